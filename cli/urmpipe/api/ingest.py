"""`urmpipe.ingest`: a log becomes a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

from numpy.typing import ArrayLike

from urmpipe.api.write_map import write_map_part
from urmpipe.arm_placing import Frame, Robot
from urmpipe.keyword_checks import (
    PathLike,
    one_or_many,
    paths,
    public_reading,
    refuse_others,
    refuse_warnings,
)
from urmpipe.output_files import guarded_outputs
from urmpipe.reading import Reading, map_files, resolved
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Finding, OptionError, map_collecting_errors
from urmpipe_pipeline.operands import log_files, recording_to_run
from urmpipe_pipeline.outputs import OutputKind
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.presenter import audit_rows
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources import Held, TableLike, held_of, held_of_arrays, is_table
from urmpipe_pipeline.tables.csv_files import write_table

LOG_ALLOWED = "a file, several of one log, a folder of them, a DataFrame or Arrow table, or arrays by t=, q="

IN_MEMORY = "log"
"""What a log is called that came from no file."""


@public_reading(Reading)
def ingest(
    log: PathLike | Sequence[PathLike] | TableLike | None = None,
    robot: Robot | None = None,
    *,
    t: ArrayLike | None = None,
    q: ArrayLike | None = None,
    recorded_tcp: ArrayLike | None = None,
    names: Sequence[str] | None = None,
    name: str | None = None,
    base: Frame | None = None,
    tool: Frame | None = None,
    base_link: str | None = None,
    tip_link: str | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    strict: bool = False,
    output: PathLike | None = None,
    audit: PathLike | None = None,
    write_map: PathLike | None = None,
    inputs: Sequence[PathLike] = (),
    progress: Callable[[float], None] | None = None,
    **reading: Unpack[Reading],
) -> Run:
    """Turn one log into a run, and write what is named: all or none. docs/python.md has the keywords.

    Args:
        log: The log's file; several files, or a folder of them, if its source writes one a plot; or a table:
            a DataFrame, or a table of Arrow. Without one: arrays. Of a recording it is the run inside.
        robot: The arm; without it there are no kinematics.
        t: Times in [s], or as datetime64 or timedelta64, shape (n,); default: `period` apart.
        q: Joint values in [rad] or [m], shape (n, joints); of angles `unit` says otherwise.
        recorded_tcp: The recorded tool centre point in [m], shape (n, 3), with quaternions x, y, z, w behind,
            shape (n, 7), or as matrices, shape (n, 4, 4).
        names: What to call the joints, in their order; default: as their columns, of arrays q1, q2, ...
        name: What to call the log; default: its file's stem, else "log".
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        base_link: Link of a URDF where the arm begins; default: its root.
        tip_link: Link of a URDF where the arm ends; default: its end.
        tsp: Period of the grid in [s]; default: the log's own.
        derivative: central or savgol; default: savgol for quantised logs, else central.
        strict: Whether a warning is an error.
        output: The recording (.rrd) to write.
        audit: A CSV file to write the repolarizer's audit to.
        write_map: A TOML file to write the map to, by which further logs read as this one was read.
        inputs: Files besides the log that are never replaced, such as the map it was read by.
        progress: Told the share of the recording that is written, 0..1.
        **reading: How to read the log where it cannot tell by itself: unit, time, joints, log_map and the
            others of `urmpipe.Reading`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.
    """
    parts: tuple[Callable[[], Any], ...] = (
        lambda: resolved(reading, robot, base, tool, base_link, tip_link, names),
        lambda: _files_and_name(log, given={"t": t, "q": q, "recorded_tcp": recorded_tcp}),
    )
    given, (files, folder) = map_collecting_errors(lambda make: make(), parts)
    unread = {**reading, "tsp": tsp, "derivative": derivative, "names": names, "name": name}
    options = given.options
    if not files:
        held = held_of_arrays(t, q, recorded_tcp, options.names, name or IN_MEMORY, given.arm, options.unit)
        files, options = [held], replace(options, names=())
    outputs: dict[OutputKind, PathLike | None] = {"recording": output, "audit": audit, "map": write_map}
    kept = [*_paths(files), *map_files(reading), *paths(inputs)]
    with guarded_outputs(outputs, kept) as written:
        run = recording_to_run(files, given.arm, unread) or ingest_log(
            files, robot=given.arm, read=options, tsp=tsp, derivative=derivative, name=name or folder
        )
        refuse_warnings(strict, run.warnings)
        written.write("audit", lambda part, path: write_table(audit_rows(run), part, path))
        named = None if given.robot is None or isinstance(given.robot, Chain) else str(given.robot)
        written.write("map", lambda part, path: write_map_part(run, part, path, named))
        return written.recorded(run, progress)


def _files_and_name(log: Any, given: Mapping[str, Any]) -> tuple[list[Path | Held], str | None]:
    """Return the files of one log, or its table, and its name where that is a folder's; nothing of arrays."""
    arrays = [name for name, array in given.items() if array is not None]
    if log is not None and arrays:
        raise OptionError(Finding(about="log", found=f"a log and {', '.join(arrays)}", allowed="one of them"))
    if arrays:
        return [], None
    if is_table(log):
        return [held_of(log, IN_MEMORY)], None
    operands = [] if log is None else one_or_many(log)
    refuse_others("log", operands, (), LOG_ALLOWED)
    paths_given = [Path(one) for one in operands]
    name = paths_given[0].resolve().name if paths_given[0].is_dir() else None
    return [file for path in paths_given for file in log_files(path)], name


def _paths(files: Sequence[Path | Held]) -> list[Path]:
    """Return those of a log's files that are files: no output replaces them."""
    return [one for one in files if isinstance(one, Path)]
