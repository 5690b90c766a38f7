"""Jumps between the solutions of neighbouring samples of a path, which no motion along the path explains.

Joint speeds along a solved path, held against what the joints can do.

What following a path returns: joint values, and all that is to be told about them.

Inverse kinematics along a path: one continuous motion, and where there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray, IntArray, TextArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.ik.branch_walk import find_true_runs, follow_branches
from urmpipe_models.ik.closed import ClosedForm, exact_closed_form
from urmpipe_models.ik.path_numeric import LeastMotionPath, unwrap_within_limits
from urmpipe_models.ik.solutions import (
    DEFAULT_SEARCH,
    TURN,
    SearchOptions,
    SingularFamily,
    Targets,
    forward_targets,
    joint_periods,
    pose_errors,
    validate_targets,
)
from urmpipe_models.ik.solutions import wrap_continuous_joints as within_pi_of
from urmpipe_models.ik.solve import find_out_of_reach, solve
from urmpipe_models.ik.task import orientation_length
from urmpipe_models.kinematics.singularity import SingularityLog, singularity_over_log

SMALL_STEP = 0.1
"""A step by less, in [rad] or [m] of every joint, is never a jump."""


@dataclass(frozen=True, slots=True)
class JointStep:
    """What one joint moves by in a jump, in [rad] or [m]."""

    joint: str
    step: float
    unit: str

    def __str__(self) -> str:
        return f"{self.joint} by {self.step:.4g} {self.unit}"


@dataclass(frozen=True, slots=True)
class Jump:
    """A step from one sample to the next that leaves the path.

    Attributes:
        sample: Index of the sample that it leads to, from 0.
        last: Index of the sample that it comes from: those between have no solution.
        t: Its time in [s], from the first sample.
        position: Where the tool is then, x, y, z in [m].
        from_branch: What the solution before is called.
        to_branch: What the solution after is called; the same where a joint starts anew by whole turns.
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
    |p - p'| + l angle(R, R') with l of `turn_length`. Along a path of smooth motion it lies between
    them, however fast a joint turns: near an aligned wrist q4 and q6 may turn far against each other, and
    the tool hardly moves.

    Args:
        chain: The arm.
        q: Joint values of samples that are all reached, in [rad] or [m], shape (m, joints).
        position_only: Whether any orientation will do.
    """
    steps = np.abs(np.diff(q, axis=0))
    at = np.flatnonzero((steps >= SMALL_STEP).any(axis=1))
    before, after, half = q[at], q[at + 1], 0.5 * (q[at] + q[at + 1])
    ends = _apart(chain, before, after, position_only)
    off = np.minimum(_apart(chain, half, before, position_only), _apart(chain, half, after, position_only))
    return np.asarray(at[off > ends] + 1)


def build_jumps(
    chain: Chain,
    samples: IndexArray,
    before: IndexArray,
    q: FloatArray,
    seconds: FloatArray,
    position: FloatArray,
    branch: TextArray,
) -> tuple[Jump, ...]:
    """Return the jumps that lead from samples `before` to `samples`.

    Args:
        chain: The arm.
        samples: Indices that the jumps lead to, shape (m,).
        before: Indices that they come from, shape (m,).
        q: Joint values of all samples in [rad] or [m], shape (n, joints).
        seconds: Times of all samples in [s], shape (n,).
        position: Of the tool in [m], shape (n, 3).
        branch: What the solutions are called, shape (n,).
    """
    units = ["m" if joint.kind == "prismatic" else "rad" for joint in chain.moving]
    found = []
    for sample, last in zip(samples.tolist(), before.tolist(), strict=True):
        steps = q[sample] - q[last]
        large = [int(k) for k in np.argsort(-np.abs(steps), kind="stable") if abs(steps[k]) >= SMALL_STEP]
        joints = tuple(JointStep(chain.coordinates[k], float(steps[k]), units[k]) for k in large)
        x, y, z = position[sample].tolist()
        t = float(seconds[sample])
        found.append(Jump(sample, last, t, (x, y, z), branch[last], branch[sample], joints))
    return tuple(found)


def _apart(chain: Chain, one: FloatArray, other: FloatArray, position_only: bool) -> FloatArray:
    """Return |p - p'| + l angle(R, R') of the tool at joint values, shape (m,), in [m]."""
    there = forward_targets(chain, other)
    distance, turn = pose_errors(chain, one, Targets(there.position) if position_only else there)
    length = orientation_length(chain)
    return np.asarray(np.linalg.norm(distance, axis=1) + length * np.linalg.norm(turn, axis=1))


ROUNDING = 1e-9
"""A speed above its limit by this share is on it."""


@dataclass(frozen=True, slots=True)
class SpeedViolation:
    """A stretch of a path along which a joint would have to move faster than it can.

    Attributes:
        joint: Its name.
        first: Index of the sample, from 0, that the first step too fast starts from.
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


def find_speed_violations(chain: Chain, q: FloatArray, seconds: FloatArray) -> tuple[SpeedViolation, ...]:
    """Return where joints move faster than they can, |q_k - q_{k-1}| / (t_k - t_{k-1}), by sample and joint.

    Over samples without a solution it is the speed that the joint needs at least to be there in time.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints), NaN where there are none.
        seconds: Times in [s], rising, shape (n,).
    """
    reached = np.flatnonzero(np.isfinite(q).all(axis=1))
    speed = np.abs(np.diff(q[reached], axis=0)) / np.diff(seconds[reached])[:, None]
    found = [
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
        for first, last in find_true_runs(speed[:, k] > joint.velocity * (1.0 + ROUNDING))
    ]
    return tuple(sorted(found, key=lambda one: one.first))


@dataclass(frozen=True, slots=True)
class SingularStretch:
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


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joint values along a path, and all that is to be told about them.

    Attributes:
        chain: The arm.
        position_only: Whether any orientation would do.
        method: "spherical wrist", "three parallel axes" or "least motion": how it was followed.
        t_ns: Time of each sample in [ns], shape (n,).
        q: In [rad] or [m], shape (n, joints); NaN where there is no solution.
        branch: What each solution is called, shape (n,), empty where there is none: of a closed form its
            branch, otherwise "1", and a number more after each jump.
        reasons: Why there is none, one line, shape (n,); empty where there is one.
        shortfall: How far the tool stays from a target that it comes near to, in [m], shape (n,); 0 where
            the target is met.
        jumps: Steps that leave the path; see `jumps.jump_samples`.
        too_fast: Stretches along which a joint would have to move faster than it can.
        singular: Stretches in families of singular poses; told of closed forms only.
    """

    chain: Chain
    position_only: bool
    method: str
    t_ns: IntArray
    q: FloatArray
    branch: TextArray
    reasons: TextArray
    shortfall: FloatArray
    jumps: tuple[Jump, ...]
    too_fast: tuple[SpeedViolation, ...]
    singular: tuple[SingularStretch, ...]

    def __len__(self) -> int:
        return len(self.q)

    @property
    def reached(self) -> BoolArray:
        """True where there is a solution, shape (n,)."""
        return np.asarray(np.isfinite(self.q).all(axis=1))

    @cached_property
    def singularity(self) -> SingularityLog:
        """How far the arm is from a singular pose at each sample: smallest singular value, manipulability."""
        return singularity_over_log(self.chain, self.q, orientation=not self.position_only)

    @property
    def nearest_singularity(self) -> int | None:
        """Index of the sample with the least of the smallest singular values; None where none is reached."""
        return int(np.nanargmin(self.singularity.smallest)) if self.reached.any() else None


LEAST_MOTION = "least motion"
"""How a path is followed by an arm, or at positions, without a closed form."""


class _Found(NamedTuple):
    """What a method found along the good samples of a path; see `JointPath`."""

    q: FloatArray
    branch: TextArray | None
    reasons: TextArray
    shortfall: FloatArray
    families: dict[SingularFamily, BoolArray]


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

    The first sample takes the solution nearest to `start`, each other one goes on from the one before:

    - poses of an arm with a closed form: of all branches, each joint in its allowed turn nearest to before,
      the one of least sum (q_k - q_{k-1})^2; where a singular pose leaves a joint free it stays where it
      was (`branch_walk`);
    - everything else: least motion, q_k = argmin |q - q_{k-1}|^2 subject to FK(q) = x_k and the limits
      (`path_newton`), and where no small motion leads on, the solution nearest to before that is found
      from random restarts.

    Joints that turn without end go on counting their turns. A sample that is none (not finite, no rotation)
    or out of reach gets a reason and stops no other; the path goes on after it from the last solution, on
    the same branch if that has one.

    Args:
        chain: The arm.
        targets: Poses, or positions with any orientation, one a sample.
        t_ns: Time of each sample in [ns], rising, shape (n,).
        start: Joint values in [rad] or [m], shape (joints,); of the chain by default.
        within_pi: Write joints that turn without end within (-pi, pi], as CoppeliaSim does. Jumps and
            speeds are those of the motion before that.
        search: How far to search where the motion does not lead on by itself.
        progress: Told the share of the samples that is done, 0 to 1.

    Raises:
        OptionError: With all that is wrong with the options.
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
    good = np.array([not reason for reason in reasons])
    asked = _Asked(chain, targets.rows(good), begin, search, progress or _untold)
    found = _spread(asked.by_least_motion() if form is None else asked.by_closed_form(form), good, reasons)
    asked.progress(1.0)
    return _told(chain, targets, np.asarray(t_ns), found, form, within_pi)


def _untold(share: float) -> None:
    """Tell nobody what share is done."""


@dataclass(frozen=True, slots=True)
class _Asked:
    """What was asked of a method: all samples are good, some may be out of reach."""

    chain: Chain
    targets: Targets
    start: FloatArray
    search: SearchOptions
    progress: Callable[[float], None]

    def by_least_motion(self) -> _Found:
        """Return what least motion finds; its branches have no names of their own."""
        path = LeastMotionPath(self.chain, self.targets, self.start, self.search, self.progress)
        return _Found(path.q, None, path.reasons, path.shortfall, {})

    def by_closed_form(self, form: ClosedForm) -> _Found:
        """Return what a closed form finds; what is out of reach approached from the sample before it."""
        walked = follow_branches(self.chain, form, self.targets, self.start)
        found = _Found(walked.q, walked.branch, walked.reasons, np.zeros(len(walked.q)), walked.singular)
        out = np.flatnonzero(walked.branch == "")
        if self.search.tolerance is None or not len(out):
            return found
        before = _before(walked.q, self.start)
        near = solve(self.chain, self.targets.rows(out), start=before[out], search=self.search)
        met = out[near.reached[:, 0]]
        found.q[out], found.reasons[out] = near.q[:, 0], near.reasons[:, 0]
        for first, last in find_true_runs(walked.branch == ""):
            rows = slice(first, last + 1)
            found.q[rows] = unwrap_within_limits(self.chain, found.q[rows], before[first])
        found.shortfall[out] = near.shortfall[:, 0]
        walked.branch[met] = near.labels[near.reached[:, 0], 0]
        return found


def _told(
    chain: Chain,
    targets: Targets,
    t_ns: IntArray,
    found: _Found,
    form: ClosedForm | None,
    within_pi: bool,
) -> JointPath:
    """Return the path with its jumps, speeds and singular stretches."""
    position_only = targets.rotation is None
    seconds = (t_ns - t_ns[0]) * 1e-9
    reached = np.flatnonzero(np.isfinite(found.q).all(axis=1))
    jumping = find_jumps(chain, found.q[reached], position_only)
    branch = found.branch
    if branch is None:
        branch = _numbered(len(found.q), reached, jumping)
    else:
        jumping = _with_gaps(chain, jumping, found.q, branch, reached)
    jumps = build_jumps(
        chain, reached[jumping], reached[jumping - 1], found.q, seconds, targets.position, branch
    )
    return JointPath(
        chain,
        position_only,
        LEAST_MOTION if form is None else form.name,
        t_ns,
        within_pi_of(found.q, joint_periods(chain)) if within_pi else found.q,
        branch,
        found.reasons,
        found.shortfall,
        jumps,
        find_speed_violations(chain, found.q, seconds),
        tuple(
            SingularStretch(family, first, last, float(seconds[first]), float(seconds[last]))
            for family, where in found.families.items()
            for first, last in find_true_runs(where)
        ),
    )


def _numbered(count: int, reached: NDArray[np.intp], jumping: NDArray[np.intp]) -> TextArray:
    """Return "1" for the samples before the first jump, "2" after it, ..., shape (n,)."""
    jumps = np.zeros(len(reached), dtype=np.intp)
    jumps[jumping] = 1
    branch = np.full(count, "", dtype=np.object_)
    branch[reached] = [str(number) for number in (1 + np.cumsum(jumps)).tolist()]
    return branch


def _with_gaps(
    chain: Chain,
    jumping: NDArray[np.intp],
    q: FloatArray,
    branch: TextArray,
    reached: NDArray[np.intp],
) -> NDArray[np.intp]:
    """Return the jumps among reached samples with others after ones without a solution.

    How the tool would have moved meanwhile is not known, so that its way tells nothing there: a jump leads
    to another branch, or moves a revolute joint by more than half a turn since its limits bar the nearer one.
    """
    gap = np.diff(reached, prepend=-1) > 1
    other = np.append(False, branch[reached][1:] != branch[reached][:-1])
    turned = np.append(False, _turned(chain, q[reached]))
    return np.union1d(jumping[~gap[jumping]], np.flatnonzero(gap & (other | turned)))


def _turned(chain: Chain, q: FloatArray) -> BoolArray:
    """Return at which steps a revolute joint moves by more than half a turn, shape (m - 1,)."""
    revolute = [joint.kind == "revolute" for joint in chain.moving]
    return np.asarray((np.abs(np.diff(q[:, revolute], axis=0)) > 0.5 * TURN).any(axis=1))


def _before(q: FloatArray, start: FloatArray) -> FloatArray:
    """Return of each sample the last solution before it, `start` where there is none, shape (n, joints)."""
    whole = np.isfinite(q).all(axis=1)
    last = np.maximum.accumulate(np.where(whole, np.arange(len(q)), -1))
    return np.asarray(np.vstack((q, start))[last])


def _spread(found: _Found, good: BoolArray, reasons: list[str]) -> _Found:
    """Return what was found of all samples from that of the good ones, the others with their reasons."""
    if good.all():
        return found
    count = len(good)
    q, shortfall = np.full((count, found.q.shape[1]), np.nan), np.zeros(count)
    texts = np.array(reasons, dtype=np.object_)
    q[good], shortfall[good], texts[good] = found.q, found.shortfall, found.reasons
    branch = found.branch
    if branch is not None:
        branch = np.full(count, "", dtype=np.object_)
        branch[good] = found.branch
    families = {}
    for family, where in found.families.items():
        families[family] = np.zeros(count, dtype=bool)
        families[family][good] = where
    return _Found(q, branch, texts, shortfall, families)


def _time_faults(t_ns: IntArray, count: int) -> Iterator[str]:
    """Yield what is wrong with times in [ns]."""
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
    """Yield what is wrong with a start."""
    joints = len(chain.coordinates)
    if start.shape != (joints,) or not np.isfinite(start).all():
        yield (
            f"start: found {np.array2string(start, separator=', ')}, allowed: {joints} finite numbers,"
            f" in rad or m, one each of {', '.join(chain.coordinates)}"
        )
