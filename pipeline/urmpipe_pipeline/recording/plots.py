"""The plots over time of a recording: one unit in each, one time axis for all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING
from uuid import UUID

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.recording.codec import Encoded
from urmpipe_pipeline.recording.entities import Place, printable
from urmpipe_pipeline.recording.marks import mark_entity, worst_entity
from urmpipe_pipeline.recording.overview import LONG, overview_entity, speed_entity
from urmpipe_pipeline.recording.series import series_lines
from urmpipe_pipeline.recording.shown_units import (
    deviation_array,
    factors,
    plotted_deviations,
    shown_unit,
    span_with_numbers,
)
from urmpipe_pipeline.recording.tolerances import PLOTS, UNSIGNED, tolerance_entities
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.signal_groups import Group
from urmpipe_pipeline.simulations.simulation import Result, Simulation

if TYPE_CHECKING:
    from rerun import SeriesLines
    from rerun.blueprint import TimeSeriesView
    from rerun.encodings import TimeRange

SHARED_AXIS = UUID("5c0dca6a-e63f-9cf7-f657-2602590474cc")
"""The view of which the viewer keeps the time axis that linked plots share. Without a range there, it opens a
log of more than some minutes on a minute of it."""

BEFORE, AFTER = 0.01, 0.24
"""Time shown before the first sample and after the last, as shares of all: there stands the legend."""


TALL, LOW = 8, 4
"""Multiples of a power of ten that the axis of a high and of a low plot has room for."""


class Plots:
    """Makes the plots of a recording; all of them show its whole time."""

    def __init__(self, result: Result, encoded: Encoded) -> None:
        self._entity_of = encoded.entity_of
        self._t_ns = result.t_ns if isinstance(result, Simulation) else None
        self._range = _whole_time(result)
        self._shares_axis = True

    def series(
        self, name: str, *entities: str, legend: bool = True, span: tuple[float, float] | None = None
    ) -> TimeSeriesView:
        """Return a plot of some entities; its vertical axis spans all of them, or what is given."""
        import rerun.blueprint as rrb

        view = rrb.TimeSeriesView(
            origin="/",
            contents=list(entities),
            name=name,
            axis_x=rrb.TimeAxis(link="LinkToGlobal", view_range=self._range),
            axis_y=None if span is None else rrb.ScalarAxis(range=span),
            plot_legend=rrb.PlotLegend("RightTop", visible=legend),
        )
        if self._shares_axis:
            view.id, self._shares_axis = SHARED_AXIS, False
        return view

    def array(
        self, name: str, unit: str, entity: str, rows: int, *beside: str, legend: bool = True
    ) -> list[TimeSeriesView]:
        """Return the plot of an array; of a long one that of its overview, and after it that of all.

        Args:
            name: What is plotted.
            unit: Its unit.
            entity: The array.
            rows: How many it has.
            beside: What else stands in the plot.
            legend: Whether it has room for one.
        """
        return self._arrays(name, unit, [entity], rows, *beside, legend=legend)

    def signals(self, group: Group, rows: int, *beside: str) -> list[TimeSeriesView]:
        """Return the plot of some signals of a block, as `array` does it."""
        name = printable(f"{group.block}: {group.variables}")
        own = [self._entity_of(one.values, self._t_ns) for one in group.signals]
        views = self._arrays(name, printable(group.bracket), own, rows, *beside)
        if group.wanted and rows > 1:  # beside each other they have other names and colours
            standing = [list(map(overview_entity, own)), own] if rows > LONG else [own]
            for view, drawn in zip(views, standing, strict=True):
                view.visualizer_overrides = {one: _looks(group, i) for i, one in enumerate(drawn)}
        return views

    def _arrays(
        self,
        name: str,
        unit: str,
        entities: Sequence[str],
        rows: int,
        *beside: str,
        legend: bool = True,
        span: tuple[float, float] | None = None,
    ) -> list[TimeSeriesView]:
        """Return the plot of some arrays of equally many rows, as `array` does it of one."""
        if rows <= LONG:
            return [self.series(f"{name} [{unit}]", *entities, *beside, legend=legend, span=span)]
        said = f"{name} [{unit}], every peak of {rows:,} rows"
        return [
            self.series(said, *map(overview_entity, entities), *beside, legend=legend, span=span),
            self.series(f"all {rows:,} rows [{unit}]", *entities, *beside, legend=legend, span=span),
        ]

    def joints(self, run: Run, place: Place) -> Iterator[list[TimeSeriesView]]:
        """Yield the joints before and after, which share the legend of the first; nothing for a path.

        Where nothing was repolarized both are one plot: they would show the same.
        """
        if not run.log.joints:
            return
        unit, raw, after = (
            run.joint_unit(),
            self._entity_of(run.log.q, run.log.t_ns),
            self._entity_of(run.q, run.t_ns),
        )
        marks = mark_entity(place, "**"), worst_entity(place, "repolarized")
        if run.goals is not None and not run.audit:
            yield self.array("Joints, solved", unit, after, len(run.t_ns), *marks)
            return
        before = self.array("Joints in the file", unit, raw, run.log.rows, worst_entity(place, "raw"))
        if not run.audit:
            same = self.array("Joints, no repolarization needed", unit, after, len(run.t_ns), *marks)
            yield [*same, *before]
            return
        wraps, doubts = len(run.repolarizations), len(run.audit) - len(run.repolarizations)
        found = f"{wraps} marked, {doubts} doubtful" if doubts else f"{wraps} marked"
        yield before
        yield self.array(f"Joints repolarized ({found})", unit, after, len(run.t_ns), *marks, legend=False)

    def speed(self, run: Run, place: Place) -> list[TimeSeriesView]:
        """Return the speed of an ingested log's tool centre point; nothing if it has none."""
        if run.tcp is None or not run.timed:
            return []
        return [self.series("Speed of the TCP [m/s]", overview_entity(speed_entity(place)), legend=False)]

    def compared_speed(self, one: Deviation, place: Place) -> list[TimeSeriesView]:
        """Return the speed of a compared log's tool centre point."""
        entity, worst = self._entity_of(one.speed, one.t_ns), worst_entity(place, "speed")
        span = _span([one.speed], LOW)
        return self._arrays(
            "Speed of the TCP", "m/s", [entity], len(one.sample), worst, legend=False, span=span
        )

    def deviations(
        self, one: Deviation, place: Place, reference: str, tolerance: Mapping[str, float]
    ) -> dict[str, list[TimeSeriesView]]:
        """Return what was held against a tolerance or can be, by its plot: delta, path, angle and joints.

        In the units that people read; of a long log there is a second view of all its rows, in SI.
        """
        names = {
            "delta": f"delta = {printable(reference)} - {printable(one.name)}",
            "path": "Distance from the path",
            "angle": "Angle between the orientations",
            "joints": "Joints, reference - log",
        }
        si = {"delta": "m", "path": "m", "angle": "rad", "joints": one.run.joint_unit()}
        rows, views = len(one.sample), {}
        for plot, values in plotted_deviations(one):
            said = f"{names[plot]} [{shown_unit(one, plot)}]"
            entity, long = self._entity_of(deviation_array(one, plot), one.t_ns), rows > LONG
            beside = tolerance_entities(plot), worst_entity(place, plot)
            span = _span([values, *_allowed(one, plot, tolerance)], TALL)
            said += f", every peak of {rows:,} rows" if long else ""
            views[plot] = [self.series(said, overview_entity(entity), *beside, span=span)]
            if long:
                views[plot].append(self.series(f"all {rows:,} rows [{si[plot]}]", entity))
        return views

    def motion(self, run: Run) -> list[TimeSeriesView]:
        """Return the derivatives and the tool centre point, as far as the run has them."""
        found: list[tuple[str, FloatArray]] = []
        if run.log.joints and run.timed:
            found.append((f"Joint rates [{run.joint_unit('/s')}]", run.qd))
            found.append((f"Joint accelerations [{run.joint_unit('/s2')}]", run.qdd))
        if run.tcp is not None:
            found.append(("TCP [m]", run.tcp.position))
            if run.timed:
                found.append(("TCP velocity [m/s]", run.tcp.velocity))
                found.append(("TCP acceleration [m/s2]", run.tcp.acceleration))
            found.append(("TCP rz, ry, rx [rad]", run.tcp.euler_zyx))
        elif run.tcp_recorded is not None and run.log.joints:
            found.append(("Recorded TCP [m]", run.tcp_recorded))
        elif run.tcp_recorded is not None:
            return self.array("Recorded TCP", "m", self._entity_of(run.tcp_recorded, run.t_ns), len(run.t_ns))
        return [self.series(name, self._entity_of(array, run.t_ns)) for name, array in found]


def _looks(group: Group, number: int) -> SeriesLines:
    """Return how the lines of one signal of a group are drawn."""
    return series_lines(list(map(printable, group.names[number])), group.colours[number])


def decisive_plot(one: Deviation) -> str:
    """Return in which of the plots of `Plots.deviations` stands what decides."""
    return PLOTS[one.decisive.kind]


def _allowed(one: Deviation, plot: str, tolerance: Mapping[str, float]) -> list[FloatArray]:
    """Return what is allowed in a plot, in its unit: both signs of what has one."""
    scale = float(factors(one, plot).max())
    found = [(kind, allowed * scale) for kind, allowed in tolerance.items() if PLOTS[kind] == plot]
    return [np.array([0.0 if kind in UNSIGNED else -allowed, allowed]) for kind, allowed in found]


def _span(arrays: Sequence[FloatArray], most: int) -> tuple[float, float] | None:
    """Return the range of an axis that shows some values and more numbers than 0; None without a value."""
    known = [values[np.isfinite(values)] for values in arrays]
    every = [values for values in known if len(values)]
    if not every:
        return None
    return span_with_numbers(min(map(np.min, every)), max(map(np.max, every)), most)


def _times(result: Result) -> list[IntArray]:
    """Return all times of a result."""
    if isinstance(result, Simulation):
        return [result.t_ns]
    runs: Sequence[Run] = [result] if isinstance(result, Run) else [one.run for one in result.runs]
    return [t_ns for run in runs for t_ns in (run.log.t_ns, run.t_ns)]


def _whole_time(result: Result) -> TimeRange | None:
    """Return from the first to the last sample, with a margin; None if there is none or but one."""
    import rerun as rr
    import rerun.blueprint as rrb

    every = [t_ns for t_ns in _times(result) if len(t_ns)]
    if not every:
        return None
    first, last = min(int(t_ns[0]) for t_ns in every), max(int(t_ns[-1]) for t_ns in every)
    if first == last:
        return None
    edges = first - BEFORE * (last - first), last + AFTER * (last - first)
    start, end = (rr.TimeRangeBoundary.absolute(nanos=round(at)) for at in edges)
    return rrb.TimeRange(start=start, end=end)
