"""Arrays of NumPy as columns of an Arrow table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

_PLAIN: Mapping[str, np.dtype[Any]] = {
    "b": np.dtype(np.uint8),
    "f2": np.dtype(np.float32),
    "f16": np.dtype(np.float64),
}
"""What holds values of types that Arrow has none for, or cannot write as text."""


def column(values: npt.NDArray[Any]) -> pa.Array:
    """Return values in any unit, shape (n,), as a column of their type."""
    kind = values.dtype
    if kind.kind in "mM":
        return pa.array(values)
    wanted = _PLAIN.get(kind.kind, _PLAIN.get(kind.str[1:], kind.newbyteorder("=")))
    values = np.ascontiguousarray(values, dtype=wanted)
    buffers = [None, pa.py_buffer(values)]  # pyarrow.array imports pandas, which takes a second
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), buffers)
