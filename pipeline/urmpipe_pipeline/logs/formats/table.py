"""The rows of a table that are read: those of the option `rows`, of an episode, of a topic.

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
from urmpipe_pipeline.logs.formats.cells import (
    is_number,
    to_float,
)
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import key, split_unit, vocabulary

ROWS_READ = "rows read"  # the inference that counts the rows left out
_LISTED = 5  # episodes, or ranges of rows, that a message names
_MIN_MEAN_ROWS = 4.0  # per episode: poses are measured three times

_Episodes = Mapping[str, IntArray]
"""The rows of each episode by its name, from 0."""


def choose_rows(layouts: Sequence[LogTable], options: LogMap) -> list[LogTable]:
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


def _choose_ranges(layout: LogTable, ranges: str) -> LogTable:
    """Return a table of the rows of ranges such as "2:-1", from 1; -1 is the last."""
    count = layout.count_rows()
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
    return layout.take(np.flatnonzero(is_read), _rows_read(int(is_read.sum()), count, why))


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


def _ask_episode(layout: LogTable) -> None:
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


def _choose_episode(layout: LogTable, episode: str) -> LogTable | None:
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
            return layout.take(rows, _rows_read(len(rows), sum(map(len, episodes.values())), why))
    if columns:
        raise _unknown_episode(
            layout, episode, f"{_list_names(episodes)} of column {layout.names[columns[-1]]}"
        )
    return None


def _unknown_episode(layout: LogTable, episode: str, allowed: str) -> OptionError:
    return OptionError(
        Finding("", layout.file, parameter="episode", found=format_value(episode), allowed=allowed)
    )


def _episode_columns(layout: LogTable) -> list[int]:
    names = layout.names if layout.header is not None else ()
    return [k for k, name in enumerate(names) if key(split_unit(name)[0]) in vocabulary().episode]


def _find_episodes(layout: LogTable, column: int) -> _Episodes:
    """Return the rows of each value of a column, in the order in which the values appear."""
    rows: dict[str, list[int]] = {}
    for row, text in enumerate(layout.texts(column)):
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
