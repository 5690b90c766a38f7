"""Compare: the deviation of some logs from a reference, and the verdict on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, check_choice, map_collecting_errors
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import align
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.iso import evaluate_test
from urmpipe_pipeline.comparison.measure import joints_not_compared, measure
from urmpipe_pipeline.comparison.sync import (
    SyncOption,
    check_sync,
    stamp_offset,
    sync_warnings,
    synchronise,
)
from urmpipe_pipeline.comparison.verdict import check_tolerance, complete_tolerance, deviations_of
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
from urmpipe_pipeline.iso9283.evaluate import IsoOptions
from urmpipe_pipeline.joint_log import SOLVED, LogWarning, Role
from urmpipe_pipeline.presentation.meshes import mesh_warnings
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.runs.recorded_tcp import missing_tool_warning
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources.columns.tcp_like import TCP_NOT_READ
from urmpipe_pipeline.trajectories import (
    JOINTS_ALONE,
    NO_ROBOT,
    NO_ROBOT_FITS,
    AlignMode,
    Side,
    Sync,
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

RECORDED_APART = 1e-3
"""Distance in [m] between kinematics and recorded tool centre point that is told where neither is judged: a
third of the default tolerance."""


NO_ALIGNMENT_ISO = "none with iso: an alignment would hide AP and AT"

CYCLES_CLOCKS = "auto, start or an offset with iso: each cycle is put beside one reference"

NO_ALIGNMENT = "none with a diagnosis: base and tool are possible causes"


@dataclass(frozen=True, slots=True)
class CompareOptions:
    """How logs are held against a reference.

    Attributes:
        tolerance: Largest deviation allowed in [m] or [rad], by kind: axis, norm, path, angle, joint, or one
            coordinate. What is not named has no tolerance. Least shares 0..1: coverage (0.9 unless given)
            and judged (0.5).
        tcp: Where a log was: by forward kinematics of its joints, or as it recorded itself.
        sync: How the clocks are put together: stamps (Unix times or dates on both sides), start (both start
            together), auto (by the motion), or the offset in [s]: t_reference = t_log + offset, both from
            their first samples. None: stamps where both sides have them and overlap, else start.
        align: How a log is moved in space before it is compared: none, start, rigid, tool or base+tool.
        from_text: Whether the tolerance was read from a text, in which a large value has its unit.
        diagnose: Whether it is asked why each log deviates. Base and tool are causes then: no alignment may
            be asked for, and only a log that was measured in a frame of its own, whose base and tool are
            always unknown, is moved first.
        iso: How the logs are evaluated as the cycles of a test after ISO 9283, whose criteria the tolerance
            is for; None: each log is judged for itself.
        defaults: Options that a file set, for the line of the verdict: "sync=auto from ../urmpipe.toml".
    """

    tolerance: Mapping[str, float] = field(default_factory=lambda: {"axis": DEFAULT_TOLERANCE})
    tcp: Tcp = "fk"
    sync: SyncOption | None = None
    align: AlignMode = "none"
    from_text: bool = False
    diagnose: bool = False
    iso: IsoOptions | None = None
    defaults: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.iso is not None:
            self._refuse_with_iso()
        check_tolerance(self.tolerance, iso=self.iso is not None)
        check_choice("tcp", self.tcp, get_args(Tcp))
        check_sync(self.sync)
        check_choice("align", self.align, get_args(AlignMode))
        if self.iso is None:  # of a test the criteria are judged, and of each cycle the shares
            object.__setattr__(self, "tolerance", complete_tolerance(self.tolerance))

    def _refuse_with_iso(self) -> None:
        """Raise an `OptionError` with what does not go with criteria after ISO 9283."""
        faults = []
        if self.align != "none":
            faults.append(Finding(parameter="align", found=self.align, allowed=NO_ALIGNMENT_ISO))
        if self.sync == "stamps":
            faults.append(Finding(parameter="sync", found=self.sync, allowed=CYCLES_CLOCKS))
        if self.diagnose:
            faults.append(Finding(parameter="diagnose", found="with iso", allowed="one of the two"))
        if faults:
            raise OptionError(*faults)


def trajectory(run: Run, tcp: Tcp = "fk", *, alone: bool = False) -> Trajectory:
    """Return where a run's tool centre point was, on its log's own rows.

    A log without joints (a path) is where it recorded itself; one with joints goes by `tcp`, or nowhere where
    the joints alone are compared.

    Raises:
        LogError: If the run has neither kinematics nor a recorded position to go by.
    """
    if _goes_by_record(run, tcp):
        return recorded_trajectory(run)
    return joint_trajectory(run) if alone else fk_trajectory(run)


def _goes_by_record(run: Run, tcp: Tcp) -> bool:
    """Tell whether a run is where it recorded itself."""
    return not run.log.joints or tcp == "recorded"


def compare_runs(reference: Run, runs: Sequence[Run], options: CompareOptions | None = None) -> Comparison:
    """Hold runs against a reference run: delta on the rows of each log, statistics, verdict.

    The reference is interpolated linearly between its rows; rows of a log outside its time, inside a gap of
    it, or without a value of their own are left out and counted.

    Args:
        reference: A path, or a run of its own.
        runs: The logs to judge, at least one.
        options: Tolerance, which tool centre point, how time and space are put together.

    Raises:
        LogError: If a run has no position to go by, shares no time with the reference, or lacks what a
            tolerance is for; if still poses are held against a motion, or against more or fewer of them; if
            a side was measured in a frame of its own, and nothing joins it to the other's.
        OptionError: If the clocks of still poses are to be put together, or a log that is to be diagnosed is
            to be moved in space.

    Source: [UrmArm2021]_ eq. 19-23.
    """
    chosen = options or CompareOptions()
    if not runs:
        raise OptionError("compare: no log to compare with the reference; at least one is needed")
    if chosen.iso is None or len(runs) > 1:
        _refuse_poses_as_motion(reference, runs, chosen)
    chosen = _joined([(run, _goes_by_record(run, chosen.tcp)) for run in (reference, *runs)], chosen)
    alone = _joints_alone(reference, runs, chosen)
    reference, *runs = _named_apart((reference, *runs))
    sides = [_side(run, chosen.tcp, alone=alone) for run in runs]
    asked = _side(reference, chosen.tcp, alone=alone)
    wanted = asked.trajectory
    same = [warning for done in sides for warning in same_data(asked, done)]
    if chosen.iso is not None:
        return _test(asked, sides, chosen, same)
    deviations = map_collecting_errors(lambda done: _deviation(asked, done, chosen), sides)
    told = [
        *(one.of(reference.name) for one in reference.warnings),
        *swapped_operands(reference, runs),
        *same,
    ]
    for done, one in zip(sides, deviations, strict=True):
        told += clocks_differ(wanted, done.trajectory, one) if is_late(one) else ()
    if chosen.tcp == "fk":
        told += _differing_robots([reference, *runs])
    if chosen.tcp == "fk" and wanted.joints:
        told += recorded_tcp_mismatch((reference, *runs), RECORDED_APART)
    elif chosen.tcp == "fk":
        failed = [one for one in deviations if one.worst_statistics.verdict == "fail"]
        told += [
            hint.of(one.name) for one in failed for hint in missing_tool_warning(one.run.robot, one.run.log)
        ]
    return _comparison(wanted, deviations, chosen, told, _taken_for_granted(reference, runs, chosen))


def _test(
    asked: Side, done: Sequence[Side], options: CompareOptions, same: Sequence[LogWarning]
) -> Comparison:
    """Return the comparison of the cycles of a test after ISO 9283."""
    assert options.iso is not None
    sync = "start" if options.sync is None else options.sync
    found = evaluate_test(asked, done, options.iso, sync, options.tolerance)
    reference, runs = asked.run, [one.run for one in done]
    told = [*(one.of(reference.name) for one in reference.warnings), *found.warnings, *same]
    if len(runs) == 1:  # its cycles are parts of it
        told = [*(one.of(runs[0].name) for one in runs[0].warnings), *told]
    assumed = _taken_for_granted(reference, runs, options)
    made = _comparison(found.command, found.deviations, options, told, assumed)
    log = f"{runs[0].name}-" if len(runs) == 1 else ""
    return replace(made, name=f"{log}against-{reference.name}", iso=found.test)


def _side(run: Run, tcp: Tcp, *, alone: bool) -> Side:
    """Return one side of a comparison."""
    return Side(run, trajectory(run, tcp, alone=alone), not _goes_by_record(run, tcp))


def _named_apart(runs: Sequence[Run]) -> list[Run]:
    """Return runs of which no two have one name, so that what is said of one is not said of another."""
    names = text.unique([run.name for run in runs])
    return [
        run if run.name == name else replace(run, name=name) for name, run in zip(names, runs, strict=True)
    ]


def _joints_alone(reference: Run, runs: Sequence[Run], options: CompareOptions) -> bool:
    """Tell whether joints are held against joints without a place in space: nothing else is judged.

    Raises:
        LogError: If a place is judged, and a run with joints has no kinematics.
    """
    every = (reference, *runs)
    lacks = [run for run in every if run.log.joints and run.tcp is None and not traces_point(run)]
    if not lacks or options.tcp == "recorded" or not all(run.log.joints for run in every):
        return False
    if options.align == "none" and set(deviations_of(options.tolerance)) == {"joint"}:
        return True
    hints = (JOINTS_ALONE,) if options.align == "none" else ()
    raise LogError(*dict.fromkeys(kinematics_missing(run, *hints) for run in lacks))


def _taken_for_granted(reference: Run, runs: Sequence[Run], options: CompareOptions) -> tuple[str, ...]:
    """Return what a verdict on runs assumes of them and the reference; raise what has to be told first."""
    sides = [(run, _compared_roles(run, options)) for run in (reference, *runs)]
    without = all(any(w.role == "time" and w.assumption for w in run.warnings) for run, _ in sides)
    alike = len({run.log.rows for run, _ in sides}) == 1 and not isinstance(options.sync, (int, float))
    if not (without and alike):  # else the rows are compared one by one, whatever their period
        sides = [(run, {*roles, "time"} if run.timed else roles) for run, roles in sides]
    return verdict_assumptions(sides)


def _compared_roles(run: Run, options: CompareOptions) -> set[Role]:
    """Return the roles of what is compared of a run: joints, or recorded positions and orientations."""
    by_joints = bool(run.log.joints) and options.tcp == "fk"
    roles: set[Role] = {"joint"} if by_joints or "joint" in options.tolerance else set()
    return roles if by_joints else roles | _recorded_roles(options, "start", "tool", "base+tool")


def _recorded_roles(options: CompareOptions, *turning: AlignMode) -> set[Role]:
    """Return what a verdict on recorded poses rests on, if some alignments go by their orientations."""
    turned = "angle" in options.tolerance or options.align in turning
    return {"position", "rotation"} if turned else {"position"}


def _refuse_poses_as_motion(reference: Run, runs: Sequence[Run], options: CompareOptions) -> None:
    """Raise if still poses are held against a motion, or against more or fewer poses.

    Still poses are held against still poses row by row; any other offset would interpolate between them.
    """
    single = [run for run in (reference, *runs) if not run.timed]
    if not single:
        return
    if len(single) <= len(runs):
        raise LogError(*map(_no_motion, single))
    wanted = reference.log.rows
    if others := [run for run in runs if run.log.rows != wanted]:
        allowed = f"{wanted}, as {reference.name} has: still poses are compared row by row"
        raise LogError(
            *(run_finding(run, f"found {run.log.rows} rows, allowed: {allowed}") for run in others)
        )
    if options.sync not in (None, "start") and not (options.iso and options.sync == "auto"):
        found = f"{options.sync} of still poses"
        raise OptionError(Finding(parameter="sync", found=found, allowed="start, row by row"))


def _no_motion(run: Run) -> Finding:
    """Return that still poses are held against a motion."""
    if run.log.source == SOLVED:
        said = (
            "found targets without times, which are not a motion, allowed: a log or a path of its own times"
        )
        return run_finding(run, said, Hint("tsp", None, "sets their sample period", call="ik"))
    said = "found still poses beside a motion, allowed: still poses on both sides, or motions"
    return run_finding(run, said, Hint("poses", True, "takes the rows of every log as still poses"))


def _joined(sides: Sequence[tuple[Run, bool]], options: CompareOptions) -> CompareOptions:
    """Return options that join sides of which some stand in a frame of their own, others in the base's.

    Each side is a run, and whether it is where it recorded itself.

    Raises:
        LogError: If nothing joins them: a diagnosis moves base and tool, else an alignment has to be given.
        OptionError: If an alignment is given with a diagnosis.
    """
    if options.diagnose and options.align != "none":
        raise OptionError(Finding(parameter="align", found=options.align, allowed=NO_ALIGNMENT))
    apart = [run for run, recorded in sides if recorded and run.log.measured]
    if not apart or len(apart) == len(sides) or options.align not in ("none", "tool"):
        return options
    if options.diagnose:
        return replace(options, align="base+tool")
    hint, findings = Hint("align", "base+tool", "finds the frames of base and tool"), []
    for run in apart:
        names = ", ".join(column.name for column in run.log.columns if column.role == "position")
        found = f"a tool that was measured in a frame of its own ({names})"
        finding = run_finding(run, "", hint, parameter="align")
        findings.append(replace(finding, found=found, allowed="base+tool, rigid, start"))
    raise LogError(*findings)


def _differing_robots(runs: Sequence[Run]) -> list[LogWarning]:
    """Return a warning if the runs were held against each other by the kinematics of different arms."""
    arms = [(run.name, run.robot.name) for run in runs if run.log.joints and run.robot]
    if len({arm for _, arm in arms}) < 2:
        return []
    said = ", ".join(f"{name} as {arm}" for name, arm in arms)
    return [LogWarning("robots-differ", f"the kinematics are those of different robots: {said}")]


def compare_recorded(run: Run, options: CompareOptions | None = None) -> Comparison:
    """Hold the forward kinematics of a log against the tool centre point that the same log recorded.

    Both stand in the same rows of one file. Their joints are the same and are not compared. Where samples
    left on a wrap were repaired, the repaired ones count.

    Raises:
        OptionError: If another time than its own is asked for, or as of `compare_runs`.
        LogError: If the log has no joints, no robot, or recorded no position.
    """
    chosen = options or CompareOptions()
    if chosen.sync not in (None, "start"):
        allowed = "start, since its joints and its recorded tool centre point share the same rows"
        raise OptionError(Finding(parameter="sync", found=f"{chosen.sync} for one log", allowed=allowed))
    chosen = replace(chosen, sync="start")
    log = run.log
    if not log.joints:
        raise LogError(
            run_finding(run, "a path alone, which has no joints; allowed: a log to compare with it")
        )
    if run.robot is None:
        raise LogError(run_finding(run, *(NO_ROBOT if log.tcp_position is None else NO_ROBOT_FITS)))
    if log.tcp_position is None:
        said = "one log, which recorded no tool centre point; allowed: a reference before the log"
        doubts = [one.as_finding() for one in log.warnings if one.kind == TCP_NOT_READ]
        raise LogError(run_finding(run, said), *(replace(one, file=run_label(run)) for one in doubts))
    chosen = _joined([(run, True), (run, False)], chosen)
    recorded = replace(
        recorded_trajectory(run), name=f"{run.name} (recorded)", joints=(), joint_units=(), q=None
    )
    computed = replace(fk_trajectory(run), joints=(), joint_units=(), q=None)
    # Others go by the orientations of the joints.
    assumed = verdict_assumptions([(run, {"joint", *_recorded_roles(chosen, "start")})])
    sides = Side(run, recorded, by_joints=False), Side(run, computed, by_joints=True)
    found = _comparison(recorded, [_deviation(*sides, chosen)], chosen, (), assumed)
    failed = any(one.worst_statistics.verdict == "fail" for one in found.runs)
    asked, turned = failed and "tool" not in chosen.align, "angle" in chosen.tolerance
    lacks = missing_tool_warning(run.robot, log, turned=turned) if asked else []
    return replace(found, warnings=(*found.warnings, *lacks))


def _comparison(
    reference: Trajectory,
    deviations: Sequence[Deviation],
    options: CompareOptions,
    told: Sequence[LogWarning],
    assumed: tuple[str, ...],
) -> Comparison:
    deviations_allowed = () if options.from_text else large_tolerances(deviations_of(options.tolerance))
    warnings = [*deviations_allowed, *told]
    for one in deviations if options.iso is None else ():
        warnings += sync_warnings(one.name, one.sync, one.run.tsp)
        warnings += left_out_warnings(one, reference)
        warnings += [*weak_evidence(one), *undetermined_frames(one)]
        if reference.joints and one.run.log.joints and one.joint_delta is None:
            said = f"no joint is compared: {joints_not_compared(reference, one.run)}"
            warnings.append(LogWarning("joints-not-compared", said, about=one.name))
    warnings += _shapes_gone([one.run for one in deviations])
    inputs = [*reference.files, *(file for one in deviations for file in one.run.log.files)]
    made = {name: getattr(options, name) for name in ("tcp", "sync", "align")}
    if options.sync is None and not any(one.sync.mode == "stamps" for one in deviations):
        made["sync"] = "start"
    made |= {"diagnose": True} if options.diagnose else {}
    if options.iso is not None:
        made |= {"iso": True, **{name: getattr(options.iso, name) for name in ("cycles", "planes", "band")}}
    name = f"{deviations[0].name}-" if len(deviations) == 1 else ""
    return Comparison(
        f"{name}against-{reference.name}",
        reference,
        tuple(deviations),
        dict(options.tolerance),
        tuple(warnings),
        build_provenance("compare", {"tolerance": dict(options.tolerance), **made}, inputs, options.defaults),
        assumptions=assumed,
        on_rows=True,
    )


def _shapes_gone(runs: Sequence[Run]) -> list[LogWarning]:
    """Return what cannot be drawn of the arms any more: a recording keeps the names of mesh files only."""
    gone = dict.fromkeys(warning for run in runs if run.robot for warning in mesh_warnings(run.robot))
    return [warning for warning in gone if not any(warning in run.warnings for run in runs)]


def _deviation(asked: Side, done: Side, options: CompareOptions) -> Deviation:
    """Return the deviation of one trajectory, at its own samples; why it deviates, if asked for."""
    run, reference, actual = done.run, reference_rows(asked, done), done.trajectory
    stamped = stamp_offset(asked.run, run)
    sync = synchronise(reference, actual, options.sync, options.align, stamped)
    matched = match(reference, actual, sync)
    if not len(matched.sample):
        said = f"no sample in common with {reference.name} (time offset {sync.offset} s)"
        raise LogError(run_finding(run, said))
    found = measure(run, reference, actual, align(matched, options.align, run), options.tolerance)
    if not options.diagnose:
        return found
    lag = _moves_alike(asked, done, sync)
    compared = Compared(
        found.name,
        found.verdict,
        tuple(Limit(one.quantity, one.kind, one.tolerance) for one in found.all_statistics),
        {name: share.value for name, share in found.shares.items()},
    )
    return replace(found, diagnosis=diagnose(compared, matched, asked, done, lag))


def _moves_alike(asked: Side, done: Side, sync: Sync) -> float | None:
    """Return the offset in [s], besides how clocks were put together, at which two logs move alike."""
    if not done.run.timed or asked.run is done.run:
        return None
    try:
        return synchronise(asked.trajectory, done.trajectory, "auto").offset - sync.offset
    except LogError:  # the motions do not tell it
        return None
