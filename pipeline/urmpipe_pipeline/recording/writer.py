"""Write a recording: arrays, metadata, layout and drawing; verified before it gets its name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.isolated import believe
from urmpipe_pipeline.outputs import guarded_output
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.recording.codec import CodecError, Encoded, encode
from urmpipe_pipeline.recording.columns import column_rows
from urmpipe_pipeline.recording.sink import Sink, write_into
from urmpipe_pipeline.recording.store import PROPERTY, SLICE, checksum, document
from urmpipe_pipeline.recording.verify import verified, verify
from urmpipe_pipeline.recording.views.blueprint import send_views
from urmpipe_pipeline.recording.views.plots import LONG, EntityOf
from urmpipe_pipeline.text import encodable

AHEAD = 3
"""Slices under way at a time: there is always one to be written, and memory stays low."""

MANY = 2_000_000
"""Rows of all arrays together from which on only those that the viewer plots stand by themselves: times and
numbers of rows would take as much room as the values."""


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

        def send(sink: Sink) -> tuple[Encoded, str]:
            """Send all of the result."""
            found, metadata = _described(sink, kind, shown, encoded)
            _send(sink, found, progress)
            return found, metadata

        written, metadata = write_into(part, send)
        believe(part)
        verify(part, path, written, metadata)


def _encoded(result: Any, path: Path) -> Encoded:
    """Return a result taken apart."""
    try:
        return encode(result)
    except CodecError as error:
        raise OutputError(Finding(f"cannot be recorded: {error}", str(path))) from error


def _send(sink: Sink, encoded: Encoded, progress: Callable[[float], None] | None) -> None:
    """Send the arrays in slices, those with a row to verify first: reading back then need not read all."""
    total = sum(column.rows for column in encoded.columns)
    done = 0
    slices = [(column, start) for column in encoded.columns for start in _starts(column.rows)]
    for number, (column, start) in enumerate(slices):
        rows = slice(start, min(start + SLICE, column.rows))
        if number % AHEAD == 0:
            sink.flush()
        numbered = column.at not in encoded.clocks
        sink.stream.send_columns(column.at, *column_rows(column, rows, numbered=numbered))
        done += rows.stop - start
        if progress:
            progress(done / total)


def _starts(rows: int) -> list[int]:
    """Return where the slices of an array begin: first those with a row to verify."""
    early = dict.fromkeys(row - row % SLICE for row in verified(rows))
    return [*early, *(start for start in range(0, rows, SLICE) if start not in early)]


def _described(sink: Sink, kind: str, shown: Presentation, encoded: Encoded) -> tuple[Encoded, str]:
    """Send what is no array: what is there to be looked at with its layout, and the metadata.

    Returns:
        The arrays, long ones packed but those that the viewer plots whole, of very many rows all but these;
        and the metadata.
    """
    import rerun as rr

    stream = sink.stream
    stream.send_recording_name(encodable(shown.name))
    blueprint, opening, plotted = send_views(stream, shown, _entities(encoded))
    rows = sum(column.rows for column in encoded.columns if column.plotted)
    packed = encoded.packed(LONG if rows <= MANY else 0, plotted)
    checksums = {column.at: checksum(column.values) for column in packed.columns}
    metadata = document(kind, packed.tree, packed.clocks, checksums)
    told = rr.AnyValues(metadata=metadata, checksum=checksum(metadata), **opening._asdict())
    stream.send_property(PROPERTY, told)
    sink.lay_out(blueprint)
    return packed, metadata


def _entities(encoded: Encoded) -> EntityOf:
    """Return what tells where an array stands, or the one that it is a view of, if it can be plotted."""
    plotted = {column.at for column in encoded.columns if column.plotted}

    def entity_of(values: Any, t_ns: Any) -> str | None:
        at = encoded.entity_of(values, t_ns)
        return at if at in plotted else None

    return entity_of
