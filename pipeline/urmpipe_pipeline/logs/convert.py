"""The numbers of a log's tables: read, checked, and joined on the same time.

A log from the numbers of its tables: units found, values in SI, with what was found out on the way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, map_collecting_errors
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
from urmpipe_pipeline.logs.formats.numbers import Numbers
from urmpipe_pipeline.logs.formats.opening import PATH, TABLE
from urmpipe_pipeline.logs.formats.padding import without_padding
from urmpipe_pipeline.logs.formats.text_table import first_left_out
from urmpipe_pipeline.logs.log_map import Evidence, LogMap
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.proofs import Recorded, prove_by_kinematics
from urmpipe_pipeline.logs.rates import SURE_VARIED, period_of, rounded_period
from urmpipe_pipeline.logs.roles import Roles
from urmpipe_pipeline.logs.rotation import Arm, settle_rotation
from urmpipe_pipeline.logs.row_checks import (
    MOST_SKIPPED,
    find_errors,
    gaps,
    may_skip,
    missing_samples,
    refuse_empty,
    trimmed,
    without_unread,
)
from urmpipe_pipeline.logs.timestamps import (
    continue_over_midnight,
    detect_static_poses,
    read_text_times,
    separate_repeated,
    sum_durations,
)
from urmpipe_pipeline.logs.units import UnitFinder, UnitSources
from urmpipe_pipeline.logs.vocabulary import Unit


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """The numbers of the columns that are used, in the file's own units.

    Attributes:
        columns: The columns that were read, by table.
        numbers: Their numbers, by table.
        clock: Times of the rows in [ns] on the file's clock, shape (n,); None without one.
        rows: How many rows there are.
        still: Whether they are static poses.
        roles: The columns, without those that could not be joined.
        inferences: What was found out while reading the times and joining.
        warnings: What was left out, and what a person should know about the times.
    """

    columns: Mapping[int, tuple[Column, ...]]
    numbers: Mapping[int, Numbers]
    clock: IntArray | None
    rows: int
    still: bool
    roles: Roles
    inferences: tuple[Inference, ...]
    warnings: tuple[LogWarning, ...]

    def values(self, group: Sequence[Column]) -> FloatArray:
        """Return the numbers of some columns in the file's own units, shape (n, columns).

        They are C-contiguous, and no copy if they are all.
        """
        if not group:
            return np.empty((self.rows, 0))
        table = group[0].table
        if tuple(group) == self.columns[table]:
            return self.numbers[table].values
        places = ((column.table, self.columns[column.table].index(column)) for column in group)
        return np.stack([self.numbers[table].values[:, place] for table, place in places], axis=1)


def read_content(plan: Plan, *, skip_bad: bool = False) -> Content:
    """Return the numbers that a plan asks for.

    Raises:
        LogError: With everything that is wrong with rows, cells and times of all tables, or if the files
            of one log differ in their times.
    """
    columns = {t: tuple(c for c in plan.roles.columns if c.table == t) for t in plan.used}
    read = map_collecting_errors(lambda table: _numbers(plan, table, columns[table], skip_bad), plan.used)
    numbers = dict(zip(plan.used, read, strict=True))
    roles, said = _joined(plan, numbers)
    if plan.time_file is not None:
        numbers[plan.main] = _with_times(plan, numbers[plan.main], skip_bad)
    main = numbers[plan.main]
    said = (*main.inferences, *said)
    warnings = tuple(dict.fromkeys(warning for one in numbers.values() for warning in one.warnings))
    return Content(columns, numbers, main.clock, len(main.values), main.still, roles, said, warnings)


def _numbers(plan: Plan, table: int, columns: Sequence[Column], skip_bad: bool) -> Numbers:
    """Return the numbers of one table; raise what is wrong with them."""
    layout, clock = plan.tables.layouts[table], plan.clocks[table]
    places = [column.index for column in columns]
    numbers = plan.tables.layouts[table].read(places, clock.parts)
    unread = f"{len(numbers.unread)} of {len(numbers.values)} rows cannot be read"
    too_many, warnings, file = None, [], layout.file
    if numbers.left_out:
        line, text = first_left_out(layout)
        verb = "is" if numbers.left_out == 1 else "are"
        said = f"{format_count(numbers.left_out, 'line')} without the labels of the rows {verb} left out"
        warnings.append(LogWarning("other-lines", f"{said}, first line {line}: {text}"))
    if skip_bad and may_skip(numbers):
        numbers, skipped = without_unread(numbers)
        warnings += skipped
    elif skip_bad and numbers.unread:
        too_many = Finding(unread, file, parameter="skip_bad", allowed=f"{MOST_SKIPPED:.0%} of them")
    elif may_skip(numbers):
        too_many = Finding(unread, file, hints=(Hint("skip_bad", True, "leaves them out"),))
    numbers, inferences = trimmed(read_text_times(layout, clock.parts, numbers))
    numbers = continue_over_midnight(numbers, clock)
    numbers, padding = without_padding(numbers, lambda: plan.tables.layouts[table].all_rows)
    if clock.are_durations:
        numbers = sum_durations(numbers, clock.columns[0].name)
    numbers = separate_repeated(detect_static_poses(plan, columns, numbers))
    if not len(numbers.values) and not numbers.findings:
        message = "found no row with a time or a number in the columns that are used, allowed: at least one"
        raise LogError(Finding(message, file))
    findings = find_errors(layout, numbers, [column.header for column in columns], clock)
    if findings:
        raise LogError(*findings, *([too_many] if too_many else []))
    warned = (*warnings, *padding, *number_rows(numbers.warnings, numbers.file_row))
    return replace(numbers, inferences=(*inferences, *numbers.inferences), warnings=warned)


def _with_times(plan: Plan, main: Numbers, skip_bad: bool) -> Numbers:
    """Return the numbers of the main table with the times of the other file, one for each row."""
    assert plan.time_file is not None
    times = _numbers(plan, plan.time_file, (), skip_bad)
    if len(times.values) != len(main.values):
        file, title = plan.tables.layouts[plan.time_file].file, plan.tables.paths[plan.main].name
        message = f"found {len(times.values)} times, allowed: {len(main.values)}, as {title} has rows"
        raise LogError(Finding(message, file))
    warnings = (*main.warnings, *times.warnings)
    return replace(main, clock=times.clock, inferences=times.inferences, warnings=warnings)


def _joined(plan: Plan, numbers: Mapping[int, Numbers]) -> tuple[Roles, tuple[Inference, ...]]:
    """Return the roles, without a recorded TCP from another graph that was sampled at other times."""
    roles = plan.roles
    findings = []
    for table in plan.used[1:]:
        difference = _difference(plan, numbers, table)
        if difference is None:
            continue
        needed = roles.joints or roles.position
        if any(column.table == table for column in needed) or len(set(plan.tables.paths)) > 1:
            findings.append(difference)
            continue
        roles = roles.without([column for column in roles.columns if column.table == table])
    if findings:
        raise LogError(*findings)
    if roles == plan.roles:
        return roles, ()
    return roles, (Inference("other graphs", "left out", "they were sampled at other times than the joints"),)


def _difference(plan: Plan, numbers: Mapping[int, Numbers], table: int) -> Finding | None:
    """Return where the times of a table differ from those of the main one."""
    main, other = numbers[plan.main], numbers[table]
    layout = plan.tables.layouts[table]
    file, title = layout.file, plan.tables.titles[plan.main]
    if (main.clock is None) != (other.clock is None):
        here, there = ("no time column", "with one") if other.clock is None else ("a time column", "without")
        return Finding(f"found {here}, allowed: {there}, as in {title}: one log has one clock", file)
    if main.clock is not None and other.clock is not None:
        count = min(len(main.clock), len(other.clock))
        different = np.flatnonzero(main.clock[:count] != other.clock[:count])
        if len(different):
            row = int(different[0])
            times = f"{other.clock[row] / 1e9:.9g} s, allowed: {main.clock[row] / 1e9:.9g} s"
            message = f"found {times}, as in {title}: the tables of one log share their times"
            at = other.file_row(row + 1)
            line = layout.lines_of([at]).get(at)
            return Finding(message, file, line, at, plan.clocks[table].columns[0].header)
    if len(main.values) != len(other.values):
        message = f"found {len(other.values)} rows, allowed: {len(main.values)}, as in {title}"
        return Finding(f"{message}: the tables of one log share their times", file)
    return None


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """The columns of one role: their values in SI, shape (n, columns), and the units that they had."""

    columns: Sequence[Column]
    values: FloatArray
    units: Sequence[Unit]

    @property
    def recorded(self) -> FloatArray | None:
        """The values; None if there are none, or one of the columns is empty."""
        if not self.units or np.isnan(self.values).all(axis=0).any():
            return None
        return self.values


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """Everything that was recorded, in the order of the roles, and what was found out about units."""

    groups: tuple[_Group, _Group, _Group, _Group, _Group]
    form: RotationForm | None
    inferences: Sequence[Inference]
    warnings: Sequence[LogWarning]
    evidence: Mapping[int, Evidence]
    by_source: bool

    @property
    def named(self) -> Iterator[tuple[FloatArray, list[str]]]:
        """The values of each group that is used, shape (n, columns), with the names of its columns."""
        return ((one.values, [column.name for column in one.columns]) for one in self.groups if one.columns)


def assemble(
    plan: Plan,
    content: Content,
    options: LogMap,
    robot: Chain | None,
    name: str,
    files: Sequence[SourceFile],
) -> JointLog:
    """Return the log of what was read.

    Raises:
        LogError: If a column has no value, or its unit cannot be told.
        OptionError: If an option does not fit the log.
    """
    roles, layout = content.roles, plan.tables.layouts[plan.main]
    numbers, clock = content.numbers[plan.main], plan.clock.as_label if content.still else plan.clock
    t_ns, start, timed, noticed = _times(content, plan, options)
    signs, offsets = _corrections(options, len(roles.joints))
    measured = _measured(plan, content, robot, t_ns, options)
    joints, rates, seconds, position, rotation = measured.groups
    texts = (column for column in roles.joints if plan.tables.layouts[column.table].arrow is None)
    written = (plan.tables.layouts[column.table].number_texts(column.index) for column in texts)
    digits, coarse = significant_digits(chain(*written)), "every joint value is written with as many"
    return JointLog(
        name=name,
        source=PATH if not roles.joints and plan.tables.source == TABLE else plan.tables.source,
        files=tuple(files),
        t_ns=t_ns,
        clock_start_ns=start,
        joints=tuple(column.name for column in roles.joints),
        q=joints.values,
        first_line=layout.first_line,
        qd=rates.recorded,
        qdd=seconds.recorded,
        tcp_position=position.recorded,
        tcp_rotation=rotation.recorded,
        rotation_form=measured.form,
        columns=(
            *(() if content.still else _time_columns(plan)),
            *_used_columns(plan, measured, signs, offsets),
        ),
        digits=digits,
        inferences=(
            *(one for found in (plan.tables, layout, clock) for one in found.inferences),
            *timed,
            *(one for found in (roles, content, measured) for one in found.inferences),
            *([Inference("significant digits", str(digits), coarse)] if digits else []),
        ),
        warnings=(
            *plan.tables.warnings,
            *_not_used(plan, options, by_source=clock.by_source or measured.by_source),
            *content.warnings,
            *clock.warnings,
            *noticed,
            *number_rows(
                (*roles.warnings, *measured.warnings, *missing_samples(measured.named)), numbers.file_row
            ),
            *gaps(t_ns, numbers.file_row),
        ),
        timed=not content.still,
        externally_measured=roles.measured,
        file_rows=None if len(t_ns) == numbers.file_row(len(t_ns)) else numbers.rows,
    )


def _not_used(plan: Plan, options: LogMap, *, by_source: bool) -> Iterator[LogWarning]:
    """Yield the options that say what the log does not have; a source is used if it told a unit."""
    if plan.tables.foreign and not by_source:
        said = f"{options.source} has no effect: the log has none of its columns or graphs"
        yield LogWarning("source-not-used", said, parameter="source")
    if options.rotation and not plan.roles.rotation:
        said = f"{options.rotation} has no effect: no orientation was found in the log"
        yield LogWarning("rotation-not-used", said, parameter="rotation")


def recorded(plan: Plan, content: Content, options: LogMap, robot: Chain | None = None) -> Recorded:
    """Return joints and recorded positions before their units are known, with their stated units.

    Raises:
        LogError: If a stated unit is not known, or does not fit.
        OptionError: If an option does not fit the log.
    """
    roles, sources = content.roles, _unit_sources(plan, options)
    q = _corrected(content.values(roles.joints), *_corrections(options, len(roles.joints)))
    stated = (sources.of_joints(roles.joints, robot), sources.of_lengths(roles.position))
    joints, lengths = (tuple(item.unit if item else None for item in group) for group in stated)
    names = tuple(column.name for column in roles.joints)
    return Recorded(names, q, content.values(roles.position), joints, lengths)


def _unit_sources(plan: Plan, options: LogMap) -> UnitSources:
    file, given = plan.tables.layouts[plan.main].file, options.source is not None
    return UnitSources(plan.units, plan.tables.known, file, given)


def _measured(
    plan: Plan,
    content: Content,
    robot: Chain | None,
    t_ns: IntArray,
    options: LogMap,
) -> _Measured:
    """Return what was recorded in SI: the units of the joints first, since others rest on them."""
    roles, sources = content.roles, _unit_sources(plan, options)
    signs, _ = _corrections(options, len(roles.joints))
    q, qd, qdd, tcp, rotation = (content.values(group) for group in roles.groups)
    refuse_empty(q if roles.joints else tcp, [c.header for c in roles.joints or roles.position], sources.file)
    raw = recorded(plan, content, options, robot)
    q, qd, qdd = raw.q, _corrected(qd, signs), _corrected(qdd, signs)
    finder = UnitFinder(sources, prove_by_kinematics(robot, raw))
    clock = None if content.clock is None or content.still else t_ns
    judged = np.sort(q, axis=0) if content.still else q  # in no order, poses have no wraps
    units = finder.settle_joints(roles.joints, judged, clock, robot) if roles.joints else []
    rates = finder.settle_rates(roles.rates, units, 1)
    seconds = finder.settle_rates(roles.accelerations, units, 2)
    q = _in_si(q, units)
    lengths = (
        finder.settle_positions(roles.position, tcp, has_joints=bool(roles.joints)) if roles.position else []
    )
    tcp = _in_si(tcp, lengths)
    planar = len(roles.position) == 2
    if planar:
        tcp = np.column_stack((tcp, np.zeros(len(tcp))))
    turned = settle_rotation(
        roles.rotation,
        roles.forms,
        rotation,
        stated := sources.of_rotation(roles.rotation, roles.forms),
        Arm(robot, q) if robot and roles.joints else None,
        finder.kinematic.base if finder.kinematic else None,
        form_given=options.rotation is not None,
        in_base=not (roles.measured or content.still),
    )
    if turned.form:
        finder.warn_not_reached(roles.rotation, stated, turned.units, "rotation")
    evidence = finder.evidence | {column.number: turned.evidence for column in turned.columns}
    return _Measured(
        groups=(
            _Group(roles.joints, q, units),
            _Group(roles.rates, _in_si(qd, rates), rates),
            _Group(roles.accelerations, _in_si(qdd, seconds), seconds),
            _Group(roles.position, tcp, lengths),
            _Group(turned.columns, turned.values, turned.units),
        ),
        form=turned.form,
        inferences=(
            *finder.inferences,
            *([Inference("z of the position", "0 m", "x and y are given alone")] if planar else []),
            *turned.inferences,
        ),
        warnings=(*finder.warnings, *turned.warnings),
        evidence=evidence,
        by_source=finder.uses_source,
    )


def _times(
    content: Content, plan: Plan, options: LogMap
) -> tuple[IntArray, int, tuple[Inference, ...], Sequence[LogWarning]]:
    """Return the rows' times in [ns] from the first, the clock there in [ns], and what there is to say.

    Of static poses their numbers stand for times.
    """
    if content.still:
        return np.arange(content.rows, dtype=np.int64) * ROW_NS, 0, (), ()
    if content.clock is None:
        if options.period is None and (by_rates := _by_rates(content)):
            return by_rates
        like = None if options.time else _like_a_time(plan, content.roles.columns)
        t_ns, said, noticed = even_clock(content.rows, options.period, like=like.called if like else "")
        return t_ns, 0, said, noticed
    start = int(content.clock[0])
    counted = Inference(
        "start of the time", plan.clock.format(start), "the first row; times are counted from it"
    )
    return content.clock - start, start, (counted,) if start else (), ()


def _by_rates(
    content: Content,
) -> tuple[IntArray, int, tuple[Inference, ...], Sequence[LogWarning]] | None:
    """Return the times of rows without a clock by the joints' recorded rates; None if these tell none."""
    roles = content.roles
    if not roles.rates or not roles.joints:
        return None
    joints, rates = content.values(roles.joints), content.values(roles.rates)
    told = [(q.unit, v.unit) for q, v in zip(roles.joints, roles.rates, strict=True)]
    ratio = np.array([v.factor / q.factor if q and v else 1.0 for q, v in told])
    found = period_of(joints, rates * ratio)
    if found is None or not MIN_PERIOD <= found[0] <= MAX_PERIOD:
        return None
    period, varies = rounded_period(found[0]), found[1]
    t_ns, _, _ = even_clock(content.rows, period)
    evidence = f"steps over recorded rates; half of the steps are within {100 * varies:.2g} % of it"
    basis: Basis = "proved" if varies <= SURE_VARIED else "assumed"
    said = Inference("period", f"{period:g} s", evidence, hints=(Hint("period"),), basis=basis)
    if basis == "proved":
        return t_ns, 0, (said,), ()
    apart = f"the rows are {1e3 * period:g} ms apart"
    warning = LogWarning(
        ASSUMED_PERIOD, f"no time column: by the recorded rates {apart}", assumption=apart, role="time",
        hints=(Hint("period", None, "sets another time between rows"),),
    )  # fmt: skip
    return t_ns, 0, (said,), (warning,)


def _like_a_time(plan: Plan, used: Sequence[Column]) -> Column | None:
    """Return a column of the main table that may be the time though its name does not say so."""
    layout = plan.tables.layouts[plan.main]
    columns = columns_of(plan.tables.layouts, plan.tables.titles) if layout.header else ()
    return suggest_time_column([one for one in columns if one.table == plan.main], layout, used)


def _corrections(options: LogMap, joints: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return the sign and the offset of each joint, having refused others than one a joint."""
    if options.shared and not joints:
        return (), ()
    for what, given in (("signs", options.signs), ("offsets", options.offsets)):
        if given and len(given) != joints:
            raise OptionError(f"{what}: found {len(given)}, allowed: one for each of the {joints} joints")
    wrong = [sign for sign in options.signs if sign not in (1, -1)]
    if wrong:
        raise OptionError(f"signs: found {wrong[0]}, allowed: 1 or -1")
    return options.signs or (1,) * joints, options.offsets or (0.0,) * joints


def _corrected(values: FloatArray, signs: Sequence[int], offsets: Sequence[float] = ()) -> FloatArray:
    """Return values with the user's signs and offsets; the array itself where there are none."""
    if values.shape[1] and -1 in signs:
        values = values * np.array(signs)
    if any(offsets):
        values = values + np.array(offsets)
    return values


def _header(plan: Plan, column: Column) -> str:
    """Return the name of a column as its file has it; empty if the file has no line of names."""
    layout = plan.tables.layouts[column.table]
    return "" if layout.header in (None, layout.first_line) else column.header


def _time_columns(plan: Plan) -> Iterator[LogColumn]:
    """Yield the columns of the clock with their units; the factor of text is 1."""
    clock = plan.clock
    for i, (column, unit) in enumerate(zip(clock.columns, clock.units.values(), strict=True)):
        factor = 10.0 ** (EXPONENTS.get(unit, 9) - 9)  # of a date: 1
        header = _header(plan, column)
        yield LogColumn(column.name, header, "time", i, unit, factor, number=column.number)


def _used_columns(
    plan: Plan, measured: _Measured, signs: Sequence[int], offsets: Sequence[float]
) -> Iterator[LogColumn]:
    """Yield the columns of each group with their units; signs and offsets are those of the joints."""
    for role, group in zip(ROLES[1:], measured.groups, strict=True):
        for i, (column, unit) in enumerate(zip(group.columns, group.units, strict=True)):
            sign = signs[i] if role in ("joint", "rate", "acceleration") else 1
            offset = offsets[i] if role == "joint" else 0.0
            header = _header(plan, column)
            known = measured.evidence.get(column.number)
            doubt = known.why if known and known.basis == "assumed" else ""
            read = (unit.name, unit.factor, sign, offset)
            yield LogColumn(column.name, header, role, i, *read, column.number, doubt)


def _in_si(values: FloatArray, units: Sequence[Unit]) -> FloatArray:
    """Bring the columns to SI, in place; as they are without units."""
    factors = np.array([unit.factor for unit in units])
    if len(units) and (factors != 1.0).any():
        values *= factors
    return values
