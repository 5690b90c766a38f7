"""Postures of the first three joints of an arm, and how two that are one are told once."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, TextArray
from urmpipe_models.inverse.closed.trigonometric import wrapped
from urmpipe_models.inverse.solutions import SingularFamily

Meeting: TypeAlias = dict[SingularFamily, BoolArray]
"""Where two postures are one, by the family of such poses."""

SAME = 1e-5
"""Polished postures that differ by less than this, in [rad] or the arm's size, are one."""


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """Joints 1 to 3 of n targets in k postures.

    Attributes:
        q: In [rad] or [m], shape (3, k, n); NaN where there is none.
        reasons: Why there is none, shape (k, n).
        meeting: Where two postures are one, shape (k, n), by the family of such poses.
        on_axis: Where the wrist centre lies on axis 1 and on axis 2, each of shape (k, n).
    """

    q: FloatArray
    reasons: TextArray
    meeting: Meeting
    on_axis: tuple[BoolArray, BoolArray]


def leave_out_equal(
    q: FloatArray,
    turning: BoolArray,
    size: float,
    branches: tuple[str, ...],
    reasons: TextArray,
    meeting: Meeting,
) -> None:
    """Make NaN of every posture that an earlier one equals, and tell that they meet.

    Args:
        q: Joints 1 to 3 in [rad] or [m], shape (3, k, n); written.
        turning: Which of them are revolute, shape (3,).
        size: Of the arm in [m].
        branches: What the postures are called.
        reasons: Shape (k, n); written.
        meeting: Where they do, by what they meet in, shape (k, n); written.
    """
    meet = np.zeros(q.shape[1:], dtype=bool)
    for first, second in combinations(range(q.shape[1]), 2):
        away = q[:, first] - q[:, second]
        away = np.where(turning[:, None], wrapped(away), away / size)
        same = np.abs(away).max(axis=0) < SAME
        meet[first] |= same
        q[:, second, same] = np.nan
        reasons[second, same] = f"the same as {branches[first]}: both meet here"
    if meet.any():
        meeting["postures meet"] = meet | meeting.get("postures meet", False)


def leave_out_second(
    u1: FloatArray, u3: FloatArray, reasons: TextArray, meet: BoolArray, names: TextArray, axis: int
) -> None:
    """Leave out the second one of two postures that are one.

    Args:
        u1: In units of the arm's size, shape (2, sides, elbows, n); written.
        u3: Likewise.
        reasons: Shape (sides, elbows, n); written.
        meet: Where both are one, of the shape of reasons.
        names: Of the postures, shape (sides, elbows).
        axis: Which two: 0 both sides, 1 both elbows.
    """
    first: tuple[slice | int, ...] = (slice(None), 0) if axis == 1 else (0,)
    second: tuple[slice | int, ...] = (slice(None), 1) if axis == 1 else (1,)
    for u in (u1, u3):
        u[(slice(None), *second)][:, meet[second]] = np.nan
    same = np.array([f"the same as {name}: both meet here" for name in names[first]])
    where = meet[second] & (reasons[second] == "")
    reasons[second] = np.where(where, same[:, None], reasons[second])
