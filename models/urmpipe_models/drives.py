"""Drives of joints: DC motor, gear and elastic shaft; set points; the sampled controller; joints of an arm.

1. Drive. All quantities refer to the gear's output shaft: theta1 is the angle of the output shaft, theta2 the
   angle of the driven element, and I1 includes the rotor's inertia times i_p squared. The joint is flexible
   between theta1 and theta2 ([Iso9283]_ eq. 14-18; eq. 15 is missing in print: it is I1 theta1'' + Mk = Mn):

       Mk = k (theta1 - theta2) + l (theta1' - theta2')        Mn = i_p C i_a
       I1 theta1'' = Mn - Mk                                   L i_a' = U - C i_p theta1' - R i_a

2. Set points of one joint as closed forms of time, from `initial` to `target`, from `begin` on. Values at a
   corner are those after it.

       step        at once; velocity and acceleration stay 0 (their impulses are left out)
       ramp        with the largest velocity all the way; acceleration stays 0 (its impulses are left out)
       trapezoid   with the largest acceleration to the largest velocity, then constant velocity, then down; a
                   move too short for that is a triangle, which decelerates from halfway

3. Controller. It adds to the voltage a term for each error at a sample (e: set - real, of position, velocity,
   acceleration):

       u_n = u_n-1 + Kphi e_phi + Kw e_w + Keps e_eps

   Summed over samples of period T this is a PID on the position: the errors' integral with Kphi / T, the
   error with Kw / T, its rate with Keps / T. The voltage is held between samples, and limited; as the
   limited one is stored, the sum does not wind up at the limit. Source: [Iso9283]_ eq. 20, which prints a
   minus where a plus is correct: with set - real, the minus drives the joint away from its set point.

4. `DrivenJoint`, `PassiveJoint`: a joint of an arm with a drive under control, or with a spring and a damper.
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
    """Return Mn = i_p C i_a, the motor's torque at the output shaft in [N.m], from the current in [A].

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
    """Return (I1 theta1'^2 + L i_a^2 + k (theta1 - theta2)^2) / 2, the energy stored in a drive, in [J].

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
    """Return R i_a^2 + l (theta1' - theta2')^2, the power lost as heat of armature and shaft, in [W].

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

    One row of eq. 19 with a constant inertia, and with friction and external torque for its other terms.

    Args:
        inertia: J in [kg.m2].
        damping: d of its bearing in [N.m.s/rad].
        omega: theta2' in [rad/s].
        torque: tau, the torque of the shaft on it, in [N.m].
        external: External torque in [N.m].

    Source: [Iso9283]_ eq. 19.
    """
    return (torque + external - damping * omega) / inertia


STEP, RAMP, TRAPEZOID = 0, 1, 2  # kinds of set points
CORNER_SLACK = 1e-9  # [s], before a corner, from which on it counts as reached: computed times are rounded


class JointMotion(NamedTuple):
    """Actual state or set point of a joint.

    Attributes:
        position: Angle in [rad].
        velocity: In [rad/s].
        acceleration: In [rad/s2].
    """

    position: Element
    velocity: Element
    acceleration: Element


def step(time: Element, begin: Element, initial: Element, target: Element) -> JointMotion:
    """Return the step: `initial` before `begin`, `target` from then on.

    Args:
        time: In [s].
        begin: Time of the step in [s].
        initial: Angle before it in [rad].
        target: Angle after it in [rad].
    """
    return JointMotion(np.where(_is_reached(time, begin), target, initial), 0.0 * time, 0.0 * time)


def ramp(time: Element, begin: Element, initial: Element, target: Element, speed: Element) -> JointMotion:
    """Return the ramp, which takes |target - initial| / speed.

    Args:
        time: In [s].
        begin: Start time in [s].
        initial: Initial angle in [rad].
        target: Final angle in [rad].
        speed: Largest velocity in [rad/s], above 0.
    """
    distance, direction = np.abs(target - initial), np.sign(target - initial)
    end = begin + distance / speed
    travelled = np.maximum(time - begin, 0.0) * speed
    moving = _onset(time, begin) - _onset(time, end)
    position = np.where(_is_reached(time, end), target, initial + direction * travelled)
    return JointMotion(position, direction * speed * moving, 0.0 * time)


def trapezoid(
    time: Element, begin: Element, initial: Element, target: Element, speed: Element, acceleration: Element
) -> JointMotion:
    """Return the move with a trapezoid of velocity.

    Over a distance d it accelerates for t_a = min(v / a, sqrt(d / a)), moves with constant velocity for
    max(d / v - v / a, 0), and decelerates for t_a. Both times are finite for a distance of 0.

    Args:
        time: In [s].
        begin: Start time in [s].
        initial: Initial angle in [rad].
        target: Final angle in [rad].
        speed: v, the largest velocity in [rad/s], above 0.
        acceleration: a, the largest acceleration in [rad/s2], above 0.
    """
    distance, direction = np.abs(target - initial), np.sign(target - initial)
    rise = np.minimum(speed / acceleration, np.sqrt(distance / acceleration))
    cruise = np.maximum(distance / speed - speed / acceleration, 0.0)
    total = 2.0 * rise + cruise
    since = time - begin
    up = _elapsed(since, rise)
    level = _elapsed(since - rise, cruise)
    down = _elapsed(since - rise - cruise, rise)
    peak = acceleration * rise
    travelled = 0.5 * acceleration * up * up + peak * level + (peak - 0.5 * acceleration * down) * down
    # 1 during acceleration, 0 at constant velocity, -1 during deceleration, 0 before and after
    phase = _onset(since, 0.0) - _onset(since, rise) - _onset(since, rise + cruise) + _onset(since, total)
    return JointMotion(
        np.where(_is_reached(since, total), target, initial + direction * travelled),
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
    """Return the set point of a kind at a time.

    Args:
        kind: 0 for `step`, 1 for `ramp`, 2 for `trapezoid`.
        time: In [s].
        begin: Start time in [s].
        initial: Initial angle in [rad].
        target: Final angle in [rad].
        speed: Of the ramp, and the largest of the trapezoid, in [rad/s], above 0; a step does not use it.
        acceleration: The largest of the trapezoid, in [rad/s2], above 0; the others do not use it.
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


def _elapsed(time: Element, duration: Element) -> Element:
    """Return the elapsed part of an interval that starts at 0."""
    return np.minimum(np.maximum(time, 0.0), duration)


def _is_reached(time: Element, corner: Element) -> Element:
    return time >= corner - CORNER_SLACK


def _onset(time: Element, corner: Element) -> Element:
    """Return 1 from a corner on, 0 before it."""
    return np.where(_is_reached(time, corner), 1.0, 0.0)


SAMPLE_SLACK = 1e-6  # of a period; a sample is due this early: 0.3 / 0.1 is computed as a bit less than 3


class Gains(NamedTuple):
    """Increments of the voltage per sample and error.

    Attributes:
        position: Kphi in [V/rad].
        velocity: Kw in [V.s/rad].
        acceleration: Keps in [V.s2/rad].
    """

    position: Element
    velocity: Element
    acceleration: Element


def control_voltage(
    previous: Element, gains: Gains, setpoint: JointMotion, measured: JointMotion, limit: Element
) -> Element:
    """Return the voltage u_n of a sample in [V], within -limit .. limit.

    Args:
        previous: u_n-1, the voltage of the sample before, in [V].
        gains: Kphi, Kw, Keps.
        setpoint: The set values.
        measured: The real values.
        limit: Largest voltage in [V].

    Source: [Iso9283]_ eq. 20 with the corrected sign.
    """
    voltage = (
        previous
        + gains.position * (setpoint.position - measured.position)
        + gains.velocity * (setpoint.velocity - measured.velocity)
        + gains.acceleration * (setpoint.acceleration - measured.acceleration)
    )
    return np.minimum(np.maximum(voltage, -limit), limit)


def sample_index(time: Element, period: Element) -> Element:
    """Return the index n of the last sample instant n T that is not after a time in [s]."""
    return np.floor(time / period + SAMPLE_SLACK)


def sampled_voltage(
    time: Element, period: Element, sample: Element, fresh: Element, last: Element
) -> Element:
    """Return the voltage from a time on in [V]: a new one if a sample is due, else the held one.

    Args:
        time: In [s].
        period: Between two samples, in [s].
        sample: Index of the last sample that was taken.
        fresh: The value of `control_voltage` at this time in [V].
        last: The voltage of the last sample in [V].
    """
    return np.where(sample_index(time, period) > sample, fresh, last)


MIN_CONSTANT = 1e-9  # of a constant above 0, in its unit: the min of an FMI variable is an allowed value
MIN_PERIOD = 1e-6  # [s], between two samples of a controller

# Names of the constants in robot files and block models, in the order of the fields.
DRIVE_KEYS = ("k", "l", "i_p", "C", "R", "L", "I1")  # of `Drive`
GAIN_KEYS = ("Kphi", "Kw", "Keps")  # of `Gains`
SPRING_KEYS = ("k_spring", "rest_spring")  # of `CounterbalanceSpring`


@dataclass(frozen=True, slots=True)
class PassiveJoint:
    """A joint without a drive, held at its start value by a spring and a damper.

    Attributes:
        joint: Name of a coordinate.
        stiffness: k in [N.m/rad], of a prismatic joint in [N/m].
        damping: l in [N.m.s/rad], of a prismatic joint in [N.s/m].
    """

    joint: str
    stiffness: float
    damping: float

    def faults(self) -> Iterator[str]:
        """Yield the constants that a spring and a damper cannot have."""
        yield from _below_minimum(MIN_CONSTANT, self.joint, {"k": self.stiffness})
        yield from _below_minimum(0.0, self.joint, {"l": self.damping})


class CounterbalanceSpring(NamedTuple):
    """A spring without mass parallel to a drive, which carries a part of the load: k (rest - q).

    Attributes:
        stiffness: k in [N.m/rad], of a prismatic joint in [N/m]; 0: no spring.
        rest: Coordinate without torque, in [rad] or [m].
    """

    stiffness: Element
    rest: Element


NO_SPRING = CounterbalanceSpring(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class DrivenJoint:
    """A joint with a flexible DC drive and a sampled controller.

    Attributes:
        joint: Name of a coordinate.
        drive: The constants of motor, gear and shaft; of a prismatic joint with m for rad.
        period: Time between two samples of the controller in [s].
        gains: The gains of the controller.
        largest_voltage: u_max in [V].
        spring: The spring that carries a part of the load.
    """

    joint: str
    drive: Drive = field(metadata={"stored": tuple[float, ...]})
    period: float
    gains: Gains = field(metadata={"stored": tuple[float, ...]})
    largest_voltage: float
    spring: CounterbalanceSpring = field(default=NO_SPRING, metadata={"stored": tuple[float, ...]})

    def __post_init__(self) -> None:
        """Convert the plain tuples of a recording to drive, gains and spring."""
        object.__setattr__(self, "drive", Drive(*self.drive))
        object.__setattr__(self, "gains", Gains(*self.gains))
        object.__setattr__(self, "spring", CounterbalanceSpring(*self.spring))

    def faults(self) -> Iterator[str]:
        """Yield the constants that a drive cannot have; gains may have any sign (see `drive_controller`)."""
        yield from _below_minimum(MIN_CONSTANT, self.joint, dict(zip(DRIVE_KEYS, self.drive, strict=True)))
        yield from _below_minimum(MIN_PERIOD, self.joint, {"period": self.period})
        yield from _below_minimum(0.0, self.joint, {"u_max": self.largest_voltage})
        yield from _below_minimum(0.0, self.joint, {SPRING_KEYS[0]: self.spring.stiffness})
        unbounded = zip((*GAIN_KEYS, SPRING_KEYS[1]), (*self.gains, self.spring.rest), strict=True)
        for key, value in unbounded:
            if not math.isfinite(value):
                yield f"drives.{self.joint}.{key}: found {value:g}, allowed: a finite number"


JointDrive: TypeAlias = PassiveJoint | DrivenJoint


def _below_minimum(minimum: float, joint: str, values: Mapping[str, float]) -> Iterator[str]:
    for key, value in values.items():
        if not minimum <= value < math.inf:
            yield f"drives.{joint}.{key}: found {value:g}, allowed: a finite number, {minimum:g} or more"
