"""How sure the numbers of causes are: autocorrelation time, and standard errors in correlated noise."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray

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
