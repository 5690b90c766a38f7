"""Where a docstring speaks of each array: its entry, a text below the field, or a sentence of all.

A docstring is prose, then sections: `Args` and `Attributes` have an entry a name, `Returns` and `Yields` tell
of the result. A sentence of the prose tells of an array if it names it, or of all in words such as `all of
shape` or `both in [m]`. The first sentence tells of the result where it returns or yields, and all prose does
where nothing is taken. What is told `likewise` is told as in the entry before.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from survey.source import Function

RESULT = "the result"
"""The name of what a function gives."""

_SECTION = re.compile(r"^(Args|Attributes|Returns|Yields|Raises|Sources?|Notes?|Examples?):(?: |$)")
_ENTRY = re.compile(r"^    \*{0,2}(\w+(?:, \w+)*): ")
_ALL = re.compile(
    r"\b(?:all|both|each|every)(?: arrays?| columns?| rows?)? (?:of (?:the )?(?:same )?shape|in \[|shaped)",
    re.IGNORECASE,
)
_LIKEWISE = re.compile(r"\blikewise\b", re.IGNORECASE)
_SENTENCE = re.compile(r"(?<=[.;:]) (?=[A-Z`])")


@dataclass(slots=True)
class Stated:
    """What a docstring says, by what it says it of.

    Attributes:
        prose: Its sentences before the first section.
        entries: The text of each entry.
        result: What its sections say of the result.
    """

    prose: list[str] = field(default_factory=list)
    entries: dict[str, str] = field(default_factory=dict)
    result: str = ""

    def of(self, name: str) -> str:
        """Return all that is said of an array: of an argument, of a field or of the result."""
        own = self.result if name == RESULT else self.entries.get(name, "")
        return " ".join([own, *(one for one in self.prose if _tells(one, name))])


def stated(node: Function | ast.ClassDef) -> Stated:
    """Return what the docstring of a definition says; of a class with what stands below its fields."""
    found = Stated()
    sections = dict(_sections(ast.get_docstring(node) or ""))
    prose = " ".join(sections.pop("", "").split())
    found.prose = _SENTENCE.split(prose)
    found.result = " ".join((sections.get("Returns", "") + sections.get("Yields", "")).split())
    if isinstance(node, ast.ClassDef):
        found.entries.update(_below_fields(node))
    elif not _takes(node):
        found.result += " " + prose
    elif re.search(r"\b(?:return|yield)", found.prose[0], re.IGNORECASE):
        found.result += " " + found.prose[0]
    for section in ("Args", "Attributes"):
        found.entries.update(_entries(sections.get(section, "")))
    return found


def _tells(sentence: str, name: str) -> bool:
    """Return whether a sentence tells of an array of a name."""
    return bool(_ALL.search(sentence) or re.search(rf"(?<![\w.]){re.escape(name)}(?!\w)", sentence))


def _takes(node: Function) -> bool:
    """Return whether a function takes anything besides the object it belongs to."""
    every = [one.arg for one in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    return bool([name for name in every if name not in ("self", "cls")])


def _sections(docstring: str) -> Iterator[tuple[str, str]]:
    """Yield the prose under no name, and the text of each section."""
    name, lines = "", list[str]()
    for line in docstring.splitlines():
        begun = _SECTION.match(line)
        if begun:
            yield name, "\n".join(lines)
            name, lines = begun[1], []
        else:
            lines.append(line)
    yield name, "\n".join(lines)


def _entries(section: str) -> Iterator[tuple[str, str]]:
    """Yield the text of each entry of a section; of one that is told likewise with that before."""
    names, text, before = list[str](), "", ""
    for line in [*section.splitlines(), "    end: "]:
        begun = _ENTRY.match(line)
        if begun is None:
            text += " " + line.strip()
            continue
        if _LIKEWISE.search(text):
            text += " " + before
        yield from ((name, text) for name in names)
        names, before, text = begun[1].split(", "), text, line[begun.end() :]


def _below_fields(node: ast.ClassDef) -> Mapping[str, str]:
    """Return the texts that stand right below fields."""
    pairs = zip(node.body, node.body[1:], strict=False)
    return {
        ast.unparse(first.target): " ".join(second.value.value.split())
        for first, second in pairs
        if isinstance(first, ast.AnnAssign)
        and isinstance(second, ast.Expr)
        and isinstance(second.value, ast.Constant)
        and isinstance(second.value.value, str)
    }
