"""Arms, joint values and times of the tests of inverse kinematics."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.limits import joint_limits
from urmpipe_models.ik.path import JointPath, solve_path
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.math3d import translation

PERIOD = 5_000_000  # ns
UR = np.array([0.3, -1.2, 1.4, -0.8, 1.2, 0.3])  # a pose in rad of a UR arm, its elbow and wrist bent


def times(count: int) -> NDArray[np.int64]:
    return PERIOD * np.arange(count, dtype=np.int64)


def planar(*lengths: float, lower: float = -math.inf, upper: float = math.inf) -> Chain:
    """Return an arm in the plane, its joints about z, with limits of the first one in [rad]."""
    others = [Joint(f"q{k + 2}", origin=translation(a, 0.0, 0.0)) for k, a in enumerate(lengths[:-1])]
    first = Joint("q1", lower=lower, upper=upper)
    return Chain("planar", (first, *others), tip=translation(lengths[-1], 0.0, 0.0))


def limited(chain: Chain, lower: float, upper: float, joint: int | None = None) -> Chain:
    """Return an arm with other limits of all joints, or of one that moves."""
    joints = list(chain.joints)
    for k, item in enumerate(joints):
        if joint is None or item is chain.moving[joint]:
            joints[k] = replace(item, lower=lower, upper=upper)
    return replace(chain, joints=tuple(joints))


def joints_within(chain: Chain, count: int, seed: int | np.random.Generator) -> FloatArray:
    """Return joint values, uniform within limits and one turn, shape (count, joints)."""
    lower, upper = joint_limits(chain)
    low, high = np.maximum(lower, -math.pi), np.minimum(upper, math.pi)
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def by_shorter_way(difference: FloatArray) -> FloatArray:
    """Return differences of angles in [-pi, pi), in [rad]."""
    return np.asarray(np.remainder(difference + math.pi, 2.0 * math.pi) - math.pi)


def line(by: list[float], count: int, first: FloatArray = UR) -> FloatArray:
    """Return joint values from a pose on, on a line, shape (count, joints)."""
    return np.asarray(first + np.linspace(0.0, 1.0, count)[:, None] * np.array(by))


def follow(chain: Chain, q: FloatArray, targets: Targets | None = None, **options: Any) -> JointPath:
    """Solve the path of joint values at 5 ms, or that of other targets, from the first of them on."""
    targets = forward_targets(chain, q) if targets is None else targets
    return solve_path(chain, targets, times(len(targets)), **{"start": q[0], **options})
