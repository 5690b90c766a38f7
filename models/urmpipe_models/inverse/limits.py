"""The limits of joints: which turn of a solution is allowed, and which solution is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, TextArray
from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.inverse.figures import figures
from urmpipe_models.inverse.solutions import Solutions

LIMIT_ROUNDING = 1e-11
"""A solution beyond a limit by this, in [rad] or [m], is on it: rounding. It is put on the limit."""

TURN = 2.0 * math.pi


def periods(chain: Chain) -> FloatArray:
    """Return 2 pi of each joint that may turn without end, infinity of any other, in [rad], shape (joints,).

    Without end turns a revolute joint without limits. One that may turn by several turns but has limits, as
    those of a UR arm, has none: from 6.2 rad to 0.1 rad it is not 0.18 rad if it ends at 2 pi. Which of its
    turns is allowed and nearest, `within_limits` knows.
    """
    free = [not (math.isfinite(joint.lower) or math.isfinite(joint.upper)) for joint in chain.moving]
    return np.where(turning(chain) & np.array(free), TURN, np.inf)


def within_limits(chain: Chain, solutions: Solutions, near: FloatArray | None = None) -> Solutions:
    """Return solutions with every revolute joint shifted by whole turns into its limits.

    Args:
        chain: The arm.
        solutions: Its solutions, limits not asked.
        near: Joint values in [rad] or [m], shape (joints,) or (n, joints): of the turns that are allowed the
            nearest to it is taken; to 0 by default.

    Returns:
        The solutions; one with a joint that cannot be brought into its limits is NaN and has a reason.
    """
    q, outside = in_nearest_turn(chain, solutions.q, 0.0 if near is None else np.atleast_2d(near)[:, None, :])
    refused = np.asarray(outside.any(axis=2))
    return replace(
        solutions,
        q=np.where(refused[..., None], np.nan, q),
        reasons=_reasons(chain, solutions, outside),
        singular=tuple(replace(one, where=one.where & ~refused) for one in solutions.singular),
    )


def in_nearest_turn(chain: Chain, q: FloatArray, near: FloatArray | float) -> tuple[FloatArray, BoolArray]:
    """Return joint values shifted by whole turns into their limits, and where they cannot be brought there.

    Args:
        chain: The arm.
        q: In [rad] or [m], shape (..., joints).
        near: Of the turns that are allowed the nearest to it is taken, in [rad] or [m], shape (..., joints)
            or (joints,).

    Returns:
        In [rad] or [m] and [-], shape (..., joints) both; what is outside of its limits is put on the nearest
        one.
    """
    lower, upper = limits_of(chain)
    least = np.ceil((lower - LIMIT_ROUNDING - q) / TURN)
    most = np.floor((upper + LIMIT_ROUNDING - q) / TURN)
    turns = np.where(turning(chain), np.clip(np.round((near - q) / TURN), least, most), 0.0)
    shifted = q + turns * TURN
    outside = (shifted < lower - LIMIT_ROUNDING) | (shifted > upper + LIMIT_ROUNDING)
    return np.clip(shifted, lower, upper), outside


def within_pi(q: FloatArray, period: FloatArray) -> FloatArray:
    """Return joint values with those of joints that turn without end within (-pi, pi].

    Args:
        q: In [rad] or [m], shape (..., joints).
        period: Of each joint in [rad], shape (joints,): see `periods`.

    Returns:
        In [rad] or [m], shape (..., joints).
    """
    turning = np.isfinite(period)
    values = q.copy()
    values[..., turning] -= TURN * np.ceil((q[..., turning] - math.pi) / TURN)
    return values


def nearest_to_limits(chain: Chain, q: FloatArray) -> FloatArray:
    """Return q with each joint in the turn nearest to its limits, both in [rad] or [m], shape (n, joints)."""
    lower, upper = limits_of(chain)
    limited = turning(chain) & np.isfinite(lower) & np.isfinite(upper)
    middle = np.where(limited, 0.5 * (lower + upper), 0.0)
    return np.where(limited, q + TURN * np.round((middle - q) / TURN), q)


def limits_of(chain: Chain) -> tuple[FloatArray, FloatArray]:
    """Return the least and the largest value of every coordinate in [rad] or [m], each of shape (joints,)."""
    return np.array([one.lower for one in chain.moving]), np.array([one.upper for one in chain.moving])


def turning(chain: Chain) -> BoolArray:
    """Return true of the joints that a whole turn leaves where they were, shape (joints,).

    One that another follows (mimic) is among them only if that one turns by whole turns, too.
    """
    barred = {
        joint.mimic.joint
        for joint in chain.joints
        if joint.mimic is not None
        and not (joint.kind == "revolute" and float(joint.mimic.multiplier).is_integer())
    }
    return np.array([joint.kind == "revolute" and joint.name not in barred for joint in chain.moving])


def _reasons(chain: Chain, solutions: Solutions, outside: BoolArray) -> TextArray:
    """Return the reasons of solutions with those of the joints that are outside their limits."""
    texts = solutions.reasons.copy()
    for target, column in zip(*np.nonzero(outside.any(axis=2)), strict=True):
        faults = [
            _fault(
                chain.moving[joint], float(solutions.q[target, column, joint]), bool(turning(chain)[joint])
            )
            for joint in np.flatnonzero(outside[target, column])
        ]
        texts[target, column] = "; ".join(faults)
    return texts


def _fault(joint: Joint, value: float, turns: bool) -> str:
    """Say that a joint cannot be at a value in [rad] or [m], in the turn nearest to its limits."""
    if turns:
        value += TURN * round((0.5 * (joint.lower + joint.upper) - value) / TURN)
    unit = "m" if joint.kind == "prismatic" else "rad"
    found, lower, upper = figures(value, joint.lower, joint.upper)
    return f"joint {joint.name} at {found} {unit}, allowed: {lower} to {upper} {unit}"
