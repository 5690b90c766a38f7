"""`urmpipe.export`: a result as tables or trajectories for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

from urmpipe.keyword_checks import PathLike, paths, public, refuse_foreign, refuse_others
from urmpipe_pipeline import results
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.results import read_recording

if TYPE_CHECKING:
    from urmpipe_pipeline.tables import Exported, Format, PoseNames, RowNames


@public
def export(
    result: PathLike | Result,
    output: PathLike | None = None,
    *,
    to: Format | None = None,
    rows: RowNames | None = None,
    tcp: PoseNames | None = None,
    inputs: Sequence[PathLike] = (),
) -> Exported:
    """Write a run, a comparison or a simulation as tables (CSV, Parquet, MAT) or as trajectories (TUM).

    Args:
        result: A recording (.rrd), or what `ingest`, `compare` or `simulate` returned.
        output: The file to write; default: NAME-grid.csv and the like in the working folder.
        to: csv, parquet, mat or tum; default: by the output's suffix, csv without one.
        rows: grid: t, q, rates and the tool centre point on the run's grid, in SI; file: the columns of
            the log that were used as its file has them: their names, units, rows, numbers and clock.
            Default: grid; file with tcp recorded.
        tcp: Of a trajectory: fk (default) by forward kinematics, recorded as the log has it.
        inputs: Files besides the recording that are never replaced.

    Raises:
        UrmpipeError: With everything that is wrong with the recording, the options or the output.
    """
    from urmpipe_pipeline.tables import ExportOptions, export_result, format_of

    target = None if output is None else Path(output)
    options = ExportOptions(format_of(to, target), rows, tcp)
    kept = paths(inputs)
    if results.is_result(result):
        own: Path | None = result.recording
    else:
        refuse_others("result", [result], (), "a recording, or a result such as a Run or a Comparison")
        own = Path(cast("PathLike", result))
        refuse_foreign([own])
        result = read_recording(own, lazy=True)
    return export_result(results.exports(result), own, target, options, [*([own] if own else []), *kept])
