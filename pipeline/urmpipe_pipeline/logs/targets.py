"""Tables with a pose or a position in each row, and further columns: targets, and the rows of a path.

A log is refused for one wrong cell, since a gap in a motion is a gap in everything computed from it. The rows
of a table of targets are independent: a wrong row is a fault of that row.

1. `sniff_targets`: how the table is written is shown by its header: x, y, z say more than rows of which some,
   or all, are wrong.
2. `read_pose_table`: the columns and their roles as in a log; lengths are in m and angles in rad unless the
   header or an option gives a unit; rz, ry, rx mean R = Rz Ry Rx.
3. `_read_rows`: the numbers, the faults of rows, and a time for every row.
4. `_rotation_form`, `_rotation_units`, `_to_rotations`: the orientation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_models.math3d import FORMS, RotationForm, column_count, is_angular, to_matrices, to_quaternions
from urmpipe_pipeline.joint_log import PASSED_OVER, Inference, LogWarning
from urmpipe_pipeline.logs.clock import DEFAULT_PERIOD, Clock, split_file_column
from urmpipe_pipeline.logs.columns import Column, columns_of, listed, unit_hints, unit_inference
from urmpipe_pipeline.logs.formats.cells import DECIMALS, DELIMITERS, is_number, split_line
from urmpipe_pipeline.logs.formats.clock_forms import UNREADABLE
from urmpipe_pipeline.logs.formats.files import unchanged
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS, Numbers, RowFault
from urmpipe_pipeline.logs.formats.opening import PATH, open_tables
from urmpipe_pipeline.logs.formats.sniff import sniff
from urmpipe_pipeline.logs.formats.text import COMMENTS, HeadLine, Segment, head_lines
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.plan import Plan, make_plan
from urmpipe_pipeline.logs.pose_columns import ORTHOGONAL, holds_orientation
from urmpipe_pipeline.logs.roles import Roles
from urmpipe_pipeline.logs.rotation import PURE, form_inference
from urmpipe_pipeline.logs.rows import find_row_errors, unknown_times
from urmpipe_pipeline.logs.timestamps import read_text_times, separate_repeated
from urmpipe_pipeline.logs.units import MAX_REACH, UnitFinder, UnitSources
from urmpipe_pipeline.logs.vocabulary import Patterns, Unit, key, split_unit, vocabulary

MAX_NORM_ERROR = 1e-3  # of a quaternion, as printed digits cause; then it is divided by its norm
MAX_RAD = 2 * np.pi * 1.01  # angles without a unit, most of them beyond this, are rarely in rad
ALLOWED = "a finite number"  # in the cells of a pose

NAMED = Hint("orientation", None, "with --position and --rotation names them")

_OUR_ANGLES = frozenset(("rx", "ry", "rz"))
_KUKA_ANGLES = frozenset("abc")


@dataclass(frozen=True, slots=True)
class ExtraColumn:
    """A further column of a table of poses.

    Attributes:
        patterns: Of its name.
        allowed: The values that a cell may hold, as text.
        fits: Returns which numbers, in the file's unit and of shape (n,), a cell may hold.
        empty: The value of an empty cell, in SI.
        length: Whether it holds lengths.
    """

    patterns: Patterns
    allowed: str
    fits: Callable[[FloatArray], BoolArray]
    empty: float
    length: bool


@dataclass(frozen=True, slots=True, eq=False)
class PoseTable:
    """The rows of a table, in SI.

    Attributes:
        plan: The columns and their roles, units and clock.
        position: In [m], shape (n, 3); NaN in a row with a fault of its pose.
        rotation: Matrices [-], shape (n, 3, 3), NaN in a row with a fault; None if the table has positions
            only.
        further: The further columns by their meaning, in [m] or [-], shape (n,).
        clock: Times in integer [ns] on the table's clock, shape (n,); None without one. A row whose time is
            not known is between its neighbours.
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
        return _unused_columns(self.plan)

    @property
    def unused_numbers(self) -> list[Column]:
        """Those of numbers, except one that counts the rows."""
        return [column for column in self.unused if not column.text and not column.counts_rows]


def read_pose_table(
    file: Path,
    options: LogMap,
    further: Mapping[str, ExtraColumn] | None = None,
    naming: str = "name the columns in a header",
) -> PoseTable:
    """Return the rows of a table: x, y, z, where it has one the orientation, and further columns.

    Args:
        file: A text table, as a log may be.
        options: How to read the file where it does not show it; those about joints are not used.
        further: The further columns to look for, by their meaning. One with lengths has the unit of
            x, y, z unless its name has one.
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
    options = replace(options, joints=(), names=(), signs=(), offsets=())
    length = vocabulary().unit(options.unit.get("", ""))
    if length is not None and length.quantity == "length" and not length.order:  # of x, y, z
        options = replace(options, unit={name: unit for name, unit in options.unit.items() if name})
    else:
        length = None
    is_named = bool(options.position)
    with unchanged([file]):
        tables = open_tables([file], options, partial(sniff_targets, position=options.position))
        names = {name: column.patterns for name, column in further.items()}
        plan = make_plan(tables, replace(options, source=PATH), None, names)
        if length is not None:  # a column's own option comes first
            plain = dict.fromkeys((column.number for column in plan.roles.position), length)
            plan = replace(plan, units={**plain, **plan.units})
        _check_columns(plan, naming, named=is_named, timed=options.time is not None)
        form, assumed = _rotation_form(plan, str(file), options.rotation, named=is_named)
        values, times, faults, about_clock = _read_rows(plan, further)
    table = _to_poses(plan, values, faults, form, further)
    before = (plan.tables, plan.table, plan.clock, plan.roles, about_clock)
    passed_over = (warning for warning in plan.roles.warnings if warning.kind == PASSED_OVER)
    return replace(
        table,
        clock=times,
        inferences=(*(inference for part in before for inference in part.inferences), *table.inferences),
        warnings=(*plan.clock.warnings, *passed_over, *about_clock.warnings, *assumed, *table.warnings),
    )


def _unused_columns(plan: Plan) -> list[Column]:
    used = {*plan.clock.columns, *plan.roles.columns}
    return [column for column in columns_of(plan.tables.tables, plan.tables.titles) if column not in used]


def _check_columns(plan: Plan, naming: str, *, named: bool, timed: bool) -> None:
    """Raise if columns without names remain, or the orientation is in another table.

    Args:
        plan: What is to be read.
        naming: The remedy where columns have no names.
        named: Whether options name the columns of the pose.
        timed: Whether options name the time.
    """
    table, used = plan.table, [*plan.clock.columns, *plan.roles.columns]
    if len(plan.used) > 1:
        fault = f"found {listed(plan.roles.rotation)} in another table than {listed(plan.roles.position)}"
        raise LogError(Finding(f"{fault}, allowed: one table", table.file))
    cells = len(table.names) - (not table.names[-1])
    if table.header is None and cells > len(used) and not (plan.roles.rotation or named):
        time = " next to the time" if plan.clock.columns else ""
        count = cells - len(plan.clock.columns)
        hints = [Hint("", effect=naming)]
        hints += [Hint("rotation", form, "specifies it") for form in FORMS if 3 + column_count(form) == count]
        if not (timed or time) and count - 1 in {3, *(3 + column_count(form) for form in FORMS)}:
            hints.append(Hint("time", "1", "if the first is the time"))
        fault = f"found {count} columns without names{time}, allowed: x, y, z alone or with an orientation"
        raise LogError(Finding(fault, table.file, hints=tuple(hints)))


# How a table is written


class _Header(NamedTuple):
    """A line of names: the sign between them, how many there are, and which are those of x, y, z."""

    delimiter: str
    width: int
    position: tuple[int, ...]


def sniff_targets(
    segment: Segment, delimiter: str | None = None, decimal: str | None = None, position: Sequence[str] = ()
) -> TextTable:
    """Return how a table is written: by its soundest rows, if a header names x, y, z or the columns given.

    These are the rows with a cell for each name and the most numbers for x, y, z. All lines below the header
    are rows then, except comments and a line of units. If no row is sound, the first line that is no comment
    may be such a header still, or the next one below a title: a row of zeros shows how it is written.

    Raises:
        LogError: If it holds no rows, no numbers below a header without x, y, z, or a header that does not
            fit its rows.
        OptionError: As `sniff`.
    """
    lines = list(islice(head_lines(segment), MAX_SAMPLED_ROWS))
    body = [line for line in lines if not line.is_comment]
    below = {line.number: [other for other in body if other.number > line.number] for line in lines}
    for line in lines:
        if sound := _soundest_lines(below[line.number], _find_headers(line.text, position)):
            # The first line may show the delimiter; any other above the header shows nothing.
            table = sniff(segment, delimiter, decimal, [*lines[: line is not lines[0]], line, *sound])
            is_header = table.header == line.number
            return _with_rows(table, below[line.number]) if is_header else sniff(segment, delimiter, decimal)
    for line in body[:2] if delimiter is None else ():  # all rows are wrong
        rows, headers = below[line.number], _find_headers(line.text, position)
        extra = [[len(split_line(row.text, h.delimiter)) - h.width for row in rows] for h in headers]
        if rows and headers and not (len(rows) > 1 and [1] * len(rows) in extra):  # an index has no name
            header = headers[int(np.argmax([cells.count(0) for cells in extra]))]
            zeros = replace(rows[0], text=header.delimiter.join(["0"] * header.width))
            table = _with_rows(sniff(segment, None, decimal, [*body[: body.index(line) + 1], zeros]), rows)
            texts = (row.text for row in rows if row.number >= table.first_line)
            return replace(table, sample=tuple(tuple(split_line(text, header.delimiter)) for text in texts))
    return sniff(segment, delimiter, decimal)


def _with_rows(table: TextTable, below: Sequence[HeadLine]) -> TextTable:
    """Return a table whose rows begin right below its header, or after a line of units."""
    cells = split_line(below[0].text, table.delimiter)
    units = tuple(cells) if len(below) > 1 and _are_units(cells) else ()
    first = below[1 if units else 0]
    return replace(table, units=units, first_line=first.number, offset=first.offset)


def _are_units(cells: Sequence[str]) -> bool:
    units = [vocabulary().unit(cell.strip("[]() ")) for cell in cells if cell]
    return bool(units) and all(units)


def _find_headers(text: str, named: Sequence[str]) -> list[_Header]:
    """Return what a line is as a header, by each delimiter that makes names of x, y and z of it."""
    for comment in COMMENTS:
        text = text.strip().removeprefix(comment)
    split = [(delimiter, split_line(text, delimiter)) for delimiter in DELIMITERS]
    headers = (_Header(sign, len(cells), _position_columns(cells, named)) for sign, cells in split)
    return [header for header in headers if header.position]


def _position_columns(cells: Sequence[str], named: Sequence[str]) -> tuple[int, ...]:
    """Return which names are those of x, y and z, or of a transform with them; none without all of them."""
    labels = [split_unit(cell)[0] for cell in cells]
    requested = tuple(k for k, label in enumerate(labels) if {label, cells[k]} & {*named})
    if len(requested) == 3:
        return requested
    keys = [key(label) for label in labels]
    for pattern in vocabulary().tcp_position:
        matches = ((k, pattern.search(name)) for k, name in enumerate(keys))
        axes = {k: match.groupdict().get("axis") for k, match in matches if match}
        if {"x", "y", "z"} <= set(axes.values()):
            return tuple(k for k, axis in axes.items() if axis)
    entries = next(pattern for pattern in vocabulary().tcp_matrix if "i" in pattern.groupindex)
    transform = tuple(k for k, name in enumerate(keys) if entries.search(name))
    return transform if len(transform) in (12, 16) else ()


def _soundest_lines(below: Sequence[HeadLine], headers: Sequence[_Header]) -> list[HeadLine]:
    """Return the lines with the most numbers for x, y, z, by the header and decimal sign with most lines."""
    best: tuple[int, list[HeadLine]] = 0, []
    for header in headers:
        rows = [split_line(line.text, header.delimiter) for line in below]
        for decimal in DECIMALS:
            counts = [
                0  # other than a cell for each name
                if len(cells) < header.width or any(cells[header.width :])
                else sum(is_number(cells[k], decimal) for k in header.position)
                for cells in rows
            ]
            most = max(counts, default=0)
            sound = [line for line, count in zip(below, counts, strict=True) if count == most > 0]
            if (most, len(sound)) > (best[0], len(best[1])):
                best = most, sound
    return best[1]


# Rows and their faults


def _read_rows(
    plan: Plan, further: Mapping[str, ExtraColumn]
) -> tuple[FloatArray, IntArray | None, dict[int, list[RowFault]], Numbers]:
    """Return the numbers of the plan's columns, times, faults by row, and what was found out about the clock.

    A fault is a row that is not written like the rest, a cell of a pose without a finite number, a cell of
    a further column with a wrong number, or a missing time. Times that run backwards are an error of the
    file, as in a log: either of two rows may be the wrong one. Numbers are in the file's units, of shape
    (n, columns), times in [ns].

    Raises:
        LogError: If there is no row, if a fault remains without the wrong rows (the header again), or if the
            known times are no clock.
    """
    table, clock = plan.table, plan.clocks[plan.main]
    allowed = {column.index: ALLOWED for column in plan.roles.columns}
    allowed |= {column.index: further[name].allowed for name, column in plan.roles.further.items()}
    read = table.read([column.index for column in plan.roles.columns], clock.parts, allowed)
    if read.lasting:
        raise LogError(*read.lasting)
    numbers = read_text_times(table, clock.parts, read)
    if len(numbers.values) and np.isnan(numbers.values[-1]).all():  # as spreadsheets end
        filled = (row for row, cells in enumerate(table.iter_cells(), start=1) if any(cells))
        numbers = numbers.at(slice(max((*filled, *(row + 1 for row in numbers.unread)), default=0)))
    if not len(numbers.values):
        raise LogError(Finding("found no row with a number, allowed: at least one", table.file))
    faults = _find_faults(numbers, plan.roles, further, clock)
    if numbers.clock is None:
        return numbers.values, None, faults, numbers
    known = np.flatnonzero(numbers.clock > UNREADABLE)
    if not len(known):
        fault = f"found no time in any of {len(numbers.clock)} rows, allowed: at least one"
        hints = (Hint("time", "none", "leaves the column out"),)
        raise LogError(Finding(fault, table.file, column=clock.columns[0].header, hints=hints))
    timed = replace(numbers, values=np.empty((len(numbers.clock), 0)), findings=()).at(known)
    timed = separate_repeated(replace(timed, rows=known + 1))
    if findings := find_row_errors(table, timed, (), clock):
        raise LogError(*findings)
    assert timed.clock is not None
    return numbers.values, _fill_times(known, timed.clock, len(numbers.clock)), faults, timed


def _find_faults(
    numbers: Numbers, roles: Roles, further: Mapping[str, ExtraColumn], clock: Clock
) -> dict[int, list[RowFault]]:
    """Return all that is wrong with rows, in their order."""
    faults = {row + 1: list(of_row) for row, of_row in numbers.unread.items()}
    for finding in unknown_times(numbers, clock):
        faults.setdefault(finding.row or 0, []).append(RowFault(finding.message, (finding.column or "",)))
    poses, extra_values = np.split(numbers.values, [len(roles.columns) - len(roles.further)], axis=1)
    for row in np.flatnonzero(~np.isfinite(poses).all(axis=1)).tolist():
        of_row = faults.setdefault(row + 1, [])
        if not all(fault.columns for fault in of_row):
            continue  # the row as a whole
        reported = {name for fault in of_row for name in fault.columns}
        names: dict[str, list[str]] = {}  # columns in which the same was found
        for column, value in zip(roles.columns, poses[row].tolist(), strict=False):
            if not math.isfinite(value) and column.header not in reported:
                text = "no number" if math.isnan(value) else str(value)
                names.setdefault(text, []).append(column.header)
        of_row += [RowFault(f"found {text}, allowed: {ALLOWED}", (*same,)) for text, same in names.items()]
    for (name, column), values in zip(roles.further.items(), extra_values.T, strict=True):
        fits = further[name].fits(values) | np.isnan(values)
        for row in np.flatnonzero(~fits).tolist():
            text = f"found {values[row]:g}, allowed: {further[name].allowed}"
            faults.setdefault(row + 1, []).append(RowFault(text, (column.header,)))
    return {row: faults[row] for row in sorted(faults)}


def _fill_times(known: IntArray, times: IntArray, rows: int) -> IntArray:
    """Return a time for each row: known ones as they are, the rest in even steps between and around them."""
    if len(known) == rows:
        return times
    step = int(np.median(np.diff(times) // np.diff(known))) if len(known) > 1 else int(DEFAULT_PERIOD * 1e9)
    row = np.arange(rows)
    before, after = times[0] + (row - known[0]) * step, times[-1] + (row - known[-1]) * step
    inside = times[0] + np.rint(np.interp(row, known, times - times[0])).astype(np.int64)
    filled = np.where(row < known[0], before, np.where(row > known[-1], after, inside))
    filled[known] = times
    return np.asarray(filled, dtype=np.int64)


# Poses


def _to_poses(
    plan: Plan,
    values: FloatArray,
    faults: dict[int, list[RowFault]],
    form: RotationForm | None,
    further: Mapping[str, ExtraColumn],
) -> PoseTable:
    """Return the rows in SI, NaN for the pose of a row with an error, and the inferences about units."""
    finder = UnitFinder(UnitSources(plan.units, plan.tables.known, str(plan.tables.paths[plan.main])))
    columns = plan.roles.rotation
    position, turns, extra_values = np.split(values.copy(), [3, 3 + len(columns)], axis=1)
    extra_headers = {column.header for column in plan.roles.further.values()}
    for row, of_row in faults.items():
        if not all(fault.columns and extra_headers.issuperset(fault.columns) for fault in of_row):
            position[row - 1], turns[row - 1] = np.nan, np.nan
    lengths, warnings = _length_units(plan, finder, position)
    position *= [unit.factor for unit in lengths]
    extra, inferences = dict[str, FloatArray](), list[Inference]()
    for (name, column), cells in zip(plan.roles.further.items(), extra_values.T, strict=True):
        factor = 1.0
        if further[name].length and finder.sources.find(column, ("length",)):
            factor = finder.settle_positions([column], np.zeros((1, 1)))[0].factor
        elif further[name].length:
            factor = lengths[0].factor
            inferences.append(unit_inference([column], lengths[0].name, "as x, y, z", "named", every=False))
        extra[name] = np.where(np.isnan(cells), further[name].empty, cells * factor)
    rotation = None
    if form is not None:
        by_name = [stated.unit if stated else None for stated in finder.sources.of_rotation(columns, (form,))]
        units, assumed = _rotation_units(columns, form, _finite_rows(turns), by_name)
        rotation, wrong = _to_rotations(columns, form, turns * [unit.factor for unit in units])
        position[list(wrong)] = np.nan
        for index, fault in wrong.items():
            faults.setdefault(index + 1, []).append(fault)
        headers = [column.header for column in columns]
        inferences.append(form_inference(headers, form, units[0], "their names, or as given"))
        warnings += assumed
    faults = {row: faults[row] for row in sorted(faults)}
    about = (*finder.inferences, *inferences)
    return PoseTable(plan, position, rotation, extra, None, faults, about, tuple(warnings))


def _length_units(plan: Plan, finder: UnitFinder, values: FloatArray) -> tuple[list[Unit], list[LogWarning]]:
    """Return the units of x, y, z, m where none is given, and a warning if no row can be in m then.

    A point further away in m than any arm reaches is a target out of reach.
    """
    columns = plan.roles.position
    units = finder.settle_positions(columns, np.zeros((1, 3)))
    source = plan.tables.known.units if plan.tables.known else {}
    stated = "length" in source or any(column.unit or column.number in plan.units for column in columns)
    nearest = np.abs(_finite_rows(values)).max(axis=1).min(initial=np.inf)
    if stated or not MAX_REACH < nearest < np.inf:
        return units, []
    message = (
        f"no unit is given for {listed(columns)}: they are taken as m, though every row is beyond any arm"
    )
    hints = (Hint("unit", {"": "mm"}, "overrides this"),)
    return units, [LogWarning("assumed-unit", message, hints=hints)]


def _finite_rows(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values).all(axis=1)]


# Orientation


def _rotation_form(
    plan: Plan, file: str, requested: RotationForm | None, *, named: bool
) -> tuple[RotationForm | None, list[LogWarning]]:
    """Return the form of the orientation, None if the rows are positions, and what was assumed.

    rz, ry, rx are angles about the moving axes Z, Y, X; a header in the order rx, ry, rz may also mean a
    rotation vector, as UR writes: it is taken as the angles, with a warning.

    Raises:
        LogError: If only a part of an orientation is there, its form is not known, or a form is given for
            positions.
    """
    columns, forms = plan.roles.rotation, plan.roles.forms
    if not columns and requested:
        fault = f"{requested} given for {listed(plan.roles.position)} and no orientation"
        allowed = "its columns next to them"
        raise LogError(Finding(file=file, parameter="rotation", found=fault, allowed=allowed, hints=(NAMED,)))
    if not columns:
        patterns = (  # KUKA's A, B, C may be anything
            pattern
            for words in vocabulary().tcp_rotations
            if words.forms != ("zyx",)
            for pattern in words.patterns
            if "axis" in pattern.groupindex
        )
        parts = [*patterns]
        unused = [] if named else _unused_columns(plan)
        if half := [column for column in unused if any(part.search(column.key) for part in parts)]:
            fault, allowed = listed(half), "all of rz, ry, rx or of qx, qy, qz, qw, or none"
            message = f"found {fault} as a part of an orientation, allowed: {allowed}"
            raise LogError(Finding(message, file, hints=(NAMED,)))
        return None, []
    if len(forms) == 1:
        return forms[0], []
    if not all(column.words & _OUR_ANGLES for column in columns):
        hints = tuple(Hint("rotation", form, "specifies it") for form in forms)
        message = f"found {listed(columns)}, which may be {' or '.join(forms)}, allowed: one form"
        raise LogError(Finding(message, file, hints=hints))
    if columns[0].index > columns[1].index > columns[2].index:
        return "rpy", []
    message = f"{listed(columns)} are taken as angles about the moving axes Z, Y, X (rz, ry, rx)"
    hints = (Hint("rotation", "vector", "if they are a rotation vector, as UR writes"),)
    return "rpy", [LogWarning("assumed-rotation", message, hints=hints)]


def _rotation_units(
    columns: Sequence[Column], form: RotationForm, values: FloatArray, stated: Sequence[Unit | None]
) -> tuple[list[Unit], list[LogWarning]]:
    """Return the unit of each column of an orientation, rad where none is stated, and what was assumed.

    That angles are in rad is the form of targets, and no assumption, unless most of them are beyond a turn or
    they are called A, B, C as KUKA's, which are in degrees. Values are those of finite rows in the file's
    units, shape (n, columns).
    """
    if not is_angular(form):
        return [PURE] * len(columns), []
    known = [unit for unit in stated if unit is not None]
    if known:
        return [unit or known[0] for unit in stated], []
    units = [vocabulary().units["rad"]] * len(columns)
    beyond = len(values) > 0 and bool(np.median(np.abs(values).max(axis=1)) > MAX_RAD)
    if not beyond and not any(column.key in _KUKA_ANGLES for column in columns):
        return units, []
    why = ", though most are beyond a turn" if beyond else ""
    message = f"no unit is given for {listed(columns)}: they are taken as rad{why}"
    return units, [LogWarning("assumed-unit", message, hints=unit_hints(columns[:1], "deg"))]


def _to_rotations(
    columns: Sequence[Column], form: RotationForm, values: FloatArray
) -> tuple[FloatArray, dict[int, RowFault]]:
    """Return the rotation matrices [-], shape (n, 3, 3), and by index the faults of rows that hold none.

    Values are in [rad] or [-], shape (n, columns); a row with NaN stays NaN and has no fault.
    """
    names = tuple(column.header for column in columns)
    if form.startswith("quat"):
        is_wrong = np.abs(np.linalg.norm(values, axis=1) - 1.0) > MAX_NORM_ERROR
    else:
        is_wrong = np.isfinite(values).all(axis=1) & ~holds_orientation(values)
    faults = {row: RowFault(_no_rotation(values[row]), names) for row in np.flatnonzero(is_wrong).tolist()}
    sound = np.where(is_wrong[:, np.newaxis], np.nan, values)
    return to_matrices(to_quaternions(sound, form)), faults


def _no_rotation(values: FloatArray) -> str:
    """Return why four or nine numbers are no rotation: by a quaternion's norm, a matrix's R R^T."""
    if len(values) == 4:
        length = f"found a quaternion of norm {np.linalg.norm(values):.6g}"
        return f"{length}, allowed: 1 within {MAX_NORM_ERROR:g}"
    r = values.reshape(3, 3)
    fault = f"R R^T off I by {np.abs(r @ r.T - np.eye(3)).max():.3g} and det R = {np.linalg.det(r):.3g}"
    return f"found {fault}, allowed: a rotation, {ORTHOGONAL:g} off at most, det R = 1"
