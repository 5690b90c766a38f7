"""What is to be read of a log's tables: the clock of each, and the columns that matter.

Several topics in one table, as PlotJuggler writes them: in the rows of one, the cells of others are empty.

The rows of the topic of the joints are read; of a table without joints, those of the recorded positions.
"""

from __future__ import annotations

import os.path
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.clock import (
    Clock,
    append_time_file,
    find_clocks,
    find_clocks_with_file,
    find_time_file,
    settle_unit_by_speed,
)
from urmpipe_pipeline.logs.columns import (
    Column,
    columns_named,
    columns_of,
    columns_of_side,
    columns_of_topic,
    given_units,
    listed,
    refuse_twins,
    without_other_side,
)
from urmpipe_pipeline.logs.formats.cells import is_missing
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.opening import PATH, Tables
from urmpipe_pipeline.logs.formats.table import ROWS_READ
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.roles import (
    Roles,
    assign,
    joint_inference,
    own_joints,
    refuse_long_form,
    written_roles,
)
from urmpipe_pipeline.logs.unnamed import one_plot_a_file, without_header
from urmpipe_pipeline.logs.vocabulary import Patterns, Unit

MOST_JOINTS = 500
"""Joints of a log: an arm has seven, a humanoid with its hands has sixty."""

SHOWN_LOGS = 6
"""Files that are named where several logs stand for one."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What is to be read.

    Attributes:
        tables: The tables.
        clocks: The clock of each table.
        roles: The columns that matter.
        units: Units given by the user, by the column's number; by 0 that of every angle.
        time_file: Index of the table that holds the times of the others, if one does nothing else.
        poses: Whether the rows are static poses; None where they are to tell.
    """

    tables: Tables
    clocks: tuple[Clock, ...]
    roles: Roles
    units: Mapping[int, Unit]
    time_file: int | None = None
    poses: bool | None = False

    @property
    def clock(self) -> Clock:
        """The clock of the log."""
        return self.clocks[self.main if self.time_file is None else self.time_file]

    @property
    def main(self) -> int:
        """Index of the table with the first joint; of a path, with x."""
        return self.roles.columns[0].table

    @property
    def used(self) -> list[int]:
        """Indices of the tables that hold a column that matters, the main one first."""
        return list(dict.fromkeys(column.table for column in self.roles.columns))


def make_plan(
    tables: Tables,
    options: LogMap,
    robot: Chain | None,
    further: Mapping[str, Patterns] | None = None,
) -> Plan:
    """Return what is to be read of a log's tables.

    Args:
        tables: The tables.
        options: What the user says.
        robot: The arm, or None.
        further: Names of columns that are read beside the usual ones, by what they are: they are neither
            a time nor anything else.

    Raises:
        LogError: If clock or joints cannot be told.
        OptionError: If an option's value makes no sense.
    """
    tables, apart = append_time_file(tables, options)
    columns = columns_of(tables.layouts, tables.titles)
    units = given_units(columns, options)
    beside = columns_named(columns, tables.layouts, further or {})
    columns = tuple(column for column in columns if column not in beside.values())
    chosen, applied = columns, {name for layout in tables.layouts for name in layout.applied}
    if options.topic is not None and "topic" not in applied:
        topic = tuple(columns_of_topic(columns, options, tables.layouts[0].file))
        chosen, applied = topic or columns, applied | ({"topic"} if topic else set())
    has_time = any(column.is_time for column in chosen)
    own_side = without_other_side(chosen if has_time else columns, options)
    apart = apart if options.time else find_time_file(tables, own_side)
    if apart is None:
        joints = len(robot.coordinates) if robot else None
        clocks = find_clocks(tables, own_side, options, units, joints)
    else:
        clocks = find_clocks_with_file(tables, own_side, apart, options, units)
    for i, clock in enumerate(() if options.time or apart is not None else clocks):
        own = [column for column in own_side if column.table == i]
        refuse_twins(clock.columns, own, tables.layouts, Hint("time", None, "selects one: give its number"))
    times = {column for clock in clocks for column in clock.columns}
    rest = [column for column in chosen if column not in times and column.table != apart]
    rest = columns_of_side(rest, options, tables.layouts[0].file)
    only = None if apart is None else 1 - apart
    roles = _renamed(_roles(rest, tables, options, robot, only), options)
    roles = replace(roles, further=beside)
    _refuse_many(roles, tables)
    if not options.poses:
        clocks = tuple(settle_unit_by_speed(clock, tables, roles.joints, units) for clock in clocks)
    for table in {column.table for column in roles.joints}:
        own = [column for column in rest if column.table == table]
        refuse_long_form(roles.joints, own, clocks[table].columns, tables.layouts[table])
    unused = [name for name in ("topic", "episode") if getattr(options, name) and name not in applied]
    warnings = [
        LogWarning(f"{name}-not-used", "no effect: not in this log", parameter=name) for name in unused
    ]
    if apart is None:
        warnings += _unused_files(tables, roles)
    roles = replace(roles, warnings=(*roles.warnings, *warnings))
    if options.poses:
        return Plan(tables, clocks, roles, units, poses=True)
    told = options.period is not None or options.time not in (None, "none") or apart is not None
    return Plan(tables, clocks, roles, units, apart, False if told else None)


def _refuse_many(roles: Roles, tables: Tables) -> None:
    """Raise if a log has more joints than any arm."""
    if len(roles.joints) > MOST_JOINTS:
        found, allowed = f"{len(roles.joints)} joints", f"{MOST_JOINTS} at most"
        file = tables.layouts[roles.joints[0].table].file
        raise LogError(Finding(file=file, found=found, allowed=allowed, hints=(Hint("joints"),)))


def _unused_files(tables: Tables, roles: Roles) -> Iterator[LogWarning]:
    """Yield a warning for each of several files of which nothing is used."""
    used = {tables.paths[column.table] for column in roles.columns}
    for path in dict.fromkeys(tables.paths):
        if path not in used:
            hints = (Hint("time", f"{path}:COLUMN", "takes the times from one of its columns"),)
            yield LogWarning("file-not-used", f"none of the columns of {path.name} is used", hints=hints)


def _renamed(roles: Roles, options: LogMap) -> Roles:
    """Return the roles with the joint names that the user gives: one for each joint, all different."""
    names = options.names
    if not names or (options.shared and not roles.joints):
        return roles
    if len(names) != len(roles.joints) or len(set(names)) < len(names):
        allowed = f"a name for each of the {len(roles.joints)} joints, each once"
        raise OptionError(f"names: found {', '.join(names)}, allowed: {allowed}")
    joints = tuple(replace(column, name=name) for column, name in zip(roles.joints, names, strict=True))
    return replace(roles, joints=joints)


def _roles(
    columns: Sequence[Column],
    tables: Tables,
    options: LogMap,
    robot: Chain | None,
    only: int | None = None,
) -> Roles:
    """Return the roles of the columns of all tables, or of the only one that matters."""
    main = tables.layouts[only or 0]
    several = only is None and len(set(tables.paths)) > 1
    given = options.joints or options.position or options.measured or options.source
    given = given or options.side or options.pair
    if (
        len(tables.layouts) == 1
        and not given
        and (written := written_roles(columns, main, robot)) is not None
    ):
        return written
    if main.header is None and not several:
        return without_header(columns, tables.layouts, options, robot, path=options.source == PATH)
    plots = one_plot_a_file(columns, tables.paths, robot) if several and not options.joints else None
    if plots is not None:
        return _plots(*plots, tables)
    try:
        ours = tables.known is not None and tables.known.own and not (tables.foreign or options.joints)
        own = own_joints(columns) if ours else None
        roles = _by_names(columns, tables, options, robot, own)
    except LogError:
        if several:
            _refuse_several_logs(columns, tables, options, robot)
        raise
    if several and not options.joints and len({column.table for column in roles.joints}) == 1:
        _refuse_several_logs(columns, tables, options, None, joints=len(roles.joints))
    return roles


def _by_names(
    columns: Sequence[Column],
    tables: Tables,
    options: LogMap,
    robot: Chain | None,
    own: tuple[Column, ...] | None = None,
) -> Roles:
    """Return the roles of columns with names, each there once; a log of our own without joints is a path."""
    path = options.source == PATH or own == ()
    layouts, written = tables.layouts, () if path else own or ()
    roles = assign(columns, layouts, options, robot, path=path, written=written)
    if not options.joints:
        refuse_twins(roles.joints, columns, layouts, Hint("joints", None, "selects them: give their numbers"))
    refuse_twins(
        (*roles.position, *roles.rotation), columns, layouts, Hint("", effect="rename or remove the others")
    )
    return roles


def _refuse_several_logs(
    columns: Sequence[Column],
    tables: Tables,
    options: LogMap,
    robot: Chain | None,
    *,
    joints: int | None = None,
) -> None:
    """Raise a `LogError` if two files or more are logs of their own: each with two joints or more.

    With a number of joints only those with names for so many count.
    """
    whole = []
    for i, (path, layout) in enumerate(zip(tables.paths, tables.layouts, strict=True)):
        own = [column for column in columns if column.table == i]
        try:
            if layout.header is None and joints is None:
                count = sum(not column.text for column in own)
            else:
                count = len(_by_names(own, tables, options, robot).joints)
        except LogError:
            continue
        whole += [path] if count > 1 and count == (joints or count) else []
    if len(whole) > 1:
        shown = ", ".join(path.name for path in whole[:SHOWN_LOGS])
        more = f" and {len(whole) - SHOWN_LOGS} more" if len(whole) > SHOWN_LOGS else ""
        said = f"found {len(whole)} logs, each with joints of its own ({shown}{more})"
        hint = "allowed: one log, or its plots with one joint per file; name the logs one by one"
        raise LogError(Finding(f"{said}, {hint}", str(whole[0].parent))) from None


def _plots(plots: Sequence[Column], warnings: tuple[LogWarning, ...], tables: Tables) -> Roles:
    """Return the roles of one plot per file, named by their columns or, if these repeat, by their files."""
    names = [column.header for column in plots]
    if len(set(names)) < len(names) or tables.layouts[0].header is None:
        plots = [replace(column, name=tables.titles[column.table]) for column in plots]
    said = joint_inference(plots, "one plot per file")
    return Roles(joints=tuple(plots), inferences=(said,), warnings=warnings)


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
    layout = layout.take(rows, Inference(ROWS_READ, f"{len(rows)} of {len(is_other)}", why))
    layouts = (*tables.layouts[:main], layout, *tables.layouts[main + 1 :])
    plan = make_plan(replace(tables, layouts=layouts), options, robot)
    numbers = {
        c.number for c, column_cells in zip(columns, is_filled[rows].T, strict=True) if not column_cells.any()
    }
    return _without(plan, [column for column in plan.roles.columns if column.number in numbers])


def _find_empty_rows(plan: Plan, tables: Tables, needed: Sequence[Column]) -> BoolArray:
    """Return in which rows all cells of some columns are empty, shape (n,)."""
    columns = [column for column in plan.roles.columns if column.table == plan.main]
    places = [column.index for column in columns]
    numbers = tables.layouts[plan.main].read(places, plan.clocks[plan.main].parts)
    values = numbers.values
    is_empty = np.isnan(values[:, columns.index(needed[0])])
    if is_empty.any():
        is_empty = np.logical_and.reduce(np.isnan(values[:, [columns.index(one) for one in needed]]), axis=1)
    is_empty[list(numbers.unread)] = False
    return is_empty


def _find_filled_cells(layout: LogTable, columns: Sequence[Column], rows: int) -> BoolArray:
    """Return which cells are not empty, shape (rows, columns)."""
    is_filled = np.zeros((rows, len(columns)), dtype=np.bool_)
    numeric = [k for k, column in enumerate(columns) if not column.text]
    values = layout.read([columns[k].index for k in numeric], ()).values[:rows]
    is_filled[: len(values), numeric] = ~np.isnan(values)
    for k, column in enumerate(columns):
        if column.text:
            texts = layout.texts(column.index)[:rows]
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
