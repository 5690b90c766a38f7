"""Solids that stand for an arm whose description has no shapes: links and joints, from the frames alone.

1. `_links`: the links between moving joints, as straight pieces from axis to axis (`_link_pieces`), the size
   of the arm, and the radius of each link, which decreases from the base to the tip.
2. `_joint_solid`: a cylinder about the axis of a revolute joint (placed by `_housing`), a box for a prismatic
   one. Of several joints about one line at one place one is drawn (`_drawn_joints`).
3. `_bars`, `_rails`, `_ends`: the pieces of the links, the rails of prismatic joints, flange and tool.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import NamedTuple, TypeAlias

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

THICKNESS = 0.045  # radius at the base / size of the arm: near that of a UR5e or a KUKA iiwa
MAX_SLENDERNESS = 0.4  # that radius / mean length of a link: shorter links look like balls
TAPER = 0.45  # decrease of the radius from base to tip, as a fraction of that at the base
HOUSING = 1.3  # radius and half length of a joint's cylinder / radius of the link that begins there
PLATE, NECK, FLANGE, ROD = 1.9, 0.6, 0.85, 0.25  # radius of base plate, last link, flange, tool rod / link's
MIN_LINK = 0.01  # shorter links (fraction of the size) are calibrated offsets, not counted for slenderness
STROKE = 0.25  # weight of the strokes of prismatic joints in the size of an arm, relative to link lengths
MAX_RAIL = 100.0  # length of a rail / length of the arm: limits farther away are not real
NEGLIGIBLE = 1e-9  # a length / the arm's; and the square of the sine between two axes

Z = np.array([0.0, 0.0, 1.0])

Piece: TypeAlias = tuple[FloatArray, FloatArray]  # straight part of a link: start and end in [m], shape (3,)


class _Link(NamedTuple):
    """A link of the arm, in the moving frame of the joint before it.

    Attributes:
        joint: The joint before it; for the first link, the base as a fixed joint.
        following: The joint at its other end; for the last link, the tip as a fixed joint.
        pieces: From one to the other, without those of no length.
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
    and along that to the next joint's frame: one capsule per piece. A revolute joint is a cylinder about its
    axis; a prismatic joint is a box on a rail as long as its limits, which the link before carries. A plate
    is under the base, a flange at the tip, and a thin rod leads to the tool centre point. All sizes are
    fractions of the arm's lengths. Of joints about one line at one place, such as mimics, one is drawn.

    Args:
        chain: The arm; its frames are numbers.
        colours: Colours of joints, by name; links do not have one.

    Returns:
        Shapes on the base and on moving joints, from the base outwards.
    """
    size, links = _links(chain)
    base, tip = links[0], links[-1]
    ending = next((link for link in reversed(links) if link.pieces), tip)
    solids = [base.shape(Cylinder(PLATE * base.radius, base.radius), -base.radius / 2.0 * Z, Z)]
    drawn = _drawn_joints(links)
    for previous, link in zip([None, *links[:-1]], links, strict=True):
        if previous is not None and link.joint.name in drawn:
            solids.append(_joint_solid(previous, link, (colours or {}).get(link.joint.name)))
        solids += _bars(link, at_tip=link is ending)
        solids += _rails(link, size)
    return (*solids, *_ends(tip, chain.tool, size))


def _links(chain: Chain) -> tuple[float, tuple[_Link, ...]]:
    """Return the size of an arm in [m], and its links; frames that are fixed to a link belong to it."""
    joints, origin = [Joint("", "fixed")], Transform()
    for joint in chain.joints:
        origin = origin @ joint.origin
        if joint.kind != "fixed":
            joints.append(replace(joint, origin=origin))
            origin = Transform()
    joints.append(Joint("", "fixed", origin @ chain.tip))
    pieces_of_links = [_link_pieces(joint, following) for joint, following in pairwise(joints)]
    lengths = [sum(map(_length, pieces)) for pieces in pieces_of_links]
    strokes = [joint.upper - joint.lower for joint in joints if joint.kind == "prismatic"]
    max_stroke = MAX_RAIL * sum(lengths) or MAX_COORDINATE
    stroke = STROKE * sum(stroke for stroke in strokes if stroke <= max_stroke)
    size = max(sum(lengths), stroke) or math.hypot(*chain.tool.translation) or 1.0
    counted = sum(length > MIN_LINK * size for length in lengths)
    radius = size * min(THICKNESS, MAX_SLENDERNESS / max(counted, 1))
    links = []
    for (joint, following), pieces, start in zip(
        pairwise(joints), pieces_of_links, accumulate([0.0, *lengths]), strict=False
    ):
        visible = tuple(piece for piece in pieces if _length(piece) > NEGLIGIBLE * size)
        links.append(_Link(joint, following, visible, radius * (1.0 - TAPER * start / size)))
    return size, tuple(links)


def _link_pieces(joint: Joint, following: Joint) -> tuple[Piece, ...]:
    """Return the pieces of the link between two joints, in the frame of the first.

    With the first axis u through 0, the second w through p, and c = u.w, their common normal starts at
    s u, s = (p.u - c p.w) / (1 - c2), and ends at p + (s c - p.w) w. Of axes that are nearly parallel it
    can be far away: three pieces longer than three perpendicular ones to p, sqrt(3) |p|, are not used. Then,
    and between parallel axes, the link goes along u by p.u and straight on to p.
    """
    u, w = np.array(joint.axis), _vector(following.origin.rotate(following.axis))
    p = _vector(following.origin.translation)
    c = float(u @ w)
    corners = [np.zeros(3), (p @ u) * u, p]
    if 1.0 - c * c > NEGLIGIBLE:
        s = float(p @ u - c * (p @ w)) / (1.0 - c * c)
        normal = [np.zeros(3), s * u, p + (s * c - float(p @ w)) * w, p]
        longest = math.sqrt(3.0) * float(np.linalg.norm(p)) * (1.0 + NEGLIGIBLE)
        if sum(map(_length, pairwise(normal))) <= longest:
            corners = normal
    return tuple(pairwise(corners))


def _drawn_joints(links: Sequence[_Link]) -> set[str]:
    """Return the names of the joints to draw: of several about one line at one place, one.

    That is the first with a coordinate, else the last.
    """
    groups: list[list[Joint]] = []
    for previous, link in pairwise(links):
        c = float(np.array(previous.joint.axis) @ _vector(link.joint.origin.rotate(link.joint.axis)))
        revolute = previous.joint.kind == link.joint.kind == "revolute"
        if revolute and not previous.pieces and 1.0 - c * c <= NEGLIGIBLE:
            groups[-1].append(link.joint)
        else:
            groups.append([link.joint])
    return {next((joint for joint in group if joint.mimic is None), group[-1]).name for group in groups}


def _joint_solid(previous: _Link, link: _Link, colour: Colour | None) -> Visual:
    """Return a joint as a solid on the link that it moves."""
    axis, half = np.array(link.joint.axis), HOUSING * link.radius
    if link.joint.kind == "prismatic":
        return link.shape(Box((2.0 * half, 2.0 * half, 2.0 * half)), np.zeros(3), axis, colour)
    shift, half_length = _housing(previous, link, half)
    return link.shape(Cylinder(half, 2.0 * half_length), shift * axis, axis, colour)


def _housing(previous: _Link, link: _Link, half: float) -> tuple[float, float]:
    """Return the shift of a revolute joint along its axis from its frame, and half its length, in [m].

    Perpendicular to the links it is at their corner. If a link leads along the axis the joint goes into that
    link: by half its length if the other link continues straight, and clear of a joint at the same place. It
    does not reach beyond the end of that link.

    Args:
        previous: The link before the joint.
        link: The link that it moves.
        half: Its radius, and half its length if there is room, in [m].
    """
    axis, axis_before = np.array(link.joint.axis), _vector(link.joint.origin.rotate(link.joint.axis))
    leaving = [(float(_direction(piece) @ axis), _length(piece)) for piece in link.pieces[:1]]
    coming = [(float(_direction(piece) @ axis_before), _length(piece)) for piece in previous.pieces[-1:]]
    for pieces, other, neighbour, sign in (
        (leaving, coming, previous.joint, 1.0),
        (coming, leaving, link.following, -1.0),
    ):
        for along, room in pieces:
            if abs(along) >= 1.0 - NEGLIGIBLE and room > half / 2.0:
                clear = half if neighbour.kind == "revolute" else 0.0
                shift = half * max(0.0, along * other[0][0]) if other else half + clear
                shift = min(shift, room / 2.0)
                return sign * math.copysign(shift, along), min(half, room - shift)
    return 0.0, half


def _bars(link: _Link, *, at_tip: bool) -> Iterator[Visual]:
    """Yield the pieces of a link; at the tip thinner and flat, else they would hide the tool centre point."""
    radius = NECK * link.radius if at_tip else link.radius
    for piece in link.pieces:
        shape = Cylinder if at_tip and piece is link.pieces[-1] else Capsule
        yield link.shape(shape(radius, _length(piece)), (piece[0] + piece[1]) / 2.0, _direction(piece))


def _rails(link: _Link, size: float) -> Iterator[Visual]:
    """Yield the rail of a prismatic joint at the end of a link, from its lower to its upper limit."""
    joint = link.following
    if joint.kind != "prismatic":
        return
    longest = MAX_RAIL * size
    low = min(joint.lower, 0.0) if joint.lower >= -longest else -size
    high = max(joint.upper, 0.0) if joint.upper <= longest else size
    axis, origin = _vector(joint.origin.rotate(joint.axis)), _vector(joint.origin.translation)
    if high - low > NEGLIGIBLE * size:
        shape = Box((link.radius, link.radius, high - low))
        yield link.shape(shape, origin + (low + high) / 2.0 * axis, axis)


def _ends(tip: _Link, tool: Transform, size: float) -> Iterator[Visual]:
    """Yield the flange at the end of the last link, and the rod from there to the tool centre point."""
    end = _vector(tip.following.origin.translation)
    z = _direction(tip.pieces[-1]) if tip.pieces else _vector(tip.following.origin.rotate((0.0, 0.0, 1.0)))
    thickness = tip.radius / 3.0
    yield tip.shape(Cylinder(FLANGE * tip.radius, thickness), end - thickness / 2.0 * z, z)
    rod = (end, _vector(tip.following.origin.point(tool.translation)))
    if _length(rod) > NEGLIGIBLE * size:
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
    return float(np.linalg.norm(piece[1] - piece[0]))


def _direction(piece: Piece) -> FloatArray:
    return np.asarray((piece[1] - piece[0]) / _length(piece))


def _vector(elements: Vector) -> FloatArray:
    return np.array([float(element) for element in elements])


def _tuple(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
