"""What is printed after the tables."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from urmpipe.printing import print_recording


def test_the_command_that_opens_a_recording_works_without_an_activated_environment(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    command = tmp_path / "bin" / "urmpipe"
    command.parent.mkdir()
    command.touch(mode=0o755)
    monkeypatch.setenv("PATH", str(command.parent))
    print_recording(Path("run.rrd"))
    assert capsys.readouterr().out == "Recording: run.rrd  (open it: urmpipe view run.rrd)\n"

    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(command.with_name("python")))
    print_recording(Path("run.rrd"))
    assert capsys.readouterr().out == f"Recording: run.rrd  (open it: {command} view run.rrd)\n"

    monkeypatch.chdir(tmp_path)
    print_recording(Path("run.rrd"))
    within = Path("bin") / "urmpipe"
    assert capsys.readouterr().out == f"Recording: run.rrd  (open it: {within} view run.rrd)\n"
