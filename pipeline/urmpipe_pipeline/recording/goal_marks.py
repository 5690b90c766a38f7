"""The targets of solved joint values in the 3D view: frames or points, their way, and those missed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.orientation import matrices
from urmpipe_pipeline.recording.entities import Place
from urmpipe_pipeline.recording.ways import MOST, dashed, lines_of
from urmpipe_pipeline.runs.results import Run

FRAMES = 100
"""Targets with an orientation that are drawn as frames, at most: more would hide each other."""


@dataclass(frozen=True, slots=True, eq=False)
class GoalMarks:
    """What is drawn of targets.

    Attributes:
        root: The entity that it stands below.
        origin: Where targets with an orientation are, in [m], shape (m, 3).
        axes: Their x, y and z axes [-], shape (m, 3, 3), an axis a column.
        points: Targets drawn as points, in [m], shape (k, 3).
        strips: The way through targets with times, dashed, in [m], shape (any, 3) each.
        reached: Every target that the arm has a pose for, in [m], shape (r, 3).
        missed: Targets that it has none for, in [m], shape (u, 3).
        reasons: Why it has none, a line each, with the row; of several reasons the first.
    """

    root: str
    origin: FloatArray
    axes: FloatArray
    points: FloatArray
    strips: tuple[FloatArray, ...]
    reached: FloatArray
    missed: FloatArray
    reasons: tuple[str, ...]


def goal_marks(run: Run, place: Place) -> GoalMarks | None:
    """Return what is drawn of the targets of a run; None of a run that was not solved."""
    goals = run.goals
    if goals is None:
        return None
    there = np.isfinite(goals.position).all(axis=1)
    few = int(there.sum()) <= FRAMES
    framed = few and goals.quat_xyzw is not None
    turned = goals.quat_xyzw[there] if framed and goals.quat_xyzw is not None else np.empty((0, 4))
    position, none = goals.position[there], np.empty((0, 3))
    missed = np.flatnonzero(there & goals.missed)[:MOST]
    return GoalMarks(
        root=place.prefix + "targets",
        origin=position if framed else none,
        axes=matrices(turned),
        points=none if framed or (not few and run.timed) else position[:MOST],
        strips=dashed(lines_of(goals.position)) if run.timed else (),
        reached=goals.position[there & ~goals.missed],
        missed=goals.position[missed],
        reasons=tuple(f"row {row + 1}: {goals.why(row)}" for row in missed.tolist()),
    )
