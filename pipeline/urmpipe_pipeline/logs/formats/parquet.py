"""Tables in Python, a DataFrame of pandas or what becomes an Arrow stream, as a table in memory.

Data sets of LeRobot: Parquet files of episodes, with names of joints in meta/info.json.

    v2  data/chunk-000/episode_000003.parquet   one episode per file
    v3  data/chunk-000/file-000.parquet         several episodes, of which meta/episodes has the file

Source: the formats v2.1 and v3.0 of huggingface/lerobot.

Parquet and Feather (Arrow's own file): the table that they hold, those of urmpipe with what they tell.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard

import pyarrow as pa

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.own import MARK, attributes_of, of_result, told_in

if TYPE_CHECKING:
    import pandas as pd
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from os.path import isdir, isfile
from pathlib import Path

import pyarrow.compute as pc

from urmpipe_models.errors import Hint, OptionError, format_value
from urmpipe_pipeline.logs.formats.arrow_columns import exact_times
from urmpipe_pipeline.logs.formats.own import with_roles
from urmpipe_pipeline.logs.formats.text import refuse_unpacked
from urmpipe_pipeline.logs.log_map import LogMap


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


EPISODE = "episode_index"
SHOWN = 9  # episodes that a question lists
FOLDERS_ABOVE = 3  # meta/ is next to the file, or next to data/chunk-000/
MAX_INFO = 16 << 20  # bytes of meta/info.json, which describes columns


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
    number = chosen_episode(folder, tuple(files), episode)
    return files[next(iter(files)) if number is None else number]


def chosen_episode(path: Path, numbers: Sequence[int], episode: str | None) -> int | None:
    """Return the episode that is given, among the numbers of those that there are; None if one is alone.

    Raises:
        LogError: With the question which one of several is read.
        OptionError: If there is no such episode.
    """
    number = None if episode is None else episode.removeprefix(f"{EPISODE}=")
    if number is not None and number.isdecimal() and int(number) in numbers:
        return int(number)
    shown = ", ".join(map(str, numbers[:SHOWN])) + ", ..." * (len(numbers) > SHOWN)
    if number is not None:
        allowed = f"the number of an episode: {shown}"
        finding = Finding(parameter="episode", file=str(path), found=format_value(episode), allowed=allowed)
        raise OptionError(finding)
    if len(numbers) == 1:
        return None
    hints = tuple(Hint("episode", str(k), f"reads episode {k}") for k in numbers[:SHOWN])
    raise LogError(
        Finding(file=str(path), found=f"{len(numbers)} episodes: {shown}", allowed="one", hints=hints)
    )


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


def with_names(table: pa.Table, path: Path) -> pa.Table:
    """Return a table with a column NAME.ENTRY for each entry of lists whose names are in meta/info.json."""
    import pyarrow.compute as pc  # takes long

    names = _feature_names(path)
    fields, columns = [], []
    for field, column in zip(table.schema, table.columns, strict=True):
        labels = names.get(field.name, []) if _is_list(field.type) else []
        if labels and pc.unique(pc.list_value_length(column)).to_pylist() == [len(labels)]:
            fields += [pa.field(f"{field.name}.{label}", field.type.value_type) for label in labels]
            columns += [pc.list_element(column, k) for k in range(len(labels))]
        else:
            fields.append(field)
            columns.append(column)
    return pa.Table.from_arrays(columns, schema=pa.schema(fields, table.schema.metadata))


def _is_list(kind: pa.DataType) -> bool:
    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def _feature_names(path: Path) -> dict[str, list[str]]:
    """Return the names of the entries of each feature, from the description of the file's data set."""
    infos = (folder / "meta" / "info.json" for folder in islice(path.resolve().parents, FOLDERS_ABOVE))
    info = next((file for file in infos if file.is_file() and file.stat().st_size < MAX_INFO), None)
    try:
        features = json.loads(info.read_bytes()).get("features", {}) if info else {}
        return {name: _texts(feature.get("names")) for name, feature in features.items()}
    except (OSError, ValueError, AttributeError, RecursionError) as error:
        raise LogError(Finding(f"found a description that cannot be read ({error})", str(info))) from None


def _texts(names: Any) -> list[str]:
    """Return the names of entries: a list, perhaps in another list, or under "motors" or "axes"."""
    names = next(iter(names.values()), None) if isinstance(names, Mapping) else names
    names = names[0] if isinstance(names, list) and len(names) == 1 and isinstance(names[0], list) else names
    texts = names if isinstance(names, list) and all(isinstance(name, str) for name in names) else []
    return texts if len(set(texts)) == len(texts) else []


CLOCK = "clock [ns]"
"""The exact clock of our own files; their times in s, ms and us are doubles."""


def read_parquet(path: Path, head: bytes, options: LogMap) -> MemoryTable:
    """Return the table of a Parquet file, of which the first bytes are given.

    Of a file of episodes (LeRobot), only the rows of a given episode are read, and no images.

    Raises:
        LogError: If it is encrypted or damaged.
    """
    import pyarrow.parquet as pq

    if head.startswith(b"PARE"):
        found = "found an encrypted Parquet file, allowed: one without encryption"
        raise LogError(Finding(found, str(path)))
    applied: list[str] = []

    def read() -> pa.Table:
        with pq.ParquetFile(path) as file:
            refuse_unpacked(path, _unpacked(file.metadata))
            if EPISODE not in file.schema_arrow.names:
                return file.read()
            columns = [field.name for field in file.schema_arrow if not _is_image(field.type)]
            numbers = sorted(pc.unique(file.read([EPISODE]).column(EPISODE)).drop_null().to_pylist())
        column, _, value = (options.episode or "").rpartition("=")
        asks = options.rows is None and column in ("", EPISODE)
        number = chosen_episode(path, numbers, value or None) if asks and numbers else None
        applied.extend(["episode"] * (number is not None))
        rows = None if number is None else [(EPISODE, "==", number)]
        return with_names(pq.read_table(path, columns=columns, filters=rows, partitioning=None), path)

    return replace(_held(path, read, "Parquet"), applied=tuple(applied))


def _is_image(kind: pa.DataType) -> bool:
    return bool(pa.types.is_struct(kind) and any(pa.types.is_binary(field.type) for field in kind))


def read_feather(path: Path) -> MemoryTable:
    """Return the table of a Feather file (Arrow IPC).

    Raises:
        LogError: If it is damaged.
    """

    def read() -> pa.Table:
        unpacked, batches = 0, []
        with (
            pa.OSFile(str(path)) as source,
            pa.ipc.open_file(source) as file,
        ):  # mapped, it could shrink under us
            for number in range(file.num_record_batches):
                batches.append(file.get_batch(number))
                unpacked += batches[-1].nbytes
                refuse_unpacked(path, unpacked)
            return pa.Table.from_batches(batches, file.schema)

    return _held(path, read, "Feather")


def _unpacked(about: Any) -> int:
    """Return the bytes that a Parquet file says its columns take: of repeated values it holds one."""
    groups = map(about.row_group, range(about.num_row_groups))
    chunks = (group.column(k) for group in groups for k in range(group.num_columns))
    return sum(max(chunk.total_uncompressed_size, 8 * chunk.num_values) for chunk in chunks)


def _held(path: Path, read: Callable[[], pa.Table], what: str) -> MemoryTable:
    try:
        table = read()
        table.validate()
    except (pa.ArrowException, OSError) as error:
        reason = str(error).partition("\n")[0].partition(": ")[0].strip(" .")
        found = f"found a {what} file that cannot be read ({reason})"
        raise LogError(Finding(f"{found}, allowed: a whole one", str(path))) from None
    about = told_in(table.schema.metadata, MARK)
    if not about and MARK.encode() in (table.schema.metadata or {}):
        found = f"found a {what} file of urmpipe whose metadata are damaged"
        raise LogError(Finding(f"{found}, allowed: as `export` wrote it", str(path)))
    if not about:
        told = attributes_of(table.schema.metadata)
        return MemoryTable(path.stem, of_result(index_first(table), told), path=path)
    return MemoryTable(path.stem, _ours(table, about), path=path)


def _ours(table: pa.Table, about: Mapping[str, Any]) -> pa.Table:
    """Return the table of a file of ours with what it tells of its columns, and its exact clock."""
    table = with_roles(table, about if about.get("rows") == "file" else {})
    if CLOCK not in table.column_names:
        return table
    clock = table.column(CLOCK)
    if (table.schema.field(CLOCK).metadata or {}).get(b"role"):
        return table  # the log's own clock
    return exact_times(table.drop_columns([CLOCK]), clock)
