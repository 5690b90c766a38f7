"""The `repr` of results: one line at a prompt; headline, warnings and head of the table in a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from urmpipe_models.errors import escape_html, escape_line

MAX_LINE_LENGTH = 120  # characters of the line: fits into a terminal, and into a list of results
HEAD_ROWS = 8  # rows of the table in a notebook


class Displayable(ABC):
    """A result with a headline, a table, and notes for the user."""

    __slots__ = ()

    @abstractmethod
    def _headline(self) -> str:
        """Return its name and content in one line."""

    def _notes(self) -> Sequence[str]:
        """Return what the user should know, one line each."""
        return [str(warning) for warning in getattr(self, "warnings", ())]

    def _table(self) -> str:
        """Return the head of its table in HTML."""
        frame: Any = self.to_frame()  # type: ignore[attr-defined]
        more = f"<p>{HEAD_ROWS} of {len(frame)} rows of to_frame()</p>" if len(frame) > HEAD_ROWS else ""
        return f"{frame.head(HEAD_ROWS).to_html(index=False)}{more}"

    def __repr__(self) -> str:
        notes = len(self._notes())
        ending = f", {format_count(notes, 'warning')}>" if notes else ">"
        line = escape_line(f"<{type(self).__name__} {self._headline()}")
        room = MAX_LINE_LENGTH - len(ending)
        return f"{line if len(line) <= room else line[: room - 3] + '...'}{ending}"

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{escape_html(note)}</li>" for note in self._notes())
        headline = f"<p><b>{type(self).__name__}</b> {escape_html(self._headline())}</p>"
        return f"{headline}{notes and f'<ul>{notes}</ul>'}{self._table()}"


def format_count(count: int, noun: str) -> str:
    """Return a number with its noun: 1 row, 2 rows."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def format_headline(name: str, *facts: Any) -> str:
    """Return a name, followed by the facts that are not empty."""
    return f"{name}: {', '.join(str(fact) for fact in facts if fact)}"
