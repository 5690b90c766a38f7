"""The columns of a log as in its file: names, units, rows, the numbers and the clock.

The log holds SI values; `to_file_values` converts them back to the numbers of the file, bit by bit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, RecordingError
from urmpipe_pipeline.joint_log import JointLog, LogColumn, LogWarning, Role
from urmpipe_pipeline.presentation.exports import DATE, DAY, TIME_OF_DAY, ExportColumn, ExportTable, Times
from urmpipe_pipeline.sources.checks import REBUILT
from urmpipe_pipeline.sources.clocks.text_times import ZONED
from urmpipe_pipeline.sources.vocabulary import split_unit, vocabulary
from urmpipe_pipeline.text import encodable

DIGITS = 15
"""A decimal number of so many digits is told apart from every other one by its double."""

EXACT_POWER = 22
"""Powers of ten up to this one are doubles without rounding."""

NEIGHBOURS = 2
"""The quotient is at most so many doubles away from the number that was multiplied: each of the two
roundings moves it by half a unit in the last place of a number that may be twice as coarse."""


def to_si(numbers: FloatArray, column: LogColumn) -> FloatArray:
    """Return factor (sign value + offset) as the reader computes it, in SI, shape (n,).

    Values are in the unit of the column, shape (n,).
    """
    values = numbers if column.sign == 1 else -numbers
    values = values + column.offset if column.offset else values
    return values if column.factor == 1.0 else values * column.factor


def to_file_values(values: FloatArray, column: LogColumn) -> FloatArray:
    """Return the numbers of a column as the file has them, in its unit, shape (n,); NaN stays.

    Of the doubles whose conversion gives the value in SI, shape (n,), bit by bit, the one with the shortest
    decimal text is taken: of a file with up to 15 digits that is its own number, else one next to it at most.
    Where an offset leaves no such double in reach, it is the nearest to the inverse.
    """
    if column.factor == 1.0 and not column.offset:
        return values if column.sign == 1 else -values
    near = values / column.factor - column.offset
    near = near if column.sign == 1 else -near
    numbers = _rounded(near, np.maximum(np.abs(near), abs(column.offset)))
    off = np.flatnonzero((to_si(numbers, column) != values) & ~np.isnan(values))
    numbers[off] = _shortest(near[off], values[off], column)
    return numbers


def _rounded(numbers: FloatArray, size: FloatArray) -> FloatArray:
    """Round to 15 significant digits of a size, so far as powers of ten are exact.

    Of 1e15 and more these stand before the point: there the double next to one of them is an integer, too.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        power = np.nan_to_num(DIGITS - 1 - np.floor(np.log10(size)), nan=0.0, posinf=0.0, neginf=0.0)
    scale, tens = (10.0 ** np.clip(one, 0, EXACT_POWER) for one in (power, -power))
    with np.errstate(over="ignore"):
        return np.where(numbers == 0.0, numbers, np.rint(numbers * scale / tens) * tens / scale)


def _shortest(near: FloatArray, values: FloatArray, column: LogColumn) -> FloatArray:
    """Return of each number and its neighbours the shortest that converts to the value, or the number."""
    best, shortest = near.copy(), np.where(to_si(near, column) == values, _lengths(near), np.inf)
    for towards in (np.inf, -np.inf):
        candidate = near
        for _ in range(NEIGHBOURS):
            candidate = np.nextafter(candidate, towards)
            kept = np.flatnonzero(to_si(candidate, column) == values)
            length = _lengths(candidate[kept])
            better = length < shortest[kept]
            best[kept[better]], shortest[kept[better]] = candidate[kept][better], length[better]
    return best


def _lengths(numbers: FloatArray) -> FloatArray:
    """Return the length of the shortest decimal text of each number."""
    import pyarrow as pa
    import pyarrow.compute as pc

    text = pa.array(numbers).cast(pa.string())
    return np.asarray(pc.binary_length(text).to_numpy(zero_copy_only=False), dtype=np.float64)


ATTRIBUTES: dict[Role, str] = {
    "joint": "q",
    "rate": "qd",
    "acceleration": "qdd",
    "position": "tcp_position",
    "rotation": "tcp_rotation",
}
"""Where a `JointLog` keeps the columns of a role."""


def file_table(log: JointLog) -> ExportTable:
    """Return the columns of the file that were used: its names, its units, its rows, its numbers.

    Nothing is repolarized or resampled; times are those of the file's clock.

    Raises:
        RecordingError: If the log came from no file.
    """
    if not log.columns:
        hint = Hint("rows", "grid", "writes what was made of it")
        said = "the log was not read from a file"
        raise RecordingError(Finding(said, about=log.name, hints=(hint,)))
    kept = _kept_columns(log)
    names = _names(kept)
    clock_ns = log.clock_start_ns + log.t_ns
    timed = [column.unit for column in kept if column.role == "time"]
    clock = iter(shares(_as_told(log, clock_ns, timed), timed))
    columns = [
        ExportColumn(name, column.unit, next(clock) if column.role == "time" else _numbers(log, column))
        for name, column in zip(names, kept, strict=True)
    ]
    lost, unsaid = tuple(_lost(log, kept)), tuple(_unsaid_units(kept))
    return ExportTable(tuple(columns), clock_ns if timed else None, lost, unsaid)


def file_roles(log: JointLog) -> dict[str, tuple[Role, int]]:
    """Return what each column of `file_table` holds, and its place among those of this role, by its name."""
    kept = _kept_columns(log)
    return {name: (column.role, column.index) for name, column in zip(_names(kept), kept, strict=True)}


def _kept_columns(log: JointLog) -> list[LogColumn]:
    """Return the columns of the file whose values the log holds, in its order."""
    return sorted((c for c in log.columns if _kept(log, c)), key=lambda column: column.number)


def _as_told(log: JointLog, clock_ns: IntArray, timed: Sequence[str]) -> IntArray:
    """Return the clock as its columns tell it: a time of day that passed midnight began anew there."""
    began_anew = any(inference.kind == "nights passed" for inference in log.inferences)
    return clock_ns % DAY if began_anew and timed == [TIME_OF_DAY] else clock_ns


def _kept(log: JointLog, column: LogColumn) -> bool:
    """Tell whether the log holds the values of a column: a recorded group with an empty column is dropped."""
    return column.role == "time" or getattr(log, ATTRIBUTES[column.role]) is not None


def _numbers(log: JointLog, column: LogColumn) -> FloatArray:
    values: FloatArray = getattr(log, ATTRIBUTES[column.role])
    return to_file_values(np.ascontiguousarray(values[:, column.index]), column)


def _names(columns: Sequence[LogColumn]) -> list[str]:
    """Return the headers as the file has them; where it has none, or several files share one, other names."""
    count = Counter(column.header for column in columns)
    return [
        column.header if column.header and count[column.header] == 1 else _own_name(column)
        for column in columns
    ]


def _own_name(column: LogColumn) -> str:
    """Return our name of a column with its unit; without a header a clock has only its place for a name."""
    name = "t" if column.role == "time" and not column.header else encodable(column.name)
    return f"{name} [{column.unit}]"


def _lost(log: JointLog, kept: Sequence[LogColumn]) -> Iterator[LogWarning]:
    """Yield what of the file is not in the recording."""
    empty = [column.name for column in log.columns if column not in kept]
    if empty:
        said = f"{', '.join(empty)}: not ingested, since a column of them was empty"
        yield LogWarning("not-exported", said)
    for inference in log.inferences:
        if inference.kind == "columns not used":
            said = f"{inference.value}: not ingested ({inference.evidence}), so they cannot be exported"
            yield LogWarning("not-exported", said)
    for warning in log.warnings:
        if warning.kind == REBUILT:
            said = f"the file's own times, which were not kept: {warning.message}"
            yield LogWarning("not-exported", said, warning.row)
        elif warning.kind in ("skipped-row", "end-rows", "other-lines"):
            yield LogWarning("not-exported", warning.message, warning.row)
    form = next((one for one in log.inferences if one.kind == ZONED), None)
    if form and any(one.unit == DATE for one in kept):
        yield LogWarning("clock-in-utc", f"{form.value} with a time zone: the dates are exported in UTC")


def _unsaid_units(columns: Sequence[LogColumn]) -> list[LogWarning]:
    """Return a warning for each unit that is not of SI and that the names of its columns do not tell."""
    unsaid: dict[str, list[str]] = {}
    for column in columns:
        told = not column.header or vocabulary().unit(split_unit(column.header)[1] or "")
        if column.role != "time" and column.factor != 1.0 and not told:
            unsaid.setdefault(column.unit, []).append(column.name)
    return [
        LogWarning("unit-not-in-name", f"{', '.join(names)}: in {unit}, which their names do not give")
        for unit, names in unsaid.items()
    ]


def shares(clock_ns: IntArray, units: Sequence[str]) -> list[Times]:
    """Return what each column of a clock in integer [ns], shape (n,), holds: all or, of two, its share.

    Two columns are seconds and nanoseconds, or date and time of day.
    """
    steps = {"s": 10**9, DATE: DAY} if len(units) > 1 else {}
    coarse = next((steps[unit] for unit in units if unit in steps), None)
    if coarse is None:
        return [Times(clock_ns, unit) for unit in units]
    rest = clock_ns % coarse
    return [Times(clock_ns - rest if unit in steps else rest, unit) for unit in units]
