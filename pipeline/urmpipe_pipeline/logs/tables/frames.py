"""Tables in Python, a DataFrame of pandas or what becomes an Arrow stream, as a table in memory."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard

import pyarrow as pa

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.logs.tables.held import MemoryTable
from urmpipe_pipeline.logs.tables.own_tables import MARK, attributes_of, of_result, told_in

if TYPE_CHECKING:
    import pandas as pd


class TableLike(Protocol):
    """A table that gives itself as an Arrow stream: pandas, polars, DuckDB, Arrow and others."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """Return the table as a stream of Arrow."""


def is_table(value: object) -> TypeGuard[TableLike]:
    """Return whether a value is a table: it gives itself as an Arrow stream, or is a LazyFrame of polars.

    A single column (Series, ChunkedArray) is no table.
    """
    kind = type(value)  # attributes of a LazyFrame and of a query would run it
    if not hasattr(kind, "__arrow_c_stream__"):
        return hasattr(kind, "collect_schema")
    return hasattr(kind, "columns") or not hasattr(kind, "__array__")


def dataframe_to_table(table: Any, name: str) -> MemoryTable:
    """Return a table of Python as one in memory.

    Of a DataFrame of pandas, an index that may be a time becomes the first column: dates, durations, texts,
    floats, and whole numbers with a name. Two levels of names are GROUP/NAME.

    Args:
        table: A value for which `is_table` is true. A stream is consumed.
        name: Name of the log.

    Raises:
        LogError: If a stream, or the query behind it, fails.
    """
    if not _is_frame(table):
        arrow = _read_stream(table, name)
        return MemoryTable(name, of_result(index_first(arrow), attributes_of(arrow.schema.metadata)))
    columns = [*_index(table), *((_name(column), table.iloc[:, k]) for k, column in enumerate(table.columns))]
    arrays = [_array(values) for _, values in columns]
    arrow = pa.Table.from_arrays(arrays, names=[label for label, _ in columns])
    attributes = table.attrs.get(MARK) or {}
    return MemoryTable(name, of_result(arrow, attributes), named=not _is_numbered(table.columns))


def _read_stream(table: Any, name: str) -> pa.Table:
    """Return a table, a stream or the result of a query as an Arrow table."""
    try:
        return pa.table(table if hasattr(type(table), "__arrow_c_stream__") else table.collect())
    except Exception as error:  # queries of polars and DuckDB raise their own
        reason = str(error).partition("\n")[0].strip(" .")
        query = f"a {type(table).__name__} that cannot be read ({reason})"
        raise LogError(Finding(file=name, found=query, allowed="a table")) from error


def _is_frame(table: object) -> TypeGuard[pd.DataFrame]:
    pandas = sys.modules.get("pandas")
    return pandas is not None and isinstance(table, pandas.DataFrame)


def _is_numbered(index: pd.Index) -> bool:
    """Return whether an index only counts."""
    import pandas as pd

    return isinstance(index, pd.RangeIndex)


def _index(frame: pd.DataFrame) -> Iterator[tuple[str, pd.Series]]:
    """Yield the levels of an index that may be a time, with their names."""
    for k in range(frame.index.nlevels):
        level = frame.index.get_level_values(k)
        counts = level.dtype.kind in "iub" and level.name is None
        if not (_is_numbered(level) or counts):
            yield "" if level.name is None else str(level.name), level.to_series()


def _name(label: Any) -> str:
    """Return the name of a column; of several levels GROUP/NAME, as of two header lines."""
    if not isinstance(label, tuple):
        return str(label)
    return "/".join(str(part) for part in label if str(part))


def _array(values: pd.Series) -> pa.Array:
    """Return a column as an Arrow array; what holds values of many kinds as their texts."""
    try:
        return pa.array(values, from_pandas=True)
    except (pa.ArrowException, TypeError, ValueError):
        missing = values.isna()
        texts = [None if lacks else str(value) for value, lacks in zip(values, missing, strict=True)]
        return pa.array(texts, pa.string())


def index_first(table: pa.Table) -> pa.Table:
    """Return a table that pandas made with its index in front, without a name where that has none."""
    levels = told_in(table.schema.metadata, "pandas").get("index_columns")
    index = [
        name
        for name in (levels if isinstance(levels, list) else ())
        if isinstance(name, str) and name in table.column_names
    ]
    others = [name for name in table.column_names if name not in index]
    if not index or len(set(table.column_names)) < table.num_columns:
        return table
    moved = table.select([*index, *others])
    return moved.rename_columns(
        ["" if name.startswith("__index_level_") else name for name in moved.column_names]
    )
