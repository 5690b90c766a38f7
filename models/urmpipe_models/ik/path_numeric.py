"""Samples that were solved beside each other, brought into the turns of the one before each.

Joints held on their limits along a path: which one meets its limit, and which one leaves it again.

For least motion within limits each sample has to satisfy, with the multiplier y of its target: a joint
between its limits moves by J^T y; one on its upper limit would move up by it, one on its lower limit down.

Least motion from sample to sample: one Newton sweep over a window of samples at once.

Of a path x_1, x_2, ... an arm with more freedoms than the path asks for takes

    q_k = argmin |q - q_{k-1}|^2   subject to   FK(q) = x_k,

each sample after the one before. Solved one after the other every sample would wait for its forward
kinematics and Jacobian, which cost about as much for one row as for hundreds. A sweep does these for all
samples of the window in one pass, each at its own guess p_k, and only then goes through the samples, by the
exact solution of the linearised problem with e_k = x_k - FK(p_k):

    q_k = p_k + N_k s_k + J_k^# e_k,    s_k = q_{k-1} - p_k,    N_k = 1 - J_k^# J_k,
    J^# = J^T (J J^T + lambda^2 1)^-1.

Sweeps repeated are Newton's method in all samples at once: what they converge to solves

    q_k - q_{k-1} = J_k^T y_k,    y_k = (x_k - FK(q_k)) / lambda^2,

the condition for least |q - q_{k-1}|^2 + |x_k - FK(q)|^2 / lambda^2. This is least motion with a miss of
lambda^2 d / sigma for a step of d along a direction of singular value sigma, and defined on singular poses,
where least motion alone is not: there a path written to the nanometre would ask for steps of its rounding
divided by sigma. Metres and radians of q weigh alike.

A joint held on a limit has no column in J; J_h^T y_k then says which way it would move if it were free.

A window that slides along a path: what converged leaves it at the front, new samples enter at the back.

The samples at the front converge in a few sweeps (see `path_newton`), and meanwhile those behind them come
near. Samples whose correction is so large that the linearisation says nothing about them leave the window
at the back again, so its length finds itself. A sample at the front that does not converge goes to `rescue`.

A joint whose least motion would leave its limits is held on the limit from that sample on, until least
motion would take it inwards (see `holding`).

A path without a closed form: least motion from sample to sample, restarts where that ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, TextArray
from urmpipe_models.ik.solutions import (
    LIMIT_ROUNDING,
    SearchOptions,
    Targets,
    joint_limits,
    shift_into_limits,
)
from urmpipe_models.ik.solve import solve
from urmpipe_models.ik.task import (
    LDLFactor,
    Task,
    TaskError,
    build_task,
    factor,
    gram,
    product,
    transposed_product,
)


def unwrap_within_limits(chain: Chain, q: FloatArray, last: FloatArray) -> FloatArray:
    """Return joint values with each joint in the allowed turn that is nearest to the sample before.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], within limits, shape (m, joints); NaN where there are none.
        last: Those of the sample before them, in [rad] or [m], shape (joints,).

    Returns:
        Joint values in [rad] or [m], shape (m, joints).
    """
    turned = q.copy()
    for sample in np.flatnonzero(np.isfinite(q).all(axis=1)).tolist():
        turned[sample] = last = shift_into_limits(chain, q[sample], last)[0]
    return turned


INWARDS = 1e-10
"""A joint leaves its limit if it would move inwards by more, in [rad] or [m]: rounding lets none go."""


def next_limit_change(
    q: FloatArray, pull: FloatArray | None, held: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[int, FloatArray]:
    """Return the first sample at which a joint meets or leaves its limit, and where joints are held then.

    Args:
        q: Joint values in [rad] or [m], shape (m, joints).
        pull: How far each joint would move if it were free, in [rad] or [m], shape (m, joints); None where
            all are free.
        held: Where a joint is held in [rad] or [m], NaN of one that is free, shape (joints,).
        lower: Limits in [rad] or [m], shape (joints,).
        upper: Limits in [rad] or [m], shape (joints,).

    Returns:
        The index of the sample, m if there is none, and where joints are held from it on in [rad] or [m],
        shape (joints,).
    """
    free = np.isnan(held)
    beyond = np.where(free, np.maximum(lower - q, q - upper), -np.inf)
    inwards = np.full_like(beyond, -np.inf)
    if pull is not None:
        sense = np.where(held == upper, -1.0, 1.0)
        inwards[:, ~free & (lower < upper)] = (sense * pull)[:, ~free & (lower < upper)]
    meets, leaves = beyond.max(axis=1) > LIMIT_ROUNDING, inwards.max(axis=1) > INWARDS
    at = int(np.argmax(np.append(meets | leaves, True)))
    following = held.copy()
    if at < len(q):
        joint = np.argmax(beyond[at] if meets[at] else inwards[at])
        on = upper[joint] if q[at, joint] > upper[joint] else lower[joint]
        following[joint] = on if meets[at] else np.nan
    return at, following


DAMPING = 1e-8
"""lambda^2 in [m2/rad2]."""

SHARE = 4
"""Sections of a recurrence, in multiples of their length: products of matrices cost more than vectors."""


@dataclass(frozen=True, slots=True, eq=False)
class SweepResult:
    """What a sweep found for the samples of a window.

    Attributes:
        q: Joint values in [rad] or [m], shape (w, joints).
        miss: |x - FK| at the guess that it was linearised at, in [m], rotations times
            `turn_length`, shape (w,).
        pull: J^T y: where each joint would move if it were free, in [rad] or [m], shape (w, joints); None
            where all are.
    """

    q: FloatArray
    miss: FloatArray
    pull: FloatArray | None


def newton_sweep(
    task: Task, guess: FloatArray, last: FloatArray, held: FloatArray, damping: FloatArray
) -> SweepResult:
    """Return the next guess at the joint values of a window of samples.

    Args:
        task: Targets of the window.
        guess: Joint values in [rad] or [m], shape (w, joints), of joints that are held where they are held.
        last: Joint values of the sample before the window, in [rad] or [m], shape (joints,).
        held: Where a joint is held in [rad] or [m], NaN of one that is free, shape (joints,).
        damping: lambda^2 of each sample in [m2/rad2], shape (w,).
    """
    miss = task.miss(np.ascontiguousarray(guess.T))
    free = np.isnan(held)
    J = miss.jacobian * free[:, None]
    system = factor(gram(J), damping)
    columns = LDLFactor(system.lower[:, :, None], system.inverse[:, None]).solve(J)
    null = np.eye(len(held)) - _rows(columns.transpose(1, 0, 2)) @ _rows(J)
    before = np.vstack((np.where(free, last, held), guess[:-1])) - guess
    q = guess + _in_turn(null, before, transposed_product(J, system.solve(miss.error)).T)
    pull = None if free.all() else _pull(system, miss, J, np.vstack((before[:1], q[:-1] - guess[1:])))
    return SweepResult(q, np.sqrt(miss.square), pull)


def _in_turn(null: FloatArray, before: FloatArray, towards: FloatArray) -> FloatArray:
    """Return c_k = N_k c_{k-1} + N_k (p_{k-1} - p_k) + J_k^# e_k, the corrections q_k - p_k.

    Args:
        null: N_k, shape (w, joints, joints).
        before: p_{k-1} - p_k, of the first sample q_0 - p_1, shape (w, joints).
        towards: J_k^# e_k, shape (w, joints).
    """
    return solve_recurrence(null, (null @ before[:, :, None])[:, :, 0] + towards)


def solve_recurrence(matrices: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return c_k = M_k c_{k-1} + a_k with c before the first 0, in any unit, shape (w, m).

    The samples are cut into sections. Side by side each section becomes one map from what it begins with:
    the product of its matrices and what its offsets come to. Only from section to section one waits for the
    other.

    Args:
        matrices: M_k [-], shape (w, m, m), of norms of at most about 1: products of them stay small.
        offsets: a_k in any unit, which is that of c_k, shape (w, m).
    """
    count, size = offsets.shape
    length = max(1, math.isqrt(count // SHARE))
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


def _pull(system: LDLFactor, miss: TaskError, J: FloatArray, s: FloatArray) -> FloatArray:
    """Return J^T y of every joint, held ones too: y = (J J^T + lambda^2 1)^-1 (e - J s)."""
    y = system.solve(miss.error - product(J, np.ascontiguousarray(s.T)))
    return transposed_product(miss.jacobian, y).T


def _rows(matrices: FloatArray) -> FloatArray:
    """Return matrices of shape (k, p, w) one after the other, shape (w, k, p)."""
    return np.ascontiguousarray(matrices.transpose(2, 0, 1))


WINDOW_SIZE = 384
"""Samples of a window: NumPy outweighs Python, and the samples at the back are still worth their sweeps.

What is found depends on it by 1e-8 rad a step, and by 1e-5 rad near singular poses: what the nanometre leaves
open, as how much is damped depends on the sweeps that a sample took."""

MET = 9e-10
"""A target is met within this, in [m]; rotations times `turn_length`: a nanometre less what
a converged sample may still move."""

STILL = 1e-10
"""A sample has converged once a sweep moves no joint by more, in [rad] or [m]."""

NEARLY_STILL = 1e-6
"""Here a miss that is left is one of the damping, not of the sweeps."""

LESS_DAMPING = 0.1
"""What the damping of a sample is multiplied with where it alone keeps the tool from its target ..."""

LEAST_DAMPING = 1e-15
"""... down to this, in [m2/rad2]: less is lost in the rounding of J J^T."""

FAR = 0.1
"""A correction by more, in [rad] or [m], is not trusted."""

PATIENCE = 25
"""Sweeps that the sample at the front may take."""


@dataclass(eq=False)
class SlidingWindow:
    """Least motion along the samples of a path.

    Attributes:
        chain: The arm.
        targets: Where the tool shall be, one a sample.
        start: Joint values in [rad] or [m] that the first sample moves least from, shape (joints,).
        rescue: Given the index of a sample at the front that does not converge and the joint values before
            it, returns those of this sample and of as many more as it likes, shape (m, joints); NaN where
            there are none.
        q: Joint values found in [rad] or [m], shape (n, joints); NaN where there are none.
    """

    chain: Chain
    targets: Targets
    start: FloatArray
    rescue: Callable[[int, FloatArray], FloatArray]
    q: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.q = np.full((len(self.targets), len(self.start)), np.nan)
        self._lower, self._upper = joint_limits(self.chain)
        self._held = np.full_like(self.start, np.nan)
        self._at = 0
        self._last = self.start
        self._rate = np.zeros_like(self.start)
        self._reach = WINDOW_SIZE
        self._empty()

    def slide(self, progress: Callable[[float], None]) -> FloatArray:
        """Go along the whole path and return the joint values in [rad] or [m], shape (n, joints).

        Args:
            progress: Told the share of the samples that is done, 0 to 1.
        """
        while self._at < len(self.q):
            progress(self._at / len(self.q))
            if self._sweeps == PATIENCE:
                self._take_rescue(self.rescue(self._at, self._last))
            else:
                self._enlarge()
                self._advance()
        return self.q

    def _empty(self) -> None:
        """Let all samples out of the window."""
        self._guess = np.empty((0, len(self.start)))
        self._damping = np.empty(0)
        self._sweeps = 0

    def _enlarge(self) -> None:
        """Let samples in at the back, guessed on the line through the two before."""
        new = min(self._reach, len(self.q) - self._at) - len(self._guess)
        if new <= 0:
            return
        ends = np.vstack((self._last - self._rate, self._last, self._guess))[-2:]
        line = ends[1] + np.arange(1, new + 1)[:, None] * (ends[1] - ends[0])
        self._guess = np.vstack((self._guess, np.where(np.isnan(self._held), line, self._held)))
        self._damping = np.concatenate((self._damping, np.full(new, DAMPING)))

    def _advance(self) -> None:
        """Correct the window once, let out at the front what has converged, at the back what is far off."""
        window = self.targets.rows(slice(self._at, self._at + len(self._guess)))
        swept = newton_sweep(
            build_task(self.chain, window), self._guess, self._last, self._held, self._damping
        )
        correction = swept.q - self._guess
        size = np.abs(correction).max(axis=1)
        self._sweeps += 1
        self._lower_damping((size <= NEARLY_STILL) & (swept.miss > MET))
        converged = _leading((size <= STILL) & (swept.miss <= MET))
        trusted = max(1, _leading(size <= FAR))
        self._reach = min(WINDOW_SIZE, 2 * trusted)
        self._guess = self._guess[:trusted] + correction[:trusted] * min(1.0, FAR / max(size[0], FAR))
        self._damping = self._damping[:trusted]
        self._let_out(converged, swept.pull)

    def _lower_damping(self, where: BoolArray) -> None:
        """Damp less where the damping alone keeps the tool from its target."""
        self._damping[where] = np.maximum(LESS_DAMPING * self._damping[where], LEAST_DAMPING)

    def _let_out(self, count: int, pull: FloatArray | None) -> None:
        """Take what is in front of the window as found, up to where a joint meets or leaves a limit."""
        found = self._guess[:count]
        at, held = next_limit_change(
            found, None if pull is None else pull[:count], self._held, self._lower, self._upper
        )
        self._take(np.clip(found[:at], self._lower, self._upper))
        if at < count:
            sweeps = self._sweeps
            self._held = held
            self._empty()
            self._sweeps = sweeps
        else:
            self._guess, self._damping = self._guess[at:], self._damping[at:]

    def _take(self, found: FloatArray) -> None:
        """Take joint values as those of the next samples."""
        if not len(found):
            return
        self.q[self._at : self._at + len(found)] = found
        self._rate = found[-1] - (found[-2] if len(found) > 1 else self._last)
        self._last = found[-1]
        self._at += len(found)
        self._sweeps = 0

    def _take_rescue(self, found: FloatArray) -> None:
        """Take what the rescue found, and begin anew after it: at rest, with no joint held."""
        self.q[self._at : self._at + len(found)] = found
        self._at += len(found)
        reached = found[np.isfinite(found).all(axis=1)]
        self._last = reached[-1] if len(reached) else self._last
        self._rate = np.zeros_like(self.start)
        self._held = np.full_like(self.start, np.nan)
        self._empty()


def _leading(true: BoolArray) -> int:
    """Return how many are true before the first that is not."""
    return int(np.argmin(np.append(true, False)))


MOST_AT_ONCE = 512
"""Samples out of reach that are tried together: a few hundred cost hardly more than one."""

MORE = 4
"""How many times as many are tried next while all are out of reach."""


@dataclass(eq=False)
class LeastMotionPath:
    """Joint values along a path, and why samples have none.

    Where a sample does not follow from the one before by least motion, `solve` looks for it, from the
    sample before and from random restarts. If it is out of reach, so are probably the next ones: they are
    tried together, more of them each time.

    Attributes:
        chain: The arm.
        targets: Poses or positions, one a sample.
        start: Joint values in [rad] or [m] that the first sample moves least from, shape (joints,).
        search: How far to search for what does not follow from the sample before.
        progress: Told the share of the samples that is done, 0 to 1.
        q: Joint values found in [rad] or [m], shape (n, joints); NaN where there are none.
        reasons: Why there are none, shape (n,); empty where there are.
        shortfall: How far the tool stays from targets out of reach, in [m], shape (n,).
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
        window = SlidingWindow(self.chain, self.targets, self.start, self._look_for)
        self.q = window.slide(self.progress)

    def _look_for(self, sample: int, last: FloatArray) -> FloatArray:
        """Return the joint values of a sample, or of it and those after it that are as much out of reach."""
        rows = slice(sample, sample + self._at_once)
        targets = self.targets.rows(rows)
        found = solve(self.chain, targets, start=last, method="iterative", search=self.search)
        met = found.reached[:, 0] & (found.shortfall[:, 0] == 0.0)
        alike = 1 if met[0] else _alike(met, found.reached[:, 0])
        self._at_once = min(MOST_AT_ONCE, MORE * self._at_once) if alike == len(met) and not met[0] else 1
        self.reasons[sample : sample + alike] = found.reasons[:alike, 0]
        self.shortfall[sample : sample + alike] = found.shortfall[:alike, 0]
        return unwrap_within_limits(self.chain, found.q[:alike, 0], last)


def _alike(met: BoolArray, reached: BoolArray) -> int:
    """Return how many samples from the first on are not met and reached, or not, as the first is."""
    other = met | (reached != reached[0])
    return int(np.argmax(np.append(other, True)))
