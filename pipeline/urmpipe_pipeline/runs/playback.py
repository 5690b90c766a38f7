"""Playback of the raw joints of a log, as an environment shows them, and its figures.

Between two rows an environment interpolates. A jump of +-pi then moves a joint through almost a whole turn
within one period: half way, at t_r, it is near 0, and the tool centre point is far from its path.

- `replay_raw`: the joints and the tool centre point, in `PARTS` steps across each jump.
- `playback_figures`: the tool centre point and its path before and after repolarization.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
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

PARTS = 32  # steps across a jump, of 11 degrees each: the swing of the TCP is a curve, the 16th ends at t_r
MAX_JUMPS = 1000  # that are played back, the first ones: a drawing of more shows no more


class Playback(NamedTuple):
    """The raw joints played back, and the tool centre point.

    Its times are those of the rows of the file that a drawing needs, those next to a jump among them, and
    `PARTS` + 1 per jump, from the row before it to the row after it.

    Attributes:
        t: Times from the first row in [s], increasing, shape (m,); not all are whole [ns].
        q: Raw joint values in [rad] or [m], shape (m, joints); NaN where the file has none.
        position: Position of the tool centre point in [m], shape (m, 3).
        velocity: Its velocity in [m/s], shape (m, 3).
        acceleration: Its acceleration in [m/s2], shape (m, 3).
        jumping: Where a joint jumps, the two rows of a jump included, shape (m,).
        deviation: Distance of the position from that of the run in [m], shape (m,); 0 outside jumps.
        jumps: Number of jumps that are played back.
    """

    t: FloatArray
    q: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jumping: BoolArray
    deviation: FloatArray
    jumps: int

    @property
    def worst(self) -> int | None:
        """Index of the largest deviation; None if no deviation is known."""
        return int(np.nanargmax(self.deviation)) if np.isfinite(self.deviation).any() else None


def replay_raw(run: Run) -> Playback | None:
    """Return the playback of a log; None without kinematics or without a repolarization.

    Outside the jumps, velocity and acceleration are those of the run. Within a jump they are from central
    differences of the joints that are played back, at the time between its rows divided by `PARTS`.

    Source: [UrmArm2021]_ section 2.3, Figure 5.
    """
    if run.robot is None or run.tcp is None or not run.repolarizations:
        return None
    first, last = _jumps(run)
    inside, q_inside, motion = _across(run, run.robot, first, last)
    neighbours = np.clip(np.concatenate((first - 1, last + 1)), 0, run.log.rows - 1)
    rows = _outside(np.union1d(_drawn_rows(run, run.tcp), neighbours), first, last)
    t_rows, q_rows = run.log.t_ns[rows], run.log.q[rows]
    expected = positions_over_log(run.robot, _linear(inside, run.t_ns, run.q))
    parts = (
        (t_rows / 1e9, inside / 1e9),
        (q_rows, q_inside),
        (positions_over_log(run.robot, q_rows), motion.position),
        (interpolate(t_rows, run.t_ns, run.tcp.velocity), motion.velocity),
        (interpolate(t_rows, run.t_ns, run.tcp.acceleration), motion.acceleration),
        (np.zeros(len(rows), dtype=np.bool_), np.ones(len(inside), dtype=np.bool_)),
        (np.zeros(len(rows)), np.linalg.norm(motion.position - expected, axis=1)),
    )
    order = np.argsort(np.concatenate(parts[0]), kind="stable")
    t, q, position, velocity, acceleration, jumping, deviation = (
        np.concatenate(part)[order] for part in parts
    )
    return Playback(t, q, position, velocity, acceleration, jumping, deviation, len(first))


def _jumps(run: Run) -> tuple[IntArray, IntArray]:
    """Return the row before and the row after each jump, from 0, each pair once, in order."""
    entries = run.repolarizations[:MAX_JUMPS]
    last = np.array([entry.sample for entry in entries])
    before = np.array([(entry.t - entry.time_uncertainty) * 1e9 for entry in entries])
    first = _nearest(run.log.t_ns, np.rint(before).astype(np.int64))
    pairs = np.unique(np.column_stack((np.minimum(first, last - 1), last)), axis=0)
    return pairs[:, 0], pairs[:, 1]


def _across(
    run: Run, robot: Chain, first: IntArray, last: IntArray
) -> tuple[FloatArray, FloatArray, PointLog]:
    """Return the times of jumps in [ns], shape (i,), the joints, and the motion of the tool."""
    start, end = run.log.t_ns[first].astype(np.float64), run.log.t_ns[last].astype(np.float64)
    period = (end - start) / PARTS
    # One more time on either side, for the differences.
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
    """Return the rows outside of the jumps, which include their two rows."""
    until = np.maximum.accumulate(last)
    jump = np.searchsorted(first, rows, side="right") - 1
    return rows[(jump < 0) | (rows > until[jump])]


def _nearest(t_ns: IntArray, at_ns: IntArray) -> IntArray:
    """Return the index of the nearest time for each of some times."""
    return np.searchsorted((t_ns[1:] + t_ns[:-1]) // 2, at_ns)


def _linear(at: FloatArray, known_ns: IntArray, values: FloatArray) -> FloatArray:
    """Return columns at times in [ns], linear between values that are not missing, constant outside."""
    known = known_ns.astype(np.float64)
    result = np.full((len(at), values.shape[1]), np.nan)
    for i, column in enumerate(values.T):
        present = np.isfinite(column)
        if present.any():
            result[:, i] = np.interp(at, known[present], column[present])
    return result


def playback_figures(run: Run) -> Iterator[Figure | SpaceFigure]:
    """Yield the tool centre point and its path before and after repolarization, as Figure 5 of the paper.

    There is none for a log without kinematics or without a repolarization.
    """
    playback = replay_raw(run)
    if playback is not None and run.tcp is not None:
        yield _point_figure(run, run.tcp, playback)
        yield _path_figure(run, run.tcp, playback)


def _point_figure(run: Run, after: PointLog, playback: Playback) -> Figure:
    """Return position, speed and acceleration of the tool centre point before and after repolarization."""
    t_ns, name = _times(playback), point_name(run)
    panels = [
        Panel(f"{name} before", "m", (coordinates(playback.position),), t_ns),
        Panel(f"{name} after", "m", (coordinates(after.position),), run.t_ns),
    ]
    for symbol, unit, raw, right in (
        ("v", "m/s", playback.velocity, after.velocity),
        ("a", "m/s2", playback.acceleration, after.acceleration),
    ):
        panels.append(_size(f"‖{symbol}‖ before", unit, raw, t_ns, DEVIATION_COLOUR))
        panels.append(_size(f"‖{symbol}‖ after", unit, right, run.t_ns, AXIS_COLOURS["norm"]))
    worst = playback.worst
    at = (
        {}
        if worst is None
        else {int(t_ns[worst]): f"furthest off {text.format_seconds(playback.t[worst])} s"}
    )
    return Figure(
        "Tool centre point before and after repolarization",
        f"{_format_error(run, playback)} {_format_method(run)}",
        f"Position, speed and acceleration of {name} of {run.name} over time, as the angles of the file move"
        f" it and after repolarization. {_format_error(run, playback)}",
        (View("Before and after repolarization", tuple(panels)),),
        at,
    )


def _size(title: str, unit: str, vectors: FloatArray, t_ns: IntArray, colour: str) -> Panel:
    """Return a panel of the norms of vectors, with a separate scale."""
    line = Line(np.linalg.norm(vectors, axis=1), (title,), (colour,))
    return Panel(title, unit, (line,), t_ns, signed=False, share=0.75)


def _path_figure(run: Run, after: PointLog, playback: Playback) -> SpaceFigure:
    """Return the path of the tool centre point in space before and after repolarization."""
    spots = ends(after.position)
    if playback.worst is not None:
        spots += (Spot(spot_at(playback.position[playback.worst]), "furthest off", DEVIATION_COLOUR),)
    error = _format_error(run, playback)
    return SpaceFigure(
        "Path in space before and after repolarization",
        error,
        f"Path of {point_name(run)} of {run.name} in three dimensions, as the angles of the file lead it and"
        f" after repolarization. {error}",
        (
            Path("before", playback.position, _times(playback), DEVIATION_COLOUR),
            Path("after", after.position, run.t_ns, AXIS_COLOURS["norm"]),
        ),
        spots,
    )


def _times(playback: Playback) -> IntArray:
    """Return the times of a playback in [ns], rounded."""
    return np.rint(1e9 * playback.t).astype(np.int64)


def _format_error(run: Run, playback: Playback) -> str:
    """Return the sentence on the largest deviation, its time, and the largest speed and acceleration."""
    worst = playback.worst
    if worst is None:
        return "How far the tool centre point goes wrong is not known."
    t = float(playback.t[worst])
    jump = min(run.repolarizations, key=lambda entry: abs(entry.t - t))
    deviation = text.format_quantity(float(playback.deviation[worst]), "m")
    where = f"at t = {text.format_seconds(t)} s, where {jump.joint} jumps (row {jump.row})"
    return (
        f"Before repolarization {point_name(run)} is off by up to {deviation}, {where}; its speed reaches"
        f" {_largest(playback.velocity)} m/s, its acceleration {_largest(playback.acceleration)} m/s²."
    )


def _format_method(run: Run) -> str:
    """Return the sentences on what "before" means."""
    some = (
        f" Only the first {MAX_JUMPS} jumps are played back." if len(run.repolarizations) > MAX_JUMPS else ""
    )
    return (
        "Before: the angles of the file, linear from row to row, as a program shows them that plays the log"
        f" back with {PARTS} steps across each jump. After: repolarized.{some}"
    )


def _largest(vectors: FloatArray) -> str:
    norm = np.linalg.norm(vectors, axis=1)
    return f"{np.nanmax(norm):.4g}" if np.isfinite(norm).any() else text.NOTHING
