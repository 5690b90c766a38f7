"""Options that name units, systems, and their values on the command line."""

from __future__ import annotations

import tomllib
from typing import Any

import click
from click.shell_completion import CompletionItem


class UnitType(click.ParamType[str]):
    """A unit's name, or a Python file with one in it; names complete in the shell."""

    name = "UNIT|FILE"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer the names of the units and then files."""
        from urmpipe_fmus.units import unit_names

        names = [CompletionItem(name) for name in unit_names() if name.startswith(incomplete)]
        return [*names, CompletionItem(incomplete, type="file")]


class SystemType(click.ParamType[str]):
    """A shipped system's name, or a system file; names complete in the shell."""

    name = "SYSTEM"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer the names of the systems and then files."""
        from urmpipe_fmus.cosim import system_names

        names = [CompletionItem(name) for name in system_names() if name.startswith(incomplete)]
        return [*names, CompletionItem(incomplete, type="file")]


def option_value(text: str) -> Any:
    """Return the value of NAME=VALUE: as TOML has it, else some words parted by commas, or a word."""
    try:
        return tomllib.loads(f"value = {text}\n")["value"]
    except (tomllib.TOMLDecodeError, KeyError):
        words = [part.strip() for part in text.split(",")]
        return words if len(words) > 1 else text.strip()


def named_values(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """Return NAME=VALUE options as a mapping.

    Raises:
        BadParameter: If one has no name, or one name stands twice.
    """
    found: dict[str, str] = {}
    for value in values:
        name, sign, text = value.partition("=")
        if not sign or not name.strip() or name.strip() in found:
            raise click.BadParameter(f"found {value!r}, allowed: NAME=VALUE, each name once")
        found[name.strip()] = text
    return found
