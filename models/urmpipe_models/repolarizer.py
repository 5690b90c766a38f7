"""The repolarizer: undoes the jumps of joints that an environment limits to one period.

A joint that passes +pi in an environment limited to +-pi goes on from -pi. The repolarizer adds whole
periods, out = in + P k, so that the joint goes on where it was. It is causal, filters nothing and
delays nothing; before the first repolarization the output is the input, bit for bit.

A step d between two samples is a repolarization when it is a whole period but for what the joint can
have moved meanwhile: | |d| - P | <= max_step, max_step = min(largest speed x dt, P / 4). A step that is
merely larger than half a period is none: it stays, flagged as unexplained.

Source: [UrmArm2021]_ eq. 15-18 with the corrections of the errata (eq. 17's sign, multi-turn k, eq. 18
as a threshold).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import Element
from urmpipe_models.kinematics import FloatArray, row_blocks

FULL_TURN = 2.0 * np.pi
"""Period of an angle in [rad]."""

NO_LIMIT = 1e30
"""Stands for the speed of a joint without a limit: finite, so that a speed times no time is 0."""

LARGEST_VALUE = 1e300
"""A value at or above it is missing, as NaN is: the comparison also traces, where isnan does not."""


class State(NamedTuple):
    """What the repolarizer of one joint remembers.

    Attributes:
        last: The last input that had a value, in the unit of the period.
        before: The one before it: two samples back.
        turns: k, the whole periods added now.
        elapsed: Time since `last` in [s]; more than a sample where values are missing.
        seen: How many values came so far, counted to 2.
    """

    last: Element = 0.0
    before: Element = 0.0
    turns: Element = 0.0
    elapsed: Element = 0.0
    seen: Element = 0.0


class Flags(NamedTuple):
    """What the repolarizer noticed at a sample.

    Attributes:
        change: Change of k: -1, 0 or 1.
        unexplained: True (1 in a trace) for a step above P / 4 that is no repolarization.
    """

    change: Element
    unexplained: Element


class Repolarized(NamedTuple):
    """A log's joint values, repolarized.

    Attributes:
        q: Repolarized values, shape (n, joints).
        rows: Row index of every repolarization, from 0, ascending, shape (r,).
        joints: Joint index of each, shape (r,).
        change: Change of k at each, shape (r,).
        unexplained: Row and joint index of every unexplained step, shape (u, 2).
    """

    q: FloatArray
    rows: NDArray[np.int64]
    joints: NDArray[np.int64]
    change: NDArray[np.int64]
    unexplained: NDArray[np.int64]


def max_step(elapsed: Element, period: Element, max_speed: Element) -> Element:
    """Return how far a joint can have moved: min(max_speed x elapsed, P / 4), in the period's unit.

    Args:
        elapsed: Time since the last value in [s].
        period: P.
        max_speed: Largest speed in the period's unit per second; inf without a limit.
    """
    return np.minimum(np.minimum(max_speed, NO_LIMIT) * elapsed, period / 4.0)


def notice(last: Element, q: Element, period: Element, allowed: Element) -> Flags:
    """Judge the step from one value to the next: the decision of the repolarizer, and all of it.

    Args:
        last: Value before, in the unit of the period.
        q: Value now.
        period: P.
        allowed: What `max_step` returns.

    Returns:
        The change of k and the flag; no change and no flag where a value is missing (NaN).
    """
    step = q - last
    size = np.abs(step)
    wrapped = np.abs(size - period) <= allowed
    change = np.where(wrapped, -np.sign(step), 0.0)
    return Flags(change, np.logical_and(size > period / 4.0, np.logical_not(wrapped)))


def turned(q: Element, turns: Element, period: Element) -> Element:
    """Return q + P k, and q itself, bit for bit, where k = 0 (eq. 15)."""
    return np.where(turns == 0.0, q, q + period * turns)


def step(
    state: State, q: Element, dt: Element, *, period: Element = FULL_TURN, max_speed: Element = np.inf
) -> tuple[State, Element, Flags]:
    """Take one sample of one joint (or of many: the arguments are elements).

    Args:
        state: What is remembered; `State()` before the first sample.
        q: The input, in the unit of the period; NaN where the sample is missing.
        dt: Time since the sample before, in [s].
        period: P: 2 pi for [rad], 360 for [deg].
        max_speed: Largest speed in the period's unit per second; inf without a limit.

    Returns:
        The state to remember, the repolarized value (NaN where the sample is missing) and the flags.

    Source: [UrmArm2021]_ eq. 15-18.
    """
    elapsed = state.elapsed + dt
    flags = notice(state.last, q, period, max_step(elapsed, period, max_speed))
    known = state.seen > 0.0
    flags = Flags(np.where(known, flags.change, 0.0), np.logical_and(known, flags.unexplained))
    turns = state.turns + flags.change
    has_value = np.abs(q) < LARGEST_VALUE
    following = State(
        last=np.where(has_value, q, state.last),
        before=np.where(has_value, state.last, state.before),
        turns=turns,
        elapsed=np.where(has_value, 0.0, elapsed),
        seen=np.where(has_value, np.minimum(state.seen + 1.0, 2.0), state.seen),
    )
    return following, turned(q, turns, period), flags


def repolarize(
    q: FloatArray, dt: FloatArray, *, period: float = FULL_TURN, max_speed: FloatArray | float = np.inf
) -> Repolarized:
    """Repolarize a whole log: what `step` gives sample by sample, bit for bit.

    Args:
        q: Joint values in the unit of the period, shape (n, joints); NaN where a sample is missing.
        dt: Time from the row before in [s], shape (n,); the first is not used.
        period: P.
        max_speed: Largest speeds in the period's unit per second, shape (joints,) or one for all.
    """
    count, joints = q.shape
    speeds = np.broadcast_to(np.asarray(max_speed, dtype=np.float64), (joints,))
    missing = np.isnan(q.sum())  # one pass over all says whether to look column by column
    complete = ~np.isnan(q.sum(axis=0)) if missing else np.ones(joints, dtype=np.bool_)
    found = [_steps_of_complete(q, dt, period, speeds, complete)]
    found += [_steps_of_sparse(q, dt, period, speeds, j) for j in map(int, np.flatnonzero(~complete))]
    rows, columns, change, odd = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((columns, rows))
    rows, columns, change, odd = rows[order], columns[order], change[order], odd[order]
    out = q.copy()
    for j in np.unique(columns[change != 0]):
        mine = (columns == j) & (change != 0)
        bounds = [*rows[mine], count]
        for k, start, end in zip(np.cumsum(change[mine]), bounds[:-1], bounds[1:], strict=True):
            out[start:end, j] = turned(q[start:end, j], float(k), period)
    wraps = change != 0
    return Repolarized(out, rows[wraps], columns[wraps], change[wraps], np.column_stack((rows, columns))[odd])


_Found = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]


def _steps_of_complete(
    q: FloatArray, dt: FloatArray, period: float, speeds: FloatArray, complete: NDArray[np.bool_]
) -> _Found:
    """Find the steps of the columns that miss no sample; only steps above P / 4 need to be judged."""
    candidates = [_nothing()[:2]]
    for block in row_blocks(len(q) - 1):
        large = np.abs(q[1:][block] - q[:-1][block]) > period / 4.0
        if large.any():
            at_row, at_column = np.nonzero(large)
            candidates.append((at_row + block.start + 1, at_column))
    rows, columns = (np.concatenate(parts) for parts in zip(*candidates, strict=True))
    rows, columns = rows[complete[columns]], columns[complete[columns]]
    allowed = max_step(dt[rows], period, speeds[columns])
    flags = notice(q[rows - 1, columns], q[rows, columns], period, allowed)
    return rows, columns, flags.change.astype(np.int64), flags.unexplained


def _steps_of_sparse(q: FloatArray, dt: FloatArray, period: float, speeds: FloatArray, joint: int) -> _Found:
    """Find the steps of a column with missing samples: between values, over the time that they lie apart."""
    present = np.flatnonzero(np.abs(q[:, joint]) < LARGEST_VALUE)
    if len(present) < 2:
        return _nothing()
    elapsed = dt[present[1:]]
    for i in np.flatnonzero(np.diff(present) > 1):
        # np.cumsum adds from left to right, as `step` does; a difference of times would round otherwise
        elapsed[i] = np.cumsum(dt[present[i] + 1 : present[i + 1] + 1])[-1]
    flags = notice(
        q[present[:-1], joint], q[present[1:], joint], period, max_step(elapsed, period, speeds[joint])
    )
    at = np.flatnonzero((flags.change != 0.0) | flags.unexplained)
    rows = present[1:][at]
    return rows, np.full(len(rows), joint), flags.change[at].astype(np.int64), flags.unexplained[at]


def _nothing() -> _Found:
    none = np.empty(0, dtype=np.int64)
    return none, none, none, np.empty(0, dtype=np.bool_)
