"""Planned paths: rows, arcs between lines, orientations, paths of lines and arcs, and the contours of a cube.

1. `PathRows`: points, radii and orientations that a path is planned from ([Iso9283]_ section 2).
2. `Arc`: an arc between two lines, from its corner (`arc_at_corner`) or from its first point (`arc_from`).
3. `OrientationPath`: the tool rotates about a fixed axis at a constant rate d theta / ds from row to row.
4. `LineArcPath`: position, tangent and curvature by arc length s; on an arc p + r (sin(w / r) t +
   (1 - cos(w / r)) n) after a distance w (eq. 1-4). `from_rows` builds it.
5. `cube_rows`: test contours of ISO 9283, sections of a cube as rows (eq. 5).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from urmpipe_models.elementwise import FloatArray, IndexArray, IntArray
from urmpipe_models.errors import Finding, OptionError, format_unknown_name
from urmpipe_models.math3d import conjugate, to_matrices, to_quaternions, to_rotation_vectors
from urmpipe_models.math3d import quaternion_product as product
from urmpipe_models.wraps import unwrap_quaternions

PROPER = 2  # variant of an arc that turns towards the next row; 1 turns away from it by the longer way
VARIANTS = (1, PROPER)

# Rates from row to row that differ by less, as an angle in [rad], may be one rate of rows with six digits:
# each angle is off by up to 5e-6, and a difference of two rotations contains that of the middle row twice.
EVEN_TURN_TOLERANCE = 2e-5
MIN_CORNER_ANGLE = 1e-9  # [rad]; lines with a smaller angle span no plane: coordinates have no more digits

Axis: TypeAlias = tuple[int, int, int]
SegmentKind = Literal["line", "arc"]


@dataclass(frozen=True, slots=True, eq=False, init=False)
class PathRows:
    """The rows that a path is planned from.

    Values that are no array of numbers become a NaN of shape (): `plan` rejects them with all other faults.

    Attributes:
        position: Points in [m], shape (n, 3).
        radius: Of the arc at each point in [m], shape (n,); 0 where the path stops.
        corner: Meaning of a point with a radius: True for the corner that the arc rounds, False for the
            arc's first point, where the line before it touches it (as in the paper).
        variant: Of each arc [-], shape (n,): 2 turns towards the next row, 1 away from it.
        rotation: Orientation of the tool at each row, as matrices [-], shape (n, 3, 3); None if it is free.

    Source: [Iso9283]_ section 2.
    """

    position: FloatArray
    radius: FloatArray
    corner: bool
    variant: IntArray
    rotation: FloatArray | None

    def __init__(
        self,
        position: ArrayLike,
        radius: ArrayLike = 0.0,
        corner: bool = False,
        variant: ArrayLike = PROPER,
        rotation: ArrayLike | None = None,
    ) -> None:
        """Build rows from arrays; a single radius, variant or rotation is that of all rows.

        Args:
            position: In [m], shape (n, 3).
            radius: In [m], shape (n,), or one number for all rows but the first and the last.
            corner: Whether a row with a radius is the corner; else it is the arc's first point.
            variant: 1 or 2 [-], shape (n,), or one number for all rows.
            rotation: Matrices [-], shape (n, 3, 3), or one of shape (3, 3) for all rows; None if free.
        """
        points, radii, variants = _array(position), _array(radius), _array(variant)
        count = len(points) if points.ndim else 0
        if radii.ndim == 0 and not np.isnan(radii):
            radii = np.full(count, radii)
            radii[:1] = radii[-1:] = 0.0
        if variants.ndim == 0 and not np.isnan(variants):
            variants = np.full(count, variants)
        rotations = None if rotation is None else _array(rotation)
        if rotations is not None and rotations.shape == (3, 3):
            rotations = np.tile(rotations, (count, 1, 1))
        is_valid = np.isin(variants, VARIANTS).all()
        object.__setattr__(self, "position", points)
        object.__setattr__(self, "radius", radii)
        object.__setattr__(self, "corner", corner)
        object.__setattr__(self, "variant", variants.astype(np.int64) if is_valid else variants)
        object.__setattr__(self, "rotation", rotations)

    def __len__(self) -> int:
        return len(self.position)


def _array(values: ArrayLike) -> FloatArray:
    """Return values as an array; a NaN of shape () if they are no array of numbers."""
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        return np.array(np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """An arc from a point, along a direction, about a centre.

    Attributes:
        start: Its first point in [m], shape (3,).
        tangent: Unit vector of the motion there [-], shape (3,).
        normal: Unit vector from there to the centre [-], shape (3,).
        radius: In [m].
        angle: Angle at its centre in [rad], 0 to 2 pi.
    """

    start: FloatArray
    tangent: FloatArray
    normal: FloatArray
    radius: float
    angle: float

    @property
    def end(self) -> FloatArray:
        """Its last point in [m], shape (3,)."""
        along, across = math.sin(self.angle), 1.0 - math.cos(self.angle)
        return self.start + self.radius * (along * self.tangent + across * self.normal)

    @property
    def end_tangent(self) -> FloatArray:
        """Unit vector of the motion at its end [-], shape (3,)."""
        return math.cos(self.angle) * self.tangent + math.sin(self.angle) * self.normal

    @property
    def leg(self) -> float:
        """Distance from its first point to the corner of its tangents in [m], r tan(angle / 2).

        Negative where the arc begins after the corner: for an angle of more than pi.
        """
        return self.radius * math.tan(0.5 * self.angle)


def normalise(vector: FloatArray) -> FloatArray:
    """Return the direction of a vector, shape (3,), with length 1 [-]."""
    return vector / np.linalg.norm(vector)


def perpendicular_towards(tangent: FloatArray, onward: FloatArray) -> FloatArray | None:
    """Return the unit vector perpendicular to a direction on the side of another [-], shape (3,).

    Args:
        tangent: Unit vector [-], shape (3,).
        onward: Unit vector [-], shape (3,).

    Returns:
        The unit vector; None if both are parallel.
    """
    across = onward - (onward @ tangent) * tangent
    return None if np.linalg.norm(across) <= MIN_CORNER_ANGLE else normalise(across)


def arc_at_corner(
    corner: FloatArray, tangent: FloatArray, onward: FloatArray, radius: float, variant: int
) -> Arc | None:
    """Return the arc that rounds the corner of two lines; None where they are parallel.

    With the angle d between the lines the proper variant turns by d, and begins r tan(d / 2) before the
    corner; the other one turns by 2 pi - d the other way, and begins at the same distance after it.

    Args:
        corner: In [m], shape (3,).
        tangent: Direction to the corner [-], shape (3,).
        onward: Direction away from it [-], shape (3,).
        radius: In [m].
        variant: 2 to turn towards `onward`, 1 to turn away from it.
    """
    side = perpendicular_towards(tangent, onward)
    if side is None:
        return None
    turn = math.atan2(float(onward @ side), float(onward @ tangent))
    angle, normal = (turn, side) if variant == PROPER else (2.0 * math.pi - turn, -side)
    return Arc(corner - radius * math.tan(0.5 * angle) * tangent, tangent, normal, radius, angle)


def arc_from(
    start: FloatArray, tangent: FloatArray, onward: FloatArray, radius: float, variant: int, within: float
) -> tuple[Arc, float] | None:
    """Return the arc that leaves a line towards a point, and the distance from its end to the point.

    In the plane of both, with x along the line, y to the side of the centre C = (0, r), and the point at
    (a, b): D = |(a, b - r)|, the distance is l = sqrt(D^2 - r^2), and the arc turns by
    atan2(b - r, a) + atan2(r, l). Of the two tangents from the point to the circle this is the one in the
    direction of the motion. For a point on the circle l = 0, because sqrt(2 r (D - r)) magnifies rounding
    to a line.

    Args:
        start: First point of the arc in [m], shape (3,).
        tangent: Direction of the motion there [-], shape (3,).
        onward: From there to the point in [m], shape (3,).
        radius: In [m].
        variant: 2 for the centre on the side of the point, 1 for the other side.
        within: Distance from the circle up to which a point is on it in [m]: rounding of coordinates.

    Returns:
        The arc and l in [m]; None if the point is on the line, or inside the circle.

    Source: [Iso9283]_ section 2, section 4 steps 3 to 6.
    """
    side = perpendicular_towards(tangent, normalise(onward))
    if side is None:
        return None
    normal = side if variant == PROPER else -side
    a, across = float(onward @ tangent), float(onward @ normal)
    square, rounding = float(onward @ onward) - 2.0 * radius * across, 2.0 * radius * within
    if square < -rounding:
        return None
    distance = math.sqrt(square) if square > rounding else 0.0
    angle = (math.atan2(across - radius, a) + math.atan2(radius, distance)) % (2.0 * math.pi)
    return Arc(start, tangent, normal, radius, angle), distance


def max_arc_radius(tangent: FloatArray, onward: FloatArray) -> float:
    """Return the largest radius in [m] with which `arc_from` reaches its point, (a^2 + b^2) / (2 b).

    Args:
        tangent: Direction of the motion [-], shape (3,).
        onward: From the arc's first point to the next row in [m], shape (3,).
    """
    across = float(np.linalg.norm(onward - (onward @ tangent) * tangent))
    return float(onward @ onward) / (2.0 * across)


@dataclass(frozen=True, slots=True, eq=False)
class OrientationPath:
    """Orientations at the rows of a path, and the rate of rotation from each to the next.

    Attributes:
        at: Arc lengths of the rows in [m], rising, shape (n,).
        quat_xyzw: Sign-continuous quaternions of the orientation there [-], shape (n, 4).
        rate: From each row to the next about a fixed axis, d theta / ds in [rad/m], in the world, shape
            (n - 1, 3).
    """

    at: FloatArray
    quat_xyzw: FloatArray
    rate: FloatArray

    def rates(self, s: FloatArray, *, before: bool = False) -> FloatArray:
        """Return the rate in [rad/m], shape (n, 3), at arc lengths in [m], shape (n,); at a row after it."""
        return np.asarray(self.rate[segment_index(self.at, s, before=before)])

    def quaternions(self, s: FloatArray) -> FloatArray:
        """Return the orientation at arc lengths in [m], shape (n,), as x, y, z, w [-], shape (n, 4)."""
        k = segment_index(self.at, s)
        rotation = self.rate[k] * (s - self.at[k])[:, None]
        return product(to_quaternions(rotation, "vector"), self.quat_xyzw[k])

    def matrices(self, s: FloatArray) -> FloatArray:
        """Return the orientation at arc lengths in [m], shape (n,), as matrices [-], shape (n, 3, 3)."""
        return to_matrices(self.quaternions(s))

    @property
    def uneven_rows(self) -> IndexArray:
        """Rows, from 0, at which the rate of rotation steps [-], shape (k,).

        Over the distance to the nearer row, the step makes an angle of more than rounding of the rows.
        """
        length = np.diff(self.at)
        change = np.linalg.norm(np.diff(self.rate, axis=0), axis=1) * np.minimum(length[:-1], length[1:])
        return np.flatnonzero(change > EVEN_TURN_TOLERANCE) + 1


def segment_index(bounds: FloatArray, s: FloatArray, *, before: bool = False) -> IndexArray:
    """Return the index of the segment of each arc length, shape (n,).

    Args:
        bounds: Begins of the segments, and the end of the last one, in [m], rising, shape (m + 1,).
        s: Arc lengths in [m], shape (n,).
        before: Whether a bound belongs to the segment before it; else to the one after it.
    """
    k = np.searchsorted(bounds, s, side="left" if before else "right") - 1
    return np.asarray(np.clip(k, 0, len(bounds) - 2))


def interpolate_orientations(rotation: FloatArray, at: FloatArray) -> OrientationPath:
    """Return orientations that rotate from row to row by the smaller angle, at constant rates along the path.

    Args:
        rotation: Matrices at the rows [-], shape (n, 3, 3).
        at: Arc lengths of the rows in [m], rising, shape (n,).
    """
    quats = unwrap_quaternions(to_quaternions(rotation.reshape(-1, 9), "matrix"))
    rotations = to_rotation_vectors(product(quats[1:], conjugate(quats[:-1])))
    return OrientationPath(at, quats, rotations / np.diff(at)[:, None])


class PathPoints(NamedTuple):
    """Points of a path.

    Attributes:
        position: p in [m], shape (n, 3).
        tangent: dp/ds, of length 1 [-], shape (n, 3).
        curvature: d2p/ds2 in [m/m2], shape (n, 3): towards the centre; 0 on a line.
    """

    position: FloatArray
    tangent: FloatArray
    curvature: FloatArray


@dataclass(frozen=True, eq=False)
class LineArcPath:
    """Lines and arcs; except at stops, each begins in the direction in which the previous one ends.

    Attributes:
        start: First points of the m segments in [m], shape (m, 3).
        tangent: Directions there [-], shape (m, 3).
        normal: From there to the centre [-], shape (m, 3); 0 of a line.
        radius: In [m], shape (m,); infinity of a line.
        length: In [m], shape (m,).
        row: The row at which each line begins, or to which each arc belongs, from 0, shape (m,).
        at: Arc lengths of the n rows in [m], rising, shape (n,); of a corner the middle of its arc.
        stop_row: The rows at which the path stops, from 0, shape (k,), the first and the last among them.
        orientation: Orientation of the tool along it; None if it is free.

    Source: [Iso9283]_ section 2, eq. 1-4.
    """

    start: FloatArray
    tangent: FloatArray
    normal: FloatArray
    radius: FloatArray
    length: FloatArray
    row: IndexArray
    at: FloatArray
    stop_row: IndexArray
    orientation: OrientationPath | None = None

    def __len__(self) -> int:
        return len(self.length)

    @cached_property
    def bounds(self) -> FloatArray:
        """Arc lengths at which the segments begin and the last one ends, in [m], shape (m + 1,)."""
        return np.concatenate(([0.0], np.cumsum(self.length)))

    @property
    def stops(self) -> FloatArray:
        """Arc lengths of the stops in [m], shape (k,)."""
        return np.asarray(self.at[self.stop_row])

    @property
    def total(self) -> float:
        """The length of the path in [m]."""
        return float(self.bounds[-1])

    @property
    def kinds(self) -> list[SegmentKind]:
        """Whether each segment is a line or an arc."""
        return ["arc" if is_arc else "line" for is_arc in np.isfinite(self.radius)]

    @property
    def arcs(self) -> IndexArray:
        """Indices of the arcs among the segments [-], shape (arcs,)."""
        return np.flatnonzero(np.isfinite(self.radius))

    @property
    def corners(self) -> FloatArray:
        """Corners that the arcs round, where the tangents at both ends meet, in [m], shape (arcs, 3).

        NaN for parallel tangents: an arc of half a turn or a full turn.
        """
        k = self.arcs
        angle = self.length[k] / self.radius[k]
        leg = self.radius[k] * np.where(np.abs(np.sin(angle)) > MIN_CORNER_ANGLE, np.tan(0.5 * angle), np.nan)
        return np.asarray(self.start[k] + leg[:, None] * self.tangent[k])

    def segment_at(self, s: FloatArray, *, before: bool = False) -> IndexArray:
        """Return the segment at each arc length in [m], shape (n,); at a bound the one after or before it."""
        return segment_index(self.bounds, s, before=before)

    def points(self, s: FloatArray, *, before: bool = False) -> PathPoints:
        """Return position, tangent and curvature at arc lengths.

        At a distance w = s - s_k into segment k: on a line p_k + w t, on an arc
        p_k + r (sin(w / r) t + (1 - cos(w / r)) n).

        Args:
            s: In [m], shape (n,).
            before: Whether a bound of two segments is the end of the first; else the begin of the second.
        """
        k = self.segment_at(s, before=before)
        distance = s - self.bounds[k]
        angle = distance / self.radius[k]  # 0 on a line
        sine, versine = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
        is_arc = np.isfinite(self.radius[k])
        radius = np.where(is_arc, self.radius[k], 1.0)
        along = np.where(is_arc, radius * sine, distance)
        across = np.where(is_arc, radius * versine, 0.0)
        t, n = self.tangent[k], self.normal[k]
        cosine = 1.0 - versine
        return PathPoints(
            self.start[k] + along[:, None] * t + across[:, None] * n,
            cosine[:, None] * t + sine[:, None] * n,
            (cosine[:, None] * n - sine[:, None] * t) / self.radius[k][:, None],
        )


# Sections of a cube: from its centre to the middles of two sides, u and v, in halves of its edge. A wall
# section is parallel to two opposite walls and halfway between them. A diagonal section contains two opposite
# edges: c2, c3 and c4 are c1 rotated by 90, 180 and 270 deg about the vertical axis through the centre.
PLANES: Mapping[str, Mapping[str, tuple[Axis, Axis]]] = {
    "wall": {
        "xy": ((1, 0, 0), (0, 1, 0)),
        "xz": ((1, 0, 0), (0, 0, 1)),
        "yz": ((0, 1, 0), (0, 0, 1)),
    },
    "diagonal": {
        "c1": ((1, 0, 1), (0, 1, 0)),
        "c2": ((0, 1, 1), (-1, 0, 0)),
        "c3": ((-1, 0, 1), (0, -1, 0)),
        "c4": ((0, -1, 1), (1, 0, 0)),
    },
}

# Corners in u and v, in the order of the contour, which starts and ends at v, in the middle of a side.
CORNERS = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]], dtype=float)


def cube_rows(
    kind: str,
    side: float,
    radius: float,
    centre: FloatArray,
    plane: str | None = None,
    rotation: FloatArray | None = None,
) -> PathRows:
    """Return the rows of the contour of a section: a row is the first tangent point of its arc.

    Corner k is at centre + a/2 (+-u +- v), and its arc begins R before it. With R = 0 the contour stops at
    the corners.

    Args:
        kind: wall, a square a x a, or diagonal, a rectangle a x a sqrt(2).
        side: Edge of the cube, a, in [m].
        radius: Of the arcs at the corners, R, in [m].
        centre: Of the cube in [m], shape (3,).
        plane: Name of the section in `PLANES`; default: the first, xy or c1.
        rotation: Constant orientation of the tool, a matrix [-], shape (3, 3); None if it is free.

    Raises:
        OptionError: With all faults of `validate_cube`.

    Source: [Iso9283]_ section 2, eq. 5, and section 5.
    """
    if faults := list(validate_cube(kind, plane, side, radius)):
        raise OptionError(*faults)
    sections = PLANES[kind]
    u, v = np.array(sections[plane or next(iter(sections))], dtype=float)
    start = np.array([0.0, 1.0])
    flat = np.vstack((start, CORNERS, start))
    corners = np.asarray(centre) + 0.5 * side * (flat[:, :1] * u + flat[:, 1:] * v)
    ahead = np.diff(corners, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    corners[1:-1] -= radius * ahead[:-1]
    return PathRows(corners, radius, rotation=rotation)


def validate_cube(kind: str, plane: str | None, side: float, radius: float) -> Iterator[Finding]:
    """Yield the faults of a contour.

    Args:
        kind: Of its section, a name in `PLANES`.
        plane: Name of the section; None for the first.
        side: Edge of the cube in [m]; NaN if it is unknown.
        radius: Of its arcs in [m]; NaN if it is unknown.
    """
    if kind not in PLANES:
        yield Finding(format_unknown_name(kind, PLANES))
    elif plane is not None and plane not in PLANES[kind]:
        yield Finding(f"plane of a {kind} section: {format_unknown_name(plane, PLANES[kind])}")
    if side <= 0.0:
        yield Finding(found=f"a = {side:g} m", allowed="more than 0")
    if radius < 0.0:
        yield Finding(found=f"r = {radius:g} m", allowed="0 or more")
    elif 0.0 < side <= 2.0 * radius:
        yield Finding(found=f"a = {side:g} m", allowed=f"more than 2 r = {2.0 * radius:g} m")
