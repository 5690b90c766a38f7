"""Statistics of a deviation and the verdict on it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.comparison.deviation import Kind, Share, Statistics, Verdict
from urmpipe_pipeline.comparison.tolerance import allowed_for
from urmpipe_pipeline.iso9283.criteria import overall_verdict

UNCHANGING = 1e-9
"""A quantity with a smaller standard deviation, in [m] or [m/s], does not change: logs print nothing finer
than a nanometre, and what rounding leaves (1e-15 m) correlates with anything by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One quantity of a deviation.

    Attributes:
        quantity: x, y, z, norm, path, angle, or a joint's name.
        kind: What it is measured of.
        unit: m or rad.
        values: In [m] or [rad], as the unit says, shape (m,); NaN where a side has no value.
    """

    quantity: str
    kind: Kind
    unit: str
    values: FloatArray

    def outside(self, tolerance: Mapping[str, float]) -> NDArray[np.bool_]:
        """Return where it is out of tolerance, shape (m,): nowhere without one.

        What has no value cannot be shown to be within its tolerance: it is out of it.
        """
        allowed = allowed_for(self.quantity, self.kind, tolerance)
        if allowed is None:
            return np.zeros(len(self.values), bool)
        return ~np.asarray(np.abs(self.values) <= allowed)


def describe(
    measured: Measured, t: FloatArray, sample: IntArray, tolerance: Mapping[str, float]
) -> Statistics:
    """Return the statistics of one quantity over the samples that have a value, and the verdict on all.

    The quantity has a value at least at one of the log's rows, shape (m,), whose times are in [s], shape
    (m,). The tolerance is in [m] or [rad], by kind or by coordinate.
    """
    known = np.flatnonzero(np.isfinite(measured.values))
    values = measured.values[known]
    size = np.abs(values)
    worst = int(np.argmax(size))
    largest = float(size[worst])
    allowed = allowed_for(measured.quantity, measured.kind, tolerance)
    out = None if allowed is None else int(np.count_nonzero(measured.outside(tolerance)))
    return Statistics(
        quantity=measured.quantity,
        kind=measured.kind,
        unit=measured.unit,
        max=largest,
        rms=float(np.sqrt(np.mean(values * values))),
        mean=float(np.mean(values)),
        std=float(np.std(values)),
        p95=float(np.percentile(size, 95)),
        t_max=float(t[known[worst]]),
        sample_max=int(sample[known[worst]]),
        tolerance=allowed,
        out_of_tolerance=out,
        share_out=None if out is None else out / len(measured.values),
        verdict=None if out is None else "fail" if out else "pass",
        samples=len(known),
        missing=len(measured.values) - len(known),
    )


def overall(statistics: Iterable[Statistics | Share]) -> Verdict | None:
    """Return fail if any quantity fails; None if none has a tolerance."""
    return overall_verdict(one.verdict for one in statistics)


def correlation(first: FloatArray, second: FloatArray) -> float | None:
    """Return Pearson's r of two quantities where both have a value; None where one does not change.

    Both are in [m] or [m/s], shape (m,); NaN where there is no value.
    """
    both = np.isfinite(first) & np.isfinite(second)
    if not both.any():
        return None
    a, b = (values[both] - values[both].mean() for values in (first, second))
    spread = float(np.sqrt(np.mean(a * a))), float(np.sqrt(np.mean(b * b)))
    if min(spread) < UNCHANGING:
        return None
    return float(np.clip(np.mean(a * b) / (spread[0] * spread[1]), -1.0, 1.0))
