"""Send what the viewer draws: series with names and colours, tolerance lines and events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_pipeline.audit_entry import AuditEntry
from urmpipe_pipeline.comparison import Comparison, Deviation
from urmpipe_pipeline.joint_log import IntArray
from urmpipe_pipeline.palette import AXIS_COLOURS, REFERENCE_COLOUR, rgb
from urmpipe_pipeline.recording.entities import SUMMARY, Block, Place, entity_path, places_of, printable
from urmpipe_pipeline.recording.scene import Scene
from urmpipe_pipeline.recording.scene_drawing import draw_scene
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.recording.times import time_columns
from urmpipe_pipeline.results import Run

if TYPE_CHECKING:
    from rerun import RecordingStream

LINE_WIDTH, LIMIT_WIDTH = 2.0, 1.5
"""Width of a series, and of a tolerance, in points of the screen."""


def draw(stream: RecordingStream, result: Run | Comparison, every: Sequence[Block], scene: Scene) -> None:
    """Send everything that is there to be looked at."""
    import rerun as rr

    stream.log(SUMMARY, rr.TextDocument(summary(result), media_type="text/markdown"), static=True)
    _draw_styles(stream, every)
    standing = places_of(result)
    if isinstance(result, Run):
        _draw_events(stream, standing[0], result)
    else:
        _draw_tolerance(stream, result)
        for place, one in zip(standing, result.runs, strict=True):
            _draw_events(stream, place, one.run, f"{printable(one.name)}: " if len(standing) > 1 else "")
            _draw_worst(stream, place, one)
    draw_scene(stream, scene)


def _draw_styles(stream: RecordingStream, every: Sequence[Block]) -> None:
    """Give every series its name and its colour."""
    import rerun as rr

    for block in every:
        if block.names:
            style = rr.SeriesLines(
                colors=[rgb(colour) for colour in block.colours],
                names=list(block.names),
                widths=[LINE_WIDTH] * len(block.names),
                # Where samples are closer than pixels, the default draws their mean: peaks would vanish.
                aggregation_policy=rr.components.AggregationPolicy.MinMax,
            )
            stream.log(block.entity, style, static=True)


def _draw_tolerance(stream: RecordingStream, result: Comparison) -> None:
    """Draw what is allowed as lines over the compared times: both signs for an axis, one for the norm."""
    import rerun as rr

    ends = _ends([one.t_ns for one in result.runs])
    numbers = _ends([one.sample for one in result.runs])
    for quantity, limit in result.tolerance.items():
        signs = (1, -1) if quantity != "norm" else (1,)
        colour = rgb(AXIS_COLOURS.get(quantity, REFERENCE_COLOUR))
        what = "tolerance" if quantity == "axis" else f"tolerance of {quantity}"
        names = [f"{'+' if sign > 0 else '-'}{what}" for sign in signs]
        entity = entity_path("delta", "tolerance", quantity)
        style = rr.SeriesLines(colors=[colour] * len(signs), names=names, widths=[LIMIT_WIDTH] * len(signs))
        stream.log(entity, style, static=True)
        values = np.array([[sign * limit for sign in signs]] * len(ends))
        stream.send_columns(entity, time_columns(ends, "sample", numbers), rr.Scalars.columns(scalars=values))


def _ends(ranges: Sequence[IntArray]) -> IntArray:
    """Return the least and the largest number in all of the ranges."""
    return np.array([min(int(one[0]) for one in ranges), max(int(one[-1]) for one in ranges)], dtype=np.int64)


def _draw_events(stream: RecordingStream, place: Place, run: Run, label: str = "") -> None:
    """List the audit at its instants and the warnings at their rows, or at the first."""
    told = [f"{label}{printable(one.joint)} {_told(one)}" for one in run.audit]
    t_ns = np.array([round(one.t * 1e9) for one in run.audit], dtype=np.int64)
    levels = ["INFO" if one.kind in ("wrap", "repaired") else "WARN" for one in run.audit]
    _draw_text(stream, f"{place.prefix}events/repolarization", t_ns, told, levels)
    said = [
        f"{label}{printable(one.kind)}{f' in row {one.row}' if one.row else ''}: {printable(one.message)}"
        for one in run.warnings
    ]
    rows = np.clip([(one.row or 1) - 1 for one in run.warnings], 0, run.log.rows - 1).astype(np.int64)
    _draw_text(stream, f"{place.prefix}events/warning", run.log.t_ns[rows], said, ["WARN"] * len(said))


def _told(one: AuditEntry) -> str:
    """Return what happened to a joint, in which row."""
    where = f"in row {one.row}"
    if one.kind == "wrap":
        turns = f"{one.before:+d} to {one.after:+d} turns"
        return f"repolarized {where}: step {one.step:+.4f} rad, {turns}, +-{1e3 * one.half_period:.3g} ms"
    if one.kind in ("in-between", "repaired"):
        done = "repaired" if one.kind == "repaired" else "left on a wrap"
        return f"{done} {where}: {one.step:+.4f} rad off the line of its neighbours"
    why = (
        "no wrap" if one.kind == "unexplained" else f"a gap of {2e3 * one.half_period:.6g} ms: turns unknown"
    )
    return f"{one.kind} {where}: step {one.step:+.4f} rad, {why}"


def _draw_worst(stream: RecordingStream, place: Place, one: Deviation) -> None:
    """List where the deviation is largest: a click on it brings the viewer there."""
    worst = one.worst
    x, y, z, norm = (1e3 * float(value) for value in one.delta[worst])
    said = f"largest deviation of {printable(one.name)}: {norm:.3f} mm (x {x:.3f}, y {y:.3f}, z {z:.3f})"
    level = "INFO" if one.verdict == "pass" else "ERROR"
    _draw_text(stream, f"{place.prefix}events/deviation", one.t_ns[worst : worst + 1], [said], [level])


def _draw_text(
    stream: RecordingStream, entity: str, t_ns: IntArray, texts: Sequence[str], levels: Sequence[str]
) -> None:
    """Send lines of the list of events, each beginning with its time: the list's own column is too narrow."""
    import rerun as rr

    if not texts:
        return
    lines = [f"{at / 1e9:.4f} s  {text}" for at, text in zip(t_ns.tolist(), texts, strict=True)]
    columns = rr.TextLog.columns(text=lines, level=list(levels))
    stream.send_columns(entity, time_columns(t_ns), columns)
