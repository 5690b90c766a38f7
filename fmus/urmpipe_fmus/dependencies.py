"""What depends on what in a unit: found by running its functions on elements that only remember.

The answer is structural: an output depends on an input if the input goes into it anywhere, whatever the
values. It needs no trace by CasADi, and finds what no trace could run: a branch on a value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from numpy.lib.mixins import NDArrayOperatorsMixin

from urmpipe_fmus.equations import Equations
from urmpipe_fmus.table import Rows
from urmpipe_fmus.unit import Unit
from urmpipe_models.errors import UnitError

TIME = "time"
"""Stands for the independent variable."""


class Remembering(NDArrayOperatorsMixin):
    """An element that has no value, only the names of what went into it.

    Attributes:
        names: Names of the scalars, and `TIME`.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.names = frozenset(names)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Take part in a ufunc: the result remembers what went into any argument."""
        if method != "__call__" or "out" in options or ufunc.signature is not None:
            return NotImplemented
        made = together(inputs)
        return made if ufunc.nout == 1 else (made,) * ufunc.nout

    def __array_function__(
        self, function: Callable[..., Any], types: Any, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        """Take part in one of NumPy's elementwise functions that are no ufuncs."""
        if function.__name__ not in ("where", "clip", "round", "around", "hypot", "minimum", "maximum"):
            raise UnitError(
                f"np.{function.__name__}: found in a unit's function, allowed: NumPy's elementwise functions"
                " (np.where, np.clip, np.round, np.cos, ...)"
            )
        return together((*arguments, *options.values()))

    def __bool__(self) -> bool:
        raise UnitError(
            f"a branch on {', '.join(sorted(self.names)) or 'a value'}: found in a unit's function (if, and,"
            " or, not, min, max), allowed: np.where, np.logical_and, np.minimum and their like"
        )

    def __float__(self) -> float:
        raise UnitError(
            f"float() or a function of the math module on {', '.join(sorted(self.names)) or 'a value'}: found"
            " in a unit's function, allowed: NumPy's elementwise functions"
        )


def together(arguments: Iterable[Any]) -> Remembering:
    """Return an element that remembers what all arguments do."""
    return Remembering(name for one in arguments if isinstance(one, Remembering) for name in one.names)


class Dependencies:
    """What the outputs, derivatives and memories of a unit depend on, by scalar name.

    Attributes:
        outputs: Of every scalar of `unit.computed`: names of the scalars and `TIME` that go into it.
        derivatives: Of every scalar of `unit.states`, what goes into its derivative.
        update: Of every scalar of `unit.memories`, what goes into its next value.

    Raises:
        UnitError: If a function of the unit does what could not be traced, or returns other names.
    """

    def __init__(self, unit: Unit) -> None:
        given = [Remembering([name]) for one in unit.given for name in one.names]
        time, rows = Remembering([TIME]), None
        if unit.table is not None:
            columns = (Remembering([TIME]),) * unit.table.columns
            rows = Rows(columns, columns, Remembering([TIME]))
        equations = Equations(unit)
        self.outputs = _by_name(unit.computed, equations.outputs(time, given, rows))
        self.derivatives = _by_name(unit.states, equations.derivatives(time, given, rows))
        self.update = _by_name(unit.memories, equations.update(time, given, rows))


def _by_name(variables: Iterable[Any], elements: list[Any]) -> dict[str, frozenset[str]]:
    names = [name for one in variables for name in one.names]
    return {
        name: element.names if isinstance(element, Remembering) else frozenset()
        for name, element in zip(names, elements, strict=True)
    }
