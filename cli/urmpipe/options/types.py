"""What the values of options are: names of catalogues, frames, joint values, times."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from urmpipe.options.completion import files
from urmpipe_models.errors import Finding, OptionError, format_value, map_collecting_errors
from urmpipe_models.measure_units import WRITTEN, quantity_to_si, read_quantity


class CatalogueType(click.ParamType[str]):
    """A name of a catalogue, or a file; both complete in the shell.

    Args:
        name: What the value is called in the help.
        names: Gives the names; called when they are to be completed.
        suffixes: What the names of files end in.
    """

    def __init__(self, name: str, names: Callable[[], Iterable[str]], *suffixes: str) -> None:
        self.name = name
        self._complete = files(*suffixes, names=names)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer files, and the names of the catalogue."""
        return self._complete(ctx, param, incomplete)


class FileType(click.Path):
    """A file whose name ends in one of some suffixes; those complete in the shell.

    Args:
        suffixes: The suffixes, each with its point.
        settings: What `click.Path` takes besides.
    """

    def __init__(self, *suffixes: str, **settings: Any) -> None:
        super().__init__(path_type=Path, **settings)
        self._complete = files(*suffixes)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer files of the kind."""
        return self._complete(ctx, param, incomplete)


ANY_FILE = FileType()
RECORDING = FileType(".rrd")
DRAWING = FileType(".svg")


def robots() -> Iterable[str]:
    """Return the names of the robots."""
    from urmpipe_models.robots.catalogue import robot_names

    return robot_names()


def _units() -> Iterable[str]:
    """Return the names of the units."""
    from urmpipe_fmus.blocks import block_names

    return block_names()


def _systems() -> Iterable[str]:
    """Return the names of the systems."""
    from urmpipe_fmus.cosim import system_names

    return system_names()


def networks() -> Iterable[str]:
    """Return the names of the networks."""
    from urmpipe_models.networks.file import network_names

    return network_names()


ROBOT = CatalogueType("NAME|FILE", robots, ".toml", ".urdf")
"""A robot's name, or a TOML or URDF file."""

UNIT = CatalogueType("UNIT|FILE", _units, ".py")
"""A unit's name, or a Python file with one in it."""

SYSTEM = CatalogueType("SYSTEM|FILE", _systems, ".toml")
"""A shipped system's name, or a system file."""

NETWORK = CatalogueType("NAME|FILE", networks, ".toml")
"""A shipped network's name, or a network file."""


class OneOf(click.Choice[str]):
    """One of some words."""

    def get_invalid_choice_message(self, value: Any, ctx: click.Context | None) -> str:
        """Return what was found, what may have been meant, and what is allowed."""
        from urmpipe_models.errors import format_unknown_name

        return format_unknown_name(str(value), self.choices)


def parsed(
    parse: Callable[[str], Any], text: str, ctx: click.Context | None, param: click.Parameter | None
) -> Any:
    """Return what a function of another package makes of a text.

    Raises:
        OptionError: With everything that is wrong with it, by the option or the key that says it.
    """
    from urmpipe.usage import place_of
    from urmpipe_models.errors import UrmpipeError

    try:
        return parse(text)
    except UrmpipeError as error:
        if param is None:
            raise
        raise OptionError(*(place_of(ctx, param, one) for one in error.findings)) from None


class ParsedType(click.ParamType[Any]):
    """What a function of another package reads, which tells of what is wrong by an `UrmpipeError`.

    Args:
        name: What the value is called in the help.
        parse: Returns the value of a text.
    """

    def __init__(self, name: str, parse: Callable[[str], Any]) -> None:
        self.name = name
        self.read = parse

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return what the value is called, in small letters where these are units."""
        return self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the value."""
        return parsed(self.read, value, ctx, param) if isinstance(value, str) else value


class OffsetType(click.ParamType[Any]):
    """A frame as X,Y,Z or X,Y,Z,RX,RY,RZ in m and rad, or with units: 0,0,150mm."""

    name = "X,Y,Z[,RX,RY,RZ]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the transform."""
        from urmpipe_models.math3d import from_offset

        if not isinstance(value, str):
            return value
        parts = value.split(",")
        values = [quantity_to_si(part, WRITTEN["m"]) for part in parts[:3]]
        values += [quantity_to_si(part, WRITTEN["rad"]) for part in parts[3:]]
        if len(values) not in (3, 6) or not all(map(math.isfinite, values)):
            allowed = "X,Y,Z or X,Y,Z,RX,RY,RZ in m and rad, such as 0,0,0.15 or 0,0,150mm,0,0,90deg"
            self.fail(f"found {format_value(value)}, allowed: {allowed}", param, ctx)
        return from_offset(values)


class WholeType(click.ParamType[int]):
    """A whole number, 0 or more."""

    name = "N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return the number."""
        if not isinstance(value, int) and not re.fullmatch("[0-9]+", value):
            self.fail(f"found {format_value(value)}, allowed: a whole number, 0 or more", param, ctx)
        return int(value)


class NamesType(click.ParamType[Any]):
    """Some names, separated by commas."""

    name = "A,B,C"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the names as a tuple."""
        return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value


def quantity_type(si: str, name: str = "", *, positive: bool = True, deviation: bool = False) -> ParsedType:
    """Return the type of a number with a unit behind it, or in SI; `read_quantity` has the details.

    Args:
        si: What it measures, by its SI unit.
        name: What a list separated by commas, returned as a tuple, is called in the help; empty: no list.
        positive: Whether it has to be above 0.
        deviation: Whether it says how large a deviation may be: it needs its unit where that is unclear.
    """
    read = partial(read_quantity, si=si, positive=positive, deviation=deviation)
    if name:
        return ParsedType(name, lambda text: tuple(map_collecting_errors(read, text.split(","))))
    return ParsedType(f"NUMBER[{'|'.join(filter(None, WRITTEN[si]))}]", read)


def _joint_values(text: str) -> tuple[str, ...]:
    """Return joint values as texts: their joints tell whether they are angles or lengths.

    Raises:
        OptionError: If one is neither.
    """
    parts = tuple(text.split(","))
    if any(all(math.isnan(quantity_to_si(part, WRITTEN[si])) for si in ("rad", "m")) for part in parts):
        allowed = "joint values in rad and m, or with units, such as 0,180deg,500mm"
        raise OptionError(Finding(found=format_value(text), allowed=allowed))
    return parts


JOINT_VALUES = ParsedType("Q1,Q2,...", _joint_values)
"""Joint values, one for each joint in the robot's order."""

DEVIATION = quantity_type("m", deviation=True)
DURATION = quantity_type("s")
