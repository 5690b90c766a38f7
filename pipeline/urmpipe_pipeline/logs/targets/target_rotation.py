"""The orientation of targets: its form and unit, its matrices, and the rows in which it is none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.math3d import RotationForm, is_angular, to_matrices, to_quaternions
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.columns.columns import Column, listed
from urmpipe_pipeline.logs.columns.pose import ORTHOGONAL
from urmpipe_pipeline.logs.columns.questions import unit_hints
from urmpipe_pipeline.logs.columns.roles import Roles
from urmpipe_pipeline.logs.tables.numbers import RowFault
from urmpipe_pipeline.logs.units.rotation import PURE
from urmpipe_pipeline.logs.vocabulary import Unit, vocabulary

UNIT_NORM = 1e-3
"""The norm of a quaternion may differ from 1 by this, as printed digits do; then it is divided by it."""

MOST_RAD = 2 * np.pi * 1.01
"""Angles without a given unit, most of them beyond a turn in [rad], are hardly in rad."""

NAMED = Hint("orientation", None, "with --position and --rotation names them")
"""The remedy where the names of columns show no orientation."""

_OURS = frozenset(("rx", "ry", "rz"))
_KUKA = frozenset("abc")


def target_form(
    roles: Roles, unused: Sequence[Column], file: str, given: RotationForm | None, *, named: bool
) -> tuple[RotationForm | None, list[LogWarning]]:
    """Return the form of an orientation, None if the rows are positions, and what was assumed.

    rz, ry, rx are angles about the moving axes Z, Y, X; a header in the order rx, ry, rz may also mean a
    rotation vector, as UR writes: it is taken as the angles, with a warning.

    Args:
        roles: What the columns are.
        unused: The columns that are nothing.
        file: The file, for errors.
        given: The form that the user gives.
        named: Whether the user names the columns of the pose.

    Raises:
        LogError: If only a part of an orientation is there, its form is not known, or a form is given for
            positions.
    """
    found = roles.rotation
    if not found:
        _refuse_half(roles, unused, file, given, named=named)
        return None, []
    if len(roles.forms) == 1:
        return roles.forms[0], []
    if not all(column.words & _OURS for column in found):
        hints = tuple(Hint("rotation", form, "specifies it") for form in roles.forms)
        said = f"found {listed(found)}, which may be {' or '.join(roles.forms)}, allowed: one form"
        raise LogError(Finding(said, file, hints=hints))
    if found[0].index > found[1].index > found[2].index:
        return "rpy", []
    said = f"{listed(found)} are taken as angles about the moving axes Z, Y, X (rz, ry, rx)"
    hints = (Hint("rotation", "vector", "if they are a rotation vector, as UR writes"),)
    return "rpy", [LogWarning("assumed-rotation", said, hints=hints)]


def rotation_units(
    columns: Sequence[Column], form: RotationForm, values: FloatArray, told: Sequence[Unit | None]
) -> tuple[list[Unit], list[LogWarning]]:
    """Return the unit of each column of an orientation, rad where none is given, and what was assumed.

    That angles are in rad is the form of targets, and no assumption, unless most of them are beyond a turn or
    they are called A, B, C as KUKA's, which are in degrees. Values are those of finite rows in the file's own
    units, shape (n, columns).
    """
    if not is_angular(form):
        return [PURE] * len(columns), []
    known = [unit for unit in told if unit is not None]
    if known:
        return [unit or known[0] for unit in told], []
    units = [vocabulary().units["rad"]] * len(columns)
    beyond = len(values) > 0 and bool(np.median(np.abs(values).max(axis=1)) > MOST_RAD)
    if not beyond and not any(column.key in _KUKA for column in columns):
        return units, []
    why = ", though most are beyond a turn" if beyond else ""
    said = f"no unit is given for {listed(columns)}: they are taken as rad{why}"
    return units, [LogWarning("assumed-unit", said, hints=unit_hints(columns[:1], "deg"))]


def target_rotations(
    columns: Sequence[Column], form: RotationForm, values: FloatArray
) -> tuple[FloatArray, dict[int, RowFault]]:
    """Return the rotation matrices [-], shape (n, 3, 3), and by index what is wrong with rows that hold none.

    Values are in [rad] or [-], shape (n, columns); a row with NaN stays NaN and has no fault.
    """
    names = tuple(column.header for column in columns)
    faults = {row: RowFault(said, names) for row, said in _no_rotations(values, form)}
    sound = values.copy()
    sound[list(faults)] = np.nan
    return to_matrices(to_quaternions(sound, form)), faults


def _no_rotations(values: FloatArray, form: RotationForm) -> Iterator[tuple[int, str]]:
    """Yield index and reason of rows that hold no rotation: by a quaternion's norm, a matrix's R R^T."""
    if form.startswith("quat"):
        norm = np.linalg.norm(values, axis=1)
        for row in np.flatnonzero(np.abs(norm - 1.0) > UNIT_NORM).tolist():
            yield row, f"found a quaternion of norm {norm[row]:.6g}, allowed: 1 within {UNIT_NORM:g}"
    elif form == "matrix":
        r = values.reshape(-1, 3, 3)
        off = np.abs(r @ r.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0)
        with np.errstate(invalid="ignore"):  # rows with NaN, which have faults already
            det = np.linalg.det(r)
        for row in np.flatnonzero((off > ORTHOGONAL) | (det < 0)).tolist():
            found = f"R R^T off I by {off[row]:.3g} and det R = {det[row]:.3g}"
            yield row, f"found {found}, allowed: a rotation, {ORTHOGONAL:g} off at most, det R = 1"


def _refuse_half(
    roles: Roles, unused: Sequence[Column], file: str, given: RotationForm | None, *, named: bool
) -> None:
    """Raise a `LogError` if a form is given for positions, or half an orientation stands beside them."""
    if given:
        said, allowed = (
            f"{given} given for {listed(roles.position)} and no orientation",
            "its columns beside them",
        )
        raise LogError(Finding(file=file, parameter="rotation", found=said, allowed=allowed, hints=(NAMED,)))
    half = [] if named else [column for column in unused if _is_part(column)]
    if half:
        said = f"found {listed(half)} as a part of an orientation"
        allowed = "all of rz, ry, rx or of qx, qy, qz, qw, or none"
        raise LogError(Finding(f"{said}, allowed: {allowed}", file, hints=(NAMED,)))


def _is_part(column: Column) -> bool:
    """Return whether a column is called as one of an orientation; KUKA's A, B, C may be anything."""
    patterns = (
        one for words in vocabulary().tcp_rotations if words.forms != ("zyx",) for one in words.patterns
    )
    return any("axis" in one.groupindex and one.search(column.key) for one in patterns)
