"""Whether the sampled controllers of an arm are stable: its motion about a pose, from sample to sample.

About a pose at rest the arm with its drives is linear, x' = A x + B u, and between two samples the voltages u
are held: x_n+1 = exp(A T) x_n + (integral of exp(A t) B) u_n. With u_n of eq. 20 that is one matrix; if its
spectral radius is below 1, what disturbs the arm dies away.
"""

from __future__ import annotations

import math

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.drives.joint_drives import DrivenJoint, HeldJoint
from urmpipe_models.dynamics.inverse import inverse_dynamics
from urmpipe_models.dynamics.mass_matrix import mass_matrix

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
        if isinstance(held, HeldJoint):
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
