"""What a shell completes: words, files of a kind, kinds of a tolerance, columns of the log on the line."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete

from command_contexts import EVERY, NAMES
from urmpipe.main import cli
from urmpipe.parameters.completion import CRITERIA, DEVIATIONS, SHARES
from urmpipe.parameters.kinds import FORMS, SOURCES
from urmpipe.parameters.outputs import Export
from urmpipe.parameters.param import params_of
from urmpipe_models import math3d
from urmpipe_pipeline.comparison.verdict import UNITS
from urmpipe_pipeline.logs import source_names
from urmpipe_pipeline.tables import FORMATS

FREE = {
    "--planes", "--band", "--cycles", "--base", "--tool", "--base-link", "--tip-link", "--period", "--tsp",
    "--start", "--restarts", "--seed", "--velocity", "--velocities", "--acceleration", "--jerk", "--limit",
    "--force", "--step", "--duration", "--timeout", "--q", "--block", "--figure-names",
    "--sheet", "--topic", "--side", "--episode", "--rows", "--names", "--signs", "--offsets",
    "--figure-font", "--figure-dpi", "--steps", "--branch", "--point", "--wrenches", "--torques",
}  # fmt: skip
"""Options whose values are numbers, or names in a file that is slow to read."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a file of each kind."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text("t,q1,q2\n0,0.1,0.2\n0.1,0.1,0.2\n")
    (tmp_path / "bare.csv").write_text("0,0.1,0.2\n0.1,0.1,0.2\n")
    (tmp_path / "noise.bin").write_bytes(bytes(range(256)))
    (tmp_path / "sub").mkdir()
    for name in ("a.rrd", "b.RRD", "arm.urdf", "arm.toml", ".hidden.rrd", "sub/c.rrd"):
        (tmp_path / name).touch()
    return tmp_path


def completions(line: str, begun: str) -> list[str]:
    """What is offered behind a line; files that the shell lists by itself as <file> or <dir>."""
    complete = ShellComplete(cli, {}, "urmpipe", "_URMPIPE_COMPLETE")
    found = complete.get_completions(shlex.split(line), begun)
    return [one.value if one.type == "plain" else f"<{one.type}>" for one in found]


@pytest.mark.parametrize(
    ("line", "begun", "offered"),
    [
        ("compare log.csv --tolerance", "a", ["axis=", "angle="]),
        ("compare log.csv --tolerance", "axis=3.5m", ["axis=3.5m", "axis=3.5mm"]),
        ("compare log.csv --tolerance", "axis=1mm,a", ["axis=1mm,angle="]),
        ("compare log.csv --tolerance", "angle=.5", ["angle=.5rad", "angle=.5mrad", "angle=.5deg"]),
        ("compare log.csv --tolerance", "axis=1mm,c", ["axis=1mm,coverage="]),
        ("compare log.csv --tolerance", "judged=4", ["judged=4%"]),
        ("iso log.csv --tolerance", "c", []),
        ("iso log.csv --tolerance", "AP=1mm,AV", ["AP=1mm,AV="]),
        ("iso log.csv --tolerance", "AV=5", ["AV=5%"]),
        ("compare log.csv --baseline a.rrd --noise", "no", ["norm="]),
        ("compare log.csv --baseline a.rrd --noise", "c", []),
        ("compare log.csv --sync", "", ["stamps", "start", "auto"]),
        ("compare log.csv --align", "b", ["base+tool"]),
        ("compare log.csv --sides", "d", ["desired,actual"]),
        ("compare log.csv bare.csv --joints", "", ["t", "q1", "q2"]),
        ("compare log.csv --joints", "q1,", ["q1,t", "q1,q2"]),
        ("compare noise.bin nosuch.csv --joints", "", []),
        ("ingest log.csv --time", "", ["none", "t", "q1", "q2"]),
        ("ingest log.csv --unit", "", ["rad", "deg", "t=", "q1=", "q2="]),
        ("ingest log.csv --unit", "q1=m", ["q1=mrad", "q1=m", "q1=mm"]),
        ("ingest log.csv --interval", "q", ["q1=", "q2="]),
        ("ingest --delimiter", "s", ["semicolon", "spaces"]),
        ("ingest --layout", "fl", ["flat:", "flat-by-joint:"]),
        ("ingest --source", "ros", ["ros", "ros2"]),
        ("ingest", "", ["<file>"]),
        ("ingest --map", "", ["<dir>", "arm.toml"]),
        ("view", "", ["<dir>", "a.rrd", "b.RRD"]),
        ("view", ".", ["<dir>", ".hidden.rrd"]),
        ("view", "sub/", ["<dir>", "sub/c.rrd"]),
        ("view", "nosuch/", ["<file>"]),
        ("view", "log", ["<file>"]),
        ("compare log.csv --robot", "arm", ["<dir>", "arm.toml", "arm.urdf", "arm6"]),
        ("robot show", "ur5", ["<file>", "ur5", "ur5e"]),
        ("network check", "four", ["<file>", "four-bar"]),
        ("network check four-bar --set", "", ["crank="]),
        ("simulate log-to-delta --set", "robot=ur5", ["robot=ur5", "robot=ur5e"]),
        ("plan", "cube", ["<file>", "cube:wall,", "cube:diagonal,"]),
        ("fmu build dc_drive --platforms", "win64,", ["win64,linux64"]),
        ("report a.rrd --figures", "", ["<dir>"]),
        ("report a.rrd --formats", "pdf,", ["pdf,svg", "pdf,png"]),
        ("demo -o", "", ["<dir>"]),
    ],
)
def test_a_value_completes(folder: Path, line: str, begun: str, offered: list[str]) -> None:
    assert completions(line, begun) == offered


def test_a_name_that_needs_quotes_is_left_to_the_shell(folder: Path) -> None:
    (folder / "my run.rrd").touch()
    assert completions("view", "m") == completions("view", "") == ["<file>"]


@pytest.mark.parametrize("context", EVERY, ids=NAMES)
def test_every_option_completes_unless_its_value_is_free(folder: Path, context: click.Context) -> None:
    operands = {
        "fmu build": "log_source",
        "simulate": "log-to-delta --set log=log.csv",
        "network check": "four-bar",
        "network solve": "four-bar",
    }
    words = context.command_path.removeprefix("urmpipe ")
    line = f"{words} {operands.get(words, 'log.csv')}"
    options = [one for one in context.command.params if isinstance(one, click.Option)]
    valued = [one for one in options if not one.is_flag and not one.hidden and not FREE & set(one.opts)]
    if words == "ik":  # a length here, and kinds elsewhere
        valued = [one for one in valued if "--tolerance" not in one.opts]
    silent = [one.opts for one in valued if not completions(f"{line} {one.opts[0]}", "")]
    assert silent == []


def test_words_are_those_of_the_models_and_the_pipeline() -> None:
    assert {**DEVIATIONS, **SHARES, **CRITERIA} == UNITS
    assert source_names() == SOURCES
    assert FORMS == math3d.FORMS
    assert params_of(Export)["to"].kind.allowed == ", ".join(FORMATS)


def test_completing_loads_nothing_heavy() -> None:
    code = """
import sys
from click.shell_completion import ShellComplete
from urmpipe.main import cli
complete = ShellComplete(cli, {}, "urmpipe", "_URMPIPE_COMPLETE").get_completions
for option in ("tolerance", "joints", "source", "unit", "align", "baseline", "junit", "map"):
    complete(["compare", "log.csv", f"--{option}"], "")
light = set(sys.modules)
for line in (["robot", "show"], ["simulate"], ["fmu", "list"], ["network", "check"]):
    complete(line, "")
complete(["fmu", "build", "dc_drive", "-s"], "")
print({"numpy", "pandas", "scipy", "rerun", "pyarrow", "plotly", "rich"} & light)
print({"pandas", "scipy", "rerun", "pyarrow", "plotly", "rich"} & set(sys.modules))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\nset()\n"


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes_behind_signs_that_split_its_words(folder: Path) -> None:
    program = folder / "urmpipe"
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m urmpipe "$@"\n')
    program.chmod(0o755)
    lines = {
        "urmpipe compare log.csv --tolerance axis=1mm,no": "axis = 1mm,no",
        "urmpipe compare log.csv --robot=ur5": "--robot = ur5",
        "urmpipe compare log.csv --sync ": "",
        "urmpipe view s": "s",
    }
    script = ['compopt() { :; }; eval "$(_URMPIPE_COMPLETE=bash_source ./urmpipe)"']  # no readline here
    for line, last in lines.items():
        words = " ".join(f"'{word}'" for word in ["urmpipe", *(last.split() or [""])])
        script += [
            f"COMP_LINE='{line}' COMP_POINT={len(line)} COMP_WORDS=({words})",
            'COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _urmpipe_completion ./urmpipe; echo "${COMPREPLY[*]}"',
        ]
    done = subprocess.run(
        ["bash", "--norc", "-c", "\n".join(script)], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == ["1mm,norm=", "ur5 ur5e", "stamps start auto", "sub"]
