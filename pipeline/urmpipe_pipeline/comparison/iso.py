"""The cycles of a test after ISO 9283: logs, or parts of one, each beside the command on its own clock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError, OptionError
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Deviation, Share
from urmpipe_pipeline.comparison.measure import measure, measure_shares
from urmpipe_pipeline.comparison.path_distance import distance_from_path
from urmpipe_pipeline.comparison.sync import SyncOption
from urmpipe_pipeline.comparison.verdict import LEAST_SHARES, deviations_of
from urmpipe_pipeline.comparison.wording import share_words
from urmpipe_pipeline.iso9283.command_path import Bend, Stations, Stop
from urmpipe_pipeline.iso9283.criteria import angles, fewest_cycles
from urmpipe_pipeline.iso9283.cycles import FoundCycles, alike, check_cycles, find_cycles, first_cycle
from urmpipe_pipeline.iso9283.evaluate import Command, Followed, Marks, follow, marks_of
from urmpipe_pipeline.iso9283.evaluate import measure as measure_criteria
from urmpipe_pipeline.iso9283.motion import Motion, motion_of
from urmpipe_pipeline.iso9283.poses import Poses
from urmpipe_pipeline.iso9283.result import Cycle, FailedCycle, IsoTest
from urmpipe_pipeline.iso9283.tables import failed_words
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.ingest import EULER_SINGULAR
from urmpipe_pipeline.runs.run import slice_run
from urmpipe_pipeline.trajectories import Side, Sync, Trajectory, match, reference_rows, run_finding

FAILED = "failed-cycle"

RETURN = "return-path"

CUT = "cut-cycle"

FEW = "few-cycles"

TREMBLING = "noise-beyond-band"

NOISY = "noisy-speed"

NO_RESTS = "no-rests"

UPRIGHT = np.radians(85.0)
"""Where ry goes beyond this in [rad], rz and rx are known twelve times worse than the orientation."""

ENOUGH = {"poses": 30, "paths": 10}
"""Cycles that the standard takes."""

MOST_PLANES = 10_000
"""Most planes: they then stand closer than the rows of any cycle, and each is sought in every cycle."""


@dataclass(frozen=True, slots=True, eq=False)
class IsoOptions:
    """How a test after ISO 9283 is evaluated.

    Attributes:
        cycles: First and last row of each cycle of one log, from 1; None: found by its returns to the start.
        planes: How many planes cut the command path.
        band: Half of the width of the band round a final pose in [m].
        targets: Poses to judge; None: those in which the reference rests.
        bends: Where the reference is known to turn.
        stops: Where the reference is known to stop, if for a moment only.
    """

    cycles: tuple[tuple[int, int], ...] | None = None
    planes: int = 50
    band: float = 1e-4
    targets: Poses | None = None
    bends: tuple[Bend, ...] = ()
    stops: tuple[Stop, ...] = ()

    def __post_init__(self) -> None:
        faults = []
        if not 1 <= self.planes <= MOST_PLANES:
            allowed = "1 or more" if self.planes < 1 else f"{MOST_PLANES} at most"
            faults.append(Finding(parameter="planes", found=str(self.planes), allowed=allowed))
        if not 0.0 < self.band < np.inf:
            faults.append(Finding(parameter="band", found=f"{self.band:g}", allowed="a positive length in m"))
        if faults:
            raise OptionError(*faults)


@dataclass(frozen=True, slots=True, eq=False)
class JudgedCycles:
    """The cycles of a test, and what they tell.

    Attributes:
        command: The reference, once.
        deviations: The deviation of each cycle from the reference at the same times.
        test: The criteria.
        warnings: What a person should know.
    """

    command: Trajectory
    deviations: tuple[Deviation, ...]
    test: IsoTest
    warnings: tuple[LogWarning, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """What may be a cycle: a log or a part of one, and its first row in the log, from 0."""

    side: Side
    motion: Motion
    first: int
    last: int


def judge_cycles(
    asked: Side, done: Sequence[Side], options: IsoOptions, sync: SyncOption, tolerance: Mapping[str, float]
) -> JudgedCycles:
    """Return what the cycles of a test tell: n logs, or one in which the motion repeats.

    A cycle that does not follow the reference, or shows too little of it, is a failed cycle. Criteria are
    computed from the other cycles.

    Args:
        asked: The reference.
        done: The logs, at least one.
        options: How they are evaluated.
        sync: How the clock of each cycle is put together with the reference's; auto goes by the planes that
            both cross.
        tolerance: Largest absolute values allowed, by criterion; least shares of a cycle, 0..1.

    Raises:
        LogError: If no cycle follows the reference, or a criterion with a tolerance has no value, however
            many cycles there are.
        OptionError: If rows are given for the cycles of several logs, or are wrong.
    """
    asked, rows = _once(asked) if len(done) == 1 else (asked, None)
    command = _motion(asked)
    candidates, told = _candidates(command, done, options)
    marks = marks_of(Command(command, options.targets, options.bends, options.stops, options.planes))
    least = {name: tolerance.get(name, share) for name, share in LEAST_SHARES.items()}
    tolerance = deviations_of(tolerance)
    kept, failed = _followed(command, marks, candidates, asked, least)
    if not kept and marks.path is not None and len(marks.poses) and options.targets is None:
        marks = replace(marks, poses=Poses(np.empty((0, 3)), None))
        kept, others = _followed(command, marks, candidates, asked, least)
        if kept:
            failed = others
            said = f"no cycle rests where {asked.run.name} does: poses are not judged"
            told.append(LogWarning(NO_RESTS, said))
    unlike = [LogWarning(FAILED, failed_words(one), row=one.row, about=one.name) for one in failed]
    if not kept:
        raise LogError(*(one.as_finding() for one in (*told, *unlike)))
    found = measure_criteria(marks, [one for _, one, _ in kept], options.band, tolerance)
    clocks = [_sync(sync, one, asked.run.timed) for _, one, _ in kept]
    cycles = tuple(
        Cycle(one.side.run.name, one.first + 1, one.last + 1, clock.offset if one.motion.timed else None)
        for (one, _, _), clock in zip(kept, clocks, strict=True)
    )
    test = IsoTest(cycles, found.criteria, found.poses, found.path, options.band, rows, tuple(failed))
    _refuse_unvalued(test, tolerance)
    deviations = tuple(
        replace(_deviation(asked, one.side, clock), shares=shares)
        for (one, _, shares), clock in zip(kept, clocks, strict=True)
    )
    motions = [one.motion for one, _, _ in kept]
    doubts = [*_few(test), *_trembling(motions, test), *_angles(command, motions, test)]
    open_failures = () if tolerance else unlike  # with a tolerance the verdict names them
    return JudgedCycles(asked.trajectory, deviations, test, (*told, *open_failures, *doubts))


def _once(asked: Side) -> tuple[Side, tuple[int, int] | None]:
    """Return what is asked for in each cycle, and its rows, from 1, in a reference that repeats itself."""
    whole = _motion(asked)
    rows = first_cycle(whole)
    if rows is None:
        return asked, None
    first, last = (int(whole.row[row]) for row in rows)
    return asked._replace(trajectory=_cut(asked.trajectory, first, last, asked.trajectory.name)), (
        first + 1,
        last + 1,
    )


def _motion(side: Side) -> Motion:
    """Return where a side was, as the criteria take it."""
    one = side.trajectory
    t = one.t if side.run.timed else np.arange(len(one.t_ns), dtype=np.float64)
    return motion_of(side.run.name, t, one.position, one.quat_xyzw, timed=side.run.timed)


def _candidates(
    command: Motion, done: Sequence[Side], options: IsoOptions
) -> tuple[list[_Candidate], list[LogWarning]]:
    """Return every whole cycle, and what was left out of one log."""
    if len(done) > 1:
        if options.cycles is not None:
            found = f"rows of cycles and {len(done)} logs, each of which is a cycle"
            raise OptionError(Finding(parameter="cycles", found=found, allowed="one log"))
        return [_Candidate(one, _motion(one), 0, one.run.log.rows - 1) for one in done], []
    (side,) = done
    whole = _motion(side)
    if options.cycles is not None:
        check_cycles(options.cycles, side.run.log.rows)
        rows = [(first - 1, last - 1) for first, last in options.cycles]
        return [_part(side, *one, number) for number, one in enumerate(rows, 1)], []
    seen = find_cycles(command, whole)
    if not seen.rows and not whole.timed:
        said = f"found {len(whole)} rows, allowed: {len(command)} for each cycle, as {command.name} has poses"
        raise LogError(run_finding(side.run, said))
    if not seen.rows:
        said = f"found no motion as in {command.name} that returns to its start, allowed: one that repeats it"
        raise LogError(run_finding(side.run, said))
    of_log = FoundCycles(
        *(tuple((int(whole.row[a]), int(whole.row[b])) for a, b in some)
          for some in (seen.rows, seen.cut, seen.returns))
    )  # fmt: skip
    if len(of_log.rows) == 1 and not of_log.cut:
        return [_Candidate(side, whole, 0, side.run.log.rows - 1)], []
    parts = [_part(side, *one, number) for number, one in enumerate(of_log.rows, 1)]
    return parts, list(_left_out(side.run.name, of_log))


def _part(side: Side, first: int, last: int, number: int) -> _Candidate:
    """Return a part of a log as what may be a cycle."""
    name = f"cycle {number}"
    part = Side(
        slice_run(side.run, first, last, name), _cut(side.trajectory, first, last, name), side.by_joints
    )
    return _Candidate(part, _motion(part), first, last)


def _cut(whole: Trajectory, first: int, last: int, name: str) -> Trajectory:
    """Return some rows of a trajectory, both ends included, on their own clock."""
    rows = slice(first, last + 1)
    broken = whole.broken
    return replace(
        whole, name=name, t_ns=whole.t_ns[rows] - whole.t_ns[first], position=whole.position[rows],
        quat_xyzw=None if whole.quat_xyzw is None else whole.quat_xyzw[rows],
        q=None if whole.q is None else whole.q[rows],
        broken=None if broken is None else broken[(broken >= first) & (broken < last)] - first,
    )  # fmt: skip


def _left_out(name: str, found: FoundCycles) -> Iterator[LogWarning]:
    """Yield what of a log is in no cycle."""
    for first, last in found.cut:
        said = f"rows {first + 1} to {last + 1} are not a whole cycle and are left out"
        yield LogWarning(CUT, said, row=first + 1, about=name)
    if found.returns:
        first, last = found.returns[0]
        said = f"rows {first + 1} to {last + 1}, between two cycles, lead back to the start and are left out"
        more = len(found.returns) - 1
        said += f"; so do {more} more such stretches" if more else ""
        yield LogWarning(RETURN, said, row=first + 1, about=name)


def _followed(
    command: Motion, marks: Marks, candidates: Sequence[_Candidate], asked: Side, least: Mapping[str, float]
) -> tuple[list[tuple[_Candidate, Followed, dict[str, Share]]], list[FailedCycle]]:
    """Return the cycles that follow the command and show it, with their shares, and the others."""
    kept, failed = [], []
    for one in candidates:
        moves = marks.path is not None
        unlike = moves and not (one.motion.timed and len(one.motion) > 1 and alike(command, one.motion))
        found = f"its path differs from that of {asked.run.name}" if unlike else follow(marks, one.motion)
        shares = {} if isinstance(found, str) else _shares(asked, one, found, marks.stations, least)
        small = [share_words(share) for share in shares.values() if share.verdict == "fail"]
        if small:
            found = "; ".join(small)
        if isinstance(found, str):
            distance = _largest_distance(command, one.motion)
            failed.append(FailedCycle(one.side.run.name, one.first + 1, one.last + 1, distance, found))
        else:
            kept.append((one, found, shares))
    return kept, failed


def _shares(
    asked: Side, one: _Candidate, followed: Followed, planes: Stations | None, least: Mapping[str, float]
) -> dict[str, Share]:
    """Return how much of the command a cycle shows.

    Samples are matched on the command's clock, and near each other on the cycle's: between two planes either
    goes on at its own speed.
    """
    command, cycle = reference_rows(asked, one.side), one.side.trajectory
    reference, on_command = command, cycle
    if planes is not None and followed.crossed is not None:
        crossed = np.maximum.accumulate(followed.crossed.t)
        reference = replace(command, t_ns=_other_clock(command.t, planes.t, crossed))
        on_command = replace(cycle, t_ns=_other_clock(cycle.t, crossed, planes.t))
    matched = match(command, on_command, Sync())
    matched = matched._replace(t_ns=cycle.t_ns[matched.sample])
    if not len(matched.sample):
        return {}
    shares = measure_shares(reference, cycle, matched, least, timed=asked.run.timed)
    unseen = shares["coverage"].unseen
    if unseen is not None and unseen.t is not None:  # on the command's own clock
        first, last = command.t[[unseen.sample, unseen.sample + unseen.samples - 1]].tolist()
        shares["coverage"] = replace(
            shares["coverage"], unseen=replace(unseen, t=first, duration=last - first)
        )
    return shares


def _other_clock(t: FloatArray, own: FloatArray, other: FloatArray) -> IntArray:
    """Return times in [s] in [ns] of another clock, by the times of some instants on both, rising."""
    beyond = np.minimum(t - own[0], 0.0) + np.maximum(t - own[-1], 0.0)
    return np.asarray(np.rint(1e9 * (np.interp(t, own, other) + beyond)).astype(np.int64))


def _largest_distance(command: Motion, cycle: Motion) -> float | None:
    """Return the largest distance of a cycle from a command's path in [m]; of still poses from its poses."""
    known = cycle.position[np.isfinite(cycle.position).all(axis=1)]
    if not len(known):
        return None
    joined = np.full(len(command) - 1, command.timed)
    return float(distance_from_path(known, command.position, joined).max())


def _sync(option: SyncOption, cycle: Followed, timed: bool) -> Sync:
    """Return how the clock of a cycle is put together with the reference's."""
    if not timed or option == "start":
        return Sync()
    return Sync("auto", cycle.offset, "planes") if option == "auto" else Sync("given", float(option))


def _deviation(asked: Side, done: Side, sync: Sync) -> Deviation:
    """Return the deviation of a cycle at the same times; nothing of it is judged."""
    reference = reference_rows(asked, done)
    matched = match(reference, done.trajectory, sync)
    if not len(matched.sample):
        said = f"no sample in common with {asked.run.name} (time offset {sync.offset} s)"
        raise LogError(run_finding(done.run, said))
    return measure(done.run, reference, done.trajectory, matched, {})


def _refuse_unvalued(test: IsoTest, tolerance: Mapping[str, float]) -> None:
    """Raise a `LogError` with each criterion that has a tolerance and no value, if more cycles gave it none.

    A criterion that only lacks cycles is not judged, and the others are.
    """
    values = {one.name: one.value for one in test.overall}
    count = text.counted(len(test.cycles), "cycle")
    lacks = [name for name in tolerance if values.get(name) is None]
    if any(name not in values or len(test.cycles) >= fewest_cycles(name) for name in lacks):
        known = ", ".join(name for name, value in values.items() if value is not None)
        allowed = f"criteria of this test: {known}"
        found = [f"{name}, which {count} of this motion cannot determine" for name in lacks]
        raise LogError(*(Finding(parameter="tolerance", found=one, allowed=allowed) for one in found))


def _few(test: IsoTest) -> Iterator[LogWarning]:
    """Yield a warning if there are fewer cycles than the standard takes."""
    count = len(test.cycles)
    parts = {"poses": test.poses is not None, "paths": test.path is not None}
    few = [f"{ENOUGH[part]} for {part}" for part, there in parts.items() if there and count < ENOUGH[part]]
    if few:
        yield LogWarning(FEW, f"{text.counted(count, 'cycle')}; ISO 9283 takes {' and '.join(few)}")


def _angles(command: Motion, cycles: Sequence[Motion], test: IsoTest) -> Iterator[LogWarning]:
    """Yield warnings if angles are not told, or not separately defined."""
    lacks = [one.name for one in cycles if one.quat_xyzw is None]
    if command.quat_xyzw is None:
        return
    if 0 < len(lacks) < len(cycles):
        said = f"no angle is judged: {lacks[0]} has no orientation"
        yield LogWarning("no-orientation", said)
    told = any(one.name in ("AP_rz", "AT_rz") for one in test.overall)
    if told and float(np.abs(angles(command.quat_xyzw)[:, 1]).max()) > UPRIGHT:
        said = "ry of the reference is near +-90 deg: rz and rx are not separately defined there"
        yield LogWarning(EULER_SINGULAR, f"{said}, and their criteria grow")


def _trembling(cycles: Sequence[Motion], test: IsoTest) -> Iterator[LogWarning]:
    """Yield warnings if noise of the cycles leaves the band about final poses, or is most of FV."""
    noise = float(np.median([one.noise for one in cycles]))
    if any(one.value is not None for one in test.overall if one.name == "PSt") and 3.0 * noise > test.band:
        said = f"PSt and OV are determined by noise: {text.quantity(3.0 * noise, 'm')} (three standard"
        said += f" deviations) leaves the band of {text.allowed(test.band)}"
        yield LogWarning(TREMBLING, said, parameter="band")
    steps = [np.median(np.diff(one.t)) for one in cycles if len(one) > 1]
    shaken = 6.0 * np.sqrt(2.0) * noise / float(np.median(steps)) if steps else 0.0
    (spread,) = [one.value for one in test.overall if one.name == "FV"] or [None]
    if spread is not None and 2.0 * shaken > spread:
        makes = f"{text.quantity(noise, 'm')} from row to row make about {shaken:.2g} m/s"
        said = f"FV is determined by noise: {makes}"
        yield LogWarning(NOISY, said)
