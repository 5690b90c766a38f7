"""Times that are doubles, put right by the exact clock that stands beside them in our own files."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.logs.cells.text_cells import Bytes
from urmpipe_pipeline.logs.tables.column_facts import UNIT

EXPONENTS = {b"s": 9, b"ms": 6, b"us": 3, b"ns": 0}
"""Powers of ten from the units of times to [ns]."""


def exact_times(table: pa.Table, clock: pa.ChunkedArray) -> pa.Table:
    """Return a table with the clock in integer [ns] in the place of its only column of times as doubles."""
    units = [(field.metadata or {}).get(UNIT) for field in table.schema]
    times = [k for k, unit in enumerate(units) if unit in EXPONENTS]
    field = table.schema.field(times[0]) if len(times) == 1 else None
    if field is None or not pa.types.is_floating(field.type) or clock.null_count:
        return table
    exact = decimals(clock.to_numpy(), EXPONENTS[field.metadata[UNIT]])
    return table.set_column(times[0], field.with_type(exact.type), exact)


def decimals(ns: IntArray, exponent: int) -> pa.Array:
    """Return times in integer [ns], shape (n,), as exact decimals of a unit, powers of ten above it."""
    words: Bytes = np.column_stack([ns, ns >> 63]).astype("<i8").view(np.uint8)  # 128 bits each
    kind = pa.decimal128(19, exponent)
    return pa.Array.from_buffers(kind, len(ns), [None, pa.py_buffer(np.ascontiguousarray(words))])
