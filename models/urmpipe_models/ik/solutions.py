"""Figures of reasons, with as many digits as tell what was found from what is allowed.

Where the tool shall be: poses, or positions with any orientation.

What inverse kinematics returns: joint values by target and branch, and why a branch has none.

What a search for solutions is asked, whoever searches.

Targets that are none: not finite, farther than any tool gets, no rotation.

The limits of joints: which turn of a solution is allowed, and which solution is not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import BoolArray, FloatArray, TextArray
from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import to_quaternions, to_rotation_vectors

DIGITS = 4
"""Significant digits, where they are enough."""


def format_with_limits(found: float, *allowed: float) -> tuple[str, ...]:
    """Return what was found and the limits that are allowed as texts.

    All have four significant digits, or as many more as let the found one differ from every limit: "at
    2.7000001 rad, allowed: up to 2.7000000" would else read as within it.
    """
    for digits in range(DIGITS, 18):
        text, *limits = (f"{value:.{digits}g}" for value in (found, *allowed))
        if text not in limits:
            break
    return text, *limits


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Poses that the tool centre point shall take, in the world.

    Attributes:
        position: In [m], shape (n, 3).
        rotation: Rotation matrices [-], shape (n, 3, 3); None if any orientation will do.
    """

    position: FloatArray
    rotation: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.position)

    def rows(self, chosen: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Targets:
        """Return the chosen targets: a slice, a mask of shape (n,), or indices of shape (m,), as `chosen`."""
        return Targets(self.position[chosen], None if self.rotation is None else self.rotation[chosen])


def forward_targets(chain: Chain, q: FloatArray) -> Targets:
    """Return the poses of the tool centre point at joint values q in [rad] or [m], shape (n, joints)."""
    return Targets(*poses_over_log(chain, q))


def pose_errors(chain: Chain, q: FloatArray, targets: Targets) -> tuple[FloatArray, FloatArray]:
    """Return how far the tool at q is from its targets, by forward kinematics.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints); a row of NaN misses by NaN.
        targets: One a row of q.

    Returns:
        Target minus tool, along x, y, z in [m], shape (n, 3), and the rotation vector in [rad], shape
        (n, 3), in the world, that turns the tool into its target; zeros where any orientation will do.
    """
    position, rotation = poses_over_log(chain, q)
    if targets.rotation is None:
        return targets.position - position, np.zeros_like(position)
    between = targets.rotation @ rotation.transpose(0, 2, 1)
    return targets.position - position, to_rotation_vectors(to_quaternions(between.reshape(-1, 9), "matrix"))


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
class SingularPoses:
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
    singular: tuple[SingularPoses, ...] = ()
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


def empty_solutions(reasons: Sequence[str], branches: tuple[str, ...], joints: int) -> Solutions:
    """Return solutions of which there are none, each target for its own reason."""
    count = len(reasons)
    texts = np.repeat(np.array(reasons, dtype=np.object_)[:, None], len(branches), axis=1)
    return Solutions(np.full((count, len(branches), joints), np.nan), branches, texts)


def concatenate_solutions(parts: Sequence[Solutions]) -> Solutions:
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
            SingularPoses(family, _where(parts, (family, *texts), count), *texts)
            for family, *texts in families
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


MAX_RESTARTS = 10_000
"""Most random starts: so many take minutes for one target already."""


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """How far a search goes for what does not follow from the start.

    Attributes:
        tolerance: In [m] along each axis: a target out of reach takes the nearest point that the tool can
            get to if it is no farther away than this, and turned by no more than tolerance / l with l of
            `turn_length`; `shortfall` says how far it is. None: it has no solution.
        restarts: Random starts of the iterative solver for what it does not reach from the start.
        seed: Of the random starts: the same seed, the same solutions.
    """

    tolerance: float | None = None
    restarts: int = 20
    seed: int = 0

    def faults(self) -> Iterator[Finding]:
        """Yield which of the values make no sense."""
        if self.tolerance is not None and not isinstance(self.tolerance, Real):
            allowed = "a number of m, more than 0"
            yield Finding(parameter="tolerance", found=format_value(self.tolerance), allowed=allowed)
        elif self.tolerance is not None and not 0.0 < self.tolerance < math.inf:
            found = f"{self.tolerance:g} m"
            yield Finding(parameter="tolerance", found=found, allowed="more than 0, finite")
        for name, value in (("restarts", self.restarts), ("seed", self.seed)):
            if not isinstance(value, Integral) or value < 0:
                yield Finding(parameter=name, found=format_value(value), allowed="a whole number, 0 or more")
            elif name == "restarts" and value > MAX_RESTARTS:
                yield Finding(parameter=name, found=format_value(value), allowed=f"{MAX_RESTARTS} at most")


DEFAULT_SEARCH = SearchOptions()
"""The search where nothing else is asked."""


ROTATION_TOLERANCE = 1e-6
"""A matrix of a file with 7 digits is a rotation within this, and the nearest one is taken [-]."""

MAX_COORDINATE = 1e9
"""A coordinate beyond this, in [m], is no place of a tool: its square leaves no digit of an arm's length."""


def validate_targets(targets: Targets) -> tuple[Targets, list[str]]:
    """Return targets with the nearest rotations, and why each of them is no target; empty where it is one.

    Of R with |R^T R - 1| <= 1e-6 in every entry the nearest rotation is taken: two steps of
    R <- R (3 - R^T R) / 2, whose error falls as its square.

    Raises:
        OptionError: If positions and rotations are not arrays of shape (n, 3) and (n, 3, 3).
    """
    position, rotation = np.asarray(targets.position, dtype=float), targets.rotation
    count = len(position)
    if position.shape != (count, 3):
        raise OptionError(f"targets: found positions of shape {position.shape}, allowed: (n, 3)")
    reasons = _of_positions(position)
    if rotation is None:
        return Targets(position), reasons
    rotation = np.asarray(rotation, dtype=float)
    if rotation.shape != (count, 3, 3):
        raise OptionError(
            f"targets: found rotations of shape {rotation.shape} for {count} positions,"
            f" allowed: ({count}, 3, 3)"
        )
    reasons = [first or second for first, second in zip(reasons, _of_rotations(rotation), strict=True)]
    with np.errstate(all="ignore"):
        for _ in range(2):
            rotation = rotation @ (1.5 * np.eye(3) - 0.5 * rotation.transpose(0, 2, 1) @ rotation)
    return Targets(position, rotation), reasons


def _of_positions(position: FloatArray) -> list[str]:
    """Return why positions in [m], shape (n, 3), are none."""
    reasons = [""] * len(position)
    for row in np.flatnonzero(~(np.abs(position) <= MAX_COORDINATE).all(axis=1)):
        found = ", ".join(f"{value:g}" for value in position[row])
        finite = np.isfinite(position[row]).all()
        allowed = f"up to {MAX_COORDINATE:g} m along each axis" if finite else "finite numbers"
        reasons[row] = f"the position is {found} m, allowed: {allowed}"
    return reasons


def _of_rotations(rotation: FloatArray) -> list[str]:
    """Return why matrices, shape (n, 3, 3), are no rotations."""
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


LIMIT_ROUNDING = 1e-11
"""A solution beyond a limit by this, in [rad] or [m], is on it: rounding. It is put on the limit."""

TURN = 2.0 * math.pi


def joint_periods(chain: Chain) -> FloatArray:
    """Return 2 pi of each joint that may turn without end, infinity of any other, in [rad], shape (joints,).

    Without end turns a revolute joint without limits. One that may turn by several turns but has limits, as
    those of a UR arm, has none: from 6.2 rad to 0.1 rad it is not 0.18 rad if it ends at 2 pi. Which of its
    turns is allowed and nearest, `within_limits` knows.
    """
    free = [not (math.isfinite(joint.lower) or math.isfinite(joint.upper)) for joint in chain.moving]
    return np.where(is_periodic(chain) & np.array(free), TURN, np.inf)


def limit_solutions(chain: Chain, solutions: Solutions, near: FloatArray | None = None) -> Solutions:
    """Return solutions with every revolute joint shifted by whole turns into its limits.

    Args:
        chain: The arm.
        solutions: Its solutions, limits not asked.
        near: Joint values in [rad] or [m], shape (joints,) or (n, joints): of the turns that are allowed the
            nearest to it is taken; to 0 by default.

    Returns:
        The solutions; one with a joint that cannot be brought into its limits is NaN and has a reason.
    """
    q, outside = shift_into_limits(
        chain, solutions.q, 0.0 if near is None else np.atleast_2d(near)[:, None, :]
    )
    refused = np.asarray(outside.any(axis=2))
    return replace(
        solutions,
        q=np.where(refused[..., None], np.nan, q),
        reasons=_reasons(chain, solutions, outside),
        singular=tuple(replace(one, where=one.where & ~refused) for one in solutions.singular),
    )


def shift_into_limits(chain: Chain, q: FloatArray, near: FloatArray | float) -> tuple[FloatArray, BoolArray]:
    """Return joint values shifted by whole turns into their limits, and where they cannot be brought there.

    Args:
        chain: The arm.
        q: In [rad] or [m], shape (..., joints).
        near: Of the turns that are allowed the nearest to it is taken, in [rad] or [m], shape (..., joints)
            or (joints,).

    Returns:
        In [rad] or [m] and [-], shape (..., joints) both; what is outside of its limits is put on the nearest
        one.
    """
    lower, upper = joint_limits(chain)
    least = np.ceil((lower - LIMIT_ROUNDING - q) / TURN)
    most = np.floor((upper + LIMIT_ROUNDING - q) / TURN)
    turns = np.where(is_periodic(chain), np.clip(np.round((near - q) / TURN), least, most), 0.0)
    shifted = q + turns * TURN
    outside = (shifted < lower - LIMIT_ROUNDING) | (shifted > upper + LIMIT_ROUNDING)
    return np.clip(shifted, lower, upper), outside


def wrap_continuous_joints(q: FloatArray, period: FloatArray) -> FloatArray:
    """Return joint values with those of joints that turn without end within (-pi, pi].

    Args:
        q: In [rad] or [m], shape (..., joints).
        period: Of each joint in [rad], shape (joints,): see `periods`.

    Returns:
        In [rad] or [m], shape (..., joints).
    """
    turning = np.isfinite(period)
    values = q.copy()
    values[..., turning] -= TURN * np.ceil((q[..., turning] - math.pi) / TURN)
    return values


def shift_towards_limits(chain: Chain, q: FloatArray) -> FloatArray:
    """Return q with each joint in the turn nearest to its limits, both in [rad] or [m], shape (n, joints)."""
    lower, upper = joint_limits(chain)
    limited = is_periodic(chain) & np.isfinite(lower) & np.isfinite(upper)
    middle = np.where(limited, 0.5 * (lower + upper), 0.0)
    return np.where(limited, q + TURN * np.round((middle - q) / TURN), q)


def joint_limits(chain: Chain) -> tuple[FloatArray, FloatArray]:
    """Return the least and the largest value of every coordinate in [rad] or [m], each of shape (joints,)."""
    return np.array([one.lower for one in chain.moving]), np.array([one.upper for one in chain.moving])


def is_periodic(chain: Chain) -> BoolArray:
    """Return true of the joints that a whole turn leaves where they were, shape (joints,).

    One that another follows (mimic) is among them only if that one turns by whole turns, too.
    """
    barred = {
        joint.mimic.joint
        for joint in chain.joints
        if joint.mimic is not None
        and not (joint.kind == "revolute" and float(joint.mimic.multiplier).is_integer())
    }
    return np.array([joint.kind == "revolute" and joint.name not in barred for joint in chain.moving])


def _reasons(chain: Chain, solutions: Solutions, outside: BoolArray) -> TextArray:
    """Return the reasons of solutions with those of the joints that are outside their limits."""
    texts = solutions.reasons.copy()
    for target, column in zip(*np.nonzero(outside.any(axis=2)), strict=True):
        faults = [
            _fault(
                chain.moving[joint],
                float(solutions.q[target, column, joint]),
                bool(is_periodic(chain)[joint]),
            )
            for joint in np.flatnonzero(outside[target, column])
        ]
        texts[target, column] = "; ".join(faults)
    return texts


def _fault(joint: Joint, value: float, turns: bool) -> str:
    """Say that a joint cannot be at a value in [rad] or [m], in the turn nearest to its limits."""
    if turns:
        value += TURN * round((0.5 * (joint.lower + joint.upper) - value) / TURN)
    unit = "m" if joint.kind == "prismatic" else "rad"
    found, lower, upper = format_with_limits(value, joint.lower, joint.upper)
    return f"joint {joint.name} at {found} {unit}, allowed: {lower} to {upper} {unit}"
