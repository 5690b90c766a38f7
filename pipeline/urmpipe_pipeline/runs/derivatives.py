"""Joint velocities and accelerations on the uniform grid.

- `derivatives`: central differences, or the smoothing of Savitzky and Golay for quantised logs.
- `log_derivatives`: those of a log: the recorded ones where they agree with the differences, else a warning
  with the unit in which they would agree.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, row_blocks
from urmpipe_models.errors import Hint
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.runs.grid import Grid, mark_spans

Method = Literal["central", "savgol"]

WINDOW = 31  # samples (0.155 s at 5 ms): smooths second differences of angles in 1 mrad steps below 1 rad/s2
POLYNOMIAL = 3
QUANTISED_DIGITS = 5  # joint values with this many significant digits or fewer are smoothed
AGREEMENT = 0.1  # recorded rates differ by less than this share of the rms of the differences ...
RESTING = 0.01  # ... or by less than this rms, in [rad/s] or [m/s]: rates of a robot at rest are noise


class MatchingUnit(NamedTuple):
    """The unit in which recorded derivatives would agree with the differences.

    Attributes:
        text: The end of a sentence, after "would agree".
        time: The unit of the times, where the times are in another unit.
    """

    text: str
    time: str | None = None


# Per order of the derivative: the ratio of the differences to the recorded values, and its cause.
_MATCHING_UNITS = {
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


class LogDerivatives(NamedTuple):
    """Velocities and accelerations of a log on its grid.

    Attributes:
        qd: Joint velocities in [rad/s] or [m/s], shape (g, joints).
        qdd: Joint accelerations in [rad/s2] or [m/s2], shape (g, joints).
        source: What the accelerations are: central, savgol or recorded; empty without any.
        warnings: Recorded derivatives that were not used.
    """

    qd: FloatArray
    qdd: FloatArray
    source: str
    warnings: tuple[LogWarning, ...]


def log_derivatives(
    log: JointLog, grid: Grid, q: FloatArray, method: Method | None, broken: IntArray
) -> LogDerivatives:
    """Return the derivatives of a log: recorded ones where they agree with the differences.

    Fewer than three samples have no differences that could contradict the recorded values.

    Args:
        log: The log.
        grid: Its grid.
        q: Joint values on the grid in [rad] or [m], shape (g, joints).
        method: central or savgol; None for savgol if the values are quantised, else central.
        broken: Grid steps that are no motion, as in `derivatives`, shape (b, 3).
    """
    is_quantised = log.digits is not None and 0 < log.digits <= QUANTISED_DIGITS
    method = method or ("savgol" if is_quantised else "central")
    differences = derivatives(q, grid.tsp, method, broken)
    results, warnings = list(differences), []
    for k, (recorded, name) in enumerate(((log.qd, "rates"), (log.qdd, "accelerations"))):
        if recorded is None:
            continue
        on_grid = grid.resample(recorded)
        if len(q) < 3 or is_same_rate(on_grid, differences[k]):
            results[k] = on_grid
            continue
        message = f"the recorded {name} do not agree with the differences of the joint values"
        hints = []
        if unit := find_matching_unit(on_grid, differences[k], k + 1):
            message += f", but would {unit.text}"
            clocks = [column.name for column in log.columns if column.role == "time"]
            hints = [Hint("unit", {name: unit.time}, "applies this") for name in clocks[:1] if unit.time]
        message += "; the differences are used"
        warnings.append(LogWarning(f"recorded-{name}", message, hints=tuple(hints)))
    qd, qdd = results
    source = "recorded"
    if qdd is differences[1]:
        source = "" if len(q) < 3 else "central" if len(q) <= POLYNOMIAL + 1 else method
    return LogDerivatives(qd, qdd, source, tuple(warnings))


def derivatives(
    q: FloatArray, tsp: float, method: Method = "central", broken: IntArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return q' and q'' on a uniform grid.

    central: q'_i = (q_{i+1} - q_{i-1}) / 2T, q''_i = (q_{i+1} - 2 q_i + q_{i-1}) / T^2, at the ends the
    three-point one-sided forms. savgol: derivatives of the cubic fitted to 31 samples around each sample
    (Savitzky and Golay). Derivatives are NaN next to a missing sample (NaN) and across a step that is no
    motion: its difference is not a velocity.

    Args:
        q: Joint values in [rad] or [m], shape (g, joints).
        tsp: Sampling period T in [s].
        method: central or savgol.
        broken: Sample before the first step and before the last step that are no motion, and joint index,
            shape (b, 3).

    Returns:
        Velocities in [rad/s] or [m/s] and accelerations in [rad/s2] or [m/s2], shape (g, joints); NaN if
        there are fewer than three samples.
    """
    count = len(q)
    if count < 3:
        return np.full_like(q, np.nan), np.full_like(q, np.nan)
    if method == "savgol" and count > POLYNOMIAL + 1:
        return _blanked(_smoothed(q, tsp), _window(count) // 2, broken)
    return _blanked(_central(q, tsp), 1, broken)


def format_acceleration_source(derivative: str, samples: int) -> str:
    """Return the sentence on the source of the accelerations of a run; empty where it is not known."""
    sources = {"central": "central differences", "savgol": f"savgol over {_window(samples)} samples"}
    return f"Accelerations: {sources.get(derivative, derivative)}." if derivative else ""


def _central(q: FloatArray, tsp: float) -> tuple[FloatArray, FloatArray]:
    count = len(q)
    qd, qdd = np.empty_like(q), np.empty_like(q)
    for block in row_blocks(count - 2):  # in blocks that stay in the cache
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
    """Set to NaN, in place, the derivatives that use samples on both sides of a broken step.

    A derivative uses `reach` samples to either side; at the ends it uses the first or the last full window.
    """
    if broken is not None and len(broken):
        count, (first, last, joints) = len(rates[0]), broken.T
        start = np.where(first < 2 * reach, 0, first - reach + 1)
        end = np.where(last >= count - 1 - 2 * reach, count, last + reach + 1)
        mixed = mark_spans(start, end, joints, rates[0].shape)
        for values in rates:
            values[mixed] = np.nan
    return rates


def is_same_rate(recorded: FloatArray, computed: FloatArray) -> bool:
    """Return whether recorded and computed rates in [rad/s] or [m/s], shape (g, joints), agree."""
    both = np.isfinite(recorded) & np.isfinite(computed)
    if not both.any():
        return False
    error = float(np.sqrt(np.mean((recorded[both] - computed[both]) ** 2)))
    size = float(np.sqrt(np.mean(computed[both] ** 2)))
    return error <= max(AGREEMENT * size, RESTING)


def find_matching_unit(recorded: FloatArray, computed: FloatArray, order: int) -> MatchingUnit | None:
    """Return the unit in which recorded derivatives would agree with the differences; None if there is none.

    Both are in [rad/s^order] or [m/s^order], shape (g, joints): velocities of order 1, accelerations of order
    2.
    """
    both = np.isfinite(recorded) & np.isfinite(computed)
    x, y = recorded[both], computed[both]
    if not x.any() or not y.any():
        return None
    ratio = float(x @ y / (x @ x))  # least squares
    if np.linalg.norm(y - ratio * x) > AGREEMENT * np.linalg.norm(y):
        return None
    units = _MATCHING_UNITS[order].items()
    return next((unit for factor, unit in units if abs(ratio / factor - 1.0) <= AGREEMENT), None)


def _window(count: int) -> int:
    """Return the length of the smoothing window, an odd number of samples."""
    return min(WINDOW, count - 1 + count % 2)


def _smoothed(q: FloatArray, tsp: float) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of the fitted cubic, NaN where a sample of its window is missing.

    In the first and the last half window they are those of the cubic of the first and the last window.
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
    """Fill in the derivatives of the cubic in the middle of each window, with respect to x.

    Samples before and after the middle have the same weight, with opposite sign in the first derivative.

    Args:
        q: Samples, shape (m + 2 half, joints).
        fit: From the samples of a window to the coefficients of the cubic, shape (4, 2 half + 1).
        first: First derivatives, shape (m, joints).
        second: Second derivatives, shape (m, joints).
    """
    count, half = len(first), fit.shape[1] // 2
    middle = q[half : half + count]
    np.multiply(middle, 0.0, out=first)  # NaN where the middle is missing
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
