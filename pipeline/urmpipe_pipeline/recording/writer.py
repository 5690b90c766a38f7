"""Write a recording: arrays, metadata, layout and drawing; verified before it gets its name."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.outputs import guarded_output
from urmpipe_pipeline.recording.columns import block_columns
from urmpipe_pipeline.recording.drawing import draw
from urmpipe_pipeline.recording.entities import Block, blocks, printable
from urmpipe_pipeline.recording.identity import APPLICATION_ID, load_rerun, settle_pyarrow
from urmpipe_pipeline.recording.layout import opening_time, viewer_layout
from urmpipe_pipeline.recording.metadata import to_json
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.signal_entities import simulation_blocks
from urmpipe_pipeline.recording.simulation_data import simulation_json
from urmpipe_pipeline.recording.store import PROPERTY
from urmpipe_pipeline.recording.verify import verify
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation

if TYPE_CHECKING:
    from rerun import RecordingStream

Made = TypeVar("Made", bound=Result)

Early: TypeAlias = Callable[[JointLog | Run], None]
"""Takes a log that was read, or a run that lacks its kinematics, to be written meanwhile."""

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
    record(lambda early: result, path, inputs, progress)
    return path


def record(
    make: Callable[[Early], Made],
    path: Path,
    inputs: Sequence[Path] = (),
    progress: Callable[[float], None] | None = None,
) -> Made:
    """Make a result and write its recording, some of it while the rest is still being computed.

    Rerun takes long to import, and longer to write a log than urmpipe to compute its kinematics: so it is
    imported while the log is read, and the joints are on their way while the rest is computed.

    Args:
        make: Returns the result. It is given a function that it may call with the log once it is read, and
            with the run before its kinematics are computed: what they have is written beside. Until it
            calls that function, or returns, it must not import what Rerun imports too (see `load_rerun`).
        path: The file (.rrd); replaced if it is a recording of urmpipe's.
        inputs: The files the result is made from: none of them is replaced.
        progress: Told the share of the data that is written, 0..1.

    Returns:
        The result, with the recording's path in it.

    Raises:
        OutputError: If the file may not be written there, or did not read back as it was written.
    """
    with guarded_output(path, inputs, "recording") as part:
        with _Sender(part) as sender, ThreadPoolExecutor(1) as beside:
            loading = beside.submit(load_rerun)
            under_way: list[Future[None]] = []

            def ready() -> None:
                """Wait until Rerun is there and pyarrow is settled: what is sent imports nothing then."""
                loading.result()
                settle_pyarrow()

            def early(known: JointLog | Run) -> None:
                """Write what is known already, beside."""
                ready()
                under_way.append(beside.submit(sender.send, blocks(known)))

            result = make(early)
            ready()
            every, metadata = _content(result)
            under_way.append(beside.submit(sender.send, every, progress))
            _describe(sender.stream(), result, every, metadata)
            for sending in under_way:
                sending.result()
        verify(part, path, every, metadata)
    return replace(result, recording=path)


class _Sender:
    """Sends arrays to a recording file, each once; the file is opened when the first is there."""

    def __init__(self, part: Path) -> None:
        self._part = part
        self._stream: RecordingStream | None = None
        self._strict_before = False
        self._opening = threading.Lock()
        self._sent: set[str] = set()

    def __enter__(self) -> _Sender:
        return self

    def __exit__(self, *exception: object) -> None:
        """Write the footer and let go of the file."""
        if self._stream is not None:
            import rerun as rr

            self._stream.flush()
            self._stream.disconnect()
            rr.set_strict_mode(self._strict_before)

    def stream(self) -> RecordingStream:
        """Return the stream into the file, which is opened by the first who asks."""
        with self._opening:
            return self._stream or self._open()

    def _open(self) -> RecordingStream:
        import rerun as rr

        stream = rr.RecordingStream(APPLICATION_ID, send_properties=False)
        if not rr.is_enabled(stream):
            raise OutputError("Rerun is switched off by the environment variable RERUN; allowed: unset or on")
        stream.save(self._part)
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        # Strict: Rerun raises where it would warn and drop data, such as for a column of the wrong length.
        self._strict_before = rr.strict_mode()
        rr.set_strict_mode(True)
        self._stream = stream
        return stream

    def send(self, every: Sequence[Block], progress: Callable[[float], None] | None = None) -> None:
        """Send the arrays that were not sent yet, in slices.

        Slices with a row to verify go first: reading back then need not read all.
        """
        stream = self.stream()
        due = [block for block in every if block.entity not in self._sent]
        total = sum(block.values.nbytes for block in every) or 1
        done = total - sum(block.values.nbytes for block in due)
        if progress and done:  # what was sent early counts
            progress(done / total)
        slices = [(block, rows) for block in due for rows in _slices(block)]
        for number, (block, rows) in enumerate(slices):
            values = block.values[rows]
            times, column = block_columns(block, rows)
            if number % AHEAD == 0:
                stream.flush()  # waits until all that was sent is in the file
            self._refuse_full_disk()
            stream.send_columns(block.entity, times, [column])
            done += values.nbytes
            if progress:
                progress(done / total)
        self._sent |= {block.entity for block in due}

    def _refuse_full_disk(self) -> None:
        """Raise before the disk is full: Rerun's file thread would wait forever then."""
        if shutil.disk_usage(self._part.parent).free < SPARE:
            raise OutputError(
                Finding(f"found less than {SPARE >> 20} MB free on the disk", str(self._part.parent))
            )


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
