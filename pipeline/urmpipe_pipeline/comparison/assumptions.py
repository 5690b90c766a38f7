"""What a verdict takes for granted: the readings that nothing proves, of what the verdict rests on."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from urmpipe_models.errors import LogError
from urmpipe_pipeline.comparison.matching import file_of
from urmpipe_pipeline.joint_log import LogWarning, Role
from urmpipe_pipeline.runs.results import Run

NAMED = 3
"""Runs that an assumption names; more are only counted."""


def assumptions(sides: Sequence[tuple[Run, Collection[Role]]]) -> tuple[str, ...]:
    """Return what the verdict on some runs assumes, each once, with the runs where it is not all of them.

    Args:
        sides: The runs that are compared, the reference among them, each with the roles of what is compared.

    Raises:
        LogError: With each reading that has to be told before a verdict rests on it.
    """
    _refuse_unasked(sides)
    found: dict[str, list[str]] = {}
    for run, roles in sides:
        for one in _assumed(run, roles):
            found.setdefault(one.assumption, []).append(run.name)
    every = {run.name for run, _ in sides}
    return tuple(
        said if set(names) == every else f"{said} ({_named(list(dict.fromkeys(names)))})"
        for said, names in found.items()
    )


def _named(names: Sequence[str]) -> str:
    """Return some runs by their names, or how many they are."""
    return ", ".join(names) if len(names) <= NAMED else f"{len(names)} logs"


def _assumed(run: Run, roles: Collection[Role]) -> list[LogWarning]:
    """Return the assumptions about some roles of a run."""
    return [one for one in run.warnings if one.assumption and one.role in roles]


def _refuse_unasked(sides: Sequence[tuple[Run, Collection[Role]]]) -> None:
    """Raise a `LogError` with what is to be answered before there is a verdict."""
    asked = [(run, one) for run, roles in sides for one in run.warnings if one.asks and one.role in roles]
    if asked:
        raise LogError(*(replace(one.as_finding(), file=file_of(run)) for run, one in asked))
