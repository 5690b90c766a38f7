"""An arm on flexible drives as one system of equations: motion, energy, equilibrium, stability.

The state is q and q' of the joints and, for each joint with a drive, theta1, theta1' and the current i_a. A
joint without a drive is held by a spring and a damper. A spring may carry a part of the load of a drive.

1. `shaft_torques`, `joint_torques`, `joint_accelerations`, `motor_derivatives`: [Iso9283]_ eq. 14-19.
2. `power_flow`, `arm_energy`: the energy changes by the power supplied less the power dissipated.
3. `find_equilibrium`: the arm at rest at its start pose, eq. 14-19 with all derivatives 0.
4. `max_stable_step`: the longest stable step of an RK4 integrator, joint by joint.
5. `spectral_radius`: stability of the sampled controllers. About a pose at rest arm and drives are linear,
   x' = A x + B u, and the voltages u are constant between two samples:
   x_n+1 = exp(A T) x_n + (integral of exp(A t) B) u_n. With u_n of eq. 20 this is one matrix; if its spectral
   radius is below 1, a disturbance of the arm decays.
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

RK4_STABILITY = 2.8  # RK4 is stable up to this product of step and rate, for decays and undamped oscillations
EQUILIBRIUM_TOLERANCE = 1e-12  # of the solver, in [rad] or [m]
MAX_EQUILIBRIUM_ERROR = 1e-9  # of its solution, in [rad] or [m]
MAX_DEFLECTION = 0.5 * np.pi  # [rad] or [m]; a spring that yields more does not bear the wrench
GRAVITY_STEP = 1e-5  # [rad] or [m], of a central difference of the torques of gravity
NANOSECONDS = 1e9  # per [s]


class Spring(NamedTuple):
    """Spring and damper that hold a joint without a drive.

    Attributes:
        stiffness: k in [N.m/rad] or [N/m].
        damping: l in [N.m.s/rad] or [N.s/m].
        rest: Joint value without torque, in [rad] or [m].
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
        spring: Spring that carries a part of its load.
    """

    drive: Drive
    angle: Element
    rate: Element
    current: Element
    voltage: Element
    spring: CounterbalanceSpring = NO_SPRING

    def spring_torque(self, q: Element) -> Element:
        """Return the torque k (rest - q) of the counterbalance spring in [N.m] or [N], q in [rad] or [m]."""
        return self.spring.stiffness * (self.spring.rest - q)


Actuator: TypeAlias = Spring | Motor


class ArmState(NamedTuple):
    """An arm and its actuators at an instant.

    Attributes:
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        actuators: One per coordinate.
    """

    q: Sequence[Element]
    qd: Sequence[Element]
    actuators: Sequence[Actuator]


class MotorDerivatives(NamedTuple):
    """Derivatives of a drive's state: theta1' [rad/s], theta1'' [rad/s2], i_a' [A/s]; or with m for rad."""

    angle: Element
    rate: Element
    current: Element


class PowerFlow(NamedTuple):
    """Powers of an arm with drives.

    Attributes:
        supplied: By the voltages and the wrench, in [W].
        dissipated: In armatures, shafts and dampers, in [W].
    """

    supplied: Element
    dissipated: Element


class JointEquilibrium(NamedTuple):
    """A joint of an arm at rest and its actuator.

    Attributes:
        q: Joint value in [rad] or [m].
        rest: Joint value without torque of its spring, in [rad] or [m]; of a drive theta1.
        current: i_a in [A]; 0 without a drive.
        voltage: U in [V]; 0 without a drive.
    """

    q: float
    rest: float
    current: float
    voltage: float


def shaft_torques(state: ArmState) -> list[Element]:
    """Return Mk of eq. 14, the torque of each drive's shaft, or of the spring and damper without a drive.

    Args:
        state: The arm.

    Returns:
        One element per coordinate, in [N.m] or [N].
    """
    torques = []
    for actuator, q, qd in zip(state.actuators, state.q, state.qd, strict=True):
        if isinstance(actuator, Motor):
            torques.append(shaft_torque(actuator.drive, actuator.angle, actuator.rate, q, qd))
        else:
            torques.append(actuator.stiffness * (actuator.rest - q) - actuator.damping * qd)
    return torques


def joint_torques(state: ArmState) -> list[Element]:
    """Return the torques on the joints: `shaft_torques` plus k (rest - q) of counterbalance springs.

    Args:
        state: The arm.

    Returns:
        One element per coordinate, in [N.m] or [N].
    """
    return [
        torque + actuator.spring_torque(q) if isinstance(actuator, Motor) else torque
        for actuator, q, torque in zip(state.actuators, state.q, shaft_torques(state), strict=True)
    ]


def joint_accelerations(
    chain: Chain, state: ArmState, wrench: Wrench | None = None, arm: Links | None = None
) -> list[Element]:
    """Return q'' of eq. 19 in [rad/s2] or [m/s2], one element per coordinate.

    Args:
        chain: The arm, with masses.
        state: The arm and its actuators.
        wrench: External wrench on the tool centre point.
        arm: Its moving links, if they are known.
    """
    return forward_dynamics(chain, state.q, state.qd, joint_torques(state), wrench, arm)


def motor_derivatives(state: ArmState) -> dict[int, MotorDerivatives]:
    """Return the derivatives of the drives, eq. 15 and 18, by index of the coordinates with a drive.

    Args:
        state: The arm and its actuators.
    """
    return {
        k: MotorDerivatives(
            motor.rate,
            shaft_acceleration(motor.drive, motor.current, torque),
            current_rate(motor.drive, motor.voltage, motor.rate, motor.current),
        )
        for k, (motor, torque) in enumerate(zip(state.actuators, shaft_torques(state), strict=True))
        if isinstance(motor, Motor)
    }


def power_flow(chain: Chain, state: ArmState, wrench: Wrench | None = None) -> PowerFlow:
    """Return the powers of an arm with its drives: `arm_energy` changes by supplied - dissipated.

    Args:
        chain: The arm.
        state: The arm and its actuators.
        wrench: External wrench on the tool centre point.
    """
    supplied = 0.0 if wrench is None else wrench_power(chain, state.q, state.qd, wrench)
    dissipated = 0.0
    for actuator, qd in zip(state.actuators, state.qd, strict=True):
        if isinstance(actuator, Motor):
            supplied = supplied + actuator.voltage * actuator.current
            dissipated = dissipated + dissipated_power(actuator.drive, actuator.rate, actuator.current, qd)
        else:
            dissipated = dissipated + actuator.damping * qd * qd
    return PowerFlow(supplied, dissipated)


def arm_energy(chain: Chain, state: ArmState) -> Element:
    """Return the kinetic, potential, elastic and magnetic energy of an arm with its drives, in [J].

    Args:
        chain: The arm, with masses.
        state: The arm and its actuators.
    """
    energy = kinetic_energy(chain, state.q, state.qd) + potential_energy(chain, state.q)
    for actuator, q in zip(state.actuators, state.q, strict=True):
        if isinstance(actuator, Motor):
            energy = energy + stored_energy(
                actuator.drive, actuator.angle, actuator.rate, actuator.current, q
            )
            energy = energy + 0.5 * actuator.spring_torque(q) * (actuator.spring.rest - q)
        else:
            energy = energy + 0.5 * actuator.stiffness * (actuator.rest - q) * (actuator.rest - q)
    return energy


def find_equilibrium(chain: Chain, wrench: Wrench | None = None) -> list[JointEquilibrium]:
    """Return the equilibrium of an arm at its start pose: shafts twisted by gravity, currents, voltages.

    theta1 = q + tau / k, i_a = tau / (i_p C), U = R i_a, tau without the part of a counterbalance spring.
    Under gravity alone every joint is at the start pose. A wrench moves the joints that are held by a spring,
    by J^T F / k; the controllers keep the others there.

    Args:
        chain: The arm, with masses and a drive or a spring for each coordinate.
        wrench: External wrench on the tool centre point.

    Raises:
        RobotError: With every joint that has neither drive nor spring, whose voltage does not hold it, or
            that moves no mass; or if the springs do not bear the wrench.

    Source: [Iso9283]_ eq. 14-19 with all derivatives 0.
    """
    by_joint = {drive.joint: drive for drive in chain.drives}
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
    joints = [
        _joint_equilibrium(drive, q, torque)
        for drive, q, torque in zip(drives, start, _static_torques(chain, start), strict=True)
    ]
    if wrench is not None:
        q_loaded = _deflected_pose(chain, drives, [joint.rest for joint in joints], wrench)
        torques = _static_torques(chain, q_loaded, wrench)
        joints = [
            joint._replace(q=q) if isinstance(drive, PassiveJoint) else _joint_equilibrium(drive, q, torque)
            for drive, joint, q, torque in zip(drives, joints, q_loaded, torques, strict=True)
        ]
    weak = [
        f"robot {chain.name}: drives.{drive.joint}: needs {abs(joint.voltage):.4g} V to hold the arm at its"
        f" start, allowed: u_max, {drive.largest_voltage:g} V"
        for drive, joint in zip(drives, joints, strict=True)
        if isinstance(drive, DrivenJoint) and abs(joint.voltage) > drive.largest_voltage
    ]
    if weak:
        raise RobotError(*weak)
    return joints


def _joint_equilibrium(drive: JointDrive, q: float, torque: float) -> JointEquilibrium:
    """Return the state in which an actuator gives a joint a torque in [N.m] or [N]."""
    if isinstance(drive, PassiveJoint):
        return JointEquilibrium(q, q + torque / drive.stiffness, 0.0, 0.0)
    torque -= drive.spring.stiffness * (drive.spring.rest - q)
    current = torque / motor_torque(drive.drive, 1.0)
    return JointEquilibrium(q, q + torque / drive.drive.stiffness, current, drive.drive.resistance * current)


def _static_torques(chain: Chain, q: Sequence[float], wrench: Wrench | None = None) -> list[float]:
    """Return the torques of an arm at rest, one per coordinate, in [N.m] or [N]."""
    zero = [0.0] * len(q)
    return [float(torque) for torque in inverse_dynamics(chain, q, zero, zero, wrench)]


def _deflected_pose(
    chain: Chain, drives: Sequence[JointDrive], rest: Sequence[float], wrench: Wrench
) -> list[float]:
    """Return the pose of an arm under a wrench in [rad] or [m]: k (rest - q) = tau(q) of the passive joints.

    Raises:
        RobotError: If the springs do not hold it within `MAX_DEFLECTION`.
    """
    from scipy.optimize import root

    start = np.array([float(value) for value in chain.start])
    passive = [k for k, drive in enumerate(drives) if isinstance(drive, PassiveJoint)]
    if not passive:
        return [float(value) for value in start]
    stiffness = np.array([drive.stiffness for drive in drives if isinstance(drive, PassiveJoint)])

    def deflected(deflection: FloatArray) -> FloatArray:
        """Return the pose with the passive joints deflected, shape (coordinates,), [rad] or [m]."""
        q = start.copy()
        q[passive] += deflection
        return q

    def residual(deflection: FloatArray) -> FloatArray:
        """Return tau / k - (rest - q) of the passive joints, shape (passive,), [rad] or [m]."""
        q = deflected(deflection)
        torques = np.array(_static_torques(chain, q.tolist(), wrench))
        return np.asarray(torques[passive] / stiffness + q[passive] - np.array(rest)[passive])

    deflection = np.asarray(root(residual, np.zeros(len(passive)), tol=EQUILIBRIUM_TOLERANCE).x)
    if (
        np.abs(deflection).max() > MAX_DEFLECTION
        or np.abs(residual(deflection)).max() > MAX_EQUILIBRIUM_ERROR
    ):
        raise RobotError(
            f"robot {chain.name}: force: found more than the springs of its held joints bear, allowed: less"
        )
    return [float(value) for value in deflected(deflection)]


def max_stable_step(chain: Chain) -> float:
    """Return approximately the longest stable step of RK4 at the start pose in [s], joint by joint.

    2.8 over the largest eigenvalue of a joint with its drive or spring, all others free: (M^-1)_ii is the
    acceleration of the joint for a unit of torque.

    Args:
        chain: The arm, with masses and a drive or a spring for each coordinate.
    """
    by_joint = {drive.joint: drive for drive in chain.drives}
    compliance = np.linalg.inv(_mass_array(chain, np.array(chain.start, dtype=np.float64)))
    rates = (
        np.abs(np.linalg.eigvals(_joint_matrix(by_joint[name], compliance[k, k]))).max()
        for k, name in enumerate(chain.coordinates)
    )
    return float(RK4_STABILITY / max(rates))


def _joint_matrix(drive: JointDrive, inverse_inertia: float) -> FloatArray:
    """Return the matrix of the linear motion of q, q', theta1, theta1', i_a of a joint, by its 1 / J."""
    if isinstance(drive, PassiveJoint):
        return np.array([[0.0, 1.0], [-drive.stiffness * inverse_inertia, -drive.damping * inverse_inertia]])
    k, damping, ratio, constant, resistance, inductance, inertia = drive.drive
    torque = np.array([-k, -damping, k, damping, 0.0])
    spring = np.array([-drive.spring.stiffness, 0.0, 0.0, 0.0, 0.0])
    _, qd, _, rate, current = np.eye(5)
    return np.array(
        [
            qd,
            inverse_inertia * (torque + spring),
            rate,
            (ratio * constant * current - torque) / inertia,
            -(constant * ratio * rate + resistance * current) / inductance,
        ]
    )


def spectral_radius(chain: Chain, q: FloatArray) -> float:
    """Return the factor per sample by which the slowest motion about a pose decays, below 1, or grows [-].

    With controllers of several periods it is that of the shortest time after which all sample together again,
    converted to the shortest period.

    Args:
        chain: The arm, with masses, and a drive or a spring for each coordinate; one drive at least.
        q: The pose, one value per coordinate in [rad] or [m], shape (coordinates,).

    Source: [Iso9283]_ eq. 13-20, eq. 20 with the corrected sign.
    """
    from scipy.linalg import expm

    motion, voltage, gains = _linearise(chain, q)
    drives = [drive for drive in chain.drives if isinstance(drive, DrivenJoint)]
    periods = np.array([round(drive.period * NANOSECONDS) for drive in drives])
    step, states, inputs = int(np.gcd.reduce(periods)), len(motion), len(drives)
    augmented = np.zeros((states + inputs, states + inputs))  # states and constant voltages
    augmented[:states] = np.hstack((motion, voltage))
    transition = expm(augmented * (step / NANOSECONDS))
    rounds = math.lcm(*periods.tolist()) // step
    product = np.eye(states + inputs)
    for k in range(rounds):
        is_due = (k * step) % periods == 0
        sampling = np.eye(states + inputs)
        sampling[states:, :states] = -np.where(is_due[:, np.newaxis], gains, 0.0)
        product = transition @ sampling @ product
    radius = float(np.abs(np.linalg.eigvals(product)).max())
    return float(radius ** (int(periods.min()) / step / rounds))


def _linearise(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B and the gains about a pose: u_n = u_n-1 - gains x.

    x holds q and q' of all coordinates, then theta1, theta1' and i_a of those with a drive, as deviations.
    """
    count, by_joint = len(chain.coordinates), {drive.joint: drive for drive in chain.drives}
    drives = [by_joint[name] for name in chain.coordinates]
    driven = [(k, drive) for k, drive in enumerate(drives) if isinstance(drive, DrivenJoint)]
    size = 2 * count + 3 * len(driven)
    torque = np.zeros((count, size))
    torque[:, :count] = -_gravity_stiffness(chain, q)
    for k, passive in enumerate(drives):
        if isinstance(passive, PassiveJoint):
            torque[k, [k, count + k]] -= passive.stiffness, passive.damping
    motion, voltage = np.zeros((size, size)), np.zeros((size, len(driven)))
    motion[:count, count : 2 * count] = np.eye(count)
    for j, (k, drive) in enumerate(driven):
        angle = 2 * count + 3 * j
        rate, current = angle + 1, angle + 2
        stiffness, damping, ratio, constant, resistance, inductance, inertia = map(float, drive.drive)
        shaft = np.zeros(size)
        shaft[[angle, rate, k, count + k]] = stiffness, damping, -stiffness, -damping
        torque[k] += shaft
        torque[k, k] -= float(drive.spring.stiffness)
        motion[angle, rate] = 1.0
        motion[rate] = -shaft / inertia
        motion[rate, current] += ratio * constant / inertia
        motion[current, [rate, current]] = -constant * ratio / inductance, -resistance / inductance
        voltage[current, j] = 1.0 / inductance
    motion[count : 2 * count] = np.linalg.solve(_mass_array(chain, q), torque)
    gains = np.zeros((len(driven), size))
    for j, (k, drive) in enumerate(driven):
        gains[j] = float(drive.gains.acceleration) * motion[count + k]
        gains[j, [k, count + k]] += float(drive.gains.position), float(drive.gains.velocity)
    return motion, voltage, gains


def _mass_array(chain: Chain, q: FloatArray) -> FloatArray:
    return np.array(mass_matrix(chain, q.tolist()), dtype=np.float64)


def _gravity_stiffness(chain: Chain, q: FloatArray) -> FloatArray:
    """Return d g / d q, the derivative of the torques of gravity, shape (n, n), by central differences."""
    zero, steps = [0.0] * len(q), GRAVITY_STEP * np.eye(len(q))
    torques = inverse_dynamics(chain, list(q[:, np.newaxis] + np.hstack((steps, -steps))), zero, zero)
    columns = np.array([np.broadcast_to(torque, 2 * len(q)) for torque in torques])
    after, before = np.hsplit(columns, 2)
    return np.asarray((after - before) / (2.0 * GRAVITY_STEP))
