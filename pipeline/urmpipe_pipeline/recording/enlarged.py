"""The deviation made visible: a path that leaves the reference many times as far as the log did."""

from __future__ import annotations

from urmpipe_pipeline.comparison.comparison import Comparison, Deviation
from urmpipe_pipeline.palette import DEVIATION_COLOUR
from urmpipe_pipeline.recording.entities import entity_path, printable
from urmpipe_pipeline.recording.ways import Way, lines_of, track_of

FACTORS = (50, 20, 10, 5, 2)
"""How many times a deviation may be drawn, the usual one first."""

LEAST_SEEN = 0.005
"""An enlarged deviation below this share of the scene's radius lies within the width of the lines."""


def enlarged(result: Comparison, radius: float) -> Way | None:
    """Return reference + factor (actual - reference) of one run, or None where that would show nothing.

    Of several runs it is the one that deviates most among those whose deviation needs enlarging: one that
    is wide of the reference as it is needs no second line. One line is drawn, since one a run would hide
    all of them.

    Args:
        result: The comparison.
        radius: Of the scene in [m]; the enlarged deviation stays below it.
    """
    factors = [(one, _factor(one.statistics["norm"].max, radius)) for one in result.runs]
    fitting = [(one, factor) for one, factor in factors if factor is not None]
    if not fitting:
        return None
    one, factor = max(fitting, key=lambda pair: pair[0].statistics["norm"].max)
    whose = f" of {printable(one.name)}" if len(result.runs) > 1 else ""
    return _way(one, factor, f"deviation{whose} x{factor}")


def _factor(largest: float, radius: float) -> int | None:
    """Return the largest factor that keeps a deviation inside the scene; None where none makes it seen."""
    factor = next((factor for factor in FACTORS if factor * largest <= radius), None)
    return None if factor is None or factor * largest < LEAST_SEEN * radius else factor


def _way(one: Deviation, factor: int, label: str) -> Way:
    position = one.reference + factor * (one.actual - one.reference)
    return Way(
        entity_path("path", "enlarged"),
        entity_path("point", "enlarged"),
        DEVIATION_COLOUR,
        wanted=False,
        strips=lines_of(position, one.sample, one.worst),
        track=track_of(one.t_ns, position, one.sample, one.worst),
        label=label,
    )
