"""The text of a program, and what is said of it."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.logs.options import LogMap


@dataclass(frozen=True)
class Program:
    """The text of a program.

    Attributes:
        path: Its file.
        text: All of it, comments as spaces.
        language: What it is written in, as its users call it.
        options: What the user says about the log.
    """

    path: Path
    text: str
    language: str
    options: LogMap

    def statements(self) -> Iterator[tuple[int, str]]:
        """Yield each statement that a semicolon ends, or the file, with the offset where it begins."""
        start = 0
        for statement in self.text.split(";"):
            lead = len(statement) - len(statement.lstrip())
            yield start + lead, statement[lead:]
            start += len(statement) + 1

    def line(self, offset: int) -> int:
        """Return the line of the file, from 1, that an offset of its text is in."""
        return bisect_left(self._ends, offset) + 1

    @cached_property
    def _ends(self) -> list[int]:
        return [match.start() for match in re.finditer("\n", self.text)]

    def error(self, found: str, allowed: str, offset: int | None = None, *hints: Hint) -> LogError:
        """Return an error about the whole, or a place in it."""
        line = None if offset is None else self.line(offset)
        return LogError(Finding(file=str(self.path), line=line, found=found, allowed=allowed, hints=hints))


def blanked(text: str, comments: re.Pattern[str]) -> str:
    """Return a text whose comments are spaces: what remains stands where it stood."""
    return comments.sub(lambda comment: re.sub(r"[^\n]", " ", comment[0]), text)


def shortened(text: str, length: int = 40) -> str:
    """Return the beginning of a text in one line, for messages."""
    line = " ".join(text.split())
    return line if len(line) <= length else f"{line[: length - 3]}..."
