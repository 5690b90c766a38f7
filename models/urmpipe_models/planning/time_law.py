"""How time runs along a path: phases of constant jerk, and swings at a constant total acceleration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from urmpipe_models.arrays import FloatArray

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

    def slower(self, factor: float) -> TimeLaw:
        """Return the same law with all speeds multiplied by a factor: t / f, f v, f^2 a, f^3 j."""
        scale = np.array([1.0 / factor, 1.0, factor, factor**2, factor**3, 1.0, 1.0])
        return TimeLaw([Phase(*row) for row in (self._table * scale).tolist()])


def swing_at(speed: FloatArray | float, a: float, radius: float) -> FloatArray:
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
