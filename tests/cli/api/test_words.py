"""One fault, told in options by the command line and in keywords by the public functions."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from inspect import signature
from pathlib import Path

import click
import pytest

import urmpipe
from urmpipe.main import COMMANDS, cli, run
from urmpipe.words import _FOREIGN, SPELLINGS, keywords
from urmpipe_pipeline.sources import ReadOptions

ROOT = Path(__file__).parents[3]
OPTION = re.compile(r"(?<![\w-])(--[a-z][a-z-]*|-o)(?![\w-])")
OF_THE_TERMINAL = ("commands/", "options", "printing/", "main.py", "boundary.py", "defaults.py", "usage.py")
"""Modules of `cli/urmpipe` whose texts only the terminal shows."""

NOT_OURS = {
    "pipeline/urmpipe_pipeline/recording/viewer.py": {
        "--bind", "--port", "--hide-welcome-screen", "--headless",
    },
    "fmus/urmpipe_fmus/native/compile.py": {"--build-id"},
}  # fmt: skip
"""Options of the programs that a module starts."""


def messages() -> Iterator[tuple[str, str]]:
    """Yield module and text of every string below the command line that is no docstring."""
    for area in ("models", "pipeline", "fmus", "cli"):
        for path in sorted((ROOT / area).rglob("*.py")):
            place = path.relative_to(ROOT).as_posix()
            if place.startswith(tuple(f"cli/urmpipe/{one}" for one in (*OF_THE_TERMINAL, "words.py"))):
                continue
            source = path.read_text(encoding="utf-8")
            if not OPTION.search(source):
                continue
            tree = ast.parse(source)
            alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
            for node in ast.walk(tree):
                if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
                    yield place, node.value


def test_each_option_in_a_message_has_a_spelling_in_python() -> None:
    unknown = {
        (place, option)
        for place, text in messages()
        for option in OPTION.findall(_FOREIGN.sub("", text))
        if option not in SPELLINGS and option not in NOT_OURS.get(place, ())
    }
    assert unknown == set()


def test_each_spelling_is_an_option_and_a_keyword() -> None:
    context = click.Context(cli)
    options = {
        option
        for name in COMMANDS
        for command in [cli.get_command(context, name)]
        for one in ([command, *command.commands.values()] if isinstance(command, click.Group) else [command])
        if one is not None
        for param in one.params
        for option in param.opts
    }
    assert set(SPELLINGS) <= options
    functions = ("ingest", "compare", "ik", "report", "export", "simulate", "build_fmu", "load_robot")
    known = {name for function in functions for name in signature(getattr(urmpipe, function)).parameters}
    read = {field.name for field in fields(ReadOptions)}
    for option, one in SPELLINGS.items():
        assert one.keyword in (read if one.in_read else known), option


@pytest.mark.parametrize(
    ("told", "wanted"),
    [
        ("none with --delimiter tab and --decimal comma",
         'none with read=ReadOptions(delimiter="tab", decimal="comma")'),
        ("--unit says otherwise", "read=ReadOptions(units=...) says otherwise"),
        ("say which with --unit my col=deg or --unit my col=rad",
         'say which with read=ReadOptions(units={"my col": "deg"}) or'
         ' read=ReadOptions(units={"my col": "rad"})'),
        ("--unit 'my col=deg' says otherwise", 'read=ReadOptions(units={"my col": "deg"}) says otherwise'),
        ("--unit q1: found 'mm'", "ReadOptions.units q1: found 'mm'"),
        ("or --time none with --period SECONDS", 'or read=ReadOptions(time="none", period=SECONDS)'),
        ("name them with --joints 2,3,...", 'name them with read=ReadOptions(joints=["2", "3", ...])'),
        ("which with --interval q1=LOW:HIGH", 'which with read=ReadOptions(interval={"q1": (LOW, HIGH)})'),
        ("; --skip-bad leaves them out", "; read=ReadOptions(skip_bad=True) leaves them out"),
        ("is a --tool or a --base missing?", "is a tool or a base missing?"),
        ("is the --tool, 100.0 mm long, the right one", "is the tool, 100.0 mm long, the right one"),
        ("1 mm with --tool 0.1,0,-0.2, which", "1 mm with tool=(0.1, 0, -0.2), which"),
        ("urmpipe simulate --write-system FILE.toml one-drive makes a copy",
         "urmpipe simulate --write-system FILE.toml one-drive makes a copy"),
        ("--sync SECONDS or start", "sync=SECONDS or start"),
        ("--align rigid: found", 'align="rigid": found'),
        ("ingest --audit FILE.csv lists all", "ingest(audit=FILE.csv) lists all"),
        ("urmpipe ik --tsp S gives the targets some", "ik(tsp=S) gives the targets some"),
        ("ros2 topic echo --csv /joint_states > log.csv", "ros2 topic echo --csv /joint_states > log.csv"),
        ("--joints: found no column 'q --tsp', allowed: q1",
         "ReadOptions.joints: found no column 'q --tsp', allowed: q1"),
        ("the robot's q1 ('a -o b'): --sync auto", "the robot's q1 ('a -o b'): sync=\"auto\""),
        ("choose a tip link (--tip, tip_link): b", "choose a tip link (tip_link): b"),
        ("found no such file", "found no such file"),
    ],
)  # fmt: skip
def test_messages_in_keywords(told: str, wanted: str) -> None:
    assert keywords(told) == wanted
    assert keywords(wanted) == wanted


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A log without a unit, in the working folder."""
    lines = ["t,q1,q2,q3,q4,q5,q6", *(f"{i / 100},{i / 50},0,0.5,0,0,0" for i in range(30))]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return "log.csv"


def test_the_same_error_in_options_and_in_keywords(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ingest", log, "--joints", "q1,q9"]) == 2
    told = capsys.readouterr().err
    with pytest.raises(urmpipe.LogError) as error:
        urmpipe.ingest(log, read=ReadOptions(joints=("q1", "q9")))
    assert "--joints" in told
    assert "--" not in str(error.value)
    assert told == f"error: {error.value}\n".replace("ReadOptions.joints", "--joints")


def test_the_same_warning_in_options_and_in_keywords(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ingest", log]) == 0
    told = capsys.readouterr().err
    with pytest.warns(urmpipe.UrmpipeWarning) as shown:
        result = urmpipe.ingest(log)
    said = "the joints are taken as rad; --unit says otherwise"
    assert said in told
    spelled = said.replace("--unit", "read=ReadOptions(units=...)")
    assert [str(one.message) for one in shown] == [one.message for one in result.warnings]
    assert any(spelled in one.message for one in result.warnings)
    assert all(one.filename == __file__ for one in shown)
