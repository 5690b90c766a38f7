"""The uniform time grid of a run: the log's own samples where they are regular, else a resampling.

Times are integer nanoseconds from the log's first row. Nothing is upsampled in silence, and nothing is
interpolated across a gap, or across a step of a joint that no motion explains.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import JointLog, LogWarning, is_inside_gap
from urmpipe_pipeline.sources.clocks.quantised import Regular, behind_rounded

REGULAR = 0.01
"""A log is regular if no sample is further from its place on the grid than this share of the period."""

ROUNDING_NS = 1000
"""Clocks are printed to the microsecond or finer: so much beyond the last known time is still at it."""

RESAMPLED = "resampled"
"""The kind of the warning that every run has whose grid is not the rows of its log."""

MOST_BYTES = 256 << 20
"""Bytes of a run on a grid, where the rows of its log do not hold as many: more come of a broken clock or a
mistyped period."""

FINER = 8
"""A grid may have so many samples for each row of its log, however many these are."""

_ALWAYS = 31
"""Numbers of a sample beside three a joint: its time, the tool centre point with its rates."""


class RowClock(NamedTuple):
    """The clock behind the rows of a log.

    Attributes:
        t_ns: Its times of the rows in integer [ns], strictly increasing, shape (n,): their own, or those of
            the regular clock behind rounded ones.
        period: Of a regular clock its mean, else the median, in [ns]; 0 of a single row.
        regular: Whether it is regular.
        rounded: What is seen behind rounded times; None where they stand as they are.
    """

    t_ns: IntArray
    period: float
    regular: bool
    rounded: Regular | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Where a run is sampled.

    Attributes:
        t_ns: Times from the log's first row in integer [ns], shape (g,).
        tsp: Sampling period in [s]; 0 for a single sample.
        own: True if each sample is a row of the log, at its own time or that of the clock rounded to it.
        source_ns: Times of the rows in integer [ns], of rounded ones those of the clock behind, shape (n,).
        warnings: What was changed.
    """

    t_ns: IntArray
    tsp: float
    own: bool
    source_ns: IntArray
    warnings: tuple[LogWarning, ...]

    def resample(self, values: FloatArray) -> FloatArray:
        """Return values in any unit, shape (n, k), on the grid, shape (g, k): linear, NaN inside gaps."""
        if self.own:
            return values
        return interpolate(self.t_ns, self.source_ns, values)

    def resample_joints(
        self, values: FloatArray, unresolved: IntArray
    ) -> tuple[FloatArray, tuple[LogWarning, ...]]:
        """Return joint values on the grid; NaN inside gaps and between the rows of an unresolved step.

        Values, repolarized, are in [rad] or [m], shape (n, joints), on the grid (g, joints). Steps that no
        motion explains are row before, row after and joint index, shape (u, 3): a warning counts what was
        left open.
        """
        result = self.resample(values)
        if self.own or not len(unresolved):
            return result, ()
        inside = inside_spans(*self._between(unresolved), unresolved[:, 2], result.shape)
        left = int(np.count_nonzero((inside & ~np.isnan(result)).any(axis=1)))
        result[inside] = np.nan
        said = f"{left} grid samples lie inside steps of a joint that no motion explains and have no value"
        return result, (LogWarning("step-left-open", said),) if left else ()

    def steps(self, rows: IntArray) -> IntArray:
        """Return the steps of the grid that steps between rows reach into: the first and the last one.

        Rows are row before, row after and joint index, shape (b, 3). Grid steps are told by the sample before
        them, and joint index, shape (m, 3).
        """
        if self.own:
            return np.column_stack((rows[:, 0], rows[:, 1] - 1, rows[:, 2]))
        first, end = self._between(rows)
        last = np.minimum(end - 1, len(self.t_ns) - 2)
        return np.column_stack((first - 1, last, rows[:, 2]))[first - 1 <= last]

    def _between(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Return the first grid sample after each row before, and the first at or after the row after."""
        first = np.searchsorted(self.t_ns, self.source_ns[rows[:, 0]], side="right")
        return first, np.searchsorted(self.t_ns, self.source_ns[rows[:, 1]], side="left")


def interpolate(at_ns: IntArray, known_ns: IntArray, values: FloatArray) -> FloatArray:
    """Return values at given times: linear between the known ones, NaN outside them and inside gaps.

    Args:
        at_ns: Times wanted in integer [ns], shape (m,).
        known_ns: Times known in integer [ns], strictly increasing, shape (n,).
        values: Values at the known times, in any unit, shape (n, k).

    Returns:
        Values at the times wanted, in the same unit, shape (m, k).
    """
    x, known = at_ns.astype(np.float64), known_ns.astype(np.float64)
    within = np.clip(x, known[0], known[-1])
    x = np.where(np.abs(within - x) <= ROUNDING_NS, within, x)
    result = np.empty((len(x), values.shape[1]))
    for i, column in enumerate(values.T):
        result[:, i] = np.interp(x, known, column, np.nan, np.nan)
    result[is_inside_gap(at_ns, known_ns)] = np.nan
    return result


def inside_spans(
    first: IntArray, end: IntArray, columns: IntArray, shape: tuple[int, ...]
) -> NDArray[np.bool_]:
    """Return a mask of rows and columns of some shape that is true in some spans of rows.

    Each span has its first row, the row after its last one and its column, all of shape (m,).
    """
    depth = np.zeros((shape[0] + 1, shape[1]), dtype=np.int32)
    np.add.at(depth, (first, columns), 1)
    np.add.at(depth, (end, columns), -1)
    return np.asarray(np.cumsum(depth, axis=0)[:-1] > 0)


def row_clock(t_ns: IntArray) -> RowClock:
    """Return the clock of rows at times in integer [ns], strictly increasing, shape (n,)."""
    if len(t_ns) < 2:
        return RowClock(t_ns, 0.0, True)
    mean = float(t_ns[-1] - t_ns[0]) / (len(t_ns) - 1)
    ideal = t_ns[0] + np.arange(len(t_ns)) * mean
    if np.max(np.abs(t_ns - ideal)) <= REGULAR * mean:
        return RowClock(t_ns, mean, True)
    if rounded := behind_rounded(t_ns):
        return RowClock(rounded.t_ns - rounded.t_ns[0] + t_ns[0], rounded.period, True, rounded)
    return RowClock(t_ns, float(np.median(np.diff(t_ns))), False)


def make_grid(log: JointLog, tsp: float | None = None) -> Grid:
    """Return the grid of a log.

    Args:
        log: The log, its times strictly increasing.
        tsp: The period wanted in [s]; None for the log's own, which is its rows where they are
            regular (as far as the resolution of their clock tells) and else its median period.

    Raises:
        LogError: If it would have more samples than fit in memory.
    """
    clock = row_clock(log.t_ns)
    own, period = clock.t_ns, clock.period
    if len(own) < 2:
        return Grid(own, tsp or 0.0, True, own, ())
    wanted = period if tsp is None else tsp * 1e9
    told = () if clock.rounded is None else (_rounded(clock.rounded),)
    if clock.regular and abs(wanted - period) <= REGULAR * period / len(own):
        return Grid(own, period / 1e9, True, own, told)
    count = int((own[-1] - own[0]) / wanted + 1e-6) + 1
    _refuse_endless(log, wanted, count)
    grid = np.rint(np.arange(count) * wanted).astype(np.int64) + own[0]
    in_gap = is_inside_gap(grid, own)
    return Grid(grid, wanted / 1e9, False, own, (*told, *_changes(log, wanted, count, in_gap)))


def _refuse_endless(log: JointLog, wanted: float, count: int) -> None:
    """Raise a `LogError` if a grid has more samples than its log or the memory accounts for."""
    most = max(MOST_BYTES // (8 * (_ALWAYS + 3 * len(log.joints))), FINER * log.rows)
    if count <= most:
        return
    steps = np.diff(log.t_ns)
    row = int(np.argmax(steps)) + 2
    found = f"found {count} samples every {wanted / 1e6:.6g} ms for {log.rows} rows"
    gap = f"{float(steps.max()) / 1e9:.6g} s pass before row {row}"
    message = f"{found}, {gap}, allowed: {most} samples; a clock without such a gap"
    hints = (Hint("tsp", None, "sets a longer period"),)
    raise LogError(Finding(message, log.files[0].name if log.files else log.name, row=row, hints=hints))


def _rounded(clock: Regular) -> LogWarning:
    """Say that a regular clock is seen behind rounded times."""
    said = f"the times are those of a regular clock of {clock.period / 1e6:.6g} ms"
    steps = f"in steps of {clock.resolution / 1e6:.6g} ms: the rows are taken as regular"
    return LogWarning("clock-rounded", f"{said} {steps}")


def _changes(log: JointLog, wanted: float, count: int, in_gap: NDArray[np.bool_]) -> list[LogWarning]:
    """Say what the resampling did."""
    median = float(np.median(np.diff(log.t_ns)))
    said = f"{log.rows} rows with a median period of {median / 1e6:.6g} ms became {count} samples"
    left = int(in_gap.sum())
    inside = f"; {left} of them lie inside gaps and have no value" if left else ""
    warnings = [LogWarning(RESAMPLED, f"{said} every {wanted / 1e6:.6g} ms (linear){inside}")]
    if wanted < (1.0 - REGULAR) * median:
        said = f"the grid of {wanted / 1e6:.6g} ms is finer than the log's {median / 1e6:.6g} ms"
        why = "the samples between its rows are interpolated, not measured"
        warnings.append(LogWarning("upsampled", f"{said}: {why}"))
    return warnings
