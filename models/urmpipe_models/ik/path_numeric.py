"""Least motion along a path, for arms without a closed form and for positions.

Along a path x_1, x_2, ... an arm with more freedoms than the path takes

    q_k = argmin |q - q_{k-1}|^2   subject to   FK(q) = x_k,

each sample after the one before. Solved one after the other every sample would wait for its forward
kinematics and Jacobian, which cost about as much for one row as for hundreds.

1. `newton_sweep` computes these for all samples of a window in one pass, each at its guess p_k, and only
   then goes through the samples, by the exact solution of the linearised problem with e_k = x_k - FK(p_k):

       q_k = p_k + N_k s_k + J_k^# e_k,    s_k = q_{k-1} - p_k,    N_k = 1 - J_k^# J_k,
       J^# = J^T (J J^T + lambda^2 1)^-1.

   Sweeps repeated are Newton's method in all samples at once. They converge to the solution of

       q_k - q_{k-1} = J_k^T y_k,    y_k = (x_k - FK(q_k)) / lambda^2,

   the condition for least |q - q_{k-1}|^2 + |x_k - FK(q)|^2 / lambda^2. This is least motion with an error
   of lambda^2 d / sigma for a step of d along a direction of singular value sigma, and defined on singular
   poses, where least motion alone is not: there a path written to the nanometre would require steps of its
   rounding divided by sigma. Metres and radians of q weigh alike.
2. `SlidingWindow`: converged samples leave the window at the front, new ones enter at the back. Those at
   the front converge in a few sweeps, and meanwhile those after them come near. Samples whose correction is
   too large for the linearisation leave at the back again, so the window finds its length.
3. `_next_limit_change`: a joint whose least motion would leave its limits is fixed at the limit from that
   sample on and has no column in J; J_h^T y_k then is its step if it were free, and it is released where
   that points inwards.
4. `LeastMotionPath`: a sample at the front that does not converge is searched for by `solve`, from the sample
   before and from random restarts. `find_out_of_reach` rejects targets beyond the length of the arm
   beforehand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, TextArray, row_norms
from urmpipe_models.ik.limits import LIMIT_ROUNDING, joint_limits, unwrap_within_limits
from urmpipe_models.ik.solutions import SearchOptions, Targets
from urmpipe_models.ik.solve import solve
from urmpipe_models.ik.task import (
    LDLFactor,
    Task,
    build_task,
    factor,
    gram,
    product,
    transposed_product,
)

MAX_AT_ONCE = 512  # samples out of reach that are tried together: a few hundred cost little more than one
GROWTH = 4  # factor of their number while all are out of reach

# Samples of a window: NumPy outweighs Python, and the samples at the back are still worth their sweeps.
# Results depend on it by 1e-8 rad per step, and by 1e-5 rad near singular poses: what the nanometre leaves
# open, as the damping depends on the sweeps that a sample took.
WINDOW_SIZE = 384
# [m], rotations times `orientation_length`; a nanometre less the last motion of a converged sample.
MET = 9e-10
CONVERGED = 1e-10  # [rad] or [m]; a sample has converged once a sweep moves no joint by more
NEARLY_CONVERGED = 1e-6  # [rad] or [m]; a remaining error is then one of the damping, not of the sweeps
DAMPING_FACTOR = 0.1  # for the damping of a sample where it alone keeps the tool from its target ...
MIN_DAMPING = 1e-15  # [m2/rad2]; ... down to this: less is lost in the rounding of J J^T
MAX_CORRECTION = 0.1  # [rad] or [m]; a larger one is not trusted
MAX_SWEEPS = 25  # of the sample at the front

DAMPING = 1e-8  # lambda^2 in [m2/rad2]
SECTION_SHARE = 4  # sections of a recurrence per length: products of matrices cost more than vectors
# [rad] or [m]; a smaller step inwards is rounding, and the joint stays at its limit.
RELEASE_TOLERANCE = 1e-10
REACH_MARGIN = 1e-3  # [m]; targets nearer to the edge of the reach are left to the search


@dataclass(eq=False)
class LeastMotionPath:
    """Joint values along a path, and why samples have none.

    Where a sample does not follow from the one before by least motion, `solve` searches for it. If it is
    out of reach, the next ones probably are, too: they are tried together, more of them each time.

    Attributes:
        chain: The arm.
        targets: Poses or positions, one per sample.
        start: Joint values in [rad] or [m] that the first sample moves least from, shape (joints,).
        search: Limits of the search for what does not follow from the sample before.
        progress: Called with the completed share of the samples, 0 to 1.
        q: Joint values in [rad] or [m], shape (n, joints); NaN in missing rows.
        reasons: Why there are none, shape (n,); empty where there are.
        shortfall: Distances of the tool from targets out of reach, in [m], shape (n,).
    """

    chain: Chain
    targets: Targets
    start: FloatArray
    search: SearchOptions
    progress: Callable[[float], None]
    q: FloatArray = field(init=False)
    reasons: TextArray = field(init=False)
    shortfall: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.targets)
        self.reasons = np.full(count, "", dtype=np.object_)
        self.shortfall = np.zeros(count)
        self._at_once = 1
        window = SlidingWindow(self.chain, self.targets, self.start, self._search_for)
        self.q = window.slide(self.progress)

    def _search_for(self, sample: int, last: FloatArray) -> FloatArray:
        """Return the joint values of a sample, or of it and those after it that are out of reach count."""
        rows = slice(sample, sample + self._at_once)
        targets = self.targets.rows(rows)
        solutions = solve(self.chain, targets, start=last, method="iterative", search=self.search)
        met = solutions.reached[:, 0] & (solutions.position_residual[:, 0] == 0.0)
        reached = solutions.reached[:, 0]
        other = met | (reached != reached[0])
        count = 1 if met[0] else int(np.argmax(np.append(other, True)))
        self._at_once = min(MAX_AT_ONCE, GROWTH * self._at_once) if count == len(met) and not met[0] else 1
        self.reasons[sample : sample + count] = solutions.reasons[:count, 0]
        self.shortfall[sample : sample + count] = solutions.position_residual[:count, 0]
        return unwrap_within_limits(self.chain, solutions.q[:count, 0], last)


def find_out_of_reach(chain: Chain, targets: Targets, tolerance: float | None) -> list[str]:
    """Return why targets are out of reach of any posture, one text each; empty where they may be in it.

    Args:
        chain: The arm.
        targets: n of them; one that is not finite has no reason here.
        tolerance: In [m] along each axis, of targets that the tool need only come near to.
    """
    reach = max_reach(chain)
    first = (chain.base @ chain.joints[0].origin).translation
    away = row_norms(targets.position - np.array(first))
    reasons = [""] * len(targets)
    for row in np.flatnonzero(away > reach + REACH_MARGIN + math.sqrt(3.0) * (tolerance or 0.0)).tolist():
        reasons[row] = f"the target is {away[row]:.3f} m from the first joint, allowed: {reach:.3f} m at most"
    return reasons


def max_reach(chain: Chain) -> float:
    """Return the largest distance of the tool centre point from the first joint's frame, in [m].

    It is the sum of the offsets from frame to frame, and of the longest stroke of each prismatic joint: no
    posture is longer. Limits of revolute joints are not considered, so that few arms get there.
    """
    offsets = [joint.origin.translation for joint in chain.joints[1:]]
    offsets += [chain.tip.translation, chain.tool.translation]
    return sum(math.hypot(*offset) for offset in offsets) + sum(_strokes(chain))


def _strokes(chain: Chain) -> Iterator[float]:
    """Yield the longest stroke of each prismatic joint."""
    coordinates = {joint.name: joint for joint in chain.moving}
    for joint in chain.joints:
        if joint.kind == "prismatic" and joint.mimic is None:
            yield max(abs(joint.lower), abs(joint.upper))
        elif joint.kind == "prismatic" and joint.mimic is not None:
            leader = coordinates[joint.mimic.joint]
            ends = (joint.mimic.multiplier * end + joint.mimic.offset for end in (leader.lower, leader.upper))
            yield max(map(abs, ends))


@dataclass(eq=False)
class SlidingWindow:
    """Least motion along the samples of a path.

    Attributes:
        chain: The arm.
        targets: One per sample.
        start: Joint values in [rad] or [m] that the first sample moves least from, shape (joints,).
        rescue: Called with the index of a sample at the front that does not converge and the joint values
            before it, returns those of this sample and of any number of samples after it, shape (m,
            joints); NaN in missing rows.
        q: Joint values in [rad] or [m], shape (n, joints); NaN in missing rows.
    """

    chain: Chain
    targets: Targets
    start: FloatArray
    rescue: Callable[[int, FloatArray], FloatArray]
    q: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.q = np.full((len(self.targets), len(self.start)), np.nan)
        self._lower, self._upper = joint_limits(self.chain)
        self._fixed = np.full_like(self.start, np.nan)
        self._at = 0
        self._last = self.start
        self._rate = np.zeros_like(self.start)
        self._length = WINDOW_SIZE
        self._empty()

    def slide(self, progress: Callable[[float], None]) -> FloatArray:
        """Go along the path and return the joint values in [rad] or [m], shape (n, joints).

        Args:
            progress: Called with the completed share of the samples, 0 to 1.
        """
        while self._at < len(self.q):
            progress(self._at / len(self.q))
            if self._sweeps == MAX_SWEEPS:
                self._take_rescue(self.rescue(self._at, self._last))
            else:
                self._enlarge()
                self._advance()
        return self.q

    def _empty(self) -> None:
        self._guess = np.empty((0, len(self.start)))
        self._damping = np.empty(0)
        self._sweeps = 0

    def _enlarge(self) -> None:
        """Add samples at the back, guessed on the line through the two before."""
        new = min(self._length, len(self.q) - self._at) - len(self._guess)
        if new <= 0:
            return
        ends = np.vstack((self._last - self._rate, self._last, self._guess))[-2:]
        line = ends[1] + np.arange(1, new + 1)[:, None] * (ends[1] - ends[0])
        self._guess = np.vstack((self._guess, np.where(np.isnan(self._fixed), line, self._fixed)))
        self._damping = np.concatenate((self._damping, np.full(new, DAMPING)))

    def _advance(self) -> None:
        """Correct the window once; converged samples leave at the front, untrusted ones at the back."""
        window = self.targets.rows(slice(self._at, self._at + len(self._guess)))
        sweep = newton_sweep(
            build_task(self.chain, window), self._guess, self._last, self._fixed, self._damping
        )
        correction = sweep.q - self._guess
        size = np.abs(correction).max(axis=1)
        self._sweeps += 1
        weaker = (size <= NEARLY_CONVERGED) & (sweep.error > MET)
        self._damping[weaker] = np.maximum(DAMPING_FACTOR * self._damping[weaker], MIN_DAMPING)
        converged = _leading((size <= CONVERGED) & (sweep.error <= MET))
        trusted = max(1, _leading(size <= MAX_CORRECTION))
        self._length = min(WINDOW_SIZE, 2 * trusted)
        self._guess = self._guess[:trusted] + correction[:trusted] * min(
            1.0, MAX_CORRECTION / max(size[0], MAX_CORRECTION)
        )
        self._damping = self._damping[:trusted]
        self._release(converged, sweep.pull)

    def _release(self, count: int, pull: FloatArray | None) -> None:
        """Take the first samples of the window, up to where a joint meets or leaves a limit."""
        q = self._guess[:count]
        at, fixed = _next_limit_change(
            q, None if pull is None else pull[:count], self._fixed, self._lower, self._upper
        )
        self._take(np.clip(q[:at], self._lower, self._upper))
        if at < count:
            sweeps = self._sweeps
            self._fixed = fixed
            self._empty()
            self._sweeps = sweeps
        else:
            self._guess, self._damping = self._guess[at:], self._damping[at:]

    def _take(self, q: FloatArray) -> None:
        if not len(q):
            return
        self.q[self._at : self._at + len(q)] = q
        self._rate = q[-1] - (q[-2] if len(q) > 1 else self._last)
        self._last = q[-1]
        self._at += len(q)
        self._sweeps = 0

    def _take_rescue(self, q: FloatArray) -> None:
        """Take the samples of the rescue, and restart after them: at rest, with no joint fixed."""
        self.q[self._at : self._at + len(q)] = q
        self._at += len(q)
        reached = q[np.isfinite(q).all(axis=1)]
        self._last = reached[-1] if len(reached) else self._last
        self._rate = np.zeros_like(self.start)
        self._fixed = np.full_like(self.start, np.nan)
        self._empty()


def _leading(values: BoolArray) -> int:
    """Return the number of true values before the first false one."""
    return int(np.argmin(np.append(values, False)))


class SweepResult(NamedTuple):
    """Result of a sweep for the samples of a window.

    Attributes:
        q: Joint values in [rad] or [m], shape (w, joints).
        error: |x - FK| at the guess of the linearisation, in [m], rotations times `orientation_length`,
            shape (w,).
        pull: J^T y: the step of each joint if it were free, in [rad] or [m], shape (w, joints); None
            where all are.
    """

    q: FloatArray
    error: FloatArray
    pull: FloatArray | None


def newton_sweep(
    task: Task, guess: FloatArray, last: FloatArray, fixed: FloatArray, damping: FloatArray
) -> SweepResult:
    """Return the next guess of the joint values of a window of samples.

    Args:
        task: Targets of the window.
        guess: Joint values in [rad] or [m], shape (w, joints); of fixed joints their fixed values.
        last: Joint values of the sample before the window, in [rad] or [m], shape (joints,).
        fixed: Values of fixed joints in [rad] or [m], NaN of a free one, shape (joints,).
        damping: lambda^2 of each sample in [m2/rad2], shape (w,).
    """
    error = task.error(np.ascontiguousarray(guess.T))
    free = np.isnan(fixed)
    J = error.jacobian * free[:, None]
    system = factor(gram(J), damping)
    columns = LDLFactor(system.lower[:, :, None], system.inverse[:, None]).solve(J)
    null = np.eye(len(fixed)) - _matrix_rows(columns.transpose(1, 0, 2)) @ _matrix_rows(J)
    before = np.vstack((np.where(free, last, fixed), guess[:-1])) - guess
    # corrections c_k = q_k - p_k = N_k c_{k-1} + N_k (p_{k-1} - p_k) + J_k^# e_k
    towards = transposed_product(J, system.solve(error.vector)).T
    q = guess + solve_recurrence(null, (null @ before[:, :, None])[:, :, 0] + towards)
    pull = None
    if not free.all():
        s = np.vstack((before[:1], q[:-1] - guess[1:]))
        y = system.solve(error.vector - product(J, np.ascontiguousarray(s.T)))
        pull = transposed_product(error.jacobian, y).T
    return SweepResult(q, np.sqrt(error.square), pull)


def solve_recurrence(matrices: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return c_k = M_k c_{k-1} + a_k, with 0 before the first one, in any unit, shape (w, m).

    The samples are cut into sections. In parallel each section becomes one map of its initial value: the
    product of its matrices and the sum of its offsets. Only the sections are evaluated one after the other.

    Args:
        matrices: M_k [-], shape (w, m, m), of norms of at most about 1: products of them stay small.
        offsets: a_k in any unit, which is that of c_k, shape (w, m).
    """
    count, size = offsets.shape
    length = max(1, math.isqrt(count // SECTION_SHARE))
    sections = -(-count // length)
    products, sums = np.zeros((sections * length, size, size)), np.zeros((sections * length, size, 1))
    products[:count], sums[:count, :, 0] = matrices, offsets
    products, sums = products.reshape(sections, length, size, size), sums.reshape(sections, length, size, 1)
    for k in range(1, length):
        sums[:, k] += products[:, k] @ sums[:, k - 1]
        products[:, k] = products[:, k] @ products[:, k - 1]
    begins = np.zeros((sections, 1, size, 1))
    for k in range(1, sections):
        begins[k, 0] = products[k - 1, -1] @ begins[k - 1, 0] + sums[k - 1, -1]
    return np.asarray((products @ begins + sums).reshape(-1, size)[:count])


def _matrix_rows(matrices: FloatArray) -> FloatArray:
    """Return matrices of shape (k, p, w) as shape (w, k, p)."""
    return np.ascontiguousarray(matrices.transpose(2, 0, 1))


def _next_limit_change(
    q: FloatArray, pull: FloatArray | None, fixed: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[int, FloatArray]:
    """Return the first sample at which a joint meets or leaves its limit, and the fixed joints from it on.

    `pull`, shape (m, joints), is the step of each joint if it were free; None where all are. The sample is
    m if there is none.
    """
    free = np.isnan(fixed)
    beyond = np.where(free, np.maximum(lower - q, q - upper), -np.inf)
    inwards = np.full_like(beyond, -np.inf)
    if pull is not None:
        sense = np.where(fixed == upper, -1.0, 1.0)
        inwards[:, ~free & (lower < upper)] = (sense * pull)[:, ~free & (lower < upper)]
    meets, leaves = beyond.max(axis=1) > LIMIT_ROUNDING, inwards.max(axis=1) > RELEASE_TOLERANCE
    at = int(np.argmax(np.append(meets | leaves, True)))
    following = fixed.copy()
    if at < len(q):
        joint = np.argmax(beyond[at] if meets[at] else inwards[at])
        on = upper[joint] if q[at, joint] > upper[joint] else lower[joint]
        following[joint] = on if meets[at] else np.nan
    return at, following
