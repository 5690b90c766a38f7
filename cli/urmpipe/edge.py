"""The edge of the public functions: keywords are checked, and messages are in Python's words."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from inspect import Signature, signature
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar, get_args

import numpy as np

from urmpipe.words import by_command_line, error_in_keywords, result_in_keywords
from urmpipe_models.errors import OptionError, UrmpipeError
from urmpipe_pipeline.joint_log import LogWarning

Parameters = ParamSpec("Parameters")
Made = TypeVar("Made")


class UrmpipeWarning(UserWarning):
    """What a person should know about a result; the result's `warnings` hold the same."""


class Kind(NamedTuple):
    """What a keyword takes.

    Attributes:
        fits: Tells whether a value is of the kind.
        allowed: What to say if it is not.
    """

    fits: Callable[[Any], bool]
    allowed: str


def _is_path(value: Any) -> bool:
    """Return whether a value names a file: the empty text is the working folder, which nobody means."""
    return isinstance(value, Path) or (isinstance(value, str) and value != "")


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_robot(value: Any) -> bool:
    from urmpipe_models.chains.chain import Chain

    return isinstance(value, Chain) or _is_path(value)


def _is_read(value: Any) -> bool:
    from urmpipe_pipeline.sources import ReadOptions

    return isinstance(value, ReadOptions)


def _is_backend(value: Any) -> bool:
    from urmpipe.systems.units import Backend

    return value in get_args(Backend)


PATH = Kind(_is_path, "a path: text or a Path, not empty")
SECONDS = Kind(_is_number, "a number, in s")
FLAG = Kind(lambda value: isinstance(value, (bool, np.bool_)), "True or False")
KIND_OF_LIMIT = Kind(
    lambda value: _is_number(value) or isinstance(value, Mapping),
    'a number in m, or a mapping of kinds to m or rad, such as {"axis": 0.0035, "angle": 0.01}',
)
KIND_OF_TOLERANCE = Kind(
    lambda value: _is_number(value) or isinstance(value, (str, Mapping)),
    'a number in m, a text such as "axis=3.5mm,angle=0.5deg", or a mapping of kinds to m or rad, such as'
    ' {"axis": 0.0035, "angle": 0.01}',
)
NAMES = Kind(lambda value: isinstance(value, Mapping), 'a mapping, such as {"log": "log.csv"}')
TOLD = Kind(callable, "a function of the share that is done, 0 to 1, such as print")

KINDS = {
    "arguments": NAMES,
    "audit": PATH,
    "backend": Kind(_is_backend, "native, python"),
    "draw": PATH,
    "duration": SECONDS,
    "every": FLAG,
    "figures": PATH,
    "junit": PATH,
    "noise": KIND_OF_LIMIT,
    "options": NAMES,
    "output": PATH,
    "progress": TOLD,
    "read": Kind(_is_read, "ReadOptions, such as urmpipe.read_map(FILE).read"),
    "robot": Kind(_is_robot, "a name, a TOML or URDF file, or a Chain, such as urmpipe.load_robot(NAME)"),
    "statistics": PATH,
    "step": SECONDS,
    "strict": FLAG,
    "told": Kind(callable, "a function of a text, such as print"),
    "tolerance": KIND_OF_TOLERANCE,
    "tsp": SECONDS,
    "within_pi": FLAG,
    "write_map": PATH,
}
"""What each keyword takes, wherever it stands; the others are checked by what they mean."""


def public(function: Callable[Parameters, Made]) -> Callable[Parameters, Made]:
    """Return a public function that checks its keywords and speaks to whom calls it.

    Called from Python, its errors and warnings name keywords, and its warnings are shown as
    `UrmpipeWarning`s. A command has checked its options itself, and prints its warnings.
    """
    known = signature(function)

    @wraps(function)
    def called(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Made:
        if by_command_line():
            return function(*args, **kwargs)
        try:
            given = _checked(known, args, kwargs)
            made = result_in_keywords(function(*args, **kwargs))
        except UrmpipeError as error:
            raise error_in_keywords(error) from error.__cause__
        for message in dict.fromkeys(_doubts(made, given)):
            warnings.warn(message, UrmpipeWarning, stacklevel=2)
        return made

    return called


def _checked(known: Signature, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> list[Any]:
    """Return all that a function is given.

    Raises:
        OptionError: With every keyword that is not of its kind.
    """
    given = known.bind(*args, **kwargs).arguments
    wrong = [
        f"{name}: found {value!r}, allowed: {KINDS[name].allowed}"
        for name, value in given.items()
        if name in KINDS and value is not known.parameters[name].default and not KINDS[name].fits(value)
    ]
    if wrong:
        raise OptionError(*wrong)
    return list(given.values())


def _doubts(made: Any, given: Iterable[Any]) -> Iterator[str]:
    """Yield the warnings of a result that were not shown when what it was made of was made."""
    if not hasattr(made, "to_frame"):
        return
    operands = [one for value in given for one in (value if isinstance(value, (list, tuple)) else (value,))]
    seen = [warning.message for one in operands for _, warning in _warnings_of(one)]
    for log, warning in _warnings_of(made):
        told = warning.message  # of a reference behind its name
        if not any(told == one or told.endswith(f": {one}") for one in seen):
            yield (warning if log is None else warning.of(log)).message


def _warnings_of(result: Any) -> Iterator[tuple[str | None, LogWarning]]:
    """Yield the warnings of a result, and those of the logs that it compares with the log's name."""
    yield from ((None, one) for one in getattr(result, "warnings", ()))
    for deviation in getattr(result, "runs", ()):
        yield from ((deviation.name, one) for one in deviation.run.warnings)
