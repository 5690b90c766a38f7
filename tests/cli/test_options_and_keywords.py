"""An option of a command and the keyword of its function have one name, but for dashes."""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
from typing import Any

import click
import pytest

import urmpipe
from urmpipe.commands.accuracy import accuracy
from urmpipe.commands.compare import compare
from urmpipe.commands.diagnose import diagnose
from urmpipe.commands.export import export
from urmpipe.commands.fmu import fmu
from urmpipe.commands.ik import ik
from urmpipe.commands.ingest import ingest
from urmpipe.commands.network import network
from urmpipe.commands.plan import plan
from urmpipe.commands.report import report
from urmpipe.commands.robot import robot
from urmpipe.commands.simulate import simulate
from urmpipe.commands.view import view
from urmpipe_models.errors import to_option

COMMANDS: dict[str, tuple[click.Command, Callable[..., Any]]] = {
    "accuracy": (accuracy, urmpipe.accuracy),
    "build": (fmu.commands["build"], urmpipe.build_fmu),
    "compare": (compare, urmpipe.compare),
    "diagnose": (diagnose, urmpipe.diagnose),
    "equations": (robot.commands["equations"], urmpipe.equations),
    "export": (export, urmpipe.export),
    "ik": (ik, urmpipe.ik),
    "ingest": (ingest, urmpipe.ingest),
    "network_check": (network.commands["check"], urmpipe.network_check),
    "network_solve": (network.commands["solve"], urmpipe.network_solve),
    "plan": (plan, urmpipe.plan),
    "report": (report, urmpipe.report),
    "simulate": (simulate, urmpipe.simulate),
    "view": (view, urmpipe.view),
}

OPERANDS: dict[str, set[str]] = {
    "accuracy": set(),
    "build": {"unit"},
    "compare": {"reference", "logs"},
    "diagnose": {"reference", "log"},
    "equations": {"robot"},
    "export": {"result"},
    "ik": {"targets"},
    "ingest": {"log"},
    "network_check": {"network"},
    "network_solve": {"network"},
    "plan": {"path"},
    "report": {"results"},
    "simulate": {"system"},
    "view": {"recordings"},
}
"""Keywords that stand without an option on the command line."""

OF_PYTHON = {"inputs", "defaults", "progress", "told", "t", "q", "recorded_tcp", "names", "name"}
"""Keywords for callbacks, arrays and their names, and for who prints."""

OF_COMMANDS = {"as_json", "quiet", "explain", "listed", "write_system", "version"}
"""Options of what is printed instead of a result, or beside it."""


@pytest.mark.parametrize("name", COMMANDS)
def test_each_option_is_a_keyword_and_each_keyword_an_option(name: str) -> None:
    command, function = COMMANDS[name]
    options = {one.name: one for one in command.params if isinstance(one, click.Option) and one.expose_value}
    keywords = set(signature(function).parameters) - OPERANDS[name] - OF_PYTHON
    assert set(options) - OF_COMMANDS == keywords
    for keyword in keywords:
        assert to_option(keyword) in options[keyword].opts
