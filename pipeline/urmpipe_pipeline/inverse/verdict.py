"""The verdict of `urmpipe ik`, as a run tells it: targets reached, by a way that an arm can go."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.text import SHOWN, counted

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


def faults(run: Run) -> list[str]:
    """Return what keeps an arm from following the path, in the words of the warnings."""
    return [one.message for one in run.warnings if one.kind in (JUMP, TOO_FAST)]


def _first_of(count: int, noun: str, first: str, what: str = "") -> str:
    """Return how many there are, and the first: "2 joints too fast, here the first: ..."."""
    return f"{counted(count, noun)}{what}{', here the first' if count > 1 else ''}: {first}"


def in_words(value: float, unit: str) -> str:
    """Return an angle, a length or a rate of one in [rad] or [m] with the unit that people read."""
    base, slash, per = unit.partition("/")
    shown, factor = SHOWN[base]
    return f"{value * factor:.4g} {shown}{slash}{per}"
