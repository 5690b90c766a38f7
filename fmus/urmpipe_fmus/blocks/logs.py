"""Blocks that work on logs: a log that is played, the repolarizer, and the meter of deviations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, Recipe, Table, Values, ValueType
from urmpipe_fmus.blocks.coordinates import check_count, check_flag, option_error
from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.delta import delta, exceeds_tolerance
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import UnitError, format_value
from urmpipe_models.wraps import WrapState, repolarize_sample

LOG_SOURCE_OPTIONS: Mapping[str, str] = {
    "table": "the rows of a log: its times from its start, and the columns of its values",
    "columns": 'what the columns are: name, unit and number of each, such as ["q", "rad", 6]',
    "interpolate": "true: linear between two rows; false (default): each row holds until the next",
}


class Column(NamedTuple):
    """A column of the table, or adjacent columns that are an array.

    Attributes:
        name: Name of the output.
        unit: Unit in FMI's spelling.
        size: Number of columns of an array; None for one column that is no array.
        description: One line of text.
    """

    name: str
    unit: str = ""
    size: int | None = None
    description: str = ""


def log_source(
    table: Table, columns: Sequence[Column | Sequence[Any]], interpolate: bool = False
) -> BlockModel:
    """Return the block that plays a log.

    Before the first row its values are those of the first, after the last those of the last. Angles that
    jump by a period should be held, not interpolated: the joint was never at a value inside the jump.

    Args:
        table: The rows; times count from the log's start.
        columns: The columns of the table, from left to right: `Column`s or their fields.
        interpolate: Linear between two rows, else each row holds until the next.

    Raises:
        UnitError: If the columns are not as many as the table has, or with the errors of their names.
    """
    check_flag("log_source", "interpolate", interpolate)
    faults = [] if isinstance(table, Table) else [f"table: found {format_value(table)}, allowed: a Table"]
    if isinstance(columns, str) or not isinstance(columns, Sequence):
        faults.append(f"columns: found {format_value(columns)}, allowed: a list of columns")
    if faults:
        raise UnitError(*(f"unit log_source: option {fault}" for fault in faults))
    outputs = [_read_column(column) for column in columns]
    width = sum(column.size or 1 for column in outputs)
    if width != table.columns or not outputs:
        raise UnitError(
            f"unit log_source: option columns: found {format_count(width, 'column')},"
            f" allowed: {table.columns} of the table"
        )

    def play(v: Values) -> Mapping[str, Element | Sequence[Element]]:
        """Return the values at the instant, those of an array together."""
        before, after, fraction = v.table
        values = iter(
            [a + fraction * (b - a) for a, b in zip(before, after, strict=True)] if interpolate else before
        )
        return {
            column.name: next(values) if column.size is None else tuple(islice(values, column.size))
            for column in outputs
        }

    return BlockModel(
        name="log_source",
        description=f"A log of {len(table.t_ns)} rows, {'interpolated' if interpolate else 'held'}",
        variables=tuple(
            Output(
                name=column.name,
                description=column.description or f"Column {column.name} of the log",
                unit=column.unit,
                display_unit="deg" if column.unit == "rad" else "",
                size=column.size,
            )
            for column in outputs
        ),
        outputs=play,
        table=table,
        equations=(
            "y = y_k + (t - t_k) / (t_(k+1) - t_k) (y_(k+1) - y_k), with t_k <= t < t_(k+1)"
            if interpolate
            else "y = y_k, with t_k <= t < t_(k+1)",
            "before the first row its values, after the last those of the last",
            "t in whole nanoseconds",
        ),
        recipe=Recipe(
            __name__,
            "log_source",
            {"columns": [list(column) for column in outputs], "interpolate": interpolate},
        ),
    )


def _read_column(fields: Column | Sequence[Any]) -> Column:
    """Return a column from its fields; `UnitError` if they do not fit."""
    parts = () if isinstance(fields, str) or not isinstance(fields, Sequence) else tuple(fields)
    texts = (*parts[:2], *parts[3:])
    if not 1 <= len(parts) <= len(Column._fields) or not all(isinstance(text, str) for text in texts):
        raise option_error("log_source", "columns", fields, "name, unit, size and description")
    column = Column(*parts)
    if column.size is not None:
        check_count("log_source", f"columns: {column.name}: size", column.size)
    return column


REPOLARIZER_OPTIONS: Mapping[str, str] = {"joints": "the number of joints, such as 6"}


def repolarizer(joints: int) -> BlockModel:
    """Return the block that adds whole periods to angles, so that they are continuous.

    It steps with `urmpipe_models.wraps.repolarize_sample` between communication points, with 1 for
    their distance and max_step for the largest speed.

    Args:
        joints: The number of joints.

    Raises:
        UnitError: If it is no integer from 1 to 1000.

    Source: [UrmArm2021]_ eq. 15-18 with the corrections of the errata.
    """
    check_count("repolarizer", "joints", joints)

    def memory(name: str, description: str, unit: str = "", kind: ValueType = "Real") -> Memory:
        return Memory(name=name, description=description, unit=unit, type=kind, size=joints)

    return BlockModel(
        name="repolarizer",
        description="Joint angles without the jumps of joints that are limited to one period",
        variables=(
            Parameter(
                name="period",
                description="What a joint jumps by where its environment limits it",
                unit="rad",
                display_unit="deg",
                start=2.0 * math.pi,
                minimum=1e-6,
            ),
            Parameter(
                name="max_step",
                description="How far a joint can move from one communication point to the next",
                unit="rad",
                display_unit="deg",
                start=math.pi / 2.0,
                minimum=1e-9,
            ),
            Input(
                name="raw",
                description="Joint angles as their environment limits them",
                unit="rad",
                display_unit="deg",
                size=joints,
            ),
            Output(
                name="q", description="Repolarized joint angles", unit="rad", display_unit="deg", size=joints
            ),
            Output(name="turns", description="Whole periods added", size=joints, type="Integer"),
            memory("last", "Raw angles of the communication point before", "rad"),
            memory("residual", "Step to them, less a period if it was a repolarization", "rad"),
            memory("lasted", "Communication points that this step took"),
            memory("turns_before", "Whole periods added there", kind="Integer"),
            memory("elapsed", "Communication points without a value since then"),
            memory("seen", "Whether there was one before", kind="Boolean"),
        ),
        outputs=_repolarizer_outputs,
        update=_repolarizer_update,
        equations=(
            "q = raw + period turns (eq. 15)",
            "turns changes by -sign(d) where a step d of raw meets ||d| - period| <= max_step (eq. 17, 18),",
            "or where two steps of one sign do so only together",
            "max_step counts as at least period / 100 and at most period / 4",
        ),
        source="UrmArm2021, eq. 15-18, with the sign of eq. 17 corrected and whole turns counted",
        recipe=Recipe(__name__, "repolarizer", {"joints": joints}),
    )


def _iter_steps(v: Values) -> Iterator[tuple[WrapState, Element]]:
    """Yield the next state and the repolarized angle of each joint."""
    states = zip(v.last, v.residual, v.lasted, v.turns_before, v.elapsed, v.seen, strict=True)
    for fields, raw in zip(states, v.raw, strict=True):
        state, q, _ = repolarize_sample(WrapState(*fields), raw, 1.0, period=v.period, max_speed=v.max_step)
        yield state, q


def _repolarizer_outputs(v: Values) -> Mapping[str, Sequence[Element]]:
    states, q = zip(*_iter_steps(v), strict=True)
    return {"q": q, "turns": tuple(state.turns for state in states)}


def _repolarizer_update(v: Values) -> Mapping[str, Sequence[Element]]:
    states = [state for state, _ in _iter_steps(v)]
    fields = dict(zip(WrapState._fields, zip(*states, strict=True), strict=True))
    fields["turns_before"] = fields.pop("turns")
    return fields


def delta_meter() -> BlockModel:
    """Return the block that measures the deviation of a point: delta = reference - actual, in [m].

    Source: [UrmArm2021]_ eq. 19-21, 23.
    """

    def outputs(v: Values) -> Mapping[str, Element]:
        deviation = delta(v.reference, v.actual)
        return {
            "delta": (deviation.x, deviation.y, deviation.z),
            "norm": deviation.norm,
            "out_of_tolerance": exceeds_tolerance(deviation, v.tolerance),
        }

    return BlockModel(
        name="delta_meter",
        description="Deviation of a point from where it should be, and whether it is tolerated",
        variables=(
            Parameter(
                name="tolerance",
                description="Largest deviation allowed along x, y and z",
                unit="m",
                display_unit="mm",
                start=DEFAULT_TOLERANCE,
                minimum=0.0,
            ),
            Input(name="reference", description="Where the point should be: x, y, z", unit="m", size=3),
            Input(name="actual", description="Where the point is: x, y, z", unit="m", size=3),
            Output(name="delta", description="Deviation: x, y, z", unit="m", display_unit="mm", size=3),
            Output(name="norm", description="Length of the deviation", unit="m", display_unit="mm"),
            Output(
                name="out_of_tolerance",
                description="Whether the deviation along x, y or z is above the tolerance or has no value",
                type="Boolean",
            ),
        ),
        outputs=outputs,
        equations=(
            "delta = reference - actual (eq. 19-21)",
            "norm = sqrt(delta_x^2 + delta_y^2 + delta_z^2) (eq. 23)",
            "out_of_tolerance = not max(|delta_x|, |delta_y|, |delta_z|) <= tolerance",
        ),
        source="UrmArm2021, eq. 19-21 and 23",
        recipe=Recipe(__name__, "delta_meter"),
    )
