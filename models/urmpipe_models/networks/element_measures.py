"""What a constraint element measures between its two bodies, and the wrench along which. Elementwise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import Element, Vector, add, cross, dot, scale, subtract
from urmpipe_models.networks.parts import ConstraintElement
from urmpipe_models.transform import Transform

MEASURES = {
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


class Measured(NamedTuple):
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


def measure(element: ConstraintElement, first: Transform, second: Transform) -> Measured:
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
        return Measured(dot(n, subtract(q, first.translation)), cross(q, n), n)
    if element.kind == "gg":
        distance, u = _length_and_unit(apart)
        return Measured(distance, cross(p, u), u)
    if element.kind == "gc":
        distance, u = _length_and_unit(subtract(apart, scale(dot(apart, n), n)))
        return Measured(distance, cross(q, u), u)
    return _between_lines(element, p, apart, n, second.rotate(element.normals[1]))


def _between_lines(
    element: ConstraintElement, p: Vector, apart: Vector, n: Vector, other: Vector
) -> Measured:
    """Return the distance of two lines: p + n a, and the line through p + apart along other."""
    sine, u = _length_and_unit(cross(n, other))
    distance = dot(apart, u)
    # where on the first line the second is nearest: nowhere in particular if they are parallel
    along = np.where(sine > PARALLEL, dot(cross(apart, other), u) / np.maximum(sine, PARALLEL), 0.0)
    if not element.meeting:
        sign = np.where(distance < 0.0, -1.0, 1.0)
        distance, u = sign * distance, scale(sign, u)
    return Measured(distance, cross(add(p, scale(along, n)), u), u)


def _length_and_unit(vector: Vector) -> tuple[Element, Vector]:
    """Return the length of a vector and its direction; of a vector of length 0 none in particular."""
    length = np.sqrt(dot(vector, vector))
    return length, scale(1.0 / np.maximum(length, 1e-300), vector)
