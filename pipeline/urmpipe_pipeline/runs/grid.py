"""The uniform time grid of a run: the rows of the log where they are regular, else a resampling.

- `row_clock`: the clock of the rows; a regular one also where the timestamps are quantised.
- `make_grid`: the grid, with warnings about every change.
- `Grid.resample`, `Grid.resample_joints`: linear interpolation; missing values inside gaps, and across a step
  of a joint that no motion explains.

Times are integer nanoseconds from the first row of the log.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import JointLog, LogWarning, is_inside_gap
from urmpipe_pipeline.logs.timestamps import Regular, fit_rounded

REGULAR = 0.01  # share of the period: no sample of a regular log is further from its place on the grid
ROUNDING_NS = 1000  # clocks are printed to the microsecond or finer: a time this far outside is at the end
RESAMPLED = "resampled"  # kind of the warning of every run whose grid is not the rows of its log
MAX_BYTES = 256 << 20  # of a run on a grid; more come from a broken clock or a mistyped period
MAX_SAMPLES_PER_ROW = 8  # samples of a grid for each row of its log, also above MAX_BYTES
_VALUES_PER_SAMPLE = 31  # the time and the tool centre point with its rates; each joint has three more


class RowClock(NamedTuple):
    """The clock of the rows of a log.

    Attributes:
        t_ns: Times of the rows in integer [ns], strictly increasing, shape (n,); of quantised timestamps the
            regular times.
        period: The mean period of a regular clock, else the median, in [ns]; 0 for a single row.
        regular: Whether the clock is regular.
        quantised: The regular clock that explains quantised timestamps; None if they are used as they are.
    """

    t_ns: IntArray
    period: float
    regular: bool
    quantised: Regular | None = None


class Grid(NamedTuple):
    """The samples of a run.

    Attributes:
        t_ns: Times from the first row of the log in integer [ns], shape (g,).
        tsp: Sampling period in [s]; 0 for a single sample.
        is_rows: Whether each sample is a row of the log.
        source_ns: Times of the rows by `RowClock` in integer [ns], shape (n,).
        warnings: What was changed.
    """

    t_ns: IntArray
    tsp: float
    is_rows: bool
    source_ns: IntArray
    warnings: tuple[LogWarning, ...]

    def resample(self, values: FloatArray) -> FloatArray:
        """Return values in any unit, shape (n, k), on the grid, shape (g, k): linear, NaN inside gaps."""
        return values if self.is_rows else interpolate(self.t_ns, self.source_ns, values)

    def resample_joints(
        self, values: FloatArray, unresolved: IntArray
    ) -> tuple[FloatArray, tuple[LogWarning, ...]]:
        """Return joint values on the grid in [rad] or [m], shape (g, joints), and a warning.

        They are NaN inside gaps and unresolved steps.

        Args:
            values: Repolarized joint values in [rad] or [m], shape (n, joints); on the grid (g, joints).
            unresolved: Row before, row after and joint index of steps that no motion explains, shape (u, 3).
        """
        result = self.resample(values)
        if self.is_rows or not len(unresolved):
            return result, ()
        inside = mark_spans(*self._between(unresolved), unresolved[:, 2], result.shape)
        count = int(np.count_nonzero((inside & ~np.isnan(result)).any(axis=1)))
        result[inside] = np.nan
        message = f"{count} grid samples lie inside unexplained steps of a joint"
        return result, (LogWarning("step-left-open", f"{message} and have no value"),) if count else ()

    def find_steps(self, row_steps: IntArray) -> IntArray:
        """Return the first and last step of the grid within each step between rows, shape (m, 3).

        Args:
            row_steps: Row before, row after and joint index, shape (b, 3).

        Returns:
            Sample before the first grid step, sample before the last one, and joint index.
        """
        before, after, joints = row_steps.T
        if self.is_rows:
            return np.column_stack((before, after - 1, joints))
        first, end = self._between(row_steps)
        last = np.minimum(end - 1, len(self.t_ns) - 2)
        return np.column_stack((first - 1, last, joints))[first - 1 <= last]

    def _between(self, row_steps: IntArray) -> tuple[IntArray, IntArray]:
        """Return the first grid sample after each row before, and the first at or after the row after."""
        first = np.searchsorted(self.t_ns, self.source_ns[row_steps[:, 0]], side="right")
        return first, np.searchsorted(self.t_ns, self.source_ns[row_steps[:, 1]], side="left")


def interpolate(
    at_ns: IntArray, known_ns: IntArray, values: FloatArray, gaps: BoolArray | None = None
) -> FloatArray:
    """Interpolate linearly; NaN outside the known times and inside their gaps.

    Args:
        at_ns: Times to interpolate at in integer [ns], shape (m,).
        known_ns: Known times in integer [ns], strictly increasing, shape (n,).
        values: Values at the known times, in any unit, shape (n, k).
        gaps: Which known times have a gap after them, shape (n - 1,); None: as `has_gap_after`.

    Returns:
        Values in the same unit, shape (m, k).
    """
    x, known = at_ns.astype(np.float64), known_ns.astype(np.float64)
    within = np.clip(x, known[0], known[-1])
    x = np.where(np.abs(within - x) <= ROUNDING_NS, within, x)
    result = np.empty((len(x), values.shape[1]))
    for i, column in enumerate(values.T):
        result[:, i] = np.interp(x, known, column, np.nan, np.nan)
    result[is_inside_gap(at_ns, known_ns, gaps)] = np.nan
    return result


def mark_spans(first: IntArray, end: IntArray, columns: IntArray, shape: tuple[int, ...]) -> BoolArray:
    """Return a mask of the given shape (rows, columns) that is true within spans of rows.

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
    if quantised := fit_rounded(t_ns):
        return RowClock(quantised.t_ns - quantised.t_ns[0] + t_ns[0], quantised.period, True, quantised)
    return RowClock(t_ns, float(np.median(np.diff(t_ns))), False)


def make_grid(log: JointLog, tsp: float | None = None) -> Grid:
    """Return the grid of a log.

    Args:
        log: The log, its times strictly increasing.
        tsp: Period in [s]; None for that of the log: its rows where they are regular within the resolution of
            their clock, else its median period.

    Raises:
        LogError: If the grid would have more samples than fit in memory.
    """
    t_ns, own_period, is_regular, quantised = row_clock(log.t_ns)
    if len(t_ns) < 2:
        return Grid(t_ns, tsp or 0.0, True, t_ns, ())
    period = own_period if tsp is None else tsp * 1e9
    warnings = []
    if quantised:
        message = f"the times are those of a regular clock of {quantised.period / 1e6:.6g} ms"
        message += f" in steps of {quantised.resolution / 1e6:.6g} ms: the rows are taken as regular"
        warnings.append(LogWarning("clock-rounded", message))
    if is_regular and abs(period - own_period) <= REGULAR * own_period / len(t_ns):
        return Grid(t_ns, own_period / 1e9, True, t_ns, tuple(warnings))
    count = int((t_ns[-1] - t_ns[0]) / period + 1e-6) + 1
    _check_size(log, period, count)
    grid_ns = np.rint(np.arange(count) * period).astype(np.int64) + t_ns[0]
    missing = int(is_inside_gap(grid_ns, t_ns).sum())
    warnings += _resampling_warnings(log, period, count, missing)
    return Grid(grid_ns, period / 1e9, False, t_ns, tuple(warnings))


def _check_size(log: JointLog, period: float, count: int) -> None:
    bytes_per_sample = 8 * (_VALUES_PER_SAMPLE + 3 * len(log.joints))
    allowed = max(MAX_BYTES // bytes_per_sample, MAX_SAMPLES_PER_ROW * log.rows)
    if count <= allowed:
        return
    steps = np.diff(log.t_ns)
    row = int(np.argmax(steps)) + 2
    message = f"found {count} samples every {period / 1e6:.6g} ms for {log.rows} rows"
    message += f", {float(steps.max()) / 1e9:.6g} s pass before row {row}"
    message += f", allowed: {allowed} samples; a clock without such a gap"
    hints = (Hint("tsp", None, "sets a longer period"),)
    raise LogError(Finding(message, log.files[0].name if log.files else log.name, row=row, hints=hints))


def _resampling_warnings(log: JointLog, period: float, count: int, missing: int) -> list[LogWarning]:
    median = float(np.median(np.diff(log.t_ns)))
    message = f"{log.rows} rows with a median period of {median / 1e6:.6g} ms became {count} samples"
    message += f" every {period / 1e6:.6g} ms (linear)"
    message += f"; {missing} of them lie inside gaps and have no value" if missing else ""
    warnings = [LogWarning(RESAMPLED, message)]
    if period < (1.0 - REGULAR) * median:
        message = f"the grid of {period / 1e6:.6g} ms is finer than the log's {median / 1e6:.6g} ms"
        message += ": the samples between its rows are interpolated, not measured"
        warnings.append(LogWarning("upsampled", message))
    return warnings
