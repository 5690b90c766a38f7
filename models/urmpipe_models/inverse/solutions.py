"""What inverse kinematics returns: joint values by target and branch, and why a branch has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
TextArray: TypeAlias = NDArray[np.object_]
"""Texts as Python objects: most are empty, and one object then."""

SingularFamily = Literal[
    "wrist on axis 1",
    "wrist on axis 2",
    "wrist aligned",
    "arm stretched",
    "arm withdrawn",
    "postures meet",
    "flips meet",
]
"""The families in which an arm loses a freedom; two can meet in one pose."""


@dataclass(frozen=True, slots=True, eq=False)
class Singular:
    """A family of singular poses that solutions lie in, and what was chosen there.

    Attributes:
        family: Its name.
        where: True where a solution lies in it, shape (n, k).
        free: What is not determined there, for a person, such as "q4 and q6: only their sum is determined";
            empty where nothing is infinite (a stretched arm).
        chosen: What was taken, such as "q4 = 0, and pi for the flipped wrist"; empty where `free` is.
    """

    family: SingularFamily
    where: BoolArray
    free: str = ""
    chosen: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Solutions:
    """The joint values that bring the tool to n targets, k of them a target at most.

    Attributes:
        q: In [rad] or [m], shape (n, k, joints); a solution that there is not is NaN in every joint.
        branches: What each of the k is called: of a closed form its branch, such as "right, elbow up,
            flipped"; of an iterative solver "1", "2", ..., nearest to the start first.
        reasons: Why there is none, one line, shape (n, k); empty where there is one.
        singular: The families of singular poses that solutions lie in.
    """

    q: FloatArray
    branches: tuple[str, ...]
    reasons: TextArray
    singular: tuple[Singular, ...] = ()

    def __len__(self) -> int:
        return len(self.q)

    @property
    def reached(self) -> BoolArray:
        """True where there is a solution, shape (n, k)."""
        return np.asarray(np.isfinite(self.q).all(axis=2))

    def reason(self, target: int) -> str | None:
        """Return why a target has no solution at all, each reason once; None if it has one."""
        if self.reached[target].any():
            return None
        return "; ".join(dict.fromkeys(text for text in self.reasons[target].tolist() if text))

    def families(self, target: int) -> list[SingularFamily]:
        """Return the families of singular poses that solutions of a target lie in."""
        return list(dict.fromkeys(one.family for one in self.singular if one.where[target].any()))

    def nearest(self, start: FloatArray, period: FloatArray) -> FloatArray:
        """Return of each target the solution nearest to a start, shape (n, joints); NaN where there is none.

        The distance is sum((q - start)^2) with each difference of a joint that may turn without end taken
        by the shorter way, and the solution is returned in the turn nearest to the start.

        Args:
            start: Joint values in [rad] or [m], shape (joints,) or (n, joints).
            period: 2 pi of a joint that may turn without end, infinity of any other, shape (joints,).
        """
        turning = np.isfinite(period)
        away = self.q - np.broadcast_to(np.atleast_2d(start)[:, None, :], self.q.shape)
        away[..., turning] -= period[turning] * np.round(away[..., turning] / period[turning])
        distance = np.where(self.reached, np.square(away).sum(axis=2), np.inf)
        best = np.argmin(distance, axis=1)[:, None, None]
        near = np.take_along_axis(away, best, axis=1)[:, 0] + np.atleast_2d(start)
        near[~self.reached.any(axis=1)] = np.nan
        return near


def no_solutions(reasons: Sequence[str], branches: tuple[str, ...], joints: int) -> Solutions:
    """Return solutions of which there are none, each target for its own reason."""
    count = len(reasons)
    texts = np.repeat(np.array(reasons, dtype=np.object_)[:, None], len(branches), axis=1)
    return Solutions(np.full((count, len(branches), joints), np.nan), branches, texts)
