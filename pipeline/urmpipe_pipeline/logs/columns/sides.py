"""Part of a table by names of columns: a side (commanded, measured, one of several arms) or a topic."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from urmpipe_models.errors import Finding, LogError, OptionError, format_value
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.vocabulary import split_unit, vocabulary

REST = "rest"  # all columns without the other side's word

MAX_LISTED = 8  # words in a message, those of most columns


def columns_of_side(columns: Sequence[Column], options: LogMap, file: str) -> list[Column]:
    """Return the columns of the side that the user chose; all columns without one.

    Args:
        columns: The columns, without the clock.
        options: What the user says: `side`, and in a comparison of two sides `pair`.
        file: The file, for errors.

    Raises:
        LogError: If no column has the words of the side.
    """
    chosen = list(columns)
    if options.side is not None:
        chosen = select_side(columns, options.side)
        if not chosen and not options.shared:
            raise _no_column(columns, f"with {_quoted(options.side)}", "side", file)
    if options.pair is not None:
        side, other = map(_words, options.pair)
        every = side == {REST}
        chosen = [
            column for column in chosen if not other <= column.words and (every or side <= column.words)
        ]
        if not chosen:
            own = "" if every else f"with {_quoted(options.pair[0])} and "
            raise _no_column(columns, f"{own}without {options.pair[1]}", "sides", file)
        if not every:
            chosen = [_without_words(column, side) for column in chosen]
    return chosen or list(columns)


def without_other_side(columns: Sequence[Column], options: LogMap) -> tuple[Column, ...]:
    """Return the columns without those of another side, unless no time is left."""
    other = _words(options.pair[1]) if options.pair else frozenset((REST,))
    own = {column.number for column in select_side(columns, options.side or "")}
    kept = tuple(
        column
        for column in columns
        if column.number in own and (other == {REST} or not other <= column.words)
    )
    return kept if any(column.is_time for column in kept) else tuple(columns)


def select_side(columns: Sequence[Column], side: str) -> list[Column]:
    """Return the columns with all words of a side, and those without a word of another side; else none.

    A column whose name differs from that of a column of the side only by these words is another side's.
    """
    if not (words := _words(side)):
        return list(columns)
    own = {
        column: replace(_without_words(column, words), side=words)
        for column in columns
        if words <= column.words
    }
    quantities = {(column.quantity, column.unit_text) for column in own.values()}
    names = [column.marked.key.split("_") for column in own]
    places = {tuple(k for k, word in enumerate(name) if word in words) for name in names} - {()}
    forms = {_masked(name, place) for name in names for place in places}

    def is_shared(column: Column) -> bool:
        name = column.marked.key.split("_")
        return bool(own) and not (
            column.words_of_side - words
            or (column.quantity, column.unit_text) in quantities
            or any(_masked(name, place) in forms for place in places)
        )

    return [own.get(column, column) for column in columns if column in own or is_shared(column)]


def side_of(group: Sequence[Column], groups: Sequence[Sequence[Column]]) -> str | None:
    """Return the fewest words that select one of several groups of columns, behind those that the user chose.

    None if there are no such words.
    """
    first, *rest = (list(dict.fromkeys(re.split(r"[\W_]+", column.marked.key))) for column in group)
    common = [word for word in first if word in group[0].words and all(word in other for other in rest)]
    common = [word for word in common if not word.isdigit() and vocabulary().unit(word) is None]
    everything = [column for some in groups for column in some]
    for count in (1, 2, 3):
        for words in combinations(common, count):
            numbers = [column.number for column in select_side(everything, "_".join(words))]
            if numbers == [column.number for column in everything if column in group]:
                return "_".join((*sorted(group[0].side), *words))
    return None


def _masked(name: Sequence[str], places: Sequence[int]) -> tuple[str, ...]:
    """Return the words of a name with those at some places left blank."""
    return tuple("" if k in places else word for k, word in enumerate(name))


def _words(side: str) -> frozenset[str]:
    return frozenset(re.findall(r"[^\W_]+", side.lower()))


def _quoted(side: str) -> str:
    return f"the word {side}" if len(_words(side)) == 1 else f"the words {', '.join(sorted(_words(side)))}"


def _without_words(column: Column, words: frozenset[str]) -> Column:
    """Return a column that is matched without some words of its name, of which some remain."""
    words = words - vocabulary().stems
    label = column.matched or split_unit(column.header)[0]
    parts = re.findall(r"[^\W_]+|[\W_]+", label)
    matched = "".join(part for part in parts if part.lower() not in words).strip(" _-./")
    return replace(column, matched=matched) if re.search(r"[^\W_]", matched) else column


def _no_column(columns: Sequence[Column], wanted: str, parameter: str, file: str) -> LogError:
    count = Counter(word for column in columns for word in column.words if word.isalpha())
    shared = [word for word, columns_with in count.most_common(MAX_LISTED) if columns_with > 1]
    allowed = (
        f"words in the names of columns, such as {', '.join(shared)}"
        if shared
        else "a table with names of columns"
    )
    return LogError(
        Finding(f"found no column {wanted} in its name, allowed: {allowed}", file, parameter=parameter)
    )


def columns_of_topic(columns: Sequence[Column], options: LogMap, file: str) -> list[Column]:
    """Return the columns whose names begin with the topic that the user chose.

    Args:
        columns: All columns of a table.
        options: `topic`, with or without a slash before, and whether it may be that of another log.
        file: The file, for errors.

    Raises:
        OptionError: If no name does: with the first part of each name.
    """
    topic = options.topic or ""
    start = topic.strip("/")
    is_whole = re.compile(rf"/?{re.escape(start)}(?!\w)")
    chosen = [column for column in columns if is_whole.match(column.header)]
    chosen = chosen or [column for column in columns if column.header.lstrip("/").startswith(start)]
    if not chosen and not options.shared:
        parts = (re.match(r"(/?\w+)[/.]", column.header) for column in columns)
        known = ", ".join(dict.fromkeys(part[1] for part in parts if part)) or "the beginning of a name"
        raise OptionError(Finding("", file, parameter="topic", found=format_value(topic), allowed=known))
    return chosen
