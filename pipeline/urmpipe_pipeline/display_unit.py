"""The units in which people like to see a quantity, as far as they are a multiple of its own."""

from __future__ import annotations

import math

FACTORS = {
    ("rad", "deg"): 180.0 / math.pi,
    ("rad/s", "deg/s"): 180.0 / math.pi,
    ("rad/s2", "deg/s2"): 180.0 / math.pi,
    ("rad/s", "rpm"): 30.0 / math.pi,
    ("m", "mm"): 1e3,
    ("m/s", "mm/s"): 1e3,
    ("m/s2", "mm/s2"): 1e3,
    ("s", "ms"): 1e3,
    ("A", "mA"): 1e3,
    ("V", "mV"): 1e3,
}
"""How many of the second one of the first is."""


def display_unit(unit: str, wanted: str) -> tuple[str, float]:
    """Return the unit to show a quantity in, and how many of it one of its own is.

    Args:
        unit: Its own unit.
        wanted: Its display unit; empty for none. One that is not known is not shown: the own one is.
    """
    factor = FACTORS.get((unit, wanted))
    return (unit, 1.0) if factor is None else (wanted, factor)
