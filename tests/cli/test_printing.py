"""What is printed after the tables."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urmpipe.printing.terminal import print_recording, progress_bar
from urmpipe_models.spelling import pasted


def test_the_command_that_opens_a_recording_works_without_an_activated_environment(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    command = tmp_path / "bin" / "urmpipe"
    command.parent.mkdir()
    command.touch(mode=0o755)
    monkeypatch.setenv("PATH", str(command.parent))
    print_recording(Path("run.rrd"))
    assert capsys.readouterr().out == "Recording: run.rrd  (open it: urmpipe view run.rrd)\n"
    print_recording(Path("run.rrd"), replaced=True)
    said = "Recording: run.rrd  (open it: urmpipe view run.rrd; it replaced an earlier one)\n"
    assert capsys.readouterr().out == said

    print_recording(Path("joint 3.rrd"))
    quoted = pasted("joint 3.rrd")
    assert capsys.readouterr().out == f"Recording: joint 3.rrd  (open it: urmpipe view {quoted})\n"

    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(command.with_name("python")))
    print_recording(Path("run.rrd"))
    assert capsys.readouterr().out == f"Recording: run.rrd  (open it: {command} view run.rrd)\n"

    monkeypatch.chdir(tmp_path)
    print_recording(Path("run.rrd"))
    within = Path("bin") / "urmpipe"
    assert capsys.readouterr().out == f"Recording: run.rrd  (open it: {within} view run.rrd)\n"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows allows no such names")
def test_nothing_in_a_name_acts_on_the_terminal(urmpipe: Callable[..., Any], tmp_path: Path) -> None:
    rows = "".join(f"{0.005 * k:.3f},{0.001 * k:.3f},0,0\n" for k in range(40))
    (tmp_path / "wanted\x1b[31m.csv").write_text("t,x [m],y [m],z [m]\n" + rows, encoding="utf-8")
    (tmp_path / "done\r\n.csv").write_text("t,x [m],y [m],z [m]\n" + rows, encoding="utf-8")
    (tmp_path / "wrong\x1b.csv").write_text("t,q1\n0,x\n1,2\n", encoding="utf-8")
    for words, code in (
        (["ingest", "wanted\x1b[31m.csv"], 0),
        (["ingest", "wanted\x1b[31m.csv", "--explain"], 0),
        (["compare", "wanted\x1b[31m.csv", "done\r\n.csv"], 0),
        (["ingest", "wrong\x1b.csv"], 2),
    ):
        ran = urmpipe(*words)
        assert ran.code == code
        assert all(line.isprintable() for line in (ran.out + ran.err).split("\n"))
        assert r"\x1b" in ran.out + ran.err


def test_a_bar_shows_the_name_of_a_file_as_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with progress_bar("reading [/b]a\x07.csv") as tell:
        assert tell is not None
        tell(0.5)
    assert r"reading [/b]a\x07.csv" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="its shell quotes otherwise")
def test_what_is_to_be_typed_holds_names_with_spaces_together(
    urmpipe: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    rows = "".join(f"{0.005 * k:.3f},{0.001 * k:.3f},0,0\n" for k in range(40))
    for name in ("wanted path.csv", "run 01.csv"):
        (tmp_path / name).write_text("t,x [m],y [m],z [m]\n" + rows, encoding="utf-8")
    ran = urmpipe("compare", "wanted path.csv", "run 01.csv")
    assert ran.code == 0
    typed = ran.out.rpartition("(open it: ")[2].strip().removesuffix(")")
    *_, view, name = shlex.split(typed)
    assert (view, name) == ("view", "run 01-against-wanted path.rrd")
    assert (tmp_path / name).is_file()


def test_a_report_says_that_it_replaced_an_earlier_one(urmpipe: Callable[..., Any], tmp_path: Path) -> None:
    rows = "".join(f"{0.005 * k:.3f},{0.001 * k:.3f},0,0\n" for k in range(40))
    (tmp_path / "path.csv").write_text("t,x [m],y [m],z [m]\n" + rows, encoding="utf-8")
    assert urmpipe("compare", "path.csv", "path.csv", "-o", "verdict.rrd").code == 0
    assert urmpipe("report", "verdict.rrd").out == "Report: verdict.html  (open it in any browser)\n"
    said = "Report: verdict.html  (open it in any browser; it replaced an earlier one)\n"
    assert urmpipe("report", "verdict.rrd").out == said
