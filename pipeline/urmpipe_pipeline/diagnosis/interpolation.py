"""A reference between its samples, where those of the log lie: by cubics, with the error that remains.

A comparison joins the samples of a reference by lines, which lie h^2 x'' / 8 from a curved motion. That is
part of a verdict, but it is no cause: causes are fitted to cubics through the same samples.

1. The rate at a sample is that of the polynomial of degree 4 through the five nearest ones: exact to h^4.
2. Two samples and their rates give a cubic (Hermite). It is local, and it may be used at uneven times.
3. The path of a log shows whether lines are nearer, as they are where the reference is a polygon.
4. Cubics through every second sample show how far cubics are from the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_pipeline.diagnosis.motion import STENCIL, Motion, five_point_rates
from urmpipe_pipeline.joint_log import has_gap_after
from urmpipe_pipeline.runs.grid import ROUNDING_NS
from urmpipe_pipeline.trajectories import Matched, Trajectory

MAX_NOISE_GAIN = 12.0  # rate times step: 0.95 at even times, 5.6 at an end; above, samples are too close
REFINEMENT = 4.0  # error at twice the step / error: 16 if smooth, 4 where the acceleration jumps
SHARPER = 1.0  # times the noise of a sample by which a motion is elsewhere on cubics
LOOKED_AT = 2000  # places between samples where that is measured
STRAIGHT = 0.5  # lines are taken if they leave less than this share of the mean square of cubics


class Interpolated(NamedTuple):
    """A reference at the rows of a log.

    Attributes:
        values: What causes are fitted to in [m] or [rad], shape (n, k).
        error: Root mean square error that interpolation leaves of each in [m] or [rad], shape (k,).
        between: Whether rows of the log lie between the samples of the reference.
    """

    values: FloatArray
    error: FloatArray
    between: bool


@dataclass(frozen=True, eq=False)
class Cubics:
    """A cubic between each two samples: ((c3 u + c2) u + c1) u + c0, u the time after the first of them.

    Attributes:
        t: Times of the samples in [s], shape (m,).
        coefficients: c0 to c3 in any unit per power of [s], shape (4, k, m - 1).
    """

    t: FloatArray
    coefficients: FloatArray

    @classmethod
    def through(cls, t_ns: IntArray, values: FloatArray, broken: IntArray | None = None) -> Cubics:
        """Return the cubics through samples; a line where these do not give a rate.

        Args:
            t_ns: Times in integer [ns], strictly increasing, shape (m,), m > 1.
            values: In any unit, shape (m, k).
            broken: Samples that no motion joins to the next one, shape (b,).
        """
        t, x, joined = t_ns / 1e9, np.ascontiguousarray(values.T), _joined(t_ns, broken)
        step = np.diff(t)
        secant = np.diff(x) / step
        rate, gain = five_point_rates(t, x, joined)
        known = np.where(joined, step, 0.0)
        longer = np.maximum(np.append(0.0, known), np.append(known, 0.0))
        rate[:, gain * longer > MAX_NOISE_GAIN] = np.nan
        first, last = (np.where(np.isfinite(part), part, secant) for part in (rate[:, :-1], rate[:, 1:]))
        curved = (first + last - 2.0 * secant) / step
        return cls(t, np.array([x[:, :-1], first, (secant - first) / step - curved, curved / step]))

    def at(self, t: FloatArray) -> FloatArray:
        """Return values at times in [s], shape (n,), in their unit, shape (k, n)."""
        before = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        u = t - self.t[before]
        c0, c1, c2, c3 = self.coefficients
        return np.asarray(((c3[:, before] * u + c2[:, before]) * u + c1[:, before]) * u + c0[:, before])


def _joined(t_ns: IntArray, broken: IntArray | None) -> BoolArray:
    """Return which samples a motion joins to the next one, shape (m - 1,)."""
    joined = ~has_gap_after(t_ns)
    joined[[] if broken is None else broken] = False
    return joined


@dataclass(frozen=True, eq=False, kw_only=True)
class SparseMotion(Motion):
    """A motion whose rows lie apart from the times that are looked up: its values are those of cubics.

    Attributes:
        cubics: Through its rows.
    """

    cubics: Cubics

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return value and its two derivatives at times in [s], shape (n,), and which lie within its own."""
        nearest, rate, second, inside = Motion.at(self, t)
        value = self.cubics.at(t)
        return np.where(np.isfinite(value), value, nearest), rate, second, inside


def with_cubics(motion: Motion, t_ns: IntArray, q: FloatArray) -> Motion:
    """Return a motion on cubics where its samples lie so far apart that this gains more than noise.

    Args:
        motion: The joints of a log.
        t_ns: Its times in integer [ns], shape (m,).
        q: Its joints in [rad] or [m], shape (m, joints).
    """
    if len(t_ns) < STENCIL + 1 or not np.isfinite(q).all():
        return motion
    some = slice(None, None, max(len(t_ns) // LOOKED_AT, 1))
    middle = (0.5 * (motion.t[:-1] + motion.t[1:]))[some]
    cubics = Cubics.through(t_ns, q)
    gained = np.sqrt(np.nanmean((cubics.at(middle) - motion.at(middle)[0]) ** 2, axis=1))
    noise = np.sqrt(
        np.mean(np.diff(q, STENCIL, axis=0) ** 2, axis=0) / 252.0
    )  # the sum of squares of its weights
    if not (gained > SHARPER * noise).any():
        return motion
    return SparseMotion(motion.t, motion.value, motion.rate, motion.second, motion.noise, cubics=cubics)


def interpolated(
    matched: Matched, reference: Trajectory, values: FloatArray, linear: FloatArray, log: FloatArray
) -> Interpolated:
    """Return a reference at the rows of a log, and the error of that.

    Args:
        matched: Both sides at the same times.
        reference: The reference at its own samples.
        values: What is interpolated of it in [m] or [rad], shape (m, k).
        linear: The same on lines in [m] or [rad], at the rows of the log, shape (n, k).
        log: The same of the log in [m] or [rad], shape (n, k).
    """
    known_ns, at_ns = reference.t_ns, matched.t_ns + round(matched.sync.offset * 1e9)
    none = Interpolated(linear, np.zeros(linear.shape[1]), False)
    if len(known_ns) < STENCIL:
        return none
    after = np.clip(np.searchsorted(known_ns, at_ns), 1, len(known_ns) - 1)
    away = np.minimum(*(np.abs(at_ns - known_ns[sample]) for sample in (after - 1, after)))
    share = float(np.mean(away > ROUNDING_NS))
    if not share:
        return none
    cubic = Cubics.through(known_ns, values, reference.broken).at(at_ns / 1e9).T
    cubic = np.where(np.isfinite(cubic), cubic, linear)
    on_lines, on_cubics = (_scatter(log - there, after) for there in (linear, cubic))
    if on_lines.sum() < STRAIGHT * on_cubics.sum():
        return Interpolated(linear, np.sqrt(on_lines), True)
    return Interpolated(cubic, np.sqrt(share) * _remaining(known_ns, values, reference.broken), True)


def _scatter(deviation: FloatArray, step: IntArray) -> FloatArray:
    """Return the mean square of deviations, shape (n, k), about their mean in each step, shape (k,)."""
    known = np.isfinite(deviation).all(axis=1)
    step, deviation = step[known], deviation[known]
    count = np.maximum(np.bincount(step), 1)
    means = np.array([np.bincount(step, column) / count for column in deviation.T]).T
    return np.asarray(((deviation - means[step]) ** 2).sum(axis=0) / max(len(step), 1))


def _remaining(t_ns: IntArray, values: FloatArray, broken: IntArray | None) -> FloatArray:
    """Return the root mean square error of cubics, shape (k,): a share of that at twice the step."""
    joined = _joined(t_ns, broken)
    left_out = 1 + 2 * np.flatnonzero(joined[:-1:2] & joined[1::2])
    steps = None if broken is None else broken[broken < 2 * (len(t_ns[::2]) - 1)] // 2
    off = Cubics.through(t_ns[::2], values[::2], steps).at(t_ns[left_out] / 1e9) - values[left_out].T
    off = off[:, np.isfinite(off).all(axis=0)]
    return np.asarray(np.sqrt((off**2).sum(axis=1) / max(off.shape[1], 1)) / REFINEMENT)
