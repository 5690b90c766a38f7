"""The cells of a column of text as bytes in one array, so that NumPy reads them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import IntArray

Bytes = NDArray[np.uint8]

BLOCK = 1 << 15
"""Cells read at once: their bytes stay in the cache."""

LONGEST_CELL = 64
"""No form of a clock has more signs."""


@dataclass(frozen=True, slots=True, eq=False)
class TextCells:
    """The cells of a column of text.

    Attributes:
        data: Their bytes, one after the other (ASCII, or signs that no clock has).
        starts: Where each begins, and where the last ends, shape (n + 1,).
    """

    data: Bytes
    starts: IntArray

    @classmethod
    def of(cls, texts: Iterable[str]) -> TextCells:
        """Return texts as cells."""
        encoded = [text.encode("ascii", "replace") for text in texts]
        starts = np.cumsum([0, *map(len, encoded)], dtype=np.int64)
        return cls(np.frombuffer(b"".join(encoded), dtype=np.uint8), starts)

    @classmethod
    def joined(cls, parts: Sequence[TextCells]) -> TextCells:
        """Return the cells of several parts of a column, one below the other."""
        lengths = np.concatenate([np.diff(part.starts) for part in parts])
        starts = np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(lengths)))
        return cls(np.concatenate([part.data[part.starts[0] : part.starts[-1]] for part in parts]), starts)

    def at(self, rows: IntArray | slice) -> TextCells:
        """Return the cells of some rows: by index, shape (k,), or as a slice from the first one on."""
        lengths = np.diff(self.starts)[rows]
        starts = np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(lengths)))
        place = np.repeat(self.starts[rows] - starts[:-1], lengths) + np.arange(starts[-1])
        return TextCells(self.data[place], starts)

    def __len__(self) -> int:
        return len(self.starts) - 1

    def text(self, row: int) -> str:
        """Return one cell."""
        return self.data[self.starts[row] : self.starts[row + 1]].tobytes().decode("latin-1")

    def blocks(self) -> Iterator[tuple[IntArray, Bytes]]:
        """Yield some cells of one length each time: their rows, and their bytes, shape (n, length).

        Empty cells, and those that are too long, are left out.
        """
        for first in range(0, len(self), BLOCK):
            starts = self.starts[first : first + BLOCK + 1]
            lengths = np.minimum(np.diff(starts), LONGEST_CELL)
            for length in np.flatnonzero(np.bincount(lengths)).tolist():
                if not 0 < length < LONGEST_CELL:
                    continue
                rows = np.flatnonzero(lengths == length)
                if len(rows) == len(lengths):
                    cells = self.data[starts[0] : starts[-1]].reshape(-1, length)
                else:
                    cells = self.data[starts[rows][:, np.newaxis] + np.arange(length)]
                yield rows + first, cells
