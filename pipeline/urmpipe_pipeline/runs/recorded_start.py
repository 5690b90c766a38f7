"""The first rows of a recorded tool centre point, where the controller knew no tool yet, or no pose."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import OWN, JointLog, LogWarning
from urmpipe_pipeline.sources.units.evidence import CLEARLY, CLOSE_WITH_TOOL, SAMPLES, spread

RECORDED_START = "recorded-tcp-start"

LEAST_ROWS = 10
"""A log of fewer rows tells too little of what is usual in it."""


def outlying_start(robot: Chain | None, log: JointLog) -> tuple[int, float]:
    """Return how many rows at the start have the tool centre point elsewhere than the others, and how far.

    Elsewhere is in the frame of the tip, where a tool stays: the offset from the kinematics is there
    `CLEARLY` times further from the usual one than in any row that follows, and further than a calibration
    makes. It is told in [m] as the median of these rows; inf of points of three zeros, which are none
    but in a plan.
    """
    if log.tcp_position is None or log.measured or log.rows < LEAST_ROWS:
        return 0, 0.0
    first = log.tcp_position[0]
    zeros = 0 if first.any() or log.source == OWN else int(np.argmax(log.tcp_position.any(axis=1)))
    if robot is None or log.q.shape[1] != len(robot.moving):
        return zeros, np.inf
    rows, apart = _by_tool(robot, log, zeros)
    return (zeros + rows, apart) if rows else (zeros, np.inf)


def start_warning(robot: Chain | None, log: JointLog) -> list[LogWarning]:
    """Return a warning if the first rows recorded the tool centre point elsewhere than the others."""
    rows, apart = outlying_start(robot, log)
    if not rows:
        return []
    first = "the first row" if rows == 1 else f"the first {rows} rows"
    where = "as 0, 0, 0" if np.isinf(apart) else f"{text.quantity(apart, 'm')} from where the others have it"
    said = f"{first} of {log.rows} recorded the TCP {where}: no tool or pose known yet?"
    return [LogWarning(RECORDED_START, f"{said} They are kept and judged with the others", row=1)]


def _by_tool(robot: Chain, log: JointLog, start: int) -> tuple[int, float]:
    """Return how many rows from a first one on have another tool than the others, and by how much in [m]."""
    every = np.arange(start, log.rows)
    rows = np.union1d(every[:SAMPLES], every[spread(len(every))])
    offset = _offsets(robot, log, rows)
    known = np.isfinite(offset).all(axis=1)
    rows, offset = rows[known], offset[known]
    even = np.isin(rows, every[spread(len(every))])
    if np.count_nonzero(even) < LEAST_ROWS:
        return 0, 0.0
    usual = np.median(offset[even], axis=0)
    apart = np.linalg.norm(offset - usual, axis=1)
    least, most = np.minimum.accumulate(apart)[:-1], np.maximum.accumulate(apart[::-1])[::-1][1:]
    splits = np.flatnonzero(least > np.maximum(CLEARLY * most, CLOSE_WITH_TOOL))
    if not len(splits):
        return 0, 0.0
    last = int(splits[-1])
    between = np.arange(rows[last], rows[last + 1])  # rows that were not looked at
    beyond = np.linalg.norm(_offsets(robot, log, between) - usual, axis=1) > CLEARLY * most[last]
    return int(between[beyond][-1]) + 1 - start, float(np.median(apart[: last + 1]))


def _offsets(robot: Chain, log: JointLog, rows: IntArray) -> FloatArray:
    """Return the recorded points in the frame that the kinematics give the tool, shape (n, 3), in [m]."""
    assert log.tcp_position is not None  # asked before
    position, rotation = poses_over_log(robot, log.q[rows])
    return np.asarray(np.einsum("nji,nj->ni", rotation, log.tcp_position[rows] - position))
