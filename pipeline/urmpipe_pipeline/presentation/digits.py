"""How a cell is written for people: here, and nowhere else, digits and units are chosen."""

from __future__ import annotations

from collections.abc import Iterable

from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.section import Cell, Judged, Place, Ref, Value


def written(cell: Cell, *, unit: bool = False) -> str:
    """Return a cell as people read it.

    Args:
        cell: What is shown.
        unit: Whether its unit stands behind it; in a table it stands in the head.
    """
    match cell:
        case None | "":
            return text.NOTHING
        case str():
            return cell
        case Ref():
            return cell.title
        case Judged():
            return text.NOTHING if cell.verdict is None else cell.verdict.upper()
        case Place():
            return f"({text.point(cell.position)})" + (" m" if unit else "")
        case Value():
            return _number(cell, unit=unit)


def unit_of(cells: Iterable[Cell]) -> str:
    """Return the unit that all values of a column are shown in; empty where they differ or have none."""
    units = {cell.unit for cell in cells if isinstance(cell, Value) and cell.number is not None}
    places = any(isinstance(cell, Place) for cell in cells)
    if places or len(units) != 1:
        return "m" if places and not units else ""
    return _shown_unit(units.pop())


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
        return text.number(number, value.unit, value.limit)
    if value.unit == "%":
        return text.percent(number)
    if value.unit == "s":
        return text.seconds(number)
    if isinstance(value.number, int):
        return str(value.number)
    return f"{number:.6g}"
