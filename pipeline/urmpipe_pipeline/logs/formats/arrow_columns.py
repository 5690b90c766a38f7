"""Columns of an Arrow table as those of a text table: numbers, and the texts of a CSV file for all else.

Structs become a column per field, NAME.FIELD; lists a column per entry, NAME_1, NAME_2, ...

`exact_times`: times that are doubles, corrected by the exact clock next to them in urmpipe's own files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from urmpipe_models.elementwise import IntArray
from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.logs.formats.cells import Bytes, printable
from urmpipe_pipeline.logs.formats.numbers import UNIT, arrow_column, is_number
from urmpipe_pipeline.logs.formats.row_form import spread_names
from urmpipe_pipeline.logs.formats.text import MAX_TABLE_COLUMNS, check_width

EXPONENTS = {b"s": 9, b"ms": 6, b"us": 3, b"ns": 0}  # powers of ten from units of times to [ns]
USUAL_SHARE = 0.9  # of the lists of a column that have one length, where the others are damaged
DAY_NS = 86_400 * 10**9

_RESOLUTIONS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}  # [ns]

Named = tuple[pa.Field, pa.ChunkedArray]


def exact_times(table: pa.Table, clock: pa.ChunkedArray) -> pa.Table:
    """Return a table with the clock in integer [ns] in the place of its only column of times as doubles."""
    units = [(field.metadata or {}).get(UNIT) for field in table.schema]
    times = [k for k, unit in enumerate(units) if unit in EXPONENTS]
    field = table.schema.field(times[0]) if len(times) == 1 else None
    if field is None or not pa.types.is_floating(field.type) or clock.null_count:
        return table
    exact = decimals(clock.to_numpy(), EXPONENTS[field.metadata[UNIT]])
    return table.set_column(times[0], field.with_type(exact.type), exact)


def decimals(ns: IntArray, exponent: int) -> pa.Array:
    """Return times in integer [ns], shape (n,), as exact decimals of a unit, powers of ten above it."""
    words: Bytes = np.column_stack([ns, ns >> 63]).astype("<i8").view(np.uint8)  # 128 bits each
    kind = pa.decimal128(19, exponent)
    return pa.Array.from_buffers(kind, len(ns), [None, pa.py_buffer(np.ascontiguousarray(words))])


def plain_table(table: pa.Table, place: str) -> pa.Table:
    """Return a table of numbers and texts alone, its names without blanks around them.

    Args:
        table: Columns of any type; units and roles may be in the metadata of their fields.
        place: The file, or what a table in memory is called, for errors.

    Raises:
        LogError: If a list has another length than those of nearly all other rows.
    """
    pairs = zip(table.schema, table.columns, strict=True)
    flat = (plain for field, column in pairs for plain in _flatten(field, column, place))
    columns = list(islice(flat, MAX_TABLE_COLUMNS + 1))
    check_width(len(columns), place)
    fields = [
        pa.field(printable(field.name.strip()), column.type, metadata=field.metadata)
        for field, column in columns
    ]
    schema = pa.schema(fields, table.schema.metadata)
    return pa.Table.from_arrays([column for _, column in columns], schema=schema)


def number_texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return the shortest digits of numbers, floats with a decimal point, as Python writes them."""
    texts = column.cast(pa.string())
    if not pa.types.is_floating(column.type):
        return texts
    return pc.replace_substring_regex(texts, r"^(-?\d+)$", r"\1.0")


def is_list(kind: pa.DataType) -> bool:
    """Return whether a column has lists, of one length or not."""
    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def _flatten(field: pa.Field, column: pa.ChunkedArray, place: str) -> Iterator[Named]:
    """Yield a column, or those of a struct, or of lists of one length. Lists of many lengths are left out."""
    kind = column.type
    if isinstance(kind, pa.BaseExtensionType):
        yield from _flatten(field, column.cast(kind.storage_type), place)
    elif pa.types.is_dictionary(kind):
        values = [_without_view(chunk.dictionary).take(chunk.indices) for chunk in column.chunks]
        yield from _flatten(field, pa.chunked_array(values, None if values else pa.null()), place)
    elif pa.types.is_struct(kind):
        for inner, values in zip(kind, column.flatten(), strict=True):
            yield from _flatten(inner.with_name(f"{field.name}.{inner.name}"), values, place)
    elif not is_list(kind):
        yield field, _to_numbers_or_texts(column)
    else:
        lengths = np.asarray(pc.list_value_length(column).fill_null(-1).to_numpy())
        present = lengths[lengths >= 0]
        usual = int(np.bincount(present).argmax()) if len(present) else 0
        other = np.flatnonzero((lengths >= 0) & (lengths != usual))
        if not usual or len(other) > (1.0 - USUAL_SHARE) * len(present):
            return
        if len(other):
            fault, allowed = f"{lengths[other[0]]} entries", f"{usual}, as in the other rows"
            row = int(other[0]) + 1
            raise LogError(Finding(file=place, row=row, column=field.name, found=fault, allowed=allowed))
        check_width(usual, place)
        for k, name in enumerate(spread_names([field.name], [usual])):
            yield from _flatten(field.with_name(name), pc.list_element(column, k), place)


def _without_view(values: Any) -> Any:
    """Return texts of the type `string_view`, which many functions of Arrow do not take, as `string`."""
    return values.cast(pa.string()) if pa.types.is_string_view(values.type) else values


def _to_numbers_or_texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return numbers and texts as they are, all else as the texts that pandas writes of it."""
    for is_kind, convert in _CONVERSIONS:
        if is_kind(column.type):
            return convert(column)
    texts = (None if value is None else printable(str(value)) for value in column.to_pylist())
    return pa.chunked_array([pa.array(texts, pa.string())])


def _date_texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return dates and times with as many decimals as the finest needs; days alone without a time."""
    zoned = column.type.tz is not None
    unit = _resolution(column.cast(pa.int64()), column.type.unit)
    if not zoned and unit == "s":
        days = pc.floor_temporal(column, unit="day")
        if pc.all(pc.equal(days, column)).as_py():
            return column.cast(pa.date32()).cast(pa.string())
    texts = column.cast(pa.timestamp(unit, column.type.tz)).cast(pa.string())
    if not zoned:
        return texts
    return pc.replace_substring_regex(pc.replace_substring(texts, "Z", "+0000"), r"(\d\d)$", r":\1")


def _resolution(counts: pa.ChunkedArray, unit: str) -> str:
    """Return the coarsest unit in which counts of a unit are whole."""
    values = counts.drop_null().to_numpy()
    common = int(np.gcd.reduce(values)) * _RESOLUTIONS[unit] if len(values) else 0
    return next(name for name, step in _RESOLUTIONS.items() if common % step == 0)


def _duration_texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return durations as days and hours, minutes, seconds: -1 days +23:59:59.995000 is -5 ms."""
    counts = column.cast(pa.int64())
    ns = counts.fill_null(0).to_numpy() * _RESOLUTIONS[column.type.unit]
    unit = _resolution(counts, column.type.unit)
    days, rest = map(arrow_column, np.divmod(ns, DAY_NS))
    kind = pa.time32("s") if unit == "s" else pa.time64("ns" if unit == "ns" else "us")
    clock = rest.cast(pa.time64("ns")).cast(kind).cast(pa.string())
    sign = pc.if_else(pc.less(days, 0), " days +", " days ")
    texts = pc.binary_join_element_wise(days.cast(pa.string()), sign, clock, "")
    return pc.if_else(column.is_null(), None, pa.chunked_array([texts]))


def _is_text(kind: pa.DataType) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind))


_CONVERSIONS: Sequence[tuple[Callable[[pa.DataType], bool], Callable[[pa.ChunkedArray], pa.ChunkedArray]]] = (
    (pa.types.is_float16, lambda column: column.cast(pa.float32())),
    (is_number, lambda column: column),
    (pa.types.is_null, lambda column: column.cast(pa.float64())),
    (_is_text, lambda column: pc.utf8_trim_whitespace(_without_view(column))),
    (pa.types.is_boolean, lambda column: pc.if_else(column, "True", "False")),
    (pa.types.is_timestamp, _date_texts),
    (pa.types.is_duration, _duration_texts),
    (lambda kind: pa.types.is_date(kind) or pa.types.is_time(kind), lambda column: column.cast(pa.string())),
)
