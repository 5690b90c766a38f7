"""From rows to a plan: the path, its law, the joints, and what their limits leave of the law's speeds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, OptionError, PathError
from urmpipe_models.inverse.along_path.path import follow
from urmpipe_models.inverse.search import Search
from urmpipe_models.inverse.solve import solve
from urmpipe_models.planning.from_rows import path_of
from urmpipe_models.planning.joint_limits import law_of_limits
from urmpipe_models.planning.joint_motion import joint_slopes, polished, targets_at
from urmpipe_models.planning.line_arc import LineArcPath
from urmpipe_models.planning.time_law import PathMotion, TimeLaw
from urmpipe_models.planning.trapezoid import trapezoid_law
from urmpipe_pipeline.joint_log import LogWarning, seconds
from urmpipe_pipeline.planned_paths.given_path import GivenPath
from urmpipe_pipeline.planned_paths.jerk_law import jerk_law
from urmpipe_pipeline.planned_paths.obstacles import WORTH_MOVING, obstacles_of, too_slow
from urmpipe_pipeline.planned_paths.request import ACCELERATION, VELOCITY, Request
from urmpipe_pipeline.planned_paths.result import FOLLOWED, Obstacle, PlannedJoints, PlannedPath
from urmpipe_pipeline.provenance import provenance
from urmpipe_pipeline.text import rows_text

AGAIN = 1.0 - 1e-4
"""What speeds are reduced by further from the second time on, so that a few times are enough [-]."""

ON_TIME = 1e-6
"""A law that ends within this share of a period after a sample ends at it."""

ANYWHERE = 1e3
"""How far from an arm, in [m], a point may be for the nearest one that it reaches to be looked for."""

MOST = 20_000_000
"""Samples of a plan: more come of a mistyped period and would fill the memory."""

Progress = Callable[[float], None] | None


def plan_path(given: GivenPath, request: Request, progress: Progress = None) -> PlannedPath:
    """Return the plan of a path.

    Args:
        given: Its rows.
        request: What is to be planned; `request` has checked it.
        progress: Told the share that is done, 0..1.

    Raises:
        PathError: With every row that the arm does not reach, and by how much.
        OptionError: If the samples are too many.

    Source: [Iso9283]_ section 4, steps 7 to 18.
    """
    path = path_of(given.rows)
    if request.arm is not None:
        _refuse_out_of_reach(given, path, request.arm, request.start)
    timing = request.timing
    law = _law(path, request)
    law, scaled, sampled = _within_limits(path, law, request, _sampled(path, law, request, progress))
    options = timing.options | {"robot": request.arm.name if request.arm else None}
    return PlannedPath(
        name=given.name, robot=request.arm, rows=given.rows, law=timing.law, arcs=timing.arcs,
        velocity=timing.speed, acceleration=timing.rise, jerk=timing.jerk,
        scaled=1.0 if timing.law == "limits" else scaled, tsp=timing.tsp,
        duration=law.duration, t_ns=sampled.t_ns, motion=sampled.motion, begins=law.time_at(path.bounds),
        passes=law.time_at(path.at),
        joints=sampled.joints, obstacles=sampled.obstacles, warnings=(*given.warnings, *_warnings(path)),
        provenance=provenance("plan", options, [given.file] if given.file else []),
    )  # fmt: skip


def _refuse_out_of_reach(given: GivenPath, path: LineArcPath, arm: Chain, start: FloatArray | None) -> None:
    """Raise a `PathError` with every row that the arm does not get to on the path, and how near it gets."""
    targets = targets_at(path, path.at)
    found = solve(arm, targets, start=start)
    out = np.flatnonzero(~found.reached[:, 0])
    if not len(out):
        return
    near = solve(arm, targets.rows(out), start=start, search=Search(tolerance=ANYWHERE))
    faults = []
    for k, row in enumerate(out.tolist()):
        gap = float(near.shortfall[k, 0])
        away = f"{gap:.3g} m out of reach of {arm.name}" if gap > 0.0 else f"{arm.name}: {found.reason(row)}"
        point = ", ".join(f"{value:.6g}" for value in targets.position[row])
        allowed = "a point that the arm reaches"
        faults.append(Finding(file=given.source, row=row + 1, found=f"({point}) m, {away}", allowed=allowed))
    raise PathError(*faults)


def _law(path: LineArcPath, request: Request) -> TimeLaw:
    """Return the law that was asked for, the limits of the joints asked only by that of limits."""
    timing = request.timing
    speed, rise = timing.speed or math.inf, timing.rise or math.inf
    if timing.law == "jerk":
        return jerk_law(path, speed, rise, timing.jerk or math.inf, timing.arcs)
    if timing.law == "limits" and request.arm is not None:
        law = law_of_limits(request.arm, path, request.start, speed, rise)
        if law is not None:
            return law
        # What the arm does not reach is told of any law.
        speed, rise = VELOCITY, ACCELERATION
    return trapezoid_law(path, speed, rise, timing.arcs)


@dataclass(frozen=True, slots=True, eq=False)
class _Sampled:
    """A law at its samples: times in [ns], the motion along the path, the joints, what is in their way."""

    t_ns: IntArray
    motion: PathMotion
    joints: PlannedJoints | None = None
    obstacles: tuple[Obstacle, ...] = ()

    @property
    def t(self) -> FloatArray:
        """Times in [s], shape (n,)."""
        return seconds(self.t_ns)


def _sampled(path: LineArcPath, law: TimeLaw, request: Request, progress: Progress) -> _Sampled:
    """Return a law at its samples: at rest at the first one and at the last, up to a period after its end."""
    period = request.timing.tsp
    count = math.ceil(law.duration / period - ON_TIME) + 1
    if count > MOST:
        allowed = f"a period that makes up to {MOST} samples of {law.duration:.6g} s"
        raise OptionError(Finding(parameter="tsp", found=f"{period:g} s", allowed=allowed))
    t_ns = np.round(np.arange(count) * (period * 1e9)).astype(np.int64)
    moves = (seconds(t_ns) < law.duration).astype(float)
    along = law.at(np.minimum(seconds(t_ns), law.duration))
    s = np.where(moves == 1.0, np.clip(along.s, 0.0, path.total), path.total)
    motion = PathMotion(s, along.v * moves, along.a * moves, along.j * moves)
    if request.arm is None:
        return _Sampled(t_ns, motion)
    followed = follow(request.arm, targets_at(path, s), t_ns, start=request.start, progress=progress)
    followed = replace(followed, q=polished(request.arm, path, followed.q, s))
    slopes = joint_slopes(request.arm, path, followed.q, s)
    joints = PlannedJoints(followed, *slopes.rates(motion.v, motion.a))
    found = tuple(sorted(obstacles_of(path, motion, seconds(t_ns), joints), key=lambda one: one.t))
    return _Sampled(t_ns, motion, joints, found)


def _within_limits(
    path: LineArcPath, law: TimeLaw, request: Request, sampled: _Sampled
) -> tuple[TimeLaw, float, _Sampled]:
    """Return the law with its speeds reduced so that no joint exceeds a limit, the factor, and its samples.

    Rates fall with the factor, accelerations with its square. Its samples stand elsewhere on the path, so it
    is done again until none of them exceeds a limit.
    """
    scaled, slower, found = 1.0, law, sampled
    while found.joints is not None and not found.obstacles:
        shares = np.stack((found.joints.velocity_share, np.sqrt(found.joints.acceleration_share)))
        _, sample, joint = np.unravel_index(int(np.nanargmax(shares)), shares.shape)
        if shares.max() <= FOLLOWED:
            break
        factor = float(1.0 / shares.max()) * (1.0 if scaled == 1.0 else AGAIN)
        scaled *= factor
        if scaled < WORTH_MOVING:
            name = found.joints.path.chain.coordinates[joint]
            slow = too_slow(path, sampled.motion.s, sampled.t, int(sample), name, scaled)
            return law, 1.0, replace(sampled, obstacles=(slow,))
        slower = slower.slower(factor)
        found = _sampled(path, slower, request, None)
    return slower, scaled, found


def _warnings(path: LineArcPath) -> Iterator[LogWarning]:
    """Yield what a person should know of a path: where the tool's turn changes its rate on the way."""
    uneven = [] if path.turning is None else [int(k) for k in path.turning.uneven if k not in path.stop_row]
    if uneven:
        rows = rows_text(np.array(uneven) + 1)
        said = f"the tool's turn changes its rate while it moves, in {rows}: there the joints' speeds step"
        yield LogWarning("uneven-turn", said)
