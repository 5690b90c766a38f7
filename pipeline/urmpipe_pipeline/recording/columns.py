"""Arrays as Rerun takes them: times in integer nanoseconds, rows of scalars as lists, or many rows as one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from urmpipe_pipeline.recording.codec import Column
from urmpipe_pipeline.recording.sending import Values, scalar_column, times_column
from urmpipe_pipeline.recording.store import PACKED, ROW

if TYPE_CHECKING:
    from rerun import ComponentColumn, TimeColumn


def column_rows(
    column: Column, rows: slice, *, numbered: bool = True
) -> tuple[list[TimeColumn], list[ComponentColumn]]:
    """Return the times and the values of some rows of an array, one by one where it is plotted.

    Plotted rows need no numbers where their times tell them apart.
    """
    import rerun as rr

    values = np.asarray(column.values[rows] if column.values.ndim else column.values)
    if not column.plotted:
        packed = rr.ComponentColumn(PACKED, Values(values), lengths=[values.size])
        return [rr.TimeColumn(ROW, sequence=np.array([rows.start + 1]))], [packed]
    times = [] if column.t_ns is None else [times_column(column.t_ns[rows])]
    if numbered:
        times.append(rr.TimeColumn(ROW, sequence=np.arange(rows.start + 1, rows.stop + 1)))
    return times, [scalar_column(values.reshape(len(values), -1))]
