"""Two sides in one table, what was asked for and what was done: told apart by words in names of columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.sources.columns.columns import Column

REST = "rest"
"""The side of all columns without the other side's word."""

SHARED = 8
"""Words that a message names, those of most columns."""


def of_side(columns: Sequence[Column], side: tuple[str, str] | None, file: str) -> list[Column]:
    """Return the columns of one side of a table; all of them without sides.

    Args:
        columns: The columns, without the clock.
        side: A word in the names of the columns of this side, or `REST`, and that of the other side. A column
            with both words is of no side.
        file: The file, for errors.

    Raises:
        LogError: If no column has the word, and not that of the other side, in its name.
    """
    if side is None:
        return list(columns)
    word, other = (one.lower() for one in side)
    own = [one for one in columns if other not in one.words and (word == REST or word in one.words)]
    if not own:
        count = Counter(one for column in columns for one in column.words if one.isalpha())
        shared = [name for name, columns_with in count.most_common(SHARED) if columns_with > 1]
        allowed = (
            f"words in the names of columns, such as {', '.join(shared)}"
            if shared
            else "a table with names of columns"
        )
        with_word = "" if word == REST else f"with the word {word} and "
        found = f"found no column {with_word}without {other} in its name"
        raise LogError(Finding(f"{found}, allowed: {allowed}", file, parameter="sides"))
    return own
