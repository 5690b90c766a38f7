"""How a parameter and its value are spelled: as an option, as a keyword, in a system file and its maps.

Values are spelled by type: a mapping goes by column or joint ("" for all of them), a list is A,B,C, a tuple
is LOW:HIGH, True a flag, and None what the reader is to fill in.

Messages as data: what is wrong or worth knowing, apart from it what the reader may give, and three voices.

A message keeps its sentence, written where the fault is seen. What that is about, and the parameters that
would change it, are fields. Who prints chooses the voice, so that a stored message reads right for everybody:

    warning = Finding("no unit is given", hints=(Hint("unit", {"q1": "deg"}, "applies this"),))
    warning.format("command line")   no unit is given; --unit q1=deg applies this
    warning.format("python")         no unit is given; unit={"q1": "deg"} applies this
    warning.format("system file")    no unit is given; units.q1 = "deg" in the map of the log applies this

The error tree: everything that urmpipe raises on purpose is an `UrmpipeError`.

An error carries *findings*: all that is wrong with an input is collected and reported at once,
each finding as one line that names the file, the line, the column, what was found and what is
allowed. The command line prints these lines and exits with 2.

How a name that is not there is told: with the one that may have been meant, and those that are allowed.
"""

from __future__ import annotations

import html
import json
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from difflib import SequenceMatcher
from itertools import groupby
from typing import Any, Literal, TypeVar

Voice = Literal["command line", "python", "system file"]
"""Who reads a message, and so how parameters are spelled."""


class Placeholder(str):
    """What the reader fills in: it stands without quotes."""

    __slots__ = ()


_OWN: Mapping[str, Any] = {
    "audit": Placeholder("FILE.csv"),
    "base": [Placeholder("X"), Placeholder("Y"), Placeholder("Z")],
    "baseline": Placeholder("RUN.rrd"),
    "decimal": Placeholder("SIGN"),
    "delimiter": Placeholder("SIGN"),
    "duration": Placeholder("SECONDS"),
    "interval": (Placeholder("LOW"), Placeholder("HIGH")),
    "joints": [Placeholder("A"), Placeholder("B"), Placeholder("C")],
    "log_map": Placeholder("FILE.toml"),
    "measured": [Placeholder("A"), Placeholder("B"), Placeholder("C")],
    "output": Placeholder("FILE"),
    "period": Placeholder("SECONDS"),
    "robot": Placeholder("NAME|FILE"),
    "rotation": Placeholder("FORM"),
    "source": Placeholder("NAME"),
    "step": Placeholder("SECONDS"),
    "sync": Placeholder("SECONDS"),
    "time": Placeholder("COLUMN"),
    "tip_link": Placeholder("LINK"),
    "tool": [Placeholder("X"), Placeholder("Y"), Placeholder("Z")],
    "tsp": Placeholder("SECONDS"),
    "write_map": Placeholder("FILE.toml"),
    "write_system": Placeholder("FILE.toml"),
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


def format_parameter(parameter: str, voice: Voice) -> str:
    """Return a parameter as somebody calls it: an option, a keyword, or a key of a file."""
    if voice == "python":
        return parameter
    if parameter in ARGUMENTS:
        return parameter.upper()
    return IN_FILE.get(parameter, to_option(parameter)) if voice == "system file" else to_option(parameter)


def to_option(parameter: str) -> str:
    """Return the option of the command line that a keyword is: `--skip-bad`."""
    return f"--{parameter.replace('_', '-')}"


def format_assignment(parameter: str, value: Any, voice: Voice) -> str:
    """Return a parameter with its value, as somebody writes it: `--unit q1=deg`, `unit={"q1": "deg"}`."""
    own = _OWN.get(parameter, Placeholder(parameter.upper()))
    if isinstance(value, Mapping):
        value = {key: own if one is None else one for key, one in value.items()}
    value = own if value is None else value
    if voice == "command line" or (voice == "system file" and parameter not in IN_FILE):
        return " ".join(_options(to_option(parameter), value))
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
    return shell_quote(key) * bool(key) + cell if _is_own(value) else shell_quote(key + cell)


def _cell(value: Any) -> str:
    """Return a value as the command line takes it: A,B,C of a list, LOW:HIGH of two ends."""
    if isinstance(value, (list, tuple)):
        return (":" if isinstance(value, tuple) else ",").join(map(_cell, value))
    return value if isinstance(value, str) else f"{value:.15g}"


def _is_own(value: Any) -> bool:
    """Return whether a value is the reader's own, and needs no quotes of a shell."""
    return isinstance(value, Placeholder) or (isinstance(value, (list, tuple)) and all(map(_is_own, value)))


def _in_python(value: Any) -> str:
    """Return a value as Python writes it."""
    if isinstance(value, Mapping):
        named = (f"{_quoted(key)}: {_in_python(one)}" for key, one in value.items())
        return _in_python(value[""]) if list(value) == [""] else f"{{{', '.join(named)}}}"
    if isinstance(value, (list, tuple)):
        inner = ", ".join(map(_in_python, value))
        return f"[{inner}]" if isinstance(value, list) else f"({inner})"
    if isinstance(value, str) and not isinstance(value, Placeholder):
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


def shell_quote(word: object, platform: str = sys.platform) -> str:
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
        f"python -c {shell_quote(code)}"
        if set(code) & set('"$`!\\\u201c\u201d\u201e')
        else f'python -c "{code}"'
    )


HIDDEN = "\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
"""DEL, C1, and what else ends a line or reorders letters without being seen, as a range of a pattern."""

_ACTING, _HIDDEN = re.compile(f"[\x00-\x1f{HIDDEN}]"), re.compile(f"[{HIDDEN}]")
_UNHOLDABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")

Value = str | bool | float | list[str] | list[float] | Mapping[str, str | tuple[float, float] | None] | None
"""What to give a parameter: by column or joint, "" for all; True for a flag; None for the reader's own."""


@dataclass(frozen=True, slots=True)
class Hint:
    """A parameter that would change what a message says.

    Attributes:
        parameter: Its keyword, such as "skip_bad"; empty for advice that is no parameter.
        value: What to give it; None where that is the reader's own.
        does: What it does, as the end of a sentence that the parameter begins: "applies this".
        call: The command and public function that takes it, where it is another than the one that ran.
        robot: The robot to give with it, which it is refused without, where its name says which.
    """

    parameter: str
    value: Value = None
    does: str = ""
    call: str = ""
    robot: str = ""

    def __hash__(self) -> int:
        return hash((self.parameter, self.does))  # a mapping has no hash

    def format(self, voice: Voice) -> str:
        """Return the parameter with its value: `--unit q1=deg`, `unit={"q1": "deg"}`."""
        if not self.parameter:
            return ""
        if self.robot:
            joined = " " if voice == "command line" else ", "
            return joined.join(
                (format_assignment("robot", self.robot, voice), replace(self, robot="").format(voice))
            )
        if not self.call:
            return format_assignment(self.parameter, self.value, voice)
        if voice == "python":
            return f"{self.call}({format_assignment(self.parameter, self.value, voice)})"
        return f"urmpipe {self.call} {format_assignment(self.parameter, self.value, 'command line')}"


class Message:
    """What all messages share: their words in each voice. Its classes are frozen dataclasses.

    Attributes:
        message: The sentence, without what the other fields say.
        parameter: Keyword of the public function that it is about, such as "tsp".
        found: What was found.
        allowed: What is allowed.
        hints: What the reader may give.
    """

    __slots__ = ()

    message: str
    parameter: str | None
    found: str | None
    allowed: str | None
    hints: tuple[Hint, ...]

    def __str__(self) -> str:
        return self.format("python")

    def place(self) -> str:
        """Return where it was seen, as it stands before the sentence; empty where that is unknown."""
        return ""

    def sentence(self, voice: Voice = "python") -> str:
        """Return what it says without its place: subject, sentence, found, allowed and hints."""
        told = (
            f"{name}{said}" for name, said in (("found ", self.found), ("allowed: ", self.allowed)) if said
        )
        said = (": " if self.found else ", ").join(filter(None, (self.message, ", ".join(told))))
        if self.parameter:
            said = f"{format_parameter(self.parameter, voice)}: {said}"
        return escape_line("; ".join([said, *format_hints(self.hints, voice)]))

    def format(self, voice: Voice) -> str:
        """Return all of it in one line, as somebody reads it."""
        place = escape_line(self.place())
        return f"{place}: {self.sentence(voice)}" if place else self.sentence(voice)

    def to_dict(self, voice: Voice = "python") -> dict[str, Any]:
        """Return its fields for JSON, with the sentence as `message`."""
        told: dict[str, Any] = asdict(self)  # type: ignore[call-overload]
        return told | {"message": self.sentence(voice), "hints": list(told["hints"])}


@dataclass(frozen=True, slots=True)
class Finding(Message):
    """One thing that is wrong with an input.

    Attributes:
        message: What is wrong; empty where `found` and `allowed` say it.
        file: The file it was found in, as the user named it.
        line: Line of the file, counted from 1 (header lines count).
        row: Data row of the file, counted from 1 (header lines do not count).
        column: Name of the column or joint.
        kind: A short word to filter by, such as "missing"; empty where none is known.
        about: The log, block or table of a system file that it is about.
        parameter: Keyword that it is about.
        found: What was found.
        allowed: What is allowed.
        hints: What the reader may give.
    """

    message: str = ""
    file: str | None = None
    line: int | None = None
    row: int | None = None
    column: str | None = None
    kind: str = ""
    about: str | None = None
    parameter: str | None = None
    found: str | None = None
    allowed: str | None = None
    hints: tuple[Hint, ...] = ()

    def place(self) -> str:
        """Return file, line (or row) and column, and what it is about: "log.csv:12, column q1"."""
        file = (self.file or "") + ("" if self.line is None else f":{self.line}")
        row = None if self.row is None or self.line is not None else f"row {self.row}"
        column = None if self.column is None else f"column {self.column}"
        place = ", ".join(filter(None, (file, row, column)))
        return ": ".join(filter(None, (place, self.about) if self.file else (self.about, place)))


def format_hints(hints: Sequence[Hint], voice: Voice) -> Iterator[str]:
    """Yield what the reader may give, what does the same in one: "--repair or --skip-bad leaves them out".

    Args:
        hints: The hints; of those that belong to no file none is told to who writes a system file.
        voice: Who reads it.
    """
    for does, alike in groupby(hints, key=lambda hint: hint.does):
        own = [
            hint for hint in alike if hint.call or voice != "system file" or hint.parameter not in IN_NO_FILE
        ]
        told = " or ".join(filter(None, (hint.format(voice) for hint in own)))
        if voice == "system file" and any(hint.parameter in IN_MAP and not hint.call for hint in own):
            told += " in the map of the log"
        if own:
            yield f"{told} {does}".strip() if does else f"use {told}"


def escape_line(text: str) -> str:
    """Return a text with all that is not printable as the escapes of Python's strings.

    Names come from files, and may hold what breaks a line or what a terminal acts on instead of showing it.
    """
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else _escape(one) for one in text)


def escape_control_characters(text: str, kept: str = "") -> str:
    """Return a text with escapes of Python's strings for what ends a line, acts on a terminal or reorders.

    Unlike `escape_line` it leaves letters that are merely unusual, such as a space that does not break.

    Args:
        text: The text.
        kept: Letters to leave: those that end a line where lines are meant.
    """
    return _ACTING.sub(lambda found: found[0] if found[0] in kept else _escape(found[0]), text)


def escape_json(written: str) -> str:
    """Return JSON, or a string of TOML, with escapes for what is not seen: it reads back the same."""
    return _HIDDEN.sub(lambda found: f"\\u{ord(found[0]):04x}", written)


def escape_html(words: str) -> str:
    """Return words as text of HTML or SVG, on one line and without what is not printable."""
    return html.escape(escape_line(words))


def escape_xml(written: str) -> str:
    """Return escaped text of XML with references for what is not seen.

    For what XML cannot hold, most control characters and lone surrogates, stand escapes of Python's strings.
    """
    held = _HIDDEN.sub(lambda found: f"&#x{ord(found[0]):x};", written)
    return _UNHOLDABLE.sub(lambda found: ascii(found[0])[1:-1], held)


def _escape(letter: str) -> str:
    return letter.encode("unicode_escape").decode()


MAX_VALUE_LENGTH = 60
"""So many letters of a value stand in a message."""

Given = TypeVar("Given")
Made = TypeVar("Made")


def format_value(value: object) -> str:
    """Return a value as a message shows it: cut where it is long, its type alone where it is an object."""
    name = type(value).__name__
    kind = f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of more digits than Python writes, or nested too deep
        return f"{kind} too large to be shown"
    if len(text) <= MAX_VALUE_LENGTH and text.isprintable() and not text.startswith("<"):
        return text
    if isinstance(value, (str, bytes, int, float, list, tuple, dict)):
        return escape_line(f"{text[: MAX_VALUE_LENGTH - 3]}...")
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


def map_collecting_errors(make: Callable[[Given], Made], items: Iterable[Given]) -> list[Made]:
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


MAX_LISTED = 16
"""So many names are listed; of more, those most like the one that was given."""
MIN_SIMILARITY = 0.6
"""Share of letters that two names have in common, from where on one may have been meant by the other."""

MAX_COMPARED_LENGTH = 200
"""Letters of a name that may have been meant otherwise."""


def format_suggestion(name: str, allowed: Iterable[str]) -> str:
    """Return ` (did you mean NAME?)` with the allowed name most like another, or nothing if none is.

    Small and capital letters count as the same, hyphens, underscores and spaces for nothing.
    """
    near = closest_name(name, allowed)
    return f" (did you mean {near}?)" if near else ""


def closest_name(name: str, allowed: Iterable[str]) -> str | None:
    """Return the allowed name most like another; None if none is."""
    near = _nearest_first(name, allowed, MIN_SIMILARITY)
    return near[0] if near else None


def format_unknown_name(name: str, allowed: Iterable[str]) -> str:
    """Return `found NAME (did you mean ONE?), allowed: ONE, ...` for a name that is not among others."""
    names = list(dict.fromkeys(allowed))
    return f"found {format_value(name)}{format_suggestion(name, names)}, allowed: {format_names(name, names)}"


def format_names(name: str, allowed: Iterable[str]) -> str:
    """Return the allowed names in their order; of more than `MAX_LISTED`, those like a given one."""
    names = list(dict.fromkeys(allowed))
    if len(names) <= MAX_LISTED:
        return ", ".join(names) or "none"
    first = ((name and _nearest_first(name, names, 0.0)) or names)[:MAX_LISTED]
    return f"{', '.join(first)} and {len(names) - len(first)} others"


def _nearest_first(name: str, allowed: Iterable[str], least: float) -> list[str]:
    """Return the names that are at least so much like another, the nearest first; of equal ones the last."""
    if len(name) > MAX_COMPARED_LENGTH:
        return []
    wanted = _letters(name)
    like = {one: SequenceMatcher(None, _letters(one), wanted).ratio() for one in allowed}
    return sorted((one for one in like if like[one] >= least), key=lambda one: (like[one], one), reverse=True)


def _letters(name: str) -> str:
    """Return a name without what is easily written otherwise."""
    return re.sub("[-_ ]", "", name.casefold())
