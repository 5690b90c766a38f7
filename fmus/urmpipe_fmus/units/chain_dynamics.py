"""The dynamics of an arm as a unit: how it moves under torques and a force on its tool."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from urmpipe_fmus.unit import Unit
from urmpipe_fmus.units.chain_masses import masses_of, tool_inputs, wrench_at
from urmpipe_fmus.units.coordinates import (
    KINDS,
    acceleration_outputs,
    arm_recipe,
    gathered,
    kinds_of,
    motion_states,
    of_joints,
    scattered,
    values_of,
)
from urmpipe_fmus.units.options import an_arm
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Output, State, Variable
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import check_motion, forward_dynamics
from urmpipe_models.dynamics.links import kinetic_energy, potential_energy, wrench_power
from urmpipe_models.elementwise import Element
from urmpipe_models.robots.toml import chain_from_dict

OPTIONS: Mapping[str, str] = {
    "robot": "a robot with masses: a name of the catalogue, a .toml or a .urdf file",
}


def chain_dynamics(robot: Chain) -> Unit:
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
    an_arm("chain_dynamics", robot)
    check_motion(robot)
    masses = masses_of(robot)

    def accelerations(v: Values) -> list[Element]:
        """Return q''."""
        torques = gathered(robot, v, {one: one.effort for one in KINDS})
        arm, links = masses.arm_at(v)
        return forward_dynamics(
            arm, values_of(robot, v), values_of(robot, v, "d"), torques, wrench_at(v), links
        )

    def outputs(v: Values) -> Mapping[str, Any]:
        """Return the accelerations and the energy."""
        arm, q, qd = masses.arm_at(v).chain, values_of(robot, v), values_of(robot, v, "d")
        energy = kinetic_energy(arm, q, qd) + potential_energy(arm, q)
        return {**scattered(robot, accelerations(v), "dd"), "energy_stored": energy}

    def derivatives(v: Values) -> Mapping[str, Any]:
        """Return the rates, the accelerations, and the power of the force on the tool."""
        q, qd = values_of(robot, v), values_of(robot, v, "d")
        return {
            **scattered(robot, qd),
            **scattered(robot, accelerations(v), "d"),
            "energy_in": wrench_power(robot, q, qd, wrench_at(v)),
        }

    return Unit(
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
        recipe=arm_recipe(__name__, robot),
    )


def from_robot_toml(robot: str) -> Unit:
    """Return `chain_dynamics` of the arm that a text of `robot_toml` describes, bit by bit."""
    return chain_dynamics(chain_from_dict(tomllib.loads(robot)))


def _inputs(robot: Chain) -> Iterator[Input]:
    for kind in kinds_of(robot):
        at = kind.of(robot)
        word = "Torques" if kind.effort_unit == "N.m" else "Forces"
        yield Input(
            name=kind.effort,
            description=f"{word} {of_joints(robot, at)}",
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
