"""Targets from a file: where the tool shall be, a row a pose or a position; with times, a path."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.messages import Hint
from urmpipe_models.orientation import FORMS, RotationForm, width
from urmpipe_pipeline.joint_log import Inference, LogWarning, SourceFile
from urmpipe_pipeline.sources.clocks.clock import even_clock, unused_period
from urmpipe_pipeline.sources.columns.columns import columns_of, listed
from urmpipe_pipeline.sources.options import ReadOptions
from urmpipe_pipeline.sources.plan import Plan, make_plan
from urmpipe_pipeline.sources.tables.opening import PATH, open_tables
from urmpipe_pipeline.sources.tables.text import fingerprint
from urmpipe_pipeline.sources.targets.row_faults import Rows, read_rows
from urmpipe_pipeline.sources.targets.sniff_targets import sniff_targets
from urmpipe_pipeline.sources.targets.target_rotation import rotation_units, target_form, target_rotations
from urmpipe_pipeline.sources.units.rotation import form_inference
from urmpipe_pipeline.sources.units.told import Tellers
from urmpipe_pipeline.sources.units.units import LONGEST_REACH, UnitFinder
from urmpipe_pipeline.sources.vocabulary import Unit, vocabulary


@dataclass(frozen=True, slots=True, eq=False)
class TargetFile:
    """The targets of a file, a row each.

    Attributes:
        file: The file.
        row: Its data rows, from 1, shape (n,).
        t_ns: Time of each row in integer [ns] from the first, shape (n,), rising: the targets are a path.
            None where nothing tells a time: each target stands for itself. A faulty row whose own time is
            not known has one between its neighbours'.
        position: In [m], shape (n, 3); NaN in a row with a fault.
        rotation: Matrices [-], shape (n, 3, 3), NaN in a row with a fault; None if the file has positions
            only.
        faults: What is wrong with a row, one line, by the data row.
        clock_start_ns: The file's own clock at the first row in integer [ns].
        inferences: What was found out about the file.
        warnings: What a person should know about it.
    """

    file: SourceFile
    row: IntArray
    t_ns: IntArray | None
    position: FloatArray
    rotation: FloatArray | None
    faults: Mapping[int, str]
    clock_start_ns: int = 0
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()

    def __len__(self) -> int:
        return len(self.row)

    @property
    def targets(self) -> Targets:
        """The poses for inverse kinematics, faulty rows as NaN."""
        return Targets(self.position, self.rotation)


def read_targets(file: Path, options: ReadOptions | None = None, tsp: float | None = None) -> TargetFile:
    """Return the targets of a file: x, y, z and, where it has one, the orientation.

    Lengths are in m and angles in rad where neither the header nor the options tell; rz, ry, rx mean
    R = Rz Ry Rx. A file with a time is a path, and so is one without if the time between its rows is
    given: t = i Tsp.

    Args:
        file: A text table, as a log may be.
        options: What the user says where the file need not, or cannot, tell; what it says about joints is
            not asked. Its period is the same as `tsp`.
        tsp: Time between the rows in [s], of a file without one.

    Raises:
        LogError: If the file as a whole is wrong: no x, y, z, an unknown unit, no row, a clock that repeats
            or runs backwards.
        OptionError: If an option's value makes no sense.

    Source: [UrmArm2021]_ eq. 22 (t = i Tsp).
    """
    asked = replace(options or ReadOptions(), joints=(), names=(), signs=(), offsets=())
    asked, length = _plain_length(asked)
    tables = open_tables([Path(file)], asked, partial(sniff_targets, position=asked.position))
    plan = make_plan(tables, replace(asked, source=PATH), None)
    if length is not None:  # what a column's own option says comes first
        plain = dict.fromkeys((column.number for column in plan.roles.position), length)
        plan = replace(plan, units={**plain, **plan.units})
    _refuse_unclear(plan, named=bool(asked.position))
    columns = [c for c in columns_of(tables.layouts, tables.titles) if c not in plan.clock.columns]
    form, assumed = target_form(plan.roles, columns, str(file), asked)
    rows = read_rows(plan)
    poses = _poses(plan, rows, form)
    t_ns, start, said, noticed = _times(rows, tsp, asked.period)
    return TargetFile(
        file=fingerprint(Path(file)),
        row=np.arange(1, len(rows.values) + 1),
        t_ns=t_ns,
        position=poses.position,
        rotation=poses.rotation,
        faults=poses.faults,
        clock_start_ns=start,
        inferences=(*_about_file(plan), *rows.inferences, *said, *poses.inferences),
        warnings=(*plan.clock.warnings, *rows.warnings, *assumed, *poses.warnings, *noticed),
    )


def _plain_length(asked: ReadOptions) -> tuple[ReadOptions, Unit | None]:
    """Return the options without a plain length (mm), and that unit, which is of x, y, z here."""
    unit = vocabulary().unit(asked.unit.get("", ""))
    if unit is None or unit.quantity != "length" or unit.order:
        return asked, None
    return replace(asked, unit={name: one for name, one in asked.unit.items() if name}), unit


@dataclass(frozen=True, slots=True, eq=False)
class _Poses:
    """The poses of the rows in SI, what is wrong with which, and what was found out about their units."""

    position: FloatArray
    rotation: FloatArray | None
    faults: Mapping[int, str]
    inferences: Sequence[Inference]
    warnings: Sequence[LogWarning]


def _poses(plan: Plan, rows: Rows, form: RotationForm | None) -> _Poses:
    """Return the poses that rows hold, all NaN in a row with a fault."""
    finder = UnitFinder(Tellers(plan.units, plan.tables.known, str(plan.tables.paths[plan.main])))
    values = rows.values.copy()
    values[[row - 1 for row in rows.faults]] = np.nan
    lengths, warnings = _length_units(plan, finder, values[:, :3])
    position = values[:, :3] * [unit.factor for unit in lengths]
    if form is None:
        return _Poses(position, None, rows.faults, finder.inferences, warnings)
    columns, turned = plan.roles.rotation, values[:, 3:]
    told = [one.unit if one else None for one in finder.rotations(columns, (form,))]
    units, assumed = rotation_units(columns, form, _finite(turned), told)
    rotation, none = target_rotations(columns, form, turned * [unit.factor for unit in units])
    position[list(none)] = np.nan
    faults = {**rows.faults, **{index + 1: said for index, said in none.items()}}
    found = form_inference([column.header for column in columns], form, units[0], "their names, or as given")
    ordered = {row: faults[row] for row in sorted(faults)}
    return _Poses(position, rotation, ordered, (*finder.inferences, found), (*warnings, *assumed))


def _length_units(plan: Plan, finder: UnitFinder, values: FloatArray) -> tuple[list[Unit], list[LogWarning]]:
    """Return the units of x, y, z, m where none is told, and a warning if no row can be in m then.

    What reaches further than an arm in m is a target out of reach.
    """
    columns = plan.roles.position
    units = finder.positions(columns, np.zeros((1, 3)))
    source = plan.tables.known.units if plan.tables.known else {}
    told = "length" in source or any(one.unit or one.number in plan.units for one in columns)
    nearest = np.abs(_finite(values)).max(axis=1).min(initial=np.inf)
    if told or not LONGEST_REACH < nearest < np.inf:
        return units, []
    said = f"no unit is given for {listed(columns)}: they are taken as m, though every row is beyond any arm"
    hints = (Hint("unit", {"": "mm"}, "reads them otherwise"),)
    return units, [LogWarning("assumed-unit", said, hints=hints)]


def _finite(values: FloatArray) -> FloatArray:
    """Return the rows without NaN."""
    return values[np.isfinite(values).all(axis=1)]


def _times(
    rows: Rows, tsp: float | None, period: float | None
) -> tuple[IntArray | None, int, tuple[Inference, ...], list[LogWarning]]:
    """Return the rows' times in [ns] from the first, the clock there in [ns], and what there is to say."""
    step, keyword = (period, "period") if tsp is None else (tsp, "tsp")
    if rows.clock is None and step is None:
        return None, 0, (), []
    if rows.clock is None:
        times, said, noticed = even_clock(len(rows.values), step, keyword)
        return times, 0, said, noticed
    start = int(rows.clock[0])
    unused = [] if step is None else [unused_period(keyword)]
    return rows.clock - start, start, (), unused


def _refuse_unclear(plan: Plan, *, named: bool) -> None:
    """Raise if columns without names are left over, or the orientation stands in another table.

    Raises:
        LogError: With what may be read instead.
    """
    layout, used = plan.tables.layouts[plan.main], [*plan.clock.columns, *plan.roles.columns]
    file = str(layout.segment.path)
    if len(plan.used) > 1:
        found = f"found {listed(plan.roles.rotation)} in another table than {listed(plan.roles.position)}"
        raise LogError(Finding(f"{found}, allowed: one table", file))
    cells = len(layout.names) - (not layout.names[-1])
    if layout.header is None and cells > len(used) and not (plan.roles.rotation or named):
        time = " beside the time" if plan.clock.columns else ""
        count = cells - len(plan.clock.columns)
        found = f"found {count} columns without names{time}, allowed: x, y, z alone or with an orientation"
        raise LogError(Finding(found, file, hints=tuple(_remedies(count, timed=bool(time)))))


def _remedies(count: int, *, timed: bool) -> Iterator[Hint]:
    """Yield what tells so many columns without names: a header, the form of the orientation, the time."""
    yield Hint("", does="name the columns in a header")
    yield from (Hint("rotation", form, "says which") for form in FORMS if 3 + width(form) == count)
    if not timed and count - 1 in {3, *(3 + width(form) for form in FORMS)}:
        yield Hint("time", "1", "if the first is the time")


def _about_file(plan: Plan) -> Iterator[Inference]:
    """Yield what was found out about the file before its rows were read."""
    for found in (plan.tables, plan.tables.layouts[plan.main], plan.clock, plan.roles):
        yield from found.inferences
