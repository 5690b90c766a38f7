"""A path of lines and arcs, one after the other: place, direction and curvature by arc length."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_models.planning.arcs import STRAIGHT
from urmpipe_models.planning.turning import Turning, part_at

SegmentKind = Literal["line", "arc"]


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
    """Lines and arcs, each going on in the direction in which the one before ends, but for stops.

    Attributes:
        start: First points of the m segments in [m], shape (m, 3).
        tangent: Directions there [-], shape (m, 3).
        normal: From there to the centre [-], shape (m, 3); 0 of a line.
        radius: In [m], shape (m,); infinity of a line.
        length: In [m], shape (m,).
        row: The row that each begins at, or is the arc of, from 0, shape (m,).
        at: Where each of the n rows is along the path in [m], rising, shape (n,); of a corner the middle of
            its arc.
        stop_row: The rows at which the path stops, from 0, shape (k,), the first and the last among them.
        turning: How the tool is turned along it; None if that is left open.

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
    turning: Turning | None = None

    def __len__(self) -> int:
        return len(self.length)

    @cached_property
    def bounds(self) -> FloatArray:
        """Where the segments begin along the path, and where the last one ends, in [m], shape (m + 1,)."""
        return np.concatenate(([0.0], np.cumsum(self.length)))

    @property
    def stops(self) -> FloatArray:
        """Where it stops along the path in [m], shape (k,)."""
        return np.asarray(self.at[self.stop_row])

    @property
    def total(self) -> float:
        """The length of the path in [m]."""
        return float(self.bounds[-1])

    @property
    def kinds(self) -> list[SegmentKind]:
        """Line or arc, of each segment."""
        return ["arc" if arc else "line" for arc in np.isfinite(self.radius)]

    @property
    def arcs(self) -> IndexArray:
        """Which segments are arcs [-], shape (arcs,)."""
        return np.flatnonzero(np.isfinite(self.radius))

    @property
    def corners(self) -> FloatArray:
        """Where the tangents at both ends of each arc meet in [m], shape (arcs, 3): what it rounds.

        NaN of an arc whose tangents are parallel: one of half a turn, or of a whole one.
        """
        k = self.arcs
        angle = self.length[k] / self.radius[k]
        leg = self.radius[k] * np.where(np.abs(np.sin(angle)) > STRAIGHT, np.tan(0.5 * angle), np.nan)
        return np.asarray(self.start[k] + leg[:, None] * self.tangent[k])

    def segment_at(self, s: FloatArray, *, before: bool = False) -> IndexArray:
        """Return the segment at each arc length in [m], shape (n,); where two meet the later or the first."""
        return part_at(self.bounds, s, before=before)

    def points(self, s: FloatArray, *, before: bool = False) -> PathPoints:
        """Return place, direction and curvature at arc lengths.

        With the way w = s - s_k into segment k: on a line p_k + w t, on an arc
        p_k + r (sin(w / r) t + (1 - cos(w / r)) n).

        Args:
            s: In [m], shape (n,).
            before: Whether a place where two segments meet is the end of the first; else the second begins.
        """
        k = self.segment_at(s, before=before)
        way = s - self.bounds[k]
        turned = way / self.radius[k]  # 0 on a line
        sine, versine = np.sin(turned), 2.0 * np.sin(0.5 * turned) ** 2
        arc = np.isfinite(self.radius[k])
        radius = np.where(arc, self.radius[k], 1.0)
        along = np.where(arc, radius * sine, way)
        across = np.where(arc, radius * versine, 0.0)
        t, n = self.tangent[k], self.normal[k]
        cosine = 1.0 - versine
        return PathPoints(
            self.start[k] + along[:, None] * t + across[:, None] * n,
            cosine[:, None] * t + sine[:, None] * n,
            (cosine[:, None] * n - sine[:, None] * t) / self.radius[k][:, None],
        )
