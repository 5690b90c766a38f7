"""Read a recording back: the result as it was, each array bit for bit.

1. `Store` opens the file, if it is a complete recording that urmpipe wrote and that can be read without a
   crash (`file_check`); of its data only the manifest and the metadata are read.
2. The metadata must have our layout version and the checksum that was written with them.
3. `codec.decode` creates the result. Each array is read once, at once or, lazily, when it is used
   (`LazyArray`), and compared with its checksum when it is read completely. Rows may be stored in any order:
   their numbers are stored with them, or follow from their rising times.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from urmpipe_models.elementwise import IntArray
from urmpipe_models.errors import Finding, RecordingError, format_value, shell_quote
from urmpipe_models.files import suggest_path
from urmpipe_pipeline.recording.codec import ArrayReader, CodecError, ReadContext, codec_for_type, decode
from urmpipe_pipeline.recording.file_check import (
    APPLICATION_ID,
    find_crash,
    is_recording,
    open_reader,
    own_entries,
)
from urmpipe_pipeline.recording.layout import (
    LAYOUT_VERSION,
    PACKED,
    PROPERTY,
    ROW,
    SCALARS,
    TIME,
    Opening,
    checksum,
)

if TYPE_CHECKING:
    from pyarrow import Array, RecordBatch
    from rerun.chunk import LazyStore


def read_result(path: Path, kinds: Mapping[str, Callable[[], type]], *, lazy: bool = False) -> Any:
    """Return the result that a recording holds, of one of the kinds whose classes are found by their names.

    Results in a result come back without the path of the recording that they were read from. If `lazy`,
    arrays are read when they are used (`LazyArray`).

    Raises:
        RecordingError: If it is no recording, was cut off, is not of urmpipe, or of another layout.
    """
    store = Store(path)
    document = _read_document(store)
    find_class = kinds.get(str(document.get("kind", "")))
    if find_class is None:
        raise store.error(f"found a result of kind {document.get('kind')!r}, allowed: {', '.join(kinds)}")
    try:
        result = decode(find_class(), document.get("result"), _array_reader(store, lazy, document))
    except CodecError as error:
        raise store.error(f"found damaged metadata, {error}") from error
    has_path = any(field.name == "recording" for field in fields(result))
    return replace(result, recording=path) if has_path else result


def _read_document(store: Store) -> dict[str, Any]:
    """Return the metadata, if they have our layout version and are as they were written."""
    try:
        document: dict[str, Any] = json.loads(store.metadata)
        version = document["layout_version"]
        is_newer = version > LAYOUT_VERSION
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise store.error(f"found damaged metadata ({error!r}), allowed: what urmpipe wrote") from error
    if version != LAYOUT_VERSION:
        writer = "a newer" if is_newer else "an older"
        raise store.error(
            f"found layout version {version} (of {writer} urmpipe), allowed: {LAYOUT_VERSION};"
            f" write it again{_format_command(document)}"
        )
    if store.checksum != checksum(store.metadata):
        raise store.error("found damaged metadata (by their checksum), allowed: what urmpipe wrote")
    return document


def _format_command(document: dict[str, Any]) -> str:
    """Return the command that made a recording, if its metadata state it."""
    try:
        provenance = document["result"]["provenance"]
        inputs = " ".join(shell_quote(file["name"]) for file in provenance["inputs"])
        return f": urmpipe {provenance['command']} {inputs} with the same options"
    except (KeyError, TypeError):
        return " from its input files"


def _array_reader(store: Store, lazy: bool, document: Mapping[str, Any]) -> ArrayReader:
    """Return a reader of arrays by their paths, which reads each array once."""
    clocks = codec_for_type(dict[str, str]).read(document.get("clocks"), ReadContext("/clocks", _no_array))
    checksums = codec_for_type(dict[str, int]).read(
        document.get("checksums"), ReadContext("/checksums", _no_array)
    )
    if not clocks.keys().isdisjoint(clocks.values()):
        raise CodecError(
            f"/clocks: found {format_value(clocks)}, allowed: the paths of times by those of arrays"
        )
    known: dict[tuple[str, tuple[int, ...], str], Any] = {}

    def array(path: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
        key = path, shape, dtype.str
        if key not in known:
            stored_shape = shape or (1,)

            def read_rows(first: int, end: int) -> NDArray[Any]:
                clock = array(clocks[path], stored_shape[:1], np.dtype(np.int64)) if path in clocks else None
                t_ns = None if clock is None else np.asarray(clock)
                rows = store.read(path, first, end, stored_shape[1:], dtype, t_ns)
                if end - first == stored_shape[0] and checksum(rows) != checksums.get(path):
                    raise store.error(f"found other values in {path} than were written (by their checksum)")
                return rows

            lazy_array = LazyArray(read_rows, stored_shape, dtype)
            known[key] = lazy_array if lazy and shape else lazy_array.load().reshape(shape)
        return known[key]

    return array


def _no_array(path: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
    raise CodecError(f"{path}: found an array, allowed: none")


class LazyArray(NDArrayOperatorsMixin):
    """An array in a recording, in place of an array: a slice of its rows is read alone, else all of it.

    Once it is read completely, it stays in memory. NumPy's functions and operators accept it as an array, and
    it has the other attributes of an array (`T`, `mean`, ...).

    Attributes:
        shape: Shape of the array, at least one dimension.
        dtype: Type of its values.
    """

    def __init__(
        self, read_rows: Callable[[int, int], NDArray[Any]], shape: tuple[int, ...], dtype: np.dtype[Any]
    ) -> None:
        """Represent an array; `read_rows(first, end)` returns the rows from one up to another."""
        self._read_rows = read_rows
        self._loaded: NDArray[Any] | None = None
        self.shape = shape
        self.dtype = dtype

    def load(self) -> NDArray[Any]:
        """Return the array in the units of its field, shape (n, ...), and keep it in memory."""
        if self._loaded is None:
            self._loaded = self._read_rows(0, len(self))
        return self._loaded

    @property
    def ndim(self) -> int:
        """Number of dimensions."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of values."""
        return int(np.prod(self.shape))

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> Any:
        first, *rest = key if isinstance(key, tuple) and key else (key,)
        if self._loaded is not None or not isinstance(first, (slice, int, np.integer)):
            return self.load()[key]
        if not isinstance(first, slice):
            row = range(len(self))[first]
            return self._read_rows(row, row + 1)[(0, *rest)]
        rows = range(len(self))[first]
        low, high = (min(rows), max(rows) + 1) if rows else (0, 0)
        return self._read_rows(low, high)[(slice(None, None, first.step), *rest)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        array = self.load() if dtype is None else self.load().astype(dtype, copy=False)
        return array.copy() if copy else array

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        arrays = (value.load() if isinstance(value, LazyArray) else value for value in inputs)
        return getattr(ufunc, method)(*arrays, **options)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.load(), name)

    def __repr__(self) -> str:
        return f"LazyArray of shape {self.shape}, {self.dtype}"


class Store:
    """An open recording of ours: only its manifest and its metadata are read before an array is read.

    Attributes:
        path: The file.
        rows: Number of rows of each entity.
        metadata: JSON text of the property.
        checksum: Checksum of that text when it was written; None in a recording of an older layout.
        opening: Where the viewer opens; at 0 s if the recording does not state it.
    """

    def __init__(self, path: Path) -> None:
        """Open a recording.

        Raises:
            RecordingError: If it is no recording, was cut off, or is not of urmpipe.
        """
        self.path = path
        self._store = self._open()
        self.rows = _count_rows(self._store.summary())
        metadata = self._read_property("metadata")
        if metadata is None:
            raise self.error("found a recording without urmpipe's metadata, allowed: one that urmpipe wrote")
        self.metadata = str(metadata)
        self.checksum = self._read_property("checksum")
        timeline, at = self._read_property("timeline"), self._read_property("at")
        self.opening = Opening(str(timeline or TIME), at if isinstance(at, int) else 0)

    def error(self, message: str) -> RecordingError:
        """Return an error that names this file."""
        return RecordingError(Finding(message, str(self.path)))

    def read(
        self,
        entity: str,
        first: int,
        end: int,
        width: tuple[int, ...],
        dtype: np.dtype[Any],
        t_ns: IntArray | None = None,
    ) -> NDArray[Any]:
        """Return some rows of an array; only the chunks up to the last of these rows are read.

        Args:
            entity: Path of the array.
            first: First of the rows, from 0.
            end: Row after the last of them.
            width: Shape of a row.
            dtype: Type of the values.
            t_ns: Rising times of all rows in integer [ns], shape (n,), if these identify the rows.

        Returns:
            Values in the units of the field, shape (end - first, *width).

        Raises:
            RecordingError: If rows are missing, or are not of that type and shape.
        """
        try:
            values, count = np.empty((end - first, *width), dtype), 0
        except (ValueError, OverflowError, MemoryError) as error:
            raise self.error(f"found no room for {entity}: {_format_error(error)}") from error
        for numbers, rows in self.iter_rows(entity, width, dtype, t_ns):
            count += _copy_rows(rows, numbers - first, values)
            if count == len(values):
                break
        if count != len(values):
            raise self.error(f"found {count} of {len(values)} rows in {entity}, allowed: all as were written")
        return values

    def iter_rows(
        self, entity: str, width: tuple[int, ...], dtype: np.dtype[Any], t_ns: IntArray | None = None
    ) -> Iterator[tuple[IntArray, NDArray[Any]]]:
        """Yield the numbers of some rows of an array, from 0, and the rows, in the order of the file.

        Raises:
            RecordingError: If they cannot be decoded, or are not of that type and shape.
        """
        try:
            for chunk in self._store.stream().filter(content=entity, components=[SCALARS, PACKED]):
                yield from _decode_batch(chunk.to_record_batch(), width, dtype, t_ns)
        except (RuntimeError, ValueError, KeyError) as error:
            raise self.error(f"found damaged data in {entity}: {_format_error(error)}") from error

    def _open(self) -> LazyStore:
        """Return the store of the recording that urmpipe wrote."""
        if not self.path.is_file():
            is_special = self.path.exists() and not self.path.is_dir()
            kind = "a pipe or a device" if is_special else f"no such file{suggest_path(self.path, ('.rrd',))}"
            raise self.error(f"found {kind}, allowed: a recording (.rrd) that urmpipe wrote")
        if not is_recording(self.path):
            raise self.error("found no Rerun recording, allowed: a recording (.rrd) that urmpipe wrote")
        if crash := find_crash(self.path):
            raise self.error(
                f"found a damaged recording (reading it {crash}), allowed: one as it was written"
            )
        try:
            reader = open_reader(self.path)
            entries = own_entries(reader)
            if not entries:
                names = ", ".join(entry.application_id for entry in reader.recordings())
                raise self.error(
                    f"found a recording of {names or 'nothing'}, allowed: one of {APPLICATION_ID}"
                )
            return reader.store(store=entries[0])
        except (RuntimeError, ValueError) as error:
            raise self.error(
                "found an incomplete recording (no footer), allowed: a complete one; write it again, or"
                f" recover what is readable: rerun rrd optimize {shell_quote(self.path)} -o recovered.rrd"
            ) from error

    def _read_property(self, name: str) -> str | int | None:
        """Return a value of the recording's property; None if it is missing."""
        try:
            for chunk in self._store.stream().filter(content=f"/__properties/{PROPERTY}", components=name):
                values = chunk.to_record_batch().column(name).to_pylist()
                if values and values[0]:
                    value: str | int = values[0][0]
                    return value
        except (RuntimeError, ValueError, KeyError) as error:
            raise self.error(f"found damaged metadata: {_format_error(error)}") from error
        return None


def _decode_batch(
    batch: RecordBatch, width: tuple[int, ...], dtype: np.dtype[Any], t_ns: IntArray | None
) -> Iterator[tuple[IntArray, NDArray[Any]]]:
    """Yield the numbers of rows, from 0, and the rows."""
    is_packed = PACKED in batch.schema.names
    column, starts = batch.column(PACKED if is_packed else SCALARS), _row_numbers(batch, t_ns)
    offsets = _to_numpy(column.offsets)
    values = _to_numpy(column.values)[offsets[0] : offsets[-1]]
    if values.dtype != dtype:
        raise ValueError(f"values of type {values.dtype} instead of {dtype}")
    if not is_packed:
        yield starts, values.reshape(len(starts), *width)
        return
    for start, pack in zip(starts.tolist(), np.split(values, offsets[1:-1] - offsets[0]), strict=True):
        rows = pack.reshape(-1, *width)
        yield np.arange(start, start + len(rows)), rows


def _row_numbers(batch: RecordBatch, t_ns: IntArray | None) -> IntArray:
    """Return the numbers of rows, from 0: as stored, else by the rising times of all rows."""
    if ROW in batch.schema.names or t_ns is None:
        return _to_numpy(batch.column(ROW)) - 1
    times = _to_numpy(batch.column(TIME)).view(np.int64)
    numbers = np.searchsorted(t_ns, times)
    if (numbers == len(t_ns)).any() or not np.array_equal(t_ns[numbers], times):
        raise ValueError("rows at other times than were written")
    return numbers


def _to_numpy(array: Array) -> NDArray[Any]:
    """Return an Arrow array as one of NumPy; its own `to_numpy` imports pandas (0.4 s, 40 MB)."""
    first, end = array.offset, array.offset + len(array)
    if array.null_count:
        raise ValueError(f"{array.null_count} values missing")
    data = array.buffers()[1]
    if str(array.type) == "bool":  # Arrow stores one bit per value
        bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
        return bits[first:end].view(np.bool_)
    return np.frombuffer(data, array.type.to_pandas_dtype())[first:end]


def _copy_rows(rows: NDArray[Any], numbers: IntArray, target: NDArray[Any]) -> int:
    """Copy the rows whose numbers are rows of the target, and return their count."""
    first = int(numbers[0]) if len(numbers) else 0
    if np.array_equal(numbers, np.arange(first, first + len(numbers))):  # as the writer sends them
        low, high = max(first, 0), min(first + len(numbers), len(target))
        if low < high:
            target[low:high] = rows[low - first : high - first]
        return max(high - low, 0)
    is_inside = (numbers >= 0) & (numbers < len(target))
    target[numbers[is_inside]] = rows[is_inside]
    return int(is_inside.sum())


def _count_rows(summary: str) -> dict[str, int]:
    """Return the rows of each array from the store's summary: one line per chunk, "path rows=n static=...".

    A path may contain anything, but the text after it is fixed: so the last " rows=" ends it.
    """
    counts: dict[str, int] = {}
    for line in summary.splitlines():
        entity, _, rest = line.rpartition(" rows=")
        if (f"'{SCALARS}'" in rest or f"'{PACKED}'" in rest) and "static=False" in rest:
            counts[entity] = counts.get(entity, 0) + int(rest.split(" ", 1)[0])
    return counts


def _format_error(error: Exception) -> str:
    return " ".join(str(error).split())
