"""The columns of a log: those of all its tables in a row, with names, units and places."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.logs.cells.cell import count_numbers, is_missing
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.limits import refuse_wide
from urmpipe_pipeline.logs.tables.numbers import capped
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.vocabulary import (
    MarkedName,
    Patterns,
    Quantity,
    Unit,
    key,
    mark_name,
    split_unit,
    vocabulary,
)

_UNIT_WORDS = re.compile(
    r"_(rad(ian)?s?|deg(ree)?s?|grad)(_(per_)?s(ec)?2?)?(?=_|$)|_(mm|cm|m|met(er|re)s?|millimet(er|re)s?)$"
)
_RANGE = re.compile(r"(?P<first>\d{1,5})-(?P<last>\d{1,5})")
_NAME_COLUMN = re.compile(r"(?P<before>.*?)name_?(?P<n>\d+)\Z")
SHOWN_TWINS = 12
"""Columns of one name that are told by their numbers."""

_NUMBERED = re.compile(r"(?P<before>.*?)(position|velocity|effort)_?(?P<n>\d+)\Z")


class Kind(IntEnum):
    """What the name of a column says about its values, in the order of preference for reading."""

    MEASURED, PLAIN, COMMANDED = range(3)


def kind_of(measured: frozenset[str], commanded: frozenset[str]) -> Kind:
    """Return what the words for measured and commanded in a name say; of both, the latter counts."""
    return Kind.COMMANDED if commanded else Kind.MEASURED if measured else Kind.PLAIN


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a log.

    Attributes:
        number: Its number over all tables of the log, from 1.
        table: Index of its table.
        index: Its index in that table.
        header: Its name as the file has it.
        name: The same without the unit in brackets, told apart from those of other tables.
        key: The name for comparison with the vocabulary.
        unit_text: Its unit as the file has it, None if it has none.
        text: Whether it holds text instead of numbers.
        matched: Its name without the words of the side that the user chose, where it has them.
        side: These words, where `side` chose them.
    """

    number: int
    table: int
    index: int
    header: str
    name: str
    key: str
    unit_text: str | None
    text: bool
    matched: str = ""
    side: frozenset[str] = frozenset()

    @property
    def unit(self) -> Unit | None:
        """Its unit, None if the file has none or one that is not known."""
        return None if self.unit_text is None else vocabulary().unit(self.unit_text)

    @property
    def counts_rows(self) -> bool:
        """Whether its name says that it only counts rows or frames."""
        return any(pattern.search(self.key) for pattern in vocabulary().index)

    @property
    def is_time(self) -> bool:
        """Whether it is called like a time, also one of a side: time_cmd."""
        names = (self.key,) if self.kind == Kind.PLAIN else (self.key, self.bare)
        return any(pattern.search(name) for pattern in vocabulary().time for name in names)

    @property
    def marked(self) -> MarkedName:
        """Its key, and what it says of its values: measured or commanded."""
        label = self.name if key(self.name) == self.key else split_unit(self.header)[0]
        return mark_name(self.matched or label)

    @property
    def words(self) -> frozenset[str]:
        """The words of its name."""
        marked = self.marked
        return marked.measured | marked.commanded | frozenset(marked.key.split("_"))

    @property
    def words_of_side(self) -> frozenset[str]:
        """The words of its name that are of a side: measured, commanded, or one of several arms."""
        marked = self.marked
        arms = frozenset(word for word in marked.key.split("_") if vocabulary().arms.fullmatch(word))
        return marked.measured | marked.commanded | arms

    @property
    def kind(self) -> Kind:
        """Whether its values were measured or commanded, as far as its name says so."""
        return kind_of(self.marked.measured, self.marked.commanded)

    @property
    def plain(self) -> str:
        """Its key without the words of a unit, qdes as q_des: joint_rad_1 is joint_1."""
        return _UNIT_WORDS.sub("", self.marked.key)

    @property
    def bare(self) -> str:
        """The same without words for measured and commanded: q_des_1 is q_1."""
        return _UNIT_WORDS.sub("", self.marked.bare)

    @property
    def quantity(self) -> str:
        """The letters and digits of it, which columns share that differ by such words alone."""
        return self.bare.replace("_", "")

    @property
    def called(self) -> str:
        """What a reading option calls it: its number where it has no name."""
        return self.name if self.header and not self.header.isdigit() else str(self.number)


def columns_of(layouts: Sequence[Layout], titles: Sequence[str]) -> tuple[Column, ...]:
    """Return the columns of some tables.

    Args:
        layouts: The tables.
        titles: A title for each, told before the name where two tables have columns of one name,
            other than a time.
    """
    result: list[Column] = []
    for table, layout in enumerate(layouts):
        refuse_wide(len(layout.names), layout.file, layout.header_line)
        earlier = {column.name for column in result}
        for index, header in enumerate(layout.names):
            label, unit = split_unit(header) if layout.header else (header, None)
            if layout.units and index < len(layout.units):
                unit = layout.units[index].strip("[]() ") or unit
            time = any(pattern.search(key(label)) for pattern in vocabulary().time)
            name = f"{titles[table]}/{label}" if label in earlier and not time else label
            text = _holds_text(layout.cells(index), layout.decimal)
            number = len(result) + 1
            name = name or f"column {number}"
            result.append(Column(number, table, index, header, name, key(label), unit, text))
    return _named_in_cells(result, layouts)


def _named_in_cells(columns: Sequence[Column], layouts: Sequence[Layout]) -> tuple[Column, ...]:
    """Return the columns, those named in the cells beside them by these names.

    rostopic echo -p writes name0, name1, ... with a joint's name in each row, and position0, position1, ...:
    position0 becomes position.NAME, whatever the order in which the joints were published.
    """
    names: dict[tuple[int, str, str], str] = {}
    for column in columns:
        match = _NAME_COLUMN.match(column.key)
        cells = set(layouts[column.table].cells(column.index)) if match and column.text else set()
        if match and len(cells) == 1:
            names[column.table, match["before"], match["n"]] = cells.pop()
    result = []
    for column in columns:
        match = _NUMBERED.match(column.key)
        name = names.get((column.table, match["before"], match["n"])) if match and not column.text else None
        if match and name:
            label = f"{column.name.rstrip('0123456789')}.{name}"
            column = replace(column, name=label, key=key(label))  # noqa: PLW2901
        result.append(column)
    return tuple(result)


def find_column(columns: Sequence[Column], text: str, **place: str) -> Column:
    """Return the column that the user means.

    Args:
        columns: The log's columns.
        text: Its name, with or without unit, or its number from 1.
        place: Fields of the finding that says where the name is from, such as its parameter.

    Raises:
        LogError: If no column or more than one is meant.
    """
    matches = columns_called(columns, text)
    if len(matches) == 1:
        return matches[0]
    none, allowed = f"no column {format_value(text)}", listed(columns)
    if matches:
        numbers = ", ".join(str(column.number) for column in matches)
        none, allowed = f"{format_value(text)} as columns {numbers}", "one; give its number"
    raise LogError(Finding(found=none, allowed=allowed, **place))  # type: ignore[arg-type]


def columns_called(columns: Sequence[Column], text: str) -> list[Column]:
    """Return the columns that a text may mean: by their names, with or without unit, else by number."""
    exact = [column for column in columns if text in (column.header, column.name)]
    matches = exact or [column for column in columns if key(text) == column.key != ""]
    return matches or [column for column in columns if text == str(column.number)]


def lacks_columns(columns: Sequence[Column], texts: Sequence[str]) -> bool:
    """Return whether no column has one of some names, or one of some numbers is beyond the columns."""
    called = {text: columns_called(columns, text) for name in texts for text in _each(columns, name)}
    numbers = [text for text in called if text.isdigit()]
    return not any(called.values()) or (len(numbers) == len(called) and not all(called.values()))


def chosen_columns(columns: Sequence[Column], texts: Sequence[str], **place: str) -> tuple[Column, ...]:
    """Return the columns that the user means by names or numbers, of which 2-7 are six.

    Raises:
        LogError: If no column or more than one is meant.
    """
    return tuple(find_column(columns, one, **place) for text in texts for one in _each(columns, text))


def _each(columns: Sequence[Column], text: str) -> Sequence[str]:
    """Return the numbers that a range means; anything else as it is."""
    ends = _RANGE.fullmatch(text)
    if ends is None or columns_called(columns, text):
        return (text,)
    first, last = int(ends["first"]), int(ends["last"])
    return [str(number) for number in range(first, min(last, columns[-1].number + 1) + 1)] or (text,)


def columns_named(
    columns: Sequence[Column], layouts: Sequence[Layout], patterns: Mapping[str, Patterns]
) -> dict[str, Column]:
    """Return the columns whose names match patterns, by what the patterns are of.

    Raises:
        LogError: If several match the same, each of them named.
    """
    found = {
        what: [column for column in columns if any(pattern.search(column.key) for pattern in alike)]
        for what, alike in patterns.items()
    }
    several = [
        Finding(f"found {listed(some)}, allowed: one of them", layouts[some[0].table].file)
        for some in found.values()
        if len(some) > 1
    ]
    if several:
        raise LogError(*several)
    return {what: some[0] for what, some in found.items() if some}


def given_units(columns: Sequence[Column], options: LogMap) -> dict[int, Unit]:
    """Return the units that the user gave, by the column's number; by 0 that of every angle.

    Raises:
        OptionError: If a text is no unit, or that of every angle is none of one.
        LogError: If there is no such column.
    """
    given = {}
    for text, unit_text in options.unit.items():
        unit = vocabulary().unit(unit_text)
        quantities: tuple[Quantity, ...] = ("angle", "length", "time", "date") if text else ("angle",)
        if unit is None or unit.quantity not in quantities:
            allowed = ", ".join(name for quantity in quantities for name in vocabulary().spelled(quantity))
            raise OptionError(Finding(parameter="unit", found=format_value(unit_text), allowed=allowed))
        if text and options.shared and not columns_called(columns, text):
            continue
        given[find_column(columns, text, parameter="unit").number if text else 0] = unit
    return given


def listed(columns: Sequence[Column], most: int = 24) -> str:
    """Return the names of columns in a row, as the user may give them; the middle of many is left out."""
    names = [column.header or f"column {column.number}" for column in columns]
    if len(names) > most:
        names = [*names[: most - 2], f"... {len(names) - most + 1} more ...", names[-1]]
    return ", ".join(names)


def refuse_twins(
    used: Sequence[Column], columns: Sequence[Column], layouts: Sequence[Layout], remedy: Hint
) -> None:
    """Raise if a column that is to be used shares its name with another one.

    A rate of the same name is no duplicate, nor is an angle "t (rad)" one of the time "t (s)": the unit
    states what it is.

    Raises:
        LogError: With a finding for each such column.
    """
    named: dict[str, list[Column]] = {}
    for column in columns:
        if column.key and not column.text:
            named.setdefault(column.key, []).append(column)
    findings = []
    for column in used:
        duplicates = [
            other
            for other in named.get(column.key, ())
            if other is not column and _may_be_equal(other, column)
        ]
        if duplicates:
            numbers = sorted(c.number for c in (column, *duplicates))
            more = f" and {len(numbers) - SHOWN_TWINS} more" if len(numbers) > SHOWN_TWINS else ""
            message = f"found as columns {', '.join(map(str, numbers[:SHOWN_TWINS]))}{more}, allowed: once"
            layout = layouts[column.table]
            place = (layout.file, layout.header_line, None, column.header)
            findings.append(Finding(message, *place, hints=(remedy,)))
    if findings:
        raise LogError(*capped(findings, layouts[used[0].table].file))


def _may_be_equal(first: Column, other: Column) -> bool:
    """Return whether two columns may hold the same quantity, by their units or without them."""
    if first.unit and other.unit and first.unit.quantity != other.unit.quantity:
        return False
    return (first.unit.order if first.unit else 0) == (other.unit.order if other.unit else 0)


def _holds_text(cells: Sequence[str], decimal: str) -> bool:
    """Return whether less than half of the cells with content are numbers."""
    cells = [cell for cell in cells if not is_missing(cell)]
    return 2 * count_numbers(cells, decimal) < len(cells)
