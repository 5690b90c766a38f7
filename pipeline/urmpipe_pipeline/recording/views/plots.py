"""The plots over time: lines with names and colours, what is allowed, marks, and the instant that decides."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias
from uuid import UUID

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.presentation.curves import decimate
from urmpipe_pipeline.presentation.figure import Computed, Line, Mark, Panel, Shape, View
from urmpipe_pipeline.presentation.palette import NEUTRAL_COLOUR, REFERENCE_COLOUR, rgb
from urmpipe_pipeline.recording.layout import scalar_column, times_at
from urmpipe_pipeline.recording.views.axes import TALL, UNITLESS, factor_of, shown_unit, span_with_numbers
from urmpipe_pipeline.text import drop_surrogates

if TYPE_CHECKING:
    from rerun import RecordingStream, SeriesLines, SeriesPoints
    from rerun.blueprint import TimeSeriesView
    from rerun.encodings import TimeRange

EntityOf: TypeAlias = Callable[["FloatArray | Computed", "IntArray | None"], str | None]
"""Returns where an array of the result stands on its times, as scalars in SI; None if it is drawn only."""

LONG = 50_000
"""Rows that the viewer still draws whole at once; of more an overview is shown first."""

ROWS = 20_000
"""Rows of an overview, at most."""

COPIED = 2_000
"""Rows of what stands nowhere in the result, at most, unless it is a deviation: every peak of it stays."""

SLICE = 65_536
"""Rows decimated at a time: what is computed on the way stays in the cache, and memory low."""

LINE_WIDTH, LIMIT_WIDTH, INSTANT_WIDTH, MARK_SIZE = 2.0, 1.5, 2.5, 5.0
"""Widths of lines and size of marks in points of the screen."""

SHARED_AXIS = UUID("5c0dca6a-e63f-9cf7-f657-2602590474cc")
"""The view of which the viewer keeps the time axis that linked plots share. Without a range there, it opens a
log of more than some minutes on a minute of it."""

BEFORE, AFTER = 0.01, 0.24
"""Time shown before the first sample and after the last, as shares of all: there stands the legend."""


@dataclass
class Plots:
    """Sends the plots of a recording, and returns their views; all of them show its whole time.

    Attributes:
        stream: Where to.
        entity_of: Where arrays of the result stand.
        whole: From the first to the last time in [ns], without times from the first to the last row; None
            where nothing is plotted.
        timed: Whether there are times.
        plotted: The arrays of the result that views show, by where they stand.
        own: Where the views of a much shorter part begin and end, in [ns] or rows; None: as all others.
    """

    stream: RecordingStream
    entity_of: EntityOf
    whole: tuple[int, int] | None
    timed: bool
    plotted: set[str] = field(default_factory=set)
    own: tuple[int, int] | None = None
    _looks: dict[str, _Look] = field(default_factory=dict)
    _shares_axis: bool = True

    def views(
        self,
        view: View,
        root: str,
        instants: Mapping[int, str],
        about: str = "",
        most: int = TALL,
        *,
        opened: bool = True,
    ) -> list[TimeSeriesView]:
        """Send a view of a figure, and return it; of a long one that of its overview, and that of all rows.

        Args:
            view: The view.
            root: The entity that what is drawn stands below.
            instants: Times in [ns] at which a line goes through it, with a word each.
            about: What it is of, where plots of several things stand beside each other.
            most: Multiples of a power of ten that its height has room for.
            opened: Whether it is seen first; else long arrays are shown by their overview alone.
        """
        panels = [panel for panel in view.panels if panel.over is None]
        if not panels:
            return []
        drawn = _Drawn(opened)
        for i, panel in enumerate(panels):
            for j, line in enumerate(panel.lines):
                self._line(drawn, panel, line, f"{root}/{i}/{j}")
            self._marks(drawn, panel, f"{root}/{i}/marks")
        self._limits(drawn, panels, f"{root}/limits")
        held = any(panel.small or panel.limit is not None or not panel.signed for panel in panels)
        span = (
            span_with_numbers(min(drawn.extent), max(drawn.extent), most) if held and drawn.extent else None
        )
        legend = len(drawn.names) > 1
        self._instants(drawn, instants, f"{root}/instants")
        said = drop_surrogates((f"{about}: {view.name}" if about else view.name) + f" [{shown_unit(panels)}]")
        if not drawn.whole:
            return [self._view(said, drawn.entities, drawn.overrides, span, legend=legend)]
        peaks = f"{said}, every peak of {drawn.rows:,} rows"
        si = " or ".join(dict.fromkeys(panel.unit or UNITLESS for panel in panels))
        return [
            self._view(peaks, drawn.entities, drawn.overrides, span, legend=legend),
            self._view(f"all {drawn.rows:,} rows [{si}]", drawn.whole, {}, None, legend=legend),
        ]

    def _view(
        self,
        name: str,
        entities: Sequence[str],
        overrides: Mapping[str, _Look],
        span: tuple[float, float] | None,
        *,
        legend: bool,
    ) -> TimeSeriesView:
        import rerun.blueprint as rrb

        view = rrb.TimeSeriesView(
            origin="/",
            contents=list(entities),
            name=name,
            axis_x=rrb.TimeAxis(
                link="LinkToGlobal" if self.own is None else "Independent", view_range=self._range()
            ),
            axis_y=None if span is None else rrb.ScalarAxis(range=span),
            plot_legend=rrb.PlotLegend("RightTop", visible=legend),
            overrides={entity: look.style() for entity, look in overrides.items()} or None,
        )
        if self._shares_axis and self.own is None:
            view.id, self._shares_axis = SHARED_AXIS, False
        return view

    def _range(self) -> TimeRange | None:
        """Return the whole time, or all rows, with a margin; None if there is none or but one."""
        import rerun as rr
        import rerun.blueprint as rrb

        if self.whole is None or self.whole[0] == self.whole[1]:
            return None
        first, last = self.whole if self.own is None else self.own
        key, span = "nanos" if self.timed else "seq", last - first
        edges = math.floor(first - BEFORE * span), math.ceil(last + AFTER * span)
        start, end = (rr.TimeRangeBoundary.absolute(**{key: at}) for at in edges)
        return rrb.TimeRange(start=start, end=end)

    def _line(self, drawn: _Drawn, panel: Panel, line: Line, root: str) -> None:
        """Show a line: the array of the result itself, or few rows of it in the unit that people read."""
        t_ns = panel.t_ns if line.t_ns is None else line.t_ns
        rows, factor = len(line.values), factor_of(panel)
        single = line.points or rows == 1 or t_ns is None
        look = _Look(line.names, line.colours, points=single, steps=line.steps)
        stored = self.entity_of(line.values, t_ns)
        drawn.names.update(line.names)
        drawn.rows = max(drawn.rows, rows)
        if rows > LONG and not drawn.opened:
            stored = None
        if stored is not None:
            self.plotted.add(stored)
        if stored is not None and factor == 1.0 and rows <= LONG:
            drawn.entities.append(stored)
            drawn.reach(line.values[:])
            if self._looks.setdefault(stored, look) != look:
                drawn.overrides[stored] = look
            elif self._looks[stored] is look:
                self.stream.log(stored, look.style(), static=True)
            return
        most = ROWS if rows > LONG else rows if panel.small else COPIED
        every = line.values[:]
        chosen = np.union1d(overview(every, most), np.array(panel.peaks, dtype=np.int64))
        values = factor * every[chosen].reshape(len(chosen), -1)
        self._send(drawn, root, look, t_ns, chosen, values)
        if stored is not None and rows > LONG:
            drawn.whole.append(stored)
            self.stream.log(stored, look.style(), static=True)

    def _send(
        self,
        drawn: _Drawn,
        entity: str,
        look: _Look,
        t_ns: IntArray | None,
        rows: IntArray,
        values: FloatArray,
    ) -> None:
        """Send rows of values that are only drawn."""
        self.stream.log(entity, look.style(), static=True)
        self.stream.send_columns(entity, times_at(t_ns, rows), [scalar_column(values)])
        drawn.entities.append(entity)
        drawn.reach(values)

    def _marks(self, drawn: _Drawn, panel: Panel, root: str) -> None:
        """Show the marks of a panel: an entity a shape, a column a line."""
        import rerun as rr

        names = list(dict.fromkeys(mark.name for mark in panel.marks))
        for shape, marks in _by_shape(panel.marks).items():
            marks.sort(key=lambda mark: mark.t_ns)
            values = np.full((len(marks), len(names)), np.nan)
            for row, mark in enumerate(marks):
                values[row, names.index(mark.name)] = factor_of(panel) * mark.value
            colours = {mark.name: rgb(mark.colour) for mark in panel.marks}
            style = rr.SeriesPoints(
                colors=[colours[name] for name in names],
                names=list(map(drop_surrogates, names)),
                markers=[shape] * len(names),
                marker_sizes=[MARK_SIZE] * len(names),
            )
            entity = f"{root}/{shape}"
            self.stream.log(entity, style, static=True)
            at = np.array([mark.t_ns for mark in marks], dtype=np.int64)
            times = times_at(None, at) if panel.t_ns is None else times_at(at, np.arange(len(at)))
            self.stream.send_columns(entity, times, [scalar_column(values)])
            drawn.entities.append(entity)

    def _limits(self, drawn: _Drawn, panels: Sequence[Panel], root: str) -> None:
        """Show what is allowed in some panels as lines: both signs of what has one, each once."""
        limits: dict[tuple[float, bool], Panel] = {}
        for panel in panels:
            if panel.limit is not None:
                limits.setdefault((panel.limit * factor_of(panel), panel.signed), panel)
        for number, ((limit, signed), panel) in enumerate(limits.items()):
            t_ns, rows = _ends(panel)
            values = [limit, -limit] if signed else [limit]
            said = f"{panel.limit_name} {'±' if signed else ''}{limit:.6g} {shown_unit([panel])}"
            colour = panel.lines[0].colours[0] if len(limits) > 1 else REFERENCE_COLOUR
            look = _Look((said,) * len(values), (colour,) * len(values), width=LIMIT_WIDTH)
            self._send(drawn, f"{root}/{number}", look, t_ns, rows, np.array([values] * len(rows)))
            drawn.names.add(said)

    def _instants(self, drawn: _Drawn, instants: Mapping[int, str], root: str) -> None:
        """Show instants as lines as high as what is plotted."""
        if not self.timed or self.whole is None or self.whole[0] == self.whole[1] or not drawn.extent:
            return  # the line's nanosecond would be the whole axis
        ends = np.array([[min(drawn.extent)], [max(drawn.extent)]])
        for number, (at_ns, words) in enumerate(instants.items()):
            look = _Look((words,), (NEUTRAL_COLOUR,), width=INSTANT_WIDTH)
            # A line between two values at one time is drawn as a point: one of them is a nanosecond later.
            self._send(drawn, f"{root}/{number}", look, at_ns + np.arange(2), np.arange(2), ends)


@dataclass
class _Drawn:
    """What was sent of a view, and whether it is seen first."""

    opened: bool
    entities: list[str] = field(default_factory=list)
    whole: list[str] = field(default_factory=list)
    overrides: dict[str, _Look] = field(default_factory=dict)
    extent: list[float] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    rows: int = 0

    def reach(self, values: FloatArray) -> None:
        """Take the least and the largest value among those that the axis must show."""
        known = np.asarray(values)
        ends = [ufunc.reduce(known, axis=None, initial=np.nan) for ufunc in (np.fmin, np.fmax)]
        if np.isinf(ends).any():
            known = known[np.isfinite(known)]
            ends = [ufunc.reduce(known, axis=None, initial=np.nan) for ufunc in (np.fmin, np.fmax)]
        self.extent += [float(end) for end in ends if not np.isnan(end)]


@dataclass(frozen=True)
class _Look:
    """How some lines look."""

    names: tuple[str, ...]
    colours: tuple[str, ...]
    points: bool = False
    steps: bool = False
    width: float = LINE_WIDTH

    def style(self) -> SeriesLines | SeriesPoints:
        """Return it as Rerun has it."""
        import rerun as rr

        colours, names = [rgb(colour) for colour in self.colours], list(map(drop_surrogates, self.names))
        if self.points:
            return rr.SeriesPoints(colors=colours, names=names, marker_sizes=[MARK_SIZE] * len(names))
        return rr.SeriesLines(
            colors=colours,
            names=names,
            widths=[self.width] * len(names),
            # Where samples are closer than pixels, the default draws their mean: peaks would vanish.
            aggregation_policy=rr.components.AggregationPolicy.MinMax,
            interpolation_mode=rr.components.InterpolationMode.StepAfter if self.steps else None,
        )


def overview(values: FloatArray, most: int) -> IntArray:
    """Return the rows of an array, shape (m,), that a drawing needs, so many at most: every peak stays.

    Values are in any unit, shape (n,) or (n, k).
    """
    starts = range(0, max(len(values), 1), SLICE)
    each = max(most // len(starts), 1)
    parts = [start + decimate(np.asarray(values[start : start + SLICE]), each) for start in starts]
    return np.concatenate(parts)


def _by_shape(marks: Sequence[Mark]) -> dict[Shape, list[Mark]]:
    found: dict[Shape, list[Mark]] = {}
    for mark in marks:
        found.setdefault(mark.shape, []).append(mark)
    return found


def _ends(panel: Panel) -> tuple[IntArray | None, IntArray]:
    """Return the times of a panel's lines and its first and last row."""
    line = panel.lines[0]
    t_ns = panel.t_ns if line.t_ns is None else line.t_ns
    return t_ns, np.unique([0, max(len(line.values) - 1, 0)])
