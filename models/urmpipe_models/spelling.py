"""How a parameter and its value are spelled: as an option, as a keyword, in a system file and its maps.

Values are spelled by type: a mapping goes by column or joint ("" for all of them), a list is A,B,C, a tuple
is LOW:HIGH, True a flag, and None what the reader is to fill in.
"""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections.abc import Iterator, Mapping
from typing import Any, Literal

Voice = Literal["command line", "python", "system file"]
"""Who reads a message, and so how parameters are spelled."""


class Own(str):
    """What the reader fills in: it stands without quotes."""

    __slots__ = ()


_OWN: Mapping[str, Any] = {
    "audit": Own("FILE.csv"),
    "base": [Own("X"), Own("Y"), Own("Z")],
    "baseline": Own("RUN.rrd"),
    "decimal": Own("SIGN"),
    "delimiter": Own("SIGN"),
    "duration": Own("SECONDS"),
    "interval": (Own("LOW"), Own("HIGH")),
    "joints": [Own("A"), Own("B"), Own("C")],
    "log_map": Own("FILE.toml"),
    "measured": [Own("A"), Own("B"), Own("C")],
    "output": Own("FILE"),
    "period": Own("SECONDS"),
    "robot": Own("NAME|FILE"),
    "rotation": Own("FORM"),
    "source": Own("NAME"),
    "step": Own("SECONDS"),
    "sync": Own("SECONDS"),
    "time": Own("COLUMN"),
    "tip_link": Own("LINK"),
    "tool": [Own("X"), Own("Y"), Own("Z")],
    "tsp": Own("SECONDS"),
    "write_map": Own("FILE.toml"),
    "write_system": Own("FILE.toml"),
}
"""What stands for a value that is the reader's own; another parameter shows its name in capitals."""

IN_MAP = {
    "source": "source",
    "delimiter": "delimiter",
    "decimal": "decimal",
    "layout": "layout",
    "time": "clock.column",
    "period": "clock.period",
    "poses": "clock.poses",
    "joints": "joints.column",
    "interval": "joints.interval",
    "rotation": "tcp.form",
    "unit": "units",
}
"""Where the map of a log, which a system file names, says how to read it."""

IN_FILE = {**IN_MAP, "log_map": "map", "robot": "robot"}
"""Where a system file, or the map of a log in it, says what is a parameter elsewhere; others are options."""

ARGUMENTS = ("path", "drives")
"""Parameters that the command line takes without an option, by their names in capitals."""

_QUOTES = "'\u2018\u2019\u201a\u201b"
"""What PowerShell takes for a single quote."""

_PARTING = frozenset(_QUOTES + ' \t"\u201c\u201d\u201e&()[]{},;=@#$`^!+%~|<>')
"""What PowerShell or cmd reads as more than a letter of a word."""

_BARE = re.compile("[A-Za-z0-9_-]+")
"""A key of TOML that needs no quotes."""


IN_NO_FILE = ("repair", "skip_bad", "derivative", "tsp")
"""Parameters of a log that no file says."""


def subject(parameter: str, voice: Voice) -> str:
    """Return a parameter as somebody calls it: an option, a keyword, or a key of a file."""
    if voice == "python":
        return parameter
    if parameter in ARGUMENTS:
        return parameter.upper()
    return IN_FILE.get(parameter, option_of(parameter)) if voice == "system file" else option_of(parameter)


def option_of(parameter: str) -> str:
    """Return the option of the command line that a keyword is: `--skip-bad`."""
    return f"--{parameter.replace('_', '-')}"


def spelled(parameter: str, value: Any, voice: Voice) -> str:
    """Return a parameter with its value, as somebody writes it: `--unit q1=deg`, `unit={"q1": "deg"}`."""
    own = _OWN.get(parameter, Own(parameter.upper()))
    if isinstance(value, Mapping):
        value = {key: own if one is None else one for key, one in value.items()}
    value = own if value is None else value
    if voice == "command line" or (voice == "system file" and parameter not in IN_FILE):
        return " ".join(_options(option_of(parameter), value))
    return f"{parameter}={_in_python(value)}" if voice == "python" else _in_file(parameter, value)


def _options(option: str, value: Any) -> Iterator[str]:
    """Yield an option with its value, once for each column or joint that it names."""
    if value is True:
        yield option
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield f"{option} {_word(f'{key}=' if key else '', one)}"
    else:
        yield f"{option} {_word('', value)}"


def _word(key: str, value: Any) -> str:
    """Return a value behind its key as one word of a shell; what the reader fills in stays as it is."""
    cell = _cell(value)
    return pasted(key) * bool(key) + cell if _is_own(value) else pasted(key + cell)


def _cell(value: Any) -> str:
    """Return a value as the command line takes it: A,B,C of a list, LOW:HIGH of two ends."""
    if isinstance(value, (list, tuple)):
        return (":" if isinstance(value, tuple) else ",").join(map(_cell, value))
    return value if isinstance(value, str) else f"{value:.15g}"


def _is_own(value: Any) -> bool:
    """Return whether a value is the reader's own, and needs no quotes of a shell."""
    return isinstance(value, Own) or (isinstance(value, (list, tuple)) and all(map(_is_own, value)))


def _in_python(value: Any) -> str:
    """Return a value as Python writes it."""
    if isinstance(value, Mapping):
        named = (f"{_quoted(key)}: {_in_python(one)}" for key, one in value.items())
        return _in_python(value[""]) if list(value) == [""] else f"{{{', '.join(named)}}}"
    if isinstance(value, (list, tuple)):
        inner = ", ".join(map(_in_python, value))
        return f"[{inner}]" if isinstance(value, list) else f"({inner})"
    if isinstance(value, str) and not isinstance(value, Own):
        return _quoted(value)
    return str(value) if isinstance(value, bool) else _cell(value)


def _in_file(parameter: str, value: Any) -> str:
    """Return what a system file, or the map of a log in it, says: as TOML."""
    key = IN_FILE[parameter]
    if not isinstance(value, Mapping):
        return f"{key} = {_in_toml(value)}"
    paths = (f"{key}.{name if _BARE.fullmatch(name) else _quoted(name)}" for name in value)
    return ", ".join(f"{path} = {_in_toml(one)}" for path, one in zip(paths, value.values(), strict=True))


def _in_toml(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_in_toml, value))}]"
    return str(value).lower() if isinstance(value, bool) else _in_python(value)


def _quoted(text: str) -> str:
    """Return a text in the quotes of Python and TOML, with escapes of both for what is not printable."""
    return _escaped(json.dumps(text, ensure_ascii=False))


def _escaped(text: str) -> str:
    return "".join(one if one.isprintable() else f"\\U{ord(one):08x}" for one in text)


def pasted(word: object, platform: str = sys.platform) -> str:
    """Return a word as it may be pasted into a shell: quoted if this would part it or read it otherwise.

    Args:
        word: Such as the path of a file.
        platform: As `sys.platform` tells it: on Windows the shell is PowerShell, where a backslash parts
            folders and is not quoted; elsewhere what is not printable stands in the $'...' of bash and zsh.
    """
    said = str(word)
    if platform == "win32":
        quoted = re.sub(f"[{_QUOTES}]", lambda quote: 2 * quote[0], said)
        return f"'{quoted}'" if not said or set(said) & _PARTING else said
    if said.isprintable():
        return shlex.quote(said)
    inner = said.replace("\\", "\\\\").replace("'", "\\'")
    return f"$'{_escaped(inner)}'"


def python_command(code: str) -> str:
    """Return the command that runs a line of Python, in which texts stand as `repr` writes them.

    It stands in double quotes, as cmd, too, reads it, unless a name in it has what a shell reads in these.
    """
    return (
        f"python -c {pasted(code)}" if set(code) & set('"$`!\\\u201c\u201d\u201e') else f'python -c "{code}"'
    )
