"""Units of measurement that people read and write, and how many of one another is."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import Decimal, DecimalException

from urmpipe_models.errors import OptionError, shown

DEGREE = Decimal("0.01745329251994329576923690768488612713443")
"""pi / 180."""

MEASURES: dict[str, dict[str, Decimal]] = {
    "m": {"m": Decimal(1), "mm": Decimal("1e-3"), "um": Decimal("1e-6")},
    "m/s": {"m/s": Decimal(1), "mm/s": Decimal("1e-3")},
    "m/s2": {"m/s2": Decimal(1), "mm/s2": Decimal("1e-3")},
    "rad": {"rad": Decimal(1), "mrad": Decimal("1e-3"), "deg": DEGREE},
    "rad/s": {"rad/s": Decimal(1), "deg/s": DEGREE, "rpm": 6 * DEGREE},
    "rad/s2": {"rad/s2": Decimal(1), "deg/s2": DEGREE},
    "s": {"s": Decimal(1), "ms": Decimal("1e-3"), "us": Decimal("1e-6")},
    "A": {"A": Decimal(1), "mA": Decimal("1e-3")},
    "V": {"V": Decimal(1), "mV": Decimal("1e-3")},
}
"""What is measured, named by its SI unit: its units, and how many SI units each is."""


TIMES = {"": Decimal(1), **MEASURES["s"]}
LENGTHS = {"": Decimal(1), "cm": Decimal("1e-2"), **MEASURES["m"]}
ANGLES = {"": Decimal(1), **MEASURES["rad"]}
"""Units that a value may have behind it, and how many SI units each is; a value without one is in SI."""


def quantity(text: str, units: Mapping[str, Decimal]) -> float:
    """Return a number with one of the units behind it in SI, rounded once; NaN if it is none."""
    match = re.fullmatch(r"(.*?)\s*([a-z]*)", text.strip())
    try:
        return float(Decimal(match[1]) * units[match[2]]) if match else math.nan
    except (ValueError, KeyError, DecimalException):
        return math.nan


def units_of(si: str) -> dict[str, Decimal]:
    """Return the units of what an SI unit measures, and how many of that each is; none of an unknown one."""
    return MEASURES.get(si, {})


def factor(unit: str, to: str) -> float:
    """Return how many of one unit another is, rounded once: 1000 from m to mm.

    Args:
        unit: The unit of a value.
        to: The unit that it is wanted in.

    Raises:
        OptionError: If one is unknown, or they measure different things.
    """
    for units in MEASURES.values():
        if unit in units and to in units:
            return float(units[unit] / units[to])
    known = next((units for units in MEASURES.values() if unit in units), None)
    if known is None:
        every = ", ".join(one for units in MEASURES.values() for one in units)
        raise OptionError(f"unit: found {shown(unit)}, allowed: {every}")
    raise OptionError(f"unit: found {shown(to)} for {shown(unit)}, allowed: {', '.join(known)}")
