"""The columns of a log: those of all its tables in a row, with names, units and places.

1. `Column`, `columns_of`: a column, and what its name says; names in the cells next to it replace numbers.
2. `find_column`, `chosen_columns`, `given_units`: the columns that the user means, by name, number or range.
3. `columns_of_side`, `select_side`, `side_of`, `columns_of_topic`: part of a table by words in the names.
4. `which_joints`, `take`: the question which columns are the joints, and its choices; hints about units.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import combinations

from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.joint_log import Basis, Inference
from urmpipe_pipeline.logs.formats.cells import count_numbers, is_missing
from urmpipe_pipeline.logs.formats.log_table import LogTable, capped
from urmpipe_pipeline.logs.formats.text import check_width
from urmpipe_pipeline.logs.log_map import LogMap
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

REST = "rest"  # all columns without the other side's word
OTHER_UNIT = {"rad": "deg", "deg": "rad", "m": "mm", "mm": "m", "cm": "m"}  # what a wrong unit most likely is
UNKNOWN = "columns that are known to be joints"  # allowed, where nothing shows which columns they are
MAX_LISTED = 8  # words in a message, those of most columns
MAX_DUPLICATES = 12  # numbers of columns with one name in a message
MAX_CHOICES = 9  # groups of columns that a question offers
MAX_SIDE_WORDS = 3  # words that select a group of columns

RECORD = Hint("", effect="record the missing one")
OTHER_ROBOT = Hint("robot", None, "gives another arm")
NAME_JOINTS = Hint("joints", None, "names the joint columns, in the robot's order")
TIMES_OF_ANOTHER = Hint("", effect="times of another log: read that one with --time FILE:COLUMN")

_UNIT_WORDS = re.compile(
    r"_(rad(ian)?s?|deg(ree)?s?|grad)(_(per_)?s(ec)?2?)?(?=_|$)|_(mm|cm|m|met(er|re)s?|millimet(er|re)s?)$"
)
_RANGE = re.compile(r"(?P<first>\d{1,5})-(?P<last>\d{1,5})")
_NAME_COLUMN = re.compile(r"(?P<before>.*?)name_?(?P<n>\d+)\Z")
_NUMBERED = re.compile(r"(?P<before>.*?)(position|velocity|effort)_?(?P<n>\d+)\Z")
_ARMS = (frozenset(("left", "l")), frozenset(("right", "r")))


# 1. Columns


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
        name: The same without the unit in brackets, different from those of other tables.
        key: The name for comparison with the vocabulary.
        unit_text: Its unit as the file has it, None if it has none.
        text: Whether it holds text instead of numbers.
        matched: Its name without the words of the side that the user chose, where it has them.
        side: These words, where `side` chose them.
        shares_name: Whether another column of its table has the same name.
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
    shares_name: bool = False

    @property
    def unit(self) -> Unit | None:
        """Its unit, None if the file has none or one that is not known."""
        return None if self.unit_text is None else vocabulary().unit(self.unit_text)

    @property
    def moves_nothing(self) -> bool:
        """Whether its unit says that it is neither a joint nor a rate: Nm, N, A, V."""
        return self.unit is not None and self.unit.quantity == "other"

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
        """Its name for comparison, and whether its words are those of measured or of commanded values."""
        label = self.name if key(self.name) == self.key else split_unit(self.header)[0]
        return mark_name(self.matched or label)

    @property
    def words(self) -> frozenset[str]:
        """The words of its name."""
        marked = self.marked
        return marked.measured | marked.commanded | frozenset(marked.key.split("_"))

    @property
    def kind(self) -> Kind:
        """Whether its values were measured or commanded, if its name says so."""
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
        """What a reading option calls it: its number where it has no name, or shares it."""
        has_name = self.header and not self.header.isdigit() and not self.shares_name
        return self.name if has_name else str(self.number)


def columns_of(tables: Sequence[LogTable], titles: Sequence[str]) -> tuple[Column, ...]:
    """Return the columns of some tables.

    A column that is named in the cells next to it has this name: rostopic echo -p writes name0, name1, ...
    with a joint's name in each row, and position0, position1, ...: position0 becomes position.NAME.

    Args:
        tables: The tables.
        titles: A title for each, written before the name where two tables have columns of one name,
            other than a time.
    """
    columns: list[Column] = []
    for number, table in enumerate(tables):
        check_width(len(table.names), table.file, table.header_line)
        earlier = {column.name for column in columns}
        for index, header in enumerate(table.names):
            label, unit = split_unit(header) if table.header else (header, None)
            if table.units and index < len(table.units):
                unit = table.units[index].strip("[]() ") or unit
            is_time = any(pattern.search(key(label)) for pattern in vocabulary().time)
            name = f"{titles[number]}/{label}" if label in earlier and not is_time else label
            cells = [cell for cell in table.cells(index) if not is_missing(cell)]
            is_text = 2 * count_numbers(cells, table.decimal) < len(cells)
            name = name or f"column {len(columns) + 1}"
            place = (len(columns) + 1, number, index)
            duplicate = table.names.count(header) > 1
            columns.append(Column(*place, header, name, key(label), unit, is_text, shares_name=duplicate))
    names: dict[tuple[int, str, str], str] = {}
    for column in columns:
        match = _NAME_COLUMN.match(column.key) if column.text else None
        texts = set(tables[column.table].cells(column.index)) if match else set()
        if match and len(texts) == 1:
            names[column.table, match["before"], match["n"]] = texts.pop()
    for k, column in enumerate(columns) if names else ():
        match = None if column.text else _NUMBERED.match(column.key)
        if match and (joint := names.get((column.table, match["before"], match["n"]))):
            label = f"{column.name.rstrip('0123456789')}.{joint}"
            columns[k] = replace(column, name=label, key=key(label))
    return tuple(columns)


def listed(columns: Sequence[Column], most: int = 24) -> str:
    """Return the names of columns in a row, as the user may give them; the middle of many is left out."""
    names = [column.header or f"column {column.number}" for column in columns]
    if len(names) > most:
        names = [*names[: most - 2], f"... {len(names) - most + 1} more ...", names[-1]]
    return ", ".join(names)


def check_unique_names(
    used: Sequence[Column], columns: Sequence[Column], tables: Sequence[LogTable], remedy: Hint
) -> None:
    """Raise if a column that is to be used shares its name with another one.

    A rate of the same name is no duplicate, nor is an angle "t (rad)" one of the time "t (s)".

    Raises:
        LogError: With a finding for each such column; joints that all have as many are a choice of groups.
    """

    def may_be_equal(first: Column, other: Column) -> bool:
        if first.unit and other.unit and first.unit.quantity != other.unit.quantity:
            return False
        return (first.unit.order if first.unit else 0) == (other.unit.order if other.unit else 0)

    by_key: dict[str, list[Column]] = {}
    for column in columns:
        if column.key and not column.text:
            by_key.setdefault(column.key, []).append(column)
    equal = []
    for column in used:
        duplicates = {c for c in by_key.get(column.key, ()) if may_be_equal(c, column)} | {column}
        equal.append(sorted(duplicates, key=lambda duplicate: duplicate.number))
    hints: tuple[Hint, ...] = (remedy,)
    if remedy.parameter == "joints" and len(set(map(len, equal))) == 1:
        hints = (*(take(group, by_number=True) for group in zip(*equal, strict=True)), remedy)
    findings: list[Finding] = []
    for column, group in zip(used, equal, strict=True):
        if len(group) > 1:
            numbers = [duplicate.number for duplicate in group]
            more = f" and {len(numbers) - MAX_DUPLICATES} more" if len(numbers) > MAX_DUPLICATES else ""
            message = f"found as columns {', '.join(map(str, numbers[:MAX_DUPLICATES]))}{more}, allowed: once"
            table = tables[column.table]
            place = (table.file, table.header_line, None, column.header)
            findings.append(Finding(message, *place, hints=() if findings and len(hints) > 1 else hints))
    if findings:
        raise LogError(*capped(findings, tables[used[0].table].file))


def columns_named(
    columns: Sequence[Column], tables: Sequence[LogTable], patterns: Mapping[str, Patterns]
) -> dict[str, Column]:
    """Return the columns whose names match patterns, by what the patterns are of.

    Raises:
        LogError: If several match the same, each of them named.
    """
    matches = {
        what: [column for column in columns if any(pattern.search(column.key) for pattern in of_what)]
        for what, of_what in patterns.items()
    }
    several = [
        Finding(f"found {listed(group)}, allowed: one of them", tables[group[0].table].file)
        for group in matches.values()
        if len(group) > 1
    ]
    if several:
        raise LogError(*several)
    return {what: group[0] for what, group in matches.items() if group}


# 2. Columns that the user means


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


def chosen_columns(columns: Sequence[Column], texts: Sequence[str], **place: str) -> tuple[Column, ...]:
    """Return the columns that the user means by names or numbers, of which 2-7 are six.

    Raises:
        LogError: If no column or more than one is meant.
    """
    return tuple(find_column(columns, name, **place) for text in texts for name in _expand(columns, text))


def lacks_columns(columns: Sequence[Column], texts: Sequence[str]) -> bool:
    """Return whether no column has one of some names, or one of some numbers is beyond the columns."""
    called = {name: columns_called(columns, name) for text in texts for name in _expand(columns, text)}
    numbers = [text for text in called if text.isdigit()]
    return not any(called.values()) or (len(numbers) == len(called) and not all(called.values()))


def _expand(columns: Sequence[Column], text: str) -> Sequence[str]:
    """Return the numbers that a range means; anything else as it is."""
    ends = _RANGE.fullmatch(text)
    if ends is None or columns_called(columns, text):
        return (text,)
    first, last = int(ends["first"]), int(ends["last"])
    return [str(number) for number in range(first, min(last, columns[-1].number + 1) + 1)] or (text,)


def given_units(columns: Sequence[Column], options: LogMap) -> dict[int, Unit]:
    """Return the units that the user gave, by the column's number; by 0 that of every angle.

    Raises:
        OptionError: If a text is no unit, or that of every angle is none of one.
        LogError: If there is no such column.
    """
    units = {}
    for text, unit_text in options.unit.items():
        unit = vocabulary().unit(unit_text)
        quantities: tuple[Quantity, ...] = ("angle", "length", "time", "date") if text else ("angle",)
        if unit is None or unit.quantity not in quantities:
            allowed = ", ".join(name for quantity in quantities for name in vocabulary().spelled(quantity))
            raise OptionError(Finding(parameter="unit", found=format_value(unit_text), allowed=allowed))
        if text and options.shared and not columns_called(columns, text):
            continue
        units[find_column(columns, text, parameter="unit").number if text else 0] = unit
    return units


# 3. Sides and topics


def columns_of_side(columns: Sequence[Column], options: LogMap, file: str) -> list[Column]:
    """Return the columns of the side that the user chose; all columns without one.

    Args:
        columns: The columns, without the clock.
        options: What the user says: `side`, and in a comparison of two sides `pair`.
        file: The file, for errors.

    Raises:
        LogError: If no column has the words of the side.
    """
    chosen = list(columns)
    if options.side is not None:
        chosen = select_side(columns, options.side)
        if not chosen and not options.shared:
            raise _no_side_error(columns, f"with {_quote(options.side)}", "side", file)
    if options.pair is not None:
        side, other = map(_split_side, options.pair)
        is_rest = side == {REST}
        chosen = [c for c in chosen if not other <= c.words and (is_rest or side <= c.words)]
        if not chosen:
            words = "" if is_rest else f"with {_quote(options.pair[0])} and "
            raise _no_side_error(columns, f"{words}without {options.pair[1]}", "sides", file)
        if not is_rest:
            chosen = [_without(column, side) for column in chosen]
    return chosen or list(columns)


def without_other_side(columns: Sequence[Column], options: LogMap) -> tuple[Column, ...]:
    """Return the columns without those of another side, unless no time remains."""
    other = _split_side(options.pair[1]) if options.pair else frozenset((REST,))
    of_side = {column.number for column in select_side(columns, options.side or "")}
    rest = tuple(c for c in columns if c.number in of_side and (other == {REST} or not other <= c.words))
    return rest if any(column.is_time for column in rest) else tuple(columns)


def select_side(columns: Sequence[Column], side: str) -> list[Column]:
    """Return the columns with all words of a side, and those without a word of another side; else none.

    A column whose name differs from that of a column of the side only by these words is another side's.
    """
    if not (words := _split_side(side)):
        return list(columns)
    of_side = {c: replace(_without(c, words), side=words) for c in columns if words <= c.words}
    quantities = {(column.quantity, column.unit_text) for column in of_side.values()}
    names = [column.marked.key.split("_") for column in of_side]
    places = {tuple(k for k, word in enumerate(name) if word in words) for name in names} - {()}

    def blank(name: Sequence[str], place: Sequence[int]) -> tuple[str, ...]:
        return tuple("" if k in place else word for k, word in enumerate(name))

    forms = {blank(name, place) for name in names for place in places}

    def is_shared(column: Column) -> bool:
        name, marked = column.marked.key.split("_"), column.marked
        arms = {word for word in name if vocabulary().arms.fullmatch(word)}
        return bool(of_side) and not (
            (marked.measured | marked.commanded | arms) - words
            or (column.quantity, column.unit_text) in quantities
            or any(blank(name, place) in forms for place in places)
        )

    return [of_side.get(column, column) for column in columns if column in of_side or is_shared(column)]


def side_of(group: Sequence[Column], groups: Sequence[Sequence[Column]]) -> str | None:
    """Return the fewest words that select one of several groups of columns, after those that the user chose.

    None if there are no such words.
    """
    first, *rest = (list(dict.fromkeys(re.split(r"[\W_]+", column.marked.key))) for column in group)
    common = [word for word in first if word in group[0].words and all(word in other for other in rest)]
    common = [word for word in common if not word.isdigit() and vocabulary().unit(word) is None]
    columns = [column for other in groups for column in other]
    numbers = [column.number for column in columns if column in group]
    for count in range(1, MAX_SIDE_WORDS + 1):
        for words in combinations(common, count):
            if [column.number for column in select_side(columns, "_".join(words))] == numbers:
                return "_".join((*sorted(group[0].side), *words))
    return None


def _split_side(side: str) -> frozenset[str]:
    return frozenset(re.findall(r"[^\W_]+", side.lower()))


def _quote(side: str) -> str:
    return (
        f"the word {side}"
        if len(_split_side(side)) == 1
        else f"the words {', '.join(sorted(_split_side(side)))}"
    )


def _without(column: Column, words: frozenset[str]) -> Column:
    """Return a column that is matched without some words of its name, of which some remain."""
    parts = re.findall(r"[^\W_]+|[\W_]+", column.matched or split_unit(column.header)[0])
    dropped = words - vocabulary().stems
    matched = "".join(part for part in parts if part.lower() not in dropped).strip(" _-./")
    return replace(column, matched=matched) if re.search(r"[^\W_]", matched) else column


def _no_side_error(columns: Sequence[Column], missing: str, parameter: str, file: str) -> LogError:
    count = Counter(word for column in columns for word in column.words if word.isalpha())
    shared = [word for word, columns_with in count.most_common(MAX_LISTED) if columns_with > 1]
    words = f"words in the names of columns, such as {', '.join(shared)}"
    allowed = words if shared else "a table with names of columns"
    message = f"found no column {missing} in its name, allowed: {allowed}"
    return LogError(Finding(message, file, parameter=parameter))


def columns_of_topic(columns: Sequence[Column], options: LogMap, file: str) -> list[Column]:
    """Return the columns whose names begin with the topic that the user chose.

    Args:
        columns: All columns of a table.
        options: `topic`, with or without a slash before, and whether it may be that of another log.
        file: The file, for errors.

    Raises:
        OptionError: If no name does: with the first part of each name.
    """
    topic = options.topic or ""
    start = topic.strip("/")
    is_topic = re.compile(rf"/?{re.escape(start)}(?!\w)")
    chosen = [column for column in columns if is_topic.match(column.header)]
    chosen = chosen or [column for column in columns if column.header.lstrip("/").startswith(start)]
    if not chosen and not options.shared:
        parts = (re.match(r"(/?\w+)[/.]", column.header) for column in columns)
        known = ", ".join(dict.fromkeys(part[1] for part in parts if part)) or "the beginning of a name"
        raise OptionError(Finding("", file, parameter="topic", found=format_value(topic), allowed=known))
    return chosen


def by_arm(columns: Sequence[Column]) -> list[list[Column]]:
    """Return the columns by arm, where their names differ by left and right or by their first word.

    All together if there are no such two.
    """
    first: dict[str, list[Column]] = {}
    for column in columns:
        first.setdefault(column.key.split("_")[0], []).append(column)
    sides = [[column for column in columns if column.words & words] for words in _ARMS]

    def without_arm(column: Column) -> str:
        words, of_arms = column.key.split("_"), frozenset().union(*_ARMS)
        return "_".join([w for w in words if w not in of_arms] if column.words & of_arms else words[1:])

    for arms in (sides, list(first.values())):
        names = [frozenset(map(without_arm, arm)) for arm in arms]
        if len(arms) > 1 and len(set(names)) == 1 and names[0] and "" not in names[0]:
            return arms
    return [list(columns)]


# 4. Questions and hints


def which_joints(
    file: str,
    fault: str,
    groups: Sequence[Sequence[Column]],
    allowed: str = UNKNOWN,
    *hints: Hint,
    by_side: bool = False,
) -> LogError:
    """Return the question which columns are the joints, with the groups that they may be.

    Args:
        file: The file.
        fault: What was found, and why it does not decide.
        groups: Columns that may be all joints; the likeliest first.
        allowed: What is allowed.
        hints: What else helps.
        by_side: Whether the words of a side select a group, where there are such words.
    """
    different = list(dict.fromkeys(tuple(group) for group in groups if group))
    names = Counter(column.called for column in {column for group in different for column in group})
    choices = []
    for group in different[:MAX_CHOICES]:
        side = side_of(group, different) if by_side else None
        is_unique = all(names[column.called] == 1 for column in group)
        choices.append(Hint("side", side, "takes these") if side else take(group, by_number=not is_unique))
    return LogError(
        Finding(f"found {fault}, allowed: {allowed}", file, hints=(*hints, *choices, NAME_JOINTS))
    )


def take(
    columns: Sequence[Column],
    does: str = "takes these",
    *,
    parameter: str = "joints",
    by_number: bool = False,
) -> Hint:
    """Return the hint that takes columns as the joints, or as the position: by number if a name repeats."""
    numbers = [column.number for column in columns]
    names = [column.called for column in columns]
    if all(name == str(number) for name, number in zip(names, numbers, strict=True)) and len(columns) > 1:
        is_range = numbers == list(range(numbers[0], numbers[-1] + 1))
        return Hint(parameter, [f"{numbers[0]}-{numbers[-1]}"] if is_range else [*map(str, numbers)], does)
    is_clear = not by_number and all("," not in name and names.count(name) == 1 for name in names)
    return Hint(parameter, names if is_clear else [*map(str, numbers)], does)


def unit_hints(columns: Sequence[Column], unit: str, does: str = "overrides this") -> tuple[Hint, ...]:
    """Return the hint that gives all of some columns a unit."""
    return (Hint("unit", {column.called: unit for column in columns}, does),)


def which_unit(columns: Sequence[Column], unit: str, *, every: bool) -> tuple[Hint, ...]:
    """Return the hints that give some columns the other unit or confirm theirs, as every angle's or each."""
    names = [""] if every else [column.called for column in columns]
    units = dict.fromkeys((OTHER_UNIT.get(unit, unit), unit))
    return tuple(Hint("unit", dict.fromkeys(names, u), "specifies it") for u in units)


def unit_inference(
    columns: Sequence[Column], unit: str, evidence: str, basis: Basis, *, every: bool
) -> Inference:
    """Return the inference of the unit of some columns, with the other unit that it may be.

    A unit for every angle reaches some columns; the others have one each, as the first.
    """
    names, other = tuple(column.name for column in columns), OTHER_UNIT.get(unit)
    every = every and len(columns) > 1 and unit in ("rad", "deg")
    hints = (Hint("unit", {"" if every else columns[0].called: other}),) if other else ()
    return Inference(f"unit of {', '.join(names)}", unit, evidence, "unit", names, hints, basis)
