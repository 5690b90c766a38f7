"""Motion of a network along the rows of a log: one configuration per row, on the branch of the first one.

1. `follow_rows` solves coarse rows first, apart by a scaled length of COARSE_LENGTH of the drives, side by
   side: each along a straight line of the drives from an earlier row, at most MAX_LINE away.
2. Such a line may end on another branch than the log does. So each pair of neighbours is verified: their
   difference must agree with the tangents at both, and the Jacobian must keep its orientation. Where a pair
   fails, the rows between are traced one after another (`continuation.trace_branch`), until both agree again.
3. The rows between are solved side by side, from the tangents at both neighbours, and verified likewise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray
from urmpipe_models.ik.numeric import damped_step
from urmpipe_models.networks.closure import (
    MIN_DAMPING,
    close_by_newton,
    evaluate_scaled_closure,
    iter_chunks,
)
from urmpipe_models.networks.continuation import (
    ROUNDING,
    Drive,
    LimitStop,
    SingularPose,
    sample_branch,
    trace_branch,
)
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.mobility import find_idle_spins, reset_idle_spins

MAX_LINE = 3.0  # scaled length of the lines from a row along which others are solved
COARSE_LENGTH = 0.05  # scaled length of the drives between rows that are solved first
MAX_DISAGREEMENT = 0.1  # share of a difference by which the tangents may miss it; COARSE_LENGTH^2 is usual
SAME_SOLUTION = 1e-7  # scaled difference below which two solutions are the same


@dataclass(eq=False)
class RowMotion:
    """Configurations along rows.

    Attributes:
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given; n rows are reached.
        singular: Singular poses between rows that were traced one after another.
        stop: The limit that ends the motion; None without one.
    """

    x: FloatArray
    singular: list[SingularPose] = field(default_factory=list)
    stop: LimitStop | None = None


def follow_rows(
    mechanism: Mechanism,
    x: FloatArray,
    driven: IndexArray,
    rows: FloatArray,
    free: IndexArray,
    limits: FloatArray,
    progress: Callable[[float], None] = lambda share: None,
) -> RowMotion:
    """Return the motion of a network whose driven variables take the values of rows.

    Args:
        mechanism: The network.
        x: The configuration of the first row, shape (variables,), in [m], [rad] and as controls are given.
        driven: The numbers of the driven variables, shape (driven,) [-].
        rows: Their values, likewise, shape (n, driven).
        free: The numbers of the variables that follow, shape (free,) [-].
        limits: Lower and upper limits of all variables in [m], [rad], shape (variables, 2).
        progress: Called with the share that is done, 0..1.
    """
    return _Follower(mechanism, x, driven, rows, free, limits).run(progress)


@dataclass(eq=False)
class _Follower:
    mechanism: Mechanism
    start: FloatArray
    driven: IndexArray
    rows: FloatArray
    free: IndexArray
    limits: FloatArray

    def __post_init__(self) -> None:
        self.spins = find_idle_spins(self.mechanism)
        self.motion = RowMotion(np.repeat(self.start[:, np.newaxis], len(self.rows), axis=1))
        self.motion.x[self.driven] = self.rows.T
        self.scaled = self.rows / self.mechanism.column_scales[self.driven]
        steps = np.linalg.norm(np.diff(self.scaled, axis=0), axis=1)
        self.length = np.append(0.0, np.cumsum(steps))
        marks = np.searchsorted(self.length, np.arange(0.0, self.length[-1], COARSE_LENGTH))
        self.coarse = np.unique(np.append(marks, len(self.rows) - 1))

    def run(self, progress: Callable[[float], None]) -> RowMotion:
        """Solve the coarse rows piece by piece and verify them, then fill in the others, and verify all."""
        first, last = 0, 0
        while first < len(self.coarse) - 1:
            coarse = self.coarse[first:]
            distance = np.linalg.norm(self.scaled[coarse] - self.scaled[coarse[0]], axis=1)
            far = np.flatnonzero(distance > MAX_LINE)
            piece = coarse[: max(int(far[0]), 2)] if len(far) else coarse
            with np.errstate(all="ignore"):  # rows out of reach: their values are not finite, and verified
                self.motion.x[:, piece[1:]] = self._along_lines(int(piece[0]), piece[1:])
            last = self._verify(piece)
            if last < piece[-1]:
                break
            first += len(piece) - 1
            progress(0.5 * first / len(self.coarse))
        end = last
        for chunk in iter_chunks(last + 1):
            end = self._fill(np.arange(chunk.start, chunk.stop))
            progress(0.5 + 0.5 * chunk.stop / (last + 1))
            if end < chunk.stop - 1:
                break
        self.motion.x = self.motion.x[:, : end + 1]
        self._stop_at_limit()
        poses = {round(pose.s, 6): pose for pose in self.motion.singular if pose.s <= self.motion.x.shape[1]}
        self.motion.singular = [poses[s] for s in sorted(poses)]
        return self.motion

    def _along_lines(self, row: int, ends: IndexArray) -> FloatArray:
        """Return configurations of rows, each along a line of the drives from one row."""
        start, values = self.motion.x[:, row], self.rows[ends].T
        begin = start[self.driven, np.newaxis]
        scales = self.mechanism.column_scales[self.driven, np.newaxis]
        distance = np.linalg.norm((values - begin) / scales, axis=0).max()
        steps = max(1, int(np.ceil(distance / (2.0 * COARSE_LENGTH))))
        x = np.repeat(start[:, np.newaxis], len(ends), axis=1)
        for chunk in iter_chunks(len(ends)):
            local = x[:, chunk]
            for step in range(1, steps + 1):
                local[self.driven] = begin + step / steps * (values[:, chunk] - begin)
                local = close_by_newton(self.mechanism, local, self.free, wrap=True)
            x[:, chunk] = local
        return reset_idle_spins(self.mechanism, self.spins, x, self.start)

    def _verify(self, coarse: IndexArray) -> int:
        """Verify coarse rows, correct those of other branches, and return the last row reached."""
        x = self.motion.x
        good = self._is_continuous(x[:, coarse[:-1]], x[:, coarse[1:]])
        is_on_line = True  # whether the last row is on the branch on which its line ended
        for k in range(len(coarse) - 1):
            first, second = int(coarse[k]), int(coarse[k + 1])
            if is_on_line and good[k]:
                continue
            line = x[:, second].copy()
            end = self._step(x[:, first], second) if not is_on_line else None
            if end is None:
                last, end = self._trace_rows(first, second)
                if last < second:
                    return last
            x[:, second] = end
            difference = self._difference(line[:, np.newaxis], end[:, np.newaxis])
            is_on_line = bool(np.abs(difference).max() < SAME_SOLUTION)
        return int(coarse[-1])

    def _step(self, x: FloatArray, row: int) -> FloatArray | None:
        """Return the configuration of a row next to that of an earlier one; None unless it is continuous."""
        end = x[:, np.newaxis].copy()
        end[self.driven] = self.rows[row][:, np.newaxis]
        change = end - x[:, np.newaxis]
        end[self.free] += self._tangents(x[:, np.newaxis], change)[self.free]
        end = close_by_newton(self.mechanism, end, self.free, wrap=True)
        end = reset_idle_spins(self.mechanism, self.spins, end, self.start)
        return end[:, 0] if self._is_continuous(x[:, np.newaxis], end)[0] else None

    def _trace_rows(self, first: int, second: int) -> tuple[int, FloatArray]:
        """Trace rows one after another; return the last row reached and its configuration."""
        x = self.motion.x[:, first]
        for row in range(first, second):
            change = np.zeros(len(x))
            change[self.driven] = self.rows[row + 1] - self.rows[row]
            if np.any(change):
                drive = Drive(self.mechanism, x, change, self.free, self.limits)
                branch = trace_branch(drive, 0.0)
                for pose, _ in branch.singular:
                    if pose.s <= 1.0:
                        self.motion.singular.append(replace(pose, s=row + pose.s))
                if not branch.complete:
                    if branch.stop is not None:
                        self.motion.stop = replace(branch.stop, s=row + branch.stop.s)
                    return row, x
                x = sample_branch(drive, branch, np.ones(1))[0][:, 0]
            x = reset_idle_spins(self.mechanism, self.spins, x[:, np.newaxis], self.start)[:, 0]
            self.motion.x[:, row + 1] = x
        return second, x

    def _fill(self, rows: IndexArray) -> int:
        """Solve rows from the tangents at their coarse neighbours; return the last row reached."""
        end = int(rows[-1])
        after = np.clip(np.searchsorted(self.coarse, rows), 1, len(self.coarse) - 1)
        first, second = self.coarse[after - 1], self.coarse[after]
        inner = (rows != first) & (rows != second)
        rows, first, second = rows[inner], first[inner], second[inner]
        if not len(rows):
            return end
        known = self.motion.x
        span = self.length[second] - self.length[first]
        share = (self.length[rows] - self.length[first]) / np.where(span > 0.0, span, 1.0)
        weight = share * share * (3.0 - 2.0 * share)
        x = known[:, rows]
        predicted = []
        for ends in (first, second):
            change = np.zeros_like(x)
            change[self.driven] = x[self.driven] - known[:, ends][self.driven]
            predicted.append(known[:, ends] + self._tangents(known[:, ends], change))
        near = _nearest_rotations(self.mechanism, predicted[1], predicted[0])
        x[self.free] = ((1.0 - weight) * predicted[0] + weight * near)[self.free]
        with np.errstate(all="ignore"):  # rows out of reach between coarse rows that are within
            solved = close_by_newton(self.mechanism, x, self.free, wrap=True)
            solved = reset_idle_spins(self.mechanism, self.spins, solved, self.start)
            good = self._is_continuous(known[:, first], solved)
        known[:, rows] = solved
        for begin, stop in sorted({*zip(first[~good].tolist(), second[~good].tolist(), strict=True)}):
            last, _ = self._trace_rows(begin, stop)
            if last < stop:
                return last
        return end

    def _is_continuous(self, first: FloatArray, second: FloatArray) -> BoolArray:
        """Return whether configurations are neighbours on one branch, shape (n,).

        x_2 - x_1 is the mean of both tangents times the change of the drives, up to the square of that; on
        another branch it is not, and the Jacobians of two branches that are near have other orientations.
        """
        good = np.zeros(first.shape[1], dtype=np.bool_)
        for chunk in iter_chunks(first.shape[1]):
            local, other = first[:, chunk], second[:, chunk]
            difference = self._difference(local, other)
            change = np.zeros_like(difference)
            change[self.driven] = other[self.driven] - local[self.driven]
            mean = 0.5 * (self._tangents(local, change) + self._tangents(other, change))
            scales = self.mechanism.column_scales[:, np.newaxis]
            error = np.linalg.norm(((difference - mean) / scales)[self.free], axis=0)
            size = np.linalg.norm((difference / scales)[self.free], axis=0)
            closures = [evaluate_scaled_closure(self.mechanism, x) for x in (local, other)]
            closed = np.abs(closures[1].residual).max(axis=0, initial=0.0) < 1e3 * ROUNDING
            is_good = closed & (error < MAX_DISAGREEMENT * size + SAME_SOLUTION)
            if not self.spins:
                jacobians = [closure.jacobian[:, self.free] for closure in closures]
                products = np.einsum("kin,kjn->nij", *jacobians)
                finite = np.isfinite(products).all(axis=(1, 2))
                is_good &= finite & (np.linalg.det(np.where(finite[:, None, None], products, 0.0)) > 0.0)
            good[chunk] = is_good
        return good

    def _difference(self, first: FloatArray, second: FloatArray) -> FloatArray:
        """Return x_2 - x_1 with rotation vectors next to each other."""
        return np.asarray(_nearest_rotations(self.mechanism, second, first) - first)

    def _tangents(self, x: FloatArray, change: FloatArray) -> FloatArray:
        """Return how all variables change with the driven ones, to first order, shape (variables, n)."""
        scales = self.mechanism.column_scales[:, np.newaxis]
        jacobian = evaluate_scaled_closure(self.mechanism, x).jacobian
        load = np.einsum("kdn,dn->kn", jacobian[:, self.driven], (change / scales)[self.driven])
        moved = np.array(change)
        moved[self.free] = damped_step(jacobian[:, self.free], -load, MIN_DAMPING) * scales[self.free]
        return moved

    def _stop_at_limit(self) -> None:
        """End before the first row at which a variable is beyond a limit."""
        lower, upper = self.limits[:, :1], self.limits[:, 1:]
        beyond = (self.motion.x < lower) | (self.motion.x > upper)
        beyond[self.driven] = False
        row = int(np.argmax(beyond.any(axis=0)))
        if not beyond[:, row].any() or row == 0:
            return
        before, after = self.motion.x[:, row - 1], self.motion.x[:, row]
        place = int(np.argmax(beyond[:, row]))
        limit = float(self.limits[place, int(after[place] > self.limits[place, 1])])
        share = float((limit - before[place]) / (after[place] - before[place]))
        labels, unit = self.mechanism.labels, self.mechanism.variables[place].unit
        x = before + share * (after - before)
        self.motion.stop = LimitStop(labels[place], unit, limit, row - 1 + share, x)
        self.motion.x = self.motion.x[:, :row]


def _nearest_rotations(mechanism: Mechanism, x: FloatArray, to: FloatArray) -> FloatArray:
    """Return configurations whose rotation vectors are the same rotations, nearest to those of others.

    q and (1 - 2 pi / |q|) q are one rotation.
    """
    x = np.array(x)
    for part in mechanism.rotations:
        angle = np.sqrt(np.einsum("kn,kn->n", x[part], x[part]))
        other = x[part] * (1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9))
        squares = [np.square(vector - to[part]).sum(axis=0) for vector in (x[part], other)]
        x[part] = np.where((squares[1] < squares[0]) & (angle > 1e-9), other, x[part])
    return x
