"""A log from its rows: the unit of each column, values in SI, and how all of it is known.

1. `Reading`: plan, rows and map of a log; joints and recorded positions in the file's units identify the arm.
2. `propose_units`: the units of joints first, since those of rates, positions and orientation rest on them.
3. `convert`: q = sign * factor * value + offset, times in [ns] from the first row, and the log.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Hint, OptionError
from urmpipe_models.math3d import RotationForm
from urmpipe_pipeline.joint_log import (
    ASSUMED_PERIOD,
    ROLES,
    ROW_NS,
    Basis,
    Inference,
    JointLog,
    LogColumn,
    LogWarning,
    SourceFile,
    number_rows,
)
from urmpipe_pipeline.logs.clock import even_clock
from urmpipe_pipeline.logs.clock_columns import MAX_PERIOD, MIN_PERIOD, suggest_time_column
from urmpipe_pipeline.logs.columns import Column, columns_of
from urmpipe_pipeline.logs.formats.cells import significant_digits
from urmpipe_pipeline.logs.formats.clock_forms import EXPONENTS
from urmpipe_pipeline.logs.formats.opening import PATH, TABLE
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.proofs import Recorded, prove_by_kinematics
from urmpipe_pipeline.logs.rates import SURE_VARIED, period_of
from urmpipe_pipeline.logs.rotation import settle_rotation
from urmpipe_pipeline.logs.rows import Rows, check_not_empty, gap_warnings, missing_warnings
from urmpipe_pipeline.logs.units import UnitFinder, UnitSources
from urmpipe_pipeline.logs.vocabulary import Unit


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """The rows of a log as its files have them, before the units are known."""

    plan: Plan
    rows: Rows
    options: LogMap
    name: str
    files: tuple[SourceFile, ...]

    @property
    def recorded(self) -> Recorded:
        """Joints and recorded positions in the file's own units, which identify the arm."""
        return _record(self, None)

    def log(self, robot: Chain | None) -> JointLog:
        """Return the log in SI, once: the numbers become those of the log.

        Args:
            robot: The arm: it determines which joints slide, and by its kinematics the units.

        Raises:
            LogError: If a column has no value, or its unit is ambiguous.
            OptionError: If an option does not fit the log.
        """
        times = find_times(self)
        return convert(self, times, propose_units(self, robot, times.t_ns))

    @property
    def corrections(self) -> tuple[tuple[int, ...], tuple[float, ...]]:
        """The sign and the offset of each joint.

        Raises:
            OptionError: If they are not one for each joint, or a sign is not 1 or -1.
        """
        options, joints = self.options, len(self.rows.roles.joints)
        if options.shared and not joints:
            return (), ()
        for name, values in (("signs", options.signs), ("offsets", options.offsets)):
            if values and len(values) != joints:
                allowed = f"one for each of the {joints} joints"
                raise OptionError(f"{name}: found {len(values)}, allowed: {allowed}")
        wrong = [sign for sign in options.signs if sign not in (1, -1)]
        if wrong:
            raise OptionError(f"signs: found {wrong[0]}, allowed: 1 or -1")
        return options.signs or (1,) * joints, options.offsets or (0.0,) * joints

    @property
    def unit_sources(self) -> UnitSources:
        """What states the units of the columns."""
        tables = self.plan.tables
        file = self.plan.table.file
        return UnitSources(self.plan.units, tables.known, file, self.options.source is not None)


class Group(NamedTuple):
    """The columns of one role: their values in SI, shape (n, columns), and the units that they had."""

    columns: Sequence[Column]
    values: FloatArray
    units: Sequence[Unit]

    @property
    def recorded(self) -> FloatArray | None:
        """The values in SI, shape (n, columns); None if there are none, or one of the columns is empty."""
        if not self.units or np.isnan(self.values).all(axis=0).any():
            return None
        return self.values


class Proposal(NamedTuple):
    """The columns of each role in SI, in the order of `ROLES` after the time, and how their units are known.

    Attributes:
        groups: The columns of joints, rates, accelerations, position, orientation.
        form: The form of the orientation; None without one.
        units: The evidence and warnings.
    """

    groups: tuple[Group, Group, Group, Group, Group]
    form: RotationForm | None
    units: UnitFinder


def propose_units(reading: Reading, robot: Chain | None, t_ns: IntArray) -> Proposal:
    """Return the columns of a log in SI, with their units.

    Args:
        reading: The log.
        robot: The arm, or None.
        t_ns: Times of the rows in [ns], shape (n,).

    Raises:
        LogError: If a column has no value, or its unit is ambiguous.
        OptionError: If an option does not fit the log.
    """
    rows, roles, sources = reading.rows, reading.rows.roles, reading.unit_sources
    signs, _ = reading.corrections
    q, qd, qdd, position, rotation = (rows.values(group) for group in roles.groups)
    needed = roles.joints or roles.position
    names = [column.header for column in needed]
    check_not_empty(q if roles.joints else position, names, sources.file)
    recorded = _record(reading, robot)
    q, qd, qdd = recorded.q, _corrected(qd, signs), _corrected(qdd, signs)
    finder = UnitFinder(sources, prove_by_kinematics(robot, recorded))
    clock = None if rows.clock is None or rows.are_poses else t_ns
    ordered = np.sort(q, axis=0) if rows.are_poses else q  # poses have no order, and so no wraps
    units = finder.settle_joints(roles.joints, ordered, clock, robot) if roles.joints else []
    rates = finder.settle_rates(roles.rates, units, 1)
    accelerations = finder.settle_rates(roles.accelerations, units, 2)
    q = _in_si(q, units)
    lengths = finder.settle_positions(roles.position, position) if roles.position else []
    position = _in_si(position, lengths)
    if len(roles.position) == 2:
        position = np.column_stack((position, np.zeros(len(position))))
        finder.noted.append(Inference("z of the position", "0 m", "x and y are given alone"))
    arm = (robot, q) if robot and roles.joints else None
    form_given = reading.options.rotation is not None
    turned = settle_rotation(finder, roles.rotation, roles.forms, rotation, arm, form_given=form_given)
    groups = (
        Group(roles.joints, q, units),
        Group(roles.rates, _in_si(qd, rates), rates),
        Group(roles.accelerations, _in_si(qdd, accelerations), accelerations),
        Group(roles.position, position, lengths),
        Group(turned.columns, turned.values, turned.units),
    )
    return Proposal(groups, turned.form, finder)


def _record(reading: Reading, robot: Chain | None) -> Recorded:
    rows, roles, sources = reading.rows, reading.rows.roles, reading.unit_sources
    q = _corrected(rows.values(roles.joints), *reading.corrections)
    stated = (sources.of_joints(roles.joints, robot), sources.of_lengths(roles.position))
    joints, lengths = (tuple(item.unit if item else None for item in group) for group in stated)
    names = tuple(column.name for column in roles.joints)
    return Recorded(names, q, rows.values(roles.position), joints, lengths)


def _corrected(values: FloatArray, signs: Sequence[int], offsets: Sequence[float] = ()) -> FloatArray:
    if values.shape[1] and -1 in signs:
        values = values * np.array(signs)
    return values + np.array(offsets) if any(offsets) else values


def _in_si(values: FloatArray, units: Sequence[Unit]) -> FloatArray:
    factors = np.array([unit.factor for unit in units])
    if len(units) and (factors != 1.0).any():
        values *= factors  # in place: a log may have gigabytes
    return values


class Times(NamedTuple):
    """The times of the rows in [ns] from the first, shape (n,), the clock there, and how they are known."""

    t_ns: IntArray
    start: int = 0
    inferences: Sequence[Inference] = ()
    warnings: Sequence[LogWarning] = ()


def find_times(reading: Reading) -> Times:
    """Return the times of the rows: by the clock, recorded rates or a period; of poses their index."""
    rows, plan, options = reading.rows, reading.plan, reading.options
    if rows.are_poses:
        return Times(np.arange(rows.count, dtype=np.int64) * ROW_NS)
    if rows.clock is None:
        if options.period is None and (by_rates := _find_times_by_rates(rows)):
            return by_rates
        table, like = plan.table, None
        if options.time is None and table.header:
            columns = columns_of(plan.tables.tables, plan.tables.titles)
            of_table = [column for column in columns if column.table == plan.main]
            like = suggest_time_column(of_table, table, rows.roles.columns)
        t_ns, inferences, warnings = even_clock(rows.count, options.period, like=like.called if like else "")
        return Times(t_ns, 0, inferences, warnings)
    start = int(rows.clock[0])
    counted = "the first row; times are counted from it"
    inference = Inference("start of the time", plan.clock.format(start), counted)
    return Times(rows.clock - start, start, (inference,) if start else ())


def _find_times_by_rates(rows: Rows) -> Times | None:
    """Return times by the joints' recorded rates, h = steps / rates; None if they show no period."""
    roles = rows.roles
    if not roles.rates or not roles.joints:
        return None
    units = [(joint.unit, rate.unit) for joint, rate in zip(roles.joints, roles.rates, strict=True)]
    ratio = np.array([rate.factor / joint.factor if joint and rate else 1.0 for joint, rate in units])
    fit = period_of(rows.values(roles.joints), rows.values(roles.rates) * ratio)
    if fit is None or not MIN_PERIOD <= fit[0] <= MAX_PERIOD:
        return None
    period, variation = fit
    t_ns, _, _ = even_clock(rows.count, period)
    evidence = f"steps over recorded rates; half of the steps are within {100 * variation:.2g} % of it"
    basis: Basis = "proved" if variation <= SURE_VARIED else "assumed"
    inference = Inference("period", f"{period:g} s", evidence, hints=(Hint("period"),), basis=basis)
    if basis == "proved":
        return Times(t_ns, 0, (inference,))
    assumption = f"the rows are {1e3 * period:g} ms apart"
    message = f"no time column: by the recorded rates {assumption}"
    hints = (Hint("period", None, "sets another time between rows"),)
    warning = LogWarning(ASSUMED_PERIOD, message, hints=hints, assumption=assumption, role="time")
    return Times(t_ns, 0, (inference,), (warning,))


def convert(reading: Reading, times: Times, proposal: Proposal) -> JointLog:
    """Return the log of rows whose times and units are known."""
    plan, rows = reading.plan, reading.rows
    roles, tables, table = rows.roles, plan.tables, plan.table
    numbers, clock = rows.numbers[plan.main], plan.clock.as_label if rows.are_poses else plan.clock
    joints, rates, accelerations, position, rotation = proposal.groups
    in_text = (column for column in roles.joints if tables.tables[column.table].arrow is None)
    digits = significant_digits(
        chain(*(tables.tables[column.table].number_texts(column.index) for column in in_text))
    )
    coarse = "every joint value is written with as many"
    groups = [group for group in proposal.groups if group.columns]
    named = ((group.values, [column.name for column in group.columns]) for group in groups)
    row_warnings = (*roles.warnings, *proposal.units.warnings, *missing_warnings(named))
    return JointLog(
        name=reading.name,
        source=PATH if not roles.joints and tables.source == TABLE else tables.source,
        files=reading.files,
        t_ns=times.t_ns,
        clock_start_ns=times.start,
        joints=tuple(column.name for column in roles.joints),
        q=joints.values,
        first_line=table.first_line,
        qd=rates.recorded,
        qdd=accelerations.recorded,
        tcp_position=position.recorded,
        tcp_rotation=rotation.recorded,
        rotation_form=proposal.form,
        columns=(*(() if rows.are_poses else _time_columns(plan)), *_log_columns(reading, proposal)),
        digits=digits,
        inferences=(
            *tables.inferences,
            *table.inferences,
            *clock.inferences,
            *times.inferences,
            *roles.inferences,
            *rows.inferences,
            *proposal.units.inferences,
            *([Inference("significant digits", str(digits), coarse)] if digits else []),
        ),
        warnings=(
            *tables.warnings,
            *_unused_options(reading, uses_source=clock.stated_by == "source" or proposal.units.uses_source),
            *rows.warnings,
            *clock.warnings,
            *times.warnings,
            *number_rows(row_warnings, numbers.file_row),
            *gap_warnings(times.t_ns, numbers.file_row),
        ),
        timed=not rows.are_poses,
        externally_measured=roles.measured,
        file_rows=None if rows.count == numbers.file_row(rows.count) else numbers.rows,
    )


def _unused_options(reading: Reading, *, uses_source: bool) -> Iterator[LogWarning]:
    """Yield the options that name what the log does not have; a source is used if it stated a unit."""
    options = reading.options
    if reading.plan.tables.foreign and not uses_source:
        message = f"{options.source} has no effect: the log has none of its columns or graphs"
        yield LogWarning("source-not-used", message, parameter="source")
    if options.rotation and not reading.plan.roles.rotation:
        message = f"{options.rotation} has no effect: no orientation was found in the log"
        yield LogWarning("rotation-not-used", message, parameter="rotation")


def _time_columns(plan: Plan) -> Iterator[LogColumn]:
    for i, (column, part) in enumerate(zip(plan.clock.columns, plan.clock.parts, strict=True)):
        unit, number = part.unit, column.number
        factor = 10.0 ** (EXPONENTS.get(unit, 9) - 9)  # of a date: 1
        yield LogColumn(column.name, _header(plan, column), "time", i, unit, factor, number=number)


def _log_columns(reading: Reading, proposal: Proposal) -> Iterator[LogColumn]:
    """Yield the columns of each group with their units; signs and offsets are those of the joints."""
    signs, offsets = reading.corrections
    for role, group in zip(ROLES[1:], proposal.groups, strict=True):
        for i, (column, unit) in enumerate(zip(group.columns, group.units, strict=True)):
            sign = signs[i] if role in ("joint", "rate", "acceleration") else 1
            offset = offsets[i] if role == "joint" else 0.0
            yield LogColumn(
                name=column.name,
                header=_header(reading.plan, column),
                role=role,
                index=i,
                unit=unit.name,
                factor=unit.factor,
                sign=sign,
                offset=offset,
                number=column.number,
                uncertainty=proposal.units.uncertainties.get(column.number, ""),
            )


def _header(plan: Plan, column: Column) -> str:
    """Return the name of a column as its file has it; empty if the file does not name it."""
    table = plan.tables.tables[column.table]
    is_named = table.header is not None and ("header", "none") not in {
        (inference.what, inference.value) for inference in table.inferences
    }
    return column.header if is_named else ""
