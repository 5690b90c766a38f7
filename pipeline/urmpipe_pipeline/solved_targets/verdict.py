"""The verdict of `urmpipe ik`, as a run tells it: targets reached, by a way that an arm can go."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.solved_targets.wording import in_words, reach_words
from urmpipe_pipeline.text import counted

if TYPE_CHECKING:
    from urmpipe_models.inverse.along_path.joint_path import JointPath

JUMP = "jump"
TOO_FAST = "joint-too-fast"


def path_warnings(path: JointPath) -> Iterator[LogWarning]:
    """Yield why no arm can follow the joint values along a path: its jumps, and joints that are too fast."""
    if path.jumps:
        first = path.jumps[0]
        steps = ", ".join(f"{one.joint} by {in_words(one.step, one.unit)}" for one in first.joints)
        yield LogWarning(JUMP, _first_of(len(path.jumps), "jump", steps), first.sample + 1)
    if path.too_fast:
        one = path.too_fast[0]
        said = f"{one.joint} at {in_words(one.speed, one.unit)} of {in_words(one.allowed, one.unit)} allowed"
        count = len({one.joint for one in path.too_fast})
        yield LogWarning(TOO_FAST, _first_of(count, "joint", said, " too fast"), one.first + 1)


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


def _first_of(count: int, noun: str, first: str, what: str = "") -> str:
    """Return how many there are, and the first: "2 joints too fast, here the first: ..."."""
    return f"{counted(count, noun)}{what}{', here the first' if count > 1 else ''}: {first}"
