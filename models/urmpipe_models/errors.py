"""The error tree: everything that urmpipe raises on purpose is an `UrmpipeError`.

An error carries *findings*: all that is wrong with an input is collected and reported at once,
each finding as one line that names the file, the line, the column, what was found and what is
allowed. The command line prints these lines and exits with 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from urmpipe_models.messages import Finding as Finding  # noqa: PLC0414 - errors are made of them
from urmpipe_models.messages import one_line

SHOWN = 60
"""So many letters of a value stand in a message."""

Given = TypeVar("Given")
Made = TypeVar("Made")


def shown(value: object) -> str:
    """Return a value as a message shows it: cut where it is long, its type alone where it is an object."""
    name = type(value).__name__
    kind = f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of more digits than Python writes, or nested too deep
        return f"{kind} too large to be shown"
    if len(text) <= SHOWN and text.isprintable() and not text.startswith("<"):
        return text
    if isinstance(value, (str, bytes, int, float, list, tuple, dict)):
        return one_line(f"{text[: SHOWN - 3]}...")
    return kind


class UrmpipeError(Exception):
    """Root of every error that urmpipe raises on purpose.

    Attributes:
        findings: All that is wrong, at least one.
    """

    def __init__(self, *findings: Finding | str) -> None:
        self.findings: tuple[Finding, ...] = tuple(
            Finding(finding) if isinstance(finding, str) else finding for finding in findings
        )
        super().__init__("\n".join(str(finding) for finding in self.findings))


class RobotError(UrmpipeError):
    """A robot description cannot be found, read or used (unknown name, URDF, TOML, frames)."""


class LogError(UrmpipeError):
    """A log cannot be read, or holds what no log may hold."""


class PathError(UrmpipeError):
    """The rows of a path make no lines and arcs, or no arm gets to them."""


class RecordingError(UrmpipeError):
    """A recording cannot be read, is not ours, or holds too little for what was asked."""


class OutputError(UrmpipeError):
    """An output may not be written there, or could not be verified after writing."""


class OptionError(UrmpipeError):
    """An option's value, or two options together, make no sense."""


class UnitError(UrmpipeError):
    """A unit is not described right, or refuses a value: unknown variable, not finite, out of range."""


class FmuError(UrmpipeError):
    """An FMU cannot be built, read, loaded or run, or reports an error of its own."""


class NetworkError(UrmpipeError):
    """A network cannot be found, read or put together."""


class CosimulationError(UrmpipeError):
    """A system of blocks cannot be put together: its file, its connections, an algebraic loop."""


class ViewerError(UrmpipeError):
    """A recording cannot be shown here: there is no display, or the viewer does not start."""


def for_each(make: Callable[[Given], Made], items: Iterable[Given]) -> list[Made]:
    """Return what a function makes of each item.

    Raises:
        UrmpipeError: With all that is wrong with any of them, of the class of the first error.
    """
    made: list[Made] = []
    errors: list[UrmpipeError] = []
    for item in items:
        try:
            made.append(make(item))
        except UrmpipeError as error:
            errors.append(error)
    if errors:
        found = dict.fromkeys(finding for error in errors for finding in error.findings)
        raise type(errors[0])(*found) from errors[0]
    return made
