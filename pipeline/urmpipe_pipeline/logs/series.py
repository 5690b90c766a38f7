"""Any columns of a table over its time: what drives a model that is no arm, such as a voltage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError, map_collecting_errors
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.clocks.clock import even_clock, find_clocks
from urmpipe_pipeline.logs.columns.columns import Column, columns_of, find_column, given_units
from urmpipe_pipeline.logs.columns.roles import Roles
from urmpipe_pipeline.logs.content import read_content
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.tables.opening import open_tables
from urmpipe_pipeline.logs.tables.reachable import unchanged
from urmpipe_pipeline.logs.vocabulary import Unit

SI = {"angle": "rad", "length": "m", "time": "s"}
"""What the quantities are in that urmpipe knows."""


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Columns of a table over its time.

    Attributes:
        file: The file.
        names: Names of the columns without their units.
        t_ns: Time of each row in integer [ns] from the first row, shape (n,), rising.
        values: In `units`, shape (n, columns), all finite.
        units: Of each column: SI where urmpipe knows the unit, else as the file has it; None where it has
            none.
        warnings: What a person should know.
    """

    file: Path
    names: tuple[str, ...]
    t_ns: IntArray
    values: FloatArray
    units: tuple[str | None, ...]
    warnings: tuple[LogWarning, ...] = ()


def read_series(file: Path, names: Sequence[str], options: LogMap | None = None) -> Series:
    """Return some columns of a table by name, over its clock.

    Args:
        file: A CSV file.
        names: The columns, with or without their units, or their numbers from 1.
        options: What the user says where the file need not, or cannot, tell.

    Raises:
        LogError: If a column is not there, or with everything that is wrong with the rows.
    """
    with unchanged([file]):
        return _read(file, names, options or LogMap())


def _read(file: Path, names: Sequence[str], options: LogMap) -> Series:
    """Return some columns of a table as `read_series` does."""
    tables = open_tables([file], options)
    columns = columns_of(tables.layouts, tables.titles)
    chosen = map_collecting_errors(lambda name: find_column(columns, name, file=str(file)), names)
    units = given_units(columns, options)
    plan = Plan(tables, find_clocks(tables, columns, options, units), Roles(joints=tuple(chosen)), units)
    content = read_content(plan, skip_bad=options.skip_bad)
    values = content.values(plan.roles.joints).copy()
    _refuse_missing(file, chosen, values)
    if content.clock is not None:
        t_ns, noticed = content.clock - content.clock[0], list[LogWarning]()
    else:
        t_ns, _, noticed = even_clock(content.rows, options.period)
    known = [units.get(column.number) or column.unit for column in chosen]
    for place, unit in enumerate(known):
        values[:, place] *= unit.factor if unit else 1.0
    spelled = tuple(_spelled(column, unit) for column, unit in zip(chosen, known, strict=True))
    warnings = (*content.warnings, *plan.clock.warnings, *noticed)
    return Series(file, tuple(one.name for one in chosen), t_ns, values, spelled, warnings)


def _refuse_missing(file: Path, columns: Sequence[Column], values: FloatArray) -> None:
    """Raise a `LogError` with each column that has a row without a number."""
    findings = []
    for place, column in enumerate(columns):
        missing = np.flatnonzero(~np.isfinite(values[:, place]))
        if len(missing):
            said = f"found {format_count(len(missing), 'row')} without a number, allowed: one in every row"
            findings.append(Finding(said, str(file), row=int(missing[0]) + 1, column=column.header))
    if findings:
        raise LogError(*findings)


def _spelled(column: Column, unit: Unit | None) -> str | None:
    """Return the unit that the values are in now."""
    if unit is None or unit.quantity not in SI:
        return column.unit_text
    return SI[unit.quantity] + ("", "/s", "/s2")[unit.order]
