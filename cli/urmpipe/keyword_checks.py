"""The checking of Python keywords: of their kinds before the work, and of warnings after it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from urmpipe.kinds import kind_of
from urmpipe_models.display import Displayable
from urmpipe_models.errors import Finding, LogError, OptionError, RecordingError, format_value
from urmpipe_pipeline.joint_log import PASSED_OVER, LogWarning
from urmpipe_pipeline.recording import is_recording
from urmpipe_pipeline.sources.options import read_options
from urmpipe_pipeline.text import counted

Parameters = ParamSpec("Parameters")
Made = TypeVar("Made")

PathLike = str | Path


class UrmpipeWarning(UserWarning):
    """What a person should know about a result; the result's `warnings` hold the same."""


def public(function: Callable[Parameters, Made]) -> Callable[Parameters, Made]:
    """Return a public function that checks its keywords, and shows its warnings as `UrmpipeWarning`s."""
    return _checked(function, ())


def public_reading(
    reading: type,
) -> Callable[[Callable[Parameters, Made]], Callable[Parameters, Made]]:
    """Return a decorator as `public`, of a function whose `**reading` are the keys of a typed dictionary."""
    return lambda function: _checked(function, tuple(reading.__annotations__.items()))


def _checked(
    function: Callable[Parameters, Made], reading: Sequence[tuple[str, Any]]
) -> Callable[Parameters, Made]:
    """Return a function that checks its keywords; its signature names those of its reading, too."""
    own = signature(function)
    keywords = [
        Parameter(
            key, Parameter.KEYWORD_ONLY, default=None, annotation=getattr(kind, "__forward_arg__", kind)
        )
        for key, kind in reading
    ]
    named = [one for one in own.parameters.values() if one.kind != Parameter.VAR_KEYWORD]
    known = own.replace(parameters=[*named, *keywords])
    defaults = {name: one.default for name, one in known.parameters.items()}

    @wraps(function)
    def called(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Made:
        given = known.bind(*args, **kwargs).arguments
        read = {key: given[key] for key, _ in reading if key in given}
        if wrong := [*_wrong(function.__name__, given, defaults), *_wrong_reading(read)]:
            raise OptionError(*wrong)
        made = function(*args, **kwargs)
        for message in dict.fromkeys(_unseen(made, given.values())):
            warnings.warn(message, UrmpipeWarning, stacklevel=2)
        return made

    called.__signature__ = known  # type: ignore[attr-defined]  # what help() shows
    return called


def _wrong(function: str, given: Mapping[str, Any], defaults: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield which of the keywords that a function is given are not of their kinds."""
    for name, value in given.items():
        kind = kind_of(function, name)
        if kind is not None and value is not defaults[name] and not kind.fits(value):
            yield Finding(parameter=name, found=format_value(value), allowed=kind.allowed)


def _wrong_reading(given: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield which of the keywords that say how a log is read are not of their kinds."""
    try:
        read_options(given)
    except OptionError as error:
        yield from error.findings


def _unseen(made: Any, given: Iterable[Any]) -> Iterator[str]:
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
    if not isinstance(result, Displayable):  # a table may have a column of that name
        return
    yield from getattr(result, "warnings", ())
    for deviation in getattr(result, "runs", ()):
        yield from (one.of(deviation.name) for one in deviation.run.warnings)


def one_or_many(given: object) -> list[Any]:
    """Return what was given as a list: a path, a run or another result alone is a list of one."""
    table = hasattr(given, "__array__") or hasattr(given, "__arrow_c_stream__")
    alone = table or isinstance(given, (str, Path, Mapping))
    return [given] if alone or not isinstance(given, Iterable) else list(given)


def paths(given: PathLike | Sequence[PathLike]) -> list[Path]:
    """Return files that were named as paths; one alone is a list of one."""
    return [Path(one) for one in one_or_many(given)]


def refuse_others(name: str, given: Sequence[object], kinds: tuple[type, ...], allowed: str) -> None:
    """Raise an `OptionError` with everything that is neither a path nor of some kinds.

    Args:
        name: The operand, for messages.
        given: What was given.
        kinds: Classes that are allowed besides paths.
        allowed: What is allowed, in words.
    """
    found = [format_value(one) for one in given if not isinstance(one, (str, Path, *kinds)) or one == ""]
    if found or not given:
        raise OptionError(Finding(about=name, found=", ".join(found) or "none", allowed=allowed))


def refuse_foreign(files: Sequence[Path]) -> None:
    """Raise a `RecordingError` with all files that are there and are no recordings."""
    foreign = [path for path in files if path.exists() and not is_recording(path)]
    if foreign:
        message = "found no recording of urmpipe, allowed: a .rrd that ingest, compare or simulate wrote"
        raise RecordingError(*(Finding(message, file=str(path)) for path in foreign))


def refuse_recording(given: object, allowed: str) -> None:
    """Raise a `LogError` if the file of a recording was given where something else is allowed."""
    if isinstance(given, (str, Path)) and Path(given).is_file() and is_recording(Path(given)):
        raise LogError(Finding(file=str(given), found="a recording", allowed=allowed))


def refuse_warnings(strict: bool, found: Sequence[LogWarning]) -> None:
    """Raise a `LogError` with all warnings if they are to be errors; columns passed over are none."""
    found = [one for one in found if one.kind != PASSED_OVER]
    if strict and found:
        first = Finding(parameter="strict", found=counted(len(found), "warning"), allowed="none")
        raise LogError(first, *(one.as_finding() for one in found))
