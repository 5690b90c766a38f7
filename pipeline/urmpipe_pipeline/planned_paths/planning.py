"""From rows to a plan: the path, the joints along it, a law within their limits, and its samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, OptionError, PathError
from urmpipe_models.ik.solutions import SearchOptions
from urmpipe_models.ik.solve import solve
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.joints import (
    PathJoints,
    joint_limited_law,
    joints_along,
    max_limit_utilisation,
    targets_at,
)
from urmpipe_models.planning.laws import PathMotion, TimeLaw, jerk_law, trapezoid_law
from urmpipe_models.planning.path import EVEN_TURN_TOLERANCE, LineArcPath
from urmpipe_pipeline.joint_log import LogWarning, ns_to_seconds
from urmpipe_pipeline.planned_paths.obstacles import WORTH_MOVING, Infeasibility, obstacles_of, too_slow
from urmpipe_pipeline.planned_paths.path_file import GivenPath
from urmpipe_pipeline.planned_paths.planned_joints import FOLLOWED, PlannedJoints
from urmpipe_pipeline.planned_paths.request import Request, Timing
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.runs.run import summarise_torques
from urmpipe_pipeline.runs.torques import MOVE_SLOWER, effort_warning
from urmpipe_pipeline.text import MAX_NAMED_ROWS, format_rows
from urmpipe_pipeline.text import format_seconds as in_seconds

SPARE = 1.0 - 1e-4
"""What reduced speeds are multiplied by further, since limits are looked at on a grid [-]."""

ON_TIME = 1e-6
"""A law that ends within this share of a period after a sample ends at it."""

ANYWHERE = 1e9
"""How far from an arm, in [m], a point may be for the nearest place that it reaches to be looked for."""

MOST = 1_000_000
"""Samples of a plan: more come of a mistyped period, and would fill the memory with 3 GB."""

Progress = Callable[[float], None] | None


def joints_of(given: GivenPath, request: Request, progress: Progress = None) -> PathJoints | None:
    """Return the joints along a path, whatever its timing; None without an arm.

    Args:
        given: Its rows.
        request: Which arm moves along it, and from where.
        progress: Called with the share that is done, 0..1.

    Raises:
        PathError: With every row that the arm does not reach, and by how much.
    """
    if request.arm is None:
        return None
    path = rows_to_path(given.rows)
    _refuse_out_of_reach(given, path, request.arm, request.start)
    return joints_along(request.arm, path, request.start, progress)


def plan_path(
    given: GivenPath, request: Request, progress: Progress = None, joints: PathJoints | None = None
) -> PlannedPath:
    """Return the plan of a path.

    Args:
        given: Its rows.
        request: What is to be planned; `request` has checked it.
        progress: Called with the share that is done, 0..1.
        joints: The joints along it, if they are known: they take the most time, and are those of any timing.

    Raises:
        PathError: With every row that the arm does not reach, and by how much.
        OptionError: If the samples are too many.

    Source: [Iso9283]_ section 4, steps 7 to 18.
    """
    path, arm, timing = rows_to_path(given.rows), request.arm, request.timing
    joints = joints_of(given, request, progress) if joints is None else joints
    timed, samples = _within_limits(path, joints, _timed(path, joints, timing))
    law = timed.law
    options = timing.options | {"robot": arm.name if arm else None}
    options |= {"start": None if request.start is None else request.start.tolist()}
    return PlannedPath(
        name=given.name, robot=arm, rows=given.rows, law=timed.timing.law, arcs=timing.arcs,
        velocity=timed.timing.velocity_limit, acceleration=timed.timing.acceleration_limit, jerk=timing.jerk,
        speed_factor=1.0 if timing.law == "limits" else timed.scaled, tsp=timing.tsp, duration=law.duration,
        t_ns=samples.t_ns, motion=samples.motion, segment_times=law.time_at(path.bounds),
        row_times=law.time_at(path.at), joints=samples.joints, infeasibilities=timed.obstacles,
        warnings=(*given.warnings, *_warnings(path, joints, timed), *_beyond_efforts(timed, samples)),
        provenance=build_provenance("plan", options, [given.file] if given.file else []),
    )  # fmt: skip


def _refuse_out_of_reach(given: GivenPath, path: LineArcPath, arm: Chain, start: FloatArray | None) -> None:
    """Raise a `PathError` with every row that the arm does not get to on the path, and how near it gets."""
    targets = targets_at(path, path.at)
    found = solve(arm, targets, start=start)
    out = np.flatnonzero(~found.reached[:, 0])
    if not len(out):
        return
    near = solve(arm, targets.rows(out), start=start, search=SearchOptions(tolerance=ANYWHERE))
    faults = []
    for k, row in enumerate(out.tolist()):
        gap = float(near.position_residual[k, 0])
        away = f"{gap:.3g} m out of reach of {arm.name}" if gap > 0.0 else f"{arm.name}: {found.reason(row)}"
        point = ", ".join(f"{value:.6g}" for value in np.round(targets.position[row], 9) + 0.0)
        faults.append(given.finding(row + 1, f"({point}) m, {away}", "a point that the arm reaches"))
    raise PathError(*faults)


@dataclass(frozen=True, slots=True, eq=False)
class _Samples:
    """A law at its samples: times in [ns], the motion along the path, the joints."""

    t_ns: IntArray
    motion: PathMotion
    joints: PlannedJoints | None


@dataclass(frozen=True, slots=True, eq=False)
class _Timed:
    """A law of time with its timing, the factor that its speeds were multiplied by, and the obstacles."""

    timing: Timing
    law: TimeLaw
    obstacles: tuple[Infeasibility, ...] = ()
    scaled: float = 1.0


def _timed(path: LineArcPath, joints: PathJoints | None, timing: Timing) -> _Timed:
    """Return the law that was requested; where the arm does not get along the path, one that shows where.

    There the law of limits has no limits to run at: the default one stands for it.
    """
    usual = replace(timing, law="trapezoid") if timing.law == "limits" else timing
    speed, rise = usual.velocity_limit or math.inf, usual.acceleration_limit or math.inf
    if timing.law == "jerk":
        law = jerk_law(path, speed, rise, timing.jerk or math.inf, timing.arcs)
    else:
        law = trapezoid_law(path, speed, rise, timing.arcs)
    obstacles = [] if joints is None else sorted(obstacles_of(joints, law), key=lambda one: one.t)
    if joints is None or obstacles or timing.law != "limits":
        return _Timed(usual, law, tuple(obstacles))
    speed, rise = timing.velocity_limit or math.inf, timing.acceleration_limit or math.inf
    return _Timed(timing, joint_limited_law(joints, speed, rise))


def _within_limits(path: LineArcPath, joints: PathJoints | None, timed: _Timed) -> tuple[_Timed, _Samples]:
    """Return a law with its speeds reduced so that no joint exceeds a limit, and its samples.

    Rates fall with the factor, accelerations with its square. Samples stand beside the places at which the
    limits were looked at, so the speeds are reduced until none of them exceeds a limit.
    """
    law, scaled, tsp = timed.law, 1.0, timed.timing.tsp
    if joints is None or timed.obstacles:
        return timed, _sampled(path, joints, law, tsp)
    usage = max_limit_utilisation(joints, law, between=timed.timing.law == "limits")
    if usage.share > FOLLOWED:
        scaled = SPARE / usage.share
        if scaled < WORTH_MOVING:
            slow = too_slow(joints, law, usage, scaled)
            return replace(timed, obstacles=(slow,)), _sampled(path, joints, law, tsp)
        law = law.scaled(scaled)
    samples = _sampled(path, joints, law, tsp)
    while samples.joints is not None and (share := samples.joints.speed_share) > FOLLOWED:
        law, scaled = law.scaled(SPARE / share), scaled * SPARE / share
        samples = _sampled(path, joints, law, tsp)
    return replace(timed, law=law, scaled=scaled), samples


def _sampled(path: LineArcPath, joints: PathJoints | None, law: TimeLaw, tsp: float) -> _Samples:
    """Return a law at its samples: at rest at the first one and at the last, up to a period after its end."""
    count = max(math.ceil(law.duration / tsp - ON_TIME), 1) + 1
    if count > MOST:
        allowed = f"a period that makes up to {MOST} samples of {law.duration:.6g} s"
        raise OptionError(Finding(parameter="tsp", found=f"{tsp:g} s", allowed=allowed))
    t_ns = np.round(np.arange(count) * (tsp * 1e9)).astype(np.int64)
    t = np.minimum(ns_to_seconds(t_ns), law.duration)
    along = law.at(t)
    moves = np.append(np.ones(count - 1), 0.0)
    s = np.append(np.clip(along.s[:-1], 0.0, path.total), path.total)
    motion = PathMotion(s, along.v * moves, along.a * moves, along.j * moves)
    if joints is None:
        return _Samples(t_ns, motion, None)
    slopes = joints.at(s)
    rates = slopes.rates(motion.v, motion.a)
    return _Samples(t_ns, motion, PlannedJoints(joints.chain, slopes.q, *rates, path.orientation is not None))


def _warnings(path: LineArcPath, joints: PathJoints | None, timed: _Timed) -> Iterator[LogWarning]:
    """Yield warnings about half turns and about steps of the joints' rates, where the law of limits rests."""
    yield from _half_turns(path)
    if timed.timing.law == "limits":
        return
    uneven = (
        []
        if path.orientation is None
        else [int(k) for k in path.orientation.uneven_rows if k not in path.stop_row]
    )
    if uneven:
        rows = format_rows(np.array(uneven) + 1)
        words = f"the tool's angular rate steps in {rows} while it moves, and so do the joints' rates"
        yield LogWarning("uneven-turn", words)
    if joints is not None and not timed.obstacles and len(steps := joints.rate_steps):
        t = timed.law.time_at(joints.s[steps]).tolist()
        places = ", ".join(f"{in_seconds(one)} s" for one in t[:MAX_NAMED_ROWS])
        more = (
            f" and {format_count(len(t) - MAX_NAMED_ROWS, 'other time')}" if len(t) > MAX_NAMED_ROWS else ""
        )
        words = f"a joint comes to a limit, or leaves it, at t = {places}{more}: there the joints' rates step"
        yield LogWarning("limit-contact", words)


def _beyond_efforts(timed: _Timed, samples: _Samples) -> list[LogWarning]:
    """Return a warning if joints need more than their efforts; nothing where the arm cannot move so."""
    joints = samples.joints
    if joints is None or timed.obstacles or not any(math.isfinite(one.effort) for one in joints.chain.moving):
        return []
    names, t_ns = joints.chain.coordinates, samples.t_ns
    return effort_warning(summarise_torques(names, joints.chain, t_ns, joints.tau), t_ns, MOVE_SLOWER)


def _half_turns(path: LineArcPath) -> Iterator[LogWarning]:
    """Yield from which rows the tool turns by 180 deg to the next."""
    if path.orientation is None:
        return
    turned = np.linalg.norm(path.orientation.rate, axis=1) * np.diff(path.at)
    rows = np.flatnonzero(turned > math.pi - EVEN_TURN_TOLERANCE)
    if len(rows):
        words = f"the tool turns by 180 deg from {format_rows(rows + 1)} to the next: either way is as short"
        yield LogWarning("half-turn", words)
