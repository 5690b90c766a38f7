"""The exit code of every command: 0 done or pass, 1 fail, 2 bad input or usage."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click
import pytest

from cases import CaseFile
from command_contexts import EVERY

FRESH = """
0 urmpipe --help
0 urmpipe ingest -h
0 urmpipe robot list
0 urmpipe robot show urm6
0 urmpipe robot export urm6
0 urmpipe plan cube:wall,a=0.02,r=0.001,x=1.7,y=0,z=1 --robot irb60
0 urmpipe network list
0 urmpipe network drive four-bar crank=0:90deg --steps 9
1 urmpipe network drive four-bar theta4=85deg:160deg --steps 50
0 urmpipe fmu build dc_drive --backend python
0 urmpipe simulate --list
2 urmpipe simulate
2 urmpipe ingest missing.csv
2 urmpipe report missing.rrd
2 urmpipe igest log.csv
"""
CASES = [(int(line[0]), line[2:]) for line in FRESH.split("\n") if line]


@pytest.mark.slow
@pytest.mark.parametrize(("code", "line"), CASES)
def test_the_installed_program_exits_with_this_code(code: int, line: str, tmp_path: Path) -> None:
    program = Path(sys.executable).with_name("urmpipe")
    words = [program, *line.split()[1:]]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, "an error in urmpipe" in done.stderr) == (code, False), done.stderr


FILES = [CaseFile(path) for path in sorted(Path(__file__).parent.glob("*.cases"))]
CALLS = [(answer[0], call) for file in FILES for case in file.cases for call, answer in case.calls if answer]


@pytest.mark.parametrize("context", EVERY, ids=lambda one: one.command_path)
def test_every_command_shows_its_codes_in_the_cases(context: click.Context) -> None:
    shown = [*CALLS, *((f"exit {code}", line) for code, line in CASES)]
    codes = {code[5:6] for code, line in shown if line.startswith(context.command_path)}
    says_fail = "1 " in (context.command.help or "").partition("Exit codes:")[2]
    assert codes
    assert codes >= {"0", "1", "2"} or not says_fail
