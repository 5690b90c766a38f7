"""Several topics in one table, as PlotJuggler writes them: in the rows of one, the cells of others are empty.

The rows of the topic of the joints are read; of a table without joints, those of the recorded positions.
"""

from __future__ import annotations

import os.path
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, IntArray
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.cells.cell import is_missing
from urmpipe_pipeline.logs.columns.columns import Column, columns_of, listed
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.plan import Plan, make_plan
from urmpipe_pipeline.logs.tables.opening import Tables
from urmpipe_pipeline.logs.tables.rows import ROWS_READ, column_texts, with_rows
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.table import read_table
from urmpipe_pipeline.logs.tables.whole import Whole

MAX_SHARE = 0.5  # a column with values in at most this share of the rows of the joints is of another topic
FEWEST = 4  # rows; fewer are at equal distances by chance
OTHER_ROWS = "other-rows"  # the warning about groups of columns that are recorded in other rows


def plan_topic(tables: Tables, options: LogMap, robot: Chain | None) -> Plan:
    """Return the plan of a log, as `make_plan` does, of the rows of the topic of its joints.

    A row is of another topic if all its joint cells are empty and a cell of another topic is not.
    """
    plan = make_plan(tables, options, robot)
    needed, main = plan.roles.joints or plan.roles.position, plan.main
    if any(column.table != main for column in needed):
        return plan
    layout, is_empty = tables.layouts[main], _find_empty_rows(plan, tables, needed)
    if not is_empty.any() or is_empty.all():
        return plan
    used = {column.number for column in (*needed, *plan.clocks[main].columns)}
    columns = columns_of(tables.layouts, tables.titles)
    columns = tuple(column for column in columns if column.table == main and column.number not in used)
    is_filled = _find_filled_cells(layout, columns, len(is_empty))
    of_others = _find_other_topics(needed, columns, is_filled[~is_empty], np.flatnonzero(~is_empty))
    is_other = is_empty & np.logical_or.reduce(is_filled[:, of_others], axis=1)
    if not is_other.any():
        return plan
    rows = np.flatnonzero(~is_other)
    named = [
        column
        for column, column_cells in zip(columns, is_filled[is_other].T, strict=True)
        if column_cells.any()
    ]
    why = f"{format_count(int(is_other.sum()), 'row')} of other topics, with {listed(named, 4)}, left out"
    layout = with_rows(layout, rows, Inference(ROWS_READ, f"{len(rows)} of {len(is_other)}", why))
    layouts = (*tables.layouts[:main], layout, *tables.layouts[main + 1 :])
    readers = (*tables.whole[:main], Whole(layout), *tables.whole[main + 1 :])
    plan = make_plan(replace(tables, layouts=layouts, whole=readers), options, robot)
    numbers = {
        c.number for c, column_cells in zip(columns, is_filled[rows].T, strict=True) if not column_cells.any()
    }
    return _without(plan, [column for column in plan.roles.columns if column.number in numbers])


def _find_empty_rows(plan: Plan, tables: Tables, needed: Sequence[Column]) -> BoolArray:
    """Return in which rows all cells of some columns are empty, shape (n,)."""
    columns = [column for column in plan.roles.columns if column.table == plan.main]
    places = [column.index for column in columns]
    numbers = tables.whole[plan.main].table(places, plan.clocks[plan.main].parts)
    values = numbers.values
    is_empty = np.isnan(values[:, columns.index(needed[0])])
    if is_empty.any():
        is_empty = np.logical_and.reduce(np.isnan(values[:, [columns.index(one) for one in needed]]), axis=1)
    is_empty[list(numbers.unread)] = False
    return is_empty


def _find_filled_cells(layout: Layout, columns: Sequence[Column], rows: int) -> BoolArray:
    """Return which cells are not empty, shape (rows, columns)."""
    is_filled = np.zeros((rows, len(columns)), dtype=np.bool_)
    numeric = [k for k, column in enumerate(columns) if not column.text]
    values = read_table(layout, [columns[k].index for k in numeric], ()).values[:rows]
    is_filled[: len(values), numeric] = ~np.isnan(values)
    for k, column in enumerate(columns):
        if column.text:
            texts = column_texts(layout, column.index)[:rows]
            is_filled[: len(texts), k] = [not is_missing(text) for text in texts]
    return is_filled


def _find_other_topics(
    needed: Sequence[Column], columns: Sequence[Column], is_filled: BoolArray, rows: IntArray
) -> BoolArray:
    """Return which columns are of other topics than the joints, shape (columns,).

    By their names, or because most rows of the joints lack them; all of them if every n-th row has joints.

    Args:
        needed: The joints.
        columns: The other columns.
        is_filled: Which of their cells are not empty in the rows of the joints, shape (k, columns).
        rows: The rows of the joints, from 0, shape (k,).
    """
    steps = np.unique(np.diff(rows))
    topic = os.path.commonprefix([column.header for column in needed]).rpartition("/")[0]  # noqa: RUF071
    is_named = [bool(topic) and not column.header.startswith(f"{topic}/") for column in columns]
    is_sampled = len(rows) >= FEWEST and len(steps) == 1 and bool(steps[0] > 1)
    few = np.count_nonzero(is_filled, axis=0) <= MAX_SHARE * len(rows)
    return np.array([is_sampled or a or b for a, b in zip(is_named, few, strict=True)], dtype=np.bool_)


def _without(plan: Plan, columns: Sequence[Column]) -> Plan:
    """Return a plan without the groups of columns that have no value in the rows that are read."""
    if not columns:
        return plan
    what = "the joints" if plan.roles.joints else "the position"
    warning = LogWarning(OTHER_ROWS, f"{listed(columns, 6)}: recorded in other rows than {what}, so not read")
    roles = plan.roles.without(columns)
    return replace(plan, roles=replace(roles, warnings=(*roles.warnings, warning)))
