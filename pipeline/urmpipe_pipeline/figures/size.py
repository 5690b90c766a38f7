"""How large a figure is on paper: the width of a column or of a page, the size of its text."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from numbers import Real

from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_models.measure_units import WRITTEN, quantity_to_si

WIDTHS = {"column": 0.088, "page": 0.180}
"""Widths by name in [m], as most journals have them."""

PAPER_UNITS = {**WRITTEN["m"], "in": Decimal("0.0254")}
"""Units of a width, and how many m each is."""

NARROWEST, WIDEST = 0.04, 1.0
"""Ends of a width in [m]: less has no room for axes."""

SMALLEST, LARGEST = 4.0, 32.0
"""Ends of a font in [pt]."""

FINEST, COARSEST = 50, 1200
"""Dots an inch of a PNG."""


@dataclass(frozen=True, slots=True)
class Size:
    """The size of a figure.

    Attributes:
        width: In [m].
        font: In [pt].
    """

    width: float
    font: float


def size_of(width: str | float, font: float, prefix: str = "") -> Size:
    """Return the size of a figure.

    Args:
        width: column, page, a length with its unit such as "85mm", or a number in [m].
        font: Size of the text in [pt].
        prefix: What the names of the parameters begin with, for messages.

    Raises:
        OptionError: With all that is out of range.
    """
    length = (
        WIDTHS.get(width) or quantity_to_si(width, PAPER_UNITS) if isinstance(width, str) else _number(width)
    )
    wrong = []
    if not NARROWEST <= length <= WIDEST:
        allowed = "column, page, or 40 mm to 1 m, such as 85mm or 3.5in"
        wrong.append(Finding(parameter=f"{prefix}width", found=format_value(width), allowed=allowed))
    if not SMALLEST <= _number(font) <= LARGEST:
        allowed = f"{SMALLEST:g} to {LARGEST:g}, in pt"
        wrong.append(Finding(parameter=f"{prefix}font", found=format_value(font), allowed=allowed))
    if wrong:
        raise OptionError(*wrong)
    return Size(length, float(font))


def _number(value: object) -> float:
    """Return a number; NaN of anything else."""
    return float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
