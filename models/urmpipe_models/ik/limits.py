"""Limits of joints: which turn of a solution is allowed, and which solution is not.

A revolute joint takes the same pose after a whole turn, 2 pi, unless a mimic follows it by another multiple
(`is_periodic`). So a solution is shifted by whole turns into the limits of its joints, into the turn nearest
to given joint values (`shift_into_limits`, `limit_solutions`). A joint without limits turns without end; it
has a period (`joint_periods`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.ik.solutions import Solutions, format_with_limits

LIMIT_ROUNDING = 1e-11  # [rad] or [m]; a solution beyond a limit by this is set to the limit: rounding
TURN = 2.0 * math.pi  # [rad]


def joint_limits(chain: Chain) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper limits of all coordinates in [rad] or [m], each of shape (joints,)."""
    joints = chain.moving
    return np.array([joint.lower for joint in joints]), np.array([joint.upper for joint in joints])


def is_periodic(chain: Chain) -> BoolArray:
    """Return whether a whole turn of a joint changes no pose, shape (joints,).

    A joint that a mimic follows is periodic only if the mimic turns by whole turns, too.
    """
    not_periodic = {
        joint.mimic.joint
        for joint in chain.joints
        if joint.mimic is not None
        and not (joint.kind == "revolute" and float(joint.mimic.multiplier).is_integer())
    }
    return np.array([joint.kind == "revolute" and joint.name not in not_periodic for joint in chain.moving])


def joint_periods(chain: Chain) -> FloatArray:
    """Return 2 pi of each revolute joint without limits, infinity of any other, in [rad], shape (joints,).

    A joint with limits has no period even if it can turn more than once, as those of a UR arm: from 6.2 rad
    to 0.1 rad it is not 0.18 rad if it ends at 2 pi. `limit_solutions` knows which of its turns is allowed
    and nearest.
    """
    endless = [not (math.isfinite(joint.lower) or math.isfinite(joint.upper)) for joint in chain.moving]
    return np.where(is_periodic(chain) & np.array(endless), TURN, np.inf)


def limit_solutions(chain: Chain, solutions: Solutions, near: FloatArray | None = None) -> Solutions:
    """Return solutions with every revolute joint shifted by whole turns into its limits.

    Args:
        chain: The arm.
        solutions: Its solutions, limits not considered.
        near: Joint values in [rad] or [m], shape (joints,) or (n, joints): of the allowed turns the
            nearest to it is taken; to 0 by default.

    Returns:
        The solutions; NaN with a reason where a joint cannot be shifted into its limits.
    """
    q, outside = shift_into_limits(
        chain, solutions.q, 0.0 if near is None else np.atleast_2d(near)[:, None, :]
    )
    refused = np.asarray(outside.any(axis=2))
    texts, periodic = solutions.reasons.copy(), is_periodic(chain)
    for target, column in zip(*np.nonzero(refused), strict=True):
        violations = [
            _limit_violation(
                chain.moving[joint], float(solutions.q[target, column, joint]), bool(periodic[joint])
            )
            for joint in np.flatnonzero(outside[target, column])
        ]
        texts[target, column] = "; ".join(violations)
    return replace(
        solutions,
        q=np.where(refused[..., None], np.nan, q),
        reasons=texts,
        singular=tuple(replace(poses, where=poses.where & ~refused) for poses in solutions.singular),
    )


def _limit_violation(joint: Joint, value: float, periodic: bool) -> str:
    if periodic:
        value += TURN * round((0.5 * (joint.lower + joint.upper) - value) / TURN)
    unit = "m" if joint.kind == "prismatic" else "rad"
    text, lower, upper = format_with_limits(value, joint.lower, joint.upper)
    return f"joint {joint.name} at {text} {unit}, allowed: {lower} to {upper} {unit}"


def shift_into_limits(chain: Chain, q: FloatArray, near: FloatArray | float) -> tuple[FloatArray, BoolArray]:
    """Return joint values shifted by whole turns into their limits, and where that is not possible.

    Args:
        chain: The arm.
        q: In [rad] or [m], shape (..., joints).
        near: Of the allowed turns the nearest to it is taken, in [rad] or [m], shape (..., joints)
            or (joints,).

    Returns:
        In [rad] or [m] and [-], shape (..., joints) both; a value outside of its limits is set to the
        nearest one.
    """
    lower, upper = joint_limits(chain)
    least = np.ceil((lower - LIMIT_ROUNDING - q) / TURN)
    most = np.floor((upper + LIMIT_ROUNDING - q) / TURN)
    turns = np.where(is_periodic(chain), np.clip(np.round((near - q) / TURN), least, most), 0.0)
    shifted = q + turns * TURN
    outside = (shifted < lower - LIMIT_ROUNDING) | (shifted > upper + LIMIT_ROUNDING)
    return np.clip(shifted, lower, upper), outside


def shift_towards_limits(chain: Chain, q: FloatArray) -> FloatArray:
    """Return q with each joint in the turn nearest to its limits, both in [rad] or [m], shape (n, joints)."""
    lower, upper = joint_limits(chain)
    limited = is_periodic(chain) & np.isfinite(lower) & np.isfinite(upper)
    middle = np.where(limited, 0.5 * (lower + upper), 0.0)
    return np.where(limited, q + TURN * np.round((middle - q) / TURN), q)


def wrap_continuous_joints(q: FloatArray, period: FloatArray) -> FloatArray:
    """Return joint values with those of joints without limits within (-pi, pi].

    Args:
        q: In [rad] or [m], shape (..., joints).
        period: Of each joint in [rad], shape (joints,): see `joint_periods`.

    Returns:
        In [rad] or [m], shape (..., joints).
    """
    turning = np.isfinite(period)
    values = q.copy()
    values[..., turning] -= TURN * np.ceil((q[..., turning] - math.pi) / TURN)
    return values


def unwrap_within_limits(chain: Chain, q: FloatArray, last: FloatArray) -> FloatArray:
    """Return joint values with each joint in the allowed turn that is nearest to the sample before.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], within limits, shape (m, joints); NaN in missing rows.
        last: Those of the sample before the first, in [rad] or [m], shape (joints,).

    Returns:
        Joint values in [rad] or [m], shape (m, joints).
    """
    turned = q.copy()
    for sample in np.flatnonzero(np.isfinite(q).all(axis=1)).tolist():
        turned[sample] = last = shift_into_limits(chain, q[sample], last)[0]
    return turned
