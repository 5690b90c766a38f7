"""The tool centre point before and after repolarization: the log played back as the raw joints lead it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.kinematics.forward import PointLog
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, SpaceFigure, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, DEVIATION_COLOUR
from urmpipe_pipeline.presentation.parts import ends, spot_at
from urmpipe_pipeline.presentation.scene import Path, Spot
from urmpipe_pipeline.runs.figures import coordinates, point_name
from urmpipe_pipeline.runs.playback import MOST, PARTS, Playback, play_back
from urmpipe_pipeline.runs.results import Run


def playback_figures(run: Run) -> Iterator[Figure | SpaceFigure]:
    """Yield the tool centre point and its path before and after repolarization: Figure 5 of the paper.

    Nothing of a log without kinematics or without a repolarization.
    """
    played = play_back(run)
    if played is not None and run.tcp is not None:
        yield _point_figure(run, run.tcp, played)
        yield _path_figure(run, run.tcp, played)


def _point_figure(run: Run, after: PointLog, played: Playback) -> Figure:
    """Return position, speed and acceleration as the raw joints move the tool centre point, and after."""
    t_ns, name = _times(played), point_name(run)
    panels = [
        Panel(f"{name} before", "m", (coordinates(played.position),), t_ns),
        Panel(f"{name} after", "m", (coordinates(after.position),), run.t_ns),
    ]
    for symbol, unit, raw, right in (
        ("v", "m/s", played.velocity, after.velocity),
        ("a", "m/s2", played.acceleration, after.acceleration),
    ):
        panels.append(_size(f"‖{symbol}‖ before", unit, raw, t_ns, DEVIATION_COLOUR))
        panels.append(_size(f"‖{symbol}‖ after", unit, right, run.t_ns, AXIS_COLOURS["norm"]))
    worst = played.worst
    at = {} if worst is None else {int(t_ns[worst]): f"furthest off {text.seconds(played.t[worst])} s"}
    return Figure(
        "Tool centre point before and after repolarization",
        f"{_error_words(run, played)} {_playback_words(run)}",
        f"Position, speed and acceleration of {name} of {run.name} over time, as the angles of the file move"
        f" it and after repolarization. {_error_words(run, played)}",
        (View("Before and after repolarization", tuple(panels)),),
        at,
    )


def _size(title: str, unit: str, vectors: FloatArray, t_ns: IntArray, colour: str) -> Panel:
    """Return a panel of the norms of vectors, on its own scale."""
    line = Line(np.linalg.norm(vectors, axis=1), (title,), (colour,))
    return Panel(title, unit, (line,), t_ns, signed=False, share=0.75)


def _path_figure(run: Run, after: PointLog, played: Playback) -> SpaceFigure:
    """Return the path in space as the raw joints lead the tool centre point, and after repolarization."""
    spots = ends(after.position)
    if played.worst is not None:
        spots += (Spot(spot_at(played.position[played.worst]), "furthest off", DEVIATION_COLOUR),)
    said = _error_words(run, played)
    return SpaceFigure(
        "Path in space before and after repolarization",
        said,
        f"Path of {point_name(run)} of {run.name} in three dimensions, as the angles of the file lead it and"
        f" after repolarization. {said}",
        (
            Path("before", played.position, _times(played), DEVIATION_COLOUR),
            Path("after", after.position, run.t_ns, AXIS_COLOURS["norm"]),
        ),
        spots,
    )


def _times(played: Playback) -> IntArray:
    """Return the instants of a playback in [ns], rounded."""
    return np.rint(1e9 * played.t).astype(np.int64)


def _error_words(run: Run, played: Playback) -> str:
    """Say how far the tool centre point goes wrong at most, when, and how fast it becomes."""
    worst = played.worst
    if worst is None:
        return "How far the tool centre point goes wrong is not known."
    t = float(played.t[worst])
    jump = min(run.repolarizations, key=lambda entry: abs(entry.t - t))
    off = text.quantity(float(played.off[worst]), "m")
    where = f"at t = {text.seconds(t)} s, where {jump.joint} jumps (row {jump.row})"
    return (
        f"Before repolarization {point_name(run)} is off by up to {off}, {where}; its speed reaches"
        f" {_largest(played.velocity)} m/s, its acceleration {_largest(played.acceleration)} m/s²."
    )


def _playback_words(run: Run) -> str:
    """Say what "before" means."""
    some = f" Only the first {MOST} jumps are played back." if len(run.repolarizations) > MOST else ""
    return (
        "Before: the angles of the file, linear from row to row, as a program shows them that plays the log"
        f" back with {PARTS} steps across each jump. After: repolarized.{some}"
    )


def _largest(vectors: FloatArray) -> str:
    norm = np.linalg.norm(vectors, axis=1)
    return f"{np.nanmax(norm):.4g}" if np.isfinite(norm).any() else text.NOTHING
