"""From joint values towards the target, step by step: three methods on one block of rows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from urmpipe_models.elementwise import Element
from urmpipe_models.inverse.small_systems import dot_product, factor, gram
from urmpipe_models.inverse.task import BoolArray, FloatArray, IntArray, Miss, Task, picked, restore

Method = Literal["lm", "dls", "pinv"]

METHODS: tuple[Method, ...] = ("lm", "dls", "pinv")

FIRST_GAIN = 0.1
"""Levenberg-Marquardt starts with mu = 0.1 |e|^2."""

GAINS = (1e-8, 1e8)
"""Between these mu / |e|^2 stays; a row that reaches the upper one finds no better point near it."""

STATIONARY = 1e-7
"""Where the cosine between e and what each free joint can change of it is less, e cannot be made less."""

LONGEST_STEP = 0.5
"""Of damped least squares and the pseudoinverse, in [rad] or [m] of any joint."""

RANK_CUTOFF = 1e-6
"""Singular values below this part of the largest count as 0 in the pseudoinverse."""


@dataclass(frozen=True, slots=True)
class Settings:
    """How a descent steps and when it has arrived; see `iterative.refine`."""

    lower: FloatArray
    upper: FloatArray
    method: Method = "lm"
    metres: float = 1e-10
    radians: float = 1e-10
    damping: float = 0.05

    @property
    def limited(self) -> bool:
        """Whether any joint has a limit."""
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())


@dataclass(frozen=True, slots=True)
class Progress:
    """How far every row of a batch has come.

    Attributes:
        q: Joint values in [rad] or [m], shape (joints, n).
        gain: mu / |e|^2 of Levenberg-Marquardt, shape (n,).
        steps: Taken so far, shape (n,).
        distance: |target - tool| in [m], shape (n,).
        angle: Between tool and target in [rad], shape (n,).
        arrived: True where both are within what was asked for, shape (n,).
        ended: True where no step more is to be taken, shape (n,).
    """

    q: FloatArray
    gain: FloatArray
    steps: IntArray
    distance: FloatArray
    angle: FloatArray
    arrived: BoolArray
    ended: BoolArray

    @classmethod
    def at(cls, q: FloatArray) -> Progress:
        """Return the progress of rows that have not moved from q, shape (n, joints)."""
        n = len(q)
        return cls(
            np.ascontiguousarray(q.T),
            np.full(n, FIRST_GAIN),
            np.zeros(n, np.intp),
            np.full(n, np.nan),
            np.full(n, np.nan),
            np.zeros(n, np.bool_),
            np.zeros(n, np.bool_),
        )


@dataclass(frozen=True, slots=True)
class Rows:
    """The rows of a block that are still on their way, one array a coordinate."""

    index: IntArray
    task: Task
    q: list[FloatArray]
    gain: FloatArray
    miss: Miss

    def kept(self, rows: IntArray) -> Rows:
        """Return some of the rows."""
        task, q, miss = self.task.kept(rows), picked(self.q, rows), self.miss.kept(rows)
        return Rows(self.index.take(rows), task, q, self.gain.take(rows), miss)


def descend(progress: Progress, task: Task, index: IntArray, settings: Settings, steps: int) -> None:
    """Take some rows of a batch up to `steps` steps further; those that have arrived leave early.

    Args:
        progress: Of the batch; the rows at `index` are brought up to date.
        task: The targets of the rows at `index`.
        index: Where the rows stand in the batch.
        settings: How to step.
        steps: The most to take.
    """
    q = list(progress.q[:, index])
    rows = Rows(index, task, q, progress.gain[index], task.miss(q))
    rows = _parted(progress, rows, _ended(rows, settings), settings)
    for _ in range(steps):
        if not len(rows.index):
            return
        progress.steps[rows.index] += 1
        rows = _stepped(rows, settings)
        rows = _parted(progress, rows, ~(_under_way(rows.miss, settings)), settings)
    _store(progress, rows, settings)


def _under_way(miss: Miss, settings: Settings) -> BoolArray:
    """Return where the target is neither met nor not a number."""
    square = miss.square
    return (square < np.inf) & ~_met(miss, settings)


def _met(miss: Miss, settings: Settings) -> BoolArray:
    """Return where position and orientation are as near as was asked for."""
    within = miss.distance2 <= settings.metres**2
    return np.asarray(within & (miss.turn2 <= (miss.length * settings.radians) ** 2))


def _ended(rows: Rows, settings: Settings) -> BoolArray:
    """Return where the target is met, is no number, or cannot be come nearer to.

    The gradient of |e|^2 / 2 is -J^T e; held joints do not count.
    """
    J = _held(rows, settings)
    least = STATIONARY**2 * rows.miss.square
    moves = np.zeros(len(rows.index), np.bool_)
    for column in zip(*J, strict=True):
        slope = dot_product(column, rows.miss.error)
        moves |= slope * slope > least * dot_product(column, column)
    moves &= rows.gain < GAINS[1]
    return ~(_under_way(rows.miss, settings) & moves)


def _parted(progress: Progress, rows: Rows, leaving: BoolArray, settings: Settings) -> Rows:
    """Store the rows that leave, and return the others."""
    if not leaving.any():
        return rows
    gone = rows.kept(np.flatnonzero(leaving))
    _store(progress, gone, settings)
    progress.ended[gone.index] = True
    return rows.kept(np.flatnonzero(~leaving))


def _store(progress: Progress, rows: Rows, settings: Settings) -> None:
    """Write how far the rows have come."""
    at = rows.index
    for joint, value in zip(progress.q, rows.q, strict=True):
        joint[at] = value
    progress.gain[at] = rows.gain
    progress.distance[at] = np.sqrt(rows.miss.distance2)
    progress.angle[at] = np.sqrt(rows.miss.turn2) / rows.miss.length
    progress.arrived[at] = _met(rows.miss, settings)


def _held(rows: Rows, settings: Settings) -> list[list[Element]]:
    """Return J without the joints that stand at a limit and would leave it downhill: J^T e points out."""
    J = rows.miss.jacobian
    if not settings.limited:
        return J
    free = [
        ~((q <= low) & (slope < 0.0) | (q >= high) & (slope > 0.0))
        for q, low, high, slope in zip(
            rows.q,
            settings.lower,
            settings.upper,
            (dot_product(column, rows.miss.error) for column in zip(*J, strict=True)),
            strict=True,
        )
    ]
    return [[np.where(one, value, 0.0) for one, value in zip(free, row, strict=True)] for row in J]


def _stepped(rows: Rows, settings: Settings) -> Rows:
    """Return the rows after one step of the method, within limits."""
    J = _held(rows, settings)
    if settings.method == "lm":
        return _marquardt(rows, J, settings)
    step = _pseudoinverse(J, rows.miss.error) if settings.method == "pinv" else None
    if step is None:
        step = damped_step(J, rows.miss.error, (settings.damping * rows.miss.length) ** 2)
    longest = np.max(np.abs(step), axis=0)
    shorter = np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))
    q = _limited([value + shorter * change for value, change in zip(rows.q, step, strict=True)], settings)
    return replace(rows, q=q, miss=rows.task.miss(q))


def _marquardt(rows: Rows, J: list[list[Element]], settings: Settings) -> Rows:
    """Return the rows after a Levenberg-Marquardt step, taken where it comes nearer as foreseen."""
    now = rows.miss
    square = now.square
    step = damped_step(J, now.error, rows.gain * square)
    q = _limited([value + change for value, change in zip(rows.q, step, strict=True)], settings)
    step = [after - before for after, before in zip(q, rows.q, strict=True)] if settings.limited else step
    left = [error - dot_product(row, step) for error, row in zip(now.error, J, strict=True)]
    foreseen = square - dot_product(left, left)
    new = rows.task.miss(q)
    gained = square - new.square
    accepted = (gained > 1e-4 * foreseen) & (foreseen > 0.0)
    gain = rows.gain * np.where(gained > 0.75 * foreseen, 0.125, np.where(gained < 0.25 * foreseen, 4.0, 1.0))
    gain = np.clip(gain, *GAINS)
    refused = np.flatnonzero(~accepted)
    if len(refused):
        restore(q, rows.q, refused)
        new = new.restored(refused, now)
    return replace(rows, q=q, gain=gain, miss=new)


def damped_step(J: list[list[Element]], error: list[FloatArray], damping: Element) -> list[FloatArray]:
    """Return dq = (J^T J + mu I)^-1 J^T e = J^T (J J^T + mu I)^-1 e, by the smaller of the two systems.

    Args:
        J: Its rows.
        error: e.
        damping: mu, in the unit of J squared.
    """
    columns = list(zip(*J, strict=True))
    if len(J) <= len(columns):
        y = factor(gram(J), damping).solve(error)
        return [dot_product(column, y) for column in columns]
    return factor(gram(columns), damping).solve([dot_product(column, error) for column in columns])


def _pseudoinverse(J: list[list[Element]], error: list[FloatArray]) -> list[FloatArray]:
    """Return J^+ e, J^+ the Moore-Penrose pseudoinverse by singular values."""
    count = len(error[0])
    matrix = np.array([[np.broadcast_to(value, count) for value in row] for row in J]).transpose(2, 0, 1)
    return list(np.einsum("nij,jn->in", np.linalg.pinv(matrix, rcond=RANK_CUTOFF), np.array(error)))


def _limited(q: list[FloatArray], settings: Settings) -> list[FloatArray]:
    """Return joint values within their limits."""
    if not settings.limited:
        return q
    return [
        np.clip(value, low, high) for value, low, high in zip(q, settings.lower, settings.upper, strict=True)
    ]
