"""Text clocks by the column: all cells of one shape are read at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.arrays import IntArray
from urmpipe_pipeline.sources.cells.cell import is_missing
from urmpipe_pipeline.sources.cells.text_cells import Bytes, TextCells
from urmpipe_pipeline.sources.cells.text_clock import FORMS, Form, Parts
from urmpipe_pipeline.sources.tables.numbers import NO_TIME, UNREADABLE


def read_cells(cells: TextCells, form: Form) -> IntArray:
    """Return the times of cells in [ns], shape (n,): NO_TIME for an empty one, UNREADABLE for no time."""
    times = np.where(np.diff(cells.starts) == 0, NO_TIME, UNREADABLE)
    for rows, block in cells.blocks():
        for same in _shapes(block):
            times[rows[same]] = _read_shape(block[same], form)
    return times


def known_forms(texts: Sequence[str]) -> tuple[Form, ...]:
    """Return the forms in which at least half of the cells with content are times, the usual ones first."""
    cells = TextCells.of([text for text in texts if not is_missing(text)])
    if not len(cells):
        return ()
    counts = [np.count_nonzero(read_cells(cells, form) != UNREADABLE) for form in FORMS]
    return tuple(form for form, count in zip(FORMS, counts, strict=True) if 2 * count >= len(cells))


def _shapes(block: Bytes) -> Iterator[IntArray | slice]:
    """Yield where cells of one length have the same signs but for their digits."""
    shapes = np.where(block - np.uint8(ord("0")) < 10, np.uint8(ord("0")), block)
    keys = shapes.view(f"S{block.shape[1]}").ravel()
    others = np.flatnonzero(keys != keys[0])
    if not len(others):
        yield slice(None)
        return
    yield np.flatnonzero(keys == keys[0])
    others = others[np.argsort(keys[others], kind="stable")]
    ordered = keys[others]
    yield from np.split(others, np.flatnonzero(ordered[1:] != ordered[:-1]) + 1)


def _read_shape(cells: Bytes, form: Form) -> IntArray | int:
    """Return the times of cells of one shape."""
    text = cells[0].tobytes().decode("latin-1")
    match = form.pattern.match(text)
    if match is None:
        return NO_TIME if is_missing(text.strip()) else UNREADABLE
    times, valid = form.nanoseconds(Parts(match, cells))
    return np.where(valid, times, UNREADABLE)
