"""Derivatives held against central differences, with the error that these have."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

EPSILON = float(np.finfo(float).eps)


def assert_slope(
    of: Callable[[float], ArrayLike],
    slope: ArrayLike,
    *,
    third: float,
    size: float = 1.0,
    rounding: float = 10.0,
    h: float = 1e-5,
) -> None:
    """Hold a derivative at 0 against (f(h) - f(-h)) / 2h, whose error is h^2 f''' / 6 + r eps |f| / h.

    Args:
        of: f, of a number; its values are arrays of any shape.
        slope: f'(0), of the same shape.
        third: The most that an entry of f''' can be near 0.
        size: The most that an entry of f, or what it is computed from, can be.
        rounding: r, how many roundings of that size an entry of f may be off by.
        h: The step.
    """
    difference = (np.asarray(of(h), dtype=float) - np.asarray(of(-h), dtype=float)) / (2.0 * h)
    bound = h**2 * third / 6.0 + rounding * EPSILON * size / h
    np.testing.assert_allclose(np.asarray(slope, dtype=float), difference, rtol=0.0, atol=bound)


def assert_jacobian(
    of: Callable[[NDArray[np.float64]], ArrayLike],
    columns: NDArray[np.float64],
    q: NDArray[np.float64],
    *,
    third: float,
    size: float,
) -> None:
    """Hold the derivatives by each row of q, shape (k, n), against differences; `assert_slope` says which.

    Args:
        of: A function of q.
        columns: Its derivatives, shape (k, ...).
        q: Where.
        third: See `assert_slope`.
        size: See `assert_slope`.
    """
    for column, step in zip(columns, np.eye(len(q)), strict=True):
        assert_slope(partial(_along, of, q, step), column, third=third, size=size)


def _along(
    of: Callable[[NDArray[np.float64]], ArrayLike],
    q: NDArray[np.float64],
    step: NDArray[np.float64],
    h: float,
) -> ArrayLike:
    return of(q + h * step[:, None])
