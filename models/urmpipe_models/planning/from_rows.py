"""From rows to a path: the arc at each row with a radius, the lines between, and what is wrong with them."""

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

SHORTEST = 1e-12
"""Shorter than this is rounding: in [m], or of coordinates beyond 1 m as a share of the largest.

A coordinate is rounded by 1e-16 of itself. That turns an arc, by more the shorter the line before it is, and
each arc passes it on to the next: 1e4 times as much is left for that.
"""


def rows_to_path(rows: PathRows) -> LineArcPath:
    """Return the path of lines and arcs through rows.

    Rows that are corners tell the lines between them, whose arcs are cut in. Where a row is the first point
    of its arc the lines follow from one another: from the end of each arc to the next row.

    Args:
        rows: Two or more; the first and the last one are stops.

    Raises:
        PathError: With every row that makes no path; see `path_faults`.

    Source: [Iso9283]_ section 2, section 4 steps 3 to 10.
    """
    made, faults = _made(rows)
    if faults:
        raise PathError(*faults)
    return made.path(rows)


def validate_rows(rows: PathRows) -> list[Finding]:
    """Return every row that makes no path, with its reason.

    Its radius is too large, the path goes straight on or reverses there but it has a radius, it repeats the
    one before. What may change once a row is mended is not reported: so no radius, NaN, makes none.

    Args:
        rows: Two or more, their positions finite.
    """
    return _made(rows)[1]


def _made(rows: PathRows) -> tuple[_Segments, list[Finding]]:
    """Return the segments of rows, and what is wrong with the rows."""
    faults = [*validate_ends(rows), *_repeated(rows)]
    radius = rows.radius.copy()
    radius[[0, -1]] = 0.0
    inner = replace(rows, radius=radius)
    made = _at_corners(inner, faults) if rows.corner else _from_first_points(inner, faults)
    return made, faults


def _rounding(rows: PathRows) -> float:
    """Return what is rounding in [m]."""
    return SHORTEST * max(1.0, float(np.abs(rows.position).max()))


def validate_ends(rows: PathRows) -> Iterator[Finding]:
    """Yield which ends of a path have a radius: there is no line before, or behind."""
    for row in sorted({0, len(rows) - 1} if len(rows) else ()):
        if rows.radius[row] > 0.0:
            allowed = "0, since a path starts and ends at rest"
            yield Finding(row=row + 1, column=_column(rows), found=f"{rows.radius[row]:g} m", allowed=allowed)


def _repeated(rows: PathRows) -> Iterator[Finding]:
    """Yield which rows are where the one before is."""
    for row in np.flatnonzero(np.linalg.norm(np.diff(rows.position, axis=0), axis=1) <= _rounding(rows)) + 1:
        allowed = "another point" + ("" if rows.rotation is None else ": the tool does not turn on the spot")
        yield Finding(row=int(row) + 1, found=f"the same point as row {row}", allowed=allowed)


@dataclass(eq=False)
class _Segments:
    """The segments made so far: lines, but for those as short as rounding in [m], and arcs by their rows."""

    rounding: float
    parts: list[tuple[Arc, float]] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)

    def line(self, start: FloatArray, tangent: FloatArray, length: float, row: int) -> None:
        """Add a line, unless it is as short as rounding."""
        if length > self.rounding:
            self._add(Arc(start, tangent, np.zeros(3), np.inf, 0.0), length, row)

    def arc(self, arc: Arc, row: int) -> None:
        """Add an arc."""
        self._add(arc, arc.radius * arc.angle, row)

    def _add(self, part: Arc, length: float, row: int) -> None:
        self.parts.append((part, length))
        self.rows.append(row)

    def path(self, rows: PathRows) -> LineArcPath:
        """Return the segments as a path, the tool turned as it is at the rows."""
        arcs, lengths = zip(*self.parts, strict=True)
        length, row = np.array(lengths), np.array(self.rows, dtype=np.intp)
        bounds = np.concatenate(([0.0], np.cumsum(length)))
        first = np.searchsorted(row, np.arange(len(rows) - 1))  # a row begins with its arc, if it has one
        at = np.append(bounds[first], bounds[-1])
        stops = np.flatnonzero(rows.radius == 0.0)
        if rows.corner:  # the corner itself is not on the path: the middle of its arc is the nearest to it
            rounded = np.flatnonzero(rows.radius > 0.0)
            at[rounded] += 0.5 * length[first[rounded]]
        return LineArcPath(
            np.array([one.start for one in arcs]),
            np.array([one.tangent for one in arcs]),
            np.array([one.normal for one in arcs]),
            np.array([one.radius for one in arcs]),
            length,
            row,
            at,
            stops,
            None if rows.rotation is None else interpolate_orientations(rows.rotation, at),
        )


def _at_corners(rows: PathRows, faults: list[Finding]) -> _Segments:
    """Return the segments of rows that are corners; faults are added to those found."""
    rounding = _rounding(rows)
    way = np.diff(rows.position, axis=0)
    leg = np.linalg.norm(way, axis=1)
    apart = leg > rounding
    along = way / np.where(apart, leg, 1.0)[:, None]
    arcs: dict[int, Arc] = {}
    for row in np.flatnonzero(rows.radius > 0.0).tolist():
        if not apart[row - 1 : row + 1].all():
            continue
        arc = arc_at_corner(
            rows.position[row], along[row - 1], along[row], float(rows.radius[row]), int(rows.variant[row])
        )
        if arc is None:
            faults.append(_parallel(rows, row, along[row - 1], along[row]))
        else:
            arcs[row] = arc
    made = _Segments(rounding)
    for row in range(len(rows) - 1):
        ends = [k for k in (row, row + 1) if k in arcs]
        needed = sum(arcs[k].leg for k in ends)
        if needed > leg[row] + rounding:
            faults.append(_too_short(rows, row, ends, needed, float(leg[row])))
            continue
        start, tangent = rows.position[row], along[row]
        if row in arcs:
            made.arc(arcs[row], row)
            start, tangent = arcs[row].end, arcs[row].end_tangent
        made.line(start, tangent, float(leg[row]) - needed, row)
    return made


def _from_first_points(rows: PathRows, faults: list[Finding]) -> _Segments:
    """Return the segments of rows that are the first points of their arcs; faults are added.

    After a fault the direction of the motion is not known until the path stops.
    """
    rounding = _rounding(rows)
    made = _Segments(rounding)
    tangent: FloatArray | None = None
    for row in range(len(rows) - 1):
        start, onward = rows.position[row], rows.position[row + 1] - rows.position[row]
        radius, length = float(rows.radius[row]), float(np.linalg.norm(onward))
        if length <= rounding or math.isnan(radius):
            tangent = None
        elif radius == 0.0:
            tangent = onward / length
            made.line(start, tangent, length, row)
        elif tangent is not None:
            found = arc_from(start, tangent, onward, radius, int(rows.variant[row]), rounding)
            if found is None:
                faults.append(_no_arc(rows, row, tangent, onward))
                tangent = None
                continue
            arc, way = found
            made.arc(arc, row)
            tangent = arc.end_tangent
            made.line(arc.end, tangent, way, row)
    return made


def _column(rows: PathRows) -> str:
    """Return what the column of radii is called."""
    return "corner_r" if rows.corner else "r"


def _parallel(rows: PathRows, row: int, tangent: FloatArray, onward: FloatArray) -> Finding:
    """Say that the path leaves a row with a radius along the direction in which it gets there."""
    where = "goes straight on" if onward @ tangent > 0.0 else "reverses"
    found = f"a radius of {rows.radius[row]:g} m where the path {where}"
    return Finding(
        row=row + 1, column=_column(rows), found=found, allowed=f"0, or row {row + 2} off that line"
    )


def _too_short(rows: PathRows, row: int, arcs: Sequence[int], needed: float, leg: float) -> Finding:
    """Say that the arcs at the ends of a line need more than its length."""
    radii = " and ".join(f"{rows.radius[k]:g}" for k in arcs)
    where = f"on the line from row {row + 1} to row {row + 2}"
    need, most = _unlike(needed, leg)
    return Finding(
        row=arcs[-1] + 1, column=_column(rows),
        found=f"{radii} m, whose {'arcs need' if len(arcs) > 1 else 'arc needs'} {need} m {where}",
        allowed=f"its length, {most} m",
    )  # fmt: skip


def _no_arc(rows: PathRows, row: int, tangent: FloatArray, onward: FloatArray) -> Finding:
    """Say that the next row lies along the direction of the motion, or within the circle of an arc."""
    if perpendicular_towards(tangent, normalise(onward)) is None:
        return _parallel(rows, row, tangent, onward)
    radius, most = _unlike(float(rows.radius[row]), max_arc_radius(tangent, onward))
    found = f"{radius} m, with row {row + 2} inside its circle"
    return Finding(row=row + 1, column=_column(rows), found=found, allowed=f"up to {most} m")


def _unlike(found: float, allowed: float) -> tuple[str, str]:
    """Return two numbers with so many digits, six or more, that they differ."""
    texts = ((f"{found:.{digits}g}", f"{allowed:.{digits}g}") for digits in range(6, 18))
    return next((one, other) for one, other in texts if one != other)
