"""A unit's functions run on symbols: what they compute, as expressions of the scalars."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from urmpipe_fmus.block import BlockModel, Rows
from urmpipe_fmus.instance import Equations
from urmpipe_fmus.native.symbols import Symbol, exact_expressions, expression
from urmpipe_models.errors import UnitError

ARGUMENTS = ("time", "v[{}]", "rows->before[{}]", "rows->after[{}]", "rows->fraction")
"""What the traced functions are given, as C reads it."""


class Traced(NamedTuple):
    """The functions of a unit as CasADi's: of `ARGUMENTS`, `v` being all scalars by value reference.

    Attributes:
        outputs: Gives the elements of `unit.computed`.
        derivatives: Gives the derivatives of `unit.states`.
        update: Gives the next values of `unit.memories`.
    """

    outputs: Any
    derivatives: Any
    update: Any


def traced(unit: BlockModel) -> Traced:
    """Trace the functions of a unit.

    Raises:
        UnitError: If a function does what cannot be traced, or returns other names.
    """
    with exact_expressions():
        return Traced(*(_function(unit, name) for name in Traced._fields))


def _function(unit: BlockModel, name: str) -> Any:
    """Trace one function of a unit."""
    import casadi

    time = casadi.SX.sym("time")
    values = [casadi.SX.sym(scalar) for scalar, _ in unit.scalars]
    columns = 0 if unit.table is None else unit.table.columns
    before, after = ([casadi.SX.sym("column") for _ in range(columns)] for _ in range(2))
    fraction = casadi.SX.sym("fraction")
    rows = Rows(_symbols(before), _symbols(after), Symbol(fraction)) if columns else None
    index = {scalar: k for k, (scalar, _) in enumerate(unit.scalars)}
    given = _symbols([values[index[scalar]] for one in unit.arguments for scalar in one.names])
    method: Callable[..., list[Any]] = getattr(Equations(unit), name)
    found = method(Symbol(time), given, rows)
    try:
        result = casadi.densify(casadi.vertcat(*map(expression, found)))
    except UnitError as error:
        raise UnitError(*(f"unit {unit.name}: {name}: {one}" for one in error.findings)) from error
    arguments = [time, *(casadi.vertcat(*group) for group in (values, before, after)), fraction]
    return casadi.Function(name, arguments, [result], {"cse": True})


def _symbols(symbols: Sequence[Any]) -> tuple[Symbol, ...]:
    return tuple(Symbol(one) for one in symbols)
