"""The command path: its corners, legs and stops, and the planes that cut it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_pipeline.iso9283.motion import ROUNDING, Motion, Stage, apart_rows, in_order

CORNER = np.radians(30.0)
"""A corner is where the direction turns by this much or more, in [rad] ..."""

BACK = np.radians(150.0)
"""Where it turns by more than this in [rad] the path goes back."""

WITHIN = 0.005
"""... within this time of commanded motion in [s], or between two vertices where these are further apart."""

SHARE = 0.01
"""A vertex belongs to a corner if the path turns there by this share of the corner's turn."""

ZONE = 0.1
"""The zone of a corner reaches so far along its legs: this share of the shorter one."""

TREMBLE = 30.0
"""Vertices nearer to each other than so many standard deviations of the noise tell no direction: at this
distance it is known to 4 deg, and 30 deg are eight times that."""

STRAIGHT = 1e-4
"""A path is taken apart into straight pieces to this share of its extent ..."""

LEVEL = 0.02
"""... and a piece is a leg if its middle half is straight to this share of that: a piece of an arc is not."""

STEADY = 0.01
"""A commanded speed that varies by this share of itself is constant."""

TOLD = 0.1
"""No speed is told to be constant where noise alone may make it vary by this share of itself."""

FEWEST = 4
"""Rows of the command in the middle half of a leg whose speed is judged, at least."""

LEAST = 1e-12
"""Arc lengths that differ by no more than this in [m] are one: what rounding leaves."""


@dataclass(frozen=True, slots=True)
class Bend:
    """Where a command is known to turn: an arc of a plan that rounds a corner.

    Attributes:
        begins: When it begins to turn in [s].
        ends: When it has turned in [s].
        corner: Where the corner is in [m].
    """

    begins: float
    ends: float
    corner: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Stop:
    """Where a command is known to stop, if for a moment only.

    Attributes:
        t: When in [s].
        place: Where in [m].
    """

    t: float
    place: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class CommandCorner:
    """A corner of the command path.

    Attributes:
        point: Where the straight legs before and behind it meet, in [m], shape (3,).
        before: Direction of the path before it [-], shape (3,).
        behind: Direction of the path behind it [-], shape (3,).
        begins: Arc length at which it begins to turn in [m].
        ends: Arc length at which it has turned in [m].
        middles: Arc lengths in [m] half way to the corner, stop or end before, and to that behind it.
        zone: Between which arc lengths in [m] no plane cuts.
        straight: Whether the leg behind it is straight.
    """

    point: FloatArray
    before: FloatArray
    behind: FloatArray
    begins: float
    ends: float
    middles: tuple[float, float]
    zone: tuple[float, float]
    straight: bool

    @property
    def anchors(self) -> tuple[float, ...]:
        """Arc lengths in [m] at which cycles are held together about it: half way to both sides, and itself.

        Without the last where the path goes back: no plane across it is crossed for sure.
        """
        if float(self.before @ self.behind) < np.cos(BACK):
            return self.middles
        return self.middles[0], (self.begins + self.ends) / 2.0, self.middles[1]


@dataclass(frozen=True, slots=True, eq=False)
class CommandLeg:
    """A straight leg with a constant commanded speed.

    Attributes:
        begins: Arc length at which its middle half begins in [m].
        ends: Arc length at which its middle half ends in [m].
        direction: Its direction [-], shape (3,).
        length: How long its middle half is in [m].
        speed: The commanded speed v_c in [m/s].
    """

    begins: float
    ends: float
    direction: FloatArray
    length: float
    speed: float


@dataclass(frozen=True, slots=True, eq=False)
class Stations:
    """Places along the command path, each with the plane normal to it.

    Attributes:
        s: Arc lengths in [m], shape (k,), rising.
        t: When the command is there in [s], shape (k,).
        point: Where that is in [m], shape (k, 3).
        normal: Direction of the path there [-], shape (k, 3).
    """

    s: FloatArray
    t: FloatArray
    point: FloatArray
    normal: FloatArray


class _Turn(NamedTuple):
    """Where the path turns: between which arc lengths in [m], and where its corner is, if that is known."""

    begins: float
    ends: float
    corner: FloatArray | None


class CommandPath:
    """The path of a command: its vertices where it moves, by arc length.

    Args:
        motion: The command.
        bends: Where it is known to turn; corners that are seen in its rows join them.
    """

    def __init__(self, motion: Motion, bends: Sequence[Bend] = ()) -> None:
        self.motion = motion
        self._rows = rows = apart_rows(motion.position, TREMBLE * motion.noise)
        self._place, self._arrives = motion.position[rows], motion.t[rows]
        step = np.diff(self._place, axis=0)
        length = np.linalg.norm(step, axis=1)
        self.s: FloatArray = np.concatenate(([0.0], np.cumsum(length)))
        self._direction: FloatArray = step / length[:, np.newaxis]
        self._leaves, self._stops = _leaving(motion, rows)
        self._pieces = list(self._straight_pieces())
        self.corners = self._corners(bends)
        self.legs = tuple(self._legs())

    @property
    def total(self) -> float:
        """Its length in [m]."""
        return float(self.s[-1])

    @property
    def position(self) -> FloatArray:
        """Its vertices in [m], shape (n, 3)."""
        return self._place

    def planes(self, count: int) -> Stations:
        """Return planes normal to the path, even in arc length over all that lies in no zone of a corner."""
        edges = [0.0, *(edge for one in self.corners for edge in one.zone), self.total]
        free = np.maximum(np.diff(np.maximum.accumulate(edges))[::2], 0.0)
        begins = np.maximum.accumulate(edges)[::2]
        along = (np.arange(count) + 0.5) / count * free.sum()
        ends = np.cumsum(free)
        which = np.minimum(np.searchsorted(ends, along, side="right"), len(free) - 1)
        return self.stations(begins[which] + along - (ends - free)[which])

    def stations(self, s: FloatArray) -> Stations:
        """Return the places at arc lengths in [m], shape (k,)."""
        piece = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self._direction) - 1)
        share = (s - self.s[piece]) / (self.s[piece + 1] - self.s[piece])
        t = self._leaves[piece] + share * (self._arrives[piece + 1] - self._leaves[piece])
        point = self._place[piece] + share[:, np.newaxis] * (self._place[piece + 1] - self._place[piece])
        return Stations(s, t, point, self._direction[piece])

    def speed(self, s: FloatArray) -> FloatArray:
        """Return the commanded speed at arc lengths in [m], in [m/s], both of shape (k,)."""
        piece = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self._direction) - 1)
        return np.asarray(self._speeds[piece])

    @property
    def _speeds(self) -> FloatArray:
        """Speed along each piece in [m/s], shape (n - 1,)."""
        return np.diff(self.s) / (self._arrives[1:] - self._leaves[:-1])

    def _corners(self, bends: Sequence[Bend]) -> tuple[CommandCorner, ...]:
        """Return all corners in order: those that are known, and those that its rows show elsewhere."""
        known = [self._bend(one) for one in bends]
        seen = [
            one
            for one in self._turns()
            if not any(other.begins <= one.ends and one.begins <= other.ends for other in known)
        ]
        every = sorted(known + seen, key=lambda one: one.begins)
        return tuple(self._corner(k, every) for k in range(len(every)))

    def _bend(self, one: Bend) -> _Turn:
        """Return between which arc lengths a known bend lies, and its corner."""
        begins, ends = np.interp([one.begins, one.ends], self._arrives, self.s).tolist()
        return _Turn(begins, ends, np.array(one.corner))

    def _turns(self) -> Iterator[_Turn]:
        """Yield between which arc lengths the direction turns as at a corner."""
        moving = np.concatenate(([0.0], np.cumsum(self._arrives[1:] - self._leaves[:-1])))
        count = len(self._direction)
        begin = np.arange(1, count)
        within = max(WITHIN, float(np.median(np.diff(self._arrives)))) + ROUNDING
        end = np.searchsorted(moving, moving[begin] + within, side="right") - 1
        end = np.clip(end, begin, count - 1)
        stops = np.concatenate(([0], np.cumsum(self._stops)))
        through = stops[end + 1] == stops[begin]  # without a stop in between
        cosine = np.einsum("ni,ni->n", self._direction[begin - 1], self._direction[end])
        found = np.flatnonzero(through & (cosine <= np.cos(CORNER) + 1e-12))
        while len(found):
            apart = (k for k in range(1, len(found)) if begin[found[k]] > end[found[k - 1]] + 1)
            last = next(apart, len(found))
            first, final = self._narrowed(int(begin[found[0]]), int(end[found[last - 1]]))
            yield _Turn(float(self.s[first]), float(self.s[final]), None)
            found = found[last:]

    def _narrowed(self, first: int, last: int) -> tuple[int, int]:
        """Return the first and the last of some vertices at which the path turns by a share of the whole."""
        vertex = np.arange(first, last + 1)
        cosine = np.einsum("ni,ni->n", self._direction[vertex - 1], self._direction[vertex])
        turn = np.arccos(np.clip(cosine, -1.0, 1.0))
        turning = vertex[turn >= SHARE * turn.sum()]
        return int(turning[0]), int(turning[-1])

    def _corner(self, number: int, every: Sequence[_Turn]) -> CommandCorner:
        """Return a corner among all of them."""
        begins, ends, point = every[number]
        edges = [edge for one in every for edge in (one.begins, one.ends)]
        bounds: FloatArray = np.unique([0.0, self.total, *self.s[self._stops].tolist(), *edges])
        start = float(bounds[int(np.searchsorted(bounds, begins)) - 1]) if begins > 0.0 else 0.0
        stop = float(bounds[min(int(np.searchsorted(bounds, ends, side="right")), len(bounds) - 1)])
        room = ZONE * min(begins - start, stop - ends)
        middles = (start + begins) / 2.0, (ends + stop) / 2.0
        before, _ = self._heading(middles[0], begins, at_end=True)
        behind, straight = self._heading(ends, middles[1], at_end=False)
        if point is None:
            point = _meeting(*self._ends(begins, before), *self._ends(ends, behind))
        zone = begins - room, ends + room
        return CommandCorner(point, before, behind, begins, ends, middles, zone, straight)

    def _ends(self, s: float, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the point at an arc length in [m], shape (3,), and a direction [-], shape (3,)."""
        return self.stations(np.array([s])).point[0], direction

    def _heading(self, first: float, last: float, *, at_end: bool) -> tuple[FloatArray, bool]:
        """Return the direction at an end of a stretch [-], shape (3,), and whether that is straight."""
        inside = self._place[(self.s >= first - LEAST) & (self.s <= last + LEAST)]
        chord = inside[-1] - inside[0] if len(inside) > 1 else np.zeros(3)
        length = float(np.linalg.norm(chord))
        if length > 0.0 and _off(inside, inside[0], chord / length) <= self._level:
            return chord / length, True
        piece = (
            np.searchsorted(self.s, last, side="left") if at_end else np.searchsorted(self.s, first, "right")
        )
        return self._direction[int(np.clip(piece - 1, 0, len(self._direction) - 1))], False

    @property
    def _coarse(self) -> float:
        """How far a straight piece may be from the path in [m]."""
        return max(STRAIGHT * self.motion.extent, 200.0 * self.motion.noise)

    @property
    def _level(self) -> float:
        """How far a leg may be from straight in [m]."""
        return max(LEVEL * self._coarse, 10.0 * self.motion.noise)

    def _straight_pieces(self) -> Iterator[tuple[int, int]]:
        """Yield the vertices at which straight pieces of the path begin and end, in order.

        A piece is parted at its furthest vertex until none is further away than `_coarse`; and at stops.
        """
        marks = [0, *np.flatnonzero(self._stops[1:-1]) + 1, len(self.s) - 1]
        waiting = list(pairwise(marks))[::-1]
        while waiting:
            first, last = waiting.pop()
            chord = self._place[last] - self._place[first]
            length = np.linalg.norm(chord)
            out = self._place[first + 1 : last] - self._place[first]
            if length > 0.0:
                along = np.clip(out @ chord / length**2, 0.0, 1.0)
                out = out - along[:, np.newaxis] * chord
            off = np.linalg.norm(out, axis=1)
            if last - first < 2 or off.max() <= self._coarse:
                yield int(first), int(last)
                continue
            middle = first + 1 + int(np.argmax(off))
            waiting += [(middle, last), (first, middle)]

    def _legs(self) -> Iterator[CommandLeg]:
        """Yield the straight legs whose middle half has a constant commanded speed."""
        speeds, shake = self.motion.speed, 10.0 * self.motion.speed_error
        for first, last in self._pieces:
            begins, ends = (self.s[first] + share * (self.s[last] - self.s[first]) for share in (0.25, 0.75))
            inside = np.flatnonzero((self.s[:-1] >= begins) & (self.s[1:] <= ends))
            if len(inside) < FEWEST:
                continue
            marks = self.stations(np.array([begins, ends]))
            chord = marks.point[1] - marks.point[0]
            length = float(np.linalg.norm(chord))
            direction = chord / length
            straight = _off(self._place[inside], marks.point[0], direction) <= self._level
            own = speeds[self._rows[inside[0]] : self._rows[inside[-1] + 1]]
            least, most = float(own.min()), float(own.max())
            if straight and shake <= TOLD * most and most - least <= STEADY * most + shake:
                duration = float(marks.t[1] - marks.t[0])
                yield CommandLeg(float(begins), float(ends), direction, length, length / duration)


def _leaving(motion: Motion, rows: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return when each vertex is left in [s], and whether the command stops there, shape (k,) both."""
    moves = np.append(np.flatnonzero(~motion.slow), len(motion) - 1)  # rows from which it moves on
    stays = np.minimum(moves[np.searchsorted(moves, rows)], np.append(rows[1:] - 1, len(motion) - 1))
    leaves = motion.t[np.maximum(stays, rows)]
    stops = np.zeros(len(rows), bool)
    for rest in motion.rests:
        stops[np.clip(np.searchsorted(rows, (rest.first + rest.last) // 2, side="right") - 1, 0, None)] = True
    return leaves, stops


def _off(places: FloatArray, start: FloatArray, direction: FloatArray) -> float:
    """Return how far places, shape (n, 3), are at most from a line, in [m]."""
    out = places - start
    out = out - np.outer(out @ direction, direction)
    return float(np.linalg.norm(out, axis=1).max(initial=0.0))


def _meeting(end: FloatArray, before: FloatArray, start: FloatArray, behind: FloatArray) -> FloatArray:
    """Return where two lines come nearest to each other, half way between, in [m], shape (3,).

    Of opposite directions: the point between the ends of both.
    """
    cosine = float(before @ behind)
    sine = 1.0 - cosine**2
    if sine < 1e-6:
        return np.asarray((end + start) / 2.0)
    gap = start - end
    first = (gap @ before - cosine * (gap @ behind)) / sine
    second = (cosine * (gap @ before) - gap @ behind) / sine
    return np.asarray((end + first * before + start + second * behind) / 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class Crossings:
    """Where a cycle crosses planes.

    Attributes:
        t: When in [s] on the cycle's own clock, shape (k,).
        point: Where in [m], shape (k, 3).
    """

    t: FloatArray
    point: FloatArray


def crossings(cycle: Motion, planes: Stations) -> Crossings | int:
    """Return where a cycle crosses planes, or the number of the first plane, from 0, that it does not reach.

    A plane is crossed in the direction of its normal, on the straight line between two rows. Of several
    crossings those are taken that follow each other in the order of the planes and are nearest to the command
    in all: a path that crosses itself or comes back keeps its planes.

    Args:
        cycle: The cycle.
        planes: Where the command path is cut.
    """
    stages: list[Stage] = []
    places: list[FloatArray] = []
    for point, normal in zip(planes.point, planes.normal, strict=True):
        height = (cycle.position - point) @ normal
        row = np.flatnonzero((height[:-1] < 0.0) & (height[1:] >= 0.0))
        share = height[row] / (height[row] - height[row + 1])
        place = cycle.position[row] + share[:, np.newaxis] * (cycle.position[row + 1] - cycle.position[row])
        t = cycle.t[row] + share * (cycle.t[row + 1] - cycle.t[row])
        stages.append((t, np.linalg.norm(place - point, axis=1)))
        places.append(place)
    chosen = in_order(stages)
    if isinstance(chosen, int):
        return chosen
    t = np.array([stage[0][k] for stage, k in zip(stages, chosen, strict=True)])
    return Crossings(t, np.array([place[k] for place, k in zip(places, chosen, strict=True)]).reshape(-1, 3))
