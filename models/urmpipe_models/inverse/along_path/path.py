"""Inverse kinematics along a path: one continuous motion, and where there is none."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import BoolArray, FloatArray, IntArray, TextArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.inverse.along_path.branch_walk import walk
from urmpipe_models.inverse.along_path.joint_path import JointPath, SingularStretch
from urmpipe_models.inverse.along_path.joint_speeds import too_fast
from urmpipe_models.inverse.along_path.jumps import jump_samples, jumps_at
from urmpipe_models.inverse.along_path.least_motion_path import LeastMotionPath
from urmpipe_models.inverse.along_path.nearest_turns import in_nearest_turns
from urmpipe_models.inverse.along_path.stretches import stretches
from urmpipe_models.inverse.checks import checked
from urmpipe_models.inverse.closed.closed_form import ClosedForm, exact_form
from urmpipe_models.inverse.farthest import too_far
from urmpipe_models.inverse.limits import TURN, periods
from urmpipe_models.inverse.limits import within_pi as within_pi_of
from urmpipe_models.inverse.search import USUAL_SEARCH, Search
from urmpipe_models.inverse.solutions import SingularFamily
from urmpipe_models.inverse.solve import solve
from urmpipe_models.inverse.targets import Targets

LEAST_MOTION = "least motion"
"""How a path is followed by an arm, or at positions, without a closed form."""


class _Found(NamedTuple):
    """What a method found along the good samples of a path; see `JointPath`."""

    q: FloatArray
    branch: TextArray | None
    reasons: TextArray
    shortfall: FloatArray
    families: dict[SingularFamily, BoolArray]


def follow(
    chain: Chain,
    targets: Targets,
    t_ns: IntArray,
    *,
    start: FloatArray | None = None,
    within_pi: bool = False,
    search: Search = USUAL_SEARCH,
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
    targets, reasons = checked(targets)
    begin = np.array(chain.start if start is None else start, dtype=float)
    faults: list[Finding | str] = [
        *_time_faults(t_ns, len(targets)),
        *_start_faults(chain, begin),
        *search.faults(),
    ]
    if faults:
        raise OptionError(*faults)
    form = None if targets.rotation is None else exact_form(chain)
    if form is None:
        far = too_far(chain, targets, search.tolerance)
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
    search: Search
    progress: Callable[[float], None]

    def by_least_motion(self) -> _Found:
        """Return what least motion finds; its branches have no names of their own."""
        path = LeastMotionPath(self.chain, self.targets, self.start, self.search, self.progress)
        return _Found(path.q, None, path.reasons, path.shortfall, {})

    def by_closed_form(self, form: ClosedForm) -> _Found:
        """Return what a closed form finds; what is out of reach approached from the sample before it."""
        walked = walk(self.chain, form, self.targets, self.start)
        found = _Found(walked.q, walked.branch, walked.reasons, np.zeros(len(walked.q)), walked.singular)
        out = np.flatnonzero(walked.branch == "")
        if self.search.tolerance is None or not len(out):
            return found
        before = _before(walked.q, self.start)
        near = solve(self.chain, self.targets.rows(out), start=before[out], search=self.search)
        met = out[near.reached[:, 0]]
        found.q[out], found.reasons[out] = near.q[:, 0], near.reasons[:, 0]
        for first, last in stretches(walked.branch == ""):
            rows = slice(first, last + 1)
            found.q[rows] = in_nearest_turns(self.chain, found.q[rows], before[first])
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
    jumping = jump_samples(chain, found.q[reached], position_only)
    branch = found.branch
    if branch is None:
        branch = _numbered(len(found.q), reached, jumping)
    else:
        jumping = _with_gaps(chain, jumping, found.q, branch, reached)
    jumps = jumps_at(
        chain, reached[jumping], reached[jumping - 1], found.q, seconds, targets.position, branch
    )
    return JointPath(
        chain,
        position_only,
        LEAST_MOTION if form is None else form.name,
        t_ns,
        within_pi_of(found.q, periods(chain)) if within_pi else found.q,
        branch,
        found.reasons,
        found.shortfall,
        jumps,
        too_fast(chain, found.q, seconds),
        tuple(
            SingularStretch(family, first, last, float(seconds[first]), float(seconds[last]))
            for family, where in found.families.items()
            for first, last in stretches(where)
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
