"""Runs of joint values that inverse kinematics found: what `ingest` makes of a log, with targets and ghosts.

Targets with times are a motion: its joint values take the way of a log that was read - audit, grid,
derivatives, kinematics. Targets without times are single poses, a second apart so that a person can step
through them; what lies between two of them is no motion, so such a run has no rates, and no turns are
resolved in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.joint_log import JointLog, LogColumn, LogWarning, SourceFile
from urmpipe_pipeline.provenance import provenance
from urmpipe_pipeline.runs.ghosts import Ghost, Goals, ghosts_of, goals_of
from urmpipe_pipeline.runs.ingest import kinematics, run_of
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.solved_targets.result import SolvedTargets
from urmpipe_pipeline.solved_targets.solution_warnings import path_warnings
from urmpipe_pipeline.sources import ReadOptions

__all__ = ["TARGET_PERIOD_NS", "Ghost", "Goals", "ghosts_of", "goals_of", "row_times", "solved_run"]

SOURCE = "ik"
"""What such a run says where another says which reader read it."""

TARGET_PERIOD_NS = 1_000_000_000
"""Targets without times stand so far apart in [ns]: long enough to look at each while the viewer plays."""

SAME = 1e-9
"""Joint values nearer than this in [rad] or [m] are one solution: rounding, far below what two branches
differ by where they can be told apart."""


@dataclass(frozen=True, slots=True, eq=False)
class _Clock:
    """The times of the rows, from the first."""

    t_ns: IntArray
    start_ns: int
    timed: bool


def solved_run(
    name: str,
    chain: Chain,
    t_ns: IntArray | None,
    q: FloatArray,
    *,
    goals: Goals,
    ghosts: Sequence[Ghost] = (),
    files: Sequence[SourceFile] = (),
    warnings: Sequence[LogWarning] = (),
    options: Mapping[str, Any] | None = None,
    command: str = "ik",
) -> Run:
    """Return the run of joint values that bring the tool to targets.

    Args:
        name: What to call it.
        chain: The arm, with base and tool.
        t_ns: Times of the targets in integer [ns], shape (n,), strictly increasing; None for targets without
            times: they stand a second apart, as `row_times` says.
        q: The solution chosen for each in [rad] or [m], shape (n, joints); NaN in the rows of targets that
            have none. There the run has no pose, and nothing is interpolated.
        goals: The targets, one a row, on the same times (`goals_of`).
        ghosts: The branches, on the same times (`ghosts_of`). Rows that are the solution chosen are left
            out, and so is a branch without any other.
        files: Where the targets came from.
        warnings: What a person should know of the solutions.
        options: The options that were given, by name.
        command: Which command makes it.

    Raises:
        LogError: If there is no target, times do not increase, or goals or ghosts lie between the rows.
    """
    clock = _clock(t_ns, len(q))
    _refuse_misplaced(name, chain, clock, q, goals, ghosts)
    present: BoolArray = np.asarray(np.isfinite(q).all(axis=1))
    q = np.where(present[:, None], q, np.nan)
    noticed = (*warnings, *_unreachable(present, goals))
    log = JointLog(
        name=name, source=SOURCE, files=tuple(files), t_ns=clock.t_ns, joints=chain.coordinates, q=q,
        clock_start_ns=clock.start_ns, columns=tuple(_columns(chain, clock.timed)), warnings=noticed,
        timed=clock.timed,
    )  # fmt: skip
    made = command, dict(options or {}) | {"robot": chain.name}
    run = (
        run_of(log, chain, ReadOptions(), made=provenance(*made, log.files))
        if clock.timed
        else _poses(log, chain, made)
    )
    return replace(run, ghosts=tuple(_others(chain, clock, q, ghosts)), goals=_from_start(goals, clock))


def row_times(count: int) -> IntArray:
    """Return times of targets that have none in integer [ns], shape (count,): a second apart."""
    return np.arange(count, dtype=np.int64) * TARGET_PERIOD_NS


def _clock(t_ns: IntArray | None, count: int) -> _Clock:
    """Return the times from the first row, and where the clock starts."""
    if t_ns is None:
        return _Clock(row_times(count), 0, False)
    start = int(t_ns[0]) if count else 0
    return _Clock(np.asarray(t_ns, dtype=np.int64) - start, start, True)


def _refuse_misplaced(
    name: str, chain: Chain, clock: _Clock, q: FloatArray, goals: Goals, ghosts: Sequence[Ghost]
) -> None:
    """Raise a `LogError` that tells all that does not fit together."""
    found = []
    if not len(q):
        found.append(Finding("found no target, allowed: one or more", name))
    if q.shape[1:] != (len(chain.coordinates),):
        found.append(Finding(f"found {q.shape[1]} joints, allowed: {len(chain.coordinates)}", name))
    if len(clock.t_ns) != len(q):
        found.append(Finding(f"found {len(clock.t_ns)} times of {len(q)} targets, allowed: one each", name))
    elif (bad := np.flatnonzero(np.diff(clock.t_ns) <= 0)).size:
        message = "found a time that is not later than the one before, allowed: increasing times"
        found.append(Finding(message, name, row=int(bad[0]) + 2))
    found += _spoilt(name, chain, ghosts)
    found += [
        Finding(f"found a time of {ghost.name} that no row has, allowed: the times of the rows", name)
        for ghost in ghosts
        if not np.isin(ghost.t_ns - clock.start_ns, clock.t_ns).all()
    ]
    for told, texts in (("reasons", goals.reasons), ("branches chosen", goals.branches or goals.reasons)):
        if len(texts) != len(goals.t_ns):
            said = f"found {len(texts)} {told} of {len(goals.t_ns)} targets, allowed: one each"
            found.append(Finding(said, name))
    if not np.array_equal(goals.t_ns - clock.start_ns, clock.t_ns):
        found.append(Finding("found targets at other times than the rows, allowed: one a row", name))
    if found:
        raise LogError(*found)


def _spoilt(name: str, chain: Chain, ghosts: Sequence[Ghost]) -> Iterator[Finding]:
    """Yield the ghosts whose joint values are none that an arm can be drawn at."""
    for ghost in ghosts:
        wanted = len(ghost.t_ns), len(chain.coordinates)
        if ghost.q.shape != wanted:
            found = " x ".join(map(str, ghost.q.shape))
            said = f"found {found} joint values of {ghost.name}, allowed: {wanted[0]} x {wanted[1]}"
            yield Finding(said, name)
        elif (~np.isfinite(ghost.q)).any():
            yield Finding(f"found a joint value missing in {ghost.name}, allowed: rows that are whole", name)
        if (np.diff(ghost.t_ns) <= 0).any():
            yield Finding(f"found times of {ghost.name} in disorder, allowed: increasing times", name)


def _unreachable(present: BoolArray, goals: Goals) -> Iterator[LogWarning]:
    """Yield how many targets the arm has no pose for, and why it has none for the first, at its row."""
    missed = np.flatnonzero(~present)
    if len(missed):
        first = int(missed[0])
        here = ", here the first" if len(missed) > 1 else ""
        why = f": {goals.why(first)}" if goals.reasons[first] else ""
        said = f"no solution for {len(missed)} of {len(present)} targets{here}{why}"
        yield LogWarning("unreachable", said, first + 1)


def _columns(chain: Chain, timed: bool) -> Iterator[LogColumn]:
    """Yield what the columns would be if the joint values stood in a file, so that they can be exported."""
    if timed:
        yield LogColumn("t", "t [s]", "time", 0, "s", number=1)
    for j, joint in enumerate(chain.moving):
        unit = "rad" if joint.kind == "revolute" else "m"
        yield LogColumn(joint.name, f"{joint.name} [{unit}]", "joint", j, unit, number=j + 1 + timed)


def _poses(log: JointLog, chain: Chain, made: tuple[str, Mapping[str, Any]]) -> Run:
    """Return the run of targets without times: poses without rates."""
    none = np.full_like(log.q, np.nan)
    tcp, noticed = kinematics(chain, log.q, none, none)
    return Run(
        name=log.name,
        log=log,
        robot=chain,
        tsp=0.0,
        t_ns=log.t_ns,
        q=log.q,
        qd=none,
        qdd=none,
        tcp=tcp,
        tcp_recorded=None,
        audit=(),
        warnings=(*log.warnings, *noticed),
        provenance=provenance(*made, log.files),
    )


def _others(chain: Chain, clock: _Clock, q: FloatArray, ghosts: Sequence[Ghost]) -> Iterator[Ghost]:
    """Yield the ghosts from the first row on, without the rows that are the solution chosen."""
    turns = np.array([joint.kind == "revolute" for joint in chain.moving])
    for ghost in ghosts:
        t_ns = ghost.t_ns - clock.start_ns
        away = ghost.q - q[np.searchsorted(clock.t_ns, t_ns)]
        away[:, turns] -= 2.0 * np.pi * np.round(away[:, turns] / (2.0 * np.pi))
        other = ~(np.abs(away) <= SAME).all(axis=1)  # a row without a chosen solution is NaN: it stays
        if other.any():
            yield Ghost(ghost.name, t_ns[other], ghost.q[other])


def _from_start(goals: Goals, clock: _Clock) -> Goals:
    """Return the targets with times from the first row."""
    return replace(goals, t_ns=goals.t_ns - clock.start_ns)


def recorded_run(result: SolvedTargets) -> Run:
    """Return what is recorded of solved targets: the chosen solutions, the others as ghosts, the targets."""
    since = row_times(len(result)) if result.t_ns is None else result.t_ns
    t_ns = since + result.clock_start_ns
    beside = (result.solutions if result.path is None else result.branches) if result.every else None
    return solved_run(
        result.name,
        result.robot,
        None if result.t_ns is None else t_ns,
        result.q,
        goals=goals_of(result.targets, t_ns, result.reasons, result.branch),
        ghosts=() if beside is None else ghosts_of(beside, t_ns),
        files=result.provenance.inputs,
        warnings=(*result.warnings, *(path_warnings(result.path) if result.path else ())),
        options=result.provenance.options,
    )
