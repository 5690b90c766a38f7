"""From rows to a path: the arc at each row with a radius, the lines between, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.errors import Finding, PathError
from urmpipe_models.planning.arcs import Arc, arc_at_corner, arc_from, largest_radius, towards, unit
from urmpipe_models.planning.line_arc import LineArcPath
from urmpipe_models.planning.rows import PathRows
from urmpipe_models.planning.turning import turning_of

SHORTEST = 1e-12
"""A line shorter than this, in [m], is rounding: two arcs touch there."""


def path_of(rows: PathRows) -> LineArcPath:
    """Return the path of lines and arcs through rows.

    Rows that are corners tell the lines between them, whose arcs are cut in. Where a row is the first point
    of its arc the lines follow from one another: from the end of each arc to the next row.

    Args:
        rows: Two or more; the first and the last one are stops.

    Raises:
        PathError: With every row that makes no path: its radius is too large, it lies on a line with its
            neighbours but has a radius, it repeats the one before.

    Source: [Iso9283]_ section 2, section 4 steps 3 to 10.
    """
    faults = [*end_faults(rows), *_repeated(rows)]
    if faults:
        raise PathError(*faults)
    made = _at_corners(rows, faults) if rows.corner else _from_first_points(rows, faults)
    if faults:
        raise PathError(*faults)
    return made.path(rows)


def end_faults(rows: PathRows) -> Iterator[Finding]:
    """Yield which ends of a path have a radius: there is no line before, or behind."""
    for row in sorted({0, len(rows) - 1} if len(rows) else ()):
        if rows.radius[row] > 0.0:
            allowed = "0, since a path starts and ends at rest"
            yield Finding(row=row + 1, column=_column(rows), found=f"{rows.radius[row]:g} m", allowed=allowed)


def _repeated(rows: PathRows) -> Iterator[Finding]:
    """Yield which rows are where the one before is."""
    for row in np.flatnonzero(np.linalg.norm(np.diff(rows.position, axis=0), axis=1) <= SHORTEST) + 1:
        allowed = "a point away from it"
        yield Finding(row=int(row) + 1, found=f"the point of row {row} again", allowed=allowed)


@dataclass(eq=False)
class _Segments:
    """The segments made so far: lines and arcs by their rows."""

    parts: list[tuple[Arc, float]] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)

    def line(self, start: FloatArray, tangent: FloatArray, length: float, row: int) -> None:
        """Add a line, unless it is as short as rounding."""
        if length > SHORTEST:
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
            None if rows.rotation is None else turning_of(rows.rotation, at),
        )


def _at_corners(rows: PathRows, faults: list[Finding]) -> _Segments:
    """Return the segments of rows that are corners; faults are added to those found."""
    way = np.diff(rows.position, axis=0)
    leg = np.linalg.norm(way, axis=1)
    along = way / leg[:, None]
    arcs: dict[int, Arc] = {}
    for row in np.flatnonzero(rows.radius > 0.0).tolist():
        arc = arc_at_corner(
            rows.position[row], along[row - 1], along[row], float(rows.radius[row]), int(rows.variant[row])
        )
        if arc is None:
            faults.append(_collinear(rows, row))
        else:
            arcs[row] = arc
    made, last = _Segments(), len(rows) - 2
    for row in range(last + 1):
        needed = sum(arcs[k].leg for k in (row, row + 1) if k in arcs)
        if needed > leg[row] + SHORTEST:
            faults.append(_too_short(rows, row, needed, float(leg[row])))
            continue
        start, tangent = rows.position[row], along[row]
        if row in arcs:
            made.arc(arcs[row], row)
            start, tangent = arcs[row].end, arcs[row].end_tangent
        made.line(start, tangent, float(leg[row]) - needed, row)
    return made


def _from_first_points(rows: PathRows, faults: list[Finding]) -> _Segments:
    """Return the segments of rows that are the first points of their arcs; faults are added."""
    made = _Segments()
    tangent = np.zeros(3)
    for row in range(len(rows) - 1):
        start, onward = rows.position[row], rows.position[row + 1] - rows.position[row]
        radius = float(rows.radius[row])
        if radius == 0.0:
            tangent = unit(onward)
            made.line(start, tangent, float(np.linalg.norm(onward)), row)
            continue
        found = arc_from(start, tangent, onward, radius, int(rows.variant[row]))
        if found is None:
            straight = towards(tangent, unit(onward)) is None
            faults.append(_collinear(rows, row) if straight else _too_large(rows, row, tangent, onward))
            tangent = unit(onward)
            continue
        arc, way = found
        made.arc(arc, row)
        tangent = arc.end_tangent
        made.line(arc.end, tangent, way, row)
    return made


def _column(rows: PathRows) -> str:
    """Return what the column of radii is called."""
    return "corner_r" if rows.corner else "r"


def _collinear(rows: PathRows, row: int) -> Finding:
    """Say that a row with a radius lies on one line with its neighbours."""
    found = f"{rows.radius[row]:g} m on one line with rows {row} and {row + 2}"
    return Finding(row=row + 1, column=_column(rows), found=found, allowed="0, or a point off that line")


def _too_short(rows: PathRows, row: int, needed: float, leg: float) -> Finding:
    """Say that the arcs at both ends of a line need more than its length."""
    arcs = [k for k in (row, row + 1) if rows.radius[k] > 0.0]
    radii = " and ".join(f"{rows.radius[k]:g}" for k in arcs)
    where = f"on the line from row {row + 1} to row {row + 2}"
    return Finding(
        row=arcs[-1] + 1, column=_column(rows),
        found=f"{radii} m, whose {'arcs need' if len(arcs) > 1 else 'arc needs'} {needed:.6g} m {where}",
        allowed=f"its length, {leg:.6g} m",
    )  # fmt: skip


def _too_large(rows: PathRows, row: int, tangent: FloatArray, onward: FloatArray) -> Finding:
    """Say that the next row lies within the circle of an arc."""
    found = f"{rows.radius[row]:g} m, a circle around row {row + 2}"
    most = largest_radius(tangent, onward)
    return Finding(row=row + 1, column=_column(rows), found=found, allowed=f"up to {most:.6g} m")
