"""`urmpipe.export`: a result as tables or trajectories for other programs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

from urmpipe.parameters import kinds
from urmpipe.parameters.outputs import Export
from urmpipe.public_functions import PathLike, check_types, public_function, require_recordings
from urmpipe_pipeline import results
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.results import read_recording

if TYPE_CHECKING:
    from urmpipe_pipeline.tables import Exported


@public_function(Export, output=kinds.ANY_FILE)
def export(result: PathLike | Result, output: PathLike | None = None, **options: Unpack[Export]) -> Exported:
    """Write a run, a comparison or a simulation as tables (CSV, Parquet, MAT) or as trajectories (TUM).

    Args:
        result: A recording (.rrd), or what `ingest`, `compare` or `simulate` returned.
        output: The file to write; default: NAME-grid.csv and the like in the working folder.
        **options: `to`: the format; `rows`: grid (t, q, rates and the tool centre point on the run's grid, in
            SI) or file (the columns of the log that were used as its file has them: their names, units, rows,
            numbers and clock), default: grid, file with tcp recorded; `tcp`: the poses of a trajectory.

    Raises:
        UrmpipeError: With everything that is wrong with the recording, the options or the output.
    """
    from urmpipe_pipeline.tables import ExportOptions, export_result, format_of

    values: Mapping[str, Any] = options  # as their kinds read them
    target = None if output is None else Path(output)
    chosen = ExportOptions(format_of(values["to"], target), values["rows"], values["tcp"])
    if results.is_result(result):
        recording: Path | None = result.recording
    else:
        check_types("result", [result], (), "a recording, or a result such as a Run or a Comparison")
        recording = Path(cast("PathLike", result))
        require_recordings([recording])
        result = read_recording(recording, lazy=True)
    kept = [*([recording] if recording else []), *values["inputs"]]
    return export_result(results.exports(result), recording, target, chosen, kept)
