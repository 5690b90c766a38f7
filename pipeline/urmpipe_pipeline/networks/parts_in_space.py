"""Where the parts of a mechanism are in an assembly, and the shapes they are drawn with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray, Vector
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.assembly import Assembly
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.parts import ConstraintElement, Joint
from urmpipe_pipeline.networks.drives import is_driven
from urmpipe_pipeline.networks.shapes import (
    SIDES,
    ball,
    bar,
    box,
    circle,
    helix,
    hull,
    in_line,
    prism,
    rod,
    sheet,
    square,
)
from urmpipe_pipeline.presentation.palette import (
    DEVIATION_COLOUR,
    JOINT_COLOURS,
    NEUTRAL_COLOUR,
    REFERENCE_COLOUR,
)
from urmpipe_pipeline.presentation.parts import spot_at
from urmpipe_pipeline.presentation.scene import PlaneView

GROUND_COLOUR, CONTROL_COLOUR, JOINT_COLOUR, ELEMENT_COLOUR = (
    REFERENCE_COLOUR,
    "#c25000",
    NEUTRAL_COLOUR,
    "#a2bcbc",
)
"""Of the ground; of what controls drive; of joints and elements that none drives."""

OPEN_COLOUR = DEVIATION_COLOUR
"""Of a joint whose bodies do not meet."""

BODY_COLOURS = tuple(one for one in JOINT_COLOURS if one not in (CONTROL_COLOUR, ELEMENT_COLOUR))
"""One a body; then they start again."""

BAR, JOINT, LONG, SLIM, ROD, DOT = 0.011, 0.019, 0.075, 0.013, 0.006, 0.011
"""Radii of bars, of joints, the length of a joint along its axis, radii of slim joints, of rods and of dots;
all as shares of the mechanism's extent."""

PLANE, LINE, TUBE = 0.3, 0.5, 0.12
"""Width of a plane's piece, lengths of lines and heights of tubes, as shares of the mechanism's extent."""

KNOB = 0.028
"""Radius of a body with all its joints at one point, such as a slider: it shows around their symbols."""

SEEN_THROUGH, GROUND_OPACITY, HULL_OPACITY = 0.22, 0.4, 0.55
"""Opacity of planes and tubes, of the ground where it is no bar, and of bodies that are no plates."""

PARALLEL = 1e-6
"""Axes are parallel if the sine of their angle is less: assemblies close to 1e-9."""

SAME = 1e-9
"""Points of a body nearer than this share of the mechanism's extent are one."""

OPEN = 1e-6
"""A joint whose points are further apart, as a share of the mechanism's extent, has a line between them."""

VERTICAL = 0.9
"""An axis whose z component is larger is vertical: its plane is seen from above."""

PARALLEL = 1e-6  # sine of the angle between the axes of two wheels below which they have pitch circles

Kind: TypeAlias = Literal["body", "joint", "element"]


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A body, a joint or an element in space.

    Attributes:
        name: Its name.
        kind: Which of these.
        colour: As #rrggbb.
        at: Where its name stands in [m], shape (3,).
        pieces: Triangles of convex shapes in [m], shape (n, 3, 3) each.
        lines: In [m], shape (k, 3) each.
        opacity: Of the pieces, 0..1.
    """

    name: str
    kind: Kind
    colour: str
    at: FloatArray
    pieces: tuple[FloatArray, ...]
    lines: tuple[FloatArray, ...] = ()
    opacity: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """An assembly of a network.

    Attributes:
        network: The network.
        poses: Where each body is, as a matrix [-] and [m], shape (4, 4), by its name.
        points: Where joints and elements tie each body, in its own frame in [m], by its name.
        lengths: The length of each element in [m], of a pair its offset in [m] or [rad].
        extent: The diagonal of the box around all points of its bodies in [m].
        sides: Of what is round.
    """

    network: Network
    poses: dict[str, FloatArray]
    points: dict[str, list[Vector]]
    lengths: tuple[float, ...]
    extent: float
    sides: int = SIDES

    def point(self, body: str, point: Vector) -> FloatArray:
        """Return a point of a body in the ground in [m], shape (3,)."""
        pose = self.poses[body]
        return np.asarray(pose[:3, :3] @ np.array(point, np.float64) + pose[:3, 3])

    def direction(self, body: str, vector: Vector) -> FloatArray:
        """Return a direction of a body in the ground [-], shape (3,)."""
        return np.asarray(self.poses[body][:3, :3] @ np.array(vector, np.float64))

    def axes(self, body: str, frame: Transform) -> FloatArray:
        """Return m, n and m x n of a frame of a body in the ground as columns [-], shape (3, 3)."""
        return np.asarray(self.poses[body][:3, :3] @ np.array(frame.rotation, np.float64))


def placed(network: Network, assembly: Assembly, sides: int = SIDES) -> Placed:
    """Return where everything is in an assembly, to be drawn with so many sides of what is round."""
    mechanism = build_mechanism(network)
    x = np.array(
        [
            assembly.values.get(one.owner, ())[one.index : one.index + 1] or (0.0,)
            for one in mechanism.variables
        ]
    ).reshape(-1)
    lengths = np.array([float(one.value) for one in mechanism.lengths(x)])
    return placed_at(network, np.asarray(assembly.poses), lengths, sides)


def placed_at(network: Network, poses: FloatArray, lengths: FloatArray, sides: int = SIDES) -> Placed:
    """Return where everything is.

    Args:
        network: The network.
        poses: Of the bodies in the order of `Network.body_names`, as matrices [-] and [m], shape
            (bodies, 4, 4).
        lengths: Of the elements in [m], shape (elements,).
        sides: Of what is round.
    """
    mechanism, by_name = build_mechanism(network), dict(zip(network.body_names, poses, strict=True))
    known = tuple(lengths.tolist())
    unscaled = Placed(network, by_name, mechanism.points, known, 1.0)
    points = np.concatenate([body_points(unscaled, name) for name in network.body_names])
    extent = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    extent = extent or max((mechanism.length, *map(abs, known)))
    return Placed(network, by_name, mechanism.points, known, extent, sides)


def find_plane(at: Placed) -> PlaneView | None:
    """Return how a planar linkage is seen along the common axis of its revolute joints; None of others.

    All its axes are parallel, what slides does so perpendicular to them, and elements act in the plane.
    x goes to the right and z up where they lie in the plane; in the plane of x and y, y goes up.
    """
    network = at.network
    axes = [at.axes(one.bodies[0], one.frames[0])[:, 1] for one in network.joints if one.kind == "revolute"]
    if not axes or len(build_mechanism(network).graph.roots) > 1:
        return None
    normal = axes[0] * np.sign(axes[0][np.argmax(np.abs(axes[0]))])
    planar = all(_is_planar_joint(at, one, normal) for one in network.joints)
    if not planar or not all(_is_planar_element(at, one, normal) for one in network.elements):
        return None
    normal = normal.round(9) + 0.0  # axes of the ground stay exact, without a negative zero
    normal /= np.linalg.norm(normal)
    vertical = np.eye(3)[1 if abs(normal[2]) > VERTICAL else 2]
    up = vertical - (vertical @ normal) * normal
    up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    right *= np.sign(right[np.argmax(np.abs(right))])
    return PlaneView(spot_at(right + 0.0), spot_at(up))


def _is_planar_joint(at: Placed, joint: Joint, normal: FloatArray) -> bool:
    """Return whether a joint leaves the planes perpendicular to a unit vector in place."""
    n = at.axes(joint.bodies[0], joint.frames[0])[:, 1]
    if joint.kind == "revolute":
        return bool(np.linalg.norm(np.cross(n, normal)) < PARALLEL)
    if joint.kind == "prismatic":
        return bool(abs(n @ normal) < PARALLEL)
    return joint.kind == "user" and not any(
        part.names for part in joint.motion
    )  # two bodies that are fixed to each other


def _is_planar_element(at: Placed, element: ConstraintElement, normal: FloatArray) -> bool:
    """Return whether an element acts in planes perpendicular to a unit vector; pairs act as their joints."""
    if element.is_pair:
        return True
    p, q = (at.point(body, point) for body, point in zip(element.bodies, element.points, strict=True))
    n = at.direction(element.bodies[0], element.normals[0])
    match element.kind:
        case "gg":
            return bool(abs((q - p) @ normal) < PARALLEL * at.extent)
        case "eg":
            return bool(abs(n @ normal) < PARALLEL)
        case "gc":
            return bool(np.linalg.norm(np.cross(n, normal)) < PARALLEL)
    return False


def body_points(at: Placed, body: str) -> FloatArray:
    """Return the points at which joints and elements hold a body in [m], shape (n, 3), all different."""
    points = [at.point(body, point) for point in at.points[body]]
    found = np.array(points).reshape(-1, 3)
    different = _different(found, SAME * at.extent)
    if len(different) == 1:  # a body that ends there reaches to its own origin
        different = _different(np.vstack((different, at.poses[body][:3, 3])), SAME * at.extent)
    return different


def _different(points: FloatArray, near: float) -> FloatArray:
    """Return points in [m], shape (n, 3), without those near to one before."""
    kept = [
        k for k in range(len(points)) if not (np.linalg.norm(points[:k] - points[k], axis=1) <= near).any()
    ]
    return np.asarray(points[kept])


def parts(at: Placed) -> tuple[Part, ...]:
    """Return the bodies, the elements and the joints of an assembly, in this order."""
    network = at.network
    return (
        *(_body(at, name) for name in network.body_names),
        *(_element(at, one, length) for one, length in zip(network.elements, at.lengths, strict=True)),
        *(_joint(at, one) for one in network.joints),
    )


def body_colour(network: Network, name: str) -> str:
    """Return the colour of a body as #rrggbb: grey of the ground."""
    number = network.body_names.index(name)
    return BODY_COLOURS[(number - 1) % len(BODY_COLOURS)] if number else GROUND_COLOUR


def _body(at: Placed, name: str) -> Part:
    """Return a body: a bar through points on a line, a plate or a hull between others, a ball at one."""
    points, colour, e = body_points(at, name), body_colour(at.network, name), at.extent
    ground = name == at.network.ground
    opacity = GROUND_OPACITY if ground else 1.0
    if not len(points):
        here = at.poses[name][:3, 3]
        return Part(name, "body", colour, here, (ball(here, DOT * e, at.sides),))
    middle = points.mean(axis=0)
    if len(points) == 1:
        return Part(name, "body", colour, middle, (ball(middle, KNOB * e, at.sides),))
    if in_line(points):
        along = (points - middle) @ (points[np.argmax(np.linalg.norm(points - middle, axis=1))] - middle)
        start, end = points[np.argmin(along)], points[np.argmax(along)]
        return Part(name, "body", colour, 0.5 * (start + end), (bar(start, end, BAR * e, at.sides),))
    triangles, edges = hull(points, 1.2 * BAR * e)
    solid = len(edges) == len(np.unique(edges.reshape(-1, 3), axis=0))  # a plate: as many edges as corners
    return Part(
        name,
        "body",
        colour,
        middle,
        (triangles,),
        tuple(edges),
        opacity if solid else min(opacity, HULL_OPACITY),
    )


def _joint(at: Placed, joint: Joint) -> Part:
    """Return a joint: what its kind is drawn as, about its axis; one that slides where its second body is."""
    e = at.extent
    first, second = (
        at.point(name, frame.translation) for name, frame in zip(joint.bodies, joint.frames, strict=True)
    )
    axes = at.axes(joint.bodies[0], joint.frames[0])
    n, colour = axes[:, 1], CONTROL_COLOUR if is_driven(joint) else JOINT_COLOUR
    turned = axes[:, [2, 0, 1]]  # boxes are long along n
    r, length = JOINT * e, LONG * e
    apart = (np.array([first, second]),) if np.linalg.norm(second - first) > OPEN * e else ()
    rails: tuple[FloatArray, ...] = ()
    match joint.kind:
        case "revolute":
            here, pieces = first, (rod(first, n, r, length, at.sides),)
        case "prismatic":
            here, pieces = second, (box(second, turned, (1.8 * r, 1.8 * r, 1.3 * length)),)
            rails = (_rail(first, second, n, length),)
        case "cylindrical":
            here, pieces = second, (rod(second, n, SLIM * e, 1.8 * length, at.sides),)
            rails = (_rail(first, second, n, 1.4 * length),)
        case "helical":
            here, pieces = second, (rod(second, n, SLIM * e, 1.6 * length, at.sides),)
            rails = (_rail(first, second, n, length), helix(second, n, 1.3 * SLIM * e, 1.6 * length, 5))
        case "global":
            here, pieces = first, (ball(first, 1.25 * r, at.sides),)
        case _:
            here, pieces = second, (box(second, turned, (2.0 * r, 2.0 * r, 2.0 * r)),)
            rails = apart
    if apart and joint.kind in ("revolute", "global"):
        colour, rails = OPEN_COLOUR, apart
    return Part(joint.name, "joint", colour, here, pieces, rails)


def _rail(first: FloatArray, second: FloatArray, n: FloatArray, beyond: float) -> FloatArray:
    """Return a line along a unit vector through two points in [m], longer at each end, shape (2, 3)."""
    to = np.sort([0.0, float((second - first) @ n)])
    return first + np.outer(to + np.array([-beyond, beyond]), n)


def _element(at: Placed, element: ConstraintElement, length: float) -> Part:
    """Return an element: a rod, a plane, two lines, a tube about a line, or a pair."""
    colour, e = CONTROL_COLOUR if is_driven(element) else ELEMENT_COLOUR, at.extent
    lines = element_lines(at, element, length)
    if element.is_pair:
        dots = tuple(ball(point, DOT * e, at.sides) for point in lines[0])
        return Part(element.name, "element", colour, lines[0].mean(axis=0), dots, lines)
    foot, q = lines[-1]
    n = at.direction(element.bodies[0], element.normals[0])
    dots = (ball(foot, DOT * e, at.sides), ball(q, DOT * e, at.sides))
    where, opacity = foot, SEEN_THROUGH
    pieces: tuple[FloatArray, ...]
    match element.kind:
        case "gg":
            where, pieces, opacity = 0.5 * (foot + q), (bar(foot, q, ROD * e, at.sides), *dots), 1.0
        case "eg":
            pieces = (sheet(foot, n, PLANE * e), dots[1])
        case "gc":
            radius, height = max(abs(length), ROD * e), TUBE * e * n
            tube = prism(circle(foot - 0.5 * height, n, radius, at.sides), height)
            pieces = (tube[2 * (at.sides - 2) :], dots[1])  # one sees into it
        case _:
            where, pieces, opacity = 0.5 * (foot + q), (bar(foot, q, ROD * e, at.sides),), 1.0
    return Part(element.name, "element", colour, where, pieces, lines, opacity)


def element_lines(at: Placed, element: ConstraintElement, length: float) -> tuple[FloatArray, ...]:
    """Return the lines of an element of a length in [m], shape (k, 3) each; the last is what it measures.

    That is from point to point, from the foot in the plane or on the line to the point, or from line to
    line. Of a pair the first is from joint to joint.
    """
    if element.is_pair:
        return _pair_lines(at, element)
    p, q = (at.point(body, point) for body, point in zip(element.bodies, element.points, strict=True))
    n, e = at.direction(element.bodies[0], element.normals[0]), at.extent
    match element.kind:
        case "gg":
            return (np.array([p, q]),)
        case "eg":
            origin = at.poses[element.bodies[0]][:3, 3]
            foot = q - (float(n @ (q - origin)) - length) * n
            return (square(foot, n, PLANE * e)[[0, 1, 2, 3, 0]], np.array([foot, q]))
        case "gc":
            nearest = p + float(n @ (q - p)) * n
            return (_around(p, nearest, n, e), np.array([nearest, q]))
    other = at.direction(element.bodies[1], element.normals[1])
    feet = _nearest(p, n, q, other)
    return (_around(p, feet[0], n, e), _around(q, feet[1], other, e), feet)


def _pair_lines(at: Placed, pair: ConstraintElement) -> tuple[FloatArray, ...]:
    """Return the line between the joints of a pair, and the pitch circles of a gear or a pinion."""
    first, second = (joint for joint, _ in at.network.pair_variables(pair))
    p, q = at.point(first.bodies[0], first.frames[0].translation), _joint(at, second).at
    axes = [at.axes(joint.bodies[0], joint.frames[0])[:, 1] for joint in (first, second)]
    lines = [np.array([p, q])]
    if pair.kind == "rack":
        lines.append(_ring(p, axes[0], abs(pair.radius), at.sides))
    elif pair.kind == "gear" and float(np.linalg.norm(np.cross(axes[0], axes[1]))) < PARALLEL:
        across = q - p - float((q - p) @ axes[0]) * axes[0]
        module = float(np.linalg.norm(across)) / (abs(sum(pair.teeth)) or 1.0)
        for centre, teeth in ((p, pair.teeth[0]), (p + across, pair.teeth[1])):
            lines.append(_ring(centre, axes[0], module * abs(teeth), at.sides))
    return tuple(lines)


def _ring(centre: FloatArray, n: FloatArray, radius: float, sides: int) -> FloatArray:
    """Return a closed circle in [m] about a centre across a unit vector, shape (k, 3)."""
    corners = circle(centre, n, radius, 2 * sides)
    return np.vstack((corners, corners[:1]))


def _nearest(p: FloatArray, n: FloatArray, q: FloatArray, other: FloatArray) -> FloatArray:
    """Return where two lines through points in [m] along unit vectors are nearest, shape (2, 3)."""
    cosine = float(n @ other)
    if 1.0 - cosine * cosine < 1e-12:  # they are parallel
        return np.array([p + float(n @ (q - p)) * n, q])
    along, back = np.linalg.solve([[1.0, -cosine], [cosine, -1.0]], [n @ (q - p), other @ (q - p)])
    return np.array([p + along * n, q + back * other])


def _around(p: FloatArray, foot: FloatArray, n: FloatArray, extent: float) -> FloatArray:
    """Return the piece of a line along a unit vector about two of its points in [m], shape (2, 3)."""
    to = np.sort([0.0, float((foot - p) @ n)])
    beyond = max(0.1 * extent, 0.5 * (LINE * extent - float(to[1] - to[0])))
    return np.asarray(p + np.outer(to + np.array([-beyond, beyond]), n))
