"""What an arm looks like whose description shows nothing: links and joints as solids, from its geometry."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import TypeAlias

import numpy as np

from urmpipe_models.arm.chain import (
    MAX_COORDINATE,
    Box,
    Capsule,
    Chain,
    Colour,
    Cylinder,
    Joint,
    Shape,
    Visual,
)
from urmpipe_models.elementwise import FloatArray, Vector
from urmpipe_models.math3d import Transform

THICKNESS = 0.045
"""Radius of an arm at its base as a share of its size: near that of a UR5e or a KUKA iiwa."""

SLENDER = 0.4
"""That radius as a share of the mean length of a link, at most: links that are shorter look like balls."""

TAPER = 0.45
"""Share of its radius that an arm loses from its base to its tip."""

HOUSING = 1.3
"""Radius and half the length of a joint's cylinder in radii of the link that begins there."""

PLATE, NECK, FLANGE, ROD = 1.9, 0.6, 0.85, 0.25
"""Radius of the plate under the base, of the last link, of the flange at its end, and of the rod to the tool
centre point, in radii that a link has there."""

SHORT = 0.01
"""Links below this share of the length of all do not count for `SLENDER`: they are calibrated offsets."""

STROKE = 0.25
"""What a length that a joint slides counts beside the length of links in the size of an arm."""

LONGEST_RAIL = 100.0
"""Length of a rail in lengths of the arm, at most: limits farther away are not real."""

LEAST = 1e-9
"""What counts as nothing: a length as a share of the arm's, and the square of the sine between two axes."""

Z = np.array([0.0, 0.0, 1.0])

Piece: TypeAlias = tuple[FloatArray, FloatArray]
"""A straight part of a link: where it starts and where it ends in [m], shape (3,) each."""


@dataclass(frozen=True, slots=True, eq=False)
class _Link:
    """A link of the arm, in the moving frame of the joint that it hangs on.

    Attributes:
        joint: The joint that it hangs on; of the first link, the base as a fixed one.
        following: The joint at its other end; of the last link, the tip as a fixed one.
        pieces: From one to the other; those without a length are left out.
        radius: In [m].
    """

    joint: Joint
    following: Joint
    pieces: tuple[Piece, ...]
    radius: float

    def shape(self, shape: Shape, middle: FloatArray, z: FloatArray, colour: Colour | None = None) -> Visual:
        """Return a shape on this link, by its middle in [m] and the direction of its z axis."""
        origin = Transform(_rotation_to(z), _tuple(middle))
        return Visual(self.joint.name or None, shape, origin, colour)


def build_placeholder_solids(chain: Chain, colours: Mapping[str, Colour] | None = None) -> tuple[Visual, ...]:
    """Return solids for the links and joints of an arm, however it was described.

    A link goes from its joint's frame along this joint's axis, then along the common normal to the next axis,
    and along that to the next joint's frame: a capsule a piece. A joint that turns is a cylinder about its
    axis; a joint that slides is a box on a rail as long as its limits, which the link before carries. A plate
    stands under the base, a flange at the tip, and a thin rod leads to the tool centre point. All sizes are
    shares of the arm's own lengths. Of joints about one line at one place, such as mimics, one is drawn.

    Args:
        chain: The arm; its frames are numbers.
        colours: Of joints, by name; all else has none.

    Returns:
        Shapes on the base and on moving joints, from the base outwards.
    """
    size, links = _links(chain)
    base, tip = links[0], links[-1]
    ending = next((link for link in reversed(links) if link.pieces), tip)
    found = [base.shape(Cylinder(PLATE * base.radius, base.radius), -base.radius / 2.0 * Z, Z)]
    drawn = _drawn_joints(links)
    for previous, link in zip([None, *links[:-1]], links, strict=True):
        if previous is not None and link.joint.name in drawn:
            found.append(_joint_solid(previous, link, (colours or {}).get(link.joint.name)))
        found += _bars(link, at_tip=link is ending)
        found += _rails(link, size)
    return (*found, *_ends(tip, chain.tool, size))


def _links(chain: Chain) -> tuple[float, tuple[_Link, ...]]:
    """Return the size of an arm in [m], and its links; frames that are fixed to a link belong to it."""
    joints, origin = [Joint("", "fixed")], Transform()
    for joint in chain.joints:
        origin = origin @ joint.origin
        if joint.kind != "fixed":
            joints.append(replace(joint, origin=origin))
            origin = Transform()
    joints.append(Joint("", "fixed", origin @ chain.tip))
    ways = [_way(joint, following) for joint, following in pairwise(joints)]
    lengths = [sum(map(_length, way)) for way in ways]
    strokes = [joint.upper - joint.lower for joint in joints if joint.kind == "prismatic"]
    real = LONGEST_RAIL * sum(lengths) or MAX_COORDINATE
    stroke = STROKE * sum(one for one in strokes if one <= real)
    size = max(sum(lengths), stroke) or math.hypot(*chain.tool.translation) or 1.0
    long = sum(length > SHORT * size for length in lengths)
    thick = size * min(THICKNESS, SLENDER / max(long, 1))
    links = []
    for (joint, following), way, before in zip(
        pairwise(joints), ways, accumulate([0.0, *lengths]), strict=False
    ):
        pieces = tuple(piece for piece in way if _length(piece) > LEAST * size)
        links.append(_Link(joint, following, pieces, thick * (1.0 - TAPER * before / size)))
    return size, tuple(links)


def _way(joint: Joint, following: Joint) -> tuple[Piece, ...]:
    """Return the pieces of the link between two joints, in the frame of the first.

    With the first axis u through 0, the second w through p, and c = u.w, their common normal starts at
    s u, s = (p.u - c p.w) / (1 - c2), and ends at p + (s c - p.w) w. Of axes that are nearly parallel it
    can be far away: a way longer than three perpendicular pieces to p, sqrt(3) |p|, is not taken. Then,
    and between parallel axes, the link goes along u by p.u and straight on to p.
    """
    u, w = np.array(joint.axis), _vector(following.origin.rotate(following.axis))
    p = _vector(following.origin.translation)
    c = float(u @ w)
    corners = [np.zeros(3), (p @ u) * u, p]
    if 1.0 - c * c > LEAST:
        s = float(p @ u - c * (p @ w)) / (1.0 - c * c)
        normal = [np.zeros(3), s * u, p + (s * c - float(p @ w)) * w, p]
        if sum(map(_length, pairwise(normal))) <= math.sqrt(3.0) * float(np.linalg.norm(p)) * (1.0 + LEAST):
            corners = normal
    return tuple(pairwise(corners))


def _drawn_joints(links: Sequence[_Link]) -> set[str]:
    """Return the names of the joints that are drawn: of several about one line at one place, one.

    That is the first that has a coordinate of its own, else the last.
    """
    groups: list[list[Joint]] = []
    for previous, link in pairwise(links):
        c = float(np.array(previous.joint.axis) @ _vector(link.joint.origin.rotate(link.joint.axis)))
        turning = previous.joint.kind == link.joint.kind == "revolute"
        if turning and not previous.pieces and 1.0 - c * c <= LEAST:
            groups[-1].append(link.joint)
        else:
            groups.append([link.joint])
    return {next((one for one in group if one.mimic is None), group[-1]).name for group in groups}


def _joint_solid(previous: _Link, link: _Link, colour: Colour | None) -> Visual:
    """Return a joint as a solid on the link that it moves."""
    axis, half = np.array(link.joint.axis), HOUSING * link.radius
    if link.joint.kind == "prismatic":
        return link.shape(Box((2.0 * half, 2.0 * half, 2.0 * half)), np.zeros(3), axis, colour)
    shift, half_length = _housing(previous, link, half)
    return link.shape(Cylinder(half, 2.0 * half_length), shift * axis, axis, colour)


def _housing(previous: _Link, link: _Link, half: float) -> tuple[float, float]:
    """Return how far along its axis from its frame a turning joint is drawn, and half its length, in [m].

    Across the links it is at their corner. Where a link leads along the axis the joint goes into that link:
    by half its length if the other link goes straight on, and clear of a joint at the same place. It does not
    reach beyond the end of that link.

    Args:
        previous: The link before the joint.
        link: The link that it moves.
        half: Its radius, and half its length where there is room, in [m].
    """
    axis, there = np.array(link.joint.axis), _vector(link.joint.origin.rotate(link.joint.axis))
    leaving = [(float(_direction(piece) @ axis), _length(piece)) for piece in link.pieces[:1]]
    coming = [(float(_direction(piece) @ there), _length(piece)) for piece in previous.pieces[-1:]]
    for own, other, neighbour, way in (
        (leaving, coming, previous.joint, 1.0),
        (coming, leaving, link.following, -1.0),
    ):
        for along, room in own:
            if abs(along) >= 1.0 - LEAST and room > half / 2.0:
                clear = half if neighbour.kind == "revolute" else 0.0
                far = half * max(0.0, along * other[0][0]) if other else half + clear
                far = min(far, room / 2.0)
                return way * math.copysign(far, along), min(half, room - far)
    return 0.0, half


def _bars(link: _Link, *, at_tip: bool) -> Iterator[Visual]:
    """Yield the pieces of a link; at the tip thinner and flat, else they would hide the tool centre point."""
    radius = NECK * link.radius if at_tip else link.radius
    for piece in link.pieces:
        shape = Cylinder if at_tip and piece is link.pieces[-1] else Capsule
        yield link.shape(shape(radius, _length(piece)), (piece[0] + piece[1]) / 2.0, _direction(piece))


def _rails(link: _Link, size: float) -> Iterator[Visual]:
    """Yield the rail of a sliding joint at the end of a link, from its lower to its upper limit."""
    joint = link.following
    if joint.kind != "prismatic":
        return
    known = LONGEST_RAIL * size
    low = min(joint.lower, 0.0) if joint.lower >= -known else -size
    high = max(joint.upper, 0.0) if joint.upper <= known else size
    axis, origin = _vector(joint.origin.rotate(joint.axis)), _vector(joint.origin.translation)
    if high - low > LEAST * size:
        shape = Box((link.radius, link.radius, high - low))
        yield link.shape(shape, origin + (low + high) / 2.0 * axis, axis)


def _ends(tip: _Link, tool: Transform, size: float) -> Iterator[Visual]:
    """Yield the flange at the end of the last link, and the rod from there to the tool centre point."""
    end = _vector(tip.following.origin.translation)
    z = _direction(tip.pieces[-1]) if tip.pieces else _vector(tip.following.origin.rotate((0.0, 0.0, 1.0)))
    thick = tip.radius / 3.0
    yield tip.shape(Cylinder(FLANGE * tip.radius, thick), end - thick / 2.0 * z, z)
    rod = (end, _vector(tip.following.origin.point(tool.translation)))
    if _length(rod) > LEAST * size:
        yield tip.shape(Cylinder(ROD * tip.radius, _length(rod)), (rod[0] + rod[1]) / 2.0, _direction(rod))


def _rotation_to(z: FloatArray) -> tuple[Vector, Vector, Vector]:
    """Return the rows of a rotation that takes the z axis to a unit vector, shape (3,)."""
    least = np.zeros(3)
    least[np.argmin(np.abs(z))] = 1.0
    x = np.cross(least, z)
    x /= np.linalg.norm(x)
    first, second, third = map(_tuple, np.column_stack((x, np.cross(z, x), z)))
    return first, second, third


def _length(piece: Piece) -> float:
    """Return the length of a piece in [m]."""
    return float(np.linalg.norm(piece[1] - piece[0]))


def _direction(piece: Piece) -> FloatArray:
    """Return the unit vector along a piece, shape (3,)."""
    return np.asarray((piece[1] - piece[0]) / _length(piece))


def _vector(elements: Vector) -> FloatArray:
    """Return three numbers as an array, shape (3,)."""
    return np.array([float(element) for element in elements])


def _tuple(vector: FloatArray) -> tuple[float, float, float]:
    """Return an array of shape (3,) as three numbers."""
    x, y, z = vector.tolist()
    return x, y, z
