"""How alike two motions are at every offset between their clocks: the correlation of their rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.comparison.sync_views import View
from urmpipe_pipeline.runs.grid import interpolate

MOST = 1 << 17
"""Samples that the longer side is looked at in, so that a million stay quick: 40 ms apart in 1.5 hours."""

LEAST = 32
"""Samples that the shorter side keeps when the period is doubled."""

KEPT = 0.98
"""Doubling the period takes more than the rest of the energy of the rates from a motion with fewer than 22
samples a cycle, and from noise with 3 % of the energy (of white noise it leaves a quarter)."""

SHARE = 0.5
"""Share of the energy of one motion that must lie where both are: with less, a part of a motion looks like
many others, and two stretches of rest are alike."""

FLOOR = 1e-3
"""Unlikeness (1 - similarity) that lines between samples, rounding and noise may make of one motion."""

SEPARATE = 1.25
"""Between two peaks that count as two the unlikeness grows by this factor."""

NEAR = 0.1
"""A peak is looked at closely if it is less alike than the best by no more than this and twice over: between
two lags of the coarse stage a peak loses a few hundredths."""

MOST_PEAKS = 6
"""So many peaks are looked at closely, the highest."""


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Mean rates of both sides over periods of the same length, which holds the noise down.

    Attributes:
        period_ns: The period in integer [ns].
        reference_ns: The ends of the reference's periods in integer [ns], shape (n + 1,).
        reference: Rates in [rad/s] or [m/s], shape (n, k); NaN where a sample is missing.
        log_ns: The ends of the log's periods in integer [ns], shape (m + 1,).
        log: Rates in [rad/s] or [m/s], shape (m, k); NaN where a sample is missing.
    """

    period_ns: int
    reference_ns: IntArray
    reference: FloatArray
    log_ns: IntArray
    log: FloatArray


@dataclass(frozen=True, slots=True)
class Peak:
    """An offset at which two motions are more alike than beside it.

    Attributes:
        offset_ns: t_reference - t_log in integer [ns].
        similarity: How alike they are there, -1 to 1.
    """

    offset_ns: int
    similarity: float


def mean_rates(view: View) -> Rates | None:
    """Return the rates of both sides, over the shortest period that shows the motion and not the noise.

    Revolute and prismatic joints count alike at 1 rad/s and 1 m/s: an arm is about 1 m long. None if a side
    has fewer than three samples, or is too short for a period of the other.
    """
    sides = ((view.reference_ns, view.reference), (view.log_ns, view.log))
    if min(len(t_ns) for t_ns, _ in sides) < 3:
        return None
    spans = [int(t_ns[-1] - t_ns[0]) for t_ns, _ in sides]
    period = max(*(float(np.median(np.diff(t_ns))) for t_ns, _ in sides), max(spans) / MOST)
    if min(spans) < 2.0 * period:
        return None
    base = min(int(np.ceil(period)), min(spans) // 2)
    levels = max(int(np.log2(max(min(spans) / base / LEAST, 1.0))), 0)
    times = [np.arange(t_ns[0], t_ns[-1] + 1, base, dtype=np.int64) for t_ns, _ in sides]
    values = [interpolate(at, *side) for at, side in zip(times, sides, strict=True)]
    kept = [min(_kept(side, 1 << level) for side in values) for level in range(levels + 1)]
    stride = 1 << next((level for level, share in enumerate(kept) if share >= KEPT), int(np.argmax(kept)))
    reference_ns, log_ns = (side[::stride] for side in times)
    reference, log = (rates(side[::stride], base * stride) for side in values)
    return Rates(base * stride, reference_ns, reference, log_ns, log)


def rates(values: FloatArray, period_ns: int) -> FloatArray:
    """Return the mean rate between each value and the next, in [rad/s] or [m/s], shape (n - 1, k).

    Args:
        values: In [rad] or [m], shape (n, k).
        period_ns: Between two of them, in integer [ns].
    """
    return np.diff(values, axis=0) / (period_ns / 1e9)


def _kept(values: FloatArray, stride: int) -> float:
    """Return the share of the energy of the rates that is left when the period is doubled, at a stride."""
    single, double = (np.diff(values[::step], axis=0) / step for step in (stride, 2 * stride))
    energies = [np.nanmean(part**2) if np.isfinite(part).any() else 0.0 for part in (single, double)]
    return float(energies[1] / energies[0]) if energies[0] else 1.0


def similarity(reference: FloatArray, log: FloatArray, turned: bool) -> float:
    """Return how alike rates at the same times are: 2 sum(a b) / (sum(a a) + sum(b b)), -1 to 1.

    1 means the same rates; it is 0 for rates that have nothing to do with each other, and less than 1 also
    for the same motion done with another amplitude.

    Args:
        reference: Rates a in [rad/s] or [m/s], shape (n, k).
        log: Rates b in the same unit, shape (n, k).
        turned: Whether b is turned first, as is best for the similarity.

    Returns:
        The similarity; -1 where no sample has both, or nothing moves.
    """
    both = np.isfinite(reference).all(axis=1) & np.isfinite(log).all(axis=1)
    a, b = reference[both], log[both]
    energy = float((a * a).sum() + (b * b).sum())
    if not energy:
        return -1.0
    products = float(_turned_products((a.T @ b)[np.newaxis])[0]) if turned else float((a * b).sum())
    return min(2.0 * products / energy, 1.0)  # but for rounding


def peaks(found: Rates, turned: bool) -> list[Peak]:
    """Return the offsets at which two motions are most alike, the best first; their frames may be turned.

    The similarity of every offset comes from correlations by FFT; what is missing, or beyond an end, is
    masked. An offset counts where both sides together hold a good share of the motion of one.
    """
    likeness = _over_lags(found.reference, found.log, turned)
    tops = _separate_tops(likeness, 1.0 - 2.0 * (1.0 - likeness.max()) - NEAR)
    best = sorted(tops, key=lambda index: -likeness[index])[:MOST_PEAKS]
    zero = int(found.reference_ns[0] - found.log_ns[0]) - (len(found.log) - 1) * found.period_ns
    return [Peak(zero + index * found.period_ns, float(likeness[index])) for index in best]


def _separate_tops(likeness: FloatArray, least: float) -> list[int]:
    """Return where a curve has tops of at least so much; of those without a valley between, the highest."""
    unlike = 1.0 - np.concatenate(([-1.0], likeness, [-1.0])) + FLOOR
    rising = (unlike[1:-1] < unlike[:-2]) & (unlike[1:-1] <= unlike[2:])
    tops = np.flatnonzero(rising & (likeness >= max(least, 0.0)))
    valleys = np.maximum.reduceat(unlike[1:-1], tops) if len(tops) else unlike[:0]
    result: list[int] = []
    valley = np.inf
    for top, after in zip(tops.tolist(), valleys.tolist(), strict=True):
        if not result or valley > SEPARATE * max(unlike[1 + top], unlike[1 + result[-1]]):
            result.append(top)
        elif unlike[1 + top] < unlike[1 + result[-1]]:
            result[-1] = top
        else:
            valley = max(valley, after)
            continue
        valley = after
    return result


def _over_lags(a: FloatArray, b: FloatArray, turned: bool) -> FloatArray:
    """Return the similarity of a[i + lag] and b[i] for every lag from -(m - 1) to n - 1; -1 where too little.

    a and b are rates of shape (n, k) and (m, k); b may be turned first.
    """
    size = 1 << (len(a) + len(b) - 1).bit_length()
    there = [np.asarray(np.isfinite(side).all(axis=1)) for side in (a, b)]
    filled = [np.where(mask[:, np.newaxis], side, 0.0) for side, mask in zip((a, b), there, strict=True)]
    power = [(side**2).sum(axis=1) for side in filled]
    if not all(side.any() for side in power):
        return np.full(len(a) + len(b) - 1, -1.0)
    of_a, of_b = (np.fft.rfft(side, size, axis=0) for side in filled)
    masks = [np.fft.rfft(mask.astype(np.float64), size) for mask in there]
    powers = [np.fft.rfft(side, size) for side in power]

    def back(spectrum: NDArray[np.complex128]) -> FloatArray:
        """Return the correlation of a spectrum, by lag."""
        whole = np.fft.irfft(spectrum, size)
        return np.asarray(np.concatenate((whole[size - len(b) + 1 :], whole[: len(a)])))

    energy_a = back(powers[0] * masks[1].conj())
    energy_b = back(masks[0] * powers[1].conj())
    enough = (energy_a >= SHARE * power[0].sum()) | (energy_b >= SHARE * power[1].sum())
    if turned:
        crossed = [[back(of_a[:, i] * of_b[:, j].conj())[enough] for j in range(3)] for i in range(3)]
        products = _turned_products(np.moveaxis(np.array(crossed), 2, 0))
    else:
        products = back((of_a * of_b.conj()).sum(axis=1))[enough]
    result = np.full(len(enough), -1.0)
    result[enough] = 2.0 * products / (energy_a[enough] + energy_b[enough])
    return result


def _turned_products(crossed: FloatArray) -> FloatArray:
    """Return the largest sum of products a . R b over all rotations R: s1 + s2 + sign(det H) s3.

    H is sum(a b^T), shape (n, 3, 3).

    Source: Kabsch, W.: A solution for the best rotation to relate two sets of vectors, 1976.
    """
    sizes = np.linalg.svd(crossed, compute_uv=False)
    return np.asarray(sizes[:, 0] + sizes[:, 1] + np.sign(np.linalg.det(crossed)) * sizes[:, 2])
