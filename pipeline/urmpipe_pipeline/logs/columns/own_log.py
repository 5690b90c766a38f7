"""The columns of what urmpipe writes: joint logs of inverse kinematics, plans, and exports of runs."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.arm.chain import Chain
from urmpipe_models.math3d import COLUMN_NAMES, FORMS, column_count
from urmpipe_pipeline.joint_log import ROLES, Inference
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.columns.roles import (
    Roles,
    check_count,
    joint_inference,
    not_used,
    path_inference,
)
from urmpipe_pipeline.logs.tables.own_tables import GIVEN, RECORDED, form_of, roles_of
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.outputs import MOTION_ROW, PATH_ROW, TARGET_ROW

TOOL = ("x", "y", "z")
"""What a plan has behind its joints; tcp_x, ... where a joint has such a name."""


def own_joints(columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return the joints: the columns with a unit of joints, but for the tool of a plan or a traced point.

    What stands behind the rows of targets or path was added by somebody else.
    """
    rows = [column for column in columns if column.header in (TARGET_ROW, PATH_ROW, MOTION_ROW)]
    before = columns[: columns.index(rows[0])] if rows else columns
    sized = tuple(one for one in before if one.unit and one.unit.quantity in ("angle", "length"))
    tool = tuple(one.key.removeprefix("tcp_") for one in sized[-len(TOOL) :])
    planned = any(column.header in (PATH_ROW, MOTION_ROW) for column in rows)
    return sized[: -len(TOOL)] if planned and tool == TOOL else sized


def written_roles(columns: Sequence[Column], layout: Layout, robot: Chain | None) -> Roles | None:
    """Return the roles of the columns of an export, as urmpipe wrote them; None of any other table.

    Args:
        columns: The columns, without the clock.
        layout: Their table.
        robot: The arm, or None.

    Raises:
        LogError: If it has another number of joints.
    """
    held = roles_of(layout)
    there = {column.index: column for column in columns}
    groups = [
        tuple(there[index] for index, own in held.items() if own == role and index in there)
        for role in ROLES[1:]
    ]
    joints, rates, accelerations, position, rotation = groups
    if not joints and not position:
        return None
    if joints:
        check_count(joints, layout.file, robot)
    names = tuple(column.name.removeprefix(RECORDED) for column in rotation)
    told = form_of(layout)
    forms = [form for form in FORMS if form == told] or [
        form for form, own in COLUMN_NAMES.items() if own == names
    ]
    forms = forms or [form for form in FORMS if rotation and column_count(form) == len(rotation)]
    arrays = layout.held is not None and GIVEN in (layout.held.schema.metadata or {})
    why = "given as an array" if arrays else "urmpipe wrote them"
    said = [joint_inference(joints, why) if joints else path_inference(_listed(position), why)]
    recorded = {"rates": rates, "accelerations": accelerations, "recorded TCP": position if joints else ()}
    for what, group in (recorded | {"recorded orientation": rotation}).items():
        said += [Inference(what, _listed(group), why)] if group else []
    used = tuple(column for group in groups for column in group)
    said += not_used([column for column in columns if column not in used], "urmpipe makes them anew")
    forms = forms if rotation else []
    return Roles(joints, rates, accelerations, position, rotation, tuple(forms), tuple(said))


def _listed(columns: Sequence[Column]) -> str:
    return ", ".join(column.name for column in columns)
