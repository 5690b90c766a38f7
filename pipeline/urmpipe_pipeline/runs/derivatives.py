"""Rates of joint values on a uniform grid: central differences, or smoothed where the log is quantised."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, row_blocks
from urmpipe_pipeline.runs.grid import inside_spans

Method = Literal["central", "savgol"]

WINDOW = 31
"""Samples of a smoothing window: 0.155 s at 5 ms. Four-digit angles (steps of 1 mrad) have second
differences of tens of rad/s2; a cubic over 31 samples brings this noise below 1 rad/s2."""

POLYNOMIAL = 3

AGREEMENT = 0.1
"""Recorded rates agree if they differ from the differences by less than this share of their rms ..."""

RESTING = 0.01
"""... or by less than this rms, in [rad/s] or [m/s]: a robot that stands still has rates of noise only."""


class MatchingUnit(NamedTuple):
    """The unit in which recorded derivatives would agree with the differences.

    Attributes:
        said: Which, behind "would agree".
        time: The unit that the times have then, where it is theirs.
    """

    said: str
    time: str | None = None


_OTHER_UNITS = {
    order: {
        **{
            10.0 ** (-k * order): MatchingUnit(f"with the time in {unit}", unit)
            for k, unit in ((3, "ms"), (6, "us"), (9, "ns"))
        },
        **{
            10.0 ** (k * order): MatchingUnit(f"with the time in s, not in {unit}", "s")
            for k, unit in ((3, "ms"), (6, "us"))
        },
        np.pi / 180.0: MatchingUnit("in deg"),
        180.0 / np.pi: MatchingUnit("with the joints in deg"),
    }
    for order in (1, 2)
}
"""By order of the derivative: the ratio of differences to what was recorded, and what makes it."""


def derivatives(
    q: FloatArray, tsp: float, method: Method = "central", broken: IntArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return q' and q'' on a uniform grid.

    central: q'_i = (q_{i+1} - q_{i-1}) / 2T, q''_i = (q_{i+1} - 2 q_i + q_{i-1}) / T^2, at the ends the
    three-point one-sided forms. savgol: those of the cubic fitted to 31 samples about each
    (Savitzky and Golay). A missing sample (NaN) leaves its neighbours without a derivative, and so
    does a step that is no motion: the difference across it is no speed, however large, and would be read as
    one.

    Args:
        q: Joint values in [rad] or [m], shape (g, joints).
        tsp: Sampling period T in [s].
        method: central or savgol.
        broken: First and last of some steps that are no motion, by the sample before the step, and joint
            index, shape (b, 3).

    Returns:
        Rates in [rad/s] or [m/s] and second derivatives in [rad/s2] or [m/s2], shape (g, joints); NaN
        where the log has too few samples for them.
    """
    count = len(q)
    if count < 3:
        return np.full_like(q, np.nan), np.full_like(q, np.nan)
    if method == "savgol" and count > POLYNOMIAL + 1:
        return _blanked(_smoothed(q, tsp), _window(count) // 2, broken)
    return _blanked(_central(q, tsp), 1, broken)


def effective_method(samples: int, method: Method) -> str:
    """Return the method that `derivatives` applies to so many samples; empty where they are too few."""
    if samples < 3:
        return ""
    return method if samples > POLYNOMIAL + 1 else "central"


def format_acceleration_source(derivative: str, samples: int) -> str:
    """Say what made the accelerations of so many samples; nothing where that is not known."""
    made = {"central": "central differences", "savgol": f"savgol over {_window(samples)} samples"}
    return f"Accelerations: {made.get(derivative, derivative)}." if derivative else ""


def _central(q: FloatArray, tsp: float) -> tuple[FloatArray, FloatArray]:
    """Return the central differences of three samples or more."""
    count = len(q)
    qd, qdd = np.empty_like(q), np.empty_like(q)
    for block in row_blocks(count - 2):  # in blocks, so that what is read again is still in the cache
        before, here, after = q[:-2][block], q[1:-1][block], q[2:][block]
        first, second = qd[1:-1][block], qdd[1:-1][block]
        np.subtract(after, before, out=first)
        first *= 0.5 / tsp
        np.subtract(after, here, out=second)
        second -= here
        second += before
        second *= 1.0 / (tsp * tsp)
    qd[0] = (-3.0 * q[0] + 4.0 * q[1] - q[2]) * (0.5 / tsp)
    qd[-1] = (3.0 * q[-1] - 4.0 * q[-2] + q[-3]) * (0.5 / tsp)
    qdd[0], qdd[-1] = qdd[1], qdd[-2]
    return qd, qdd


def _blanked(
    rates: tuple[FloatArray, FloatArray], reach: int, broken: IntArray | None
) -> tuple[FloatArray, FloatArray]:
    """Take out of q' and q'', in place, what is made of samples on both sides of a broken step.

    A derivative is made of so many samples to either side (`reach`); those at the ends share the first and
    the last whole window.
    """
    if broken is not None and len(broken):
        count, (first, last, joints) = len(rates[0]), broken.T
        start = np.where(first < 2 * reach, 0, first - reach + 1)
        end = np.where(last >= count - 1 - 2 * reach, count, last + reach + 1)
        mixed = inside_spans(start, end, joints, rates[0].shape)
        for values in rates:
            values[mixed] = np.nan
    return rates


def is_same_rate(recorded: FloatArray, computed: FloatArray) -> bool:
    """Tell whether recorded and computed rates in [rad/s] or [m/s], shape (g, joints), are the same."""
    both = np.isfinite(recorded) & np.isfinite(computed)
    if not both.any():
        return False
    error = float(np.sqrt(np.mean((recorded[both] - computed[both]) ** 2)))
    size = float(np.sqrt(np.mean(computed[both] ** 2)))
    return error <= max(AGREEMENT * size, RESTING)


def find_matching_unit(recorded: FloatArray, computed: FloatArray, order: int) -> MatchingUnit | None:
    """Return in which other unit recorded derivatives would agree with the differences; None if in none.

    Both are in [rad/s^order] or [m/s^order], shape (g, joints): rates of order 1, accelerations of order 2.
    """
    both = np.isfinite(recorded) & np.isfinite(computed)
    own, wanted = recorded[both], computed[both]
    if not own.any() or not wanted.any():
        return None
    ratio = float(own @ wanted / (own @ own))  # least squares
    if np.linalg.norm(wanted - ratio * own) > AGREEMENT * np.linalg.norm(wanted):
        return None
    near = [unit for factor, unit in _OTHER_UNITS[order].items() if abs(ratio / factor - 1.0) <= AGREEMENT]
    return near[0] if near else None


def _window(count: int) -> int:
    """Return the samples of a smoothing window over so many samples: an odd number."""
    return min(WINDOW, count - 1 + count % 2)


def _smoothed(q: FloatArray, tsp: float) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of the fitted cubic, NaN where the samples it is fitted to are not all there.

    The first and the last half window share the cubic of the first and the last whole one.
    """
    half = _window(len(q)) // 2
    x = np.linspace(-1.0, 1.0, 2 * half + 1)
    powers = np.vander(x, POLYNOMIAL + 1, increasing=True)
    fit = np.asarray(np.linalg.pinv(powers), dtype=np.float64)  # from samples to coefficients
    qd, qdd = np.empty_like(q), np.empty_like(q)
    for block in row_blocks(len(q) - 2 * half):
        window = q[block.start : block.stop + 2 * half]
        _fit_middles(window, fit, qd[half:-half][block], qdd[half:-half][block])
    ends = ((slice(half), q[: 2 * half + 1], x[:half]), (slice(-half, None), q[-2 * half - 1 :], x[-half:]))
    for end, samples, side in ends:
        _, c1, c2, c3 = fit @ samples
        at = side[:, None]
        qd[end] = c1 + 2.0 * c2 * at + 3.0 * c3 * at**2
        qdd[end] = 2.0 * c2 + 6.0 * c3 * at
    qd *= 1.0 / (half * tsp)
    qdd *= 1.0 / (half * tsp) ** 2
    return qd, qdd


def _fit_middles(q: FloatArray, fit: FloatArray, first: FloatArray, second: FloatArray) -> None:
    """Fill in the derivatives of the cubic in the middle of each window, over x.

    Samples before and after the middle weigh the same, with opposite sign in the first derivative.

    Args:
        q: Samples, shape (m + 2 half, joints).
        fit: From the samples of a window to the coefficients of the cubic, shape (4, 2 half + 1).
        first: First derivatives, shape (m, joints).
        second: Second derivatives, shape (m, joints).
    """
    count, half = len(first), fit.shape[1] // 2
    middle = q[half : half + count]
    np.multiply(middle, 0.0, out=first)  # which is NaN where the middle is missing
    np.multiply(middle, 2.0 * fit[2, half], out=second)
    pair = np.empty_like(first)
    for k in range(1, half + 1):
        before, after = q[half - k : half - k + count], q[half + k : half + k + count]
        np.subtract(after, before, out=pair)
        pair *= fit[1, half + k]
        first += pair
        np.add(after, before, out=pair)
        pair *= 2.0 * fit[2, half + k]
        second += pair
