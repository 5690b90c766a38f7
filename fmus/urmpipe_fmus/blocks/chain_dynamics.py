"""What of an arm's masses can be changed while it is simulated, and what acts on its tool.

The dynamics of an arm as a unit: how it moves under torques and a force on its tool.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import chain as joined
from typing import Any, NamedTuple

from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, State, Values, Variable
from urmpipe_fmus.blocks.coordinates import (
    KINDS,
    acceleration_outputs,
    check_robot,
    coordinate_kinds,
    format_joints,
    gather,
    motion_states,
    read_coordinates,
    robot_recipe,
    scatter,
)
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import MIN_CONSTANT
from urmpipe_models.dynamics.equations import check_solvable, forward_dynamics
from urmpipe_models.dynamics.links import (
    Links,
    Wrench,
    chain_to_links,
    kinetic_energy,
    potential_energy,
    wrench_power,
)
from urmpipe_models.elementwise import Element
from urmpipe_models.robots.toml import chain_from_dict


class Arm(NamedTuple):
    """An arm of some masses.

    Attributes:
        chain: The arm.
        links: Its moving parts.
    """

    chain: Chain
    links: Links


class Masses(NamedTuple):
    """The masses of an arm.

    Attributes:
        parameters: Tunable; they start at the masses of the robot's description.
        arm_at: Returns the arm of some values of the parameters.
    """

    parameters: tuple[Parameter, ...]
    arm_at: Callable[[Values], Arm]


def chain_to_masses(robot: Chain) -> Masses:
    """Return the masses of an arm that move, their centres, and gravity as parameters.

    Masses that stand still and masses of 0 have no part in the motion and are left out.
    """
    first = next(k for k, joint in enumerate(robot.joints) if joint.kind != "fixed")
    carriers = {joint.name for joint in robot.joints[first:]}
    moving = tuple(one for one in robot.inertials if one.joint in carriers and one.mass)
    arm = replace(robot, inertials=moving, visuals=())
    centres = [f"centre{k}" for k in range(1, len(moving) + 1)]

    last: tuple[list[Any], Arm] | None = None

    def arm_at(v: Values) -> Arm:
        """Return the arm of some masses: the last one as long as they are the same objects."""
        nonlocal last
        given = [v.masses, v.gravity, *(getattr(v, name) for name in centres)]
        elements = [*joined.from_iterable(given)]
        found = last
        if found is None or [*map(id, elements)] != [*map(id, found[0])]:
            inertials = (
                replace(one, mass=mass, centre=centre)
                for one, mass, centre in zip(moving, given[0], given[2:], strict=True)
            )
            chain = replace(arm, inertials=tuple(inertials), gravity=v.gravity)
            found = last = elements, Arm(chain, chain_to_links(chain))
        return found[1]

    masses = Parameter(
        name="masses",
        description="Masses on the joints " + ", ".join(str(one.joint) for one in moving),
        unit="kg",
        start=tuple(float(one.mass) for one in moving),
        minimum=MIN_CONSTANT,
        size=len(moving),
    )
    places = (
        Parameter(
            name=name,
            description=f"Centre of mass {k} in the frame of joint {one.joint}: x, y, z",
            unit="m",
            display_unit="mm",
            start=tuple(map(float, one.centre)),
            size=3,
        )
        for k, (name, one) in enumerate(zip(centres, moving, strict=True), start=1)
    )
    gravity = Parameter(
        name="gravity",
        description="Acceleration of gravity in the world: x, y, z",
        unit="m/s2",
        start=tuple(map(float, robot.gravity)),
        size=3,
    )
    return Masses((masses, *places, gravity), arm_at)


def tool_inputs() -> tuple[Input, Input]:
    """Return what acts on the tool centre point as inputs."""
    return (
        Input(
            name="force",
            description="Force on the tool centre point, along the axes of the world",
            unit="N",
            size=3,
        ),
        Input(
            name="moment",
            description="Moment on the tool centre point, along the axes of the world",
            unit="N.m",
            size=3,
        ),
    )


def read_wrench(v: Values) -> Wrench:
    """Return what acts on the tool centre point."""
    return Wrench(v.force, v.moment)


CHAIN_DYNAMICS_OPTIONS: Mapping[str, str] = {
    "robot": "a robot with masses: a name of the catalogue, a .toml or a .urdf file",
}


def chain_dynamics(robot: Chain) -> BlockModel:
    """Return the unit: torques of the joints and a force on the tool in; their motion out.

    Inputs are the torques `tau` of the joints that turn and the forces `f` of those that slide, each from the
    base outwards; states their values `phi` and `s` with the rates `phid` and `sd`, which start at the start
    pose at rest. Masses, centres and gravity are tunable.

    Args:
        robot: The arm, with masses.

    Raises:
        UnitError: If the robot is none.
        RobotError: If it has no masses, or a joint moves none.

    Source: [Iso9283]_ eq. 13, solved for the accelerations.
    """
    check_robot("chain_dynamics", robot)
    check_solvable(robot)
    masses = chain_to_masses(robot)

    def accelerations(v: Values) -> list[Element]:
        """Return q''."""
        torques = gather(robot, v, {one: one.effort for one in KINDS})
        arm, links = masses.arm_at(v)
        return forward_dynamics(
            arm, read_coordinates(robot, v), read_coordinates(robot, v, "d"), torques, read_wrench(v), links
        )

    def outputs(v: Values) -> Mapping[str, Any]:
        """Return the accelerations and the energy."""
        arm, q, qd = masses.arm_at(v).chain, read_coordinates(robot, v), read_coordinates(robot, v, "d")
        energy = kinetic_energy(arm, q, qd) + potential_energy(arm, q)
        return {**scatter(robot, accelerations(v), "dd"), "energy_stored": energy}

    def derivatives(v: Values) -> Mapping[str, Any]:
        """Return the rates, the accelerations, and the power of the force on the tool."""
        q, qd = read_coordinates(robot, v), read_coordinates(robot, v, "d")
        return {
            **scatter(robot, qd),
            **scatter(robot, accelerations(v), "d"),
            "energy_in": wrench_power(robot, q, qd, read_wrench(v)),
        }

    return BlockModel(
        name="chain_dynamics",
        description=f"Motion of {robot.name or 'an arm'} under the torques of its joints",
        variables=(*masses.parameters, *_inputs(robot), *_outputs(robot), *_states(robot)),
        outputs=outputs,
        derivatives=derivatives,
        internal_step=5e-4,
        equations=(
            "M(q) q'' + h(q, q') + g(q) - J^T F = tau    (eq. 13; F acts on the tool from outside)",
            "M by the bodies beyond each joint, h + g - J^T F by the recursion of Newton and Euler,",
            "q'' by M = L D L^T. q: phi of joints that turn, s of joints that slide; tau: tau, f.",
        ),
        source="Simulative investigation of robot's accuracy and running speed (2005), eq. 8-13",
        recipe=robot_recipe(__name__, robot),
    )


def from_robot_toml(robot: str) -> BlockModel:
    """Return `chain_dynamics` of the arm that a text of `robot_toml` describes, bit by bit."""
    return chain_dynamics(chain_from_dict(tomllib.loads(robot)))


def _inputs(robot: Chain) -> Iterator[Input]:
    for kind in coordinate_kinds(robot):
        at = kind.indices(robot)
        word = "Torques" if kind.effort_unit == "N.m" else "Forces"
        yield Input(
            name=kind.effort,
            description=f"{word} {format_joints(robot, at)}",
            unit=kind.effort_unit,
            size=len(at),
        )
    yield from tool_inputs()


def _outputs(robot: Chain) -> Iterator[Variable]:
    yield from acceleration_outputs(robot)
    yield Output(name="energy_stored", description="Kinetic and potential energy", unit="J")


def _states(robot: Chain) -> Iterator[State]:
    yield from motion_states(robot)
    yield State(
        name="energy_in", description="Work of the force and moment on the tool", unit="J", output=True
    )
