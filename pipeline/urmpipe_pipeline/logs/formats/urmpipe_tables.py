"""The tables that urmpipe wrote: what each column holds, by the metadata of columns or by all names.

A file of typed columns has the role and the place of each column in its metadata. A run on its grid is known
by its names alone: t, the joints, their rates and their second derivatives, each with its unit in SI.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, cast, get_args

import numpy as np
import pyarrow as pa

from urmpipe_models.elementwise import IntArray
from urmpipe_models.math3d import COLUMN_NAMES
from urmpipe_pipeline.joint_log import Role
from urmpipe_pipeline.logs.formats.cells import Bytes
from urmpipe_pipeline.logs.formats.clock_forms import EXPONENTS
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.memory import JOINT, ROLE, UNIT
from urmpipe_pipeline.logs.vocabulary import split_unit

MARK = "urmpipe"  # key of our metadata: of a Parquet file, and of the attributes of a table in pandas
FORM = b"rotation_form"  # key of the form of the orientation, in the metadata of a table
GIVEN = b"given"  # key of a table of arrays that were given one by one
RECORDED = "recorded_"  # prefix of the name of a column that the log recorded itself
ORDERS: Mapping[Role, tuple[str, str]] = {
    "joint": ("", ""),
    "rate": ("d_", "/s"),
    "acceleration": ("dd_", "/s2"),
}  # prefix of the name of a joint and suffix of its unit, by the role of a column
POINT = [("px", "m"), ("py", "m"), ("pz", "m"), ("rz", "rad"), ("ry", "rad"), ("rx", "rad")]
# the tool centre point of static poses on their grid

_ROLE_AND_PLACE = re.compile(rf"(?P<role>{'|'.join(get_args(Role))}) (?P<place>\d{{1,9}})", re.ASCII)

Head = Sequence[tuple[str, str]]  # name and unit of each column, an empty unit where none is stated


def read_roles(table: LogTable) -> dict[int, Role]:
    """Return what the columns of a table of ours hold, by their index, in the order of their role.

    Of other tables it is nothing.
    """
    texts = (_metadata(field, ROLE) for field in table.arrow.schema) if table.arrow is not None else ()
    matches = ((index, _ROLE_AND_PLACE.fullmatch(text)) for index, text in enumerate(texts))
    stated = [(int(match["place"]), index, cast("Role", match["role"])) for index, match in matches if match]
    if stated:
        return {index: role for _, index, role in sorted(stated)}
    return _read_grid_roles(_read_head(table)) if table.header is not None else {}


def stated_joints(table: LogTable) -> frozenset[int]:
    """Return the indices of the columns that a schema calls positions of joints, in no order."""
    schema = table.arrow.schema if table.arrow is not None else ()
    return frozenset(k for k, field in enumerate(schema) if (field.metadata or {}).get(ROLE) == JOINT)


def read_rotation_form(table: LogTable) -> str:
    """Return the form of the orientation in a table of ours; empty where it does not state one."""
    form = _metadata(table.arrow.schema, FORM) if table.arrow is not None else ""
    return form if form in COLUMN_NAMES else ""


def is_in_si(table: LogTable) -> bool:
    """Return whether urmpipe made the numbers of a table, in SI: the units that it states are certain."""
    if table.arrow is not None and MARK.encode() in (table.arrow.schema.metadata or {}):
        return True
    return table.header is not None and bool(_read_grid_roles(_read_head(table)))


def _metadata(field: pa.Field | pa.Schema, name: bytes) -> str:
    value: bytes = (field.metadata or {}).get(name, b"")
    return value.decode(errors="replace")


def _read_head(table: LogTable) -> Head:
    split = [split_unit(name) for name in table.names]
    units = table.units or [""] * len(split)
    return [(label, unit or in_name or "") for (label, in_name), unit in zip(split, units, strict=False)]


def _read_grid_roles(head: Head) -> dict[int, Role]:
    """Return what the columns of a run on its grid hold, by their index; nothing of other tables.

    No other program writes joints, rates and second derivatives so. In a table of static poses the number of
    each precedes the joints and the point of the tool.
    """
    if len(head) < 2 or head[0] not in (("t", "s"), ("row", "")):
        return {}
    is_timed = head[0][0] == "t"
    last = (f"d_{head[1][0]}", f"{head[1][1]}/s") if is_timed else POINT[0]
    count = next((k - 1 for k, column in enumerate(head) if k > 1 and column == last), 0)
    joints = head[1 : 1 + count]
    orders = list(ORDERS.values()) if is_timed else [("", "")]
    columns = [(prefix + name, unit + suffix) for prefix, suffix in orders for name, unit in joints]
    columns += [] if is_timed else POINT
    is_grid = list(head[1 : 1 + len(columns)]) == columns and all(unit in ("rad", "m") for _, unit in joints)
    if not count or not is_grid:
        return {}
    roles: dict[int, Role] = {0: "time"} if is_timed else {}
    for k, role in enumerate(ORDERS if is_timed else ("joint",)):
        roles |= dict.fromkeys(range(1 + k * count, 1 + (k + 1) * count), role)
    recorded = {k: n.removeprefix(RECORDED) for k, (n, _) in enumerate(head) if n.startswith(RECORDED)}
    roles |= {k: "position" for k, name in recorded.items() if name in ("tcp_x", "tcp_y", "tcp_z")}
    rotation = [k for k in recorded if k not in roles and recorded[k]]
    if tuple(recorded[k] for k in rotation) in COLUMN_NAMES.values():
        roles |= dict.fromkeys(rotation, "rotation")
    return roles


def with_roles(table: pa.Table, about: Mapping[str, Any]) -> pa.Table:
    """Return a table with the roles and units of our metadata in the metadata of its fields.

    Args:
        table: The table.
        about: Under `columns` the role of each and its place among those of the role, under `units` its unit
            where that is stated here, under `rotation_form` the form of the orientation.
    """
    roles, units = (as_mapping(about.get(name)) for name in ("columns", "units"))
    form = about.get("rotation_form")
    fields = []
    for field in table.schema:
        metadata = dict(field.metadata or {})
        if field.name in roles:
            value = roles[field.name]
            metadata[ROLE] = " ".join(map(str, value if isinstance(value, (list, tuple)) else [value]))
        if field.name in units:
            metadata[UNIT] = str(units[field.name])
        fields.append(field.with_metadata(metadata))
    return table.cast(pa.schema(fields, {FORM: str(form)} if form else None))


def mark_result(table: pa.Table, about: Mapping[str, Any]) -> pa.Table:
    """Return the table of a result of ours with what is stated of its columns, and that they are in SI."""
    return with_roles(table, about).replace_schema_metadata({MARK: ""}) if about else table


def pandas_attributes(metadata: Mapping[bytes, bytes] | None) -> Mapping[str, Any]:
    """Return what our results state of their columns in the attributes of a table that pandas wrote."""
    return as_mapping(as_mapping(read_metadata_json(metadata, "pandas").get("attributes")).get(MARK))


def read_metadata_json(metadata: Mapping[bytes, bytes] | None, name: str) -> Mapping[str, Any]:
    """Return the mapping of JSON in the metadata of a table; an empty one of what others wrote there."""
    try:
        return as_mapping(json.loads((metadata or {}).get(name.encode(), b"null")))
    except (ValueError, RecursionError):
        return {}


def as_mapping(value: object) -> Mapping[str, Any]:
    """Return a value that is a mapping; an empty one in the place of any other."""
    return value if isinstance(value, Mapping) else {}


def exact_times(table: pa.Table, clock: pa.ChunkedArray) -> pa.Table:
    """Return a table with the clock in integer [ns] in the place of its only column of times as doubles."""
    units = [(field.metadata or {}).get(UNIT, b"").decode(errors="replace") for field in table.schema]
    times = [k for k, unit in enumerate(units) if unit in EXPONENTS]
    field = table.schema.field(times[0]) if len(times) == 1 else None
    if field is None or not pa.types.is_floating(field.type) or clock.null_count:
        return table
    exact = decimals(clock.to_numpy(), EXPONENTS[units[times[0]]])
    return table.set_column(times[0], field.with_type(exact.type), exact)


def decimals(ns: IntArray, exponent: int) -> pa.Array:
    """Return times in integer [ns], shape (n,), as exact decimals of a unit, powers of ten above it."""
    words: Bytes = np.column_stack([ns, ns >> 63]).astype("<i8").view(np.uint8)  # 128 bits each
    kind = pa.decimal128(19, exponent)
    return pa.Array.from_buffers(kind, len(ns), [None, pa.py_buffer(np.ascontiguousarray(words))])
