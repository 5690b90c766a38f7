"""The tool centre point that a log recorded: the columns of its position and orientation, and their form."""

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

ORTHOGONAL = 1e-2
"""Entries of R R^T may differ from those of I by this: matrices are printed with three digits or more."""


_LIKE_JOINT = re.compile(r"q_?\d")
"""Names that quaternions and joints have."""

OF_POSITION = re.compile(r"(?<=_)(pos|position|pose|pose_position|p|translation)_$")
"""What the names of x, y, z may have behind the device, and those of the orientation have not."""

_UNIT_LENGTH = 1e-2

_PLACES = np.arange(16).reshape(4, 4)
_ORDERS = (("row by row", _PLACES), ("column by column", _PLACES.T))
"""The places of the entries of a homogeneous transform among its columns."""


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


def find_pose(
    numeric: Sequence[Column],
    layouts: Sequence[LogTable],
    file: str | None = None,
    *,
    form: RotationForm | None = None,
    some: bool = False,
    lone: bool = False,
) -> Pose:
    """Return the recorded pose among some columns with names.

    Args:
        numeric: Candidates.
        layouts: The tables.
        file: The file, if it is an error that several positions are recorded; else they are left.
        form: Form of the orientation, if it is told: its columns are not asked then whether they hold it.
        some: Whether it is enough that some rows hold an orientation: the others are wrong.
        lone: Whether columns are a position that are known only without their words for measured or
            commanded: target_x is not where the tool was, unless the log has actual_x, too.

    Raises:
        LogError: If there are several positions where one is needed.
    """
    every = [f for f in find_families(numeric, vocabulary().tcp_pose_vector, 0) if _numbers(f) == range(6)]
    vectors = prefer_measured(every)
    if len(vectors) == 1:
        ordered = vectors[0].ordered()
        forms: tuple[RotationForm, ...] = ("vector",) if vectors[0].rank == 0 else ("vector", "rpy", "xyz")
        return Pose(ordered[:3], ordered[3:], forms, alternatives=_alternatives(vectors[0], every))
    every = find_families(numeric, vocabulary().tcp_matrix, 0)
    for family in prefer_measured(every):
        pose = matrix_pose(family.ordered(), layouts, some=some)
        if pose is not None:
            same = [other for other in every if other.shares_name(family)]
            return replace(pose, alternatives=_alternatives(family, same))
    position, alternatives = _position(numeric, file, lone=lone)
    measured = not position
    if measured:
        position, alternatives = _xyz(find_families(numeric, vocabulary().measured, 0))
    if not position and (numbered := _counted_pose(numeric, layouts, form)):
        return numbered
    rest = [column for column in numeric if column not in position]
    if measured and position:
        stem = os.path.commonprefix([column.key for column in position])  # noqa: RUF071 (names, not paths)
        stem = OF_POSITION.sub("", stem)
        rest = [column for column in rest if stem and column.key.startswith(stem)]
    if alternatives:  # the orientation of another position is not that of this one
        rest, lone = [column for column in rest if column.kind == position[0].kind], True
    rotation, forms = _rotation(rest, layouts, form, some=some, lone=lone) if position else ((), ())
    own_frame = any(p.search(column.key) for column in position[:1] for p in vocabulary().measured)
    return Pose(position, rotation, forms, measured=own_frame, alternatives=alternatives)


def _counted_pose(
    numeric: Sequence[Column], layouts: Sequence[LogTable], form: RotationForm | None
) -> Pose | None:
    """Return p1, p2, p3 and the only quaternion beside them, which has length 1 in each row."""
    every = prefer_measured(find_families(numeric, vocabulary().tcp_counted, 0))
    found = [f for f in every if _numbers(f) == range(3)]
    if len(found) != 1:
        return None
    position = found[0].ordered()
    rest = [column for column in numeric if column not in position]
    rotation, forms = _rotation(rest, layouts, form, some=False)
    if len(rotation) != 4 or not _is_unit(rotation, layouts, some=False):
        return None
    return Pose(position, rotation, forms, "the four columns beside them have length 1")


def chosen_pose(columns: Sequence[Column], options: LogMap) -> Pose | None:
    """Return the pose whose columns the user named; None if none are named.

    Raises:
        LogError: If there is no such column.
        OptionError: If there are too few or too many for a position or for the form of the orientation.
    """
    if options.measured:
        return _measured_pose(columns, options)
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
        allowed = (
            f"{column_count(options.rotation)}, as {options.rotation} has"
            if options.rotation
            else "3, 4 or 9"
        )
        raise OptionError(f"orientation: found {format_count(len(rotation), 'column')}, allowed: {allowed}")
    return Pose(position, rotation, forms if rotation else (), "given as an option")


def _measured_pose(columns: Sequence[Column], options: LogMap) -> Pose:
    """Return the pose that the user names as measured from outside."""
    named = chosen_columns(columns, options.measured, parameter="measured")
    position, rotation = named[:3], named[3:]
    forms = _forms_of(rotation, options)
    if len(position) != 3 or (rotation and not forms):
        widths = f"{column_count(options.rotation)}" if options.rotation else "3, 4 or 9"
        allowed = f"x, y, z, and {widths} of the orientation behind them, or none"
        raise OptionError(
            Finding(parameter="measured", found=format_count(len(named), "column"), allowed=allowed)
        )
    return Pose(position, rotation, forms, "given as an option", measured=True)


def _forms_of(rotation: Sequence[Column], options: LogMap) -> tuple[RotationForm, ...]:
    """Return the forms that so many columns of an orientation may have; none of none."""
    many = len(rotation)
    return tuple(
        form for form in FORMS if many and column_count(form) == many and options.rotation in (None, form)
    )


def with_form(pose: Pose, form: RotationForm | None) -> Pose:
    """Return the pose with the form of orientation that the user tells.

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


def trailing_matrix(
    columns: Sequence[Column], layouts: Sequence[LogTable], *, some: bool = False
) -> Pose | None:
    """Return the pose in columns without names of which the last 16 or 12 are a homogeneous transform."""
    tried = (matrix_pose(columns[-count:], layouts, some=some) for count in (16, 12))
    return next((pose for pose in tried if pose), None)


def matrix_pose(columns: Sequence[Column], layouts: Sequence[LogTable], *, some: bool = False) -> Pose | None:
    """Return the pose that 16 or 12 columns hold as a homogeneous transform, by what their numbers are.

    Row by row, or of 16 also column by column: the entries 0, 0, 0, 1 tell which, and R R^T = I that it
    is one at all.

    Args:
        columns: The columns, in their order.
        layouts: The tables.
        some: Whether it is enough that some rows are one: the others are wrong.
    """
    if len(columns) not in (12, 16):
        return None
    return transform_pose(columns, _sampled(columns, layouts)[0], some=some)


def transform_pose(columns: Sequence[Column], values: FloatArray, *, some: bool = False) -> Pose | None:
    """Return the pose that 16 or 12 columns hold, by their values in the file's units, shape (n, columns)."""
    for order, entries in _ORDERS[: 1 if len(columns) == 12 else 2]:
        if _enough(_are_transforms(values, entries), some=some):
            position, turned = entries[:3, 3].tolist(), entries[:3, :3].ravel().tolist()
            rotation = tuple(columns[k] for k in turned)
            return Pose(tuple(columns[k] for k in position), rotation, ("matrix",), f"a transform, {order}")
    return None


def trailing_quaternion(
    columns: Sequence[Column], layouts: Sequence[LogTable], *, some: bool = False
) -> Pose | None:
    """Return the pose in the last seven columns without names, if four of length 1 follow three others."""
    if len(columns) < 7 or not _is_unit(columns[-4:], layouts, some=some):
        return None
    return quaternion_pose(columns)


def quaternion_pose(columns: Sequence[Column]) -> Pose:
    """Return the last seven columns as a position and a quaternion, whose order nothing tells."""
    evidence = "the last four of seven numbers have length 1"
    return Pose(tuple(columns[-7:-4]), tuple(columns[-4:]), ("quat_xyzw", "quat_wxyz"), evidence)


def _is_unit(columns: Sequence[Column], layouts: Sequence[LogTable], *, some: bool) -> bool:
    """Return whether the numbers of three rows or more, or of some, have length 1, as quaternions have."""
    values, _ = _sampled(columns, layouts)
    return (some or len(values) > 2) and _enough(have_length_1(values), some=some)


def turns_as_quaternion(columns: Sequence[Column], layouts: Sequence[LogTable]) -> bool:
    """Return whether four columns have length 1 in every sampled row, and change."""
    values, _ = _sampled(columns, layouts)
    changes = len(values) > 2 and bool((values != values[0]).any())
    return changes and _is_unit(columns, layouts, some=False)


def odd_rows(columns: Sequence[Column], layouts: Sequence[LogTable]) -> list[int]:
    """Return the few sampled rows, from 1, that hold no orientation although most do: they hide it.

    Of 16 or 12 columns it is a transform, of 9 a matrix, of 4 a quaternion that changes in most rows.
    """
    values, rows = _sampled(columns, layouts)
    if len(columns) in (12, 16):
        laws = [_are_transforms(values, entries) for _, entries in _ORDERS[: 1 if len(columns) == 12 else 2]]
    elif len(columns) == 9:
        laws = [_orthogonal(values.reshape(-1, 3, 3))]
    else:
        changes = (np.diff(values, axis=0) != 0).any(axis=1)
        laws = [have_length_1(values)] if 2 * np.count_nonzero(changes) > len(changes) else []
    few = (rows[~holds].tolist() for holds in laws if 0 < np.count_nonzero(~holds) <= FEW * len(rows))
    return next(few, [])


def _sampled(columns: Sequence[Column], layouts: Sequence[LogTable]) -> tuple[FloatArray, IntArray]:
    """Return the sampled rows in which all of these columns have a number, and which these are, from 1."""
    cells = [layouts[c.table].cells(c.index) for c in columns]
    decimals = [layouts[c.table].decimal for c in columns]
    rows = [
        [to_float(cell, decimal) for cell, decimal in zip(row, decimals, strict=True)]
        for row in zip(*cells, strict=False)
    ]
    values = np.array(rows, dtype=np.float64).reshape(-1, len(columns))  # NaN for no number
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    return values[known], known + 1


def _are_transforms(values: FloatArray, entries: IntArray) -> BoolArray:
    """Return which rows are homogeneous transforms with their entries at these places; shape (n,)."""
    holds = _orthogonal(values[:, entries[:3, :3].ravel()].reshape(-1, 3, 3))
    return holds if values.shape[1] == 12 else holds & (values[:, entries[3]] == (0, 0, 0, 1)).all(axis=1)


def have_length_1(values: FloatArray) -> BoolArray:
    """Return which rows are unit vectors; shape (n,)."""
    with np.errstate(over="ignore"):  # of huge values the length is infinite
        return np.asarray(np.abs((values**2).sum(axis=1) - 1.0) < _UNIT_LENGTH)


def _orthogonal(r: FloatArray) -> BoolArray:
    """Return which of these are rotation matrices: R R^T = I and det R = 1; shape (n,)."""
    gram = r @ r.transpose(0, 2, 1)
    near = (np.abs(gram - np.eye(3)) < ORTHOGONAL).all(axis=(1, 2))
    return np.asarray(near & (np.linalg.det(r) > 0))


def _enough(holds: BoolArray, *, some: bool) -> bool:
    """Return whether a law holds in all rows, of which there is one, or in some: the others are wrong."""
    return bool(holds.any()) if some else len(holds) > 0 and bool(holds.all())


def _position(
    numeric: Sequence[Column], file: str | None, *, lone: bool
) -> tuple[tuple[Column, ...], tuple[tuple[Column, ...], ...]]:
    """Return the columns x, y, z, and others that may be; none if there are several and need not be known."""
    numeric = [column for column in numeric if not column.words & vocabulary().outside]
    forces = any(column.key in ("fx", "f_x") for column in numeric)  # tx, ty, tz beside them are torques
    numeric = [c for c in numeric if not (forces and c.key.startswith("t") and len(c.key) <= len("t_x"))]
    return _xyz(drop_unknown(find_families(numeric, vocabulary().tcp_position, 0), lone=lone), file)


def _xyz(
    families: Sequence[Family], file: str | None = None
) -> tuple[tuple[Column, ...], tuple[tuple[Column, ...], ...]]:
    """Return the columns of the only one of the surest families that is x, y, z, and those of the others."""
    every = [family for family in families if _numbers(family) == range(3)]
    families = [family for family in prefer_measured(families) if family in every]
    best = [family for family in families if family.rank == families[0].rank]
    if len(best) > 1 and file is not None:
        groups = "; ".join(listed(family.ordered()) for family in best)
        raise LogError(Finding(f"found several positions: {groups}; allowed: one x, y, z", file=file))
    return (best[0].ordered(), _alternatives(best[0], every)) if len(best) == 1 else ((), ())


def _alternatives(family: Family, every: Sequence[Family]) -> tuple[tuple[Column, ...], ...]:
    """Return the columns of the other families of as many."""
    return tuple(
        other.ordered()
        for other in every
        if other is not family and len(other.columns) == len(family.columns)
    )


def _rotation(
    rest: Sequence[Column],
    layouts: Sequence[LogTable],
    form: RotationForm | None,
    *,
    some: bool,
    lone: bool = False,
) -> tuple[tuple[Column, ...], tuple[RotationForm, ...]]:
    """Return the columns of the only orientation, and the forms that their names allow."""
    for words in vocabulary().tcp_rotations:
        wanted = range(4) if words.forms[0].startswith("quat") else range(3)
        every = [f for f in find_families(rest, words.patterns, 0) if _numbers(f) == wanted]
        families = prefer_measured(drop_unknown(every, lone=lone))
        if len(families) != 1:
            continue
        columns = families[0].ordered()
        told = not _LIKE_JOINT.fullmatch(columns[0].bare) or form in words.forms
        if told or _is_unit(columns, layouts, some=some):
            return columns, words.forms
    matrices = prefer_measured(find_families(rest, vocabulary().tcp_matrix, 0))
    nine = [family for family in matrices if len(family.columns) == 9]
    if len(nine) == 1:
        columns = nine[0].ordered()
        holds = _orthogonal(_sampled(columns, layouts)[0].reshape(-1, 3, 3))
        entries = some and "i" in vocabulary().tcp_matrix[nine[0].rank].groupindex  # r11 is no joint
        if entries or form == "matrix" or _enough(holds, some=some):
            return columns, ("matrix",)
    return (), ()


def _numbers(family: Family) -> range | None:
    """Return range(n) if the n numbers of a family count up from 0, or from 1, without a gap."""
    count = range(len(family.columns))
    lowest = min(family.columns)
    is_numbered = lowest in (0, 1) and sorted(family.columns) == [lowest + k for k in count]
    return count if is_numbered else None
