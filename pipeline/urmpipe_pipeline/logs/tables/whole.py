"""All numbers of a table, for what its first rows cannot prove: read once, when they are first looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_pipeline.logs.cells.cell import count_numbers, is_missing
from urmpipe_pipeline.logs.tables.numbers import ClockColumn, Numbers
from urmpipe_pipeline.logs.tables.padding import end_rows
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.table import read_table


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
