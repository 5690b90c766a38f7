"""An arm that is turned by flexible drives: all of it as one system of equations.

The state is q and q' of the joints, and of each joint with a drive theta1, theta1' and the current. A joint
without a drive is held by a spring and a damper. A spring beside a drive may carry a part of its load.

Source: [Iso9283]_ eq. 14-19.

Whether the sampled controllers of an arm are stable: its motion about a pose, from sample to sample.

About a pose at rest the arm with its drives is linear, x' = A x + B u, and between two samples the voltages u
are held: x_n+1 = exp(A T) x_n + (integral of exp(A t) B) u_n. With u_n of eq. 20 that is one matrix; if its
spectral radius is below 1, what disturbs the arm dies away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import (
    NO_SPRING,
    CounterbalanceSpring,
    Drive,
    DrivenJoint,
    JointDrive,
    PassiveJoint,
    current_rate,
    dissipated_power,
    motor_torque,
    shaft_acceleration,
    shaft_torque,
    stored_energy,
)
from urmpipe_models.dynamics.equations import check_solvable, forward_dynamics, inverse_dynamics, mass_matrix
from urmpipe_models.dynamics.links import Links, Wrench, kinetic_energy, potential_energy, wrench_power
from urmpipe_models.elementwise import Element, FloatArray
from urmpipe_models.errors import Finding, RobotError

STABLE = 2.8
"""RK4 is stable up to this product of step and rate, for decays and undamped swings alike."""


SETTLED, NEARLY = 1e-12, 1e-9
"""How near held joints are brought to where they stand under a wrench, and have to be, in [rad] or [m]."""

FURTHEST = 0.5 * np.pi
"""A spring that yields to a wrench by more, in [rad] or [m], does not bear it."""


class Spring(NamedTuple):
    """What holds a joint without a drive.

    Attributes:
        stiffness: k in [N.m/rad] or [N/m].
        damping: l in [N.m.s/rad] or [N.s/m].
        rest: Where it gives no torque, in [rad] or [m].
    """

    stiffness: Element
    damping: Element
    rest: Element


class Motor(NamedTuple):
    """The drive of a joint and its state.

    Attributes:
        drive: The constants.
        angle: theta1 of the gear's output shaft in [rad] or [m].
        rate: theta1' in [rad/s] or [m/s].
        current: i_a in [A].
        voltage: U in [V].
        spring: What relieves it of a part of the load.
    """

    drive: Drive
    angle: Element
    rate: Element
    current: Element
    voltage: Element
    spring: CounterbalanceSpring = NO_SPRING


Actuator: TypeAlias = Spring | Motor
"""What gives a joint its torque."""


class ArmState(NamedTuple):
    """An arm and what turns it, at an instant.

    Attributes:
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        actuators: One per coordinate.
    """

    q: Sequence[Element]
    qd: Sequence[Element]
    actuators: Sequence[Actuator]


class MotorDerivatives(NamedTuple):
    """How the state of a drive changes: theta1' [rad/s], theta1'' [rad/s2], i_a' [A/s]; or with m for rad."""

    angle: Element
    rate: Element
    current: Element


class PowerFlow(NamedTuple):
    """What goes into an arm with drives, and what becomes heat.

    Attributes:
        supplied: By the voltages and the wrench, in [W].
        dissipated: In armatures, shafts and dampers, in [W].
    """

    supplied: Element
    dissipated: Element


class JointEquilibrium(NamedTuple):
    """Where a joint of an arm at rest stands, and what holds it there.

    Attributes:
        q: In [rad] or [m].
        rest: Where its spring gives no torque, in [rad] or [m]; of a drive theta1.
        current: i_a in [A]; 0 without a drive.
        voltage: U in [V]; 0 without a drive.
    """

    q: float
    rest: float
    current: float
    voltage: float


def shaft_torques(state: ArmState) -> list[Element]:
    """Return Mk of eq. 14, what the shaft of each drive transmits, and what holds each joint without one.

    Args:
        state: The arm.

    Returns:
        One element per coordinate, in [N.m] or [N].
    """
    torques = []
    for one, q, qd in zip(state.actuators, state.q, state.qd, strict=True):
        if isinstance(one, Motor):
            torques.append(shaft_torque(one.drive, one.angle, one.rate, q, qd))
        else:
            torques.append(one.stiffness * (one.rest - q) - one.damping * qd)
    return torques


def joint_torques(state: ArmState) -> list[Element]:
    """Return what the joints are turned with: `shaft_torques`, and of relieved drives k (rest - q) besides.

    Args:
        state: The arm.

    Returns:
        One element per coordinate, in [N.m] or [N].
    """
    return [
        torque + _relief(one, q) if isinstance(one, Motor) else torque
        for one, q, torque in zip(state.actuators, state.q, shaft_torques(state), strict=True)
    ]


def _relief(one: Motor, q: Element) -> Element:
    """Return the torque of the spring beside a drive."""
    return one.spring.stiffness * (one.spring.rest - q)


def joint_accelerations(
    chain: Chain, state: ArmState, wrench: Wrench | None = None, arm: Links | None = None
) -> list[Element]:
    """Return q'' of eq. 19 in [rad/s2] or [m/s2], one element per coordinate.

    Args:
        chain: The arm, with masses.
        state: The arm and what turns it.
        wrench: What acts on the tool centre point from outside.
        arm: Its moving parts, where they are known.
    """
    return forward_dynamics(chain, state.q, state.qd, joint_torques(state), wrench, arm)


def motor_derivatives(state: ArmState) -> dict[int, MotorDerivatives]:
    """Return how the drives change, eq. 15 and 18, by index of the coordinates that have any.

    Args:
        state: The arm and what turns it.
    """
    return {
        k: MotorDerivatives(
            one.rate,
            shaft_acceleration(one.drive, one.current, torque),
            current_rate(one.drive, one.voltage, one.rate, one.current),
        )
        for k, (one, torque) in enumerate(zip(state.actuators, shaft_torques(state), strict=True))
        if isinstance(one, Motor)
    }


def power_flow(chain: Chain, state: ArmState, wrench: Wrench | None = None) -> PowerFlow:
    """Return the powers of an arm with its drives: `arm_energy` changes by supplied - dissipated.

    Args:
        chain: The arm.
        state: The arm and what turns it.
        wrench: What acts on the tool centre point from outside.
    """
    supplied = 0.0 if wrench is None else wrench_power(chain, state.q, state.qd, wrench)
    dissipated = 0.0
    for one, qd in zip(state.actuators, state.qd, strict=True):
        if isinstance(one, Motor):
            supplied = supplied + one.voltage * one.current
            dissipated = dissipated + dissipated_power(one.drive, one.rate, one.current, qd)
        else:
            dissipated = dissipated + one.damping * qd * qd
    return PowerFlow(supplied, dissipated)


def arm_energy(chain: Chain, state: ArmState) -> Element:
    """Return the kinetic, potential, elastic and magnetic energy of an arm with its drives, in [J].

    Args:
        chain: The arm, with masses.
        state: The arm and what turns it.
    """
    energy = kinetic_energy(chain, state.q, state.qd) + potential_energy(chain, state.q)
    for one, q in zip(state.actuators, state.q, strict=True):
        if isinstance(one, Motor):
            energy = energy + stored_energy(one.drive, one.angle, one.rate, one.current, q)
            energy = energy + 0.5 * _relief(one, q) * (one.spring.rest - q)
        else:
            energy = energy + 0.5 * one.stiffness * (one.rest - q) * (one.rest - q)
    return energy


def find_equilibrium(chain: Chain, wrench: Wrench | None = None) -> list[JointEquilibrium]:
    """Return what holds an arm at its start pose: shafts twisted by gravity, currents and voltages set.

    theta1 = q + tau / k, i_a = tau / (i_p C), U = R i_a, tau without what a relief spring gives. Under
    gravity alone every joint stands at the start pose. A wrench shifts those that are held by a spring, by
    J^T F / k; the controllers keep the others there.

    Args:
        chain: The arm, with masses and a drive or a spring for each coordinate.
        wrench: What acts on the tool centre point from outside, besides.

    Raises:
        RobotError: With every joint that has neither, whose voltage does not hold it, or that moves no mass;
            or if the wrench is more than the springs bear.

    Source: [Iso9283]_ eq. 14-19 with all derivatives 0.
    """
    by_joint = {one.joint: one for one in chain.drives}
    faults = [
        Finding(
            f"robot {chain.name}: key drives.{name}: not found, allowed: the drive of the joint,"
            " or { k, l } of a spring that holds it"
        )
        for name in chain.coordinates
        if name not in by_joint
    ]
    try:
        check_solvable(chain)
    except RobotError as error:
        faults += error.findings
    if faults:
        raise RobotError(*faults)
    drives = [by_joint[name] for name in chain.coordinates]
    start = [float(value) for value in chain.start]
    rests = [_held(*each) for each in zip(drives, start, _torques(chain, start), strict=True)]
    if wrench is not None:
        q = _yielded(chain, drives, [one.rest for one in rests], wrench)
        torques = _torques(chain, q, wrench)
        rests = [
            rest._replace(q=value) if isinstance(own, PassiveJoint) else _held(own, value, torque)
            for own, rest, value, torque in zip(drives, rests, q, torques, strict=True)
        ]
    weak = [
        f"robot {chain.name}: drives.{own.joint}: needs {abs(rest.voltage):.4g} V to hold the arm at its"
        f" start, allowed: u_max, {own.largest_voltage:g} V"
        for own, rest in zip(drives, rests, strict=True)
        if isinstance(own, DrivenJoint) and abs(rest.voltage) > own.largest_voltage
    ]
    if weak:
        raise RobotError(*weak)
    return rests


def max_stable_step(chain: Chain) -> float:
    """Return about how long a step of RK4 in [s] may be at the start pose, joint by joint.

    2.8 over the largest eigenvalue of a joint with its drive or spring, all others free: (M^-1)_ii is what
    the joint yields to its torque.

    Args:
        chain: The arm, with masses and a drive or a spring for each coordinate.
    """
    by_joint = {one.joint: one for one in chain.drives}
    inverse = np.linalg.inv(np.array(mass_matrix(chain, list(map(float, chain.start))), dtype=np.float64))
    rates = (
        np.abs(np.linalg.eigvals(_alone(by_joint[name], inverse[k, k]))).max()
        for k, name in enumerate(chain.coordinates)
    )
    return float(STABLE / max(rates))


def _alone(one: JointDrive, lightness: float) -> FloatArray:
    """Return the matrix of q, q', theta1, theta1', i_a of a joint that yields by 1 / J to its torque."""
    if isinstance(one, PassiveJoint):
        return np.array([[0.0, 1.0], [-one.stiffness * lightness, -one.damping * lightness]])
    k, damping, ratio, constant, resistance, inductance, inertia = one.drive
    torque = np.array([-k, -damping, k, damping, 0.0])
    relief = np.array([-one.spring.stiffness, 0.0, 0.0, 0.0, 0.0])
    current = np.eye(5)[4]
    return np.array(
        [
            np.eye(5)[1],
            lightness * (torque + relief),
            np.eye(5)[3],
            (ratio * constant * current - torque) / inertia,
            -(constant * ratio * np.eye(5)[3] + resistance * current) / inductance,
        ]
    )


def _held(one: PassiveJoint | DrivenJoint, q: float, torque: float) -> JointEquilibrium:
    """Return what gives a joint a torque at rest."""
    if isinstance(one, PassiveJoint):
        return JointEquilibrium(q, q + torque / one.stiffness, 0.0, 0.0)
    torque -= one.spring.stiffness * (one.spring.rest - q)
    current = torque / motor_torque(one.drive, 1.0)
    return JointEquilibrium(q, q + torque / one.drive.stiffness, current, one.drive.resistance * current)


def _torques(chain: Chain, q: Sequence[float], wrench: Wrench | None = None) -> list[float]:
    """Return the torques of an arm at rest, one per coordinate, in [N.m] or [N]."""
    still = [0.0] * len(q)
    return [float(torque) for torque in inverse_dynamics(chain, q, still, still, wrench)]


def _yielded(
    chain: Chain, drives: Sequence[JointDrive], rest: Sequence[float], wrench: Wrench
) -> list[float]:
    """Return where an arm stands under a wrench in [rad] or [m]: k (rest - q) = tau(q) of what is held.

    Raises:
        RobotError: If the springs do not hold it within a quarter of a turn.
    """
    from scipy.optimize import root

    start = np.array([float(value) for value in chain.start])
    held = [k for k, own in enumerate(drives) if isinstance(own, PassiveJoint)]
    if not held:
        return [float(value) for value in start]
    stiffness = np.array([own.stiffness for own in drives if isinstance(own, PassiveJoint)])

    def standing(moved: FloatArray) -> FloatArray:
        """Return the pose when the held joints have moved by so much, shape (coordinates,), [rad] or [m]."""
        q = start.copy()
        q[held] += moved
        return q

    def lacking(moved: FloatArray) -> FloatArray:
        """Return by how far the springs would have to be turned further, shape (held,), [rad] or [m]."""
        q = standing(moved)
        torques = np.array(_torques(chain, q.tolist(), wrench))
        return np.asarray(torques[held] / stiffness + q[held] - np.array(rest)[held])

    moved = np.asarray(root(lacking, np.zeros(len(held)), tol=SETTLED).x)
    if np.abs(moved).max() > FURTHEST or np.abs(lacking(moved)).max() > NEARLY:
        raise RobotError(
            f"robot {chain.name}: force: found more than the springs of its held joints bear, allowed: less"
        )
    return [float(value) for value in standing(moved)]


STEP = 1e-5
"""By how much a joint is moved either way, in [rad] or [m], to see how its torques change."""

NANOSECONDS = 1e9


def spectral_radius(chain: Chain, q: FloatArray) -> float:
    """Return by which factor, a sample, the slowest motion about a pose dies away, below 1, or grows [-].

    With controllers of several periods it is of the shortest time after which all sample together again,
    brought to the shortest of them.

    Args:
        chain: The arm, with masses, and a drive or a spring for each coordinate; one drive at least.
        q: The pose, one value per coordinate in [rad] or [m], shape (coordinates,).

    Source: [Iso9283]_ eq. 13-20, eq. 20 with the corrected sign.
    """
    from scipy.linalg import expm

    motion, voltage, gains = _linear(chain, q)
    driven = [one for one in chain.drives if isinstance(one, DrivenJoint)]
    periods = np.array([round(one.period * NANOSECONDS) for one in driven])
    step, states, inputs = int(np.gcd.reduce(periods)), len(motion), len(driven)
    held = np.zeros((states + inputs, states + inputs))
    held[:states] = np.hstack((motion, voltage))
    passing = expm(held * (step / NANOSECONDS))
    rounds = math.lcm(*periods.tolist()) // step
    whole = np.eye(states + inputs)
    for k in range(rounds):
        due = (k * step) % periods == 0
        sampling = np.eye(states + inputs)
        sampling[states:, :states] = -np.where(due[:, np.newaxis], gains, 0.0)
        whole = passing @ sampling @ whole
    size = float(np.abs(np.linalg.eigvals(whole)).max())
    return float(size ** (int(periods.min()) / step / rounds))


def _linear(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B and the gains about a pose: u_n = u_n-1 - gains x.

    x holds q and q' of all coordinates, then theta1, theta1' and i_a of those with a drive, as deviations.
    """
    count, by_joint = len(chain.coordinates), {one.joint: one for one in chain.drives}
    drives = [by_joint[name] for name in chain.coordinates]
    driven = [(k, one) for k, one in enumerate(drives) if isinstance(one, DrivenJoint)]
    size = 2 * count + 3 * len(driven)
    torque = np.zeros((count, size))
    torque[:, :count] = -_weight_stiffness(chain, q)
    for k, held in enumerate(drives):
        if isinstance(held, PassiveJoint):
            torque[k, [k, count + k]] -= held.stiffness, held.damping
    motion, voltage = np.zeros((size, size)), np.zeros((size, len(driven)))
    motion[:count, count : 2 * count] = np.eye(count)
    for j, (k, one) in enumerate(driven):
        angle = 2 * count + 3 * j
        rate, current = angle + 1, angle + 2
        stiffness, damping, ratio, constant, resistance, inductance, inertia = map(float, one.drive)
        shaft = np.zeros(size)
        shaft[[angle, rate, k, count + k]] = stiffness, damping, -stiffness, -damping
        torque[k] += shaft
        torque[k, k] -= float(one.spring.stiffness)
        motion[angle, rate] = 1.0
        motion[rate] = -shaft / inertia
        motion[rate, current] += ratio * constant / inertia
        motion[current, [rate, current]] = -constant * ratio / inductance, -resistance / inductance
        voltage[current, j] = 1.0 / inductance
    motion[count : 2 * count] = np.linalg.solve(_masses(chain, q), torque)
    gains = np.zeros((len(driven), size))
    for j, (k, one) in enumerate(driven):
        gains[j] = float(one.gains.acceleration) * motion[count + k]
        gains[j, [k, count + k]] += float(one.gains.position), float(one.gains.velocity)
    return motion, voltage, gains


def _masses(chain: Chain, q: FloatArray) -> FloatArray:
    return np.array(mass_matrix(chain, q.tolist()), dtype=np.float64)


def _weight_stiffness(chain: Chain, q: FloatArray) -> FloatArray:
    """Return how the torques of gravity change with the joints, d g / d q, shape (n, n)."""
    still, moved = [0.0] * len(q), STEP * np.eye(len(q))
    weights = inverse_dynamics(chain, list(q[:, np.newaxis] + np.hstack((moved, -moved))), still, still)
    more, less = np.hsplit(np.array([np.broadcast_to(one, 2 * len(q)) for one in weights]), 2)
    return np.asarray((more - less) / (2.0 * STEP))
