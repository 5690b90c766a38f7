"""Laws of time along a path, s(t): phases of constant jerk, and swings with a constant total acceleration.

1. `Phase`, `TimeLaw`: s = s0 + v t + a t^2 / 2 + j t^3 / 6, or a swing on an arc, where
   s''^2 + (s'^2 / r)^2 = a^2 is the equation of a pendulum ([Dlmf]_ 22.19(i)).
2. `_split_at_stops`, `_max_boundary_speeds`: segments from stop to stop, each with its maximum speed, and the
   maximum speeds at their boundaries, by one pass forward and one pass back.
3. `trapezoid_law`: a maximum acceleration ([Iso9283]_ section 2, section 4 steps 11 to 13).
4. `jerk_law`: a maximum jerk too, by Ruckig ([BerscheidKroger2021]_, extra `planning`).

SciPy is imported where it is used: only swings and maximum jerks need it, and commands would wait for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.planning.path import LineArcPath

SWING_PARAMETER = 0.5  # m = k^2 of the elliptic functions of a swing [-]: k = sin(pi / 4)
ARRIVAL_TOLERANCE = 1e-12  # share of the path from the end of a phase, where s at rest does not define t
EQUAL_SHARE = math.sqrt(0.5)  # of a total acceleration, for s'' and s'^2 / r each on an arc next to a stop
LENGTH_MARGIN = 1e-9  # share of a segment that remains unused: Ruckig does not reach exact lengths

Arcs = Literal["tangential", "total"]
ARCS: tuple[Arcs, ...] = (
    "tangential",
    "total",
)  # limited on an arc: s'' alone, or sqrt(s''^2 + (s'^2 / r)^2)


@dataclass(frozen=True, slots=True, eq=False)
class PathMotion:
    """Arc length and its derivatives at several times.

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
    """A part of a law: s = s0 + v t + a t^2 / 2 + j t^3 / 6, or a swing.

    A swing passes an arc with the total acceleration that it has at rest: s''^2 + (s'^2 / r)^2 = a^2. With
    2 s / r as the angle it is a pendulum that is released with its thread level:
    s = s0 + r (asin(k sn(w)) - asin(k sn(w0))), k^2 = 1/2, w = w0 + sqrt(2 a / r) t. It accelerates while
    w < 0, and decelerates after that.

    Attributes:
        duration: In [s].
        s: At its begin in [m].
        v: s' there in [m/s]; for a swing it follows from `a`, `radius` and `w`.
        a: s'' there in [m/s2]; for a swing the total acceleration.
        j: s''' in [m/s3].
        radius: Of the arc of a swing in [m]; 0 for constant jerk.
        w: Phase w0 at the begin of a swing [-].

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
    """s(t) of a path, by consecutive phases.

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
        return _evaluate(self._table[k].T, t - (self.ends[k] - self._table[k, 0]))

    def time_at(self, s: FloatArray) -> FloatArray:
        """Return the first times at arc lengths in [m], shape (n,), in [s], shape (n,).

        Near a stop the time is known to sqrt(2 e / a), with e the rounding of s.
        """
        begin = self._table[:, 1]
        k = np.clip(np.searchsorted(begin, s, side="left") - 1, 0, None)
        total = _evaluate(self._table[-1:].T, self._table[-1:, 0]).s
        end = np.append(begin[1:], total)[k]
        phases = np.ascontiguousarray(self._table[k].T)
        low, high = np.zeros(len(s)), phases[0]
        for _ in range(60):  # bisection of a phase to the last bit: s(t) rises
            middle = 0.5 * (low + high)
            is_before = _evaluate(phases, middle).s < s
            low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
        is_end = s >= end - ARRIVAL_TOLERANCE * total
        times = np.where(is_end, self.ends[k], self.ends[k] - self._table[k, 0] + high)
        return np.where(s <= begin[0], 0.0, times)

    def scaled(self, factor: float) -> TimeLaw:
        """Return the same law with all speeds multiplied by a factor: t / f, f v, f^2 a, f^3 j."""
        scale = np.array([1.0 / factor, 1.0, factor, factor**2, factor**3, 1.0, 1.0])
        return TimeLaw([Phase(*row) for row in (self._table * scale).tolist()])


def _evaluate(phases: FloatArray, t: FloatArray) -> PathMotion:
    """Return the motion at times in [s], shape (n,), after the begin of their phases, shape (7, n)."""
    _, s, v, a, j, radius, w = phases
    motion = PathMotion(
        s + t * (v + t * (0.5 * a + t * j / 6.0)), v + t * (a + 0.5 * t * j), a + t * j, j.copy()
    )
    swings = radius > 0.0
    if swings.any():
        swing = _evaluate_swings(t[swings], s[swings], a[swings], radius[swings], w[swings])
        for values, part in zip((motion.s, motion.v, motion.a, motion.j), swing, strict=True):
            values[swings] = part
    return motion


def _evaluate_swings(
    t: FloatArray, s: FloatArray, a: FloatArray, radius: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return s, v, a and j of swings, all arrays of shape (n,).

    v = sqrt(a r) cn, its derivative -2 k a sn dn, and that one's -2 a cn^2 v / r.
    """
    from scipy.special import ellipj

    k = math.sqrt(SWING_PARAMETER)
    sn, cn, dn, _ = ellipj(w + np.sqrt(2.0 * a / radius) * t, SWING_PARAMETER)
    distance = radius * (np.arcsin(k * sn) - np.arcsin(k * ellipj(w, SWING_PARAMETER)[0]))
    v = np.sqrt(a * radius) * cn
    return s + distance, np.asarray(v), np.asarray(-2.0 * k * a * sn * dn), -2.0 * a * cn * cn * v / radius


def swing_phase(speed: FloatArray | float, a: float, radius: float) -> FloatArray:
    """Return w of an accelerating swing, -K to 0, at speeds v: cn(w) = v / sqrt(a r) [-], shape (n,).

    Args:
        speed: v in [m/s], shape (n,) or one, 0 to sqrt(a r).
        a: The total acceleration in [m/s2].
        radius: Of the arc in [m].

    Source: [Dlmf]_ 22.15 (inverse of cn).
    """
    from scipy.special import ellipkinc

    return np.asarray(-ellipkinc(np.arccos(np.minimum(speed / np.sqrt(a * radius), 1.0)), SWING_PARAMETER))


class SpeedSegment(NamedTuple):
    """A segment with a maximum speed.

    Attributes:
        length: In [m].
        radius: Of an arc on which s'^2 / r is limited too, in [m]; else infinity.
        max_speed: In [m/s].
    """

    length: float
    radius: float
    max_speed: float


def _split_at_stops(
    path: LineArcPath, velocity: float, acceleration: float, arcs: Arcs
) -> Iterator[list[SpeedSegment]]:
    """Yield the segments from each stop to the next.

    If s'' alone is limited, there is one from stop to stop; else each segment of the path is one, an arc with
    the maximum speed min(v, sqrt(a r)).
    """
    bounds = np.searchsorted(path.bounds, path.stops).tolist()  # a stop is a bound, to the last bit
    for first, last in pairwise(bounds):
        if arcs == "tangential":
            yield [SpeedSegment(float(path.bounds[last] - path.bounds[first]), math.inf, velocity)]
        else:
            pairs = zip(path.length[first:last].tolist(), path.radius[first:last].tolist(), strict=True)
            yield [SpeedSegment(length, r, min(velocity, math.sqrt(acceleration * r))) for length, r in pairs]


def _max_boundary_speeds(
    max_speeds: Sequence[float], reachable: Callable[[int, float], float]
) -> list[float]:
    """Return the maximum speeds at the boundaries of segments from stop to stop in [m/s], 0 at both ends.

    By one pass forward and one pass back: `reachable` gives the maximum speed at one end of a segment for its
    index and the speed at the other end.
    """
    speeds = [0.0, *(min(pair) for pair in pairwise(max_speeds)), 0.0]
    for k in range(1, len(max_speeds)):
        speeds[k] = min(speeds[k], reachable(k - 1, speeds[k - 1]))
    for k in range(len(max_speeds) - 1, 0, -1):
        speeds[k] = min(speeds[k], reachable(k, speeds[k + 1]))
    return speeds


def trapezoid_law(
    path: LineArcPath, velocity: float, acceleration: float, arcs: Arcs = "tangential"
) -> TimeLaw:
    """Return the fastest law along a path within a speed and an acceleration, at rest at its stops.

    With u = s'^2 a line allows |du/ds| <= 2 a. If the total acceleration is limited, an arc allows
    u = a r sin(p) with |dp/ds| <= 2 / r (a swing, see `Phase`), and u <= a r. Speeds at the boundaries of
    segments follow from one pass forward and one pass back; in between the law accelerates, keeps the maximum
    speed of the segment, and decelerates.

    Args:
        path: The path.
        velocity: Maximum s' in [m/s].
        acceleration: Maximum acceleration a in [m/s2]: of s'', or on arcs in total.
        arcs: "tangential" or "total".

    Source: [Iso9283]_ section 2 (an assumed pattern of movement), section 4 steps 11 to 13.
    """
    phases: list[Phase] = []
    begin = 0.0
    for segments in _split_at_stops(path, velocity, acceleration, arcs):

        def reachable(k: int, speed: float, segments: Sequence[SpeedSegment] = segments) -> float:
            return _reachable_speed(segments[k], speed, acceleration)

        speeds = _max_boundary_speeds([segment.max_speed for segment in segments], reachable)
        for segment, (entry, leave) in zip(segments, pairwise(speeds), strict=True):
            phases += segment_phases(segment, begin, entry, leave, acceleration)
            begin += segment.length
    return TimeLaw(phases)


def _reachable_speed(segment: SpeedSegment, speed: float, a: float) -> float:
    """Return the maximum speed in [m/s] at the end of a segment that begins with a speed."""
    if math.isinf(segment.radius):
        return min(segment.max_speed, math.sqrt(speed * speed + 2.0 * a * segment.length))
    largest = a * segment.radius
    angle = math.asin(min(speed * speed / largest, 1.0)) + 2.0 * segment.length / segment.radius
    return min(segment.max_speed, math.sqrt(largest * math.sin(min(angle, 0.5 * math.pi))))


def segment_phases(
    segment: SpeedSegment, begin: float, entry: float, leave: float, a: float
) -> Iterator[Phase]:
    """Yield the phases of the fastest passage of a segment: acceleration, constant speed, deceleration.

    Args:
        segment: The segment.
        begin: Arc length of its begin in [m].
        entry: s' there in [m/s].
        leave: s' at its end in [m/s]; one that the acceleration allows from `entry`.
        a: Maximum acceleration in [m/s2]: of s'', or on an arc in total.
    """
    rise = _line_peak if math.isinf(segment.radius) else _arc_peak
    peak, up, down = rise(segment, entry, leave, a)
    level = segment.length - up.s - down.s
    if up.duration > 0.0:
        yield up._replace(s=begin)
    if level > 0.0 and peak > 0.0:
        yield Phase(level / peak, begin + up.s, peak)
    if down.duration > 0.0:
        yield down._replace(s=begin + segment.length - down.s)


def _line_peak(segment: SpeedSegment, entry: float, leave: float, a: float) -> tuple[float, Phase, Phase]:
    """Return the maximum speed on a line, and the phases before and after it; `s` is their length."""
    peak = min(segment.max_speed, math.sqrt(0.5 * (entry * entry + leave * leave) + a * segment.length))
    peak = max(peak, entry, leave)
    up = Phase((peak - entry) / a, 0.5 * (peak + entry) * (peak - entry) / a, entry, a)
    return peak, up, Phase((peak - leave) / a, 0.5 * (peak + leave) * (peak - leave) / a, peak, -a)


def _arc_peak(segment: SpeedSegment, entry: float, leave: float, a: float) -> tuple[float, Phase, Phase]:
    """Return the same on an arc with a limited total acceleration."""
    radius, largest = segment.radius, a * segment.radius
    first, last, cap = (math.asin(min(v * v / largest, 1.0)) for v in (entry, leave, segment.max_speed))
    angle = max(min(cap, 0.5 * (first + last) + segment.length / radius), first, last)
    peak = math.sqrt(largest * math.sin(angle))
    rate = math.sqrt(2.0 * a / radius)
    begin, end, top = swing_phase(np.array([entry, leave, peak]), a, radius).tolist()
    up = Phase((top - begin) / rate, 0.5 * radius * (angle - first), 0.0, a, 0.0, radius, begin)
    return peak, up, Phase((top - end) / rate, 0.5 * radius * (angle - last), 0.0, a, 0.0, radius, -top)


def jerk_law(path: LineArcPath, velocity: float, acceleration: float, jerk: float, arcs: Arcs) -> TimeLaw:
    """Return the law along a path within a speed, an acceleration and a jerk of s, at rest at its stops.

    If the total acceleration is limited, an arc is passed at a constant speed, up to v^2 = a r, except next
    to a stop: there s'' and s'^2 / r are each limited to a / sqrt 2. The acceleration across the path still
    steps at the begin of an arc: the jerk is that of s.

    Args:
        path: The path.
        velocity: Maximum s' in [m/s].
        acceleration: Maximum s'' in [m/s2], or in total on arcs.
        jerk: Maximum s''' in [m/s3].
        arcs: "tangential" or "total".

    Raises:
        OptionError: If Ruckig is not installed, or finds no motion.

    Source: [BerscheidKroger2021]_ (Ruckig), which plans each segment.
    """
    phases: list[Phase] = []
    begin = 0.0
    for stretch in _split_at_stops(path, velocity, acceleration, arcs):
        segments = [*_limit_accelerations(stretch, acceleration)]

        def reachable(k: int, speed: float, segments: Sequence[_JerkSegment] = segments) -> float:
            return _reachable_speed_with_jerk(segments[k], speed, jerk)

        speeds = _max_boundary_speeds([segment.max_speed for segment in segments], reachable)
        for segment, (entry, leave) in zip(segments, pairwise(speeds), strict=True):
            phases += _ruckig_phases(segment, entry, leave, jerk, begin)
            begin += segment.length
    return TimeLaw(phases)


class _JerkSegment(NamedTuple):
    """A segment: its length [m], the maximum s'' [m/s2], 0 for a constant speed, and the maximum s' [m/s]."""

    length: float
    acceleration: float
    max_speed: float


def _limit_accelerations(segments: Sequence[SpeedSegment], acceleration: float) -> Iterator[_JerkSegment]:
    """Yield the segments from stop to stop with the maximum s'' of each."""
    lines = [k for k, segment in enumerate(segments) if math.isinf(segment.radius)]
    for k, segment in enumerate(segments):
        if math.isinf(segment.radius):
            yield _JerkSegment(segment.length, acceleration, segment.max_speed)
        elif lines and lines[0] < k < lines[-1]:
            yield _JerkSegment(segment.length, 0.0, segment.max_speed)
        else:
            max_speed = min(segment.max_speed, math.sqrt(EQUAL_SHARE * acceleration * segment.radius))
            yield _JerkSegment(segment.length, EQUAL_SHARE * acceleration, max_speed)


def _reachable_speed_with_jerk(segment: _JerkSegment, speed: float, jerk: float) -> float:
    """Return the maximum speed in [m/s] at the end of a segment that begins with one, s'' = 0 at both ends.

    From v0 to v1 it takes T = 2 sqrt((v1 - v0) / j), or (v1 - v0) / a + a / j where that reaches a, and
    a distance of T (v0 + v1) / 2.
    """
    from scipy.optimize import brentq

    a = segment.acceleration
    if a == 0.0 or speed >= segment.max_speed:
        return min(speed, segment.max_speed)

    def excess(end: float) -> float:
        """Return the distance in [m] of the change to a speed in [m/s] minus the length of the segment."""
        change = end - speed
        duration = 2.0 * math.sqrt(change / jerk) if change < a * a / jerk else change / a + a / jerk
        return 0.5 * (speed + end) * duration - (1.0 - LENGTH_MARGIN) * segment.length

    is_reached = excess(segment.max_speed) <= 0.0
    return segment.max_speed if is_reached else float(brentq(excess, speed, segment.max_speed))


def _ruckig_phases(
    segment: _JerkSegment, entry: float, leave: float, jerk: float, begin: float
) -> Iterator[Phase]:
    """Yield the phases of a segment that begins at an arc length in [m]."""
    if segment.acceleration == 0.0:
        yield Phase(segment.length / entry, begin, entry)
        return
    try:
        from ruckig import InputParameter, Result, Ruckig, Trajectory
    except ImportError:
        needs = "with ruckig: pip install urmpipe[planning]"
        raise OptionError(Finding(parameter="law", found="jerk without ruckig", allowed=needs)) from None
    request, trajectory = InputParameter(1), Trajectory(1)
    request.current_velocity, request.target_velocity = [entry], [leave]
    request.target_position, request.max_velocity = [segment.length], [segment.max_speed]
    request.max_acceleration, request.max_jerk = [segment.acceleration], [jerk]
    if Ruckig(1).calculate(request, trajectory) not in (Result.Working, Result.Finished):
        motion = f"{segment.length:g} m from {entry:g} to {leave:g} m/s with a jerk of {jerk:g} m/s3"
        raise OptionError(Finding(parameter="jerk", found=f"no motion over {motion}", allowed="another jerk"))
    profile = trajectory.profiles[0][0]
    for duration, s, v, a, j in zip(profile.t, profile.p, profile.v, profile.a, profile.j, strict=False):
        if duration > 0.0:
            yield Phase(duration, begin + s, v, a, j)
