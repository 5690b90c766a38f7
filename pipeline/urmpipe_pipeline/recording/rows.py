"""An array that stands in a recording and is read when it is used: whole, or the rows of a slice."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray


class Rows(NDArrayOperatorsMixin):
    """An array in a file, in place of an array: a slice of its rows is read alone, all else reads it whole.

    Read whole it stays in memory. NumPy's functions and operators take it as they take an array, and what an
    array has besides (`T`, `mean`, ...) it has, too.

    Attributes:
        shape: Of the array, at least one dimension.
        dtype: Of its values.
    """

    def __init__(
        self, read: Callable[[int, int], NDArray[Any]], shape: tuple[int, ...], dtype: np.dtype[Any]
    ) -> None:
        """Stand for an array; `read(first, end)` returns the rows from one up to another."""
        self._read = read
        self._whole: NDArray[Any] | None = None
        self.shape = shape
        self.dtype = dtype

    @property
    def ndim(self) -> int:
        """How many dimensions it has."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """How many values it has."""
        return int(np.prod(self.shape))

    @property
    def whole(self) -> NDArray[Any]:
        """The array in its own units, shape (n, ...), which stays in memory."""
        if self._whole is None:
            self._whole = self._read(0, len(self))
        return self._whole

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> Any:
        first, *others = key if isinstance(key, tuple) and key else (key,)
        if self._whole is not None or not isinstance(first, (slice, int, np.integer)):
            return self.whole[key]
        if not isinstance(first, slice):
            row = range(len(self))[first]
            return self._read(row, row + 1)[(0, *others)]
        chosen = range(len(self))[first]
        low, high = (min(chosen), max(chosen) + 1) if chosen else (0, 0)
        return self._read(low, high)[(slice(None, None, first.step), *others)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        whole = self.whole if dtype is None else self.whole.astype(dtype, copy=False)
        return whole.copy() if copy else whole

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        arrays = (one.whole if isinstance(one, Rows) else one for one in inputs)
        return getattr(ufunc, method)(*arrays, **options)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.whole, name)

    def __repr__(self) -> str:
        return f"Rows of shape {self.shape}, {self.dtype}"
