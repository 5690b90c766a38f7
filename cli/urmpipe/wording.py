"""How quantities stand in the terminal: in mm and deg, with as many digits as the report gives them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from urmpipe_pipeline.comparison import Statistics
from urmpipe_pipeline.report import text

if TYPE_CHECKING:
    from rich.text import Text

UNITS = {"m": "mm", "rad": "deg"}
"""What people read, by the unit of the statistics."""


def judged(verdict: str | None) -> Text:
    """Return a verdict as a word, with a colour on a terminal."""
    from rich.text import Text

    style = {"pass": "bold green", "fail": "bold red"}
    return Text(text.NOTHING) if verdict is None else Text(verdict.upper(), style=style[verdict])


def figure(value: float | None, unit: str, against: float | None = None) -> str:
    """Return a length in [m] as [mm], or an angle in [rad] as [deg].

    Args:
        value: In the unit.
        unit: m or rad.
        against: What it is held against: as many digits are shown as tell the two apart.
    """
    if unit == "m":
        return text.millimetres(value, against)
    # By the rules for lengths, which are shown in thousandths.
    value, against = (None if one is None else math.degrees(one) / 1e3 for one in (value, against))
    return text.millimetres(value, against)


def label(one: Statistics) -> str:
    """Return what people call a quantity."""
    symbol = text.SYMBOLS.get(one.quantity) if one.kind in ("axis", "norm") else None
    return symbol or one.quantity


def limit(value: float | None, unit: str) -> str:
    """Return a tolerance as people read it, with no more digits than it has."""
    return text.limit(value if unit == "m" or value is None else math.degrees(value) / 1e3)
