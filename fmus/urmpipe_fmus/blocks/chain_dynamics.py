"""Block of the dynamics of a robot: its motion under joint torques and a force on its tool.

    M(q) q'' + h(q, q') + g(q) - J^T F = tau    ([Iso9283]_ eq. 13)

1. `chain_to_masses`: masses, centres of mass and gravity as tunable parameters (also of `driven_arm`).
2. `tool_inputs`, `read_wrench`: force and moment on the tool (also of `driven_arm`).
3. `chain_dynamics`: the block.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import chain as chain_iterables
from typing import Any, NamedTuple

from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, State, Values
from urmpipe_fmus.blocks.coordinates import (
    KINDS,
    acceleration_outputs,
    check_robot,
    coordinate_kinds,
    coordinate_variables,
    format_joints,
    gather,
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

CHAIN_DYNAMICS_OPTIONS: Mapping[str, str] = {
    "robot": "a robot with masses: a name of the catalogue, a .toml or a .urdf file",
}


class Arm(NamedTuple):
    """A robot with values of its masses, and its moving links."""

    chain: Chain
    links: Links


class Masses(NamedTuple):
    """The masses of a robot.

    Attributes:
        parameters: Tunable; they start at the masses of the robot's description.
        arm_at: Returns the arm with the values of the parameters.
    """

    parameters: tuple[Parameter, ...]
    arm_at: Callable[[Values], Arm]


def chain_to_masses(robot: Chain) -> Masses:
    """Return the moving masses of a robot, their centres, and gravity as parameters.

    Masses that do not move and masses of 0 do not affect the motion and are left out.
    """
    first = next(k for k, joint in enumerate(robot.joints) if joint.kind != "fixed")
    carriers = {joint.name for joint in robot.joints[first:]}
    moving = tuple(inertial for inertial in robot.inertials if inertial.joint in carriers and inertial.mass)
    without_masses = replace(robot, inertials=moving, visuals=())
    centres = [f"centre{k}" for k in range(1, len(moving) + 1)]

    last: tuple[list[Any], Arm] | None = None

    def arm_at(v: Values) -> Arm:
        """Return the arm; the last one again while the values are the same objects."""
        nonlocal last
        values = [v.masses, v.gravity, *(getattr(v, name) for name in centres)]
        elements = [*chain_iterables.from_iterable(values)]
        latest = last
        if latest is None or [*map(id, elements)] != [*map(id, latest[0])]:
            inertials = (
                replace(inertial, mass=mass, centre=centre)
                for inertial, mass, centre in zip(moving, values[0], values[2:], strict=True)
            )
            chain = replace(without_masses, inertials=tuple(inertials), gravity=v.gravity)
            latest = last = elements, Arm(chain, chain_to_links(chain))
        return latest[1]

    parameters = (
        Parameter(
            name="masses",
            description="Masses on the joints " + ", ".join(str(inertial.joint) for inertial in moving),
            unit="kg",
            start=tuple(float(inertial.mass) for inertial in moving),
            minimum=MIN_CONSTANT,
            size=len(moving),
        ),
        *(
            Parameter(
                name=name,
                description=f"Centre of mass {k} in the frame of joint {inertial.joint}: x, y, z",
                unit="m",
                display_unit="mm",
                start=tuple(map(float, inertial.centre)),
                size=3,
            )
            for k, (name, inertial) in enumerate(zip(centres, moving, strict=True), start=1)
        ),
        Parameter(
            name="gravity",
            description="Acceleration of gravity in the world: x, y, z",
            unit="m/s2",
            start=tuple(map(float, robot.gravity)),
            size=3,
        ),
    )
    return Masses(parameters, arm_at)


def tool_inputs() -> Iterator[Input]:
    """Yield force and moment on the tool centre point as inputs."""
    for name, unit in (("force", "N"), ("moment", "N.m")):
        description = f"{name.capitalize()} on the tool centre point, along the axes of the world"
        yield Input(name=name, description=description, unit=unit, size=3)


def read_wrench(v: Values) -> Wrench:
    """Return force [N] and moment [N m] on the tool centre point."""
    return Wrench(v.force, v.moment)


def chain_dynamics(robot: Chain) -> BlockModel:
    """Return the block: torques of the joints and a force on the tool in; their motion out.

    Inputs are the torques `tau` of the revolute joints and the forces `f` of the prismatic ones, each from
    the base outwards; states their values `phi` and `s` with the velocities `phid` and `sd`, which start at
    rest at the start pose. Masses, centres and gravity are tunable.

    Args:
        robot: The robot, with masses.

    Raises:
        UnitError: If `robot` is no robot.
        RobotError: If it has no masses, or a joint moves none.

    Source: [Iso9283]_ eq. 13, solved for the accelerations.
    """
    check_robot("chain_dynamics", robot)
    check_solvable(robot)
    masses = chain_to_masses(robot)

    def accelerations(v: Values) -> list[Element]:
        """Return q''."""
        torques = gather(robot, v, {kind: kind.effort for kind in KINDS})
        arm, links = masses.arm_at(v)
        q, qd = read_coordinates(robot, v), read_coordinates(robot, v, "d")
        return forward_dynamics(arm, q, qd, torques, read_wrench(v), links)

    def outputs(v: Values) -> Mapping[str, Any]:
        """Return the accelerations and the energy."""
        arm, q, qd = masses.arm_at(v).chain, read_coordinates(robot, v), read_coordinates(robot, v, "d")
        energy = kinetic_energy(arm, q, qd) + potential_energy(arm, q)
        return {**scatter(robot, accelerations(v), "dd"), "energy_stored": energy}

    def derivatives(v: Values) -> Mapping[str, Any]:
        """Return the velocities, the accelerations, and the power of the force on the tool."""
        q, qd = read_coordinates(robot, v), read_coordinates(robot, v, "d")
        return {
            **scatter(robot, qd),
            **scatter(robot, accelerations(v), "d"),
            "energy_in": wrench_power(robot, q, qd, read_wrench(v)),
        }

    return BlockModel(
        name="chain_dynamics",
        description=f"Motion of {robot.name or 'an arm'} under the torques of its joints",
        variables=(
            *masses.parameters,
            *_effort_inputs(robot),
            *tool_inputs(),
            *acceleration_outputs(robot),
            Output(name="energy_stored", description="Kinetic and potential energy", unit="J"),
            *coordinate_variables(robot, State, 1, output=True),
            State(
                name="energy_in",
                description="Work of the force and moment on the tool",
                unit="J",
                output=True,
            ),
        ),
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
    """Return `chain_dynamics` of the robot in a text of `robot_toml`, equal to the bit."""
    return chain_dynamics(chain_from_dict(tomllib.loads(robot)))


def _effort_inputs(robot: Chain) -> Iterator[Input]:
    for kind in coordinate_kinds(robot):
        indices = kind.indices(robot)
        word = "Torques" if kind.effort_unit == "N.m" else "Forces"
        yield Input(
            name=kind.effort,
            description=f"{word} {format_joints(robot, indices)}",
            unit=kind.effort_unit,
            size=len(indices),
        )
