"""From rows to a path: an arc at each row with a radius, lines between them, and the faults of rows.

1. `rows_to_path`: rows that are corners define the lines, into which the arcs are cut
   (`_segments_at_corners`). Rows that are first points of their arcs define lines one after the other, from
   the end of each arc to the next row (`_segments_from_first_points`). Source: [Iso9283]_ section 2,
   section 4 steps 3 to 10.
2. `validate_rows`, `validate_ends`: every row without a path, with its reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, PathError
from urmpipe_models.planning.path import (
    Arc,
    LineArcPath,
    PathRows,
    arc_at_corner,
    arc_from,
    interpolate_orientations,
    max_arc_radius,
    normalise,
    perpendicular_towards,
)

# Lengths up to this are rounding: in [m], or for coordinates beyond 1 m as a share of the largest. A
# coordinate is rounded by 1e-16 of itself. That rotates an arc, by more the shorter the line before it is,
# and each arc passes it on to the next: the margin for that is 1e4.
ROUNDING_LENGTH = 1e-12


def rows_to_path(rows: PathRows) -> LineArcPath:
    """Return the path of lines and arcs through rows.

    Args:
        rows: Two or more; the first and the last one are stops.

    Raises:
        PathError: With every row without a path; see `validate_rows`.

    Source: [Iso9283]_ section 2, section 4 steps 3 to 10.
    """
    segments, faults = _build_segments(rows)
    if faults:
        raise PathError(*faults)
    return segments.path(rows)


def validate_rows(rows: PathRows) -> list[Finding]:
    """Return every row without a path, with its reason.

    Its radius is too large, the path continues straight or reverses at a row with a radius, or the row
    repeats the previous one. Faults that may vanish once another row is corrected are not reported: so an
    unknown radius, NaN, has none.

    Args:
        rows: Two or more, their positions finite.
    """
    return _build_segments(rows)[1]


def validate_ends(rows: PathRows) -> Iterator[Finding]:
    """Yield the ends of a path with a radius, where the line before or after is missing."""
    for row in sorted({0, len(rows) - 1} if len(rows) else ()):
        if rows.radius[row] > 0.0:
            allowed = "0, since a path starts and ends at rest"
            yield Finding(
                row=row + 1, column=_radius_column(rows), found=f"{rows.radius[row]:g} m", allowed=allowed
            )


@dataclass(eq=False)
class _Segments:
    """Segments of a path: lines longer than rounding in [m], arcs, and the row of each."""

    rounding: float
    parts: list[tuple[Arc, float]] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)

    def line(self, start: FloatArray, tangent: FloatArray, length: float, row: int) -> None:
        """Add a line, unless its length is rounding."""
        if length > self.rounding:
            self.parts.append((Arc(start, tangent, np.zeros(3), np.inf, 0.0), length))
            self.rows.append(row)

    def arc(self, arc: Arc, row: int) -> None:
        """Add an arc."""
        self.parts.append((arc, arc.radius * arc.angle))
        self.rows.append(row)

    def path(self, rows: PathRows) -> LineArcPath:
        """Return the segments as a path with the orientations of the rows."""
        arcs, lengths = zip(*self.parts, strict=True)
        length, row = np.array(lengths), np.array(self.rows, dtype=np.intp)
        bounds = np.concatenate(([0.0], np.cumsum(length)))
        first = np.searchsorted(row, np.arange(len(rows) - 1))  # a row begins with its arc, if it has one
        at = np.append(bounds[first], bounds[-1])
        stops = np.flatnonzero(rows.radius == 0.0)
        if rows.corner:  # the corner itself is not on the path; the middle of its arc is nearest to it
            rounded = np.flatnonzero(rows.radius > 0.0)
            at[rounded] += 0.5 * length[first[rounded]]
        return LineArcPath(
            np.array([arc.start for arc in arcs]),
            np.array([arc.tangent for arc in arcs]),
            np.array([arc.normal for arc in arcs]),
            np.array([arc.radius for arc in arcs]),
            length,
            row,
            at,
            stops,
            None if rows.rotation is None else interpolate_orientations(rows.rotation, at),
        )


def _build_segments(rows: PathRows) -> tuple[_Segments, list[Finding]]:
    """Return the segments of rows, and the faults of the rows."""
    segments = _Segments(ROUNDING_LENGTH * max(1.0, float(np.abs(rows.position).max())))
    faults = [*validate_ends(rows)]
    steps = np.linalg.norm(np.diff(rows.position, axis=0), axis=1)
    for row in np.flatnonzero(steps <= segments.rounding) + 1:
        allowed = "another point" + ("" if rows.rotation is None else ": the tool does not turn on the spot")
        faults.append(Finding(row=int(row) + 1, found=f"the same point as row {row}", allowed=allowed))
    radius = rows.radius.copy()
    radius[[0, -1]] = 0.0
    inner = replace(rows, radius=radius)
    add_segments = _segments_at_corners if rows.corner else _segments_from_first_points
    add_segments(inner, segments, faults)
    return segments, faults


def _segments_at_corners(rows: PathRows, segments: _Segments, faults: list[Finding]) -> None:
    """Add the segments of rows that are corners, and their faults."""
    steps = np.diff(rows.position, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    is_line = lengths > segments.rounding
    along = steps / np.where(is_line, lengths, 1.0)[:, None]
    arcs: dict[int, Arc] = {}
    for row in np.flatnonzero(rows.radius > 0.0).tolist():
        if not is_line[row - 1 : row + 1].all():
            continue
        radius, variant = float(rows.radius[row]), int(rows.variant[row])
        arc = arc_at_corner(rows.position[row], along[row - 1], along[row], radius, variant)
        if arc is None:
            faults.append(_parallel_fault(rows, row, along[row - 1], along[row]))
        else:
            arcs[row] = arc
    for row in range(len(rows) - 1):
        ends = [k for k in (row, row + 1) if k in arcs]
        needed, length = sum(arcs[k].leg for k in ends), float(lengths[row])
        if needed > lengths[row] + segments.rounding:
            faults.append(_short_line_fault(rows, row, ends, needed, length))
            continue
        start, tangent = rows.position[row], along[row]
        if row in arcs:
            segments.arc(arcs[row], row)
            start, tangent = arcs[row].end, arcs[row].end_tangent
        segments.line(start, tangent, length - needed, row)


def _segments_from_first_points(rows: PathRows, segments: _Segments, faults: list[Finding]) -> None:
    """Add the segments of rows that are the first points of their arcs, and their faults.

    After a fault the direction of the motion is unknown until the path stops.
    """
    tangent: FloatArray | None = None
    for row in range(len(rows) - 1):
        start, onward = rows.position[row], rows.position[row + 1] - rows.position[row]
        radius, length = float(rows.radius[row]), float(np.linalg.norm(onward))
        if length <= segments.rounding or math.isnan(radius):
            tangent = None
        elif radius == 0.0:
            tangent = onward / length
            segments.line(start, tangent, length, row)
        elif tangent is not None:
            tangent_line = arc_from(start, tangent, onward, radius, int(rows.variant[row]), segments.rounding)
            if tangent_line is None:
                faults.append(_no_arc_fault(rows, row, tangent, onward))
                tangent = None
                continue
            arc, distance = tangent_line
            segments.arc(arc, row)
            tangent = arc.end_tangent
            segments.line(arc.end, tangent, distance, row)


def _radius_column(rows: PathRows) -> str:
    return "corner_r" if rows.corner else "r"


def _parallel_fault(rows: PathRows, row: int, tangent: FloatArray, onward: FloatArray) -> Finding:
    """Return the fault of a row with a radius between parallel lines."""
    where = "goes straight on" if onward @ tangent > 0.0 else "reverses"
    return Finding(
        row=row + 1, column=_radius_column(rows),
        found=f"a radius of {rows.radius[row]:g} m where the path {where}",
        allowed=f"0, or row {row + 2} off that line",
    )  # fmt: skip


def _short_line_fault(rows: PathRows, row: int, arcs: Sequence[int], needed: float, length: float) -> Finding:
    """Return the fault of a line shorter than the arcs at its ends need."""
    radii = " and ".join(f"{rows.radius[k]:g}" for k in arcs)
    where = f"on the line from row {row + 1} to row {row + 2}"
    need, limit = _format_distinct(needed, length)
    return Finding(
        row=arcs[-1] + 1, column=_radius_column(rows),
        found=f"{radii} m, whose {'arcs need' if len(arcs) > 1 else 'arc needs'} {need} m {where}",
        allowed=f"its length, {limit} m",
    )  # fmt: skip


def _no_arc_fault(rows: PathRows, row: int, tangent: FloatArray, onward: FloatArray) -> Finding:
    """Return the fault of a row whose next row is on the line of motion, or inside the circle of its arc."""
    if perpendicular_towards(tangent, normalise(onward)) is None:
        return _parallel_fault(rows, row, tangent, onward)
    radius, limit = _format_distinct(float(rows.radius[row]), max_arc_radius(tangent, onward))
    return Finding(
        row=row + 1, column=_radius_column(rows),
        found=f"{radius} m, with row {row + 2} inside its circle", allowed=f"up to {limit} m",
    )  # fmt: skip


def _format_distinct(value: float, limit: float) -> tuple[str, str]:
    """Return two numbers with six digits, or more until they differ."""
    texts = ((f"{value:.{digits}g}", f"{limit:.{digits}g}") for digits in range(6, 18))
    return next(pair for pair in texts if pair[0] != pair[1])
