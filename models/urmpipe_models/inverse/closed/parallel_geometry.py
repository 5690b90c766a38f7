"""The geometry of an arm whose axes 2, 3 and 4 are parallel, in a frame of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.elementwise import Vector
from urmpipe_models.kinematics.screws import Screws
from urmpipe_models.transform import Transform

PARALLEL = 1e-10
"""Axes that are this near to parallel, in [rad], are; a solution is off by no more than that."""

MEETING = 1e-11
"""Axes that pass each other by this share of the arm's size meet."""

TILT = 1e-3
"""The least sine of the angle of axes 1 and 5 to axes 2 to 4, and of axis 6 to axis 5 where these meet."""

PASSING = 1e-3
"""How far axes 5 and 6 must pass each other where they do not meet, t45 and t56 their angles to axes 4 and 5:
the distance, of the arm's size, times sin(t56) sin(t45)^2. With 1e-5 a solution may miss by 1e-7 m."""

ROUNDING = 1e-14
"""Less than this, of 1 or of the arm's size, is the rounding of a right angle or of an offset of 0."""


@dataclass(frozen=True, slots=True)
class ParallelGeometry:
    """The arm at q = 0 in a frame on axis 2 whose z axis is along axis 2.

    Attributes:
        to_frame: The world in the frame.
        from_tip: The frame in the tip's frame, at q = 0.
        k1: Direction of axis 1 [-]; k5 and k6 likewise.
        p1: A point of axis 1 in [m]; p5 and p6, which are the feet of the common normal of axes 5 and 6 and
            the same point where these meet, likewise.
        p3: A point of axis 3 in [m]; p4 likewise.
        signs: Of joints 2, 3, 4: -1 where its axis points against z.
        size: A length of the arm in [m].
    """

    to_frame: Transform
    from_tip: Transform
    k1: Vector
    k5: Vector
    k6: Vector
    p1: Vector
    p3: Vector
    p4: Vector
    p5: Vector
    p6: Vector
    signs: tuple[float, float, float]
    size: float


def parallel_geometry(screws: Screws) -> ParallelGeometry | None:
    """Return the geometry of an arm of six revolute joints with axes 2, 3, 4 parallel; None of any other.

    None too where axis 1 or 5 is parallel to these, or two of them are one line: such an arm has a joint too
    many in the plane and one too few out of it. None where axes 5 and 6 all but meet (`PASSING`).
    """
    if len(screws.direction) != 6 or not screws.revolute.all():
        return None
    k, p, size = screws.direction, screws.point, screws.size
    z = k[1]
    if max(_sine(z, k[2]), _sine(z, k[3])) > PARALLEL or min(_sine(z, k[0]), _sine(z, k[4])) < TILT:
        return None
    if min(_distance(z, p[2] - p[1]), _distance(z, p[3] - p[2])) < MEETING * size:
        return None
    across = k[0] - z * (z @ k[0])
    x = across / np.linalg.norm(across)
    axes = np.array((x, np.cross(z, x), z))
    feet = _common_normal(k[4], p[4], k[5], p[5], MEETING * size)
    if not _is_wrist(z, k[4], k[5], float(np.linalg.norm(feet[1] - feet[0])) / size):
        return None
    to_frame = Transform(_rows(axes, ROUNDING), _vector(-axes @ p[1], ROUNDING * size))
    tip = Transform(_rows(screws.rotation), _vector(screws.position))
    k1, k5, k6 = _rows(k[[0, 4, 5]] @ axes.T, ROUNDING)
    places = np.array((p[0], p[2], p[3], *feet)) - p[1]
    p1, p3, p4, p5, p6 = (_vector(axes @ place, ROUNDING * size) for place in places)
    signs = (1.0, float(np.sign(z @ k[2])), float(np.sign(z @ k[3])))
    from_tip = (to_frame @ tip).inverse()
    return ParallelGeometry(to_frame, from_tip, k1, k5, k6, p1, p3, p4, p5, p6, signs, size)


def _is_wrist(z: FloatArray, k5: FloatArray, k6: FloatArray, passing: float) -> bool:
    """Return whether joints 5 and 6 turn axis 6 enough, whose distance is `passing` of the arm's size."""
    t56 = _sine(k5, k6)
    if passing == 0.0:
        return t56 >= TILT
    if t56 < PARALLEL:
        return passing > MEETING
    return passing * t56 * _sine(z, k5) ** 2 >= PASSING


def _sine(one: FloatArray, other: FloatArray) -> float:
    """Return the sine of the angle between two unit vectors."""
    return float(np.linalg.norm(np.cross(one, other)))


def _distance(direction: FloatArray, between: FloatArray) -> float:
    """Return the distance in [m] of two parallel lines from a vector between them."""
    return float(np.linalg.norm(np.cross(direction, between)))


def _common_normal(
    k5: FloatArray, p5: FloatArray, k6: FloatArray, p6: FloatArray, meeting: float
) -> tuple[FloatArray, FloatArray]:
    """Return the feet of the common normal of two lines, the point between them twice where they meet."""
    normal = np.cross(k5, k6)
    square = float(normal @ normal)
    if square < PARALLEL**2:
        return p5, p6 - k6 * (k6 @ (p6 - p5))
    between = p6 - p5
    foot5 = p5 + k5 * (np.cross(between, k6) @ normal / square)
    foot6 = p6 + k6 * (np.cross(between, k5) @ normal / square)
    if np.linalg.norm(foot6 - foot5) > meeting:
        return foot5, foot6
    middle = 0.5 * (foot5 + foot6)
    return middle, middle


def _rows(matrix: FloatArray, rounding: float = 0.0) -> tuple[Vector, Vector, Vector]:
    """Return the rows of a 3 x 3 matrix."""
    x, y, z = (_vector(row, rounding) for row in matrix)
    return x, y, z


def _vector(values: FloatArray, rounding: float = 0.0) -> Vector:
    """Return three floats, those that differ by rounding from 0, 1 and -1 as these: they fold away."""
    x, y, z = (
        float(round(one)) if abs(one - round(one)) < rounding and abs(one) < 2.0 else float(one)
        for one in values
    )
    return x, y, z
