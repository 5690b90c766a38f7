"""Write a recording: arrays, metadata, layout and drawing; verified before it gets its name."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.outputs import guarded_output
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.recording.array_form import CodecError
from urmpipe_pipeline.recording.codec import Encoded, encode
from urmpipe_pipeline.recording.columns import column_rows
from urmpipe_pipeline.recording.identity import APPLICATION_ID
from urmpipe_pipeline.recording.store import PROPERTY, SLICE, document
from urmpipe_pipeline.recording.verify import verified, verify
from urmpipe_pipeline.recording.views.blueprint import send_views
from urmpipe_pipeline.recording.views.plots import LONG, EntityOf
from urmpipe_pipeline.text import encodable

if TYPE_CHECKING:
    from rerun import RecordingStream

AHEAD = 3
"""Slices under way at a time: there is always one to be written, and memory stays low."""

MANY = 2_000_000
"""Rows of all arrays together from which on only those that the viewer plots stand by themselves: times and
numbers of rows would take as much room as the values."""

SPARE = 64 * 2**20
"""Bytes that must be free on the disk before a slice is sent: it, what is on its way, and the footer."""


def write_result(
    result: Any,
    kind: str,
    shown: Presentation,
    path: Path,
    inputs: Sequence[Path] = (),
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write the recording of a result of a kind with what the viewer shows of it, and read it back.

    An input is never replaced. Progress is the share of the data that is written, 0..1.

    Raises:
        OutputError: If the file may not be written there, or did not read back as it was written.
    """
    with guarded_output(path, inputs, "recording") as part:
        encoded = _encoded(result, path)
        with _stream_into(part, path) as stream:
            encoded, metadata = _described(stream, kind, shown, encoded)
            _send(stream, part.parent, encoded, progress)
        verify(part, path, encoded, metadata)


def _encoded(result: Any, path: Path) -> Encoded:
    """Return a result taken apart."""
    try:
        return encode(result)
    except CodecError as error:
        raise OutputError(Finding(f"cannot be recorded: {error}", str(path))) from error


@contextmanager
def _stream_into(part: Path, path: Path) -> Iterator[RecordingStream]:
    """Give a stream into the part of a file; afterwards write the footer and let go of it."""
    import rerun as rr

    stream = rr.RecordingStream(APPLICATION_ID, send_properties=False)
    if not rr.is_enabled(stream):
        raise OutputError("Rerun is switched off by the environment variable RERUN; allowed: unset or on")
    try:
        stream.save(part)
    except RuntimeError as error:  # Rerun's, of a folder that nobody may write to
        reason = str(error).rpartition("Failed to create file: ")[2].partition(", path: ")[0]
        raise OutputError(Finding(f"cannot be written: {reason}", str(path))) from error
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    # Strict: Rerun raises where it would warn and drop data, such as for a column of the wrong length.
    strict_before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield stream
    finally:
        stream.flush()
        stream.disconnect()
        rr.set_strict_mode(strict_before)


def _send(
    stream: RecordingStream, folder: Path, encoded: Encoded, progress: Callable[[float], None] | None
) -> None:
    """Send the arrays in slices, those with a row to verify first: reading back then need not read all."""
    total = sum(column.rows for column in encoded.columns)
    done = 0
    slices = [(column, start) for column in encoded.columns for start in _starts(column.rows)]
    for number, (column, start) in enumerate(slices):
        rows = slice(start, min(start + SLICE, column.rows))
        if number % AHEAD == 0:
            stream.flush()  # waits until all that was sent is in the file
        _refuse_full_disk(folder)
        stream.send_columns(column.at, *column_rows(column, rows, numbered=column.at not in encoded.clocks))
        done += rows.stop - start
        if progress:
            progress(done / total)


def _starts(rows: int) -> list[int]:
    """Return where the slices of an array begin: first those with a row to verify."""
    early = dict.fromkeys(row - row % SLICE for row in verified(rows))
    return [*early, *(start for start in range(0, rows, SLICE) if start not in early)]


def _refuse_full_disk(folder: Path) -> None:
    """Raise before the disk is full: Rerun's file thread would wait forever then."""
    if shutil.disk_usage(folder).free < SPARE:
        raise OutputError(Finding(f"found less than {SPARE >> 20} MB free on the disk", str(folder)))


def _described(
    stream: RecordingStream, kind: str, shown: Presentation, encoded: Encoded
) -> tuple[Encoded, str]:
    """Send what is no array: what is there to be looked at with its layout, and the metadata.

    Returns:
        The arrays, long ones packed but those that the viewer plots whole, of very many rows all but these;
        and the metadata.
    """
    import rerun as rr

    stream.send_recording_name(encodable(shown.name))
    blueprint, opening, plotted = send_views(stream, shown, _entities(encoded))
    rows = sum(column.rows for column in encoded.columns if column.plotted)
    packed = encoded.packed(LONG if rows <= MANY else 0, plotted)
    metadata = document(kind, packed.tree, packed.clocks)
    stream.send_property(PROPERTY, rr.AnyValues(metadata=metadata, **opening._asdict()))
    stream.send_blueprint(blueprint)
    return packed, metadata


def _entities(encoded: Encoded) -> EntityOf:
    """Return what tells where an array stands, or the one that it is a view of, if it can be plotted."""
    plotted = {column.at for column in encoded.columns if column.plotted}

    def entity_of(values: Any, t_ns: Any) -> str | None:
        at = encoded.entity_of(values, t_ns)
        return at if at in plotted else None

    return entity_of
