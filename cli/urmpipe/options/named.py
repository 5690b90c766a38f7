"""NAME=VALUE options: arguments of systems, and options of units."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import click
from click.shell_completion import CompletionItem

from urmpipe.options.completion import items, operands
from urmpipe.options.types import networks, robots
from urmpipe_models.errors import format_value
from urmpipe_models.toml_tables import TomlError, parse_toml_text


class NamedType(click.ParamType[str]):
    """NAME=VALUE; the names complete in the shell, and those of robots and networks as values.

    Args:
        names: Gives the names, from what stands on the line already.
    """

    name = "NAME=VALUE"

    def __init__(self, names: Callable[[click.Context], Iterable[str]]) -> None:
        self._names = names

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer the names with their sign; nothing where the line is wrong."""
        from urmpipe_models.errors import UrmpipeError

        name, _, begun = incomplete.partition("=")
        catalogue = {"robot": robots, "network": networks}.get(name)
        if catalogue is not None:
            return items(catalogue(), begun, f"{name}=")
        try:
            return items([f"{name}=" for name in self._names(ctx)], incomplete)
        except UrmpipeError:
            return []


def argument_names(ctx: click.Context) -> Iterable[str]:
    """Return the arguments of the system on the line."""
    from urmpipe_fmus.cosim import load_system

    return [name for system in operands(ctx) for name in load_system(system, {}).arguments]


def option_names(ctx: click.Context) -> Iterable[str]:
    """Return the options of the unit on the line that -s gives: not its robot or log."""
    from urmpipe_fmus.blocks import block_option_help

    return [
        name for unit in operands(ctx) for name in block_option_help(unit) if name not in ("robot", "table")
    ]


def control_names(ctx: click.Context) -> Iterable[str]:
    """Return the controls of the network on the line that can be set."""
    from urmpipe_models.networks.file import load_network

    networks = [load_network(network) for network in operands(ctx)]
    return [one.name for network in networks for one in network.controls if one.value is None]


def option_value(text: str) -> Any:
    """Return the value of NAME=VALUE: as TOML has it, else words separated by commas, or a word."""
    try:
        return parse_toml_text(f"value = {text}\n")["value"]
    except (TomlError, KeyError):
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
            raise click.BadParameter(f"found {format_value(value)}, allowed: NAME=VALUE, each name once")
        found[name.strip()] = text
    return found
