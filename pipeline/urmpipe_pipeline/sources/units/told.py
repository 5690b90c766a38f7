"""The unit that somebody tells of a column: the user, its own name, or the source that wrote it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from urmpipe_models.errors import Finding, LogError, OptionError, format_value
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.units.unit_hints import unit_hints
from urmpipe_pipeline.sources.vocabulary import KnownSource, Quantity, Unit, vocabulary

Teller = Literal["column", "name", "every angle", "source", "given source", "urmpipe"]

GIVEN = "given as an option"


@dataclass(frozen=True, slots=True)
class Told:
    """A unit that is told of a column.

    Attributes:
        unit: The unit.
        by: Who tells it: the user of this very column, its name, the user of every angle, the source, the
            source as the user gave it, or its name in a file that urmpipe wrote.
        evidence: The same in words.
    """

    unit: Unit
    by: Teller
    evidence: str

    @property
    def given(self) -> bool:
        """Whether the user told it."""
        return self.by in ("column", "every angle", "given source")

    @property
    def certain(self) -> bool:
        """Whether it is not to be doubted: the user told it, or urmpipe wrote it."""
        return self.given or self.by == "urmpipe"

    @property
    def by_source(self) -> bool:
        """Whether the source told it."""
        return self.by in ("source", "given source")


@dataclass(frozen=True, slots=True)
class Tellers:
    """Who tells the units of the columns of a log.

    Attributes:
        given: Units given by the user, by the column's number; by 0 that of every angle.
        source: The source, if it is known.
        file: The file, for errors.
        source_given: Whether the user gave the source.
    """

    given: Mapping[int, Unit]
    source: KnownSource | None
    file: str
    source_given: bool = False

    def of(self, column: Column, allowed: Sequence[Quantity] = ("angle",)) -> Told | None:
        """Return the unit that is told of a column; None if none is.

        What the user says of every angle comes behind the column's own name, and before the source.

        Args:
            column: The column.
            allowed: What it may hold; the first is the likely one.

        Raises:
            LogError: If a name has a unit that is not known or allowed, and the user gives none.
            OptionError: If the user gives one that is not allowed.
        """
        told = self._first(column, allowed)
        if told is None or (told.unit.quantity in allowed and not told.unit.order):
            return told
        names = ", ".join(name for quantity in allowed for name in vocabulary().spelled(quantity))
        message = f"found the unit {told.unit.name} ({told.evidence}), allowed: {names}"
        if told.by in ("column", "every angle"):
            raise OptionError(Finding(message, column=column.name, parameter="unit"))
        raise LogError(Finding(message, self.file, column=column.header))

    def own(self, column: Column, likely: Quantity = "angle") -> Unit | None:
        """Return the unit that the user or the name gives this very column.

        Raises:
            LogError: If it is not known.
        """
        if column.number in self.given:
            return self.given[column.number]
        if column.unit_text and column.unit is None:
            message = f"found the unit {format_value(column.unit_text)}, allowed: rad, deg, m, mm, cm"
            hints = unit_hints([column], "mm" if likely == "length" else "deg", "keeps the values unchanged")
            said = f"{message}; convert the values"
            raise LogError(Finding(said, self.file, column=column.header, hints=hints))
        return column.unit

    def _first(self, column: Column, allowed: Sequence[Quantity]) -> Told | None:
        if column.number in self.given:
            return Told(self.given[column.number], "column", GIVEN)
        every = self.given.get(0) if "angle" in allowed else None
        own = self.own(column, allowed[0]) if every is None else column.unit
        if own is not None and own.quantity != "time" and own != every:
            ours = self.source is not None and self.source.own
            return Told(own, "urmpipe" if ours else "name", "its name")
        if every is not None:
            return Told(every, "every angle", GIVEN)
        default = self.source.units.get(allowed[0]) if self.source else None
        if self.source is None or default is None:
            return None
        by: Teller = "given source" if self.source_given else "source"
        return Told(default, by, f"{self.source.name} writes {default.name}")
