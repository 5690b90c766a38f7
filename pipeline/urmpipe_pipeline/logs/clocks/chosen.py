"""The columns that were chosen as the time of a table, and how they make one clock."""

from __future__ import annotations

from typing import NamedTuple

from urmpipe_models.errors import Hint
from urmpipe_pipeline.logs.cells.text_clock import Form
from urmpipe_pipeline.logs.columns.columns import Column

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Powers of ten from a unit to [ns]."""

OTHER_TIME = (
    Hint("time", None, "names the time column"),
    Hint("time", "none", "leaves the time column out"),
)
"""What to give where a column is not the time, or a wrong one."""

EVEN = (*OTHER_TIME, Hint("period", None, "sets the time between rows then"))
"""What to give where a time column is of no use."""


class Chosen(NamedTuple):
    """The columns of a clock.

    Attributes:
        columns: One column, or two that are added; none if there is no time.
        why: What tells that they are the time.
        rest: Of whole seconds and what goes on from them: the power of ten from the latter to [ns].
        forms: The form of each column where they are dates and times of day in digits alone.
        lasts: Whether each row has a duration, and the times are their sum.
        passed_over: Times of the side that is not read.
    """

    columns: tuple[Column, ...]
    why: str
    rest: int | None = None
    forms: tuple[Form, ...] = ()
    lasts: bool = False
    passed_over: tuple[Column, ...] = ()
