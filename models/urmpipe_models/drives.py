"""The flexible drive of a joint: a DC motor, a gear, a damped elastic shaft; and the inertia that it turns.

Everything is counted at the gear's output shaft: theta1 is the angle that the gear gives, theta2 that of
the driven element, and I1 holds the rotor's inertia times i_p squared. What makes the joint flexible lies
between theta1 and theta2.

Source: [Iso9283]_ eq. 14-18. Eq. 15 is missing in print; it is I1 theta1'' + Mk = Mn.

Set points of one joint as closed forms of time: a step, a ramp, a trapezoid of velocity.

Each starts at `begin` and goes from `initial` to `target`. Values at a corner are those after it.

    step        at once; velocity and acceleration stay 0 (their impulses are left out)
    ramp        with the largest velocity all the way; acceleration stays 0 (its impulses are left out)
    trapezoid   with the largest acceleration to the largest velocity, on with it, and down again; a move
                too short for that is a triangle, which turns back halfway

The sampled controller of a drive: it adds to the voltage what the errors at a sample ask for.

    u_n = u_n-1 + Kphi e_phi + Kw e_w + Keps e_eps        (e: set - real, of position, velocity, acceleration)

Summed up over samples of period T this is a PID on the position: the errors' integral with Kphi / T, the
error itself with Kw / T, its rate with Keps / T. The voltage is held between samples, and limited; as the
limited one is remembered, the sum does not wind up while the limit holds.

Source: [Iso9283]_ eq. 20, which prints a minus where a plus must stand: with set - real, the minus drives
the joint away from its set point.

What holds or turns the joints of an arm: a drive under control, or a spring and a damper alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.elementwise import Element


class Drive(NamedTuple):
    """The constants of a drive.

    Attributes:
        stiffness: k, the shaft's torsional rigidity in [N.m/rad].
        damping: l, the damping of the shaft's torsion in [N.m.s/rad].
        ratio: i_p, turns of the motor for one of the output shaft.
        constant: C, torque for a current in [N.m/A], as large as voltage for a speed in [V.s/rad].
        resistance: R of the armature in [Ohm].
        inductance: L of the armature in [H].
        inertia: I1 of rotor and gear, reduced to the output shaft, in [kg.m2].
    """

    stiffness: Element
    damping: Element
    ratio: Element
    constant: Element
    resistance: Element
    inductance: Element
    inertia: Element


def shaft_torque(drive: Drive, theta1: Element, omega1: Element, theta2: Element, omega2: Element) -> Element:
    """Return Mk = k (theta1 - theta2) + l (theta1' - theta2') in [N.m].

    Args:
        drive: The constants.
        theta1: Angle of the gear's output shaft in [rad].
        omega1: Its rate in [rad/s].
        theta2: Angle of the driven element in [rad].
        omega2: Its rate in [rad/s].

    Source: [Iso9283]_ eq. 14.
    """
    return drive.stiffness * (theta1 - theta2) + drive.damping * (omega1 - omega2)


def motor_torque(drive: Drive, current: Element) -> Element:
    """Return Mn = i_p C i_a, the motor's torque at the output shaft in [N.m], of the current in [A].

    Source: [Iso9283]_ eq. 16 and 17.
    """
    return drive.ratio * (drive.constant * current)


def shaft_acceleration(drive: Drive, current: Element, torque: Element) -> Element:
    """Return theta1'' = (Mn - Mk) / I1 in [rad/s2].

    Args:
        drive: The constants.
        current: i_a in [A].
        torque: Mk in [N.m].

    Source: [Iso9283]_ eq. 15, which is missing in print.
    """
    return (motor_torque(drive, current) - torque) / drive.inertia


def current_rate(drive: Drive, voltage: Element, omega1: Element, current: Element) -> Element:
    """Return i_a' = (U - C i_p theta1' - R i_a) / L in [A/s].

    Args:
        drive: The constants.
        voltage: U of the armature in [V].
        omega1: Rate of the output shaft in [rad/s].
        current: i_a in [A].

    Source: [Iso9283]_ eq. 18.
    """
    induced = drive.constant * (drive.ratio * omega1)
    return (voltage - induced - drive.resistance * current) / drive.inductance


def stored_energy(
    drive: Drive, theta1: Element, omega1: Element, current: Element, theta2: Element
) -> Element:
    """Return (I1 theta1'^2 + L i_a^2 + k (theta1 - theta2)^2) / 2, what a drive holds, in [J].

    Args:
        drive: The constants.
        theta1: Angle of the gear's output shaft in [rad].
        omega1: Its rate in [rad/s].
        current: i_a in [A].
        theta2: Angle of the driven element in [rad].
    """
    twist = theta1 - theta2
    turning, winding = drive.inertia * omega1 * omega1, drive.inductance * current * current
    return 0.5 * (turning + winding + drive.stiffness * twist * twist)


def dissipated_power(drive: Drive, omega1: Element, current: Element, omega2: Element) -> Element:
    """Return R i_a^2 + l (theta1' - theta2')^2, the heat of armature and shaft, in [W].

    Args:
        drive: The constants.
        omega1: Rate of the gear's output shaft in [rad/s].
        current: i_a in [A].
        omega2: Rate of the driven element in [rad/s].
    """
    twisting = omega1 - omega2
    return drive.resistance * current * current + drive.damping * twisting * twisting


def load_acceleration(
    inertia: Element, damping: Element, omega: Element, torque: Element, external: Element
) -> Element:
    """Return theta2'' = (tau + external - d theta2') / J in [rad/s2].

    One row of eq. 19 with a constant inertia, and with friction and outer torque for its other terms.

    Args:
        inertia: J in [kg.m2].
        damping: d of its bearing in [N.m.s/rad].
        omega: theta2' in [rad/s].
        torque: tau, what the shaft drives it with, in [N.m].
        external: Torque from outside in [N.m].

    Source: [Iso9283]_ eq. 19.
    """
    return (torque + external - damping * omega) / inertia


STEP, RAMP, TRAPEZOID = 0, 1, 2
"""The kinds, as numbers, for `set_point`."""


CORNER_SLACK = 1e-9
"""A corner counts as reached so early, in [s]: times that are computed miss it by their rounding."""


class JointMotion(NamedTuple):
    """Where a joint is or shall be.

    Attributes:
        position: Angle in [rad].
        velocity: Its rate in [rad/s].
        acceleration: Its second derivative in [rad/s2].
    """

    position: Element
    velocity: Element
    acceleration: Element


def step(time: Element, begin: Element, initial: Element, target: Element) -> JointMotion:
    """Return the step: `initial` before `begin`, `target` from then on.

    Args:
        time: In [s].
        begin: When it steps, in [s].
        initial: Where from, in [rad].
        target: Where to, in [rad].
    """
    return JointMotion(np.where(_reached(time, begin), target, initial), 0.0 * time, 0.0 * time)


def ramp(time: Element, begin: Element, initial: Element, target: Element, speed: Element) -> JointMotion:
    """Return the ramp, which takes |target - initial| / speed.

    Args:
        time: In [s].
        begin: When it starts, in [s].
        initial: Where from, in [rad].
        target: Where to, in [rad].
        speed: Largest velocity in [rad/s], above 0.
    """
    way, direction = np.abs(target - initial), np.sign(target - initial)
    end = begin + way / speed
    gone = np.maximum(time - begin, 0.0) * speed
    moving = _since(time, begin) - _since(time, end)
    position = np.where(_reached(time, end), target, initial + direction * gone)
    return JointMotion(position, direction * speed * moving, 0.0 * time)


def trapezoid(
    time: Element,
    begin: Element,
    initial: Element,
    target: Element,
    speed: Element,
    acceleration: Element,
) -> JointMotion:
    """Return the move with a trapezoid of velocity.

    It speeds up for t_a = min(v / a, sqrt(way / a)), keeps its velocity for way / v - v / a, but not below
    0, and slows down for t_a. Both t_a and the time between are finite for a way of 0.

    Args:
        time: In [s].
        begin: When it starts, in [s].
        initial: Where from, in [rad].
        target: Where to, in [rad].
        speed: v, the largest velocity in [rad/s], above 0.
        acceleration: a, the largest acceleration in [rad/s2], above 0.
    """
    way, direction = np.abs(target - initial), np.sign(target - initial)
    rise = np.minimum(speed / acceleration, np.sqrt(way / acceleration))
    cruise = np.maximum(way / speed - speed / acceleration, 0.0)
    total = 2.0 * rise + cruise
    since = time - begin
    up = _within(since, rise)
    level = _within(since - rise, cruise)
    down = _within(since - rise - cruise, rise)
    peak = acceleration * rise
    gone = 0.5 * acceleration * up * up + peak * level + (peak - 0.5 * acceleration * down) * down
    # 1 while it speeds up, 0 after that, -1 while it slows down, 0 before and after.
    phase = _since(since, 0.0) - _since(since, rise) - _since(since, rise + cruise) + _since(since, total)
    return JointMotion(
        np.where(_reached(since, total), target, initial + direction * gone),
        direction * acceleration * (up - down),
        direction * acceleration * phase,
    )


def evaluate_setpoint(
    kind: Element,
    time: Element,
    begin: Element,
    initial: Element,
    target: Element,
    speed: Element,
    acceleration: Element,
) -> JointMotion:
    """Return the set point of a kind: where the joint shall be at that time.

    Args:
        kind: 0 for `step`, 1 for `ramp`, 2 for `trapezoid`.
        time: In [s].
        begin: When it starts, in [s].
        initial: Where from, in [rad].
        target: Where to, in [rad].
        speed: Of the ramp, and the largest of the trapezoid, in [rad/s], above 0; a step needs none.
        acceleration: The largest of the trapezoid, in [rad/s2], above 0; the others need none.
    """
    forms = (
        step(time, begin, initial, target),
        ramp(time, begin, initial, target, speed),
        trapezoid(time, begin, initial, target, speed, acceleration),
    )
    return JointMotion(
        *(
            np.where(kind == STEP, stepped, np.where(kind == RAMP, ramped, rounded))
            for stepped, ramped, rounded in zip(*forms, strict=True)
        )
    )


def _within(time: Element, duration: Element) -> Element:
    """Return how much of a stretch that starts at 0 is over."""
    return np.minimum(np.maximum(time, 0.0), duration)


def _reached(time: Element, corner: Element) -> Element:
    """Return whether a time is not before a corner."""
    return time >= corner - CORNER_SLACK


def _since(time: Element, corner: Element) -> Element:
    """Return 1 from a corner on, 0 before it."""
    return np.where(_reached(time, corner), 1.0, 0.0)


SAMPLE_SLACK = 1e-6
"""A sample counts as reached this share of a period early: computed, 0.3 / 0.1 is not quite 3."""


class Gains(NamedTuple):
    """What a sample adds to the voltage for each error.

    Attributes:
        position: Kphi in [V/rad].
        velocity: Kw in [V.s/rad].
        acceleration: Keps in [V.s2/rad].
    """

    position: Element
    velocity: Element
    acceleration: Element


def control_voltage(
    last: Element, gains: Gains, wanted: JointMotion, real: JointMotion, limit: Element
) -> Element:
    """Return the voltage u_n of a sample in [V], within -limit .. limit.

    Args:
        last: u_n-1, the voltage of the sample before, in [V].
        gains: Kphi, Kw, Keps.
        wanted: The set values.
        real: The real values.
        limit: Largest voltage in [V].

    Source: [Iso9283]_ eq. 20 with the corrected sign.
    """
    voltage = (
        last
        + gains.position * (wanted.position - real.position)
        + gains.velocity * (wanted.velocity - real.velocity)
        + gains.acceleration * (wanted.acceleration - real.acceleration)
    )
    return np.minimum(np.maximum(voltage, -limit), limit)


def sample_index(time: Element, period: Element) -> Element:
    """Return the number of the last sample instant, n T, that is not after a time in [s]."""
    return np.floor(time / period + SAMPLE_SLACK)


def held_voltage(time: Element, period: Element, sample: Element, fresh: Element, last: Element) -> Element:
    """Return the voltage from a time on in [V]: a new one where a sample is due, else the held one.

    Args:
        time: In [s].
        period: Between two samples, in [s].
        sample: Number of the last sample that was taken.
        fresh: What `next_voltage` gives now, in [V].
        last: The voltage of the last sample in [V].
    """
    return np.where(sample_index(time, period) > sample, fresh, last)


@dataclass(frozen=True, slots=True)
class PassiveJoint:
    """A joint without a drive, held where it starts by a spring and a damper.

    Attributes:
        joint: Name of a coordinate.
        stiffness: k in [N.m/rad], of a joint that slides in [N/m].
        damping: l in [N.m.s/rad], of a joint that slides in [N.s/m].
    """

    joint: str
    stiffness: float
    damping: float

    def faults(self) -> Iterator[str]:
        """Yield which constants no spring and damper have."""
        yield from _at_least(MIN_CONSTANT, self.joint, {"k": self.stiffness})
        yield from _at_least(0.0, self.joint, {"l": self.damping})


class CounterbalanceSpring(NamedTuple):
    """A spring without mass beside a drive, which carries a part of the load: k (rest - q).

    Attributes:
        stiffness: k in [N.m/rad], of a joint that slides in [N/m]; 0: there is none.
        rest: Where it gives no torque, in [rad] or [m].
    """

    stiffness: Element
    rest: Element


NO_SPRING = CounterbalanceSpring(0.0, 0.0)
"""Of a drive that carries all of the load."""


@dataclass(frozen=True, slots=True)
class DrivenJoint:
    """A joint with a flexible DC drive and a sampled controller.

    Attributes:
        joint: Name of a coordinate.
        drive: The constants of motor, gear and shaft; of a joint that slides with m for rad.
        period: Time between two samples of the controller in [s].
        gains: What a sample adds to the voltage.
        largest_voltage: u_max in [V].
        spring: What relieves the drive of a part of its load.
    """

    joint: str
    drive: Drive = field(metadata={"stored": tuple[float, ...]})
    period: float
    gains: Gains = field(metadata={"stored": tuple[float, ...]})
    largest_voltage: float
    spring: CounterbalanceSpring = field(default=NO_SPRING, metadata={"stored": tuple[float, ...]})

    def __post_init__(self) -> None:
        """Make drive, gains and spring of the plain numbers that a recording gives."""
        object.__setattr__(self, "drive", Drive(*self.drive))
        object.__setattr__(self, "gains", Gains(*self.gains))
        object.__setattr__(self, "spring", CounterbalanceSpring(*self.spring))

    def faults(self) -> Iterator[str]:
        """Yield which constants no drive has; gains may have any sign (see `drive_controller`)."""
        yield from _at_least(MIN_CONSTANT, self.joint, dict(zip(DRIVE_KEYS, self.drive, strict=True)))
        yield from _at_least(MIN_PERIOD, self.joint, {"period": self.period})
        yield from _at_least(0.0, self.joint, {"u_max": self.largest_voltage})
        yield from _at_least(0.0, self.joint, {SPRING_KEYS[0]: self.spring.stiffness})
        free = zip((*GAIN_KEYS, SPRING_KEYS[1]), (*self.gains, self.spring.rest), strict=True)
        for key, value in free:
            if not math.isfinite(value):
                yield f"drives.{self.joint}.{key}: found {value:g}, allowed: a finite number"


JointDrive: TypeAlias = PassiveJoint | DrivenJoint

DRIVE_KEYS = ("k", "l", "i_p", "C", "R", "L", "I1")
"""The constants of `Drive`, as robot files and units name them."""

GAIN_KEYS = ("Kphi", "Kw", "Keps")
"""The gains, as robot files and units name them."""

SPRING_KEYS = ("k_spring", "rest_spring")
"""The constants of `ReliefSpring`, as robot files and units name them."""


MIN_CONSTANT = 1e-9
"""The least value of a constant that is above 0, in its unit; FMI's min is a value that is allowed."""

MIN_PERIOD = 1e-6
"""The least time between two samples of a controller in [s]."""


def _at_least(least: float, joint: str, values: Mapping[str, float]) -> Iterator[str]:
    """Yield which constants are not finite, or below the least value."""
    for key, value in values.items():
        if not least <= value < math.inf:
            yield f"drives.{joint}.{key}: found {value:g}, allowed: a finite number, {least:g} or more"
