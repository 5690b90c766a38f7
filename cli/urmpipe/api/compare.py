"""`urmpipe.compare`: logs against a reference, and the result against an earlier one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from urmpipe.guards import PathLike, Robot, place_robot, refuse_foreign, refuse_shared, refuse_warnings
from urmpipe_models.errors import Finding, OptionError, RecordingError, for_each
from urmpipe_models.transform import Transform
from urmpipe_pipeline.comparison.baseline import against_baseline, complete_noise
from urmpipe_pipeline.comparison.compare import CompareOptions, Tcp, compare_recorded, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.junit import write_junit
from urmpipe_pipeline.comparison.left_out import BEYOND
from urmpipe_pipeline.comparison.statistics_table import write_statistics
from urmpipe_pipeline.comparison.sync import SyncOption
from urmpipe_pipeline.comparison.tolerance import DEFAULT_TOLERANCE
from urmpipe_pipeline.comparison.trajectory import AlignMode
from urmpipe_pipeline.operands import load_comparison, load_run
from urmpipe_pipeline.outputs import OutputKind, guarded_output
from urmpipe_pipeline.recording import read_recording, record
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.recorded_tcp import LACKING_TOOL
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.sources import ReadOptions

Operand = PathLike | Run


def compare(
    reference: PathLike | Run | Comparison,
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
    baseline: PathLike | Comparison | None = None,
    noise: float | Mapping[str, float] | None = None,
    output: PathLike | None = None,
    junit: PathLike | None = None,
    statistics: PathLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> Comparison:
    """Hold logs against a reference: deviation, statistics and verdict; write what is named: all or none.

    Args:
        reference: A path (t, x, y, z), a log, or a recording. Without `logs` it is a log that recorded its
            own tool centre point, whose forward kinematics are held against that; or, with a `baseline`, a
            comparison that was made, which stands as it was made.
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
        baseline: An earlier comparison, or its recording: the result tells what changed since (`baseline`).
        noise: Changes since the baseline that mean nothing: of all lengths in [m], or in [m] and [rad] by
            kind; default: 1 um and 1 urad.
        output: The recording (.rrd) to write.
        junit: A JUnit file (XML) to write.
        statistics: A table (CSV) to write, one row a log and quantity.
        progress: Told the share of the recording that is written, 0..1.

    Returns:
        The comparison: its verdict, `to_frame()`, `to_dict()`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.

    Source: [UrmArm2021]_ eq. 19-23.
    """
    allowed = tolerance if isinstance(tolerance, Mapping) else {"axis": tolerance}
    options = CompareOptions(allowed, tcp, sync, align)
    level = complete_noise(noise)
    if noise is not None and baseline is None:
        raise OptionError("--noise: found without --baseline, allowed: with an earlier comparison")
    named: dict[OutputKind, PathLike | None] = {
        "recording": output, "junit": junit, "statistics": statistics,
    }  # fmt: skip
    targets = {kind: Path(path) for kind, path in named.items() if path is not None}
    refuse_shared(targets)
    earlier = None if baseline is None else _earlier(baseline)
    arm = place_robot(robot, base, tool)

    def run_of(operand: Operand) -> Run:
        """Return the run that an operand is, or is read as."""
        if isinstance(operand, Run):
            return operand
        return load_run(Path(operand), robot=arm, read=read, tsp=tsp, derivative=derivative)

    with ExitStack() as stack:
        inputs = _files([reference, *logs, baseline])
        parts = {
            kind: stack.enter_context(guarded_output(path, inputs, kind))
            for kind, path in targets.items()
            if kind != "recording"
        }
        made = None if logs or earlier is None else _made_before(reference, output)
        made = made or _compared(reference, logs, run_of, options)
        _refuse_doubts(strict, made)
        result = made if earlier is None else replace(made, baseline=against_baseline(made, earlier, level))
        if "junit" in parts:
            write_junit(result, parts["junit"], targets["junit"])
        if "statistics" in parts:
            write_statistics(result, parts["statistics"], targets["statistics"])
        return result if output is None else record(lambda early: result, Path(output), inputs, progress)


def _compared(
    reference: Operand | Comparison,
    logs: Sequence[Operand],
    run_of: Callable[[Operand], Run],
    options: CompareOptions,
) -> Comparison:
    """Return the comparison of some logs with a reference, or of one log with what it recorded itself."""
    if isinstance(reference, Comparison):
        raise OptionError("found a comparison as the reference, allowed: with a baseline, and without logs")
    first, *others = for_each(run_of, (reference, *logs))
    return compare_runs(first, others, options) if others else compare_recorded(first, options)


def _made_before(reference: Operand | Comparison, output: PathLike | None) -> Comparison | None:
    """Return the comparison that the reference is; None if it is a log, a path or a run.

    Raises:
        OptionError: If it is to be recorded again.
    """
    if isinstance(reference, Run):
        return None
    made = reference if isinstance(reference, Comparison) else load_comparison(Path(reference))
    if made is not None and output is not None:
        raise OptionError(f"-o: found {output} with a comparison that stands already, allowed: without")
    return made


def _earlier(baseline: PathLike | Comparison) -> Comparison:
    """Return the comparison that a baseline is."""
    if isinstance(baseline, Comparison):
        return baseline
    path = Path(baseline)
    refuse_foreign([path])
    result = read_recording(path)
    if not isinstance(result, Comparison):
        held = "one log" if isinstance(result, Run) else "a simulation"
        raise RecordingError(
            Finding(f"found the recording of {held}, allowed: that of a comparison (--baseline)", str(path))
        )
    return result


def _refuse_doubts(strict: bool, result: Comparison) -> None:
    """Raise a `LogError` with the warnings of the logs and the comparison, if they are to be errors."""
    of_logs = [w.of(one.name) for one in result.runs for w in one.run.warnings]
    doubts = [w for w in result.warnings if w.kind not in (LACKING_TOOL, BEYOND)]  # those explain a result
    refuse_warnings(strict, (*of_logs, *doubts))


def _files(operands: Sequence[PathLike | Run | Comparison | None]) -> list[Path]:
    """Return the files that no output may replace: operands, and the recordings of those that are results."""
    found = [one.recording if isinstance(one, (Run, Comparison)) else one for one in operands]
    return [Path(one) for one in found if one is not None]
