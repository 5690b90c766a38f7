"""The verdict of `urmpipe ik`, as a run tells it: targets reached, by a way that an arm can go."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.runs.results import Run

if TYPE_CHECKING:
    pass

JUMP = "jump"
TOO_FAST = "joint-too-fast"


def reached(run: Run) -> int:
    """Return how many targets have a solution."""
    return int(np.isfinite(run.log.q).all(axis=1).sum())


def solved(run: Run) -> bool:
    """Tell whether every target has a solution, along a path without a jump or a joint that is too fast."""
    return reached(run) == run.log.rows and not faults(run)


def verdict_of(run: Run) -> Verdict | None:
    """Return the verdict of `ik` on solved targets; None of a log, where nothing is judged."""
    if run.goals is None:
        return None
    return "pass" if solved(run) else "fail"


def reached_words(runs: Sequence[Run]) -> str:
    """Return how many targets arms reach: "poses: ur5e reaches 2 of 3 targets, with 1 jump".

    Args:
        runs: Solved targets, at least one.
    """
    found, wanted = sum(map(reached, runs)), sum(run.log.rows for run in runs)
    arms = list(dict.fromkeys(run.robot.name for run in runs if run.robot))
    subject = runs[0].name if len(runs) == 1 else text.counted(len(runs), "file")
    said = reach_words(subject, arms, found, wanted)
    counts = [re.split("[,:]", fault)[0] for fault in faults(runs[0])] if len(runs) == 1 else []
    return f"{said}, with {text.enumerated(counts)}" if counts else said


def faults(run: Run) -> list[str]:
    """Return what keeps an arm from following the path, in the words of the warnings."""
    return [one.message for one in run.warnings if one.kind in (JUMP, TOO_FAST)]


def reach_words(subject: str, arms: Sequence[str], found: int, wanted: int) -> str:
    """Return that arms reach so many targets of some: "poses: ur5e reaches 3 targets"."""
    part = "" if found == wanted else f"{found} of "
    verb = "reaches" if len(arms) == 1 else "reach"
    return f"{subject}: {text.enumerated(arms)} {verb} {part}{text.counted(wanted, 'target')}"
