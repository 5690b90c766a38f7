"""The solutions of samples to choose from on the way along a path, each joint in any of its allowed turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.limits import LIMIT_ROUNDING, TURN, limits_of
from urmpipe_models.inverse.solutions import Solutions


@dataclass(frozen=True, slots=True, eq=False)
class Choices:
    """The solutions of samples, and the whole turns that each joint may be off them.

    Attributes:
        q: In [rad], shape (n, k, joints); 0 where there is none.
        lost: Infinity where there is none, 0 elsewhere [-], shape (n, k).
        least: Whole turns that a joint may turn less [-], shape (n, k, joints).
        most: Whole turns that a joint may turn more [-], shape (n, k, joints).
    """

    q: FloatArray
    lost: FloatArray
    least: FloatArray
    most: FloatArray

    @classmethod
    def of(cls, chain: Chain, found: Solutions) -> Choices:
        """Return the choices that solutions within limits leave."""
        lower, upper = limits_of(chain)
        q = np.where(found.reached[..., None], found.q, 0.0)
        least = np.ceil((lower - LIMIT_ROUNDING - q) / TURN)
        most = np.floor((upper + LIMIT_ROUNDING - q) / TURN)
        return cls(q, np.where(found.reached, 0.0, np.inf), least, most)

    def put(self, rows: slice, other: Choices) -> None:
        """Put in the place of some samples what was found for them anew."""
        for mine, others in (
            (self.q, other.q),
            (self.lost, other.lost),
            (self.least, other.least),
            (self.most, other.most),
        ):
            mine[rows] = others

    def nearest(self, sample: int, last: FloatArray, column: int | None) -> tuple[int, FloatArray]:
        """Return the column and the joint values that are nearest to the last ones.

        Args:
            sample: Its index.
            last: Joint values before in [rad] or [m], shape (joints,).
            column: Taken whatever its distance, if it has a solution; None to take the nearest.

        Returns:
            The column, and joint values in [rad] or [m], shape (joints,).
        """
        turns = np.rint((last - self.q[sample]) / TURN)
        near = self.q[sample] + TURN * np.minimum(np.maximum(turns, self.least[sample]), self.most[sample])
        away = near - last
        if column is None or self.lost[sample, column] > 0.0:
            column = int(np.argmin(np.einsum("kj,kj->k", away, away) + self.lost[sample]))
        return column, near[column]

    def going_on(self, rows: slice, column: int, last: FloatArray) -> FloatArray:
        """Return joint values in [rad] or [m] while a column is the nearest and allowed, shape (m, joints).

        Another solution can only be farther than the shorter way to it, so limits of its turns are not asked.

        Args:
            rows: Samples to look at, one after the other.
            column: Where the sample before them is.
            last: Joint values of that sample in [rad] or [m], shape (joints,).
        """
        own = self.q[rows, column]
        before = np.vstack((last, own[:-1]))
        turns = np.cumsum(np.rint((before - own) / TURN), axis=0)
        away = self.q[rows] - before[:, None]
        away -= TURN * np.rint(away / TURN)
        nearest = np.argmin(np.einsum("nkj,nkj->nk", away, away) + self.lost[rows], axis=1)
        allowed = (self.least[rows, column] <= turns) & (turns <= self.most[rows, column])
        stays = (nearest == column) & (self.lost[rows, column] == 0.0) & allowed.all(axis=1)
        return np.asarray((own + TURN * turns)[: int(np.argmin(np.append(stays, False)))])
