"""`urmpipe.ingest`: a log becomes a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Unpack

from urmpipe.api.write_map import write_map_part
from urmpipe.arm_placing import Frame, Robot
from urmpipe.keyword_checks import (
    WRITTEN_FIRST,
    PathLike,
    one_or_many,
    paths,
    public_reading,
    refuse_others,
    refuse_warnings,
)
from urmpipe.output_files import guarded_outputs, recorded
from urmpipe.reading import Reading, map_files, resolved
from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, LogError, for_each
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.outputs import OutputKind
from urmpipe_pipeline.recording import is_recording
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.presenter import audit_rows
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.tables.table_csv import write_table

LOG_ALLOWED = f"a file, several of one log, or a folder of them; {WRITTEN_FIRST}"


@public_reading(Reading)
def ingest(
    log: PathLike | Sequence[PathLike],
    robot: Robot | None = None,
    *,
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
        log: The log's file; several files, or a folder of them, if its source writes one a plot.
        robot: The arm; without it there are no kinematics.
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
        lambda: resolved(reading, robot, base, tool, base_link, tip_link),
        lambda: _files_and_name(log),
    )
    given, (files, name) = for_each(lambda make: make(), parts)
    outputs: dict[OutputKind, PathLike | None] = {"recording": output, "audit": audit, "map": write_map}
    kept = [*files, *map_files(reading), *paths(inputs)]
    with guarded_outputs(outputs, kept) as written:
        run = ingest_log(
            files, robot=given.arm, read=given.options, tsp=tsp, derivative=derivative, name=name
        )
        refuse_warnings(strict, run.warnings)
        if audit is not None:
            write_table(audit_rows(run), written["audit"], Path(audit))
        if write_map is not None:
            named = None if given.robot is None or isinstance(given.robot, Chain) else str(given.robot)
            write_map_part(run, written["map"], Path(write_map), named)
        return recorded(run, output, kept, progress)


def _files_and_name(log: PathLike | Sequence[PathLike]) -> tuple[list[Path], str | None]:
    """Return the files of one log, and its name where that is a folder's."""
    operands = one_or_many(log)
    refuse_others("log", operands, (), LOG_ALLOWED)
    given = [Path(one) for one in operands]
    recordings = [str(path) for path in given if path.is_file() and is_recording(path)]
    if recordings:
        raise LogError(*(Finding("found a recording, allowed: a log (CSV)", file) for file in recordings))
    name = given[0].resolve().name if given[0].is_dir() else None
    return [file for path in given for file in log_files(path)], name
