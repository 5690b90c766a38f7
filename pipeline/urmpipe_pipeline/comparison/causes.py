"""What the statistics of a log that is out of tolerance look like: late, or with a joint's zero elsewhere.

These are the two causes that maxima, means and deviations tell without any fit; others are not looked for.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.messages import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import AXES, Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.presentation.section import Advice

IN_SPACE = 0.1
"""Share of the norm that a log may be off the path by, and still be late rather than elsewhere."""

THROUGHOUT = 0.25
"""Share of the way on which a late log is off by a tenth of what it is off where it is out of tolerance."""

STEADY = 0.1
"""Share of its mean that a joint's deviation may spread by (std), and still be constant."""

MOVED = 10.0
"""What a joint that is off by 1 rad or 1 m moves at most, in [m] or [rad]: no arm reaches further. What is
off by more has another cause, whatever rounding left of the joint."""


def causes(run: Deviation, reference: Trajectory) -> Iterator[Advice]:
    """Yield what a log that is out of tolerance looks like, and what may be done; nothing of one that passes.

    Late or early: out of a tolerance of position at the same time, but off the path by at most a tenth of
    that; and so on much of its way, not in some rows. The zero of a joint: its deviation is the same
    throughout, no joint's is larger, and it is large enough for what decides.
    """
    if run.verdict == "fail":
        yield from _late(run, reference) if run.statistics else ()
        yield from _zeros(run)


def _late(run: Deviation, reference: Trajectory) -> Iterator[Advice]:
    held = [(name, run.statistics[name].tolerance) for name in AXES]
    beyond = [np.abs(run.delta[:, AXES.index(name)]) > most for name, most in held if most is not None]
    if not np.any(beyond) or run.statistics["path"].verdict == "fail":
        return
    out = np.any(beyond, axis=0)
    norm, path = run.delta[:, 3], run.path
    off, beside = float(np.median(norm[out])), float(np.nanmedian(path[out]))
    if beside <= IN_SPACE * off and _share_of_way(run, norm >= IN_SPACE * off) >= THROUGHOUT:
        hint = Hint("sync", "auto", "finds an offset of the clocks")
        most, least = text.quantity(off, "m"), text.quantity(beside, "m")
        medians = f"medians out of tolerance: ‖Δ‖ {most}, path {least}"
        said = f"on the path but not in time ({medians}): late or early"
        yield Advice(said, (hint,) if _has_own_clock(run, reference) else ())


def _share_of_way(run: Deviation, samples: NDArray[np.bool_]) -> float:
    """Return at which share of the way some samples are, 0..1: where the arm rests, nothing is late.

    The way is what log and reference both go: an outlier of one of them is none.
    """
    sides = [np.linalg.norm(np.diff(side, axis=0), axis=1) for side in (run.reference, run.actual)]
    way = np.nan_to_num(np.min(sides, axis=0))
    return float(way[samples[1:]].sum() / way.sum()) if way.any() else 0.0


def _has_own_clock(run: Deviation, reference: Trajectory) -> bool:
    """Tell whether an offset may be looked for: not in one file, nor between targets without times."""
    return run.sync.mode == "start" and run.run.log.files != reference.files and run.run.timed


def _zeros(run: Deviation) -> Iterator[Advice]:
    for unit in ("rad", "m"):
        one = run.furthest_joint(unit)
        if one is None or MOVED * one.max < run.decisive.max:
            continue
        if one.max > 0.0 and one.std <= STEADY * abs(one.mean):
            mean = f"{text.quantity(one.mean, unit)}, std {text.quantity(one.std, unit)}"
            yield Advice(f"constant offset of {one.quantity} (reference - log = {mean}): another zero?")
