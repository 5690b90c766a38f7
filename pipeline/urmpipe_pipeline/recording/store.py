"""Access to the arrays in a recording file, as they stand there."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import IntArray
from urmpipe_models.errors import Finding, RecordingError, shell_quote
from urmpipe_models.files import suggest_path
from urmpipe_pipeline.recording.identity import APPLICATION_ID, is_recording, open_reader, our_entries
from urmpipe_pipeline.recording.trial import recording_abort

if TYPE_CHECKING:
    from pyarrow import Array, RecordBatch
    from rerun.chunk import LazyStore

SCALARS = "Scalars:scalars"
"""The component with the values of an array whose rows stand by themselves, so that they can be plotted."""

PACKED = "urmpipe:packed"
"""The component with the values of any other array, of its own type: many of its rows stand as one."""

TIME, ROW = "t", "row"
"""The timelines: times, and the rows of every array, from 1; of what is packed the first row of each pack."""

SLICE = 32_768
"""Rows sent at a time: few enough to keep memory low, many enough to keep the overhead low."""

LAYOUT_VERSION = 8
"""The version that a recording says; raised when what is stored changes otherwise than by a default."""

PROPERTY = "urmpipe"
"""Name of the recording's property that holds the metadata."""


NONE: Mapping[str, Any] = MappingProxyType({})


class Opening(NamedTuple):
    """Where the viewer should stand: a timeline, and the time in [ns] on t or the row from 1 on row."""

    timeline: str
    at: int


class Store:
    """A recording of ours, opened: only its manifest is read until more is asked for.

    Attributes:
        path: The file.
        rows: How many rows each entity has.
        metadata: The JSON text in its property.
        checksum: That of the text as it was written; None in a recording of an older layout.
        opening: Where the viewer should stand; at 0 s if nothing is said.
    """

    def __init__(self, path: Path) -> None:
        """Open a recording.

        Raises:
            RecordingError: If it is none, was cut off, or is not of urmpipe.
        """
        self.path = path
        self._store = self._open()
        self.rows = _row_counts(self._store.summary())
        self.metadata = self._metadata()
        self.checksum = self._property("checksum")
        timeline, at = self._property("timeline"), self._property("at")
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
        """Return some rows of an array; only the chunks up to the last of them are read.

        Args:
            entity: Its path.
            first: The first of the rows, from 0.
            end: The row after the last of them.
            width: Shape of a row.
            dtype: Type of the values.
            t_ns: Rising times of all rows in integer [ns], shape (n,), where these tell the rows.

        Returns:
            In the units of its field, shape (end - first, *width).

        Raises:
            RecordingError: If some of them are missing, or are none of that type and shape.
        """
        try:
            found, filled = np.empty((end - first, *width), dtype), 0
        except (ValueError, OverflowError, MemoryError) as error:
            raise self.error(f"found no room for {entity}: {_one_line(error)}") from error
        for numbers, rows in self.parts(entity, width, dtype, t_ns):
            filled += _copy(rows, numbers - first, found)
            if filled == len(found):
                break
        if filled != len(found):
            raise self.error(f"found {filled} of {len(found)} rows in {entity}, allowed: all as were written")
        return found

    def parts(
        self, entity: str, width: tuple[int, ...], dtype: np.dtype[Any], t_ns: IntArray | None = None
    ) -> Iterator[tuple[IntArray, NDArray[Any]]]:
        """Yield the numbers of some rows of an array, from 0, and the rows, in the order of the file.

        Raises:
            RecordingError: If they cannot be decoded, or are none of that type and shape.
        """
        try:
            for chunk in self._store.stream().filter(content=entity, components=[SCALARS, PACKED]):
                yield from _decoded(chunk.to_record_batch(), width, dtype, t_ns)
        except (RuntimeError, ValueError, KeyError) as error:
            raise self.error(f"found damaged data in {entity}: {_one_line(error)}") from error

    def _open(self) -> LazyStore:
        """Return the store of the recording that urmpipe wrote."""
        if not self.path.is_file():
            special = self.path.exists() and not self.path.is_dir()
            found = "a pipe or a device" if special else f"no such file{suggest_path(self.path, ('.rrd',))}"
            raise self.error(f"found {found}, allowed: a recording (.rrd) that urmpipe wrote")
        if not is_recording(self.path):
            raise self.error("found no Rerun recording, allowed: a recording (.rrd) that urmpipe wrote")
        if how := recording_abort(self.path):
            raise self.error(f"found a damaged recording (reading it {how}), allowed: one as it was written")
        try:
            reader = open_reader(self.path)
            ours = our_entries(reader)
            if not ours:
                names = ", ".join(entry.application_id for entry in reader.recordings())
                raise self.error(
                    f"found a recording of {names or 'nothing'}, allowed: one of {APPLICATION_ID}"
                )
            return reader.store(store=ours[0])
        except (RuntimeError, ValueError) as error:
            raise self.error(
                "found a recording that was cut off (no footer), allowed: a whole one;"
                " what is left of it can be looked at after:"
                f" rerun rrd optimize {shell_quote(self.path)} -o mended.rrd"
            ) from error

    def _metadata(self) -> str:
        """Return the JSON text in the recording's property."""
        text = self._property("metadata")
        if text is None:
            raise self.error("found a recording without urmpipe's metadata, allowed: one that urmpipe wrote")
        return str(text)

    def _property(self, name: str) -> str | int | None:
        """Return a value of the recording's property; None if it is not there."""
        try:
            for chunk in self._store.stream().filter(content=f"/__properties/{PROPERTY}", components=name):
                values = chunk.to_record_batch().column(name).to_pylist()
                if values and values[0]:
                    value: str | int = values[0][0]
                    return value
        except (RuntimeError, ValueError, KeyError) as error:
            raise self.error(f"found damaged metadata: {_one_line(error)}") from error
        return None


def document(
    kind: str, tree: Any, clocks: Mapping[str, str] = NONE, checksums: Mapping[str, int] = NONE
) -> str:
    """Return the metadata of a result of a kind as JSON.

    Args:
        kind: What a recording calls it.
        tree: All of the result but its arrays.
        clocks: The paths of times by those of the arrays that they tell the rows of.
        checksums: Those of the arrays by their paths, see `checksum`.
    """
    told = {"layout_version": LAYOUT_VERSION, "kind": kind, "clocks": dict(clocks)}
    return json.dumps({**told, "checksums": dict(checksums), "result": tree})


def checksum(values: NDArray[Any] | str) -> int:
    """Return the checksum (CRC-32) of an array, any unit and shape, or a text: a changed byte changes it."""
    return zlib.crc32(values.encode() if isinstance(values, str) else np.ascontiguousarray(values).data)


def _decoded(
    batch: RecordBatch, width: tuple[int, ...], dtype: np.dtype[Any], t_ns: IntArray | None
) -> Iterator[tuple[IntArray, NDArray[Any]]]:
    """Yield the numbers of rows, from 0, and the rows."""
    packed = PACKED in batch.schema.names
    column, starts = batch.column(PACKED if packed else SCALARS), _starts(batch, t_ns)
    offsets = _numbers(column.offsets)
    every = _numbers(column.values)[offsets[0] : offsets[-1]]
    if every.dtype != dtype:
        raise ValueError(f"values of type {every.dtype} instead of {dtype}")
    if not packed:
        yield starts, every.reshape(len(starts), *width)
        return
    for start, pack in zip(starts.tolist(), np.split(every, offsets[1:-1] - offsets[0]), strict=True):
        rows = pack.reshape(-1, *width)
        yield np.arange(start, start + len(rows)), rows


def _starts(batch: RecordBatch, t_ns: IntArray | None) -> IntArray:
    """Return the numbers of rows, from 0: as they are told, else by the rising times of all rows."""
    if ROW in batch.schema.names or t_ns is None:
        return _numbers(batch.column(ROW)) - 1
    times = _numbers(batch.column(TIME)).view(np.int64)
    found = np.searchsorted(t_ns, times)
    if (found == len(t_ns)).any() or not np.array_equal(t_ns[found], times):
        raise ValueError("rows at other times than were written")
    return found


def _numbers(array: Array) -> NDArray[Any]:
    """Return an array of Arrow's as one of NumPy's; its own `to_numpy` loads pandas (0.4 s, 40 MB)."""
    first, end = array.offset, array.offset + len(array)
    if array.null_count:
        raise ValueError(f"{array.null_count} values missing")
    data = array.buffers()[1]
    if str(array.type) == "bool":  # Arrow has a bit for each
        bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
        return bits[first:end].view(np.bool_)
    return np.frombuffer(data, array.type.to_pandas_dtype())[first:end]


def _copy(rows: NDArray[Any], places: IntArray, into: NDArray[Any]) -> int:
    """Copy rows to their places, as far as these are within, and return how many they are."""
    first = int(places[0]) if len(places) else 0
    if np.array_equal(places, np.arange(first, first + len(places))):  # as the writer sends them
        low, high = max(first, 0), min(first + len(places), len(into))
        if low < high:
            into[low:high] = rows[low - first : high - first]
        return max(high - low, 0)
    within = (places >= 0) & (places < len(into))
    into[places[within]] = rows[within]
    return int(within.sum())


def _row_counts(summary: str) -> dict[str, int]:
    """Return the rows of each array from the store's summary: a line a chunk, "path rows=n static=...".

    A path may hold anything, but what follows it is fixed: so the last " rows=" ends it.
    """
    counts: dict[str, int] = {}
    for line in summary.splitlines():
        entity, _, rest = line.rpartition(" rows=")
        if (f"'{SCALARS}'" in rest or f"'{PACKED}'" in rest) and "static=False" in rest:
            counts[entity] = counts.get(entity, 0) + int(rest.split(" ", 1)[0])
    return counts


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
