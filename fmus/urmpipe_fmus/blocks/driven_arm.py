"""Block of a robot with masses, an elastic drive and a sampled controller on each joint.

Dynamics, drives and controllers are one function with one integrator ([Iso9283]_ eq. 13-20):

    M(q) q'' + h(q, q') + g(q) - J^T F = Mk + Ms            Ms: counterbalance springs
    Mk = k (theta1 - q) + l (omega1 - q')                   drives; I1 omega1' + Mk = i_p C i_a
    Mk = k_held (rest - q) - l_held q'                      passive joints, on a spring and a damper

1. `DriveGroup`: the drives and springs of the revolute joints as arrays of variables, and those of the
   prismatic joints, whose names end in _s.
2. `driven_arm`: the block. It starts at rest at the start pose, in equilibrium with gravity; `start_values`
   are those of an equilibrium with a force on the tool.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, State, Values, Variable
from urmpipe_fmus.blocks.chain_dynamics import Masses, chain_to_masses, read_wrench, tool_inputs
from urmpipe_fmus.blocks.coordinates import (
    CoordinateKind,
    acceleration_outputs,
    check_robot,
    coordinate_kinds,
    coordinate_variables,
    format_joints,
    read_coordinates,
    robot_recipe,
    scatter,
)
from urmpipe_fmus.blocks.drives import NO_SAMPLE
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import (
    DRIVE_KEYS,
    GAIN_KEYS,
    MIN_CONSTANT,
    MIN_PERIOD,
    NO_SPRING,
    SPRING_KEYS,
    CounterbalanceSpring,
    Drive,
    DrivenJoint,
    Gains,
    JointMotion,
    PassiveJoint,
    control_voltage,
    sample_index,
    sampled_voltage,
)
from urmpipe_models.dynamics.driven_arm import (
    Actuator,
    ArmState,
    JointEquilibrium,
    Motor,
    MotorDerivatives,
    Spring,
    arm_energy,
    find_equilibrium,
    joint_accelerations,
    max_stable_step,
    motor_derivatives,
    power_flow,
    shaft_torques,
)
from urmpipe_models.dynamics.links import Wrench
from urmpipe_models.elementwise import Element, Vector
from urmpipe_models.robots.toml import chain_from_dict

DRIVEN_ARM_OPTIONS: Mapping[str, str] = {
    "robot": "a robot with masses and drives: a .toml file with [drives.NAME]",
}

MAX_INTERNAL_STEP = 5e-4  # s

# Constants of drive and controller by their names in robot files: description and unit.
_CONSTANTS = {
    "k": ("Rigidity of the shaft", "{torque}/{way}"),
    "l": ("Damping of the shaft", "{torque}.s/{way}"),
    "i_p": ("Gear ratio: turns of the motor for one of the joint", "{ratio}"),
    "C": ("Motor constant: torque for a current, voltage for a speed", "N.m/A"),
    "R": ("Resistance of the armature", "Ohm"),
    "L": ("Inductance of the armature", "H"),
    "I1": ("Inertia of rotor and gear, reduced to the joint", "{inertia}"),
    "Kphi": ("Voltage that a sample adds for an error of position", "V/{way}"),
    "Kw": ("Voltage that a sample adds for an error of velocity", "V.s/{way}"),
    "Keps": ("Voltage that a sample adds for an error of acceleration", "V.s2/{way}"),
}


@dataclass(frozen=True, slots=True)
class DriveGroup:
    """The drives of all joints of a kind as variables, whose names end in `suffix`.

    Attributes:
        kind: The kind of the coordinates.
        robot: The robot.
        driven: By index of the coordinate, each joint with a drive, and its equilibrium.
        passive: By index of the coordinate, each joint on a spring and a damper, and its equilibrium.
    """

    kind: CoordinateKind
    robot: Chain
    driven: Mapping[int, tuple[DrivenJoint, JointEquilibrium]]
    passive: Mapping[int, tuple[PassiveJoint, JointEquilibrium]]

    @property
    def suffix(self) -> str:
        """The end of the names: "" for revolute joints, "_s" for prismatic ones."""
        return "" if self.kind.kind == "revolute" else "_s"

    @property
    def counterbalanced(self) -> bool:
        """Whether any drive has a counterbalance spring."""
        return any(joint.spring != NO_SPRING for joint, _ in self.driven.values())

    @property
    def _limit(self) -> str:
        return f"u{self.suffix}_max"

    def parameters(self) -> Iterator[Parameter]:
        """Yield the constants of the drives and the springs; the periods are fixed."""
        joints = [joint for joint, _ in self.driven.values()]
        stiffness_unit, position_unit = self._unit("{torque}/{way}"), self.kind.unit
        if joints:
            constants = zip(*((*joint.drive, *joint.gains) for joint in joints), strict=True)
            for key, values in zip((*DRIVE_KEYS, *GAIN_KEYS), constants, strict=True):
                description, unit = _CONSTANTS[key]
                minimum = -np.inf if key in GAIN_KEYS else MIN_CONSTANT
                yield self._parameter(key, description, self._unit(unit), values, minimum)
            periods, voltages = zip(*((joint.period, joint.largest_voltage) for joint in joints), strict=True)
            period = self._parameter("period", "Time between two samples", "s", periods, MIN_PERIOD)
            yield replace(period, tunable=False)
            yield replace(self._parameter("u_max", "Largest voltage", "V", voltages, 0.0), name=self._limit)
            if self.counterbalanced:
                stiffness, rests = zip(*(joint.spring for joint in joints), strict=True)
                text = "Rigidity of the spring beside the drive"  # plain: ok
                yield self._parameter(SPRING_KEYS[0], text, stiffness_unit, stiffness, 0.0)
                text = "Where the spring beside the drive gives no torque"  # plain: ok
                yield self._parameter(SPRING_KEYS[1], text, position_unit, rests, -np.inf)
        if self.passive:
            springs = (
                (joint.stiffness, joint.damping, equilibrium.rest)
                for joint, equilibrium in self.passive.values()
            )
            k, damping, rest = zip(*springs, strict=True)
            for name, description, unit, values, minimum in (
                ("k_held", "Rigidity of the spring", stiffness_unit, k, MIN_CONSTANT),
                ("l_held", "Damping of the spring", self._unit("{torque}.s/{way}"), damping, 0.0),
                ("rest", "Where the spring gives no torque", position_unit, rest, -np.inf),
            ):
                yield self._parameter(name, description, unit, values, minimum, self.passive)

    def inputs(self) -> Iterator[Input]:
        """Yield the set points."""
        kind, starts = self.kind, tuple(float(self.robot.start[k]) for k in self.driven)
        for dots, per, word in (("", "", "position"), ("d", "/s", "velocity"), ("dd", "/s2", "acceleration")):
            if starts:
                yield Input(
                    name=f"set_{kind.name}{dots}",
                    description=f"Set {word} {self._joints(self.driven)}",
                    unit=kind.unit + per,
                    display_unit=kind.display_unit + per,
                    start=0.0 if dots else starts,
                    size=len(starts),
                )

    def computed(self) -> Iterator[Output]:
        """Yield voltages and torques."""
        if self.driven:
            yield Output(
                name=f"u{self.suffix}",
                description=f"Voltages of the armatures {self._joints(self.driven)}",
                unit="V",
                size=len(self.driven),
            )
        indices = sorted((*self.driven, *self.passive))
        yield Output(
            name=f"Mk{self.suffix}",
            description=f"Torques of shafts and springs {self._joints(indices)}",
            unit=self.kind.effort_unit,
            size=len(indices),
        )

    def states(self) -> Iterator[State]:
        """Yield the states of the drives, which start in equilibrium."""
        equilibria = [equilibrium for _, equilibrium in self.driven.values()]
        angles = tuple(equilibrium.rest for equilibrium in equilibria)
        currents = tuple(equilibrium.current for equilibrium in equilibria)
        position, display = self.kind.unit, self.kind.display_unit
        for name, description, unit, display_unit, starts in (
            ("theta1", "Angles of the gears' output shafts", position, display, angles),
            ("omega1", "Rates of these shafts", f"{position}/s", f"{display}/s", (0.0,) * len(equilibria)),
            ("i_a", "Currents of the armatures", "A", "", currents),
        ):
            if equilibria:
                yield State(
                    name=f"{name}{self.suffix}",
                    description=f"{description} {self._joints(self.driven)}",
                    unit=unit,
                    display_unit=display_unit,
                    start=starts,
                    size=len(equilibria),
                    output=True,
                )

    def memories(self) -> Iterator[Memory]:
        """Yield the memories of the controllers."""
        if self.driven:
            yield Memory(
                name=f"last{self.suffix}",
                description="Voltages of the samples before",
                unit="V",
                start=tuple(equilibrium.voltage for _, equilibrium in self.driven.values()),
                size=len(self.driven),
            )
            yield Memory(
                name=f"sample{self.suffix}",
                description="Numbers of the last samples; before the first -2^53",
                start=NO_SAMPLE,
                size=len(self.driven),
            )

    def actuators(self, v: Values) -> dict[int, Actuator]:
        """Return the source of torque of each joint, with the held voltage, by index of the coordinate."""
        actuators: dict[int, Actuator] = {}
        for j, k in enumerate(self.driven):
            drive = Drive(*(self._read(v, key)[j] for key in DRIVE_KEYS))
            angle, rate, current, voltage = (
                self._read(v, name)[j] for name in ("theta1", "omega1", "i_a", "last")
            )
            spring = NO_SPRING
            if self.counterbalanced:
                spring = CounterbalanceSpring(*(self._read(v, key)[j] for key in SPRING_KEYS))
            actuators[k] = Motor(drive, angle, rate, current, voltage, spring)
        for j, k in enumerate(self.passive):
            stiffness, damping, rest = (self._read(v, key)[j] for key in ("k_held", "l_held", "rest"))
            actuators[k] = Spring(stiffness, damping, rest)
        return actuators

    def voltages(
        self, v: Values, q: Sequence[Element], qd: Sequence[Element], qdd: Sequence[Element]
    ) -> list[Element]:
        """Return the voltages from the communication point on."""
        voltages = []
        for j, k in enumerate(self.driven):
            gains = Gains(*(self._read(v, key)[j] for key in GAIN_KEYS))
            name = f"set_{self.kind.name}"
            setpoint = JointMotion(*(getattr(v, name + dots)[j] for dots in ("", "d", "dd")))
            last, period, sample = (self._read(v, key)[j] for key in ("last", "period", "sample"))
            limit = getattr(v, self._limit)[j]
            fresh = control_voltage(last, gains, setpoint, JointMotion(q[k], qd[k], qdd[k]), limit)
            voltages.append(sampled_voltage(v.time, period, sample, fresh, last))
        return voltages

    def outputs(self, state: ArmState, voltages: Sequence[Element]) -> dict[str, tuple[Element, ...]]:
        """Return voltages and torques by variable."""
        torques = shaft_torques(state)
        of_joints = {f"Mk{self.suffix}": tuple(torques[k] for k in sorted((*self.driven, *self.passive)))}
        return of_joints | ({f"u{self.suffix}": tuple(voltages)} if self.driven else {})

    def derivatives(self, rates: Mapping[int, MotorDerivatives]) -> dict[str, tuple[Element, ...]]:
        """Return the derivatives of the states by variable, from those by index of the coordinate."""
        motors = [rates[k] for k in self.driven]
        names = ("theta1", "omega1", "i_a") if motors else ()
        return {f"{name}{self.suffix}": tuple(motor[i] for motor in motors) for i, name in enumerate(names)}

    def samples(self, v: Values, voltages: Sequence[Element]) -> dict[str, tuple[Element, ...]]:
        """Return the next values of the memories by variable."""
        if not self.driven:
            return {}
        numbers = (
            np.maximum(sample, sample_index(v.time, period))
            for sample, period in zip(self._read(v, "sample"), self._read(v, "period"), strict=True)
        )
        return {f"last{self.suffix}": tuple(voltages), f"sample{self.suffix}": tuple(numbers)}

    def _read(self, v: Values, name: str) -> tuple[Element, ...]:
        elements: tuple[Element, ...] = getattr(v, name + self.suffix)
        return elements

    def _parameter(
        self,
        name: str,
        description: str,
        unit: str,
        start: Sequence[float],
        minimum: float,
        indices: Iterable[int] | None = None,
    ) -> Parameter:
        """Return a tunable parameter of joints, by default the driven ones."""
        return Parameter(
            name=name + self.suffix,
            description=f"{description} {self._joints(self.driven if indices is None else indices)}",
            unit=unit,
            start=tuple(map(float, start)),
            minimum=minimum,
            size=len(start),
        )

    def _unit(self, template: str) -> str:
        is_revolute = self.kind.kind == "revolute"
        return template.format(
            torque=self.kind.effort_unit,
            way=self.kind.unit,
            ratio="" if is_revolute else "rad/m",
            inertia="kg.m2" if is_revolute else "kg",
        )

    def _joints(self, indices: Iterable[int]) -> str:
        return format_joints(self.robot, indices)


def drive_groups(robot: Chain, equilibria: Sequence[JointEquilibrium]) -> list[DriveGroup]:
    """Return the drives and springs of a robot by kind of joint.

    Args:
        robot: The robot, with one of `drives` for every coordinate.
        equilibria: The equilibrium of each joint, in the order of the coordinates.
    """
    drives = {drive.joint: drive for drive in robot.drives}
    groups = []
    for kind in coordinate_kinds(robot):
        driven: dict[int, tuple[DrivenJoint, JointEquilibrium]] = {}
        passive: dict[int, tuple[PassiveJoint, JointEquilibrium]] = {}
        for k in kind.indices(robot):
            drive = drives[robot.coordinates[k]]
            if isinstance(drive, DrivenJoint):
                driven[k] = drive, equilibria[k]
            else:
                passive[k] = drive, equilibria[k]
        groups.append(DriveGroup(kind, robot, driven, passive))
    return groups


def driven_arm(robot: Chain) -> BlockModel:
    """Return the block: set points of the driven joints and a force on the tool in; the arm's motion out.

    Nothing is held between dynamics, drives and controllers but the voltage between two samples. The arm
    starts at rest at the robot's start pose, in equilibrium with gravity: shafts twisted, currents and
    voltages set. A joint with `{ k, l }` alone is passive, on a spring and a damper. A spring parallel to a
    drive may carry a part of its load. The controllers measure the driven side, and sample as
    `drive_controller` does.

    Args:
        robot: The robot, with masses and a drive or a spring for every joint.

    Raises:
        UnitError: If `robot` is no robot.
        RobotError: If it has no masses, a joint has neither drive nor spring, or a voltage cannot hold it.

    Source: [Iso9283]_ eq. 13-20, eq. 20 with the corrected sign.
    """
    check_robot("driven_arm", robot)
    arm = _DrivenArm(robot, chain_to_masses(robot), drive_groups(robot, find_equilibrium(robot)))
    return BlockModel(
        name="driven_arm",
        description=f"{robot.name or 'An arm'} with its drives and controllers",
        variables=tuple(arm.variables()),
        outputs=arm.outputs,
        derivatives=arm.derivatives,
        update=arm.update if any(group.driven for group in arm.groups) else None,
        internal_step=min(MAX_INTERNAL_STEP, 0.5 * max_stable_step(robot)),
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
        recipe=robot_recipe(__name__, robot),
    )


@dataclass(frozen=True, slots=True)
class _DrivenArm:
    """The variables and functions of the block."""

    robot: Chain
    masses: Masses
    groups: Sequence[DriveGroup]

    def variables(self) -> Iterator[Variable]:
        yield from self.masses.parameters
        for group in self.groups:
            yield from (*group.parameters(), *group.inputs())
        yield from (*tool_inputs(), *acceleration_outputs(self.robot))
        for group in self.groups:
            yield from group.computed()
        yield Output(name="energy_stored", description="Energy of arm, drives, shafts and springs", unit="J")
        yield from coordinate_variables(self.robot, State, 1, output=True)
        for group in self.groups:
            yield from (*group.states(), *group.memories())
        yield State(name="energy_in", description="Work of voltages and tool force", unit="J", output=True)
        yield State(
            name="energy_lost", description="Heat of armatures, shafts and dampers", unit="J", output=True
        )

    def outputs(self, v: Values) -> Mapping[str, Any]:
        """Return accelerations, voltages, torques of shafts and springs, and the energy."""
        results: dict[str, Any] = dict(scatter(self.robot, self._accelerations(v), "dd"))
        for group in self.groups:
            results |= group.outputs(self._state(v), self._voltages(group, v))
        return {**results, "energy_stored": arm_energy(self.masses.arm_at(v).chain, self._state(v))}

    def derivatives(self, v: Values) -> Mapping[str, Any]:
        """Return the derivatives of coordinates, drives and energies."""
        state = self._state(v)
        results: dict[str, Any] = dict(scatter(self.robot, state.qd))
        results |= scatter(self.robot, self._accelerations(v), "d")
        for group in self.groups:
            results |= group.derivatives(motor_derivatives(state))
        flows = power_flow(self.robot, state, read_wrench(v))
        return {**results, "energy_in": flows.supplied, "energy_lost": flows.dissipated}

    def update(self, v: Values) -> Mapping[str, Any]:
        """Return voltages and indices of the samples that are due."""
        results: dict[str, Any] = {}
        for group in self.groups:
            results |= group.samples(v, self._voltages(group, v))
        return results

    def _state(self, v: Values) -> ArmState:
        """Return the arm with the held voltages."""
        actuators: dict[int, Actuator] = {}
        for group in self.groups:
            actuators |= group.actuators(v)
        q = read_coordinates(self.robot, v)
        return ArmState(q, read_coordinates(self.robot, v, "d"), [actuators[k] for k in range(len(q))])

    def _accelerations(self, v: Values) -> list[Element]:
        """Return q'', which does not depend on the present voltages."""
        chain, links = self.masses.arm_at(v)
        return joint_accelerations(chain, self._state(v), read_wrench(v), links)

    def _voltages(self, group: DriveGroup, v: Values) -> list[Element]:
        state = self._state(v)
        return group.voltages(v, state.q, state.qd, self._accelerations(v))


def from_robot_toml(robot: str) -> BlockModel:
    """Return `driven_arm` of the robot in a text of `robot_toml`, equal to the bit."""
    return driven_arm(chain_from_dict(tomllib.loads(robot)))


def start_values(robot: Chain, force: Vector) -> dict[str, tuple[Element, ...]]:
    """Return start values of `driven_arm` by name: in equilibrium with a force on the tool.

    Passive joints have yielded to the force; driven joints are at the start pose.

    Args:
        robot: The robot, with masses and a drive or a spring for every joint.
        force: In [N], along the axes of the world.

    Raises:
        RobotError: If a voltage cannot hold the arm so, or the springs cannot.
    """
    equilibria = find_equilibrium(robot, Wrench(force))
    starts: dict[str, tuple[Element, ...]] = {"force": force, "moment": (0.0, 0.0, 0.0)}
    for group in drive_groups(robot, equilibria):
        starts |= {variable.name: variable.starts for variable in (*group.states(), *group.memories())}
        starts[group.kind.name] = tuple(equilibria[k].q for k in group.kind.indices(robot))
    return starts
