"""The joints of an arm along a path, by arc length: what holds whatever the law of time is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.along_path.joint_path import JointPath
from urmpipe_models.inverse.along_path.path import follow
from urmpipe_models.inverse.limits import LIMIT_ROUNDING, limits_of
from urmpipe_models.planning.joint_motion import JointSlopes, joint_slopes, polished, targets_at
from urmpipe_models.planning.line_arc import LineArcPath
from urmpipe_models.planning.turning import part_at

GRID, STEP = 4000, 2e-3
"""Intervals of a path at least, and their largest length in [m]: the least time along the paper's contour is
then within 0.3 % of finer grids."""

LEAST = 30
"""Intervals from each row or end of a segment to the next at least."""

FINE, BENT = 0.02, 0.1
"""How far a joint may move in an interval, in [rad] or [m], and dq/ds change, as a share of the largest: both
grow without end near a singular pose."""

MISSED = 0.05
"""An interval whose slopes miss its end by more, as a share of its step, follows another branch."""

PARTS, ROUNDS, SHORTEST = 100, 4, 1e-7
"""Into how many parts an interval is divided at most, how often, and down to which length in [m]."""

STEPPED = 1e-6
"""Slopes that differ by more, as a share of the largest, are two: rounding of a Jacobian is less."""


@dataclass(frozen=True, slots=True, eq=False)
class PathJoints:
    """The joints along a path: followed on a grid, exact at any place.

    Attributes:
        chain: The arm.
        path: The path.
        s: Places of the grid in [m], rising, shape (n + 1,): among them all rows and ends of segments.
        grid: The joints at these places, a sample a place.
        moves: Which joints move along each interval, shape (n, joints): not those that rest on a limit.
        touches: Along which intervals a joint comes to a limit or leaves it, shape (n,).
        after: Slopes where each interval begins, n rows.
        before: Slopes where each one ends, n rows.
    """

    chain: Chain
    path: LineArcPath
    s: FloatArray
    grid: JointPath
    moves: BoolArray
    touches: BoolArray
    after: JointSlopes
    before: JointSlopes

    @property
    def reached(self) -> bool:
        """Whether the arm reaches every place of the grid."""
        return bool(self.grid.reached.all())

    @property
    def rate_steps(self) -> IndexArray:
        """Places of the grid, from 0, at which a joint comes to a limit or leaves it [-], shape (k,).

        There the others take over, so that dq/ds steps; not where the path stops.
        """
        step = np.abs(self.after.dq[1:] - self.before.dq[:-1]).max(axis=1)
        steps = step > STEPPED * np.abs(self.after.dq[1:]).max(axis=1)
        other = (self.moves[1:] != self.moves[:-1]).any(axis=1)
        return np.flatnonzero(other & steps & ~np.isin(self.s[1:-1], self.path.stops)) + 1

    @property
    def parts(self) -> IndexArray:
        """Into how many parts each interval has to be divided for its joints to be known [-], shape (n,).

        Few where a joint moves far or its slope changes much; as many as may be where the slopes contradict
        the step, the determinant changes its sign, or a joint comes to a limit or leaves it.
        """
        step, length = self.before.q - self.after.q, np.diff(self.s)
        largest = np.maximum(np.abs(self.after.dq), np.abs(self.before.dq)).max(axis=1)
        bend = np.abs(self.before.dq - self.after.dq).max(axis=1) / np.where(largest > 0.0, largest, 1.0)
        moved = np.abs(step).max(axis=1)
        wanted = np.ceil(np.maximum(moved / FINE, bend / BENT))
        missed = np.abs(step - 0.5 * length[:, None] * (self.after.dq + self.before.dq)).max(axis=1)
        unknown = self.touches | (missed > MISSED * moved)
        determinant = self.grid.singularity.determinant
        if determinant is not None:
            unknown |= determinant[1:] * determinant[:-1] < 0.0
        parts = np.where(unknown, PARTS, np.clip(wanted, 1, PARTS))
        return np.where(length > SHORTEST, parts, 1).astype(np.intp)

    def at(self, s: FloatArray) -> JointSlopes:
        """Return joint values and their slopes, at the end of a segment those after it.

        With the way w = s - s_k into interval k, h long, the values are
        q_k + w q'_k + w^2 q''_k / 2, with w / h of what these miss q_(k+1) by, and from there a Newton step
        or two onto the path.

        Args:
            s: In [m], shape (n,).

        Returns:
            Slopes of n rows; NaN where an end of the interval is not reached.
        """
        k = part_at(self.s, s)
        way, length = s - self.s[k], np.diff(self.s)[k]
        q = _ahead(self.after, k, way) + (way / length)[:, None] * self._missed()[k]
        lower, upper = limits_of(self.chain)
        q = polished(self.chain, self.path, np.clip(q, lower, upper), s, self.moves[k])
        q = np.clip(q, lower, upper)  # the last digits of a joint that comes to a limit
        return joint_slopes(self.chain, self.path, q, s, self.moves[k])

    def _missed(self) -> FloatArray:
        """Return what the slopes at the begin of each interval miss its end by, shape (n, joints).

        Least motion finds each place from the one before: the slopes of a redundant arm differ from that by
        the step. A jump is missed by nothing: values belong to the begin of its interval.
        """
        intervals = np.arange(len(self.s) - 1)
        missed = self.before.q - _ahead(self.after, intervals, np.diff(self.s))
        missed[[jump.sample - 1 for jump in self.grid.jumps]] = 0.0
        return np.asarray(missed)


def joints_along(
    chain: Chain,
    path: LineArcPath,
    start: FloatArray | None = None,
    progress: Callable[[float], None] | None = None,
) -> PathJoints:
    """Return the joints that lead the tool of an arm along a path.

    Intervals are divided, and the path followed anew from where it began, until the joints are known along
    each of them.

    Args:
        chain: The arm.
        path: The path.
        start: Joint values to be near to at its first place in [rad] or [m], shape (joints,).
        progress: Called with the share of the grid that is done, 0..1.
    """
    s = _grid(path)
    found = _followed(chain, path, s, start, progress)
    for _ in range(ROUNDS - 1):
        if not found.reached or found.parts.max() == 1:
            break
        s = _divided(s, found.parts)
        found = _followed(chain, path, s, found.grid.q[0], None)
    return found


def _followed(
    chain: Chain,
    path: LineArcPath,
    s: FloatArray,
    start: FloatArray | None,
    progress: Callable[[float], None] | None,
) -> PathJoints:
    """Return the joints on a grid of arc lengths in [m], shape (n + 1,)."""
    grid = follow(chain, targets_at(path, s), np.arange(len(s)), start=start, progress=progress)
    moves, touches = _moving(chain, grid.q)
    after = joint_slopes(chain, path, grid.q[:-1], s[:-1], moves)
    return PathJoints(
        chain, path, s, grid, moves, touches, after, _before(chain, path, s, grid.q, moves, after)
    )


def _before(
    chain: Chain, path: LineArcPath, s: FloatArray, q: FloatArray, moves: BoolArray, after: JointSlopes
) -> JointSlopes:
    """Return the slopes where each interval ends: those after it, unless they may step there."""
    steps = np.append((moves[1:] != moves[:-1]).any(axis=1), True)
    steps |= np.isin(s[1:], np.append(path.bounds, path.at))
    own = joint_slopes(chain, path, q[1:][steps], s[1:][steps], moves[steps], before=True)
    dq, ddq = np.roll(after.dq, -1, axis=0), np.roll(after.ddq, -1, axis=0)
    dq[steps], ddq[steps] = own.dq, own.ddq
    return JointSlopes(q[1:], dq, ddq)


def rests_of(path: LineArcPath) -> FloatArray:
    """Return where joints with finite accelerations have to rest in [m], shape (k,).

    At stops, and where the tool's turn changes its rate.
    """
    return path.stops if path.turning is None else np.append(path.stops, path.at[path.turning.uneven])


def _ahead(slopes: JointSlopes, k: IndexArray, way: FloatArray) -> FloatArray:
    """Return q + w q' + w^2 q'' / 2 from the rows k on, shape (n, joints)."""
    w = way[:, None]
    return np.asarray(slopes.q[k] + w * (slopes.dq[k] + 0.5 * w * slopes.ddq[k]))


def _grid(path: LineArcPath) -> FloatArray:
    """Return arc lengths in [m] that hold the ends of all segments and all rows, shape (n + 1,)."""
    places = np.unique(np.concatenate((path.bounds, path.at)))
    lengths = np.diff(places)
    counts = np.maximum(np.ceil(lengths * max(GRID / path.total, 1.0 / STEP)), LEAST)
    return _divided(places, counts.astype(np.intp))


def _divided(places: FloatArray, counts: IndexArray) -> FloatArray:
    """Return places, shape (n + 1,), and between each and the next what makes as many parts, shape (n,)."""
    k = np.repeat(np.arange(len(counts)), counts)
    part = np.arange(len(k)) - (np.cumsum(counts) - counts)[k]
    return np.append(places[k] + part * (np.diff(places) / counts)[k], places[-1])


def _moving(chain: Chain, q: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return which joints move along each interval, shape (n, joints), and where one touches a limit, (n,).

    A joint that is on a limit at both ends of an interval, and the same there, rests on it.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n + 1, joints).
    """
    lower, upper = limits_of(chain)
    free = lower < upper
    on = free & ((np.abs(q - lower) <= LIMIT_ROUNDING) | (np.abs(q - upper) <= LIMIT_ROUNDING))
    rests = on[1:] & on[:-1] & (np.abs(np.diff(q, axis=0)) <= LIMIT_ROUNDING)
    return np.asarray(free & ~rests), np.asarray((on[1:] != on[:-1]).any(axis=1))
