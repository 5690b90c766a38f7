"""`--help` of every command: options under headings in one order, and lines that fit a terminal."""

from __future__ import annotations

import re

import click
import pytest

from command_contexts import EVERY, NAMES
from urmpipe.command_line import MAX_FLAT_OPTIONS, HeadedOption
from urmpipe.parameters.param import Heading

HEADINGS = re.compile(r"^([A-Z][^\n]*):\n", re.MULTILINE)
NOT_OF_OPTIONS = {"Usage", "Commands"}


ALL = pytest.mark.parametrize("context", EVERY, ids=NAMES)


def headings_of(context: click.Context) -> list[str]:
    """The headings of options that a help page shows."""
    return [one for one in HEADINGS.findall(context.get_help()) if one not in NOT_OF_OPTIONS]


def options_of(context: click.Context) -> list[click.Option]:
    """The options that a help page shows."""
    params = context.command.get_params(context)
    return [one for one in params if isinstance(one, click.Option) and not one.hidden]


@ALL
def test_many_options_stand_under_headings_in_one_order(context: click.Context) -> None:
    found, options = headings_of(context), options_of(context)
    if len(options) <= MAX_FLAT_OPTIONS:
        assert found == ["Options"]
        return
    assert found == [one for one in Heading if one in found]
    assert len(found) > 2
    own = [one for one in options if "--help" not in one.opts]  # click's own
    assert [one.opts for one in own if not isinstance(one, HeadedOption)] == []
    assert {one.heading for one in own if isinstance(one, HeadedOption)} == set(found)


@ALL
def test_each_option_stands_once_and_every_line_fits(context: click.Context) -> None:
    text = context.get_help()
    assert [line for line in text.splitlines() if len(line) > 80] == []
    lists = text[text.index(f"\n{headings_of(context)[0]}:\n") :]
    for option in options_of(context):
        listed = re.findall(rf"^  {re.escape(', '.join(option.opts))}(?=[ \n])", lists, re.MULTILINE)
        assert len(listed) == 1, option.opts


@ALL
def test_every_command_has_examples_and_every_option_says_what_it_does(context: click.Context) -> None:
    if not isinstance(context.command, click.Group):
        _, _, examples = context.get_help().partition("Example")
        assert f"  {context.command_path} " in examples
    assert [one.opts for one in options_of(context) if not one.help] == []


def test_the_help_of_compare_begins_with_what_is_used_most() -> None:
    context = next(one for one in EVERY if one.command_path == "urmpipe compare")
    assert headings_of(context) == [
        "Robot", "Judging", "Aligning", "Compared motions", "Baseline", "Reading files", "Processing",
        "Output", "General",
    ]  # fmt: skip
    assert context.get_help().split("\nRobot:\n")[1].splitlines()[0].startswith("  --robot NAME|FILE ")
