"""The shipped systems in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from urmpipe.printing.terminal import lines_of, new_console, new_table, say

if TYPE_CHECKING:
    from urmpipe_fmus.cosim.system import System


def print_systems(systems: Sequence[System]) -> None:
    """Print the shipped systems: a line each, and their arguments."""
    table = new_table("System", "Description", "--set", title="Systems")
    for one in systems:
        table.add_row(one.name, one.description, lines_of(f"{k}={v}" for k, v in one.arguments.items()))
    new_console().print(table)
    say("Run one: urmpipe simulate SYSTEM [--set NAME=VALUE]")
    say("Change anything else: urmpipe simulate SYSTEM --write-system FILE.toml")
