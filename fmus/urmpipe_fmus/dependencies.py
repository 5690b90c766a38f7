"""What depends on what in a unit: found by running its functions on elements that only remember.

The answer is structural: an output depends on an input if the input goes into it anywhere, whatever the
values. It needs no trace by CasADi, and finds what no trace could run: a branch on a value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from urmpipe_fmus.block import BlockModel, Rows
from urmpipe_fmus.instance import Equations
from urmpipe_models.errors import Finding, UnitError

TIME = "time"
"""Stands for the independent variable."""

LOGICAL = (
    *("less", "less_equal", "greater", "greater_equal", "equal", "not_equal"),
    *("logical_and", "logical_or", "logical_not", "logical_xor"),
    *("bitwise_and", "bitwise_or", "invert", "bitwise_xor"),
    *("isnan", "isfinite", "isinf", "signbit"),
)
"""NumPy's functions whose result is true or false."""

FUNCTIONS = (
    *LOGICAL,
    *("add", "subtract", "multiply", "divide", "negative", "positive", "absolute", "fabs", "sign"),
    *("power", "float_power", "square", "reciprocal", "sqrt", "exp", "expm1", "log", "log1p"),
    *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "hypot", "copysign", "heaviside"),
    *("sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh"),
    *("deg2rad", "radians", "rad2deg", "degrees"),
    *("floor", "ceil", "trunc", "rint", "round", "around", "fmod", "remainder", "floor_divide"),
    *("minimum", "maximum", "clip", "where"),
)
"""NumPy's functions that a unit may use: elementwise, and the same in C."""

_OPTIONS = ("decimals", "a_min", "a_max", "min", "max")
"""What they may be given by name."""

_NOT_OF_TRUTH = ("add", "subtract", "negative", "positive")
"""What joins or refuses NumPy's truth values, where C would add them."""


class Remembering(NDArrayOperatorsMixin):
    """An element that has no value, only the names of what went into it.

    Attributes:
        names: Names of the scalars, and `TIME`.
        logical: Whether it is true or false, and no number.
    """

    def __init__(self, names: Iterable[str], logical: bool = False) -> None:
        self.names = frozenset(names)
        self.logical = logical

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Take part in a ufunc: the result remembers what went into any argument."""
        name = ufunc.__name__ if method == "__call__" else f"{ufunc.__name__}.{method}"
        return _made(name, inputs, options)

    def __array_function__(
        self, function: Callable[..., Any], types: Any, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        """Take part in one of NumPy's elementwise functions that are no ufuncs."""
        return _made(function.__name__, arguments, options)

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise UnitError(
            "an array of values (np.array, np.sum, np.dot, np.linalg, a function of a whole tuple): found in"
            " a unit's function, allowed: one element after the other, sum(...), np.hypot"
        )

    def __bool__(self) -> bool:
        raise UnitError(
            f"a branch on {self._said()}: found in a unit's function (if, and, or, not, min, max, in),"
            " allowed: np.where, np.logical_and, np.minimum and their like"
        )

    def __float__(self) -> float:
        raise UnitError(
            f"float(), int(), round(), an index or a function of the math module on {self._said()}: found"
            " in a unit's function, allowed: NumPy's elementwise functions"
        )

    def __int__(self) -> int:
        return int(float(self))

    def __index__(self) -> int:
        return int(float(self))

    def __round__(self, _digits: int | None = None) -> float:
        return float(self)

    def __floor__(self) -> int:
        return int(float(self))

    __ceil__ = __trunc__ = __floor__

    def _said(self) -> str:
        return ", ".join(sorted(self.names)) or "a value"


def _made(name: str, arguments: tuple[Any, ...], options: dict[str, Any]) -> Remembering:
    """Return what a function of NumPy makes of elements.

    Raises:
        UnitError: If it is none that a unit may use.
    """
    elements = (*arguments, *options.values())
    wrong = [option for option in options if option not in _OPTIONS]
    if name not in FUNCTIONS or wrong or (name == "where" and len(arguments) != 3):
        how = f" with {', '.join(wrong) or 'other arguments'}" if name in FUNCTIONS else ""
        raise UnitError(f"np.{name}{how}: found in a unit's function, allowed: np.{', np.'.join(FUNCTIONS)}")
    if any(np.ndim(one) > 0 for one in elements if not isinstance(one, Remembering)):
        raise UnitError(
            f"np.{name} of an array or a tuple: found in a unit's function, allowed: one element after the"
            " other"
        )
    if name in _NOT_OF_TRUTH and all(_is_logical(one) for one in elements):
        raise UnitError(
            f"np.{name} of truth values: found in a unit's function, allowed: np.where(condition, 1.0, 0.0)"
        )
    names = (name for one in elements if isinstance(one, Remembering) for name in one.names)
    return Remembering(names, logical=name in LOGICAL)


def _is_logical(value: Any) -> bool:
    return value.logical if isinstance(value, Remembering) else isinstance(value, bool | np.bool_)


class Dependencies:
    """What the outputs, derivatives and memories of a unit depend on, by scalar name.

    Attributes:
        outputs: Of every scalar of `unit.computed`: names of the scalars and `TIME` that go into it.
        derivatives: Of every scalar of `unit.states`, what goes into its derivative.
        update: Of every scalar of `unit.memories`, what goes into its next value.

    Raises:
        UnitError: If a function of the unit does what could not be traced, or returns other names.
    """

    def __init__(self, unit: BlockModel) -> None:
        given = [Remembering([name]) for one in unit.arguments for name in one.names]
        time, rows = Remembering([TIME]), None
        if unit.table is not None:
            columns = (Remembering([TIME]),) * unit.table.columns
            rows = Rows(columns, columns, Remembering([TIME]))
        equations = Equations(unit)
        found: list[dict[str, frozenset[str]]] = []
        faults: list[Finding] = []
        for variables, function in (
            (unit.computed, equations.outputs),
            (unit.states, equations.derivatives),
            (unit.memories, equations.update),
        ):
            try:
                found.append(_by_name(variables, function(time, given, rows)))
            except UnitError as error:
                faults += error.findings
        if faults:
            raise UnitError(*faults)
        self.outputs, self.derivatives, self.update = found


def _by_name(variables: Iterable[Any], elements: list[Any]) -> dict[str, frozenset[str]]:
    names = [name for one in variables for name in one.names]
    return {
        name: element.names if isinstance(element, Remembering) else frozenset()
        for name, element in zip(names, elements, strict=True)
    }
