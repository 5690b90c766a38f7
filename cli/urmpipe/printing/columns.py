"""Tables that fit the terminal: columns that find no room go on below, each part with the keys again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from urmpipe.printing.terminal import lines_of
from urmpipe_models.errors import escape_line
from urmpipe_pipeline.text import NOTHING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

KEY_WIDTH = 32
"""Widest that a key is; longer ones are folded."""

GAP = 2
"""Blanks between two columns."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Attributes:
        head: The lines of its head.
        cells: One a row; None where there is nothing.
        key: Whether it names the rows: it stands at the left of every part.
        words: Whether it holds words, which stand to the left and are folded; else numbers.
    """

    head: Sequence[str]
    cells: Sequence[str | Text | None]
    key: bool = False
    words: bool = False

    @property
    def width(self) -> int:
        """Places that the widest line takes."""
        from rich.cells import cell_len

        lines = [*self.head, *(str(cell or NOTHING) for cell in self.cells)]
        width = max(cell_len(escape_line(line)) for line in lines)
        return min(width, KEY_WIDTH) if self.key or self.words else width


def print_columns(console: Console, title: str, columns: Sequence[Column]) -> None:
    """Print columns as one table, or as several below each other where the terminal is too narrow.

    Args:
        console: Where to print.
        title: What stands above.
        columns: Those that name the rows, and the others from the left.
    """
    console.print()
    console.print(title, style="italic", soft_wrap=True)
    for part in _parts(columns, console.width):
        console.print(_table(part))


def _parts(columns: Sequence[Column], width: int) -> Iterator[list[Column]]:
    """Yield as many columns at a time as fit, at least one, behind the keys."""
    keys = [column for column in columns if column.key]
    part = list(keys)
    for column in columns:
        if column.key:
            continue
        if len(part) > len(keys) and sum(one.width + GAP for one in [*part, column]) > width:
            yield part
            part = list(keys)
        part.append(column)
    yield part


def _table(columns: Sequence[Column]) -> Table:
    """Return a table of columns: words to the left, figures to the right."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, GAP - 1, 0, 0))
    for column in columns:
        # Blanks between columns: one of the box, the others of the padding.
        table.add_column(
            lines_of(column.head),
            justify="left" if column.key or column.words else "right",
            width=column.width,
            no_wrap=not (column.key or column.words),
            overflow="fold",
        )
    for row in zip(*(column.cells for column in columns), strict=True):
        table.add_row(*(NOTHING if cell is None else cell for cell in row))
    return table
