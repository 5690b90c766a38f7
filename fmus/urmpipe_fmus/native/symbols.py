"""NumPy's elementwise functions on CasADi's symbols: what a unit's functions may use to become C.

A `Symbol` takes part in NumPy's functions and builds the expression that computes what NumPy would, to the
last bit where the target's math library does: halves are rounded to even, a remainder has the divisor's sign,
NaN goes through `np.minimum`, and `np.isnan` and `&` work. What is not in the tables here is refused by name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from numbers import Real
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from urmpipe_fmus.dependencies import LOGICAL
from urmpipe_models.errors import UnitError

Formula = Callable[..., Any]


class Symbol(NDArrayOperatorsMixin):
    """An element that is an expression.

    Attributes:
        sx: CasADi's expression.
        logical: Whether it is a truth value: of a comparison, or of truth values.
    """

    def __init__(self, sx: Any, logical: bool = False) -> None:
        self.sx = sx
        self.logical = logical

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Symbol:
        """Build the expression of one of NumPy's ufuncs."""
        name = ufunc.__name__ if method == "__call__" else f"{ufunc.__name__}.{method}"
        return _built(name, _ufuncs(), inputs, options)

    def __array_function__(
        self, function: Any, types: Any, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Symbol:
        """Build the expression of one of NumPy's elementwise functions that are no ufuncs."""
        return _built(function.__name__, _functions(), arguments, options)

    def __bool__(self) -> bool:
        raise UnitError(
            "a branch on a value: found in a unit's function (if, and, or, not, min, max), allowed: np.where,"
            " np.logical_and, np.minimum and their like"
        )

    def __float__(self) -> float:
        raise UnitError(
            "float() or a function of the math module: found in a unit's function, allowed: NumPy's"
            " elementwise functions"
        )


def traceable() -> tuple[str, ...]:
    """Return the names of NumPy's functions that a unit may use."""
    return tuple(sorted({*_ufuncs(), *_functions()}))


@contextmanager
def exact_expressions() -> Iterator[None]:
    """Keep CasADi from rearranging: 6 x may differ from 2 (3 x) in the last bit, and 0 for 0 x hides a NaN.

    The switch is one of the process; it is put back.
    """
    import casadi

    before = casadi.GlobalOptions.getSimplificationOnTheFly()
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(before)


def expression(value: Any) -> Any:
    """Return CasADi's expression of an element: a symbol, or a number.

    Raises:
        UnitError: If it is something else, such as an array.
    """
    import casadi

    if isinstance(value, Symbol):
        return value.sx
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if not isinstance(value, Real | np.bool_):
        raise UnitError(
            f"{_said(value)}: found in a unit's function, allowed: floats and what the variables give"
        )
    return casadi.SX(float(value))


def _said(value: Any) -> str:
    return f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__


def _built(
    name: str, formulas: Mapping[str, Formula], inputs: tuple[Any, ...], options: Mapping[str, Any]
) -> Symbol:
    """Return the expression of a function of NumPy by its name."""
    if name not in formulas or any(one not in _OPTIONS.get(name, ()) for one in options):
        with_options = f" with {', '.join(options)}" if name in formulas else ""
        raise UnitError(
            f"np.{name}{with_options}: found in a unit's function, allowed: {', '.join(traceable())}"
        )
    if name in _NOT_OF_TRUTH and all(_is_logical(one) for one in inputs):
        raise UnitError(
            f"np.{name} of truth values: found in a unit's function, allowed: np.where(condition, 1.0, 0.0)"
        )
    made = (
        formulas[name](*inputs, **options) if name in _OPTIONS else formulas[name](*map(expression, inputs))
    )
    return Symbol(made, logical=name in LOGICAL)


def _is_logical(value: Any) -> bool:
    return value.logical if isinstance(value, Symbol) else isinstance(value, bool | np.bool_)


_OPTIONS = {"round": ("decimals",), "around": ("decimals",), "clip": ("a_min", "a_max", "min", "max")}
"""Functions that take numbers by name."""

_NOT_OF_TRUTH = ("add", "subtract", "negative", "positive")
"""What adds truth values in one form of NumPy, and joins or refuses them in another."""


def _ufuncs() -> dict[str, Formula]:
    """Return the ufuncs, by name."""
    import casadi as c

    same = (
        *("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "floor", "ceil", "sign"),
        *("expm1", "log1p", "hypot", "copysign", "fmod"),
    )
    truth: dict[str, Formula] = {
        "logical_and": c.logic_and,
        "logical_or": c.logic_or,
        "logical_not": c.logic_not,
        "logical_xor": lambda x, y: c.logic_not(x) != c.logic_not(y),
        "less": lambda x, y: x < y,
        "less_equal": lambda x, y: x <= y,
        "greater": lambda x, y: y < x,
        "greater_equal": lambda x, y: y <= x,
        "equal": lambda x, y: x == y,
        "not_equal": lambda x, y: x != y,
        "isnan": lambda x: c.logic_not(c.fabs(x) <= c.inf),
        "isfinite": lambda x: c.fabs(x) < c.inf,
        "isinf": lambda x: c.fabs(x) == c.inf,
        "signbit": lambda x: c.copysign(1.0, x) < 0.0,
    }
    return {
        **{name: getattr(c, name) for name in same},
        **{f"arc{name}": getattr(c, f"a{name}") for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
        **truth,
        **{"bitwise_and": truth["logical_and"], "bitwise_or": truth["logical_or"]},
        **{"invert": truth["logical_not"], "bitwise_xor": truth["logical_xor"]},
        "add": lambda x, y: x + y,
        "subtract": lambda x, y: x - y,
        "multiply": lambda x, y: x * y,
        "divide": lambda x, y: x / y,
        "negative": lambda x: -x,
        "positive": lambda x: x,
        "absolute": c.fabs,
        "fabs": c.fabs,
        "power": _power,
        "float_power": _power,
        "square": lambda x: x * x,
        "reciprocal": lambda x: 1.0 / x,
        "arctan2": c.atan2,
        "minimum": c.fmin,
        "maximum": c.fmax,
        "trunc": lambda x: c.copysign(c.floor(c.fabs(x)), x),
        "rint": _rounded,
        "remainder": _remainder,
        "floor_divide": _floor_divide,
        "deg2rad": lambda x: x * (math.pi / 180.0),
        "radians": lambda x: x * (math.pi / 180.0),
        "rad2deg": lambda x: x * (180.0 / math.pi),
        "degrees": lambda x: x * (180.0 / math.pi),
        "heaviside": lambda x, y: c.if_else(x == 0.0, y, c.if_else(x < 0.0, 0.0, c.if_else(x > 0.0, 1.0, x))),
    }


def _functions() -> dict[str, Formula]:
    """Return the elementwise functions that are no ufuncs, by name."""
    import casadi as c

    return {"where": c.if_else, "round": _round, "around": _round, "clip": _clip}


def _power(x: Any, y: Any) -> Any:
    """Return x**y; x**2 as x x, as NumPy does."""
    return x * x if y.is_constant() and float(y) == 2.0 else x**y


def _rounded(x: Any) -> Any:
    """Return the nearest whole number, of two the even one."""
    import casadi as c

    below = c.floor(x)
    beyond = x - below
    even = 2.0 * c.floor((below + 1.0) / 2.0)
    nearest = c.if_else(beyond < 0.5, below, c.if_else(beyond > 0.5, below + 1.0, even))
    return c.copysign(c.if_else(c.fabs(x) < c.inf, nearest, x), x)


def _round(x: Any, decimals: int = 0) -> Any:
    """Return x rounded to some decimals, as NumPy does: scaled, rounded, scaled back."""
    factor = 10.0 ** abs(decimals)
    value = expression(x)
    if decimals == 0:
        return _rounded(value)
    return _rounded(value * factor) / factor if decimals > 0 else _rounded(value / factor) * factor


def _clip(
    x: Any,
    a_min: Any = None,
    a_max: Any = None,
    *,
    min: Any = None,
    max: Any = None,
) -> Any:
    """Return x between two bounds, either of which may be missing."""
    import casadi as c

    lower, upper = a_min if min is None else min, a_max if max is None else max
    value = expression(x)
    if lower is not None:
        value = c.fmax(value, expression(lower))
    return value if upper is None else c.fmin(value, expression(upper))


def _remainder(x: Any, y: Any) -> Any:
    """Return what is left of x after whole times y, with the sign of y."""
    import casadi as c

    left = c.fmod(x, y)
    other_sign = (y < 0.0) != (left < 0.0)
    return c.if_else(left == 0.0, c.copysign(0.0, y), c.if_else(other_sign, left + y, left))


def _floor_divide(x: Any, y: Any) -> Any:
    """Return how many whole times y goes into x, rounded down."""
    import casadi as c

    left = c.fmod(x, y)
    times = (x - left) / y
    times = c.if_else(c.logic_and(left != 0.0, (y < 0.0) != (left < 0.0)), times - 1.0, times)
    below = c.floor(times)
    whole = c.if_else(times - below > 0.5, below + 1.0, below)
    whole = c.if_else(times == 0.0, c.copysign(0.0, x / y), whole)
    return c.if_else(y == 0.0, x / y, whole)
