"""Motion of joints and measures of constraint elements, elementwise.

1. `exp3`, `left_jacobian`, `left_jacobian_inverse`, `wrap_rotation_vector`: the rotation of a rotation vector
   q, its derivatives by q, and back.
2. `joint_frame`: T(q) of each kind of joint; `joint_twists`: the twists of its variables;
   `constraint_twists`: those that it prevents.
3. `measure_element`: the distance that an element holds, and the wrench along it, whose product with a twist
   is the rate of the distance.
4. `transmission`: the function of a higher pair. With the angle q_1 of its first joint, the variable q_2 of
   its second joint, and an offset,

    q_2 = offset + f(q_1)

    gear    f = -(z_1 / z_2) q_1            z: teeth, negative of an internal wheel
    rack    f = r q_1                       r: radius of the pinion, with a sign
    cam     f = S(q_1)                      S: periodic cubic spline through the points of the profile

   The variables are not reduced by full turns: a gear keeps the count of its turns.

A twist is a pair of vectors in the ground: the angular velocity, and the velocity of the point at its origin.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.elementwise import ZERO, Element, FloatArray, Vector, add, cross, dot, scale, subtract
from urmpipe_models.math3d import Transform, rotation_y, translation
from urmpipe_models.networks.parts import ConstraintElement, Joint, Profile, frame_from_axes

AXES: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
SMALL_ANGLE_SQUARED = 1e-8  # [rad^2]; below, series replace quotients whose both parts vanish
MIN_SINE = 1e-12  # of the angle of two lines; below, they have no common normal and their distance is 0
TURN = 2.0 * np.pi

MEASURED_QUANTITIES = {
    "gg": "length",
    "eg": "height",
    "crc": "distance",
    "gc": "radius",
    "gear": "mesh",
    "rack": "mesh",
    "cam": "contact",
}  # what an element of a kind constrains

Twists: TypeAlias = list[tuple[Vector, Vector]]  # per unit of each value: [rad] and [m]


# --- rotation vectors


def exp3(q: Vector) -> Transform:
    """Return exp([q]x) = cos(a) I + (sin(a) / a) [q]x + ((1 - cos(a)) / a^2) q q^T, a = |q|.

    Args:
        q: Rotation vector in [rad], any elements; at 0 the series are used.

    Source: [KinematicSystems]_ section 3.2.2, the global joint, with u1 u1 in T(1,1) (errata).
    """
    x, y, z = q
    cosine, sinc, versed = _quotients(dot(q, q))[:3]
    return Transform(
        (
            (cosine + versed * x * x, versed * x * y - sinc * z, versed * x * z + sinc * y),
            (versed * x * y + sinc * z, cosine + versed * y * y, versed * y * z - sinc * x),
            (versed * x * z - sinc * y, versed * y * z + sinc * x, cosine + versed * z * z),
        )
    )


def left_jacobian(q: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the angular velocities of exp([q]x) in the outer frame by q_1, q_2 and q_3.

    The columns of I + ((1 - cos(a)) / a^2) [q]x + ((a - sin(a)) / a^3) [q]x^2, a = |q|.

    Args:
        q: Rotation vector in [rad], any elements.

    Source: the left Jacobian of SO(3), e.g. Barfoot 2017, State Estimation for Robotics, eq. 7.77.
    """
    x, y, z = q
    square = dot(q, q)
    _, _, v, w = _quotients(square)
    d = 1.0 - w * square
    return (
        (d + w * x * x, v * z + w * x * y, w * x * z - v * y),
        (w * x * y - v * z, d + w * y * y, v * x + w * y * z),
        (v * y + w * x * z, w * y * z - v * x, d + w * z * z),
    )


def _quotients(square: Element) -> tuple[Element, Element, Element, Element]:
    """Return cos(a), sin(a) / a, (1 - cos(a)) / a^2 and (a - sin(a)) / a^3 of a^2 in [rad^2]."""
    small = square < SMALL_ANGLE_SQUARED
    safe = np.where(small, 1.0, square)
    a = np.sqrt(safe)
    c, s = np.cos(a), np.sin(a)
    half = np.sin(0.5 * a)
    return (
        np.where(small, 1.0 - square / 2.0, c),
        np.where(small, 1.0 - square / 6.0, s / a),
        np.where(small, 0.5 - square / 24.0, 2.0 * half * half / safe),
        np.where(small, 1.0 / 6.0 - square / 120.0, (1.0 - s / a) / safe),
    )


def left_jacobian_inverse(vector: FloatArray) -> FloatArray:
    """Return the matrix from an angular velocity in the outer frame to the rate of a rotation vector.

    I - [v]x / 2 + ((1 - (a / 2) cot(a / 2)) / a^2) [v]x^2, a = |v|: the inverse of `left_jacobian`.

    Args:
        vector: v in [rad], shape (3, n).

    Returns:
        [-], shape (3, 3, n).
    """
    square = np.einsum("kn,kn->n", vector, vector)
    small = square < SMALL_ANGLE_SQUARED
    a = np.sqrt(np.where(small, 1.0, square))
    factor = np.where(small, 1.0 / 12.0 + square / 720.0, (1.0 - 0.5 * a / np.tan(0.5 * a)) / (a * a))
    x, y, z = vector
    zero = np.zeros_like(x)
    skew = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])
    twice = np.einsum("ijn,jkn->ikn", skew, skew)
    return np.asarray(np.eye(3)[:, :, np.newaxis] - 0.5 * skew + factor * twice)


def wrap_rotation_vector(vector: Vector) -> Vector:
    """Return the rotation vector of the same rotation whose angle is pi at most, elementwise.

    Args:
        vector: In [rad], any elements.
    """
    angle = np.sqrt(dot(vector, vector))
    turns = np.round(angle / TURN)
    return scale(np.where(turns > 0.0, 1.0 - TURN * turns / np.maximum(angle, 1.0), 1.0), vector)


# --- joints


def joint_frame(joint: Joint, values: Sequence[Element]) -> Transform:
    """Return T, the frame a of the second body in that of the first.

    Args:
        joint: The joint.
        values: Its variables in [rad] and [m]; of a user joint the nine entries of m, n [-] and a in [m].

    Source: [KinematicSystems]_ section 3.2.2, with its errata.
    """
    if joint.kind == "user":
        return frame_from_axes(_vector(values, 0), _vector(values, 3), _vector(values, 6))
    if joint.kind == "global":
        return exp3(_vector(values, 0))
    if joint.kind == "prismatic":
        return translation(0.0, values[0], 0.0)
    rotation = rotation_y(values[0]).rotation
    shift = {"revolute": 0.0, "helical": joint.pitch * values[0]}.get(joint.kind, values[-1])
    return Transform(rotation, (0.0, shift, 0.0))


def joint_twists(joint: Joint, values: Sequence[Element], at: Transform) -> Twists:
    """Return the twists of the second body relative to the first in the ground, one per value.

    Of theta: (n, p x n); of s: (0, n); of a helical joint: (n, p x n + pitch n); of the rotation vector:
    the rotation as each entry changes. Of a user joint: the rotation and translation as each entry of m, n
    and a changes; their sum over all entries is T' T^-1.

    Args:
        joint: The joint.
        values: As in `joint_frame`.
        at: The frame a of the first body in the ground.
    """
    n, p = at.columns[1], at.translation
    rotation, sliding = (n, cross(p, n)), (ZERO, n)
    if joint.kind == "revolute":
        return [rotation]
    if joint.kind == "prismatic":
        return [sliding]
    if joint.kind == "cylindrical":
        return [rotation, sliding]
    if joint.kind == "helical":
        return [(n, add(rotation[1], scale(joint.pitch, n)))]
    if joint.kind == "global":
        axes = [at.rotate(axis) for axis in left_jacobian(_vector(values, 0))]
        return [(axis, cross(p, axis)) for axis in axes]
    return _user_twists(values, at)


def _user_twists(values: Sequence[Element], at: Transform) -> Twists:
    """Return w = (m x m' + n x n' + k x k') / 2 about a; k = m x n has the rate m' x n + m x n'."""
    m, n, a = (_vector(values, 3 * i) for i in range(3))
    k = cross(m, n)
    doubled = [add(cross(m, axis), cross(k, cross(axis, n))) for axis in AXES]
    doubled += [add(cross(n, axis), cross(k, cross(m, axis))) for axis in AXES]
    twists: Twists = []
    for vector in doubled:
        w = at.rotate(scale(0.5, vector))
        twists.append((w, cross(at.point(a), w)))
    return [*twists, *((ZERO, at.rotate(axis)) for axis in AXES)]


def constraint_twists(
    joint: Joint, values: Sequence[Element], at: Transform
) -> Iterator[tuple[str, str, tuple[Vector, Vector]]]:
    """Yield the motions that a joint prevents: a description, the unit, and the twist in the ground.

    Rotations about and translations along the axes m, n and m x n of its frame that none of its variables
    makes, and those of its driven variables.

    Args:
        joint: The joint.
        values: As in `joint_frame`.
        at: The frame a of the first body in the ground.
    """
    origin = (at @ joint_frame(joint, values)).translation
    for k, name in enumerate(("m", "n", "m x n")):
        axis = at.columns[k]
        if not (joint.kind == "global" or (k == 1 and joint.kind in ("revolute", "cylindrical", "helical"))):
            yield f"rotation about {name}", "rad", (axis, cross(origin, axis))
        if not (k == 1 and joint.kind in ("prismatic", "cylindrical")):
            yield f"translation along {name}", "m", (ZERO, axis)
    twists = joint_twists(joint, values, at)
    for drive, unit, twist in zip(joint.drives, joint.units, twists, strict=False):
        if drive is not None:
            yield "drive", unit, twist


def _vector(values: Sequence[Element], first: int) -> Vector:
    return values[first], values[first + 1], values[first + 2]


# --- elements


class ElementMeasurement(NamedTuple):
    """The distance that an element measures between its bodies, and the wrench along it.

    Attributes:
        distance: In [m].
        moment: Moment about the ground's origin in [m] of the unit force along the element. The product of
            this wrench and the twist of the second body relative to the first is the distance's rate.
        force: The unit force [-].
    """

    distance: Element
    moment: Vector
    force: Vector


def measure_element(element: ConstraintElement, first: Transform, second: Transform) -> ElementMeasurement:
    """Return the distance of an element: of two points, of a point from a plane or a line, or of two lines.

    gg: |p_2 - p_1|. eg: n . (p_2 - g_1). crc: |(p_2 - p_1) . u|, u the unit vector of n_1 x n_2; with its
    sign if the element's length is the constant 0. gc: the length of p_2 - p_1 perpendicular to n_1.

    Args:
        element: The element, no pair.
        first: Its first body in the ground.
        second: Its second.

    Source: [KinematicSystems]_ section 3.2.3, with its errata.
    """
    p, q = first.point(element.points[0]), second.point(element.points[1])
    offset = subtract(q, p)
    n = first.rotate(element.normals[0])
    if element.kind == "eg":
        return ElementMeasurement(dot(n, subtract(q, first.translation)), cross(q, n), n)
    if element.kind == "gg":
        distance, u = _length_and_unit(offset)
        return ElementMeasurement(distance, cross(p, u), u)
    if element.kind == "gc":
        distance, u = _length_and_unit(subtract(offset, scale(dot(offset, n), n)))
        return ElementMeasurement(distance, cross(q, u), u)
    other = second.rotate(element.normals[1])
    sine, u = _length_and_unit(cross(n, other))
    distance = dot(offset, u)
    # the point of the first line that is closest to the second; its start if they are parallel
    along = np.where(sine > MIN_SINE, dot(cross(offset, other), u) / np.maximum(sine, MIN_SINE), 0.0)
    if not element.has_zero_length:
        sign = np.where(distance < 0.0, -1.0, 1.0)
        distance, u = sign * distance, scale(sign, u)
    return ElementMeasurement(distance, cross(add(p, scale(along, n)), u), u)


def _length_and_unit(vector: Vector) -> tuple[Element, Vector]:
    """Return the length of a vector and its unit vector; of a vector of length 0 the vector 0."""
    length = np.sqrt(dot(vector, vector))
    return length, scale(1.0 / np.maximum(length, 1e-300), vector)


# --- pairs


def transmission(element: ConstraintElement, angle: Element) -> tuple[Element, Element]:
    """Return f of the angle of the first joint, and its derivative.

    Args:
        element: A gear, a rack or a cam.
        angle: In [rad], any element.

    Returns:
        In [rad] or [m], and in that unit per [rad].
    """
    if element.kind == "cam":
        return _periodic_spline(element.profile, angle)
    slope = element.radius if element.kind == "rack" else -element.teeth[0] / element.teeth[1]
    return slope * angle, slope


def _periodic_spline(profile: Profile, angle: Element) -> tuple[Element, Element]:
    """Return the periodic cubic spline through the points of a profile, and its derivative.

    Every segment is evaluated, then the right value selected, so that symbols pass, too.
    """
    segments, first = _spline_segments(profile), profile[0][0]
    phase = angle - first
    phase = phase - TURN * np.floor(phase / TURN)
    value: Element = 0.0
    slope: Element = 0.0
    for k, (start, a, b, c, d) in enumerate(segments.tolist()):
        u = phase - start
        cubic, rate = a + u * (b + u * (c + u * d)), b + u * (2.0 * c + u * (3.0 * d))
        value = np.where(phase >= start, cubic, value) if k else cubic
        slope = np.where(phase >= start, rate, slope) if k else rate
    return value, slope


@lru_cache(maxsize=64)
def _spline_segments(profile: Profile) -> FloatArray:
    """Return where each segment starts after the first point in [rad], and its a, b, c, d, shape (n, 5).

    a + b u + c u^2 + d u^3. The second derivatives M solve
    h_(i-1) M_(i-1) + 2 (h_(i-1) + h_i) M_i + h_i M_(i+1) = 6 (s_i - s_(i-1)), s the slopes of the chords, all
    indices modulo n.

    Source: de Boor 1978, A Practical Guide to Splines, chapter IV, with periodic ends.
    """
    x, y = np.array(profile).T
    h = np.diff(x, append=x[0] + TURN)
    chords = (np.roll(y, -1) - y) / h
    before = np.roll(h, 1)
    eye = np.eye(len(x))
    matrix = 2.0 * np.diag(before + h)
    matrix += before[:, np.newaxis] * np.roll(eye, -1, axis=1) + h[:, np.newaxis] * np.roll(eye, 1, axis=1)
    M = np.linalg.solve(matrix, 6.0 * (chords - np.roll(chords, 1)))
    after = np.roll(M, -1)
    return np.stack(
        (x - x[0], y, chords - h * (2.0 * M + after) / 6.0, 0.5 * M, (after - M) / (6.0 * h)), axis=1
    )
