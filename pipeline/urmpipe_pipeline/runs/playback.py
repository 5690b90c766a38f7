"""Playback of a log as its file has it: what an environment shows that runs the raw joints.

Between two rows an environment interpolates. Across a jump of +-pi that takes a joint through almost a whole
turn within one period: half way, at t_r, it stands near 0, and the tool centre point is far from its path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.kinematics.forward import PointLog, point_over_log, positions_over_log
from urmpipe_pipeline.presentation.curves import decimate
from urmpipe_pipeline.runs.grid import interpolate
from urmpipe_pipeline.runs.results import Run

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


def play_back(run: Run) -> Playback | None:
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
