"""Arrays as Rerun takes them: times in integer nanoseconds, rows of scalars as lists, or many rows as one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_pipeline.recording.array_form import Column
from urmpipe_pipeline.recording.sending import scalar_column, times_column
from urmpipe_pipeline.recording.store import PACKED, ROW

if TYPE_CHECKING:
    import pyarrow as pa
    from rerun import ComponentColumn, TimeColumn


@dataclass(frozen=True)
class _Packed:
    """Values of any type as Rerun takes those of a component."""

    values: NDArray[Any]

    def as_arrow_array(self) -> pa.Array:
        import pyarrow as pa

        return pa.array(self.values.reshape(-1))


def column_rows(column: Column, rows: slice) -> tuple[list[TimeColumn], list[ComponentColumn]]:
    """Return the times and the values of some rows of an array, one by one where it is plotted."""
    import rerun as rr

    values = np.asarray(column.values[rows] if column.values.ndim else column.values)
    if not column.plotted:
        packed = rr.ComponentColumn(PACKED, _Packed(values), lengths=[values.size])
        return [rr.TimeColumn(ROW, sequence=np.array([rows.start + 1]))], [packed]
    times = [rr.TimeColumn(ROW, sequence=np.arange(rows.start + 1, rows.stop + 1))]
    if column.t_ns is not None:
        times.insert(0, times_column(column.t_ns[rows]))
    return times, [scalar_column(values.reshape(len(values), -1))]
