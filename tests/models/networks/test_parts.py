"""Expressions: their values and derivatives compared with those of Python and NumPy."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from urmpipe_models.networks.parts import Expression

STEP = 1e-30  # imaginary: f'(x) = Im f(x + ih) / h without a difference, exact to rounding


def atan2(y: Any, x: Any) -> complex:
    """atan2 of numbers with a small imaginary part, analytic where it is defined."""
    y, x = complex(y), complex(x)
    if abs(x.real) >= abs(y.real):
        turn = math.copysign(math.pi, y.real) if x.real < 0.0 else 0.0
        return cmath.atan(y / x) + turn
    return math.copysign(math.pi / 2.0, y.real) - cmath.atan(x / y)


COMPLEX = {name: getattr(cmath, name) for name in ("sin", "cos", "tan", "sqrt", "exp", "pi")} | {
    "atan2": atan2
}
REAL = {name: getattr(math, name) for name in ("sin", "cos", "tan", "sqrt", "exp", "pi", "atan2")}

leaves = st.sampled_from(["x", "y", "pi", "2", "0.5", "3.0", "1e-1"])


def deeper(parts: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return (
        st.builds("({} {} {})".format, parts, st.sampled_from("+-*/"), parts)
        | st.builds("{}({})".format, st.sampled_from(["sin", "cos", "tan", "sqrt", "exp", "-", "+"]), parts)
        | st.builds("atan2({}, {})".format, parts, parts)
        | st.builds("({} ** {})".format, parts, st.sampled_from(["2", "3", "-1", "0.5", "x", "y"]))
    )


formulas = st.recursive(leaves, deeper, max_leaves=6)
numbers = st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 1e-2)


def evaluated(text: str, of: dict[str, Any], **values: complex) -> complex:
    """Python's own value of a formula; nothing is asserted where it has none, or is steep."""
    try:
        value = eval(text, {"__builtins__": {}, **of, **values})
    except (ArithmeticError, ValueError):
        value = math.inf
    assume(abs(value) < 1e3)
    return complex(value)


@given(formulas, numbers, numbers)
def test_value_and_slopes_are_those_of_python_and_of_a_complex_step(text: str, x: float, y: float) -> None:
    formula = Expression(text)
    value, slopes = formula.value_and_gradient({"x": x, "y": y})
    assume(np.isfinite(value))
    expected = evaluated(text, REAL, x=x, y=y)
    by = {
        "x": evaluated(text, COMPLEX, x=x + 1j * STEP, y=y).imag / STEP,
        "y": evaluated(text, COMPLEX, x=x, y=y + 1j * STEP).imag / STEP,
    }
    assume(all(abs(one) < 1e3 for one in by.values()))
    assume(all(np.isfinite(one) for one in slopes.values()))
    assert set(slopes) <= formula.names
    # 1e-9: values and slopes of parts reach 1e3 and more, each rounded to 1e-16 of itself
    assert value == pytest.approx(expected.real, rel=1e-9, abs=1e-9)
    for name, slope in by.items():
        assert slopes.get(name, 0.0) == pytest.approx(slope, rel=1e-9, abs=1e-9)


def test_arrays_go_through_as_numbers_do() -> None:
    x, y = np.linspace(-1.0, 1.0, 5), np.linspace(1.0, 2.0, 5)
    value, slopes = Expression("sqrt(y) * x ** 3 + atan2(x, y)").value_and_gradient({"x": x, "y": y})
    # 1e-15: a rounding or two of numbers of 1
    np.testing.assert_allclose(value, np.sqrt(y) * x**3 + np.arctan2(x, y), atol=1e-15)
    np.testing.assert_allclose(slopes["x"], 3.0 * np.sqrt(y) * x**2 + y / (x**2 + y**2), atol=1e-15)
    np.testing.assert_allclose(slopes["y"], 0.5 * x**3 / np.sqrt(y) - x / (x**2 + y**2), atol=1e-15)


@pytest.mark.slow
@given(st.text(max_size=40))
def test_any_other_text_is_refused_in_order(text: str) -> None:
    try:
        Expression(text)
    except ValueError as error:
        assert str(error).startswith(("found ", "function found "))
