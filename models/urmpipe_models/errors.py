"""Messages and errors: faults and notes, the parameters that the user may give, and how both are written.

1. Parameters: the same parameter is an option and a keyword. Values are written as in a shell, which Python
   and TOML read as texts: a mapping is given per column or joint ("" for all), a list is A,B,C, a tuple is
   LOW:HIGH, True is a flag, None is a value that the user fills in.
2. Escapes: names come from files and may contain what ends a line, acts on a terminal or reorders letters.
3. Messages: the sentence is written where the fault is found; its subject and the parameters that change it
   are fields. The text is the same for users of the command line, of Python and of files:

    Finding(parameter="unit", found="'deg'", hints=(Hint("unit", {"q1": "deg"}, "applies this"),))
    unit (--unit): found 'deg'; --unit q1=deg applies this

4. Errors: everything that urmpipe raises on purpose is an `UrmpipeError`. It carries *findings*: all faults
   of an input are collected and reported at once, one line per finding, with file, line, column, the value
   found and the values allowed. The command line prints these lines and exits with 2.
5. Unknown names: reported with the most similar allowed name and the list of allowed names.
"""

from __future__ import annotations

import html
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from difflib import SequenceMatcher
from itertools import groupby
from typing import Any, TypeVar


class Placeholder(str):
    """A value that the user fills in, written without quotes."""

    __slots__ = ()


_PLACEHOLDERS: Mapping[str, Any] = {  # of other parameters: the name in capitals
    "arguments": Placeholder("VALUE"),
    "audit": Placeholder("FILE.csv"),
    "base": [Placeholder("X"), Placeholder("Y"), Placeholder("Z")],
    "baseline": Placeholder("RUN.rrd"),
    "decimal": Placeholder("SIGN"),
    "delimiter": Placeholder("SIGN"),
    "duration": Placeholder("SECONDS"),
    "interval": (Placeholder("LOW"), Placeholder("HIGH")),
    "joints": [Placeholder("A"), Placeholder("B"), Placeholder("C")],
    "map": Placeholder("FILE.toml"),
    "measured": [Placeholder("A"), Placeholder("B"), Placeholder("C")],
    "names": [Placeholder("A"), Placeholder("B"), Placeholder("C")],
    "orientation": [Placeholder("A"), Placeholder("B"), Placeholder("C")],
    "output": Placeholder("FILE"),
    "period": Placeholder("SECONDS"),
    "position": [Placeholder("X"), Placeholder("Y"), Placeholder("Z")],
    "robot": Placeholder("NAME|FILE"),
    "rotation": Placeholder("FORM"),
    "offsets": [Placeholder("OFFSET"), Placeholder("...")],
    "signs": [Placeholder("1|-1"), Placeholder("...")],
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

_NO_OPTION = {  # keywords that are positional arguments of commands, or of Python alone
    *("defaults", "drives", "font", "inputs", "lazy", "logs", "name", "name_or_path", "network"),
    *("on_message", "path", "progress", "q", "recorded_tcp"),
    *("recordings", "reference", "result", "results", "run", "shared", "side", "starts", "system"),
    *("t", "targets", "title", "width"),
}

_QUOTES = "'\u2018\u2019\u201a\u201b"  # single quotes of PowerShell
_SPECIAL = frozenset(_QUOTES + ' \t"\u201c\u201d\u201e&()[]{},;=@#$`^!+%~|<>')  # special in PowerShell or cmd


def to_option(parameter: str) -> str:
    """Return the command line option of a keyword: `--skip-bad`."""
    return f"--{parameter.replace('_', '-')}"


def _format_assignment(parameter: str, value: Any) -> str:
    """Return an option with its value: `--unit q1=deg`."""
    placeholder = _PLACEHOLDERS.get(parameter, Placeholder(parameter.upper()))
    if isinstance(value, Mapping):
        value = {key: placeholder if item is None else item for key, item in value.items()}
    return " ".join(_iter_options(to_option(parameter), placeholder if value is None else value))


def _iter_options(option: str, value: Any) -> Iterator[str]:
    """Yield an option with its value, once per column or joint of a mapping."""
    if value is True:
        yield option
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield f"{option} {_to_word(f'{key}=' if key else '', item)}"
    else:
        yield f"{option} {_to_word('', value)}"


def _to_word(key: str, value: Any) -> str:
    cell = _to_cell(value)
    return shell_quote(key) * bool(key) + cell if _is_placeholder(value) else shell_quote(key + cell)


def _to_cell(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return (":" if isinstance(value, tuple) else ",").join(map(_to_cell, value))
    return value if isinstance(value, str) else f"{value:.15g}"


def _is_placeholder(value: Any) -> bool:
    sequence = isinstance(value, (list, tuple))
    return isinstance(value, Placeholder) or (sequence and all(map(_is_placeholder, value)))


def _escape_long(text: str) -> str:
    return "".join(letter if letter.isprintable() else f"\\U{ord(letter):08x}" for letter in text)


def shell_quote(word: object, platform: str = sys.platform) -> str:
    """Return a word that may be pasted into a shell, in quotes if the shell would split or expand it.

    Args:
        word: Such as the path of a file.
        platform: As in `sys.platform`. On Windows the shell is PowerShell, where a backslash separates
            folders and is not quoted; elsewhere unprintable characters are in the $'...' of bash and zsh.
    """
    text = str(word)
    if platform == "win32":
        quoted = re.sub(f"[{_QUOTES}]", lambda quote: 2 * quote[0], text)
        return f"'{quoted}'" if not text or set(text) & _SPECIAL else text
    if text.isprintable():
        return shlex.quote(text)
    inner = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"$'{_escape_long(inner)}'"


def python_command(code: str) -> str:
    """Return the command that runs a line of Python, in which texts are written as by `repr`.

    It is in double quotes, as cmd reads them, too, unless the code contains what a shell expands in these.
    """
    special = set(code) & set('"$`!\\\u201c\u201d\u201e')
    return f"python -c {shell_quote(code)}" if special else f'python -c "{code}"'


HIDDEN = "\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
"""Range of a pattern: DEL, C1, and other invisible characters that end a line or reorder letters."""

_CONTROL, _HIDDEN = re.compile(f"[\x00-\x1f{HIDDEN}]"), re.compile(f"[{HIDDEN}]")
_INVALID_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def escape_line(text: str) -> str:
    """Return a text with all unprintable characters as the escapes of Python's strings."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else _escape(letter) for letter in text)


def escape_control_characters(text: str, kept: str = "") -> str:
    """Return a text with escapes of Python's strings for what ends a line, acts on a terminal or reorders.

    Unlike `escape_line` it keeps letters that are merely unusual, such as a non-breaking space.

    Args:
        text: The text.
        kept: Letters to keep, such as line ends of a text of several lines.
    """
    return _CONTROL.sub(lambda match: match[0] if match[0] in kept else _escape(match[0]), text)


def escape_json(text: str) -> str:
    """Return JSON, or a string of TOML, with escapes for invisible characters: it reads back the same."""
    return _HIDDEN.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def escape_html(text: str) -> str:
    """Return a text of HTML or SVG, on one line and without unprintable characters."""
    return html.escape(escape_line(text))


def escape_xml(text: str) -> str:
    """Return escaped text of XML with references for invisible characters.

    Most control characters and lone surrogates, which XML cannot contain, become escapes of Python's strings.
    """
    references = _HIDDEN.sub(lambda match: f"&#x{ord(match[0]):x};", text)
    return _INVALID_IN_XML.sub(lambda match: ascii(match[0])[1:-1], references)


def _escape(letter: str) -> str:
    return letter.encode("unicode_escape").decode()


Value = str | bool | float | list[str] | list[float] | Mapping[str, str | tuple[float, float] | None] | None
"""Value of a parameter: per column or joint, "" for all; True for a flag; None for the user's own."""


@dataclass(frozen=True, slots=True)
class Hint:
    """A parameter that would change what a message reports.

    Attributes:
        parameter: Its keyword, such as "skip_bad"; empty for advice without a parameter.
        value: Its value; None where the user fills it in.
        effect: Its effect, as the end of a sentence that the parameter begins: "applies this".
        call: The command and public function with this parameter, if it is not the one that ran.
        robot: The robot that the parameter needs, if its name states which.
    """

    parameter: str
    value: Value = None
    effect: str = ""
    call: str = ""
    robot: str = ""

    def __hash__(self) -> int:
        return hash((self.parameter, self.effect))  # a mapping has no hash

    def __str__(self) -> str:
        if not self.parameter:
            return ""
        robot = f"{_format_assignment('robot', self.robot)} " if self.robot else ""
        call = f"urmpipe {self.call} " if self.call else ""
        return f"{call}{robot}{_format_assignment(self.parameter, self.value)}"


class Message:
    """Base of all messages. Its classes are frozen dataclasses.

    Attributes:
        message: The sentence, without the content of the other fields.
        parameter: Keyword of the public function that it is about, such as "tsp".
        found: The value found.
        allowed: The values allowed.
        hints: What the user may give.
    """

    __slots__ = ()

    message: str
    parameter: str | None
    found: str | None  # plain: ok
    allowed: str | None
    hints: tuple[Hint, ...]

    def __str__(self) -> str:
        place = escape_line(self.place())
        return f"{place}: {self.sentence()}" if place else self.sentence()

    def place(self) -> str:
        """Return the place that precedes the sentence, or an empty string."""
        return ""

    def sentence(self) -> str:
        """Return the message without its place: subject, sentence, found, allowed and hints."""
        fields = (("found ", self.found), ("allowed: ", self.allowed))
        values = ", ".join(f"{label}{value}" for label, value in fields if value)
        text = (": " if self.found else ", ").join(filter(None, (self.message, values)))
        if self.parameter:
            option = "" if self.parameter in _NO_OPTION else f" ({to_option(self.parameter)})"
            text = f"{self.parameter}{option}: {text}"
        return escape_line("; ".join([text, *format_hints(self.hints)]))

    def to_dict(self) -> dict[str, Any]:
        """Return its fields for JSON, with the sentence as `message`."""
        fields: dict[str, Any] = asdict(self)  # type: ignore[call-overload]
        return fields | {"message": self.sentence(), "hints": list(fields["hints"])}


@dataclass(frozen=True, slots=True)
class Finding(Message):
    """One fault of an input.

    Attributes:
        message: The fault; empty where `found` and `allowed` state it.
        file: The file, as the user named it.
        line: Line of the file, counted from 1 (header lines count).
        row: Data row of the file, counted from 1 (header lines do not count).
        column: Name of the column or joint.
        kind: A short word to filter by, such as "missing"; may be empty.
        about: The log, block or table of a system file that it is about.
        parameter: Keyword that it is about.
        found: The value found.
        allowed: The values allowed.
        hints: What the user may give.
    """

    message: str = ""
    file: str | None = None
    line: int | None = None
    row: int | None = None
    column: str | None = None
    kind: str = ""
    about: str | None = None
    parameter: str | None = None
    found: str | None = None  # plain: ok
    allowed: str | None = None
    hints: tuple[Hint, ...] = ()

    def place(self) -> str:
        """Return file, line (or row), column and subject: "log.csv:12, column q1"."""
        file = (self.file or "") + ("" if self.line is None else f":{self.line}")
        row = None if self.row is None or self.line is not None else f"row {self.row}"
        column = None if self.column is None else f"column {self.column}"
        place = ", ".join(filter(None, (file, row, column)))
        return ": ".join(filter(None, (place, self.about) if self.file else (self.about, place)))


def format_hints(hints: Sequence[Hint]) -> Iterator[str]:
    """Yield one clause per effect: "--repair or --skip-bad leaves them out"."""
    for effect, group in groupby(hints, key=lambda hint: hint.effect):
        text = " or ".join(filter(None, map(str, group)))
        yield f"{text} {effect}".strip() if effect else f"use {text}"


class UrmpipeError(Exception):
    """Root of every error that urmpipe raises on purpose.

    Attributes:
        findings: All faults, at least one.
    """

    def __init__(self, *findings: Finding | str) -> None:
        self.findings: tuple[Finding, ...] = tuple(
            Finding(finding) if isinstance(finding, str) else finding for finding in findings
        )
        super().__init__("\n".join(str(finding) for finding in self.findings))


class RobotError(UrmpipeError):
    """A robot description cannot be found, read or used (unknown name, URDF, TOML, frames)."""


class LogError(UrmpipeError):
    """A log cannot be read, or contains invalid data."""


class PathError(UrmpipeError):
    """The rows of a path do not define lines and arcs, or no arm reaches them."""


class RecordingError(UrmpipeError):
    """A recording cannot be read, is not one of urmpipe, or lacks the requested data."""


class OutputError(UrmpipeError):
    """An output may not be written there, or could not be verified after writing."""


class OptionError(UrmpipeError):
    """The value of an option is invalid, or two options contradict each other."""


class UnitError(UrmpipeError):
    """The description of a unit is invalid, or it rejects a value: unknown, not finite, out of range."""


class FmuError(UrmpipeError):
    """An FMU cannot be built, read, loaded or run, or reports an error."""


class NetworkError(UrmpipeError):
    """A network cannot be found, read or assembled."""


class CosimulationError(UrmpipeError):
    """A system of blocks cannot be assembled: its file, its connections, an algebraic loop."""


class ViewerError(UrmpipeError):
    """A recording cannot be shown here: there is no display, or the viewer does not start."""


_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def map_collecting_errors(function: Callable[[_Item], _Result], items: Iterable[_Item]) -> list[_Result]:
    """Return the results of a function for all items.

    Raises:
        UrmpipeError: With the findings of all items, of the class of the first error.
    """
    results: list[_Result] = []
    errors: list[UrmpipeError] = []
    for item in items:
        try:
            results.append(function(item))
        except UrmpipeError as error:
            errors.append(error)
    if errors:
        findings = dict.fromkeys(finding for error in errors for finding in error.findings)
        raise type(errors[0])(*findings) from errors[0]
    return results


MAX_VALUE_LENGTH = 60  # characters of a value in a message


def format_value(value: object) -> str:
    """Return the `repr` of a value for a message: a long one is cut, an object is named by its type."""
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


MAX_LISTED = 16  # of more names, the most similar ones are listed
MIN_SIMILARITY = 0.6  # ratio of `difflib.SequenceMatcher` from which a name is suggested
MAX_COMPARED_LENGTH = 200  # longer names are not compared: the time grows with the square of the length


def check_choice(parameter: str, value: str, allowed: Sequence[str]) -> None:
    """Raise an `OptionError` if the value of a parameter is not one of the allowed words."""
    if value not in allowed:
        raise OptionError(Finding(parameter=parameter, found=value, allowed=", ".join(allowed)))  # plain: ok


def format_suggestion(name: str, allowed: Iterable[str]) -> str:
    """Return ` (did you mean NAME?)` with the most similar allowed name, or an empty string.

    Case, hyphens, underscores and spaces are ignored.
    """
    closest = closest_name(name, allowed)
    return f" (did you mean {closest}?)" if closest else ""


def closest_name(name: str, allowed: Iterable[str]) -> str | None:
    """Return the most similar allowed name, or None if no name is similar."""
    similar = _sort_by_similarity(name, allowed, MIN_SIMILARITY)
    return similar[0] if similar else None


def format_unknown_name(name: str, allowed: Iterable[str]) -> str:
    """Return `found NAME (did you mean OTHER?), allowed: OTHER, ...`."""
    names = list(dict.fromkeys(allowed))
    return f"found {format_value(name)}{format_suggestion(name, names)}, allowed: {format_names(name, names)}"


def format_names(name: str, allowed: Iterable[str]) -> str:
    """Return the allowed names as a list; if there are more than `MAX_LISTED`, the most similar to `name`."""
    names = list(dict.fromkeys(allowed))
    if len(names) <= MAX_LISTED:
        return ", ".join(names) or "none"
    first = ((name and _sort_by_similarity(name, names, 0.0)) or names)[:MAX_LISTED]
    more = len(names) - len(first)
    return f"{', '.join(first)} and {more} other{'s' * (more != 1)}"


def _sort_by_similarity(name: str, allowed: Iterable[str], min_similarity: float) -> list[str]:
    """Return the names with at least the given similarity, most similar first, equal ones Z to A."""
    if len(name) > MAX_COMPARED_LENGTH:
        return []
    target = _normalise(name)
    similarity = {
        candidate: SequenceMatcher(None, _normalise(candidate), target).ratio() for candidate in allowed
    }
    similar = (candidate for candidate in similarity if similarity[candidate] >= min_similarity)
    return sorted(similar, key=lambda candidate: (similarity[candidate], candidate), reverse=True)


def _normalise(name: str) -> str:
    return re.sub("[-_ ]", "", name.casefold())
