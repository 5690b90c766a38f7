"""Named pipes that nobody writes to, and compilers that are stopped: a command ends, and leaves nothing."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from urmpipe_datasets import LOGS
from urmpipe_models.processes import module_environment

HANGS = 120.0
"""Time in [s] after which a command hangs: each takes a second or two."""

COMMAND = [sys.executable, "-P", "-m", "urmpipe"]

NO_RECORDING = "found no recording of urmpipe, allowed: a recording (.rrd) that urmpipe wrote"
PIPE = "found a pipe or a device, allowed: a recording (.rrd) that urmpipe wrote"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("report pipe.rrd", f"pipe.rrd: {NO_RECORDING}"),
        ("export pipe.rrd", f"pipe.rrd: {NO_RECORDING}"),
        ("compare LOG --robot urm6 --baseline pipe.rrd", f"pipe.rrd: {NO_RECORDING}"),
        ("report folder.rrd", f"folder.rrd: {NO_RECORDING}"),
        ("view pipe.rrd", f"pipe.rrd: {PIPE}"),
        ("view socket.rrd", f"socket.rrd: {PIPE}"),
        ("fmu build pipe.py", "pipe.py: found a pipe or a device, allowed: a file"),
    ],
)  # fmt: skip
def test_what_is_no_file_is_one_line(words: str, said: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.rrd")
    os.mkfifo(tmp_path / "pipe.py")
    (tmp_path / "folder.rrd").mkdir()
    line = [*COMMAND, *words.replace("LOG", str(LOGS / "matlab.csv")).split()]
    with socket.socket(socket.AF_UNIX) as there:
        there.bind(str(tmp_path / "socket.rrd"))
        done = subprocess.run(
            line,
            cwd=tmp_path,
            env=module_environment(),
            capture_output=True,
            text=True,
            timeout=HANGS,
            check=False,
        )
    assert (done.returncode, done.stderr) == (2, f"error: {said}\n")


def test_completion_does_not_wait_for_a_named_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    asked = {
        "_URMPIPE_COMPLETE": "bash_complete",
        "COMP_WORDS": "urmpipe ingest pipe.csv --time ",
        "COMP_CWORD": "4",
    }
    done = subprocess.run(
        COMMAND, cwd=tmp_path, env=module_environment() | asked,
        capture_output=True, text=True, timeout=HANGS,
        check=False,
    )  # fmt: skip
    assert done.stdout == "plain,none\n"


COMPILER = """#!/bin/sh
touch "$TMPDIR/kept.s"
sleep 1000 &
echo $! > child.part && mv child.part "$STARTED"
wait
"""
"""A compiler that puts a file where it is told to, and starts a process that goes on, as cc does with cc1."""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_build_that_is_stopped_leaves_nothing_of_the_compiler(number: int, tmp_path: Path) -> None:
    temporary, out, started = tmp_path / "temporary", tmp_path / "out", tmp_path / "started"
    temporary.mkdir()
    out.mkdir()
    (compiler := tmp_path / "slow-cc").write_text(COMPILER)
    compiler.chmod(0o755)
    told = {"CC": str(compiler), "TMPDIR": str(temporary), "STARTED": str(started)}
    line = [*COMMAND, "fmu", "build", "repolarizer", "-s", "joints=1", "--backend", "native", "-o", str(out)]
    with subprocess.Popen(
        line, env=module_environment() | told, stderr=subprocess.PIPE, text=True
    ) as process:
        end = time.monotonic() + HANGS
        while not started.exists() and process.poll() is None and time.monotonic() < end:
            time.sleep(0.01)
        process.send_signal(number)
        _, said = process.communicate(timeout=HANGS)
    assert (process.returncode, said.strip()) == (2, "error: stopped; no file is left incomplete")
    assert [*temporary.iterdir(), *out.iterdir()] == []
    state = Path(f"/proc/{int(started.read_text())}/stat")
    assert not state.exists() or ") Z " in state.read_text()  # what it was is kept until somebody asks
