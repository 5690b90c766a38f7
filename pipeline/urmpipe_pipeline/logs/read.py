"""One log from its files.

Any columns of a table over its time: what drives a model that is no arm, such as a voltage.
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
from urmpipe_pipeline.logs.columns import Column, columns_of, find_column, given_units, lacks_columns
from urmpipe_pipeline.logs.convert import Content, assemble, read_content, recorded
from urmpipe_pipeline.logs.formats.files import unchanged
from urmpipe_pipeline.logs.formats.memory import MemoryTable, fingerprint_of
from urmpipe_pipeline.logs.formats.opening import Tables, open_tables
from urmpipe_pipeline.logs.formats.own import roles_of
from urmpipe_pipeline.logs.formats.parquet import episode_file, is_data_set
from urmpipe_pipeline.logs.formats.text import fingerprint
from urmpipe_pipeline.logs.log_map import READING, LogMap
from urmpipe_pipeline.logs.map_file import shown_entries
from urmpipe_pipeline.logs.plan import Plan, make_plan, plan_topic
from urmpipe_pipeline.logs.pose_columns import find_pose
from urmpipe_pipeline.logs.proofs import Recorded
from urmpipe_pipeline.logs.roles import Roles
from urmpipe_pipeline.logs.vocabulary import Unit, key, split_unit, vocabulary


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """The numbers of a log as its files have them, before their units are known."""

    plan: Plan
    content: Content
    options: LogMap
    name: str
    files: tuple[SourceFile, ...]

    @property
    def recorded(self) -> Recorded:
        """Joints and recorded positions in the file's own units, which tell the arm."""
        return recorded(self.plan, self.content, self.options)

    def log(self, robot: Chain | None) -> JointLog:
        """Return the log in SI, once: the numbers become those of the log.

        Args:
            robot: The arm: it tells which joints slide, and by its kinematics the units.

        Raises:
            LogError: If a column has no value, or its unit cannot be told.
            OptionError: If an option does not fit the log.
        """
        return assemble(self.plan, self.content, self.options, robot, self.name, self.files)


def read_numbers(
    files: Sequence[Path | MemoryTable], options: LogMap | None = None, robot: Chain | None = None
) -> Reading:
    """Return the numbers of a log; arguments and errors are those of `read_log`."""
    options = options or LogMap()
    files = [
        episode_file(file, options.episode) if isinstance(file, Path) and is_data_set(file) else file
        for file in files
    ]
    named = split_file_column(options.time)
    used = [*files, named[0]] if named else files
    with unchanged(used), ThreadPoolExecutor(max_workers=1) as beside:
        tables = open_tables(files, options)
        given = _with_own_clock(tables, options)
        options = _without_foreign(tables, given)
        hashed = [beside.submit(_fingerprint, file) for file in used]
        try:
            plan = plan_topic(tables, options, robot)
        except LogError:
            if options != given:
                make_plan(tables, given, robot)  # its error states the columns that are not there
            raise
        content = read_content(plan, skip_bad=options.skip_bad)
        return Reading(plan, content, options, _name(files), tuple(future.result() for future in hashed))


def open_map(files: Sequence[Path | MemoryTable], given: LogMap, error: LogError) -> LogMap:
    """Return the map of a log that cannot be read yet: what is given, what its files show, and the questions.

    Args:
        files: The files.
        given: The map with which they were read.
        error: Why they cannot be read; findings with hints about entries of the map are questions.
    """
    asked = tuple(one for one in error.findings if any(hint.parameter in READING for hint in one.hints))
    try:
        tables = open_tables(files, given)
    except LogError:
        return replace(given, questions=asked)
    found = [*tables.inferences, *(one for layout in tables.layouts for one in layout.inferences)]
    return replace(given, **shown_entries(found), questions=asked)


def read_log(
    files: Sequence[Path | MemoryTable], options: LogMap | None = None, robot: Chain | None = None
) -> JointLog:
    """Return a log as its files have it, in SI.

    Args:
        files: The log's file, or a table in memory; several if its source writes one a plot (SolidWorks),
            joined on their times.
        options: What the user says where the files need not, or cannot, tell.
        robot: The arm: it tells how many joints there are, their names, and which of them slide.

    Raises:
        LogError: With everything that is wrong with the files, each with its file, line and column.
        OptionError: If an option's value makes no sense.
    """
    return read_numbers(files, options, robot).log(robot)


def _with_own_clock(tables: Tables, options: LogMap) -> LogMap:
    """Return the options with the clock of a file of ours that is not called like one."""
    times = [k for k, role in roles_of(tables.layouts[0]).items() if role == "time"]
    if options.time is not None or len(tables.layouts) != 1 or len(times) != 1:
        return options
    name = key(split_unit(tables.layouts[0].names[times[0]])[0])
    called = any(pattern.search(name) for pattern in vocabulary().time)
    return options if called else replace(options, time=str(times[0] + 1))


def _without_foreign(tables: Tables, options: LogMap) -> LogMap:
    """Return options for several logs without the columns that this one lacks: they are those of another.

    Columns by number that are x, y, z by their names are no joints and no time, either.
    """
    if not options.shared:
        return options
    columns = columns_of(tables.layouts, tables.titles)
    numeric = [column for column in columns if not column.text]
    named = tables.layouts[0].header is not None
    position = {str(one.number) for one in find_pose(numeric, tables.layouts).position} if named else set()

    def is_foreign(texts: Sequence[str]) -> bool:
        return lacks_columns(columns, texts) or bool(position & {*texts})

    fields = ("joints", "position", "orientation", "measured")
    foreign = [name for name in fields if getattr(options, name) and is_foreign(getattr(options, name))]
    foreign += ["names", "signs", "offsets"] if "joints" in foreign else []
    time = options.time
    if time not in (None, "none") and not split_file_column(time) and is_foreign([time]):
        options = replace(options, time=None)
    changes: dict[str, Any] = dict.fromkeys(foreign, ())
    return replace(options, **changes)


def _fingerprint(file: Path | MemoryTable) -> SourceFile:
    return fingerprint_of(file) if isinstance(file, MemoryTable) else fingerprint(file)


def _name(files: Sequence[Path | MemoryTable]) -> str:
    """Return the stem of the only file, or what the stems of several share at their beginning."""
    stems = [file.name if isinstance(file, MemoryTable) else log_stem(file) for file in files]
    shared = os.path.commonprefix(stems)  # noqa: RUF071 (stems, not paths)
    return stems[0] if len(stems) == 1 else shared.strip(" _-.,()[]#") or stems[0]


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
