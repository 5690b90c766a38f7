"""`urmpipe.export`: a result as tables or trajectories for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from urmpipe.edge import public
from urmpipe.guards import PathLike, paths, refuse_foreign, refuse_others
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.recording import read_recording
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation

if TYPE_CHECKING:
    from urmpipe_pipeline.comparison.compare import Tcp
    from urmpipe_pipeline.export import Exported, Format, Rows


@public
def export(
    result: PathLike | Result,
    output: PathLike | None = None,
    *,
    to: Format | None = None,
    rows: Rows | None = None,
    tcp: Tcp | None = None,
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
    from urmpipe_pipeline.export import ExportOptions, export_result, format_of

    target = None if output is None else Path(output)
    options = ExportOptions(format_of(to, target), rows, tcp)
    kept = paths(inputs)
    if isinstance(result, (Run, Comparison, Simulation)):
        own = [result.recording] if result.recording else []
        return export_result(result, target, options, [*own, *kept])
    refuse_others("result", [result], (), "a recording, a Run, a Comparison or a Simulation")
    refuse_foreign([Path(result)])
    return export_result(read_recording(Path(result)), target, options, [Path(result), *kept])
