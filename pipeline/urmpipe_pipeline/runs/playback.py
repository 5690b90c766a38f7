"""Playback of a log as its file has it: what an environment shows that runs the raw joints.

Between two rows an environment interpolates. Across a jump of +-pi that takes a joint through almost a whole
turn within one period: half way, at t_r, it stands near 0, and the tool centre point is far from its path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.kinematics.forward import PointLog, point_over_log, positions_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.curves import decimate
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, SpaceFigure, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, DEVIATION_COLOUR
from urmpipe_pipeline.presentation.parts import ends, spot_at
from urmpipe_pipeline.presentation.scene import Path, Spot
from urmpipe_pipeline.runs.figures import coordinates, point_name
from urmpipe_pipeline.runs.grid import interpolate
from urmpipe_pipeline.runs.run import Run

PARTS = 32
"""Periods of playback between the two rows of a jump: in each the joint turns by 11 degrees, so that the
swing of the tool centre point is seen as a curve, and the sixteenth ends at t_r."""

MOST = 1000
"""Jumps that are played back at most, the first ones: beyond them a drawing tells nothing more."""


@dataclass(frozen=True, slots=True, eq=False)
class Playback:
    """The raw joints played back, and where the tool centre point is then.

    Its instants are those of some rows of the file, enough to draw it, the ones beside a jump among them, and
    `PARTS` + 1 a jump, from the row before it to the row after it.

    Attributes:
        t: Instants in [s] from the first row, increasing, shape (m,); not all are whole [ns].
        q: Raw joint values in [rad] or [m], shape (m, joints); NaN where the file has none.
        position: Of the tool centre point in [m], shape (m, 3).
        velocity: In [m/s], shape (m, 3).
        acceleration: In [m/s2], shape (m, 3).
        jumping: Where a joint jumps, the two rows of a jump included, shape (m,).
        off: Distance of the position from the run's at that instant in [m], shape (m,); 0 outside jumps.
        jumps: How many were played back.
    """

    t: FloatArray
    q: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jumping: NDArray[np.bool_]
    off: FloatArray
    jumps: int

    @property
    def worst(self) -> int | None:
        """Index of the instant at which the tool centre point is furthest off; None if none is known."""
        return int(np.nanargmax(self.off)) if np.isfinite(self.off).any() else None


def replay_raw(run: Run) -> Playback | None:
    """Return the playback of a log; None without kinematics or without a repolarization.

    Outside the jumps velocity and acceleration are the run's. Within a jump they are those of central
    differences of the played-back joints at the period of playback: the time between its rows by `PARTS`.

    Source: [UrmArm2021]_ section 2.3, Figure 5.
    """
    if run.robot is None or run.tcp is None or not run.repolarizations:
        return None
    first, last = _jumps(run)
    inside, q_inside, motion = _across(run, run.robot, first, last)
    beside = np.clip(np.concatenate((first - 1, last + 1)), 0, run.log.rows - 1)
    rows = _outside(np.union1d(_drawn_rows(run, run.tcp), beside), first, last)
    t_rows, q_rows = run.log.t_ns[rows], run.log.q[rows]
    should = positions_over_log(run.robot, _linear(inside, run.t_ns, run.q))
    parts = (
        (t_rows / 1e9, inside / 1e9),
        (q_rows, q_inside),
        (positions_over_log(run.robot, q_rows), motion.position),
        (interpolate(t_rows, run.t_ns, run.tcp.velocity), motion.velocity),
        (interpolate(t_rows, run.t_ns, run.tcp.acceleration), motion.acceleration),
        (np.zeros(len(rows), dtype=np.bool_), np.ones(len(inside), dtype=np.bool_)),
        (np.zeros(len(rows)), np.linalg.norm(motion.position - should, axis=1)),
    )
    order = np.argsort(np.concatenate(parts[0]), kind="stable")
    t, q, position, velocity, acceleration, jumping, off = (np.concatenate(part)[order] for part in parts)
    return Playback(t, q, position, velocity, acceleration, jumping, off, len(first))


def _jumps(run: Run) -> tuple[IntArray, IntArray]:
    """Return the row before and the row after each jump, from 0, each pair once, in order."""
    entries = run.repolarizations[:MOST]
    last = np.array([entry.sample for entry in entries])
    before = np.array([(entry.t - entry.half_period) * 1e9 for entry in entries])
    first = _nearest(run.log.t_ns, np.rint(before).astype(np.int64))
    pairs = np.unique(np.column_stack((np.minimum(first, last - 1), last)), axis=0)
    return pairs[:, 0], pairs[:, 1]


def _across(
    run: Run, robot: Chain, first: IntArray, last: IntArray
) -> tuple[FloatArray, FloatArray, PointLog]:
    """Return the instants of jumps in [ns], shape (i,), the joints there, and the motion of the tool."""
    start, end = run.log.t_ns[first].astype(np.float64), run.log.t_ns[last].astype(np.float64)
    period = (end - start) / PARTS
    # One instant more on either side, for the differences.
    t = start[:, np.newaxis] + period[:, np.newaxis] * np.arange(-1, PARTS + 2)
    q = _linear(t.ravel(), run.log.t_ns, run.log.q).reshape(*t.shape, -1)
    tsp = period[:, np.newaxis, np.newaxis] / 1e9
    qd = (q[:, 2:] - q[:, :-2]) / (2.0 * tsp)
    qdd = (q[:, 2:] - 2.0 * q[:, 1:-1] + q[:, :-2]) / tsp**2
    inside, kept = np.unique(t[:, 1:-1], return_index=True)  # two jumps may share a row
    q, qd, qdd = (values.reshape(-1, values.shape[-1])[kept] for values in (q[:, 1:-1], qd, qdd))
    return inside, q, point_over_log(robot, q, qd, qdd)


def _drawn_rows(run: Run, tcp: PointLog) -> IntArray:
    """Return the rows of the file nearest to the grid samples that a drawing of the motion needs."""
    sizes = (np.linalg.norm(values, axis=1) for values in (tcp.velocity, tcp.acceleration))
    kept = np.unique(np.concatenate([decimate(values) for values in (*tcp.position.T, *sizes)]))
    return np.unique(_nearest(run.log.t_ns, run.t_ns[kept]))


def _outside(rows: IntArray, first: IntArray, last: IntArray) -> IntArray:
    """Return the rows that are not of a jump; its own two rows are."""
    until = np.maximum.accumulate(last)
    jump = np.searchsorted(first, rows, side="right") - 1
    return rows[(jump < 0) | (rows > until[jump])]


def _nearest(t_ns: IntArray, at_ns: IntArray) -> IntArray:
    """Return the index of the time that is nearest to each of some others."""
    return np.searchsorted((t_ns[1:] + t_ns[:-1]) // 2, at_ns)


def _linear(at: FloatArray, known_ns: IntArray, values: FloatArray) -> FloatArray:
    """Return columns at times in [ns], linear between those that are there, beyond them the last that is."""
    known = known_ns.astype(np.float64)
    result = np.full((len(at), values.shape[1]), np.nan)
    for i, column in enumerate(values.T):
        there = np.isfinite(column)
        if there.any():
            result[:, i] = np.interp(at, known[there], column[there])
    return result


def playback_figures(run: Run) -> Iterator[Figure | SpaceFigure]:
    """Yield the tool centre point and its path before and after repolarization: Figure 5 of the paper.

    Nothing of a log without kinematics or without a repolarization.
    """
    played = replay_raw(run)
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
