"""The columns of a log as in its file: names, units, rows, the numbers and the clock.

- `file_table`: the table, with warnings about the parts of the file that are lost.
- `to_file_values`: the numbers of the file from the SI values of the log, bit for bit.
- `split_clock`: the columns of a clock in two columns.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, RecordingError
from urmpipe_pipeline.joint_log import JointLog, LogColumn, LogWarning, Role
from urmpipe_pipeline.logs.timestamps import REBUILT, ZONED
from urmpipe_pipeline.logs.vocabulary import split_unit, vocabulary
from urmpipe_pipeline.presentation.exports import DATE, DAY, TIME_OF_DAY, ExportColumn, ExportTable, Times
from urmpipe_pipeline.text import drop_surrogates

MAX_DIGITS = 15  # decimal numbers with up to 15 digits have different doubles
MAX_EXACT_POWER = 22  # larger powers of ten are rounded
MAX_NEIGHBOUR = (
    2  # doubles from the quotient to the original number: product and quotient are each rounded by
)
# half a unit in the last place of a number that may be twice as coarse

_ATTRIBUTES: dict[Role, str] = {  # of a `JointLog`, by role
    "joint": "q",
    "rate": "qd",
    "acceleration": "qdd",
    "position": "tcp_position",
    "rotation": "tcp_rotation",
}


def file_table(log: JointLog) -> ExportTable:
    """Return the used columns of the file, with its names, units, rows and numbers.

    Nothing is repolarized or resampled; times are those of the clock of the file.

    Raises:
        RecordingError: If the log was not read from a file.
    """
    if not log.columns:
        hint = Hint("rows", "grid", "writes what was made of it")
        message = "the log was not read from a file"
        raise RecordingError(Finding(message, about=log.name, hints=(hint,)))
    columns = _exported_columns(log)
    clock_ns = log.clock_start_ns + log.t_ns
    time_units = [column.unit for column in columns if column.role == "time"]
    shown_ns = clock_ns
    if time_units == [TIME_OF_DAY] and any(inference.kind == "nights passed" for inference in log.inferences):
        shown_ns = clock_ns % DAY
    times = iter(split_clock(shown_ns, time_units))
    exported = []
    for name, column in zip(_column_names(columns), columns, strict=True):
        if column.role == "time":
            exported.append(ExportColumn(name, column.unit, next(times)))
        else:
            values = np.ascontiguousarray(getattr(log, _ATTRIBUTES[column.role])[:, column.index])
            exported.append(ExportColumn(name, column.unit, to_file_values(values, column)))
    lost, units = tuple(_lost_warnings(log, columns)), tuple(_unit_warnings(columns))
    return ExportTable(tuple(exported), clock_ns if time_units else None, lost, units)


def file_roles(log: JointLog) -> dict[str, tuple[Role, int]]:
    """Return the role of each column of `file_table` and its index among those of this role, by name."""
    columns = _exported_columns(log)
    names = _column_names(columns)
    return {name: (column.role, column.index) for name, column in zip(names, columns, strict=True)}


def _exported_columns(log: JointLog) -> list[LogColumn]:
    """Return the columns whose values the log has, in the order of the file.

    A recorded group with an empty column is dropped by the reader.
    """
    columns = (
        column
        for column in log.columns
        if column.role == "time" or getattr(log, _ATTRIBUTES[column.role]) is not None
    )
    return sorted(columns, key=lambda column: column.number)


def _column_names(columns: Sequence[LogColumn]) -> list[str]:
    """Return the headers of the file; NAME [UNIT] without one, and where several columns share one."""
    count = Counter(column.header for column in columns)
    names = []
    for column in columns:
        if column.header and count[column.header] == 1:
            names.append(column.header)
        else:
            is_clock = column.role == "time" and not column.header
            names.append(f"{'t' if is_clock else drop_surrogates(column.name)} [{column.unit}]")
    return names


def _lost_warnings(log: JointLog, exported: Sequence[LogColumn]) -> Iterator[LogWarning]:
    """Yield warnings about parts of the file that are not in the recording."""
    empty = [column.name for column in log.columns if column not in exported]
    if empty:
        message = f"{', '.join(empty)}: not exported, since a column of the same quantity was empty"
        yield LogWarning("not-exported", message)
    for inference in log.inferences:
        if inference.kind == "columns not used":
            message = f"{inference.value}: not used by ingest ({inference.evidence}), so not exported"
            yield LogWarning("not-exported", message)
    for warning in log.warnings:
        if warning.kind == REBUILT:
            message = f"the file's own times, which were not kept: {warning.message}"
            yield LogWarning("not-exported", message, warning.row)
        elif warning.kind in ("skipped-row", "end-rows", "other-lines"):
            yield LogWarning("not-exported", warning.message, warning.row)
    zoned = next((inference for inference in log.inferences if inference.kind == ZONED), None)
    if zoned and any(column.unit == DATE for column in exported):
        message = f"{zoned.value} with a time zone: the dates are exported in UTC"
        yield LogWarning("clock-in-utc", message)


def _unit_warnings(columns: Sequence[LogColumn]) -> Iterator[LogWarning]:
    """Yield a warning for each unit other than SI that the names of its columns do not contain."""
    names: dict[str, list[str]] = {}
    for column in columns:
        in_name = not column.header or vocabulary().unit(split_unit(column.header)[1] or "")
        if column.role != "time" and column.factor != 1.0 and not in_name:
            names.setdefault(column.unit, []).append(column.name)
    for unit, of_unit in names.items():
        message = f"{', '.join(of_unit)}: in {unit}, which their names do not give"
        yield LogWarning("unit-not-in-name", message)


def split_clock(clock_ns: IntArray, units: Sequence[str]) -> list[Times]:
    """Return the content of each column of a clock in integer [ns], shape (n,).

    Two columns are seconds and nanoseconds, or date and time of day.
    """
    steps = {"s": 10**9, DATE: DAY} if len(units) > 1 else {}
    coarse = next((steps[unit] for unit in units if unit in steps), None)
    if coarse is None:
        return [Times(clock_ns, unit) for unit in units]
    rest = clock_ns % coarse
    return [Times(clock_ns - rest if unit in steps else rest, unit) for unit in units]


def to_si(numbers: FloatArray, column: LogColumn) -> FloatArray:
    """Return factor (sign value + offset) as the reader computes it, in SI, shape (n,).

    Values are in the unit of the column, shape (n,).
    """
    values = numbers if column.sign == 1 else -numbers
    values = values + column.offset if column.offset else values
    return values if column.factor == 1.0 else values * column.factor


def to_file_values(values: FloatArray, column: LogColumn) -> FloatArray:
    """Return the numbers of a column in its unit, shape (n,); NaN stays.

    Of the doubles whose conversion gives the value in SI, shape (n,), bit for bit, it is the one with the
    shortest decimal text. Numbers with up to 15 digits come back exactly, others within one unit in the last
    place. If an offset leaves no such double in reach, it is the nearest to the inverse.
    """
    if column.factor == 1.0 and not column.offset:
        return values if column.sign == 1 else -values
    near = values / column.factor - column.offset
    near = near if column.sign == 1 else -near
    numbers = _round_digits(near, np.maximum(np.abs(near), abs(column.offset)))
    differs = np.flatnonzero((to_si(numbers, column) != values) & ~np.isnan(values))
    numbers[differs] = _find_shortest(near[differs], values[differs], column)
    return numbers


def _round_digits(numbers: FloatArray, size: FloatArray) -> FloatArray:
    """Round to 15 significant digits of a size, as long as powers of ten are exact.

    From 1e15 on, these digits are before the decimal point, where each double is an integer.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        power = np.nan_to_num(MAX_DIGITS - 1 - np.floor(np.log10(size)), nan=0.0, posinf=0.0, neginf=0.0)
    scale, tens = (10.0 ** np.clip(exponent, 0, MAX_EXACT_POWER) for exponent in (power, -power))
    with np.errstate(over="ignore"):
        return np.where(numbers == 0.0, numbers, np.rint(numbers * scale / tens) * tens / scale)


def _find_shortest(near: FloatArray, values: FloatArray, column: LogColumn) -> FloatArray:
    """Return the number with the shortest text that converts to the value, or the number itself."""
    best, shortest = near.copy(), np.where(to_si(near, column) == values, _text_lengths(near), np.inf)
    for direction in (np.inf, -np.inf):
        candidate = near
        for _ in range(MAX_NEIGHBOUR):
            candidate = np.nextafter(candidate, direction)
            converts = np.flatnonzero(to_si(candidate, column) == values)
            length = _text_lengths(candidate[converts])
            better = length < shortest[converts]
            best[converts[better]] = candidate[converts][better]
            shortest[converts[better]] = length[better]
    return best


def _text_lengths(numbers: FloatArray) -> FloatArray:
    import pyarrow as pa
    import pyarrow.compute as pc

    text = pa.array(numbers).cast(pa.string())
    return np.asarray(pc.binary_length(text).to_numpy(zero_copy_only=False), dtype=np.float64)
