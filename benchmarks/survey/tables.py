"""The tables of a survey, in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from survey.house import DOCUMENTED, Area, House
from survey.imports import ALLOWED
from survey.sizes import MANY_ARGUMENTS, Spread
from survey.source import AREAS, PACKAGES


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table."""
    return [_row(heads), "|" + "---|" * len(heads), *(_row(row) for row in rows)]


def summary(house: House) -> list[str]:
    """Return the table that CONTRIBUTING shows: what is held, in figures that few commits change."""
    heads = (
        "area",
        "file: median, largest, to the next ten",
        "function: median, largest",
        "docstrings",
        "units and shapes",
        "annotations",
    )
    rows = [
        (
            area.name,
            f"{_next_ten(area.files.median)}, {_next_ten(area.files.largest)}",
            f"{area.functions.median:g}, {area.functions.largest}",
            _documented(area) if area.name in DOCUMENTED else "-",
            _with_units(area) if area.name in PACKAGES else "-",
            _annotated(area),
        )
        for area in house.areas
    ]
    excused = ", ".join(f"{what} {len(judged.excused)}" for what, judged in house.judged().items())
    return [
        *table(heads, rows),
        "",
        f"Over a bound, with a reason in `benchmarks/survey/reasons.toml`: {excused}.",
    ]


def details(house: House) -> list[str]:
    """Return the table of all figures, those too that nothing is asked of."""
    heads = (
        "area",
        "files: count, median, largest",
        "functions: count, median, largest",
        "public",
        "docstrings",
        "arrays",
        "units and shapes",
        "annotations",
    )
    rows = [
        (
            area.name,
            _spread(area.files),
            _spread(area.functions),
            area.documented.public,
            _documented(area),
            area.arrays.passing,
            _with_units(area),
            _annotated(area),
        )
        for area in house.areas
    ]
    return table(heads, rows)


def full(house: House) -> list[str]:
    """Return all tables and lists."""
    return [
        "# The house: what its own code is like",
        "",
        "Sizes in lines, of a function from `def` to its last one. Docstrings: the share of what is public;",
        "units and shapes: of the arrays that what is public takes, gives or holds, each by itself. The same",
        "tree gives the same figures.",
        "",
        *details(house),
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


def _next_ten(lines: float) -> int:
    return 10 * math.ceil(lines / 10)


def _spread(spread: Spread) -> str:
    return f"{spread.count}, {spread.median:g}, {spread.largest}"


def _documented(area: Area) -> str:
    return _share(area.documented.public, len(area.documented.bare))


def _with_units(area: Area) -> str:
    return _share(area.arrays.passing, len(area.arrays.incomplete))


def _annotated(area: Area) -> str:
    return _share(area.functions.count, len(area.unannotated))


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
    return [f"{what}: {reason}" for one in house.judged().values() for what, reason in one.excused]


def _listed(title: str, lines: Sequence[str]) -> list[str]:
    """Return a list below its title, or nothing."""
    return [f"## {title}", "", *(f"- {line}" for line in lines), ""] if lines else []
