"""The nearest arm that has a closed form: axes that all but meet or are parallel made to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.inverse.closed.loop_equations import nearest_point
from urmpipe_models.inverse.closed.spherical_wrist import TILT, meeting_point
from urmpipe_models.kinematics.screws import Screws

NEARLY = 1e-2
"""Axes all but meet if they pass each other by less than this, in units of the arm's size, and are all but
parallel if they stand at less than this to each other, in [rad].

Angles written as 1.5708 are off by 4e-6, lengths written to the micrometre by 1e-6 m; the calibration of an
arm as built moves its axes by some 1e-3 rad and a millimetre. Of arm6 and the UR arms moved like that one
random pose in a hundred loses the branch that it was made of, all beside singular poses.
"""


def with_spherical_wrist(screws: Screws) -> Iterator[Screws]:
    """Yield six joints whose last three axes are made to meet in one point, if they all but do.

    First with joints 1 to 3 ordered as well: axes 2 and 3, or else 1 and 2, made parallel or made to meet
    if they all but do, so that the branches have the names of the arm that was meant; then without.
    """
    arm = compact(screws)
    if len(arm.revolute) != 6 or not arm.revolute[3:].all():
        return
    if np.linalg.norm(np.cross(arm.direction[3:5], arm.direction[4:]), axis=1).min() <= TILT:
        return  # parallel axes meet nowhere, and no such wrist has a closed form
    centre = meeting_point(arm.direction[3:], arm.point[3:])
    passing = np.linalg.norm(np.cross(centre - arm.point[3:], arm.direction[3:]), axis=1)
    if passing.max() > NEARLY * arm.size:
        return
    point = arm.point.copy()
    point[3:] = centre
    met = replace(arm, point=point)
    for pair in ([1, 2], [0, 1]):
        if arm.revolute[pair].all():
            yield from _paired(met, pair)
    yield met


def with_parallel_axes(screws: Screws) -> Iterator[Screws]:
    """Yield six revolute joints with axes 2, 3, 4 made parallel, if they all but are.

    First with axes 5 and 6 as they are, then made to meet if they all but do.
    """
    arm = compact(screws)
    if len(arm.revolute) != 6 or not arm.revolute.all():
        return
    parallel = _made_parallel(arm, [1, 2, 3])
    if parallel is None:
        return
    yield parallel
    met = _made_to_meet(parallel, [4, 5])
    if met is not None:
        yield met


def compact(screws: Screws) -> Screws:
    """Return the same screws, each by the point of its axis that is nearest to the one before it.

    So an axis that is tilted is tilted where the arm is, and the arm's size is that of the arm: frames may
    lie anywhere along their axes.
    """
    k, point = screws.direction, screws.point.copy()
    if len(point) > 1:
        point[0] = nearest_point(point[0], k[0], point[1], k[1])
    for i in range(1, len(point)):
        point[i] += k[i] * (k[i] @ (point[i - 1] - point[i]))
    return replace(screws, point=point)


def _paired(arm: Screws, pair: list[int]) -> Iterator[Screws]:
    """Yield an arm with two axes made parallel, or made to meet, if they all but are or do."""
    for made in (_made_parallel(arm, pair), _made_to_meet(arm, pair)):
        if made is not None:
            yield made


def _made_parallel(arm: Screws, axes: list[int]) -> Screws | None:
    """Return an arm with axes along their mean direction, senses kept; None if they are not nearly so."""
    k = arm.direction[axes]
    senses = np.where(k @ k[0] < 0.0, -1.0, 1.0)[:, None]
    mean = (senses * k).sum(axis=0)
    mean /= np.linalg.norm(mean)
    if np.linalg.norm(np.cross(k, mean), axis=1).max() > NEARLY:
        return None
    direction = arm.direction.copy()
    direction[axes] = senses * mean
    return replace(arm, direction=direction)


def _made_to_meet(arm: Screws, axes: list[int]) -> Screws | None:
    """Return an arm with two axes moved to the middle of their common normal; None if they pass far."""
    k, point = arm.direction[axes], arm.point[axes]
    if np.linalg.norm(np.cross(*k)) <= NEARLY:
        return None
    feet = [_foot(point, k, 0), _foot(point, k, 1)]
    if np.linalg.norm(feet[1] - feet[0]) > NEARLY * arm.size:
        return None
    points = arm.point.copy()
    points[axes] = (feet[0] + feet[1]) / 2
    return replace(arm, point=points)


def _foot(point: FloatArray, k: FloatArray, i: int) -> FloatArray:
    """Return the point of one of two lines that is nearest to the other."""
    return nearest_point(point[i], k[i], point[1 - i], k[1 - i])
