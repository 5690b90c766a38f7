"""Logs that were to be compared and could not be, while others are judged all the same."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from urmpipe_models.errors import Finding, UrmpipeError
from urmpipe_pipeline.runs.run import Run

Made = TypeVar("Made")


@dataclass(frozen=True, slots=True)
class Unjudged:
    """A log that was to be compared, and could not be.

    Attributes:
        name: Its name.
        errors: All that is wrong with it, at least one.
    """

    name: str
    errors: tuple[Finding, ...]


def judge_others(
    judge: Callable[[Sequence[Run]], Made], runs: Sequence[Run], unjudged: list[Unjudged]
) -> Made:
    """Return what a function makes of those runs that it takes, and add the others to a list.

    Raises:
        UrmpipeError: With everything that is wrong, if it takes none, or not all that it takes alone.
    """
    try:
        return judge(runs)
    except UrmpipeError:
        alone = [_lost(judge, run) for run in runs]
        kept = [run for run, lost in zip(runs, alone, strict=True) if lost is None]
        if not kept or len(kept) == len(runs):
            raise
    unjudged += [lost for lost in alone if lost is not None]
    return judge(kept)


def _lost(judge: Callable[[Sequence[Run]], object], run: Run) -> Unjudged | None:
    """Return why a run cannot be judged, even alone; None if it can."""
    try:
        judge([run])
    except UrmpipeError as error:
        return Unjudged(run.name, error.findings)
    return None
