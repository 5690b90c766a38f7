"""A result exported as `urmpipe.export` does it, without a recording in between."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from urmpipe_pipeline import results
from urmpipe_pipeline.tables import Exported, ExportOptions
from urmpipe_pipeline.tables import export_result as export


def export_result(
    result: Any, output: Path | None, options: ExportOptions, inputs: Sequence[Path] = ()
) -> Exported:
    """Write a result as tables or trajectories."""
    return export(results.exports(result), result.recording, output, options, inputs)
