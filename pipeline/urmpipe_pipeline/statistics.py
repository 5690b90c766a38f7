"""Statistics of a deviation and the verdict on it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from urmpipe_pipeline.joint_log import FloatArray, IntArray
from urmpipe_pipeline.results import AXES, Statistics, Verdict

DEFAULT_TOLERANCE = 0.0035
"""Largest deviation allowed on an axis in [m]. Source: [UrmArm2021]_ section 2.4."""


def describe(
    delta: FloatArray, t: FloatArray, sample: IntArray, tolerance: Mapping[str, float]
) -> dict[str, Statistics]:
    """Return the statistics of x, y, z and norm.

    Args:
        delta: Deviations in [m], shape (m, 4), m > 0, without NaN.
        t: Their times in [s], shape (m,).
        sample: Their grid samples, shape (m,).
        tolerance: In [m]; "axis" holds for x, y and z, a quantity's own name for it alone.
    """
    return {
        axis: _of_one(
            delta[:, i], t, sample, tolerance.get(axis, tolerance.get("axis") if axis != "norm" else None)
        )
        for i, axis in enumerate(AXES)
    }


def overall(statistics: Mapping[str, Statistics]) -> Verdict:
    """Return fail if any quantity fails."""
    return "fail" if any(one.verdict == "fail" for one in statistics.values()) else "pass"


def _of_one(values: FloatArray, t: FloatArray, sample: IntArray, tolerance: float | None) -> Statistics:
    size = np.abs(values)
    worst = int(np.argmax(size))
    largest = float(size[worst])
    return Statistics(
        max=largest,
        rms=float(np.sqrt(np.mean(values * values))),
        mean=float(np.mean(values)),
        std=float(np.std(values)),
        p95=float(np.percentile(size, 95)),
        t_max=float(t[worst]),
        sample_max=int(sample[worst]),
        tolerance=tolerance,
        verdict=None if tolerance is None else "pass" if largest <= tolerance else "fail",
    )
