"""Values with two derivatives: each rule against differences of the function itself, through NumPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from urmpipe_models.networks.rates import Taylor

FIRST = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840
SECOND = np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040
STEP = 0.01

RULES: dict[str, Callable[[Any, Any], Any]] = {
    "add": lambda u, v: 3.0 + u + v,
    "subtract": lambda u, v: 1.5 - u - v,
    "negative": lambda u, v: -u,
    "multiply": lambda u, v: u * v * 2.0,
    "divide": lambda u, v: u / v,
    "reciprocal": lambda u, v: 2.0 / u,
    "square": lambda u, v: np.square(u),
    "power": lambda u, v: u**3 - v**-2 + u**0.5,
    "power of a negative base": lambda u, v: (-u) ** 3,
    "variable power": lambda u, v: u**v + 2.0**v,
    "sin": lambda u, v: np.sin(u),
    "cos": lambda u, v: np.cos(u * v),
    "tan": lambda u, v: np.tan(0.5 * u),
    "exp": lambda u, v: np.exp(u - v),
    "log": lambda u, v: np.log(u),
    "sqrt": lambda u, v: np.sqrt(u + v),
    "arctan2": lambda u, v: np.arctan2(u - 1.0, -v),
    "floor": lambda u, v: u * np.floor(v + 7.5),
    "remainder": lambda u, v: np.remainder(u + 10.0, 6.0),
    "absolute": lambda u, v: np.abs(u - 5.0) + np.abs(v),
    "maximum": lambda u, v: np.maximum(u * u, v - 9.0) + np.maximum(u, 0.1),
    "minimum": lambda u, v: np.minimum(u - 9.0, v * v) + np.minimum(0.1, v),
    "where": lambda u, v: np.where(u > v, u * v, v / u) + np.where(u < 0.0, 1.0, v),
}


def u_at(t: Any) -> Any:
    return 1.2 + 0.4 * t + 0.3 * t**2


def v_at(t: Any) -> Any:
    return 2.0 + 0.2 * t - 0.5 * t**2


@pytest.mark.parametrize("name", RULES)
def test_rules_are_derivatives(name: str) -> None:
    """Of the columns u(t) and v(t) at three times, and of floats."""
    t, steps = np.array([0.0, 0.3, -0.2]), STEP * np.arange(-4, 5)
    u = Taylor(u_at(t), 0.4 + 0.6 * t, np.full(3, 0.6))
    v = Taylor(v_at(t), 0.2 - t, np.full(3, -1.0))
    found, rule = RULES[name](u, v), RULES[name]
    values = np.array([rule(u_at(t + step), v_at(t + step)) for step in steps])
    # eighth order: h^8 = 1e-16; rounding of 1e-15 / h and 1e-14 / h^2
    np.testing.assert_allclose(found.value, rule(u_at(t), v_at(t)), rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.first, FIRST @ values / STEP, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.second, SECOND @ values / STEP**2, rtol=0, atol=1e-9)
    scalar = rule(Taylor(u_at(0.3), 0.58, 0.6), Taylor(v_at(0.3), -0.1, -1.0))
    numbers = [float(one) for one in (scalar.value, scalar.first, scalar.second)]
    np.testing.assert_allclose(
        numbers, [one[1] for one in (found.value, found.first, found.second)], rtol=1e-14
    )


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_powers_of_zero(n: int) -> None:
    power = Taylor(np.array([0.0]), 0.7, 0.3) ** n
    assert (power.value, power.first, power.second) == (
        0.0**n,
        0.7 * (n == 1),
        0.3 * (n == 1) + 2 * 0.7**2 * (n == 2),
    )


def test_comparisons_are_of_the_values() -> None:
    u, v = Taylor(np.array([1.0, 2.0]), 1.0), Taylor(np.array([2.0, 2.0]), -1.0)
    for found, expected in (
        (u < v, [1, 0]),
        (u <= v, [1, 1]),
        (u == v, [0, 1]),
        (u != 1.0, [0, 1]),
        (u >= 2.0, [0, 1]),
    ):
        assert np.asarray(found).astype(int).tolist() == expected


@pytest.mark.parametrize(
    "call",
    [
        np.arcsin,
        np.cosh,
        np.add.reduce,
        lambda u: np.sin(u, where=True),
        lambda u: np.concatenate((u, u)),
        np.sum,
    ],
)
def test_a_function_without_a_rule_is_refused(call: Callable[[Any], Any]) -> None:
    with pytest.raises(TypeError):
        call(Taylor(np.array([0.1, 0.2]), 1.0))
