"""Write a recording: metadata, style, scene and arrays; verified before it gets its name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_models.errors import OutputError
from urmpipe_pipeline.joint_log import FloatArray
from urmpipe_pipeline.outputs import guarded_output
from urmpipe_pipeline.recording.drawing import draw, time_columns
from urmpipe_pipeline.recording.entities import Block, blocks, printable
from urmpipe_pipeline.recording.identity import APPLICATION_ID
from urmpipe_pipeline.recording.layout import viewer_layout
from urmpipe_pipeline.recording.metadata import to_json
from urmpipe_pipeline.recording.pipe import piped
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.store import PROPERTY
from urmpipe_pipeline.recording.verify import verify
from urmpipe_pipeline.results import Comparison, Run

if TYPE_CHECKING:
    from rerun import ComponentColumn, RecordingStream, TimeColumn

SLICE = 65_536
"""Rows sent at a time: few enough to keep memory low, many enough to keep the overhead low."""


def write_recording(
    result: Run | Comparison,
    path: Path,
    inputs: Sequence[Path] = (),
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write the recording of a run or a comparison, read it back, and put it in its place.

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
        every = blocks(result)
        metadata = to_json(result, every)
        with _strict():
            _write(part, result, every, metadata, progress or (lambda share: None))
        verify(part, path, every, metadata)
    return path


@contextmanager
def _strict() -> Iterator[None]:
    """Make Rerun raise where it would warn and drop data, such as for a column of the wrong length."""
    import rerun as rr

    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def _write(
    part: Path, result: Run | Comparison, every: list[Block], metadata: str, tell: Callable[[float], None]
) -> None:
    """Write everything; the end of the stream's context writes the footer."""
    import rerun as rr

    scene = scene_of(result)
    with piped(part) as place, rr.RecordingStream(APPLICATION_ID, send_properties=False) as stream:
        if not rr.is_enabled(stream):
            raise OutputError("Rerun is switched off by the environment variable RERUN; allowed: unset or on")
        stream.save(place, default_blueprint=viewer_layout(result, scene))
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        stream.send_recording_name(printable(result.name))
        stream.send_property(PROPERTY, rr.AnyValues(metadata=metadata))
        draw(stream, result, every, scene)
        _send(stream, every, tell)


def _send(stream: RecordingStream, every: list[Block], tell: Callable[[float], None]) -> None:
    """Send the arrays in slices, those with a row to verify first: reading back then need not read all."""
    total = sum(block.values.nbytes for block in every) or 1
    sent = 0
    for block in every:
        for rows in _slices(block):
            values = block.values[rows]
            times, column = _times(block, rows), _scalars(values)
            stream.flush()  # the slice before: it was being written while this one was made
            stream.send_columns(block.entity, times, [column])
            sent += values.nbytes
            tell(sent / total)
    tell(1.0)


def _slices(block: Block) -> list[slice]:
    starts = list(range(0, len(block.t_ns), SLICE))
    return [
        slice(start, start + SLICE) for start in sorted(starts, key=lambda start: not _verified(block, start))
    ]


def _verified(block: Block, start: int) -> bool:
    return any(start <= row < start + SLICE for row in block.verified)


def _scalars(values: FloatArray) -> ComponentColumn:
    """Return an array as a column of lists; `Scalars.columns` takes six times as long over it."""
    import rerun as rr

    offsets = np.arange(len(values) + 1, dtype=np.int32) * np.int32(values.shape[1])
    return rr.ComponentColumn(
        rr.Scalars.descriptor_scalars(), rr.components.ScalarBatch(values), offsets=offsets
    )


def _times(block: Block, rows: slice) -> list[TimeColumn]:
    if block.numbers is None:
        return time_columns(block.t_ns[rows])
    name, numbers = block.numbers
    return time_columns(block.t_ns[rows], name, numbers[rows])
