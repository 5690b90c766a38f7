"""Logs as tables for units: the file's own rows in SI, over the time from its first row.

1. Tables: the motion of a log as the variables q, s, their rates and p; or columns by name.
2. Maps: where only a map states how to read a log, hints name the map instead of options.
3. Held logs: joint values may wrap, so they are not interpolated: at a communication point between two
   samples the previous sample is held, against a reference that has moved on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from urmpipe.public_functions import PathLike
from urmpipe.reading import resolve_reading
from urmpipe_fmus.block import Table
from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.log_map import READING
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.runs.grid import REGULAR

NOT_IN_MAP = ("derivative", "tsp")  # options of logs that are no entries of a map


class Quantity(NamedTuple):
    """Columns of a table that are one variable.

    Attributes:
        name: The variable.
        unit: Its unit; SI, spelled as FMI does.
        size: Its number of columns; None for a variable that is no array.
    """

    name: str
    unit: str
    size: int | None = None


class LogTable(NamedTuple):
    """A log as a table for units.

    Attributes:
        table: Its rows.
        columns: The variables of the columns, from the left.
        files: Its files.
        warnings: The warnings of reading it.
    """

    table: Table
    columns: tuple[Quantity, ...]
    files: tuple[Path, ...]
    warnings: tuple[LogWarning, ...]


def read_table(
    log: PathLike,
    names: Sequence[str] | None = None,
    *,
    robot: Chain | None = None,
    read: LogMap | None = None,
) -> LogTable:
    """Return a log as a table: its motion, or some columns by name.

    The variables of its motion are q, the angles of revolute joints, and s, the positions of prismatic ones;
    qd, qdd, sd and sdd, their recorded rates; and p, a path or the recorded tool centre point. A column by
    name, such as a voltage, is a separate variable.

    Args:
        log: A log or path (CSV), or a folder whose CSV files make one log.
        names: Columns by name or number, of any table; default: the motion.
        robot: The robot: it states how many joints there are, their names, and which of them are prismatic.
        read: How to read the file where it does not show it.

    Raises:
        LogError: With all faults of the files, or if a row lacks a value.
    """
    if names is not None:
        from urmpipe_pipeline.logs.read import read_series

        series = read_series(Path(log), names, read)
        units = (unit or "" for unit in series.units)
        columns = tuple(Quantity(*column) for column in zip(series.names, units, strict=True))
        warnings = tuple(warning.of(Path(log).stem) for warning in series.warnings)
        return LogTable(Table(series.t_ns, series.values), columns, (Path(log),), warnings)
    files = log_files(Path(log))
    motion = read_log(files, read, robot)
    if not motion.timed:
        hint = Hint("period", None, "reads the rows as a motion")
        raise LogError(
            Finding("found static poses, allowed: a motion with times", str(files[0]), hints=(hint,))
        )
    quantities = list(_iter_quantities(motion))
    _check_complete(str(files[0]), quantities)
    table = Table(motion.t_ns, np.column_stack([values for _, _, values in quantities]))
    columns = tuple(Quantity(name, unit, values.shape[1]) for name, unit, values in quantities)
    return LogTable(
        table, columns, tuple(files), tuple(warning.of(motion.name) for warning in motion.warnings)
    )


def _iter_quantities(log: JointLog) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield name, unit and values of each variable of a log."""
    revolute = np.array([unit == "rad" for unit in log.joint_units], dtype=np.bool_)
    recorded = (("", "", log.q if log.joints else None), ("d", "/s", log.qd), ("dd", "/s2", log.qdd))
    for suffix, per_time, values in recorded:
        for name, unit, selected in (("q", "rad", revolute), ("s", "m", ~revolute)):
            if values is not None and selected.any():
                yield f"{name}{suffix}", f"{unit}{per_time}", values[:, selected]
    if log.tcp_position is not None:
        yield "p", "m", log.tcp_position


def _check_complete(file: str, quantities: Sequence[tuple[str, str, FloatArray]]) -> None:
    findings = []
    for name, _, values in quantities:
        rows, columns = np.nonzero(~np.isfinite(values))
        if len(rows):
            count = format_count(len(np.unique(rows)), "row")
            message = f"found {count} without a value, allowed: one in every row"
            findings.append(Finding(message, file, row=int(rows[0]) + 1, column=f"{name}[{columns[0] + 1}]"))
    if findings:
        raise LogError(*findings)


def read_mapped_table(
    log: PathLike,
    names: Sequence[str] | None = None,
    *,
    robot: Chain | None = None,
    log_map: PathLike | LogMap | None = None,
) -> LogTable:
    """Return a log as a table, as `read_table` does, where only a map states how to read it.

    Raises:
        UrmpipeError: With all faults of the map or the files; hints name the map.
    """
    try:
        table = read_table(log, names, robot=robot, read=resolve_reading({"map": log_map}).options)
    except LogError as error:
        findings = (replace(finding, hints=tuple(_name_map(finding.hints))) for finding in error.findings)
        raise LogError(*findings) from error
    warnings = (replace(warning, hints=tuple(_name_map(warning.hints))) for warning in table.warnings)
    return table._replace(warnings=tuple(warnings))


def _name_map(hints: Sequence[Hint]) -> Iterator[Hint]:
    """Yield hints with a map in place of options that it states, and without those that it cannot state."""
    for hint in hints:
        if not hint.call and hint.parameter in READING:
            source = f"from urmpipe ingest {hint} {Hint('write_map')}"
            yield Hint("map", None, f"{source} {hint.effect}".strip())
        elif hint.call or hint.parameter not in NOT_IN_MAP:
            yield hint


def snap_to_points(t_ns: IntArray, step: float) -> IntArray:
    """Return times in which those near a communication point are exactly its time, without rounding errors.

    Args:
        t_ns: Times in integer [ns], strictly increasing, shape (n,).
        step: Communication step in [s].

    Returns:
        The times in integer [ns], shape (n,).
    """
    if len(t_ns) < 2:
        return t_ns
    points = _point_times(np.rint(t_ns / (step * 1e9)), step)
    return np.where(np.abs(points - t_ns) <= REGULAR * np.diff(t_ns).min(), points, t_ns)


def hold_warning(block: str, t_ns: IntArray, step: float, count: int) -> LogWarning | None:
    """Return a warning about communication points between two samples of a log; None if there are none.

    Args:
        block: The block that plays the log.
        t_ns: Times of its samples in integer [ns], strictly increasing, shape (n,).
        step: Communication step in [s].
        count: Number of steps.
    """
    points = _point_times(np.arange(count + 1), step)
    points = points[(points >= t_ns[0]) & (points <= t_ns[-1])]
    delay = points - t_ns[np.searchsorted(t_ns, points, side="right") - 1]
    if not np.any(delay):
        return None
    share = f"{np.count_nonzero(delay)} of {len(points)}"
    hold = f"where the previous sample is held for at most {delay.max() / 1e6:.4g} ms"
    message = f"block {block}: {share} communication points lie between samples of the log, {hold}"
    return LogWarning("held", f"{message}: deviations there are not those of the log")


def _point_times(k: FloatArray | IntArray, step: float) -> IntArray:
    """Return the times of communication points in integer [ns], rounded as in a table."""
    return np.rint(k * step * 1e9).astype(np.int64)
