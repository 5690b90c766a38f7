"""One log from its files: the numbers of its tables in SI, with names and what was found out."""

from __future__ import annotations

import os.path
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from urmpipe_models.chain import Chain
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
from urmpipe_pipeline.sources.clock import EXPONENTS, Clock, even_clock
from urmpipe_pipeline.sources.columns import Column
from urmpipe_pipeline.sources.content import Content, read_content
from urmpipe_pipeline.sources.options import ReadOptions
from urmpipe_pipeline.sources.plan import Plan, make_plan
from urmpipe_pipeline.sources.table import release_memory
from urmpipe_pipeline.sources.tables import PATH, TABLE, open_tables
from urmpipe_pipeline.sources.text import fingerprint
from urmpipe_pipeline.sources.units import UnitFinder
from urmpipe_pipeline.sources.vocabulary import Unit


def read_log(
    paths: Sequence[Path], options: ReadOptions | None = None, robot: Chain | None = None
) -> JointLog:
    """Return a log as its files have it, in SI.

    Args:
        paths: The log's file; several if its source writes one a plot (SolidWorks), joined on their times.
        options: What the user says where the files need not, or cannot, tell.
        robot: The arm: it tells how many joints there are, their names, and which of them slide.

    Raises:
        LogError: With everything that is wrong with the files, each with its file, line and column.
        OptionError: If an option's value makes no sense.
    """
    options = options or ReadOptions()
    files = [Path(path) for path in paths]
    tables = open_tables(files, options)
    with ThreadPoolExecutor(max_workers=1) as beside:
        hashed = [beside.submit(fingerprint, file) for file in files]
        plan = make_plan(tables, options, robot)
        content = read_content(plan)
        log = _joint_log(plan, content, options, robot, files, [future.result() for future in hashed])
    release_memory()
    return log


def _joint_log(
    plan: Plan,
    content: Content,
    options: ReadOptions,
    robot: Chain | None,
    files: Sequence[Path],
    sources: Sequence[SourceFile],
) -> JointLog:
    """Return the log of what was read: units found, values in SI."""
    roles, layout, clock = content.roles, plan.tables.layouts[plan.main], plan.clock
    file = str(layout.segment.path)
    t_ns, start, timed, noticed = _times(content, options)
    q, qd, qdd = (content.values(group) for group in (roles.joints, roles.rates, roles.accelerations))
    tcp, rotation = content.values(roles.position), content.values(roles.rotation)
    refuse_empty(q if roles.joints else tcp, [c.header for c in roles.joints or roles.position], file)
    finder = UnitFinder(plan.units, plan.tables.known, file)
    recorded_times = None if content.clock is None else t_ns
    joint_units = finder.joints(roles.joints, q, recorded_times, robot) if roles.joints else []
    rate_units = finder.derivatives(roles.rates, joint_units, 1)
    second_units = finder.derivatives(roles.accelerations, joint_units, 2)
    tcp_units = finder.positions(roles.position, tcp) if roles.position else []
    rotation_units = finder.rotations(roles.rotation)
    digits = _digits(plan, roles.joints)
    groups = (roles.joints, roles.rates, roles.accelerations, roles.position, roles.rotation)
    units = (joint_units, rate_units, second_units, tcp_units, rotation_units)
    missing = [
        warning
        for group, values in zip(groups, (q, qd, qdd, tcp, rotation), strict=True)
        for warning in missing_samples(values, [column.name for column in group])
    ]
    return JointLog(
        name=_name(files),
        source=PATH if not roles.joints and plan.tables.source == TABLE else plan.tables.source,
        files=tuple(sources),
        t_ns=t_ns,
        clock_start_ns=start,
        joints=tuple(column.name for column in roles.joints),
        q=_in_si(q, joint_units),
        first_line=layout.first_line,
        qd=_recorded(qd, rate_units),
        qdd=_recorded(qdd, second_units),
        tcp_position=_recorded(tcp, tcp_units),
        tcp_rotation=_recorded(rotation, rotation_units),
        rotation_form="vector" if roles.rotation else None,
        columns=(*_time_columns(clock), *_used_columns(groups, units)),
        digits=digits,
        inferences=(
            *plan.tables.inferences,
            *layout.inferences,
            *clock.inferences,
            *timed,
            *roles.inferences,
            *content.inferences,
            *finder.inferences,
            *_about_digits(digits),
        ),
        warnings=(*clock.warnings, *noticed, *finder.warnings, *missing, *gaps(t_ns)),
    )


def _times(
    content: Content, options: ReadOptions
) -> tuple[IntArray, int, tuple[Inference, ...], Sequence[LogWarning]]:
    """Return the rows' times in [ns] from the first, the clock there in [ns], and what there is to say."""
    if content.clock is None:
        t_ns, said, noticed = even_clock(content.rows, options.period)
        return t_ns, 0, said, noticed
    start = int(content.clock[0])
    return content.clock - start, start, (), content.warnings


def _time_columns(clock: Clock) -> list[LogColumn]:
    """Return the columns of the clock with their units; the factor of text is 1."""
    return [
        LogColumn(column.name, column.header, "time", i, unit, 10.0 ** (EXPONENTS.get(unit, 9) - 9))
        for i, (column, unit) in enumerate(zip(clock.columns, clock.units.values(), strict=True))
    ]


def _used_columns(groups: Sequence[Sequence[Column]], units: Sequence[Sequence[Unit]]) -> Iterator[LogColumn]:
    """Yield the columns of each group with their units."""
    for role, group, group_units in zip(ROLES[1:], groups, units, strict=True):
        for i, (column, unit) in enumerate(zip(group, group_units, strict=True)):
            yield LogColumn(column.name, column.header, role, i, unit.name, unit.factor)


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


def _name(files: Sequence[Path]) -> str:
    """Return the stem of the only file, or what the stems of several share at their beginning."""
    if len(files) == 1:
        return files[0].stem
    shared = os.path.commonprefix([file.stem for file in files])  # noqa: RUF071 (stems, not paths)
    return shared.strip(" _-.,()[]#") or files[0].stem
