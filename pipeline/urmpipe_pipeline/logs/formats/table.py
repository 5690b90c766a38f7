"""The numbers of a table, block by block: parsed, or where a row is not as it should be read row by row.

All numbers of a table, for what its first rows cannot prove: read once, when they are first looked at.

The rows of a table that are read: those of the option `rows`, of an episode, of a topic.

A table of some rows is like any other: clock, joints and units are decided on these rows alone. Errors count
the rows of the file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import (
    TextCells,
    count_numbers,
    is_missing,
    is_number,
    split_line,
    to_float,
)
from urmpipe_pipeline.logs.formats.clock_forms import UNPADDED_NS
from urmpipe_pipeline.logs.formats.memory import read_held, sampled_cells
from urmpipe_pipeline.logs.formats.numbers import ClockColumn, Numbers, arrow_column
from urmpipe_pipeline.logs.formats.padding import end_rows
from urmpipe_pipeline.logs.formats.rows import (
    RowReader,
    Scales,
    byte_encoding,
    clock_scales,
    data_lines,
    end_of_rows,
    parse_block,
    row_blocks,
)
from urmpipe_pipeline.logs.formats.sniff import SAMPLED_LINES, Layout
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import key, split_unit, vocabulary

READ_BY_ROW = 1 << 16
"""Bytes that are read row by row together if there is something wrong in them."""


def read_table(
    layout: Layout,
    columns: Sequence[int],
    clock: Sequence[ClockColumn],
    allowed: Mapping[int, str] | None = None,
) -> Numbers:
    """Return the numbers of some columns, with a finding for each row and cell that holds none.

    Read row by row is also what the parser refuses though it is sound: blanks as missing samples, 1.5d0,
    comments. The values of the clock in [ns] are added; if they are text, their cells are read as they are.
    What a cell may hold is told as in a log, or by its column in other words.
    """
    if layout.held is not None:
        return read_held(layout, columns, clock)
    reader = RowReader(layout, columns, clock, allowed)
    scales = clock_scales(layout, clock)
    parts = [part for block in row_blocks(layout) for part in _parts(reader, block, scales)]
    reader.refuse_cut_row()
    values = [part.values for part in parts] or [np.empty((0, len(columns)))]
    times = [_times(part) for part in parts] or [np.empty(0, dtype=np.int64)]
    numbers = replace(
        reader.verdict(),
        values=np.concatenate(values),
        clock=np.concatenate(times) if clock else None,
        texts=tuple(TextCells.joined(texts) for texts in zip(*(part.texts for part in parts), strict=True)),
        left_out=sum(part.left_out for part in parts),
    )
    if layout.rows is None:
        return numbers
    return numbers.at(layout.rows[layout.rows < len(numbers.values)])  # fewer if another header ends them


def _times(part: Numbers) -> IntArray:
    """Return the times of a part; none yet where they are text, which is read of all parts at once."""
    return np.zeros(len(part.values), dtype=np.int64) if part.clock is None else part.clock


def _parts(reader: RowReader, block: bytes, scales: Scales) -> Iterator[Numbers]:
    """Yield the numbers of some whole rows: of all at once, or of either half."""
    layout = reader.layout
    newline = layout.segment.newline
    numbers = None if reader.ended else parse_block(layout, reader.columns, reader.clock, block, scales)
    if numbers is not None:
        signs = np.frombuffer(block, dtype=np.uint8)
        reader.pass_over(len(numbers.values), int(np.count_nonzero(signs == ord(newline))))
        yield numbers
    elif len(block) > READ_BY_ROW and (end := end_of_rows(block[: len(block) // 2], layout)):
        for half in (block[:end], block[end:]):
            yield from _parts(reader, half, scales)
    else:
        text = block.decode(byte_encoding(layout), errors="surrogateescape")
        yield reader.read(text.removesuffix(newline).split(newline))


class Whole:
    """All rows of a table.

    Args:
        layout: How it is written.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self._last: tuple[object, Numbers] | None = None

    @cached_property
    def columns(self) -> tuple[int, ...]:
        """The columns that hold numbers, by their sampled cells."""
        layout = self.layout

        def holds(column: int) -> bool:
            """Return whether at least half of the cells with content are numbers."""
            cells = [cell for cell in layout.cells(column) if not is_missing(cell)]
            return 2 * count_numbers(cells, layout.decimal) >= len(cells) > 0

        return tuple(column for column in range(len(layout.names)) if holds(column))

    @cached_property
    def numbers(self) -> Numbers:
        """Their numbers in the file's own units, shape (n, columns), with what is wrong with them.

        Rows at the end that hold no sample are left out.
        """
        ends = end_rows(self.read.values)
        return self.read.at(slice(-ends)) if ends else self.read

    @cached_property
    def read(self) -> Numbers:
        """The same with all rows."""
        return read_table(self.layout, self.columns, ())

    def table(self, columns: Sequence[int], clock: Sequence[ClockColumn]) -> Numbers:
        """Return the numbers of some columns with those of the clock, as `read_table` does.

        They are those that were looked at already, if nothing was wrong with them: then the exact text of the
        clock alone is read again. The last answer is kept.
        """
        arguments = tuple(columns), tuple(clock)
        if self._last is None or self._last[0] != arguments:
            self._last = arguments, self._table(columns, clock)
        return self._last[1]

    def _table(self, columns: Sequence[int], clock: Sequence[ClockColumn]) -> Numbers:
        """Return the same, read."""
        known = self.__dict__.get("read")
        if known is None or known.findings or known.left_out or not set(columns) <= set(self.columns):
            return read_table(self.layout, columns, clock)
        times = read_table(self.layout, (), clock) if clock else known
        if times.findings or len(times.values) != len(known.values):
            return read_table(self.layout, columns, clock)
        places = [self.columns.index(column) for column in columns]
        whole = places == list(range(len(self.columns)))
        return replace(times, values=known.values if whole else known.values.take(places, axis=1))

    def values(self, columns: Sequence[int]) -> FloatArray:
        """Return some, shape (n, columns), in the file's units; NaN where one is missing or wrong."""
        numbers = self.numbers.values
        values = np.full((len(numbers), len(columns)), np.nan)
        places = {column: place for place, column in enumerate(self.columns)}
        for place, column in enumerate(columns):
            if column in places:
                values[:, place] = numbers[:, places[column]]
        return values

    @cached_property
    def increasing(self) -> BoolArray:
        """Which columns of numbers increase from each row to the next, over two rows or more, shape (c,)."""
        values = self.numbers.values
        if len(values) < 2:
            return np.zeros(len(self.columns), dtype=bool)
        return np.asarray((np.diff(values, axis=0) > 0).all(axis=0))


ROWS_READ = "rows read"  # the inference that counts the rows left out
_LISTED = 5  # episodes, or ranges of rows, that a message names
_MIN_MEAN_ROWS = 4.0  # per episode: poses are measured three times
_ANY_TEXT = (UNPADDED_NS,)  # reads a column as text

_Episodes = Mapping[str, IntArray]
"""The rows of each episode by its name, from 0."""


def choose_rows(layouts: Sequence[Layout], options: LogMap) -> list[Layout]:
    """Return tables of the rows of the option `rows`, and of these the rows of one episode.

    Raises:
        LogError: If there are several episodes and none is given; the hints choose one.
        OptionError: If there are no such rows, or no such episode.
    """
    if options.rows is not None:
        layouts = [_choose_ranges(layout, options.rows) for layout in layouts]
    if options.episode is None:
        for layout in layouts if options.rows is None and not options.poses else ():
            _ask_episode(layout)
        return list(layouts)
    chosen = [_choose_episode(layout, options.episode) for layout in layouts]
    if all(layout is None for layout in chosen) and not options.shared:
        allowed = f"a column {', '.join(vocabulary().episode)}, or COLUMN=VALUE"
        raise _unknown_episode(layouts[0], options.episode, allowed)
    return [episode or layout for episode, layout in zip(chosen, layouts, strict=True)]


def with_rows(layout: Layout, rows: IntArray, *inferences: Inference) -> Layout:
    """Return a table of some of its rows, by index from 0, ascending, shape (k,)."""
    in_file = rows if layout.rows is None else layout.rows[rows]
    layout = replace(layout, rows=in_file, inferences=(*layout.inferences, *inferences))
    if layout.held is None:
        return replace(layout, sample=_sample(layout, in_file[:SAMPLED_LINES]))
    table = layout.held.take(arrow_column(rows))
    return replace(layout, held=table, sample=sampled_cells(table))


def column_texts(layout: Layout, column: int) -> list[str]:
    """Return all cells of a column as text, without spaces and quotes around them."""
    cells = read_table(layout, (), [ClockColumn(column, forms=_ANY_TEXT)]).texts[0]
    return [cells.text(row).strip(" \"'") for row in range(len(cells))]


def _sample(layout: Layout, rows: IntArray) -> tuple[tuple[str, ...], ...]:
    """Return the cells of some data rows of a text file, from 0."""
    sampled, last, texts = frozenset(rows.tolist()), int(rows[-1]), list[str]()
    for row, (_, text) in enumerate(data_lines(layout, layout.segment.lines())):
        if row in sampled:
            texts.append(text)
        if row == last:
            break
    if layout.form is not None:
        return layout.form.sampled(layout.form.readable(texts))
    return tuple(tuple(split_line(text, layout.delimiter)) for text in texts)


def count_rows(layout: Layout) -> int:
    """Return the number of data rows of a table."""
    if layout.held is not None:
        return int(layout.held.num_rows)
    return sum(1 for _ in data_lines(layout, layout.segment.lines()))


def _choose_ranges(layout: Layout, ranges: str) -> Layout:
    """Return a table of the rows of ranges such as "2:-1", from 1; -1 is the last."""
    count = count_rows(layout)
    is_read = np.zeros(count, dtype=np.bool_)
    for text in ranges.split(","):
        ends = zip(text.split(":"), (1, -1), strict=True)
        first, last = (
            count + 1 + end if end < 0 else end for end in (int(end or usual) for end, usual in ends)
        )
        if not 1 <= first <= last <= count:
            allowed = f"FIRST:LAST among rows 1 to {count}, FIRST no larger than LAST"
            raise OptionError(Finding("", layout.file, parameter="rows", found=text, allowed=allowed))
        is_read[first - 1 : last] = True
    if is_read.all():
        return layout
    why = f"given as an option: {format_ranges(np.flatnonzero(~is_read) + 1)} left out"
    return with_rows(layout, np.flatnonzero(is_read), _rows_read(int(is_read.sum()), count, why))


def _rows_read(rows: int, count: int, why: str) -> Inference:
    return Inference(ROWS_READ, f"{rows} of {count}", why, hints=(Hint("rows"),))


def format_ranges(rows: IntArray) -> str:
    """Return ascending numbers of rows [-], shape (n,), as text: "rows 1 to 5 and 9"."""
    breaks = np.flatnonzero(np.diff(rows) > 1)
    starts, ends = rows[np.r_[0, breaks + 1]].tolist(), rows[np.r_[breaks, len(rows) - 1]].tolist()
    parts = [str(a) if a == b else f"{a} to {b}" for a, b in zip(starts, ends, strict=True)]
    if len(parts) > _LISTED:
        parts[_LISTED - 1 :] = [f"{len(parts) - _LISTED + 1} more ranges"]
    return f"row{'s' * (len(rows) > 1)} " + " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))


def _ask_episode(layout: Layout) -> None:
    """Raise the question which episode is read, if a column has several, each in one block of rows."""
    for column in () if "episode" in layout.applied else _episode_columns(layout):
        episodes = {name: rows for name, rows in _find_episodes(layout, column).items() if name}
        if not _are_blocks(episodes):
            continue
        hints = [
            Hint("episode", name, f"reads its {format_count(len(rows), 'row')}")
            for name, rows in list(episodes.items())[:_LISTED]
        ]
        hints.append(Hint("rows", "1:-1", "reads all rows as one log"))
        finding = Finding(
            "", layout.file, column=layout.names[column], allowed="one", hints=tuple(hints),
            found=f"{len(episodes)} episodes: {_list_names(episodes)}",
        )  # fmt: skip
        raise LogError(finding)


def _choose_episode(layout: Layout, episode: str) -> Layout | None:
    """Return a table of the rows of an episode; None without a column of episodes."""
    if "episode" in layout.applied:
        return layout
    name, _, value = episode.partition("=")
    columns, labels = _episode_columns(layout), [split_unit(label)[0] for label in layout.names]
    named = [k for k, label in enumerate(labels) if value and name in (layout.names[k], label, str(k + 1))]
    if named:
        columns, episode = named[:1], value
    episodes: _Episodes = {}
    for column in columns:
        episodes = _find_episodes(layout, column)
        if (rows := episodes.get(_plain(episode))) is not None:
            why = f"{layout.names[column]} is {episode}, given as an option: the other rows left out"
            layout = replace(layout, applied=(*layout.applied, "episode"))
            return with_rows(layout, rows, _rows_read(len(rows), sum(map(len, episodes.values())), why))
    if columns:
        raise _unknown_episode(
            layout, episode, f"{_list_names(episodes)} of column {layout.names[columns[-1]]}"
        )
    return None


def _unknown_episode(layout: Layout, episode: str, allowed: str) -> OptionError:
    return OptionError(
        Finding("", layout.file, parameter="episode", found=format_value(episode), allowed=allowed)
    )


def _episode_columns(layout: Layout) -> list[int]:
    names = layout.names if layout.header is not None else ()
    return [k for k, name in enumerate(names) if key(split_unit(name)[0]) in vocabulary().episode]


def _find_episodes(layout: Layout, column: int) -> _Episodes:
    """Return the rows of each value of a column, in the order in which the values appear."""
    rows: dict[str, list[int]] = {}
    for row, text in enumerate(column_texts(layout, column)):
        rows.setdefault(_plain(text), []).append(row)
    return {name: np.array(of_name, dtype=np.int64) for name, of_name in rows.items()}


def _plain(text: str) -> str:
    """Return a whole number without decimals, any other text unchanged."""
    value = to_float(text, ".") if is_number(text, ".") else None
    return f"{value:.0f}" if value is not None and value.is_integer() else text


def _are_blocks(episodes: _Episodes) -> bool:
    """Return whether values are episodes: two or more whole numbers or texts, each in one block of rows."""
    are_names = not any(is_number(name, ".") and "." in name for name in episodes)
    are_together = all(rows[-1] - rows[0] == len(rows) - 1 for rows in episodes.values())
    are_long = sum(map(len, episodes.values())) >= _MIN_MEAN_ROWS * len(episodes)
    return len(episodes) > 1 and are_names and are_together and are_long


def _list_names(episodes: _Episodes) -> str:
    names = [name for name in episodes if name]
    more = f", ... ({len(names)} in total)" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more
