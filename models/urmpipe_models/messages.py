"""Messages as data: what is wrong or worth knowing, apart from it what the reader may give, and three voices.

A message keeps its sentence, written where the fault is seen. What that is about, and the parameters that
would change it, are fields. Who prints chooses the voice, so that a stored message reads right for everybody:

    warning = Finding("no unit is given", hints=(Hint("unit", {"q1": "deg"}, "applies this"),))
    warning.words("command line")   no unit is given; --unit q1=deg applies this
    warning.words("python")         no unit is given; unit={"q1": "deg"} applies this
    warning.words("system file")    no unit is given; units.q1 = "deg" in the map of the log applies this
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from typing import Any

from urmpipe_models.spelling import IN_MAP, IN_NO_FILE, Voice, spelled, subject

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

    def spelled(self, voice: Voice) -> str:
        """Return the parameter with its value: `--unit q1=deg`, `unit={"q1": "deg"}`."""
        if not self.parameter:
            return ""
        if self.robot:
            joined = " " if voice == "command line" else ", "
            return joined.join((spelled("robot", self.robot, voice), replace(self, robot="").spelled(voice)))
        if not self.call:
            return spelled(self.parameter, self.value, voice)
        if voice == "python":
            return f"{self.call}({spelled(self.parameter, self.value, voice)})"
        return f"urmpipe {self.call} {spelled(self.parameter, self.value, 'command line')}"


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
        return self.words("python")

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
            said = f"{subject(self.parameter, voice)}: {said}"
        return one_line("; ".join([said, *hint_words(self.hints, voice)]))

    def words(self, voice: Voice) -> str:
        """Return all of it in one line, as somebody reads it."""
        place = one_line(self.place())
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


def hint_words(hints: Sequence[Hint], voice: Voice) -> Iterator[str]:
    """Yield what the reader may give, what does the same in one: "--repair or --skip-bad leaves them out".

    Args:
        hints: The hints; of those that belong to no file none is told to who writes a system file.
        voice: Who reads it.
    """
    for does, alike in groupby(hints, key=lambda hint: hint.does):
        own = [
            hint for hint in alike if hint.call or voice != "system file" or hint.parameter not in IN_NO_FILE
        ]
        told = " or ".join(filter(None, (hint.spelled(voice) for hint in own)))
        if voice == "system file" and any(hint.parameter in IN_MAP and not hint.call for hint in own):
            told += " in the map of the log"
        if own:
            yield f"{told} {does}".strip() if does else f"use {told}"


def one_line(text: str) -> str:
    """Return a text with all that is not printable as the escapes of Python's strings.

    Names come from files, and may hold what breaks a line or what a terminal acts on instead of showing it.
    """
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else _escape(one) for one in text)


def inert(text: str, kept: str = "") -> str:
    """Return a text with escapes of Python's strings for what ends a line, acts on a terminal or reorders.

    Unlike `one_line` it leaves letters that are merely unusual, such as a space that does not break.

    Args:
        text: The text.
        kept: Letters to leave: those that end a line where lines are meant.
    """
    return _ACTING.sub(lambda found: found[0] if found[0] in kept else _escape(found[0]), text)


def shown_json(written: str) -> str:
    """Return JSON, or a string of TOML, with escapes for what is not seen: it reads back the same."""
    return _HIDDEN.sub(lambda found: f"\\u{ord(found[0]):04x}", written)


def in_html(words: str) -> str:
    """Return words as text of HTML or SVG, on one line and without what is not printable."""
    return html.escape(one_line(words))


def in_xml(written: str) -> str:
    """Return escaped text of XML with references for what is not seen.

    For what XML cannot hold, most control characters and lone surrogates, stand escapes of Python's strings.
    """
    held = _HIDDEN.sub(lambda found: f"&#x{ord(found[0]):x};", written)
    return _UNHOLDABLE.sub(lambda found: ascii(found[0])[1:-1], held)


def _escape(letter: str) -> str:
    return letter.encode("unicode_escape").decode()
