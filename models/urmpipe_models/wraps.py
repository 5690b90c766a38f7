"""Wraps of joints and jumps of orientations: found and undone.

1. The repolarizer. A joint that passes +pi in an environment limited to +-pi continues from -pi. The
   repolarizer adds whole periods, out = in + P k, so that the joint continues where it was. It is causal,
   without filter and delay; before the first repolarization the output is the input, bit for bit.

   A step d between two samples is a repolarization if it is a whole period except for the motion that is
   possible meanwhile:
   | |d| - P | <= max_step, max_step = min(maximum speed x dt, P / 4). So are two steps of one
   sign whose sum is such a step: the sample between them was left on the wrap by a linear resampling, is not
   a position of the joint, and is reported as an in-between sample. A step that is merely larger than half a
   period stays, flagged as unexplained.

   Source: [UrmArm2021]_ eq. 15-18 with the corrections of the errata (eq. 17's sign, multi-turn k, eq. 18 as
   a threshold).

2. In-between samples of a whole log. A log that was resampled before its wraps were undone has values on the
   straight line from +pi to -pi, where the joint never was. `repolarize` reports those that hide a wrap from
   it. `find_interpolated_samples` finds those next to a step that is a wrap alone, which needs the samples
   after it. `reinterpolate` replaces them.

3. Continuity of recorded orientations. One rotation has many representations, and a log jumps between them:
   quaternions q and -q, rotation vectors v and v (1 + 2 pi k / |v|), Euler angles (a, b, c) and
   (a + pi, pi - b, c + pi) - with equal first and last axis (a + pi, -b, c + pi) - and whole turns more. Each
   function continues with the representation closest to the one before, so that values can be interpolated
   and differentiated. The first sample is kept; missing ones (NaN) are skipped. Condition: less than a
   quarter turn of the axis and half a turn of the angle between two samples.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import Element, FloatArray, IntArray, row_blocks
from urmpipe_models.math3d import RotationForm

FULL_TURN = 2.0 * np.pi  # [rad], period of an angle
NO_LIMIT = 1e30  # speed of a joint without a limit: finite, so that speed x time is 0 for a time of 0
MAX_VALUE = 1e300  # larger values are missing, as NaN is: this comparison can be traced, isnan cannot
MIN_WRAP_TOLERANCE = 0.01  # of P: deviation of a wrap that is always allowed; clocks jitter, joints overshoot

MIN_DISTANCE_RATIO = 4.0  # distance of an in-between sample from the line / motion of the samples around it
MIN_DISTANCE = 5e-4  # of P: 0.18 deg, a few steps of a coarse encoder
STEPS_AROUND = (
    -4,
    -3,
    -2,
    -1,
    2,
    3,
    4,
    5,
)  # steps that measure the motion around s; step i leads to sample i

MAX_CONTINUOUS_STEP = np.pi / 4.0  # [rad]: up to it, the other Euler angles are at least three times as far
OTHER_SIGNS = np.array([1.0, -1.0, 1.0])  # factors of the angles in the other Euler angles of a rotation


class WrapState(NamedTuple):
    """Memory of the repolarizer of one joint.

    Attributes:
        last: The last input that had a value, in the unit of the period.
        residual: The step to it, minus a period if it was a wrap; 0 if there was none, or if it was the
            second half of a wrap.
        lasted: Duration of this step in [s].
        turns: k, the whole periods added.
        elapsed: Time since `last` in [s]; more than one sample if values are missing.
        seen: 1 after the first value.
    """

    last: Element = 0.0
    residual: Element = 0.0
    lasted: Element = 0.0
    turns: Element = 0.0
    elapsed: Element = 0.0
    seen: Element = 0.0


class Flags(NamedTuple):
    """Flags of the repolarizer for one sample.

    Attributes:
        change: Change of k: -1, 0 or 1.
        unexplained: True (1 in a trace) for a step above P / 4 that is no repolarization.
        in_between: True if only the sum of this step and the one before is a wrap: the value before this one
            is on the wrap, and its step was reported as unexplained if it is above P / 4.
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
            in-between sample, which are explained by the step after.
        in_between: Row and joint index of every in-between sample, shape (b, 2).
    """

    q: FloatArray
    rows: IntArray
    joints: IntArray
    change: IntArray
    unexplained: IntArray
    in_between: IntArray


def max_step(elapsed: Element, period: Element, max_speed: Element) -> Element:
    """Return the maximum motion of a joint, in the unit of the period.

    It is max_speed x elapsed, but not less than P / 100 and not more than P / 4.

    Args:
        elapsed: Time since the last value in [s].
        period: P.
        max_speed: Largest speed in the period's unit per second; inf without a limit.
    """
    reached = np.minimum(max_speed, NO_LIMIT) * elapsed
    return np.minimum(np.maximum(reached, MIN_WRAP_TOLERANCE * period), period / 4.0)


def wrap_change(step: Element, period: Element, allowed: Element) -> Element:
    """Return the change of k that undoes a step: -1, 0 or 1.

    Args:
        step: Difference of two values, in the unit of the period.
        period: P.
        allowed: Maximum deviation from a whole period; see `max_step`.
    """
    return np.where(np.abs(np.abs(step) - period) <= allowed, -np.sign(step), 0.0)


def detect_wrap(
    step: Element, elapsed: Element, residual: Element, lasted: Element, period: Element, max_speed: Element
) -> Flags:
    """Judge the step from one value to the next: the whole decision of the repolarizer.

    Args:
        step: The step, in the unit of the period.
        elapsed: Its duration in [s].
        residual: The step before it, minus a period if it was a wrap; 0 for none.
        lasted: Duration of that step in [s].
        period: P.
        max_speed: Largest speed in the period's unit per second; inf without a limit.

    Returns:
        The change of k and the flags; no change and no flag if a value is missing (NaN).
    """
    single = wrap_change(step, period, max_step(elapsed, period, max_speed))
    double = wrap_change(residual + step, period, max_step(lasted + elapsed, period, max_speed))
    same_sign = np.logical_and(np.abs(single) < 1.0, residual * step > 0.0)
    in_between = np.logical_and(same_sign, np.abs(double) > 0.0)
    change = np.where(in_between, double, single)
    unexplained = np.logical_and(np.abs(step) > period / 4.0, np.abs(change) < 1.0)
    return Flags(change, unexplained, in_between)


def add_turns(q: Element, turns: Element, period: Element) -> Element:
    """Return q + P k in the unit of the period; for k = 0, q bit for bit.

    Args:
        q: A value as measured, in the unit of the period.
        turns: k, whole.
        period: P.

    Source: [UrmArm2021]_ eq. 15.
    """
    return np.where(turns == 0.0, q, q + period * turns)


def repolarize_sample(
    state: WrapState, q: Element, dt: Element, *, period: Element = FULL_TURN, max_speed: Element = np.inf
) -> tuple[WrapState, Element, Flags]:
    """Repolarize one sample of one joint (or of many: the arguments are elements).

    Args:
        state: The state; `State()` before the first sample.
        q: The input, in the unit of the period; NaN where the sample is missing.
        dt: Time since the sample before, in [s].
        period: P: 2 pi for [rad], 360 for [deg].
        max_speed: Largest speed in the period's unit per second; inf without a limit.

    Returns:
        The next state, the repolarized value (NaN if the sample is missing) and the flags.

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
    following = WrapState(
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
    """Repolarize a whole log: the results of `repolarize_sample` for each sample, bit for bit.

    Args:
        q: Joint values in the unit of the period, shape (n, joints); NaN where a sample is missing.
        dt: Time from the row before in [s], shape (n,); the first is not used.
        period: P, 2 pi for [rad], 360 for [deg], shape (joints,) or one for all.
        max_speed: Largest speeds in the unit of the period per second, shape (joints,) or one for all.
    """
    joints = q.shape[1]
    periods, speeds = (
        np.broadcast_to(np.asarray(values, dtype=np.float64), (joints,)) for values in (period, max_speed)
    )
    steps = _judge_all_columns(q, dt, periods, speeds)
    wraps = steps.change != 0
    out = q.copy()
    for j in np.unique(steps.joints[wraps]):
        of_joint = wraps & (steps.joints == j)
        _add_turns_in_blocks(out[:, j], steps.rows[of_joint], steps.change[of_joint], periods[j])
    in_between = np.column_stack((steps.between, steps.joints))[steps.between >= 0]
    unexplained = np.column_stack((steps.rows, steps.joints))[steps.unexplained]
    explained = np.isin(
        unexplained[:, 0] * joints + unexplained[:, 1], in_between[:, 0] * joints + in_between[:, 1]
    )
    return Repolarized(
        out,
        steps.rows[wraps],
        steps.joints[wraps],
        steps.change[wraps],
        unexplained[~explained],
        in_between,
    )


def _add_turns_in_blocks(column: FloatArray, rows: IntArray, change: IntArray, period: float) -> None:
    """Repolarize a column in place, in blocks that stay in the cache."""
    k = np.append(0.0, np.cumsum(change))
    for block in row_blocks(len(column)):
        stop = min(block.stop, len(column))
        first, last = np.searchsorted(rows, (block.start, stop))
        bounds = np.concatenate(([block.start], rows[first:last], [stop]))
        column[block] = add_turns(column[block], np.repeat(k[first : last + 1], np.diff(bounds)), period)


class _JudgedSteps(NamedTuple):
    """Steps by row and joint index; `between` is the row of the in-between sample or -1."""

    rows: IntArray
    joints: IntArray
    change: IntArray
    unexplained: NDArray[np.bool_]
    between: IntArray


def _judge_all_columns(
    q: FloatArray, dt: FloatArray, periods: FloatArray, speeds: FloatArray
) -> _JudgedSteps:
    """Return the steps of all columns by row and joint: complete columns together, others one at a time."""
    joints = q.shape[1]
    complete = np.ones(joints, dtype=np.bool_)
    # Minimum and maximum of all are fast and mostly sufficient: NaN is neither, nor within the bounds.
    if not -MAX_VALUE < q.min(initial=0.0) <= q.max(initial=0.0) < MAX_VALUE:
        complete[:] = (np.abs(q) < MAX_VALUE).all(axis=0)
    together = np.flatnonzero(complete)
    values = q if complete.all() else q[:, together]
    steps = _judge_steps(values, dt, periods[together], speeds[together])
    parts = [steps._replace(joints=together[steps.joints])]
    for j in np.flatnonzero(~complete):
        present = np.flatnonzero(np.abs(q[:, j]) < MAX_VALUE)
        column = slice(j, j + 1)
        steps = _judge_steps(q[present, column], _elapsed(present, dt), periods[column], speeds[column])
        between = np.append(present, -1)[steps.between]  # -1, for none, is the last entry
        parts.append(steps._replace(rows=present[steps.rows], joints=steps.joints + j, between=between))
    rows, columns, change, unexplained, between = map(np.concatenate, zip(*parts, strict=True))
    order = np.argsort(rows * joints + columns)
    return _JudgedSteps(rows[order], columns[order], change[order], unexplained[order], between[order])


def _judge_steps(
    values: FloatArray, elapsed: FloatArray, periods: FloatArray, speeds: FloatArray
) -> _JudgedSteps:
    """Judge the steps of columns without missing values: those above P / 4 and the ones after them.

    A wrap is above P / 4, and so is one of the two steps to and from an in-between sample.
    """
    rows, columns = _find_large_steps(values, periods)
    step = values[rows, columns] - values[rows - 1, columns]
    # There is no step before that from the first value to the second, whatever its duration.
    before = np.where(rows < 2, 0.0, values[rows - 1, columns] - values[rows - 2, columns])
    lasted = elapsed[rows - 1]
    period, speed = periods[columns], speeds[columns]
    residual = before + period * wrap_change(before, period, max_step(lasted, period, speed))
    flags = detect_wrap(step, elapsed[rows], residual, lasted, period, speed)
    used = _after_in_between(rows, columns, flags.in_between)
    change = np.where(used, 0.0, flags.change)  # the step before is used: this one alone is no wrap
    in_between = flags.in_between & ~used
    unexplained = (np.abs(step) > period / 4.0) & (change == 0.0)
    between = np.where(in_between, rows - 1, -1)
    return _JudgedSteps(rows, columns, change.astype(np.int64), unexplained, between)


def _find_large_steps(values: FloatArray, periods: FloatArray) -> tuple[IntArray, IntArray]:
    """Return row and column of the steps above P / 4 and of those after them, by column and row."""
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
    """Return which pairs share a step with the pair before: every second one of consecutive pairs."""
    follows = np.zeros(len(rows), dtype=np.bool_)
    follows[1:] = paired[1:] & paired[:-1] & (np.diff(rows) == 1) & (np.diff(columns) == 0)
    index = np.arange(len(rows))
    start = np.maximum.accumulate(np.where(follows, 0, index))
    return np.asarray(follows & ((index - start) % 2 == 1))


def _elapsed(present: IntArray, dt: FloatArray) -> FloatArray:
    """Return the time from each value to the next, added from left to right as in `repolarize_sample`."""
    elapsed = dt[present]
    distance = np.diff(present, prepend=present[:1])
    for length in np.unique(distance[distance > 1]):
        at = np.flatnonzero(distance == length)
        passed = present[at - 1][:, np.newaxis] + np.arange(1, length + 1)
        elapsed[at] = np.cumsum(dt[passed], axis=1)[:, -1]
    return elapsed


def find_interpolated_samples(
    q: FloatArray, x: FloatArray, t: FloatArray, wraps: IntArray, period: float
) -> IntArray:
    """Return the identifiable in-between samples next to the wraps of a joint.

    In the file, an in-between sample has a value between those of its neighbours. After repolarization its
    distance from the line through them exceeds by far the motion in the samples around it. A sample next to a
    clean wrap never has a value between those of its neighbours, whatever the noise or the speed.

    Args:
        q: Values of the file that are not missing, in the unit of the period, shape (n,).
        x: The same repolarized, in the unit of the period, shape (n,).
        t: Their times in [s], shape (n,).
        wraps: Index of the value after each wrap, shape (r,).
        period: P, 2 pi for [rad], 360 for [deg].

    Returns:
        Their indices, ascending, shape (b,).
    """
    at = np.setxor1d(wraps - 1, wraps)  # one of its two steps is a wrap, not both
    at = at[(at > 0) & (at < len(q) - 1)]
    at = at[(q[at] - q[at - 1]) * (q[at + 1] - q[at]) > 0.0]
    distance = np.abs(line_residuals(x, t, at))
    motion = np.abs(x[at + 1] - x[at - 1]) / (t[at + 1] - t[at - 1])
    for offset in STEPS_AROUND:
        i = at + offset
        inside = (i > 0) & (i < len(x))
        j = np.where(inside, i, 1)
        motion = np.maximum(motion, np.where(inside, np.abs(x[j] - x[j - 1]) / (t[j] - t[j - 1]), 0.0))
    expected = motion * (t[at + 1] - t[at - 1]) / 2.0
    is_far = (distance > MIN_DISTANCE_RATIO * expected) & (distance > MIN_DISTANCE * period)
    return np.asarray(at[is_far], dtype=np.int64)


def line_residuals(x: FloatArray, t: FloatArray, at: IntArray) -> FloatArray:
    """Return the distances of samples from the straight line, in time, through their neighbours.

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
        A new array in the unit of x, shape (n, joints); all other values are the same bit for bit.
    """
    result = x.copy()
    for j in np.unique(in_between[:, 1]):
        rows = in_between[in_between[:, 1] == j, 0]
        is_valid = ~np.isnan(x[:, j])
        is_valid[rows] = False
        result[rows, j] = np.interp(t[rows], t[is_valid], x[is_valid, j])
    return result


def unwrap_orientations(rotation: FloatArray, form: RotationForm) -> FloatArray:
    """Return recorded orientations in their form, without jumps between representations of one rotation.

    Args:
        rotation: As recorded, in [rad] or [-], shape (n, width); NaN where a sample is missing.
        form: Its form. A matrix is unique and is returned unchanged.

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


def unwrap_quaternions(quat_xyzw: FloatArray) -> FloatArray:
    """Return quaternions with the sign that is closest to the one before.

    Args:
        quat_xyzw: Shape (n, 4) [-]; NaN where a sample is missing.

    Returns:
        Quaternions [-], shape (n, 4).
    """
    return _apply_to_present(quat_xyzw, lambda q: q * _signs(q)[:, np.newaxis])


def unwrap_rotation_vectors(vectors: FloatArray) -> FloatArray:
    """Return rotation vectors whose angle continues past pi instead of changing sign.

    The axis keeps the direction that is closest to the one before, and the angle about it changes by the
    closest whole turns: v (1 + 2 pi k / |v|). Where the angle is 0 the axis is that of the sample before.

    Args:
        vectors: Axis times angle in [rad], shape (n, 3); NaN where a sample is missing.

    Returns:
        Axis times angle in [rad], shape (n, 3).
    """
    return _apply_to_present(vectors, _unwrap_vectors)


def unwrap_euler(angles: FloatArray, *, proper: bool = False) -> FloatArray:
    """Return Euler angles of the family, and with the turns, that are closest to those before.

    Args:
        angles: Three angles about axes in turn in [rad], shape (n, 3); NaN where a sample is missing.
        proper: Whether the first and the last axis are equal, as in Z-Y-Z; otherwise all three differ.

    Returns:
        Angles in [rad], shape (n, 3).
    """
    middle = 0.0 if proper else np.pi
    return _apply_to_present(
        angles, lambda present: _unwrap_euler_angles(present, np.array([np.pi, middle, np.pi]))
    )


def _apply_to_present(values: FloatArray, function: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the result of a function of the samples that are not missing, with NaN at the missing ones."""
    present = ~np.isnan(values).any(axis=1)
    if present.all():
        return function(values)
    result = np.full_like(values, np.nan)
    result[present] = function(values[present])
    return result


def _signs(directions: FloatArray) -> FloatArray:
    """Return the sign, 1 or -1, with which each direction is closest to the one before; 1 for the first."""
    along = np.einsum("ij,ij->i", directions[1:], directions[:-1])
    return np.cumprod(np.append(1.0, np.where(along < 0.0, -1.0, 1.0)))[: len(directions)]


def _closest_turns(angles: FloatArray) -> FloatArray:
    """Return the whole turns to add so that no step exceeds half a turn, in the shape of the angles."""
    turns = np.zeros_like(angles)
    turns[1:] = -np.cumsum(np.rint(np.diff(angles, axis=0) / FULL_TURN), axis=0)
    return turns


def _unwrap_vectors(v: FloatArray) -> FloatArray:
    """Return rotation vectors in [rad], shape (n, 3), each the closest to the one before."""
    largest = np.abs(v).max(axis=1)
    rotating = np.flatnonzero(largest > 0.0)
    if not len(rotating):
        return v
    known = np.maximum.accumulate(np.where(largest > 0.0, np.arange(len(v)), rotating[0]))
    along = v[known] / largest[known, np.newaxis]  # squares of tiny components would be 0
    lengths = np.linalg.norm(along, axis=1)
    axis, angle = along / lengths[:, np.newaxis], largest * lengths
    signs = _signs(axis)
    turns = _closest_turns(signs * angle)
    return np.asarray(v + axis * (signs * turns * FULL_TURN)[:, np.newaxis])


def _unwrap_euler_angles(angles: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return Euler angles in [rad], shape (n, 3), of the two families the one closest to the sample before.

    The other family is angles * OTHER_SIGNS + offsets. After a small step, neither the family nor the turns
    change.
    """
    # column by column: little memory
    large = (np.abs(np.diff(column)) > MAX_CONTINUOUS_STEP for column in angles.T)
    steep = np.flatnonzero(np.logical_or.reduce([*large])) + 1
    if not len(steep):
        return angles + 0.0
    before, after = angles[steep - 1], angles[steep]
    same, other = (_squared_distance(family, before) for family in (after, after * OTHER_SIGNS + offsets))
    lengths = np.diff(steep, prepend=0, append=len(angles))
    is_other = np.append(False, np.cumsum(other < same) % 2 == 1)
    swapped = np.repeat(is_other, lengths)
    result = angles.copy()
    for column, sign, offset in zip(result.T, OTHER_SIGNS, offsets, strict=True):
        if is_other.any():
            column[swapped] = column[swapped] * sign + offset
        turns = np.cumsum(np.rint((column[steep] - column[steep - 1]) / FULL_TURN))
        column[:] -= np.repeat(FULL_TURN * np.append(0.0, turns), lengths)
    return result


def _squared_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the squared distance of angles without whole turns, shape (n,)."""
    step = a - b
    step = step - FULL_TURN * np.rint(step / FULL_TURN)
    return np.asarray(np.einsum("ij,ij->i", step, step))
