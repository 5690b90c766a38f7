"""Access to the arrays in a recording file, as they stand there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.errors import Finding, RecordingError
from urmpipe_models.files.missing import meant_by
from urmpipe_pipeline.recording.identity import APPLICATION_ID, is_recording, open_reader, our_entries

if TYPE_CHECKING:
    from pyarrow import RecordBatch
    from rerun.chunk import LazyStore

SCALARS = "Scalars:scalars"
"""The column of a chunk that holds the values of an array."""

PROPERTY = "urmpipe"
"""Name of the recording's property that holds the metadata."""


@dataclass(frozen=True, slots=True, eq=False)
class Chunk:
    """Some rows of one array.

    Attributes:
        t_ns: Times in integer [ns], shape (m,).
        values: In SI, shape (m, k).
        numbers: The other timeline, row or sample, shape (m,); None without one.
    """

    t_ns: IntArray
    values: FloatArray
    numbers: IntArray | None


class Store:
    """A recording of ours, opened: only its manifest is read until more is asked for.

    Attributes:
        path: The file.
        rows: How many rows each entity has.
        metadata: The JSON text in its property.
        opens_at_ns: Where the viewer should stand in [ns]; 0 if nothing is said.
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
        self.opens_at_ns = int(self._property("opens_at_ns") or 0)

    def error(self, message: str) -> RecordingError:
        """Return an error that names this file."""
        return RecordingError(Finding(message, str(self.path)))

    def chunks(self, entity: str) -> Iterator[Chunk]:
        """Yield the rows of an array, some at a time, in the order in which they were written.

        Raises:
            RecordingError: If they cannot be decoded.
        """
        try:
            for chunk in self._store.stream().filter(content=entity, components=SCALARS):
                yield _decoded(chunk.to_record_batch())
        except (RuntimeError, ValueError) as error:
            raise self.error(f"found damaged data in {entity}: {_one_line(error)}") from error

    def read(self, entity: str, width: int) -> Chunk:
        """Return an array whole, by time; without rows if it is not there.

        Args:
            entity: Its path.
            width: Values a row.
        """
        parts = sorted(self.chunks(entity), key=lambda part: int(part.t_ns[0]))
        if not parts:
            return Chunk(np.empty(0, np.int64), np.empty((0, width)), np.empty(0, np.int64))
        numbers = [part.numbers for part in parts if part.numbers is not None]
        return _by_time(
            Chunk(
                np.concatenate([part.t_ns for part in parts]),
                np.concatenate([part.values for part in parts]),
                np.concatenate(numbers) if numbers else None,
            )
        )

    def _open(self) -> LazyStore:
        """Return the store of the recording that urmpipe wrote."""
        if not self.path.is_file():
            meant = meant_by(self.path, (".rrd",))
            raise self.error(f"found no such file{meant}, allowed: a recording (.rrd) that urmpipe wrote")
        if not is_recording(self.path):
            raise self.error("found no Rerun recording, allowed: a recording (.rrd) that urmpipe wrote")
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
                f" what is left of it can be looked at after: rerun rrd optimize {self.path} -o mended.rrd"
            ) from error

    def _metadata(self) -> str:
        """Return the JSON text in the recording's property."""
        text = self._property("metadata")
        if text is None:
            raise self.error("found a recording without urmpipe's metadata, allowed: one that urmpipe wrote")
        return str(text)

    def _property(self, name: str) -> str | int | None:
        """Return a value of the recording's property; None if it is not there."""
        for chunk in self._store.stream().filter(content=f"/__properties/{PROPERTY}", components=name):
            values = chunk.to_record_batch().column(name).to_pylist()
            if values and values[0]:
                value: str | int = values[0][0]
                return value
        return None


def _decoded(batch: RecordBatch) -> Chunk:
    names = set(batch.schema.names)
    column = batch.column(SCALARS)
    first, last = column.offsets[0].as_py(), column.offsets[-1].as_py()  # flatten() loads pyarrow.compute
    values = column.values[first:last].to_numpy().reshape(len(column), -1)
    other = next((name for name in ("row", "sample") if name in names), None)
    return Chunk(
        batch.column("t").to_numpy(zero_copy_only=False).astype(np.int64),
        values,
        None if other is None else batch.column(other).to_numpy(),
    )


def _by_time(chunk: Chunk) -> Chunk:
    """Return the rows in the order of time, in which all but a rewritten recording has them already."""
    if np.all(chunk.t_ns[1:] >= chunk.t_ns[:-1]):
        return chunk
    order = np.argsort(chunk.t_ns, kind="stable")
    numbers = None if chunk.numbers is None else chunk.numbers[order]
    return Chunk(chunk.t_ns[order], chunk.values[order], numbers)


def _row_counts(summary: str) -> dict[str, int]:
    """Return the rows of each array from the store's summary: a line a chunk, "path rows=n static=...".

    A path may hold anything, but what follows it is fixed: so the last " rows=" ends it.
    """
    counts: dict[str, int] = {}
    for line in summary.splitlines():
        entity, _, rest = line.rpartition(" rows=")
        if f"'{SCALARS}'" in rest and "static=False" in rest:
            counts[entity] = counts.get(entity, 0) + int(rest.split(" ", 1)[0])
    return counts


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
