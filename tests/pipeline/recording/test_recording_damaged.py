"""Recordings in which a byte changed: one line, or the result as it was; never other values, and no abort."""

from __future__ import annotations

import re
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import refusal
from recordable import build_run
from same_results import assert_same
from urmpipe_models.errors import RecordingError
from urmpipe_models.processes import module_command, module_environment
from urmpipe_pipeline.results import read_recording, write_recording

HOW = "reading it ended the process: Aborted (SIGABRT)"
ABORTED = f"found a damaged recording ({HOW}), allowed: one as it was written"


def changed(path: Path, at: int, copy: Path) -> Path:
    """Return a copy of a file in which the last bit of a byte is another."""
    content = bytearray(path.read_bytes())
    content[at] ^= 0x01
    copy.write_bytes(content)
    return copy


@pytest.mark.slow
def test_a_byte_that_aborts_the_reader_is_one_line(tmp_path: Path) -> None:
    """Changed tokens of the compression (LZ4: how much is copied) abort it: they are tried until one does."""
    path = write_recording(build_run(rows=5), tmp_path / "whole.rrd")
    whole, tokens = read_recording(path), re.finditer(rb"\x00\x13@\x11", path.read_bytes())
    said = ""
    for number, token in enumerate(tokens):
        one = changed(path, token.start() + 1, tmp_path / f"{number}.rrd")
        try:
            assert_same(read_recording(one), whole)
        except RecordingError as error:
            said = str(error).removeprefix(f"{one}: ")
        if said.startswith("found a damaged recording (reading"):
            break
    assert said == ABORTED
    line = module_command(
        "urmpipe_pipeline.subprocess_reader", "urmpipe_pipeline.recording.file_check", str(one)
    )
    ended = subprocess.run(line, env=module_environment(), capture_output=True, timeout=100, check=False)
    assert ended.returncode == -signal.SIGABRT  # else nothing would need a process of its own


def test_a_changed_value_is_an_error(tmp_path: Path) -> None:
    run = build_run(rows=50)
    path = write_recording(run, tmp_path / "whole.rrd")
    content = path.read_bytes()
    value = next(one.tobytes() for one in np.ravel(run.log.q) if content.count(one.tobytes()) == 1)
    one = changed(path, content.index(value), tmp_path / "changed.rrd")
    assert (
        refusal(RecordingError, read_recording, one)
        == f"{one}: found other values in /log/q than were written (by their checksum)"
    )
    lazily: Any = read_recording(one, lazy=True)
    with pytest.raises(RecordingError):
        np.asarray(lazily.log.q)


@pytest.mark.slow
def test_a_changed_letter_of_the_metadata_is_an_error(tmp_path: Path) -> None:
    path = write_recording(build_run(rows=5), tmp_path / "whole.rrd")
    run: Any = read_recording(path)
    created, content, said = run.provenance.created.encode()[:19], path.read_bytes(), set()
    for number, found in enumerate(re.finditer(re.escape(created), content)):
        one = changed(path, found.start(), tmp_path / f"{number}.rrd")
        said.add(refusal(RecordingError, read_recording, one).removeprefix(f"{one}: "))
    assert said == {"found damaged metadata (by their checksum), allowed: what urmpipe wrote"}
