"""The signals of a simulation as urmpipe exports them: which columns are joints, by block and variable."""

from __future__ import annotations

import re
from collections.abc import Sequence

from urmpipe_models.arm.chain import Chain
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.columns.questions import which_joints
from urmpipe_pipeline.logs.columns.roles import Roles, check_count, joint_inference, not_used
from urmpipe_pipeline.logs.tables.sniff import Layout

_SIGNAL = re.compile(r"(?P<block>[^.\s]+)\.(?P<variable>[^.\s\[]+)(\[(?P<element>\d+)\])?( \[[^\]]*\])?")
"""BLOCK.VARIABLE, of an array with the number of the element, and its unit behind."""

_JOINTS = ("q", "phi", "s")
"""What the arrays of joints are called in the units of urmpipe."""

_CLOCK = "t [s]"


def joints_of_blocks(columns: Sequence[Column], layout: Layout, robot: Chain | None) -> Roles | None:
    """Return the roles of the signals of a simulation; None of any other table.

    The joints are the only array that is called as joints are. Scalars such as load1.theta, load2.theta may
    be those of drives, of loads or of set points.

    Args:
        columns: The columns, without the clock.
        layout: Their table.
        robot: The arm, or None.

    Raises:
        LogError: With the question which they are, if several may be, or they are not as many as the robot's.
    """
    signals = {
        column: _SIGNAL.fullmatch(column.header) for column in columns if column.header != "clock [ns]"
    }
    if layout.names[:1] != (_CLOCK,) or not signals or not all(signals.values()):
        return None
    arrays: dict[tuple[str, str], list[Column]] = {}
    scalars: dict[tuple[str, str], list[Column]] = {}
    for column, match in signals.items():
        if match is None or column.unit is None or column.unit.quantity not in ("angle", "length"):
            continue
        if column.unit.order == 0 and match["element"] and match["variable"] in _JOINTS:
            arrays.setdefault((match["block"], match["variable"]), []).append(column)
        elif column.unit.order == 0 and not match["element"]:
            alike = re.sub(r"\d+$", "", match["block"]), match["variable"]
            scalars.setdefault(alike, []).append(column)
    if len(arrays) == 1:
        return _taken(next(iter(arrays.values())), columns, layout, robot)
    groups = list((arrays or scalars).values())
    most = max(map(len, groups), default=0)
    groups = [one for one in groups if len(one) == most]
    if len(groups) < 2:
        return None
    found = f"{len(groups)} groups of signals that may be joints"
    raise which_joints(layout.file, found, groups, "one of them")


def _taken(joints: Sequence[Column], columns: Sequence[Column], layout: Layout, robot: Chain | None) -> Roles:
    """Return the joints of an arm with the rates that stand beside them."""
    check_count(joints, layout.file, robot)
    by_name = {column.header.split(" ")[0]: column for column in columns}
    rates, accelerations = (
        tuple(by_name[name] for name in names) if all(name in by_name for name in names) else ()
        for names in ([one.header.split(" ")[0].replace("[", f"{d}[") for one in joints] for d in ("d", "dd"))
    )
    said = [joint_inference(joints, "the only array of joints among the signals")]
    rest = [column for column in columns if column not in (*joints, *rates, *accelerations)]
    said += not_used(rest, "signals beside the joints")
    return Roles(tuple(joints), rates, accelerations, inferences=tuple(said))
