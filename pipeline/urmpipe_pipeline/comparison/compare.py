"""Compare: the deviation of some logs from a reference, and the verdict on it.

`compare_runs` compares logs with a reference, `compare_with_recorded_tcp` a log's kinematics with its own
record. Each log goes through these chapters:

1. `trajectories`: the sides, by kinematics, as recorded, or by joints alone.
2. `sync`, `trajectories.match`, `align`: the same times, then the same frame.
3. `measure`: deviations, statistics, shares and the verdict.
4. `diagnosis`, if requested: why it deviates.
5. `warnings`: assumptions of the verdict, and warnings about it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Literal, TypeVar, get_args

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.errors import (
    Finding,
    Hint,
    LogError,
    OptionError,
    UrmpipeError,
    check_choice,
    map_collecting_errors,
)
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import align
from urmpipe_pipeline.comparison.comparison import Comparison, FailedLog
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.measure import joints_not_compared, measure
from urmpipe_pipeline.comparison.sync import (
    SyncOption,
    check_sync,
    no_common_sample,
    stamp_offset,
    sync_warnings,
    synchronise,
)
from urmpipe_pipeline.comparison.verdict import check_tolerance, complete_tolerance, deviation_tolerances
from urmpipe_pipeline.comparison.warnings import (
    clocks_differ,
    is_late,
    large_tolerances,
    left_out_warnings,
    recorded_tcp_mismatch,
    same_data,
    swapped_operands,
    undetermined_frames,
    verdict_assumptions,
    weak_evidence,
)
from urmpipe_pipeline.diagnosis.diagnose import Compared, Limit, diagnose
from urmpipe_pipeline.joint_log import SOLVED, LogWarning, Role
from urmpipe_pipeline.logs.coverage import TCP_NOT_READ
from urmpipe_pipeline.presentation.meshes import mesh_warnings
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.runs.recorded_tcp import missing_tool_warning
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import (
    JOINTS_ALONE,
    NO_ROBOT,
    NO_ROBOT_FITS,
    AlignMode,
    Side,
    Trajectory,
    fk_trajectory,
    joint_trajectory,
    kinematics_missing,
    match,
    recorded_trajectory,
    reference_rows,
    run_finding,
    run_label,
    traces_point,
)

Tcp = Literal["fk", "recorded"]

MAX_RECORDED_DISTANCE = 1e-3  # m from the recorded TCP, if not judged: a third of the default tolerance

NO_ALIGNMENT = "none with a diagnosis: base and tool are possible causes"

Made = TypeVar("Made")


@dataclass(frozen=True, slots=True)
class CompareOptions:
    """How logs are compared with a reference.

    Attributes:
        tolerance: Largest deviation allowed in [m] or [rad], by kind: axis, norm, path, angle, joint, or one
            coordinate. Other kinds have no tolerance. Least shares 0..1: coverage (0.9 by default) and judged
            (0.5).
        tcp: Which tool centre point: by forward kinematics of the joints, or as recorded.
        sync: How the clocks are aligned: stamps (Unix times or dates on both sides), start (both start
            together), auto (by the motion), or the offset in [s]: t_reference = t_log + offset, both from
            their first samples. None: stamps where both sides have them and overlap, else start.
        align: How a log is moved in space before it is compared: none, start, rigid, tool or base+tool.
        from_text: Whether the tolerance was read from a text, in which a large value has its unit.
        diagnose: Whether the causes of each deviation are searched for. Base and tool are causes then: no
            alignment may be given, and only a log that was measured in a separate frame, whose base and tool
            are always unknown, is moved first.
        defaults: Options that a file set, for the line of the verdict: "sync=auto from ../urmpipe.toml".
    """

    tolerance: Mapping[str, float] = field(default_factory=lambda: {"axis": DEFAULT_TOLERANCE})
    tcp: Tcp = "fk"
    sync: SyncOption | None = None
    align: AlignMode = "none"
    from_text: bool = False
    diagnose: bool = False
    defaults: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_tolerance(self.tolerance)
        check_choice("tcp", self.tcp, get_args(Tcp))
        check_sync(self.sync)
        check_choice("align", self.align, get_args(AlignMode))
        object.__setattr__(self, "tolerance", complete_tolerance(self.tolerance))


def tcp_trajectory(run: Run, tcp: Tcp = "fk", *, joints_alone: bool = False) -> Trajectory:
    """Return the trajectory of a run's tool centre point, on its log's own rows.

    A log without joints (a path) has the recorded one; one with joints that of `tcp`, or no positions where
    the joints alone are compared.

    Raises:
        LogError: If the run has neither kinematics nor a recorded position.
    """
    if _is_recorded(run, tcp):
        return recorded_trajectory(run)
    return joint_trajectory(run) if joints_alone else fk_trajectory(run)


def _is_recorded(run: Run, tcp: Tcp) -> bool:
    return not run.log.joints or tcp == "recorded"


def compare_runs(reference: Run, runs: Sequence[Run], options: CompareOptions | None = None) -> Comparison:
    """Compare runs with a reference run: deviation at the rows of each log, statistics, verdict.

    The reference is interpolated linearly between its rows; rows of a log outside its time, inside a gap of
    it, or without a value are left out and counted.

    Args:
        reference: A path, or a run.
        runs: The logs to judge, at least one.
        options: Tolerance, tool centre point, alignment of time and space.

    Raises:
        LogError: If a run has no positions to compare, shares no time with the reference, or lacks the
            quantity of a tolerance; if static poses are compared with a motion, or with more or fewer of
            them; if a side was measured in a separate frame, and nothing joins it to the other's.
        OptionError: If the clocks of static poses are to be aligned, or a log that is to be diagnosed is to
            be moved in space.

    Source: [UrmArm2021]_ eq. 19-23.
    """
    options = options or CompareOptions()
    if not runs:
        raise OptionError("compare: no log to compare with the reference; at least one is needed")
    check_static_poses(reference, runs, options)
    (reference_side, *sides), options = prepare_sides((reference, *runs), options)
    reference, runs = reference_side.run, [side.run for side in sides]
    warnings = [warning.of(reference.name) for warning in reference.warnings]
    same = [warning for side in sides for warning in same_data(reference_side, side)]
    deviations = map_collecting_errors(lambda side: _deviation(reference_side, side, options), sides)
    warnings += [*swapped_operands(reference, runs), *same]
    for side, deviation in zip(sides, deviations, strict=True):
        if is_late(deviation):
            warnings += clocks_differ(reference_side.trajectory, side.trajectory, deviation)
    if options.tcp == "fk":
        robots = [(run.name, run.robot.name) for run in (reference, *runs) if run.log.joints and run.robot]
        if len({robot for _, robot in robots}) > 1:
            names_and_robots = ", ".join(f"{name} as {robot}" for name, robot in robots)
            message = f"the kinematics are those of different robots: {names_and_robots}"
            warnings.append(LogWarning("robots-differ", message))
        if reference_side.trajectory.joints:
            warnings += recorded_tcp_mismatch((reference, *runs), MAX_RECORDED_DISTANCE)
        else:
            for run, deviation in zip(runs, deviations, strict=True):
                if deviation.worst_statistics.verdict == "fail":
                    warnings += [hint.of(run.name) for hint in missing_tool_warning(run.robot, run.log)]
    assumptions = find_assumptions((reference, *runs), options)
    return _build_comparison(reference_side.trajectory, deviations, options, warnings, assumptions)


def prepare_sides(runs: Sequence[Run], options: CompareOptions) -> tuple[list[Side], CompareOptions]:
    """Return the sides of a comparison, the reference first, and options that join their frames.

    No two sides have the same name, so that a warning names its log.

    Raises:
        LogError: If a run has no positions to compare, or nothing joins frames that differ.
    """
    options = _join_frames([(run, _is_recorded(run, options.tcp)) for run in runs], options)
    joints_alone = _compares_joints_alone(runs, options)
    sides = []
    for name, run in zip(text.make_unique([run.name for run in runs]), runs, strict=True):
        named = run if run.name == name else replace(run, name=name)
        trajectory = tcp_trajectory(named, options.tcp, joints_alone=joints_alone)
        sides.append(Side(named, trajectory, not _is_recorded(run, options.tcp)))
    return sides, options


def _compares_joints_alone(runs: Sequence[Run], options: CompareOptions) -> bool:
    """Return whether joints are compared with joints without positions: nothing else is judged.

    Raises:
        LogError: If a position is judged, and a run with joints has no kinematics.
    """
    without = [run for run in runs if run.log.joints and run.tcp is None and not traces_point(run)]
    if not without or options.tcp == "recorded" or not all(run.log.joints for run in runs):
        return False
    if options.align == "none" and set(deviation_tolerances(options.tolerance)) == {"joint"}:
        return True
    hints = (JOINTS_ALONE,) if options.align == "none" else ()
    raise LogError(*dict.fromkeys(kinematics_missing(run, *hints) for run in without))


def find_assumptions(runs: Sequence[Run], options: CompareOptions) -> tuple[str, ...]:
    """Return what a verdict assumes of the reference and the logs.

    Raises:
        LogError: With each reading that needs an answer first.
    """
    sides = []
    for run in runs:
        by_joints = bool(run.log.joints) and options.tcp == "fk"
        roles: set[Role] = {"joint"} if by_joints or "joint" in options.tolerance else set()
        sides.append(
            (run, roles if by_joints else roles | _recorded_roles(options, "start", "tool", "base+tool"))
        )
    untimed = all(any(w.role == "time" and w.assumption for w in run.warnings) for run, _ in sides)
    same_rows = len({run.log.rows for run, _ in sides}) == 1 and not isinstance(options.sync, (int, float))
    if not (untimed and same_rows):  # else the rows are compared one by one, whatever their period
        sides = [(run, {*roles, "time"} if run.timed else roles) for run, roles in sides]
    return verdict_assumptions(sides)


def _recorded_roles(options: CompareOptions, *oriented: AlignMode) -> set[Role]:
    """Return the roles of recorded poses that a verdict needs; `oriented` alignments use orientations."""
    use_orientations = "angle" in options.tolerance or options.align in oriented
    return {"position", "rotation"} if use_orientations else {"position"}


def check_static_poses(reference: Run, runs: Sequence[Run], options: CompareOptions) -> None:
    """Raise if static poses are compared with a motion, or with more or fewer poses.

    They are compared row by row; any other offset would interpolate between them.
    """
    static = [run for run in (reference, *runs) if not run.timed]
    if not static:
        return
    if len(static) <= len(runs):
        motion = next(run for run in (reference, *runs) if run.timed)
        raise LogError(*(_no_motion(run, motion) for run in static))
    rows = reference.log.rows
    if unequal := [run for run in runs if run.log.rows != rows]:
        allowed = f"{rows}, as {reference.name} has: static poses are compared row by row"
        raise LogError(
            *(run_finding(run, f"found {run.log.rows} rows, allowed: {allowed}") for run in unequal)
        )
    if options.sync not in (None, "start"):
        refused, allowed = f"{options.sync} with static poses", "start, as they are compared row by row"
        raise OptionError(Finding(parameter="sync", found=refused, allowed=allowed))


def _no_motion(run: Run, motion: Run) -> Finding:
    if run.log.source == SOLVED:
        message = "found targets without times, which are not a motion, allowed: a log or a path with times"
        return run_finding(run, message, Hint("tsp", None, "sets their sample period", call="ik"))
    message = f"found static poses, but {motion.name} is a motion"
    hint = Hint("poses", True, "reads the rows of every log as static poses")
    return run_finding(run, f"{message}, allowed: static poses on both sides, or motions on both sides", hint)


def _join_frames(sides: Sequence[tuple[Run, bool]], options: CompareOptions) -> CompareOptions:
    """Return options that join sides of which some are in a separate frame, others in the base's.

    Each side is a run, and whether its recorded tool centre point is compared.

    Raises:
        LogError: If nothing joins them: a diagnosis moves base and tool, else an alignment has to be given.
        OptionError: If an alignment is given with a diagnosis.
    """
    if options.diagnose and options.align != "none":
        raise OptionError(Finding(parameter="align", found=options.align, allowed=NO_ALIGNMENT))
    measured = [run for run, recorded in sides if recorded and run.log.externally_measured]
    if not measured or len(measured) == len(sides) or options.align not in ("none", "tool"):
        return options
    if options.diagnose:
        return replace(options, align="base+tool")
    hint, errors = Hint("align", "base+tool", "estimates the frames of base and tool"), []
    for run in measured:
        names = ", ".join(column.name for column in run.log.columns if column.role == "position")
        side = f"an externally measured tool position ({names}), in the frame of its device"
        error = run_finding(run, "", hint, parameter="align")
        errors.append(replace(error, found=side, allowed="base+tool, rigid, start"))
    raise LogError(*errors)


def compare_with_recorded_tcp(run: Run, options: CompareOptions | None = None) -> Comparison:
    """Compare the forward kinematics of a log with its recorded tool centre point.

    Both are in the same rows of one file. Their joints are the same and are not compared. Where samples on a
    wrap were repaired, the repaired ones are used.

    Raises:
        OptionError: If another alignment of the clocks is requested, or as of `compare_runs`.
        LogError: If the log has no joints, no robot, or recorded no position.
    """
    options = options or CompareOptions()
    if options.sync not in (None, "start"):
        allowed = "start, since its joints and its recorded tool centre point share the same rows"
        raise OptionError(Finding(parameter="sync", found=f"{options.sync} for one log", allowed=allowed))
    log = run.log
    if not log.joints:
        message = "found a path alone, which has no joints, allowed: a path and a log"
        raise LogError(run_finding(run, message))
    if run.robot is None:
        raise LogError(run_finding(run, *(NO_ROBOT if log.tcp_position is None else NO_ROBOT_FITS)))
    if log.tcp_position is None:
        message = "found one log, which recorded no tool centre point, allowed: a reference and a log"
        unread = [warning.as_finding() for warning in log.warnings if warning.kind == TCP_NOT_READ]
        raise LogError(
            run_finding(run, message), *(replace(finding, file=run_label(run)) for finding in unread)
        )
    options = _join_frames([(run, True), (run, False)], replace(options, sync="start"))
    recorded, computed = (
        replace(side, joints=(), joint_units=(), q=None)
        for side in (recorded_trajectory(run), fk_trajectory(run))
    )
    recorded = replace(recorded, name=f"{run.name} (recorded)")
    # Alignments other than start use the orientations of the joints.
    assumed = verdict_assumptions([(run, {"joint", *_recorded_roles(options, "start")})])
    sides = Side(run, recorded, by_joints=False), Side(run, computed, by_joints=True)
    result = _build_comparison(recorded, [_deviation(*sides, options)], options, (), assumed)
    if "tool" in options.align or result.runs[0].worst_statistics.verdict != "fail":
        return result
    warnings = missing_tool_warning(run.robot, log, turned="angle" in options.tolerance)
    return replace(result, warnings=(*result.warnings, *warnings))


def _build_comparison(
    reference: Trajectory,
    deviations: Sequence[Deviation],
    options: CompareOptions,
    warnings: Sequence[LogWarning],
    assumptions: tuple[str, ...],
) -> Comparison:
    large = [] if options.from_text else large_tolerances(deviation_tolerances(options.tolerance))
    warnings = [*large, *warnings]
    for deviation in deviations:
        run = deviation.run
        warnings += sync_warnings(deviation.name, deviation.sync, run.tsp)
        warnings += left_out_warnings(deviation, reference)
        warnings += [*weak_evidence(deviation), *undetermined_frames(deviation)]
        if reference.joints and run.log.joints and deviation.joint_delta is None:
            message = f"no joint is compared: {joints_not_compared(reference, run)}"
            warnings.append(LogWarning("joints-not-compared", message, about=deviation.name))
    settings = {name: getattr(options, name) for name in ("tcp", "sync", "align")}
    if options.sync is None and not any(deviation.sync.mode == "stamps" for deviation in deviations):
        settings["sync"] = "start"
    settings |= {"diagnose": True} if options.diagnose else {}
    log = f"{deviations[0].name}-" if len(deviations) == 1 else ""
    return build_comparison(
        f"{log}against-{reference.name}", reference, deviations, warnings, assumptions,
        options.tolerance, settings, options.defaults,
    )  # fmt: skip


def build_comparison(
    name: str,
    reference: Trajectory,
    deviations: Sequence[Deviation],
    warnings: Sequence[LogWarning],
    assumptions: tuple[str, ...],
    tolerance: Mapping[str, float],
    settings: Mapping[str, object],
    defaults: tuple[str, ...],
) -> Comparison:
    """Return a comparison with its provenance, and warnings about meshes that cannot be drawn any more.

    Args:
        name: Its name.
        reference: The reference.
        deviations: The deviation of each log, or of each cycle of a test.
        warnings: Warnings about it.
        assumptions: What its verdict assumes.
        tolerance: The tolerance, by kind or criterion.
        settings: The other options that repeat it, by name.
        defaults: Options that a file set.
    """
    runs = [deviation.run for deviation in deviations]
    # A recording has the names of mesh files only.
    lost_meshes = dict.fromkeys(w for run in runs if run.robot for w in mesh_warnings(run.robot))
    lost = [w for w in lost_meshes if not any(w in run.warnings for run in runs)]
    inputs = [*reference.files, *(file for run in runs for file in run.log.files)]
    return Comparison(
        name,
        reference,
        tuple(deviations),
        dict(tolerance),
        (*warnings, *lost),
        build_provenance("compare", {"tolerance": dict(tolerance), **settings}, inputs, defaults),
        assumptions=assumptions,
        on_rows=True,
    )


def _deviation(reference: Side, log: Side, options: CompareOptions) -> Deviation:
    """Return the deviation of one log, at its own samples, and its causes if requested."""
    run, target, actual = log.run, reference_rows(reference, log), log.trajectory
    sync = synchronise(target, actual, options.sync, options.align, stamp_offset(reference.run, run))
    matched = match(target, actual, sync)
    if not len(matched.sample):
        raise LogError(no_common_sample(run, target.name, sync))
    deviation = measure(run, target, actual, align(matched, options.align, run), options.tolerance)
    if not options.diagnose:
        return deviation
    lag = None
    if run.timed and reference.run is not run:
        with suppress(LogError):  # the motions do not determine it
            lag = synchronise(reference.trajectory, actual, "auto").offset - sync.offset
    compared = Compared(
        deviation.name,
        deviation.verdict,
        tuple(Limit(of.quantity, of.kind, of.tolerance) for of in deviation.all_statistics),
        {name: share.value for name, share in deviation.shares.items()},
    )
    return replace(deviation, diagnosis=diagnose(compared, matched, reference, log, lag))


def skip_failed_logs(
    compare: Callable[[Sequence[Run]], Made], runs: Sequence[Run], failed: list[FailedLog]
) -> Made:
    """Return what a function makes of those runs that it accepts, and add the others to a list.

    Raises:
        UrmpipeError: With all errors, if it accepts none, or not all together that it accepts alone.
    """
    try:
        return compare(runs)
    except UrmpipeError:
        accepted, errors = [], []
        for run in runs:
            try:
                compare([run])
            except UrmpipeError as error:
                errors.append(FailedLog(run.name, error.findings))
            else:
                accepted.append(run)
        if not accepted or not errors:
            raise
    failed += errors
    return compare(accepted)
