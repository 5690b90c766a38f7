"""How a cell is written for people: here, and nowhere else, digits and units are chosen."""

from __future__ import annotations

import math
from collections.abc import Iterable

from urmpipe_models.errors import format_hints
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.section import Advice, Cell, Judged, Place, Ref, Value

FINEST = 15
"""Digits of a share at most: more are not in it."""


def written(cell: Cell, *, unit: bool = False) -> str:
    """Return a cell as people read it.

    Args:
        cell: What is shown.
        unit: Whether its unit stands behind it; in a table it stands in the head.
    """
    match cell:
        case Value():
            return _number(cell, unit=unit)
        case Place():
            return f"({text.format_point(cell.position)})" + (" m" if unit else "")
        case Advice():
            said = "; ".join(filter(None, (cell.words, *format_hints(cell.hints))))
        case Judged():
            said = (cell.verdict or "").upper()
        case Ref():
            said = cell.title
        case _:
            said = cell or ""
    return said or text.NOTHING


def held(value: Value) -> str:
    """Return a value with its unit and what is allowed of it: "2.5010 mm of 3.5 mm allowed"."""
    allowed, by = allowed_words(value), "needed" if value.least else "allowed"
    return f"{written(value, unit=True)} of {allowed} {by}" if allowed else written(value, unit=True)


def allowed_words(value: Value) -> str:
    """Return the limit of a value with its unit: "3.5 mm"; empty if there is none."""
    return "" if value.limit is None else written(Value(value.limit, value.unit, given=True), unit=True)


def unit_of(cells: Iterable[Cell]) -> str:
    """Return the unit that all values of a column are shown in; empty where they differ or have none."""
    units = _units(cells)
    places = any(isinstance(cell, Place) for cell in cells)
    if places or len(units) != 1:
        return "m" if places and not units else ""
    return _shown_unit(units.pop())


def units_differ(cells: Iterable[Cell]) -> bool:
    """Return whether values of a column are in different units: then each cell shows its own."""
    return len(_units(cells)) > 1


def _units(cells: Iterable[Cell]) -> set[str]:
    return {cell.unit for cell in cells if isinstance(cell, Value) and cell.number is not None}


def _shown_unit(si: str) -> str:
    """Return the unit that values in an SI unit are shown in; none of shares, ratios and counts."""
    return "" if si in ("%", "1") else text.SHOWN.get(si, (si, 1.0))[0]


def _number(value: Value, *, unit: bool) -> str:
    if value.number is None:
        return text.NOTHING
    said = _digits(value, float(value.number))
    sign = "+" if value.signed and value.number > 0 else ""
    shown = _shown_unit(value.unit)
    return f"{sign}{said} {shown}" if unit and shown and said != text.NOTHING else f"{sign}{said}"


def _digits(value: Value, number: float) -> str:
    if value.unit in text.SHOWN:
        exact = value.given and math.isfinite(number)
        return (
            text.format_limit(number, value.unit)
            if exact
            else text.format_number(number, value.unit, value.limit)
        )
    if value.unit == "%":
        return f"{100.0 * number:.6g} %" if value.given else _percent(number, value.limit)
    if value.unit == "1":
        return f"{round(number, 3) + 0.0:.3f}"  # + 0.0: no -0.000
    if value.unit == "s":
        return text.format_seconds(number)
    if isinstance(value.number, int):
        return str(value.number)
    return f"{number:.6g}" if value.given else text.format_significant(number)


def _said(percent: str) -> float:
    return float(percent.removeprefix("under ").removesuffix("%"))


def _percent(share: float, against: float | None) -> str:
    """Return a share in [%], with as many digits as tell it from what it is held against."""
    shown = text.format_percent(share)
    if against is None or against == share or _said(shown) != _said(text.format_percent(against)):
        return shown
    digits = next((n for n in range(3, FINEST) if f"{share:.{n}g}" != f"{against:.{n}g}"), FINEST)
    return f"{100.0 * share:.{digits}g} %"
