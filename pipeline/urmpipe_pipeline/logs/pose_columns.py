"""The tool centre point that a log recorded: the columns of its position and orientation, and their form.

1. `find_pose`: by names: x, y, z and a rotation vector in a row (pose_0, ...); a matrix by its numbers, too;
   x, y, z of the tool or as measured from outside, with the only orientation next to them; p1, p2, p3 with a
   quaternion. Of several positions those measured are read.
2. `chosen_pose`, `with_form`: the columns and the form that the user gives.
3. `trailing_pose`: the last columns of a table without names, by their numbers: R R^T = I and a row
   0, 0, 0, 1 prove a homogeneous transform, length 1 a quaternion (`holds_orientation`), a few rows excepted.
"""

from __future__ import annotations

import os.path
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.errors import Finding, Hint, OptionError
from urmpipe_models.math3d import FORMS, RotationForm, column_count
from urmpipe_pipeline.logs.columns import Column, chosen_columns, listed
from urmpipe_pipeline.logs.formats.cells import to_float
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.names import Family, drop_unknown, find_families, prefer_measured
from urmpipe_pipeline.logs.vocabulary import vocabulary

ORTHOGONAL = 1e-2  # entries of R R^T may differ from those of I by this: matrices have three digits or more
MAX_LENGTH_DEVIATION = 0.02  # of a quaternion from 1: they are printed with two digits or more
MAX_ODD = 0.25  # share of rows that may be wrong where the others show what columns without names hold
MIN_ROWS = 3  # in fewer, four numbers have length 1 by chance
OF_POSITION = re.compile(r"(?<=_)(pos|position|pose|pose_position|p|translation)_$")  # after the device

_LIKE_JOINT = re.compile(r"q_?\d")  # names that quaternions and joints have
_PLACES = np.arange(16).reshape(4, 4)  # of the entries of a homogeneous transform among its columns
_ORDERS = (("row by row", _PLACES), ("column by column", _PLACES.T))
_ROTATION_FIRST = ("rotation and position", np.column_stack([np.arange(9).reshape(3, 3), [9, 10, 11]]))


@dataclass(frozen=True, slots=True)
class Pose:
    """Columns of a recorded tool centre point.

    Attributes:
        position: x, y, z, or x, y in the plane z = 0, or none.
        rotation: The columns of its orientation, in the order of the form, or none.
        forms: What these may be; one if it is known.
        evidence: Why.
        measured: Whether it was measured from outside, in another frame.
        alternatives: Groups of columns that would have been the position without these.
    """

    position: tuple[Column, ...] = ()
    rotation: tuple[Column, ...] = ()
    forms: tuple[RotationForm, ...] = ()
    evidence: str = "their names"
    measured: bool = False
    alternatives: tuple[tuple[Column, ...], ...] = ()


# 1. By names


def find_pose(
    numeric: Sequence[Column],
    tables: Sequence[LogTable],
    form: RotationForm | None = None,
    *,
    path: bool = False,
) -> Pose:
    """Return the recorded pose among some columns with names.

    Args:
        numeric: Candidates.
        tables: The tables.
        form: Form of the orientation, if it is given: of a path its columns need not prove that they hold it.
        path: Whether a pose is needed. Then numbers prove an orientation in any row, as the others are wrong,
            a target is a position, and of several positions the first is returned, with its alternatives.
            Else most rows have to prove it, target_x is not where the tool was unless the log has actual_x,
            too, and several positions give no pose.
    """
    words = vocabulary()
    families = [f for f in find_families(numeric, words.tcp_pose_vector, 0) if _numbers(f) == range(6)]
    vectors = prefer_measured(families)
    if len(vectors) == 1:
        columns = vectors[0].ordered()
        forms: tuple[RotationForm, ...] = ("vector",) if vectors[0].rank == 0 else ("vector", "rpy", "xyz")
        return Pose(columns[:3], columns[3:], forms, alternatives=_alternatives(vectors[0], families))
    families = find_families(numeric, words.tcp_matrix, 0)
    for family in prefer_measured(families):
        columns = family.ordered()
        for pose, holds in _iter_transforms(columns, _sample(columns, tables)):
            if _is_enough(holds, path=path):
                same = [other for other in families if other.shares_name(family)]
                return replace(pose, alternatives=_alternatives(family, same))
    inside = [column for column in numeric if not column.words & words.outside]
    if any(column.key in ("fx", "f_x") for column in inside):  # tx, ty, tz next to forces are torques
        inside = [c for c in inside if not (c.key.startswith("t") and len(c.key) <= len("t_x"))]
    families = drop_unknown(find_families(inside, words.tcp_position, 0), lone=path)
    position, alternatives = _find_xyz(families, path=path)
    is_outside = not position
    if is_outside:
        position, alternatives = _find_xyz(find_families(numeric, words.measured, 0))
    if not position:
        return _find_counted_pose(numeric, tables, form)
    rest = [column for column in numeric if column not in position]
    if is_outside:
        stem = os.path.commonprefix([column.key for column in position])  # noqa: RUF071 (names, not paths)
        stem = OF_POSITION.sub("", stem)
        rest = [column for column in rest if stem and column.key.startswith(stem)]
    if alternatives:  # the orientation of another position is not that of this one
        rest = [column for column in rest if column.kind == position[0].kind]
    rotation, forms = _find_rotation(rest, tables, form, path=path, lone=path or bool(alternatives))
    in_frame = any(pattern.search(position[0].key) for pattern in words.measured)
    return Pose(position, rotation, forms, measured=in_frame, alternatives=alternatives)


def _find_counted_pose(
    numeric: Sequence[Column], tables: Sequence[LogTable], form: RotationForm | None
) -> Pose:
    """Return p1, p2, p3 and the only quaternion next to them, of length 1 in most rows; else no pose."""
    families = prefer_measured(find_families(numeric, vocabulary().tcp_counted, 0))
    families = [family for family in families if _numbers(family) == range(3)]
    if len(families) != 1:
        return Pose()
    position = families[0].ordered()
    rest = [column for column in numeric if column not in position]
    rotation, forms = _find_rotation(rest, tables, form)
    if len(rotation) != 4 or not _is_rotation(rotation, tables):
        return Pose()
    return Pose(position, rotation, forms, "the four columns next to them have length 1")


def _find_xyz(
    families: Sequence[Family], *, path: bool = False
) -> tuple[tuple[Column, ...], tuple[tuple[Column, ...], ...]]:
    """Return the columns of the only one of the surest families that is x, y, z, and those of the others."""
    valid = [family for family in families if _numbers(family) == range(3)]
    families = [family for family in prefer_measured(families) if family in valid]
    best = [family for family in families if family.rank == families[0].rank]
    is_clear = len(best) == 1 or (path and best)
    return (best[0].ordered(), _alternatives(best[0], valid)) if is_clear else ((), ())


def may_be_positions(columns: Sequence[Column]) -> list[tuple[Column, ...]]:
    """Return the groups of columns whose names differ by x, y and z alone, or by x and y."""
    words = vocabulary()
    excluded = words.joint_terms["rate"] | words.joint_terms["acceleration"] | (words.other - words.tool)
    groups: dict[tuple[str, ...], dict[str, Column]] = {}
    for column in columns:
        parts = column.plain.split("_")
        axes = [k for k, part in enumerate(parts) if part in ("x", "y", "z")]
        is_length = column.unit is None or column.unit.quantity == "length"
        if axes and is_length and not column.words & excluded:
            stem = *parts[: axes[-1]], "#", *parts[axes[-1] + 1 :]
            groups.setdefault(stem, {}).setdefault(parts[axes[-1]], column)
    return [
        tuple(group[axis] for axis in sorted(group)) for group in groups.values() if {*group} >= {"x", "y"}
    ]


def _alternatives(family: Family, families: Sequence[Family]) -> tuple[tuple[Column, ...], ...]:
    """Return the columns of the other families of as many."""
    count = len(family.columns)
    return tuple(f.ordered() for f in families if f is not family and len(f.columns) == count)


def _find_rotation(
    rest: Sequence[Column],
    tables: Sequence[LogTable],
    form: RotationForm | None,
    *,
    path: bool = False,
    lone: bool = False,
) -> tuple[tuple[Column, ...], tuple[RotationForm, ...]]:
    """Return the columns of the only orientation, and the forms that their names allow."""
    for words in vocabulary().tcp_rotations:
        numbers = range(4) if words.forms[0].startswith("quat") else range(3)
        families = [f for f in find_families(rest, words.patterns, 0) if _numbers(f) == numbers]
        families = prefer_measured(drop_unknown(families, lone=lone))
        if len(families) != 1:
            continue
        columns = families[0].ordered()
        is_clear = not _LIKE_JOINT.fullmatch(columns[0].bare) or (path and form in words.forms)
        if is_clear or _is_rotation(columns, tables, path=path):
            return columns, words.forms
    matrices = prefer_measured(find_families(rest, vocabulary().tcp_matrix, 0))
    matrices = [family for family in matrices if len(family.columns) == 9]
    if len(matrices) == 1:
        columns = matrices[0].ordered()
        is_clear = path and "i" in vocabulary().tcp_matrix[matrices[0].rank].groupindex  # r11 is no joint
        is_clear |= path and form == "matrix"
        if is_clear or _is_rotation(columns, tables, path=path):
            return columns, ("matrix",)
    return (), ()


def _numbers(family: Family) -> range | None:
    """Return range(n) if the n numbers of a family count up from 0, or from 1, without a gap."""
    count, lowest = len(family.columns), min(family.columns)
    is_counted = lowest in (0, 1) and sorted(family.columns) == [*range(lowest, lowest + count)]
    return range(count) if is_counted else None


# 2. By options


def chosen_pose(columns: Sequence[Column], options: LogMap) -> Pose | None:
    """Return the pose whose columns the user named; None if none are named.

    Raises:
        LogError: If there is no such column.
        OptionError: If there are too few or too many for a position or for the form of the orientation.
    """
    if not (options.position or options.measured):
        if options.orientation:
            hint = Hint("position", None, "names x, y, z")
            message = "found without a position, allowed: next to x, y, z"
            raise OptionError(Finding(message, parameter="orientation", hints=(hint,)))
        return None
    if is_outside := bool(options.measured):
        named = chosen_columns(columns, options.measured, parameter="measured")
        position, rotation = named[:3], named[3:]
    else:
        position = chosen_columns(columns, options.position, parameter="position")
        rotation = chosen_columns(columns, options.orientation, parameter="orientation")
    if len(position) != 3 and (is_outside or len(position) != 2):
        parameter = "measured" if is_outside else "position"
        allowed = "x, y, z, and an orientation or none" if is_outside else "x, y, z, or x, y of a planar arm"
        count = format_count(len(position), "column")
        raise OptionError(Finding(parameter=parameter, found=count, allowed=allowed))
    forms = [form for form in FORMS if column_count(form) == len(rotation)] if rotation else []
    forms = [form for form in forms if options.rotation in (None, form)]
    if rotation and not forms:
        of_form = f"{column_count(options.rotation)}, as {options.rotation} has" if options.rotation else ""
        parameter = "measured" if is_outside else "orientation"
        count = format_count(len(rotation), "column") + " after x, y, z" * is_outside
        raise OptionError(Finding(parameter=parameter, found=count, allowed=of_form or "3, 4 or 9"))
    return Pose(position, rotation, tuple(forms), "given as an option", measured=is_outside)


def with_form(pose: Pose, form: RotationForm | None) -> Pose:
    """Return the pose with the form of orientation that the user gives.

    Raises:
        OptionError: If it has another number of columns.
    """
    if form is None or not pose.rotation:
        return pose
    if column_count(form) != len(pose.rotation):
        fault = f"{form}, which has {column_count(form)} columns, for {listed(pose.rotation)}"
        allowed = f"a form of {len(pose.rotation)} columns"
        raise OptionError(Finding(parameter="rotation", found=fault, allowed=allowed))
    return replace(pose, forms=(form,))


# 3. By numbers


def trailing_pose(columns: Sequence[Column], table: LogTable, *, path: bool = False) -> Pose | None:
    """Return the pose that the last columns of a table without names hold; or None.

    They hold one in all rows but a few; where a path is given, in any, as the others are wrong.
    16 or 12 are a homogeneous transform: row by row, or of 16 also column by column, as the entries
    0, 0, 0, 1 show; of 12 also a rotation matrix and a position, of 13 with a gripper last. Seven are x, y, z
    and a quaternion of unknown order; one that rests has no wrong rows.
    """
    blocks = [(count, columns[-count:]) for count in (16, 12, 7)]
    blocks += [(12, columns[:12])] if len(columns) == 13 else []
    for count, last in blocks:
        values = table.values([column.index for column in last])
        values = values[np.isfinite(values).all(axis=1)]
        if len(last) < count or not len(values):
            continue
        if count == 7:
            holds = holds_orientation(values[:, 3:])
            changes = (np.diff(values[:, 3:], axis=0) != 0).any(axis=1)
            are_enough = len(values) >= MIN_ROWS or len(table.names) == 8  # with a time, as of TUM
            is_steady = holds.all() or 2 * np.count_nonzero(changes) > len(changes)
            is_sure = path or (are_enough and is_steady)
            evidence = "the last four of seven numbers have length 1"
            quaternion = Pose(tuple(last[:3]), tuple(last[3:]), ("quat_xyzw", "quat_wxyz"), evidence)
            readings = iter([(quaternion, holds)] if is_sure else [])
        else:
            readings = _iter_transforms(last, values)
        for pose, holds in readings:
            if holds.any() if path else np.count_nonzero(~holds) <= MAX_ODD * len(holds):
                return pose
    return None


def leading_pose(columns: Sequence[Column], table: LogTable) -> Pose | None:
    """Return the pose that the first seven columns of more hold: x, y, z and a quaternion; or None."""
    return trailing_pose(columns[:7], table) if len(columns) > 7 else None


def turns_as_quaternion(columns: Sequence[Column], tables: Sequence[LogTable]) -> bool:
    """Return whether four columns have length 1 in every sampled row, three at least, and change."""
    values = _sample(columns, tables)
    is_quaternion = len(values) >= MIN_ROWS and bool(holds_orientation(values).all())
    return is_quaternion and bool((values != values[0]).any())


def holds_orientation(values: FloatArray) -> BoolArray:
    """Return which rows are a quaternion, |q| = 1, or a rotation matrix, R R^T = I and det R = 1; shape (n,).

    Args:
        values: Quaternions, shape (n, 4), or matrices, shape (n, 9) [-]; of three columns all rows are one.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of huge values the length is infinite
        if values.shape[1] == 4:
            return np.asarray(np.abs(np.linalg.norm(values, axis=1) - 1.0) <= MAX_LENGTH_DEVIATION)
        if values.shape[1] != 9:
            return np.ones(len(values), dtype=np.bool_)
        r = values.reshape(-1, 3, 3)
        near = (np.abs(r @ r.transpose(0, 2, 1) - np.eye(3)) < ORTHOGONAL).all(axis=(1, 2))
        return np.asarray(near & (np.linalg.det(r) > 0))


def _iter_transforms(columns: Sequence[Column], values: FloatArray) -> Iterator[tuple[Pose, BoolArray]]:
    """Yield the poses that 16 or 12 columns may be as a transform, and in which rows they are; shape (n,)."""
    for order, entries in {16: _ORDERS, 12: (_ORDERS[0], _ROTATION_FIRST)}.get(len(columns), ()):
        holds = holds_orientation(values[:, entries[:3, :3].ravel()])
        if len(columns) == 16:
            holds &= (values[:, entries[3]] == (0, 0, 0, 1)).all(axis=1)
        position, rotation = (
            tuple(columns[k] for k in places.ravel().tolist()) for places in (entries[:3, 3], entries[:3, :3])
        )
        yield Pose(position, rotation, ("matrix",), f"a transform, {order}"), holds


def _sample(columns: Sequence[Column], tables: Sequence[LogTable]) -> FloatArray:
    """Return the numbers of columns in the first rows in which all of them have one, shape (n, columns)."""
    cells = [
        [to_float(cell, tables[column.table].decimal) for cell in tables[column.table].cells(column.index)]
        for column in columns
    ]
    values = np.array(list(zip(*cells, strict=False)), dtype=np.float64).reshape(-1, len(columns))
    return values[np.isfinite(values).all(axis=1)]  # NaN for no number


def _is_rotation(columns: Sequence[Column], tables: Sequence[LogTable], *, path: bool = False) -> bool:
    """Return whether the numbers of four or nine columns are an orientation in enough rows."""
    holds = holds_orientation(_sample(columns, tables))
    return (path or len(holds) >= MIN_ROWS or len(columns) != 4) and _is_enough(holds, path=path)


def _is_enough(holds: BoolArray, *, path: bool) -> bool:
    """Return whether a law holds in most rows; of a path in any, as the others are wrong."""
    return bool(holds.any() if path else 2 * np.count_nonzero(holds) > len(holds))
