"""view as a user runs it; the viewer itself is looked at in tests/pipeline/recording."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urmpipe_datasets import LOGS
from urmpipe_models.errors import ViewerError
from urmpipe_pipeline.recording.viewer import refuse_without_display

RunCommand = Callable[..., Any]
"""What the fixture `urmpipe` gives: arguments in; exit code, standard output and standard error out."""

NO_DISPLAY = (
    "found no display (neither DISPLAY nor WAYLAND_DISPLAY is set), allowed: a copy on a computer with one,"
    " there: urmpipe view run.rrd; or a browser there, here: rerun --serve-web --bind 127.0.0.1 run.rrd,"
    " there: ssh -L 9090:127.0.0.1:9090 -L 9876:127.0.0.1:9876 THIS-HOST, and the address that rerun prints"
)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux may be without a display")
def test_without_a_display_it_says_what_to_do(urmpipe: RunCommand, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    urmpipe("ingest", LOGS / "path.csv", "-q", "-o", "run.rrd")
    ran = urmpipe("view", "run.rrd")
    assert (ran.code, ran.out, ran.err) == (2, "", f"error: {NO_DISPLAY}\n")


@pytest.mark.parametrize(
    ("environment", "platform"),
    [
        ({"DISPLAY": ":0"}, "linux"),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux"),
        ({}, "win32"),
        ({}, "darwin"),
    ],
)
def test_where_there_is_a_display_it_is_used(environment: dict[str, str], platform: str) -> None:
    refuse_without_display([Path("run.rrd")], environment, platform)


def test_an_empty_variable_is_no_display() -> None:
    with pytest.raises(ViewerError) as caught:
        refuse_without_display([Path("run.rrd")], {"DISPLAY": ""}, "linux")
    assert str(caught.value) == NO_DISPLAY


def test_all_files_that_are_no_recordings_are_refused_at_once(urmpipe: RunCommand, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,q1\n")
    ran = urmpipe("view", "log.csv", "none.rrd")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == (
        "error: log.csv: found no Rerun recording, allowed: a recording (.rrd) that urmpipe wrote\n"
        "error: none.rrd: found no such file, allowed: a recording (.rrd) that urmpipe wrote\n"
    )


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays by number are Linux's")
def test_a_display_that_does_not_answer_is_one_line(
    urmpipe: RunCommand, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":4711")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    urmpipe("ingest", LOGS / "path.csv", "-q", "-o", "run.rrd")
    ran = urmpipe("view", "run.rrd")
    assert ran.code == 2
    assert ran.err.startswith(
        "error: the viewer ended with exit code 1, allowed: a display and a graphics driver that it can use;"
        " what is wrong it says itself: "
    )
    assert ran.err.count("\n") == 1


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="needs a display: apt-get install xvfb")
def test_it_stays_until_it_is_interrupted(urmpipe: RunCommand, tmp_path: Path) -> None:
    urmpipe("ingest", LOGS / "path.csv", "-q", "-o", "run.rrd")
    view = [sys.executable, "-m", "urmpipe", "view", "run.rrd"]
    done = subprocess.run(
        ["xvfb-run", "-a", "timeout", "--signal=INT", "20", *view],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("", "Closed.\n")
