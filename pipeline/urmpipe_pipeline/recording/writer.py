"""Write a recording: arrays, metadata, layout and drawing; verified before it gets its name."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.outputs import guarded_output
from urmpipe_pipeline.recording.columns import block_columns
from urmpipe_pipeline.recording.drawing import draw
from urmpipe_pipeline.recording.entities import Block, blocks, printable
from urmpipe_pipeline.recording.identity import APPLICATION_ID
from urmpipe_pipeline.recording.layout import opening_time, viewer_layout
from urmpipe_pipeline.recording.metadata import to_json
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.signal_entities import simulation_blocks
from urmpipe_pipeline.recording.simulation_data import simulation_json
from urmpipe_pipeline.recording.store import PROPERTY
from urmpipe_pipeline.recording.verify import verify
from urmpipe_pipeline.simulations.simulation import Result, Simulation

if TYPE_CHECKING:
    from rerun import RecordingStream

SLICE = 65_536
"""Rows sent at a time: few enough to keep memory low, many enough to keep the overhead low."""

AHEAD = 3
"""Slices under way at a time: there is always one to be written, and memory stays low."""

SPARE = 64 * 2**20
"""Bytes that must be free on the disk before a slice is sent: it, what is on its way, and the footer."""


def write_recording(
    result: Result,
    path: Path,
    inputs: Sequence[Path] = (),
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write the recording of a result, read it back, and put it in its place.

    Args:
        result: What to record.
        path: The file (.rrd); replaced if it is a recording of urmpipe's.
        inputs: The files the result was made from: none of them is replaced.
        progress: Told the share of the data that is written, 0..1.

    Returns:
        The path.

    Raises:
        OutputError: If the file may not be written there, or did not read back as it was written.
    """
    with guarded_output(path, inputs, "recording") as part:
        every, metadata = _content(result)
        with _stream_into(part) as stream:
            _describe(stream, result, every, metadata)
            _send(stream, part.parent, every, progress)
        verify(part, path, every, metadata)
    return path


@contextmanager
def _stream_into(part: Path) -> Iterator[RecordingStream]:
    """Give a stream into a file; afterwards write the footer and let go of the file."""
    import rerun as rr

    stream = rr.RecordingStream(APPLICATION_ID, send_properties=False)
    if not rr.is_enabled(stream):
        raise OutputError("Rerun is switched off by the environment variable RERUN; allowed: unset or on")
    stream.save(part)
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
    stream: RecordingStream, folder: Path, every: Sequence[Block], progress: Callable[[float], None] | None
) -> None:
    """Send the arrays in slices, those with a row to verify first: reading back then need not read all.

    Args:
        stream: Where to.
        folder: Where its file stands.
        every: The arrays.
        progress: Told the share that is sent.
    """
    total = sum(block.values.nbytes for block in every) or 1
    done = 0
    slices = [(block, rows) for block in every for rows in _slices(block)]
    for number, (block, rows) in enumerate(slices):
        values = block.values[rows]
        times, column = block_columns(block, rows)
        if number % AHEAD == 0:
            stream.flush()  # waits until all that was sent is in the file
        _refuse_full_disk(folder)
        stream.send_columns(block.entity, times, [column])
        done += values.nbytes
        if progress:
            progress(done / total)


def _refuse_full_disk(folder: Path) -> None:
    """Raise before the disk is full: Rerun's file thread would wait forever then."""
    if shutil.disk_usage(folder).free < SPARE:
        raise OutputError(Finding(f"found less than {SPARE >> 20} MB free on the disk", str(folder)))


def _content(result: Result) -> tuple[list[Block], str]:
    """Return the arrays and the metadata of a result."""
    if isinstance(result, Simulation):
        arrays = simulation_blocks(result)
        return arrays, simulation_json(result, arrays)
    arrays = blocks(result)
    return arrays, to_json(result, arrays)


def _describe(stream: RecordingStream, result: Result, every: list[Block], metadata: str) -> None:
    """Send what is no array: the metadata, the viewer's layout, and what is there to be looked at."""
    import rerun as rr

    scene = scene_of(result)
    stream.send_recording_name(printable(result.name))
    stream.send_property(PROPERTY, rr.AnyValues(metadata=metadata, opens_at_ns=opening_time(result)))
    stream.send_blueprint(viewer_layout(result, scene))
    draw(stream, result, every, scene)


def _slices(block: Block) -> list[slice]:
    starts = list(range(0, len(block.t_ns), SLICE))
    return [
        slice(start, start + SLICE) for start in sorted(starts, key=lambda start: not _verified(block, start))
    ]


def _verified(block: Block, start: int) -> bool:
    return any(start <= row < start + SLICE for row in block.verified)
