"""docs/python.md against the code: its ten lines do the same on both sides, its tables are complete."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shlex
from inspect import signature
from pathlib import Path

import click
import numpy as np
import pytest

import urmpipe
from asserting import there
from urmpipe.main import cli, find_commands, run
from urmpipe_datasets import LOGS

PAGE = (Path(__file__).parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
BLOCKS = [
    re.sub("^    ", "", one, flags=re.MULTILINE)
    for one in re.findall(r"(?:^    .*\n|^\n(?=    ))+", PAGE, re.MULTILINE)
]
COMMAND_LINES = BLOCKS[0].strip().split("\n")
PYTHON_LINES = BLOCKS[1].strip().split("\n")
ROWS = 60
SIMULATE = ("urmpipe simulate one-drive", 'urmpipe.simulate("one-drive"')
"""Run for docs/drives.md and README.md: the FMUs of its drive take long to build."""


@pytest.fixture(scope="module")
def sides(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A folder in which the commands were run, and one in which the functions were."""
    folders = {name: tmp_path_factory.mktemp(name) for name in ("commands", "functions")}
    for folder in folders.values():
        for name, source in (("log", "matlab"), ("path", "path")):
            head = (LOGS / f"{source}.csv").read_text(encoding="utf-8").splitlines()[: ROWS + 1]
            (folder / f"{name}.csv").write_text("\n".join(head) + "\n", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folders["commands"])
        codes = [
            run([*shlex.split(line)[1:], "-q"]) for line in COMMAND_LINES if not line.startswith(SIMULATE)
        ]
        assert codes == [0] * 9
        patch.chdir(folders["functions"])
        names: dict[str, object] = {}
        lines = [line for line in PYTHON_LINES if not line.startswith(SIMULATE)]
        exec("\n".join([*lines, *BLOCKS[2].splitlines()]), names)
        told = io.StringIO()
        with contextlib.redirect_stdout(told):
            for block in BLOCKS[3:]:
                exec(block, names)
    assert told.getvalue().splitlines()[0].startswith("unknown robot 'urm66' (did you mean urm6?); allowed: ")
    assert told.getvalue().endswith("100%")
    return folders


def test_there_are_ten_lines_of_each() -> None:
    assert len(COMMAND_LINES) == 10
    assert len([line for line in PYTHON_LINES if "urmpipe." in line]) == 10
    called = [re.search(r"urmpipe\.(\w+)\(", line) for line in PYTHON_LINES if "urmpipe." in line]
    asked = [line.split()[1] for line in COMMAND_LINES]
    assert [one and one[1] for one in called] == ["build_fmu" if one == "fmu" else one for one in asked]


@pytest.mark.slow
def test_both_sides_write_the_same_files(sides: dict[str, Path]) -> None:
    ours = {"log-against-path.rrd", "log.rrd"}  # recordings that a command writes by default
    files = {name: {one.name for one in folder.iterdir()} for name, folder in sides.items()}
    plots = {"figures", "motion.pdf"}  # of a section about Python alone
    assert files["functions"] - plots <= files["commands"]
    assert files["commands"] - files["functions"] <= ours


@pytest.mark.slow
def test_both_sides_find_the_same(sides: dict[str, Path]) -> None:
    results = [urmpipe.read_recording(folder / "compared.rrd") for folder in sides.values()]
    frames = [one.to_frame() for one in results]
    assert frames[0].equals(frames[1])
    joints = [np.loadtxt(folder / "joints.csv", delimiter=",", skiprows=1) for folder in sides.values()]
    assert (joints[0] == joints[1]).all()
    assert len(joints[0]) == ROWS
    maps = [(folder / "lab.toml").read_bytes() for folder in sides.values()]
    assert maps[0] == maps[1]


@pytest.mark.slow
def test_the_dictionary_of_a_result_is_json(sides: dict[str, Path]) -> None:
    found = urmpipe.read_recording(sides["functions"] / "compared.rrd").to_dict()
    assert json.loads(json.dumps(found, default=str))["verdict"] == "pass"


def options() -> dict[str, set[str]]:
    """The options of each command that is a function, by its name."""
    context = click.Context(cli)
    found: dict[str, set[str]] = {}
    for name in find_commands():
        command = there(cli.get_command(context, name))
        for one in command.commands.values() if isinstance(command, click.Group) else [command]:
            if name not in ("demo", "robot") and one.name != "check":
                params = [param for param in one.params if isinstance(param, click.Option)]
                found[f"{name} {one.name}"] = {max(param.opts, key=len) for param in params}
    return found


def test_each_option_has_a_row() -> None:
    table = PAGE[PAGE.index("| option |") : PAGE.index("## Warnings and errors")]
    named = set(re.findall(r"(--[a-z][a-z-]+)", table))
    asked = set().union(*options().values())
    assert asked - named == set()
    assert named - asked == {"--help"}


def test_options_of_the_same_name_are_keywords() -> None:
    row = next(line for line in PAGE.splitlines() if line.endswith("| the same name, `_` for `-` |"))
    keywords = {one[2:].replace("-", "_") for one in re.findall(r"`(--[a-z-]+)`", row)}
    functions = (
        "ingest", "compare", "iso", "ik", "plan", "accuracy", "report", "export", "simulate", "build_fmu",
        "network_drive",
    )  # fmt: skip
    assert keywords <= {name for one in functions for name in signature(getattr(urmpipe, one)).parameters}


def test_each_error_is_named() -> None:
    errors = {
        name
        for name in urmpipe.__all__
        if isinstance(getattr(urmpipe, name), type) and issubclass(getattr(urmpipe, name), Exception)
    }
    assert {name for name in errors if f"`{name}`" in PAGE} == errors
