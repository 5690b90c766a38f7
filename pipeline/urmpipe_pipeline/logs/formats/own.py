"""The tables that urmpipe wrote: what each column holds, by what stands beside it or by all names."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, cast, get_args

import pyarrow as pa

from urmpipe_models.math3d import COLUMN_NAMES
from urmpipe_pipeline.joint_log import Role
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.numbers import JOINT, ROLE, UNIT
from urmpipe_pipeline.logs.vocabulary import split_unit

MARK = "urmpipe"
"""The key of our metadata: of a Parquet file, and of the attributes of a table in pandas."""

FORM = b"rotation_form"
"""The key of the form of the orientation, in the metadata of a table."""

GIVEN = b"given"
"""The key of a table of arrays that were given one by one."""

ORDERS: Mapping[Role, tuple[str, str]] = {
    "joint": ("", ""),
    "rate": ("d_", "/s"),
    "acceleration": ("dd_", "/s2"),
}
"""What stands before the name of a joint and behind its unit, by the role of a column."""

POINT = [("px", "m"), ("py", "m"), ("pz", "m"), ("rz", "rad"), ("ry", "rad"), ("rx", "rad")]
"""The tool centre point of static poses on their grid."""

RECORDED = "recorded_"
"""What stands before the name of a column that the log recorded itself."""

_TOLD_ROLE = re.compile(rf"(?P<role>{'|'.join(get_args(Role))}) (?P<place>\d{{1,9}})", re.ASCII)
"""Role and place of a column in its metadata; others write what they like there."""

Head = Sequence[tuple[str, str]]
"""Name and unit of each column."""


def head_of(layout: LogTable) -> Head:
    """Return name and unit of each column of a table; an empty unit where none is told."""
    split = [split_unit(name) for name in layout.names]
    units = layout.units or [""] * len(split)
    return [(label, unit or own or "") for (label, own), unit in zip(split, units, strict=False)]


def roles_of(layout: LogTable) -> dict[int, Role]:
    """Return what the columns of a table of ours hold, by their index, in the order of their role.

    Of other tables it is nothing.
    """
    if layout.arrow is not None:
        texts = (
            (field.metadata or {}).get(ROLE, b"").decode(errors="replace") for field in layout.arrow.schema
        )
        found = ((index, _TOLD_ROLE.fullmatch(text)) for index, text in enumerate(texts))
        told = [(int(match["place"]), index, cast("Role", match["role"])) for index, match in found if match]
        if told:
            return {index: role for _, index, role in sorted(told)}
    return (
        grid_roles(head_of(layout))
        if layout.header is not None and getattr(layout, "form", None) is None
        else {}
    )


def stated_joints(layout: LogTable) -> frozenset[int]:
    """Return the indices of the columns that a schema calls positions of joints, in no order."""
    schema = getattr(layout.arrow, "schema", ())
    return frozenset(k for k, field in enumerate(schema) if (field.metadata or {}).get(ROLE) == JOINT)


def form_of(layout: LogTable) -> str:
    """Return the form of the orientation in a table of ours; empty where it does not tell one."""
    metadata = {} if layout.arrow is None else layout.arrow.schema.metadata or {}
    told = metadata.get(FORM, b"").decode(errors="replace")
    return told if told in COLUMN_NAMES else ""


def grid_roles(head: Head) -> dict[int, Role]:
    """Return what the columns of a run on its grid hold, by their index; nothing of other tables.

    Behind t stand the joints, their rates and their second derivatives, each with its unit in SI: no other
    program writes all three so. The number of a static pose precedes the joints and the point of the tool.
    """
    if len(head) < 2 or head[0] not in (("t", "s"), ("row", "")):
        return {}
    timed = head[0][0] == "t"
    count = _joints(head, timed=timed)
    if not count:
        return {}
    roles: dict[int, Role] = {0: "time"} if timed else {}
    for k, role in enumerate(ORDERS if timed else ("joint",)):
        roles |= dict.fromkeys(range(1 + k * count, 1 + (k + 1) * count), role)
    names = [name.removeprefix(RECORDED) if name.startswith(RECORDED) else None for name, _ in head]
    roles |= {k: "position" for k, name in enumerate(names) if name in ("tcp_x", "tcp_y", "tcp_z")}
    rotation = [k for k, name in enumerate(names) if name and k not in roles]
    if tuple(names[k] for k in rotation) in COLUMN_NAMES.values():
        roles |= dict.fromkeys(rotation, "rotation")
    return roles


def _joints(head: Head, *, timed: bool) -> int:
    """Return how many joints stand behind the first column of a run on its grid; 0 of any other table."""
    last = (f"d_{head[1][0]}", f"{head[1][1]}/s") if timed else POINT[0]
    count = next((k - 1 for k, column in enumerate(head) if k > 1 and column == last), 0)
    joints = head[1 : 1 + count]
    wanted = [
        (before + name, unit + behind)
        for before, behind in (ORDERS.values() if timed else [("", "")])
        for name, unit in joints
    ] + ([] if timed else POINT)
    ours = list(head[1 : 1 + len(wanted)]) == wanted and all(unit in ("rad", "m") for _, unit in joints)
    return count if ours else 0


def in_si(layout: LogTable) -> bool:
    """Return whether urmpipe made the numbers of a table, in SI: what it says of their units is no doubt."""
    if layout.arrow is not None and MARK.encode() in (layout.arrow.schema.metadata or {}):
        return True
    return layout.header is not None and bool(grid_roles(head_of(layout)))


def with_roles(table: pa.Table, about: Mapping[str, Any]) -> pa.Table:
    """Return a table with what our metadata tell of its columns, by their names, in those of its fields.

    Args:
        table: The table.
        about: Under `columns` the role of each and its place among those of the role, under `units` its unit
            where that is told here, under `rotation_form` the form of the orientation.
    """
    roles, units = (mapping(about.get(key)) for key in ("columns", "units"))
    form = about.get("rotation_form")
    fields = []
    for field in table.schema:
        told = dict(field.metadata or {})
        told |= {ROLE: _words(roles[field.name])} if field.name in roles else {}
        told |= {UNIT: str(units[field.name])} if field.name in units else {}
        fields.append(field.with_metadata(told))
    return table.cast(pa.schema(fields, {FORM: str(form)} if form else None))


def of_result(table: pa.Table, told: Mapping[str, Any]) -> pa.Table:
    """Return the table of a result of ours with what is told of its columns, and that they are in SI."""
    return with_roles(table, told).replace_schema_metadata({MARK: ""}) if told else table


def attributes_of(metadata: Mapping[bytes, bytes] | None) -> Mapping[str, Any]:
    """Return what our results tell of their columns in the attributes of a table that pandas wrote."""
    return mapping(mapping(told_in(metadata, "pandas").get("attributes")).get(MARK))


def told_in(metadata: Mapping[bytes, bytes] | None, key: str) -> Mapping[str, Any]:
    """Return what JSON in the metadata of a table tells; nothing of what others wrote there."""
    try:
        return mapping(json.loads((metadata or {}).get(key.encode(), b"null")))
    except (ValueError, RecursionError):
        return {}


def mapping(value: object) -> Mapping[str, Any]:
    """Return a value that is a mapping; an empty one in the place of any other."""
    return value if isinstance(value, Mapping) else {}


def _words(value: object) -> str:
    return " ".join(map(str, value if isinstance(value, (list, tuple)) else [value]))
