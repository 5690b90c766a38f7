"""What messages say to whom: the command line's options, or the keywords of the public functions.

The code below the public functions names options as the command line has them, in one way everywhere. Whoever
calls a public function from Python reads its keywords instead: the one table here says how each is spelled.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, is_dataclass, replace
from functools import cache, partial
from typing import Any, Literal, TypeVar

from urmpipe_models.errors import UrmpipeError

Shape = Literal["plain", "text", "number", "list", "units", "interval", "flag"]

Held = TypeVar("Held")


@dataclass(frozen=True, slots=True)
class Spelling:
    """How an option is written in Python.

    Attributes:
        keyword: The keyword of the public functions, or the field of `ReadOptions`.
        value: Pattern of what may follow the option as its value; empty for none.
        shape: plain for a keyword; else a field of `ReadOptions`, and what it holds.
    """

    keyword: str
    value: str = ""
    shape: Shape = "plain"

    @property
    def in_read(self) -> bool:
        """True of a field of `ReadOptions`."""
        return self.shape != "plain"


_SHOWN = r"[A-Z][A-Z|]*(?:\.[a-z]+)?"
"""What stands for a value, such as SECONDS, NAME|FILE, FILE.csv."""

_FRAME = r"-?[0-9][0-9.e+-]*(?:,-?[0-9][0-9.e+-]*)*"
"""A frame as X,Y,Z and the like."""

SPELLINGS = {
    "--align": Spelling("align", "none|start|rigid|tool"),
    "--all": Spelling("every"),
    "--audit": Spelling("audit", _SHOWN),
    "--base": Spelling("base", _FRAME),
    "--base-link": Spelling("base_link", _SHOWN),
    "--baseline": Spelling("baseline", _SHOWN),
    "--decimal": Spelling("decimal", rf"{_SHOWN}|point|comma", "text"),
    "--delimiter": Spelling("delimiter", rf"{_SHOWN}|comma|semicolon|tab|spaces|bar", "text"),
    "--derivative": Spelling("derivative", "central|savgol"),
    "--duration": Spelling("duration", _SHOWN),
    "--figures": Spelling("figures"),
    "--format": Spelling("formats"),
    "--interval": Spelling("interval", r"[^';,()=]*=LOW:HIGH|LOW:HIGH", "interval"),
    "--joints": Spelling("joints", r"A,B,C|[0-9]+,[0-9,]+,\.\.\.|[^\s;()]+,[^\s;()]+", "list"),
    "--map": Spelling("read", _SHOWN),
    "--method": Spelling("method", "auto|closed|iterative"),
    "--noise": Spelling("noise"),
    "--output": Spelling("output", _SHOWN),
    "--period": Spelling("period", _SHOWN, "number"),
    "--repair": Spelling("repair", "", "flag"),
    "--restarts": Spelling("restarts"),
    "--robot": Spelling("robot", _SHOWN),
    "--rotation": Spelling("rotation", r"FORM|[a-z][a-z_|]+(?=[ ;,|]|$)", "text"),
    "--rows": Spelling("rows", "grid|file"),
    "--seed": Spelling("seed"),
    "--skip-bad": Spelling("skip_bad", "", "flag"),
    "--source": Spelling("source", "NAME|path", "text"),
    "--start": Spelling("start"),
    "--strict": Spelling("strict"),
    "--sync": Spelling("sync", "start|auto|SECONDS"),
    "--tcp": Spelling("tcp", "fk|recorded"),
    "--time": Spelling("time", "none|COLUMN|[0-9]+", "text"),
    "--tip": Spelling("tip_link", _SHOWN),
    "--to": Spelling("to", r"csv\|parquet\|mat\|tum|csv|parquet|mat|tum"),
    "--tolerance": Spelling("tolerance", r"[a-z]+=[0-9.e+-]+[a-z]+"),
    "--tool": Spelling("tool", _FRAME),
    "--tsp": Spelling("tsp", rf"{_SHOWN}|[0-9][0-9.e-]*"),
    "--unit": Spelling("units", r"[^';,()=]*=[A-Za-z]\w*|(?:rad|deg|mm|m|s|ms|us|ns)(?![\w:])", "units"),
    "--within-pi": Spelling("within_pi"),
    "--write-map": Spelling("write_map", _SHOWN),
    "-o": Spelling("output", _SHOWN),
}
"""Every option that a message names (a test reads the sources)."""

_FOREIGN = re.compile(
    r"\b(?:ros2|rosbag|libreoffice|rerun|xacro|apt-get|pip|urmpipe simulate --write-system) [^;)]*"
)
"""A command line that no public function stands for: its options stay."""

_KEPT = re.compile(rf"(?P<option>--?[a-z-]+ '[^']*')|{_FOREIGN.pattern}|(?<!\w)'[^']*'(?!\w)")
"""What stays as it is: that, and what is quoted (names of files and columns) and no value of an option."""

_TOGETHER = re.compile(r"read=ReadOptions\(([^()]*)\) (?:with|and) read=ReadOptions\(([^()]*)\)")
_CALLED = re.compile(r"\b(?:urmpipe )?(ingest|compare|ik|export) (\w+=[^\s,;)]+)")


def by_command_line() -> bool:
    """Return whether a command of ours is what runs."""
    click, main = sys.modules.get("click"), sys.modules.get("urmpipe.main")
    context = click.get_current_context(silent=True) if click else None
    return bool(context and main and context.find_root().command is main.cli)


def keywords(message: str) -> str:
    """Return a message with the keywords of the public functions instead of the command line's options."""
    if "-" not in message:
        return message
    parts, end = [], 0
    for kept in _KEPT.finditer(message):
        if kept["option"] is None:
            parts += [_spelled(message[end : kept.start()]), kept[0]]
            end = kept.end()
    text = "".join([*parts, _spelled(message[end:])])
    text = text.replace("tip_link, tip_link", "tip_link")  # both are named where no command line is known
    if text == message:
        return message
    return _CALLED.sub(r"\1(\2)", _TOGETHER.sub(r"read=ReadOptions(\1, \2)", text))


def _spelled(text: str) -> str:
    """Return a text with each option of the table as Python writes it."""
    for option in sorted(SPELLINGS, key=len, reverse=True):
        if option in text:
            text = _pattern(option).sub(partial(_in_python, SPELLINGS[option]), text)
    return text


@cache
def _pattern(option: str) -> re.Pattern[str]:
    """Return what finds an option, its value, and whether it is the subject of the message."""
    value = SPELLINGS[option].value
    behind = rf"(?: '?(?P<value>{value})'?)?" if value else "(?P<value>)"  # quoted as for a shell
    return re.compile(rf"(?<![\w-]){option}(?![\w-])(?P<subject>(?=:| [^:;,=]{{1,80}}: ))?{behind}")


def _in_python(one: Spelling, found: re.Match[str]) -> str:
    """Return an option that was found as Python writes it."""
    value = found["value"]
    if not one.in_read:
        return f"{one.keyword}={_quoted(value)}" if value else one.keyword
    if found["subject"] is not None and not value and one.shape != "flag":
        return f"ReadOptions.{one.keyword}"
    return f"read=ReadOptions({one.keyword}={_written(one.shape, value)})"


def _written(shape: Shape, value: str | None) -> str:
    """Return a value of a field of `ReadOptions` as Python writes it."""
    if shape == "flag":
        return "True"
    key, _, own = (value or "...").rpartition("=")
    if value and shape == "units":
        return f'{{"{key}": "{own}"}}'
    if value and shape == "interval":
        return f'{{"{key}": (LOW, HIGH)}}'
    if value and shape == "list":
        cells = (part if part == "..." else f'"{part}"' for part in value.split(","))
        return f"[{', '.join(cells)}]"
    return f'"{own}"' if shape == "text" and not own.isupper() and value else own


def _quoted(value: str) -> str:
    """Return the value of a keyword as Python writes it: words quoted, a frame as a tuple."""
    if value[0].islower():
        return f'"{value}"'
    return f"({value.replace(',', ', ')})" if "," in value else value


def error_in_keywords(error: UrmpipeError) -> UrmpipeError:
    """Return an error whose findings name keywords."""
    told = type(error)(*(replace(one, message=keywords(one.message)) for one in error.findings))
    return told.with_traceback(error.__traceback__)


def result_in_keywords(result: Held) -> Held:
    """Return a result whose warnings, and those of what it was made of, name keywords."""
    if isinstance(result, tuple):
        changed: Any = tuple(result_in_keywords(one) for one in result)
        return result if all(map(_same, changed, result)) else changed
    if not is_dataclass(result) or isinstance(result, type):
        return result
    if type(result).__name__ == "LogWarning":
        message = keywords(result.message)  # type: ignore[attr-defined]
        return result if message == result.message else replace(result, message=message)  # type: ignore[attr-defined]
    held = {name: getattr(result, name, None) for name in ("warnings", "log", "run", "runs", "results")}
    spelled = {name: result_in_keywords(one) for name, one in held.items()}
    new = {name: one for name, one in spelled.items() if one is not held[name]}
    return replace(result, **new) if new else result


def _same(one: object, other: object) -> bool:
    """Return whether two are one object."""
    return one is other
