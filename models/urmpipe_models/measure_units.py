"""Units of measurement in texts: their factors, quantities with units, and conversions."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import Decimal

from urmpipe_models.errors import Finding, OptionError, format_value

DEGREE = Decimal("0.01745329251994329576923690768488612713443")  # pi / 180

MEASURES: dict[str, dict[str, Decimal]] = {  # by SI unit: the units of the same quantity, as multiples of it
    "m": {"m": Decimal(1), "mm": Decimal("1e-3"), "um": Decimal("1e-6")},
    "m/s": {"m/s": Decimal(1), "mm/s": Decimal("1e-3")},
    "m/s2": {"m/s2": Decimal(1), "mm/s2": Decimal("1e-3")},
    "m/s3": {"m/s3": Decimal(1), "mm/s3": Decimal("1e-3")},
    "rad": {"rad": Decimal(1), "mrad": Decimal("1e-3"), "deg": DEGREE},
    "rad/s": {"rad/s": Decimal(1), "deg/s": DEGREE, "rpm": 6 * DEGREE},
    "rad/s2": {"rad/s2": Decimal(1), "deg/s2": DEGREE},
    "rad/s3": {"rad/s3": Decimal(1), "deg/s3": DEGREE},
    "s": {"s": Decimal(1), "ms": Decimal("1e-3"), "us": Decimal("1e-6")},
    "A": {"A": Decimal(1), "mA": Decimal("1e-3")},
    "V": {"V": Decimal(1), "mV": Decimal("1e-3")},
}
WRITTEN: dict[str, dict[str, Decimal]] = {  # the units accepted in a text; "" is SI, or pt
    **{si: {"": Decimal(1), **units} for si, units in MEASURES.items()},
    "m": {"": Decimal(1), **MEASURES["m"], "cm": Decimal("1e-2")},
    "N": {"": Decimal(1), "N": Decimal(1)},
    "1": {"": Decimal(1), "%": Decimal("1e-2")},
    "pt": {"": Decimal(1), "pt": Decimal(1)},
}
# Other spellings of units: m/s^2, m/s², 0.5°, 20µm (with the sign for micro, or the Greek letter).
SPELLED = str.maketrans({"^": "", "²": "2", "³": "3", "°": "deg", "µ": "u", "μ": "u"})

# A number in decimal digits and its unit; Decimal limits the length of an exponent.
QUANTITY = re.compile(r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?)\s*([^\s0-9.]\S*)?")

NAMES = {  # by SI unit: the quantity in a message, with an example
    "m": "a length in m, such as 0.0004 or 0.4mm",
    "m/s": "a speed in m/s, such as 0.25 or 250mm/s",
    "m/s2": "an acceleration in m/s2, such as 0.5 or 500mm/s2",
    "m/s3": "a jerk in m/s3, such as 60 or 60m/s3",
    "rad": "an angle in rad, such as 1.57 or 90deg",
    "rad/s": "a speed in rad/s, such as 30deg/s",
    "rad/s2": "an acceleration in rad/s2, such as 100deg/s2",
    "rad/s3": "a jerk in rad/s3, such as 1000deg/s3",
    "s": "a time in s, such as 0.005 or 5ms",
    "A": "a current in A, such as 20mA",
    "V": "a voltage in V, such as 500mV",
    "N": "a force in N, such as 50N",
    "1": "a share, such as 5%",
    "pt": "a size in pt, such as 8pt",
}
USUAL_UNITS = {"m": "mm", "rad": "deg", "1": "%"}  # usual units of deviations, by SI unit


def quantity_to_si(text: str, units: Mapping[str, Decimal]) -> float:
    """Return the value in SI of a number with its unit, rounded once, or NaN for any other text."""
    parts = _parts(text)
    return float(parts[0] * units[parts[1]]) if parts and parts[1] in units else math.nan


def read_quantity(text: str, si: str, *, positive: bool = True, deviation: bool = False) -> float:
    """Return a quantity in SI from a number and its unit; a number alone is in SI.

    Args:
        text: The number with its unit.
        si: SI unit of the quantity: a key of `NAMES`.
        positive: Whether it must be above 0.
        deviation: Whether it is the limit of a deviation: see `readings`.

    Raises:
        OptionError: If it is not such a quantity, or a deviation that needs its unit.
    """
    value = quantity_to_si(text, WRITTEN[si])
    if not (0.0 < value < math.inf if positive else math.isfinite(value)):
        allowed = f"a positive {NAMES[si].partition(' ')[2]}" if positive else NAMES[si]
        raise OptionError(Finding(found=format_value(text), allowed=allowed))
    if deviation and (quantities := readings(text, si)):
        raise OptionError(Finding(found=text.strip(), allowed=f"a unit: {' or '.join(quantities)}"))
    return value


def readings(text: str, si: str) -> tuple[str, ...]:
    """Return the two readings of an ambiguous limit of a deviation without a unit: ("3.5mm", "3.5m").

    Empty if the unit is stated, or the number is below 0.02 m, up to 0.2 rad or a fraction up to 1. Larger
    deviations are unlikely for an arm, so 3.5 may be a number of mm.
    """
    parts = _parts(text)
    if parts is None or parts[1] or si not in USUAL_UNITS:
        return ()
    number = parts[0]
    is_clear = number < Decimal("0.02") if si == "m" else number <= (Decimal("0.2") if si == "rad" else 1)
    stripped = text.strip()
    in_si = f"{(100 * number).normalize():f}%" if si == "1" else f"{stripped}{si}"
    return () if is_clear else (f"{stripped}{USUAL_UNITS[si]}", in_si)


def _parts(text: str) -> tuple[Decimal, str] | None:
    """Return a number and its unit as in `WRITTEN`, or None if there is no number."""
    match = QUANTITY.fullmatch(text.strip())
    return match and (Decimal(match[1]), (match[2] or "").translate(SPELLED))


def compatible_units(si: str) -> dict[str, Decimal]:
    """Return the units of the quantity of an SI unit, as multiples of it; empty for an unknown unit."""
    return MEASURES.get(si, {})


def conversion_factor(unit: str, to: str) -> float:
    """Return the factor from one unit to another, rounded once: 1000 from m to mm.

    Args:
        unit: The unit of a value.
        to: The unit to convert to.

    Raises:
        OptionError: If a unit is unknown, or they are units of different quantities.
    """
    for units in MEASURES.values():
        if unit in units and to in units:
            return float(units[unit] / units[to])
    known = next((units for units in MEASURES.values() if unit in units), None)
    if known is None:
        allowed = ", ".join(name for units in MEASURES.values() for name in units)
        raise OptionError(f"unit: found {format_value(unit)}, allowed: {allowed}")
    raise OptionError(f"unit: found {format_value(to)} for {format_value(unit)}, allowed: {', '.join(known)}")
