"""Inverse kinematics along a path: one continuous motion, and where there is none, the jumps.

1. `solve_path`, the entry: validates the samples, follows the path and restores the order.
2. With a closed form (`_follow_branches`): every branch of every sample at once, then from sample to
   sample. Of the solutions of a sample, each joint in the nearest of its allowed turns, the one is taken
   that is nearest to the sample before, sum (q_k - q_{k-1})^2. So a solution continues even where its name
   changes: through an aligned wrist theta5 changes its sign, and a flipped wrist becomes one that is not.
   Where a pose leaves a joint free (a singular family) it stays where it was. After samples without a
   solution the same branch continues if it has a solution, else the nearest.
3. Without one: least motion (`path_numeric`).
4. The result, `JointPath`, with its jumps (`find_jumps`), joint speeds above their limits
   (`_find_speed_violations`) and stretches in singular families.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray, IntArray, TextArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.ik.closed import ClosedForm, exact_closed_form
from urmpipe_models.ik.limits import (
    LIMIT_ROUNDING,
    TURN,
    joint_limits,
    joint_periods,
    limit_solutions,
    unwrap_within_limits,
    wrap_continuous_joints,
)
from urmpipe_models.ik.path_numeric import LeastMotionPath, find_out_of_reach
from urmpipe_models.ik.solutions import (
    DEFAULT_SEARCH,
    SearchOptions,
    SingularFamily,
    Solutions,
    Targets,
    forward_targets,
    pose_errors,
    validate_targets,
)
from urmpipe_models.ik.solve import solve
from urmpipe_models.ik.task import orientation_length
from urmpipe_models.kinematics.singularity import SingularityLog, singularity_over_log

MOTION_METHOD = "least motion"  # of an arm, or of positions, without a closed form
SMALL_STEP = 0.1  # [rad] or [m]; a step by less of every joint is never a jump
SPEED_ROUNDING = 1e-9  # of the limit; a speed above it by less is on it
MIN_LOOKAHEAD, MAX_LOOKAHEAD = (
    8,
    1024,
)  # samples of a column checked together; doubled while it is the nearest


def solve_path(
    chain: Chain,
    targets: Targets,
    t_ns: IntArray,
    *,
    start: FloatArray | None = None,
    within_pi: bool = False,
    search: SearchOptions = DEFAULT_SEARCH,
    progress: Callable[[float], None] | None = None,
) -> JointPath:
    """Return joint values that lead the tool along a path, limits kept.

    The first sample takes the solution nearest to `start`, each other one continues from the one before:

    - poses of an arm with a closed form: of all branches, each joint in its allowed turn nearest to before,
      the one of least sum (q_k - q_{k-1})^2; a joint that a singular pose leaves free stays where it
      was (`_follow_branches`);
    - everything else: least motion, q_k = argmin |q - q_{k-1}|^2 subject to FK(q) = x_k and the limits
      (`path_numeric`), and where no small motion continues it, the solution nearest to before that is found
      from random restarts.

    Continuous joints count their turns. A sample that is invalid (not finite, no rotation)
    or out of reach gets a reason and does not affect the others; the path continues after it from the last
    solution, on the same branch if that has one.

    Args:
        chain: The arm.
        targets: Poses, or positions with any orientation, one per sample.
        t_ns: Time of each sample in [ns], rising, shape (n,).
        start: Joint values in [rad] or [m], shape (joints,); of the chain by default.
        within_pi: Return joints without limits within (-pi, pi], as CoppeliaSim does. Jumps and
            speeds are those of the motion before that.
        search: Limits of the search where the motion does not continue.
        progress: Called with the completed share of the samples, 0 to 1.

    Raises:
        OptionError: With all faults of the options.
    """
    targets, reasons = validate_targets(targets)
    begin = np.array(chain.start if start is None else start, dtype=float)
    faults: list[Finding | str] = [
        *_time_faults(t_ns, len(targets)),
        *_start_faults(chain, begin),
        *search.faults(),
    ]
    if faults:
        raise OptionError(*faults)
    form = None if targets.rotation is None else exact_closed_form(chain)
    if form is None:
        far = find_out_of_reach(chain, targets, search.tolerance)
        reasons = [fault or reason for fault, reason in zip(reasons, far, strict=True)]
    valid = np.array([not reason for reason in reasons])
    progress = progress or (lambda share: None)
    if form is None:
        path = LeastMotionPath(chain, targets.rows(valid), begin, search, progress)
        motion = _Motion(path.q, None, path.reasons, path.shortfall, {})
    else:
        motion = _follow_branches(chain, form, targets.rows(valid), begin, search)
    progress(1.0)
    motion = motion if valid.all() else _insert_invalid(motion, valid, reasons)
    return _build_path(chain, targets, np.asarray(t_ns), motion, form, within_pi)


def _time_faults(t_ns: IntArray, count: int) -> Iterator[str]:
    times = np.asarray(t_ns)
    if count == 0:
        yield "targets: found none, allowed: a path of one sample or more"
    if times.shape != (count,) or not np.issubdtype(times.dtype, np.integer):
        yield f"t_ns: found {times.dtype} of shape {times.shape}, allowed: integer ns of shape ({count},)"
    elif (back := np.flatnonzero(np.diff(times) <= 0)).size:
        sample = int(back[0]) + 1
        yield (
            f"t_ns: found {times[sample]} ns at sample {sample} after {times[sample - 1]} ns,"
            " allowed: times that rise"
        )


def _start_faults(chain: Chain, start: FloatArray) -> Iterator[str]:
    joints = len(chain.coordinates)
    if start.shape != (joints,) or not np.isfinite(start).all():
        yield (
            f"start: found {np.array2string(start, separator=', ')}, allowed: {joints} finite numbers,"
            f" in rad or m, one each of {', '.join(chain.coordinates)}"
        )


class _Motion(NamedTuple):
    """Joint values along the samples of a path; see `JointPath`. Least motion has no names of branches."""

    q: FloatArray
    branch: TextArray | None
    reasons: TextArray
    shortfall: FloatArray
    families: dict[SingularFamily, BoolArray]


def _insert_invalid(motion: _Motion, valid: BoolArray, reasons: list[str]) -> _Motion:
    """Return the motion of all samples from that of the valid ones, the others with their reasons."""
    count = len(valid)
    q, shortfall = np.full((count, motion.q.shape[1]), np.nan), np.zeros(count)
    texts = np.array(reasons, dtype=np.object_)
    q[valid], shortfall[valid], texts[valid] = motion.q, motion.shortfall, motion.reasons
    branch = None
    if motion.branch is not None:
        branch = np.full(count, "", dtype=np.object_)
        branch[valid] = motion.branch
    families = {}
    for family, where in motion.families.items():
        families[family] = np.zeros(count, dtype=bool)
        families[family][valid] = where
    return _Motion(q, branch, texts, shortfall, families)


def _build_path(
    chain: Chain,
    targets: Targets,
    t_ns: IntArray,
    motion: _Motion,
    form: ClosedForm | None,
    within_pi: bool,
) -> JointPath:
    """Return the path with its jumps, speed violations and singular stretches."""
    position_only = targets.rotation is None
    seconds = (t_ns - t_ns[0]) * 1e-9
    reached = np.flatnonzero(np.isfinite(motion.q).all(axis=1))
    jumping = find_jumps(chain, motion.q[reached], position_only)
    branch = motion.branch
    if branch is None:
        is_jump = np.zeros(len(reached), dtype=np.intp)
        is_jump[jumping] = 1
        branch = np.full(len(motion.q), "", dtype=np.object_)
        branch[reached] = [str(number) for number in (1 + np.cumsum(is_jump)).tolist()]
    else:
        jumping = _gap_jumps(chain, jumping, motion.q, branch, reached)
    jumps = _build_jumps(
        chain, reached[jumping], reached[jumping - 1], motion.q, seconds, targets.position, branch
    )
    return JointPath(
        chain,
        position_only,
        MOTION_METHOD if form is None else form.name,
        t_ns,
        wrap_continuous_joints(motion.q, joint_periods(chain)) if within_pi else motion.q,
        branch,
        motion.reasons,
        motion.shortfall,
        jumps,
        _find_speed_violations(chain, motion.q, seconds),
        tuple(
            SingularInterval(family, first, last, float(seconds[first]), float(seconds[last]))
            for family, where in motion.families.items()
            for first, last in find_true_runs(where)
        ),
    )


def _gap_jumps(
    chain: Chain, jumping: IndexArray, q: FloatArray, branch: TextArray, reached: IndexArray
) -> IndexArray:
    """Return the jumps among reached samples, those after samples without a solution by another criterion.

    The motion of the tool meanwhile is unknown. There a jump leads to another branch, or moves a revolute
    joint by more than half a turn since its limits exclude the nearer one.
    """
    gap = np.diff(reached, prepend=-1) > 1
    other = np.append(False, branch[reached][1:] != branch[reached][:-1])
    revolute = [joint.kind == "revolute" for joint in chain.moving]
    half_turn = (np.abs(np.diff(q[reached][:, revolute], axis=0)) > 0.5 * TURN).any(axis=1)
    return np.union1d(jumping[~gap[jumping]], np.flatnonzero(gap & (other | np.append(False, half_turn))))


def _follow_branches(
    chain: Chain, form: ClosedForm, targets: Targets, start: FloatArray, search: SearchOptions
) -> _Motion:
    """Return the solutions along a path; missed targets are approached from the sample before."""
    solutions = limit_solutions(chain, form.solve(targets))
    walk = _BranchWalk(chain, form, targets, solutions, start)
    for sample in np.flatnonzero(solutions.reached.any(axis=1)).tolist():
        if sample > walk.at:
            walk.step(sample)
            walk.follow_column()
    reached, rows = walk.column >= 0, np.arange(len(solutions))
    branch = np.where(reached, solutions.labels[rows, walk.column], "")
    reasons = np.full(len(solutions), "", dtype=np.object_)
    reasons[~reached] = [solutions.reason(sample) for sample in np.flatnonzero(~reached).tolist()]
    families: dict[SingularFamily, BoolArray] = {}
    for poses in solutions.singular:
        where = poses.where[rows, walk.column] & reached
        families[poses.family] = families.get(poses.family, False) | where
    motion = _Motion(walk.q, branch, reasons, np.zeros(len(solutions)), families)
    if search.tolerance is not None and not reached.all():
        _approach_missed(chain, targets, start, search, motion)
    return motion


def _approach_missed(
    chain: Chain, targets: Targets, start: FloatArray, search: SearchOptions, motion: _Motion
) -> None:
    """Write the nearest points of missed targets, or their reasons, into a motion by a closed form."""
    q, branch = motion.q, motion.branch
    assert branch is not None
    runs, missed = find_true_runs(branch == ""), np.flatnonzero(branch == "")
    last = np.maximum.accumulate(np.where(np.isfinite(q).all(axis=1), np.arange(len(q)), -1))
    before = np.asarray(np.vstack((q, start))[last])  # last solution before each sample, or the start
    near = solve(chain, targets.rows(missed), start=before[missed], search=search)
    reached = near.reached[:, 0]
    q[missed], motion.reasons[missed] = near.q[:, 0], near.reasons[:, 0]
    for first, end in runs:
        rows = slice(first, end + 1)
        q[rows] = unwrap_within_limits(chain, q[rows], before[first])
    motion.shortfall[missed] = near.position_residual[:, 0]
    branch[missed[reached]] = near.labels[reached, 0]


class _BranchWalk:
    """A walk along the solutions of a path, sample by sample, or many at once while the column stays.

    Attributes:
        at: The last sample with a solution, -1 before the first.
        q: The solutions taken, shape (n, joints).
        column: The columns that they are in, -1 where there is none, shape (n,).
    """

    def __init__(
        self, chain: Chain, form: ClosedForm, targets: Targets, solutions: Solutions, start: FloatArray
    ) -> None:
        self._chain, self._form, self._targets = chain, form, targets
        self._candidates = _Candidates.of(chain, solutions)
        free = np.zeros(len(solutions), dtype=bool)
        for poses in solutions.singular:
            if poses.free:
                free |= poses.where.any(axis=1)
        self._free = find_true_runs(free)  # stretches at which singular poses leave joints free
        self._last, self._lookahead = start, MIN_LOOKAHEAD
        self.at = -1
        self.q = np.full((len(solutions), len(start)), np.nan)
        self.column = np.full(len(solutions), -1, dtype=np.intp)

    def step(self, sample: int) -> None:
        """Take the nearest solution of a sample; after a gap the one of the same branch."""
        if self._free and self._free[0][0] <= sample:
            rows = slice(sample, self._free.pop(0)[1] + 1)
            solutions = self._form.solve(self._targets.rows(rows), self._last)
            limited = limit_solutions(self._chain, solutions, self._last)
            self._candidates.replace(rows, _Candidates.of(self._chain, limited))
        same = int(self.column[self.at]) if 0 <= self.at < sample - 1 else None
        column, q = self._candidates.nearest(sample, self._last, same)
        self._take(sample, column, q[None])

    def follow_column(self) -> None:
        """Stay in the column as long as its solution is the nearest."""
        column, stop = int(self.column[self.at]), self._free[0][0] if self._free else len(self.q)
        while (first := self.at + 1) < stop:
            rows = slice(first, min(first + self._lookahead, stop))
            q = self._candidates.follow_column(rows, column, self._last)
            if len(q):
                self._take(first, column, q)
            if len(q) < rows.stop - rows.start:
                self._lookahead = MIN_LOOKAHEAD
                return
            self._lookahead = min(2 * self._lookahead, MAX_LOOKAHEAD)

    def _take(self, first: int, column: int, q: FloatArray) -> None:
        rows = slice(first, first + len(q))
        self.q[rows], self.column[rows] = q, column
        self.at, self._last = rows.stop - 1, q[-1]


class _Candidates(NamedTuple):
    """The solutions of samples, and the whole turns by which each joint may differ from them."""

    q: FloatArray  # [rad], shape (n, k, joints); 0 where there is none
    lost: FloatArray  # infinity where there is none, 0 elsewhere [-], shape (n, k)
    least: FloatArray  # fewest whole turns to add to a joint [-], shape (n, k, joints)
    most: FloatArray  # most whole turns to add to a joint [-], shape (n, k, joints)

    @classmethod
    def of(cls, chain: Chain, solutions: Solutions) -> _Candidates:
        lower, upper = joint_limits(chain)
        q = np.where(solutions.reached[..., None], solutions.q, 0.0)
        least = np.ceil((lower - LIMIT_ROUNDING - q) / TURN)
        most = np.floor((upper + LIMIT_ROUNDING - q) / TURN)
        return cls(q, np.where(solutions.reached, 0.0, np.inf), least, most)

    def replace(self, rows: slice, other: _Candidates) -> None:
        for values, replacement in zip(self, other, strict=True):
            values[rows] = replacement

    def nearest(self, sample: int, last: FloatArray, column: int | None) -> tuple[int, FloatArray]:
        """Return the nearest column, or `column` if it has a solution, and its joint values."""
        turns = np.rint((last - self.q[sample]) / TURN)
        near = self.q[sample] + TURN * np.minimum(np.maximum(turns, self.least[sample]), self.most[sample])
        away = near - last
        if column is None or self.lost[sample, column] > 0.0:
            column = int(np.argmin(np.einsum("kj,kj->k", away, away) + self.lost[sample]))
        return column, near[column]

    def follow_column(self, rows: slice, column: int, last: FloatArray) -> FloatArray:
        """Return joint values in [rad] or [m] while a column is the nearest and allowed, shape (m, joints).

        Another solution can only be farther than the shorter way to it, so limits of its turns are not
        considered.

        Args:
            rows: Samples to look at, one after the other.
            column: Of the sample before them.
            last: Joint values of that sample in [rad] or [m], shape (joints,).
        """
        q = self.q[rows, column]
        before = np.vstack((last, q[:-1]))
        turns = np.cumsum(np.rint((before - q) / TURN), axis=0)
        away = self.q[rows] - before[:, None]
        away -= TURN * np.rint(away / TURN)
        nearest = np.argmin(np.einsum("nkj,nkj->nk", away, away) + self.lost[rows], axis=1)
        allowed = (self.least[rows, column] <= turns) & (turns <= self.most[rows, column])
        stays = (nearest == column) & (self.lost[rows, column] == 0.0) & allowed.all(axis=1)
        return np.asarray((q + TURN * turns)[: int(np.argmin(np.append(stays, False)))])


def find_true_runs(where: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last index of every run of true values of `where`, shape (n,), ascending."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False]))))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joint values along a path, with its jumps, speed violations and singular stretches.

    Attributes:
        chain: The arm.
        position_only: Whether any orientation is allowed.
        method: "spherical wrist", "three parallel axes" or "least motion".
        t_ns: Time of each sample in [ns], shape (n,).
        q: In [rad] or [m], shape (n, joints); NaN where there is no solution.
        branch: Name of each solution, shape (n,), empty where there is none: of a closed form its
            branch, otherwise "1", and a number more after each jump.
        reasons: Why there is none, one line, shape (n,); empty where there is one.
        position_residual: Distance of the tool from a target that it comes near to, in [m], shape (n,);
            0 where the target is met.
        jumps: Steps that leave the path; see `find_jumps`.
        speed_violations: Stretches along which a joint exceeds its speed limit.
        singular: Stretches in families of singular poses; of closed forms only.
    """

    chain: Chain
    position_only: bool
    method: str
    t_ns: IntArray
    q: FloatArray
    branch: TextArray
    reasons: TextArray
    position_residual: FloatArray
    jumps: tuple[BranchJump, ...]
    speed_violations: tuple[SpeedViolation, ...]
    singular: tuple[SingularInterval, ...]

    def __len__(self) -> int:
        return len(self.q)

    @property
    def reached(self) -> BoolArray:
        """True where there is a solution, shape (n,)."""
        return np.asarray(np.isfinite(self.q).all(axis=1))

    @cached_property
    def singularity(self) -> SingularityLog:
        """Smallest singular value and manipulability at each sample."""
        return singularity_over_log(self.chain, self.q, orientation=not self.position_only)

    @property
    def nearest_singularity(self) -> int | None:
        """Index of the sample with the least of the smallest singular values; None where none is reached."""
        return int(np.nanargmin(self.singularity.smallest)) if self.reached.any() else None


@dataclass(frozen=True, slots=True)
class JointStep:
    """The step of one joint in a jump, in [rad] or [m]."""

    joint: str
    step: float
    unit: str

    def __str__(self) -> str:
        return f"{self.joint} by {self.step:.4g} {self.unit}"


@dataclass(frozen=True, slots=True)
class BranchJump:
    """A step from one sample to the next that leaves the path.

    Attributes:
        sample: Index of the sample that it leads to, from 0.
        last: Index of the sample that it comes from: those between have no solution.
        t: Its time in [s], from the first sample.
        position: Of the tool then, x, y, z in [m].
        from_branch: Name of the solution before.
        to_branch: Name of the solution after; the same where a joint restarts by whole turns.
        joints: The joints that move by `SMALL_STEP` or more, the largest step first.
    """

    sample: int
    last: int
    t: float
    position: tuple[float, float, float]
    from_branch: str
    to_branch: str
    joints: tuple[JointStep, ...]

    @property
    def text(self) -> str:
        """The jump in one line."""
        place = ", ".join(f"{value:.4f}" for value in self.position)
        branches = (
            f" from {self.from_branch} to {self.to_branch}" if self.from_branch != self.to_branch else ""
        )
        gap = f" since sample {self.last}" if self.last < self.sample - 1 else ""
        steps = ", ".join(map(str, self.joints))
        return f"sample {self.sample} at {self.t:.3f} s, ({place}) m: a jump{gap}{branches}: {steps}"


def find_jumps(chain: Chain, q: FloatArray, position_only: bool) -> IndexArray:
    """Return the samples that a jump leads to, ascending, shape (jumps,).

    A step of `SMALL_STEP` or more is a jump if half of it leads off the path: the tool at the mean of the
    two joint values is farther from both samples than they are from one another, in
    |p - p'| + l angle(R, R') with l of `orientation_length`. Along a path of smooth motion it lies between
    them, however fast a joint turns: near an aligned wrist q4 and q6 may turn far against each other, and
    the tool moves little.

    Args:
        chain: The arm.
        q: Joint values of samples that are all reached, in [rad] or [m], shape (m, joints).
        position_only: Whether any orientation is allowed.
    """
    steps = np.abs(np.diff(q, axis=0))
    at = np.flatnonzero((steps >= SMALL_STEP).any(axis=1))
    before, after, half = q[at], q[at + 1], 0.5 * (q[at] + q[at + 1])
    ends = _pose_distance(chain, before, after, position_only)
    off = np.minimum(
        _pose_distance(chain, half, before, position_only), _pose_distance(chain, half, after, position_only)
    )
    return np.asarray(at[off > ends] + 1)


def _pose_distance(chain: Chain, q: FloatArray, other: FloatArray, position_only: bool) -> FloatArray:
    targets = forward_targets(chain, other)
    distance, turn = pose_errors(chain, q, Targets(targets.position) if position_only else targets)
    length = orientation_length(chain)
    return np.asarray(np.linalg.norm(distance, axis=1) + length * np.linalg.norm(turn, axis=1))


def _build_jumps(
    chain: Chain,
    samples: IndexArray,
    before: IndexArray,
    q: FloatArray,
    seconds: FloatArray,
    position: FloatArray,
    branch: TextArray,
) -> tuple[BranchJump, ...]:
    """Return the jumps that lead from samples `before` to `samples`, both of shape (m,)."""
    units = ["m" if joint.kind == "prismatic" else "rad" for joint in chain.moving]
    jumps = []
    for sample, last in zip(samples.tolist(), before.tolist(), strict=True):
        steps = q[sample] - q[last]
        large = [int(k) for k in np.argsort(-np.abs(steps), kind="stable") if abs(steps[k]) >= SMALL_STEP]
        joints = tuple(JointStep(chain.coordinates[k], float(steps[k]), units[k]) for k in large)
        x, y, z = position[sample].tolist()
        t = float(seconds[sample])
        jumps.append(BranchJump(sample, last, t, (x, y, z), branch[last], branch[sample], joints))
    return tuple(jumps)


@dataclass(frozen=True, slots=True)
class SpeedViolation:
    """A stretch of a path along which a joint would have to exceed its speed limit.

    Attributes:
        joint: Its name.
        first: Index of the sample, from 0, that the first violating step starts from.
        last: Index of the sample that the last one leads to.
        t: Time of the first in [s], from the first sample of the path.
        speed: The largest speed in [rad/s] or [m/s].
        allowed: The joint's limit.
        unit: rad/s or m/s.
    """

    joint: str
    first: int
    last: int
    t: float
    speed: float
    allowed: float
    unit: str

    @property
    def text(self) -> str:
        """The stretch in one line."""
        return (
            f"samples {self.first} to {self.last} from {self.t:.3f} s: joint {self.joint} moves at"
            f" {self.speed:.4g} {self.unit}, allowed: {self.allowed:.4g}"
        )


def _find_speed_violations(chain: Chain, q: FloatArray, seconds: FloatArray) -> tuple[SpeedViolation, ...]:
    """Return where joints exceed their limits, |q_k - q_{k-1}| / (t_k - t_{k-1}), by sample and joint.

    Over samples without a solution it is the speed that the joint needs at least to be there in time.
    """
    reached = np.flatnonzero(np.isfinite(q).all(axis=1))
    speed = np.abs(np.diff(q[reached], axis=0)) / np.diff(seconds[reached])[:, None]
    violations = [
        SpeedViolation(
            joint.name,
            int(reached[first]),
            int(reached[last + 1]),
            float(seconds[reached[first]]),
            float(speed[first : last + 1, k].max()),
            joint.velocity,
            "m/s" if joint.kind == "prismatic" else "rad/s",
        )
        for k, joint in enumerate(chain.moving)
        for first, last in find_true_runs(speed[:, k] > joint.velocity * (1.0 + SPEED_ROUNDING))
    ]
    return tuple(sorted(violations, key=lambda violation: violation.first))


@dataclass(frozen=True, slots=True)
class SingularInterval:
    """A stretch of a path in a family of singular poses.

    Attributes:
        family: Its name.
        first: Index of its first sample, from 0.
        last: Index of its last sample.
        t_first: Time of the first in [s], from the first sample of the path.
        t_last: Time of the last in [s].
    """

    family: SingularFamily
    first: int
    last: int
    t_first: float
    t_last: float

    @property
    def text(self) -> str:
        """The stretch in one line."""
        if self.first == self.last:
            return f"sample {self.first} at {self.t_first:.3f} s: {self.family}"
        times = f"{self.t_first:.3f} to {self.t_last:.3f} s"
        return f"samples {self.first} to {self.last}, {times}: {self.family}"
