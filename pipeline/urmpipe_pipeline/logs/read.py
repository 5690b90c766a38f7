"""Logs of joints, and any columns over time, from their files.

1. `read_numbers`: files -> tables -> plan (columns and clock) -> rows, in the file's own units.
2. `read_log`: the same in SI. `open_map`: the map of a log that cannot be read before a question is answered.
3. `read_series`: any columns of a table over its time, such as the voltage of a drive.
"""

from __future__ import annotations

import os.path
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError, map_collecting_errors
from urmpipe_models.files import log_stem
from urmpipe_pipeline.joint_log import JointLog, LogWarning, SourceFile
from urmpipe_pipeline.logs.clock import even_clock, find_clocks, split_file_column
from urmpipe_pipeline.logs.clock_columns import is_named_time
from urmpipe_pipeline.logs.columns import Column, columns_of, find_column, given_units, lacks_columns
from urmpipe_pipeline.logs.convert import Reading
from urmpipe_pipeline.logs.formats.files import unchanged
from urmpipe_pipeline.logs.formats.memory import MemoryTable, fingerprint_of
from urmpipe_pipeline.logs.formats.opening import Tables, open_tables
from urmpipe_pipeline.logs.formats.parquet import episode_file, is_data_set
from urmpipe_pipeline.logs.formats.text import fingerprint
from urmpipe_pipeline.logs.formats.urmpipe_tables import read_roles
from urmpipe_pipeline.logs.log_map import READING, LogMap
from urmpipe_pipeline.logs.map_file import file_entries
from urmpipe_pipeline.logs.plan import Plan, make_plan, plan_topic
from urmpipe_pipeline.logs.pose_columns import find_pose
from urmpipe_pipeline.logs.roles import Roles
from urmpipe_pipeline.logs.rows import read_rows
from urmpipe_pipeline.logs.vocabulary import Unit, key, split_unit


def read_log(
    files: Sequence[Path | MemoryTable], options: LogMap | None = None, robot: Chain | None = None
) -> JointLog:
    """Return a log as its files have it, in SI.

    Args:
        files: The log's file, or a table in memory; several if its source writes one a plot (SolidWorks),
            joined on their times.
        options: What the user states where the files do not.
        robot: The arm: it determines how many joints there are, their names, and which of them slide.

    Raises:
        LogError: With everything that is wrong with the files, each with its file, line and column.
        OptionError: If an option's value makes no sense.
    """
    return read_numbers(files, options, robot).log(robot)


def read_numbers(
    files: Sequence[Path | MemoryTable], options: LogMap | None = None, robot: Chain | None = None
) -> Reading:
    """Return the rows of a log in the file's own units; arguments and errors are those of `read_log`."""
    options = options or LogMap()
    files = [
        episode_file(file, options.episode) if isinstance(file, Path) and is_data_set(file) else file
        for file in files
    ]
    time_file = split_file_column(options.time)
    inputs = [*files, time_file[0]] if time_file else files
    with unchanged(inputs), ThreadPoolExecutor(max_workers=1) as pool:
        tables = open_tables(files, options)
        stated = _with_own_clock(tables, options)
        options = _without_foreign_columns(tables, stated)
        hashes = [pool.submit(_fingerprint, file) for file in inputs]
        try:
            plan = plan_topic(tables, options, robot)
        except LogError:
            if options != stated:
                make_plan(tables, stated, robot)  # its error states the columns that are not there
            raise
        rows = read_rows(plan, skip_bad=options.skip_bad)
        return Reading(plan, rows, options, _log_name(files), tuple(future.result() for future in hashes))


def open_map(files: Sequence[Path | MemoryTable], options: LogMap, error: LogError) -> LogMap:
    """Return the map of a log that cannot be read yet: the options, what its files show, and the questions.

    Args:
        files: The files.
        options: The map with which they were read.
        error: Why they cannot be read; findings with hints about entries of the map are questions.
    """
    questions = tuple(
        finding for finding in error.findings if any(hint.parameter in READING for hint in finding.hints)
    )
    try:
        tables = open_tables(files, options)
    except LogError:
        return replace(options, questions=questions)
    inferences = [*tables.inferences, *(each for table in tables.tables for each in table.inferences)]
    return replace(options, **file_entries(inferences), questions=questions)


def _with_own_clock(tables: Tables, options: LogMap) -> LogMap:
    """Return the options with the clock of a file that urmpipe wrote under another name."""
    times = [k for k, role in read_roles(tables.tables[0]).items() if role == "time"]
    if options.time is not None or len(tables.tables) != 1 or len(times) != 1:
        return options
    name = key(split_unit(tables.tables[0].names[times[0]])[0])
    return options if is_named_time(name) else replace(options, time=str(times[0] + 1))


def _without_foreign_columns(tables: Tables, options: LogMap) -> LogMap:
    """Return options for several logs without the columns that this one lacks: they are those of another.

    Columns by number that are x, y, z by their names are no joints and no time, either.
    """
    if not options.shared:
        return options
    columns = columns_of(tables.tables, tables.titles)
    numeric = [column for column in columns if not column.text]
    position = find_pose(numeric, tables.tables).position if tables.tables[0].header is not None else ()
    positions = {str(column.number) for column in position}

    def is_foreign(texts: Sequence[str]) -> bool:
        return lacks_columns(columns, texts) or bool(positions & {*texts})

    fields = ("joints", "position", "orientation", "measured")
    changes: dict[str, Any] = {
        name: () for name in fields if getattr(options, name) and is_foreign(getattr(options, name))
    }
    changes |= {"names": (), "signs": (), "offsets": ()} if "joints" in changes else {}
    time = options.time
    if time not in (None, "none") and not split_file_column(time) and is_foreign([time]):
        changes["time"] = None
    return replace(options, **changes)


def _fingerprint(file: Path | MemoryTable) -> SourceFile:
    return fingerprint_of(file) if isinstance(file, MemoryTable) else fingerprint(file)


def _log_name(files: Sequence[Path | MemoryTable]) -> str:
    """Return the stem of the only file, or what the stems of several share at their beginning."""
    stems = [file.name if isinstance(file, MemoryTable) else log_stem(file) for file in files]
    prefix = os.path.commonprefix(stems)  # noqa: RUF071 (stems, not paths)
    return stems[0] if len(stems) == 1 else prefix.strip(" _-.,()[]#") or stems[0]


# Any columns over time


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
        warnings: What a user should check.
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
        options: What the user states where the file does not.

    Raises:
        LogError: If a column is not there, or with everything that is wrong with the rows.
    """
    options = options or LogMap()
    with unchanged([file]):
        tables = open_tables([file], options)
        columns = columns_of(tables.tables, tables.titles)
        selected = map_collecting_errors(lambda name: find_column(columns, name, file=str(file)), names)
        stated = given_units(columns, options)
        clocks = find_clocks(tables, columns, options, stated)
        plan = Plan(tables, clocks, Roles(joints=tuple(selected)), stated)
        rows = read_rows(plan, skip_bad=options.skip_bad)
    values = rows.values(plan.roles.joints).copy()
    _check_complete(file, selected, values)
    t_ns, warnings = None if rows.clock is None else rows.clock - rows.clock[0], list[LogWarning]()
    if t_ns is None:
        t_ns, _, warnings = even_clock(rows.count, options.period)
    units = [stated.get(column.number) or column.unit for column in selected]
    for j, unit in enumerate(units):
        values[:, j] *= unit.factor if unit else 1.0
    texts = tuple(_unit_text(column, unit) for column, unit in zip(selected, units, strict=True))
    warnings = [*rows.warnings, *plan.clock.warnings, *warnings]
    return Series(file, tuple(column.name for column in selected), t_ns, values, texts, tuple(warnings))


def _check_complete(file: Path, columns: Sequence[Column], values: FloatArray) -> None:
    """Raise a `LogError` with each column that has a row without a number."""
    findings = []
    for j, column in enumerate(columns):
        missing = np.flatnonzero(~np.isfinite(values[:, j]))
        if len(missing):
            message = f"found {format_count(len(missing), 'row')} without a number, allowed: one in every row"
            findings.append(Finding(message, str(file), row=int(missing[0]) + 1, column=column.header))
    if findings:
        raise LogError(*findings)


def _unit_text(column: Column, unit: Unit | None) -> str | None:
    """Return the unit of the values in SI, or that of the file."""
    names = {"angle": "rad", "length": "m", "time": "s"}
    if unit is None or unit.quantity not in names:
        return column.unit_text
    return names[unit.quantity] + ("", "/s", "/s2")[unit.order]
