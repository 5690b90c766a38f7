"""The flexible drive of a joint: a DC motor, a gear, a damped elastic shaft; and the inertia that it turns.

Everything is counted at the gear's output shaft: theta1 is the angle that the gear gives, theta2 that of
the driven element, and I1 holds the rotor's inertia times i_p squared. What makes the joint flexible lies
between theta1 and theta2.

Source: [Iso9283]_ eq. 14-18. Eq. 15 is missing in print; it is I1 theta1'' + Mk = Mn.
"""

from __future__ import annotations

from typing import NamedTuple

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


def driving_torque(drive: Drive, current: Element) -> Element:
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
    return (driving_torque(drive, current) - torque) / drive.inertia


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


def lost_power(drive: Drive, omega1: Element, current: Element, omega2: Element) -> Element:
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
