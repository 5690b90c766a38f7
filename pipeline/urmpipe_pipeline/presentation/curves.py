"""The curves of a panel: its lines column by column, on their horizontal axis, in the unit that is shown.

1. `by_axis`, `axis_of`, `across`: the horizontal axis of panels, of times, rows or another quantity.
2. `curves_of`, `shown_unit`: the columns of the lines in the unit that is shown.
3. `logarithmic_ends`, `out_of_limit`, `stretches`: ends of an axis, values out of a limit, tinted intervals.
4. `decimate`, `cloud_rows`: the rows that a drawing needs; M4 decimation keeps every peak at its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import ns_to_seconds
from urmpipe_pipeline.presentation.figure import Figure, Line, Over, Panel
from urmpipe_pipeline.presentation.scene import BoolArray

MAX_DOTS = 1500  # points of a cloud: a browser draws more of them slowly
MAX_MERGED_DISTANCE = 1 / 200  # share of the time axis; intervals nearer to each other are tinted as one
MIN_TINTED_WIDTH = 1 / 1000  # share of the time axis, so that a single sample is visible
LOGARITHMIC_DEPTH = 1000.0  # the least of the lines' largest values over the lower end of a logarithmic axis
MAX_POINTS = 2000  # points of a line: about two per pixel of a wide screen
MAX_STEP_RATIO = 8.0  # longest over shortest time between rows; beyond it a bucket hides more than a pixel
M4_SAMPLES = 4  # of a bucket: the first, the least, the largest and the last


class Span(NamedTuple):
    """Start and end of a horizontal axis, in [s] or in rows."""

    start: float
    end: float

    @property
    def length(self) -> float:
        """Its length."""
        return self.end - self.start


class Curve(NamedTuple):
    """A column of a line.

    Attributes:
        line: The line.
        name: Of the column.
        colour: As #rrggbb.
        t_ns: Times in [ns], shape (n,); None without.
        x: Times in [s] or row numbers, shape (n,).
        raw: Values in the unit of the panel, shape (n,).
        values: In the unit that is shown, shape (n,).
    """

    line: Line
    name: str
    colour: str
    t_ns: IntArray | None
    x: FloatArray
    raw: FloatArray
    values: FloatArray


def panels_of(figure: Figure) -> Iterator[Panel]:
    """Yield the panels of a figure from the top."""
    return (panel for view in figure.views for panel in view.panels)


def by_axis(figure: Figure) -> Iterator[tuple[str, str, list[Panel]]]:
    """Yield a title, a horizontal axis and its panels, in order.

    Each is one drawing; the first has the title of the figure.
    """
    groups = [(over, list(panels)) for over, panels in groupby(panels_of(figure), axis_of)]
    for over, panels in groups:
        yield figure.title if over == groups[0][0] else f"{figure.title} over {over}", over, panels


def span_of(panels: Iterable[Panel]) -> Span:
    """Return the span from the first to the last row of all lines; 0 to 0 without a row."""
    columns = [x for panel in panels for line in panel.lines if len(x := across(panel, line))]
    ends = [(float(x[0]), float(x[-1])) for x in columns] or [(0.0, 0.0)]
    return Span(min(start for start, _ in ends), max(end for _, end in ends))


def axis_of(panel: Panel) -> str:
    """Return the quantity of the horizontal axis of a panel: t, row, or its title."""
    if panel.over is not None:
        return panel.over.title
    timed = panel.t_ns is not None or any(line.t_ns is not None for line in panel.lines)
    return "t" if timed else "row"


def across(panel: Panel, line: Line) -> FloatArray:
    """Return the times of a line in [s] or its row numbers from 1, shape (n,)."""
    t_ns = _times(panel, line)
    return np.arange(1.0, len(line.values) + 1.0) if t_ns is None else ns_to_seconds(t_ns[:])


def place_of(panel: Panel, at: int) -> float:
    """Return the place of a time in [ns], or of a row from 0, on the horizontal axis of a panel."""
    if panel.over is not None:
        return float(panel.over.values[at])
    return at / 1e9 if axis_of(panel) == "t" else at + 1.0


def _times(panel: Panel, line: Line) -> IntArray | None:
    return panel.t_ns if line.t_ns is None else line.t_ns


def shown_unit(panel: Panel) -> tuple[str, float]:
    """Return the unit that a panel is drawn in, and the factor to it from the unit of the panel."""
    if panel.small and panel.unit in text.SHOWN:
        return text.SHOWN[panel.unit]
    unit, factor = text.choose_unit(panel.unit, panel.display_unit)
    return unit.replace("/s2", "/s²").replace("/s3", "/s³"), factor


def curves_of(panel: Panel, factor: float) -> Iterator[Curve]:
    """Yield each column of each line, `factor` times as large as in the panel's unit."""
    for line in panel.lines:
        t_ns, x = _times(panel, line), across(panel, line)
        columns = np.asarray(line.values[:], dtype=np.float64)
        columns = columns if columns.ndim == 2 else columns[:, np.newaxis]
        with np.errstate(over="ignore"):
            scaled = factor * columns
        for name, colour, raw, values in zip(line.names, line.colours, columns.T, scaled.T, strict=True):
            yield Curve(line, name, colour, t_ns, x, raw, values)


def is_switch(curves: Sequence[Curve]) -> bool:
    """Return whether all curves are steps between 0 and 1: yes or no."""
    return all(
        curve.line.steps and np.isin(curve.raw[np.isfinite(curve.raw)], (0.0, 1.0)).all() for curve in curves
    )


def logarithmic_ends(curves: Sequence[Curve], limit: float, *, all_values: bool) -> tuple[float, float]:
    """Return the ends of a logarithmic axis: it reaches the limit, and all values or far below the largest.

    Args:
        curves: Curves on the axis.
        limit: Limit in the unit that is shown; 0 without one.
        all_values: Whether the axis includes the least value above 0, however small.
    """
    values = np.concatenate([[limit], *(curve.values for curve in curves)])
    if all_values and (values > 0.0).any():
        values = values[values > 0.0]
        return float(values.min()) / 1.5, 1.5 * float(values.max())
    largest = np.array([np.nanmax(np.abs(curve.values), initial=0.0) for curve in curves])
    largest = largest[largest > 0.0] if (largest > 0.0).any() else np.ones(1)
    return float(largest.min()) / LOGARITHMIC_DEPTH, 1.5 * max(float(largest.max()), limit)


def out_of_limit(panel: Panel, curves: Sequence[Curve]) -> FloatArray:
    """Return where a measured curve is out of the limit of a panel, in [s] or rows, shape (n,)."""
    measured = [curve for curve in curves if not curve.line.dashed]
    if panel.limit is None or not measured:
        return np.empty(0)
    return np.unique(np.concatenate([curve.x[np.abs(curve.raw) > panel.limit] for curve in measured]))


def stretches(t: FloatArray, where: BoolArray, duration: float) -> list[tuple[float, float]]:
    """Return the start and the end of each interval in [s] in which a condition holds.

    Args:
        t: Times in [s], shape (n,).
        where: Where the condition holds, shape (n,).
        duration: Length of the time axis in [s]; intervals nearer than a two-hundredth of it are joined.
    """
    at = t[where]
    if not len(at):
        return []
    gaps = np.flatnonzero(np.diff(at) > MAX_MERGED_DISTANCE * duration)
    starts, ends = at[np.append(0, gaps + 1)], at[np.append(gaps, len(at) - 1)]
    widening = np.maximum(MIN_TINTED_WIDTH * duration - (ends - starts), 0.0) / 2.0
    return list(zip((starts - widening).tolist(), (ends + widening).tolist(), strict=True))


def cloud_rows(curve: Curve, over: Over, peaks: Sequence[int]) -> IntArray:
    """Return the rows to draw of a curve over a quantity, shape (n,): evenly spread, with all peaks."""
    known = np.flatnonzero(np.isfinite(over.values[:]) & np.isfinite(curve.values))
    evenly = np.linspace(0, len(known) - 1, min(MAX_DOTS, len(known))).astype(np.int64)
    return np.union1d(known[np.unique(evenly)], np.intersect1d(peaks, known)).astype(np.int64)


def choose_point_count(t_ns: IntArray | None) -> int:
    """Return the number of points of a line: more if the times of its rows are uneven.

    Its rows are at times in [ns], shape (n,); None without times.
    """
    if t_ns is None or len(t_ns) < 3:
        return MAX_POINTS
    steps = np.diff(t_ns[:])
    return 2 * MAX_POINTS if steps.max() > MAX_STEP_RATIO * steps.min() else MAX_POINTS


def decimate(values: FloatArray, points: int = MAX_POINTS, t: FloatArray | None = None) -> IntArray:
    """Return the samples that a drawing of `values` needs, in order.

    The samples are divided into buckets of equal size, or of equal duration if their times are given. Of
    each bucket, the first and the last sample are kept, those of the least and the largest value of each
    column, and, if values are missing (NaN), the first and the last missing one, so that a gap stays a gap. A
    line through these samples covers the same pixels as one through all, if no bucket is wider than a pixel.

    Args:
        values: Values to draw, shape (n,) or (n, k), any unit; NaN where there is no value.
        points: Number of samples to keep (a column of a bucket counts for two, its ends for two).
        t: Times of samples that are not evenly spaced in [s], increasing, shape (n,).

    Returns:
        Indices into `values`, sorted and unique, shape (at most `points` + 2 k a bucket with a gap,).

    Source: the M4 aggregation of Jugel, Jerzak, Hackenbroich, Markl, "M4: a visualization-oriented
    time series data aggregation", PVLDB 7 (2014).
    """
    count = len(values)
    if count <= points:
        return np.arange(count, dtype=np.int64)
    from tsdownsample import M4Downsampler

    columns = values.reshape(count, -1).T
    buckets = max(points // (2 + 2 * len(columns)), 1)
    m4 = M4Downsampler()
    kept = [np.array([0, count - 1])]
    times = () if t is None else (np.ascontiguousarray(t, np.float64),)
    for column in columns:
        # All columns have the same buckets: the library divides by the number or the times alone.
        samples = m4.downsample(*times, np.ascontiguousarray(column), n_out=M4_SAMPLES * buckets)
        missing = np.flatnonzero(np.isnan(column))
        bucket = missing // -(-count // buckets)
        first, last = np.diff(bucket, prepend=-1) > 0, np.diff(bucket, append=count) > 0
        kept += [samples.astype(np.int64), missing[first], missing[last]]
    return np.unique(np.concatenate(kept))
