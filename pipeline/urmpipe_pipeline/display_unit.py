"""The units in which people like to see a quantity, as far as they are a multiple of its own."""

from __future__ import annotations

from urmpipe_models.measure_units import factor, units_of


def display_unit(unit: str, wanted: str) -> tuple[str, float]:
    """Return the unit to show a quantity in, and how many of it one of its own is.

    Args:
        unit: Its own unit, one of SI.
        wanted: Its display unit; empty for none. One that is not known, or measures something else (an FMU
            may say anything), is not shown: the own one is.
    """
    return (wanted, factor(unit, wanted)) if wanted in units_of(unit) else (unit, 1.0)
