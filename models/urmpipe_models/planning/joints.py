"""The joints along a planned path: how they change with arc length, exactly.

The joints of an arm along a path, by arc length: what holds whatever the law of time is.

The law that runs a path in the least time within the limits of the joints, at rest at its stops.

With x = s'^2 and u = s'' the joints accelerate by q'' = (dq/ds) u + (d2q/ds2) x: their limits are linear in
both. On a grid of arc lengths, with u constant from each to the next, one pass back finds the largest x at
each from which the rest of the path can be run, and one pass along takes the largest u that keeps to that.

Source: [Iso9283]_ section 2 (approximately optimum time); [PhamPham2018]_ (both passes).

The limits of joints along a path: the law that runs at them, and how much of them a law uses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray
from urmpipe_models.ik.limits import LIMIT_ROUNDING, joint_limits
from urmpipe_models.ik.path import JointPath, solve_path
from urmpipe_models.ik.solutions import Targets, pose_errors
from urmpipe_models.kinematics.forward import bias_over_log, jacobian_over_log
from urmpipe_models.planning.laws import PathMotion, Phase, TimeLaw
from urmpipe_models.planning.path import LineArcPath, segment_index

NUDGE = 1e-6
"""Step of the fastest joint, in [rad] or [m], for a difference of Jacobians: error 1e-12, rounding 1e-10."""

NEAR = 1e-14
"""The tool within this of its path, in [m] and [rad], is on it: rounding."""

STEPS = 4
"""Newton steps at most: three square an error of 1e-2 down to rounding."""

SINGULAR = 1e-9
"""Singular values of a Jacobian below this share of the largest are 0 for a step onto the path: rounding."""

ROUNDING = 1e-15
"""Below this share they are 0 for slopes, which shall grow near a singular pose."""

PLAIN = 1e-5
"""A Jacobian whose pivots are all above this share of the largest is far from singular."""


@dataclass(frozen=True, slots=True, eq=False)
class JointPathDerivatives:
    """Joint values by arc length.

    Attributes:
        q: In [rad] or [m], shape (n, joints).
        dq: dq/ds in [rad/m] or [-], shape (n, joints).
        ddq: d2q/ds2 in [rad/m2] or [1/m], shape (n, joints).
    """

    q: FloatArray
    dq: FloatArray
    ddq: FloatArray

    def rates(self, v: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return q' = dq s' and q'' = ddq s'^2 + dq s'', each of shape (n, joints), in SI.

        Args:
            v: s' in [m/s], shape (n,).
            a: s'' in [m/s2], shape (n,).
        """
        return self.dq * v[:, None], self.ddq * (v * v)[:, None] + self.dq * a[:, None]


def targets_at(path: LineArcPath, s: FloatArray) -> Targets:
    """Return where the tool shall be at arc lengths in [m], shape (n,)."""
    rotation = None if path.orientation is None else path.orientation.matrices(s)
    return Targets(path.points(s).position, rotation)


def joint_path_derivatives(
    chain: Chain, path: LineArcPath, q: FloatArray, s: FloatArray, moves: BoolArray, *, before: bool = False
) -> JointPathDerivatives:
    """Return the slopes of joint values that lead the tool along a path with the least motion.

    With x' = (t, turn rate) and x'' = (curvature, 0): q' = J+ x', and differentiated once more, with
    y = J+^T q', q'' = J+ (x'' - J' q') + (1 - J+ J) J'^T y; the last term is 0 where J is square. Joints
    that do not move have no column in J.

    Args:
        chain: The arm.
        path: The path.
        q: Joint values along it in [rad] or [m], shape (n, joints); a row of NaN has slopes of NaN.
        s: Arc lengths in [m], shape (n,).
        moves: Which joints move, shape (n, joints).
        before: Whether slopes that jump, where two segments meet, are those before it; else after it.
    """
    points = path.points(s, before=before)
    first, second = points.tangent, points.curvature
    if path.orientation is not None:
        first = np.hstack((first, path.orientation.rates(s, before=before)))
        second = np.hstack((second, np.zeros_like(second)))
    dq, ddq = np.full(q.shape, np.nan), np.full(q.shape, np.nan)
    known = np.isfinite(q).all(axis=1)
    for rows in _alike(moves, np.flatnonzero(known)):
        dq[rows], ddq[rows] = _slopes(chain, q[rows], first[rows], second[rows], moves[rows[0]])
    return JointPathDerivatives(q, dq, ddq)


def refine_on_path(
    chain: Chain, path: LineArcPath, q: FloatArray, s: FloatArray, moves: BoolArray
) -> FloatArray:
    """Return joint values with the tool on the path to the last digits, by Newton steps q + J+ (x - FK(q)).

    Each step leaves the square of what it finds. What is nearer than `NEAR` stays, and so does, in a singular
    pose, what no step removes.

    Args:
        chain: The arm.
        path: The path.
        q: Joint values near it in [rad] or [m], shape (n, joints), NaN where there are none.
        s: Arc lengths in [m], shape (n,).
        moves: Which joints move, shape (n, joints).

    Returns:
        In [rad] or [m], shape (n, joints).
    """
    better, off = q.copy(), np.flatnonzero(np.isfinite(q).all(axis=1))
    for _ in range(STEPS):
        miss = np.hstack(pose_errors(chain, better[off], targets_at(path, s[off])))
        miss = miss[:, : 3 if path.orientation is None else 6]
        far = np.abs(miss).max(axis=1) > NEAR
        off, miss = off[far], miss[far]
        for chosen in _alike(moves[off], np.arange(len(off))):
            rows, pattern = off[chosen], moves[off[chosen[0]]]
            J = jacobian_over_log(chain, better[rows])[:, : miss.shape[1], pattern]
            better[np.ix_(rows, pattern)] += _times(_inverses(J, SINGULAR), miss[chosen])
    return better


def _slopes(
    chain: Chain, q: FloatArray, first: FloatArray, second: FloatArray, moves: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return dq/ds and d2q/ds2 where the same joints move, both of shape (m, joints)."""
    rows = first.shape[1]
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    J = jacobian_over_log(chain, q)[:, :rows, moves]
    inverse = _inverses(J, ROUNDING)
    dq[:, moves] = _times(inverse, first)
    ddq[:, moves] = _times(inverse, second - bias_over_log(chain, q, dq)[:, :rows])
    if J.shape[2] > rows:
        changed = _jacobian_along(chain, q, dq)[:, :rows, moves]
        pull = _times(changed.transpose(0, 2, 1), _times(inverse.transpose(0, 2, 1), dq[:, moves]))
        ddq[:, moves] += pull - _times(inverse, _times(J, pull))
    return dq, ddq


def _alike(moves: BoolArray, rows: IndexArray) -> Iterator[IndexArray]:
    """Yield the rows, of some, in which the same joints move."""
    while len(rows):
        same = (moves[rows] == moves[rows[0]]).all(axis=1)
        yield rows[same]
        rows = rows[~same]


def _inverses(J: FloatArray, cutoff: float) -> FloatArray:
    """Return pseudo-inverses, shape (n, k, j), of matrices, shape (n, j, k).

    A tall matrix is Q R, and its pseudo-inverse R^-1 Q^T. Only those that are nearly singular, as the
    pivots of R show, need their singular values, which cost three times as much.

    Args:
        J: In any unit.
        cutoff: Singular values below this share of the largest count as 0.
    """
    tall = J if J.shape[1] > J.shape[2] else J.transpose(0, 2, 1)
    Q, R = np.linalg.qr(tall)
    pivots = np.abs(np.diagonal(R, axis1=1, axis2=2))
    regular = pivots.min(axis=1) > PLAIN * pivots.max(axis=1)
    inverse = np.empty(tall.shape)
    inverse[regular] = Q[regular] @ np.linalg.inv(R[regular]).transpose(0, 2, 1)
    inverse[~regular] = np.linalg.pinv(tall[~regular], rcond=cutoff).transpose(0, 2, 1)
    return inverse if tall is not J else inverse.transpose(0, 2, 1)


def _times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the products of matrices, shape (n, j, k), and vectors, shape (n, k)."""
    return np.asarray(np.einsum("njk,nk->nj", matrix, vector))


def _jacobian_along(chain: Chain, q: FloatArray, dq: FloatArray) -> FloatArray:
    """Return the derivative of the Jacobian along a motion, by a central difference, shape (n, 6, joints)."""
    step = NUDGE / np.maximum(np.abs(dq).max(axis=1, keepdims=True), 1e-12)
    change = jacobian_over_log(chain, q + step * dq) - jacobian_over_log(chain, q - step * dq)
    return np.asarray(change / (2.0 * step)[:, :, None])


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
        limit_contacts: Along which intervals a joint comes to a limit or leaves it, shape (n,).
        after: Slopes where each interval begins, n rows.
        before: Slopes where each one ends, n rows.
    """

    chain: Chain
    path: LineArcPath
    s: FloatArray
    grid: JointPath
    moves: BoolArray
    limit_contacts: BoolArray
    after: JointPathDerivatives
    before: JointPathDerivatives

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
        unknown = self.limit_contacts | (missed > MISSED * moved)
        determinant = self.grid.singularity.determinant
        if determinant is not None:
            unknown |= determinant[1:] * determinant[:-1] < 0.0
        parts = np.where(unknown, PARTS, np.clip(wanted, 1, PARTS))
        return np.where(length > SHORTEST, parts, 1).astype(np.intp)

    def at(self, s: FloatArray) -> JointPathDerivatives:
        """Return joint values and their slopes, at the end of a segment those after it.

        With the way w = s - s_k into interval k, h long, the values are
        q_k + w q'_k + w^2 q''_k / 2, with w / h of what these miss q_(k+1) by, and from there a Newton step
        or two onto the path.

        Args:
            s: In [m], shape (n,).

        Returns:
            Slopes of n rows; NaN where an end of the interval is not reached.
        """
        k = segment_index(self.s, s)
        way, length = s - self.s[k], np.diff(self.s)[k]
        q = _ahead(self.after, k, way) + (way / length)[:, None] * self._missed()[k]
        lower, upper = joint_limits(self.chain)
        q = refine_on_path(self.chain, self.path, np.clip(q, lower, upper), s, self.moves[k])
        q = np.clip(q, lower, upper)  # the last digits of a joint that comes to a limit
        return joint_path_derivatives(self.chain, self.path, q, s, self.moves[k])

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
    grid = solve_path(chain, targets_at(path, s), np.arange(len(s)), start=start, progress=progress)
    moves, limit_contacts = _moving(chain, grid.q)
    after = joint_path_derivatives(chain, path, grid.q[:-1], s[:-1], moves)
    return PathJoints(
        chain, path, s, grid, moves, limit_contacts, after, _before(chain, path, s, grid.q, moves, after)
    )


def _before(
    chain: Chain,
    path: LineArcPath,
    s: FloatArray,
    q: FloatArray,
    moves: BoolArray,
    after: JointPathDerivatives,
) -> JointPathDerivatives:
    """Return the slopes where each interval ends: those after it, unless they may step there."""
    steps = np.append((moves[1:] != moves[:-1]).any(axis=1), True)
    steps |= np.isin(s[1:], np.append(path.bounds, path.at))
    own = joint_path_derivatives(chain, path, q[1:][steps], s[1:][steps], moves[steps], before=True)
    dq, ddq = np.roll(after.dq, -1, axis=0), np.roll(after.ddq, -1, axis=0)
    dq[steps], ddq[steps] = own.dq, own.ddq
    return JointPathDerivatives(q[1:], dq, ddq)


def required_stops(path: LineArcPath) -> FloatArray:
    """Return where joints with finite accelerations have to rest in [m], shape (k,).

    At stops, and where the tool's turn changes its rate.
    """
    return (
        path.stops
        if path.orientation is None
        else np.append(path.stops, path.at[path.orientation.uneven_rows])
    )


def _ahead(slopes: JointPathDerivatives, k: IndexArray, way: FloatArray) -> FloatArray:
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
    lower, upper = joint_limits(chain)
    free = lower < upper
    on = free & ((np.abs(q - lower) <= LIMIT_ROUNDING) | (np.abs(q - upper) <= LIMIT_ROUNDING))
    rests = on[1:] & on[:-1] & (np.abs(np.diff(q, axis=0)) <= LIMIT_ROUNDING)
    return np.asarray(free & ~rests), np.asarray((on[1:] != on[:-1]).any(axis=1))


STILL = 1e-12
"""A joint that moves by less, in [rad/m], does not move: rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class PhasePlaneBounds:
    """What holds on n intervals of a grid: |u + slope x| <= most, and x <= fastest where they begin.

    Attributes:
        slope: In [m/m2], shape (n, k).
        most: In [m/s2], shape (n, k).
        fastest: In [m2/s2], shape (n + 1,); the last one where the last interval ends.
    """

    slope: FloatArray
    most: FloatArray
    fastest: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class JointLimits:
    """The largest rates and accelerations of joints, and of the tool along its path.

    Attributes:
        velocity: In [rad/s] or [m/s], shape (joints,); infinity without one.
        acceleration: In [rad/s2] or [m/s2], shape (joints,).
        speed: s' in [m/s].
        tangential: s'' in [m/s2].
    """

    velocity: FloatArray
    acceleration: FloatArray
    speed: float = np.inf
    tangential: float = np.inf


def time_optimal_law(
    s: FloatArray,
    after: JointPathDerivatives,
    before: JointPathDerivatives,
    stop: BoolArray,
    limits: JointLimits,
) -> TimeLaw:
    """Return the law in the least time.

    Args:
        s: Arc lengths of the grid in [m], rising, shape (n + 1,).
        after: Slopes where each interval begins, n rows.
        before: Slopes where each one ends, n rows: where segments meet they are others.
        stop: Where the path stops, shape (n + 1,); the first and the last are stops.
        limits: Of joints and tool.

    Source: [PhamPham2018]_.
    """
    step = np.diff(s)
    bounds = interval_bounds(step, after, before, limits)
    x = _run(step, bounds, stop)
    v = np.sqrt(x)
    moves = v[1:] + v[:-1] > 0.0
    with np.errstate(divide="ignore"):
        durations = 2.0 * step / (v[1:] + v[:-1])
    rows = (durations, s[:-1], v[:-1], 0.5 * np.diff(x) / step)
    phases: list[Phase] = []
    for i, row in enumerate(zip(*(part.tolist() for part in rows), strict=True)):
        phases += [Phase(*row)] if moves[i] else _from_rest_to_rest(bounds, i, float(s[i]), float(step[i]))
    return TimeLaw(phases)


def _from_rest_to_rest(bounds: PhasePlaneBounds, i: int, s: float, step: float) -> list[Phase]:
    """Return how an interval from s on in [m] is passed from rest to rest: faster to its middle, then slower.

    With u constant x rises to u step: |u + slope x| <= most holds where u (1 + |slope| step) <= most.
    """
    u = float((bounds.most[i] / (1.0 + np.abs(bounds.slope[i]) * step)).min())
    u = min(u, float(bounds.fastest[i : i + 2].min()) / step)
    half = math.sqrt(step / u)
    return [Phase(half, s, 0.0, u), Phase(half, s + 0.5 * step, u * half, -u)]


def interval_bounds(
    step: FloatArray, after: JointPathDerivatives, before: JointPathDerivatives, limits: JointLimits
) -> PhasePlaneBounds:
    """Return the bounds that limits set at both ends of each interval.

    At its end x + 2 step u stands for x: |(dq + 2 step ddq) u + ddq x| <= a.

    Args:
        step: Lengths of the intervals in [m], shape (n,).
        after: Slopes where each interval begins, n rows.
        before: Slopes where each one ends, n rows.
        limits: Of joints and tool.
    """
    along = np.hstack((after.dq, before.dq + 2.0 * step[:, None] * before.ddq))
    across = np.hstack((after.ddq, before.ddq))
    limit = np.tile(limits.acceleration, 2)
    fastest = np.full(len(step) + 1, limits.speed**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        for part, ends in ((after.dq, slice(None, -1)), (before.dq, slice(1, None))):
            rate = np.square(limits.velocity / np.abs(part)).min(axis=1)
            fastest[ends] = np.minimum(fastest[ends], rate)
        moves = np.abs(along) > STILL
        alone = np.where(moves | (across == 0.0), np.inf, limit / np.abs(across)).min(axis=1)
        slope, most = (
            np.where(moves, own, none)
            for own, none in ((across / along, 0.0), (limit / np.abs(along), np.inf))
        )
    fastest[:-1] = np.minimum(fastest[:-1], alone)
    tool = np.zeros((len(step), 1))
    return PhasePlaneBounds(np.hstack((slope, tool)), np.hstack((most, tool + limits.tangential)), fastest)


def _run(step: FloatArray, bounds: PhasePlaneBounds, stop: BoolArray) -> FloatArray:
    """Return x in [m2/s2] on the grid, shape (n + 1,); 0 at stops."""
    half = 0.5 / step
    most = np.where(stop, 0.0, bounds.fastest)
    most[:-1] = np.minimum(most[:-1], _feasible(bounds, half))
    for i in range(len(step) - 1, -1, -1):  # the least u that is allowed has to lead to most[i + 1] or below
        steepness = half[i] - bounds.slope[i]
        reach = (most[i + 1] * half[i] + bounds.most[i])[steepness > 0.0] / steepness[steepness > 0.0]
        most[i] = min(most[i], reach.min(initial=np.inf))
    x = np.zeros(len(step) + 1)
    for i in range(len(step)):
        u = (bounds.most[i] - bounds.slope[i] * x[i]).min()
        x[i + 1] = max(min(x[i] + 2.0 * step[i] * u, most[i + 1]), 0.0)
    return x


def _feasible(bounds: PhasePlaneBounds, half: FloatArray) -> FloatArray:
    """Return the largest x at which any u is allowed that leaves x + 2 step u at 0 or above, shape (n,).

    Each pair of bounds has to leave room: -most_j - slope_j x <= most_k - slope_k x.
    """
    slope = np.hstack((bounds.slope, half[:, None]))
    most = np.hstack((bounds.most, np.zeros((len(half), 1))))
    apart = bounds.slope[:, None, :] - slope[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(apart > 0.0, (bounds.most[:, None, :] + most[:, :, None]) / apart, np.inf)
    return np.asarray(room.min(axis=(1, 2)))


INSIDE = 1e-6
"""How far inside an interval its ends are looked at, as a share of it: where s'' steps a side is plain."""

SIDE = 1e-9
"""How far from the time at which phases meet both are looked at, as a share of it."""


def chain_to_limits(chain: Chain, speed: float = np.inf, tangential: float = np.inf) -> JointLimits:
    """Return the largest rates and accelerations of an arm, and of its tool along the path.

    Args:
        chain: The arm.
        speed: The largest s' in [m/s]; infinity for none.
        tangential: The largest s'' in [m/s2]; infinity for none.
    """
    return JointLimits(
        np.array([joint.velocity for joint in chain.moving]),
        np.array([joint.acceleration for joint in chain.moving]),
        speed,
        tangential,
    )


def joint_limited_law(joints: PathJoints, speed: float = np.inf, tangential: float = np.inf) -> TimeLaw:
    """Return the law in the least time within the rates and accelerations of the joints.

    The limits hold on the grid of the joints; between its places they are exceeded by less than its step
    squared makes. Where the rates of the joints step, as where the tool's turn changes its rate or a joint
    comes to a limit, the path stops: no finite acceleration follows that.

    Args:
        joints: The joints along a path that the arm reaches everywhere.
        speed: The largest s' in [m/s], too; infinity for none.
        tangential: The largest s'' in [m/s2], too; infinity for none.
    """
    stop = np.isin(joints.s, required_stops(joints.path))
    stop[joints.rate_steps] = True
    limits = chain_to_limits(joints.chain, speed, tangential)
    return time_optimal_law(joints.s, joints.after, joints.before, stop, limits)


class LimitUtilisation(NamedTuple):
    """The largest use of a limit along a path.

    Attributes:
        share: max(|q'| / limit, sqrt(|q''| / limit)) [-]: with speeds divided by it the limit holds.
        s: Where, in [m].
        joint: Which of the moving joints, from 0.
    """

    share: float
    s: float
    joint: int


def max_limit_utilisation(joints: PathJoints, law: TimeLaw, *, between: bool = False) -> LimitUtilisation:
    """Return the largest use of a joint's limit by a law.

    It is looked for in the middle and just inside both ends of each interval of the grid, and on both sides
    of the times at which phases of the law meet: rates and accelerations step at both.

    Args:
        joints: The joints along a path that the arm reaches everywhere.
        law: The law.
        between: Whether the middles alone are looked at, since the law holds the limits on the grid.

    Source: [Iso9283]_ section 4, steps 17 and 18.
    """
    limits = chain_to_limits(joints.chain)
    if not np.isfinite([limits.velocity, limits.acceleration]).any():
        return LimitUtilisation(0.0, 0.0, 0)
    s, step = joints.s, INSIDE * np.diff(joints.s)
    middle = 0.5 * (s[1:] + s[:-1])
    looked = [_usage(joints.at(middle), law.at(law.time_at(middle)), limits)]
    if not between:
        for slopes, places in ((joints.after, s[:-1] + step), (joints.before, s[1:] - step)):
            looked.append(_usage(slopes, law.at(law.time_at(places)), limits))
        sides = np.concatenate((law.ends * (1.0 - SIDE), law.ends * (1.0 + SIDE)))
        motion = law.at(np.minimum(sides, law.duration))
        looked.append(_usage(joints.at(np.clip(motion.s, 0.0, s[-1])), motion, limits))
    return max(looked)


def _usage(slopes: JointPathDerivatives, motion: PathMotion, limits: JointLimits) -> LimitUtilisation:
    """Return the largest use of a limit, of n places."""
    rates, accelerations = slopes.rates(motion.v, motion.a)
    share = np.maximum(np.abs(rates) / limits.velocity, np.sqrt(np.abs(accelerations) / limits.acceleration))
    place, joint = np.unravel_index(int(share.argmax()), share.shape)
    return LimitUtilisation(float(share[place, joint]), float(motion.s[place]), int(joint))
