"""What is needed to repeat a run: inputs by hash, options, versions."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
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


def provenance(
    command: str, options: Mapping[str, Any], inputs: Sequence[SourceFile], defaults: tuple[str, ...] = ()
) -> Provenance:
    """Return the provenance of a result made now; options that were left at None are left out."""
    given = {name: value for name, value in options.items() if value is not None}
    created = datetime.now(UTC).isoformat(timespec="seconds")
    return Provenance(command, given, tuple(dict.fromkeys(inputs)), dict(_versions()), created, defaults)


def defaults_words(made: Provenance) -> str:
    """Return what a verdict's line adds of options from files: "; sync=auto from ../urmpipe.toml"."""
    return "".join(f"; {one}" for one in made.defaults)


@cache
def _versions() -> Mapping[str, str]:
    """Return the versions of Python and the libraries: reading them takes a tenth of a short log's time."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}
