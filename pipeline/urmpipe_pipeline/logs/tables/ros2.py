"""`ros2 topic echo --csv /joint_states`: a table without header whose rows name the joints themselves.

Source: rosidl_runtime_py, message_to_csv: the fields of sensor_msgs/JointState in order, arrays spread over
cells, an empty array as one empty cell: seconds, nanoseconds, frame, names, positions, velocities, efforts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.cells.cell import is_text, printable
from urmpipe_pipeline.logs.tables.row_reader import lines_of_rows
from urmpipe_pipeline.logs.tables.sniff import Layout

_FIRST_NAME = 3


def with_names(layout: Layout) -> Layout:
    """Return the layout with names for its columns if most rows are those of such a table, else as it is.

    Raises:
        LogError: If rows of several publishers, each with joints of its own, stand in one file.
    """
    if layout.header is not None:
        return layout
    found = [_names(row, layout.decimal) for row in layout.sample]
    usual = max(filter(None, found), key=found.count, default=())
    _refuse_other_publishers(layout, found, usual)
    joints = tuple(map(printable, usual))
    if not joints or len(set(joints)) < len(joints) or 2 * found.count(usual) <= len(found):
        return layout
    count, row = len(joints), layout.sample[found.index(usual)]
    velocity = _FIRST_NAME + 2 * count
    has_rates = row[velocity : velocity + 1] != ("",)
    full = {
        2 * count: (True, True, True),
        count + 1: (True, has_rates, not has_rates),
        2: (True, False, False),
    }.get(len(row) - velocity)
    if full is None:
        return layout
    names = ["sec", "nanosec", "frame_id", *(f"name.{joint}" for joint in joints)]
    for group, spread in zip(("position", "velocity", "effort"), full, strict=True):
        names += [f"{group}.{joint}" for joint in joints] if spread else [f"{group}."]
    said = Inference("header", "none", "seconds, nanoseconds and names of joints, as ros2 topic echo writes")
    kept = tuple(inference for inference in layout.inferences if inference.what != "header")
    return replace(layout, names=tuple(names), header=layout.first_line, inferences=(*kept, said))


def _names(row: Sequence[str], decimal: str) -> tuple[str, ...]:
    """Return the texts behind a stamp, none if the row does not begin with one."""
    if len(row) < _FIRST_NAME + 4 or not (row[0].isdecimal() and row[1].isdecimal() and int(row[1]) < 10**9):
        return ()
    return tuple(takewhile(lambda cell: is_text(cell, decimal), row[_FIRST_NAME:]))


def _refuse_other_publishers(
    layout: Layout, found: Sequence[tuple[str, ...]], usual: tuple[str, ...]
) -> None:
    """Raise at the first row with other names than the usual ones; a text where a number belongs is none."""
    for row, names in enumerate(found, start=1):
        if names and names[: len(usual)] != usual:
            listed, wanted = (", ".join(map(printable, group)) for group in (names, usual))
            message = f"found a row with the joints {listed} among rows with {wanted}, allowed: one publisher"
            line = lines_of_rows(layout, [row]).get(row)
            raise LogError(Finding(f"{message}; keep the rows of one of them", layout.file, line, row))
