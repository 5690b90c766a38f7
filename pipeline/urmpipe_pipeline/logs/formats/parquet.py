"""Tables of Arrow: those that Python holds, Parquet and Feather files, data sets of LeRobot.

1. `dataframe_to_table`: a DataFrame of pandas, or what gives itself as an Arrow stream (polars, DuckDB).
2. `read_parquet`, `read_feather`: the table of a file; of urmpipe's own files with what they state.
3. `episode_file`: the file of an episode of LeRobot, a data set with names of joints in meta/info.json. Its
   rows are chosen by the column `episode_index`, as those of any table.

       v2  data/chunk-000/episode_000003.parquet   one episode per file
       v3  data/chunk-000/file-000.parquet         several episodes, of which meta/episodes has the file

Source: the formats v2.1 and v3.0 of huggingface/lerobot.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from os.path import isdir, isfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard

import pyarrow as pa

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.logs.formats.files import choose_part
from urmpipe_pipeline.logs.formats.memory import MemoryTable, is_list
from urmpipe_pipeline.logs.formats.text import check_unpacked_size
from urmpipe_pipeline.logs.formats.urmpipe_tables import (
    MARK,
    exact_times,
    mark_result,
    pandas_attributes,
    read_metadata_json,
    with_roles,
)

if TYPE_CHECKING:
    import pandas as pd

EPISODE = "episode_index"
CLOCK = "clock [ns]"  # the exact clock of urmpipe's files; their times in s, ms and us are doubles
FOLDERS_ABOVE = 3  # meta/ is next to the file, or next to data/chunk-000/
MAX_INFO = 16 << 20  # bytes of meta/info.json, which describes columns

# Tables in Python


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
        LogError: If a stream, or its query, fails.
    """
    pandas = sys.modules.get("pandas")
    if pandas is not None and isinstance(table, pandas.DataFrame):
        return _read_dataframe(table, name)
    try:
        arrow = pa.table(table if hasattr(type(table), "__arrow_c_stream__") else table.collect())
    except Exception as error:  # queries of polars and DuckDB raise their own
        reason = str(error).partition("\n")[0].strip(" .")
        query = f"a {type(table).__name__} that cannot be read ({reason})"
        raise LogError(Finding(file=name, found=query, allowed="a table")) from error
    return MemoryTable(name, mark_result(_index_first(arrow), pandas_attributes(arrow.schema.metadata)))


def _read_dataframe(frame: pd.DataFrame, name: str) -> MemoryTable:
    import pandas as pd

    columns: list[tuple[str, pd.Series]] = []
    for k in range(frame.index.nlevels):
        level = frame.index.get_level_values(k)
        is_count = isinstance(level, pd.RangeIndex) or (level.dtype.kind in "iub" and level.name is None)
        if not is_count:
            columns.append(("" if level.name is None else str(level.name), level.to_series()))
    for k, label in enumerate(frame.columns):
        parts = map(str, label) if isinstance(label, tuple) else [str(label)]
        columns.append(("/".join(filter(None, parts)), frame.iloc[:, k]))
    arrays = []
    for _, values in columns:
        try:
            arrays.append(pa.array(values, from_pandas=True))
        except (pa.ArrowException, TypeError, ValueError):  # values of many kinds
            missing = values.isna()
            texts = [None if lacks else str(value) for value, lacks in zip(values, missing, strict=True)]
            arrays.append(pa.array(texts, pa.string()))
    arrow = mark_result(
        pa.Table.from_arrays(arrays, names=[label for label, _ in columns]), frame.attrs.get(MARK) or {}
    )
    return MemoryTable(name, arrow, named=not isinstance(frame.columns, pd.RangeIndex))


def _index_first(table: pa.Table) -> pa.Table:
    """Return a table that pandas made with its index in front, without a name where that has none."""
    levels = read_metadata_json(table.schema.metadata, "pandas").get("index_columns")
    names = table.column_names
    index = [name for name in (levels if isinstance(levels, list) else ()) if name in names]
    if not index or len(set(names)) < len(names):
        return table
    moved = table.select([*index, *(name for name in names if name not in index)])
    plain = ("" if name.startswith("__index_level_") else name for name in moved.column_names)
    return moved.rename_columns([*plain])


# Files


def read_parquet(path: Path, head: bytes) -> MemoryTable:
    """Return the table of a Parquet file that begins with some bytes, without images.

    Raises:
        LogError: If it is encrypted or damaged.
    """
    import pyarrow.parquet as pq

    if head.startswith(b"PARE"):
        fault = "found an encrypted Parquet file, allowed: one without encryption"
        raise LogError(Finding(fault, str(path)))

    def read() -> pa.Table:
        with pq.ParquetFile(path) as file:
            groups = map(file.metadata.row_group, range(file.metadata.num_row_groups))
            chunks = (group.column(k) for group in groups for k in range(group.num_columns))
            # Of repeated values a file holds one.
            sizes = (max(chunk.total_uncompressed_size, 8 * chunk.num_values) for chunk in chunks)
            check_unpacked_size(path, sum(sizes))
            if EPISODE not in file.schema_arrow.names:
                return file.read()
            columns = [field.name for field in file.schema_arrow if not _is_image(field.type)]
            return _name_entries(file.read(columns), path)

    return _read_file(path, read, "Parquet")


def read_feather(path: Path) -> MemoryTable:
    """Return the table of a Feather file (Arrow IPC).

    Raises:
        LogError: If it is damaged.
    """

    def read() -> pa.Table:
        size, batches = 0, []
        # Mapped into memory, a file could shrink meanwhile.
        with pa.OSFile(str(path)) as source, pa.ipc.open_file(source) as file:
            for number in range(file.num_record_batches):
                batches.append(file.get_batch(number))
                size += batches[-1].nbytes
                check_unpacked_size(path, size)
            return pa.Table.from_batches(batches, file.schema)

    return _read_file(path, read, "Feather")


def _read_file(path: Path, read: Callable[[], pa.Table], form: str) -> MemoryTable:
    try:
        table = read()
        table.validate()
    except (pa.ArrowException, OSError) as error:
        reason = str(error).partition("\n")[0].partition(": ")[0].strip(" .")
        fault = f"found a {form} file that cannot be read ({reason})"
        raise LogError(Finding(f"{fault}, allowed: a whole one", str(path))) from None
    metadata = table.schema.metadata or {}
    about = read_metadata_json(metadata, MARK)
    if not about and MARK.encode() in metadata:
        fault = f"found a {form} file of urmpipe whose metadata are damaged"
        raise LogError(Finding(f"{fault}, allowed: as `export` wrote it", str(path)))
    if about:
        table = with_roles(table, about if about.get("rows") == "file" else {})
        if CLOCK in table.column_names and not (table.schema.field(CLOCK).metadata or {}).get(b"role"):
            table = exact_times(table.drop_columns([CLOCK]), table.column(CLOCK))
    else:
        table = mark_result(_index_first(table), pandas_attributes(metadata))
    return MemoryTable(path.stem, table, path=path)


# LeRobot


def is_data_set(path: Path) -> bool:
    """Return whether a folder is a data set of LeRobot."""
    return isfile(path / "meta" / "info.json") and isdir(path / "data")  # noqa: PTH112, PTH113 (any name)


def episode_file(folder: Path, episode: str | None) -> Path:
    """Return the file of a data set with an episode; without one, the only file, or that of the only episode.

    Raises:
        LogError: If there is no episode, or with the question which one is read.
        OptionError: If there is no such episode.
    """
    try:
        files = dict(_iter_episodes(folder))
    except (pa.ArrowException, OSError) as error:
        reason = str(error).partition("\n")[0]
        raise LogError(Finding(f"found a data set that cannot be read ({reason})", str(folder))) from None
    if not files:
        raise LogError(Finding(file=str(folder), found="a data set without episodes", allowed="one or more"))
    requested = None if episode is None else episode.removeprefix(f"{EPISODE}=")
    choices = {str(number): f"episode {number}" for number in files}
    return files[int(choose_part(folder, "episode", requested, choices, "episodes"))]


def _iter_episodes(folder: Path) -> Iterator[tuple[int, Path]]:
    """Yield number and file of each episode."""
    import pyarrow.parquet as pq

    keys = [EPISODE, "data/chunk_index", "data/file_index"]
    for meta in sorted((folder / "meta" / "episodes").glob("chunk-*/file-*.parquet")):
        rows = pq.read_table(meta, columns=keys).to_pydict()
        for number, chunk, file in zip(*(rows[key] for key in keys), strict=True):
            yield number, folder / "data" / f"chunk-{chunk:03d}" / f"file-{file:03d}.parquet"
    for path in sorted((folder / "data").glob("chunk-*/episode_*.parquet")):
        if match := re.fullmatch(r"episode_(\d+)", path.stem):
            yield int(match[1]), path


def _is_image(kind: pa.DataType) -> bool:
    return bool(pa.types.is_struct(kind) and any(pa.types.is_binary(field.type) for field in kind))


def _name_entries(table: pa.Table, path: Path) -> pa.Table:
    """Return a table with a column NAME.ENTRY for each entry of lists whose names are in meta/info.json."""
    import pyarrow.compute as pc

    names = _feature_names(path)
    fields, columns = [], []
    for field, column in zip(table.schema, table.columns, strict=True):
        labels = names.get(field.name, []) if is_list(field.type) else []
        if labels and pc.unique(pc.list_value_length(column)).to_pylist() == [len(labels)]:
            fields += [pa.field(f"{field.name}.{label}", field.type.value_type) for label in labels]
            columns += [pc.list_element(column, k) for k in range(len(labels))]
        else:
            fields.append(field)
            columns.append(column)
    return pa.Table.from_arrays(columns, schema=pa.schema(fields, table.schema.metadata))


def _feature_names(path: Path) -> dict[str, list[str]]:
    """Return the names of the entries of each feature, from the description of the file's data set."""
    infos = (folder / "meta" / "info.json" for folder in islice(path.resolve().parents, FOLDERS_ABOVE))
    info = next((file for file in infos if file.is_file() and file.stat().st_size < MAX_INFO), None)
    try:
        features = json.loads(info.read_bytes()).get("features", {}) if info else {}
        return {name: _unique_texts(feature.get("names")) for name, feature in features.items()}
    except (OSError, ValueError, AttributeError, RecursionError) as error:
        raise LogError(Finding(f"found a description that cannot be read ({error})", str(info))) from None


def _unique_texts(names: Any) -> list[str]:
    """Return the names of entries: a list, perhaps in another list, or under "motors" or "axes"."""
    names = next(iter(names.values()), None) if isinstance(names, Mapping) else names
    names = names[0] if isinstance(names, list) and len(names) == 1 and isinstance(names[0], list) else names
    texts = names if isinstance(names, list) and all(isinstance(name, str) for name in names) else []
    return texts if len(set(texts)) == len(texts) else []
