"""Arrays as Rerun takes them: times in integer nanoseconds or rows, scalars as lists; names as entities."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.text import encodable, unique

if TYPE_CHECKING:
    from rerun import ComponentColumn, TimeColumn

ROOT = "/shown"
"""What is there to be looked at only stands below it."""


def shown_path(*parts: str) -> str:
    """Return the path of an entity below the root, each part escaped as Rerun wants it."""
    import rerun as rr

    return ROOT + rr.new_entity_path(list(parts))


def keys(names: Sequence[str]) -> list[str]:
    """Return names as parts of entity paths, all different.

    Rerun's filters, by which views choose what they show, drop blanks at the end of a path, and take a
    backslash before a slash for the slash's own, escaped or not: names end before these.
    """
    return unique([re.sub(r"[\s\\]+\Z", "", encodable(name)) or "unnamed" for name in names])


def times_column(t_ns: IntArray) -> TimeColumn:
    """Return times in integer [ns], shape (n,), on the timeline t.

    Rerun truncates seconds given as floats, which puts some times off by a nanosecond; integers are exact.
    """
    import rerun as rr

    return rr.TimeColumn("t", duration=np.asarray(t_ns).astype("timedelta64[ns]"))


def times_at(t_ns: IntArray | None, rows: IntArray) -> list[TimeColumn]:
    """Return the times of some rows on the timeline t; on the timeline row, from 1, where there are none.

    Args:
        t_ns: Times of all rows in integer [ns], shape (n,); None without times.
        rows: The rows, shape (m,).
    """
    import rerun as rr

    if t_ns is None:
        return [rr.TimeColumn("row", sequence=np.asarray(rows) + 1)]
    return [times_column(np.asarray(t_ns)[rows])]


def scalar_column(values: FloatArray) -> ComponentColumn:
    """Return an array as a column of lists; `Scalars.columns` takes six times as long over it.

    Args:
        values: In the unit of their plot, shape (n, k).
    """
    import rerun as rr

    offsets = np.arange(len(values) + 1, dtype=np.int32) * np.int32(values.shape[1])
    batch = rr.components.ScalarBatch(np.ascontiguousarray(values))
    return rr.ComponentColumn(rr.Scalars.descriptor_scalars(), batch, offsets=offsets)
