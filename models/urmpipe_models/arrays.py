"""The types of arrays, under one name each."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]
"""Counts, and times in [ns]."""
IndexArray: TypeAlias = NDArray[np.intp]
"""Rows of another array."""
TextArray: TypeAlias = NDArray[np.object_]
