"""What the statistics of a log that is out of tolerance look like: late, or with a joint's zero elsewhere.

These are the two causes that maxima, means and deviations tell without any fit; others are not looked for.
"""

from __future__ import annotations

from collections.abc import Iterator

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Deviation

IN_SPACE = 0.1
"""Share of the largest norm that a log may be off the path by, and still be late rather than elsewhere."""

STEADY = 0.1
"""Share of its mean that a joint's deviation may spread by (std), and still be constant."""


def causes(run: Deviation) -> Iterator[str]:
    """Yield what a log that is out of tolerance looks like, a sentence each; nothing of one that passes.

    Late or early: off the reference at the same time, but at most a tenth of that off its path. The zero of a
    joint: its deviation is the same throughout, and no joint's is larger.
    """
    if run.verdict == "fail":
        yield from _late(run)
        yield from _zeros(run)


def _late(run: Deviation) -> Iterator[str]:
    norm, path = run.statistics["norm"], run.statistics["path"]
    if norm.max > 0.0 and path.max <= IN_SPACE * norm.max and run.decisive.kind != "path":
        remedy = "; --sync auto finds an offset of the clocks" if run.sync.mode == "start" else ""
        most, least = text.quantity(norm.max, "m"), text.quantity(path.max, "m")
        yield f"on the path but not in time (‖Δ‖ {most}, path {least}): late or early{remedy}"


def _zeros(run: Deviation) -> Iterator[str]:
    for unit in ("rad", "m"):
        one = run.furthest_joint(unit)
        if one is not None and one.max > 0.0 and one.std <= STEADY * abs(one.mean):
            mean = f"{text.quantity(one.mean, unit)}, std {text.quantity(one.std, unit)}"
            yield f"{one.quantity} is off by the same throughout (reference - log = {mean}): another zero?"
