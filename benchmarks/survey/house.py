"""All that is measured of a tree, and which bounds it holds."""

from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pairs import Bound

from survey.annotations import unannotated
from survey.arrays import Aliases
from survey.docstrings import ArraysDocumented, Documented, arrays_documented, documented
from survey.duplicates import LEAST, duplicates
from survey.imports import between_areas, folder_rings, module_rings, wrong_ways
from survey.reasons import Judged, judge, read_reasons
from survey.sizes import (
    FILE_MEDIAN,
    FILE_MOST,
    FUNCTION_MEDIAN,
    FUNCTION_MOST,
    Spread,
    deepest,
    file_sizes,
    function_sizes,
    long_files,
    long_functions,
    many_arguments,
)
from survey.source import AREAS, PACKAGES, Source, read_sources

DOCUMENTED = (*PACKAGES, "benchmarks", "docs")
"""The areas that are held to docstrings. A test says what it holds by its name."""

REASONS = Path(__file__).with_name("reasons.toml")


@dataclass(frozen=True, slots=True)
class Area:
    """What is measured of one area."""

    name: str
    files: Spread
    functions: Spread
    documented: Documented
    arrays: ArraysDocumented
    unannotated: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class House:
    """What is measured of a tree.

    Attributes:
        areas: Those that have files.
        files: The long ones.
        functions: Likewise.
        duplicates: Pairs of places.
        imports: How many modules of one area import from another.
        wrong_ways: Imports against the direction that is allowed.
        module_rings: Modules that import each other.
        folder_rings: Folders likewise.
        many_arguments: Functions that take many, most first.
        deepest: Functions that nest deepest.
    """

    areas: tuple[Area, ...]
    files: Judged
    functions: Judged
    duplicates: Judged
    imports: Counter[tuple[str, str]]
    wrong_ways: tuple[str, ...]
    module_rings: tuple[str, ...]
    folder_rings: tuple[str, ...]
    many_arguments: tuple[str, ...]
    deepest: tuple[str, ...]

    def judged(self) -> dict[str, Judged]:
        """Return what reasons may excuse, by kind."""
        return {"files": self.files, "functions": self.functions, "duplicates": self.duplicates}

    def faults(self) -> dict[str, tuple[str, ...]]:
        """Return what is over each bound, as an editor finds it."""
        held = [area for area in self.areas if area.name in DOCUMENTED]
        return {
            f"files over {FILE_MOST} lines without a reason": self.files.faults,
            f"functions over {FUNCTION_MOST} lines without a reason": self.functions.faults,
            "medians over their bounds": tuple(_high_medians(self.areas)),
            "public definitions without a docstring": tuple(p for area in held for p in area.documented.bare),
            "arrays of which the docstring tells no unit or no shape": tuple(
                place for area in held if area.name in PACKAGES for place in area.arrays.incomplete
            ),
            "functions without all annotations": tuple(p for area in self.areas for p in area.unannotated),
            "imports the wrong way": self.wrong_ways,
            "rings of modules": self.module_rings,
            "rings of folders": self.folder_rings,
            f"duplicates of {LEAST} lines and more without a reason": self.duplicates.faults,
            "reasons for nothing": tuple(key for one in self.judged().values() for key in one.stale),
        }

    def bounds(self) -> list[Bound]:
        """Return what is held: none of each fault."""
        return [Bound(what, len(places), most=0) for what, places in self.faults().items()]


def survey(root: Path, reasons: Path = REASONS) -> House:
    """Measure the tree below a root."""
    with _uncollected():
        return measured(read_sources(root), read_reasons(reasons))


def measured(sources: Sequence[Source], reasons: dict[str, dict[str, str]]) -> House:
    """Measure some files."""
    aliases = Aliases(sources)
    by_area = {name: [source for source in sources if source.area == name] for name in AREAS}
    files = {source.path: f"{source.path}: {len(source.lines)} lines" for source in long_files(sources)}
    functions = {made.key: f"{made.place}: {made.size} lines" for made in long_functions(sources)}
    pairs: dict[str, str] = {}
    for pair in duplicates(sources):
        pairs[pair.key] = f"{pairs[pair.key]}, {pair}" if pair.key in pairs else str(pair)
    return House(
        tuple(_area(name, files, aliases) for name, files in by_area.items() if files),
        judge(files, reasons["files"]),
        judge(functions, reasons["functions"]),
        judge(pairs, reasons["duplicates"]),
        between_areas(sources),
        tuple(wrong_ways(sources)),
        tuple(" ~ ".join(ring) for ring in module_rings(sources)),
        tuple(folder_rings(sources)),
        tuple(many_arguments(sources)),
        tuple(deepest(sources)),
    )


@contextmanager
def _uncollected() -> Iterator[None]:
    """Keep Python from looking for garbage among a million nodes that stay: it takes longer than reading."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def _area(name: str, sources: Sequence[Source], aliases: Aliases) -> Area:
    return Area(
        name,
        file_sizes(sources),
        function_sizes(sources),
        documented(sources),
        arrays_documented(sources, aliases),
        tuple(made.place for made in unannotated(sources)),
    )


def _high_medians(areas: Sequence[Area]) -> Iterator[str]:
    """Yield the medians that are too high."""
    for area in areas:
        for what, spread, most in (
            ("file", area.files, FILE_MEDIAN),
            ("function", area.functions, FUNCTION_MEDIAN),
        ):
            if spread.median > most:
                yield f"{area.name}: the median {what} has {spread.median:g} lines, allowed: {most}"
