"""What of a log's tables is read: the columns, and the clock of each table.

`make_plan`: topic and side -> clocks -> roles of the other columns -> unit of the clock by their speeds.
Of a single table with a header the roles are those that urmpipe or a schema wrote, else those by names; of
one without a header, those by numbers. Of several files each is a plot of one joint, or all are one log.

`plan_topic`: the same for a table of several topics, as PlotJuggler writes them: in the rows of one topic the
cells of the others are empty. The rows with the joints, or of a path with its positions, are read.
"""

from __future__ import annotations

import os.path
import re
from collections.abc import Mapping, Sequence
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
    check_unique_names,
    columns_named,
    columns_of,
    columns_of_side,
    columns_of_topic,
    given_units,
    listed,
    take,
    without_other_side,
)
from urmpipe_pipeline.logs.formats.cells import is_missing
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.long_form import LONG, MAX_NAMES
from urmpipe_pipeline.logs.formats.opening import PATH, Tables
from urmpipe_pipeline.logs.formats.shape import AS_TABLE, ROWS_READ
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.roles import (
    Roles,
    assign,
    own_joints,
    signal_roles,
    written_roles,
)
from urmpipe_pipeline.logs.unnamed import ASSUMED_JOINTS, MAX_UNASKED, one_plot_a_file, without_header
from urmpipe_pipeline.logs.vocabulary import Patterns, Unit

MAX_JOINTS = 500  # of a log: an arm has seven, a humanoid with its hands has sixty
MAX_LISTED = 6  # files that are listed where they are several logs
MAX_SHARE = 0.5  # a column with values in at most this share of the rows of the joints is of another topic
MIN_ROWS = 4  # fewer are at equal distances by chance
OTHER_ROWS = "other-rows"  # the warning about groups of columns that are recorded in other rows
_POSITION = re.compile(r"(position|pos)_?\d")  # of a joint, or x, y, z


@dataclass(frozen=True, slots=True)
class Plan:
    """What is read of a log's tables.

    Attributes:
        tables: The tables.
        clocks: The clock of each table.
        roles: The columns that are used.
        units: Units that the user gives, by the column's number; by 0 that of every angle.
        time_file: Index of the table that holds the times of the others, if one does nothing else.
        poses: Whether the rows are static poses; None where the rows decide.
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
    def table(self) -> LogTable:
        """The table with the first joint; of a path, with x."""
        return self.tables.tables[self.main]

    @property
    def used(self) -> list[int]:
        """Indices of the tables that hold a column that is used, the main one first."""
        return list(dict.fromkeys(column.table for column in self.roles.columns))


def make_plan(
    tables: Tables,
    options: LogMap,
    robot: Chain | None,
    further: Mapping[str, Patterns] | None = None,
) -> Plan:
    """Return what is read of a log's tables.

    Args:
        tables: The tables.
        options: What the user states.
        robot: The arm, or None.
        further: Names of columns that are read in addition to the usual ones, by what they are: they are
            neither a time nor anything else.

    Raises:
        LogError: If clock or joints are ambiguous.
        OptionError: If an option's value makes no sense.
    """
    tables, time_file = append_time_file(tables, options)
    file = tables.tables[0].file
    columns = columns_of(tables.tables, tables.titles)
    units = given_units(columns, options)
    extra = columns_named(columns, tables.tables, further or {})
    columns = tuple(column for column in columns if column not in extra.values())
    in_topic, applied = columns, {name for table in tables.tables for name in table.applied}
    if options.topic is not None and "topic" not in applied:
        topic = tuple(columns_of_topic(columns, options, file))
        in_topic, applied = topic or columns, applied | ({"topic"} if topic else set())
    has_time = any(column.is_time for column in in_topic)
    side = without_other_side(in_topic if has_time else columns, options)
    if options.time is None:
        time_file = find_time_file(tables, side)
    if time_file is None:
        clocks = find_clocks(tables, side, options, units, len(robot.coordinates) if robot else None)
    else:
        clocks = find_clocks_with_file(tables, side, time_file, options, units)
    if options.time is None and time_file is None:
        hint = Hint("time", None, "selects one: give its number")
        for index, clock in enumerate(clocks):
            of_table = [column for column in side if column.table == index]
            check_unique_names(clock.columns, of_table, tables.tables, hint)
    times = {column for clock in clocks for column in clock.columns}
    rest = [column for column in in_topic if column not in times and column.table != time_file]
    rest = columns_of_side(rest, options, file)
    roles = _rename_joints(_find_roles(rest, tables, options, robot, time_file), options)
    if len(roles.joints) > MAX_JOINTS:
        message = f"found {len(roles.joints)} joints, allowed: {MAX_JOINTS} at most"
        file = tables.tables[roles.joints[0].table].file
        raise LogError(Finding(message, file, hints=(Hint("joints"),)))
    if not options.poses:
        clocks = tuple(settle_unit_by_speed(clock, tables, roles.joints, units) for clock in clocks)
    for index in {column.table for column in roles.joints}:
        of_table = [column for column in rest if column.table == index]
        _check_not_long_form(roles.joints, of_table, tables.tables[index])
    warnings = [
        LogWarning(f"{name}-not-used", "no effect: not in this log", parameter=name)
        for name in ("topic", "episode")
        if getattr(options, name) and name not in applied
    ]
    if time_file is None:
        warnings += _unused_files(tables, roles)
    roles = replace(roles, further=extra, warnings=(*roles.warnings, *warnings))
    if options.poses:
        return Plan(tables, clocks, roles, units, poses=True)
    is_timed = options.period is not None or options.time not in (None, "none") or time_file is not None
    return Plan(tables, clocks, roles, units, time_file, False if is_timed else None)


def _check_not_long_form(joints: Sequence[Column], columns: Sequence[Column], table: LogTable) -> None:
    """Raise if a table may have a row per joint: next to its only joint names repeat in order, or joints.

    Args:
        joints: The joints that were found.
        columns: The columns next to the clock.
        table: The table.

    Raises:
        LogError: With the question what a row is.
    """
    if len(joints) != 1 or table.header is None or any(known.what == "layout" for known in table.inferences):
        return
    for column in columns:
        cells = table.cells(column.index)
        count, is_joint = len(set(cells)), "joint" in column.key.split("_")
        if column in joints or not 2 <= count <= MAX_NAMES or (len(cells) < 3 * count and not is_joint):
            continue
        is_name = all(not cell or not cell[0].isdigit() or cell.isdigit() for cell in cells[:count])
        if not is_name or (not is_joint and any(cell != cells[k % count] for k, cell in enumerate(cells))):
            continue
        effects = {LONG: "takes each row as a joint in a sample", AS_TABLE: "takes each row as a sample"}
        raise LogError(
            Finding(
                file=table.file,
                found=f"{column.header} with {count} names",
                allowed="one row per sample, or one per joint in each sample",
                hints=tuple(Hint("layout", layout, effect) for layout, effect in effects.items()),
            )
        )


def _unused_files(tables: Tables, roles: Roles) -> list[LogWarning]:
    """Return a warning for each of several files of which nothing is used."""
    used = {tables.paths[column.table] for column in roles.columns}
    warnings = []
    for path in dict.fromkeys(tables.paths):
        if path not in used:
            hints = (Hint("time", f"{path}:COLUMN", "takes the times from one of its columns"),)
            message = f"none of the columns of {path.name} is used"
            warnings.append(LogWarning("file-not-used", message, hints=hints))
    return warnings


def _rename_joints(roles: Roles, options: LogMap) -> Roles:
    names = options.names
    if not names or (options.shared and not roles.joints):
        return roles
    if len(names) != len(roles.joints) or len(set(names)) < len(names):
        allowed = f"a name for each of the {len(roles.joints)} joints, each once"
        raise OptionError(f"names: found {', '.join(names)}, allowed: {allowed}")
    joints = tuple(replace(column, name=name) for column, name in zip(roles.joints, names, strict=True))
    return replace(roles, joints=joints)


def _find_roles(
    columns: Sequence[Column],
    tables: Tables,
    options: LogMap,
    robot: Chain | None,
    time_file: int | None,
) -> Roles:
    main = tables.tables[0 if time_file is None else 1 - time_file]
    are_several = time_file is None and len(set(tables.paths)) > 1
    columns_given = options.joints or options.position or options.measured
    if not (columns_given or options.source or options.side or options.pair):
        stated = written_roles(columns, main, robot) if len(tables.tables) == 1 else None
        stated = stated or signal_roles(columns, main, robot)
        if stated is not None:
            return stated
    if main.header is None and not are_several:
        return without_header(columns, tables.tables, options, robot, path=options.source == PATH)
    if are_several and not options.joints:
        if plots := one_plot_a_file(columns, tables, robot):
            return plots
        _check_one_log(columns, tables, options)
    is_ours = tables.known is not None and tables.known.own and not (tables.foreign or options.joints)
    return _roles_by_names(columns, tables, options, robot, own_joints(columns) if is_ours else None)


def _roles_by_names(
    columns: Sequence[Column],
    tables: Tables,
    options: LogMap,
    robot: Chain | None,
    written: tuple[Column, ...] | None = None,
) -> Roles:
    """Return the roles by names, each name once; a log that urmpipe wrote without joints is a path."""
    is_path = options.source == PATH or written == ()
    joints = () if is_path else written or ()
    roles = assign(columns, tables.tables, options, robot, path=is_path, written=joints)
    if robot is None and not (options.joints or written):
        _check_no_position(roles, tables)
        roles = _warn_of_many_joints(roles)
    if not options.joints:
        check_unique_names(
            roles.joints, columns, tables.tables, Hint("joints", None, "selects them: give their numbers")
        )
    pose, hint = (*roles.position, *roles.rotation), Hint("", effect="rename or remove the others")
    check_unique_names(pose, columns, tables.tables, hint)
    return roles


def _warn_of_many_joints(roles: Roles) -> Roles:
    """Return roles with a warning if there are more joints than an arm has: of two arms, a hand or wheels."""
    if len(roles.joints) <= MAX_UNASKED:
        return roles
    columns = f"{len(roles.joints)} columns"
    message = (
        f"{columns} are taken as the joints, more than an arm has: {listed(roles.joints, most=MAX_UNASKED)}"
    )
    hints = (Hint("joints", None, "names those of the arm"),)
    assumption = f"{columns} are the joints"
    warning = LogWarning(ASSUMED_JOINTS, message, hints=hints, assumption=assumption, role="joint")
    return replace(roles, warnings=(*roles.warnings, warning))


def _check_no_position(roles: Roles, tables: Tables) -> None:
    """Raise a `LogError` with the question whether pos_0, pos_1, ... are joints or the pose of a tool.

    In a header six or seven are joints; after a label, `pos: [0.1, ...]`, they may be either.
    """
    joints = roles.joints
    texts = [table for table in tables.tables if isinstance(table, TextTable)]
    counts = (3, 6, 7) if any(text.form and text.form.labels for text in texts) else (3,)
    are_positions = all(_POSITION.fullmatch(c.key) and c.unit is None for c in joints)
    if len(joints) in counts and are_positions and not (roles.rates or roles.position):
        hints = (take(joints), take(joints[:3], "takes x, y, z", parameter="position"))
        names = f"{listed(joints)}, which may be joints or the pose of a tool"
        raise LogError(Finding(file=tables.tables[joints[0].table].file, found=names, hints=hints))


def _check_one_log(columns: Sequence[Column], tables: Tables, options: LogMap) -> None:
    """Raise a `LogError` if two files or more are separate logs, each with as many joints, two or more."""
    counts = dict.fromkeys(tables.paths, 1)
    for index, path in enumerate(tables.paths):
        of_table = [column for column in columns if column.table == index]
        try:
            if all(table.header is None for table in tables.tables):
                counts[path] = sum(not column.text for column in of_table)
            else:
                counts[path] = len(_roles_by_names(of_table, tables, options, None).joints)
        except LogError:
            continue
    logs = [path for path, count in counts.items() if count == max(counts.values()) > 1]
    if len(logs) > 1:
        listed_logs = ", ".join(path.name for path in logs[:MAX_LISTED])
        more = f" and {len(logs) - MAX_LISTED} more" if len(logs) > MAX_LISTED else ""
        message = f"found {len(logs)} logs, each with its joints ({listed_logs}{more})"
        allowed = "allowed: one log, or its plots with one joint per file; name the logs one by one"
        raise LogError(Finding(f"{message}, {allowed}", str(logs[0].parent)))


# Several topics in one table


def plan_topic(tables: Tables, options: LogMap, robot: Chain | None) -> Plan:
    """Return the plan of a log, as `make_plan` does, of the rows of the topic of its joints.

    A row is of another topic if all its joint cells are empty and a cell of another topic is not.
    """
    plan = make_plan(tables, options, robot)
    needed, main = plan.roles.joints or plan.roles.position, plan.main
    if any(column.table != main for column in needed):
        return plan
    table, is_empty = tables.tables[main], _find_empty_rows(plan, needed)
    if not is_empty.any() or is_empty.all():
        return plan
    used = {column.number for column in (*needed, *plan.clocks[main].columns)}
    columns = [column for column in columns_of(tables.tables, tables.titles) if column.table == main]
    columns = [column for column in columns if column.number not in used]
    is_filled = _find_filled_cells(table, columns, len(is_empty))
    of_others = _find_other_topics(needed, columns, is_filled[~is_empty], np.flatnonzero(~is_empty))
    is_other = is_empty & is_filled[:, of_others].any(axis=1)
    if not is_other.any():
        return plan

    def without_values(rows: BoolArray) -> list[Column]:
        filled = np.asarray(is_filled[rows].any(axis=0))
        return [column for column, has_value in zip(columns, filled, strict=True) if not has_value]

    absent = {column.number for column in without_values(is_other)}
    with_values = listed([column for column in columns if column.number not in absent], 4)
    why = f"{format_count(int(is_other.sum()), 'row')} of other topics, with {with_values}, left out"
    rows = np.flatnonzero(~is_other)
    chosen = table.take(rows, Inference(ROWS_READ, f"{len(rows)} of {len(is_other)}", why))
    table = replace(chosen, uncut=table.uncut or table)
    in_topic = (*tables.tables[:main], table, *tables.tables[main + 1 :])
    plan = make_plan(replace(tables, tables=in_topic), options, robot)
    empty = {column.number for column in without_values(~is_other)}
    return _drop_groups(plan, [column for column in plan.roles.columns if column.number in empty])


def _find_empty_rows(plan: Plan, needed: Sequence[Column]) -> BoolArray:
    """Return in which rows all cells of some columns are empty, shape (n,)."""
    columns = [column for column in plan.roles.columns if column.table == plan.main]
    clock = plan.clocks[plan.main].parts
    numbers = plan.table.read([column.index for column in columns], clock)
    is_empty = np.isnan(numbers.values[:, columns.index(needed[0])])
    if is_empty.any():
        places = [columns.index(column) for column in needed]
        is_empty = np.asarray(np.isnan(numbers.values[:, places]).all(axis=1))
    is_empty[list(numbers.unread)] = False
    return is_empty


def _find_filled_cells(table: LogTable, columns: Sequence[Column], rows: int) -> BoolArray:
    """Return which cells are not empty, shape (rows, columns)."""
    is_filled = np.zeros((rows, len(columns)), dtype=np.bool_)
    numeric = [k for k, column in enumerate(columns) if not column.text]
    values = table.read([columns[k].index for k in numeric], ()).values[:rows]
    is_filled[: len(values), numeric] = ~np.isnan(values)
    for k, column in enumerate(columns):
        if column.text:
            texts = table.texts(column.index)[:rows]
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
    is_foreign = [bool(topic) and not column.header.startswith(f"{topic}/") for column in columns]
    is_sampled = len(rows) >= MIN_ROWS and len(steps) == 1 and bool(steps[0] > 1)
    is_rare = np.count_nonzero(is_filled, axis=0) <= MAX_SHARE * len(rows)
    return np.asarray(is_sampled | np.array(is_foreign, dtype=np.bool_) | is_rare)


def _drop_groups(plan: Plan, columns: Sequence[Column]) -> Plan:
    """Return a plan without the groups of columns that have no value in the rows that are read."""
    if not columns:
        return plan
    needed = "the joints" if plan.roles.joints else "the position"
    message = f"{listed(columns, 6)}: recorded in other rows than {needed}, so not read"
    warning = LogWarning(OTHER_ROWS, message)
    roles = plan.roles.without(columns)
    return replace(plan, roles=replace(roles, warnings=(*roles.warnings, warning)))
