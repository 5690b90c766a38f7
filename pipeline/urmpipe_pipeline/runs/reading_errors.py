"""Errors that the reading of a log can have, each as an edit of the log that undoes it.

- Joints: reversed signs, exchanged joints, half and whole turns, deg for rad, a joint that includes another.
- Paths: the unit, and the axes of the base.
- Another robot.

`Edit.of_joints` applies an edit; the generators yield the candidates of each kind.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations, product
from typing import Literal, TypeAlias

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.robots.catalogue import kinematically_distinct_names, load_robot
from urmpipe_models.wraps import FULL_TURN

MAX_SIGN_JOINTS = (
    7  # joints of which all patterns of signs are tried: 127; of more joints at most two at once
)
UNITS = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254}  # units that a path may have, in metres

EditKind: TypeAlias = Literal[
    "joint_sign", "joints_swapped", "joint_unit", "joint_coupled", "half_turn", "mirrored", "turns",
    "base_rotation", "base_mirrored", "path_unit", "other_robot",
]  # fmt: skip

Row: TypeAlias = tuple[float, float, float]

Matrix: TypeAlias = tuple[Row, Row, Row]  # rows of a 3x3 matrix [-]

X, Y, Z = IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Edit:
    """A change of the columns of the joints, of the path, or of the robot.

    Attributes:
        kind: The kind.
        joints: Indices of its joints; of a coupling the joint that includes another one, then that one.
        value: Factor of a path or a joint, number of half or whole turns, or factor of the second joint
            that is added to the first.
        first: First row of the log to which it applies.
        name: Name of the other robot, side and unit, or the axes x, y and z of a mirrored base in those of
            the path.
        robot: The other robot.
        matrix: M of a rotated or mirrored base: x_path = M x_base; else None. A mirrored base changes the
            orientations R to M R M^T, as a left-handed frame describes them.
    """

    kind: EditKind
    joints: tuple[int, ...] = ()
    value: float = 1.0
    first: int = 0
    name: str = ""
    robot: Chain | None = field(default=None, compare=False)
    matrix: Matrix | None = None

    @property
    def axis_angle(self) -> tuple[Row, float]:
        """Unit vector [-] and angle in [rad], 0 < angle <= pi, of the rotation of the base.

        For half a turn, the first coordinate of the vector that is not 0 is positive.
        """
        m = np.array(self.matrix)
        angle = math.acos((np.trace(m) - 1.0) / 2.0)
        axis = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
        if not axis.any():  # half a turn: m = 2 u u^T - 1
            axis = (m + np.eye(3))[np.argmax(np.diag(m))]
        x, y, z = (float(part) + 0.0 for part in axis / np.linalg.norm(axis))
        return (x, y, z), angle

    def of_joints(self, rows: IntArray, q: FloatArray, *rates: FloatArray) -> list[FloatArray]:
        """Return the joint values, and their derivatives if given, with this change.

        Args:
            rows: Their rows in the log, shape (n,).
            q: Joint values in [rad] or [m], shape (joints, n).
            rates: First and second derivatives, per [s] and [s^2], each of shape (joints, n).

        Returns:
            The same arrays, changed, in [rad] or [m] and these per [s] and [s^2], each of shape (joints, n).
        """
        if not self.joints:
            return [q, *rates]
        changed = [values.copy() for values in (q, *rates)]
        if self.kind == "joints_swapped":
            for values in changed:
                values[list(self.joints)] = values[list(reversed(self.joints))]
            return changed
        (j, *other), later = self.joints, rows >= self.first
        if self.kind in ("joint_sign", "mirrored"):
            for values in changed:
                values[j] = np.where(later, -values[j], values[j])
        elif self.kind == "joint_unit":
            for values in changed:
                values[list(self.joints)] *= self.value
        elif self.kind == "joint_coupled":
            for values in changed:
                values[j] += self.value * values[other[0]]
        else:
            turn = FULL_TURN / 2.0 if self.kind == "half_turn" else FULL_TURN
            changed[0][j] += np.where(later, turn * self.value, 0.0)
        return changed


Edits: TypeAlias = tuple[Edit, ...]


def sign_edits(joints: int, *, most: int) -> Iterator[Edits]:
    """Yield the patterns of reversed joints, at most `most` at once."""
    for count in range(1, 1 + (most if joints <= MAX_SIGN_JOINTS else min(most, 2))):
        for chosen in combinations(range(joints), count):
            yield tuple(Edit("joint_sign", (j,)) for j in chosen)


def swap_edits(joints: int) -> Iterator[Edits]:
    """Yield the exchanges of two joints."""
    yield from ((Edit("joints_swapped", pair),) for pair in combinations(range(joints), 2))


def joint_unit_edits(revolute: Sequence[bool]) -> Iterator[Edits]:
    """Yield revolute joints, one, all except one, or all, in deg that are read as rad, or the reverse."""
    joints = np.flatnonzero(revolute).tolist()
    groups: list[tuple[int, ...]] = [(j,) for j in joints]
    if len(joints) > 2:
        groups += [tuple(j for j in joints if j != excluded) for excluded in joints]
    if len(joints) > 1:
        groups.append(tuple(joints))
    for group in groups:
        yield from ((Edit("joint_unit", group, factor),) for factor in (math.pi / 180.0, 180.0 / math.pi))


def coupling_edits(revolute: Sequence[bool]) -> Iterator[Edits]:
    """Yield joints that include another one, or its negative: their true value is q_k - q_j or q_k + q_j."""
    for pair in permutations(np.flatnonzero(revolute).tolist(), 2):
        yield from ((Edit("joint_coupled", pair, sign),) for sign in (-1.0, 1.0))


def axis_edits(*, base_known: bool) -> Iterator[Edits]:
    """Yield the bases whose axes are parallel to those of the path: 23 rotated and 24 mirrored ones.

    For a base at an unknown pose there is one, mirrored: all others are rotations of it.
    """
    if not base_known:
        yield (_of_axes((X, Y, (0.0, 0.0, -1.0))),)
        return
    for first, second, third in permutations(IDENTITY):
        for a, b, c in product((1.0, -1.0), repeat=3):
            matrix = _scaled(a, first), _scaled(b, second), _scaled(c, third)
            if matrix != IDENTITY:
                yield (_of_axes(matrix),)


def _scaled(sign: float, row: Row) -> Row:
    x, y, z = (sign * part + 0.0 for part in row)  # no zero below 0
    return x, y, z


def _of_axes(matrix: Matrix) -> Edit:
    if np.linalg.det(matrix) > 0.0:
        return Edit("base_rotation", name="base", matrix=matrix)
    columns = zip(*matrix, strict=True)
    letters = (
        next(f"{'-' * (part < 0.0)}{letter}" for part, letter in zip(column, "xyz", strict=True) if part)
        for column in columns
    )
    return Edit("base_mirrored", name=f"({', '.join(letters)})", matrix=matrix)


def unit_edits(*sides: str) -> Iterator[Edits]:
    """Yield the units that the positions of a side may have, where they are read in m."""
    for side in sides:
        for unit, metres in UNITS.items():
            yield (Edit("path_unit", value=metres, name=f"{side} in {unit}"),)


def robot_edits(chain: Chain) -> Iterator[Edits]:
    """Yield the other robots of the catalogue with as many joints."""
    for name in kinematically_distinct_names():
        other = load_robot(name)
        if name != chain.name and len(other.moving) == len(chain.moving):
            yield (Edit("other_robot", robot=other, name=name),)
