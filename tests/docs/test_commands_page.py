"""docs/commands.md against the commands: it is what docs/write_commands.py writes."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import click
import pytest

from pages import DOCS, command_lines, commands_in_text, pages, script, text_of
from urmpipe.command_line import ParamOption, long_name
from urmpipe.main import cli
from urmpipe_fmus.blocks import block_names
from urmpipe_fmus.cosim import system_names
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.networks.file import network_names
from urmpipe_models.robots.catalogue import robot_names

OF_OTHERS = {"--start-values", "--debug-logging", "--no-arr", "--truncate-length", "--dist"}
"""Options of fmpy, ros2 and pytest that pages name."""


@pytest.fixture(scope="module")
def writer() -> Any:
    """The script that writes the page."""
    return script(DOCS / "write_commands.py")


def test_the_page_is_what_its_script_writes(writer: Any) -> None:
    assert text_of("docs/commands.md") == writer.page(), "run: python docs/write_commands.py"


def test_every_option_of_every_command_is_on_it(writer: Any) -> None:
    sections = text_of("docs/commands.md").split("\n## urmpipe ")[1:]
    of_command = {section.partition("\n")[0]: section for section in sections}
    for words, context in writer.commands():
        for option in (one for one in context.command.params if isinstance(one, click.Option)):
            named = option.hidden or all(name in of_command[words] for name in option.opts)
            assert named, (words, option.opts)


def test_what_has_no_default_is_named(writer: Any) -> None:
    defaults = text_of("docs/commands.md").split("**Defaults.**")[1].split("\n\n")[0]
    each_call = {
        long_name(option)
        for _, context in writer.commands()
        for option in context.command.params
        if isinstance(option, ParamOption) and option.param.each_call
    }
    assert [name for name in sorted(each_call) if f"`{name}`" not in defaults] == []


@pytest.mark.parametrize("page", pages())
def test_every_command_of_a_page_is_one_with_these_options_and_values(page: str, tmp_path: Path) -> None:
    for line in dict.fromkeys([*command_lines(page), *commands_in_text(page)]):
        try:
            given = parsed(line)
        except (click.UsageError, UrmpipeError) as error:
            pytest.fail(f"{page}: {line}: {error}")
        assert unknown_names(given) == [], f"{page}: {line}"


def parsed(line: str) -> click.Context:
    """Return what a command is given; a command that is named without its operands is only looked up."""
    command: click.Command = cli
    words = shlex.split(line.replace(" ... ", " "))[1:]
    while isinstance(command, click.Group) and words:
        found = command.get_command(click.Context(command), words[0])
        if found is None:
            raise click.UsageError(f"no command {words[0]}")
        command, words = found, words[1:]
    return command.make_context(command.name, words, resilient_parsing=not words)


def unknown_names(given: click.Context) -> list[str]:
    """Return the robots, networks, units and systems in a command that urmpipe does not bring along.

    A name in capitals stands for any, and one with a suffix is a file.
    """
    shipped = {"robot": robot_names(), "unit": block_names(), "system": system_names()}
    shipped["name"] = (*robot_names(), *network_names())
    named = [(key, given.params.get(key)) for key in shipped]
    return [
        f"{key} {name}"
        for key, name in named
        if isinstance(name, str) and not name.isupper() and not Path(name).suffix and name not in shipped[key]
    ]


def test_every_option_that_a_page_names_in_its_text_is_one_of_a_command(writer: Any) -> None:
    known = {opt for _, one in writer.commands() for param in one.command.params for opt in param.opts}
    for page in pages():
        for code in re.findall(r"`([^`\n]+)`", text_of(page)):
            named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", code))
            assert named <= known | OF_OTHERS | {"--help"}, f"{page}: {code}"
