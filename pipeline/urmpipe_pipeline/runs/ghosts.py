"""What stands beside the motion that inverse kinematics made: its targets, and its other solutions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IntArray
from urmpipe_models.inverse.solutions import Solutions
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.orientation import quaternions


@dataclass(frozen=True, slots=True, eq=False)
class Ghost:
    """A branch of the solutions: joint values that bring the tool to the targets as well.

    Attributes:
        name: The branch, such as "right, elbow up, flipped".
        t_ns: Times of the rows of the run at which there is this solution, in integer [ns], shape (m,),
            strictly increasing.
        q: Joint values in [rad] or [m], shape (m, joints), none missing.
    """

    name: str
    t_ns: IntArray
    q: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Goals:
    """The targets of a run that inverse kinematics made, one a row.

    Attributes:
        t_ns: Times of the rows in integer [ns], shape (n,).
        position: Where the tool centre point shall be, in [m], shape (n, 3); NaN where a target is none.
        quat_xyzw: Its orientation as unit quaternions [-], shape (n, 4); None if any will do.
        reasons: Why the arm has no pose there, one line a target; empty where it has one. ("",) * n
            where it has one everywhere.
        branches: What the solution chosen is called, one a target; empty where there is none, and () where
            none has a name.
    """

    t_ns: IntArray
    position: FloatArray
    quat_xyzw: FloatArray | None
    reasons: tuple[str, ...]
    branches: tuple[str, ...] = ()

    @property
    def missed(self) -> BoolArray:
        """True where the arm has no pose, shape (n,)."""
        return np.array([bool(reason) for reason in self.reasons], dtype=np.bool_)

    def why(self, index: int) -> str:
        """Return why the arm has no pose for a target: of several reasons, which "; " joins, the first."""
        return self.reasons[index].split("; ")[0]


def ghosts_of(solutions: Solutions, t_ns: IntArray) -> tuple[Ghost, ...]:
    """Return a ghost a branch that has a solution anywhere.

    Args:
        solutions: Every solution of n targets.
        t_ns: Times of the targets in integer [ns], shape (n,).
    """
    return tuple(
        Ghost(branch, t_ns[there], solutions.q[there, k])
        for k, branch in enumerate(solutions.branches)
        if (there := solutions.reached[:, k]).any()
    )


def goals_of(
    targets: Targets,
    t_ns: IntArray,
    reasons: Sequence[str | None] | None = None,
    branches: Iterable[str] = (),
) -> Goals:
    """Return targets as the goals of a run.

    Args:
        targets: The targets.
        t_ns: Their times in integer [ns], shape (n,).
        reasons: Why the arm has no pose there, one a target; None or empty where it has one.
        branches: What the solution chosen is called, one a target; empty where there is none.
    """
    texts = tuple(reason or "" for reason in reasons or [None] * len(targets))
    rotation = None if targets.rotation is None else targets.rotation.reshape(-1, 9)
    quat = None if rotation is None else quaternions(rotation, "matrix")
    named = tuple(map(str, branches))
    return Goals(t_ns, targets.position, quat, texts, named if any(named) else ())
