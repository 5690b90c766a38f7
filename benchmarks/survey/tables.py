"""The tables of a survey, in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from survey.house import Area, House
from survey.imports import ALLOWED
from survey.sizes import MANY_ARGUMENTS
from survey.source import AREAS


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table."""
    return [_row(heads), "|" + "---|" * len(heads), *(_row(row) for row in rows)]


def summary(house: House) -> list[str]:
    """Return the table that CONTRIBUTING shows: what most commits leave as it is."""
    heads = (
        "area",
        "file: median, largest",
        "function: median, largest",
        "docstrings",
        "units and shapes",
        "annotations",
    )
    excused = ", ".join(
        f"{len(judged.excused)} {what}"
        for what, judged in (
            ("files", house.files),
            ("functions", house.functions),
            ("duplicates", house.duplicates),
        )
    )
    return [*table(heads, map(_area_row, house.areas)), "", f"Over a bound with a reason: {excused}."]


def full(house: House) -> list[str]:
    """Return all tables and lists."""
    return [
        "# The house: what its own code is like",
        "",
        "Sizes in lines, of a function from `def` to its last one. Docstrings: the share of what is public;",
        "units and shapes: of what is public and takes, gives or holds arrays. The same tree gives the same",
        "figures.",
        "",
        *summary(house),
        "",
        *table(("imports of modules in", *AREAS), _import_rows(house)),
        "",
        *_listed("Over a bound with a reason", _excused(house)),
        *_listed(f"More than {MANY_ARGUMENTS} arguments", house.many_arguments),
        *_listed("Deepest nesting", house.deepest),
        *(line for what, places in house.faults().items() for line in _listed(what.capitalize(), places)),
    ]


def _row(cells: Iterable[object]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"


def _area_row(area: Area) -> tuple[object, ...]:
    """Return the row of an area."""
    functions = area.functions.count
    return (
        area.name,
        f"{area.files.median:g}, {area.files.largest}",
        f"{area.functions.median:g}, {area.functions.largest}",
        _share(area.documented.public, len(area.documented.bare)),
        _share(area.arrays.passing, len(area.arrays.incomplete)),
        _share(functions, len(area.unannotated)),
    )


def _share(count: int, without: int) -> str:
    """Return a share in percent, rounded down: 100 % means all."""
    return f"{100 * (count - without) // count} %" if count else "-"


def _import_rows(house: House) -> list[Sequence[object]]:
    """Return how many modules of each area import from each other one; a dot where that is not allowed."""
    return [
        (area, *("." if _barred(area, other) else house.imports[area, other] for other in AREAS))
        for area in AREAS
    ]


def _barred(area: str, other: str) -> bool:
    return area == other or other not in ALLOWED.get(area, ALLOWED.keys())


def _excused(house: House) -> list[str]:
    judged = (house.files, house.functions, house.duplicates)
    return [f"{what}: {reason}" for one in judged for what, reason in one.excused]


def _listed(title: str, lines: Sequence[str]) -> list[str]:
    """Return a list below its title, or nothing."""
    return [f"## {title}", "", *(f"- {line}" for line in lines), ""] if lines else []
