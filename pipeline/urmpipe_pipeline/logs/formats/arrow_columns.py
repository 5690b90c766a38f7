"""Times that are doubles, put right by the exact clock that stands beside them in our own files.

Columns of an Arrow table as those of a text table: numbers, and the texts of a CSV file for all else.

Structs become a column a field, NAME.FIELD; lists a column an entry, NAME_1, NAME_2, ...
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
from urmpipe_pipeline.logs.formats.form import spread_names
from urmpipe_pipeline.logs.formats.numbers import UNIT, arrow_column, is_number
from urmpipe_pipeline.logs.formats.text import MOST_COLUMNS, refuse_wide

EXPONENTS = {b"s": 9, b"ms": 6, b"us": 3, b"ns": 0}
"""Powers of ten from the units of times to [ns]."""


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


USUAL_SHARE = 0.9
"""Share of the lists of a column that have one length where the others are damaged."""

_DAY_NS = 86_400 * 10**9
_FINENESS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}

Named = tuple[pa.Field, pa.ChunkedArray]


def plain_table(table: pa.Table, place: str) -> pa.Table:
    """Return a table of numbers and texts alone, its names without blanks around them.

    Args:
        table: Columns of any type; units and roles may stand in the metadata of their fields.
        place: The file, or what a table in memory is called, for errors.

    Raises:
        LogError: If a list has another length than those of nearly all other rows.
    """
    pairs = zip(table.schema, table.columns, strict=True)
    flat = (plain for field, column in pairs for plain in _flat(field, column, place))
    columns = list(islice(flat, MOST_COLUMNS + 1))
    refuse_wide(len(columns), place)
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


def _flat(field: pa.Field, column: pa.ChunkedArray, place: str) -> Iterator[Named]:
    """Yield a column; of a struct or a list the columns that it holds."""
    kind = column.type
    if isinstance(kind, pa.BaseExtensionType):
        yield from _flat(field, column.cast(kind.storage_type), place)
    elif pa.types.is_dictionary(kind):
        values = [_without_view(chunk.dictionary).take(chunk.indices) for chunk in column.chunks]
        yield from _flat(field, pa.chunked_array(values, None if values else pa.null()), place)
    elif pa.types.is_struct(kind):
        for inner, values in zip(kind, column.flatten(), strict=True):
            yield from _flat(inner.with_name(f"{field.name}.{inner.name}"), values, place)
    elif pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        yield from _spread(field, column, place)
    else:
        yield field, _plain(column)


def _spread(field: pa.Field, column: pa.ChunkedArray, place: str) -> Iterator[Named]:
    """Yield a column for each entry of lists of one length; none of lists of many lengths."""
    lengths = np.asarray(pc.list_value_length(column).fill_null(-1).to_numpy())
    there = lengths[lengths >= 0]
    usual = int(np.bincount(there).argmax()) if len(there) else 0
    other = np.flatnonzero((lengths >= 0) & (lengths != usual))
    if not usual or len(other) > (1.0 - USUAL_SHARE) * len(there):
        return
    if len(other):
        row = int(other[0])
        found = f"{lengths[row]} entries"
        allowed = f"{usual}, as in the other rows"
        raise LogError(Finding(file=place, row=row + 1, column=field.name, found=found, allowed=allowed))
    refuse_wide(usual, place)
    for k, name in enumerate(spread_names([field.name], [usual])):
        yield from _flat(field.with_name(name), pc.list_element(column, k), place)


def _without_view(values: Any) -> Any:
    """Return texts of the type `string_view`, which many functions of Arrow do not take, as `string`."""
    return values.cast(pa.string()) if pa.types.is_string_view(values.type) else values


def _plain(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return numbers and texts as they are, all else as the texts that pandas writes of it."""
    for is_kind, made in _MADE:
        if is_kind(column.type):
            return made(column)
    texts = (None if value is None else printable(str(value)) for value in column.to_pylist())
    return pa.chunked_array([pa.array(texts, pa.string())])


def _dates(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return dates and times with as many decimals as the finest needs; days alone without a time."""
    zoned = column.type.tz is not None
    unit = _fineness(column.cast(pa.int64()), column.type.unit)
    if not zoned and unit == "s" and _all_days(column):
        return column.cast(pa.date32()).cast(pa.string())
    texts = column.cast(pa.timestamp(unit, column.type.tz)).cast(pa.string())
    if not zoned:
        return texts
    return pc.replace_substring_regex(pc.replace_substring(texts, "Z", "+0000"), r"(\d\d)$", r":\1")


def _all_days(column: pa.ChunkedArray) -> bool:
    return bool(pc.all(pc.equal(pc.floor_temporal(column, unit="day"), column)).as_py())


def _fineness(counts: pa.ChunkedArray, unit: str) -> str:
    """Return the coarsest unit in which counts of a unit are whole."""
    values = counts.drop_null().to_numpy()
    common = int(np.gcd.reduce(values)) * _FINENESS[unit] if len(values) else 0
    return next(name for name, step in _FINENESS.items() if common % step == 0)


def _lengths_of_time(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return lengths of time as days and hours, minutes, seconds: -1 days +23:59:59.995000 is -5 ms."""
    counts = column.cast(pa.int64())
    ns = counts.fill_null(0).to_numpy() * _FINENESS[column.type.unit]
    unit = _fineness(counts, column.type.unit)
    days, rest = map(arrow_column, np.divmod(ns, _DAY_NS))
    kind = pa.time32("s") if unit == "s" else pa.time64("ns" if unit == "ns" else "us")
    clock = rest.cast(pa.time64("ns")).cast(kind).cast(pa.string())
    sign = pc.if_else(pc.less(days, 0), " days +", " days ")
    texts = pc.binary_join_element_wise(days.cast(pa.string()), sign, clock, "")
    return pc.if_else(column.is_null(), None, pa.chunked_array([texts]))


_MADE: Sequence[tuple[Callable[[pa.DataType], bool], Callable[[pa.ChunkedArray], pa.ChunkedArray]]] = (
    (pa.types.is_float16, lambda column: column.cast(pa.float32())),
    (is_number, lambda column: column),
    (pa.types.is_null, lambda column: column.cast(pa.float64())),
    (pa.types.is_string_view, lambda column: pc.utf8_trim_whitespace(_without_view(column))),
    (pa.types.is_string, pc.utf8_trim_whitespace),
    (pa.types.is_large_string, pc.utf8_trim_whitespace),
    (pa.types.is_boolean, lambda column: pc.if_else(column, "True", "False")),
    (pa.types.is_timestamp, _dates),
    (pa.types.is_duration, _lengths_of_time),
    (pa.types.is_date, lambda column: column.cast(pa.string())),
    (pa.types.is_time, lambda column: column.cast(pa.string())),
)
"""What is made of a column, by its type."""
