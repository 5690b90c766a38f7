"""An arm with a flexible drive and a sampled controller on each joint, as one unit."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from urmpipe_fmus.unit import Unit
from urmpipe_fmus.units.chain_masses import Masses, masses_of, tool_inputs, wrench_at
from urmpipe_fmus.units.coordinates import (
    acceleration_outputs,
    arm_recipe,
    motion_states,
    scattered,
    values_of,
)
from urmpipe_fmus.units.drive_variables import DriveGroup, drive_groups
from urmpipe_fmus.units.options import an_arm
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Output, State, Variable
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.driven_arm import (
    Actuator,
    ArmState,
    arm_energy,
    at_rest,
    joint_accelerations,
    motor_rates,
    powers,
    stable_step,
)
from urmpipe_models.dynamics.links import Wrench
from urmpipe_models.elementwise import Element, Vector
from urmpipe_models.robots.toml import chain_from_dict

OPTIONS: Mapping[str, str] = {
    "robot": "a robot with masses and drives: a .toml file with [drives.NAME]",
}


LONGEST_STEP = 5e-4
"""The longest step of the integrator in [s]."""


def driven_arm(robot: Chain) -> Unit:
    """Return the unit: set points of the driven joints and a force on the tool in; the arm's motion out.

    Dynamics of the arm, drives and controllers are one function with one integrator: nothing is held between
    them but the voltage between two samples. It starts at rest at the robot's start pose, held against
    gravity: shafts twisted, currents and voltages set. A joint with `{ k, l }` alone is held by a spring and
    a damper. A spring beside a drive may carry a part of its load. The controllers measure the driven side,
    and sample as `drive_controller` does.

    Args:
        robot: The arm, with masses and a drive or a spring for every joint.

    Raises:
        UnitError: If the robot is none.
        RobotError: If it has no masses, a joint has neither drive nor spring, or a voltage cannot hold it.

    Source: [Iso9283]_ eq. 13-20, eq. 20 with the corrected sign.
    """
    an_arm("driven_arm", robot)
    model = _Model(robot, masses_of(robot), drive_groups(robot, at_rest(robot)))
    return Unit(
        name="driven_arm",
        description=f"{robot.name or 'An arm'} with its drives and controllers",
        variables=tuple(model.variables()),
        outputs=model.outputs,
        derivatives=model.derivatives,
        update=model.update if any(group.driven for group in model.groups) else None,
        internal_step=min(LONGEST_STEP, 0.5 * stable_step(robot)),
        equations=(
            "M(q) q'' + h(q, q') + g(q) - J^T F = Mk + Ms    (eq. 13, 19; F acts on the tool from outside)",
            "Mk = k (theta1 - q) + l (omega1 - q')    (eq. 14); held: Mk = k_held (rest - q) - l_held q'",
            "Ms = k_spring (rest_spring - q)    (where a spring relieves a drive; else Ms = 0)",
            "I1 omega1' + Mk = i_p C i_a    (eq. 15-17), u = C i_p omega1 + R i_a + L i_a'    (eq. 18)",
            "u_n = u_n-1 + Kphi (set_phi - phi) + Kw (set_phid - phid) + Keps (set_phidd - phidd),",
            "      within -u_max .. u_max, at t = n period    (eq. 20, which prints a minus)",
            "energy_stored' = energy_in' - energy_lost'",
        ),
        source="Simulative investigation of robot's accuracy and running speed (2005), eq. 8-20",
        recipe=arm_recipe(__name__, robot),
    )


@dataclass(frozen=True, slots=True)
class _Model:
    """The functions of the unit.

    Attributes:
        robot: The arm.
        masses: Its masses as parameters.
        groups: Its drives and springs as variables.
    """

    robot: Chain
    masses: Masses
    groups: Sequence[DriveGroup]

    def variables(self) -> Iterator[Variable]:
        """Yield the variables of the unit."""
        yield from self.masses.parameters
        for group in self.groups:
            yield from (*group.parameters(), *group.inputs())
        yield from (*tool_inputs(), *acceleration_outputs(self.robot))
        for group in self.groups:
            yield from group.computed()
        yield Output(name="energy_stored", description="Energy of arm, drives, shafts and springs", unit="J")
        yield from motion_states(self.robot)
        for group in self.groups:
            yield from (*group.states(), *group.memories())
        yield State(name="energy_in", description="Work of voltages and tool force", unit="J", output=True)
        yield State(
            name="energy_lost", description="Heat of armatures, shafts and dampers", unit="J", output=True
        )

    def outputs(self, v: Values) -> Mapping[str, Any]:
        """Return accelerations, voltages, torques of shafts and springs, and the energy."""
        found: dict[str, Any] = dict(scattered(self.robot, self._accelerations(v), "dd"))
        for group in self.groups:
            found |= group.outputs(self._state(v), self._voltages(group, v))
        return {**found, "energy_stored": arm_energy(self.masses.arm_at(v).chain, self._state(v))}

    def derivatives(self, v: Values) -> Mapping[str, Any]:
        """Return how the states change."""
        state = self._state(v)
        found: dict[str, Any] = dict(scattered(self.robot, state.qd))
        found |= scattered(self.robot, self._accelerations(v), "d")
        for group in self.groups:
            found |= group.derivatives(motor_rates(state))
        flows = powers(self.robot, state, wrench_at(v))
        return {**found, "energy_in": flows.given, "energy_lost": flows.lost}

    def update(self, v: Values) -> Mapping[str, Any]:
        """Take the samples that are due."""
        found: dict[str, Any] = {}
        for group in self.groups:
            found |= group.samples(v, self._voltages(group, v))
        return found

    def _state(self, v: Values) -> ArmState:
        """Return the arm with the held voltages."""
        actuators: dict[int, Actuator] = {}
        for group in self.groups:
            actuators |= group.actuators(v)
        q = values_of(self.robot, v)
        return ArmState(q, values_of(self.robot, v, "d"), [actuators[k] for k in range(len(q))])

    def _accelerations(self, v: Values) -> list[Element]:
        """Return q''; no voltage goes into them at once."""
        chain, links = self.masses.arm_at(v)
        return joint_accelerations(chain, self._state(v), wrench_at(v), links)

    def _voltages(self, group: DriveGroup, v: Values) -> list[Element]:
        """Return the voltages of a group from the communication point on."""
        state = self._state(v)
        return group.voltages(v, state.q, state.qd, self._accelerations(v))


def from_robot_toml(robot: str) -> Unit:
    """Return `driven_arm` of the arm that a text of `robot_toml` describes, bit by bit."""
    return driven_arm(chain_from_dict(tomllib.loads(robot)))


def starts_under(robot: Chain, force: Vector) -> dict[str, tuple[Element, ...]]:
    """Return start values of `driven_arm` by name: at rest at the start pose, a force on the tool.

    What a spring holds has yielded to the force; the drives hold their joints where they were.

    Args:
        robot: The arm, with masses and a drive or a spring for every joint.
        force: In [N], along the axes of the world.

    Raises:
        RobotError: If a voltage cannot hold the arm so, or the springs cannot.
    """
    rests = at_rest(robot, Wrench(force))
    found: dict[str, tuple[Element, ...]] = {"force": force, "moment": (0.0, 0.0, 0.0)}
    for group in drive_groups(robot, rests):
        found |= {one.name: one.starts for one in (*group.states(), *group.memories())}
        found[group.kind.name] = tuple(rests[k].q for k in group.kind.of(robot))
    return found
