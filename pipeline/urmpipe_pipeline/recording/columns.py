"""Arrays as Rerun takes them: times in integer nanoseconds, rows of scalars as lists, or many rows as one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.recording.array_form import Column
from urmpipe_pipeline.recording.entities import Block
from urmpipe_pipeline.recording.store import PACKED, ROW

if TYPE_CHECKING:
    import pyarrow as pa
    from rerun import ComponentColumn, TimeColumn


def time_columns(
    t_ns: IntArray | None, name: str | None = None, numbers: IntArray | None = None
) -> list[TimeColumn]:
    """Return the time columns: t in integer [ns], and a sequence if one is named.

    Rerun truncates seconds given as floats, which puts some times off by a nanosecond; integers are exact.

    Args:
        t_ns: In integer [ns], shape (n,); None for no times.
        name: Of the sequence.
        numbers: The sequence, shape (n,).
    """
    import rerun as rr

    columns = [] if t_ns is None else [rr.TimeColumn("t", duration=t_ns.astype("timedelta64[ns]"))]
    if name is not None and numbers is not None:
        columns.append(rr.TimeColumn(name, sequence=numbers))
    return columns


@dataclass(frozen=True)
class _Values:
    """Values of any type as Rerun takes those of a component; its own batches copy them first."""

    values: NDArray[Any]

    def as_arrow_array(self) -> pa.Array:
        import pyarrow as pa

        return pa.array(self.values.reshape(-1))


def scalar_column(values: FloatArray) -> ComponentColumn:
    """Return an array as a column of lists; `Scalars.columns` takes six times as long over it.

    Args:
        values: In the unit of their plot, shape (n, k).
    """
    import rerun as rr

    offsets = np.arange(len(values) + 1, dtype=np.int32) * np.int32(values.shape[1])
    return rr.ComponentColumn(rr.Scalars.descriptor_scalars(), _Values(values), offsets=offsets)


def column_rows(column: Column, rows: slice) -> tuple[list[TimeColumn], list[ComponentColumn]]:
    """Return the times and the values of some rows of an array, one by one where it is plotted."""
    import rerun as rr

    values = np.asarray(column.values[rows] if column.values.ndim else column.values)
    if not column.plotted:
        packed = rr.ComponentColumn(PACKED, _Values(values), lengths=[values.size])
        return time_columns(None, ROW, np.array([rows.start + 1])), [packed]
    t_ns = None if column.t_ns is None else np.asarray(column.t_ns[rows])
    numbers = np.arange(rows.start + 1, rows.stop + 1)
    return time_columns(t_ns, ROW, numbers), [scalar_column(values.reshape(len(values), -1))]


def block_columns(block: Block, rows: slice) -> tuple[list[TimeColumn], ComponentColumn]:
    """Return the times and the values of some rows of an array."""
    name, numbers = block.numbers or (None, None)
    times = time_columns(block.t_ns[rows], name, None if numbers is None else numbers[rows])
    return times, scalar_column(block.values[rows])
