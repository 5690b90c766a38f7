"""Weighted least squares of a model: normal equations, Gauss-Newton, outliers, and correlated noise.

1. A row is an outlier beyond `MAX_MEDIANS` medians of the residual lengths (`find_inliers`).
2. With residual r, Jacobian J, weights W and y = r + J x: (J^T W^2 J) x = J^T W^2 y, summed over blocks of
   rows (`normal_equations`). Subsets of causes are scored from these sums alone (selection.py).
3. `fit_parameters` repeats 2 where the last step led, shortening a step that leaves more (Gauss-Newton).
4. Residuals are correlated in time: tau rows in sequence count as one (`autocorrelation_time`), and the
   covariance of the parameters is (J^T W^2 J)^-1 Omega (J^T W^2 J)^-1 (`batch_covariance`).
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import add
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, map_blocks, row_blocks
from urmpipe_models.errors import UrmpipeError
from urmpipe_pipeline.diagnosis.hypotheses import Group, Model, State

MAX_MEDIANS = (
    6.0  # length of a residual over the median; of Gaussian noise fewer than one in a million exceed it
)
MAX_OUTLIERS = 0.1  # fraction of the rows
TAIL = 1.6  # medians that a tenth of the rows exceeds, of Gaussian noise in three directions
MAX_STEPS = 12  # of a fit; from a good start three are enough
MIN_GAIN = 1e-6  # fraction of the mean square; a step that gains less is the last
MAX_SHORTENINGS = 7  # of a step, each to a third
BLOCK = 8192  # rows whose Jacobian is in memory at a time, on each thread

BATCH = 5.0  # autocorrelation times per batch: its sum is then short of 10 % of the variance
MIN_BATCHES, MAX_BATCHES = 20, 400  # fewer do not determine a variance, more are not needed
MAX_SAMPLES = 1 << 17  # for an autocorrelation time: 11 minutes at 5 ms


class NormalEquations(NamedTuple):
    """The normal equations of all columns, from which subsets of them are scored.

    Attributes:
        gram: J^T J [-], in the weights of the rows, shape (p, p).
        moment: J^T y [-], shape (p,).
        square: y^T y.
        size: N, the number of weighted values in y.
    """

    gram: FloatArray
    moment: FloatArray
    square: float
    size: int

    def without(self, columns: Sequence[int], damping: FloatArray) -> NormalEquations:
        """Return the equations of the residual after some columns are fitted (Schur complement).

        With a damping of sigma^2 / s^2 a column has a parameter of about s in noise of about sigma: no other
        cause is needed for what such a parameter explains.

        Args:
            columns: The columns.
            damping: Of each of them, in the square of its unit to the -1, shape (len(columns),).
        """
        at = np.array(columns, dtype=np.int64)
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
        undamped = int(np.count_nonzero(damping == 0.0))
        return NormalEquations(gram, moment, max(square, 0.0), self.size - undamped)


class WeightedRows(NamedTuple):
    """Rows with the weights of their residuals.

    Attributes:
        at: Indices of the rows, shape (n,).
        weight: Of each component in [1/m] or [1/rad], one over its noise, shape (c,).
        inlier_size: Weighted length [-] up to which no residual is an outlier.
    """

    at: IntArray
    weight: FloatArray
    inlier_size: float = 0.0

    def thin(self, count: int) -> WeightedRows:
        """Return evenly spaced rows, at least `count` and less than twice as many."""
        return self._replace(at=self.at[:: max(len(self.at) // count, 1)])

    def without_outliers(self, residuals: FloatArray) -> WeightedRows:
        """Return the rows that are no outliers by their residuals in [m] and [rad], shape (c, n)."""
        weighted = residuals * self.weight[:, np.newaxis]
        return self._replace(at=self.at[find_inliers(weighted, self.inlier_size)])


def find_inliers(residuals: FloatArray, inlier_size: float = 0.0) -> BoolArray:
    """Return which rows have a value and are no outliers, shape (n,).

    If a log is at rest most of its time, the median is too small: residuals that a tenth of the rows reaches
    are no outliers.

    Args:
        residuals: In one unit, shape (c, n).
        inlier_size: Length up to which no residual is an outlier.
    """
    size = np.sqrt((residuals**2).sum(axis=0))
    known = np.isfinite(size)
    if not known.any():
        return np.asarray(known)
    median, most = np.quantile(size[known], (0.5, 1.0 - MAX_OUTLIERS))
    return np.asarray(known & (size <= MAX_MEDIANS * max(median, most / TAIL, inlier_size)))


def normal_equations(
    model: Model, state: State, rows: WeightedRows, groups: Sequence[Group] | None = None
) -> NormalEquations:
    """Return the normal equations near an explanation, for its parameters counted from 0.

    y = residual + J x with the explanation's parameters x: a subset without one of them has a larger
    residual.
    """
    groups = list(model.groups if groups is None else groups)
    columns = np.array([c for group in groups for c in group.columns], dtype=np.int64)
    x = state.values[columns]

    def of_block(block: slice) -> NormalEquations:
        left, jacobian = model.linear(state, rows.at[block], groups)
        known = np.isfinite(left).all(axis=0)
        y = (left + np.tensordot(x, jacobian, 1))[:, known] * rows.weight[:, np.newaxis]
        jacobian = jacobian if known.all() else jacobian[:, :, known]
        jacobian *= rows.weight[:, np.newaxis]
        flat, flat_y = jacobian.reshape(len(columns), -1), y.ravel()
        return NormalEquations(flat @ flat.T, flat @ flat_y, float(flat_y @ flat_y), flat_y.size)

    total = NormalEquations(np.zeros((len(columns), len(columns))), np.zeros(len(columns)), 0.0, 0)
    for part in map_blocks(of_block, row_blocks(len(rows.at), BLOCK)):
        total = NormalEquations(*map(add, total, part))
    return total


def residual(model: Model, state: State, rows: IntArray) -> FloatArray:
    """Return `model.residual` in [m] and [rad], shape (c, n), computed in blocks of rows."""
    parts = map_blocks(lambda block: model.residual(state, rows[block]), row_blocks(len(rows)))
    return np.concatenate(parts, axis=1)


def deviation(model: Model, state: State) -> FloatArray:
    """Return `model.deviation` of all rows in [m] or [rad], shape (k, n), computed in blocks of rows."""
    rows = np.arange(model.rows)
    parts = map_blocks(lambda block: model.deviation(state, rows[block]), row_blocks(len(rows)))
    return np.concatenate(parts, axis=1)


def cost(model: Model, state: State, rows: WeightedRows) -> float:
    """Return the weighted mean square [-] of the residual; inf without any value."""
    try:
        left = residual(model, state, rows.at) * rows.weight[:, np.newaxis]
    except UrmpipeError:  # parameters beyond any arm: a frame too far away to be computed
        return np.inf
    known = np.isfinite(left).all(axis=0)
    return float((left[:, known] ** 2).mean()) if known.any() else np.inf


def fit_parameters(
    model: Model,
    state: State,
    groups: Sequence[Group],
    rows: WeightedRows,
    *,
    keep_others: bool = False,
    max_steps: int = MAX_STEPS,
) -> State:
    """Return an explanation with the parameters of some groups fitted (Gauss-Newton with shortened steps).

    Args:
        model: The model.
        state: Start.
        groups: The groups that are fitted.
        rows: The rows that count.
        keep_others: Whether the other parameters keep their values; else they become 0.
        max_steps: Maximum number of steps.
    """
    columns = np.array([c for group in groups for c in group.columns], dtype=np.int64)
    values = state.values.copy() if keep_others else np.zeros_like(state.values)
    values[columns] = state.values[columns]
    state = state._replace(values=values)
    if not len(columns):
        return state
    before = cost(model, state, rows)
    for _ in range(max_steps):
        normal = normal_equations(model, state, rows, groups)
        size = np.sqrt(np.maximum(np.diag(normal.gram), 1e-300))
        scaled = normal.gram / size / size[:, np.newaxis]
        target = np.linalg.lstsq(scaled, normal.moment / size, rcond=1e-13)[0] / size
        step = target - state.values[columns]
        for _ in range(MAX_SHORTENINGS):
            values = state.values.copy()
            values[columns] += step
            candidate = state._replace(values=values)
            after = cost(model, candidate, rows)
            if after <= before:
                break
            step = step / 3.0
        else:
            return state
        gain, state, before = before - after, candidate, after
        if gain <= MIN_GAIN * before or before == 0.0:
            break
    return state


def autocorrelation_time(residuals: FloatArray, floor: float = 0.0) -> float:
    """Return tau = 1 + 2 sum(rho_k), k = 1, 2, ..., in rows: n rows count as n / tau independent ones.

    rho_k is the autocorrelation of all components together. The sum ends before the first pair rho_2i +
    rho_2i+1 that is not positive (initial positive sequence).

    Args:
        residuals: Components in any one unit, without NaN, shape (n, k).
        floor: Negligible mean square per row, in the square of that unit: it counts as white noise.

    Returns:
        tau, at least 1.

    Source: [Geyer1992]_ section 3.3.
    """
    values = residuals[:MAX_SAMPLES]
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
    weights W and a Jacobian J_i, s = sum J_i^T W r_i. The covariance of the fitted parameters is then
    (J^T W J)^-1 Omega (J^T W J)^-1, whatever the correlation within a batch.

    Args:
        scores: Of each row in its order in time [-], shape (n, k).
        tau: Autocorrelation time of the residual in rows.

    Returns:
        Omega [-], shape (k, k), and B - k, at least 1.

    Source: [Geyer1992]_ section 3.2.
    """
    count, parameters = scores.shape
    length = 1 if tau < 1.5 else int(np.ceil(BATCH * tau))
    fewest = min(max(MIN_BATCHES, 2 * parameters), count)
    batches = int(np.clip(count // length, fewest, count if length == 1 else max(MAX_BATCHES, fewest)))
    edges = np.linspace(0, count, batches + 1).round().astype(np.int64)
    total = np.concatenate((np.zeros((1, parameters)), np.cumsum(scores, axis=0)))
    sums = total[edges[1:]] - total[edges[:-1]]
    free = max(batches - parameters, 1)
    return sums.T @ sums * batches / free, free


def student_quantile(free: int) -> float:
    """Return the 97.5 % quantile of Student's t [-], within 1 % from 5 degrees of freedom on.

    z + (z^3 + z) / (4 n) + (5 z^5 + 16 z^3 + 3 z) / (96 n^2), z = 1.96.

    Source: [AbramowitzStegun1964]_ eq. 26.7.5.
    """
    z = 1.959964
    return float(z + (z**3 + z) / (4 * free) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * free**2))
