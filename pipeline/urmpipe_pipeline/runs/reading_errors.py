"""What may be wrong with a log as it was read, and is there or not.

Of joints: signs, exchanges, half and whole turns, deg for rad, a joint that counts from another. Of a path:
its unit and the axes of its base. Or the log is of another robot.
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

MOST_SIGNS = 7
"""Of so many joints all patterns of signs are looked at: 127; of more, two at once at most."""

UNITS = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254}
"""Units that a path may have been written in, and how many metres one is."""

EditKind: TypeAlias = Literal[
    "joint_sign", "joints_swapped", "joint_unit", "joint_coupled", "half_turn", "mirrored", "turns",
    "base_rotation", "base_mirrored", "path_unit", "other_robot",
]  # fmt: skip

Row: TypeAlias = tuple[float, float, float]

Matrix: TypeAlias = tuple[Row, Row, Row]
"""The rows of a 3x3 matrix [-]."""

X, Y, Z = IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Edit:
    """A cause that is there or not: a change of the columns of the joints, of the path, or of the robot.

    Attributes:
        kind: What it is.
        joints: Indices of its joints; of a coupling the joint that includes another, then that other.
        value: The factor of a path or of a joint, how many turns, half or whole, or how much of the second
            joint is added to the first.
        first: Row of the log from which on it holds.
        name: What the other robot is called, which side is in which unit, or how the axes x, y and z of a
            mirrored base read in those of the path.
        robot: The other robot.
        matrix: M, how the base is turned or mirrored: x_path = M x_base; None of other causes. A mirrored
            base turns the orientations R to M R M^T, as a left-handed frame describes them.
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
        """Unit vector [-] and angle in [rad], 0 < angle <= pi, of how the base is turned.

        Of half a turn the first coordinate of the vector that is not 0 is above 0.
        """
        m = np.array(self.matrix)
        angle = math.acos((np.trace(m) - 1.0) / 2.0)
        axis = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
        if not axis.any():  # half a turn: m = 2 u u^T - 1
            axis = (m + np.eye(3))[np.argmax(np.diag(m))]
        x, y, z = (float(part) + 0.0 for part in axis / np.linalg.norm(axis))
        return (x, y, z), angle

    def of_joints(self, rows: IntArray, q: FloatArray, *rates: FloatArray) -> list[FloatArray]:
        """Return joints, and their rates if given, with the change; the columns of time are rows.

        Args:
            rows: Rows of the log that they stand in, shape (n,).
            q: Joint values in [rad] or [m], shape (joints, n).
            rates: Their first derivatives, then their second, per [s] and [s^2], each of shape (joints, n).

        Returns:
            As many as given, in [rad] or [m] and these per [s] and [s^2], each of shape (joints, n).
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
    """Yield the patterns of joints that count the other way, of so many at once at most."""
    for count in range(1, 1 + (most if joints <= MOST_SIGNS else min(most, 2))):
        for chosen in combinations(range(joints), count):
            yield tuple(Edit("joint_sign", (j,)) for j in chosen)


def swap_edits(joints: int) -> Iterator[Edits]:
    """Yield the exchanges of two joints."""
    yield from ((Edit("joints_swapped", pair),) for pair in combinations(range(joints), 2))


def joint_unit_edits(turning: Sequence[bool]) -> Iterator[Edits]:
    """Yield that a joint that turns, all but one or all are in deg, read as rad, or in rad, read as deg."""
    joints = np.flatnonzero(turning).tolist()
    others = [tuple(j for j in joints if j != one) for one in joints] if len(joints) > 2 else []
    for some in [*((j,) for j in joints), *others, *([tuple(joints)] if len(joints) > 1 else [])]:
        yield from ((Edit("joint_unit", some, factor),) for factor in (math.pi / 180.0, 180.0 / math.pi))


def coupling_edits(turning: Sequence[bool]) -> Iterator[Edits]:
    """Yield that a joint includes another one, or its negative: q_k - q_j or q_k + q_j is its true value."""
    for pair in permutations(np.flatnonzero(turning).tolist(), 2):
        yield from ((Edit("joint_coupled", pair, sign),) for sign in (-1.0, 1.0))


def axis_edits(*, base_known: bool) -> Iterator[Edits]:
    """Yield the bases whose axes lie along others: 23 that are turned and 24 that are mirrored.

    Of a base at an unknown pose there is one, mirrored: all others are this one, turned.
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
    """Yield the units that positions of a side may be in, where they are read in m."""
    for side in sides:
        for unit, metres in UNITS.items():
            yield (Edit("path_unit", value=metres, name=f"{side} in {unit}"),)


def robot_edits(chain: Chain) -> Iterator[Edits]:
    """Yield the other robots of the catalogue with as many joints."""
    for name in kinematically_distinct_names():
        other = load_robot(name)
        if name != chain.name and len(other.moving) == len(chain.moving):
            yield (Edit("other_robot", robot=other, name=name),)
