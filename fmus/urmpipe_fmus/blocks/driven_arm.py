"""The drives of an arm as variables: arrays over its driven and over its held joints, by kind of joint.

An arm with a flexible drive and a sampled controller on each joint, as one unit.
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
    format_joints,
    motion_states,
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
"""The constants of drive and controller, by the names of robot files: description and unit."""


@dataclass(frozen=True, slots=True)
class DriveGroup:
    """The drives of all joints of a kind: their variables have names that end in `suffix`.

    Attributes:
        kind: Of the joints.
        robot: The arm.
        driven: By index of the coordinate, each joint with a drive and what holds it at rest.
        passive: By index of the coordinate, each joint with a spring and what holds it at rest.
    """

    kind: CoordinateKind
    robot: Chain
    driven: Mapping[int, tuple[DrivenJoint, JointEquilibrium]]
    passive: Mapping[int, tuple[PassiveJoint, JointEquilibrium]]

    @property
    def suffix(self) -> str:
        """Nothing for joints that turn, "_s" for those that slide."""
        return "" if self.kind.kind == "revolute" else "_s"

    @property
    def counterbalanced(self) -> bool:
        """Whether a spring relieves any of the drives."""
        return any(one.spring != NO_SPRING for one, _ in self.driven.values())

    @property
    def _limit(self) -> str:
        """Name of the voltage limit: u_max, u_s_max."""
        return f"u{self.suffix}_max"

    def parameters(self) -> Iterator[Parameter]:
        """Yield the constants of the drives and the springs; the periods are fixed."""
        joints = [one for one, _ in self.driven.values()]
        if joints:
            constants = zip(*((*one.drive, *one.gains) for one in joints), strict=True)
            for key, values in zip((*DRIVE_KEYS, *GAIN_KEYS), constants, strict=True):
                description, unit = _CONSTANTS[key]
                least = -np.inf if key in GAIN_KEYS else MIN_CONSTANT
                yield self._parameter(key, description, self._unit(unit), values, least)
            periods, largest = zip(*((one.period, one.largest_voltage) for one in joints), strict=True)
            period = self._parameter("period", "Time between two samples", "s", periods, MIN_PERIOD)
            yield replace(period, tunable=False)
            yield replace(self._parameter("u_max", "Largest voltage", "V", largest, 0.0), name=self._limit)
            if self.counterbalanced:
                stiffness, rests = zip(*(one.spring for one in joints), strict=True)
                described = "Rigidity of the spring beside the drive"
                form = self._unit("{torque}/{way}")
                yield self._parameter(SPRING_KEYS[0], described, form, stiffness, 0.0)
                described = "Where the spring beside the drive gives no torque"
                yield self._parameter(SPRING_KEYS[1], described, self.kind.unit, rests, -np.inf)
        if self.passive:
            springs = ((one.stiffness, one.damping, rest.rest) for one, rest in self.passive.values())
            k, l_held, rest = zip(*springs, strict=True)
            for name, description, unit, values, least in (
                ("k_held", "Rigidity of the spring", self._unit("{torque}/{way}"), k, MIN_CONSTANT),
                ("l_held", "Damping of the spring", self._unit("{torque}.s/{way}"), l_held, 0.0),
                ("rest", "Where the spring gives no torque", self.kind.unit, rest, -np.inf),
            ):
                yield self._parameter(name, description, unit, values, least, self.passive)

    def inputs(self) -> Iterator[Input]:
        """Yield the set points."""
        kind, starts = self.kind, tuple(float(self.robot.start[k]) for k in self.driven)
        for dots, per, word in (("", "", "position"), ("d", "/s", "velocity"), ("dd", "/s2", "acceleration")):
            if starts:
                yield Input(
                    name=f"set_{kind.name}{dots}",
                    description=f"Set {word} {self._of(self.driven)}",
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
                description=f"Voltages of the armatures {self._of(self.driven)}",
                unit="V",
                size=len(self.driven),
            )
        every = sorted((*self.driven, *self.passive))
        yield Output(
            name=f"Mk{self.suffix}",
            description=f"Torques of shafts and springs {self._of(every)}",
            unit=self.kind.effort_unit,
            size=len(every),
        )

    def states(self) -> Iterator[State]:
        """Yield the states of the drives, which start where they hold the arm."""
        rests = [one for _, one in self.driven.values()]
        way, seen = self.kind.unit, self.kind.display_unit
        for name, description, unit, display_unit, start in (
            ("theta1", "Angles of the gears' output shafts", way, seen, [one.rest for one in rests]),
            ("omega1", "Rates of these shafts", f"{way}/s", f"{seen}/s", [0.0 for _ in rests]),
            ("i_a", "Currents of the armatures", "A", "", [one.current for one in rests]),
        ):
            if rests:
                yield State(
                    name=f"{name}{self.suffix}",
                    description=f"{description} {self._of(self.driven)}",
                    unit=unit,
                    display_unit=display_unit,
                    start=tuple(start),
                    size=len(rests),
                    output=True,
                )

    def memories(self) -> Iterator[Memory]:
        """Yield what the controllers remember."""
        rests = [one for _, one in self.driven.values()]
        if rests:
            yield Memory(
                name=f"last{self.suffix}",
                description="Voltages of the samples before",
                unit="V",
                start=tuple(one.voltage for one in rests),
                size=len(rests),
            )
            yield Memory(
                name=f"sample{self.suffix}",
                description="Numbers of the last samples; before the first -2^53",
                start=NO_SAMPLE,
                size=len(rests),
            )

    def actuators(self, v: Values) -> dict[int, Actuator]:
        """Return what gives each joint its torque, with the held voltage, by index of the coordinate."""
        found: dict[int, Actuator] = {}
        for j, k in enumerate(self.driven):
            drive = Drive(*(self._read(v, key)[j] for key in DRIVE_KEYS))
            angle, rate, current, voltage = (
                self._read(v, name)[j] for name in ("theta1", "omega1", "i_a", "last")
            )
            spring = NO_SPRING
            if self.counterbalanced:
                spring = CounterbalanceSpring(*(self._read(v, key)[j] for key in SPRING_KEYS))
            found[k] = Motor(drive, angle, rate, current, voltage, spring)
        for j, k in enumerate(self.passive):
            stiffness, damping, rest = (self._read(v, key)[j] for key in ("k_held", "l_held", "rest"))
            found[k] = Spring(stiffness, damping, rest)
        return found

    def voltages(
        self, v: Values, q: Sequence[Element], qd: Sequence[Element], qdd: Sequence[Element]
    ) -> list[Element]:
        """Return the voltages from the communication point on."""
        found = []
        for j, k in enumerate(self.driven):
            gains = Gains(*(self._read(v, key)[j] for key in GAIN_KEYS))
            name = f"set_{self.kind.name}"
            wanted = JointMotion(*(getattr(v, name + dots)[j] for dots in ("", "d", "dd")))
            last, period, sample = (self._read(v, key)[j] for key in ("last", "period", "sample"))
            limit = getattr(v, self._limit)[j]
            fresh = control_voltage(last, gains, wanted, JointMotion(q[k], qd[k], qdd[k]), limit)
            found.append(sampled_voltage(v.time, period, sample, fresh, last))
        return found

    def outputs(self, state: ArmState, voltages: Sequence[Element]) -> dict[str, tuple[Element, ...]]:
        """Return voltages and torques."""
        torques = shaft_torques(state)
        found = {f"Mk{self.suffix}": tuple(torques[k] for k in sorted((*self.driven, *self.passive)))}
        return found | ({f"u{self.suffix}": tuple(voltages)} if self.driven else {})

    def derivatives(self, rates: Mapping[int, MotorDerivatives]) -> dict[str, tuple[Element, ...]]:
        """Return how the states of the drives change, of the rates by index of the coordinate."""
        own = [rates[k] for k in self.driven]
        names = ("theta1", "omega1", "i_a") if own else ()
        return {f"{name}{self.suffix}": tuple(one[place] for one in own) for place, name in enumerate(names)}

    def samples(self, v: Values, voltages: Sequence[Element]) -> dict[str, tuple[Element, ...]]:
        """Return what the controllers remember from the communication point on."""
        if not self.driven:
            return {}
        numbers = (
            np.maximum(sample, sample_index(v.time, period))
            for sample, period in zip(self._read(v, "sample"), self._read(v, "period"), strict=True)
        )
        return {f"last{self.suffix}": tuple(voltages), f"sample{self.suffix}": tuple(numbers)}

    def _read(self, v: Values, name: str) -> tuple[Element, ...]:
        found: tuple[Element, ...] = getattr(v, name + self.suffix)
        return found

    def _parameter(
        self,
        name: str,
        description: str,
        unit: str,
        start: Sequence[float],
        minimum: float,
        joints: Iterable[int] | None = None,
    ) -> Parameter:
        """Return a tunable parameter of some joints, of the driven ones by default."""
        return Parameter(
            name=name + self.suffix,
            description=f"{description} {self._of(self.driven if joints is None else joints)}",
            unit=unit,
            start=tuple(map(float, start)),
            minimum=minimum,
            size=len(start),
        )

    def _unit(self, form: str) -> str:
        turns = self.kind.kind == "revolute"
        return form.format(
            torque=self.kind.effort_unit,
            way=self.kind.unit,
            ratio="" if turns else "rad/m",
            inertia="kg.m2" if turns else "kg",
        )

    def _of(self, indices: Iterable[int]) -> str:
        return format_joints(self.robot, indices)


def drive_groups(robot: Chain, rests: Sequence[JointEquilibrium]) -> list[DriveGroup]:
    """Return the drives and springs of an arm by kind of joint.

    Args:
        robot: The arm, with one of `drives` for every coordinate.
        rests: What holds it at rest, in the order of its coordinates.
    """
    by_joint = {one.joint: one for one in robot.drives}
    found = []
    for kind in coordinate_kinds(robot):
        driven: dict[int, tuple[DrivenJoint, JointEquilibrium]] = {}
        held: dict[int, tuple[PassiveJoint, JointEquilibrium]] = {}
        for k in kind.indices(robot):
            own = by_joint[robot.coordinates[k]]
            if isinstance(own, DrivenJoint):
                driven[k] = own, rests[k]
            else:
                held[k] = own, rests[k]
        found.append(DriveGroup(kind, robot, driven, held))
    return found


DRIVEN_ARM_OPTIONS: Mapping[str, str] = {
    "robot": "a robot with masses and drives: a .toml file with [drives.NAME]",
}


MAX_INTERNAL_STEP = 5e-4
"""The longest step of the integrator in [s]."""


def driven_arm(robot: Chain) -> BlockModel:
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
    check_robot("driven_arm", robot)
    model = _Model(robot, chain_to_masses(robot), drive_groups(robot, find_equilibrium(robot)))
    return BlockModel(
        name="driven_arm",
        description=f"{robot.name or 'An arm'} with its drives and controllers",
        variables=tuple(model.variables()),
        outputs=model.outputs,
        derivatives=model.derivatives,
        update=model.update if any(group.driven for group in model.groups) else None,
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
        found: dict[str, Any] = dict(scatter(self.robot, self._accelerations(v), "dd"))
        for group in self.groups:
            found |= group.outputs(self._state(v), self._voltages(group, v))
        return {**found, "energy_stored": arm_energy(self.masses.arm_at(v).chain, self._state(v))}

    def derivatives(self, v: Values) -> Mapping[str, Any]:
        """Return how the states change."""
        state = self._state(v)
        found: dict[str, Any] = dict(scatter(self.robot, state.qd))
        found |= scatter(self.robot, self._accelerations(v), "d")
        for group in self.groups:
            found |= group.derivatives(motor_derivatives(state))
        flows = power_flow(self.robot, state, read_wrench(v))
        return {**found, "energy_in": flows.supplied, "energy_lost": flows.dissipated}

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
        q = read_coordinates(self.robot, v)
        return ArmState(q, read_coordinates(self.robot, v, "d"), [actuators[k] for k in range(len(q))])

    def _accelerations(self, v: Values) -> list[Element]:
        """Return q''; no voltage goes into them at once."""
        chain, links = self.masses.arm_at(v)
        return joint_accelerations(chain, self._state(v), read_wrench(v), links)

    def _voltages(self, group: DriveGroup, v: Values) -> list[Element]:
        """Return the voltages of a group from the communication point on."""
        state = self._state(v)
        return group.voltages(v, state.q, state.qd, self._accelerations(v))


def from_robot_toml(robot: str) -> BlockModel:
    """Return `driven_arm` of the arm that a text of `robot_toml` describes, bit by bit."""
    return driven_arm(chain_from_dict(tomllib.loads(robot)))


def start_values(robot: Chain, force: Vector) -> dict[str, tuple[Element, ...]]:
    """Return start values of `driven_arm` by name: at rest at the start pose, a force on the tool.

    What a spring holds has yielded to the force; the drives hold their joints where they were.

    Args:
        robot: The arm, with masses and a drive or a spring for every joint.
        force: In [N], along the axes of the world.

    Raises:
        RobotError: If a voltage cannot hold the arm so, or the springs cannot.
    """
    rests = find_equilibrium(robot, Wrench(force))
    found: dict[str, tuple[Element, ...]] = {"force": force, "moment": (0.0, 0.0, 0.0)}
    for group in drive_groups(robot, rests):
        found |= {one.name: one.starts for one in (*group.states(), *group.memories())}
        found[group.kind.name] = tuple(rests[k].q for k in group.kind.indices(robot))
    return found
