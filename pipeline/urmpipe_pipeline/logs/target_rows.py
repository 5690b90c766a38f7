"""A table in which a wrong row does not stop the others: its rows, and what is wrong with which.

A log is refused for one wrong cell, since a gap in a motion is a gap in everything computed from it. The
rows of a table of targets stand each for itself.

The orientation of targets: its form and unit, its matrices, and the rows in which it is none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.math3d import RotationForm, is_angular, to_matrices, to_quaternions
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.clock import DEFAULT_PERIOD, Clock
from urmpipe_pipeline.logs.columns import Column, listed, unit_hints
from urmpipe_pipeline.logs.formats.clock_forms import UNREADABLE
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.numbers import Numbers, RowFault
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.pose_columns import ORTHOGONAL
from urmpipe_pipeline.logs.roles import Roles
from urmpipe_pipeline.logs.rotation import PURE
from urmpipe_pipeline.logs.rows import find_row_errors, unknown_times
from urmpipe_pipeline.logs.timestamps import read_text_times, separate_repeated
from urmpipe_pipeline.logs.vocabulary import Patterns, Unit, vocabulary

ALLOWED = "a finite number"
"""What the cells of a pose may hold."""


@dataclass(frozen=True, slots=True)
class ExtraColumn:
    """A column beside the poses.

    Attributes:
        patterns: Of its name.
        allowed: The values that a cell may hold, in words.
        fits: Returns which numbers, in the file's own unit and of shape (n,), a cell may hold.
        empty: The value of an empty cell, in SI.
        length: Whether it holds lengths.
    """

    patterns: Patterns
    allowed: str
    fits: Callable[[FloatArray], BoolArray]
    empty: float
    length: bool


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The rows of a table, in the file's own units.

    Attributes:
        values: Of the columns of the plan, in the file's own units, shape (n, columns); in a row with a fault
            without meaning.
        clock: Times in [ns] on the file's clock, shape (n,); None without one. A row whose own time is
            not known stands between its neighbours.
        faults: Data row from 1, and all that is wrong with it.
        inferences: What was found out about the clock.
        warnings: What a person should know about the clock.
    """

    values: FloatArray
    clock: IntArray | None
    faults: Mapping[int, Sequence[RowFault]]
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()


def read_rows(plan: Plan, further: Mapping[str, ExtraColumn]) -> Rows:
    """Return the rows that a plan asks for, all in one table, with a fault where a row cannot be used.

    A fault is a row that is not written like the others, a cell of a pose without a finite number, a cell of
    a further column with a wrong number, or a missing time. Times that run backwards are an error of the
    file, as in a log: either of two rows may be the wrong one.

    Raises:
        LogError: If there is no row, if a fault remains without the wrong rows (the header again), or if the
            known times are no clock.
    """
    layout, clock = plan.tables.layouts[plan.main], plan.clocks[plan.main]
    places = [column.index for column in plan.roles.columns]
    allowed = dict.fromkeys(places, ALLOWED)
    allowed |= {column.index: further[name].allowed for name, column in plan.roles.further.items()}
    read = layout.read(places, clock.parts, allowed)
    if read.lasting:
        raise LogError(*read.lasting)
    numbers = _without_blank_end(layout, read_text_times(layout, clock.parts, read))
    if not len(numbers.values):
        raise LogError(Finding("found no row with a number, allowed: at least one", layout.file))
    faults = _faults(numbers, plan.roles, further, clock)
    times, about = _whole_clock(layout, numbers, clock)
    return Rows(numbers.values, times, faults, about.inferences, about.warnings)


def _faults(
    numbers: Numbers, roles: Roles, further: Mapping[str, ExtraColumn], clock: Clock
) -> dict[int, list[RowFault]]:
    """Return what is wrong with rows, in their order: all of it."""
    faults = {row + 1: list(of_row) for row, of_row in numbers.unread.items()}
    for one in unknown_times(numbers, clock):
        faults.setdefault(one.row or 0, []).append(RowFault(one.message, (one.column or "",)))
    beside = len(roles.further)
    poses, others = np.split(numbers.values, [len(roles.columns) - beside], axis=1)
    for row in np.flatnonzero(~np.isfinite(poses).all(axis=1)).tolist():
        told = faults.setdefault(row + 1, [])
        if not all(fault.columns for fault in told):
            continue  # the row as a whole
        reported = {name for fault in told for name in fault.columns}
        cells = zip(roles.columns, poses[row].tolist(), strict=False)
        told += _not_finite((c, value) for c, value in cells if c.header not in reported)
    for (name, column), values in zip(roles.further.items(), others.T, strict=True):
        fits = further[name].fits(values) | np.isnan(values)
        for row in np.flatnonzero(~fits).tolist():
            said = f"found {values[row]:g}, allowed: {further[name].allowed}"
            faults.setdefault(row + 1, []).append(RowFault(said, (column.header,)))
    return {row: faults[row] for row in sorted(faults)}


def _not_finite(cells: Iterable[tuple[Column, float]]) -> Iterator[RowFault]:
    """Yield what is wrong with the numbers of a row, columns in which the same is found together."""
    names: dict[str, list[str]] = {}
    for column, value in cells:
        if not math.isfinite(value):
            names.setdefault("no number" if math.isnan(value) else str(value), []).append(column.header)
    for found, of in names.items():
        yield RowFault(f"found {found}, allowed: {ALLOWED}", tuple(of))


def _without_blank_end(layout: LogTable, numbers: Numbers) -> Numbers:
    """Return the numbers without rows at the end whose cells are all empty, as spreadsheets leave them."""
    if not len(numbers.values) or not np.isnan(numbers.values[-1]).all():
        return numbers
    last = max((row + 1 for row in numbers.unread), default=0)
    for row, cells in enumerate(layout.iter_cells(), start=1):
        if any(cells):
            last = max(last, row)
    return numbers.at(slice(last))


def _whole_clock(layout: LogTable, numbers: Numbers, clock: Clock) -> tuple[IntArray | None, Numbers]:
    """Return a time for every row, and what was found out about the known ones, if they are a clock."""
    if numbers.clock is None:
        return None, numbers
    known = np.flatnonzero(numbers.clock > UNREADABLE)
    if not len(known):
        said = f"found no time in any of {len(numbers.clock)} rows, allowed: at least one"
        hints = (Hint("time", "none", "leaves the column out"),)
        raise LogError(Finding(said, layout.file, column=clock.columns[0].header, hints=hints))
    timed_rows = replace(numbers, values=np.empty((len(numbers.clock), 0)), findings=(), wrong=0).at(known)
    told = separate_repeated(replace(timed_rows, rows=known + 1))
    findings = find_row_errors(layout, told, (), clock)
    if findings:
        raise LogError(*findings)
    assert told.clock is not None
    return _between(known, told.clock, len(numbers.clock)), told


def _between(known: IntArray, times: IntArray, rows: int) -> IntArray:
    """Return a time for each row: known ones as they are, others in even steps between and around them."""
    if len(known) == rows:
        return times
    step = int(np.median(np.diff(times) // np.diff(known))) if len(known) > 1 else int(DEFAULT_PERIOD * 1e9)
    row = np.arange(rows)
    before, after = times[0] + (row - known[0]) * step, times[-1] + (row - known[-1]) * step
    inside = times[0] + np.rint(np.interp(row, known, times - times[0])).astype(np.int64)
    filled = np.where(row < known[0], before, np.where(row > known[-1], after, inside))
    filled[known] = times
    return np.asarray(filled, dtype=np.int64)


UNIT_NORM = 1e-3
"""The norm of a quaternion may differ from 1 by this, as printed digits do; then it is divided by it."""

MOST_RAD = 2 * np.pi * 1.01
"""Angles without a given unit, most of them beyond a turn in [rad], are hardly in rad."""

NAMED = Hint("orientation", None, "with --position and --rotation names them")
"""The remedy where the names of columns show no orientation."""

_OURS = frozenset(("rx", "ry", "rz"))
_KUKA = frozenset("abc")


def target_form(
    roles: Roles, unused: Sequence[Column], file: str, given: RotationForm | None, *, named: bool
) -> tuple[RotationForm | None, list[LogWarning]]:
    """Return the form of an orientation, None if the rows are positions, and what was assumed.

    rz, ry, rx are angles about the moving axes Z, Y, X; a header in the order rx, ry, rz may also mean a
    rotation vector, as UR writes: it is taken as the angles, with a warning.

    Args:
        roles: What the columns are.
        unused: The columns that are nothing.
        file: The file, for errors.
        given: The form that the user gives.
        named: Whether the user names the columns of the pose.

    Raises:
        LogError: If only a part of an orientation is there, its form is not known, or a form is given for
            positions.
    """
    found = roles.rotation
    if not found:
        _refuse_half(roles, unused, file, given, named=named)
        return None, []
    if len(roles.forms) == 1:
        return roles.forms[0], []
    if not all(column.words & _OURS for column in found):
        hints = tuple(Hint("rotation", form, "specifies it") for form in roles.forms)
        said = f"found {listed(found)}, which may be {' or '.join(roles.forms)}, allowed: one form"
        raise LogError(Finding(said, file, hints=hints))
    if found[0].index > found[1].index > found[2].index:
        return "rpy", []
    said = f"{listed(found)} are taken as angles about the moving axes Z, Y, X (rz, ry, rx)"
    hints = (Hint("rotation", "vector", "if they are a rotation vector, as UR writes"),)
    return "rpy", [LogWarning("assumed-rotation", said, hints=hints)]


def rotation_units(
    columns: Sequence[Column], form: RotationForm, values: FloatArray, told: Sequence[Unit | None]
) -> tuple[list[Unit], list[LogWarning]]:
    """Return the unit of each column of an orientation, rad where none is given, and what was assumed.

    That angles are in rad is the form of targets, and no assumption, unless most of them are beyond a turn or
    they are called A, B, C as KUKA's, which are in degrees. Values are those of finite rows in the file's own
    units, shape (n, columns).
    """
    if not is_angular(form):
        return [PURE] * len(columns), []
    known = [unit for unit in told if unit is not None]
    if known:
        return [unit or known[0] for unit in told], []
    units = [vocabulary().units["rad"]] * len(columns)
    beyond = len(values) > 0 and bool(np.median(np.abs(values).max(axis=1)) > MOST_RAD)
    if not beyond and not any(column.key in _KUKA for column in columns):
        return units, []
    why = ", though most are beyond a turn" if beyond else ""
    said = f"no unit is given for {listed(columns)}: they are taken as rad{why}"
    return units, [LogWarning("assumed-unit", said, hints=unit_hints(columns[:1], "deg"))]


def target_rotations(
    columns: Sequence[Column], form: RotationForm, values: FloatArray
) -> tuple[FloatArray, dict[int, RowFault]]:
    """Return the rotation matrices [-], shape (n, 3, 3), and by index what is wrong with rows that hold none.

    Values are in [rad] or [-], shape (n, columns); a row with NaN stays NaN and has no fault.
    """
    names = tuple(column.header for column in columns)
    faults = {row: RowFault(said, names) for row, said in _no_rotations(values, form)}
    sound = values.copy()
    sound[list(faults)] = np.nan
    return to_matrices(to_quaternions(sound, form)), faults


def _no_rotations(values: FloatArray, form: RotationForm) -> Iterator[tuple[int, str]]:
    """Yield index and reason of rows that hold no rotation: by a quaternion's norm, a matrix's R R^T."""
    if form.startswith("quat"):
        norm = np.linalg.norm(values, axis=1)
        for row in np.flatnonzero(np.abs(norm - 1.0) > UNIT_NORM).tolist():
            yield row, f"found a quaternion of norm {norm[row]:.6g}, allowed: 1 within {UNIT_NORM:g}"
    elif form == "matrix":
        r = values.reshape(-1, 3, 3)
        off = np.abs(r @ r.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0)
        with np.errstate(invalid="ignore"):  # rows with NaN, which have faults already
            det = np.linalg.det(r)
        for row in np.flatnonzero((off > ORTHOGONAL) | (det < 0)).tolist():
            found = f"R R^T off I by {off[row]:.3g} and det R = {det[row]:.3g}"
            yield row, f"found {found}, allowed: a rotation, {ORTHOGONAL:g} off at most, det R = 1"


def _refuse_half(
    roles: Roles, unused: Sequence[Column], file: str, given: RotationForm | None, *, named: bool
) -> None:
    """Raise a `LogError` if a form is given for positions, or half an orientation stands beside them."""
    if given:
        said, allowed = (
            f"{given} given for {listed(roles.position)} and no orientation",
            "its columns beside them",
        )
        raise LogError(Finding(file=file, parameter="rotation", found=said, allowed=allowed, hints=(NAMED,)))
    half = [] if named else [column for column in unused if _is_part(column)]
    if half:
        said = f"found {listed(half)} as a part of an orientation"
        allowed = "all of rz, ry, rx or of qx, qy, qz, qw, or none"
        raise LogError(Finding(f"{said}, allowed: {allowed}", file, hints=(NAMED,)))


def _is_part(column: Column) -> bool:
    """Return whether a column is called as one of an orientation; KUKA's A, B, C may be anything."""
    patterns = (
        one for words in vocabulary().tcp_rotations if words.forms != ("zyx",) for one in words.patterns
    )
    return any("axis" in one.groupindex and one.search(column.key) for one in patterns)
