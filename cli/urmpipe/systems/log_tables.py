"""Logs as tables for units: the file's own rows in SI over the time from its first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from urmpipe.keyword_checks import PathLike
from urmpipe.log_table import LogTable, Quantity
from urmpipe.reading import resolved
from urmpipe_fmus.block import Table
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.sources import LogMap, ReadOptions, read_log
from urmpipe_pipeline.text import counted

IN_MAP = (  # options of reading that a map states
    *(
        "decimal",
        "delimiter",
        "interval",
        "joints",
        "layout",
        "period",
        "poses",
        "rotation",
        "source",
        "time",
    ),
    "unit",
)
NOT_IN_MAP = ("derivative", "repair", "skip_bad", "tsp")  # the others


def read_table(
    log: PathLike,
    names: Sequence[str] | None = None,
    *,
    robot: Chain | None = None,
    read: ReadOptions | None = None,
) -> LogTable:
    """Return a log as a table: its motion, or some columns by name.

    The variables of its motion are q, the angles of the joints that turn, and s, the ways of those that
    slide; qd, qdd, sd and sdd, what was recorded of their rates; and p, a path or the recorded tool centre
    point. A column by name, such as a voltage, is a variable of its own.

    Args:
        log: A log or path (CSV), or a folder whose CSV files make one log.
        names: Columns by name or number, of any table; default: the motion.
        robot: The arm: it tells how many joints there are, their names, and which of them slide.
        read: How to read the file where it cannot tell by itself.

    Raises:
        LogError: With everything that is wrong with the files, or if a row lacks a value.
    """
    return _motion(Path(log), robot, read) if names is None else _columns(Path(log), names, read)


def read_mapped_table(
    log: PathLike,
    names: Sequence[str] | None = None,
    *,
    robot: Chain | None = None,
    log_map: PathLike | LogMap | None = None,
) -> LogTable:
    """Return a log as a table, as `read_table` does, where a map alone says how to read it.

    Raises:
        UrmpipeError: With everything that is wrong with the map or the files; hints name the map.
    """
    try:
        table = read_table(log, names, robot=robot, read=resolved({"log_map": log_map}).options)
    except LogError as error:
        findings = (replace(finding, hints=tuple(_name_map(finding.hints))) for finding in error.findings)
        raise LogError(*findings) from error
    warnings = (replace(warning, hints=tuple(_name_map(warning.hints))) for warning in table.warnings)
    return table._replace(warnings=tuple(warnings))


def _name_map(hints: Sequence[Hint]) -> Iterator[Hint]:
    """Yield hints with a map in place of options that it states, and without those that it cannot state."""
    for hint in hints:
        if not hint.call and hint.parameter in IN_MAP:
            writes = f"from urmpipe ingest {hint} {Hint('write_map')}"
            yield Hint("log_map", None, f"{writes} {hint.does}".strip())
        elif hint.call or hint.parameter not in NOT_IN_MAP:
            yield hint


def _motion(path: Path, robot: Chain | None, read: ReadOptions | None) -> LogTable:
    """Return the motion that a log holds."""
    files = log_files(path)
    log = read_log(files, read, robot)
    if not log.timed:
        said = "found still poses, allowed: a motion with times"
        hint = Hint("period", None, "reads the rows as a motion")
        raise LogError(Finding(said, str(files[0]), hints=(hint,)))
    parts = list(_parts(log))
    _refuse_missing(str(files[0]), parts)
    columns = tuple(Quantity(name, unit, values.shape[1]) for name, unit, values in parts)
    table = Table(log.t_ns, np.column_stack([values for _, _, values in parts]))
    return LogTable(table, columns, tuple(files), tuple(one.of(log.name) for one in log.warnings))


def _columns(path: Path, names: Sequence[str], read: ReadOptions | None) -> LogTable:
    """Return columns of a table by name."""
    from urmpipe_pipeline.sources.series import read_series

    found = read_series(path, names, read)
    columns = tuple(Quantity(name, unit or "") for name, unit in zip(found.names, found.units, strict=True))
    warnings = tuple(one.of(path.stem) for one in found.warnings)
    return LogTable(Table(found.t_ns, found.values), columns, (path,), warnings)


def _parts(log: JointLog) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield name, unit and values of each variable of a log."""
    turns = np.array([unit == "rad" for unit in log.joint_units], dtype=np.bool_)
    recorded = {"": log.q if log.joints else None, "d": log.qd, "dd": log.qdd}
    per = {"": "", "d": "/s", "dd": "/s2"}
    for suffix, values in recorded.items():
        for name, unit, mine in (("q", "rad", turns), ("s", "m", ~turns)):
            if values is not None and mine.any():
                yield f"{name}{suffix}", f"{unit}{per[suffix]}", values[:, mine]
    if log.tcp_position is not None:
        yield "p", "m", log.tcp_position


def _refuse_missing(file: str, parts: Sequence[tuple[str, str, FloatArray]]) -> None:
    """Raise a `LogError` with each variable that has a row without a value."""
    findings = []
    for name, _, values in parts:
        rows, places = np.nonzero(~np.isfinite(values))
        if len(rows):
            said = f"found {counted(len(np.unique(rows)), 'row')} without a value, allowed: one in every row"
            findings.append(Finding(said, file, row=int(rows[0]) + 1, column=f"{name}[{places[0] + 1}]"))
    if findings:
        raise LogError(*findings)
