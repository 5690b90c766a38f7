"""Expressions: their value, derivatives, and texts that are refused. Limits that assemblies exceed."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from asserting import refusal
from urmpipe import load_network, network_check, network_solve
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


@pytest.mark.parametrize(
    "text",
    [
        "2 * x + y", "x - y - 1", "x / y / 2", "-x ** 2", "2 ** -x ** 2", "+x * -y", " (x + 1) * (y - 1)",
        "1.5e-3 + 10 * pi", "atan2(x, -y) ** 3",
    ],
)  # fmt: skip
def test_operators_bind_as_those_of_python(text: str) -> None:
    values = {"x": 0.7, "y": 1.9}
    assert Expression(text).value(values) == pytest.approx(eval(text.strip(), REAL | values), rel=1e-15)


def test_arrays_go_through_as_numbers_do() -> None:
    x, y = np.linspace(-1.0, 1.0, 5), np.linspace(1.0, 2.0, 5)
    value, slopes = Expression("sqrt(y) * x ** 3 + atan2(x, y)").value_and_gradient({"x": x, "y": y})
    # 1e-15: a rounding or two of numbers of 1
    np.testing.assert_allclose(value, np.sqrt(y) * x**3 + np.arctan2(x, y), atol=1e-15)
    np.testing.assert_allclose(slopes["x"], 3.0 * np.sqrt(y) * x**2 + y / (x**2 + y**2), atol=1e-15)
    np.testing.assert_allclose(slopes["y"], 0.5 * x**3 / np.sqrt(y) - x / (x**2 + y**2), atol=1e-15)


def test_names_are_those_that_values_are_needed_of() -> None:
    assert Expression("sin(a) + pi * b_2 - a").names == {"a", "b_2"}
    assert Expression("sqrt(2) * pi").names == frozenset()


@pytest.mark.parametrize(
    ("text", "value"),
    [("1 / 0", math.inf), ("sqrt(-1)", math.nan), ("exp(1000)", math.inf), ("0 / 0", math.nan)],
)
def test_values_that_are_no_numbers_come_back_as_they_are(text: str, value: float) -> None:
    np.testing.assert_equal(float(Expression(text).value({})), value)


ALLOWED = "allowed: numbers, names of controls, pi, + - * / ** and brackets, sin, cos, tan, atan2, sqrt, exp"


@pytest.mark.parametrize(
    "text",
    [
        "", "   ", "1 +", "1\0", "lambda: 1", "x = 1", "x.real", "x[0]", "x if y else 1", "x or y", "not x",
        "~x", "x // 2", "x @ y", "[x]", "(x, y)", "'x'", "f'{x}'", "1j", "True", "1e999", "sin", "sin(x=1)",
        "sin(x)(y)", "x.sin(y)",
    ],
)  # fmt: skip
def test_texts_without_arithmetic_are_refused(text: str) -> None:
    assert refusal(ValueError, Expression, text) == f"found {text!r}, no arithmetic; {ALLOWED}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x ^ 2", f"found 'x ^ 2', no arithmetic; {ALLOWED}; a power is **"),
        ("1 + (x < 2)", f"found 'x < 2', no arithmetic; {ALLOWED}"),
        ("(x := 1)", f"found 'x := 1', no arithmetic; {ALLOWED}"),
        ("9" * 400, f"found '{'9' * 56}..., no arithmetic; {ALLOWED}"),
        ("sin(*x)", f"found '*x', no arithmetic; {ALLOWED}"),
        ("sin()", "found 0 arguments of sin, allowed: 1"),
        ("atan2(x)", "found 1 arguments of atan2, allowed: 2"),
        ("sine(x)", "function found 'sine' (did you mean sin?), allowed: sin, cos, tan, atan2, sqrt, exp"),
        ("__import__('os')", "function found '__import__', allowed: sin, cos, tan, atan2, sqrt, exp"),
        ("(" * 10_000, f"found '{'(' * 56}... of 10000 letters, allowed: 1000 at most"),
        ("-" * 900 + "1", f"found '{'-' * 56}..., nested 51 deep; allowed: 50"),
        ("(" * 400 + "1" + ")" * 400, f"found '{'(' * 56}..., nested 400 deep; allowed: 50"),
    ],
)
def test_the_part_that_is_refused_is_named(text: str, message: str) -> None:
    assert refusal(ValueError, Expression, text) == message


@pytest.mark.slow
@given(st.text(max_size=40))
def test_any_other_text_is_refused_in_order(text: str) -> None:
    try:
        Expression(text)
    except ValueError as error:
        assert str(error).startswith(("found ", "function found "))


# --- limits


def beyond(turn: float, *tables: dict[str, Any], **joint: Any) -> list[str]:
    """Return the warnings of limits of a door on a hinge along x, driven by a control, in mm and deg."""
    hinge = {"kind": "revolute", "bodies": ["ground", "door"], "n": [1, 0, 0], "driven": "turn", **joint}
    door: dict[str, Any] = {
        "length_unit": "mm", "angle_unit": "deg", "controls": {"turn": {}}, "bodies": {"door": {}},
        "joints": {"hinge": hinge},
    }  # fmt: skip
    for table in tables:
        for key, parts in table.items():
            door.setdefault(key, {}).update(parts)
    found = network_check(door, controls={"turn": turn})
    return [warning.sentence() for warning in found.warnings if warning.kind == "beyond-limit"]


@pytest.mark.parametrize(
    ("turn", "lines"),
    [
        (60, []),
        (360 + 59, []),  # an angle is compared within the full turn that fits
        (-360 - 31, ["joint hinge is at -391 deg, beyond its lower limit, -30 deg"]),
        (61, ["joint hinge is at 61 deg, beyond its upper limit, 60 deg"]),
    ],
)
def test_an_assembly_beyond_a_limit_is_a_warning(turn: float, lines: list[str]) -> None:
    assert beyond(turn, lower=-30, upper=60) == lines


def test_turns_of_a_geared_joint_count_against_its_limits_and_a_sliding_joint_has_none() -> None:
    geared: dict[str, Any] = {
        "bodies": {"wheel": {}},
        "joints": {"shaft": {"kind": "revolute", "bodies": ["ground", "wheel"]}},
        "elements": {"mesh": {"kind": "gear", "joints": ["hinge", "shaft"], "teeth": [1, 1]}},
    }
    lines = ["joint hinge is at 360 deg, beyond its upper limit, 60 deg"]
    assert beyond(360, geared, lower=-30, upper=60) == lines
    assert beyond(6, kind="prismatic", upper=5) == ["joint hinge is at 6 mm, beyond its upper limit, 5 mm"]


def test_only_the_assembly_that_is_shown_counts() -> None:
    found = network_solve(load_network("rack-and-pinion"), every=True, restarts=100)
    assert max(abs(assembly.values["left"][0]) for assembly in found.assemblies) > math.radians(45)
    assert found.warnings == ()
