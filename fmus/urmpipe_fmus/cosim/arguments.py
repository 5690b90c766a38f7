"""The arguments of a system file: `$name` in it, replaced before anything else is read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from urmpipe_models.errors import Finding, Hint, not_among, shown
from urmpipe_models.files import is_there
from urmpipe_models.measure_units import WRITTEN, quantity

NAMES = ("unit", "column")
"""Keys whose texts are names, also where a file beside is called so."""


def beside(folder: Path, value: Any) -> Any:
    """Return a value in which each text that names a file of a folder is that file's path."""
    if isinstance(value, str) and value and not value.startswith("$"):
        path = folder / value
        return str(path) if is_there(path) else value
    if isinstance(value, Mapping):
        return {key: one if key in NAMES else beside(folder, one) for key, one in value.items()}
    return _mapped(lambda one: beside(folder, one), value)


def replaced(value: Any, arguments: Mapping[str, Any]) -> Any:
    """Return a value in which each text `$name` is the argument of that name."""
    if isinstance(value, str) and value[:1] == "$" and value[1:] in arguments:
        return arguments[value[1:]]
    return _mapped(lambda one: replaced(one, arguments), value)


def unknown(value: Any, arguments: Mapping[str, Any], where: str = "") -> Iterator[Finding]:
    """Yield what is wrong with the `$name`s of a value: no such argument."""
    if isinstance(value, str) and value[:1] == "$" and value[1:] not in arguments:
        yield Finding(
            f"{not_among(value, (f'${name}' for name in arguments))} ([arguments] names them)", about=where
        )
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield from unknown(one, arguments, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list):
        for one in value:
            yield from unknown(one, arguments, where)


def given(
    defaults: Mapping[str, Any], arguments: Mapping[str, str], faults: list[Finding], shipped: bool = False
) -> dict[str, Any]:
    """Return the arguments of a system: those given, each of its default's type, and the other defaults.

    Args:
        defaults: What the file's `[arguments]` says.
        arguments: What is given instead, as texts.
        faults: What is wrong is noted here.
        shipped: Whether the system came along.
    """
    values = dict(defaults)
    for name, text in arguments.items():
        if name not in defaults:
            said = f"{not_among(name, defaults)}; all else is changed in the system's file"
            hints = (Hint("write_system", None, "makes a copy of it"),) if shipped else ()
            faults.append(Finding(said, about=f"argument {name}", hints=hints))
            continue
        try:
            values[name] = _like(defaults[name], text)
        except ValueError:
            allowed = "true, false" if isinstance(defaults[name], bool) else "a number"
            faults.append(
                Finding(
                    f"found {shown(text)}, allowed: {allowed}, like {shown(defaults[name])}",
                    about=f"argument {name}",
                )
            )
    return values


def _like(default: Any, text: str) -> Any:
    """Return a text as a value of a default's type; ValueError if it is none."""
    if isinstance(default, bool):
        if text not in ("true", "false"):
            raise ValueError(text)
        return text == "true"
    if isinstance(default, str) or any(math.isfinite(quantity(text, units)) for units in _WITH_UNIT):
        return text
    return int(text) if isinstance(default, int) and text.lstrip("+-").isdigit() else float(text)


_WITH_UNIT = [{unit: one for unit, one in units.items() if unit} for units in WRITTEN.values()]


def _mapped(function: Callable[[Any], Any], value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: function(one) for key, one in value.items()}
    if isinstance(value, list):
        return [function(one) for one in value]
    return value
