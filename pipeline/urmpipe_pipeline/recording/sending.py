"""Arrays as Rerun takes them: times in integer nanoseconds or rows, scalars as lists; names as entities."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.recording.store import ROW, TIME
from urmpipe_pipeline.text import encodable, unique

if TYPE_CHECKING:
    import pyarrow as pa
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

    return rr.TimeColumn(TIME, duration=np.asarray(t_ns).astype("timedelta64[ns]"))


def times_at(t_ns: IntArray | None, rows: IntArray) -> list[TimeColumn]:
    """Return the times of some rows on the timeline t, or where there are none on the timeline row, from 1.

    Rows, from 0, shape (m,), are some of those at integer times in [ns], shape (n,).
    """
    import rerun as rr

    if t_ns is None:
        return [rr.TimeColumn(ROW, sequence=rows + 1)]
    return [times_column(np.asarray(t_ns)[rows])]


@dataclass(frozen=True)
class Values:
    """Values of any type, unit and shape (...,) of a component: Rerun's batches would copy them once more."""

    array: NDArray[Any]

    def as_arrow_array(self) -> pa.Array:
        """Return them as Rerun asks for them."""
        import pyarrow as pa

        return pa.array(self.array.reshape(-1))


def scalar_column(values: FloatArray) -> ComponentColumn:
    """Return an array in the unit of its plot, shape (n, k), as a column of lists.

    `Scalars.columns` takes six times as long over it.
    """
    import rerun as rr

    offsets = np.arange(len(values) + 1, dtype=np.int32) * np.int32(values.shape[1])
    return rr.ComponentColumn(rr.Scalars.descriptor_scalars(), Values(np.asarray(values)), offsets=offsets)
