"""What verdicts take for granted, in words: each as the end of "assuming ...", with what it is about."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

NAMED = 3
"""Logs that an assumption names; more are only counted."""


def assumed(found: Iterable[tuple[str, str]], every: Collection[str] = ()) -> tuple[str, ...]:
    """Return assumptions, each once, with the logs that it is about where these are not all of them.

    Args:
        found: Each with the name of its log: ("the joints are in deg", "matlab").
        every: The names of all logs; without them each assumption has the names of its own.
    """
    names: dict[str, dict[str, None]] = {}
    for said, name in found:
        names.setdefault(said, {})[name] = None
    return tuple(
        said if set(about) == set(every) else f"{said} ({_named(list(about))})"
        for said, about in names.items()
    )


def _named(names: Sequence[str]) -> str:
    """Return some logs by their names, or how many they are."""
    return ", ".join(names) if len(names) <= NAMED else f"{len(names)} logs"


def assuming(assumptions: Sequence[str]) -> str:
    """Return what a verdict's line ends with: ", assuming the joints are in deg"; perhaps nothing."""
    return f", assuming {' and '.join(assumptions)}" if assumptions else ""
