"""How many samples of a deviation tell something of their own: its autocorrelation time."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray

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
