"""The public functions: each command is a thin shell around one of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe.guards import (
    PathLike,
    Robot,
    offset_of,
    place_robot,
    refuse_foreign,
    refuse_shared,
    refuse_warnings,
)
from urmpipe_models.catalogue import robot_names
from urmpipe_models.errors import Finding, LogError, for_each
from urmpipe_models.transform import Transform
from urmpipe_pipeline.audit_file import write_audit
from urmpipe_pipeline.comparison import Comparison
from urmpipe_pipeline.derivatives import Method
from urmpipe_pipeline.ingest import ingest_log
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.outputs import OutputKind, guarded_output
from urmpipe_pipeline.recording import is_recording, read_recording, record
from urmpipe_pipeline.results import Run
from urmpipe_pipeline.simulation import Result, Simulation
from urmpipe_pipeline.sources import ReadOptions, map_of, read_map

if TYPE_CHECKING:
    import pandas as pd

    from urmpipe_pipeline.compare import Tcp
    from urmpipe_pipeline.export import Exported, Format, Rows
    from urmpipe_pipeline.report import FigureFile
    from urmpipe_pipeline.report.headless import FigureFormat

__all__ = [
    "PathLike", "Report", "Robot", "export", "ingest", "place_robot", "read_options", "report",
    "write_map",
]  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """A report that was written.

    Attributes:
        path: The HTML file.
        results: What it shows.
        figures: The files of its figures; none unless they were asked for.
    """

    path: Path
    results: tuple[Result, ...]
    figures: tuple[FigureFile, ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """Return one row a compared log and quantity, as `Comparison.to_frame`, for all comparisons in it."""
        import pandas as pd

        frames = [result.to_frame() for result in self.results if isinstance(result, Comparison)]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe report --json` prints."""
        kinds = [
            {"name": result.name, "verdict": None if isinstance(result, Run) else result.verdict}
            for result in self.results
        ]
        return {
            "schema": 1,
            "report": str(self.path),
            "recordings": kinds,
            "figures": [figure.to_dict() for figure in self.figures],
        }


def ingest(
    log: PathLike | Sequence[PathLike],
    *,
    robot: Robot | None = None,
    base: Transform | None = None,
    tool: Transform | None = None,
    read: ReadOptions | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    strict: bool = False,
    output: PathLike | None = None,
    audit: PathLike | None = None,
    log_map: PathLike | None = None,
    map_robot: str | None = None,
    inputs: Sequence[PathLike] = (),
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Turn one log into a run, and write its recording, audit and map if they are named: all or none.

    Args:
        log: The log's file; several files, or a folder of them, if its source writes one a plot.
        robot: Name, file (TOML, URDF) or chain of the arm; without it there are no kinematics.
        base: Where the arm stands in the world.
        tool: The tool centre point in the frame of the arm's tip.
        read: How to read the file where it cannot tell by itself.
        tsp: Period of the grid in [s]; default: the log's own.
        derivative: central or savgol; default: savgol for quantised logs, else central.
        strict: Whether a warning is an error.
        output: The recording (.rrd) to write.
        audit: A CSV file to write the repolarizer's audit to.
        log_map: A TOML file to write the map to, by which further logs read as this one was read.
        map_robot: Name or file of the arm in that map; default: its name, if it is one of the catalogue.
        inputs: Files besides the log that are never replaced, such as the map it was read by.
        progress: Told the share of the recording that is written, 0..1.

    Returns:
        The run: arrays in SI, `to_frame()`, `to_dict()`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.
    """
    files, name = _files_and_name(log)
    arm = place_robot(robot, base, tool)
    named: dict[OutputKind, PathLike | None] = {"recording": output, "audit": audit, "map": log_map}
    targets = {kind: Path(path) for kind, path in named.items() if path is not None}
    refuse_shared(targets)
    kept = [*files, *map(Path, inputs)]
    with ExitStack() as stack:
        parts = {
            kind: stack.enter_context(guarded_output(path, kept, kind))
            for kind, path in targets.items()
            if kind != "recording"
        }

        def make(early: Callable[[JointLog | Run], None] | None) -> Run:
            """Return the run; write its audit and its map."""
            run = ingest_log(
                files, robot=arm, read=read, tsp=tsp, derivative=derivative, name=name, early=early
            )
            refuse_warnings(strict, run.warnings)
            if "audit" in parts:
                write_audit(run, parts["audit"], targets["audit"])
            if "map" in parts:
                _write_map(run, parts["map"], targets["map"], map_robot)
            return run

        return make(None) if output is None else record(make, Path(output), kept, progress)


def report(
    results: Sequence[PathLike | Result],
    output: PathLike,
    *,
    figures: PathLike | None = None,
    formats: Sequence[FigureFormat] = ("svg", "png"),
    progress: Callable[[float], None] | None = None,
) -> Report:
    """Write one self-contained HTML file about recordings or results, and its figures as files: all or none.

    Args:
        results: Recordings (.rrd), or what `ingest`, `compare` and `simulate` returned.
        output: The HTML file to write.
        figures: A folder to write every figure to as a file; needs the extra `figures` and Chromium.
        formats: svg, png or both.
        progress: Told the share that is done, 0..1.

    Raises:
        UrmpipeError: With everything that is wrong with the recordings or the output.
    """
    from urmpipe_pipeline.report import FigureOptions, write_report

    wanted = None if figures is None else FigureOptions(Path(figures), tuple(formats))
    files = [Path(one) for one in results if isinstance(one, (str, Path))]
    refuse_foreign(files)
    reading, writing = _halves(progress)

    def read(numbered: tuple[int, PathLike | Result]) -> Result:
        """Return a result, read if it is a recording, and tell how far it is."""
        number, one = numbered
        found = read_recording(Path(one)) if isinstance(one, (str, Path)) else one
        reading(number / len(results))
        return found

    shown = for_each(read, enumerate(results, start=1))
    written = write_report(shown, Path(output), files, wanted, writing)
    return Report(written.path, tuple(shown), written.figures)


def _halves(progress: Callable[[float], None] | None) -> tuple[Callable[[float], None], ...]:
    """Return what to tell the progress of the first and of the second half of some work."""
    tell = progress or (lambda share: None)
    return lambda share: tell(share / 2), lambda share: tell((1 + share) / 2)


def view(recordings: PathLike | Sequence[PathLike]) -> None:
    """Open recordings in the viewer, each in a window paused at its worst sample; return when all are closed.

    Args:
        recordings: Recordings (.rrd) that urmpipe wrote.

    Raises:
        UrmpipeError: With every file that is no recording, or if the viewer cannot be shown here.
    """
    from urmpipe_pipeline.recording.viewer import view_recordings

    given = [recordings] if isinstance(recordings, (str, Path)) else recordings
    view_recordings([Path(one) for one in given])


def write_map(run: Run, output: PathLike, inputs: Sequence[PathLike] = (), robot: str | None = None) -> Path:
    """Write the map (TOML) by which further logs read as this one was read.

    Args:
        run: An ingested log.
        output: The file to write; only another map of ours is replaced.
        inputs: Files that may not be overwritten.
        robot: Name or file of the arm; default: its name, if it is one of the catalogue.

    Raises:
        UrmpipeError: If it may not be written there.
    """
    path = Path(output)
    with guarded_output(path, [Path(one) for one in inputs], "map") as part:
        _write_map(run, part, path, robot)
    return path


def _write_map(run: Run, part: Path, path: Path, robot: str | None) -> None:
    """Write the map of a run to a part that is to have a name, and read it back."""
    arm = run.robot
    if robot is None:
        robot = arm.name if arm and arm.name in robot_names() else None
    elif Path(robot).suffix:
        robot = os.path.relpath(robot, path.parent)
    frames = (arm.base, arm.tool) if arm else ()
    given = run.provenance.options.get("read") or {}
    text = map_of(run.log, robot, *(offset_of(frame) for frame in frames), given=given)
    part.write_text(text, encoding="utf-8", newline="\n")
    read_map(part)


def _files_and_name(log: PathLike | Sequence[PathLike]) -> tuple[list[Path], str | None]:
    """Return the files of one log, and its name where that is a folder's."""
    given = [Path(log)] if isinstance(log, (str, Path)) else [Path(one) for one in log]
    recordings = [str(path) for path in given if path.is_file() and is_recording(path)]
    if recordings:
        raise LogError(*(Finding("found a recording, allowed: a log (CSV)", file) for file in recordings))
    name = given[0].resolve().name if given[0].is_dir() else None
    return [file for path in given for file in log_files(path)], name


def export(
    result: PathLike | Result,
    output: PathLike | None = None,
    *,
    to: Format | None = None,
    rows: Rows | None = None,
    tcp: Tcp | None = None,
) -> Exported:
    """Write a run, a comparison or a simulation as tables (CSV, Parquet, MAT) or as trajectories (TUM).

    Args:
        result: A recording (.rrd), or what `ingest`, `compare` or `simulate` returned.
        output: The file to write; default: NAME-grid.csv and the like in the working folder.
        to: csv, parquet, mat or tum; default: by the output's suffix.
        rows: grid: t, q, rates and the tool centre point on the run's grid, in SI; file: the columns of
            the log that were used as its file has them: their names, units, rows, numbers and clock.
            Default: grid; file with tcp recorded.
        tcp: Of a trajectory: fk (default) by forward kinematics, recorded as the log has it.

    Raises:
        UrmpipeError: With everything that is wrong with the recording, the options or the output.
    """
    from urmpipe_pipeline.export import ExportOptions, export_result, format_of

    target = None if output is None else Path(output)
    options = ExportOptions(format_of(to, target), rows, tcp)
    if isinstance(result, (Run, Comparison, Simulation)):
        return export_result(result, target, options, [result.recording] if result.recording else [])
    refuse_foreign([Path(result)])
    return export_result(read_recording(Path(result)), target, options, [Path(result)])


def read_options(values: Mapping[str, Any], otherwise: ReadOptions | None = None) -> ReadOptions:
    """Return the reading options among some named values; None means not given.

    Args:
        values: Options by name, others among them.
        otherwise: What holds where nothing is given, such as that of a map. Units of single columns and
            intervals of single joints add up; joints given anew leave behind what belonged to the others:
            names, signs, offsets and intervals.
    """
    base = otherwise or ReadOptions()
    known = {field.name for field in fields(ReadOptions)}
    given = {name: value for name, value in values.items() if name in known and value is not None}
    given["units"] = {**base.units, **given.get("units", {})}
    if "joints" in given:
        given = {"names": (), "signs": (), "offsets": (), "interval": {}, **given}
    elif "" not in given.get("interval", {"": None}):
        given["interval"] = {**base.interval, **given["interval"]}
    return replace(base, **given)
