"""A log from the numbers of its tables: units found, values in SI, with what was found out on the way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.chain import Chain
from urmpipe_models.errors import OptionError
from urmpipe_pipeline.joint_log import (
    ROLES,
    FloatArray,
    Inference,
    IntArray,
    JointLog,
    LogColumn,
    LogWarning,
    SourceFile,
)
from urmpipe_pipeline.sources.cells import is_number, plain, significant_digits
from urmpipe_pipeline.sources.checks import gaps, missing_samples, refuse_empty
from urmpipe_pipeline.sources.clock import even_clock
from urmpipe_pipeline.sources.clock_units import EXPONENTS
from urmpipe_pipeline.sources.columns import Column
from urmpipe_pipeline.sources.content import Content
from urmpipe_pipeline.sources.kinematic_units import by_kinematics
from urmpipe_pipeline.sources.options import ReadOptions
from urmpipe_pipeline.sources.plan import Plan
from urmpipe_pipeline.sources.rotation import settle_rotation
from urmpipe_pipeline.sources.tables import PATH, TABLE
from urmpipe_pipeline.sources.units import UnitFinder
from urmpipe_pipeline.sources.vocabulary import Unit


def assemble(
    plan: Plan,
    content: Content,
    options: ReadOptions,
    robot: Chain | None,
    name: str,
    files: Sequence[SourceFile],
) -> JointLog:
    """Return the log of what was read.

    Args:
        plan: What was to be read.
        content: The numbers.
        options: What the user says.
        robot: The arm, or None.
        name: What the log is called.
        files: Its files.

    Raises:
        LogError: If a column has no value, or a unit cannot be told or contradicts the data.
        OptionError: If an option does not fit the log.
    """
    roles, layout = content.roles, plan.tables.layouts[plan.main]
    t_ns, start, timed, noticed = _times(content, options)
    q, qd, qdd = (content.values(group) for group in (roles.joints, roles.rates, roles.accelerations))
    tcp, rotation = content.values(roles.position), content.values(roles.rotation)
    file = str(layout.segment.path)
    refuse_empty(q if roles.joints else tcp, [c.header for c in roles.joints or roles.position], file)
    signs, offsets = _corrections(options, len(roles.joints))
    q, qd, qdd = _corrected(q, signs, offsets), _corrected(qd, signs), _corrected(qdd, signs)
    finder = UnitFinder(plan.units, plan.tables.known, file, by_kinematics(robot, q, tcp))
    units = finder.joints(roles.joints, q, t_ns if content.timed else None, robot) if roles.joints else []
    rates = finder.derivatives(roles.rates, units, 1)
    seconds = finder.derivatives(roles.accelerations, units, 2)
    lengths = finder.positions(roles.position, tcp) if roles.position else []
    q = _in_si(q, units)
    told = finder.rotations(roles.rotation, roles.forms)
    turned = settle_rotation(roles.rotation, roles.forms, rotation, told, (robot, q) if robot else None)
    used = (
        (roles.joints, q, units),
        (roles.rates, qd, rates),
        (roles.accelerations, qdd, seconds),
        (roles.position, tcp, lengths),
        (roles.rotation if turned.form else (), rotation, turned.units),
    )
    digits = _digits(plan, roles.joints)
    return JointLog(
        name=name,
        source=PATH if not roles.joints and plan.tables.source == TABLE else plan.tables.source,
        files=tuple(files),
        t_ns=t_ns,
        clock_start_ns=start,
        joints=tuple(column.name for column in roles.joints),
        q=q,
        first_line=layout.first_line,
        qd=_recorded(qd, rates),
        qdd=_recorded(qdd, seconds),
        tcp_position=_recorded(tcp, lengths),
        tcp_rotation=_recorded(rotation, turned.units),
        rotation_form=turned.form,
        columns=(
            *_time_columns(plan),
            *_used_columns(plan, [(group, found) for group, _, found in used], signs, offsets),
        ),
        digits=digits,
        inferences=(
            *plan.tables.inferences,
            *layout.inferences,
            *plan.clock.inferences,
            *timed,
            *roles.inferences,
            *content.inferences,
            *finder.inferences,
            *turned.inferences,
            *_about_digits(digits),
        ),
        warnings=(
            *content.warnings,
            *plan.clock.warnings,
            *noticed,
            *finder.warnings,
            *turned.warnings,
            *_missing(used),
            *gaps(t_ns),
        ),
    )


def _times(
    content: Content, options: ReadOptions
) -> tuple[IntArray, int, tuple[Inference, ...], Sequence[LogWarning]]:
    """Return the rows' times in [ns] from the first, the clock there in [ns], and what there is to say."""
    if content.clock is None:
        t_ns, said, noticed = even_clock(content.rows, options.period)
        return t_ns, 0, said, noticed
    start = int(content.clock[0])
    return content.clock - start, start, (), ()


def _corrections(options: ReadOptions, joints: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return the sign and the offset of each joint.

    Raises:
        OptionError: If there are others than one a joint, or a sign is neither 1 nor -1.
    """
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
    plan: Plan,
    groups: Sequence[tuple[Sequence[Column], Sequence[Unit]]],
    signs: Sequence[int],
    offsets: Sequence[float],
) -> Iterator[LogColumn]:
    """Yield the columns of each group with their units; signs and offsets are those of the joints."""
    for role, (group, units) in zip(ROLES[1:], groups, strict=True):
        for i, (column, unit) in enumerate(zip(group, units, strict=True)):
            sign = signs[i] if role in ("joint", "rate", "acceleration") else 1
            offset = offsets[i] if role == "joint" else 0.0
            header = _header(plan, column)
            yield LogColumn(column.name, header, role, i, unit.name, unit.factor, sign, offset, column.number)


def _in_si(values: FloatArray, units: Sequence[Unit]) -> FloatArray:
    """Bring the columns to SI, in place."""
    factors = np.array([unit.factor for unit in units])
    if (factors != 1.0).any():
        values *= factors
    return values


def _recorded(values: FloatArray, units: Sequence[Unit]) -> FloatArray | None:
    """Return what the log recorded beside the joints in SI; None if a column is not there or empty."""
    if not units or np.isnan(values).all(axis=0).any():
        return None
    return _in_si(values, units)


def _missing(used: Sequence[tuple[Sequence[Column], FloatArray, Sequence[Unit]]]) -> Iterator[LogWarning]:
    """Yield a warning for each column in which samples are missing."""
    for group, values, _ in used:
        if group:
            yield from missing_samples(values, [column.name for column in group])


def _digits(plan: Plan, joints: Sequence[Column]) -> int | None:
    cells = []
    for column in joints:
        layout = plan.tables.layouts[column.table]
        numbers = (cell for cell in layout.cells(column.index) if is_number(cell, layout.decimal))
        cells += [plain(cell, layout.decimal) for cell in numbers]
    return significant_digits(cells)


def _about_digits(digits: int | None) -> tuple[Inference, ...]:
    if digits is None:
        return ()
    return (Inference("significant digits", str(digits), "every joint value is written with as many"),)
