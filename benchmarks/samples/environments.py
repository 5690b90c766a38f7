"""The environments that make an arm follow the path, each with its own solver, timing and structure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from samples.path import SAMPLES, TIMES, SamplePath, ease

from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import jacobian_over_log, positions_over_log
from urmpipe_models.math3d import translation

# [UrmArm2021]_ Table 1 (the tilts as the errata give them) and the calibration pose of section 2.4.
LENGTHS = (0.243215, 0.212430, 0.212430, 0.212430, 0.212430, 0.212430, 0.042215)
TILTS = (np.deg2rad(52.0),) * 6
START: FloatArray = np.array([0.0, np.pi, 0.0, np.pi, 0.0, np.pi])

LAG = 0.004
"""Delay of the joints in the MATLAB environment, in [s]."""
SHIFT = (0.0015, -0.0012, 0.0016)
"""Where the base of the SolidWorks structure stands, in [m]: 2.5 mm off."""
COUNTER_ROTATING = 3
"""The module, from 1, that counter-rotates in the last structure."""


def urm6(directions: Sequence[int] = ()) -> Chain:
    """Return the paper's arm, with some modules counter-rotating if asked."""
    return urm_chain("urm6", LENGTHS, TILTS, directions=directions)


def tip(q: FloatArray, arm: Chain | None = None) -> FloatArray:
    """Return the tool centre point in [m], shape (3,), of one pose."""
    return np.asarray(positions_over_log(arm or urm6(), q[None])[0])


@dataclass(frozen=True)
class Environment:
    """Something that makes an arm follow the path, well or less well.

    Attributes:
        arm: The structure that its joints move.
        damping: lambda of its damped least squares, in [m/rad]: a step leaves lambda^2 / (sigma^2 + lambda^2)
            of the deviation in a direction whose singular value is sigma.
        tolerance: It steps again while an axis is off by more, in [m].
        lag: How late its joints are, in [s].
    """

    arm: Chain
    damping: float
    tolerance: float
    lag: float = 0.0


ENVIRONMENTS = {
    "coppeliasim": Environment(urm6(), 0.17, 0.0025),
    "matlab": Environment(urm6(), 0.005, 1e-9, LAG),
    "solidworks": Environment(urm6().placed(base=translation(*SHIFT)), 0.005, 1e-9),
    "counter_rotating": Environment(
        urm6([-1 if k == COUNTER_ROTATING else 1 for k in range(1, 7)]), 0.005, 1e-9
    ),
}


def follow(environment: Environment, path: SamplePath, samples: int = SAMPLES) -> FloatArray:
    """Return the joint angles in [rad], not wrapped, shape (samples, 6), that the environment finds.

    Each sample starts from the last one: the arm moves within itself, then its tip is brought to the path.
    """
    clock = np.maximum(TIMES[:samples] - environment.lag, 0.0)
    targets = path.at(clock)
    found = np.empty((samples, 6))
    found[0] = settle(environment, targets[0])
    for k in range(1, samples):
        q = found[k - 1]
        moved = q + (clock[k] - clock[k - 1]) * self_motion(environment.arm, q, clock[k])
        found[k] = reach(environment, moved, targets[k])
    return found


def settle(environment: Environment, target: FloatArray) -> FloatArray:
    """Return the pose in [rad] next to the calibration pose that brings the tip to the target.

    In the calibration pose all axes lie in one plane, so the tip can move along y only; where it is not on
    the target, the arm is bent a little first.
    """
    sense = senses(environment.arm)
    start = sense * START + 0.0
    if np.abs(target - tip(start, environment.arm)).max() < 1e-9:
        return start
    return reach(environment, start + 0.01 * sense * DEPARTURE, target)


def reach(environment: Environment, q: FloatArray, target: FloatArray) -> FloatArray:
    """Return q after damped least squares steps towards the target: q + J^T (J J^T + lambda^2 I)^-1 e.

    At least one step is done, and up to 30 while an axis is out of the environment's tolerance (close to the
    singular calibration pose not even these reach a nanometre).
    """
    damped = environment.damping**2 * np.eye(3)
    error = target - tip(q, environment.arm)
    for _ in range(30):
        J = jacobian_over_log(environment.arm, q[None])[0, :3]
        q = q + J.T @ np.linalg.solve(J @ J.T + damped, error)
        error = target - tip(q, environment.arm)
        if np.abs(error).max() <= environment.tolerance:
            break
    return q


DEPARTURE = np.array([0.0, -0.3, -0.3, -0.3, -0.3, 0.0])
"""Rates in [rad/s] that bend the arm out of the calibration pose's plane."""
SPIN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -0.8])
"""Rates in [rad/s] that the last module turns with all the while."""
ASCENT = 25.0
"""Rate in [rad/s] per unit gradient of the manipulability in [m^3/rad]."""


def self_motion(arm: Chain, q: FloatArray, t: float) -> FloatArray:
    """Return joint rates in [rad/s], shape (6,), that leave the tip where it is (to first order).

    The null-space part of what is wanted: bend out of the plane at first, turn the last module, and
    climb the manipulability sqrt(det(J J^T)) away from singular poses.
    """
    h = 1e-5
    nearby = q + h * np.concatenate([np.zeros((1, 6)), np.eye(6), -np.eye(6)])
    J = jacobian_over_log(arm, nearby)[:, :3]
    manipulability = np.sqrt(np.maximum(np.linalg.det(J @ J.transpose(0, 2, 1)), 0.0))
    gradient = (manipulability[1:7] - manipulability[7:]) / (2.0 * h)

    bend = (ease(t / 0.5) - ease((t - 2.0) / 2.0)) * DEPARTURE
    wanted = ASCENT * gradient + senses(arm) * (bend + SPIN)
    wanted = wanted * (ease(t) - ease((t - TIMES[-1] + 2.0) / 2.0))
    damped = J[0] @ J[0].T + 1e-4 * np.eye(3)  # 0.01 m/rad: the first poses are singular
    return np.asarray(wanted - J[0].T @ np.linalg.solve(damped, J[0] @ wanted))


def senses(arm: Chain) -> FloatArray:
    """Return +1 for a module that turns as the others do, -1 for one that counter-rotates."""
    return np.array([joint.axis[2] for joint in arm.moving])
