"""The rows of a table that are read: those of the option `rows`, of an episode.

A table of some rows is like any other: clock, joints and units are decided on these rows alone. Errors count
the rows of the file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import is_number, to_float
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import key, split_unit, vocabulary

ROWS_READ = "rows read"  # the inference that counts the rows that are not read
MAX_LISTED = 5  # episodes, or ranges of rows, that a message names
MIN_MEAN_ROWS = 4.0  # per episode: poses are measured three times

_Episodes = Mapping[str, IntArray]  # the rows of each episode by its name, from 0


def choose_rows(tables: Sequence[LogTable], options: LogMap) -> list[LogTable]:
    """Return tables of the rows of the option `rows`, and of these the rows of one episode.

    Raises:
        LogError: If there are several episodes and none is given; the hints choose one.
        OptionError: If there are no such rows, or no such episode.
    """
    if options.rows is not None:
        tables = [_choose_ranges(table, options.rows) for table in tables]
    if options.episode is None:
        for table in tables if options.rows is None and not options.poses else ():
            _check_episodes(table)
        return list(tables)
    chosen = [_choose_episode(table, options.episode) for table in tables]
    if all(table is None for table in chosen) and not options.shared:
        allowed = f"a column {', '.join(vocabulary().episode)}, or COLUMN=VALUE"
        raise _unknown_episode(tables[0], options.episode, allowed)
    return [episode or table for episode, table in zip(chosen, tables, strict=True)]


def _choose_ranges(table: LogTable, ranges: str) -> LogTable:
    """Return a table of the rows of ranges such as "2:-1", from 1; -1 is the last."""
    count = table.count_rows()
    is_read = np.zeros(count, dtype=np.bool_)
    for text in ranges.split(","):
        ends = (int(end or usual) for end, usual in zip(text.split(":"), (1, -1), strict=True))
        first, last = (count + 1 + end if end < 0 else end for end in ends)
        if not 1 <= first <= last <= count:
            allowed = f"FIRST:LAST among rows 1 to {count}, FIRST no larger than LAST"
            raise OptionError(Finding("", table.file, parameter="rows", found=text, allowed=allowed))
        is_read[first - 1 : last] = True
    if is_read.all():
        return table
    why = f"given as an option: {format_ranges(np.flatnonzero(~is_read) + 1)} left out"
    return table.take(np.flatnonzero(is_read), _rows_read(int(is_read.sum()), count, why))


def _rows_read(rows: int, count: int, why: str) -> Inference:
    return Inference(ROWS_READ, f"{rows} of {count}", why, hints=(Hint("rows"),))


def format_ranges(rows: IntArray) -> str:
    """Return ascending numbers of rows [-], shape (n,), as text: "rows 1 to 5 and 9"."""
    breaks = np.flatnonzero(np.diff(rows) > 1)
    starts, ends = rows[np.r_[0, breaks + 1]].tolist(), rows[np.r_[breaks, len(rows) - 1]].tolist()
    parts = [str(a) if a == b else f"{a} to {b}" for a, b in zip(starts, ends, strict=True)]
    if len(parts) > MAX_LISTED:
        parts[MAX_LISTED - 1 :] = [f"{len(parts) - MAX_LISTED + 1} more ranges"]
    return f"row{'s' * (len(rows) > 1)} " + " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))


def _check_episodes(table: LogTable) -> None:
    """Raise the question which episode is read, if a column has several, each in one block of rows."""
    for column in () if "episode" in table.applied else _episode_columns(table):
        episodes = {name: rows for name, rows in _find_episodes(table, column).items() if name}
        if not _are_blocks(episodes):
            continue
        hints = [
            Hint("episode", name, f"reads its {format_count(len(rows), 'row')}")
            for name, rows in list(episodes.items())[:MAX_LISTED]
        ]
        hints.append(Hint("rows", "1:-1", "reads all rows as one log"))
        found = f"{len(episodes)} episodes: {_list_names(episodes)}"
        column_name = table.names[column]
        raise LogError(
            Finding("", table.file, column=column_name, found=found, allowed="one", hints=tuple(hints))
        )


def _choose_episode(table: LogTable, episode: str) -> LogTable | None:
    """Return a table of the rows of an episode; None without a column of episodes."""
    if "episode" in table.applied:
        return table
    name, _, value = episode.partition("=")
    columns, labels = _episode_columns(table), [split_unit(label)[0] for label in table.names]
    named = [k for k, label in enumerate(labels) if value and name in (table.names[k], label, str(k + 1))]
    if named:
        columns, episode = named[:1], value
    episodes: _Episodes = {}
    for column in columns:
        episodes = _find_episodes(table, column)
        if (rows := episodes.get(_without_decimals(episode))) is not None:
            why = f"{table.names[column]} is {episode}, given as an option: the other rows left out"
            table = replace(table, applied=(*table.applied, "episode"))
            return table.take(rows, _rows_read(len(rows), sum(map(len, episodes.values())), why))
    if columns:
        allowed = f"{_list_names(episodes)} of column {table.names[columns[-1]]}"
        raise _unknown_episode(table, episode, allowed)
    return None


def _unknown_episode(table: LogTable, episode: str, allowed: str) -> OptionError:
    found = format_value(episode)
    return OptionError(Finding("", table.file, parameter="episode", found=found, allowed=allowed))


def _episode_columns(table: LogTable) -> list[int]:
    names = table.names if table.header is not None else ()
    return [k for k, name in enumerate(names) if key(split_unit(name)[0]) in vocabulary().episode]


def _find_episodes(table: LogTable, column: int) -> _Episodes:
    """Return the rows of each value of a column, in the order in which the values appear."""
    rows: dict[str, list[int]] = {}
    for row, text in enumerate(table.texts(column)):
        rows.setdefault(_without_decimals(text), []).append(row)
    return {name: np.array(of_name, dtype=np.int64) for name, of_name in rows.items()}


def _without_decimals(text: str) -> str:
    """Return a whole number without decimals, any other text unchanged."""
    value = to_float(text, ".") if is_number(text, ".") else None
    return f"{value:.0f}" if value is not None and value.is_integer() else text


def _are_blocks(episodes: _Episodes) -> bool:
    """Return whether values are episodes: two or more whole numbers or texts, each in one block of rows."""
    are_names = not any(is_number(name, ".") and "." in name for name in episodes)
    are_together = all(rows[-1] - rows[0] == len(rows) - 1 for rows in episodes.values())
    are_long = sum(map(len, episodes.values())) >= MIN_MEAN_ROWS * len(episodes)
    return len(episodes) > 1 and are_names and are_together and are_long


def _list_names(episodes: _Episodes) -> str:
    names = [name for name in episodes if name]
    more = f", ... ({len(names)} in total)" if len(names) > MAX_LISTED else ""
    return ", ".join(names[:MAX_LISTED]) + more
