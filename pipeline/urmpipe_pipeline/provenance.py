"""What is needed to repeat a run: inputs by hash, options, versions."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from urmpipe_pipeline.joint_log import SourceFile
from urmpipe_pipeline.results import Provenance

LIBRARIES = ("urmpipe", "numpy", "pyarrow", "rerun-sdk")
"""The distributions whose code made the numbers or the recording."""


def provenance(command: str, options: Mapping[str, Any], inputs: Sequence[SourceFile]) -> Provenance:
    """Return the provenance of a result made now; options that were left at None are left out."""
    given = {name: value for name, value in options.items() if value is not None}
    versions = {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}
    created = datetime.now(UTC).isoformat(timespec="seconds")
    return Provenance(command, given, tuple(dict.fromkeys(inputs)), versions, created)
