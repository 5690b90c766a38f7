"""The drives of an arm as variables: arrays over its driven and over its held joints, by kind of joint."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_fmus.units.coordinates import CoordinateKind, kinds_of, of_joints
from urmpipe_fmus.units.drive_controller import NO_SAMPLE
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Memory, Output, Parameter, State
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import (
    DRIVE_KEYS,
    GAIN_KEYS,
    NO_SPRING,
    SHORTEST_PERIOD,
    SMALLEST,
    SPRING_KEYS,
    Drive,
    DrivenJoint,
    Gains,
    HeldJoint,
    JointMotion,
    ReliefSpring,
    next_voltage,
    sample_number,
    voltage_at,
)
from urmpipe_models.dynamics.driven_arm import (
    Actuator,
    ArmState,
    Motor,
    MotorRates,
    Rest,
    Spring,
    shaft_torques,
)
from urmpipe_models.elementwise import Element

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
        held: By index of the coordinate, each joint with a spring and what holds it at rest.
    """

    kind: CoordinateKind
    robot: Chain
    driven: Mapping[int, tuple[DrivenJoint, Rest]]
    held: Mapping[int, tuple[HeldJoint, Rest]]

    @property
    def suffix(self) -> str:
        """Nothing for joints that turn, "_s" for those that slide."""
        return "" if self.kind.kind == "revolute" else "_s"

    @property
    def relieved(self) -> bool:
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
                least = -np.inf if key in GAIN_KEYS else SMALLEST
                yield self._parameter(key, description, self._unit(unit), values, least)
            periods, largest = zip(*((one.period, one.largest_voltage) for one in joints), strict=True)
            period = self._parameter("period", "Time between two samples", "s", periods, SHORTEST_PERIOD)
            yield replace(period, tunable=False)
            yield replace(self._parameter("u_max", "Largest voltage", "V", largest, 0.0), name=self._limit)
            if self.relieved:
                stiffness, rests = zip(*(one.spring for one in joints), strict=True)
                described = "Rigidity of the spring beside the drive"
                form = self._unit("{torque}/{way}")
                yield self._parameter(SPRING_KEYS[0], described, form, stiffness, 0.0)
                described = "Where the spring beside the drive gives no torque"
                yield self._parameter(SPRING_KEYS[1], described, self.kind.unit, rests, -np.inf)
        if self.held:
            springs = ((one.stiffness, one.damping, rest.rest) for one, rest in self.held.values())
            k, l_held, rest = zip(*springs, strict=True)
            for name, description, unit, values, least in (
                ("k_held", "Rigidity of the spring", self._unit("{torque}/{way}"), k, SMALLEST),
                ("l_held", "Damping of the spring", self._unit("{torque}.s/{way}"), l_held, 0.0),
                ("rest", "Where the spring gives no torque", self.kind.unit, rest, -np.inf),
            ):
                yield self._parameter(name, description, unit, values, least, self.held)

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
        every = sorted((*self.driven, *self.held))
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
            if self.relieved:
                spring = ReliefSpring(*(self._read(v, key)[j] for key in SPRING_KEYS))
            found[k] = Motor(drive, angle, rate, current, voltage, spring)
        for j, k in enumerate(self.held):
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
            fresh = next_voltage(last, gains, wanted, JointMotion(q[k], qd[k], qdd[k]), limit)
            found.append(voltage_at(v.time, period, sample, fresh, last))
        return found

    def outputs(self, state: ArmState, voltages: Sequence[Element]) -> dict[str, tuple[Element, ...]]:
        """Return voltages and torques."""
        torques = shaft_torques(state)
        found = {f"Mk{self.suffix}": tuple(torques[k] for k in sorted((*self.driven, *self.held)))}
        return found | ({f"u{self.suffix}": tuple(voltages)} if self.driven else {})

    def derivatives(self, rates: Mapping[int, MotorRates]) -> dict[str, tuple[Element, ...]]:
        """Return how the states of the drives change, of the rates by index of the coordinate."""
        own = [rates[k] for k in self.driven]
        names = ("theta1", "omega1", "i_a") if own else ()
        return {f"{name}{self.suffix}": tuple(one[place] for one in own) for place, name in enumerate(names)}

    def samples(self, v: Values, voltages: Sequence[Element]) -> dict[str, tuple[Element, ...]]:
        """Return what the controllers remember from the communication point on."""
        if not self.driven:
            return {}
        numbers = (
            np.maximum(sample, sample_number(v.time, period))
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
        return of_joints(self.robot, indices)


def drive_groups(robot: Chain, rests: Sequence[Rest]) -> list[DriveGroup]:
    """Return the drives and springs of an arm by kind of joint.

    Args:
        robot: The arm, with one of `drives` for every coordinate.
        rests: What holds it at rest, in the order of its coordinates.
    """
    by_joint = {one.joint: one for one in robot.drives}
    found = []
    for kind in kinds_of(robot):
        driven: dict[int, tuple[DrivenJoint, Rest]] = {}
        held: dict[int, tuple[HeldJoint, Rest]] = {}
        for k in kind.of(robot):
            own = by_joint[robot.coordinates[k]]
            if isinstance(own, DrivenJoint):
                driven[k] = own, rests[k]
            else:
                held[k] = own, rests[k]
        found.append(DriveGroup(kind, robot, driven, held))
    return found
