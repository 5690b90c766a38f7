"""Why an arm cannot move as planned: samples it does not reach, jumps, singular poses, speeds near zero."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray
from urmpipe_models.inverse.along_path.joint_path import JointPath
from urmpipe_models.inverse.along_path.stretches import stretches
from urmpipe_models.planning.joint_limits import rests_of
from urmpipe_models.planning.line_arc import LineArcPath
from urmpipe_models.planning.time_law import PathMotion
from urmpipe_pipeline.planned_paths.result import Obstacle, ObstacleKind, PlannedJoints
from urmpipe_pipeline.text import counted, in_words

SINGULAR = 1e-9
"""Smallest singular value [-] of a singular pose but for rounding."""

WORTH_MOVING = 0.01
"""Speeds that would have to fall below this share are no plan: another path has to be taken (step 18)."""


def obstacles_of(
    path: LineArcPath, motion: PathMotion, t: FloatArray, joints: PlannedJoints
) -> Iterator[Obstacle]:
    """Yield where an arm does not get along a path at all, each kind for itself.

    Args:
        path: The path.
        motion: Along it, n samples.
        t: Their times in [s], shape (n,).
        joints: What follows them.
    """
    at = _Places(path, motion.s, t)
    for first, last in stretches(~joints.path.reached):
        more = "" if first == last else f", and {counted(last - first, 'sample')} after it"
        yield at.obstacle(first, "unreachable", f"{joints.path.reasons[first]}{more}")
    for jump in joints.path.jumps:
        moved = ", ".join(f"{one.joint} by {in_words(one.step, one.unit)}" for one in jump.joints)
        yield at.obstacle(jump.sample, "jump", f"the joints jump: {moved}", jump.joints[0].joint)
    names = joints.path.chain.coordinates
    for first in _crawling(path, motion):
        slow = int(np.nanargmax(joints.velocity_share[first]))
        words = f"the joints all but stop it, at {motion.v[first]:.3g} m/s"
        yield at.obstacle(first, "too-slow", words, names[slow])
    for first, _ in stretches(_singular(joints.path)):
        joint = names[int(np.argmax(np.abs(joints.path.q[first] - joints.path.q[max(first - 1, 0)])))]
        yield at.obstacle(first, "singular", "the arm passes a singular pose", joint)


def too_slow(
    path: LineArcPath, s: FloatArray, t: FloatArray, sample: int, joint: str, factor: float
) -> Obstacle:
    """Return the obstacle that speeds would have to fall by a factor [-] for a joint at a sample.

    Args:
        path: The path.
        s: Arc lengths of the samples in [m], shape (n,).
        t: Their times in [s], shape (n,).
        sample: Where the joint exceeds its limit most.
        joint: Its name.
        factor: What the speeds would have to be multiplied by [-].
    """
    words = f"{joint} allows {100.0 * factor:.2g} % of the speed, allowed: {100.0 * WORTH_MOVING:g} % or more"
    return _Places(path, s, t).obstacle(sample, "too-slow", words, joint)


def _crawling(path: LineArcPath, motion: PathMotion) -> Iterator[int]:
    """Yield the first sample of each stretch in which a law all but stops where nothing makes it stop."""
    rests = rests_of(path)
    for first, last in stretches(motion.v < WORTH_MOVING * motion.v.max()):
        ends = motion.s[[max(first - 1, 0), min(last + 1, len(motion.s) - 1)]]
        if not ((ends[0] <= rests) & (rests <= ends[1])).any():
            yield first


class _Places:
    """Where and when samples are along a path."""

    def __init__(self, path: LineArcPath, s: FloatArray, t: FloatArray) -> None:
        self._segment, self._row, self._t = path.segment_at(s), path.row, t

    def obstacle(self, sample: int, kind: ObstacleKind, words: str, joint: str = "") -> Obstacle:
        """Return an obstacle at a sample."""
        k = int(self._segment[sample])
        return Obstacle(kind, k, int(self._row[k]) + 1, float(self._t[sample]), joint, words)


def _singular(path: JointPath) -> BoolArray:
    """Return which samples are singular, or have the first determinant of another sign, shape (n,)."""
    found = np.asarray(path.singularity.smallest <= SINGULAR)
    determinant = path.singularity.determinant
    if determinant is not None:
        jumping = np.zeros(len(path), dtype=bool)
        jumping[[one.sample for one in path.jumps]] = True
        found[1:] |= (determinant[1:] * determinant[:-1] < 0.0) & ~jumping[1:]
    return found
