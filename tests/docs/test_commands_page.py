"""docs/commands.md against the commands: it is what docs/write_commands.py writes."""

from __future__ import annotations

import re
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any

import click
import pytest

from pages import DOCS, command_lines, pages, text_of
from urmpipe.defaults import EACH_TIME

OF_OTHERS = {"--start-values", "--debug-logging", "--no-arr", "--truncate-length"}
"""Options of fmpy and ros2 that pages name."""


@pytest.fixture(scope="module")
def writer() -> Any:
    """The script that writes the page."""
    spec = spec_from_file_location("write_commands", DOCS / "write_commands.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_what_its_script_writes(writer: Any) -> None:
    assert text_of("docs/commands.md") == writer.page(), "run: python docs/write_commands.py"


def test_every_option_of_every_command_is_on_it(writer: Any) -> None:
    sections = text_of("docs/commands.md").split("\n## urmpipe ")[1:]
    of_command = {section.partition("\n")[0]: section for section in sections}
    for words, context in writer.commands():
        for option in (one for one in context.command.params if isinstance(one, click.Option)):
            assert all(name in of_command[words] for name in option.opts), (words, option.opts)


def test_what_has_no_default_is_named(writer: Any) -> None:
    defaults = text_of("docs/commands.md").split("**Defaults.**")[1].split("\n\n")[0]
    assert all(f"`{name.removeprefix('--')}`" in defaults for name in EACH_TIME)


def test_every_command_that_a_page_shows_is_one_with_these_options(writer: Any) -> None:
    known = dict(writer.commands())
    for page in pages():
        for line in command_lines(page):
            words = line.split()[1:]
            name = " ".join(words[:2]) if " ".join(words[:2]) in known else words[0]
            options = {opt for param in known[name].command.params for opt in param.opts} | {"--help"}
            given = {word.partition("=")[0] for word in words if word.startswith("--")}
            assert given <= options, f"{page}: {line}"


def test_every_option_that_a_page_names_in_its_text_is_one_of_a_command(writer: Any) -> None:
    known = {opt for _, one in writer.commands() for param in one.command.params for opt in param.opts}
    for page in pages():
        for code in re.findall(r"`([^`\n]+)`", text_of(page)):
            named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", code))
            assert named <= known | OF_OTHERS | {"--help"}, f"{page}: {code}"
