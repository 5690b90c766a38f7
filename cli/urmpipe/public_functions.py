"""Public functions of Python: their keywords, which are declared parameters, and their warnings.

1. `public_function` reads all keywords before the work, with one error for all faults, gives the function the
   values that their kinds return, and its defaults, and shows the warnings of the result.
2. Operands: positional arguments, as lists, paths and results.
3. Warnings as errors (`strict`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from urmpipe.parameters.param import Kind, Param, params_of, read_parameters
from urmpipe_models.display import Displayable, format_count
from urmpipe_models.errors import Finding, LogError, OptionError, RecordingError, format_value
from urmpipe_pipeline.joint_log import PASSED_OVER, LogWarning
from urmpipe_pipeline.recording import is_recording

Parameters = ParamSpec("Parameters")
ResultT = TypeVar("ResultT")

PathLike = str | Path


class UrmpipeWarning(UserWarning):
    """A warning of a result, as its `warnings` hold it."""


def public_function(
    *groups: type, **operands: Kind
) -> Callable[[Callable[Parameters, ResultT]], Callable[Parameters, ResultT]]:
    """Return a decorator of a public function, whose `**options` are the parameters of some groups.

    The function gets a value for each of them: as its kind reads it, or the default. `help()` and completion
    see them as keywords.

    Args:
        groups: Typed dictionaries of parameters.
        operands: Kinds of parameters that the function itself names.
    """
    declared = {name: param for name, param in params_of(*groups).items() if param.python}
    params = dict(sorted(declared.items(), key=lambda item: not item[1].shell))  # those of Python alone last

    def decorate(function: Callable[Parameters, ResultT]) -> Callable[Parameters, ResultT]:
        named = [
            parameter
            for parameter in signature(function).parameters.values()
            if parameter.kind != Parameter.VAR_KEYWORD
        ]
        annotations = {name: kind for group in groups for name, kind in group.__annotations__.items()}
        keywords = [
            Parameter(
                name,
                Parameter.KEYWORD_ONLY,
                default=param.default,
                annotation=getattr(
                    annotations[name].__origin__, "__forward_arg__", annotations[name].__origin__
                ),
            )
            for name, param in params.items()
        ]
        known = signature(function).replace(parameters=[*named, *keywords])
        read = {
            name: params[name] if name in params else Param(operands[name], "", default=parameter.default)
            for name, parameter in known.parameters.items()
            if name in params or name in operands
        }

        @wraps(function)
        def checked(*args: Parameters.args, **kwargs: Parameters.kwargs) -> ResultT:
            arguments = known.bind(*args, **kwargs).arguments
            result = function(**arguments | read_parameters(read, arguments))  # type: ignore[call-arg]
            for message in dict.fromkeys(_iter_new_warnings(result, arguments.values())):
                warnings.warn(message, UrmpipeWarning, stacklevel=2)
            return result

        checked.__signature__ = known  # type: ignore[attr-defined]
        return checked

    return decorate


def _iter_new_warnings(result: Any, operands: Iterable[Any]) -> Iterator[str]:
    """Yield the warnings of a result that its operands did not have."""
    if not hasattr(result, "to_frame"):
        return
    listed = [value if isinstance(value, (list, tuple)) else (value,) for value in operands]
    known = {
        replace(warning, about=None)
        for values in listed
        for operand in values
        for warning in _iter_warnings(operand)
    }
    for warning in _iter_warnings(result):
        if replace(warning, about=None) not in known:
            yield str(warning)


def _iter_warnings(result: Any) -> Iterator[LogWarning]:
    """Yield the warnings of a result, and those of the logs that it compares with the log's name."""
    if not isinstance(result, Displayable):  # a table may have a column of that name
        return
    yield from getattr(result, "warnings", ())
    for deviation in getattr(result, "runs", ()):
        yield from (warning.of(deviation.name) for warning in deviation.run.warnings)


def as_list(operands: object) -> list[Any]:
    """Return operands as a list: a path, a table, a run or another result alone is a list of one."""
    is_table = hasattr(operands, "__array__") or hasattr(operands, "__arrow_c_stream__")
    is_single = is_table or isinstance(operands, (str, Path, Mapping)) or not isinstance(operands, Iterable)
    return [operands] if is_single else list(operands)  # type: ignore[call-overload]


def as_paths(files: PathLike | Sequence[PathLike]) -> list[Path]:
    """Return the names of files as paths; one alone is a list of one."""
    return [Path(file) for file in as_list(files)]


def check_types(name: str, operands: Sequence[object], types: tuple[type, ...], allowed: str) -> None:
    """Raise an `OptionError` with all operands that are neither paths nor of some types.

    Args:
        name: The operand, for messages.
        operands: The operands, at least one.
        types: Classes that are allowed in addition to paths.
        allowed: The operands allowed, for messages.
    """
    wrong = [
        format_value(operand)
        for operand in operands
        if not isinstance(operand, (str, Path, *types)) or operand == ""
    ]
    if wrong or not operands:
        raise OptionError(Finding(about=name, found=", ".join(wrong) or "none", allowed=allowed))


def require_recordings(files: Sequence[Path]) -> None:
    """Raise a `RecordingError` with all existing files that are not recordings."""
    foreign = [path for path in files if path.exists() and not is_recording(path)]
    if foreign:
        message = "found no recording of urmpipe, allowed: a recording (.rrd) that urmpipe wrote"
        raise RecordingError(*(Finding(message, file=str(path)) for path in foreign))


def reject_recording(operand: object, allowed: str) -> None:
    """Raise a `LogError` if an operand is the file of a recording, where something else is allowed."""
    if isinstance(operand, (str, Path)) and Path(operand).is_file() and is_recording(Path(operand)):
        raise LogError(Finding(file=str(operand), found="a recording", allowed=allowed))


def raise_warnings(strict: bool, reported: Sequence[LogWarning]) -> None:
    """Raise a `LogError` with all warnings if they are errors; ignored columns are not warnings."""
    errors = [warning for warning in reported if warning.kind != PASSED_OVER]
    if strict and errors:
        first = Finding(parameter="strict", found=format_count(len(errors), "warning"), allowed="none")
        raise LogError(first, *(warning.as_finding() for warning in errors))
