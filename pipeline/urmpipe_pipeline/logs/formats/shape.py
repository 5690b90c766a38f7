"""The rows of a table: one per sample, and of these the ones that are read.

1. `orient_table`: joints as rows, and arrays flattened to numbers one after another. Only the numbers show
   it: from sample to sample a joint continues nearly straight, while two joints have nothing in common. With
   numbers in the shape (samples, joints) that they may have, the roughness

       r = mean d2^2,    d2[i] = x[i + 1] - 2 x[i] + x[i - 1] down each column

   falls to a part of what it is as they stand. A table of few rows that is smooth along them is asked about,
   and numbers one by one of which another shape is smoother. Rows that begin with a name are joints. Read so,
   a table is one in memory. A row per joint of each sample: `long_form`.
2. `choose_rows`: the rows of the option `rows`, and of these one episode. A table of some rows is like any
   other: clock, joints and units are decided on these rows alone. Errors count the rows of the file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice

import numpy as np
import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import is_number, is_text, plain, to_float
from urmpipe_pipeline.logs.formats.log_table import LogTable, capped, steps
from urmpipe_pipeline.logs.formats.long_form import LONG, find_long_form, pivot, require_long_form
from urmpipe_pipeline.logs.formats.memory import MemoryTable, to_log_table
from urmpipe_pipeline.logs.formats.sniff import GIVEN, across
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import key, split_unit, vocabulary

AS_TABLE, TRANSPOSED = "table", "transposed"
MAX_JOINTS = 16  # with times, rates or torques, that rows or a flat array may stand for
MIN_COLUMNS = 20  # fewer may be those of an ordinary table
MIN_SAMPLES = 10  # of a flat array; fewer show nothing
MAX_ALONG = 0.1  # of the squared steps down: swings with 14 samples a period have it, noise 1
MAX_ROUGHNESS = {"flat": 0.1, "flat-by-joint": 0.35}  # of that as they stand; in the latter jumps remain
MIN_ROUGHNESS = 1e-12  # of the variance, or of that as they stand: below it is rounding
SIMILAR = 2.0  # roughness within this factor is the same: of two numbers of joints the smaller one is taken
MAX_OFFERED = 3  # ways to read a flat array
ROWS_READ = "rows read"  # the inference that counts the rows that are not read
MAX_LISTED = 5  # episodes that a message names
MIN_MEAN_ROWS = 4.0  # per episode: poses are measured three times

_TABLE = Hint("layout", AS_TABLE, "takes each row as a sample")
_Rows = Sequence[Sequence[str]]
_Episodes = Mapping[str, IntArray]  # the rows of each episode by its name, from 0


def orient_table(table: LogTable, layout: str | None, *, is_only: bool = True) -> LogTable:
    """Return a table as one with a row per sample.

    Args:
        table: The table.
        layout: The option: "table", "transposed", "long", "flat:N", "flat-by-joint:N".
        is_only: Whether it is all of a log: one of several files may be a single column or row.

    Raises:
        LogError: If its numbers say that it may be no row a sample, or they do not fit the option.
    """
    if layout is not None:
        return _apply(table, layout)
    if not is_only or (isinstance(table, TextTable) and table.form is not None):
        return table
    if (form := find_long_form(table)) is not None:
        return pivot(table, form, form.describe(table), _TABLE)
    line = across(table)
    if len(line.names) == 1 or (table.arrow is not None and table.arrow.num_rows == 1):
        return _check_single(table, line)
    is_unnamed = table.header is None or all(is_number(name, ".") for name in table.names if name)
    return _check_rows(table) if is_unnamed and len(table.sample) <= MAX_JOINTS else table


def _apply(table: LogTable, layout: str) -> LogTable:
    if layout == TRANSPOSED:
        return _transpose(table, list(table.iter_cells()), GIVEN)
    if layout == LONG:
        return pivot(table, require_long_form(table), GIVEN)
    if layout != AS_TABLE:
        return _unflatten(table, layout)
    return replace(table, inferences=(*table.inferences, Inference("layout", AS_TABLE, GIVEN)))


def _check_rows(table: LogTable) -> LogTable:
    """Return rows that are joints by their names turned; by their numbers alone they are asked about."""
    rows = list(islice(table.iter_cells(), MAX_JOINTS + 1))
    if not 1 < len(rows) <= MAX_JOINTS or len({len(row) for row in rows}) > 1:
        return table
    names, cells = _split_names(rows, table.decimal)
    numbers = [to_float(cell, table.decimal) for cell in chain.from_iterable(cells)]
    values = np.array([] if None in numbers else numbers, dtype=np.float64).reshape(len(rows), -1)
    if not goes_along_rows(values):
        return table
    if not names or len(set(names)) < len(names):
        raise _rows_error(table, *values.shape)
    why = f"{len(rows)} rows begin with a name, and their {values.shape[1]} numbers continue smoothly"
    return _transpose(table, rows, why, _TABLE)


def _check_single(table: LogTable, line: LogTable) -> LogTable:
    """Return a single column or row as it is, if it may be one joint over time or one sample; else ask."""
    numbers = line.all_rows
    if numbers.findings:
        return table
    x = numbers.values.ravel()
    ways = flat_ways(x)[:MAX_OFFERED]
    if ways:
        order, count = ways[0]
        place = f"{count}th after it" if order == "flat" else f"next, except {count - 1} jumps"
        fault = f"found {len(x)} numbers one by one that continue smoothly from one to the {place}"
        effects = {"flat": "numbers a sample", "flat-by-joint": "joints one by one"}
        hints = [Hint("layout", f"{order}:{n}", f"takes {n} {effects[order]}") for order, n in ways]
        hints.append(Hint("layout", AS_TABLE, f"takes {'them' if line.across else 'each'} as a sample"))
        raise LogError(Finding(f"{fault}, which may be a flat array", table.file, hints=tuple(hints)))
    if len(table.names) > 1 and goes_along_rows(x[np.newaxis]):
        raise _rows_error(table, 1, len(x))
    return table


def _rows_error(table: LogTable, rows: int, columns: int) -> LogError:
    count = format_count(rows, "row")
    fault = f"found {count} of {columns} numbers that continue smoothly along the rows"
    fault += ", which may be joints as rows"
    return LogError(Finding(fault, table.file, hints=(Hint("layout", TRANSPOSED, "applies this"), _TABLE)))


def goes_along_rows(values: FloatArray) -> bool:
    """Return whether numbers are smooth along the rows and not down the columns, so that rows may be joints.

    mean d1^2 along the rows <= MAX_ALONG * mean d1^2 down the columns; of a single row its variance, twice.

    Args:
        values: In any unit, shape (rows, columns), NaN where one is missing.
    """
    rows, columns = values.shape
    if not 1 <= rows <= MAX_JOINTS or columns < max(MIN_COLUMNS, rows + 1):
        return False
    along = _mean_square([steps(row) for row in values])
    down = 2 * _variance(values[0]) if rows == 1 else _mean_square(np.diff(values, axis=0))
    return 0.0 < along <= MAX_ALONG * down or (along == 0.0 < down and rows > 1)


def flat_ways(x: FloatArray) -> list[tuple[str, int]]:
    """Return how many joints numbers in a row may hold, and in which order: "flat" or "flat-by-joint".

    Args:
        x: In the order of the file and in any unit, shape (n,).

    Returns:
        The most likely first; nothing where the numbers are one joint, or cannot be distinguished from one.
    """
    counts = [n for n in range(2, MAX_JOINTS + 1) if not len(x) % n and len(x) >= n * MIN_SAMPLES]
    as_they_stand = _roughness(x[:, np.newaxis])
    if as_they_stand <= MIN_ROUGHNESS * _variance(x):
        return []
    for order, limit in MAX_ROUGHNESS.items():
        tables = {n: x.reshape(-1, n) if order == "flat" else x.reshape(n, -1).T for n in counts}
        rough = {n: _roughness(table) / as_they_stand for n, table in tables.items()}
        rough = {n: share for n, share in rough.items() if MIN_ROUGHNESS < share <= limit}
        # twice as many joints are as smooth as the right number, and half as many are not
        best = next((n for n in rough if rough[n] <= SIMILAR * min(rough.values())), None)
        if best is not None:
            return [(order, n) for n in sorted(rough, key=lambda n: (n != best, rough[n]))]
    return []


def _roughness(table: FloatArray) -> float:
    return _mean_square(np.diff(steps(table), axis=0))


def _mean_square(values: FloatArray | Sequence[FloatArray]) -> float:
    known = np.asarray(values)[np.isfinite(values)]
    return float(np.mean(known**2)) if len(known) else 0.0


def _variance(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.var(known)) if len(known) else 0.0


def _transpose(table: LogTable, rows: _Rows, why: str, *otherwise: Hint) -> LogTable:
    """Return a table whose rows are columns; a text at the beginning of a row is its name."""
    width = max(map(len, rows))
    short = next((k for k, row in enumerate(rows) if len(row) != width), None)
    if short is not None:
        fault = f"found a row of {len(rows[short])} cells, allowed: {width}, as others have"
        raise LogError(Finding(fault, table.file, row=short + 1))
    names, cells = _split_names(rows, table.decimal)
    texts = (
        [plain(c, table.decimal) if is_number(c, table.decimal) else c or None for c in row] for row in cells
    )
    columns = [pa.array(column, pa.string()) for column in texts]
    return _in_memory(table, columns, names, Inference("layout", TRANSPOSED, why, hints=otherwise))


def _unflatten(table: LogTable, layout: str) -> LogTable:
    """Return numbers that follow each other, row by row, as a table of N columns."""
    order, _, text = layout.partition(":")
    numbers, count = across(table).all_rows, int(text)
    if numbers.findings:
        raise LogError(*capped(numbers.findings, table.file))
    x = numbers.values.ravel()
    if not len(x) or len(x) % count:
        fault = f"found {len(x)} numbers, allowed with {layout}: a multiple of {count}"
        raise LogError(Finding(fault, table.file))
    columns = x.reshape(-1, count).T if order == "flat" else x.reshape(count, -1)
    return _in_memory(table, [pa.array(column) for column in columns], (), Inference("layout", layout, GIVEN))


def _in_memory(
    table: LogTable, columns: Sequence[pa.Array], names: Sequence[str], inference: Inference
) -> LogTable:
    numbered = list(names or map(str, range(1, len(columns) + 1)))
    arrow = pa.Table.from_arrays(list(columns), names=numbered)
    memory = MemoryTable(table.path.stem, arrow, named=bool(names), path=table.path)
    earlier = (known for known in table.inferences if known.what != "header")
    return replace(to_log_table(memory), inferences=(*earlier, inference))


def _split_names(rows: _Rows, decimal: str) -> tuple[tuple[str, ...], list[Sequence[str]]]:
    """Return the names that rows begin with, if they do, and the other cells."""
    if not any(is_text(row[0], decimal) for row in rows if row):
        return (), list(rows)
    return tuple(row[0] for row in rows), [row[1:] for row in rows]


# The rows that are read


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
    why = f"{GIVEN}: {ranges}"
    chosen = table.take(np.flatnonzero(is_read), _rows_read(int(is_read.sum()), count, why))
    return replace(chosen, uncut=table)


def _rows_read(rows: int, count: int, why: str) -> Inference:
    return Inference(ROWS_READ, f"{rows} of {count}", why, hints=(Hint("rows"),))


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
        fault = f"{len(episodes)} episodes: {_list_names(episodes)}"
        column_name = table.names[column]
        raise LogError(
            Finding("", table.file, column=column_name, found=fault, allowed="one", hints=tuple(hints))
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
    fault = format_value(episode)
    return OptionError(Finding("", table.file, parameter="episode", found=fault, allowed=allowed))


def _episode_columns(table: LogTable) -> list[int]:
    names = table.names if table.header is not None else ()
    return [k for k, name in enumerate(names) if key(split_unit(name)[0]) in vocabulary().episode]


def _find_episodes(table: LogTable, column: int) -> _Episodes:
    """Return the rows of each value of a column, in the order in which the values appear."""
    texts, rows = table.texts(column), dict[str, list[int]]()
    names = {text: _without_decimals(text) for text in set(texts)}
    for row, text in enumerate(texts):
        rows.setdefault(names[text], []).append(row)
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
