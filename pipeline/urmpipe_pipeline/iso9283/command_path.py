"""The path of a command by arc length s: its corners, legs and stops, and the planes that cut it.

1. Vertices: rows that are 30 sigma apart, so that noise has no direction.
2. Corners: where the path turns by 30 deg or more within 5 ms of motion; or known ones (`RoundedCorner`).
   The corner point is where the straight legs before and after it meet. No plane cuts its zone, 10 % of
   the shorter leg to either side.
3. Legs: straight pieces with a constant commanded speed v_c; the middle half of each counts.
4. Planes normal to the path (`even_planes`, `planes_at`), and where a cycle crosses them (`find_crossings`).

Source: after ISO 9283, from common knowledge; thresholds are of this project.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_pipeline.iso9283.motion import TIME_ROUNDING, Motion, Stage, assign_in_order, thin_by_distance

CORNER_ANGLE = np.radians(30.0)  # a path that turns by this or more has a corner there
REVERSAL_ANGLE = np.radians(150.0)  # a path that turns by more goes back
CORNER_TIME = 0.005  # s of commanded motion in which a corner turns, or one row if rows are further apart
CORNER_SHARE = 0.01  # of the turn of a corner: vertices at which the path turns by less are outside it
CORNER_ZONE = 0.1  # of the shorter leg of a corner: no plane cuts the path so near to it
VERTEX_NOISE = 30.0  # standard deviations between vertices: a direction is known to 4 deg, 1/8 of 30 deg
PIECE_TOLERANCE = 1e-4  # of the extent: distance of a path from its straight pieces
LEG_TOLERANCE = 0.02  # of that, for the middle half of a leg: a piece of an arc is no leg
SPEED_TOLERANCE = 0.01  # of the commanded speed: variation of a constant one
MAX_SPEED_NOISE = 0.1  # of the commanded speed: with more noise no speed is known to be constant
MIN_LEG_ROWS = 4  # of the command in the middle half of a leg
ARC_ROUNDING = 1e-12  # m, between arc lengths that are equal except for rounding
STOP_DISTANCE = 1e-9  # m, between a plane and a stop that are at one place
CROSSWISE = np.cos(
    np.radians(85.0)
)  # a leg at a larger angle to the normal does not cross a plane at its end


class RoundedCorner(NamedTuple):
    """A corner that a command is known to round: an arc of a plan.

    Attributes:
        start: Time at which it begins to turn in [s].
        end: Time at which it has turned in [s].
        point: The corner in [m].
    """

    start: float
    end: float
    point: tuple[float, float, float]


class Stop(NamedTuple):
    """A point at which a command is known to stop, even if only for a moment.

    Attributes:
        t: Time in [s].
        position: In [m].
    """

    t: float
    position: tuple[float, float, float]


class CommandCorner(NamedTuple):
    """A corner of the command path.

    Attributes:
        point: Where the straight legs before and after it meet, in [m], shape (3,).
        before: Direction of the path before it [-], shape (3,).
        after: Direction of the path after it [-], shape (3,).
        start: Arc length at which it begins to turn in [m].
        end: Arc length at which it has turned in [m].
        middles: Arc lengths in [m] half way to the corner, stop or end before it, and to the one after it.
        zone: Arc lengths in [m] between which no plane cuts the path.
        is_straight: Whether the leg after it is straight.
    """

    point: FloatArray
    before: FloatArray
    after: FloatArray
    start: float
    end: float
    middles: tuple[float, float]
    zone: tuple[float, float]
    is_straight: bool

    @property
    def anchors(self) -> tuple[float, ...]:
        """Arc lengths in [m] at which cycles are aligned around it: both middles, and the corner between.

        Only the middles if the path goes back: a cycle need not cross a plane there.
        """
        if float(self.before @ self.after) < np.cos(REVERSAL_ANGLE):
            return self.middles
        return self.middles[0], (self.start + self.end) / 2.0, self.middles[1]


class CommandLeg(NamedTuple):
    """A straight leg with a constant commanded speed.

    Attributes:
        start: Arc length at which its middle half begins in [m].
        end: Arc length at which its middle half ends in [m].
        direction: Its direction [-], shape (3,).
        length: Length of its middle half in [m].
        speed: The commanded speed v_c in [m/s].
    """

    start: float
    end: float
    direction: FloatArray
    length: float
    speed: float


class Planes(NamedTuple):
    """Planes normal to the command path.

    Attributes:
        s: Arc lengths in [m], shape (k,), rising.
        t: Times of the command there in [s], shape (k,).
        point: Points of the path in [m], shape (k, 3).
        normal: Direction of the path there [-], shape (k, 3).
    """

    s: FloatArray
    t: FloatArray
    point: FloatArray
    normal: FloatArray


class Crossings(NamedTuple):
    """Where a cycle crosses planes.

    Attributes:
        t: Times in [s] on the cycle's clock, shape (k,).
        point: In [m], shape (k, 3).
    """

    t: FloatArray
    point: FloatArray


class _Turn(NamedTuple):
    """Arc lengths in [m] between which the path turns, and its corner in [m], shape (3,), if it is known."""

    start: float
    end: float
    corner: FloatArray | None


class CommandPath:
    """The path of a command: its vertices where it moves, by arc length.

    Args:
        motion: The command.
        corners: Corners that it is known to round; those that its rows show elsewhere are added.
    """

    def __init__(self, motion: Motion, corners: Sequence[RoundedCorner] = ()) -> None:
        self.motion = motion
        self._rows = rows = thin_by_distance(motion.position, VERTEX_NOISE * motion.noise)
        self.position: FloatArray = motion.position[rows]  # vertices in [m], shape (n, 3)
        self._arrival_times = motion.t[rows]
        step = np.diff(self.position, axis=0)
        length = np.linalg.norm(step, axis=1)
        self.s: FloatArray = np.concatenate(([0.0], np.cumsum(length)))
        self.total = float(self.s[-1])  # length in [m]
        self._direction: FloatArray = step / length[:, np.newaxis]
        self._departure_times, self._is_stop = _departures_and_stops(motion, rows)
        self._coarse = max(PIECE_TOLERANCE * motion.extent, 200.0 * motion.noise)
        self._fine = max(LEG_TOLERANCE * self._coarse, 10.0 * motion.noise)
        self.corners = self._find_corners(corners)
        self.legs = tuple(self._iter_legs())

    def even_planes(self, count: int) -> Planes:
        """Return planes that are even in arc length over all that is outside the zones of corners.

        A plane at a stop where the path turns off moves back, half way to the plane, stop or zone before it:
        at the stop it would lie along the leg before, and no cycle has to cross it.
        """
        edges = np.maximum.accumulate(
            [0.0, *(edge for corner in self.corners for edge in corner.zone), self.total]
        )
        starts = edges[::2]
        free = np.maximum(np.diff(edges)[::2], 0.0)
        along = (np.arange(count) + 0.5) / count * free.sum()
        ends = np.cumsum(free)
        stretch = np.minimum(np.searchsorted(ends, along, side="right"), len(free) - 1)
        s = starts[stretch] + along - (ends - free)[stretch]
        cosine = np.einsum("ni,ni->n", self._direction[:-1], self._direction[1:])
        for turn in self.s[1:-1][self._is_stop[1:-1] & (cosine <= CROSSWISE)]:
            earlier = np.concatenate((edges, self.s[self._is_stop], s))
            earlier = earlier[earlier < turn - STOP_DISTANCE]
            s[np.abs(s - turn) <= STOP_DISTANCE] = (turn + earlier.max()) / 2.0
        return self.planes_at(s)

    def planes_at(self, s: FloatArray) -> Planes:
        """Return the planes at arc lengths in [m], shape (k,)."""
        piece = self._piece_at(s)
        share = (s - self.s[piece]) / (self.s[piece + 1] - self.s[piece])
        departure = self._departure_times[piece]
        t = departure + share * (self._arrival_times[piece + 1] - departure)
        step = self.position[piece + 1] - self.position[piece]
        return Planes(s, t, self.position[piece] + share[:, np.newaxis] * step, self._direction[piece])

    def speed_at(self, s: FloatArray) -> FloatArray:
        """Return the commanded speed in [m/s] at arc lengths in [m], both of shape (k,)."""
        speeds = np.diff(self.s) / (self._arrival_times[1:] - self._departure_times[:-1])
        return np.asarray(speeds[self._piece_at(s)])

    def _piece_at(self, s: FloatArray) -> IntArray:
        return np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self._direction) - 1)

    def _find_corners(self, rounded: Sequence[RoundedCorner]) -> tuple[CommandCorner, ...]:
        """Return all corners in order: the known ones, and those that the rows show elsewhere."""
        turns = []
        for corner in rounded:
            start, end = np.interp([corner.start, corner.end], self._arrival_times, self.s).tolist()
            turns.append(_Turn(start, end, np.array(corner.point)))
        turns += [
            turn
            for turn in self._iter_turns()
            if not any(known.start <= turn.end and turn.start <= known.end for known in turns)
        ]
        turns.sort(key=lambda turn: turn.start)
        edges = [edge for turn in turns for edge in (turn.start, turn.end)]
        bounds: FloatArray = np.unique([0.0, self.total, *self.s[self._is_stop].tolist(), *edges])
        return tuple(self._build_corner(turn, bounds) for turn in turns)

    def _iter_turns(self) -> Iterator[_Turn]:
        """Yield where the direction turns as at a corner, without a stop."""
        moving = np.concatenate(([0.0], np.cumsum(self._arrival_times[1:] - self._departure_times[:-1])))
        count = len(self._direction)
        begin = np.arange(1, count)
        duration = max(CORNER_TIME, float(np.median(np.diff(self._arrival_times)))) + TIME_ROUNDING
        end = np.searchsorted(moving, moving[begin] + duration, side="right") - 1
        end = np.clip(end, begin, count - 1)
        stops = np.concatenate(([0], np.cumsum(self._is_stop)))
        has_no_stop = stops[end + 1] == stops[begin]
        cosine = np.einsum("ni,ni->n", self._direction[begin - 1], self._direction[end])
        turning = np.flatnonzero(has_no_stop & (cosine <= np.cos(CORNER_ANGLE) + 1e-12))
        while len(turning):
            gaps = (k for k in range(1, len(turning)) if begin[turning[k]] > end[turning[k - 1]] + 1)
            following = next(gaps, len(turning))
            vertex = np.arange(begin[turning[0]], end[turning[following - 1]] + 1)
            cosine = np.einsum("ni,ni->n", self._direction[vertex - 1], self._direction[vertex])
            angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            vertex = vertex[angle >= CORNER_SHARE * angle.sum()]
            yield _Turn(float(self.s[vertex[0]]), float(self.s[vertex[-1]]), None)
            turning = turning[following:]

    def _build_corner(self, turn: _Turn, bounds: FloatArray) -> CommandCorner:
        """Return the corner of a turn.

        Args:
            turn: The turn.
            bounds: Arc lengths of the ends, of the stops and of the edges of all turns in [m], rising.
        """
        start, end, point = turn
        previous = float(bounds[int(np.searchsorted(bounds, start)) - 1]) if start > 0.0 else 0.0
        following = float(bounds[min(int(np.searchsorted(bounds, end, side="right")), len(bounds) - 1)])
        margin = CORNER_ZONE * min(start - previous, following - end)
        middles = (previous + start) / 2.0, (end + following) / 2.0
        before, _ = self._heading(middles[0], start, at_end=True)
        after, is_straight = self._heading(end, middles[1], at_end=False)
        if point is None:
            edges = self.planes_at(np.array([start, end])).point
            point = _closest_point(edges[0], before, edges[1], after)
        zone = start - margin, end + margin
        return CommandCorner(point, before, after, start, end, middles, zone, is_straight)

    def _heading(self, first: float, last: float, *, at_end: bool) -> tuple[FloatArray, bool]:
        """Return the direction [-], shape (3,), at an end of a stretch, and whether that is straight."""
        inside = self.position[(self.s >= first - ARC_ROUNDING) & (self.s <= last + ARC_ROUNDING)]
        chord = inside[-1] - inside[0] if len(inside) > 1 else np.zeros(3)
        length = float(np.linalg.norm(chord))
        if length > 0.0 and _max_distance(inside, inside[0], chord / length) <= self._fine:
            return chord / length, True
        after = np.searchsorted(self.s, last, "left") if at_end else np.searchsorted(self.s, first, "right")
        return self._direction[int(np.clip(after - 1, 0, len(self._direction) - 1))], False

    def _iter_straight_pieces(self) -> Iterator[tuple[int, int]]:
        """Yield the first and the last vertex of each straight piece of the path, in order.

        Parted at stops, and at the vertex that is furthest away until none is further than `_coarse`
        (Ramer-Douglas-Peucker).
        """
        edges = [0, *np.flatnonzero(self._is_stop[1:-1]) + 1, len(self.s) - 1]
        waiting = list(pairwise(edges))[::-1]
        while waiting:
            first, last = waiting.pop()
            chord = self.position[last] - self.position[first]
            length = np.linalg.norm(chord)
            offset = self.position[first + 1 : last] - self.position[first]
            if length > 0.0:
                along = np.clip(offset @ chord / length**2, 0.0, 1.0)
                offset = offset - along[:, np.newaxis] * chord
            distance = np.linalg.norm(offset, axis=1)
            if last - first < 2 or distance.max() <= self._coarse:
                yield int(first), int(last)
                continue
            middle = first + 1 + int(np.argmax(distance))
            waiting += [(middle, last), (first, middle)]

    def _iter_legs(self) -> Iterator[CommandLeg]:
        """Yield the straight legs whose middle half has a constant commanded speed."""
        speeds, noise = self.motion.speed, 10.0 * self.motion.speed_error
        for first, last in self._iter_straight_pieces():
            start, end = (self.s[first] + share * (self.s[last] - self.s[first]) for share in (0.25, 0.75))
            inside = np.flatnonzero((self.s[:-1] >= start) & (self.s[1:] <= end))
            if len(inside) < MIN_LEG_ROWS:
                continue
            ends = self.planes_at(np.array([start, end]))
            chord = ends.point[1] - ends.point[0]
            length = float(np.linalg.norm(chord))
            direction = chord / length
            is_straight = _max_distance(self.position[inside], ends.point[0], direction) <= self._fine
            speed = speeds[self._rows[inside[0]] : self._rows[inside[-1] + 1]]
            least, largest = float(speed.min()), float(speed.max())
            is_constant = largest - least <= SPEED_TOLERANCE * largest + noise
            if is_straight and noise <= MAX_SPEED_NOISE * largest and is_constant:
                duration = float(ends.t[1] - ends.t[0])
                yield CommandLeg(float(start), float(end), direction, length, length / duration)


def _departures_and_stops(motion: Motion, rows: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return when each vertex is left in [s], and whether the command stops there, both of shape (k,)."""
    moves = np.append(np.flatnonzero(~motion.is_resting), len(motion) - 1)  # rows from which it moves on
    last = np.minimum(moves[np.searchsorted(moves, rows)], np.append(rows[1:] - 1, len(motion) - 1))
    departures = motion.t[np.maximum(last, rows)]
    is_stop = np.zeros(len(rows), bool)
    for rest in motion.rests:
        is_stop[np.clip(np.searchsorted(rows, (rest.first + rest.last) // 2, side="right") - 1, 0, None)] = (
            True
        )
    return departures, is_stop


def _max_distance(points: FloatArray, start: FloatArray, direction: FloatArray) -> float:
    """Return the largest distance of points, shape (n, 3), from a line, in [m]."""
    offset = points - start
    offset = offset - np.outer(offset @ direction, direction)
    return float(np.linalg.norm(offset, axis=1).max(initial=0.0))


def _closest_point(end: FloatArray, before: FloatArray, start: FloatArray, after: FloatArray) -> FloatArray:
    """Return the point half way between two lines where they are closest, in [m], shape (3,).

    If their directions are opposite, the point between `end` and `start`.
    """
    cosine = float(before @ after)
    sine = 1.0 - cosine**2
    if sine < 1e-6:
        return np.asarray((end + start) / 2.0)
    gap = start - end
    first = (gap @ before - cosine * (gap @ after)) / sine
    second = (cosine * (gap @ before) - gap @ after) / sine
    return np.asarray((end + first * before + start + second * after) / 2.0)


def find_crossings(cycle: Motion, planes: Planes) -> Crossings | int:
    """Return where a cycle crosses planes, or the number of the first plane, from 0, that it does not reach.

    A plane is crossed in the direction of its normal, on the straight line between two rows. If there are
    several crossings, the choice is in the order of the planes and nearest to the command in total, so that
    a path that crosses itself or comes back keeps its planes.

    Args:
        cycle: The cycle.
        planes: The planes of the command.
    """
    stages: list[Stage] = []
    points: list[FloatArray] = []
    for origin, normal in zip(planes.point, planes.normal, strict=True):
        height = (cycle.position - origin) @ normal
        row = np.flatnonzero((height[:-1] < 0.0) & (height[1:] >= 0.0))
        share = height[row] / (height[row] - height[row + 1])
        point = cycle.position[row] + share[:, np.newaxis] * (cycle.position[row + 1] - cycle.position[row])
        t = cycle.t[row] + share * (cycle.t[row + 1] - cycle.t[row])
        stages.append((t, np.linalg.norm(point - origin, axis=1)))
        points.append(point)
    chosen = assign_in_order(stages)
    if isinstance(chosen, int):
        return chosen
    t = np.array([stage[0][k] for stage, k in zip(stages, chosen, strict=True)])
    return Crossings(t, np.array([point[k] for point, k in zip(points, chosen, strict=True)]).reshape(-1, 3))
