"""Deviations in the units that people read: they are plotted in those in which the summary tells them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.text import SHOWN

DEVIATIONS = ("delta", "path", "angle", "joints")
"""The plots of what was held against a tolerance, or can be."""


MARGIN = 0.04
"""Free space above and below what is plotted, as a share of it."""


def deviation_array(one: Deviation, plot: str) -> FloatArray | None:
    """Return the array of a plot of `DEVIATIONS`, in SI; None if the log has none."""
    return {"delta": one.delta, "path": one.path, "angle": one.angle, "joints": one.joint_delta}[plot]


def plotted_deviations(one: Deviation) -> Iterator[tuple[str, FloatArray]]:
    """Yield each plot of `DEVIATIONS` that a log has, with its values in [mm] or [deg], shape (m, k)."""
    for plot in DEVIATIONS:
        if (values := deviation_array(one, plot)) is not None:
            yield plot, values.reshape(len(values), -1) * factors(one, plot)


def factors(one: Deviation, plot: str) -> FloatArray:
    """Return what the columns of a plot of `DEVIATIONS` are multiplied by, from SI, shape (k,) or (1,)."""
    return np.array([SHOWN[unit][1] for unit in _units(one, plot)])


def shown_unit(one: Deviation, plot: str) -> str:
    """Return the unit of a plot of `DEVIATIONS`: mm, deg, or both of an arm that turns and slides."""
    return " or ".join(dict.fromkeys(SHOWN[unit][0] for unit in _units(one, plot)))


def _units(one: Deviation, plot: str) -> list[str]:
    """Return the SI units of the columns of a plot."""
    if plot == "joints":
        return one.run.joint_units
    return ["rad" if plot == "angle" else "m"]


def span_with_numbers(low: float, high: float, most: int) -> tuple[float, float] | None:
    """Return a range for an axis on which the viewer writes more than 0; None if it has none to show.

    The viewer writes powers of ten: the multiples of the largest one in the range where they are few, else
    those of the next. So the longer side of a range whose multiples are many is drawn out to that.

    Args:
        low: Least value.
        high: Largest value.
        most: Multiples that the height has room for.
    """
    low, high = min(low, 0.0), max(high, 0.0)
    longest = max(-low, high)
    if not longest or not math.isfinite(longest):
        return None
    power = 10.0 ** math.floor(math.log10(longest))
    if (high - low) / power > most:
        low, high = (low, 10.0 * power) if high >= -low else (-10.0 * power, high)
    margin = MARGIN * (high - low)
    return low - margin, high + margin
