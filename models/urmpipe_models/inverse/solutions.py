"""What inverse kinematics returns: joint values by target and branch, and why a branch has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import BoolArray, FloatArray, TextArray

SingularFamily = Literal[
    "wrist on axis 1",
    "wrist beside axis 1",
    "wrist on axis 2",
    "wrist aligned",
    "arm stretched",
    "arm withdrawn",
    "postures meet",
    "flips meet",
]
"""The families in which an arm loses a freedom; two can meet in one pose.

"wrist beside axis 1": as near to axis 1 as the offset of the shoulder lets it come, where the right and the
left arm meet. "postures meet" and "flips meet": other folds, where two postures of the arm, or both of a
wrist that is not square, are one.
"""

NEAREST_POINT = "nearest point"
"""What a solution is called that comes as near as it can to a target out of reach."""

NO_BRANCH = "found by search"
"""What a solution is called that none of the branches of an arm with a closed form leads to."""


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
            flipped"; of an iterative solver "1", "2", ..., nearest to the start first; of `picked` what it
            was picked for.
        reasons: Why there is none, one line, shape (n, k); empty where there is one.
        singular: The families of singular poses that solutions lie in.
        shortfall: How far the tool stays from a target that it is told to come near to, in [m], shape (n, k);
            0, the default, where the target is met.
        labels: What each solution is called, shape (n, k); by default what its column is, `branches`.
    """

    q: FloatArray
    branches: tuple[str, ...]
    reasons: TextArray
    singular: tuple[Singular, ...] = ()
    shortfall: FloatArray = field(default_factory=lambda: np.zeros(()))
    labels: TextArray = field(default_factory=lambda: np.array("", dtype=np.object_))

    def __post_init__(self) -> None:
        shape = self.q.shape[:2]
        labels = self.labels if self.labels.ndim else np.array(self.branches, dtype=np.object_)
        object.__setattr__(self, "shortfall", np.broadcast_to(self.shortfall, shape))
        object.__setattr__(self, "labels", np.broadcast_to(labels, shape))

    def __len__(self) -> int:
        return len(self.q)

    @property
    def reached(self) -> BoolArray:
        """True where there is a solution, shape (n, k)."""
        return np.asarray(np.isfinite(self.q).all(axis=2))

    def reason(self, target: int) -> str | None:
        """Return why a target has no solution at all, each reason once; None if it has one."""
        if np.isfinite(self.q[target]).all(axis=1).any():  # not `reached`: that looks at every target
            return None
        return "; ".join(dict.fromkeys(text for text in self.reasons[target].tolist() if text))

    def families(self, target: int) -> list[SingularFamily]:
        """Return the families of singular poses that solutions of a target lie in."""
        return list(dict.fromkeys(one.family for one in self.singular if one.where[target].any()))

    def nearest(self, start: FloatArray, period: FloatArray) -> FloatArray:
        """Return of each target the solution nearest to a start, in [rad] or [m], shape (n, joints), or NaN.

        It is returned in the turn nearest to the start; see `nearest_column` for what near means.

        Args:
            start: Joint values in [rad] or [m], shape (joints,) or (n, joints).
            period: 2 pi of a joint that may turn without end, infinity of any other, in [rad], shape
                (joints,).
        """
        column = self.nearest_column(start, period)[:, None, None]
        near = np.take_along_axis(self._away(start, period), column, axis=1)[:, 0] + np.atleast_2d(start)
        near[~self.reached.any(axis=1)] = np.nan
        return near

    def nearest_column(self, start: FloatArray, period: FloatArray) -> NDArray[np.intp]:
        """Return of each target the column of the solution nearest to a start, shape (n,); 0 if it has none.

        The distance is sum((q - start)^2) with each difference of a joint that may turn without end taken
        by the shorter way.

        Args:
            start: Joint values in [rad] or [m], shape (joints,) or (n, joints).
            period: 2 pi of a joint that may turn without end, infinity of any other, in [rad], shape
                (joints,).
        """
        distance = np.square(self._away(start, period)).sum(axis=2)
        return np.asarray(np.argmin(np.where(self.reached, distance, np.inf), axis=1))

    def picked(self, column: NDArray[np.intp], name: str) -> Solutions:
        """Return one solution a target, k = 1: that of a column each.

        Args:
            column: Index of a column for each target, shape (n,).
            name: What the one column is called; its `labels` keep the name of the branch.
        """
        one = column[:, None]

        def pick(values: NDArray[Any]) -> NDArray[Any]:
            """Return the column of each target, shape (n, 1)."""
            return np.take_along_axis(values, one, axis=1)

        return Solutions(
            np.take_along_axis(self.q, one[:, :, None], axis=1),
            (name,),
            pick(self.reasons),
            tuple(replace(family, where=pick(family.where)) for family in self.singular),
            pick(self.shortfall),
            pick(self.labels),
        )

    def _away(self, start: FloatArray, period: FloatArray) -> FloatArray:
        """Return q - start by the shorter way, shape (n, k, joints)."""
        turning = np.isfinite(period)
        away = self.q - np.broadcast_to(np.atleast_2d(start)[:, None, :], self.q.shape)
        away[..., turning] -= period[turning] * np.round(away[..., turning] / period[turning])
        return away


def no_solutions(reasons: Sequence[str], branches: tuple[str, ...], joints: int) -> Solutions:
    """Return solutions of which there are none, each target for its own reason."""
    count = len(reasons)
    texts = np.repeat(np.array(reasons, dtype=np.object_)[:, None], len(branches), axis=1)
    return Solutions(np.full((count, len(branches), joints), np.nan), branches, texts)


def joined(parts: Sequence[Solutions]) -> Solutions:
    """Return solutions of targets one after the other from those of parts of them, one part at least.

    Parts with fewer branches than the widest are filled up with solutions that there are not. A family of
    singular poses is one where its name and its texts are.
    """
    branches = max((part.branches for part in parts), key=len)
    count = len(branches)
    families = dict.fromkeys((one.family, one.free, one.chosen) for part in parts for one in part.singular)
    return Solutions(
        np.concatenate([_filled(part.q, count, np.nan) for part in parts]),
        branches,
        np.concatenate([_filled(part.reasons, count, "") for part in parts]),
        tuple(
            Singular(family, _where(parts, (family, *texts), count), *texts) for family, *texts in families
        ),
        np.concatenate([_filled(part.shortfall, count, 0.0) for part in parts]),
        np.concatenate([_filled(part.labels, count, "") for part in parts]),
    )


def _filled(values: NDArray[Any], count: int, nothing: float | str) -> NDArray[Any]:
    """Return values of shape (n, k, ...) with `count` columns."""
    if values.shape[1] == count:
        return values
    wide = np.full((len(values), count, *values.shape[2:]), nothing, dtype=values.dtype)
    wide[:, : values.shape[1]] = values
    return wide


def _where(parts: Sequence[Solutions], family: tuple[str, ...], count: int) -> BoolArray:
    """Return where the solutions of all parts lie in a family of singular poses, shape (n, count)."""
    where = []
    for part in parts:
        of_part = np.zeros((len(part), count), dtype=bool)
        for one in part.singular:
            if (one.family, one.free, one.chosen) == family:
                of_part[:, : one.where.shape[1]] |= one.where
        where.append(of_part)
    return np.concatenate(where)
