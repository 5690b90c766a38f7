"""How a recording gets into its file: by a pipe, or held in memory where a system has none with a name."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import pytest
import rerun as rr
from rerun.chunk import RrdReader

from recordable import build_run
from urmpipe_pipeline.recording.writer import Sink, write_into
from urmpipe_pipeline.results import write_recording


def send(sink: Sink) -> str:
    """Send ten rows."""
    times = [rr.TimeColumn("row", sequence=range(10))]
    sink.stream.send_columns("/q", times, rr.Scalars.columns(scalars=range(10)))
    sink.flush()
    return "sent"


@pytest.mark.parametrize("piped", [True, False])
def test_both_ways_write_the_same_and_raise_an_error_of_the_sender(tmp_path: Path, *, piped: bool) -> None:
    path = tmp_path / "one.rrd"
    assert write_into(path, send, piped=piped) == "sent"
    assert "/q rows=10" in RrdReader(path).store().summary()

    def fail(sink: Sink) -> None:
        """Send, and fail."""
        send(sink)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_into(tmp_path / "two.rrd", fail, piped=piped)


def test_a_file_that_is_closed_early_is_an_error_of_the_sink(tmp_path: Path) -> None:
    """A command that is stopped may close the file while rows are on their way."""
    with (tmp_path / "one.rrd").open("xb") as file:
        sink = Sink(rr.RecordingStream("closed"), file, piped=True)
    times = [rr.TimeColumn("row", sequence=range(10))]
    sink.stream.send_columns("/q", times, rr.Scalars.columns(scalars=range(10)))
    with pytest.raises(OSError, match="closed file"):
        sink.finish()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counted in /proc")
def test_recordings_leave_no_thread_behind(tmp_path: Path) -> None:
    run, counts = build_run(rows=3), []
    for number in range(4):
        write_recording(run, tmp_path / f"{number}.rrd")
        counts.append((len(list(Path("/proc/self/task").iterdir())), threading.active_count()))
    assert len(set(counts[1:])) == 1, counts
