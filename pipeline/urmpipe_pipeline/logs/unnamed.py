"""The columns of tables without a header, by their numbers and places, and of plots with one result a file.

1. Poses: a table of seven numbers, the last four of length 1, or of a homogeneous transform (12 or 16
   numbers), alone or after a time, is a path, as TUM and KITTI write it: joints keep no such law.
2. Joints: as many columns as the robot has; columns whose rates are next to them (`rates`); without a robot
   a few columns that move alike, with a warning. A pose may follow the joints.
3. Otherwise a question whose choices are blocks of columns.
4. Plots: one column of numbers a file, joined by the numbers in the names of columns or files.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.errors import Finding, Hint, LogError, format_value
from urmpipe_models.math3d import column_count
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
from urmpipe_pipeline.logs.formats.cells import find_numbers
from urmpipe_pipeline.logs.formats.log_table import USUAL_COUNTS, LogTable
from urmpipe_pipeline.logs.formats.opening import Tables
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.pose_columns import (
    Pose,
    chosen_pose,
    leading_pose,
    trailing_pose,
    with_form,
)
from urmpipe_pipeline.logs.rates import MAX_JOINTS, proved_blocks
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

ASSUMED_JOINTS = "assumed-joints"  # warning: all columns of a table without names are the joints
NO_HEADER = "no header states what they are"
TWO_TURNS = 720.0, 2.0 * math.tau  # [deg], [rad]: no joint goes further, as clocks, wheels and counts do
MAX_SELDOM = 0.2  # a column that moves in a smaller share of the rows than others may be a gripper's
MAX_UNASKED = 7  # columns that are joints where no robot states how many there are; more may be blocks


def without_header(
    columns: Sequence[Column],
    tables: Sequence[LogTable],
    options: LogMap,
    robot: Chain | None,
    *,
    path: bool,
) -> Roles:
    """Return the roles of the columns of a table without a header.

    Args:
        columns: The columns, without the clock.
        tables: All tables; the columns are of one.
        options: What the user says: joint columns, position, orientation.
        robot: The arm, or None.
        path: The user says that it is a path: the columns are x, y, z, and an orientation after them.

    Raises:
        LogError: If there are too few columns, or with the question which are the joints.
    """
    table = tables[columns[0].table if columns else 0]
    columns = [column for column in columns if column.header]
    pose, count = chosen_pose(columns, options), len(robot.coordinates) if robot else 0
    if options.joints:
        joints = chosen_columns(columns, options.joints, parameter="joints")
        check_count(joints, table.file, robot)
        return _by_place(joints, columns, robot, GIVEN, pose)
    last = trailing_pose(columns, table, path=path) if pose is None else None
    if last and len(columns_before(last, columns)) <= 1:
        return _path_of_poses(last, columns, table, options)
    if path:
        return _path_by_place(columns, table, options, pose or last or leading_pose(columns, table))
    if texts := [column for column in columns if column.text]:
        is_text = np.array([column.text for column in columns])
        odd = is_text | find_odd_columns(table.values([column.index for column in columns]))
        empty = [column for column in columns if np.isnan(table.values([column.index])).all()]
        groups = [group for group in _groups(columns, odd, count) if not {*group} & {*texts, *empty}]
        cell = format_value(table.cells(texts[0].index)[0])
        message = f"{cell} in column {texts[0].number} of a table without a header"
        raise which_joints(table.file, message, groups)
    if not columns:
        message = "found no column except the time, allowed: the joints"
        raise LogError(Finding(message, file=table.file, hints=(TIMES_OF_ANOTHER,)))
    if last and len(columns_before(last, columns)) < count:
        last = None
    pose = with_form(pose or last or Pose(), options.rotation)
    free = columns_before(last, columns) if last else columns
    free = [column for column in free if column not in (*pose.position, *pose.rotation)]
    if not free and pose.position:
        return _path_roles(pose, columns)
    joints, rates, evidence = _joints_among(free, table, robot)
    check_count(joints, table.file, robot)
    roles = _by_place(joints, columns, robot, evidence, pose, rates)
    if robot or rates or len(joints) == 1:
        return roles
    assumption = f"columns {joints[0].number} to {joints[-1].number} are the joints"
    hints = [take(joints, "confirms it"), Hint("joints", None, "names others")]
    if len(joints) == 2 and not pose.position:
        hints.append(take(joints, "reads x, y", parameter="position"))
    message = f"no header names the columns: {assumption}, in order"
    warning = LogWarning(ASSUMED_JOINTS, message, hints=tuple(hints), assumption=assumption, role="joint")
    inferences = (replace(roles.inferences[0], basis="assumed"), *roles.inferences[1:])
    return replace(roles, inferences=inferences, warnings=(*roles.warnings, warning))


def _by_place(
    joints: Sequence[Column],
    columns: Sequence[Column],
    robot: Chain | None,
    evidence: str,
    pose: Pose | None,
    rates: tuple[Column, ...] = (),
) -> Roles:
    """Return joints, called as those of the robot or q1, q2, ..., their rates, and the pose next to them."""
    pose = pose or Pose()
    rest = [column for column in columns if column not in (*joints, *rates, *pose.position, *pose.rotation)]
    inferences = [
        joint_inference(joints, evidence, "proved"),
        *about_pose(pose, "proved"),
        *not_used(rest, NO_HEADER),
    ]
    names = robot.coordinates if robot else [f"q{k + 1}" for k in range(len(joints))]
    renamed = tuple(replace(column, name=name) for column, name in zip(joints, names, strict=True))
    place = pose.position, pose.rotation, pose.forms
    return Roles(renamed, rates, (), *place, tuple(inferences), (), pose.measured)


# 1. Poses


def clock_before_pose(columns: Sequence[Column], table: LogTable) -> tuple[tuple[Column, ...], str] | None:
    """Return the clock of a table of poses, empty of poses alone, and why; None of any other table.

    Args:
        columns: All columns of a table without a header.
        table: The table.
    """
    pose = trailing_pose(columns, table)
    before = columns_before(pose, columns) if pose else columns
    if pose is None or len(before) > 1:
        return None
    if not before:
        return (), f"the {len(columns)} columns are a pose: {pose.evidence}"
    times = table.values([before[0].index])[:, 0]
    if before[0].text or (np.diff(times) <= 0).any() or np.isnan(times).any():
        return None
    return tuple(before), f"it increases, and a pose follows it: {pose.evidence}"


def columns_before(pose: Pose, columns: Sequence[Column]) -> Sequence[Column]:
    """Return the columns before the first one of a pose."""
    return columns[: min(map(columns.index, (*pose.position, *pose.rotation)))]


def _path_of_poses(pose: Pose, columns: Sequence[Column], table: LogTable, options: LogMap) -> Roles:
    """Return the roles of a pose alone, or after one column; w of TUM is assumed to be the last."""
    warnings: tuple[LogWarning, ...] = ()
    is_tum = len(table.names) == 8 and table.delimiter == " "
    if options.rotation is None and len(pose.forms) > 1 and is_tum:
        order = f"no header states the order of {listed(pose.rotation)}, a quaternion"
        hints = (
            Hint("rotation", "quat_wxyz", "overrides this"),
            Hint("rotation", "quat_xyzw", "confirms it"),
        )
        assumption = "the quaternions are x, y, z, w"
        message = f"{order}: taken as x, y, z, w, as of TUM"
        warnings = (LogWarning("assumed-form", message, hints=hints, assumption=assumption, role="rotation"),)
        pose = replace(pose, forms=("quat_xyzw",))
    return replace(_path_roles(with_form(pose, options.rotation), columns), warnings=warnings)


def _path_by_place(columns: Sequence[Column], table: LogTable, options: LogMap, pose: Pose | None) -> Roles:
    """Return x, y, z and the orientation after them: of the given form, or by what its numbers are."""
    form = options.rotation
    if pose is None and len(columns) < 3:
        message = f"found {format_count(len(columns), 'column')}, allowed: x, y, z"
        raise LogError(Finding(message, file=table.file))
    if pose is None:
        has_form = form is not None and len(columns) == 3 + column_count(form)
        rotation = tuple(columns[3:]) if has_form else ()
        pose = Pose(tuple(columns[:3]), rotation, evidence=GIVEN if has_form else "there is no header")
    return _path_roles(with_form(pose, form), columns)


def _path_roles(pose: Pose, columns: Sequence[Column]) -> Roles:
    rest = [column for column in columns if column not in (*pose.position, *pose.rotation)]
    inferences = [path_inference(listed(pose.position), pose.evidence), *about_pose(pose, "proved")[1:]]
    inferences += not_used(rest, NO_HEADER)
    place = pose.position, pose.rotation, pose.forms
    return Roles((), (), (), *place, tuple(inferences), measured=pose.measured)


# 2., 3. Joints


def _joints_among(
    free: Sequence[Column], table: LogTable, robot: Chain | None
) -> tuple[tuple[Column, ...], tuple[Column, ...], str]:
    """Return the joints among columns without names, their rates, and why; or raise the question."""
    count = len(robot.coordinates) if robot else None
    if not free or (count is not None and len(free) <= count):
        return tuple(free), (), f"no header: joints in order{', as many as the robot has' if robot else ''}"
    values = table.values([column.index for column in free])
    if count is None and len(table.names) == 1 and len(values) > 3 and (np.diff(values[:, 0]) > 0).all():
        message = "one column, which always increases, as times do"
        raise which_joints(table.file, message, [free], UNKNOWN, TIMES_OF_ANOTHER)
    blocks = proved_blocks(values, count)
    if len(blocks) == 1:
        joints, rates = (tuple(free[k] for k in place) for place in (blocks[0].joints, blocks[0].rates))
        evidence = f"half of the steps agree within {100 * blocks[0].variation:.2g} %"
        return joints, rates, f"columns {listed(rates)} are their rates: {evidence}"
    odd = find_odd_columns(values)
    pose = leading_pose(free, table)
    may_be_path = len(free) == 3 or pose is not None
    if not blocks and count is None and len(free) <= MAX_UNASKED and not odd.any() and not may_be_path:
        return tuple(free), (), "no header: joints in order"
    groups = [[free[k] for k in block.joints] for block in blocks] + [free[7:]] * (pose is not None)
    groups += _groups(free, odd, count)  # and the columns after a pose: joints on a base that moves
    doubtful = [column for column, is_odd in zip(free, odd, strict=True) if is_odd]
    message = f"{len(free)} columns that no header names"
    message += f", of which {listed(doubtful)} may not be joints" if doubtful else ""
    message += f", and robot {robot.name} has {count} joints" if robot else ""
    as_path = (Hint("source", "path", "reads them as x, y, z"),) if may_be_path else ()
    if len(free) == 2 and not robot:
        as_path = (take(free, "reads x, y", parameter="position"),)
    transposed = Hint("layout", "transposed", "takes the rows as joints")
    as_rows = (transposed,) if len(values) <= MAX_UNASKED < len(free) else ()
    raise which_joints(table.file, message, groups, UNKNOWN, *as_path, *as_rows)


def find_odd_columns(values: FloatArray) -> BoolArray:
    """Return which columns are unlike joints, or unlike the others, shape (columns,).

    They go further than any arm's joint, or than one in rad where most of the others do not; they move seldom
    while others do; they count; or they are empty.

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
        is_integer = (values[0] % 1.0 == 0.0) & (steps[0] % 1.0 == 0.0)
    counts = is_integer & (steps[0] > 0.0) & (steps == steps[0]).all(axis=0)
    seldom = (moves > 0.0) & (moves < MAX_SELDOM * np.median(moves))
    empty = np.isnan(values).all(axis=0)
    return np.asarray((size > TWO_TURNS[in_rad]) | seldom | (counts & (len(values) > 3)) | empty)


def _groups(free: Sequence[Column], odd: BoolArray, count: int | None) -> list[Sequence[Column]]:
    """Return the columns that may be all joints: those between unlike ones, or blocks of one size."""
    runs = [
        [free[k] for k, _ in run]
        for is_odd, run in groupby(enumerate(odd), lambda pair: bool(pair[1]))
        if not is_odd
    ]
    near = sorted(
        (run for run in runs if 2 < len(run) <= MAX_JOINTS or len(run) == count), key=len, reverse=True
    )
    if count:
        likely = [column for column, is_odd in zip(free, odd, strict=True) if not is_odd]
        return [run for run in (*near, likely, free[:count], free[-count:]) if len(run) == count]
    if len(free) <= MAX_UNASKED:
        return [*near[:1], free]
    tiles = [
        free[k : k + size]
        for size in ((3, *USUAL_COUNTS) if len(free) == 9 else USUAL_COUNTS)
        for k in (range(0, len(free), size) if len(free) % size == 0 else (0,))
    ]
    starts = [k for k in range(1, len(odd)) if odd[k - 1] and not odd[k]]
    after_odd = [free[k : k + size] for k in starts[:1] for size in USUAL_COUNTS[:2]]
    return [*tiles, *near[:1], *after_odd, free]


# 4. Plots


def one_plot_a_file(columns: Sequence[Column], tables: Tables, robot: Chain | None) -> Roles | None:
    """Return the roles of files that hold one joint each; None if one holds more.

    Their order is that of the numbers in the columns' names, if these differ only by a number; else that of
    the numbers in the files' names; else the order of the files as given. Where both have numbers and the
    orders differ, a warning states both. Columns of one name are called as their files.

    Raises:
        LogError: If a number is missing among those of the plots, and there is no robot.
    """
    paths, titles = tables.paths, tables.titles
    numeric = [column for column in columns if not column.text and not column.counts_rows]
    has_others = [column.table for column in numeric] != list(range(len(paths)))
    if has_others or (robot is not None and len(numeric) != len(robot.coordinates)):
        return None
    by_name = find_numbers([split_unit(column.header)[0] for column in numeric])
    by_file = find_numbers([path.stem for path in paths])
    numbers = by_name or by_file or list(range(len(numeric)))
    missing = [n for n in range(min(numbers), max(numbers)) if n not in numbers]
    if robot is None and missing and len(missing) < len(numbers):  # 1, 2, 4, but not 1, 2, 10
        known = ", ".join(map(str, sorted(numbers)))
        message = f"found plots with the numbers {known} and none with {', '.join(map(str, missing))}"
        message = f"{message}, allowed: a plot for each joint; add the missing one"
        raise LogError(Finding(message, str(paths[0].parent), hints=(NAME_JOINTS,)))
    order, warnings = np.argsort(numbers).tolist(), list[LogWarning]()
    plots = [numeric[k] for k in order]
    if by_file and order != np.argsort(by_file).tolist():
        names = ", ".join(f"{column.name} of {paths[column.table].name}" for column in plots)
        message = "the plots are joined by the numbers of their columns, which are not those of the files"
        hints = (Hint("joints", None, "gives another order"),)
        warnings.append(LogWarning("plot-order", f"{message}: {names}", hints=hints))
    if len({column.header for column in plots}) < len(plots) or tables.tables[0].header is None:
        plots = [replace(column, name=titles[column.table]) for column in plots]
    inference = joint_inference(plots, "one plot per file")
    return Roles(tuple(plots), inferences=(inference,), warnings=tuple(warnings))
