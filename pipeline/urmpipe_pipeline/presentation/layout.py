"""Decisions about a panel that every renderer shares: an axis of two scales, and a plot a pair of lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.presentation.figure import Computed, Line, Panel
from urmpipe_pipeline.presentation.palette import BEYOND_SCALE, WITHIN_SCALE

FAINT = 12.0
"""Largest value over the limit from which on a linear axis leaves the tolerance too few pixels."""

BAND_SHARE = 0.3
"""Share of an axis of two scales that the tolerance takes."""

MANY = 3
"""So many set points with their answers are plotted apart, a pair a plot."""

LIMITED_SCALE = tuple(zip((0.0, BAND_SHARE, BAND_SHARE, 1.0), (*WITHIN_SCALE, *BEYOND_SCALE), strict=True))
"""Colours of values that have a limit, by their heights on an axis of two scales."""

CLOSE_SHARE = 0.65
"""Share that the values take of an axis that shows them close up."""

STEPS = (1.0, 2.0, 5.0)
"""What the largest tick may be, times a power of ten: at least two fifths of the largest value."""


@dataclass(frozen=True, slots=True)
class TwoScales:
    """An axis with one linear scale up to a value and a smaller one beyond it; it grows everywhere.

    The height above 0 is `share` at the value and 1 at `top`; below 0 it is the negative of that.

    Attributes:
        inner: Where the scale changes, in any unit, above 0: the limit, or the largest value far within it.
        top: The largest value drawn, or the limit, in the same unit, above `inner`.
        share: Height of `inner`, 0 to 1.
    """

    inner: float
    top: float
    share: float = BAND_SHARE

    @property
    def close(self) -> bool:
        """Whether the limit is the top, and values far within it are shown close up."""
        return self.share == CLOSE_SHARE

    def height(self, values: FloatArray) -> FloatArray:
        """Return where values of the limit's unit stand on the axis, in any shape; NaN stays NaN."""
        sizes = np.array([0.0, self.inner, self.top])
        return self._odd(values, sizes, np.array([0.0, self.share, 1.0]))

    def value(self, heights: FloatArray) -> FloatArray:
        """Return the values, in the limit's unit, at heights [-] of any shape: the inverse of `height`."""
        sizes = np.array([0.0, self.inner, self.top])
        return self._odd(heights, np.array([0.0, self.share, 1.0]), sizes)

    def ticks(self) -> list[float]:
        """Return the sizes that have a tick, from 0 up: the limit, and the largest round value."""
        drawn = self.inner if self.close else self.top
        power = 10.0 ** np.floor(np.log10(drawn))
        largest = float(max(one * power for one in STEPS if one * power <= drawn))
        return [0.0, *sorted((largest, self.top if self.close else self.inner))]

    @staticmethod
    def _odd(values: FloatArray, known: FloatArray, shown: FloatArray) -> FloatArray:
        """Return an odd function that is linear between known places, and goes on beyond the last."""
        size = np.abs(values)
        slope = (shown[2] - shown[1]) / (known[2] - known[1])
        beyond = shown[2] + slope * (size - known[2])
        return np.asarray(np.sign(values) * np.where(size > known[2], beyond, np.interp(size, known, shown)))


def two_scales(panel: Panel) -> TwoScales | None:
    """Return the axis that shows the tolerance of a panel and all its values, in the unit of the panel.

    None where a linear or the panel's logarithmic axis shows both, and where nothing is allowed or limited.
    Values far within the limit are shown close up only if the panel says that it is about them.
    """
    if not panel.limit or panel.logarithmic or panel.over is not None:
        return None
    largest = max((_largest(one) for one in panel.lines), default=0.0)
    if 0.0 < panel.close < panel.limit / FAINT:
        return TwoScales(max(panel.close, largest), panel.limit, CLOSE_SHARE)
    return TwoScales(panel.limit, largest) if largest > FAINT * panel.limit else None


def value_scales(values: FloatArray, limit: float | None) -> TwoScales | None:
    """Return where the colours of sizes stand, shape (n,), with a limit in their unit; None without one."""
    largest = float(np.nanmax(values, initial=0.0))
    return TwoScales(limit, max(largest, 2.0 * limit)) if limit else None


def small_multiples(panel: Panel) -> tuple[Panel, ...]:
    """Return a panel for each answer with its set point, dashed; the panel itself where they are few.

    Set points are the dashed columns. As many of them as answers belong together in their order; a single
    one belongs to all. Any other number cannot be told apart: the panel stays whole.
    """
    wanted = [one for line in panel.lines if line.dashed for one in _columns(line)]
    answers = [one for line in panel.lines if not line.dashed for one in _columns(line)]
    if len(answers) < MANY or len(wanted) not in (1, len(answers)):
        return (panel,)
    pairs = zip(wanted * (len(answers) // len(wanted)), answers, strict=True)
    return tuple(
        replace(
            panel,
            title=answer.names[0],
            lines=(want, answer),
            marks=tuple(mark for mark in panel.marks if mark.name in (*want.names, *answer.names)),
        )
        for want, answer in pairs
    )


def _columns(line: Line) -> Iterator[Line]:
    """Yield each column of a line as a line of its own; its values are read where it is drawn."""
    for k, (name, colour) in enumerate(zip(line.names, line.colours, strict=True)):
        values = Computed(len(line.values), partial(_column, line, k))
        yield replace(line, values=values, names=(name,), colours=(colour,))


def _column(line: Line, k: int) -> FloatArray:
    values = np.asarray(line.values[:], dtype=np.float64)
    return values if values.ndim == 1 else np.asarray(values[:, k])


def _largest(line: Line) -> float:
    """Return the largest absolute value of a line that is finite; 0 without one."""
    values = np.abs(np.asarray(line.values[:], dtype=np.float64))
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))
