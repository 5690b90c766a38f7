"""The public functions: each command is a thin shell around one of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe_models.catalogue import load_robot, robot_names
from urmpipe_models.chain import Chain
from urmpipe_models.errors import Finding, LogError, OptionError, RecordingError
from urmpipe_models.transform import Transform, rpy_of
from urmpipe_pipeline.audit_file import write_audit
from urmpipe_pipeline.compare import CompareOptions, Tcp, compare_recorded, compare_runs
from urmpipe_pipeline.comparison import AlignMode, Comparison
from urmpipe_pipeline.derivatives import Method
from urmpipe_pipeline.ingest import ingest_log
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.operands import load_run, log_files
from urmpipe_pipeline.outputs import OutputKind, guarded_output
from urmpipe_pipeline.recorded_tcp import LACKING_TOOL
from urmpipe_pipeline.recording import is_recording, read_recording, record
from urmpipe_pipeline.results import Run
from urmpipe_pipeline.sources import ReadOptions, map_of, read_map
from urmpipe_pipeline.sync import SyncOption
from urmpipe_pipeline.tolerance import DEFAULT_TOLERANCE

if TYPE_CHECKING:
    import pandas as pd

    from urmpipe_pipeline.export import Exported, Format, Rows
    from urmpipe_pipeline.report import FigureFile
    from urmpipe_pipeline.report.headless import FigureFormat

PathLike = str | Path
Robot = Chain | str | Path


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """A report that was written.

    Attributes:
        path: The HTML file.
        results: What it shows.
        figures: The files of its figures; none unless they were asked for.
    """

    path: Path
    results: tuple[Run | Comparison, ...]
    figures: tuple[FigureFile, ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """Return one row a compared log and quantity, as `Comparison.to_frame`, for all comparisons in it."""
        import pandas as pd

        frames = [result.to_frame() for result in self.results if isinstance(result, Comparison)]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe report --json` prints."""
        kinds = [
            {"name": result.name, "verdict": result.verdict if isinstance(result, Comparison) else None}
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
    _refuse_shared(targets)
    kept = [*files, *map(Path, inputs)]
    with ExitStack() as stack:
        parts = {
            kind: stack.enter_context(guarded_output(path, kept, kind))
            for kind, path in targets.items()
            if kind != "recording"
        }

        def make(early: Callable[[JointLog | Run], None] | None) -> Run:
            run = ingest_log(
                files, robot=arm, read=read, tsp=tsp, derivative=derivative, name=name, early=early
            )
            _refuse_warnings(strict, run.warnings)
            if "audit" in parts:
                write_audit(run, parts["audit"], targets["audit"])
            if "map" in parts:
                _write_map(run, parts["map"], targets["map"], map_robot)
            return run

        return make(None) if output is None else record(make, Path(output), kept, progress)


def compare(
    reference: PathLike | Run,
    logs: Sequence[PathLike | Run] = (),
    *,
    robot: Robot | None = None,
    base: Transform | None = None,
    tool: Transform | None = None,
    read: ReadOptions | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    tolerance: float | Mapping[str, float] = DEFAULT_TOLERANCE,
    tcp: Tcp = "fk",
    sync: SyncOption = "start",
    align: AlignMode = "none",
    strict: bool = False,
    output: PathLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> Comparison:
    """Hold logs against a reference: deviation, statistics and verdict.

    Args:
        reference: A path (t, x, y, z), a log, or a recording. Without `logs` it is a log that
            recorded its own tool centre point: its forward kinematics are held against that.
        logs: The logs or recordings to judge.
        robot: Name, file (TOML, URDF) or chain of the arm; a recording brings its own.
        base: Where the arm stands in the world.
        tool: The tool centre point in the frame of the arm's tip.
        read: How to read a file where it cannot tell by itself.
        tsp: Period of the grid in [s]; default: each log's own.
        derivative: central or savgol; default: savgol for quantised logs, else central.
        tolerance: Largest deviation allowed on an axis in [m], or in [m] and [rad] by kind: axis, norm, path,
            angle, joint, or x, y, z.
        tcp: fk or recorded: where a log was.
        sync: How the clocks are put together: start (both start together), auto (by the motion), or the
            offset in [s]: t_reference = t_log + offset.
        align: How a log is moved in space before it is compared: none, start (the first poses agree), rigid
            (the best rigid motion), tool (the best constant offset of the tool centre point).
        strict: Whether a warning is an error.
        output: The recording (.rrd) to write.
        progress: Told the share of the recording that is written, 0..1.

    Returns:
        The comparison: its verdict, `to_frame()`, `to_dict()`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.

    Source: [UrmArm2021]_ eq. 19-23.
    """
    allowed = tolerance if isinstance(tolerance, Mapping) else {"axis": tolerance}
    options = CompareOptions(allowed, tcp, sync, align)
    arm = place_robot(robot, base, tool)

    def run_of(operand: PathLike | Run) -> Run:
        if isinstance(operand, Run):
            return operand
        return load_run(Path(operand), robot=arm, read=read, tsp=tsp, derivative=derivative)

    first, others = run_of(reference), [run_of(log) for log in logs]
    result = compare_runs(first, others, options) if others else compare_recorded(first, options)
    judged = others or [first]  # the reference's own stand among those of the comparison
    doubts = [w for w in result.warnings if w.kind != LACKING_TOOL]  # that one explains a verdict of fail
    _refuse_warnings(strict, (*(w for run in judged for w in run.warnings), *doubts))
    if output is None:
        return result
    inputs = [Path(operand) for operand in (reference, *logs) if not isinstance(operand, Run)]
    return record(lambda early: result, Path(output), inputs, progress)


def report(
    results: Sequence[PathLike | Run | Comparison],
    output: PathLike,
    *,
    figures: PathLike | None = None,
    formats: Sequence[FigureFormat] = ("svg", "png"),
    progress: Callable[[float], None] | None = None,
) -> Report:
    """Write one self-contained HTML file about recordings or results, and its figures as files: all or none.

    Args:
        results: Recordings (.rrd), or what `ingest` and `compare` returned; at least one.
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
    _refuse_foreign(files)
    reading, writing = _halves(progress)
    shown = []
    for number, one in enumerate(results, start=1):
        shown.append(read_recording(Path(one)) if isinstance(one, (str, Path)) else one)
        reading(number / len(results))
    written = write_report(shown, Path(output), files, wanted, writing)
    return Report(written.path, tuple(shown), written.figures)


def _halves(progress: Callable[[float], None] | None) -> tuple[Callable[[float], None], ...]:
    """Return what to tell the progress of the first and of the second half of some work."""
    tell = progress or (lambda share: None)
    return lambda share: tell(share / 2), lambda share: tell((1 + share) / 2)


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
    text = map_of(run.log, robot, *(_offset(frame) for frame in frames), given=given)
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


def _refuse_shared(targets: Mapping[OutputKind, Path]) -> None:
    """Raise an `OptionError` if two outputs have one name."""
    places: dict[Path, OutputKind] = {}
    for kind, path in targets.items():
        other = places.setdefault(path.resolve(), kind)
        if other != kind:
            raise OptionError(f"found {path} as {other} and as {kind}; allowed: a name for each")


def _offset(frame: Transform) -> tuple[float, ...]:
    """Return a frame as X, Y, Z in [m], with RX, RY, RZ in [rad] if it turns; nothing for none at all."""
    if frame == Transform():
        return ()
    turn = () if frame.rotation == Transform().rotation else rpy_of(frame.rotation)
    return tuple(float(value) + 0.0 for value in (*frame.translation, *turn))  # + 0.0: no -0.0 in the file


def export(
    result: PathLike | Run | Comparison,
    output: PathLike | None = None,
    *,
    to: Format | None = None,
    rows: Rows | None = None,
    tcp: Tcp | None = None,
) -> Exported:
    """Write a run or a comparison as tables (CSV, Parquet, MAT) or as trajectories (TUM).

    Args:
        result: A recording (.rrd), or what `ingest` or `compare` returned.
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
    if isinstance(result, (Run, Comparison)):
        return export_result(result, target, options, [result.recording] if result.recording else [])
    _refuse_foreign([Path(result)])
    return export_result(read_recording(Path(result)), target, options, [Path(result)])


def place_robot(
    robot: Robot | None,
    base: Transform | None = None,
    tool: Transform | None = None,
    *,
    base_link: str | None = None,
    tip_link: str | None = None,
) -> Chain | None:
    """Return the arm on its base and with its tool; None without a robot.

    Args:
        robot: Name, file (TOML, URDF) or chain of the arm.
        base: Where the arm stands in the world.
        tool: The tool centre point in the frame of the arm's tip.
        base_link: Link of a URDF where the arm begins.
        tip_link: Link of a URDF where it ends.

    Raises:
        RobotError: If the robot is unknown, or with everything that is wrong with its file.
        OptionError: If the arm is placed or cut, but there is none.
    """
    if robot is not None:
        chain = (
            robot if isinstance(robot, Chain) else load_robot(robot, base_link=base_link, tip_link=tip_link)
        )
        return chain.placed(base, tool)
    if any(value is not None for value in (base, tool, base_link, tip_link)):
        raise OptionError(
            "found --base, --tool, --base-link or --tip without a robot; allowed: with --robot NAME|FILE"
        )
    return None


def _refuse_foreign(files: Sequence[Path]) -> None:
    """Raise a `RecordingError` with all files that are there and are no recordings."""
    foreign = [path for path in files if path.exists() and not is_recording(path)]
    if foreign:
        message = "found no recording of urmpipe, allowed: a .rrd that ingest or compare wrote"
        raise RecordingError(*(Finding(message, file=str(path)) for path in foreign))


def _refuse_warnings(strict: bool, warnings: Sequence[LogWarning]) -> None:
    if strict and warnings:
        raise LogError(*(Finding(f"{w.kind}: {w.message} (--strict)", row=w.row) for w in warnings))


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
