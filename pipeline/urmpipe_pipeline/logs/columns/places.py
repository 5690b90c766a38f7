"""Joints by their place: tables without a header, and plots with one result a file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError, format_value
from urmpipe_models.math3d import column_count
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.columns.columns import Column, chosen_columns, listed
from urmpipe_pipeline.logs.columns.pose import (
    Pose,
    chosen_pose,
    odd_rows,
    trailing_matrix,
    trailing_quaternion,
    with_form,
)
from urmpipe_pipeline.logs.columns.questions import NAME_JOINTS, TIMES_OF_ANOTHER, take
from urmpipe_pipeline.logs.columns.roles import (
    GIVEN,
    Roles,
    about_pose,
    check_count,
    joint_inference,
    not_used,
    path_inference,
)
from urmpipe_pipeline.logs.columns.trajectories import path_of_poses
from urmpipe_pipeline.logs.columns.unnamed import joints_among
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.numbers import capped
from urmpipe_pipeline.logs.tables.row_reader import lines_of_rows
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.whole import Whole
from urmpipe_pipeline.logs.vocabulary import split_unit

NO_HEADER = "no header tells what they are"
ASSUMED_JOINTS = "assumed-joints"  # warning: all columns of a table without names are the joints


def without_header(
    columns: Sequence[Column],
    layouts: Sequence[Layout],
    options: LogMap,
    robot: Chain | None,
    whole: Sequence[Whole],
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
    columns: Sequence[Column], layouts: Sequence[Layout], file: str, options: LogMap, pose: Pose | None
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
    columns: Sequence[Column], layouts: Sequence[Layout], robot: Chain | None, *, some: bool = False
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


def _refuse_odd_rows(columns: Sequence[Column], layouts: Sequence[Layout]) -> None:
    """Raise a `LogError` with the few rows without which columns are an orientation, if there are some."""
    layout = layouts[columns[0].table]
    odd = [layout.file_row(row) for row in odd_rows(columns, layouts)]
    lines, told = lines_of_rows(layout, odd), listed(columns, most=4)
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
