"""Why an arm cannot move as planned: places it does not reach, jumps, singular poses, speeds near zero."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from urmpipe_models.elementwise import BoolArray
from urmpipe_models.ik.path import JointPath, find_true_runs
from urmpipe_models.planning.joints import LimitUtilisation, PathJoints
from urmpipe_models.planning.laws import TimeLaw
from urmpipe_pipeline.text import format_rounded

SINGULAR = 1e-7
"""Smallest singular value [-] of a singular pose: a path is followed to 1e-9 m, joints to 1e-2 rad there."""

WORTH_MOVING = 0.01
"""Speeds that would have to fall below this share are no plan: another path has to be taken (step 18)."""

ObstacleKind = Literal["unreachable", "jump", "singular", "too-slow"]


@dataclass(frozen=True, slots=True)
class Infeasibility:
    """Why an arm cannot move as planned.

    Attributes:
        kind: What is in the way: places without a solution, a jump, a singular pose, or speeds that would
            have to fall below what is worth moving.
        segment: Number of the segment, from 0.
        row: Row of the path that the segment belongs to, from 1.
        s: Where along the path, in [m].
        t: When, in [s].
        joint: The joint that is concerned most; empty where it is the arm as a whole.
        message: What is in the way, without its place.
    """

    kind: ObstacleKind
    segment: int
    row: int
    s: float
    t: float
    joint: str
    message: str


def obstacles_of(joints: PathJoints, law: TimeLaw) -> Iterator[Infeasibility]:
    """Yield where an arm does not get along a path, whatever its speed, each kind for itself.

    Args:
        joints: The joints along the path.
        law: The law, which tells when a place is passed.

    Source: [Iso9283]_ section 4, step 17.
    """
    grid, s, names = joints.grid, joints.s, joints.chain.coordinates
    for first, last in find_true_runs(~grid.reached):
        along = f"; this holds for {s[last] - s[first]:.3g} m of the path" if last > first else ""
        yield _obstacle(joints, law, float(s[first]), "unreachable", f"{grid.reasons[first]}{along}")
    for jump in grid.jumps:
        moved = ", ".join(f"{one.joint} by {format_rounded(one.step, one.unit)}" for one in jump.joints)
        words = f"the joints jump: {moved}"
        yield _obstacle(joints, law, float(s[jump.sample]), "jump", words, jump.joints[0].joint)
    for first, _ in find_true_runs(_singular(grid)):
        moved_most = int(np.argmax(np.abs(grid.q[first] - grid.q[max(first - 1, 0)])))
        words = "the arm passes a singular pose"
        yield _obstacle(joints, law, float(s[first]), "singular", words, names[moved_most])


def too_slow(joints: PathJoints, law: TimeLaw, usage: LimitUtilisation, factor: float) -> Infeasibility:
    """Return the obstacle that speeds would have to fall by a factor [-] for a joint.

    Args:
        joints: The joints along the path.
        law: The law at its full speed.
        usage: Where the joint exceeds its limit most.
        factor: What the speeds would have to be multiplied by [-].

    Source: [Iso9283]_ section 4, step 18.
    """
    name = joints.chain.coordinates[usage.joint]
    words = f"{name} limits the speed to {100.0 * factor:.2g} %, allowed: {100.0 * WORTH_MOVING:g} % or more"
    return _obstacle(joints, law, usage.s, "too-slow", words, name)


def _obstacle(
    joints: PathJoints, law: TimeLaw, s: float, kind: ObstacleKind, words: str, joint: str = ""
) -> Infeasibility:
    """Return an obstacle at an arc length in [m]."""
    place = np.array([s])
    segment = int(joints.path.segment_at(place)[0])
    t = float(law.time_at(place)[0])
    return Infeasibility(kind, segment, int(joints.path.row[segment]) + 1, s, t, joint, words)


def _singular(grid: JointPath) -> BoolArray:
    """Return which places are singular, or have the first determinant of another sign, shape (n,)."""
    found = np.asarray(grid.singularity.smallest <= SINGULAR)
    determinant = grid.singularity.determinant
    if determinant is not None:
        jumping = np.zeros(len(grid), dtype=bool)
        jumping[[one.sample for one in grid.jumps]] = True
        found[1:] |= (determinant[1:] * determinant[:-1] < 0.0) & ~jumping[1:]
    return found
