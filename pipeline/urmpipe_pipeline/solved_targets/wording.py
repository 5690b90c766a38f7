"""Words that messages about solved targets share: stretches of rows, angles, lengths and rates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from urmpipe_models.arrays import IntArray
from urmpipe_pipeline.text import SHOWN

NAMED = 6
"""Rows or stretches of rows that are named; the others are counted."""


def rows_text(rows: Sequence[int] | IntArray) -> str:
    """Return rows, shape (n,), for a sentence: "row 3", "rows 3, 7-9 and 40 more"."""
    rows = np.asarray(rows)
    first = np.flatnonzero(np.diff(rows, prepend=rows[0] - 2) != 1)
    last = np.append(first[1:], len(rows)) - 1
    parts = [
        str(rows[a]) if a == b else f"{rows[a]}-{rows[b]}"
        for a, b in zip(first[:NAMED], last[:NAMED], strict=True)
    ]
    more = len(rows) - 1 - last[:NAMED][-1]
    said = ", ".join(parts) + (f" and {more} more" if more else "")
    return f"row{'' if len(rows) == 1 else 's'} {said}"


def in_words(value: float, unit: str) -> str:
    """Return an angle, a length or a rate of one in [rad] or [m] with the unit that people read."""
    base, slash, per = unit.partition("/")
    shown, factor = SHOWN[base]
    return f"{value * factor:.4g} {shown}{slash}{per}"
