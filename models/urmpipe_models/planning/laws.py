"""How time runs along a path: phases of constant jerk, and swings at a constant total acceleration.

A path from stop to stop: pieces, each with the largest speed along it, and the speeds where they meet.

The law with a largest acceleration: up to the largest speed, on with it, and down, from stop to stop.

The law with a largest jerk, by Ruckig, from stop to stop (extra `planning`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple, Protocol, TypeVar

import numpy as np
from scipy.optimize import brentq

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.planning.path import LineArcPath

HALF = 0.5
"""m = k^2 of the elliptic functions of a swing [-]: let go a quarter turn above rest, k = sin(pi / 4)."""

MET = 1e-12
"""Within this share of the whole way of its end a phase is over: where it comes to rest, s tells no time."""


@dataclass(frozen=True, slots=True, eq=False)
class PathMotion:
    """Where along a path, and how it goes on.

    Attributes:
        s: Arc length in [m], shape (n,).
        v: s' in [m/s], shape (n,).
        a: s'' in [m/s2], shape (n,).
        j: s''' in [m/s3], shape (n,).
    """

    s: FloatArray
    v: FloatArray
    a: FloatArray
    j: FloatArray


class Phase(NamedTuple):
    """A stretch of time: s = s0 + v t + a t^2 / 2 + j t^3 / 6, or a swing.

    A swing goes through an arc so that the total acceleration stays what it is at rest:
    s''^2 + (s'^2 / r)^2 = a^2. With 2 s / r as the angle it is a pendulum that was let go with its thread
    level: s = s0 + r (asin(k sn(w)) - asin(k sn(w0))), k^2 = 1/2, w = w0 + sqrt(2 a / r) t. It speeds up
    where w < 0, and slows down after that.

    Attributes:
        duration: In [s].
        s: Where it begins in [m].
        v: s' there in [m/s]; a swing has it from `a`, `radius` and `w`.
        a: s'' there in [m/s2]; of a swing the total acceleration.
        j: s''' in [m/s3].
        radius: Of the arc of a swing in [m]; 0 for constant jerk.
        w: Where a swing begins, w0 [-].

    Source: [Dlmf]_ 22.19(i) (the pendulum).
    """

    duration: float
    s: float
    v: float = 0.0
    a: float = 0.0
    j: float = 0.0
    radius: float = 0.0
    w: float = 0.0


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """s(t) of a path, by phases one after the other.

    Attributes:
        phases: At least one.
    """

    phases: Sequence[Phase]

    @cached_property
    def _table(self) -> FloatArray:
        return np.array(self.phases, dtype=float).reshape(len(self.phases), 7)

    @cached_property
    def ends(self) -> FloatArray:
        """Times at which the phases end in [s], shape (m,)."""
        return np.cumsum(self._table[:, 0])

    @property
    def duration(self) -> float:
        """In [s]."""
        return float(self.ends[-1])

    def at(self, t: FloatArray) -> PathMotion:
        """Return the motion at times in [s], shape (n,), 0 to the duration; of two phases the later."""
        k = np.minimum(np.searchsorted(self.ends, t, side="right"), len(self.phases) - 1)
        since = t - (self.ends[k] - self._table[k, 0])
        return _within(self._table[k].T, since)

    def time_at(self, s: FloatArray) -> FloatArray:
        """Return when the motion is at arc lengths in [m], shape (n,), in [s], shape (n,); the first time.

        Near a stop the time is known to sqrt(2 e / a), with e the rounding of s.
        """
        begin = self._table[:, 1]
        k = np.clip(np.searchsorted(begin, s, side="left") - 1, 0, None)
        whole = _within(self._table[-1:].T, self._table[-1:, 0]).s
        last = np.append(begin[1:], whole)[k]
        phases = np.ascontiguousarray(self._table[k].T)
        low, high = np.zeros(len(s)), phases[0]
        for _ in range(60):  # halves of a phase down to the last bit: s(t) rises
            middle = 0.5 * (low + high)
            before = _within(phases, middle).s < s
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        found = np.where(s >= last - MET * whole, self.ends[k], self.ends[k] - self._table[k, 0] + high)
        return np.where(s <= begin[0], 0.0, found)

    def scaled(self, factor: float) -> TimeLaw:
        """Return the same law with all speeds multiplied by a factor: t / f, f v, f^2 a, f^3 j."""
        scale = np.array([1.0 / factor, 1.0, factor, factor**2, factor**3, 1.0, 1.0])
        return TimeLaw([Phase(*row) for row in (self._table * scale).tolist()])


def swing_phase(speed: FloatArray | float, a: float, radius: float) -> FloatArray:
    """Return w of a swing that speeds up, -K to 0, at speeds v: cn(w) = v / sqrt(a r) [-], shape (n,).

    Args:
        speed: v in [m/s], shape (n,) or one, 0 to sqrt(a r).
        a: The total acceleration in [m/s2].
        radius: Of the arc in [m].

    Source: [Dlmf]_ 22.15 (inverse of cn).
    """
    from scipy.special import ellipkinc  # a tenth of a second, which every command would wait for

    return np.asarray(-ellipkinc(np.arccos(np.minimum(speed / np.sqrt(a * radius), 1.0)), HALF))


def _within(phases: FloatArray, t: FloatArray) -> PathMotion:
    """Return the motion at times in [s], shape (n,), since their phases, shape (7, n), began."""
    _, s, v, a, j, radius, w = phases
    found = PathMotion(
        s + t * (v + t * (0.5 * a + t * j / 6.0)), v + t * (a + 0.5 * t * j), a + t * j, j.copy()
    )
    swings = radius > 0.0
    if swings.any():
        swung = _swing(t[swings], s[swings], a[swings], radius[swings], w[swings])
        for values, own in zip((found.s, found.v, found.a, found.j), swung, strict=True):
            values[swings] = own
    return found


def _swing(
    t: FloatArray, s: FloatArray, a: FloatArray, radius: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the motion of swings, of which each value has shape (n,).

    v = sqrt(a r) cn, its derivative -2 k a sn dn, and that one's -2 a cn^2 v / r.
    """
    from scipy.special import ellipj  # a tenth of a second, which every command would wait for

    k = math.sqrt(HALF)
    sn, cn, dn, _ = ellipj(w + np.sqrt(2.0 * a / radius) * t, HALF)
    way = radius * (np.arcsin(k * sn) - np.arcsin(k * ellipj(w, HALF)[0]))
    v = np.sqrt(a * radius) * cn
    return s + way, np.asarray(v), np.asarray(-2.0 * k * a * sn * dn), -2.0 * a * cn * cn * v / radius


Arcs = Literal["tangential", "total"]
ARCS: tuple[Arcs, ...] = ("tangential", "total")
"""What a largest acceleration holds on an arc: s'' alone, or sqrt(s''^2 + (s'^2 / r)^2)."""


class SpeedSegment(NamedTuple):
    """A piece of a stretch.

    Attributes:
        length: In [m].
        radius: Of an arc along which s'^2 / r counts, in [m]; infinity where it does not.
        fastest: The largest speed along it in [m/s].
    """

    length: float
    radius: float
    fastest: float


def split_at_stops(
    path: LineArcPath, velocity: float, acceleration: float, arcs: Arcs
) -> Iterator[list[SpeedSegment]]:
    """Yield the pieces from each stop to the next.

    Where s'' alone is held all of a stretch is one piece; else each segment is one, an arc with the largest
    speed min(v, sqrt(a r)).

    Args:
        path: The path.
        velocity: v in [m/s].
        acceleration: a in [m/s2].
        arcs: What it holds on an arc.
    """
    bounds = np.searchsorted(path.bounds, path.stops).tolist()  # a stop is a bound, to the last bit
    for first, last in pairwise(bounds):
        if arcs == "tangential":
            yield [SpeedSegment(float(path.bounds[last] - path.bounds[first]), math.inf, velocity)]
        else:
            own = zip(path.length[first:last].tolist(), path.radius[first:last].tolist(), strict=True)
            yield [SpeedSegment(length, r, min(velocity, math.sqrt(acceleration * r))) for length, r in own]


class _Limited(Protocol):
    """What has a largest speed in [m/s]."""

    @property
    def fastest(self) -> float:
        """The largest s' in [m/s]."""


AnyPiece = TypeVar("AnyPiece", bound=_Limited)


def max_boundary_speeds(
    pieces: Sequence[AnyPiece], reached: Callable[[AnyPiece, float], float]
) -> list[float]:
    """Return the largest speeds in [m/s] where pieces begin, and where the last one ends, 0 at both ends.

    By one pass along the pieces, and one back.

    Args:
        pieces: From one stop to the next.
        reached: Of a piece and the speed in [m/s] at one of its ends, the largest at the other one.
    """
    found = [0.0, *(min(before.fastest, after.fastest) for before, after in pairwise(pieces)), 0.0]
    for k in range(1, len(pieces)):
        found[k] = min(found[k], reached(pieces[k - 1], found[k - 1]))
    for k in range(len(pieces) - 1, 0, -1):
        found[k] = min(found[k], reached(pieces[k], found[k + 1]))
    return found


def trapezoid_law(
    path: LineArcPath, velocity: float, acceleration: float, arcs: Arcs = "tangential"
) -> TimeLaw:
    """Return the fastest law along a path within a speed and an acceleration, at rest at its stops.

    With u = s'^2 a line allows |du/ds| <= 2 a. Where the total acceleration is held an arc allows
    u = a r sin(p) with |dp/ds| <= 2 / r (a swing, see `time_law.Phase`), and u <= a r. Speeds where pieces
    meet follow from one pass along the path and one back; in between it speeds up, keeps the largest speed
    of the piece, and slows down.

    Args:
        path: The path.
        velocity: The largest s' in [m/s].
        acceleration: The largest acceleration a in [m/s2]: of s'', or on arcs in total.
        arcs: "tangential" or "total".

    Source: [Iso9283]_ section 2 (an assumed pattern of movement), section 4 steps 11 to 13.
    """
    phases: list[Phase] = []
    begin = 0.0
    for pieces in split_at_stops(path, velocity, acceleration, arcs):
        met = max_boundary_speeds(pieces, lambda piece, speed: _reached(piece, speed, acceleration))
        for piece, (entry, leave) in zip(pieces, pairwise(met), strict=True):
            phases += piece_phases(piece, begin, entry, leave, acceleration)
            begin += piece.length
    return TimeLaw(phases)


def _reached(piece: SpeedSegment, speed: float, a: float) -> float:
    """Return the largest speed in [m/s] at the end of a piece that begins with one."""
    if math.isinf(piece.radius):
        return min(piece.fastest, math.sqrt(speed * speed + 2.0 * a * piece.length))
    most = a * piece.radius
    angle = math.asin(min(speed * speed / most, 1.0)) + 2.0 * piece.length / piece.radius
    return min(piece.fastest, math.sqrt(most * math.sin(min(angle, 0.5 * math.pi))))


def piece_phases(piece: SpeedSegment, begin: float, entry: float, leave: float, a: float) -> Iterator[Phase]:
    """Yield how a piece is passed in the least time: faster, on, slower; none of no duration.

    Args:
        piece: The piece.
        begin: Where it begins along the path in [m].
        entry: s' there in [m/s].
        leave: s' at its end in [m/s]; one that the acceleration allows from `entry`.
        a: The largest acceleration in [m/s2]: of s'', or on an arc in total.
    """
    rise = _line_rise if math.isinf(piece.radius) else _arc_rise
    peak, up, down = rise(piece, entry, leave, a)
    level = piece.length - up.s - down.s
    if up.duration > 0.0:
        yield up._replace(s=begin)
    if level > 0.0 and peak > 0.0:
        yield Phase(level / peak, begin + up.s, peak)
    if down.duration > 0.0:
        yield down._replace(s=begin + piece.length - down.s)


def _line_rise(piece: SpeedSegment, entry: float, leave: float, a: float) -> tuple[float, Phase, Phase]:
    """Return the largest speed along a line, and how it is reached and left; `s` is their way."""
    peak = min(piece.fastest, math.sqrt(0.5 * (entry * entry + leave * leave) + a * piece.length))
    peak = max(peak, entry, leave)
    up = Phase((peak - entry) / a, 0.5 * (peak + entry) * (peak - entry) / a, entry, a)
    return peak, up, Phase((peak - leave) / a, 0.5 * (peak + leave) * (peak - leave) / a, peak, -a)


def _arc_rise(piece: SpeedSegment, entry: float, leave: float, a: float) -> tuple[float, Phase, Phase]:
    """Return the same of an arc along which the total acceleration is held."""
    radius, most = piece.radius, a * piece.radius
    first, last, cap = (math.asin(min(v * v / most, 1.0)) for v in (entry, leave, piece.fastest))
    angle = max(min(cap, 0.5 * (first + last) + piece.length / radius), first, last)
    peak = math.sqrt(most * math.sin(angle))
    rate = math.sqrt(2.0 * a / radius)
    begin, end, top = swing_phase(np.array([entry, leave, peak]), a, radius).tolist()
    up = Phase((top - begin) / rate, 0.5 * radius * (angle - first), 0.0, a, 0.0, radius, begin)
    return peak, up, Phase((top - end) / rate, 0.5 * radius * (angle - last), 0.0, a, 0.0, radius, -top)


EQUAL_SHARE = math.sqrt(0.5)
"""Of a total acceleration: so much s'' and s'^2 / r each may have on an arc that begins or ends at rest."""

SPARE_LENGTH = 1e-9
"""Of a piece, this share stays free where speeds meet: Ruckig finds no motion that fits to the last bit."""


def jerk_law(path: LineArcPath, velocity: float, acceleration: float, jerk: float, arcs: Arcs) -> TimeLaw:
    """Return the law along a path within a speed, an acceleration and a jerk of s, at rest at its stops.

    Where the total acceleration is held, an arc is run at a constant speed, up to v^2 = a r. Arcs next to a
    stop cannot be: there s'' and s'^2 / r are each held to a / sqrt 2. The acceleration across the path still
    steps where an arc begins: the jerk is that of s.

    Args:
        path: The path.
        velocity: The largest s' in [m/s].
        acceleration: The largest s'' in [m/s2], or in total on arcs.
        jerk: The largest s''' in [m/s3].
        arcs: "tangential" or "total".

    Raises:
        OptionError: If Ruckig is not installed, or finds no motion.

    Source: [BerscheidKroger2021]_ (Ruckig), which plans each piece.
    """
    phases: list[Phase] = []
    begin = 0.0
    for stretch in split_at_stops(path, velocity, acceleration, arcs):
        pieces = [*_held(stretch, acceleration)]
        met = max_boundary_speeds(pieces, lambda piece, speed: _reached_jerk(piece, speed, jerk))
        for piece, (entry, leave) in zip(pieces, pairwise(met), strict=True):
            phases += _planned(piece, entry, leave, jerk, begin)
            begin += piece.length
    return TimeLaw(phases)


class _Piece(NamedTuple):
    """A piece of a stretch: its length [m], the largest s'' [m/s2], 0 for a constant speed, and s' [m/s]."""

    length: float
    acceleration: float
    fastest: float


def _held(stretch: Sequence[SpeedSegment], acceleration: float) -> Iterator[_Piece]:
    """Yield the pieces of a stretch with the s'' that each may have."""
    lines = [k for k, piece in enumerate(stretch) if math.isinf(piece.radius)]
    for k, piece in enumerate(stretch):
        if math.isinf(piece.radius):
            yield _Piece(piece.length, acceleration, piece.fastest)
        elif lines and lines[0] < k < lines[-1]:
            yield _Piece(piece.length, 0.0, piece.fastest)
        else:
            fastest = min(piece.fastest, math.sqrt(EQUAL_SHARE * acceleration * piece.radius))
            yield _Piece(piece.length, EQUAL_SHARE * acceleration, fastest)


def _reached_jerk(piece: _Piece, speed: float, jerk: float) -> float:
    """Return the largest speed in [m/s] at the end of a piece that begins with one, s'' = 0 at both ends.

    From v0 to v1 it takes T = 2 sqrt((v1 - v0) / j), or (v1 - v0) / a + a / j where that reaches a, and
    T (v0 + v1) / 2 of way.
    """
    a = piece.acceleration
    if a == 0.0 or speed >= piece.fastest:
        return min(speed, piece.fastest)

    def beyond(end: float) -> float:
        """Return how far in [m] the change to a speed in [m/s] leads beyond the piece."""
        change = end - speed
        duration = 2.0 * math.sqrt(change / jerk) if change < a * a / jerk else change / a + a / jerk
        return 0.5 * (speed + end) * duration - (1.0 - SPARE_LENGTH) * piece.length

    return piece.fastest if beyond(piece.fastest) <= 0.0 else float(brentq(beyond, speed, piece.fastest))


def _planned(piece: _Piece, entry: float, leave: float, jerk: float, begin: float) -> Iterator[Phase]:
    """Yield how a piece that begins at an arc length in [m] is passed."""
    if piece.acceleration == 0.0:
        yield Phase(piece.length / entry, begin, entry)
        return
    try:
        from ruckig import InputParameter, Result, Ruckig, Trajectory
    except ImportError:
        needs = "with ruckig: pip install urmpipe[planning]"
        raise OptionError(Finding(parameter="law", found="jerk without ruckig", allowed=needs)) from None
    given, found = InputParameter(1), Trajectory(1)
    given.current_velocity, given.target_velocity, given.target_position = [entry], [leave], [piece.length]
    given.max_velocity, given.max_acceleration = [piece.fastest], [piece.acceleration]
    given.max_jerk = [jerk]
    if Ruckig(1).calculate(given, found) not in (Result.Working, Result.Finished):
        motion = f"{piece.length:g} m from {entry:g} to {leave:g} m/s with a jerk of {jerk:g} m/s3"
        raise OptionError(Finding(parameter="jerk", found=f"no motion over {motion}", allowed="another jerk"))
    profile = found.profiles[0][0]
    for duration, s, v, a, j in zip(profile.t, profile.p, profile.v, profile.a, profile.j, strict=False):
        if duration > 0.0:
            yield Phase(duration, begin + s, v, a, j)
