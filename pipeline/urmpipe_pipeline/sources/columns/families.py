"""Families of columns: those that share a name but for a number or an axis."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.vocabulary import Patterns, vocabulary

T = TypeVar("T", Column, "Family")

_AXES = {name: k for names in ("xyzw", "abc", ("roll", "pitch", "yaw")) for k, name in enumerate(names)}

LONGEST = 200
"""Letters of a name that may be one of a family: no recorder writes longer ones."""


@dataclass(slots=True)
class Family:
    """Columns whose names differ only by a number.

    Attributes:
        rank: Index of the pattern that found them: the lower, the surer.
        name: Their name with # in the number's place.
        order: How often they are differentiated in time: 0 for positions.
        columns: The columns by their number.
        twins: Columns that share a number with one of them.
    """

    rank: int
    name: str
    order: int = 0
    columns: dict[int, Column] = field(default_factory=dict)
    twins: list[Column] = field(default_factory=list)

    def ordered(self) -> tuple[Column, ...]:
        """Return the columns in the order of their numbers."""
        return tuple(self.columns[n] for n in sorted(self.columns))

    @property
    def words(self) -> frozenset[str]:
        """The words of their name; the d of a derivative, which also stands for desired, is none."""
        words = self.name.replace("#", "_").split("_")
        return frozenset(words[1:] if self.order and words[0] == "d" else words)

    @property
    def commanded(self) -> bool:
        """Whether they hold what was asked for, not what was measured."""
        return bool(self.words & vocabulary().commanded)


def families(columns: Iterable[Column], patterns: Patterns, order: int) -> list[Family]:
    """Return the families of columns that match, the surest first; measured ones where both kinds are there.

    Args:
        columns: Candidates.
        patterns: Patterns with a group n (number), axis (x, y, z, w, roll, ...), k (entry of a vector), or
            i and j (row and column of a matrix).
        order: Derivative in time that their units may not contradict: 0 for positions.
    """
    found: dict[tuple[int, str, str | None], Family] = {}
    for column in columns:
        match = _first_match(column, patterns)
        if match is None or (column.unit is not None and column.unit.order != order):
            continue
        rank, place = match
        number, start, end = _number(place)
        name = f"{column.plain[:start]}#{column.plain[end:]}"
        family = found.setdefault((rank, name, None), Family(rank, name, order))
        if number in family.columns:
            family.twins.append(column)
            if column.unit_text == family.columns[number].unit_text:
                continue
            family = found.setdefault((rank, name, column.unit_text), Family(rank, name, order))
        family.columns.setdefault(number, column)
    whole = [family for (*_, unit), family in found.items() if unit is None or len(family.columns) > 1]
    ranked = sorted(whole, key=lambda family: family.rank)
    return measured(ranked)


def measured(items: Sequence[T]) -> list[T]:
    """Return the items without those that hold commands, unless all do."""
    without = [item for item in items if not item.words & vocabulary().commanded]
    return without or list(items)


def _first_match(column: Column, patterns: Patterns) -> tuple[int, re.Match[str]] | None:
    if len(column.plain) > LONGEST or ("n" in patterns[0].groupindex and column.words & vocabulary().other):
        return None
    for rank, pattern in enumerate(patterns):
        match = pattern.search(column.plain)
        if match:
            return rank, match
    return None


def _number(match: re.Match[str]) -> tuple[int, int, int]:
    """Return the number that a match tells, and where it stands."""
    groups = match.groupdict()
    if "i" in groups:
        return 10 * int(groups["i"]) + int(groups["j"]), match.start("i"), match.end("j")
    group = next(name for name in ("n", "axis", "k") if name in groups)
    text = groups[group]
    number = _AXES[text] if group == "axis" else int(text or 0)
    return number, match.start(group), match.end(group)
