"""What is to be read of a log's tables: the clock of each, and the columns that matter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Finding, Hint, LogError, OptionError
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.clocks.clock import Clock, by_joints, find_clocks
from urmpipe_pipeline.logs.clocks.time_file import clocks_apart, time_file, with_time_file
from urmpipe_pipeline.logs.columns.columns import (
    Column,
    columns_named,
    columns_of,
    given_units,
    refuse_twins,
)
from urmpipe_pipeline.logs.columns.long_form import refuse_long_form
from urmpipe_pipeline.logs.columns.own_log import own_joints, written_roles
from urmpipe_pipeline.logs.columns.places import one_plot_a_file, without_header
from urmpipe_pipeline.logs.columns.roles import Roles, assign, joint_inference
from urmpipe_pipeline.logs.columns.sides import columns_of_side, columns_of_topic, without_other_side
from urmpipe_pipeline.logs.columns.simulated import joints_of_blocks
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.opening import PATH, Tables
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
    tables, apart = with_time_file(tables, options)
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
    apart = apart if options.time else time_file(tables, own_side)
    if apart is None:
        joints = len(robot.coordinates) if robot else None
        clocks = find_clocks(tables, own_side, options, units, joints)
    else:
        clocks = clocks_apart(tables, own_side, apart, options, units)
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
        clocks = tuple(by_joints(clock, tables, roles.joints, units) for clock in clocks)
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
    if not given and (signals := joints_of_blocks(columns, main, robot)) is not None:
        return signals
    if main.header is None and not several:
        return without_header(
            columns, tables.layouts, options, robot, tables.whole, path=options.source == PATH
        )
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
    roles = assign(columns, layouts, options, robot, tables.whole, path=path, written=written)
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
