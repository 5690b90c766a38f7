"""Trajectories without a header: a pose a row, alone or behind a time, as TUM and KITTI write it.

What a table holds shows in all its rows: of seven numbers the last four have length 1, or 12 or 16 are a
homogeneous transform. No joints keep that, so none are looked for, whatever robot is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.errors import Hint
from urmpipe_models.math3d import RotationForm
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.columns.columns import Column, listed
from urmpipe_pipeline.logs.columns.pose import Pose, have_length_1, transform_pose, with_form
from urmpipe_pipeline.logs.columns.roles import Roles, about_pose, not_used, path_inference
from urmpipe_pipeline.logs.tables.whole import Whole

QUATERNION, TRANSFORMS = 7, (12, 16)
"""Columns of a position with a quaternion, and of a transform without and with its last row 0, 0, 0, 1."""

LEAST_ROWS = 3
"""In fewer rows, four of seven joints may have length 1 by chance."""

SPACES = " "
"""Delimiter of TUM's form."""


def clock_before_pose(columns: Sequence[Column], whole: Whole) -> tuple[tuple[Column, ...], str] | None:
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
    single = len(whole.numbers.values) < 2
    rises = single or bool(whole.increasing[whole.columns.index(before[0].index)])
    return (before, f"it increases, and a pose stands behind it: {pose.evidence}") if rises else None


def path_of_poses(
    columns: Sequence[Column], whole: Sequence[Whole], rotation: RotationForm | None
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
    timed = len(table.layout.names) == 1 + QUATERNION  # poses alone are no TUM
    if rotation is None and len(pose.forms) > 1 and timed and table.layout.delimiter == SPACES:
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


def _pose(columns: Sequence[Column], whole: Whole) -> Pose | None:
    """Return the pose that columns hold in every row, alone or behind one of them."""
    for count in (*TRANSFORMS, QUATERNION):
        held = columns[-count:]
        if len(columns) - count not in (0, 1) or not {c.index for c in columns}.issubset(whole.columns):
            continue
        values = whole.values([column.index for column in held])
        values = values[np.isfinite(values).all(axis=1)]
        if count != QUATERNION:
            pose = transform_pose(held, values)
        elif len(values) < LEAST_ROWS and len(whole.layout.names) == QUATERNION:
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
