"""The edge of the public functions: keywords are checked, and messages are in Python's words."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, TypeVar

from urmpipe.kinds import kind_of
from urmpipe.words import by_command_line, error_in_keywords, result_in_keywords
from urmpipe_models.errors import OptionError, UrmpipeError, shown
from urmpipe_pipeline.joint_log import LogWarning

Parameters = ParamSpec("Parameters")
Made = TypeVar("Made")


class UrmpipeWarning(UserWarning):
    """What a person should know about a result; the result's `warnings` hold the same."""


def public(function: Callable[Parameters, Made]) -> Callable[Parameters, Made]:
    """Return a public function that checks its keywords and speaks to whom calls it.

    Called from Python, its errors and warnings name keywords, and its warnings are shown as
    `UrmpipeWarning`s. A command has checked its options itself, and prints its warnings.
    """
    known = signature(function)
    defaults = {name: one.default for name, one in known.parameters.items()}

    @wraps(function)
    def called(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Made:
        if by_command_line():
            return function(*args, **kwargs)
        given = known.bind(*args, **kwargs).arguments
        if wrong := list(_wrong(function.__name__, given, defaults)):
            raise OptionError(*wrong)
        try:
            made = result_in_keywords(function(*args, **kwargs))
        except UrmpipeError as error:
            raise error_in_keywords(error) from error.__cause__
        for message in dict.fromkeys(_doubts(made, given.values())):
            warnings.warn(message, UrmpipeWarning, stacklevel=2)
        return made

    return called


def _wrong(function: str, given: Mapping[str, Any], defaults: Mapping[str, Any]) -> Iterator[str]:
    """Yield which of the keywords that a function is given are not of their kinds."""
    for name, value in given.items():
        kind = kind_of(function, name)
        if kind is not None and value is not defaults[name] and not kind.fits(value):
            yield f"{name}: found {shown(value)}, allowed: {kind.allowed}"


def _doubts(made: Any, given: Iterable[Any]) -> Iterator[str]:
    """Yield the warnings of a result that were not shown when what it was made of was made."""
    if not hasattr(made, "to_frame"):
        return
    operands = [one for value in given for one in (value if isinstance(value, (list, tuple)) else (value,))]
    seen = {replace(warning, about=None) for one in operands for warning in _warnings_of(one)}
    for warning in _warnings_of(made):
        if replace(warning, about=None) not in seen:
            yield str(warning)


def _warnings_of(result: Any) -> Iterator[LogWarning]:
    """Yield the warnings of a result, and those of the logs that it compares with the log's name."""
    yield from getattr(result, "warnings", ())
    for deviation in getattr(result, "runs", ()):
        yield from (one.of(deviation.name) for one in deviation.run.warnings)
