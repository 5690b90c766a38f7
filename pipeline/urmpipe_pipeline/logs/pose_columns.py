"""The tool centre point that a log recorded: the columns of its position and orientation, and their form.

1. `find_pose`: by names: x, y, z and a rotation vector in a row (pose_0, ...); a matrix by its numbers, too;
   x, y, z of the tool or as measured from outside, with the only orientation beside them; p1, p2, p3 with a
   quaternion. Of several positions those measured are read.
2. `chosen_pose`, `with_form`: the columns and the form that the user gives.
3. By their numbers: R R^T = I and a row 0, 0, 0, 1 prove a homogeneous transform, length 1 a quaternion.
"""

from __future__ import annotations

import os.path
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError
from urmpipe_models.math3d import FORMS, RotationForm, column_count
from urmpipe_pipeline.logs.columns import Column, chosen_columns, listed
from urmpipe_pipeline.logs.formats.cells import to_float
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.sniff import FEW
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.names import Family, drop_unknown, find_families, prefer_measured
from urmpipe_pipeline.logs.vocabulary import vocabulary

ORTHOGONAL = 1e-2  # entries of R R^T may differ from those of I by this: matrices have three digits or more
OF_POSITION = re.compile(r"(?<=_)(pos|position|pose|pose_position|p|translation)_$")  # behind the device

_UNIT_LENGTH = 1e-2  # squared lengths of quaternions may differ from 1 by this
_MIN_ROWS = 3  # in fewer, numbers have length 1 by chance
_LIKE_JOINT = re.compile(r"q_?\d")  # names that quaternions and joints have
_PLACES = np.arange(16).reshape(4, 4)  # of the entries of a homogeneous transform among its columns
_ORDERS = (("row by row", _PLACES), ("column by column", _PLACES.T))


@dataclass(frozen=True, slots=True)
class Pose:
    """Columns of a recorded tool centre point.

    Attributes:
        position: x, y, z, or x, y in the plane z = 0, or none.
        rotation: The columns of its orientation, in the order of the form, or none.
        forms: What these may be; one if it is known.
        evidence: Why.
        measured: Whether it was measured from outside, in a frame of its own.
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
    file: str | None = None,
    *,
    form: RotationForm | None = None,
    some: bool = False,
    lone: bool = False,
) -> Pose:
    """Return the recorded pose among some columns with names.

    Args:
        numeric: Candidates.
        tables: The tables.
        file: The file, if it is an error that several positions are recorded; else they are left out.
        form: Form of the orientation, if it is given: its columns need not prove that they hold it.
        some: Whether it is enough that some rows hold an orientation: the others are wrong.
        lone: Whether columns are a position that are known only without their words for measured or
            commanded: target_x is not where the tool was, unless the log has actual_x, too.

    Raises:
        LogError: If there are several positions where one is needed.
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
        if pose := transform_pose(columns, _sample(columns, tables)[0], some=some):
            same = [other for other in families if other.shares_name(family)]
            return replace(pose, alternatives=_alternatives(family, same))
    inside = [column for column in numeric if not column.words & words.outside]
    if any(column.key in ("fx", "f_x") for column in inside):  # tx, ty, tz beside forces are torques
        inside = [c for c in inside if not (c.key.startswith("t") and len(c.key) <= len("t_x"))]
    families = drop_unknown(find_families(inside, words.tcp_position, 0), lone=lone)
    position, alternatives = _find_xyz(families, file)
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
        rest, lone = [column for column in rest if column.kind == position[0].kind], True
    rotation, forms = _find_rotation(rest, tables, form, some=some, lone=lone)
    in_frame = any(pattern.search(position[0].key) for pattern in words.measured)
    return Pose(position, rotation, forms, measured=in_frame, alternatives=alternatives)


def _find_counted_pose(
    numeric: Sequence[Column], tables: Sequence[LogTable], form: RotationForm | None
) -> Pose:
    """Return p1, p2, p3 and the only quaternion beside them, which has length 1 in each row; else no pose."""
    families = prefer_measured(find_families(numeric, vocabulary().tcp_counted, 0))
    families = [family for family in families if _numbers(family) == range(3)]
    if len(families) != 1:
        return Pose()
    position = families[0].ordered()
    rest = [column for column in numeric if column not in position]
    rotation, forms = _find_rotation(rest, tables, form)
    if len(rotation) != 4 or not _is_unit(rotation, tables):
        return Pose()
    return Pose(position, rotation, forms, "the four columns beside them have length 1")


def _find_xyz(
    families: Sequence[Family], file: str | None = None
) -> tuple[tuple[Column, ...], tuple[tuple[Column, ...], ...]]:
    """Return the columns of the only one of the surest families that is x, y, z, and those of the others."""
    valid = [family for family in families if _numbers(family) == range(3)]
    families = [family for family in prefer_measured(families) if family in valid]
    best = [family for family in families if family.rank == families[0].rank]
    if len(best) > 1 and file is not None:
        groups = "; ".join(listed(family.ordered()) for family in best)
        raise LogError(Finding(f"found several positions: {groups}; allowed: one x, y, z", file=file))
    return (best[0].ordered(), _alternatives(best[0], valid)) if len(best) == 1 else ((), ())


def _alternatives(family: Family, families: Sequence[Family]) -> tuple[tuple[Column, ...], ...]:
    """Return the columns of the other families of as many."""
    count = len(family.columns)
    return tuple(f.ordered() for f in families if f is not family and len(f.columns) == count)


def _find_rotation(
    rest: Sequence[Column],
    tables: Sequence[LogTable],
    form: RotationForm | None,
    *,
    some: bool = False,
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
        is_clear = not _LIKE_JOINT.fullmatch(columns[0].bare) or form in words.forms
        if is_clear or _is_unit(columns, tables, some=some):
            return columns, words.forms
    matrices = prefer_measured(find_families(rest, vocabulary().tcp_matrix, 0))
    matrices = [family for family in matrices if len(family.columns) == 9]
    if len(matrices) == 1:
        columns = matrices[0].ordered()
        is_clear = some and "i" in vocabulary().tcp_matrix[matrices[0].rank].groupindex  # r11 is no joint
        holds = _are_orthogonal(_sample(columns, tables)[0].reshape(-1, 3, 3))
        if is_clear or form == "matrix" or _is_enough(holds, some=some):
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
    widths = str(column_count(options.rotation)) if options.rotation else "3, 4 or 9"
    if options.measured:
        named = chosen_columns(columns, options.measured, parameter="measured")
        position, rotation = named[:3], named[3:]
        forms = _forms_of(rotation, options)
        if len(position) != 3 or (rotation and not forms):
            allowed = f"x, y, z, and {widths} of the orientation behind them, or none"
            count = format_count(len(named), "column")
            raise OptionError(Finding(parameter="measured", found=count, allowed=allowed))
        return Pose(position, rotation, forms, "given as an option", measured=True)
    if not options.position:
        if options.orientation:
            hint = Hint("position", None, "names x, y, z")
            message = "found without a position, allowed: beside x, y, z"
            raise OptionError(Finding(message, parameter="orientation", hints=(hint,)))
        return None
    position = chosen_columns(columns, options.position, about="position")
    rotation = chosen_columns(columns, options.orientation, about="orientation")
    if len(position) not in (2, 3):
        allowed = "x, y, z, or x, y of a planar arm"
        raise OptionError(f"position: found {format_count(len(position), 'column')}, allowed: {allowed}")
    forms = _forms_of(rotation, options)
    if rotation and not forms:
        allowed = f"{widths}, as {options.rotation} has" if options.rotation else widths
        raise OptionError(f"orientation: found {format_count(len(rotation), 'column')}, allowed: {allowed}")
    return Pose(position, rotation, forms, "given as an option")


def _forms_of(rotation: Sequence[Column], options: LogMap) -> tuple[RotationForm, ...]:
    """Return the forms that so many columns of an orientation may have; none of none."""
    forms = [form for form in FORMS if rotation and column_count(form) == len(rotation)]
    return tuple(form for form in forms if options.rotation in (None, form))


def with_form(pose: Pose, form: RotationForm | None) -> Pose:
    """Return the pose with the form of orientation that the user gives.

    Raises:
        OptionError: If it has another number of columns.
    """
    if form is None or not pose.rotation:
        return pose
    if column_count(form) != len(pose.rotation):
        found = f"{form}, which has {column_count(form)} columns, for {listed(pose.rotation)}"
        allowed = f"a form of {len(pose.rotation)} columns"
        raise OptionError(Finding(parameter="rotation", found=found, allowed=allowed))
    return replace(pose, forms=(form,))


# 3. By numbers


def trailing_matrix(
    columns: Sequence[Column], tables: Sequence[LogTable], *, some: bool = False
) -> Pose | None:
    """Return the pose in columns without names of which the last 16 or 12 are a homogeneous transform."""
    last = (columns[-count:] for count in (16, 12) if len(columns) >= count)
    poses = (transform_pose(group, _sample(group, tables)[0], some=some) for group in last)
    return next((pose for pose in poses if pose), None)


def transform_pose(columns: Sequence[Column], values: FloatArray, *, some: bool = False) -> Pose | None:
    """Return the pose that 16 or 12 columns hold as a homogeneous transform; None of others.

    Row by row, or of 16 also column by column: the entries 0, 0, 0, 1 show which.

    Args:
        columns: The columns, in their order.
        values: Their values in the file's units, shape (n, columns).
        some: Whether it is enough that some rows are one: the others are wrong.
    """
    for order, entries in _orders_of(len(columns)):
        if _is_enough(_are_transforms(values, entries), some=some):
            position, rotation = (
                tuple(columns[k] for k in places.ravel().tolist())
                for places in (entries[:3, 3], entries[:3, :3])
            )
            return Pose(position, rotation, ("matrix",), f"a transform, {order}")
    return None


def trailing_quaternion(
    columns: Sequence[Column], tables: Sequence[LogTable], *, some: bool = False
) -> Pose | None:
    """Return the pose in the last seven columns without names, if four of length 1 follow three others."""
    is_pose = len(columns) >= 7 and _is_unit(columns[-4:], tables, some=some)
    return quaternion_pose(columns) if is_pose else None


def quaternion_pose(columns: Sequence[Column]) -> Pose:
    """Return the last seven columns as a position and a quaternion of unknown order."""
    evidence = "the last four of seven numbers have length 1"
    return Pose(tuple(columns[-7:-4]), tuple(columns[-4:]), ("quat_xyzw", "quat_wxyz"), evidence)


def turns_as_quaternion(columns: Sequence[Column], tables: Sequence[LogTable]) -> bool:
    """Return whether four columns have length 1 in every sampled row, and change."""
    values, _ = _sample(columns, tables)
    return _is_unit(columns, tables) and bool((values != values[0]).any())


def odd_rows(columns: Sequence[Column], tables: Sequence[LogTable]) -> list[int]:
    """Return the few sampled rows, from 1, that hold no orientation although most do: they hide it.

    Of 16 or 12 columns it is a transform, of 9 a matrix, of 4 a quaternion that changes in most rows.
    """
    values, rows = _sample(columns, tables)
    laws = [_are_transforms(values, entries) for _, entries in _orders_of(len(columns))]
    if len(columns) == 9:
        laws = [_are_orthogonal(values.reshape(-1, 3, 3))]
    elif len(columns) == 4:
        changes = (np.diff(values, axis=0) != 0).any(axis=1)
        laws = [have_length_1(values)] if 2 * np.count_nonzero(changes) > len(changes) else []
    few = (rows[~holds].tolist() for holds in laws if 0 < np.count_nonzero(~holds) <= FEW * len(rows))
    return next(few, [])


def have_length_1(values: FloatArray) -> BoolArray:
    """Return which rows are unit vectors; shape (n,)."""
    with np.errstate(over="ignore"):  # of huge values the length is infinite
        return np.asarray(np.abs((values**2).sum(axis=1) - 1.0) < _UNIT_LENGTH)


def _is_unit(columns: Sequence[Column], tables: Sequence[LogTable], *, some: bool = False) -> bool:
    """Return whether the numbers of three rows or more, or of some, have length 1, as quaternions have."""
    values, _ = _sample(columns, tables)
    return (some or len(values) >= _MIN_ROWS) and _is_enough(have_length_1(values), some=some)


def _sample(columns: Sequence[Column], tables: Sequence[LogTable]) -> tuple[FloatArray, IntArray]:
    """Return the sampled rows in which all of these columns have a number, and which these are, from 1."""
    cells = [
        [to_float(cell, tables[column.table].decimal) for cell in tables[column.table].cells(column.index)]
        for column in columns
    ]
    values = np.array(list(zip(*cells, strict=False)), dtype=np.float64).reshape(-1, len(columns))
    known = np.flatnonzero(np.isfinite(values).all(axis=1))  # NaN for no number
    return values[known], known + 1


def _orders_of(count: int) -> Sequence[tuple[str, IntArray]]:
    """Return the orders of the entries of a transform in so many columns; none in others than 12 and 16."""
    return _ORDERS if count == 16 else _ORDERS[:1] if count == 12 else ()


def _are_transforms(values: FloatArray, entries: IntArray) -> BoolArray:
    """Return which rows are homogeneous transforms with their entries at these places; shape (n,)."""
    holds = _are_orthogonal(values[:, entries[:3, :3].ravel()].reshape(-1, 3, 3))
    return holds if values.shape[1] == 12 else holds & (values[:, entries[3]] == (0, 0, 0, 1)).all(axis=1)


def _are_orthogonal(r: FloatArray) -> BoolArray:
    """Return which of these are rotation matrices: R R^T = I and det R = 1; shape (n,)."""
    gram = r @ r.transpose(0, 2, 1)
    near = (np.abs(gram - np.eye(3)) < ORTHOGONAL).all(axis=(1, 2))
    return np.asarray(near & (np.linalg.det(r) > 0))


def _is_enough(holds: BoolArray, *, some: bool) -> bool:
    """Return whether a law holds in all rows, one at least; with `some`, in any: the others have errors."""
    return bool(holds.any()) if some else len(holds) > 0 and bool(holds.all())
