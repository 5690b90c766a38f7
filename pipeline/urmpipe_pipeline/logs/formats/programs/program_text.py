"""Which text is a program, and what it holds: a table in memory in its place."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.programs import krl, rapid, structured_text
from urmpipe_pipeline.logs.formats.programs.program import Program, blanked
from urmpipe_pipeline.logs.formats.text import Segment
from urmpipe_pipeline.logs.log_map import LogMap


@dataclass(frozen=True, slots=True)
class _Language:
    """A language of programs.

    Attributes:
        name: What its users call it.
        known: A line of its head gives it away.
        comments: Its comments.
        read: Returns what a program of it holds; None if it is not read.
        block: The words that begin and end a block of declarations: one that does not end was cut.
    """

    name: str
    known: re.Pattern[str]
    comments: re.Pattern[str] = re.compile(r"(?!)")
    read: Callable[[Program], MemoryTable] | None = None
    block: tuple[str, str] = ("", "")


def _line(*patterns: str) -> re.Pattern[str]:
    """Return a pattern of a line that begins as one of some do."""
    return re.compile(rf"^[ \t]*(?:{'|'.join(patterns)})", re.IGNORECASE | re.MULTILINE)


_LANGUAGES = (
    _Language("a Fanuc program (/PROG)", re.compile(r"\A\s*/PROG\b")),
    _Language("a Yaskawa job (/JOB)", re.compile(r"\A\s*/JOB\b")),
    _Language("a program in URScript", _line(r"(?:movej|movel|movep|servoj)\s*\(")),
    _Language(
        "a RAPID program",
        _line(
            r"MODULE\s+\w+\s*(?:\([\w,\s]*\))?\s*$(?=[\s\S]{0,2000}?\b(?:ENDMODULE|PROC\s|(?:CONST|PERS|VAR)\s+\w+\s+\w))",
            r"(?:(?:LOCAL|TASK)\s+)?(?:CONST|PERS|VAR)\s+(?:joint|rob)target\s",
            r"Move(?:AbsJ|J|L|C)\s+\\?\w*\s*\[",
        ),
        re.compile(r"![^\n]*"),
        rapid.read,
        ("MODULE", "ENDMODULE"),
    ),
    _Language(
        "a KRL program",
        _line(
            r"&ACCESS\b",
            r"(?:GLOBAL\s+)?(?:DEFDAT\s+\w+|DEF\s+\w+\s*\([^)\n]*\)\s*$)",
            r"(?:GLOBAL\s+)?DECL\s+(?:GLOBAL\s+)?(?:E6AXIS|AXIS|E6POS|POS|FRAME)\s",
            r"(?:E6AXIS|AXIS|E6POS|POS|FRAME)\s+\w+(?:\[\d*\])?\s*=\s*\{",
            r"S?(?:PTP|LIN|CIRC)\s+\{",
        ),
        re.compile(r";[^\n]*"),
        krl.read,
        ("DEFDAT", "ENDDAT"),
    ),
    _Language(
        "a program in structured text",
        _line(
            r"VAR(?:_[A-Z_]+)?(?:\s++(?:CONSTANT|RETAIN|PERSISTENT))*+\s++"
            r"(?>(?:\(\*(?:[^*\n]|\*(?!\)))*\*\)\s*|(?:\(\*|//).*\n\s*)*)\w[\w, ]*:(?!=)",
            r"\w+(?:\s+AT\s*%\S+)?\s*:\s*(?:ARRAY\s*\[.*\bOF\b|(?:L?REAL|U?[SDL]?INT|L?TIME)\s*:=)",
        ),
        re.compile(r"\(\*.*?(?:\*\)|\Z)|//[^\n]*", re.DOTALL),
        structured_text.read,
        (r"VAR(?:_[A-Z_]+)?", "END_VAR"),
    ),
)


def read_program(segment: Segment, options: LogMap) -> MemoryTable | None:
    """Return the table that the text of a program holds; None of any other text, by its head.

    Raises:
        LogError: If it holds no position and no array of numbers, or several tables; or is in a language
            that is not read.
    """
    if not re.search(r":=|\{|^\s*/|\(", segment.head):  # no table has all that a program is made of
        return None
    language = next((one for one in _LANGUAGES if one.known.search(segment.head)), None)
    if language is None:
        return None
    if language.read is None:
        advice = Hint(
            "", effect="write its positions as a table, such as J1 [deg],J2 [deg],... one row per position"
        )
        found = f"found {language.name}, allowed: a text table"
        raise LogError(Finding(found, str(segment.path), hints=(advice,)))
    program = Program(segment.path, blanked(segment.text(), language.comments), language.name, options)
    start, end = (list(_line(rf"{word}\b").finditer(program.text)) for word in language.block)
    if len(start) > len(end):
        raise program.error(
            f"{start[-1][0].strip()} without {language.block[1]}", "a program as a whole", start[-1].start()
        )
    return language.read(program)
