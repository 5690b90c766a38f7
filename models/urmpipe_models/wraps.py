"""The repolarizer: undoes the jumps of joints that an environment limits to one period.

A joint that passes +pi in an environment limited to +-pi goes on from -pi. The repolarizer adds whole
periods, out = in + P k, so that the joint goes on where it was. It is causal, filters nothing and
delays nothing; before the first repolarization the output is the input, bit for bit.

A step d between two samples is a repolarization when it is a whole period but for what the joint can
have moved meanwhile: | |d| - P | <= max_step, max_step = min(largest speed x dt, P / 4). So are two steps
of one sign that only together are a whole period: the sample between them was left on the jump by a
linear resampling, is no place where the joint ever was, and is told as an in-between sample. A step that
is merely larger than half a period is none: it stays, flagged as unexplained.

Source: [UrmArm2021]_ eq. 15-18 with the corrections of the errata (eq. 17's sign, multi-turn k, eq. 18
as a threshold).

In-between samples: what a linear resampling leaves on a wrap, found in a whole log and repaired.

A log that was resampled before its wraps were undone holds values on the straight line from +pi to -pi,
where the joint never was. `repolarize` tells those that hide a wrap from it. Here the others are found: next
to a step that is a wrap alone, where it takes the sample after to see them. The offline part of the
repolarizer, then, which needs the whole log.

Continuity of recorded orientations: the same rotation has many names, and a record jumps between them.

A quaternion q and -q are one rotation, so are a rotation vector v and v (1 + 2 pi k / |v|), and Euler angles
(a, b, c), (a + pi, pi - b, c + pi) - of one axis twice (a + pi, -b, c + pi) - and any turns more. Each
function goes on with the name nearest to the one before, so that values can be interpolated and
differentiated. The first sample keeps its own; a missing one (NaN) is passed over. What they need is that
less than a quarter turn of the axis and half a turn of the angle lie between two samples.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import Element, FloatArray, IntArray, row_blocks
from urmpipe_models.math3d import RotationForm

FULL_TURN = 2.0 * np.pi
"""Period of an angle in [rad]."""

NO_LIMIT = 1e30
"""Stands for the speed of a joint without a limit: finite, so that a speed times no time is 0."""

MAX_VALUE = 1e300
"""A value at or above it is missing, as NaN is: the comparison also traces, where isnan does not."""

MIN_WRAP_TOLERANCE = 0.01
"""Share of P by which a wrap may always miss the whole period: clocks jitter, and joints overshoot limits."""


class State(NamedTuple):
    """What the repolarizer of one joint remembers.

    Attributes:
        last: The last input that had a value, in the unit of the period.
        residual: The step to it in the turns of now, so less a period if it was a wrap; 0 where there is
            none, or where it was used up as a half of a wrap.
        lasted: Time that this step took in [s].
        turns: k, the whole periods added now.
        elapsed: Time since `last` in [s]; more than a sample where values are missing.
        seen: 1 once a value came.
    """

    last: Element = 0.0
    residual: Element = 0.0
    lasted: Element = 0.0
    turns: Element = 0.0
    elapsed: Element = 0.0
    seen: Element = 0.0


class Flags(NamedTuple):
    """What the repolarizer noticed at a sample.

    Attributes:
        change: Change of k: -1, 0 or 1.
        unexplained: True (1 in a trace) for a step above P / 4 that is no repolarization.
        in_between: True where this step and the one before are a wrap only together: the value before
            this one lies on the jump, and its step was told as unexplained if it is above P / 4.
    """

    change: Element
    unexplained: Element
    in_between: Element


class Repolarized(NamedTuple):
    """A log's joint values, repolarized.

    Attributes:
        q: Repolarized values in the unit of the period, shape (n, joints); NaN where a sample is missing.
        rows: Row index of every repolarization, from 0, ascending, shape (r,).
        joints: Joint index of each, shape (r,).
        change: Change of k at each, -1 or 1, shape (r,).
        unexplained: Row and joint index of every unexplained step, shape (u, 2), without those to an
            in-between sample, which the step after explains.
        in_between: Row and joint index of every in-between sample, shape (b, 2).
    """

    q: FloatArray
    rows: IntArray
    joints: IntArray
    change: IntArray
    unexplained: IntArray
    in_between: IntArray


def max_step(elapsed: Element, period: Element, max_speed: Element) -> Element:
    """Return how far a joint can have moved, in the period's unit.

    It is max_speed x elapsed, but not less than P / 100 and not more than P / 4.

    Args:
        elapsed: Time since the last value in [s].
        period: P.
        max_speed: Largest speed in the period's unit per second; inf without a limit.
    """
    reached = np.minimum(max_speed, NO_LIMIT) * elapsed
    return np.minimum(np.maximum(reached, MIN_WRAP_TOLERANCE * period), period / 4.0)


def wrap_change(step: Element, period: Element, allowed: Element) -> Element:
    """Return the change of k that a step asks for: -1, 0 or 1.

    Args:
        step: Difference of two values, in the unit of the period.
        period: P.
        allowed: By how much a whole period may be missed; see `max_step`.
    """
    return np.where(np.abs(np.abs(step) - period) <= allowed, -np.sign(step), 0.0)


def detect_wrap(
    step: Element, elapsed: Element, residual: Element, lasted: Element, period: Element, max_speed: Element
) -> Flags:
    """Judge the step from one value to the next: the decision of the repolarizer, and all of it.

    Args:
        step: The step, in the unit of the period.
        elapsed: Time that it took in [s].
        residual: The step before it in the turns of now, 0 for none.
        lasted: Time that one took in [s].
        period: P.
        max_speed: Largest speed in the period's unit per second; inf without a limit.

    Returns:
        The change of k and the flags; no change and no flag where a value is missing (NaN).
    """
    alone = wrap_change(step, period, max_step(elapsed, period, max_speed))
    both = wrap_change(residual + step, period, max_step(lasted + elapsed, period, max_speed))
    halves = np.logical_and(np.abs(alone) < 1.0, residual * step > 0.0)
    in_between = np.logical_and(halves, np.abs(both) > 0.0)
    change = np.where(in_between, both, alone)
    unexplained = np.logical_and(np.abs(step) > period / 4.0, np.abs(change) < 1.0)
    return Flags(change, unexplained, in_between)


def add_turns(q: Element, turns: Element, period: Element) -> Element:
    """Return q + P k in the unit of the period, and q itself, bit for bit, where k = 0.

    Args:
        q: A value as measured, in the unit of the period.
        turns: k, whole.
        period: P.

    Source: [UrmArm2021]_ eq. 15.
    """
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
    move = q - state.last
    has_value = np.abs(q) < MAX_VALUE
    known = np.logical_and(has_value, state.seen > 0.0)
    flags = detect_wrap(move, elapsed, state.residual, state.lasted, period, max_speed)
    flags = Flags(
        np.where(known, flags.change, 0.0),
        np.logical_and(known, flags.unexplained),
        np.logical_and(known, flags.in_between),
    )
    turns = state.turns + flags.change
    residual = np.where(flags.in_between, 0.0, move + period * flags.change)
    following = State(
        last=np.where(has_value, q, state.last),
        residual=np.where(known, residual, state.residual),
        lasted=np.where(known, elapsed, state.lasted),
        turns=turns,
        elapsed=np.where(has_value, 0.0, elapsed),
        seen=np.where(has_value, 1.0, state.seen),
    )
    return following, add_turns(q, turns, period), flags


def repolarize(
    q: FloatArray,
    dt: FloatArray,
    *,
    period: FloatArray | float = FULL_TURN,
    max_speed: FloatArray | float = np.inf,
) -> Repolarized:
    """Repolarize a whole log: what `step` gives sample by sample, bit for bit.

    Args:
        q: Joint values in the unit of the period, shape (n, joints); NaN where a sample is missing.
        dt: Time from the row before in [s], shape (n,); the first is not used.
        period: P, 2 pi for [rad], 360 for [deg], shape (joints,) or one for all.
        max_speed: Largest speeds in the unit of the period per second, shape (joints,) or one for all.
    """
    joints = q.shape[1]
    periods, speeds = (
        np.broadcast_to(np.asarray(one, dtype=np.float64), (joints,)) for one in (period, max_speed)
    )
    found = _found_in_all(q, dt, periods, speeds)
    wraps = found.change != 0
    out = q.copy()
    for j in np.unique(found.joints[wraps]):
        mine = wraps & (found.joints == j)
        _add_turns(out[:, j], found.rows[mine], found.change[mine], periods[j])
    on_jump = np.column_stack((found.between, found.joints))[found.between >= 0]
    odd = np.column_stack((found.rows, found.joints))[found.unexplained]
    explained = np.isin(odd[:, 0] * joints + odd[:, 1], on_jump[:, 0] * joints + on_jump[:, 1])
    return Repolarized(
        out, found.rows[wraps], found.joints[wraps], found.change[wraps], odd[~explained], on_jump
    )


def _add_turns(column: FloatArray, rows: IntArray, change: IntArray, period: float) -> None:
    """Repolarize a column in place, in blocks that stay in the cache."""
    k = np.append(0.0, np.cumsum(change))
    for block in row_blocks(len(column)):
        stop = min(block.stop, len(column))
        first, last = np.searchsorted(rows, (block.start, stop))
        bounds = np.concatenate(([block.start], rows[first:last], [stop]))
        column[block] = add_turns(column[block], np.repeat(k[first : last + 1], np.diff(bounds)), period)


class _Found(NamedTuple):
    """Steps that were judged: by row and joint index, `between` the row of the in-between sample or -1."""

    rows: IntArray
    joints: IntArray
    change: IntArray
    unexplained: NDArray[np.bool_]
    between: IntArray


def _found_in_all(q: FloatArray, dt: FloatArray, periods: FloatArray, speeds: FloatArray) -> _Found:
    """Judge the steps of all columns, by row and then by joint: whole columns at once, others one by one."""
    joints = q.shape[1]
    complete = np.ones(joints, dtype=np.bool_)
    # Least and largest of all are quick, and mostly enough: NaN is neither, nor within the bounds.
    if not -MAX_VALUE < q.min(initial=0.0) <= q.max(initial=0.0) < MAX_VALUE:
        complete[:] = (np.abs(q) < MAX_VALUE).all(axis=0)
    whole = np.flatnonzero(complete)
    part = q if complete.all() else q[:, whole]
    found = _judged(part, dt, periods[whole], speeds[whole])
    parts = [found._replace(joints=whole[found.joints])]
    for j in np.flatnonzero(~complete):
        present = np.flatnonzero(np.abs(q[:, j]) < MAX_VALUE)
        one = slice(j, j + 1)
        found = _judged(q[present, one], _elapsed(present, dt), periods[one], speeds[one])
        between = np.append(present, -1)[found.between]  # -1, for none, is the last entry
        parts.append(found._replace(rows=present[found.rows], joints=found.joints + j, between=between))
    rows = np.concatenate([one.rows for one in parts])
    columns = np.concatenate([one.joints for one in parts])
    order = np.argsort(rows * joints + columns)
    return _Found(
        rows[order],
        columns[order],
        np.concatenate([one.change for one in parts])[order],
        np.concatenate([one.unexplained for one in parts])[order],
        np.concatenate([one.between for one in parts])[order],
    )


def _judged(values: FloatArray, elapsed: FloatArray, periods: FloatArray, speeds: FloatArray) -> _Found:
    """Judge the steps of columns that miss no value: those above P / 4 and the ones after them.

    A wrap is above P / 4, and so is one of the two steps about an in-between sample.
    """
    rows, columns = _candidates(values, periods)
    step = values[rows, columns] - values[rows - 1, columns]
    # Nothing stands before the step from the first value to the second, whatever time it took.
    before = np.where(rows < 2, 0.0, values[rows - 1, columns] - values[rows - 2, columns])
    lasted = elapsed[rows - 1]
    period, speed = periods[columns], speeds[columns]
    residual = before + period * wrap_change(before, period, max_step(lasted, period, speed))
    flags = detect_wrap(step, elapsed[rows], residual, lasted, period, speed)
    again = _after_in_between(rows, columns, flags.in_between)
    change = np.where(again, 0.0, flags.change)  # the step before is used up: alone this one is no wrap
    in_between = flags.in_between & ~again
    unexplained = (np.abs(step) > period / 4.0) & (change == 0.0)
    return _Found(rows, columns, change.astype(np.int64), unexplained, np.where(in_between, rows - 1, -1))


def _candidates(values: FloatArray, periods: FloatArray) -> tuple[IntArray, IntArray]:
    """Return row and column of the steps above P / 4 and of those after them, by column and then by row."""
    count = len(values)
    keys = [np.empty(0, dtype=np.int64)]
    for block in row_blocks(count - 1):
        large = np.abs(values[1:][block] - values[:-1][block]) > periods / 4.0
        if large.any():
            at_row, at_column = np.nonzero(large)
            keys.append(at_column * count + at_row + block.start + 1)
    large_keys = np.concatenate(keys)
    following = large_keys[large_keys % count < count - 1] + 1
    columns, rows = np.divmod(np.unique(np.concatenate((large_keys, following))), count)
    return rows, columns


def _after_in_between(rows: IntArray, columns: IntArray, paired: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which pairs share a step with the pair before: of pairs in a row every second one does."""
    follows = np.zeros(len(rows), dtype=np.bool_)
    follows[1:] = paired[1:] & paired[:-1] & (np.diff(rows) == 1) & (np.diff(columns) == 0)
    index = np.arange(len(rows))
    start = np.maximum.accumulate(np.where(follows, 0, index))
    return np.asarray(follows & ((index - start) % 2 == 1))


def _elapsed(present: IntArray, dt: FloatArray) -> FloatArray:
    """Return the time from each value to the next, added from left to right as in `step`."""
    elapsed = dt[present]
    apart = np.diff(present, prepend=present[:1])
    for length in np.unique(apart[apart > 1]):
        at = np.flatnonzero(apart == length)
        passed = present[at - 1][:, np.newaxis] + np.arange(1, length + 1)
        elapsed[at] = np.cumsum(dt[passed], axis=1)[:, -1]
    return elapsed


FAR = 4.0
"""A sample lies off the line of its neighbours if by more than this times the motion around it ..."""

PERCEPTIBLE = 5e-4
"""... and by more than this share of a period: 0.18 deg, a few steps of a coarse encoder."""

AROUND = (-4, -3, -2, -1, 2, 3, 4, 5)
"""The steps around sample s whose speeds are the motion around it: step i leads to sample i."""


def find_interpolated_samples(
    q: FloatArray, x: FloatArray, t: FloatArray, wraps: IntArray, period: float
) -> IntArray:
    """Return the in-between samples beside the wraps of a joint, as far as they can be told.

    An in-between sample lies between its neighbours in the file, which are a wrap apart; but off the line
    between them, once repolarized, by far more than the joint moves in the samples around. A clean wrap
    never lies between its neighbours, whatever the noise or the speed.

    Args:
        q: Values in the file's turns that are not missing, in the unit of the period, shape (n,).
        x: The same repolarized, in the unit of the period, shape (n,).
        t: Their times in [s], shape (n,).
        wraps: Index of every value to which a wrap leads, shape (r,).
        period: P, 2 pi for [rad], 360 for [deg].

    Returns:
        Their indices, ascending, shape (b,).
    """
    at = np.setxor1d(wraps - 1, wraps)  # one of the two steps beside each is a wrap, not both
    at = at[(at > 0) & (at < len(q) - 1)]
    at = at[(q[at] - q[at - 1]) * (q[at + 1] - q[at]) > 0.0]
    off = np.abs(line_residuals(x, t, at))
    motion = np.abs(x[at + 1] - x[at - 1]) / (t[at + 1] - t[at - 1])
    for offset in AROUND:
        i = at + offset
        inside = (i > 0) & (i < len(x))
        j = np.where(inside, i, 1)
        motion = np.maximum(motion, np.where(inside, np.abs(x[j] - x[j - 1]) / (t[j] - t[j - 1]), 0.0))
    usual = motion * (t[at + 1] - t[at - 1]) / 2.0
    return np.asarray(at[(off > FAR * usual) & (off > PERCEPTIBLE * period)], dtype=np.int64)


def line_residuals(x: FloatArray, t: FloatArray, at: IntArray) -> FloatArray:
    """Return how far samples lie from the straight line, in time, through their neighbours.

    Args:
        x: Values in any unit, shape (n,).
        t: Their times in [s], shape (n,).
        at: Indices of the samples, neither the first nor the last, shape (b,).

    Returns:
        Signed distances x_s - (x_{s-1} + (t_s - t_{s-1}) / (t_{s+1} - t_{s-1}) (x_{s+1} - x_{s-1})) in the
        unit of x, shape (b,).
    """
    share = (t[at] - t[at - 1]) / (t[at + 1] - t[at - 1])
    return np.asarray(x[at] - x[at - 1] - share * (x[at + 1] - x[at - 1]), dtype=np.float64)


def reinterpolate(x: FloatArray, t: FloatArray, in_between: IntArray) -> FloatArray:
    """Return repolarized values with the in-between samples on the straight line through their neighbours.

    Args:
        x: Repolarized values of the joints in any unit, shape (n, joints); NaN where a sample is missing.
        t: Time of each row in [s], shape (n,).
        in_between: Row and joint index of each in-between sample, shape (b, 2).

    Returns:
        A new array in the unit of x, shape (n, joints); every other value is the same bit for bit.
    """
    repaired = x.copy()
    for j in np.unique(in_between[:, 1]):
        rows = in_between[in_between[:, 1] == j, 0]
        good = ~np.isnan(x[:, j])
        good[rows] = False
        repaired[rows, j] = np.interp(t[rows], t[good], x[good, j])
    return repaired


SMALL_STEP = np.pi / 4.0
"""If no angle steps by more in [rad], no sample needs another name: two angles of the other one are at least
three times as far off."""

OTHER_SIGNS = np.array([1.0, -1.0, 1.0])
"""What the angles are multiplied by in the other name of a rotation."""


def unwrap_quaternions(quat_xyzw: FloatArray) -> FloatArray:
    """Return quaternions with the sign that is nearest to the one before.

    Args:
        quat_xyzw: Shape (n, 4) [-]; NaN where a sample is missing.

    Returns:
        Quaternions [-], shape (n, 4).
    """
    return _of_present(quat_xyzw, lambda q: q * _signs(q)[:, np.newaxis])


def unwrap_rotation_vectors(vectors: FloatArray) -> FloatArray:
    """Return rotation vectors whose angle goes on past pi instead of flipping to the other side.

    The axis keeps the direction that is nearest to the one before, and the angle about it goes on by the
    nearest whole turns: v (1 + 2 pi k / |v|). Without an angle the axis stays what it was.

    Args:
        vectors: Axis times angle in [rad], shape (n, 3); NaN where a sample is missing.

    Returns:
        Axis times angle in [rad], shape (n, 3).
    """
    return _of_present(vectors, _vectors)


def unwrap_euler(angles: FloatArray, *, proper: bool = False) -> FloatArray:
    """Return Euler angles of the family, and with the turns, that are nearest to those before.

    Args:
        angles: Three angles about axes in turn in [rad], shape (n, 3); NaN where a sample is missing.
        proper: Whether the first and the last axis are the same, as in Z-Y-Z; else all three differ.

    Returns:
        Angles in [rad], shape (n, 3).
    """
    middle = 0.0 if proper else np.pi
    return _of_present(angles, lambda present: _euler(present, np.array([np.pi, middle, np.pi])))


def unwrap_orientations(rotation: FloatArray, form: RotationForm) -> FloatArray:
    """Return recorded orientations in their own form, without jumps between the names of one rotation.

    Args:
        rotation: As recorded, in [rad] or [-], shape (n, width); NaN where a sample is missing.
        form: What its columns are. A matrix is the only name of its rotation and stays.

    Returns:
        In [rad] or [-], shape (n, width).
    """
    if form == "matrix":
        return rotation
    if form in ("quat_xyzw", "quat_wxyz"):
        return unwrap_quaternions(rotation)
    if form == "vector":
        return unwrap_rotation_vectors(rotation)
    return unwrap_euler(rotation, proper=form in ("zyz", "zxz"))


def _of_present(values: FloatArray, work: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return a record worked on without its missing samples."""
    present = ~np.isnan(values).any(axis=1)
    if present.all():
        return work(values)
    result = np.full_like(values, np.nan)
    result[present] = work(values[present])
    return result


def _signs(directions: FloatArray) -> FloatArray:
    """Return the sign, 1 or -1, with which each direction is nearest to the one before; 1 for the first."""
    along = np.einsum("ij,ij->i", directions[1:], directions[:-1])
    return np.cumprod(np.append(1.0, np.where(along < 0.0, -1.0, 1.0)))[: len(directions)]


def _nearest_turns(angles: FloatArray) -> FloatArray:
    """Return the whole turns to add so that no step is above half a turn, shape as the angles', (n, ...)."""
    turns = np.zeros_like(angles)
    turns[1:] = -np.cumsum(np.rint(np.diff(angles, axis=0) / FULL_TURN), axis=0)
    return turns


def _vectors(v: FloatArray) -> FloatArray:
    """Return rotation vectors in [rad], shape (n, 3), each of its names the nearest to the one before."""
    largest = np.abs(v).max(axis=1)
    turning = np.flatnonzero(largest > 0.0)
    if not len(turning):
        return v
    known = np.maximum.accumulate(np.where(largest > 0.0, np.arange(len(v)), turning[0]))
    along = v[known] / largest[known, np.newaxis]  # squares of tiny components are no numbers any more
    lengths = np.linalg.norm(along, axis=1)
    axis, angle = along / lengths[:, np.newaxis], largest * lengths
    signs = _signs(axis)
    turns = _nearest_turns(signs * angle)
    return np.asarray(v + axis * (signs * turns * FULL_TURN)[:, np.newaxis])


def _euler(angles: FloatArray, apart: FloatArray) -> FloatArray:
    """Return Euler angles in [rad], shape (n, 3), of both families the one nearest to the sample before.

    Between two samples that step little, neither the family nor the turns change.
    """
    steps = (np.abs(np.diff(column)) > SMALL_STEP for column in angles.T)  # column by column: little memory
    steep = np.flatnonzero(np.logical_or.reduce([*steps])) + 1
    if not len(steep):
        return angles + 0.0
    before, after = angles[steep - 1], angles[steep]
    own, across = (_distance(one, before) for one in (after, _other(after, apart)))
    lengths = np.diff(steep, prepend=0, append=len(angles))
    swapped = np.append(False, np.cumsum(across < own) % 2 == 1)
    swaps = np.repeat(swapped, lengths)
    result = angles.copy()
    for column, sign, half in zip(result.T, OTHER_SIGNS, apart, strict=True):
        if swapped.any():
            column[swaps] = column[swaps] * sign + half
        turns = np.cumsum(np.rint((column[steep] - column[steep - 1]) / FULL_TURN))
        column[:] -= np.repeat(FULL_TURN * np.append(0.0, turns), lengths)
    return result


def _other(angles: FloatArray, apart: FloatArray) -> FloatArray:
    """Return the other Euler angles in [rad] of the same rotations, shape (n, 3)."""
    return np.asarray(angles * OTHER_SIGNS + apart)


def _distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the squared distance of angles, whole turns apart counted as none, shape (n,)."""
    step = a - b
    step = step - FULL_TURN * np.rint(step / FULL_TURN)
    return np.asarray(np.einsum("ij,ij->i", step, step))
