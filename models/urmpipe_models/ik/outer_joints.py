"""Joints 1 and 5 of an arm whose axes 2, 3 and 4 are parallel: the ones that place axis 6.

1. `parallel_geometry` recognises such an arm by its screws and describes it in a frame on axis 2 whose z axis
   is along axis 2.
2. Joints 2, 3 and 4 move nothing along z and turn nothing out of it. So for the motion G that takes the arm
   from q = 0 to its target, a point p6 of axis 6 and its direction k6

       z . R1^T (G p6 - p1) + p1z = z . R5 (p6 - p5) + p5z        (place)
       z . R1^T R_G k6            = z . R5 k6                     (direction)

   hold, both linear in the cosine and sine of q1 and of q5. `outer_joints` solves them by the position of
   axes 5 and 6: they meet, are parallel, or pass each other.

`parallel_axes` solves joints 2, 3, 4 and 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, Element, FloatArray, TextArray, Vector, cross, dot, subtract
from urmpipe_models.ik.solutions import SingularPoses, format_with_limits
from urmpipe_models.ik.trigonometric import linear_roots, quadric_roots, wrap_angle
from urmpipe_models.kinematics.forward import Screws
from urmpipe_models.math3d import Transform, rotation_about

PARALLEL = 1e-10  # [rad]; axes this near to parallel are; a solution is off by no more
MEETING = 1e-11  # of the arm's size; axes that pass each other by this meet
MIN_TILT_SINE = 1e-3  # between axes 1 and 5 and axes 2 to 4, and between axes 5 and 6 where these meet
# Least distance of axes 5 and 6 where they do not meet, of the arm's size, times sin(t56) sin(t45)^2 of their
# angles to axes 5 and 4. With 1e-5 a solution may miss by 1e-7 m.
MIN_PASSING = 1e-3
ROUNDING = 1e-14  # of 1 or of the arm's size: the rounding of a right angle or of an offset of 0
REACH = 1e-11  # of the arm's size or in [rad]; a target is out of reach by this from rounding of its pose
# Branches nearer than this, of the arm's size or in [rad], to where two of them meet are taken as one.
# Rounding of the pose would separate them by its root, 1e-8, and with them the positions for the other
# joints.
EDGE = 1e-14
NEAR_ROOTS = 1e-6  # [rad]; nearer values of q1 are one; also the longest last step of Newton's rule


@dataclass(frozen=True, slots=True)
class ParallelGeometry:
    """The arm at q = 0 in a frame on axis 2 whose z axis is along axis 2.

    Attributes:
        to_frame: The world in the frame.
        from_tip: The frame in the tip's frame, at q = 0.
        k1: Direction of axis 1 [-].
        k5: Direction of axis 5 [-].
        k6: Direction of axis 6 [-].
        p1: A point of axis 1 in [m].
        p3: A point of axis 3 in [m].
        p4: A point of axis 4 in [m].
        p5: Foot on axis 5 of the common normal of axes 5 and 6 in [m].
        p6: Foot on axis 6 of the same normal in [m]; equal to p5 where both axes meet.
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

    None also where axis 1 or 5 is parallel to these, or two of them are one line: such an arm has a joint too
    many in the plane and one too few out of it. None where axes 5 and 6 almost meet (`MIN_PASSING`).
    """
    if len(screws.direction) != 6 or not screws.revolute.all():
        return None
    k, p, size = screws.direction, screws.point, screws.size
    z = k[1]
    if max(_sine(z, k[2]), _sine(z, k[3])) > PARALLEL or min(_sine(z, k[0]), _sine(z, k[4])) < MIN_TILT_SINE:
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
    """Return whether joints 5 and 6 turn axis 6 enough; `passing` is the distance of both axes."""
    t56 = _sine(k5, k6)
    if passing == 0.0:
        return t56 >= MIN_TILT_SINE
    if t56 < PARALLEL:
        return passing > MEETING
    return passing * t56 * _sine(z, k5) ** 2 >= MIN_PASSING


def _sine(u: FloatArray, v: FloatArray) -> float:
    return float(np.linalg.norm(np.cross(u, v)))


def _distance(direction: FloatArray, between: FloatArray) -> float:
    """Return the distance of two parallel lines from a vector between them."""
    return float(np.linalg.norm(np.cross(direction, between)))


def _common_normal(
    k5: FloatArray, p5: FloatArray, k6: FloatArray, p6: FloatArray, meeting: float
) -> tuple[FloatArray, FloatArray]:
    """Return the feet of the common normal of two lines, its middle twice where they meet."""
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
    x, y, z = (_vector(row, rounding) for row in matrix)
    return x, y, z


def _vector(values: FloatArray, rounding: float = 0.0) -> Vector:
    """Return three floats, rounded to 0, 1 or -1 where they differ by rounding only: these fold away."""
    x, y, z = (
        float(round(value)) if abs(value - round(value)) < rounding and abs(value) < 2.0 else float(value)
        for value in values
    )
    return x, y, z


class OuterJoints(NamedTuple):
    """All pairs of q1 and q5 of n targets: `a` values of q1, with `b` of q5 for each.

    Attributes:
        q1: In [rad], shape (a, 1, n); NaN where there is none.
        q5: In [rad], shape (a, b, n); NaN where there is none.
        side: 1 where the wrist is on the side of axis 1 that k1 x z points to, -1 else [-], shape (a, 1, n).
        flip: False of the first, true of the second wrist, shape (b,).
        reasons: Why there is none, shape (a, b, n).
        free: Where the wrist is on axis 1, which leaves q1 free, shape (n,).
        singular: The other families that pairs lie in, `where` of shape (a, b, n).
    """

    q1: FloatArray
    q5: FloatArray
    side: FloatArray
    flip: BoolArray
    reasons: TextArray
    free: BoolArray
    singular: tuple[SingularPoses, ...]


def outer_joints(arm: ParallelGeometry, motion: Transform, near: FloatArray) -> OuterJoints:
    """Return the pairs of q1 and q5 that place axis 6.

    Where axes 5 and 6 meet, p6 is their meeting point and `place` alone gives q1; where they are parallel,
    `direction` does. The other equation then gives q5. Else q5 is eliminated: a quadric in q1.

    Args:
        arm: The arm.
        motion: G of n targets, in the frame of the arm.
        near: q1 in [rad] where it is free, shape (n,).
    """
    if arm.p5 == arm.p6:
        return _meeting_axes(arm, motion, near)
    return _passing_axes(arm, motion) if _is_passing(arm) else _parallel_axes(arm, motion)


def branch_names(arm: ParallelGeometry) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the values of q1, and of those of q5 for each; "" where there is only one."""
    if _is_passing(arm):
        return tuple(f"shoulder {number}" for number in range(1, 5)), ("",)
    return ("right", "left"), ("not flipped", "flipped")


def _is_passing(arm: ParallelGeometry) -> bool:
    """Return whether axes 5 and 6 neither meet nor are parallel."""
    across = cross(arm.k5, arm.k6)
    return arm.p5 != arm.p6 and bool(dot(across, across) >= PARALLEL**2)


def _meeting_axes(arm: ParallelGeometry, motion: Transform, near: FloatArray) -> OuterJoints:
    """Solve axes 5 and 6 that meet, as those of a UR arm: `place` gives q1, a spherical triangle q5."""
    a, b, c = _shoulder(arm.k1, subtract(motion.point(arm.p6), arm.p1), arm.p5[2] - arm.p1[2])
    r, within = np.hypot(a, b), REACH * arm.size
    free = (r <= within) & (np.abs(c) <= within)
    c, meet = _on_edge(r, c, EDGE * arm.size, within)
    left, right = linear_roots(a, b, c)
    q1 = np.where(free, (near, near + np.pi), (right, left))[:, None]
    axis6 = rotation_about(arm.k1, -q1).rotate(motion.rotate(arm.k6))
    theta = np.arctan2(np.hypot(axis6[0], axis6[1]), axis6[2])
    q5, folded, allowed = _joint5(arm, theta)
    sine = float(np.hypot(arm.k1[0], arm.k1[1]))
    reasons = format_reasons(
        np.broadcast_to(np.isnan(q1), q5.shape),
        "the wrist is {} m from axis 1, allowed: at least {} m",
        r / sine,
        np.abs(c) / sine,
    )
    reasons += format_reasons(
        np.isnan(q5) & ~np.isnan(q1),
        "axis 6 is at {} rad to axis 4, allowed: {} to {} rad",
        theta,
        *allowed,
    )
    singular = (
        SingularPoses("wrist beside axis 1", np.broadcast_to(meet & ~free, q5.shape)),  # plain: ok
        SingularPoses("flips meet", folded & (np.sin(theta) > REACH)),
    )
    side = np.broadcast_to(np.array([1.0, -1.0])[:, None, None], q1.shape)
    return OuterJoints(q1, q5, side, np.array([False, True]), reasons, free, singular)


def _joint5(arm: ParallelGeometry, theta: FloatArray) -> tuple[FloatArray, BoolArray, tuple[float, float]]:
    """Return q5 that puts axis 6 at an angle theta to axis 4, shape (a, 1, n).

    The directions of axes 4, 5, 6 are the corners of a spherical triangle with the sides t45, t56 and theta:
    with delta = |t45 - t56|, sigma = t45 + t56

        tan^2((q5 - q0)/2) = sin((theta + delta)/2) sin((theta - delta)/2)
                             / (sin((sigma + theta)/2) sin((sigma - theta)/2)),

    which keeps the digits of a small angle where cos(q5) does not.

    Returns:
        q5 in [rad], shape (a, 2, n), where both are one, and the least and largest theta in [rad].
    """
    t45, t56 = _angle((0.0, 0.0, 1.0), arm.k5), _angle(arm.k5, arm.k6)
    delta, sigma = abs(t45 - t56), t45 + t56
    top = min(sigma, 2.0 * np.pi - sigma)
    low, high = theta - delta <= EDGE, top - theta <= EDGE
    up = np.where(low, 0.0, np.sin((theta + delta) / 2) * np.sin((theta - delta) / 2))
    down = np.where(high, 0.0, np.sin((sigma + theta) / 2) * np.sin((sigma - theta) / 2))
    half = np.arctan2(np.sqrt(np.maximum(up, 0.0)), np.sqrt(np.maximum(down, 0.0)))
    within = (theta >= delta - REACH) & (theta <= top + REACH)
    away = 2.0 * np.where(within, half, np.nan)
    _, cosine, sine = _rotation_terms(arm.k5, arm.k6)
    q5 = wrap_angle(float(np.arctan2(sine, cosine)) + np.concatenate((away, -away), axis=1))
    return q5, np.broadcast_to((low | high) & within, q5.shape), (delta, top)


def _parallel_axes(arm: ParallelGeometry, motion: Transform) -> OuterJoints:
    """Solve axes 5 and 6 that are parallel: `direction` gives q1, `place` q5."""
    a, b, c = _shoulder(arm.k1, motion.rotate(arm.k6), arm.k6[2])
    r = np.hypot(a, b)
    c, meet = _on_edge(r, c, EDGE, REACH)
    left, right = linear_roots(a, b, c)
    q1 = np.stack((right, left))[:, None]
    there = rotation_about(arm.k1, -q1).rotate(subtract(motion.point(arm.p6), arm.p1))[2] + arm.p1[2]
    const, cosine, sine = _rotation_terms(arm.k5, subtract(arm.p6, arm.p5))
    reach, height = float(np.hypot(cosine, sine)), there - arm.p5[2] - const
    height, fold = _on_edge(np.full_like(height, reach), height, EDGE * arm.size, REACH * arm.size)
    falling, rising = linear_roots(np.full_like(height, cosine), np.full_like(height, sine), height)
    q5 = np.concatenate((rising, falling), axis=1)
    reasons = format_reasons(
        np.broadcast_to(np.isnan(q1), q5.shape),
        "axis 6 cannot be turned into its direction: {} of its unit along axis 2, allowed: up to {}",
        np.abs(c),
        r,
    )
    reasons += format_reasons(
        np.isnan(q5) & ~np.isnan(q1),
        "axis 6 is {} m along axis 2 from where axis 5 holds it, allowed: up to {} m",
        np.abs(height),
        np.full_like(height, reach),
    )
    singular = (
        SingularPoses("postures meet", np.broadcast_to(meet, q5.shape)),
        SingularPoses("flips meet", np.broadcast_to(fold, q5.shape)),
    )
    side = np.broadcast_to(np.array([1.0, -1.0])[:, None, None], q1.shape)
    return OuterJoints(q1, q5, side, np.array([False, True]), reasons, np.zeros(len(r), dtype=bool), singular)


def _passing_axes(arm: ParallelGeometry, motion: Transform) -> OuterJoints:
    """Solve axes 5 and 6 that pass each other: both equations give cos q5 and sin q5, on the unit circle."""
    left = np.array(
        (
            _shoulder(arm.k1, subtract(motion.point(arm.p6), arm.p1), arm.p5[2] - arm.p1[2]),
            _shoulder(arm.k1, motion.rotate(arm.k6), 0.0),
        )
    )
    left[:, 2] *= -1.0
    right: FloatArray = np.array(
        (_rotation_terms(arm.k5, subtract(arm.p6, arm.p5)), _rotation_terms(arm.k5, arm.k6))
    )
    left[:, 2] -= right[:, :1]
    # of cos q5 and of sin q5: the factors of cos q1, sin q1 and 1
    (a, b, c), (d, e, f) = np.einsum("ij,jkn->ikn", np.linalg.inv(right[:, 1:]), left)
    q1 = quadric_roots(
        (
            a * a + d * d,
            2 * (a * b + d * e),
            b * b + e * e,
            2 * (a * c + d * f),
            2 * (b * c + e * f),
            c * c + f * f - 1.0,
        )
    )
    q5 = np.arctan2(d * np.cos(q1) + e * np.sin(q1) + f, a * np.cos(q1) + b * np.sin(q1) + c)
    for _ in range(2):
        q1, q5 = _newton_step(left, right[:, 1:], q1, q5)
    # sorted by the angle about axis 1 from the wrist to axis 2: the same order for any zero of joint 1
    cosine, sine, _ = _shoulder(arm.k1, subtract(motion.point(arm.p6), arm.p1), 0.0)
    order = np.argsort(wrap_angle(q1 - np.arctan2(sine, cosine)), axis=0)  # NaN last
    q1, q5 = (wrap_angle(np.take_along_axis(q, order, axis=0))[:, None] for q in (q1, q5))
    count = np.isfinite(q1).sum(axis=0)
    reasons = format_reasons(
        np.isnan(q1),
        "joints 1 and 5 put axis 6 into its place in {} ways, allowed for this branch: at least {}",
        count,
        np.arange(1.0, 5.0)[:, None, None],
    )
    slope = left[0, 1] * np.cos(q1) - left[0, 0] * np.sin(q1)
    rolled = [np.roll(q1, shift, axis=0) for shift in (1, 2, 3)]
    meet = np.any([np.abs(wrap_angle(q1 - other)) < NEAR_ROOTS for other in rolled], axis=0)
    singular = (SingularPoses("postures meet", meet),)
    return OuterJoints(
        q1,
        q5,
        np.where(slope < 0.0, -1.0, 1.0),
        np.array([False]),
        reasons,
        np.zeros(q1.shape[-1], dtype=bool),
        singular,
    )


def _newton_step(
    left: FloatArray, right: FloatArray, q1: FloatArray, q5: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return q1 and q5, shape (4, n), after a step of Newton's rule; unchanged where it is singular.

    `left`, shape (2, 3, n), has the factors of cos q1, sin q1 and 1 in both equations, `right`, shape (2, 2),
    those of cos q5 and sin q5.
    """
    (c1, s1), (c5, s5) = (np.cos(q1), np.sin(q1)), (np.cos(q5), np.sin(q5))
    f, g = (a[0] * c1 + a[1] * s1 + a[2] - r[0] * c5 - r[1] * s5 for a, r in zip(left, right, strict=True))
    f1, g1 = (a[1] * c1 - a[0] * s1 for a in left)
    f5, g5 = (r[0] * s5 - r[1] * c5 for r in right)
    det = f1 * g5 - f5 * g1
    step1, step5 = (f * g5 - f5 * g) / det, (f1 * g - f * g1) / det
    good = np.abs(step1) + np.abs(step5) < NEAR_ROOTS
    return np.where(good, q1 - step1, q1), np.where(good, q5 - step5, q5)


def _rotation_terms(k: Vector, v: Vector) -> tuple[Element, Element, Element]:
    """Return the parts of z . R(k, q) v: the constant, and the factors of cos q and sin q."""
    constant = k[2] * dot(k, v)
    return constant, v[2] - constant, cross(k, v)[2]


def _shoulder(k1: Vector, v: Vector, value: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a, b, c of z . R1^T v = value as a cos q1 + b sin q1 = c, each of shape (n,)."""
    constant, cosine, sine = _rotation_terms(k1, v)
    a, b, c, _ = np.broadcast_arrays(cosine, -sine, value - constant, v[0])
    return a, b, c


def _on_edge(r: FloatArray, c: FloatArray, inside: float, outside: float) -> tuple[FloatArray, BoolArray]:
    """Return c of a cos x + b sin x = c with |c| = r where it is up to rounding, and where that is."""
    meet = (np.abs(c) >= r - inside) & (np.abs(c) <= r + outside)
    return np.where(meet, np.copysign(r, c), c), meet


def _angle(u: Vector, v: Vector) -> float:
    across = cross(u, v)
    return float(np.arctan2(np.sqrt(dot(across, across)), dot(u, v)))


def format_reasons(where: BoolArray, text: str, value: FloatArray, *allowed: FloatArray | float) -> TextArray:
    """Return a text with a value and its limits where a mask holds, empty elsewhere, shape (..., n).

    Args:
        where: The mask, shape (..., n).
        text: With a place for each number (see `format_with_limits`).
        value: In [m] or [rad], of a shape that broadcasts to (..., n).
        allowed: Its limits, in the same unit and shape.
    """
    texts = np.full(where.shape, "", dtype=np.object_)
    spread = [np.broadcast_to(array, where.shape)[where].tolist() for array in (value, *allowed)]
    texts[where] = [text.format(*format_with_limits(*row)) for row in zip(*spread, strict=True)]
    return texts
