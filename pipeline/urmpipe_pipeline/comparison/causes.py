"""What the statistics of a log that is out of tolerance look like: late, or with a joint's zero elsewhere.

These are the two causes that maxima, means and deviations tell without any fit; others are not looked for.
"""

from __future__ import annotations

from collections.abc import Iterator

from urmpipe_models.messages import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import AXES, Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.presentation.section import Advice

IN_SPACE = 0.1
"""Share of the largest norm that a log may be off the path by, and still be late rather than elsewhere."""

STEADY = 0.1
"""Share of its mean that a joint's deviation may spread by (std), and still be constant."""

MOVED = 10.0
"""What a joint that is off by 1 rad or 1 m moves at most, in [m] or [rad]: no arm reaches further. What is
off by more has another cause, whatever rounding left of the joint."""


def causes(run: Deviation, reference: Trajectory) -> Iterator[Advice]:
    """Yield what a log that is out of tolerance looks like, and what may be done; nothing of one that passes.

    Late or early: out of a tolerance of position at the same time, but off the path by at most a tenth of
    that. The zero of a joint: its deviation is the same throughout, no joint's is larger, and it is large
    enough for what decides.
    """
    if run.verdict == "fail":
        yield from _late(run, reference) if run.statistics else ()
        yield from _zeros(run)


def _late(run: Deviation, reference: Trajectory) -> Iterator[Advice]:
    norm, path = run.statistics["norm"], run.statistics["path"]
    position = (run.statistics[axis] for axis in AXES)
    beyond = any(one.tolerance is not None and one.max > one.tolerance for one in position)
    if beyond and path.max <= IN_SPACE * norm.max and path.verdict != "fail":
        hint = Hint("sync", "auto", "finds an offset of the clocks")
        most, least = text.quantity(norm.max, "m"), text.quantity(path.max, "m")
        said = f"on the path but not in time (‖Δ‖ {most}, path {least}): late or early"
        yield Advice(said, (hint,) if _has_own_clock(run, reference) else ())


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
