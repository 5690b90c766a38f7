"""Into the file of a recording: Rerun writes to a pipe, and a thread of ours from there to the file.

Rerun writes files in a thread that ends where a file takes no more, be it a full disk, a quota or a limit of
its size: whatever waits for that thread waits forever then. Ours keeps the error for whoever waits.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import IO, TYPE_CHECKING, TypeVar

from urmpipe_models.errors import OutputError
from urmpipe_pipeline.outputs import interrupts_held_back
from urmpipe_pipeline.recording.identity import APPLICATION_ID

if TYPE_CHECKING:
    from rerun import RecordingStream
    from rerun.blueprint import Blueprint

BLOCK = 2**20
"""Bytes that are copied at a time."""

PATIENCE = 60.0
"""Time in [s] that the last bytes have to get from the pipe into the file."""

FILES = Path("/dev/fd")
"""Where Unix has the open files of a process, by which Rerun finds the pipe."""

Found = TypeVar("Found")


class Sink:
    """A recording that is on its way into a file.

    Attributes:
        stream: What takes the data.
    """

    def __init__(self, stream: RecordingStream, file: IO[bytes], *, piped: bool) -> None:
        from rerun import binary_stream

        self.stream = stream
        self._file = file
        self._error: OSError | None = None
        self._thread: Thread | None = None
        if not piped:
            self._held = binary_stream(stream)
            return
        source, into = os.pipe()
        try:
            self._thread = Thread(target=self._copy, args=(source,), daemon=True)
            self._thread.start()
            stream.save(FILES / str(into))
        finally:
            os.close(into)

    def lay_out(self, blueprint: Blueprint) -> None:
        """Send the layout, and end the stream that Rerun makes of it in memory: its threads would stay."""
        layout = _Layout(blueprint)
        self.stream.send_blueprint(layout)  # type: ignore[arg-type]
        layout.stream.disconnect()

    def flush(self) -> None:
        """Wait until all that was sent is on its way.

        Raises:
            OSError: If the file takes no more.
        """
        self.stream.flush()
        if self._error:
            raise self._error

    def finish(self) -> None:
        """Write the footer, and wait until all is in the file.

        Raises:
            OSError: If the file took not all of it.
        """
        self.stream.flush()
        if self._thread is None:
            self._file.write(self._held.read() or b"")
        self.stream.disconnect()
        if self._thread is not None:
            self._thread.join(PATIENCE)
            if self._thread.is_alive():
                raise TimeoutError(f"the last bytes were not written within {PATIENCE:.0f} s")
        self._file.close()
        if self._error:
            raise self._error

    def _copy(self, source: int) -> None:
        """Copy from the pipe to the file; what the file does not take is dropped, so that nobody waits."""
        with open(source, "rb", buffering=0) as pipe:
            while data := pipe.read(BLOCK):
                try:
                    if self._error is None:
                        self._file.write(data)
                except OSError as error:
                    self._error = error
                except ValueError as error:  # the file is closed: the command was stopped
                    self._error = OSError(str(error))


class _Layout:
    """A layout that keeps the stream into which Rerun puts it.

    Attributes:
        stream: That stream.
    """

    stream: RecordingStream

    def __init__(self, blueprint: Blueprint) -> None:
        self._blueprint = blueprint

    def to_blueprint(self) -> _Layout:
        """Return itself, as Rerun asks of what stands for a layout."""
        return self

    def _log_to_stream(self, stream: RecordingStream) -> None:
        """Put the layout into a stream, as Rerun asks."""
        self.stream = stream
        self._blueprint._log_to_stream(stream)


def write_into(part: Path, send: Callable[[Sink], Found], *, piped: bool = FILES.is_dir()) -> Found:
    """Write a recording, and return what the function that sends its content returns.

    Args:
        part: The file, not there yet.
        send: Sends all to the stream of a sink, and flushes it now and then.
        piped: Whether by a pipe; else all is held in memory until it is written.

    Raises:
        OSError: If the file takes not all of it.
        OutputError: If Rerun is switched off.
    """
    from rerun_bindings import flush_and_cleanup_orphaned_recordings

    try:
        return _written(part, send, piped=piped)
    finally:
        flush_and_cleanup_orphaned_recordings()  # else the threads of each recording stay


def _written(part: Path, send: Callable[[Sink], Found], *, piped: bool) -> Found:
    """Write a recording, and let go of all that belongs to it."""
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
            with interrupts_held_back():
                sink.finish()
