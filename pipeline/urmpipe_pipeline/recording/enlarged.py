"""The deviation made visible: a path that leaves the reference many times as far as the log did."""

from __future__ import annotations

from urmpipe_pipeline.comparison.decided import decided_row
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.palette import DEVIATION_COLOUR
from urmpipe_pipeline.recording.entities import entity_path
from urmpipe_pipeline.recording.ways import Way, lines_of, track_of

FACTORS = (50, 20, 10, 5, 2)
"""How many times a deviation may be drawn, the usual one first."""

LEAST_SEEN = 0.005
"""An enlarged deviation below this share of the scene's radius lies within the width of the lines."""


def enlarged(one: Deviation, radius: float) -> Way | None:
    """Return reference + factor (actual - reference) of a log, or None where that would show nothing.

    Of several logs it is drawn of the one whose arm stands there: a line a log would hide all of them, and
    that of another would belong to nothing else in view.

    Args:
        one: The log.
        radius: Of the scene in [m]; the enlarged deviation stays below it.
    """
    factor = _factor(one, radius)
    if factor is None or not one.run.timed:
        return None
    position, row = one.reference + factor * (one.actual - one.reference), decided_row(one)
    return Way(
        entity_path("path", "enlarged"),
        entity_path("point", "enlarged"),
        DEVIATION_COLOUR,
        wanted=False,
        strips=lines_of(position, one.sample, row),
        track=track_of(one.t_ns, position, one.sample, row),
        factor=factor,
    )


def _factor(one: Deviation, radius: float) -> int | None:
    """Return the largest factor that keeps a deviation inside the scene; None where none makes it seen."""
    largest = one.statistics["norm"].max
    factor = next((factor for factor in FACTORS if factor * largest <= radius), None)
    return None if factor is None or factor * largest < LEAST_SEEN * radius else factor
