"""Joints along a planned path: derivatives by arc length, the time-optimal law, utilisation of joint limits.

1. `_joint_path_derivatives`: q' = J+ x' and q'' by arc length, least motion, exactly; `_refine_on_path`.
2. `joints_along`: `PathJoints`, joints followed on a grid of arc lengths that is refined where they are
   unknown between its points. They do not depend on the law of time.
3. `time_optimal_law`: with x = s'^2 and u = s'' the joints accelerate by q'' = (dq/ds) u + (d2q/ds2) x: their
   limits are linear in both. On a grid of arc lengths, with u constant in each interval, one pass back finds
   the largest x at each point from which the rest of the path is feasible, and one pass forward takes the
   largest u within these ([Iso9283]_ section 2 (approximately optimum time); [PhamPham2018]_).
4. `joint_limited_law`, `max_limit_utilisation`: that law for an arm, and the use of its limits by any law.
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

# Of the fastest joint, [rad] or [m], for a Jacobian: error 1e-12, rounding 1e-10.
FINITE_DIFFERENCE_STEP = 1e-6
PATH_TOLERANCE = 1e-14  # [m] and [rad]; the tool within this of its path is on it: rounding
MAX_NEWTON_STEPS = 4  # three square an error of 1e-2 down to rounding
REFINEMENT_CUTOFF = 1e-9  # share of the largest singular value; smaller ones are 0 in a step onto the path
DERIVATIVE_CUTOFF = 1e-15  # the same for derivatives, which must grow near a singular pose
MIN_REGULAR_PIVOT = 1e-5  # share of the largest pivot; a Jacobian with larger ones is far from singular

# The least time along the paper's contour is with these within 0.3 % of finer grids.
MIN_INTERVALS = 4000  # of a path
MAX_INTERVAL = 2e-3  # [m]
MIN_INTERVALS_PER_PART = 30  # from each row or bound of a segment to the next

# Both grow without end near a singular pose.
MAX_JOINT_STEP = 0.02  # in an interval, [rad] or [m]
MAX_DERIVATIVE_CHANGE = 0.1  # of dq/ds in an interval, as a share of the largest

MAX_PREDICTION_ERROR = 0.05  # share of the step of an interval; a larger one is a change of branch
MAX_DIVISION = 100  # parts of an interval from one pass to the next
MAX_PASSES = 4  # times that a path is followed, each on a finer grid
MIN_DIVIDED_INTERVAL = 1e-7  # [m]
STEP_TOLERANCE = 1e-6  # difference of derivatives, as a share of the largest; rounding of a Jacobian is less
STATIONARY_RATE = 1e-12  # [rad/m]; a joint with a smaller dq/ds does not move: rounding
INTERVAL_MARGIN = 1e-6  # share of an interval from its ends at which limits are checked, as s'' steps there
PHASE_MARGIN = 1e-9  # share of the time of a boundary of phases, before and after which limits are checked


@dataclass(frozen=True, slots=True, eq=False)
class JointPathDerivatives:
    """Joint values and their derivatives by arc length.

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
    """Return the targets of the tool at arc lengths in [m], shape (n,)."""
    rotation = None if path.orientation is None else path.orientation.matrices(s)
    return Targets(path.points(s).position, rotation)


def _joint_path_derivatives(
    chain: Chain, path: LineArcPath, q: FloatArray, s: FloatArray, moves: BoolArray, *, before: bool = False
) -> JointPathDerivatives:
    """Return the derivatives of joint values that lead the tool along a path with the least motion.

    With x' = (t, rate of rotation) and x'' = (curvature, 0): q' = J+ x', and differentiated once more, with
    y = J+^T q', q'' = J+ (x'' - J' q') + (1 - J+ J) J'^T y; the last term is 0 where J is square. Joints
    that do not move have no column in J. A row of NaN has derivatives of NaN. At a bound of segments, where
    derivatives step, they are those after it, or before it.
    """
    points = path.points(s, before=before)
    first, second = points.tangent, points.curvature
    if path.orientation is not None:
        first = np.hstack((first, path.orientation.rates(s, before=before)))
        second = np.hstack((second, np.zeros_like(second)))
    dq, ddq = np.full(q.shape, np.nan), np.full(q.shape, np.nan)
    known = np.isfinite(q).all(axis=1)
    for rows in _iter_equal_rows(moves, np.flatnonzero(known)):
        dq[rows], ddq[rows] = _derivatives(chain, q[rows], first[rows], second[rows], moves[rows[0]])
    return JointPathDerivatives(q, dq, ddq)


def _derivatives(
    chain: Chain, q: FloatArray, first: FloatArray, second: FloatArray, moves: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return dq/ds and d2q/ds2 of rows in which the same joints move, both of shape (m, joints)."""
    rows = first.shape[1]
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    J = jacobian_over_log(chain, q)[:, :rows, moves]
    inverse = _pseudo_inverses(J, DERIVATIVE_CUTOFF)
    dq[:, moves] = _multiply(inverse, first)
    ddq[:, moves] = _multiply(inverse, second - bias_over_log(chain, q, dq)[:, :rows])
    if J.shape[2] > rows:
        step = FINITE_DIFFERENCE_STEP / np.maximum(np.abs(dq).max(axis=1, keepdims=True), 1e-12)
        change = jacobian_over_log(chain, q + step * dq) - jacobian_over_log(chain, q - step * dq)
        J_prime = np.asarray(change / (2.0 * step)[:, :, None])[:, :rows, moves]
        pull = _multiply(J_prime.transpose(0, 2, 1), _multiply(inverse.transpose(0, 2, 1), dq[:, moves]))
        ddq[:, moves] += pull - _multiply(inverse, _multiply(J, pull))
    return dq, ddq


def _refine_on_path(
    chain: Chain, path: LineArcPath, q: FloatArray, s: FloatArray, moves: BoolArray
) -> FloatArray:
    """Return joint values with the tool on the path to the last digits, by Newton steps q + J+ (x - FK(q)).

    Each step squares the error. Rows within `PATH_TOLERANCE` stay, and so does, in a singular pose, the error
    that no step removes; a row of NaN stays.
    """
    refined, remaining = q.copy(), np.flatnonzero(np.isfinite(q).all(axis=1))
    for _ in range(MAX_NEWTON_STEPS):
        error = np.hstack(pose_errors(chain, refined[remaining], targets_at(path, s[remaining])))
        error = error[:, : 3 if path.orientation is None else 6]
        far = np.abs(error).max(axis=1) > PATH_TOLERANCE
        remaining, error = remaining[far], error[far]
        for chosen in _iter_equal_rows(moves[remaining], np.arange(len(remaining))):
            rows, pattern = remaining[chosen], moves[remaining[chosen[0]]]
            J = jacobian_over_log(chain, refined[rows])[:, : error.shape[1], pattern]
            step = _multiply(_pseudo_inverses(J, REFINEMENT_CUTOFF), error[chosen])
            refined[np.ix_(rows, pattern)] += step
    return refined


def _iter_equal_rows(moves: BoolArray, rows: IndexArray) -> Iterator[IndexArray]:
    """Yield groups of the given rows in which the same joints move."""
    while len(rows):
        same = (moves[rows] == moves[rows[0]]).all(axis=1)
        yield rows[same]
        rows = rows[~same]


def _pseudo_inverses(J: FloatArray, cutoff: float) -> FloatArray:
    """Return pseudo-inverses, shape (n, k, j), of matrices, shape (n, j, k).

    A tall matrix is Q R, and its pseudo-inverse R^-1 Q^T. Only those that are nearly singular, as the
    pivots of R show, need their singular values, which cost three times as much: those below a share of the
    largest, the cutoff, count as 0.
    """
    tall = J if J.shape[1] > J.shape[2] else J.transpose(0, 2, 1)
    Q, R = np.linalg.qr(tall)
    pivots = np.abs(np.diagonal(R, axis1=1, axis2=2))
    regular = pivots.min(axis=1) > MIN_REGULAR_PIVOT * pivots.max(axis=1)
    inverse = np.empty(tall.shape)
    inverse[regular] = Q[regular] @ np.linalg.inv(R[regular]).transpose(0, 2, 1)
    inverse[~regular] = np.linalg.pinv(tall[~regular], rcond=cutoff).transpose(0, 2, 1)
    return inverse if tall is not J else inverse.transpose(0, 2, 1)


def _multiply(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the products of matrices, shape (n, j, k), and vectors, shape (n, k)."""
    return np.asarray(np.einsum("njk,nk->nj", matrix, vector))


@dataclass(frozen=True, slots=True, eq=False)
class PathJoints:
    """The joints along a path: followed on a grid, exact at any arc length.

    Attributes:
        chain: The arm.
        path: The path.
        s: Arc lengths of the grid in [m], rising, shape (n + 1,): with those of all rows and segments.
        grid: The joints there, one sample per point of the grid.
        moves: Which joints move along each interval, shape (n, joints): not those that rest on a limit.
        limit_contacts: Intervals in which a joint comes to a limit or leaves it, shape (n,).
        after: Derivatives at the begin of each interval, n rows.
        before: Derivatives at the end of each interval, n rows.
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
        """Whether the arm reaches every point of the grid."""
        return bool(self.grid.reached.all())

    @property
    def rate_steps(self) -> IndexArray:
        """Points of the grid, from 0, at which a joint comes to a limit or leaves it [-], shape (k,).

        There the other joints take over its motion, so that dq/ds steps; without those at stops.
        """
        step = np.abs(self.after.dq[1:] - self.before.dq[:-1]).max(axis=1)
        is_step = step > STEP_TOLERANCE * np.abs(self.after.dq[1:]).max(axis=1)
        changes = (self.moves[1:] != self.moves[:-1]).any(axis=1)
        return np.flatnonzero(changes & is_step & ~np.isin(self.s[1:-1], self.path.stops)) + 1

    @property
    def parts(self) -> IndexArray:
        """Parts into which each interval has to be divided for its joints to be known [-], shape (n,).

        Few where a joint moves far or its derivative changes much; the maximum where the derivatives
        contradict the step, the determinant changes its sign, or a joint comes to a limit or leaves it.
        """
        step, length = self.before.q - self.after.q, np.diff(self.s)
        largest = np.maximum(np.abs(self.after.dq), np.abs(self.before.dq)).max(axis=1)
        change = np.abs(self.before.dq - self.after.dq).max(axis=1) / np.where(largest > 0.0, largest, 1.0)
        moved = np.abs(step).max(axis=1)
        needed = np.ceil(np.maximum(moved / MAX_JOINT_STEP, change / MAX_DERIVATIVE_CHANGE))
        error = np.abs(step - 0.5 * length[:, None] * (self.after.dq + self.before.dq)).max(axis=1)
        unknown = self.limit_contacts | (error > MAX_PREDICTION_ERROR * moved)
        determinant = self.grid.singularity.determinant
        if determinant is not None:
            unknown |= determinant[1:] * determinant[:-1] < 0.0
        parts = np.where(unknown, MAX_DIVISION, np.clip(needed, 1, MAX_DIVISION))
        return np.where(length > MIN_DIVIDED_INTERVAL, parts, 1).astype(np.intp)

    def at(self, s: FloatArray) -> JointPathDerivatives:
        """Return joint values and their derivatives, at the end of a segment those after it.

        At a distance w = s - s_k into interval k, of length h, the values are q_k + w q'_k + w^2 q''_k / 2,
        plus w / h of their difference from q_(k+1), and from there a Newton step or two onto the path.

        Args:
            s: In [m], shape (n,).

        Returns:
            Derivatives of n rows; NaN where an end of the interval is not reached.
        """
        k = segment_index(self.s, s)
        distance, length = s - self.s[k], np.diff(self.s)[k]
        q = _extrapolate(self.after, k, distance) + (distance / length)[:, None] * self._gaps()[k]
        lower, upper = joint_limits(self.chain)
        q = _refine_on_path(self.chain, self.path, np.clip(q, lower, upper), s, self.moves[k])
        q = np.clip(q, lower, upper)  # the last digits of a joint that comes to a limit
        return _joint_path_derivatives(self.chain, self.path, q, s, self.moves[k])

    def _gaps(self) -> FloatArray:
        """Return the end of each interval minus its extrapolated begin, shape (n, joints).

        Least motion finds each point from the previous one: the derivatives of a redundant arm differ from
        that by the step. A jump has no gap: the values of its interval belong to its begin.
        """
        intervals = np.arange(len(self.s) - 1)
        gaps = self.before.q - _extrapolate(self.after, intervals, np.diff(self.s))
        gaps[[jump.sample - 1 for jump in self.grid.jumps]] = 0.0
        return np.asarray(gaps)


def _extrapolate(derivatives: JointPathDerivatives, k: IndexArray, distance: FloatArray) -> FloatArray:
    """Return q + w q' + w^2 q'' / 2 of the rows k at distances w, shape (n, joints)."""
    w = distance[:, None]
    return np.asarray(derivatives.q[k] + w * (derivatives.dq[k] + 0.5 * w * derivatives.ddq[k]))


def joints_along(
    chain: Chain,
    path: LineArcPath,
    start: FloatArray | None = None,
    progress: Callable[[float], None] | None = None,
) -> PathJoints:
    """Return the joints that lead the tool of an arm along a path.

    Intervals are divided, and the path is followed again from its begin, until the joints are known in each
    of them.

    Args:
        chain: The arm.
        path: The path.
        start: Joint values near which the path starts in [rad] or [m], shape (joints,).
        progress: Called with the completed share of the grid, 0..1.
    """
    places = np.unique(np.concatenate((path.bounds, path.at)))
    lengths = np.diff(places)
    counts = np.ceil(lengths * max(MIN_INTERVALS / path.total, 1.0 / MAX_INTERVAL))
    s = _divide(places, np.maximum(counts, MIN_INTERVALS_PER_PART).astype(np.intp))
    joints = _follow_grid(chain, path, s, start, progress)
    for _ in range(MAX_PASSES - 1):
        if not joints.reached or joints.parts.max() == 1:
            break
        s = _divide(s, joints.parts)
        joints = _follow_grid(chain, path, s, joints.grid.q[0], None)
    return joints


def _divide(places: FloatArray, counts: IndexArray) -> FloatArray:
    """Return places, shape (n + 1,), with each interval divided into equal parts, counts of shape (n,)."""
    k = np.repeat(np.arange(len(counts)), counts)
    part = np.arange(len(k)) - (np.cumsum(counts) - counts)[k]
    return np.append(places[k] + part * (np.diff(places) / counts)[k], places[-1])


def _follow_grid(
    chain: Chain,
    path: LineArcPath,
    s: FloatArray,
    start: FloatArray | None,
    progress: Callable[[float], None] | None,
) -> PathJoints:
    """Return the joints on a grid of arc lengths in [m], shape (n + 1,)."""
    grid = solve_path(chain, targets_at(path, s), np.arange(len(s)), start=start, progress=progress)
    moves, limit_contacts = _moving_joints(chain, grid.q)
    after = _joint_path_derivatives(chain, path, grid.q[:-1], s[:-1], moves)
    before = _derivatives_before(chain, path, s, grid.q, moves, after)
    return PathJoints(chain, path, s, grid, moves, limit_contacts, after, before)


def _moving_joints(chain: Chain, q: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return which joints move in each interval, shape (n, joints), and where one touches a limit, (n,).

    A joint with the same value on a limit at both ends of an interval rests on it.
    """
    lower, upper = joint_limits(chain)
    free = lower < upper
    on = free & ((np.abs(q - lower) <= LIMIT_ROUNDING) | (np.abs(q - upper) <= LIMIT_ROUNDING))
    rests = on[1:] & on[:-1] & (np.abs(np.diff(q, axis=0)) <= LIMIT_ROUNDING)
    return np.asarray(free & ~rests), np.asarray((on[1:] != on[:-1]).any(axis=1))


def _derivatives_before(
    chain: Chain,
    path: LineArcPath,
    s: FloatArray,
    q: FloatArray,
    moves: BoolArray,
    after: JointPathDerivatives,
) -> JointPathDerivatives:
    """Return the derivatives at the end of each interval: those after it, unless they may step there."""
    steps = np.append((moves[1:] != moves[:-1]).any(axis=1), True)
    steps |= np.isin(s[1:], np.append(path.bounds, path.at))
    stepped = _joint_path_derivatives(chain, path, q[1:][steps], s[1:][steps], moves[steps], before=True)
    dq, ddq = np.roll(after.dq, -1, axis=0), np.roll(after.ddq, -1, axis=0)
    dq[steps], ddq[steps] = stepped.dq, stepped.ddq
    return JointPathDerivatives(q[1:], dq, ddq)


@dataclass(frozen=True, slots=True, eq=False)
class JointLimits:
    """Maximum rates and accelerations of joints, and of the tool along its path.

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


class _Bounds(NamedTuple):
    """Limits of n intervals: |u + slope x| <= max_u, shape (n, k), and x <= max_x at their ends, (n + 1,)."""

    slope: FloatArray
    max_u: FloatArray
    max_x: FloatArray


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
        after: Derivatives at the begin of each interval, n rows.
        before: Derivatives at the end of each interval, n rows; they step at the bounds of segments.
        stop: Whether the path stops, shape (n + 1,); the first and the last are stops.
        limits: Of joints and tool.

    Source: [PhamPham2018]_.
    """
    step = np.diff(s)
    bounds = _interval_bounds(step, after, before, limits)
    x = _two_passes(step, bounds, stop)
    v = np.sqrt(x)
    moves = v[1:] + v[:-1] > 0.0
    with np.errstate(divide="ignore"):
        durations = 2.0 * step / (v[1:] + v[:-1])
    rows = (durations, s[:-1], v[:-1], 0.5 * np.diff(x) / step)
    phases: list[Phase] = []
    for i, row in enumerate(zip(*(part.tolist() for part in rows), strict=True)):
        phases += [Phase(*row)] if moves[i] else _rest_to_rest(bounds, i, float(s[i]), float(step[i]))
    return TimeLaw(phases)


def _interval_bounds(
    step: FloatArray, after: JointPathDerivatives, before: JointPathDerivatives, limits: JointLimits
) -> _Bounds:
    """Return the bounds that limits set at both ends of each interval, of lengths in [m], shape (n,).

    At its end x + 2 step u replaces x: |(dq + 2 step ddq) u + ddq x| <= a.
    """
    along = np.hstack((after.dq, before.dq + 2.0 * step[:, None] * before.ddq))
    across = np.hstack((after.ddq, before.ddq))
    limit = np.tile(limits.acceleration, 2)
    max_x = np.full(len(step) + 1, limits.speed**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        for dq, ends in ((after.dq, slice(None, -1)), (before.dq, slice(1, None))):
            rate = np.square(limits.velocity / np.abs(dq)).min(axis=1)
            max_x[ends] = np.minimum(max_x[ends], rate)
        moves = np.abs(along) > STATIONARY_RATE
        curved = np.where(moves | (across == 0.0), np.inf, limit / np.abs(across)).min(axis=1)
        slope = np.where(moves, across / along, 0.0)
        max_u = np.where(moves, limit / np.abs(along), np.inf)
    max_x[:-1] = np.minimum(max_x[:-1], curved)
    tool = np.zeros((len(step), 1))
    return _Bounds(np.hstack((slope, tool)), np.hstack((max_u, tool + limits.tangential)), max_x)


def _two_passes(step: FloatArray, bounds: _Bounds, stop: BoolArray) -> FloatArray:
    """Return x in [m2/s2] on the grid, shape (n + 1,); 0 at stops."""
    half = 0.5 / step
    limit = np.where(stop, 0.0, bounds.max_x)
    limit[:-1] = np.minimum(limit[:-1], _max_feasible_x(bounds, half))
    for i in range(len(step) - 1, -1, -1):  # the smallest allowed u has to lead to limit[i + 1] or below
        steepness = half[i] - bounds.slope[i]
        rising = steepness > 0.0
        reach = (limit[i + 1] * half[i] + bounds.max_u[i])[rising] / steepness[rising]
        limit[i] = min(limit[i], reach.min(initial=np.inf))
    x = np.zeros(len(step) + 1)
    for i in range(len(step)):
        u = (bounds.max_u[i] - bounds.slope[i] * x[i]).min()
        x[i + 1] = max(min(x[i] + 2.0 * step[i] * u, limit[i + 1]), 0.0)
    return x


def _max_feasible_x(bounds: _Bounds, half: FloatArray) -> FloatArray:
    """Return the largest x at which some u is allowed that leaves x + 2 step u at 0 or above, shape (n,).

    Each pair of bounds has to leave room: -max_u_j - slope_j x <= max_u_k - slope_k x.
    """
    slope = np.hstack((bounds.slope, half[:, None]))
    max_u = np.hstack((bounds.max_u, np.zeros((len(half), 1))))
    difference = bounds.slope[:, None, :] - slope[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        room = (bounds.max_u[:, None, :] + max_u[:, :, None]) / difference
    return np.asarray(np.where(difference > 0.0, room, np.inf).min(axis=(1, 2)))


def _rest_to_rest(bounds: _Bounds, i: int, s: float, step: float) -> list[Phase]:
    """Return the phases of an interval from s in [m], at rest at both ends: up to its middle, then down.

    With u constant x rises to u step: |u + slope x| <= max_u holds where u (1 + |slope| step) <= max_u.
    """
    u = float((bounds.max_u[i] / (1.0 + np.abs(bounds.slope[i]) * step)).min())
    u = min(u, float(bounds.max_x[i : i + 2].min()) / step)
    half = math.sqrt(step / u)
    return [Phase(half, s, 0.0, u), Phase(half, s + 0.5 * step, u * half, -u)]


def joint_limited_law(joints: PathJoints, speed: float = np.inf, tangential: float = np.inf) -> TimeLaw:
    """Return the law in the least time within the rates and accelerations of the joints.

    The limits hold on the grid of the joints; between its points they are exceeded by less than the effect of
    the squared step. Where the rates of the joints step, at a step of the tool's rate of rotation or where a
    joint comes to a limit, the path stops: no finite acceleration follows that.

    Args:
        joints: The joints along a path that the arm reaches everywhere.
        speed: Additional maximum s' in [m/s]; infinity for none.
        tangential: Additional maximum s'' in [m/s2]; infinity for none.
    """
    path = joints.path
    uneven = () if path.orientation is None else path.at[path.orientation.uneven_rows]
    stop = np.isin(joints.s, np.append(path.stops, uneven))
    stop[joints.rate_steps] = True
    limits = _arm_limits(joints.chain, speed, tangential)
    return time_optimal_law(joints.s, joints.after, joints.before, stop, limits)


def _arm_limits(chain: Chain, speed: float = np.inf, tangential: float = np.inf) -> JointLimits:
    velocity = np.array([joint.velocity for joint in chain.moving])
    acceleration = np.array([joint.acceleration for joint in chain.moving])
    return JointLimits(velocity, acceleration, speed, tangential)


class LimitUtilisation(NamedTuple):
    """The maximum utilisation of a limit along a path.

    Attributes:
        share: max(|q'| / limit, sqrt(|q''| / limit)) [-]: with speeds divided by it the limit holds.
        s: Its arc length in [m].
        joint: Index of the moving joint, from 0.
    """

    share: float
    s: float
    joint: int


def max_limit_utilisation(joints: PathJoints, law: TimeLaw, *, between: bool = False) -> LimitUtilisation:
    """Return the maximum utilisation of a joint's limit by a law.

    It is searched in the middle and just inside both ends of each interval of the grid, and before and after
    the boundaries of phases of the law: rates and accelerations step at both.

    Args:
        joints: The joints along a path that the arm reaches everywhere.
        law: The law.
        between: Whether only the middles are searched, because the law holds the limits on the grid.

    Source: [Iso9283]_ section 4, steps 17 and 18.
    """
    limits = _arm_limits(joints.chain)
    if not np.isfinite([limits.velocity, limits.acceleration]).any():
        return LimitUtilisation(0.0, 0.0, 0)
    s, margin = joints.s, INTERVAL_MARGIN * np.diff(joints.s)
    middle = 0.5 * (s[1:] + s[:-1])
    largest = [_utilisation(joints.at(middle), law.at(law.time_at(middle)), limits)]
    if not between:
        for derivatives, places in ((joints.after, s[:-1] + margin), (joints.before, s[1:] - margin)):
            largest.append(_utilisation(derivatives, law.at(law.time_at(places)), limits))
        sides = np.concatenate((law.ends * (1.0 - PHASE_MARGIN), law.ends * (1.0 + PHASE_MARGIN)))
        motion = law.at(np.minimum(sides, law.duration))
        largest.append(_utilisation(joints.at(np.clip(motion.s, 0.0, s[-1])), motion, limits))
    return max(largest)


def _utilisation(
    derivatives: JointPathDerivatives, motion: PathMotion, limits: JointLimits
) -> LimitUtilisation:
    """Return the maximum utilisation of a limit at n points."""
    rates, accelerations = derivatives.rates(motion.v, motion.a)
    share = np.maximum(np.abs(rates) / limits.velocity, np.sqrt(np.abs(accelerations) / limits.acceleration))
    place, joint = np.unravel_index(int(share.argmax()), share.shape)
    return LimitUtilisation(float(share[place, joint]), float(motion.s[place]), int(joint))
