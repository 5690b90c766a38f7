"""What is printed after the tables."""

from __future__ import annotations

import json
import re
import sys
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urmpipe.printing.terminal import progress_bar, recording_line
from urmpipe_models.errors import shell_quote
from urmpipe_models.robots.catalogue import load_robot


def test_the_command_that_opens_a_recording_works_without_an_activated_environment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    command = tmp_path / "bin" / "urmpipe"
    command.parent.mkdir()
    command.touch(mode=0o755)

    def opened(name: str, is_replaced: bool = False) -> str:
        line = recording_line(Path(name), is_replaced)
        return line.removeprefix(f"Recording: {name}  (open it: ").removesuffix(")")

    monkeypatch.setenv("PATH", str(command.parent))
    assert opened("run.rrd") == "urmpipe view run.rrd"
    assert opened("run.rrd", is_replaced=True) == "urmpipe view run.rrd; it replaced an earlier one"
    assert opened("joint 3.rrd") == f"urmpipe view {shell_quote('joint 3.rrd')}"
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(command.with_name("python")))
    assert opened("run.rrd") == f"{command} view run.rrd"
    monkeypatch.chdir(tmp_path)
    assert opened("run.rrd") == f"{Path('bin', 'urmpipe')} view run.rrd"


def test_a_bar_shows_the_name_of_a_file_as_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with progress_bar("reading [/b]a\x07.csv") as tell:
        assert tell is not None
        tell(0.5)
    assert r"reading [/b]a\x07.csv" in capsys.readouterr().err


CLAIM = "PASS  all logs within tolerance"
LETTERS = "\x85\x9b\x7f\u061c\u200e\u200f\u2028\u2029\u202a\u202e\u2066\u2069"
HELD = f"x\n{CLAIM}{LETTERS}<b>&"
"""A name that XML can hold: a line of its own that looks like a verdict, C1 and marks of direction."""

NAME = f"{HELD}\x1b[31m\r\x07"
ARM = f"""name = {json.dumps(NAME)}
kind = "joints"
description = {json.dumps(NAME)}
source = {json.dumps(NAME)}
[[joints]]
name = {json.dumps(f"j{NAME}")}
origin = {{ translation = [0, 0, 0.1] }}
[[joints]]
name = "second"
origin = {{ translation = [0.2, 0, 0] }}
axis = [0, 1, 0]
[tip]
translation = [0.3, 0, 0]
[[inertials]]
joint = "second"
mass = 2
centre = [0.1, 0, 0]
inertia = [0.1, 0.1, 0.1, 0, 0, 0]
source = {json.dumps(NAME)}
"""


def clean(text: str, kept: str = "\n\t") -> bool:
    """Tell whether no letter acts on a terminal or others, and no line claims what a name says."""
    acting = re.findall(f"[\x00-\x1f{LETTERS}\x80-\x9f]", text)
    return set(acting) <= set(kept) and not re.search(rf"^\s*{CLAIM}", text, re.MULTILINE)


def test_no_name_breaks_a_line_of_what_robot_prints_and_writes(
    urmpipe: Callable[..., Any], tmp_path: Path
) -> None:
    """JSON, TOML and XML read back as the name, but for what XML cannot hold."""
    (tmp_path / "arm.toml").write_text(ARM, encoding="utf-8")
    for words in (
        ["show", "arm.toml", "--picture", "arm.svg"],
        ["export", "arm.toml", "-o", "same.toml"],
        ["export", "arm.toml", "-o", "same.urdf"],
        ["equations", "arm.toml", "-o", "arm.c"],
        ["equations", "arm.toml"],
    ):
        ran = urmpipe("robot", *words)
        assert (ran.code, clean(ran.out + ran.err)) == (0, True)
    shown = urmpipe("robot", "show", "arm.toml", "--json").out
    assert clean(shown)
    assert json.loads(shown)["name"] == NAME
    for name in ("arm.svg", "arm.c", "same.toml", "same.urdf"):
        assert clean((tmp_path / name).read_text(encoding="utf-8"))
    ET.parse(tmp_path / "arm.svg")
    assert tomllib.loads((tmp_path / "same.toml").read_text(encoding="utf-8"))["name"] == NAME
    read_back = load_robot(tmp_path / "same.urdf")
    assert read_back.name == f"{HELD}\\x1b[31m\r\\x07"
    assert read_back.coordinates == (f"j{read_back.name}", "second")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows allows no such names")
def test_no_name_breaks_a_line_of_a_verdict(urmpipe: Callable[..., Any], tmp_path: Path) -> None:
    """Of a robot, a file or a column: in the terminal, JSON, JUnit, CSV, the report, exports and maps."""
    (tmp_path / "arm.toml").write_text(ARM, encoding="utf-8")
    wanted, done, column = f"wanted{NAME}.csv", f"done{NAME}.csv", "q1\u202e\x9b\x7f\u2066"
    for name, more in ((wanted, 0.0), (done, 0.5)):
        rows = "".join(f"{0.01 * k:.2f},{0.01 * k + more:.4f},{-0.01 * k:.4f}\n" for k in range(60))
        (tmp_path / name).write_text(f"t [s],{column} [rad],q2 [rad]\n{rows}", encoding="utf-8")
    read, files = ["--robot", "arm.toml"], ["--junit", "v.xml", "--csv", "v.csv"]
    for words, code in (
        (["compare", wanted, done, *read, *files, "-o", "v.rrd"], 1),
        (["compare", wanted, done, *read, "-o", "v.rrd", "-q"], 1),
        (["report", "v.rrd", "-o", "v.html"], 0),
        (["export", "v.rrd", "--to", "csv", "-o", "rows.csv"], 0),
        (["ingest", done, *read, "--write-map", "map.toml", "--audit", "audit.csv", "-o", "done.rrd"], 0),
        (["ingest", done, *read, "--explain"], 0),
        (["diagnose", wanted, done, *read], 1),
        (["compare", wanted, f"{NAME}.csv", *read], 2),
    ):
        ran = urmpipe(*words)
        assert (ran.code, clean(ran.out + ran.err)) == (code, True), words[0]
        assert r"\x1b" in ran.out + ran.err or words[0] in ("report", "export"), words[0]
    told = urmpipe("compare", wanted, done, *read, "-o", "v.rrd", "--json").out
    assert clean(told)
    assert json.loads(told)["runs"][0]["name"] == f"done{NAME}"
    for name in ("v.xml", "v.csv", "v.html", "rows.csv", "map.toml", "audit.csv"):
        written = (tmp_path / name).read_bytes().decode()
        assert clean(re.sub("<script>.*?</script>", "", written, flags=re.DOTALL)), name  # not of names
    ET.parse(tmp_path / "v.xml")
