"""Joints among columns without names: as many as the arm has, proved by their rates, or asked about.

Trajectories without a header: a pose a row, alone or behind a time, as TUM and KITTI write it.

What a table holds shows in all its rows: of seven numbers the last four have length 1, or 12 or 16 are a
homogeneous transform. No joints keep that, so none are looked for, whatever robot is given.

Joints by their place: tables without a header, and plots with one result a file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.errors import Finding, Hint, LogError, format_value
from urmpipe_models.math3d import RotationForm, column_count
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.columns import (
    NAME_JOINTS,
    TIMES_OF_ANOTHER,
    UNKNOWN,
    Column,
    chosen_columns,
    listed,
    take,
    which_joints,
)
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.numbers import capped
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.pose_columns import (
    Pose,
    chosen_pose,
    have_length_1,
    odd_rows,
    trailing_matrix,
    trailing_quaternion,
    transform_pose,
    with_form,
)
from urmpipe_pipeline.logs.rates import SURE, proved_blocks
from urmpipe_pipeline.logs.roles import (
    GIVEN,
    Roles,
    about_pose,
    check_count,
    joint_inference,
    not_used,
    path_inference,
)
from urmpipe_pipeline.logs.vocabulary import split_unit

TWO_TURNS = 720.0, 2.0 * math.tau
"""No joint of an arm goes further either way in [deg] and in [rad], as clocks, wheels and counts do."""

SELDOM = 0.2
"""A column that moves in a smaller share of the rows than others do, by this factor, may be a gripper's."""

MOST_UNASKED = 7
"""So many columns without names are joints where no robot tells how many there are; more may be blocks."""

FEW = 3
"""So few joints may go on as others say by chance, where no robot tells how many there are."""

USUAL = (6, 7, 5, 4)
"""How many joints arms have, the usual first."""

Found = tuple[tuple[Column, ...], tuple[Column, ...], str]
"""Joints, their rates, and why."""


def joints_among(
    free: Sequence[Column], layout: LogTable, whole: LogTable | None, robot: Chain | None
) -> Found:
    """Return the joints among columns without names, their rates, and why.

    They are all columns, if these are as many as the robot has joints; those whose rates stand beside them;
    without a robot all of a few columns that move alike.

    Raises:
        LogError: With the question which they are, if none of that holds.
    """
    count = len(robot.coordinates) if robot else None
    if whole is None or (count is not None and len(free) <= count):
        return tuple(free), (), f"no header: joints in order{', as many as the robot has' if robot else ''}"
    values = whole.values([column.index for column in free])
    if count is None and len(layout.names) == 1 and len(values) > FEW and (np.diff(values[:, 0]) > 0).all():
        found = "one column, which always increases, as times do"
        raise which_joints(layout.file, found, [free], UNKNOWN, TIMES_OF_ANOTHER)
    blocks = proved_blocks(values, count)
    if (
        len(blocks) == 1
        and blocks[0].fills(len(free))
        and (count or len(blocks[0].joints) > FEW or blocks[0].weakest >= SURE)
    ):
        joints, rates = (tuple(free[k] for k in some) for some in (blocks[0].joints, blocks[0].rates))
        alike = f"steps and rates correlate by {blocks[0].correlation:.3g}"
        return joints, rates, f"columns {listed(rates)} are their rates: {alike}"
    odd = unlike_joints(values)
    if not blocks and count is None and len(free) <= MOST_UNASKED and not odd.any():
        return tuple(free), (), "no header: joints in order"
    groups = [[free[k] for k in block.joints] for block in blocks] + _groups(free, odd, count)
    others = [column for column, is_odd in zip(free, odd, strict=True) if is_odd]
    found = f"{len(free)} columns that no header names"
    found += f", of which {listed(others)} may be no joints" if others else ""
    found += f", and robot {robot.name} has {count} joints" if robot else ""
    path = (Hint("source", "path", "reads them as x, y, z"),) if len(free) == 3 else ()
    raise which_joints(layout.file, found, groups, UNKNOWN, *path)


def unlike_joints(values: FloatArray) -> BoolArray:
    """Return which columns are unlike joints, or unlike the others, shape (columns,).

    They go further than any arm's joint, or than one in rad where most of the others do not; they move seldom
    while others do; or they count.

    Args:
        values: The columns in the file's own units, shape (n, columns); NaN where a sample is missing.
    """
    if len(values) < 2:
        return np.zeros(values.shape[1], dtype=bool)
    size = np.sort(np.abs(values), axis=0)[math.ceil(0.9 * (len(values) - 1))]  # NaN counts as the largest
    in_rad = int(2 * np.count_nonzero(size <= TWO_TURNS[1]) > len(size))
    steps = np.diff(values, axis=0)
    moves = (steps != 0.0).mean(axis=0)
    with np.errstate(invalid="ignore"):  # infinite numbers have no remainder
        whole = (values[0] % 1.0 == 0.0) & (steps[0] % 1.0 == 0.0)
    counts = whole & (steps[0] > 0.0) & (steps == steps[0]).all(axis=0)
    seldom = (moves > 0.0) & (moves < SELDOM * np.median(moves))
    return np.asarray((size > TWO_TURNS[in_rad]) | seldom | (counts & (len(values) > FEW)))


def _groups(free: Sequence[Column], odd: BoolArray, count: int | None) -> list[Sequence[Column]]:
    """Return the columns that may be all joints: those between odd ones, or blocks of one size."""
    runs = [
        [free[k] for k, _ in run]
        for is_odd, run in groupby(enumerate(odd), lambda pair: bool(pair[1]))
        if not is_odd
    ]
    near = sorted((run for run in runs if 1 < len(run) < len(free)), key=len, reverse=True)
    if count:
        return [run for run in (*near, free[:count], free[-count:]) if len(run) == count]
    if len(free) <= MOST_UNASKED:
        return [*near[:1], free]
    groups = [
        free[k : k + size]
        for size in USUAL
        for k in (range(0, len(free), size) if len(free) % size == 0 else (0,))
    ]
    return [*groups, *near[:1], free]


QUATERNION, TRANSFORMS = 7, (12, 16)
"""Columns of a position with a quaternion, and of a transform without and with its last row 0, 0, 0, 1."""

LEAST_ROWS = 3
"""In fewer rows, four of seven joints may have length 1 by chance."""

SPACES = " "
"""Delimiter of TUM's form."""


def clock_before_pose(columns: Sequence[Column], whole: LogTable) -> tuple[tuple[Column, ...], str] | None:
    """Return the clock of a table of poses, none of poses alone, and why; None of any other table.

    Args:
        columns: All columns of a table without a header.
        whole: All its numbers.
    """
    pose = _pose(columns, whole)
    if pose is None:
        return None
    before = tuple(columns[:1]) if columns[0] not in (*pose.position, *pose.rotation) else ()
    if not before:
        return (), f"the {len(columns)} columns are a pose: {pose.evidence}"
    single = len(whole.samples.values) < 2
    rises = single or bool(whole.increasing[whole.numeric_columns.index(before[0].index)])
    return (before, f"it increases, and a pose stands behind it: {pose.evidence}") if rises else None


def path_of_poses(
    columns: Sequence[Column], whole: Sequence[LogTable], rotation: RotationForm | None
) -> Roles | None:
    """Return the roles of the columns of a table of poses, with or without its clock; None of any other.

    In TUM's form w is the last of a quaternion; without a header that is assumed, and said.

    Args:
        columns: Columns of a table without a header.
        whole: All numbers of each table.
        rotation: Form of the orientation, if the user tells it.
    """
    table = whole[columns[0].table] if columns else None
    pose = _pose(columns, table) if table else None
    if pose is None or table is None:
        return None
    warnings = []
    timed = len(table.names) == 1 + QUATERNION  # poses alone are no TUM
    if rotation is None and len(pose.forms) > 1 and timed and table.delimiter == SPACES:
        pose = replace(pose, forms=("quat_xyzw",))
        warnings = [_about_order(pose.rotation)]
    pose = with_form(pose, rotation)
    rest = [column for column in columns if column not in (*pose.position, *pose.rotation)]
    said = [path_inference(listed(pose.position), pose.evidence), *about_pose(pose)[1:]]
    said += not_used(rest, "no header tells what it is")
    return Roles(
        position=pose.position, rotation=pose.rotation, forms=pose.forms, inferences=tuple(said),
        warnings=tuple(warnings),
    )  # fmt: skip


def _pose(columns: Sequence[Column], whole: LogTable) -> Pose | None:
    """Return the pose that columns hold in every row, alone or behind one of them."""
    for count in (*TRANSFORMS, QUATERNION):
        held = columns[-count:]
        if len(columns) - count not in (0, 1) or not {c.index for c in columns}.issubset(
            whole.numeric_columns
        ):
            continue
        values = whole.values([column.index for column in held])
        values = values[np.isfinite(values).all(axis=1)]
        if count != QUATERNION:
            pose = transform_pose(held, values)
        elif len(values) < LEAST_ROWS and len(whole.names) == QUATERNION:
            pose = None
        else:
            pose = _with_quaternion(held) if len(values) and have_length_1(values[:, 3:]).all() else None
        if pose is not None:
            return pose
    return None


def _with_quaternion(held: Sequence[Column]) -> Pose:
    """Return seven columns as a position and a quaternion, whose order nothing tells."""
    evidence = "the last four of seven numbers have length 1"
    return Pose(tuple(held[:3]), tuple(held[3:]), ("quat_xyzw", "quat_wxyz"), evidence)


def _about_order(rotation: Sequence[Column]) -> LogWarning:
    """Say that the order of a quaternion is that of TUM's form."""
    said = f"no header tells the order of {listed(rotation)}, a quaternion: taken as x, y, z, w, as of TUM"
    hints = (
        Hint("rotation", "quat_wxyz", "overrides this"),
        Hint("rotation", "quat_xyzw", "confirms it"),
    )
    assumed = "the quaternions are x, y, z, w"
    return LogWarning("assumed-form", said, hints=hints, assumption=assumed, role="rotation")


NO_HEADER = "no header tells what they are"
ASSUMED_JOINTS = "assumed-joints"  # warning: all columns of a table without names are the joints


def without_header(
    columns: Sequence[Column],
    layouts: Sequence[LogTable],
    options: LogMap,
    robot: Chain | None,
    whole: Sequence[LogTable],
    *,
    path: bool,
) -> Roles:
    """Return the roles of the columns of a table without a header: joints in order, as many as the robot has.

    The last 16 or 12 columns may be a pose: that they are a homogeneous transform shows in their numbers;
    and so may the last seven: x, y, z and a quaternion, whose length is 1 (a trajectory in TUM's form).

    Args:
        columns: The columns, without the clock.
        layouts: All tables; the columns are of one.
        options: What the user says: joint columns, position, orientation.
        robot: The arm; without one every column is a joint.
        whole: All numbers of each table.
        path: The user says that it is a path: the columns are x, y, z, and an orientation behind them.

    Raises:
        LogError: If there are too few columns, or one of them holds text.
    """
    layout = layouts[columns[0].table if columns else 0]
    file = layout.file
    columns = [column for column in columns if column.header]
    pose = chosen_pose(columns, options)
    if options.joints:
        joints = chosen_columns(columns, options.joints, parameter="joints")
        check_count(joints, file, robot)
        return _by_place(joints, columns, robot, GIVEN, pose)
    alone = path_of_poses(columns, whole, options.rotation) if pose is None else None
    if alone is not None:
        return alone
    for column in () if path else columns:  # of a path they are wrong rows
        if column.text:
            cell = layout.cells(column.index)[0]
            message = f"found {format_value(cell)} in a table without a header, allowed: numbers"
            raise layout.error(message, column.name, NAME_JOINTS)
    if path:
        return _path_by_place(columns, layouts, file, options, pose)
    if not columns:
        message = "found no column except the time, allowed: the joints"
        raise LogError(Finding(message, file=file, hints=(TIMES_OF_ANOTHER,)))
    behind = None if pose else _trailing_pose(columns, layouts, robot)
    pose = with_form(pose or behind or Pose(), options.rotation)
    used = (*pose.position, *pose.rotation)
    start = min(map(columns.index, used)) if behind else len(columns)
    free = [column for column in columns[:start] if column not in used]
    joints, rates, evidence = joints_among(free, layout, whole[free[0].table] if free else None, robot)
    check_count(joints, file, robot)
    roles = _by_place(joints, columns, robot, evidence, pose, rates)
    if robot or rates or behind or len(joints) == 1:  # a count, rates, or a pose after them
        return roles
    return replace(roles, warnings=(*roles.warnings, _assumed_joints(joints)))


def _assumed_joints(joints: Sequence[Column]) -> LogWarning:
    """Return the warning that columns without names are taken as the joints, as nothing shows it."""
    taken = f"columns {joints[0].number} to {joints[-1].number} are the joints"
    hints = (take(joints, "confirms it"), Hint("joints", None, "names others"))
    message = f"no header names the columns: {taken}, in order"
    return LogWarning(ASSUMED_JOINTS, message, hints=hints, assumption=taken, role="joint")


def _path_by_place(
    columns: Sequence[Column], layouts: Sequence[LogTable], file: str, options: LogMap, pose: Pose | None
) -> Roles:
    """Return x, y, z and the orientation behind them: of the form told, or by what its numbers are."""
    if pose is None and len(columns) < 3:
        raise LogError(Finding(f"found {format_count(len(columns), 'column')}, allowed: x, y, z", file=file))
    form = options.rotation
    if pose is None and form is not None and len(columns) == 3 + column_count(form):
        pose = Pose(tuple(columns[:3]), tuple(columns[3:]), (form,), GIVEN)
    behind = _trailing_pose(columns, layouts, None, some=True) if pose is None else None
    pose = with_form(pose or behind or Pose(tuple(columns[:3]), evidence="there is no header"), form)
    rest = [column for column in columns if column not in (*pose.position, *pose.rotation)]
    said = [path_inference(listed(pose.position), pose.evidence), *about_pose(pose)[1:]]
    said += not_used(rest, NO_HEADER)
    return Roles((), (), (), pose.position, pose.rotation, pose.forms, tuple(said), measured=pose.measured)


def _trailing_pose(
    columns: Sequence[Column], layouts: Sequence[LogTable], robot: Chain | None, *, some: bool = False
) -> Pose | None:
    """Return the pose that stands behind the joints, or alone in a table, by what (some of) its rows are."""
    found = trailing_matrix(columns, layouts, some=some)
    joints = len(robot.coordinates) if robot else 0
    fits = len(columns) == 7 if robot is None else len(columns) >= joints + 7
    found = found or (trailing_quaternion(columns, layouts, some=some) if fits else None)
    for count in () if found else (16, 12, *([4] if fits else [])):
        if len(columns) >= count:
            _refuse_odd_rows(columns[-count:], layouts)
    return found


def _refuse_odd_rows(columns: Sequence[Column], layouts: Sequence[LogTable]) -> None:
    """Raise a `LogError` with the few rows without which columns are an orientation, if there are some."""
    layout = layouts[columns[0].table]
    odd = [layout.file_row(row) for row in odd_rows(columns, layouts)]
    lines, told = layout.lines_of(odd), listed(columns, most=4)
    found = f"found no orientation in columns {told}, allowed: one in every row, as in most"
    findings = [Finding(found, layout.file, lines.get(row), row, hints=(NAME_JOINTS,)) for row in odd]
    if findings:
        raise LogError(*capped(findings, layout.file))


def one_plot_a_file(
    columns: Sequence[Column], paths: Sequence[Path], robot: Chain | None
) -> tuple[tuple[Column, ...], tuple[LogWarning, ...]] | None:
    """Return the joint columns, in order, of files that hold one result each; None if one holds more.

    The order is that of the numbers in the columns' names, if these differ only by a number; else that of
    the numbers in the files' names; else the order in which the files were given. Where both have numbers
    and the orders differ, a warning says so.

    Raises:
        LogError: If a number is missing among those of the plots, and there is no robot.
    """
    numeric = [column for column in columns if not column.text and not column.counts_rows]
    if [column.table for column in numeric] != list(range(len(paths))):
        return None
    if robot is not None and len(numeric) != len(robot.coordinates):
        return None
    by_name = _only_numbers_differ([split_unit(column.header)[0] for column in numeric])
    by_file = _only_numbers_differ([path.stem for path in paths])
    numbers = by_name or by_file
    if numbers is None:
        return tuple(numeric), ()
    if robot is None:
        _refuse_missing_plot(numbers, paths)
    ordered = _in_order(numbers, numeric)
    if by_name is None or by_file is None or ordered == _in_order(by_file, numeric):
        return ordered, ()
    names = ", ".join(f"{column.name} of {paths[column.table].name}" for column in ordered)
    said = f"the plots are joined by the numbers of their columns, which are not those of the files: {names}"
    hints = (Hint("joints", None, "gives another order"),)
    return ordered, (LogWarning("plot-order", said, hints=hints),)


def _in_order(numbers: Sequence[int], columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return columns in the order of their numbers."""
    return tuple(column for _, column in sorted(zip(numbers, columns, strict=True), key=lambda p: p[0]))


def _refuse_missing_plot(numbers: Sequence[int], paths: Sequence[Path]) -> None:
    """Raise a `LogError` if a plot is missing between others: 1, 2, 4, but not 1, 2, 10."""
    missing = [n for n in range(min(numbers), max(numbers)) if n not in numbers]
    if missing and len(missing) < len(numbers):
        found = ", ".join(map(str, sorted(numbers)))
        said = f"found plots with the numbers {found} and none with {', '.join(map(str, missing))}"
        said = f"{said}, allowed: a plot for each joint; add the missing one"
        raise LogError(Finding(said, str(paths[0].parent), hints=(NAME_JOINTS,)))


def _only_numbers_differ(names: Sequence[str]) -> list[int] | None:
    """Return the last number in each name, if the names are the same without it and the numbers differ."""
    found = [re.fullmatch(r"(.*?)(\d+)(\D*)", name) for name in names]
    parts = [match.groups() for match in found if match]
    numbers = [int(number) for _, number, _ in parts]
    same = len({(before, after) for before, _, after in parts}) == 1
    return numbers if same and len(set(numbers)) == len(names) else None


def _by_place(
    joints: Sequence[Column],
    columns: Sequence[Column],
    robot: Chain | None,
    evidence: str,
    pose: Pose | None,
    rates: tuple[Column, ...] = (),
) -> Roles:
    """Return joints that are named by the robot, or q1, q2, ..., their rates, and the pose beside them."""
    pose = pose or Pose()
    rest = [column for column in columns if column not in (*joints, *rates, *pose.position, *pose.rotation)]
    said = [joint_inference(joints, evidence), *about_pose(pose), *not_used(rest, NO_HEADER)]
    names = robot.coordinates if robot else [f"q{k + 1}" for k in range(len(joints))]
    named = tuple(replace(column, name=name) for column, name in zip(joints, names, strict=True))
    place = pose.position, pose.rotation, pose.forms
    return Roles(named, rates, (), *place, tuple(said), (), pose.measured)
