"""Write a recording: arrays, metadata and the content of the viewer; verified before it gets its name.

1. The result is encoded (`codec`), and checked that an output may be written there (`outputs`).
2. Layout, views and metadata are sent, then the arrays in slices of `SLICE` rows (`layout.array_columns`).
   Arrays that the viewer does not plot are packed: times and numbers of rows need as much room as values.
3. Rerun writes to a pipe, and a thread of ours from there to the file (`Sink`). Rerun's own thread for files
   ends when a file takes no more (a full disk, a quota, a limit of its size), and whatever waits for that
   thread waits forever; ours keeps the error.
4. The file is read back (`verify`): footer, number of rows, metadata, and the first, middle and last row of
   each array. The slices with these rows are sent first, so that few chunks need to be read.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from threading import Thread
from typing import IO, TYPE_CHECKING, Any, TypeVar

import numpy as np

from urmpipe_models.errors import Finding, OutputError, RecordingError
from urmpipe_pipeline.outputs import defer_interrupts, safe_output
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.recording.codec import CodecError, Encoded, StoredArray, encode
from urmpipe_pipeline.recording.file_check import APPLICATION_ID
from urmpipe_pipeline.recording.layout import PROPERTY, SLICE, array_columns, checksum, metadata_json
from urmpipe_pipeline.recording.reader import Store
from urmpipe_pipeline.recording.views.blueprint import send_views
from urmpipe_pipeline.recording.views.plots import LONG
from urmpipe_pipeline.subprocess_reader import mark_safe
from urmpipe_pipeline.text import drop_surrogates

if TYPE_CHECKING:
    from rerun import RecordingStream
    from rerun.blueprint import Blueprint

SLICES_AHEAD = 3  # slices on their way to the file at a time: it never waits, and memory stays low
MAX_PLOTTED_ROWS = (
    2_000_000  # of all arrays together; of a result with more only plotted arrays are not packed
)

PIPE_BLOCK = 2**20  # bytes copied at a time
PIPE_TIMEOUT = 60.0  # [s] for the last bytes from the pipe to the file
FILE_DESCRIPTORS = Path("/dev/fd")  # open files of a process in Unix, by which Rerun opens the pipe

Result = TypeVar("Result")


def write_result(
    result: Any,
    kind: str,
    shown: Presentation,
    path: Path,
    inputs: Sequence[Path] = (),
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the recording of a result of a kind with its presentation in the viewer, and read it back.

    An input is never replaced. Progress is the share of the data that is written, 0..1.

    Raises:
        OutputError: If the file may not be written there, or did not read back as it was written.
    """
    with safe_output(path, inputs, "recording") as part:
        try:
            encoded = encode(result)
        except CodecError as error:
            raise OutputError(Finding(f"cannot be recorded: {error}", str(path))) from error

        def send(sink: Sink) -> tuple[Encoded, str]:
            packed, metadata = _send_views_and_metadata(sink, kind, shown, encoded)
            _send_arrays(sink, packed, progress)
            return packed, metadata

        written, metadata = write_into(part, send)
        mark_safe(part)
        verify(part, path, written, metadata)


def _send_views_and_metadata(
    sink: Sink, kind: str, shown: Presentation, encoded: Encoded
) -> tuple[Encoded, str]:
    """Send everything but the arrays.

    Returns:
        The arrays, long ones packed except those that the viewer plots completely, and the metadata.
    """
    import rerun as rr

    plottable = {array.path for array in encoded.arrays if array.plotted}

    def entity_of(values: Any, t_ns: Any) -> str | None:
        path = encoded.path_of(values, t_ns)
        return path if path in plottable else None

    stream = sink.stream
    stream.send_recording_name(drop_surrogates(shown.name))
    blueprint, opening, plotted = send_views(stream, shown, entity_of)
    rows = sum(array.rows for array in encoded.arrays if array.plotted)
    packed = encoded.packed(LONG if rows <= MAX_PLOTTED_ROWS else 0, plotted)
    checksums = {array.path: checksum(array.values) for array in packed.arrays}
    metadata = metadata_json(kind, packed.tree, packed.clocks, checksums)
    values = rr.AnyValues(metadata=metadata, checksum=checksum(metadata), **opening._asdict())
    stream.send_property(PROPERTY, values)
    sink.send_blueprint(blueprint)
    return packed, metadata


def _send_arrays(sink: Sink, encoded: Encoded, progress: Callable[[float], None] | None) -> None:
    """Send the arrays in slices, of each array first those with a row that `verify` reads."""
    total = sum(array.rows for array in encoded.arrays)
    done = 0
    slices = [(array, start) for array in encoded.arrays for start in _slice_starts(array.rows)]
    for number, (array, start) in enumerate(slices):
        rows = slice(start, min(start + SLICE, array.rows))
        if number % SLICES_AHEAD == 0:
            sink.flush()
        numbered = array.path not in encoded.clocks
        sink.stream.send_columns(array.path, *array_columns(array, rows, numbered=numbered))
        done += rows.stop - start
        if progress:
            progress(done / total)


def _slice_starts(rows: int) -> list[int]:
    first = dict.fromkeys(row - row % SLICE for row in _verified_rows(rows))
    return [*first, *(start for start in range(0, rows, SLICE) if start not in first)]


def verify(part: Path, path: Path, encoded: Encoded, metadata: str) -> None:
    """Compare the content of a file with what was written.

    Args:
        part: The file.
        path: The name that it is to have, for messages.
        encoded: The arrays that were written.
        metadata: The metadata that were written.

    Raises:
        OutputError: With everything that differs.
    """
    try:
        store = Store(part)
    except RecordingError as error:
        raise OutputError(
            Finding(f"could not be read back: {error.findings[0].sentence()}", str(path))
        ) from error
    differences = list(_iter_differences(store, encoded, metadata))
    if differences:
        raise OutputError(*(Finding(f"differs when read back: {place}", str(path)) for place in differences))


def _iter_differences(store: Store, encoded: Encoded, metadata: str) -> Iterator[str]:
    if store.metadata != metadata:
        yield "the metadata"
    for array in encoded.arrays:
        written = array.rows if array.plotted else -(-array.rows // SLICE)
        if (rows := store.rows.get(array.path, 0)) != written:
            yield f"{array.path} has {rows} rows of {written}"
        elif (row := _find_wrong_row(store, array, timed=array.path in encoded.clocks)) is not None:
            yield f"{array.path} in row {row + 1}"


def _find_wrong_row(store: Store, array: StoredArray, *, timed: bool) -> int | None:
    """Return the first verified row of an array that the file lacks, or whose values differ."""
    values = array.values if array.values.ndim else array.values.reshape(1)
    missing, t_ns = _verified_rows(array.rows), array.t_ns if timed else None
    for numbers, rows in store.iter_rows(array.path, values.shape[1:], values.dtype, t_ns):
        for row in [row for row in missing if row in numbers]:
            if rows[int(np.argmax(numbers == row))].tobytes() != np.asarray(values[row]).tobytes():
                return row
            missing.remove(row)
        if not missing:
            return None
    return missing[0]


def _verified_rows(rows: int) -> list[int]:
    return sorted({0, rows // 2, rows - 1})


class Sink:
    """A recording on its way into a file.

    Attributes:
        stream: Rerun's stream, which takes the data.
    """

    def __init__(self, stream: RecordingStream, file: IO[bytes], *, piped: bool) -> None:
        from rerun import binary_stream

        self.stream = stream
        self._file = file
        self._error: OSError | None = None
        self._thread: Thread | None = None
        if not piped:
            self._memory = binary_stream(stream)
            return
        source, target = os.pipe()
        try:
            self._thread = Thread(target=self._copy, args=(source,), daemon=True)
            self._thread.start()
            stream.save(FILE_DESCRIPTORS / str(target))
        finally:
            os.close(target)

    def send_blueprint(self, blueprint: Blueprint) -> None:
        """Send the layout, and end the stream that Rerun creates for it in memory: its threads would stay."""
        layout = _Layout(blueprint)
        self.stream.send_blueprint(layout)  # type: ignore[arg-type]
        layout.stream.disconnect()

    def flush(self) -> None:
        """Wait until Rerun has passed on all data.

        Raises:
            OSError: If the file takes no more.
        """
        self.stream.flush()
        if self._error:
            raise self._error

    def finish(self) -> None:
        """Write the footer, and wait until everything is in the file.

        Raises:
            OSError: If the file did not take everything.
        """
        self.stream.flush()
        if self._thread is None:
            self._file.write(self._memory.read() or b"")
        self.stream.disconnect()
        if self._thread is not None:
            self._thread.join(PIPE_TIMEOUT)
            if self._thread.is_alive():
                raise TimeoutError(f"the last bytes were not written within {PIPE_TIMEOUT:.0f} s")
        self._file.close()
        if self._error:
            raise self._error

    def _copy(self, source: int) -> None:
        """Copy from the pipe to the file; drop what the file does not take, so that Rerun never waits."""
        with open(source, "rb", buffering=0) as pipe:
            while data := pipe.read(PIPE_BLOCK):
                try:
                    if self._error is None:
                        self._file.write(data)
                except OSError as error:
                    self._error = error
                except ValueError as error:  # the file is closed: the command was stopped
                    self._error = OSError(str(error))


class _Layout:
    """A layout that keeps the stream in which Rerun puts it.

    Attributes:
        stream: That stream.
    """

    stream: RecordingStream

    def __init__(self, blueprint: Blueprint) -> None:
        self._blueprint = blueprint

    def to_blueprint(self) -> _Layout:
        """Return itself: Rerun calls this."""
        return self

    def _log_to_stream(self, stream: RecordingStream) -> None:
        """Put the layout into a stream: Rerun calls this."""
        self.stream = stream
        self._blueprint._log_to_stream(stream)


def write_into(
    part: Path, send: Callable[[Sink], Result], *, piped: bool = FILE_DESCRIPTORS.is_dir()
) -> Result:
    """Write a recording, and return the result of the function that sends its content.

    Args:
        part: The file, which does not exist yet.
        send: Sends everything to the stream of a sink, and flushes it now and then.
        piped: Whether by a pipe; else everything is kept in memory until it is written.

    Raises:
        OSError: If the file does not take everything.
        OutputError: If Rerun is switched off.
    """
    from rerun_bindings import flush_and_cleanup_orphaned_recordings

    try:
        return _write(part, send, piped=piped)
    finally:
        flush_and_cleanup_orphaned_recordings()  # else the threads of each recording stay


def _write(part: Path, send: Callable[[Sink], Result], *, piped: bool) -> Result:
    """Write a recording, and release everything that refers to its stream."""
    import rerun as rr

    stream = rr.RecordingStream(APPLICATION_ID, send_properties=False)
    if not rr.is_enabled(stream):
        raise OutputError("Rerun is switched off by the environment variable RERUN; allowed: unset or on")
    strict_before = rr.strict_mode()
    with part.open("xb") as file:
        sink = Sink(stream, file, piped=piped)
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        # Strict: Rerun raises where it would warn and drop data, such as for a column of the wrong length.
        rr.set_strict_mode(True)
        try:
            return send(sink)
        finally:
            rr.set_strict_mode(strict_before)
            with defer_interrupts():
                sink.finish()
