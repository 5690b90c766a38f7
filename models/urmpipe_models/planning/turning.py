"""How the tool is turned along a path: held, or turned at an even rate from row to row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_models.continuity import continuous_quaternions
from urmpipe_models.orientation import conjugate, matrices, product, quaternions, rotation_vectors

UNEVEN = 2e-5
"""Turns from row to row that differ by less, in [rad], may be one even turn whose angles have six digits:
each is then off by up to 5e-6, and a difference of turns has three of them, that of the middle row twice."""


@dataclass(frozen=True, slots=True, eq=False)
class Turning:
    """Orientations at places of a path, and how fast the tool turns from each to the next.

    Attributes:
        at: Where the rows are along the path in [m], rising, shape (n,).
        quat_xyzw: The orientation there [-], shape (n, 4), of the sign that is nearest to the one before.
        rate: From each to the next about a fixed axis, d theta / ds in [rad/m], in the world, shape
            (n - 1, 3).
    """

    at: FloatArray
    quat_xyzw: FloatArray
    rate: FloatArray

    def rates(self, s: FloatArray, *, before: bool = False) -> FloatArray:
        """Return the rate in [rad/m], shape (n, 3), at arc lengths in [m], shape (n,); at a row after it."""
        return np.asarray(self.rate[part_at(self.at, s, before=before)])

    def quaternions(self, s: FloatArray) -> FloatArray:
        """Return the orientation at arc lengths in [m], shape (n,), as x, y, z, w [-], shape (n, 4)."""
        k = part_at(self.at, s)
        turned = self.rate[k] * (s - self.at[k])[:, None]
        return product(quaternions(turned, "vector"), self.quat_xyzw[k])

    def matrices(self, s: FloatArray) -> FloatArray:
        """Return the orientation at arc lengths in [m], shape (n,), as matrices [-], shape (n, 3, 3)."""
        return matrices(self.quaternions(s))

    @property
    def uneven(self) -> IndexArray:
        """Rows, from 0, that the tool passes while the rate of its turn changes [-], shape (k,).

        By an angle that is more than rounding of the rows: over the shorter way to a row beside it.
        """
        way = np.diff(self.at)
        change = np.linalg.norm(np.diff(self.rate, axis=0), axis=1) * np.minimum(way[:-1], way[1:])
        return np.flatnonzero(change > UNEVEN) + 1


def part_at(bounds: FloatArray, s: FloatArray, *, before: bool = False) -> IndexArray:
    """Return the part between bounds in which each arc length is, shape (n,).

    Args:
        bounds: Where parts begin, and the last one ends, in [m], rising, shape (m + 1,).
        s: In [m], shape (n,).
        before: Whether a bound is the end of the part before it; else the next one begins.
    """
    found = np.searchsorted(bounds, s, side="left" if before else "right") - 1
    return np.asarray(np.clip(found, 0, len(bounds) - 2))


def turning_of(rotation: FloatArray, at: FloatArray) -> Turning:
    """Return how the tool turns by the shorter way from row to row, evenly along the path.

    Args:
        rotation: Matrices at the rows [-], shape (n, 3, 3).
        at: Where the rows are along the path in [m], rising, shape (n,).
    """
    quats = continuous_quaternions(quaternions(rotation.reshape(-1, 9), "matrix"))
    turn = rotation_vectors(product(quats[1:], conjugate(quats[:-1])))
    return Turning(at, quats, turn / np.diff(at)[:, None])
