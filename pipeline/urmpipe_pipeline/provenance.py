"""What a result rests on: inputs by hash, options, versions; and the assumptions of a verdict."""

from __future__ import annotations

import platform
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Any

from urmpipe_pipeline.joint_log import SourceFile

LIBRARIES = ("urmpipe", "numpy", "pyarrow", "rerun-sdk")
"""The distributions whose code made the numbers or the recording."""


@dataclass(frozen=True, slots=True)
class Provenance:
    """What is needed to repeat a run.

    Attributes:
        command: Which function made it, such as ingest, compare or ik.
        options: The options that were given, by name.
        inputs: The files it came from.
        versions: Versions of urmpipe, Python and the libraries that computed.
        created: When, in UTC, ISO 8601.
        defaults: Options that decide a verdict and that a file set: "tolerance=2mm from ../urmpipe.toml".
    """

    command: str
    options: Mapping[str, Any]
    inputs: tuple[SourceFile, ...]
    versions: Mapping[str, str]
    created: str
    defaults: tuple[str, ...] = ()


def build_provenance(
    command: str, options: Mapping[str, Any], inputs: Sequence[SourceFile], defaults: tuple[str, ...] = ()
) -> Provenance:
    """Return the provenance of a result made now; options that were left at None are left out."""
    given = {name: value for name, value in options.items() if value is not None}
    created = datetime.now(UTC).isoformat(timespec="seconds")
    return Provenance(command, given, tuple(dict.fromkeys(inputs)), dict(_versions()), created, defaults)


def format_defaults(made: Provenance) -> str:
    """Return what a verdict's line adds of options from files: "; sync=auto from ../urmpipe.toml"."""
    return "".join(f"; {one}" for one in made.defaults)


@cache
def _versions() -> Mapping[str, str]:
    """Return the versions of Python and the libraries: reading them takes a tenth of a short log's time."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}


NAMED = 3
"""Logs that an assumption names; more are only counted."""


def list_assumptions(found: Iterable[tuple[str, str]], every: Collection[str] = ()) -> tuple[str, ...]:
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


def format_assumptions(assumptions: Sequence[str]) -> str:
    """Return what a verdict's line ends with: ", assuming the joints are in deg"; perhaps nothing."""
    return f", assuming {' and '.join(assumptions)}" if assumptions else ""
