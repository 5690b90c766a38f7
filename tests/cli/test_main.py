"""The group, its help and the one error boundary."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from importlib.metadata import version
from typing import Any

import click
import pytest
from click.testing import CliRunner

from urmpipe.main import COMMANDS, cli

RunCommand = Callable[..., Any]
"""What the fixture `urmpipe` gives: arguments in; exit code, standard output and standard error out."""


def test_the_short_help_of_every_command_is_its_own() -> None:
    context = click.Context(cli)
    for name, short in COMMANDS.items():
        command = cli.get_command(context, name)
        assert command is not None
        assert command.get_short_help_str(limit=200) == short


def commands() -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Every command and subcommand with its words."""
    context = click.Context(cli)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command is not None
        yield (name,), command
        if isinstance(command, click.Group):
            yield from (((name, sub), command.commands[sub]) for sub in command.commands)


@pytest.mark.parametrize(
    ("words", "command"),
    list(commands()),
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_every_command_has_help_with_examples_and_every_option_says_what_it_does(
    words: tuple[str, ...], command: click.Command
) -> None:
    result = CliRunner().invoke(cli, [*words, "--help"])
    assert result.exit_code == 0
    if not isinstance(command, click.Group):
        assert "Examples:" in result.output or "Example:" in result.output
        assert f"urmpipe {' '.join(words)}" in result.output
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            assert parameter.help, f"{parameter.name} has no help"


def test_version(urmpipe: RunCommand) -> None:
    for words in ((), ("ingest",), ("robot", "list")):
        ran = urmpipe(*words, "--version")
        assert (ran.code, ran.out) == (0, f"urmpipe, version {version('urmpipe')}\n")


def test_an_unknown_command_is_usage_and_exits_with_2(urmpipe: RunCommand) -> None:
    ran = urmpipe("ingset")
    assert ran.code == 2
    assert "No such command 'ingset'" in ran.err
    assert ran.out == ""


def test_an_error_is_one_line_and_json_if_asked_for(urmpipe: RunCommand) -> None:
    ran = urmpipe("ingest", "missing.csv")
    assert ran.code == 2
    assert ran.out == ""
    assert ran.err.startswith("error: missing.csv: ")
    assert ran.err.count("\n") == 1
    ran = urmpipe("ingest", "missing.csv", "--json")
    assert ran.code == 2
    answer = json.loads(ran.out)
    assert answer["schema"] == 1
    assert answer["errors"][0].keys() == {"file", "line", "row", "column", "message"}
    assert answer["errors"][0]["file"] == "missing.csv"


def test_debug_adds_the_traceback(urmpipe: RunCommand) -> None:
    ran = urmpipe("ingest", "missing.csv", "--debug")
    assert ran.code == 2
    assert "Traceback (most recent call last)" in ran.err


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["--tsp", "never"], "found 'never', allowed: a positive time in s, such as 0.005 or 5ms"),
        (["--tsp", "-1"], "found '-1', allowed: a positive time in s, such as 0.005 or 5ms"),
        (["--tsp", "5 m"], "found '5 m', allowed: a positive time in s, such as 0.005 or 5ms"),
        (["--derivative", "magic"], "'magic' is not one of 'central', 'savgol'."),
    ],
)
def test_wrong_options_say_what_is_allowed(urmpipe: RunCommand, arguments: list[str], found: str) -> None:
    ran = urmpipe("ingest", "log.csv", *arguments)
    assert ran.code == 2
    assert found in ran.err


def test_shell_completion_offers_commands_and_robots() -> None:
    from urmpipe.options.types import ROBOT

    robots = ROBOT.shell_complete(click.Context(cli), click.Option(["--robot"]), "ur5")
    assert {item.value for item in robots} >= {"ur5", "ur5e"}
