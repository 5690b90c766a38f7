"""Families of columns: those that share a name but for a number or an axis."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from urmpipe_pipeline.logs.columns.columns import Column, Kind, kind_of
from urmpipe_pipeline.logs.vocabulary import Patterns, vocabulary

_AXES = {name: k for names in ("xyzw", "abc", ("roll", "pitch", "yaw")) for k, name in enumerate(names)}

_BESIDE = re.compile(r"_?#_?")
_LETTER = re.compile(r"[^\W\d_]")
"""Without one, what is left of a name is no name: sensor_1 is no joint 1."""

LONGEST = 200
"""Letters of a name that may be one of a family: no recorder writes longer ones."""


@dataclass(slots=True)
class Family:
    """Columns whose names differ only by a number.

    Attributes:
        rank: Index of the pattern that found them: the lower, the surer.
        name: Their name with # in the number's place, without words for measured and commanded.
        kind: What these words say.
        known: Whether a pattern has their whole name, with these words; else only without them.
        columns: The columns by their number.
        twins: Columns that share a number with one of them.
    """

    rank: int
    name: str
    kind: Kind
    known: bool
    columns: dict[int, Column] = field(default_factory=dict)
    twins: list[Column] = field(default_factory=list)

    @property
    def is_measured(self) -> bool:
        """Whether a word for measured is in their names; that of a sensor may be of a force."""
        return all(column.marked.measured - {"sensor"} for column in self.columns.values())

    def shares_name(self, other: Family) -> bool:
        """Return whether the names are the same, with or without a sign beside the number."""
        one, two = (_BESIDE.sub("#", family.name) for family in (self, other))
        return one == two

    def ordered(self) -> tuple[Column, ...]:
        """Return the columns in the order of their numbers."""
        return tuple(self.columns[n] for n in sorted(self.columns))


def find_families(columns: Iterable[Column], patterns: Patterns, order: int) -> list[Family]:
    """Return the families of columns that match, the surest first.

    Args:
        columns: Candidates.
        patterns: Patterns with a group n (number), axis (x, y, z, w, roll, ...), k (entry of a vector), or
            i and j (row and column of a matrix).
        order: Derivative in time that their units may not contradict: 0 for positions.
    """
    found: dict[tuple[object, ...], Family] = {}
    for column in columns:
        matched = _match(column, patterns, order)
        if matched is None or (column.unit is not None and column.unit.order != order):
            continue
        number, identity = matched
        shape = tuple(tuple(vocabulary().marked.findall(word)) for word in column.plain.split("_"))
        family = found.setdefault((*identity, shape, None), Family(*identity))
        if number in family.columns:
            family.twins.append(column)
            if column.unit_text == family.columns[number].unit_text:
                continue
            family = found.setdefault((*identity, shape, column.unit_text), Family(*identity))
        family.columns.setdefault(number, column)
    whole = [family for (*_, unit), family in found.items() if unit is None or len(family.columns) > 1]
    return sorted(whole, key=lambda family: family.rank)


def prefer_measured(found: Sequence[Family]) -> list[Family]:
    """Return the families to read: of each quantity those measured, else plain; commands if all are."""
    best = [family for family in found if not any(_stands_for(other, family) for other in found)]
    return [family for family in best if family.kind != Kind.COMMANDED] or best


def _stands_for(other: Family, family: Family) -> bool:
    """Return whether another family is the same quantity, of a kind that is read first.

    One that is known only without its words has to have the same name.
    """
    same = other.shares_name(family) or (other.known and other.kind == Kind.MEASURED)
    return other.kind < family.kind and len(other.columns) == len(family.columns) and same


def drop_unknown(found: Sequence[Family], *, lone: bool) -> list[Family]:
    """Return the families that are known or measured, and the others that share a name with one of them.

    Args:
        found: The families.
        lone: Whether all count if none is known.
    """
    kept = [
        f for f in found if f.known or f.is_measured or any(o is not f and o.shares_name(f) for o in found)
    ]
    return kept or (list(found) if lone else [])


def _match(column: Column, patterns: Patterns, order: int) -> tuple[int, tuple[int, str, Kind, bool]] | None:
    """Return a column's number and its family: rank, name, kind, and whether it is known."""
    plain, bare, kind = column.plain, column.bare, column.kind
    if order and plain.startswith("d_"):  # the d of a derivative, which also stands for desired
        bare = f"d_{bare}"
        kind = kind_of(column.marked.measured, column.marked.commanded - {"d"})
    if len(plain) > LONGEST or ("n" in patterns[0].groupindex and column.words & vocabulary().other):
        return None
    known = _first(plain, patterns)
    found = (_first(bare, patterns) if _LETTER.search(bare) else None) or known
    if found is None:
        return None
    rank, match = found
    number, start, end = _number(match)
    name = f"{match.string[:start]}#{match.string[end:]}"
    return number, (min(rank, known[0]) if known else rank, name, kind, known is not None)


def _first(text: str, patterns: Patterns) -> tuple[int, re.Match[str]] | None:
    for rank, pattern in enumerate(patterns):
        match = pattern.search(text)
        if match:
            return rank, match
    return None


def _number(match: re.Match[str]) -> tuple[int, int, int]:
    """Return the number that a match tells, and where it stands."""
    groups = match.groupdict()
    if "i" in groups:
        return 10 * int(groups["i"]) + int(groups["j"]), match.start("i"), match.end("j")
    group = next(name for name in ("n", "axis", "k", "wpr") if name in groups)
    text = groups[group]
    number = _AXES[text] if group == "axis" else "wpr".index(text) if group == "wpr" else int(text or 0)
    return number, match.start(group), match.end(group)
