"""Evaluate logs as the cycles of a test after ISO 9283.

`measure_iso` compares logs with a reference as `compare.compare_runs` does, with these differences:

1. Cycles: one log each, or the parts of one log in which the motion repeats. If the reference repeats it as
   well, its first cycle is the command.
2. A cycle that does not follow the reference, or shows too little of it, is a failed cycle; the criteria
   are those of the others (`iso9283.evaluate`).
3. Each cycle has a deviation from the reference as a log has it in a comparison; it is drawn, not judged.
4. Warnings: what was left out, too few cycles, noise that decides a criterion, angles that are undefined.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, get_args

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError, OptionError, check_choice
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.compare import (
    CompareOptions,
    Tcp,
    build_comparison,
    check_static_poses,
    find_assumptions,
    prepare_sides,
)
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation, Share
from urmpipe_pipeline.comparison.measure import measure, measure_shares
from urmpipe_pipeline.comparison.path_distance import distance_from_path
from urmpipe_pipeline.comparison.sync import SyncOption, check_sync, no_common_sample
from urmpipe_pipeline.comparison.verdict import (
    MIN_SHARES,
    check_tolerance,
    deviation_tolerances,
    format_share,
)
from urmpipe_pipeline.comparison.warnings import large_tolerances, same_data
from urmpipe_pipeline.iso9283.command_path import Planes, RoundedCorner, Stop
from urmpipe_pipeline.iso9283.criteria import euler_angles, min_cycles
from urmpipe_pipeline.iso9283.cycles import (
    FoundCycles,
    check_cycles,
    find_cycles,
    find_first_cycle,
    is_same_path,
)
from urmpipe_pipeline.iso9283.evaluate import (
    CommandStations,
    MatchedCycle,
    command_to_stations,
    evaluate_cycles,
    match_cycle,
)
from urmpipe_pipeline.iso9283.motion import Motion, build_motion
from urmpipe_pipeline.iso9283.poses import Poses
from urmpipe_pipeline.iso9283.result import Cycle, FailedCycle, IsoTest
from urmpipe_pipeline.iso9283.tables import format_failed_cycle
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.ingest import EULER_SINGULAR
from urmpipe_pipeline.runs.run import Run, slice_run
from urmpipe_pipeline.trajectories import Side, Sync, Trajectory, match, reference_rows, run_finding

FAILED = "failed-cycle"
RETURN = "return-path"
CUT = "cut-cycle"
FEW = "few-cycles"
NOISE_BEYOND_BAND = "noise-beyond-band"
NOISY_SPEED = "noisy-speed"
NO_RESTS = "no-rests"

MAX_RY = np.radians(85.0)  # rad; beyond it rz and rx are known twelve times worse than the orientation
STANDARD_CYCLES = {"poses": 30, "paths": 10}  # of ISO 9283
MAX_PLANES = 10_000  # more are closer together than the rows of any cycle, and each is sought in every cycle
CLOCKS = "auto, start or an offset: each cycle has the same reference"


@dataclass(frozen=True, slots=True, eq=False)
class IsoOptions:
    """How a test after ISO 9283 is evaluated.

    Attributes:
        tolerance: Largest absolute values allowed, by criterion; least shares of a cycle, 0..1. Other
            criteria have no tolerance.
        tcp: Which tool centre point: by forward kinematics of the joints, or as recorded.
        sync: How the clock of each cycle is aligned: auto (by the planes that both cross), start (both start
            together), or the offset in [s]: t_reference = t_cycle + offset, both from their first samples.
        cycles: First and last row of each cycle of one log, from 1; None: found by its returns to the start.
        planes: Number of planes that cut the command path.
        band: Half of the width of the band around a final pose in [m].
        targets: Poses to judge; None: those in which the reference rests.
        corners: Corners that the reference is known to round.
        stops: Where the reference is known to stop, even if only for a moment.
        from_text: Whether the tolerance was read from a text, in which a large value has its unit.
        defaults: Options that a file set, for the line of the verdict: "sync=auto from ../urmpipe.toml".

    Raises:
        OptionError: If an option is out of its range.
    """

    tolerance: Mapping[str, float] = field(default_factory=dict)
    tcp: Tcp = "fk"
    sync: SyncOption = "start"
    cycles: tuple[tuple[int, int], ...] | None = None
    planes: int = 50
    band: float = 1e-4
    targets: Poses | None = None
    corners: tuple[RoundedCorner, ...] = ()
    stops: tuple[Stop, ...] = ()
    from_text: bool = False
    defaults: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        findings = []
        if not 1 <= self.planes <= MAX_PLANES:
            allowed = "1 or more" if self.planes < 1 else f"{MAX_PLANES} at most"
            findings.append(Finding(parameter="planes", found=str(self.planes), allowed=allowed))
        if not 0.0 < self.band < np.inf:
            findings.append(
                Finding(parameter="band", found=f"{self.band:g}", allowed="a positive length in m")
            )
        if self.sync == "stamps":
            findings.append(Finding(parameter="sync", found=self.sync, allowed=CLOCKS))
        if findings:
            raise OptionError(*findings)
        check_tolerance(self.tolerance, iso=True)
        check_choice("tcp", self.tcp, get_args(Tcp))
        check_sync(self.sync)


class _Candidate(NamedTuple):
    """A possible cycle: a log or a part of one, and its first and last row in the log, from 0."""

    side: Side
    motion: Motion
    first: int
    last: int


class _Kept(NamedTuple):
    """A cycle that follows the command, and how much of it it shows."""

    candidate: _Candidate
    matched: MatchedCycle
    shares: dict[str, Share]


def measure_iso(reference: Run, runs: Sequence[Run], options: IsoOptions | None = None) -> Comparison:
    """Evaluate a test after ISO 9283: n logs, or one in which the motion repeats.

    Args:
        reference: The commanded motion: a path, or a run.
        runs: The logs, at least one.
        options: How they are evaluated.

    Returns:
        The comparison of the cycles that follow the reference; its `iso` has the criteria.

    Raises:
        LogError: If no cycle follows the reference, or a criterion with a tolerance has no value, however
            many cycles there are; and as of `compare_runs`.
        OptionError: If rows are given for the cycles of several logs, or are wrong.

    Source: [Iso9283]_ section 7.
    """
    options = options or IsoOptions()
    if not runs:
        raise OptionError("compare: no log to compare with the reference; at least one is needed")
    compared = CompareOptions(tcp=options.tcp, sync=None if options.sync == "auto" else options.sync)
    if len(runs) > 1:
        check_static_poses(reference, runs, compared)
    (command, *logs), compared = prepare_sides((reference, *runs), compared)
    same = [warning for log in logs for warning in same_data(command, log)]
    warnings: list[LogWarning] = []
    if not options.from_text:
        warnings += large_tolerances(deviation_tolerances(options.tolerance))
    if len(logs) == 1:  # the cycles are parts of it
        warnings += [warning.of(logs[0].run.name) for warning in logs[0].run.warnings]
    warnings += [warning.of(command.run.name) for warning in command.run.warnings]
    trajectory, deviations, test, of_test = _evaluate(command, logs, options)
    assumptions = find_assumptions([side.run for side in (command, *logs)], compared)
    settings = {
        "tcp": options.tcp, "sync": options.sync, "align": "none", "iso": True,
        "cycles": options.cycles, "planes": options.planes, "band": options.band,
    }  # fmt: skip
    log_name = f"{logs[0].run.name}-" if len(logs) == 1 else ""
    result = build_comparison(
        f"{log_name}against-{command.run.name}", trajectory, deviations, [*warnings, *of_test, *same],
        assumptions, options.tolerance, settings, options.defaults,
    )  # fmt: skip
    return replace(result, iso=test)


def _evaluate(
    reference: Side, logs: Sequence[Side], options: IsoOptions
) -> tuple[Trajectory, tuple[Deviation, ...], IsoTest, list[LogWarning]]:
    """Return the command of each cycle, the deviations of the cycles, the test, and its warnings."""
    reference, rows = _first_cycle(reference) if len(logs) == 1 else (reference, None)
    command = _build_motion(reference)
    candidates, warnings = _find_candidates(command, logs, options)
    stations = command_to_stations(command, options.targets, options.corners, options.stops, options.planes)
    least_shares = {name: options.tolerance.get(name, share) for name, share in MIN_SHARES.items()}
    tolerance = deviation_tolerances(options.tolerance)
    kept, failed = _match_cycles(command, stations, candidates, reference, least_shares)
    if not kept and stations.path is not None and len(stations.poses) and options.targets is None:
        stations = stations._replace(poses=Poses(np.empty((0, 3)), None))
        kept, still_failed = _match_cycles(command, stations, candidates, reference, least_shares)
        if kept:
            failed = still_failed
            message = f"no cycle rests where {reference.run.name} does: poses are not judged"
            warnings.append(LogWarning(NO_RESTS, message))
    failures = [
        LogWarning(FAILED, format_failed_cycle(cycle), row=cycle.row, about=cycle.name) for cycle in failed
    ]
    if not kept:
        raise LogError(*(warning.as_finding() for warning in (*warnings, *failures)))
    criteria, poses, path = evaluate_cycles(
        stations, [cycle.matched for cycle in kept], options.band, tolerance
    )
    clocks = [_align_clock(options.sync, cycle.matched, reference.run.timed) for cycle in kept]
    cycles = []
    for (candidate, _, _), clock in zip(kept, clocks, strict=True):
        offset = clock.offset if candidate.motion.timed else None
        cycles.append(Cycle(candidate.side.run.name, candidate.first + 1, candidate.last + 1, offset))
    test = IsoTest(tuple(cycles), criteria, poses, path, options.band, rows, tuple(failed))
    _check_values(test, tolerance)
    deviations = tuple(
        replace(_deviation(reference, candidate.side, clock), shares=shares)
        for (candidate, _, shares), clock in zip(kept, clocks, strict=True)
    )
    motions = [cycle.candidate.motion for cycle in kept]
    warnings += () if tolerance else failures  # with a tolerance the verdict names them
    warnings += [
        *_few_cycles(test),
        *_noise_warnings(motions, test),
        *_angle_warnings(command, motions, test),
    ]
    return reference.trajectory, deviations, test, warnings


def _first_cycle(reference: Side) -> tuple[Side, tuple[int, int] | None]:
    """Return the command of each cycle, and its rows, from 1, if the reference repeats it."""
    motion = _build_motion(reference)
    rows = find_first_cycle(motion)
    if rows is None:
        return reference, None
    first, last = (int(motion.row[row]) for row in rows)
    trajectory = _take_rows(reference.trajectory, first, last, reference.trajectory.name)
    return reference._replace(trajectory=trajectory), (first + 1, last + 1)


def _build_motion(side: Side) -> Motion:
    trajectory, timed = side.trajectory, side.run.timed
    t = trajectory.t if timed else np.arange(len(trajectory.t_ns), dtype=np.float64)
    return build_motion(side.run.name, t, trajectory.position, trajectory.quat_xyzw, timed=timed)


def _find_candidates(
    command: Motion, logs: Sequence[Side], options: IsoOptions
) -> tuple[list[_Candidate], list[LogWarning]]:
    """Return the whole cycles, and warnings about rows of the log that are in none."""
    if len(logs) > 1:
        if options.cycles is not None:
            both = f"rows of cycles and {len(logs)} logs, each of which is a cycle"
            raise OptionError(Finding(parameter="cycles", found=both, allowed="one log"))
        return [_Candidate(log, _build_motion(log), 0, log.run.log.rows - 1) for log in logs], []
    (log,) = logs
    motion = _build_motion(log)
    if options.cycles is not None:
        check_cycles(options.cycles, log.run.log.rows)
        return [_part(log, first - 1, last - 1, k) for k, (first, last) in enumerate(options.cycles, 1)], []
    found_cycles = find_cycles(command, motion)
    if not found_cycles.rows:
        if motion.timed:
            message = f"found no complete cycle of {command.name}, allowed: a log that repeats its motion"
        else:
            count = len(command)
            message = (
                f"found {len(motion)} rows, allowed: {count} for each cycle, as {command.name} has poses"
            )
        raise LogError(run_finding(log.run, message))
    cycles = FoundCycles(
        *(tuple((int(motion.row[a]), int(motion.row[b])) for a, b in parts) for parts in found_cycles)
    )
    if len(cycles.rows) == 1 and not cycles.incomplete:
        return [_Candidate(log, motion, 0, log.run.log.rows - 1)], []
    parts = [_part(log, *rows, number) for number, rows in enumerate(cycles.rows, 1)]
    return parts, list(_omitted_rows(log.run.name, cycles))


def _part(log: Side, first: int, last: int, number: int) -> _Candidate:
    name = f"cycle {number}"
    trajectory = _take_rows(log.trajectory, first, last, name)
    part = Side(slice_run(log.run, first, last, name), trajectory, log.by_joints)
    return _Candidate(part, _build_motion(part), first, last)


def _take_rows(trajectory: Trajectory, first: int, last: int, name: str) -> Trajectory:
    """Return the rows of a trajectory from `first` to `last`, both included, with times from 0."""
    rows = slice(first, last + 1)
    t_ns, quat, q, breaks = (
        trajectory.t_ns[rows],
        trajectory.quat_xyzw,
        trajectory.q,
        trajectory.discontinuities,
    )
    return replace(
        trajectory,
        name=name,
        t_ns=t_ns - t_ns[0],
        position=trajectory.position[rows],
        quat_xyzw=None if quat is None else quat[rows],
        q=None if q is None else q[rows],
        discontinuities=None if breaks is None else breaks[(breaks >= first) & (breaks < last)] - first,
    )


def _omitted_rows(name: str, cycles: FoundCycles) -> Iterator[LogWarning]:
    for first, last in cycles.incomplete:
        message = f"rows {first + 1} to {last + 1} are not a whole cycle and are left out"
        yield LogWarning(CUT, message, row=first + 1, about=name)
    if cycles.returns:
        first, last = cycles.returns[0]
        message = (
            f"rows {first + 1} to {last + 1}, between two cycles, lead back to the start and are left out"
        )
        more = len(cycles.returns) - 1
        message += f"; so do {more} more such stretches" if more else ""
        yield LogWarning(RETURN, message, row=first + 1, about=name)


def _match_cycles(
    command: Motion,
    stations: CommandStations,
    candidates: Sequence[_Candidate],
    reference: Side,
    least_shares: Mapping[str, float],
) -> tuple[list[_Kept], list[FailedCycle]]:
    """Return the cycles that follow the command and show enough of it, and the others."""
    kept, failed = [], []
    for candidate in candidates:
        side, motion, first, last = candidate
        can_match = stations.path is None or (
            motion.timed and len(motion) > 1 and is_same_path(command, motion)
        )
        matched = (
            match_cycle(stations, motion)
            if can_match
            else f"it does not follow the path of {reference.run.name} from start to end"
        )
        shares: dict[str, Share] = {}
        if not isinstance(matched, str):
            shares = _shares(reference, candidate, matched, stations.planes, least_shares)
            small = [format_share(share) for share in shares.values() if share.verdict == "fail"]
            matched = "; ".join(small) or matched
        if isinstance(matched, str):
            distance = _max_distance(command, motion)
            failed.append(FailedCycle(side.run.name, first + 1, last + 1, distance, matched))
        else:
            kept.append(_Kept(candidate, matched, shares))
    return kept, failed


def _shares(
    reference: Side,
    candidate: _Candidate,
    matched: MatchedCycle,
    planes: Planes | None,
    least_shares: Mapping[str, float],
) -> dict[str, Share]:
    """Return how much of the command a cycle shows.

    Samples are matched on the command's clock, and near each other on the cycle's: between two planes either
    moves at its own speed.
    """
    command, cycle = reference_rows(reference, candidate.side), candidate.side.trajectory
    on_cycle_clock, on_command_clock = command, cycle
    if planes is not None and matched.crossings is not None:
        crossed = np.maximum.accumulate(matched.crossings.t)
        on_cycle_clock = replace(command, t_ns=_convert_times(command.t, planes.t, crossed))
        on_command_clock = replace(cycle, t_ns=_convert_times(cycle.t, crossed, planes.t))
    samples = match(command, on_command_clock, Sync())
    if not len(samples.sample):
        return {}
    samples = samples._replace(t_ns=cycle.t_ns[samples.sample])
    shares = measure_shares(on_cycle_clock, cycle, samples, least_shares, timed=reference.run.timed)
    unseen = shares["coverage"].longest_unseen
    if unseen is not None and unseen.t is not None:  # in times of the command
        first, last = command.t[[unseen.sample, unseen.sample + unseen.samples - 1]].tolist()
        unseen = replace(unseen, t=first, duration=last - first)
        shares["coverage"] = replace(shares["coverage"], longest_unseen=unseen)
    return shares


def _convert_times(t: FloatArray, clock: FloatArray, other_clock: FloatArray) -> IntArray:
    """Return times in [s] as [ns] of another clock, by the times of some instants on both, rising."""
    outside = np.minimum(t - clock[0], 0.0) + np.maximum(t - clock[-1], 0.0)
    return np.asarray(np.rint(1e9 * (np.interp(t, clock, other_clock) + outside)).astype(np.int64))


def _max_distance(command: Motion, cycle: Motion) -> float | None:
    """Return the largest distance of a cycle from a command's path, or from static poses, in [m]."""
    known = cycle.position[np.isfinite(cycle.position).all(axis=1)]
    if not len(known):
        return None
    joined = np.full(len(command) - 1, command.timed)
    return float(distance_from_path(known, command.position, joined).max())


def _align_clock(option: SyncOption, cycle: MatchedCycle, timed: bool) -> Sync:
    if not timed or option == "start":
        return Sync()
    return Sync("auto", cycle.offset, "planes") if option == "auto" else Sync("given", float(option))


def _deviation(reference: Side, log: Side, sync: Sync) -> Deviation:
    """Return the deviation of a cycle at the same times, without a tolerance."""
    rows = reference_rows(reference, log)
    matched = match(rows, log.trajectory, sync)
    if not len(matched.sample):
        raise LogError(no_common_sample(log.run, reference.run.name, sync))
    return measure(log.run, rows, log.trajectory, matched, {})


def _check_values(test: IsoTest, tolerance: Mapping[str, float]) -> None:
    """Raise a `LogError` with each criterion that has a tolerance and that more cycles would not determine.

    A criterion that only lacks cycles is not judged, and the others are.
    """
    values = {criterion.name: criterion.value for criterion in test.overall}
    count = format_count(len(test.cycles), "cycle")
    missing = [name for name in tolerance if values.get(name) is None]
    if any(name not in values or len(test.cycles) >= min_cycles(name) for name in missing):
        known = ", ".join(name for name, value in values.items() if value is not None)
        allowed = f"criteria of this test: {known}"
        reasons = [f"{name}, which {count} of this motion cannot determine" for name in missing]
        raise LogError(*(Finding(parameter="tolerance", found=reason, allowed=allowed) for reason in reasons))


def _few_cycles(test: IsoTest) -> Iterator[LogWarning]:
    count = len(test.cycles)
    parts = {"poses": test.poses is not None, "paths": test.path is not None}
    few = [
        f"{STANDARD_CYCLES[part]} for {part}"
        for part, is_tested in parts.items()
        if is_tested and count < STANDARD_CYCLES[part]
    ]
    if few:
        yield LogWarning(FEW, f"{format_count(count, 'cycle')}; ISO 9283 requires {' and '.join(few)}")


def _angle_warnings(command: Motion, cycles: Sequence[Motion], test: IsoTest) -> Iterator[LogWarning]:
    """Yield warnings if angles are not judged, or not separately defined."""
    if command.quat_xyzw is None:
        return
    missing = [cycle.name for cycle in cycles if cycle.quat_xyzw is None]
    if 0 < len(missing) < len(cycles):
        yield LogWarning("no-orientation", f"no angle is judged: {missing[0]} has no orientation")
    has_angles = any(criterion.name in ("AP_rz", "AT_rz") for criterion in test.overall)
    if has_angles and float(np.abs(euler_angles(command.quat_xyzw)[:, 1]).max()) > MAX_RY:
        message = "ry of the reference is near +-90 deg: rz and rx are not separately defined there"
        yield LogWarning(EULER_SINGULAR, f"{message}, and their criteria grow")


def _noise_warnings(cycles: Sequence[Motion], test: IsoTest) -> Iterator[LogWarning]:
    """Yield warnings if noise of the cycles leaves the band around final poses, or is most of FV."""
    values = {criterion.name: criterion.value for criterion in test.overall}
    noise = float(np.median([cycle.noise for cycle in cycles]))
    if values.get("PSt") is not None and 3.0 * noise > test.band:
        message = (
            f"PSt and OV are determined by noise: {text.format_quantity(3.0 * noise, 'm')} (three standard"
        )
        message += f" deviations) leaves the band of {text.format_stated(test.band)}"
        yield LogWarning(NOISE_BEYOND_BAND, message, parameter="band")
    steps = [np.median(np.diff(cycle.t)) for cycle in cycles if len(cycle) > 1]
    speed_noise = 6.0 * np.sqrt(2.0) * noise / float(np.median(steps)) if steps else 0.0
    fluctuation = values.get("FV")
    if fluctuation is not None and 2.0 * speed_noise > fluctuation:
        noise_text = f"{text.format_quantity(noise, 'm')} per sample, which gives about {speed_noise:.2g} m/s"
        yield LogWarning(NOISY_SPEED, f"FV is determined by noise: {noise_text}")
