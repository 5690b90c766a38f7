"""Targets, search options and solutions of inverse kinematics: what all solvers take and return.

`Targets` are poses of the tool centre point, or positions with any orientation; `validate_targets` replaces
rotations that files rounded by the nearest ones and gives the reason why a target is invalid. `SearchOptions`
limit the search for what does not follow from the start. `Solutions` hold joint values by target and branch,
the reason where there is no solution, and the families of singular poses (`SingularPoses`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, TextArray
from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import to_quaternions, to_rotation_vectors

DIGITS = 4  # significant digits of a value in a reason; more only where value and limit would look equal
ROTATION_TOLERANCE = 1e-6  # [-], per entry of R^T R - 1: 7 digits of a file; the nearest rotation is taken
MAX_COORDINATE = 1e9  # [m]; the square of more leaves no digit of an arm's length
MAX_RESTARTS = 10_000  # these take minutes for a single target
NEAREST_POINT = "nearest point"  # label of a solution that comes as near as it can to a target out of reach
NO_BRANCH = "found by search"  # label of a solution that no branch of a closed form leads to


def format_with_limits(value: float, *limits: float) -> tuple[str, ...]:
    """Return a value and the limits that it violates as texts.

    All have four significant digits, or as many more as make the value differ from every limit: "at
    2.7000001 rad, allowed: up to 2.7000000" would else read as within it.
    """
    for digits in range(DIGITS, 18):
        text, *limit_texts = (f"{number:.{digits}g}" for number in (value, *limits))
        if text not in limit_texts:
            break
    return text, *limit_texts


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Poses that the tool centre point shall take, in the world.

    Attributes:
        position: In [m], shape (n, 3).
        rotation: Rotation matrices [-], shape (n, 3, 3); None allows any orientation.
    """

    position: FloatArray
    rotation: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.position)

    def rows(self, selected: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Targets:
        """Return the selected targets: a slice, a mask of shape (n,), or indices of shape (m,)."""
        return Targets(self.position[selected], None if self.rotation is None else self.rotation[selected])


def forward_targets(chain: Chain, q: FloatArray) -> Targets:
    """Return the poses of the tool centre point at joint values q in [rad] or [m], shape (n, joints)."""
    return Targets(*poses_over_log(chain, q))


def pose_errors(chain: Chain, q: FloatArray, targets: Targets) -> tuple[FloatArray, FloatArray]:
    """Return the differences between targets and the tool at joint values q, by forward kinematics.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints); a row of NaN has errors of NaN.
        targets: One per row of q.

    Returns:
        Target minus tool, along x, y, z in [m], shape (n, 3), and the rotation vector in [rad], shape
        (n, 3), in the world, that turns the tool into its target; zeros where any orientation is allowed.
    """
    position, rotation = poses_over_log(chain, q)
    if targets.rotation is None:
        return targets.position - position, np.zeros_like(position)
    between = targets.rotation @ rotation.transpose(0, 2, 1)
    return targets.position - position, to_rotation_vectors(to_quaternions(between.reshape(-1, 9), "matrix"))


def validate_targets(targets: Targets) -> tuple[Targets, list[str]]:
    """Return targets with the nearest rotations, and why each of them is no target; empty for a valid one.

    Of R with |R^T R - 1| <= 1e-6 in every entry the nearest rotation is taken: two steps of
    R <- R (3 - R^T R) / 2, whose error falls as its square.

    Raises:
        OptionError: If positions and rotations are not arrays of shape (n, 3) and (n, 3, 3).
    """
    position, rotation = np.asarray(targets.position, dtype=float), targets.rotation
    count = len(position)
    if position.shape != (count, 3):
        raise OptionError(f"targets: found positions of shape {position.shape}, allowed: (n, 3)")
    reasons = _position_reasons(position)
    if rotation is None:
        return Targets(position), reasons
    rotation = np.asarray(rotation, dtype=float)
    if rotation.shape != (count, 3, 3):
        raise OptionError(
            f"targets: found rotations of shape {rotation.shape} for {count} positions,"
            f" allowed: ({count}, 3, 3)"
        )
    reasons = [first or second for first, second in zip(reasons, _rotation_reasons(rotation), strict=True)]
    with np.errstate(all="ignore"):
        for _ in range(2):
            rotation = rotation @ (1.5 * np.eye(3) - 0.5 * rotation.transpose(0, 2, 1) @ rotation)
    return Targets(position, rotation), reasons


def _position_reasons(position: FloatArray) -> list[str]:
    reasons = [""] * len(position)
    for row in np.flatnonzero(~(np.abs(position) <= MAX_COORDINATE).all(axis=1)):
        values = ", ".join(f"{value:g}" for value in position[row])
        finite = np.isfinite(position[row]).all()
        allowed = f"up to {MAX_COORDINATE:g} m along each axis" if finite else "finite numbers"
        reasons[row] = f"the position is {values} m, allowed: {allowed}"
    return reasons


def _rotation_reasons(rotation: FloatArray) -> list[str]:
    with np.errstate(all="ignore"):
        error = np.abs(rotation.transpose(0, 2, 1) @ rotation - np.eye(3)).max(axis=(1, 2))
        mirrored = np.linalg.det(rotation) < 0.0
    reasons = [""] * len(rotation)
    for row in np.flatnonzero(~(error <= ROTATION_TOLERANCE) | mirrored):
        if not np.isfinite(rotation[row]).all():
            reasons[row] = "the orientation is not finite, allowed: finite numbers"
        elif not error[row] <= ROTATION_TOLERANCE:
            reasons[row] = (
                f"the orientation is not a rotation: R^T R differs from 1 by {error[row]:.3g},"
                f" allowed: {ROTATION_TOLERANCE:g}"
            )
        else:
            reasons[row] = "the orientation is not a rotation: its determinant is -1, a mirror, allowed: 1"
    return reasons


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """Limits of the search for what does not follow from the start.

    Attributes:
        tolerance: In [m] along each axis: a target out of reach takes the nearest point that the tool can
            get to if it is no farther away than this, and turned by no more than tolerance / l with l of
            `orientation_length`; `Solutions.position_residual` is the distance. None: it has no solution.
        restarts: Random starts of the iterative solver for what it does not reach from the start.
        seed: Of the random starts: the same seed, the same solutions.
    """

    tolerance: float | None = None
    restarts: int = 20
    seed: int = 0

    def faults(self) -> Iterator[Finding]:
        """Yield which of the values are not allowed."""
        if self.tolerance is not None and not isinstance(self.tolerance, Real):
            allowed = "a number of m, more than 0"
            yield Finding(parameter="tolerance", found=format_value(self.tolerance), allowed=allowed)
        elif self.tolerance is not None and not 0.0 < self.tolerance < math.inf:
            yield Finding(parameter="tolerance", found=f"{self.tolerance:g} m", allowed="more than 0, finite")
        for name, value in (("restarts", self.restarts), ("seed", self.seed)):
            if not isinstance(value, Integral) or value < 0:
                yield Finding(parameter=name, found=format_value(value), allowed="a whole number, 0 or more")
            elif name == "restarts" and value > MAX_RESTARTS:
                yield Finding(parameter=name, found=format_value(value), allowed=f"{MAX_RESTARTS} at most")


DEFAULT_SEARCH = SearchOptions()

# "wrist beside axis 1": as near to axis 1 as the offset of the shoulder allows, where the  # plain: ok
# right and the left arm meet. "postures meet" and "flips meet": other folds, where two postures of the arm,
# or both of a wrist whose axes are not perpendicular, are one. Two families can meet in one pose.
SingularFamily = Literal[
    "wrist on axis 1",
    "wrist beside axis 1",  # plain: ok
    "wrist on axis 2",
    "wrist aligned",
    "arm stretched",
    "arm withdrawn",
    "postures meet",
    "flips meet",
]


@dataclass(frozen=True, slots=True, eq=False)
class SingularPoses:
    """Solutions in a family of singular poses, and what was chosen there.

    Attributes:
        family: Its name.
        where: True where a solution lies in it, shape (n, k).
        free: What is not determined there, as text, such as "q4 and q6: only their sum is determined";
            empty where nothing is infinite (a stretched arm).
        chosen: What was taken, such as "q4 = 0, and pi for the flipped wrist"; empty where `free` is.
    """

    family: SingularFamily
    where: BoolArray
    free: str = ""
    chosen: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Solutions:
    """Joint values that bring the tool to n targets, up to k of them per target.

    Attributes:
        q: In [rad] or [m], shape (n, k, joints); NaN in every joint of a missing solution.
        branches: Names of the k columns: of a closed form its branches, such as "right, elbow up,
            flipped"; of an iterative solver "1", "2", ..., nearest to the start first; after `select` the
            reason of the selection.
        reasons: Why there is no solution, one line, shape (n, k); empty where there is one.
        singular: The families of singular poses that solutions lie in.
        position_residual: Distance of the tool from a target that it need only come near to, in [m],
            shape (n, k); 0, the default, where the target is met.
        labels: Name of each solution, shape (n, k); by default that of its column, `branches`.
    """

    q: FloatArray
    branches: tuple[str, ...]
    reasons: TextArray
    singular: tuple[SingularPoses, ...] = ()
    position_residual: FloatArray = field(default_factory=lambda: np.zeros(()))
    labels: TextArray = field(default_factory=lambda: np.array("", dtype=np.object_))

    def __post_init__(self) -> None:
        shape = self.q.shape[:2]
        labels = self.labels if self.labels.ndim else np.array(self.branches, dtype=np.object_)
        object.__setattr__(self, "position_residual", np.broadcast_to(self.position_residual, shape))
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
        return list(dict.fromkeys(poses.family for poses in self.singular if poses.where[target].any()))

    def nearest(self, start: FloatArray, period: FloatArray) -> FloatArray:
        """Return the solution of each target nearest to a start, in [rad] or [m], shape (n, joints), or NaN.

        It is returned in the turn nearest to the start; `nearest_column` defines the distance.

        Args:
            start: Joint values in [rad] or [m], shape (joints,) or (n, joints).
            period: Of each joint in [rad], shape (joints,): see `joint_periods`.
        """
        column = self.nearest_column(start, period)[:, None, None]
        near = np.take_along_axis(self._differences(start, period), column, axis=1)[:, 0]
        near = near + np.atleast_2d(start)
        near[~self.reached.any(axis=1)] = np.nan
        return near

    def nearest_column(self, start: FloatArray, period: FloatArray) -> NDArray[np.intp]:
        """Return the column of the solution nearest to a start, shape (n,); 0 for a target without any.

        The distance is sum((q - start)^2) with each difference of a continuous joint by the shorter way.

        Args:
            start: Joint values in [rad] or [m], shape (joints,) or (n, joints).
            period: Of each joint in [rad], shape (joints,): see `joint_periods`.
        """
        distance = np.square(self._differences(start, period)).sum(axis=2)
        return np.asarray(np.argmin(np.where(self.reached, distance, np.inf), axis=1))

    def select(self, column: NDArray[np.intp], name: str) -> Solutions:
        """Return one solution per target, k = 1, from one column each.

        Args:
            column: Index of a column for each target, shape (n,).
            name: Of the only column of the result; its `labels` keep the name of the branch.
        """
        index = column[:, None]

        def pick(values: NDArray[Any]) -> NDArray[Any]:
            return np.take_along_axis(values, index, axis=1)

        return Solutions(
            np.take_along_axis(self.q, index[:, :, None], axis=1),
            (name,),
            pick(self.reasons),
            tuple(replace(poses, where=pick(poses.where)) for poses in self.singular),
            pick(self.position_residual),
            pick(self.labels),
        )

    def _differences(self, start: FloatArray, period: FloatArray) -> FloatArray:
        """Return q - start by the shorter way, shape (n, k, joints)."""
        periodic = np.isfinite(period)
        away = self.q - np.broadcast_to(np.atleast_2d(start)[:, None, :], self.q.shape)
        away[..., periodic] -= period[periodic] * np.round(away[..., periodic] / period[periodic])
        return away


def empty_solutions(reasons: Sequence[str], branches: tuple[str, ...], joints: int) -> Solutions:
    """Return missing solutions of all targets, each with its own reason."""
    count = len(reasons)
    texts = np.repeat(np.array(reasons, dtype=np.object_)[:, None], len(branches), axis=1)
    return Solutions(np.full((count, len(branches), joints), np.nan), branches, texts)


def concatenate_solutions(parts: Sequence[Solutions]) -> Solutions:
    """Return the solutions of one or more parts of the targets, one after the other.

    Parts with fewer branches than the widest are padded with missing solutions. Families of singular poses
    are joined if their names and texts are equal.
    """
    branches = max((part.branches for part in parts), key=len)
    count = len(branches)
    families = dict.fromkeys(
        (poses.family, poses.free, poses.chosen) for part in parts for poses in part.singular
    )

    def joined(arrays: Sequence[NDArray[Any]], missing: float | str) -> NDArray[Any]:
        return np.concatenate([_padded(values, count, missing) for values in arrays])

    def singular_poses(family: SingularFamily, free: str, chosen: str) -> SingularPoses:
        where = []
        for part in parts:
            part_where = np.zeros((len(part), count), dtype=bool)
            for poses in part.singular:
                if (poses.family, poses.free, poses.chosen) == (family, free, chosen):
                    part_where[:, : poses.where.shape[1]] |= poses.where
            where.append(part_where)
        return SingularPoses(family, np.concatenate(where), free, chosen)

    return Solutions(
        joined([part.q for part in parts], np.nan),
        branches,
        joined([part.reasons for part in parts], ""),
        tuple(singular_poses(*family) for family in families),
        joined([part.position_residual for part in parts], 0.0),
        joined([part.labels for part in parts], ""),
    )


def _padded(values: NDArray[Any], count: int, missing: float | str) -> NDArray[Any]:
    """Return values of shape (n, k, ...) with `count` columns."""
    if values.shape[1] == count:
        return values
    wide = np.full((len(values), count, *values.shape[2:]), missing, dtype=values.dtype)
    wide[:, : values.shape[1]] = values
    return wide
