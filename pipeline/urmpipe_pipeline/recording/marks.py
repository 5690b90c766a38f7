"""Marks in the plots: where a joint was repolarized, what is doubtful, and the worst sample."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.comparison.decided import decided_row
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.palette import NEUTRAL_COLOUR, joint_colour, rgb
from urmpipe_pipeline.recording.columns import scalar_column, time_columns
from urmpipe_pipeline.recording.entities import Place, printable
from urmpipe_pipeline.recording.shown_units import plotted_deviations
from urmpipe_pipeline.recording.signal_entities import verdict_entities
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Simulation

if TYPE_CHECKING:
    from rerun import RecordingStream

Mark = Literal["up", "down", "doubt"]

SHAPES: dict[Mark, Literal["up", "down", "cross"]] = {"up": "up", "down": "down", "doubt": "cross"}
"""Turns were added, turns were taken away, or neither: Rerun's markers for them."""

MARK_SIZE = 5.0
"""Size of a mark in points of the screen."""

WORST_WIDTH = 2.5
"""Width of the line through the worst sample in points of the screen."""


def mark_entity(place: Place, mark: Mark | Literal["**"]) -> str:
    """Return the entity of the marks of one kind in the plot of a run's repolarized joints."""
    return f"{place.prefix}marks/repolarization/{mark}"


def worst_entity(place: Place, plot: str) -> str:
    """Return the entity of the line through the worst sample in one plot of a run."""
    return f"{place.prefix}marks/worst/{plot}"


def draw_repolarizations(stream: RecordingStream, place: Place, run: Run) -> None:
    """Mark every entry of the audit at its instant, on its joint's line and in its colour."""
    import rerun as rr

    names = [printable(name) for name in run.log.joints]
    for mark, entries in _kinds(run.audit).items():
        t_ns, values = _on_lines(run, entries)
        style = rr.SeriesPoints(
            colors=[rgb(joint_colour(j)) for j in range(len(names))],
            names=names,
            markers=[SHAPES[mark]] * len(names),
            marker_sizes=[MARK_SIZE] * len(names),
        )
        entity = mark_entity(place, mark)
        stream.log(entity, style, static=True)
        stream.send_columns(entity, time_columns(t_ns), [scalar_column(values)])


def draw_worst(stream: RecordingStream, place: Place, one: Deviation) -> None:
    """Draw a line through the sample that decides in every plot, as high as what is plotted there."""
    if len(one.run.t_ns) < 2:
        return  # the line's nanosecond would be the whole axis
    for plot, values in _plots(one):
        _draw_instant(stream, worst_entity(place, plot), int(one.t_ns[decided_row(one)]), values)


def draw_meter_worst(stream: RecordingStream, result: Simulation) -> None:
    """Draw a line through the worst sample of each delta meter in the plot of what it is judged by."""
    if len(result.t_ns) < 2:
        return
    for one, entity in zip(result.verdicts, verdict_entities(result, "marks/worst"), strict=True):
        judged = [
            signal.columns
            for signal in result.signals
            if signal.block == one.block and signal.variable in one.variables
        ]
        if judged:
            _draw_instant(stream, entity, int(result.t_ns[one.sample]), np.column_stack(judged))


def _draw_instant(stream: RecordingStream, entity: str, at_ns: int, values: FloatArray) -> None:
    """Draw a line at one time, as high as some values."""
    import rerun as rr

    if not values.size:  # a path has no joints
        return
    ends = [ufunc.reduce(values, axis=None) for ufunc in (np.fmin, np.fmax)]  # of what is no NaN
    if not np.isfinite(ends).all():
        return
    style = rr.SeriesLines(
        colors=[rgb(NEUTRAL_COLOUR)],
        names=["decides"],
        widths=[WORST_WIDTH],
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    stream.log(entity, style, static=True)
    # A line between two values at one time is drawn as a point: one of them is a nanosecond later.
    times = time_columns(at_ns + np.arange(2))
    stream.send_columns(entity, times, [scalar_column(np.array(ends)[:, np.newaxis])])


def _plots(one: Deviation) -> Iterator[tuple[str, FloatArray]]:
    """Yield what is plotted of a compared run, by the names of the plots."""
    yield from plotted_deviations(one)
    yield "raw", one.run.log.q
    yield "repolarized", one.run.q
    yield "speed", one.speed


def _kinds(audit: Sequence[AuditEntry]) -> dict[Mark, list[AuditEntry]]:
    """Return the entries of an audit by their marks."""
    found: dict[Mark, list[AuditEntry]] = {}
    for one in audit:
        mark: Mark = "doubt" if one.kind != "wrap" else "up" if one.after > one.before else "down"
        found.setdefault(mark, []).append(one)
    return found


def _on_lines(run: Run, entries: Sequence[AuditEntry]) -> tuple[IntArray, FloatArray]:
    """Return the instants of the entries in [ns], in order, and where the joint is there on its plotted line.

    Returns:
        Shape (entries,), and shape (entries, joints): NaN but at the entry's own joint.
    """
    ordered = sorted(entries, key=lambda one: one.t)
    t_ns = np.array([round(one.t * 1e9) for one in ordered], dtype=np.int64)
    joint = np.array([run.log.joints.index(one.joint) for one in ordered])
    values = np.full((len(ordered), len(run.log.joints)), np.nan)
    for j in np.unique(joint):
        own = joint == j
        rows = _beside(run, t_ns[own], j)
        if len(rows):
            values[own, j] = np.interp(t_ns[own], run.t_ns[rows], run.q[rows, j])
    return t_ns, values


def _beside(run: Run, t_ns: IntArray, j: int) -> IntArray:
    """Return the samples before and after each time; where a value is missing, all that a joint has."""
    after = np.searchsorted(run.t_ns, t_ns)
    rows: IntArray = np.unique(np.clip(np.concatenate((after - 1, after)), 0, len(run.t_ns) - 1))
    return rows if np.isfinite(run.q[rows, j]).all() else np.flatnonzero(np.isfinite(run.q[:, j]))
