"""`urmpipe.ingest`: a log becomes a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

from numpy.typing import ArrayLike

from urmpipe.api.write_map import write_map_part
from urmpipe.arm_placing import Robot
from urmpipe.output_files import guarded_outputs
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import LOG_PARAMETERS, Ingest
from urmpipe.public_functions import PathLike, as_list, check_types, public_function, raise_warnings
from urmpipe.reading import map_files, resolve_reading
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Finding, OptionError, map_collecting_errors
from urmpipe_pipeline.logs import MemoryTable, TableLike, arrays_to_table, dataframe_to_table, is_table
from urmpipe_pipeline.operands import log_files, recording_to_run
from urmpipe_pipeline.outputs import OutputKind
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.presenter import audit_rows
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables.csv_files import write_table

LOG_ALLOWED = "a file, several of one log, a folder of them, a DataFrame or Arrow table, or arrays by t=, q="

IN_MEMORY = "log"  # name of a log that is not from a file
NAME = kinds.text("NAME")


@public_function(Ingest, robot=kinds.ROBOT, name=NAME)
def ingest(
    log: PathLike | Sequence[PathLike] | TableLike | None = None,
    robot: Robot | None = None,
    *,
    t: ArrayLike | None = None,
    q: ArrayLike | None = None,
    recorded_tcp: ArrayLike | None = None,
    name: str | None = None,
    **options: Unpack[Ingest],
) -> Run:
    """Turn one log into a run, and write what is named: all or none. docs/python.md has the keywords.

    Args:
        log: The log's file; several files, or a folder of them, if its source writes one per plot; or a
            table: a DataFrame, or a table of Arrow. Without one: arrays. Of a recording it is the run inside.
        robot: The arm; without it there are no kinematics.
        t: Times in [s], or as datetime64 or timedelta64, shape (n,); default: `period` from row to row.
        q: Joint values in [rad] or [m], shape (n, joints); `unit` states another unit of angles.
        recorded_tcp: The recorded tool centre point in [m], shape (n, 3), with quaternions x, y, z, w after
            it, shape (n, 7), or as matrices, shape (n, 4, 4).
        name: Name of the log; default: its file's stem, else "log".
        **options: How the log is read, where the arm is placed, what is written: the options of
            `urmpipe ingest`, by their names.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    parts: tuple[Callable[[], Any], ...] = (
        lambda: resolve_reading(values, robot),
        lambda: _files_and_name(log, {"t": t, "q": q, "recorded_tcp": recorded_tcp}),
    )
    resolved, (files, folder) = map_collecting_errors(lambda part: part(), parts)
    read = resolved.options
    if not files:
        table = arrays_to_table(t, q, recorded_tcp, read.names, name or IN_MEMORY, resolved.arm, read.unit)
        files, read = [table], replace(read, names=())
    outputs: dict[OutputKind, PathLike | None] = {
        "recording": values["output"], "audit": values["audit"], "map": values["write_map"],
    }  # fmt: skip
    kept = [*(file for file in files if isinstance(file, Path)), *map_files(values), *values["inputs"]]
    with guarded_outputs(outputs, kept) as written:
        of_logs = {key: values[key] for key in LOG_PARAMETERS} | {"name": name}
        run = recording_to_run(files, resolved.arm, of_logs) or ingest_log(
            files,
            robot=resolved.arm,
            read=read,
            tsp=values["tsp"],
            derivative=values["derivative"],
            name=name or folder,
        )
        raise_warnings(values["strict"], run.warnings)
        written.write("audit", lambda part, path: write_table(audit_rows(run), part, path))
        arm = None if resolved.robot is None or isinstance(resolved.robot, Chain) else str(resolved.robot)
        written.write("map", lambda part, path: write_map_part(run, part, path, arm))
        return written.recorded(run, values["progress"])


def _files_and_name(log: Any, arrays: Mapping[str, Any]) -> tuple[list[Path | MemoryTable], str | None]:
    """Return the files of a log, or its table, and the name of its folder; no files if arrays are given."""
    names = [name for name, array in arrays.items() if array is not None]
    if log is not None and names:
        raise OptionError(Finding(about="log", found=f"a log and {', '.join(names)}", allowed="one of them"))
    if names:
        return [], None
    if is_table(log):
        return [dataframe_to_table(log, IN_MEMORY)], None
    operands = [] if log is None else as_list(log)
    check_types("log", operands, (), LOG_ALLOWED)
    paths = [Path(operand) for operand in operands]
    name = paths[0].resolve().name if paths[0].is_dir() else None
    return [file for path in paths for file in log_files(path)], name
