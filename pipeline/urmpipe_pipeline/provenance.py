"""What a result depends on.

- `Provenance`, `build_provenance`: inputs by hash, options and versions, to repeat it.
- `format_defaults`, `list_assumptions`, `format_assumptions`: options from files and assumptions in the line
  of a verdict.
"""

from __future__ import annotations

import platform
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Any

from urmpipe_pipeline.joint_log import SourceFile

LIBRARIES = ("urmpipe", "numpy", "pyarrow", "rerun-sdk")  # distributions that compute or record
MAX_NAMED_LOGS = 3  # of an assumption; more are counted


@dataclass(frozen=True, slots=True)
class Provenance:
    """Inputs, options and versions of a result, to repeat it.

    Attributes:
        command: The function, such as ingest, compare or ik.
        options: Its options by name.
        inputs: The input files.
        versions: Versions of urmpipe, Python and the libraries that computed.
        created: Time in UTC, ISO 8601.
        defaults: Options from a file that decide a verdict: "tolerance=2mm from ../urmpipe.toml".
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
    """Return the provenance of a result that is made now; options that are None are left out."""
    options = {name: value for name, value in options.items() if value is not None}
    created = datetime.now(UTC).isoformat(timespec="seconds")
    return Provenance(command, options, tuple(dict.fromkeys(inputs)), dict(_versions()), created, defaults)


@cache  # reading them takes a tenth of the time of a short log
def _versions() -> Mapping[str, str]:
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}


def format_defaults(provenance: Provenance) -> str:
    """Return the options from files for the line of a verdict: "; sync=auto from ../urmpipe.toml"."""
    return "".join(f"; {option}" for option in provenance.defaults)


def list_assumptions(assumptions: Iterable[tuple[str, str]], logs: Collection[str] = ()) -> tuple[str, ...]:
    """Return assumptions, each once, with the names of their logs unless these are all logs.

    Args:
        assumptions: Each with the name of its log: ("the joints are in deg", "matlab").
        logs: Names of all logs; without them the logs of each assumption are named.
    """
    names: dict[str, dict[str, None]] = {}
    for assumption, log in assumptions:
        names.setdefault(assumption, {})[log] = None
    listed = []
    for assumption, log_names in names.items():
        about = ", ".join(log_names) if len(log_names) <= MAX_NAMED_LOGS else f"{len(log_names)} logs"
        listed.append(assumption if set(log_names) == set(logs) else f"{assumption} ({about})")
    return tuple(listed)


def format_assumptions(assumptions: Sequence[str]) -> str:
    """Return the end of the line of a verdict: ", assuming the joints are in deg"; empty without any."""
    return f", assuming {' and '.join(assumptions)}" if assumptions else ""
