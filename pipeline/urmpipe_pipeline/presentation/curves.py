"""The curves of a panel, column by column, on their horizontal axis and in the unit that people read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import ns_to_seconds
from urmpipe_pipeline.presentation.figure import Figure, Line, Over, Panel
from urmpipe_pipeline.presentation.scene import BoolArray

DOTS = 1500
"""Points of a cloud at most: a browser draws no more of them with ease."""

NEAR = 1 / 200
"""Stretches of time nearer to each other than this share of the whole are tinted as one."""

THINNEST = 1 / 1000
"""A tinted stretch is at least this share of the whole wide, so that a single sample is seen."""

DEPTH = 1000.0
"""So far below the least of the lines' largest values a logarithmic axis reaches."""


@dataclass(frozen=True, slots=True)
class Span:
    """From where to where a horizontal axis goes: in [s], or in rows."""

    start: float
    end: float

    @property
    def length(self) -> float:
        """How long it is."""
        return self.end - self.start


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
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
    """Yield a title, a horizontal axis and the panels that stand on it, in order.

    One figure is drawn of each; the first has the title of the whole.
    """
    groups = [(over, list(panels)) for over, panels in groupby(panels_of(figure), axis_of)]
    for over, panels in groups:
        yield figure.title if over == groups[0][0] else f"{figure.title} over {over}", over, panels


def span_of(panels: Iterable[Panel]) -> Span:
    """Return from the first to the last row of all lines; 0 to 0 without one."""
    found = [x for panel in panels for one in panel.lines if len(x := across(panel, one))]
    ends = [(float(x[0]), float(x[-1])) for x in found] or [(0.0, 0.0)]
    return Span(min(start for start, _ in ends), max(end for _, end in ends))


def axis_of(panel: Panel) -> str:
    """Return what the horizontal axis of a panel measures: t, row, or the title of a quantity."""
    if panel.over is not None:
        return panel.over.title
    timed = panel.t_ns is not None or any(one.t_ns is not None for one in panel.lines)
    return "t" if timed else "row"


def across(panel: Panel, one: Line) -> FloatArray:
    """Return the times of a line in [s] or its row numbers from 1, shape (n,)."""
    t_ns = _times(panel, one)
    return np.arange(1.0, len(one.values) + 1.0) if t_ns is None else ns_to_seconds(t_ns[:])


def place_of(panel: Panel, at: int) -> float:
    """Return where a time in [ns], or a row from 0, stands on the horizontal axis of a panel."""
    if panel.over is not None:
        return float(panel.over.values[at])
    return at / 1e9 if axis_of(panel) == "t" else at + 1.0


def _times(panel: Panel, one: Line) -> IntArray | None:
    return panel.t_ns if one.t_ns is None else one.t_ns


def shown_unit(panel: Panel) -> tuple[str, float]:
    """Return the unit that a panel is drawn in, and how many of it one of its own is."""
    if panel.small and panel.unit in text.SHOWN:
        return text.SHOWN[panel.unit]
    unit, factor = text.display_unit(panel.unit, panel.display_unit)
    return unit.replace("/s2", "/s²").replace("/s3", "/s³"), factor


def curves_of(panel: Panel, factor: float) -> Iterator[Curve]:
    """Yield each column of each line, `factor` times as large as in the panel's unit."""
    for one in panel.lines:
        t_ns, x = _times(panel, one), across(panel, one)
        columns = np.asarray(one.values[:], dtype=np.float64)
        columns = columns if columns.ndim == 2 else columns[:, np.newaxis]
        with np.errstate(over="ignore"):
            scaled = factor * columns
        for name, colour, raw, values in zip(one.names, one.colours, columns.T, scaled.T, strict=True):
            yield Curve(one, name, colour, t_ns, x, raw, values)


def is_switch(curves: Sequence[Curve]) -> bool:
    """Tell whether all curves are steps between 0 and 1: yes or no."""
    return all(one.line.steps and np.isin(one.raw[np.isfinite(one.raw)], (0.0, 1.0)).all() for one in curves)


def logarithmic_ends(curves: Sequence[Curve], limit: float, *, whole: bool) -> tuple[float, float]:
    """Return the ends of a logarithmic axis: it reaches the limit, and all values or far below the largest.

    Args:
        curves: What is drawn.
        limit: In the unit that is shown; 0 without one.
        whole: Whether the least value above 0 is in sight, however small.
    """
    every = np.concatenate([[limit], *(one.values for one in curves)])
    if whole and (every > 0.0).any():
        every = every[every > 0.0]
        return float(every.min()) / 1.5, 1.5 * float(every.max())
    most = np.array([np.nanmax(np.abs(one.values), initial=0.0) for one in curves])
    most = most[most > 0.0] if (most > 0.0).any() else np.ones(1)
    return float(most.min()) / DEPTH, 1.5 * max(float(most.max()), limit)


def out_of_limit(panel: Panel, curves: Sequence[Curve]) -> FloatArray:
    """Return where a curve that was measured is out of the limit of a panel, in [s] or rows, shape (n,)."""
    measured = [one for one in curves if not one.line.dashed]
    if panel.limit is None or not measured:
        return np.empty(0)
    return np.unique(np.concatenate([one.x[np.abs(one.raw) > panel.limit] for one in measured]))


def stretches(t: FloatArray, where: BoolArray, duration: float) -> list[tuple[float, float]]:
    """Return the stretches of times in [s] in which something holds, shape (n,), from start to end.

    Those nearer than a two-hundredth of the time axis, its duration in [s], are one.
    """
    at = t[where]
    if not len(at):
        return []
    apart = np.flatnonzero(np.diff(at) > NEAR * duration)
    starts, ends = at[np.append(0, apart + 1)], at[np.append(apart, len(at) - 1)]
    wider = np.maximum(THINNEST * duration - (ends - starts), 0.0) / 2.0
    return list(zip((starts - wider).tolist(), (ends + wider).tolist(), strict=True))


def cloud_rows(curve: Curve, over: Over, peaks: Sequence[int]) -> IntArray:
    """Return the rows of a curve over a quantity to draw, shape (n,): spread evenly, with all peaks."""
    known = np.flatnonzero(np.isfinite(over.values[:]) & np.isfinite(curve.values))
    evenly = np.linspace(0, len(known) - 1, min(DOTS, len(known))).astype(np.int64)
    return np.union1d(known[np.unique(evenly)], np.intersect1d(peaks, known)).astype(np.int64)


POINTS = 2000
"""Points a drawn trace has at most: about two a pixel of a wide screen."""

EACH = 4
"""Points that M4 keeps of a column's bucket: the first, the least, the largest and the last."""


UNEVEN = 8.0
"""Longest over shortest time between rows: from there on a bucket of time hides more than a pixel should."""


def points_for(t_ns: IntArray | None) -> int:
    """Return how many points a line may have: twice as many where it leaves its course within a few rows.

    Its rows are at times in [ns], shape (n,); None without times.
    """
    if t_ns is None or len(t_ns) < 3:
        return POINTS
    between = np.diff(t_ns[:])
    return 2 * POINTS if between.max() > UNEVEN * between.min() else POINTS


def decimate(values: FloatArray, points: int = POINTS, t: FloatArray | None = None) -> IntArray:
    """Return the samples that a drawing of `values` needs, in order.

    The samples are cut into buckets of equal size, or of equal duration if their times are given. Of
    each bucket stay the first and the last sample, those of the least and the largest value of each
    column, and, if values are missing (NaN), the first and the last missing one, so that a gap stays a
    gap. A line through what stays covers the same pixels as the whole, as long as a bucket is not wider
    than a pixel.

    Args:
        values: What is drawn, shape (n,) or (n, k), any unit; NaN where there is no value.
        points: How many samples may stay (a column of a bucket counts for two, its ends for two).
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
        # All columns share the ends of their buckets: the library cuts by the number or the times alone.
        kept.append(
            m4.downsample(*times, np.ascontiguousarray(column), n_out=EACH * buckets).astype(np.int64)
        )
        kept += _missing(column, -(-count // buckets))
    return np.unique(np.concatenate(kept))


def _missing(column: FloatArray, size: int) -> list[IntArray]:
    """Return the first and the last missing sample of each bucket that has one."""
    where = np.flatnonzero(np.isnan(column))
    bucket = where // size
    first = where[np.diff(bucket, prepend=-1) > 0]
    last = where[np.diff(bucket, append=len(column)) > 0]
    return [first, last]
