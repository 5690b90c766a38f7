"""The criteria of poses: accuracy, repeatability, distances, directions, settling and drift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.command_path import CORNER
from urmpipe_pipeline.iso9283.criteria import ANGLES
from urmpipe_pipeline.iso9283.poses import Poses
from urmpipe_pipeline.iso9283.spread import accuracy, angles, repeatability, threefold, turned

Found: TypeAlias = tuple[str, str, float | None]
"""A criterion, where it is, and its value."""

TENTH = 10
"""Drift is told between the first and the last of so many parts of the cycles."""


def pose_criteria(attained: FloatArray, quats: FloatArray | None, poses: Poses) -> Iterator[Found]:
    """Yield what the attained points of several cycles tell of each pose.

    Args:
        attained: In [m], shape (n, k, 3): cycles, poses, coordinates.
        quats: Orientations [-], shape (n, k, 4); None without them.
        poses: The commanded poses.

    Source: after ISO 9283: AP and RP as public evaluations have them, the others from common knowledge.
    """
    at = [f"pose {k + 1}" for k in range(len(poses))]
    yield from _each("AP", at, accuracy(attained, poses.position))
    yield from _each("RP", at, repeatability(attained))
    if quats is not None and poses.quat_xyzw is not None:
        flat = angles(quats.reshape(-1, 4)).reshape(*quats.shape[:2], 3)
        off = turned(flat, angles(poses.quat_xyzw))
        yield from angle_criteria("P", at, off)
    yield from _distances(attained, poses)
    yield from _directions(attained, poses)
    yield from _drift(attained, poses, at)


def angle_criteria(kind: str, at: Sequence[str], off: FloatArray) -> Iterator[Found]:
    """Yield accuracy and repeatability of the angles rz, ry and rx.

    A = |mean angle - commanded angle|, R = 3 S of the angle over the cycles.

    Args:
        kind: P of poses, T of paths.
        at: What the places are called.
        off: Attained - commanded angles in [rad], shape (n, k, 3).

    Source: after ISO 9283, from common knowledge.
    """
    spread = threefold(off)
    for axis, angle in enumerate(ANGLES):
        yield from _each(f"A{kind}_{angle}", at, np.abs(off[:, :, axis].mean(axis=0)))
        yield from _each(f"R{kind}_{angle}", at, None if spread is None else spread[:, axis])


def _each(name: str, at: Sequence[str], values: FloatArray | None) -> Iterator[Found]:
    """Yield a criterion at some places; its values are of shape (k,), or none are known."""
    for k, where in enumerate(at):
        yield name, where, None if values is None else float(values[k])


def _distances(attained: FloatArray, poses: Poses) -> Iterator[Found]:
    """Yield of each two poses AD = |mean distance - commanded distance| and RD = 3 S of the distance."""
    pairs = [pair for pair in combinations(range(len(poses)), 2) if not poses.alike(*pair)]
    if not pairs:
        return
    first, second = np.array(pairs).T
    distance = np.linalg.norm(attained[:, first] - attained[:, second], axis=2)
    wanted = np.linalg.norm(poses.position[first] - poses.position[second], axis=1)
    at = [f"poses {a + 1}-{b + 1}" for a, b in pairs]
    yield from _each("AD", at, np.abs(distance.mean(axis=0) - wanted))
    yield from _each("RD", at, threefold(distance))


def _directions(attained: FloatArray, poses: Poses) -> Iterator[Found]:
    """Yield vAP: of a pose that is attained from different directions, how far its barycentres are apart.

    The direction is that from the pose before, of which the command tells; directions that differ by less
    than 30 deg are one.
    """
    centre = attained.mean(axis=0)
    for group in poses.visited_again:
        own = [k for k in group if k > 0]
        ways = [poses.position[k] - poses.position[k - 1] for k in own]
        pairs = [(own[i], own[j]) for i, j in combinations(range(len(own)), 2) if _differ(ways[i], ways[j])]
        if pairs:
            apart = max(float(np.linalg.norm(centre[a] - centre[b])) for a, b in pairs)
            yield "vAP", f"poses {', '.join(str(k + 1) for k in group)}", apart


def _differ(first: FloatArray, second: FloatArray) -> bool:
    """Tell whether two directions, shape (3,) each, are at least 30 deg apart."""
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return size > 0.0 and float(first @ second) <= size * np.cos(CORNER)


def _drift(attained: FloatArray, poses: Poses, at: Sequence[str]) -> Iterator[Found]:
    """Yield dAP and dRP: how much AP and RP change from the first tenth of the cycles to the last."""
    count = -(-len(attained) // TENTH)
    parts = attained[:count], attained[-count:]
    several = len(attained) > 1
    accuracies = [accuracy(one, poses.position) for one in parts]
    yield from _each("dAP", at, np.abs(accuracies[1] - accuracies[0]) if several else None)
    first, last = (repeatability(one) for one in parts)
    yield from _each("dRP", at, None if first is None or last is None else np.abs(last - first))
