"""What may be wrong with a log as it was read: signs, exchanged joints, turns, units, or the robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations
from typing import Literal, TypeAlias

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.repolarizer import FULL_TURN
from urmpipe_models.robots.catalogue import load_robot, moving_differently

MOST_SIGNS = 7
"""Of so many joints all patterns of signs are looked at: 127; of more, two at once at most."""

UNITS = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254}
"""Units that a path may have been written in, and how many metres one is."""

EditKind: TypeAlias = Literal[
    "joint_sign", "joints_swapped", "half_turn", "mirrored", "turns", "path_unit", "other_robot"
]


@dataclass(frozen=True)
class Edit:
    """A cause that is there or not: a change of the columns of the joints, of the path, or of the robot.

    Attributes:
        kind: What it is.
        joints: Indices of its joints.
        value: The factor of a path, or how many turns, half or whole.
        first: Row of the log from which on it holds.
        name: What the other robot is called, or which side is in which unit.
        robot: The other robot.
    """

    kind: EditKind
    joints: tuple[int, ...] = ()
    value: float = 1.0
    first: int = 0
    name: str = ""
    robot: Chain | None = field(default=None, compare=False)

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
        (j,), later = self.joints, rows >= self.first
        if self.kind in ("joint_sign", "mirrored"):
            for values in changed:
                values[j] = np.where(later, -values[j], values[j])
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


def unit_edits(*sides: str) -> Iterator[Edits]:
    """Yield the units that positions of a side may be in, where they are read in m."""
    for side in sides:
        for unit, metres in UNITS.items():
            yield (Edit("path_unit", value=metres, name=f"{side} in {unit}"),)


def robot_edits(chain: Chain) -> Iterator[Edits]:
    """Yield the other robots of the catalogue with as many joints."""
    for name in moving_differently():
        other = load_robot(name)
        if name != chain.name and len(other.moving) == len(chain.moving):
            yield (Edit("other_robot", robot=other, name=name),)
