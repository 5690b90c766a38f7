"""Arrays as Rerun takes them: times in integer nanoseconds, rows of scalars as lists."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.recording.entities import Block

if TYPE_CHECKING:
    from rerun import ComponentColumn, TimeColumn


def time_columns(
    t_ns: IntArray, name: str | None = None, numbers: IntArray | None = None
) -> list[TimeColumn]:
    """Return the time columns: t in integer [ns], and a sequence if one is named.

    Rerun truncates seconds given as floats, which puts some times off by a nanosecond; integers are exact.

    Args:
        t_ns: In integer [ns], shape (n,).
        name: Of the sequence.
        numbers: The sequence, shape (n,).
    """
    import rerun as rr

    columns = [rr.TimeColumn("t", duration=t_ns.astype("timedelta64[ns]"))]
    if name is not None and numbers is not None:
        columns.append(rr.TimeColumn(name, sequence=numbers))
    return columns


def scalar_column(values: FloatArray) -> ComponentColumn:
    """Return an array as a column of lists; `Scalars.columns` takes six times as long over it.

    Args:
        values: In the unit of their plot, shape (n, k).
    """
    import rerun as rr

    offsets = np.arange(len(values) + 1, dtype=np.int32) * np.int32(values.shape[1])
    return rr.ComponentColumn(
        rr.Scalars.descriptor_scalars(), rr.components.ScalarBatch(values), offsets=offsets
    )


def block_columns(block: Block, rows: slice) -> tuple[list[TimeColumn], ComponentColumn]:
    """Return the times and the values of some rows of an array."""
    name, numbers = block.numbers or (None, None)
    times = time_columns(block.t_ns[rows], name, None if numbers is None else numbers[rows])
    return times, scalar_column(block.values[rows])
