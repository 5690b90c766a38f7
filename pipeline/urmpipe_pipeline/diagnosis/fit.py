"""Least squares of a model against what it should be: normal equations, steps, outliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, map_blocks, row_blocks
from urmpipe_models.errors import UrmpipeError
from urmpipe_pipeline.diagnosis.hypotheses import Group, State
from urmpipe_pipeline.runs.reading_errors import Edits

OUTLIER = 6.0
"""A row is left out if it is further off than so many medians: of Gaussian noise none in a million is."""

SELDOM = 0.1
"""Outliers are no more than this share of the rows."""

TAIL = 1.6
"""So many medians a tenth of the rows is beyond, of Gaussian noise in three directions."""

STEPS = 12
"""Steps of a fit: from a good start three are enough."""

STILL = 1e-6
"""A fit has come to rest when a step takes less than this share from what it leaves."""

SHORTENED = 7
"""A step that leaves more is shortened to a third so many times."""

BLOCK = 8192
"""Rows whose Jacobian is in memory at a time, on each thread."""


class Model(Protocol):
    """A side that is modelled, beside what it should be."""

    @property
    def groups(self) -> tuple[Group, ...]:
        """What may differ by some amount."""

    @property
    def rows(self) -> int:
        """How many rows are compared."""

    @property
    def unit(self) -> Literal["m", "rad"]:
        """Of what is judged."""

    @property
    def of_joints(self) -> bool:
        """Whether the joints themselves are judged, not positions."""

    @property
    def sample(self) -> IntArray:
        """Rows of the log, shape (n,)."""

    @property
    def blocks(self) -> IntArray:
        """Which components share a noise, shape (c,)."""

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves in [m] and [rad], shape (c, n); NaN where a side has no value."""

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return what an explanation leaves in [m] and [rad], shape (c, n), and the Jacobian (p, c, n)."""

    def residuals(self, edits: Sequence[Edits], rows: IntArray) -> FloatArray:
        """Return what each of some discrete causes leaves by itself in [m] and [rad], shape (k, c, n)."""

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves of what is judged, in [m] or [rad], shape (k, n)."""

    def wanted(self, rows: IntArray) -> FloatArray:
        """Return what is judged of where the model should be, in [m] or [rad], shape (k, n)."""


@dataclass(frozen=True, eq=False)
class Normal:
    """The normal equations of all columns: all that subsets are scored by.

    Attributes:
        gram: J^T J [-], in the weights of the rows, shape (p, p).
        moment: J^T y [-], shape (p,).
        square: y^T y.
        count: N, the number of rows that stand in them.
    """

    gram: FloatArray
    moment: FloatArray
    square: float
    count: int

    def __add__(self, other: Normal) -> Normal:
        """Return the equations of the rows of both."""
        return Normal(
            self.gram + other.gram,
            self.moment + other.moment,
            self.square + other.square,
            self.count + other.count,
        )

    def without(self, taken: Sequence[int], damping: FloatArray) -> Normal:
        """Return the equations of what is left when some columns are always taken (Schur complement).

        With a damping of sigma^2 / s^2 a column has numbers of about s beside noise of about sigma: what so
        much of it explains needs no other cause.

        Args:
            taken: The columns.
            damping: Of each of them, in the square of its unit to the -1, shape (len(taken),).
        """
        at = np.array(taken, dtype=np.int64)
        if not len(at):
            return self
        inner = self.gram[np.ix_(at, at)] + np.diag(damping)
        size = np.sqrt(np.maximum(np.diag(inner), 1e-300))
        inverse = np.linalg.pinv(inner / size / size[:, np.newaxis], rcond=1e-13, hermitian=True)
        inverse = inverse / size / size[:, np.newaxis]
        across = self.gram[:, at] @ inverse
        gram = self.gram - across @ self.gram[at]
        moment = self.moment - across @ self.moment[at]
        square = self.square - float(self.moment[at] @ inverse @ self.moment[at])
        return Normal(gram, moment, max(square, 0.0), self.count - int(np.count_nonzero(damping == 0.0)))


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows that an explanation is held against.

    Attributes:
        at: Their indices, shape (n,).
        weight: Of each component in [1/m] or [1/rad], one over its noise, shape (c,).
        least: What is no outlier, in these weights.
    """

    at: IntArray
    weight: FloatArray
    least: float = 0.0

    def thinned(self, count: int) -> Rows:
        """Return every so manieth of them, so that about `count` or up to twice as many are left."""
        return replace(self, at=self.at[:: max(len(self.at) // count, 1)])

    def trimmed(self, left: FloatArray) -> Rows:
        """Return those that are no outliers, by what is left of them in [m] and [rad], shape (c, n)."""
        return replace(self, at=self.at[inliers(left * self.weight[:, np.newaxis], self.least)])


def inliers(left: FloatArray, least: float = 0.0) -> BoolArray:
    """Return which rows have a value and are no outliers: no further off than some medians, shape (n,).

    Of a log that rests much of its time the median tells nothing: what a tenth of the rows has is no outlier.

    Args:
        left: In one unit, shape (c, n).
        least: What is no outlier however little the others are off.
    """
    size = np.sqrt((left**2).sum(axis=0))
    known = np.isfinite(size)
    if not known.any():
        return np.asarray(known)
    median, most = np.quantile(size[known], (0.5, 1.0 - SELDOM))
    return np.asarray(known & (size <= OUTLIER * max(median, most / TAIL, least)))


def normal_equations(model: Model, state: State, rows: Rows, groups: Sequence[Group] | None = None) -> Normal:
    """Return the normal equations of an explanation's neighbourhood, in which its own numbers count from 0.

    y = left + J x of the state's own numbers x: so a subset that lacks one of them pays for it.
    """
    taken = list(model.groups if groups is None else groups)
    columns = np.array([c for g in taken for c in g.columns], dtype=np.int64)
    now = state.values[columns]

    def of_block(block: slice) -> Normal:
        """Return the normal equations of one block of rows."""
        left, jacobian = model.linear(state, rows.at[block], taken)
        known = np.isfinite(left).all(axis=0)
        y = (left + np.tensordot(now, jacobian, 1))[:, known] * rows.weight[:, np.newaxis]
        jacobian = jacobian if known.all() else jacobian[:, :, known]
        jacobian *= rows.weight[:, np.newaxis]
        flat, flat_y = jacobian.reshape(len(columns), -1), y.ravel()
        return Normal(flat @ flat.T, flat @ flat_y, float(flat_y @ flat_y), flat_y.size)

    whole = Normal(np.zeros((len(columns), len(columns))), np.zeros(len(columns)), 0.0, 0)
    for part in map_blocks(of_block, row_blocks(len(rows.at), BLOCK)):
        whole = whole + part
    return whole


def residual(model: Model, state: State, rows: IntArray) -> FloatArray:
    """Return what an explanation leaves of rows in [m] and [rad], shape (c, n), worked on by blocks."""
    parts = map_blocks(lambda block: model.residual(state, rows[block]), row_blocks(len(rows)))
    return np.concatenate(parts, axis=1)


def deviation(model: Model, state: State) -> FloatArray:
    """Return what an explanation leaves of what is judged, of all rows, in [m] or [rad], shape (k, n)."""
    rows = np.arange(model.rows)
    parts = map_blocks(lambda block: model.deviation(state, rows[block]), row_blocks(len(rows)))
    return np.concatenate(parts, axis=1)


def cost(model: Model, state: State, rows: Rows) -> float:
    """Return the mean square of what an explanation leaves, in the weights of rows; inf without any."""
    try:
        left = residual(model, state, rows.at) * rows.weight[:, np.newaxis]
    except UrmpipeError:  # numbers that no arm has: a frame beyond what can be computed with
        return np.inf
    known = np.isfinite(left).all(axis=0)
    return float((left[:, known] ** 2).mean()) if known.any() else np.inf


def fitted(
    model: Model,
    state: State,
    groups: Sequence[Group],
    rows: Rows,
    *,
    others: bool = False,
    steps: int = STEPS,
) -> State:
    """Return an explanation whose numbers of some groups leave the least (Gauss-Newton, shortened steps).

    Args:
        model: What is held against what it should be.
        state: Where to start from.
        groups: Whose numbers.
        rows: The rows that count.
        others: Whether the other numbers stay; else they are 0.
        steps: How many are taken at most.
    """
    columns = np.array([c for g in groups for c in g.columns], dtype=np.int64)
    kept = state.values.copy() if others else np.zeros_like(state.values)
    kept[columns] = state.values[columns]
    state = replace(state, values=kept)
    if not len(columns):
        return state
    now = cost(model, state, rows)
    for _ in range(steps):
        normal = normal_equations(model, state, rows, groups)
        size = np.sqrt(np.maximum(np.diag(normal.gram), 1e-300))
        scaled = normal.gram / size / size[:, np.newaxis]
        target = np.linalg.lstsq(scaled, normal.moment / size, rcond=1e-13)[0] / size
        step = target - state.values[columns]
        for _ in range(SHORTENED):
            values = state.values.copy()
            values[columns] += step
            there = replace(state, values=values)
            after = cost(model, there, rows)
            if after <= now:
                break
            step = step / 3.0
        else:
            return state
        gained, state, now = now - after, there, after
        if gained <= STILL * now or now == 0.0:
            break
    return state


BATCH = 5.0  # autocorrelation times a batch lasts: its sum is then short of 10 % of the variance
FEWEST, MOST = 20, 400  # batches: fewer have no variance to speak of, more are not needed

LONGEST = 1 << 17
"""Samples in a row that it is estimated from: 11 minutes at 5 ms."""


def autocorrelation_time(residual: FloatArray, floor: float = 0.0) -> float:
    """Return tau = 1 + 2 sum(rho_k), k = 1, 2, ...: so many samples in a row tell as much as one.

    rho_k is the autocorrelation of all components together. The sum ends before the first pair rho_2i +
    rho_2i+1 that is not positive (initial positive sequence).

    Args:
        residual: Components in any one unit, without NaN, shape (n, k).
        floor: Mean square of a row, in the square of that unit, that means nothing: it counts as white noise.

    Returns:
        tau, at least 1.

    Source: [Geyer1992]_ section 3.3.
    """
    values = residual[:LONGEST]
    count = len(values)
    if count < 4:
        return 1.0
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(values, size, axis=0)
    products = np.fft.irfft((np.abs(spectrum) ** 2).sum(axis=1), size)[: count // 2]
    products[0] += floor * count
    if not products[0] > 0.0:
        return 1.0
    rho = products / products[0]
    pairs = rho[: len(rho) // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    return max(2.0 * float(pairs[: ends[0] if len(ends) else len(pairs)].sum()) - 1.0, 1.0)


def batch_covariance(scores: FloatArray, tau: float) -> tuple[FloatArray, int]:
    """Return the covariance of a sum of correlated scores by batch means, and its degrees of freedom.

    Omega = B / (B - k) sum_b s_b s_b^T, with s_b the sum of the scores of batch b: of residuals r_i in the
    weights W and a Jacobian J_i, s = sum J_i^T W r_i. The covariance of the fitted numbers is then
    (J^T W J)^-1 Omega (J^T W J)^-1, whatever the correlation within a batch.

    Args:
        scores: Of each row in its order in time [-], shape (n, k).
        tau: Autocorrelation time of the residual in rows.

    Returns:
        Omega [-], shape (k, k), and B - k, at least 1.

    Source: [Geyer1992]_ section 3.2.
    """
    count, numbers = scores.shape
    length = 1 if tau < 1.5 else int(np.ceil(BATCH * tau))
    fewest = min(max(FEWEST, 2 * numbers), count)
    batches = int(np.clip(count // length, fewest, count if length == 1 else max(MOST, fewest)))
    edges = np.linspace(0, count, batches + 1).round().astype(np.int64)
    total = np.concatenate((np.zeros((1, numbers)), np.cumsum(scores, axis=0)))
    sums = total[edges[1:]] - total[edges[:-1]]
    free = max(batches - numbers, 1)
    return sums.T @ sums * batches / free, free


def student_quantile(free: int) -> float:
    """Return the 97.5 % quantile of Student's t [-], within 1 % from 5 degrees of freedom on.

    z + (z^3 + z) / (4 n) + (5 z^5 + 16 z^3 + 3 z) / (96 n^2), z = 1.96.

    Source: [AbramowitzStegun1964]_ eq. 26.7.5.
    """
    z = 1.959964
    return float(z + (z**3 + z) / (4 * free) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * free**2))
