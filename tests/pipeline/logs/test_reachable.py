"""Files that are none on a disk, and files that change while they are read."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from asserting import refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.logs import read_log
from urmpipe_pipeline.logs.formats import files
from urmpipe_pipeline.logs.formats.files import unchanged

LOG = b"t,q1\n" + b"".join(b"%.2f,%.4f\n" % (0.01 * k, 0.001 * k) for k in range(30))
KEPT = "allowed: a file, which can be read more than once"

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/fd").exists(), reason="numbers of open files are Linux's"
)


def test_a_pipe_of_a_shell_is_read() -> None:
    read, write = os.pipe()
    try:
        os.write(write, LOG)
        os.close(write)
        path = Path(f"/dev/fd/{read}")
        assert read_log([path]).rows == 30
        assert read_log([path]).rows == 30  # its bytes are kept
    finally:
        os.close(read)


def test_a_pipe_that_brings_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(files, "PIPE_TIMEOUTS", (0.02, 0.02))
    read, write = os.pipe()
    try:
        said = refusal(LogError, read_log, [Path(f"/dev/fd/{read}")])
    finally:
        os.close(read)
        os.close(write)
    assert said == f"/dev/fd/{read}: found a pipe that brings nothing for 0.04 s, allowed: a log"
    assert capsys.readouterr().err == f"waiting for /dev/fd/{read}, a pipe that brings nothing so far\n"


def test_a_pipe_that_brings_too_much(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "MAX_PIPED", 100)
    read, write = os.pipe()
    try:
        os.write(write, LOG)
        said = refusal(LogError, read_log, [Path(f"/dev/fd/{read}")])
    finally:
        os.close(read)
        os.close(write)
    assert said == f"/dev/fd/{read}: found more than 0 GiB in a pipe, allowed: a file"


def test_what_is_no_file(tmp_path: Path) -> None:
    """Nothing of them is opened, which could wait for ever."""
    os.mkfifo(pipe := tmp_path / "pipe.csv")
    assert refusal(LogError, read_log, [pipe]) == f"{pipe}: found a pipe with a name, {KEPT}"
    zero = Path("/dev/zero")
    assert refusal(LogError, read_log, [zero]) == f"/dev/zero: found a device, {KEPT}"
    with socket.socket(socket.AF_UNIX) as there:
        there.bind(str(tmp_path / "s"))
        assert refusal(LogError, read_log, [tmp_path / "s"]) == f"{tmp_path / 's'}: found a socket, {KEPT}"


def test_names_of_no_file() -> None:
    assert refusal(LogError, read_log, [Path("a\0b")]) == "found 'a\\x00b', allowed: the name of a file"
    long = Path("a" * 300)
    assert refusal(LogError, read_log, [long]) == f"{long}: cannot be read: File name too long"


@pytest.mark.parametrize(
    "change", [b"", LOG[:100], LOG + b"0.30,0.0\n", None], ids=["none", "cut", "more", "gone"]
)
@pytest.mark.parametrize("wrong", [True, False])
def test_a_file_that_changes_is_refused(tmp_path: Path, change: bytes | None, wrong: bool) -> None:
    """Whatever else was found wrong with it meanwhile comes of the change."""
    (path := tmp_path / "log.csv").write_bytes(LOG)

    def read() -> None:
        with unchanged([path]):
            path.unlink() if change is None else path.write_bytes(change)
            if wrong:
                raise LogError("found 1 cell, allowed: 2")

    said = f"{path}: changed while it was read, allowed: a file that no program still writes"
    assert refusal(LogError, read) == said
