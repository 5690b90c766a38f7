"""The columns of the logs that urmpipe writes: joint logs of inverse kinematics, and plans."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_pipeline.outputs import PATH_ROW, TARGET_ROW
from urmpipe_pipeline.sources.columns.columns import Column

TOOL = ("x", "y", "z")
"""What a plan has behind its joints; tcp_x, ... where a joint has such a name."""


def own_joints(columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return the joints: the columns with a unit of joints, but for the tool of a plan.

    What stands behind the rows of targets or path was added by somebody else.
    """
    rows = [column for column in columns if column.header in (TARGET_ROW, PATH_ROW)]
    before = columns[: columns.index(rows[0])] if rows else columns
    sized = tuple(one for one in before if one.unit and one.unit.quantity in ("angle", "length"))
    tool = tuple(one.key.removeprefix("tcp_") for one in sized[-len(TOOL) :])
    planned = any(column.header == PATH_ROW for column in rows)
    return sized[: -len(TOOL)] if planned and tool == TOOL else sized
