"""What a shell completes of `urmpipe simulate` and `urmpipe fmu`: systems, units, what may be set."""

from __future__ import annotations

import click
import pytest
from click.shell_completion import ShellComplete

from asserting import there
from urmpipe.commands.simulate import simulate as command
from urmpipe.main import cli
from urmpipe.parameters.kinds import UNIT_MODEL


def test_names_complete_in_the_shell() -> None:
    context, argument = click.Context(command), command.params[0]
    assert argument.shell_complete(context, "six")[1].value == "six-drives"
    units = there(UNIT_MODEL.complete)(context, argument, "dc")
    assert [(one.value, one.type) for one in units] == [("dc", "file"), ("dc_drive", "plain")]


@pytest.mark.parametrize(
    ("line", "begun", "offered"),
    [
        (["simulate", "log-to-delta", "--set"], "r", ["reference=", "robot="]),
        (["simulate", "--set"], "", []),
        (["simulate", "nosuch", "--set"], "", []),
        (["fmu", "build", "kinematic_chain", "-s"], "", ["points=", "sensors=", "rates="]),
        (["fmu", "build", "log_source", "--option"], "c", ["columns="]),
        (["fmu", "build", "network_motion", "-s"], "network=slid", ["network=slider-crank"]),
    ],
)
def test_what_is_set_completes_in_the_shell(line: list[str], begun: str, offered: list[str]) -> None:
    complete = ShellComplete(cli, {}, "urmpipe", "_URMPIPE_COMPLETE")
    assert [one.value for one in complete.get_completions(line, begun)] == offered
