"""How a table of targets is written, told by its header: x, y, z say more than rows of which some are wrong.

A few targets are typed by hand, and all of their rows may be wrong. How a log is written its rows tell.

A table with a pose or a position a row, and columns beside it: targets, and the rows of a path.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_models.math3d import FORMS, RotationForm, column_count
from urmpipe_pipeline.joint_log import PASSED_OVER, Inference, LogWarning
from urmpipe_pipeline.logs.clock import split_file_column
from urmpipe_pipeline.logs.columns import Column, columns_of, listed, unit_inference
from urmpipe_pipeline.logs.formats.cells import DECIMALS, DELIMITERS, count_up, is_number, split_line
from urmpipe_pipeline.logs.formats.files import unchanged
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS
from urmpipe_pipeline.logs.formats.numbers import RowFault
from urmpipe_pipeline.logs.formats.opening import PATH, open_tables
from urmpipe_pipeline.logs.formats.sniff import sniff
from urmpipe_pipeline.logs.formats.text import COMMENTS, HeadLine, Segment, head_lines
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.plan import Plan, make_plan
from urmpipe_pipeline.logs.rotation import form_inference
from urmpipe_pipeline.logs.target_rows import (
    ExtraColumn,
    Rows,
    read_rows,
    rotation_units,
    target_form,
    target_rotations,
)
from urmpipe_pipeline.logs.units import MAX_REACH, UnitFinder, UnitSources
from urmpipe_pipeline.logs.vocabulary import Unit, key, split_unit, vocabulary


def sniff_targets(
    segment: Segment, delimiter: str | None = None, decimal: str | None = None, position: Sequence[str] = ()
) -> TextTable:
    """Return how a table is written: by its soundest rows, if a header names x, y, z or the columns given.

    These are the rows with a cell for each name and the most numbers for x, y, z. All lines below the header
    are rows then, but for comments and a line of units. If no row is sound, the first line that is no comment
    may be such a header still, or the next one below a title.

    Raises:
        LogError: If it holds no rows, no numbers below a header without x, y, z, or a header that does not
            fit its rows.
        OptionError: As `sniff`.
    """
    lines = list(islice(head_lines(segment), MAX_SAMPLED_ROWS))
    for place, line in enumerate(lines):
        below = [other for other in lines[place + 1 :] if not other.is_comment]
        whole = _soundest(below, _headers(line.text, position))
        if whole:
            # The first line may tell the delimiter; any other above the header tells nothing.
            layout = sniff(segment, delimiter, decimal, [*lines[: min(place, 1)], line, *whole])
            return (
                _from(layout, below) if layout.header == line.number else sniff(segment, delimiter, decimal)
            )
    body = [line for line in lines if not line.is_comment]
    for place, line in enumerate(body[:2]):
        header = _fitting(body[place + 1 :], _headers(line.text, position))
        if header and delimiter is None:
            return _by_header(segment, decimal, body[: place + 1], header, body[place + 1 :])
    return sniff(segment, delimiter, decimal)


def _by_header(
    segment: Segment,
    decimal: str | None,
    head: Sequence[HeadLine],
    header: _Header,
    below: Sequence[HeadLine],
) -> TextTable:
    """Return a layout that the header alone tells, of rows that are all wrong."""
    sound = replace(below[0], text=header.delimiter.join(["0"] * header.width))  # as the header asks for
    layout = _from(sniff(segment, None, decimal, [*head, sound]), below)
    rows = [line for line in below if line.number >= layout.first_line]
    return replace(layout, sample=tuple(tuple(split_line(line.text, header.delimiter)) for line in rows))


def _from(layout: TextTable, below: Sequence[HeadLine]) -> TextTable:
    """Return a layout whose rows begin right below its header, or behind a line of units."""
    cells = split_line(below[0].text, layout.delimiter)
    units = tuple(cells) if len(below) > 1 and _are_units(cells) else ()
    first = below[1 if units else 0]
    return replace(layout, units=units, first_line=first.number, offset=first.offset)


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether the cells of a line are units."""
    told = [vocabulary().unit(cell.strip("[]() ")) for cell in cells if cell]
    return bool(told) and all(told)


@dataclass(frozen=True, slots=True)
class _Header:
    """A line of names: the sign between them, how many there are, and which are those of x, y, z."""

    delimiter: str
    width: int
    position: tuple[int, ...]


def _headers(text: str, named: Sequence[str]) -> list[_Header]:
    """Return what a line is as a header, by each delimiter that makes names of x, y and z of it."""
    for comment in COMMENTS:
        text = text.strip().removeprefix(comment)
    split = [(delimiter, split_line(text, delimiter)) for delimiter in DELIMITERS]
    return [_Header(sign, len(cells), found) for sign, cells in split if (found := _position(cells, named))]


def _position(cells: Sequence[str], named: Sequence[str]) -> tuple[int, ...]:
    """Return which names are those of x, y and z, or of a transform with them; none without all of them."""
    labels = [split_unit(cell)[0] for cell in cells]
    told = tuple(k for k, label in enumerate(labels) if {label, cells[k]} & {*named})
    if len(told) == 3:
        return told
    keys = [key(label) for label in labels]
    for pattern in vocabulary().tcp_position:
        found = ((k, pattern.search(one)) for k, one in enumerate(keys))
        matches = {k: match.groupdict().get("axis") for k, match in found if match}
        if {"x", "y", "z"} <= set(matches.values()):
            return tuple(k for k, axis in matches.items() if axis)
    entries = next(pattern for pattern in vocabulary().tcp_matrix if "i" in pattern.groupindex)
    transform = tuple(k for k, one in enumerate(keys) if entries.search(one))
    return transform if len(transform) in (12, 16) else ()


def _soundest(below: Sequence[HeadLine], headers: Sequence[_Header]) -> list[HeadLine]:
    """Return the lines with the most numbers for x, y, z, by the header and decimal sign with most lines."""
    best: tuple[int, list[HeadLine]] = 0, []
    for header in headers:
        for decimal in DECIMALS:
            numbers = [_numbers(line.text, header, decimal) for line in below]
            most = max(numbers, default=0)
            whole = [line for line, count in zip(below, numbers, strict=True) if count == most > 0]
            if (most, len(whole)) > (best[0], len(best[1])):
                best = most, whole
    return best[1]


def _numbers(text: str, header: _Header, decimal: str) -> int:
    """Return how many numbers a line has for x, y, z; 0 if it has other than a cell for each name."""
    cells = split_line(text, header.delimiter)
    if len(cells) < header.width or any(cells[header.width :]):
        return 0
    return sum(is_number(cells[k], decimal) for k in header.position)


def _fitting(below: Sequence[HeadLine], headers: Sequence[_Header]) -> _Header | None:
    """Return the header that fits most of some rows; None without one, or if they begin with an index."""

    def widths(header: _Header) -> list[int]:
        """Return how many cells each row has by a header's delimiter."""
        return [len(split_line(line.text, header.delimiter)) for line in below]

    found = max(headers, key=lambda header: widths(header).count(header.width), default=None)
    if found is None or not below:
        return None
    rows = [split_line(line.text, found.delimiter) for line in below]
    if len(rows) == 1 and _are_units(rows[0]):
        return None
    first = [cells[0] for cells in rows]
    indexed = set(widths(found)) == {found.width + 1} and len(below) > 1 and count_up(first)
    return None if indexed else found


@dataclass(frozen=True, slots=True, eq=False)
class PoseTable:
    """The rows of a table, in SI.

    Attributes:
        plan: The columns and their roles, units and clock.
        position: In [m], shape (n, 3); NaN in a row with a fault of its pose.
        rotation: Matrices [-], shape (n, 3, 3), NaN in a row with a fault; None if the table has positions
            only.
        further: The columns beside the pose by their meaning, in [m] or [-], shape (n,).
        clock: Times in integer [ns] on the table's clock, shape (n,); None without one.
        faults: Data row from 1, and all that is wrong with it.
        inferences: What was found out about the table.
        warnings: What a person should know about it.
    """

    plan: Plan
    position: FloatArray
    rotation: FloatArray | None
    further: Mapping[str, FloatArray]
    clock: IntArray | None
    faults: Mapping[int, Sequence[RowFault]]
    inferences: tuple[Inference, ...]
    warnings: tuple[LogWarning, ...]

    def __len__(self) -> int:
        return len(self.position)

    @property
    def unused(self) -> list[Column]:
        """The columns that are neither a time nor have a role."""
        return _unused(self.plan)

    @property
    def unused_numbers(self) -> list[Column]:
        """Those of numbers, but for one that counts the rows."""
        return [column for column in self.unused if not column.text and not column.counts_rows]


def read_pose_table(
    file: Path,
    options: LogMap,
    further: Mapping[str, ExtraColumn] | None = None,
    naming: str = "name the columns in a header",
) -> PoseTable:
    """Return the rows of a table: x, y, z, where it has one the orientation, and further columns.

    Lengths are in m and angles in rad unless the header or the options give a unit; rz, ry, rx mean
    R = Rz Ry Rx. A further length without a unit in its own name has the unit of x, y, z.

    Args:
        file: A text table, as a log may be.
        options: How to read the file where it does not show it; those about joints are not used.
        further: The columns to look for beside the poses, by their meaning.
        naming: The remedy where columns have no names, for the error.

    Raises:
        LogError: If the file as a whole is wrong: no x, y, z, an unknown unit, no row, a clock that repeats
            or runs backwards.
        OptionError: If an option's value makes no sense.
    """
    further = further or {}
    if split_file_column(options.time):
        allowed = "a column of the table of targets"
        raise OptionError(Finding(parameter="time", found=format_value(options.time or ""), allowed=allowed))
    with unchanged([file]):
        return _read(file, options, further, naming)


def _read(file: Path, options: LogMap, further: Mapping[str, ExtraColumn], naming: str) -> PoseTable:
    """Return the rows of a table as `read_pose_table` does."""
    asked, length = _plain_length(replace(options, joints=(), names=(), signs=(), offsets=()))
    tables = open_tables([file], asked, partial(sniff_targets, position=asked.position))
    names = {name: one.patterns for name, one in further.items()}
    plan = make_plan(tables, replace(asked, source=PATH), None, names)
    if length is not None:  # what a column's own option says comes first
        plain = dict.fromkeys((column.number for column in plan.roles.position), length)
        plan = replace(plan, units={**plain, **plan.units})
    named = bool(asked.position)
    _refuse_unclear(plan, naming, named=named, timed=asked.time is not None)
    form, assumed = target_form(plan.roles, _unused(plan), str(file), asked.rotation, named=named)
    rows = read_rows(plan, further)
    poses = _poses(plan, rows, form, further)
    passed_over = (one for one in plan.roles.warnings if one.kind == PASSED_OVER)
    return replace(
        poses,
        inferences=(*_about_file(plan), *rows.inferences, *poses.inferences),
        warnings=(*plan.clock.warnings, *passed_over, *rows.warnings, *assumed, *poses.warnings),
    )


def _plain_length(asked: LogMap) -> tuple[LogMap, Unit | None]:
    """Return the options without a plain length (mm), and that unit, which is of x, y, z here."""
    unit = vocabulary().unit(asked.unit.get("", ""))
    if unit is None or unit.quantity != "length" or unit.order:
        return asked, None
    return replace(asked, unit={name: one for name, one in asked.unit.items() if name}), unit


def _unused(plan: Plan) -> list[Column]:
    """Return the columns that are neither a time nor have a role."""
    used = {*plan.clock.columns, *plan.roles.columns}
    return [column for column in columns_of(plan.tables.layouts, plan.tables.titles) if column not in used]


def _poses(
    plan: Plan, rows: Rows, form: RotationForm | None, further: Mapping[str, ExtraColumn]
) -> PoseTable:
    """Return the rows in SI, the pose of a row with a fault as NaN, and what was found out about units."""
    finder = UnitFinder(UnitSources(plan.units, plan.tables.known, str(plan.tables.paths[plan.main])))
    columns = plan.roles.rotation
    placed, turned, others = np.split(rows.values.copy(), [3, 3 + len(columns)], axis=1)
    for part in (placed, turned):
        part[_without_pose(plan, rows)] = np.nan
    lengths, warnings = _length_units(plan, finder, placed)
    position = placed * [unit.factor for unit in lengths]
    beside, told = _further(plan, finder, others, further, lengths)
    table = PoseTable(plan, position, None, beside, rows.clock, rows.faults, (), tuple(warnings))
    if form is None:
        return replace(table, inferences=(*finder.inferences, *told))
    by_name = [one.unit if one else None for one in finder.sources.of_rotation(columns, (form,))]
    units, assumed = rotation_units(columns, form, _finite(turned), by_name)
    rotation, none = target_rotations(columns, form, turned * [unit.factor for unit in units])
    position[list(none)] = np.nan
    faults = {row: [*rows.faults.get(row, ())] for row in sorted({*rows.faults, *(k + 1 for k in none)})}
    for index, fault in none.items():
        faults[index + 1].append(fault)
    found = form_inference([column.header for column in columns], form, units[0], "their names, or as given")
    return replace(
        table,
        rotation=rotation,
        faults=faults,
        inferences=(*finder.inferences, *told, found),
        warnings=(*warnings, *assumed),
    )


def _without_pose(plan: Plan, rows: Rows) -> list[int]:
    """Return the rows, from 0, in which something else is wrong than a further column."""
    beside = {column.header for column in plan.roles.further.values()}
    return [
        row - 1
        for row, faults in rows.faults.items()
        if not all(fault.columns and beside.issuperset(fault.columns) for fault in faults)
    ]


def _length_units(plan: Plan, finder: UnitFinder, values: FloatArray) -> tuple[list[Unit], list[LogWarning]]:
    """Return the units of x, y, z, m where none is given, and a warning if no row can be in m then.

    A point further away in m than any arm reaches is a target out of reach.
    """
    columns = plan.roles.position
    units = finder.settle_positions(columns, np.zeros((1, 3)))
    source = plan.tables.known.units if plan.tables.known else {}
    told = "length" in source or any(one.unit or one.number in plan.units for one in columns)
    nearest = np.abs(_finite(values)).max(axis=1).min(initial=np.inf)
    if told or not MAX_REACH < nearest < np.inf:
        return units, []
    said = f"no unit is given for {listed(columns)}: they are taken as m, though every row is beyond any arm"
    hints = (Hint("unit", {"": "mm"}, "overrides this"),)
    return units, [LogWarning("assumed-unit", said, hints=hints)]


def _further(
    plan: Plan,
    finder: UnitFinder,
    values: FloatArray,
    further: Mapping[str, ExtraColumn],
    lengths: Sequence[Unit],
) -> tuple[dict[str, FloatArray], list[Inference]]:
    """Return the columns beside the poses in SI, and the units that they share with x, y, z."""
    found, said = {}, []
    for (name, column), cells in zip(plan.roles.further.items(), values.T, strict=True):
        factor = 1.0
        if further[name].length and finder.sources.find(column, ("length",)):
            factor = finder.settle_positions([column], np.zeros((1, 1)))[0].factor
        elif further[name].length:
            factor = lengths[0].factor
            said.append(unit_inference([column], lengths[0].name, "as x, y, z", "named", every=False))
        found[name] = np.where(np.isnan(cells), further[name].empty, cells * factor)
    return found, said


def _finite(values: FloatArray) -> FloatArray:
    """Return the rows without NaN."""
    return values[np.isfinite(values).all(axis=1)]


def _refuse_unclear(plan: Plan, naming: str, *, named: bool, timed: bool) -> None:
    """Raise if columns without names are left over, or the orientation stands in another table.

    Args:
        plan: What is to be read.
        naming: The remedy where columns have no names.
        named: Whether the user names the columns of the pose.
        timed: Whether the user names the time.

    Raises:
        LogError: With what may be read instead.
    """
    layout, used = plan.tables.layouts[plan.main], [*plan.clock.columns, *plan.roles.columns]
    file = str(layout.path)
    if len(plan.used) > 1:
        found = f"found {listed(plan.roles.rotation)} in another table than {listed(plan.roles.position)}"
        raise LogError(Finding(f"{found}, allowed: one table", file))
    cells = len(layout.names) - (not layout.names[-1])
    if layout.header is None and cells > len(used) and not (plan.roles.rotation or named):
        time = " beside the time" if plan.clock.columns else ""
        count = cells - len(plan.clock.columns)
        found = f"found {count} columns without names{time}, allowed: x, y, z alone or with an orientation"
        raise LogError(Finding(found, file, hints=tuple(_remedies(count, naming, timed=timed or bool(time)))))


def _remedies(count: int, naming: str, *, timed: bool) -> Iterator[Hint]:
    """Yield remedies for so many columns without names: a header, the form of the orientation, the time."""
    yield Hint("", effect=naming)
    yield from (Hint("rotation", form, "specifies it") for form in FORMS if 3 + column_count(form) == count)
    if not timed and count - 1 in {3, *(3 + column_count(form) for form in FORMS)}:
        yield Hint("time", "1", "if the first is the time")


def _about_file(plan: Plan) -> Iterator[Inference]:
    """Yield what was found out about the file before its rows were read."""
    for found in (plan.tables, plan.tables.layouts[plan.main], plan.clock, plan.roles):
        yield from found.inferences
