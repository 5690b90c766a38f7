"""What the values of options are: names of catalogues, frames, joint values, times."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from typing import Any

import click
from click.shell_completion import CompletionItem


class CatalogueType(click.ParamType[str]):
    """A name of a catalogue, or a file; names complete in the shell.

    Args:
        name: What the value is called in the help.
        names: Gives the names; called when they are to be completed.
    """

    def __init__(self, name: str, names: Callable[[], Iterable[str]]) -> None:
        self.name = name
        self._names = names

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer the catalogue's names and then files."""
        names = [CompletionItem(name) for name in self._names() if name.startswith(incomplete)]
        return [*names, CompletionItem(incomplete, type="file")]


def _robots() -> Iterable[str]:
    """Return the names of the robots."""
    from urmpipe_models.robots.catalogue import robot_names

    return robot_names()


def _units() -> Iterable[str]:
    """Return the names of the units."""
    from urmpipe_fmus.units import unit_names

    return unit_names()


def _systems() -> Iterable[str]:
    """Return the names of the systems."""
    from urmpipe_fmus.cosim import system_names

    return system_names()


ROBOT = CatalogueType("NAME|FILE", _robots)
"""A robot's name, or a TOML or URDF file."""

UNIT = CatalogueType("UNIT|FILE", _units)
"""A unit's name, or a Python file with one in it."""

SYSTEM = CatalogueType("SYSTEM|FILE", _systems)
"""A shipped system's name, or a system file."""


class OffsetType(click.ParamType[Any]):
    """A frame as X,Y,Z or X,Y,Z,RX,RY,RZ in m and rad."""

    name = "X,Y,Z[,RX,RY,RZ]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the transform."""
        from urmpipe_models.robots.catalogue import parse_offset

        return parse_offset(value) if isinstance(value, str) else value


class NamesType(click.ParamType[Any]):
    """Some names, parted by commas."""

    name = "A,B,C"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the names as a tuple."""
        return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value


class JointValuesType(click.ParamType[tuple[float, ...]]):
    """Joint values as Q1,Q2,... in rad and m, one for each joint in the robot's order."""

    name = "Q1,Q2,..."

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        """Return the values."""
        if isinstance(value, tuple):
            return value
        try:
            values = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            values = ()
        if not values or not all(map(math.isfinite, values)):
            self.fail(f"found {value!r}, allowed: numbers in rad and m, such as 0,3.14,0.5", param, ctx)
        return values


class QuantityType(click.ParamType[float]):
    """A positive number in the SI unit, or with its unit behind it: 0.005 or 5ms."""

    def __init__(self, name: str, units: dict[str, float], example: str) -> None:
        self.name = name
        self.units = {"": 1.0} | units
        self.example = example

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the quantity in SI."""
        if isinstance(value, float):
            return value
        match = re.fullmatch(r"(.*?)\s*([a-z]*)", str(value).strip())
        try:
            number = float(match[1]) * self.units[match[2]] if match else math.nan
        except (ValueError, KeyError):
            number = math.nan
        if not 0.0 < number < math.inf:
            self.fail(f"found {value!r}, allowed: {self.example}", param, ctx)
        return number


DURATION = QuantityType(
    "SECONDS", {"s": 1.0, "ms": 1e-3, "us": 1e-6}, "a positive time in s, such as 0.005 or 5ms"
)
