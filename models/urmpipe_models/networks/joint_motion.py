"""Rotation vectors: the rotation of one, what a change of one turns, and the way back. Elementwise.

What each kind of joint does: its matrix T, and the twists of its variables. Elementwise.

What a constraint element measures between its two bodies, and the wrench along which. Elementwise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.elementwise import ZERO, Element, FloatArray, Vector, add, cross, dot, scale, subtract
from urmpipe_models.math3d import Transform, rotation_y, translation
from urmpipe_models.networks.parts import ConstraintElement, Joint, frame_from_axes

SMALL_ANGLE_SQUARED = 1e-8
"""Below this square of an angle in [rad^2] series stand for quotients of which both parts vanish."""


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
    """Return the angular velocities in the outer frame with which exp([q]x) turns as q_1, q_2, q_3 change.

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
    """Return what makes the rate of a rotation vector of an angular velocity in the outer frame.

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
    skew = _skew(vector)
    twice = np.einsum("ijn,jkn->ikn", skew, skew)
    return np.asarray(np.eye(3)[:, :, np.newaxis] - 0.5 * skew + factor * twice)


def _skew(vector: FloatArray) -> FloatArray:
    """Return [v]x, shape (3, 3, n), of v in any unit, shape (3, n)."""
    x, y, z = vector
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def wrap_rotation_vector(vector: Vector) -> Vector:
    """Return the rotation vector of the same rotation whose angle is pi at most, elementwise.

    Args:
        vector: In [rad], any elements.
    """
    angle = np.sqrt(dot(vector, vector))
    turns = np.round(angle / (2.0 * np.pi))
    return scale(np.where(turns > 0.0, 1.0 - 2.0 * np.pi * turns / np.maximum(angle, 1.0), 1.0), vector)


Twists: TypeAlias = list[tuple[Vector, Vector]]
"""Angular velocity [rad] and velocity [m] of the point at the ground's origin, a unit of each value."""


AXES = ("m", "n", "m x n")
"""What the directions of a joint's frame are called."""

TURNING, SLIDING = ("revolute", "cylindrical", "helical"), ("prismatic", "cylindrical")
"""The kinds that turn about n, and those that slide along it, whatever else they do."""


def joint_frame(joint: Joint, values: Sequence[Element]) -> Transform:
    """Return T, the frame a of the second body seen from that of the first.

    Args:
        joint: The joint.
        values: Its variables in [rad] and [m]; of a user joint the nine entries of m, n [-] and a in [m].

    Source: [KinematicSystems]_ section 3.2.2, with its errata.
    """
    if joint.kind == "user":
        return frame_from_axes(_three(values, 0), _three(values, 3), _three(values, 6))
    if joint.kind == "global":
        return exp3(_three(values, 0))
    if joint.kind == "prismatic":
        return translation(0.0, values[0], 0.0)
    turned = rotation_y(values[0])
    slid = {"revolute": 0.0, "helical": joint.pitch * values[0]}.get(joint.kind, values[-1])
    return Transform(turned.rotation, (0.0, slid, 0.0))


def joint_twists(joint: Joint, values: Sequence[Element], at: Transform) -> Twists:
    """Return the twists of the second body against the first in the ground, one a value.

    Of theta: (n, p x n); of s: (0, n); of a helical joint: (n, p x n + pitch n); of the rotation vector:
    the rotation as each entry changes. Of a user joint: the rotation and shift as each entry of m, n and a
    changes; their sum over all entries is T' T^-1.

    Args:
        joint: The joint.
        values: As in `joint_frame`.
        at: The frame a of the first body in the ground.
    """
    n, p = at.columns[1], at.translation
    turning, sliding = (n, cross(p, n)), (ZERO, n)
    if joint.kind == "revolute":
        return [turning]
    if joint.kind == "prismatic":
        return [sliding]
    if joint.kind == "cylindrical":
        return [turning, sliding]
    if joint.kind == "helical":
        return [(n, add(turning[1], scale(joint.pitch, n)))]
    if joint.kind == "global":
        axes = [at.rotate(axis) for axis in left_jacobian(_three(values, 0))]
        return [(axis, cross(p, axis)) for axis in axes]
    return _user_screws(values, at)


def constraint_twists(
    joint: Joint, values: Sequence[Element], at: Transform
) -> Iterator[tuple[str, str, tuple[Vector, Vector]]]:
    """Yield what a joint does not let its bodies do: in words, in which unit, and as a twist in the ground.

    Turns about and shifts along the axes m, n and m x n of its frame that none of its variables makes, and
    what its driven variables would do.

    Args:
        joint: The joint.
        values: As in `joint_frame`.
        at: The frame a of the first body in the ground.
    """
    origin = (at @ joint_frame(joint, values)).translation
    for k, name in enumerate(AXES):
        axis = at.columns[k]
        if not (joint.kind == "global" or (k == 1 and joint.kind in TURNING)):
            yield f"rotation about {name}", "rad", (axis, cross(origin, axis))
        if not (k == 1 and joint.kind in SLIDING):
            yield f"translation along {name}", "m", (ZERO, axis)
    screws = joint_twists(joint, values, at)
    for drive, unit, screw in zip(joint.drives, joint.units, screws, strict=False):
        if drive is not None:
            yield "drive", unit, screw


def _user_screws(values: Sequence[Element], at: Transform) -> Twists:
    """Return the twists of the nine entries of a user joint.

    w = (m x m' + n x n' + k x k') / 2 with k = m x n, whose rate is m' x n + m x n'.
    """
    m, n, a = (_three(values, 3 * i) for i in range(3))
    k = cross(m, n)
    screws: Twists = []
    for axis in _AXES:
        screws.append(_about(add(cross(m, axis), cross(k, cross(axis, n))), a, at))
    for axis in _AXES:
        screws.append(_about(add(cross(n, axis), cross(k, cross(m, axis))), a, at))
    return [*screws, *((ZERO, at.rotate(axis)) for axis in _AXES)]


def _about(doubled: Vector, a: Vector, at: Transform) -> tuple[Vector, Vector]:
    """Return the twist of a rotation about the point a of a frame: (w, a x w) in the ground."""
    w = at.rotate(scale(0.5, doubled))
    return w, cross(at.point(a), w)


_AXES: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _three(values: Sequence[Element], first: int) -> Vector:
    return values[first], values[first + 1], values[first + 2]


MEASURED_QUANTITIES = {
    "gg": "length",
    "eg": "height",
    "crc": "distance",
    "gc": "radius",
    "gear": "mesh",
    "rack": "mesh",
    "cam": "contact",
}
"""What an element of a kind holds."""


PARALLEL = 1e-12
"""Below this sine of their angle two lines have no common normal: their distance is none then."""


class ElementMeasurement(NamedTuple):
    """What an element measures between its bodies.

    Attributes:
        distance: In [m].
        moment: Moment about the ground's origin in [m] of the unit force along the element. The product of
            this wrench and the twist of the second body against the first is the distance's rate.
        force: The unit force [-].
    """

    distance: Element
    moment: Vector
    force: Vector


def measure_element(element: ConstraintElement, first: Transform, second: Transform) -> ElementMeasurement:
    """Return what an element measures: a distance of points, of a point from a plane or a line, or of lines.

    gg: |p_2 - p_1|. eg: n . (p_2 - g_1). crc: |(p_2 - p_1) . u|, u the unit vector of n_1 x n_2. gc: the
    length of what p_2 - p_1 has across n_1. Of crc whose length is the constant 0 the sign stays.

    Args:
        element: The element, no pair.
        first: Its first body in the ground.
        second: Its second.

    Source: [KinematicSystems]_ section 3.2.3, with its errata.
    """
    p, q = first.point(element.points[0]), second.point(element.points[1])
    apart = subtract(q, p)
    n = first.rotate(element.normals[0])
    if element.kind == "eg":
        return ElementMeasurement(dot(n, subtract(q, first.translation)), cross(q, n), n)
    if element.kind == "gg":
        distance, u = _length_and_unit(apart)
        return ElementMeasurement(distance, cross(p, u), u)
    if element.kind == "gc":
        distance, u = _length_and_unit(subtract(apart, scale(dot(apart, n), n)))
        return ElementMeasurement(distance, cross(q, u), u)
    return _between_lines(element, p, apart, n, second.rotate(element.normals[1]))


def _between_lines(
    element: ConstraintElement, p: Vector, apart: Vector, n: Vector, other: Vector
) -> ElementMeasurement:
    """Return the distance of two lines: p + n a, and the line through p + apart along other."""
    sine, u = _length_and_unit(cross(n, other))
    distance = dot(apart, u)
    # where on the first line the second is nearest: nowhere in particular if they are parallel
    along = np.where(sine > PARALLEL, dot(cross(apart, other), u) / np.maximum(sine, PARALLEL), 0.0)
    if not element.has_zero_length:
        sign = np.where(distance < 0.0, -1.0, 1.0)
        distance, u = sign * distance, scale(sign, u)
    return ElementMeasurement(distance, cross(add(p, scale(along, n)), u), u)


def _length_and_unit(vector: Vector) -> tuple[Element, Vector]:
    """Return the length of a vector and its direction; of a vector of length 0 none in particular."""
    length = np.sqrt(dot(vector, vector))
    return length, scale(1.0 / np.maximum(length, 1e-300), vector)
