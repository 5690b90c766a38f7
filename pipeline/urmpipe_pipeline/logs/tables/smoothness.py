"""How smoothly numbers go on in the ways in which a file may hold them: samples or joints as rows, or flat.

A motion is sampled many times in its shortest period: from sample to sample a joint goes on nearly straight,
while two joints have nothing in common. With the k-th differences of numbers x at a lag L,

    d1_L[i] = x[i + L] - x[i],    d2_L[i] = x[i + 2 L] - 2 x[i + L] + x[i],

a joint with n samples in a period of amplitude A has d1_1 up to 2 A sin(pi / n) and d2_1 up to
4 A sin(pi / n)^2; noise of deviation s has sqrt(2) s and sqrt(6) s at any lag, so that it never asks.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.wraps import FULL_TURN

ROUGH = 0.1
"""What goes on as a motion has at most this share of the squared differences of what does not: swings with 14
samples in a period have 2 sin(pi / 14)^2 = 0.1 of those of noise, d1_1^2 / (2 variance)."""

SMOOTH = 0.05
"""Numbers with at most this share are one joint: it has so much with 20 samples in a period, more than there
are joints. Of two joints or more in turn it is 0.1 or more, also of angles that wrap."""

JUMP = 2.0
"""Where one joint ends and the next begins, d2_1 is so many times the largest within the joints (rms). Of
noise the largest of many numbers is above the rms of a few."""

MOST_JOINTS = 16
"""Joints, with times, rates or torques beside them, that rows or a flat array may stand for."""

LEAST_SAMPLES = 20
"""Fewer columns may be those of an ordinary table."""

LEAST_ROWS = 10
"""Fewer samples of a flat array tell nothing."""

NEARLY = 2.0
"""Roughness within this factor is the same: of two numbers of joints the smaller one is taken."""

CORNER = 2.0
"""Where one joint ends and the next begins, d1_1 is so many times that beside it (rms)."""

SLACK = 1.01
"""Angles between -1 and 1 turn pass these by no more than this."""


def goes_along_rows(values: FloatArray) -> bool:
    """Return whether numbers go on along the rows and not down the columns, so that rows may be joints.

    mean d1^2 along the rows <= ROUGH * mean d1^2 down the columns; of a single row its variance, twice.

    Args:
        values: In any unit, shape (rows, columns), NaN where one is missing.
    """
    rows, columns = values.shape
    if not 1 <= rows <= MOST_JOINTS or columns < max(LEAST_SAMPLES, rows + 1):
        return False
    along = _mean_square(np.array([steps(row) for row in values]))
    down = 2 * _variance(values[0]) if rows == 1 else _mean_square(np.diff(values, axis=0))
    return 0.0 < along <= ROUGH * down or (along == 0.0 < down and rows > 1)


def flat_ways(numbers: FloatArray) -> list[tuple[str, int]]:
    """Return how many joints numbers in a row may hold, and in which order: "flat" or "flat-by-joint".

    Args:
        numbers: In the order of the file and in any unit, shape (n,).

    Returns:
        The smoothest first; nothing where the numbers are one joint, or cannot be told from one.
    """
    if not np.isfinite(numbers).any():
        return []
    counts = [n for n in range(2, MOST_JOINTS + 1) if not len(numbers) % n and len(numbers) >= n * LEAST_ROWS]
    return [("flat", n) for n in _by_sample(numbers, counts)] or [
        ("flat-by-joint", n) for n in _by_joint(numbers, counts)
    ]


def _by_sample(x: FloatArray, counts: list[int]) -> list[int]:
    """Return each number of joints N with mean d2_N^2 <= ROUGH * mean d2_1^2, where x is not smooth."""
    if _mean_square(steps(x)) <= SMOOTH * 2 * _variance(x):
        return []
    rough = {n: _mean_square(_second(x, n)) for n in counts}
    found = [n for n in counts if rough[n] <= ROUGH * _mean_square(_second(x, 1))]
    return _smoothest({n: rough[n] for n in found})


def _by_joint(x: FloatArray, counts: list[int]) -> list[int]:
    """Return the numbers of joints with jumps between them alone: rms d2_1 >= JUMP * the largest elsewhere.

    A joint that is given steps stands still between them.
    """
    second, found = np.abs(_second(x, 1)), {}
    for n in counts:
        ends = np.arange(1, n) * (len(x) // n)
        if not _part_joints(steps(x), ends - 1):
            continue
        beside = np.zeros(len(second), dtype=bool)
        beside[[*(ends - 2), *(ends - 1)]] = True
        largest, jumps = np.nanmax(second[~beside]), np.sqrt(_mean_square(second[beside]))
        if 0.0 < JUMP * largest <= jumps:
            found[n] = float(largest)
    return _smoothest(found)


def _part_joints(between: FloatArray, ends: IntArray) -> bool:
    """Return whether steps at the ends are jumps from joint to joint, and no corners of a path.

    A path of straight pieces has no larger steps at its corners than beside them.
    """
    size = np.abs(between)
    beside = np.fmax(size[ends - 1], size[ends + 1])
    return _mean_square(size[ends]) >= CORNER**2 * _mean_square(beside)


def _smoothest(rough: Mapping[int, float]) -> list[int]:
    """Return numbers of joints, the smoothest first; of nearly equal ones the smallest.

    Twice as many joints are as smooth as the right number, and half as many are not.
    """
    best = next((n for n in sorted(rough) if rough[n] <= NEARLY * min(rough.values())), None)
    return sorted(rough, key=lambda n: (n != best, rough[n]))


def steps(x: FloatArray, lag: int = 1) -> FloatArray:
    """Return d1 at a lag, shape (n - lag,), of values in any unit: without the turns by which angles wrap."""
    known = np.abs(x[np.isfinite(x)])
    peak = float(known.max()) if len(known) else 0.0
    turn = next((turn for turn in (FULL_TURN, 360.0) if peak <= SLACK * turn), np.inf)
    step = x[lag:] - x[:-lag]
    return step if np.isinf(turn) else step - turn * np.rint(step / turn)


def _second(x: FloatArray, lag: int) -> FloatArray:
    """Return d2 at a lag, shape (n - 2 lag,)."""
    step = steps(x, lag)
    return np.asarray(step[lag:] - step[:-lag])


def _mean_square(values: FloatArray) -> float:
    """Return the mean square of values that are not missing; 0 of none."""
    known = values[np.isfinite(values)]
    return float(np.mean(known**2)) if len(known) else 0.0


def _variance(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.var(known)) if len(known) else 0.0
