"""A log as a unit: the columns of a table inside the FMU, over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple

from urmpipe_fmus.table import Table
from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_fmus.units.options import whole_number, yes_or_no
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Output
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import UnitError, shown

OPTIONS: Mapping[str, str] = {
    "table": "the rows of a log: its times from its start, and the columns of its values",
    "columns": 'what the columns are: name, unit and number of each, such as ["q", "rad", 6]',
    "interpolate": "true: linear between two rows; false (default): each row holds until the next",
}


class Column(NamedTuple):
    """A column of the table, or some that stand side by side and make an array.

    Attributes:
        name: Of the output.
        unit: Spelled as FMI does.
        size: How many columns; None for one that is no array.
        description: One line for people.
    """

    name: str
    unit: str = ""
    size: int | None = None
    description: str = ""


def log_source(table: Table, columns: Sequence[Column | Sequence[Any]], interpolate: bool = False) -> Unit:
    """Return the unit that plays a log.

    Before the first row its values are those of the first, after the last those of the last. Angles that
    jump by a period are better held than interpolated: a value on the jump is no place where the joint was.

    Args:
        table: The rows; times count from the log's start.
        columns: What the columns of the table are, from left to right: `Column`s or what makes one.
        interpolate: Linear between two rows, else each row holds until the next.

    Raises:
        UnitError: If the columns are not as many as the table has, or with what is wrong with their names.
    """
    yes_or_no("log_source", "interpolate", interpolate)
    if not isinstance(table, Table) or isinstance(columns, str) or not isinstance(columns, Sequence):
        raise UnitError("unit log_source: found no table and columns, allowed: a Table, a list of columns")
    shown = [_column(one) for one in columns]
    width = sum(one.size or 1 for one in shown)
    if width != table.columns or not shown:
        raise UnitError(
            f"unit log_source: option columns: found {width} columns, allowed: {table.columns} of the table"
        )

    def outputs(v: Values) -> Mapping[str, Element | Sequence[Element]]:
        """Return the columns at the instant, those of an array together."""
        before, after, fraction = v.table
        values = iter(
            [a + fraction * (b - a) for a, b in zip(before, after, strict=True)] if interpolate else before
        )
        return {
            one.name: next(values) if one.size is None else tuple(islice(values, one.size)) for one in shown
        }

    return Unit(
        name="log_source",
        description=f"A log of {len(table.t_ns)} rows, {'interpolated' if interpolate else 'held'}",
        variables=tuple(_output(one) for one in shown),
        outputs=outputs,
        table=table,
        equations=(
            "y = y_k + (t - t_k) / (t_(k+1) - t_k) (y_(k+1) - y_k), with t_k <= t < t_(k+1)"
            if interpolate
            else "y = y_k, with t_k <= t < t_(k+1)",
            "before the first row its values, after the last those of the last",
            "t in whole nanoseconds",
        ),
        recipe=Recipe(
            __name__, "log_source", {"columns": [list(one) for one in shown], "interpolate": interpolate}
        ),
    )


def _column(given: Column | Sequence[Any]) -> Column:
    """Return a column from what makes one.

    Raises:
        UnitError: If it makes none.
    """
    parts = () if isinstance(given, str) or not isinstance(given, Sequence) else tuple(given)
    texts = (*parts[:2], *parts[3:])
    if not 1 <= len(parts) <= len(Column._fields) or not all(isinstance(one, str) for one in texts):
        allowed = "name, unit, size and description"
        raise UnitError(f"unit log_source: option columns: found {shown(given)}, allowed: {allowed}")
    column = Column(*parts)
    if column.size is not None:
        whole_number("log_source", f"columns: {column.name}: size", column.size)
    return column


def _output(column: Column) -> Output:
    return Output(
        name=column.name,
        description=column.description or f"Column {column.name} of the log",
        unit=column.unit,
        display_unit="deg" if column.unit == "rad" else "",
        size=column.size,
    )
