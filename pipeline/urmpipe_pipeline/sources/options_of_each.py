"""Options that are given once for several logs: each holds for the logs that it fits.

An option that names columns (--joints, --time, --unit COLUMN=, those of a map) holds for the logs that have
them: by numbers, which fit any log, for those without a header if there is one; --time none for those whose
names tell no time, if there is one. An option that says how a table is written (--delimiter, --decimal,
--source, --rotation) holds for the logs that can be read so; a unit of all joints for those whose names tell
no other. What fits none of them is an error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, LogError, UrmpipeError
from urmpipe_pipeline.sources.columns.columns import Column, called, columns_of, listed
from urmpipe_pipeline.sources.options import ReadOptions
from urmpipe_pipeline.sources.plan import Plan, make_plan
from urmpipe_pipeline.sources.tables.opening import Tables, open_tables
from urmpipe_pipeline.sources.vocabulary import vocabulary

ALL_JOINTS = ""
"""Stands among the units for all joints that turn."""

NO_TIME = "none"
"""Stands for the time of a log that has none."""

WRITTEN = ("delimiter", "decimal", "source", "rotation")
"""What says how a table is written."""


@dataclass(frozen=True, slots=True)
class _Named:
    """Columns that an option names.

    Attributes:
        option: How it was given.
        columns: Names or numbers of the columns.
    """

    option: str
    columns: tuple[str, ...]

    def names(self, columns: Sequence[Column]) -> bool:
        """Tell whether a log has one of them by its name."""
        return any(called(columns, text) for text in self.columns)

    def counts(self, columns: Sequence[Column]) -> bool:
        """Tell whether a log has all of them by their numbers."""
        numbers = range(1, len(columns) + 1)
        return all(text.isdigit() and int(text) in numbers for text in self.columns)

    def belongs_to(self, other: _Named) -> bool:
        """Tell whether this is the unit of columns that the other option names."""
        return self.option == "--unit" != other.option and set(self.columns) <= set(other.columns)

    def left_out(self, options: ReadOptions) -> ReadOptions:
        """Return the options without this one."""
        if self.option == "--joints":
            return replace(options, joints=(), names=(), signs=(), offsets=())
        if self.option == "--time":
            return replace(options, time=None)
        if self.option == "position":
            return replace(options, position=(), orientation=())
        kept = {text: unit for text, unit in options.units.items() if text not in self.columns}
        return replace(options, units=kept)


@dataclass(frozen=True, slots=True)
class _Fitted:
    """How one of several logs is read.

    Attributes:
        file: Its first file.
        options: What holds for it.
        taken: The options that name columns of it.
        columns: Its columns; none if it cannot be opened.
        plan: What is read of it; None if that cannot be told.
        has_names: Whether it has a header.
        names_time: Whether its names tell a time, where an option says that there is none.
        foreign: Whether a source was given that has columns of its own, and they are not those.
    """

    file: Path
    options: ReadOptions
    taken: tuple[_Named, ...] = ()
    columns: tuple[Column, ...] = ()
    plan: Plan | None = None
    has_names: bool = True
    names_time: bool = False
    foreign: bool = False

    @property
    def joints(self) -> tuple[Column, ...]:
        """Its joints; none of a path, or if they cannot be told."""
        return self.plan.roles.joints if self.plan else ()

    def tells_other_than(self, unit: str | None) -> bool:
        """Tell whether the names of all joints tell another unit than this one."""
        told = [column.unit for column in self.joints]
        return unit is not None and bool(told) and None not in told and vocabulary().unit(unit) not in told


def options_of_each(
    logs: Sequence[Sequence[Path]], options: ReadOptions, robot: Chain | None = None
) -> list[ReadOptions]:
    """Return how to read each of several logs.

    Args:
        logs: The files of each log.
        options: What the user says of all of them; of a single log all of it holds.
        robot: The arm, or None.

    Raises:
        LogError: If an option names columns that no log has.
    """
    if len(logs) < 2 or options == ReadOptions():
        return [options] * len(logs)
    named = list(_named(options))
    fitted = [_fit(files, options, named, robot) for files in logs]
    numbered = {one for log in fitted if not log.has_names for one in log.taken}
    if numbered:
        fitted = [
            _fit(files, options, named, robot, numbered) if log.has_names else log
            for files, log in zip(logs, fitted, strict=True)
        ]
    unused = [one for one in named if not any(one in log.taken for log in fitted)]
    if unused and all(log.columns for log in fitted):
        raise LogError(*(_nowhere(one, fitted) for one in unused))
    return [
        replace(log.options, **_of_joints(log, fitted, options), **_for_all(log, fitted, options))
        for log in fitted
    ]


def _named(options: ReadOptions) -> Iterator[_Named]:
    """Yield the options that name columns."""
    if options.joints:
        yield _Named("--joints", options.joints)
    if options.time is not None and options.time.lower() != NO_TIME:
        yield _Named("--time", (options.time,))
    if options.position:
        yield _Named("position", (*options.position, *options.orientation))
    for text in options.units:
        if text != ALL_JOINTS:
            yield _Named("--unit", (text,))


def _fit(
    files: Sequence[Path],
    options: ReadOptions,
    named: Sequence[_Named],
    robot: Chain | None,
    numbered: Set[_Named] = frozenset(),
) -> _Fitted:
    """Return how one log is read: as the options say it is written, if it can be and has their columns.

    Args:
        files: The files of the log.
        options: What the user says of all logs.
        named: Those of the options that name columns.
        robot: The arm, or None.
        numbered: Those of them whose numbers are of other logs.
    """

    def fitted(given: ReadOptions) -> _Fitted:
        """Return how it is read; without the form of an orientation that it does not have."""
        found = _fitted(files, given, named, robot, numbered)
        if found.plan is None and given.rotation is not None:
            otherwise = _fitted(files, replace(given, rotation=None), named, robot, numbered)
            return otherwise if otherwise.plan else found
        return found

    as_told = fitted(options)
    plain = replace(options, delimiter=None, decimal=None, source=None)
    if plain == options or (as_told.plan and (as_told.taken or not named)):
        return as_told
    otherwise = fitted(plain)
    return otherwise if otherwise.plan else as_told


def _fitted(
    files: Sequence[Path],
    options: ReadOptions,
    named: Sequence[_Named],
    robot: Chain | None,
    numbered: Set[_Named],
) -> _Fitted:
    """Return how one log is read with the options whose columns it has."""
    try:
        tables = open_tables(files, options)
    except UrmpipeError:
        return _Fitted(files[0], options)  # to be told when it is read
    columns = columns_of(tables.layouts, tables.titles)
    taken: list[_Named] = []
    for one in named:
        leader = next((other for other in named if one.belongs_to(other)), None)
        if one.names(columns):
            taken.append(one)
        elif leader is not None:
            taken += [one] if leader in taken else []
        elif one.counts(columns) and one not in numbered and not _of_path(one, tables, options):
            taken.append(one)
    for one in named:
        options = options if one in taken else one.left_out(options)
    return _Fitted(
        file=files[0],
        options=options,
        taken=tuple(taken),
        columns=columns,
        plan=_plan(tables, options, robot),
        has_names=any(layout.header is not None for layout in tables.layouts),
        names_time=_names_time(tables, options),
        foreign=tables.foreign,
    )


def _plan(tables: Tables, options: ReadOptions, robot: Chain | None = None) -> Plan | None:
    """Return what is read of a log; None if that cannot be told."""
    try:
        return make_plan(tables, options, robot)
    except UrmpipeError:
        return None


def _of_path(named: _Named, tables: Tables, options: ReadOptions) -> bool:
    """Tell whether joints are named, and the log is a path by the names that it has."""
    if named.option != "--joints":
        return False
    plan = _plan(tables, named.left_out(options))
    return plan is not None and not plan.roles.joints


def _names_time(tables: Tables, options: ReadOptions) -> bool:
    """Tell whether the names of a log tell a time although the options say that there is none."""
    if options.time is None or options.time.lower() != NO_TIME or tables.layouts[0].header is None:
        return False
    plan = _plan(tables, replace(options, time=None))
    return plan is not None and bool(plan.clock.columns)


def _of_joints(log: _Fitted, logs: Sequence[_Fitted], options: ReadOptions) -> dict[str, Any]:
    """Return the intervals and the units that hold for one log: those of its joints."""
    known = {column.name for one in logs for column in one.joints}
    own = {column.name for column in log.joints}
    interval = {name: ends for name, ends in options.interval.items() if name in own or name not in known}
    unit = options.units.get(ALL_JOINTS)
    units = dict(log.options.units)
    if log.tells_other_than(unit) and any(one.joints and not one.tells_other_than(unit) for one in logs):
        del units[ALL_JOINTS]
    return {"interval": interval, "units": units}


def _for_all(log: _Fitted, logs: Sequence[_Fitted], options: ReadOptions) -> dict[str, Any]:
    """Return what holds for one log in view of the others.

    That is the time that its names tell, if another log has none; no source and no form of an orientation
    that it does not have, if another log has it; and how a table is written, if that fits none, so that
    reading it tells why.
    """
    told = {name: getattr(options, name) for name in WRITTEN}
    lost = {
        name: value
        for name, value in told.items()
        if all(getattr(other.options, name) != value for other in logs)
    }
    timed = log.names_time and not all(other.names_time for other in logs)
    turned = any(other.plan and other.plan.roles.rotation for other in logs)
    written = any(other.options.source and not other.foreign for other in logs)
    no_time = {"time": None} if timed else {}
    no_form = {"rotation": None} if turned and log.plan and not log.plan.roles.rotation else {}
    no_source = {"source": None} if written and log.foreign else {}
    return {**lost, **no_time, **no_form, **no_source}


def _nowhere(named: _Named, logs: Sequence[_Fitted]) -> Finding:
    """Say that an option names columns that no log has."""
    columns = "; ".join(f"{listed(log.columns)} of {log.file}" for log in logs)
    said = ", ".join(repr(text) for text in named.columns)
    return Finding(f"{named.option}: found no column {said} in any log, allowed: {columns}")
