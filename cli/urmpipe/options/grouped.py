"""Options that belong together reach a command as one object."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Any, TypeVar

Command = TypeVar("Command", bound=Callable[..., Any])


def names_of(kind: type[Any]) -> list[str]:
    """Return the names of the parameters that a dataclass of options takes."""
    return [field.name for field in fields(kind)]


def grouped(kind: type[Any], name: str) -> Callable[[Command], Command]:
    """Return a decorator that hands the parameters named as the fields of a dataclass over as one of it.

    Args:
        kind: The dataclass; the options of each of its fields are added to the command beside.
        name: The parameter of the command that takes it.
    """

    def decorate(command: Command) -> Command:
        @wraps(command)
        def called(*arguments: Any, **options: Any) -> Any:
            values = {field: options.pop(field) for field in names_of(kind)}
            return command(*arguments, **{name: kind(**values)}, **options)

        return called  # type: ignore[return-value]  # it takes what click gives

    return decorate


def with_options(command: Command, *options: Callable[[Command], Command]) -> Command:
    """Return a command with some options, which its help lists in this order."""
    for option in reversed(options):
        command = option(command)
    return command
