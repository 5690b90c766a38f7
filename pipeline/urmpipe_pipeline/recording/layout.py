"""The layout of a recording: what writer and reader agree on, and columns as Rerun takes them.

- The property `PROPERTY` holds the metadata as JSON (`metadata_json`), its checksum, and `Opening`.
- Each array is an entity at the path of its field. Its rows are stored one by one on the timelines `TIME`,
  where it has times, and `ROW`, where its times do not identify them (`SCALARS`); or many rows as one
  (`PACKED`), where it is not plotted (`array_columns`).
- Everything that is only to be looked at is stored below `VIEW_ROOT` (`shown_path`).
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.recording.codec import StoredArray
from urmpipe_pipeline.text import drop_surrogates, make_unique

if TYPE_CHECKING:
    import pyarrow as pa
    from rerun import ComponentColumn, TimeColumn

LAYOUT_VERSION = 9  # raised when what is stored changes otherwise than by a field with a default

PROPERTY = "urmpipe"  # name of the recording's property with the metadata
SCALARS = "Scalars:scalars"  # component with the values of an array whose rows are stored one by one
PACKED = "urmpipe:packed"  # component with the values of any other array, of its dtype
TIME = "t"  # timeline of times in [ns]
ROW = "row"  # timeline of the rows of every array, from 1; of a packed array that of the first row of a pack
VIEW_ROOT = "/shown"  # path of everything that is no array of the result
SLICE = 32_768  # rows sent at a time: low memory, and low overhead

NO_ENTRIES: Mapping[str, Any] = MappingProxyType({})


class Opening(NamedTuple):
    """Where the viewer opens: a timeline, and the time in [ns] on t or the row from 1 on row."""

    timeline: str
    at: int


def metadata_json(
    kind: str, tree: Any, clocks: Mapping[str, str] = NO_ENTRIES, checksums: Mapping[str, int] = NO_ENTRIES
) -> str:
    """Return the metadata of a result of a kind as JSON.

    Args:
        kind: Name of the kind, see `urmpipe_pipeline.results`.
        tree: The result without its arrays, from `encode`.
        clocks: Paths of the times that identify the rows of arrays, by the paths of these.
        checksums: Checksums of the arrays by their paths, see `checksum`.
    """
    head = {"layout_version": LAYOUT_VERSION, "kind": kind, "clocks": dict(clocks)}
    return json.dumps({**head, "checksums": dict(checksums), "result": tree})


def checksum(values: NDArray[Any] | str) -> int:
    """Return the checksum (CRC-32) of an array, any unit and shape, or a text: a changed byte changes it."""
    return zlib.crc32(values.encode() if isinstance(values, str) else np.ascontiguousarray(values).data)


def shown_path(*parts: str) -> str:
    """Return the path of an entity below `VIEW_ROOT`, each part escaped for Rerun."""
    import rerun as rr

    return VIEW_ROOT + rr.new_entity_path(list(parts))


def keys(names: Sequence[str]) -> list[str]:
    """Return names as parts of entity paths, all different.

    Rerun's filters, by which views choose what they show, drop blanks at the end of a path, and take a
    backslash before a slash for the escape of that slash: names end before these.
    """
    return make_unique([re.sub(r"[\s\\]+\Z", "", drop_surrogates(name)) or "unnamed" for name in names])


def array_columns(
    array: StoredArray, rows: slice, *, numbered: bool = True
) -> tuple[list[TimeColumn], list[ComponentColumn]]:
    """Return the times and the values of some rows of an array, one by one if it is plotted.

    Plotted rows need no numbers if their times identify them.
    """
    import rerun as rr

    values = np.asarray(array.values[rows] if array.values.ndim else array.values)
    if not array.plotted:
        pack = rr.ComponentColumn(PACKED, _ArrowValues(values), lengths=[values.size])
        return [rr.TimeColumn(ROW, sequence=np.array([rows.start + 1]))], [pack]
    times = [] if array.t_ns is None else [times_column(array.t_ns[rows])]
    if numbered:
        times.append(rr.TimeColumn(ROW, sequence=np.arange(rows.start + 1, rows.stop + 1)))
    return times, [scalar_column(values.reshape(len(values), -1))]


def times_column(t_ns: IntArray) -> TimeColumn:
    """Return times in integer [ns], shape (n,), on the timeline t.

    Rerun truncates seconds given as floats, which shifts some times by a nanosecond; integers are exact.
    """
    import rerun as rr

    return rr.TimeColumn(TIME, duration=np.asarray(t_ns).astype("timedelta64[ns]"))


def times_at(t_ns: IntArray | None, rows: IntArray) -> list[TimeColumn]:
    """Return the times of some rows on the timeline t, or without times their numbers on the timeline row.

    Rows, from 0, shape (m,), are some of those at integer times in [ns], shape (n,).
    """
    import rerun as rr

    if t_ns is None:
        return [rr.TimeColumn(ROW, sequence=rows + 1)]
    return [times_column(np.asarray(t_ns)[rows])]


def scalar_column(values: FloatArray) -> ComponentColumn:
    """Return an array in the unit of its plot, shape (n, k), as a column of lists.

    `Scalars.columns` takes six times as long.
    """
    import rerun as rr

    offsets = np.arange(len(values) + 1, dtype=np.int32) * np.int32(values.shape[1])
    return rr.ComponentColumn(
        rr.Scalars.descriptor_scalars(), _ArrowValues(np.asarray(values)), offsets=offsets
    )


class _ArrowValues:
    """The values of a component as Rerun asks for them: its own batches would copy them once more."""

    def __init__(self, values: NDArray[Any]) -> None:
        self._values = values

    def as_arrow_array(self) -> pa.Array:
        import pyarrow as pa

        return pa.array(self._values.reshape(-1))
