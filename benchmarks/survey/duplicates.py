"""Pairs of places that share six lines and more, to the letter or but for the names of variables.

Blank lines, comments, docstrings, imports, signatures and lone brackets do not count, nor does white space.
pylint's checker of similar lines finds those that are the same to the letter, but takes four times as long as
all that is measured here; it finds none whose variables are named otherwise.
"""

from __future__ import annotations

import ast
import builtins
import keyword
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

from survey.source import Function, Source

LEAST = 6
"""Lines that make a pair."""

COMMON = 12
"""A run that stands in more places than this is the form of a thing, such as a decorator's: no pairs."""

_NAME = r"(?<![\w.])[a-z_]\w*+(?![(=]|: )"
"""What may be a variable's name: no attribute, class, called function, keyword argument or field."""

_KEPT = frozenset([*keyword.kwlist, *dir(builtins), "self", "cls"])
_VARIABLE = re.compile(_NAME)
_TOKEN = re.compile(rf"\"[^\"]*\"|'[^']*'|(?P<variable>{_NAME})|\w+|\n|[^\s\w]")


@dataclass(frozen=True, slots=True)
class Place:
    """Where a run of lines stands: the definition around its first line, and its lines from 1."""

    path: str
    name: str
    first: int
    last: int

    @property
    def key(self) -> str:
        """What a reason is kept under: file:function."""
        return f"{self.path}:{self.name}"

    def __str__(self) -> str:
        """Return where an editor finds it."""
        return f"{self.path}:{self.first}-{self.last}"


@dataclass(frozen=True, slots=True)
class Duplicate:
    """Two places that share a run of lines."""

    left: Place
    right: Place
    lines: int
    exact: bool
    """Whether to the letter; else variables are named otherwise."""

    @property
    def key(self) -> str:
        """What a reason is kept under."""
        return f"{self.left.key} ~ {self.right.key}"

    def __str__(self) -> str:
        """Return one line."""
        alike = "the same" if self.exact else "the same but for names of variables"
        return (
            f"{self.left} ~ {self.right} ({self.left.name} ~ {self.right.name}): {self.lines} lines {alike}"
        )


class _Line(NamedTuple):
    """A line that counts.

    Attributes:
        number: In its file, from 1.
        text: Without the space around it.
        shape: The text with all that may be a variable's name as one and the same, words in texts too.
    """

    number: int
    text: str
    shape: str


def duplicates(sources: Sequence[Source]) -> list[Duplicate]:
    """Return the pairs of places that share `LEAST` lines and more, each as long as it goes, by place."""
    counted = [_lines(source) for source in sources]
    windows: dict[tuple[str, ...], list[tuple[int, int]]] = defaultdict(list)
    for index, lines in enumerate(counted):
        shapes = [line.shape for line in lines]
        for start in range(len(lines) - LEAST + 1):
            windows[tuple(shapes[start : start + LEAST])].append((index, start))
    alike = set(_alike(counted, windows))
    found = []
    for left, start, right, other in sorted(alike):
        if (left, start - 1, right, other - 1) in alike:
            continue
        length = LEAST
        while (left, start + length - LEAST + 1, right, other + length - LEAST + 1) in alike:
            length += 1
        runs = counted[left][start : start + length], counted[right][other : other + length]
        exact = [line.text for line in runs[0]] == [line.text for line in runs[1]]
        places = _place(sources[left], runs[0]), _place(sources[right], runs[1])
        found.append(Duplicate(*places, length, exact))
    return found


def _alike(
    counted: Sequence[Sequence[_Line]], windows: dict[tuple[str, ...], list[tuple[int, int]]]
) -> Iterator[tuple[int, int, int, int]]:
    """Yield the pairs of windows that are the same but for a renaming, and do not overlap."""
    for places in windows.values():
        if len(places) < 2:
            continue
        groups: dict[tuple[str, ...], list[tuple[int, int]]] = defaultdict(list)
        for index, start in places:
            groups[_renamed(counted[index][start : start + LEAST])].append((index, start))
        for group in groups.values():
            if len(group) > COMMON:
                continue
            for (left, start), (right, other) in combinations(group, 2):
                if left != right or other - start >= LEAST:
                    yield left, start, right, other


def _renamed(lines: Sequence[_Line]) -> tuple[str, ...]:
    """Return the tokens of some lines with each variable as the number of its first mention."""
    numbers: dict[str, str] = {}
    found = []
    for match in _TOKEN.finditer("\n".join(line.text for line in lines)):
        token = match.group()
        variable = match.lastgroup == "variable" and token not in _KEPT
        found.append(numbers.setdefault(token, f"\0{len(numbers)}") if variable else token)
    return tuple(found)


def _lines(source: Source) -> list[_Line]:
    """Return the lines of a file that count."""
    left_out = _left_out(source)
    found = []
    for number, text in enumerate(source.lines, start=1):
        line = text.strip()
        if number not in left_out and not line.startswith("#") and re.search(r"\w", line):
            found.append(_Line(number, line, _VARIABLE.sub("\0", line)))
    return found


def _left_out(source: Source) -> set[int]:
    """Return the numbers of the lines of imports, signatures and docstrings."""
    found: set[int] = set()
    for node in source.statements:
        if isinstance(node, ast.Import | ast.ImportFrom):
            found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        elif isinstance(node, Function | ast.ClassDef):
            found.update(range(node.lineno, max(node.body[0].lineno, node.lineno + 1)))
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return found


def _place(source: Source, run: Sequence[_Line]) -> Place:
    first, last = run[0].number, run[-1].number
    around = [
        made.name
        for made in source.definitions
        if made.node.lineno <= first <= (made.node.end_lineno or made.node.lineno)
    ]
    return Place(source.path, around[-1] if around else "<module>", first, last)
