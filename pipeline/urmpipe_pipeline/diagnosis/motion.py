"""The motion of a side over time, with derivatives, and its joints with the causes of an explanation.

1. Derivatives of the samples: by five samples, or by as many as keep the noise small (`motion_of`).
2. Look-up at the times of the compared rows on the side's clock, each joint at its time (`Motion.joints`).
3. Edits (`runs.reading_errors`), then the parameters of each joint:
   q + offset + scale q + compliance q'' + play / 2 sign(q') + sag times the torque of gravity.
4. A servo with time constant T follows T y' + y = x (`first_order_lag`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import inverse_dynamics
from urmpipe_models.elementwise import BoolArray, Element, FloatArray, IntArray, dot, scale
from urmpipe_models.kinematics.forward import jacobian
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, has_masses
from urmpipe_pipeline.runs.reading_errors import Edits

MOVING = 5.0  # joint velocity over its noise; exceeded by chance less than once in a million
STANDARD_GRAVITY = 9.80665  # [m/s2]
WEIGHTLESS = 1e-9  # [N m] or [N]: rounding of the torque about a vertical axis
SHIFTING_TIME = ("time_lag", "clock_drift", "joint_lag")

STENCIL = 5  # samples of a rate; the rate of three would leave h^2 x''' / 6
STENCIL_NOISE = (
    0.95,
    1.12,
)  # of both derivatives by five samples, per noise of a sample and power of the step
MAX_NOISE = 0.05  # rms of a derivative that the noise of the samples causes, over that of the derivative
MIN_WINDOWS = 20  # in a log: no derivative uses a larger part of it


class Clock(NamedTuple):
    """The times of the compared rows on the clock of the modelled side, and how an offset moves them.

    t_reference = t_log + offset + drift t: if the log is modelled, a time of the reference corresponds to an
    earlier one of the log.

    Attributes:
        t: Times of the rows on the modelled side's clock in [s], shape (n,); of static poses their rows.
        direction: -1 if the log is modelled, 1 if the reference is.
        since: Times of the rows from the first sample of the log in [s], shape (n,).
    """

    t: FloatArray
    direction: float
    since: FloatArray

    def at(self, state: State, groups: Sequence[Group], rows: IntArray) -> FloatArray:
        """Return the times at which rows are looked up, in [s], shape of rows."""
        lag, drift = (
            sum(float(state.of(g)[0]) for g in groups if g.kind == kind)
            for kind in ("time_lag", "clock_drift")
        )
        return np.asarray(self.t[rows] + self.direction * (lag + drift * self.since[rows]))

    def flow(self, group: Group, rows: IntArray) -> Element:
        """Return the change of the times of rows, shape (n,), in [s] per unit of a lag or a drift."""
        return self.direction * (1.0 if group.kind == "time_lag" else self.since[rows])


class Joints(NamedTuple):
    """Joints of some rows with the causes of an explanation.

    Attributes:
        q: In [rad] or [m], shape (joints, n).
        rate: q' in [rad/s] or [m/s], shape (joints, n).
        edited: q after the edits alone in [rad] or [m], shape (joints, n).
        second: q'' of that in [rad/s2] or [m/s2], shape (joints, n).
        inside: Which rows lie within the time of their side, shape (n,).
        servo_rate: q' in [rad/s] or [m/s] by which a servo lag moves the joints, shape (joints, n).
        direction: Returns the direction of a joint's present or last motion, shape (n,): 1 or -1; 0 if it
            never moves.
        torque: Returns the static torque of gravity on a joint in [N m] or [N], shape (n,); of an arm without
            masses for each [kg] at its tool centre point.
    """

    q: FloatArray
    rate: FloatArray
    edited: FloatArray
    second: FloatArray
    inside: BoolArray
    servo_rate: FloatArray
    direction: Callable[[int], FloatArray]
    torque: Callable[[int], FloatArray]

    def factors(self, group: Group, clock: Clock, rows: IntArray) -> Iterator[tuple[int, Element]]:
        """Yield the joints that a parameter of a group moves, and dq / dx at rows, shape (n,)."""
        if group.kind == "servo_lag":
            yield from ((j, -clock.direction * rate) for j, rate in enumerate(self.servo_rate))
        elif group.joint is None:
            by = clock.flow(group, rows)
            yield from ((j, rate * by) for j, rate in enumerate(self.rate))
        else:
            yield group.joint, self._factor(group.kind, group.joint, clock)

    def _factor(self, kind: str, j: int, clock: Clock) -> Element:
        if kind == "joint_scale":
            return self.edited[j]
        if kind == "compliance":
            return self.second[j]
        if kind == "joint_lag":  # of the modelled joint, on either side
            return -self.rate[j]
        if kind == "backlash":
            return 0.5 * self.direction(j)
        return self.torque(j) if kind == "sag" else 1.0


@dataclass(frozen=True, eq=False)
class Motion:
    """Values over time, with their derivatives.

    Attributes:
        t: Times in [s], ascending, shape (m,).
        value: In any unit, shape (k, m).
        rate: First derivative, in that unit a second [s], shape (k, m).
        second: Second derivative, in that unit a second squared [s2], shape (k, m).
        noise: Root mean square noise of the first derivative, in its unit, shape (k,); None if there is none.
    """

    t: FloatArray
    value: FloatArray
    rate: FloatArray
    second: FloatArray
    noise: FloatArray | None = None
    _directions: dict[tuple[Edits, int], FloatArray] = field(default_factory=dict, init=False)
    _torques: dict[Edits, tuple[FloatArray, BoolArray]] = field(default_factory=dict, init=False)
    _outputs: dict[float, tuple[Motion, Motion, Motion]] = field(default_factory=dict, init=False)

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return value, rate and second derivative at some times, and which lie within the samples' times.

        x(t) = x_i + x'_i dt + x''_i dt^2 / 2 from the nearest sample keeps the variance of the noise, which a
        line between two samples would halve.

        Args:
            t: Times in [s], shape (n,).

        Returns:
            The first three in their units, shape (k, n), and which times lie within and have all values,
            shape (n,): a column without effect at first may have one in an explanation.
        """
        nearest = self.nearest(t)
        dt = t - self.t[nearest]
        value, rate, second = (part[:, nearest] for part in (self.value, self.rate, self.second))
        edge = 0.5 * (self.t[-1] - self.t[0]) / max(len(self.t) - 1, 1)
        inside = (t >= self.t[0] - edge) & (t <= self.t[-1] + edge) & np.isfinite(value).all(axis=0)
        if dt.any():
            value = value + dt * (rate + 0.5 * dt * second)
            rate = rate + dt * second
        return value, rate, second, np.asarray(inside)

    def nearest(self, t: FloatArray) -> IntArray:
        """Return the sample nearest to each of some times in [s], shape (n,)."""
        after = np.clip(np.searchsorted(self.t, t), min(1, len(self.t) - 1), len(self.t) - 1)
        before = np.maximum(after - 1, 0)
        return np.asarray(np.where(t - self.t[before] <= self.t[after] - t, before, after))

    def joints(
        self,
        state: State,
        groups: Sequence[Group],
        clock: Clock,
        sample: IntArray,
        rows: IntArray,
        chain: Chain | None,
    ) -> Joints:
        """Return the joints of some rows with the causes of an explanation.

        Args:
            state: The explanation.
            groups: The groups of its parameters.
            clock: The times of all rows.
            sample: Rows of the log, shape (n,).
            rows: Indices of the rows, shape (k,).
            chain: The arm that sags under gravity; None if there is no group of sag.
        """
        at = clock.at(state, groups, rows)
        edits = tuple(edit for edit in state.edits if edit.joints)
        parameters = [(group, float(state.values[group.columns[0]])) for group in groups if not group.twists]
        parameters = [(group, value) for group, value in parameters if value]
        lags = {group.joint: value for group, value in parameters if group.kind == "joint_lag"}
        edited, edited_rate, second, inside = self._look_up(edits, at, sample[rows], lags)
        nearest = cache(partial(self.nearest, at))
        q, rate = edited.copy(), edited_rate.copy()
        joints = Joints(
            q, rate, edited, second, inside, edited_rate.copy(),
            partial(self._direction, edits, clock, sample, nearest),
            partial(self._torque, edits, clock, sample, nearest, chain),
        )  # fmt: skip
        for group, value in parameters:
            if group.kind in SHIFTING_TIME:
                continue
            if group.kind == "servo_lag" and clock.direction * value > 0.0:
                parts = self._filtered(clock.direction * value)
                (x, x_rate), (y, y_rate), (_, servo_rate) = (
                    part._look_up(edits, at, sample[rows], lags)[:2] for part in parts
                )
                q += y - x
                rate += y_rate - x_rate
                joints.servo_rate[:] = servo_rate
                continue
            for j, factor in joints.factors(group, clock, rows):
                q[j] += value * factor
            if group.kind == "joint_scale":
                rate[group.joint] += value * edited_rate[group.joint]
            elif group.kind == "servo_lag":
                ahead = -clock.direction * value
                rate += ahead * second
        return joints

    def _filtered(self, constant: float) -> tuple[Motion, Motion, Motion]:
        """Return x, the output y of a servo with a time constant T in [s], and y with -dy / dT as its rate.

        y = x - T x' + T^2 z, z being the servo's output for x''; y' = x' - T z, and -dy / dT is the output
        for y'. The motions of the last constant are kept.
        """
        parts = self._outputs.get(constant)
        if parts is None:
            second = first_order_lag(self.t, self.second, constant)
            rate = self.rate - constant * second
            value = self.value - constant * self.rate + constant**2 * second
            slope = rate - constant * first_order_lag(self.t, second, constant)
            parts = (
                Motion(self.t, self.value, self.rate, self.second),
                Motion(self.t, value, rate, second),
                Motion(self.t, value, slope, second),
            )
            self._outputs.clear()
            self._outputs[constant] = parts
        return parts

    def _look_up(
        self, edits: Edits, at: FloatArray, log_rows: IntArray, lags: Mapping[int | None, float]
    ) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return `_edited` with some joints at earlier times, by a lag in [s] each."""
        *parts, inside = self._edited(edits, at, log_rows)
        for joint, lag in lags.items():
            *lagging, known = self._edited(edits, at - lag, log_rows)
            for part, lagged in zip(parts, lagging, strict=True):
                part[joint] = lagged[joint]
            inside = inside & known
        value, rate, second = parts
        return value, rate, second, inside

    def _edited(
        self, edits: Edits, at: FloatArray, log_rows: IntArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return `at` after edits, with the log's rows at these times."""
        q, rate, second, inside = self.at(at)
        for edit in edits:
            q, rate, second = edit.of_joints(log_rows, q, rate, second)
        return q, rate, second, inside

    def _direction(
        self, edits: Edits, clock: Clock, sample: IntArray, nearest: Callable[[], IntArray], j: int
    ) -> FloatArray:
        """Return the direction of a joint's present or last motion at some samples, shape of these.

        It moves where its rate exceeds the noise; before that, the direction is that of its first motion. The
        rate is that of three samples: one of five overshoots before a corner.
        """
        if not any(j in edit.joints for edit in edits):
            edits = ()
        if (edits, j) not in self._directions:
            rate = self.value if len(self.t) < 2 else np.gradient(self.value, self.t, axis=1)
            noise = np.zeros(len(rate)) if self.noise is None else self.noise  # of five samples: more
            parts = np.diag(noise)  # a joint that includes another has both noises
            for edit in edits:
                log_rows = self._log_rows(clock, sample, np.arange(len(self.t)))
                rate = edit.of_joints(log_rows, rate, rate)[1]
                parts = edit.of_joints(np.arange(len(noise)), parts, parts)[1]
            moves = np.abs(rate[j]) > MOVING * np.linalg.norm(parts[j])
            last = np.maximum.accumulate(np.where(moves, np.arange(len(moves)), np.argmax(moves)))
            self._directions[edits, j] = np.sign(rate[j, last]) * moves[last]
        return self._directions[edits, j][nearest()]

    def _torque(
        self,
        edits: Edits,
        clock: Clock,
        sample: IntArray,
        nearest: Callable[[], IntArray],
        chain: Chain | None,
        j: int,
    ) -> FloatArray:
        """Return the static torque of gravity on a joint at some samples, each computed once."""
        assert chain is not None  # without an arm there is no group of sag
        if edits not in self._torques:
            self._torques[edits] = np.zeros_like(self.value), np.zeros(len(self.t), dtype=bool)
        torques, known = self._torques[edits]
        at = nearest()
        new = np.unique(at[~known[at]])
        if len(new):
            q = self.value[:, new]
            for edit in edits:
                (q,) = edit.of_joints(self._log_rows(clock, sample, new), q)
            torques[:, new] = gravity_torques(chain, q)
            known[new] = True
        return np.asarray(torques[j, at])

    def _log_rows(self, clock: Clock, sample: IntArray, at: IntArray) -> IntArray:
        """Return the rows of the log nearest in time to some samples, shape of `at`."""
        return sample[np.minimum(np.searchsorted(clock.t, self.t[at]), len(sample) - 1)]


def first_order_lag(t: FloatArray, values: FloatArray, constant: float) -> FloatArray:
    """Return y [-] with T y' + y = x, in lines between samples, y = x at the first, shape (k, m).

    y_i+1 = e y_i + (1 - e) x_i + (x_i+1 - x_i) (1 - (1 - e) T / h), e = exp(-h / T): a scan in log2(m) steps.

    Args:
        t: Times in [s], shape (m,).
        values: x in any unit, shape (k, m).
        constant: T in [s], above 0.
    """
    step = np.maximum(np.diff(t), np.finfo(float).tiny)
    fade = np.append(0.0, np.exp(-step / constant))
    part = 1.0 - (1.0 - fade[1:]) * constant / step
    gain = np.append(values[:, :1], (1.0 - fade[1:]) * values[:, :-1] + part * np.diff(values), axis=1)
    reach = 1
    while reach < len(t):
        gain[:, reach:] = gain[:, reach:] + fade[reach:] * gain[:, :-reach]
        fade = np.append(fade[:reach], fade[reach:] * fade[:-reach])
        reach *= 2
    return gain


def gravity_torques(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the torques that the joints of an arm at rest need against gravity, shape (joints, n).

    Args:
        chain: The arm; without masses, the torques are those of 1 kg at its tool centre point.
        q: Joints in [rad] or [m], shape (joints, n).

    Returns:
        In [N m] of revolute joints, in [N] of prismatic ones.
    """
    still = [0.0] * len(q)
    if has_masses(chain):
        torques = inverse_dynamics(chain, [*q], still, still)
    else:
        upward = scale(-STANDARD_GRAVITY / max(math.hypot(*chain.gravity), WEIGHTLESS), chain.gravity)
        torques = [dot(upward, column[:3]) for column in jacobian(chain, [*q])]
    result = np.empty_like(q)
    for row, torque in zip(result, torques, strict=True):
        row[:] = torque
    return np.asarray(np.where(np.abs(result) < WEIGHTLESS, 0.0, result))


def motion_of(t: FloatArray | None, values: FloatArray) -> Motion:
    """Return samples as a motion, with derivatives from enough of them to keep their noise small.

    Noise of q'' repeats that of q: it would be taken for the compliance of a joint. If it is still too large,
    or the rows are too far from each other, q'' is 0: it is unknown.

    Args:
        t: Times in [s], shape (m,); None without times, and then without derivatives.
        values: In any unit, shape (k, m); NaN where a sample is missing.
    """
    count = values.shape[1]
    none = np.zeros_like(values)
    if t is None or count < 3:
        return Motion(np.arange(count, dtype=float) if t is None else t, values, none, none)
    rate, second, noise = none, none.copy(), np.zeros(len(values))
    for k, row in enumerate(values):
        known = np.isfinite(row)
        if known.sum() > 3:
            filled = np.interp(t, t[known], row[known])
            (rate[k], noise[k]), (curvature, left) = (_derivative(t, filled, order) for order in (1, 2))
            second[k] = curvature if left <= MAX_NOISE * np.sqrt(np.mean(curvature**2)) else 0.0
    return Motion(t, values, rate, second, noise)


def _derivative(t: FloatArray, values: FloatArray, order: int) -> tuple[FloatArray, float]:
    """Return the first or second derivative, by means of as few samples as its noise allows, and its noise.

    Fifth differences remove the motion; their variance is 252 times that of a sample. If the noise is small,
    a rate is that of five samples, and so is the rate of rates.
    """
    noise = float(np.sqrt(np.mean(np.diff(values, 5) ** 2) / 252.0)) if len(values) > STENCIL else 0.0
    reach = 1
    while True:
        mean = _mean(values, reach)
        derivative = _by_stencil(t, mean, order) if reach == 1 else _by_difference(t, mean, reach, order)
        step = reach * float(np.median(np.diff(t)))
        gain = STENCIL_NOISE[order - 1] if reach == 1 else np.sqrt((0.5, 6.0)[order - 1] / reach)
        left = noise * gain / step**order
        if left <= MAX_NOISE * float(np.sqrt(np.mean(derivative**2))) or 2 * reach * MIN_WINDOWS > len(t):
            return derivative, float(left)
        reach *= 2


def _by_stencil(t: FloatArray, values: FloatArray, order: int) -> FloatArray:
    """Return the first or second derivative by five samples, or by three of fewer."""
    joined = np.ones(len(t) - 1, dtype=bool)
    if len(t) < STENCIL:
        return np.asarray(np.gradient(values, t)) if order == 1 else _by_difference(t, values, 1, order)
    derivative = values[np.newaxis]
    for _ in range(order):
        derivative, _ = five_point_rates(t, derivative, joined)
    return np.asarray(derivative[0])


def _mean(values: FloatArray, width: int) -> FloatArray:
    """Return the moving mean over `width` samples, fewer at the ends."""
    if width < 2:
        return values
    index = np.arange(len(values))
    low, high = np.maximum(index - width // 2, 0), np.minimum(index + (width + 1) // 2, len(values))
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray((total[high] - total[low]) / (high - low))


def _by_difference(t: FloatArray, values: FloatArray, reach: int, order: int) -> FloatArray:
    """Return a derivative by the values `reach` samples before and after, at the ends that of the nearest."""
    middle = np.arange(reach, len(t) - reach)
    before, after = middle - reach, middle + reach
    back, ahead = t[middle] - t[before], t[after] - t[middle]
    slopes = (values[middle] - values[before]) / back, (values[after] - values[middle]) / ahead
    inner = (
        (slopes[0] * ahead + slopes[1] * back) / (back + ahead)
        if order == 1
        else 2.0 * (slopes[1] - slopes[0]) / (back + ahead)
    )
    return np.pad(inner, reach, mode="edge")


def five_point_rates(t: FloatArray, x: FloatArray, joined: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return rates [1/s], shape (k, m), NaN where fewer than five samples are joined, and noise gains.

    With d_j the time from a sample to the four others, x' = sum_j w_j (x_j - x),
    w_j = 1 / d_j prod_(i != j) d_i / (d_i - d_j). The gain is the norm of all five weights in [1/s].

    Args:
        t: Times in [s], shape (m,).
        x: Samples in any unit [-], shape (k, m).
        joined: Which samples a motion connects to the next one, shape (m - 1,).

    Returns:
        Rates in that unit per [s], shape (k, m), and gains in [1/s], shape (m,).
    """
    count, pairs = len(t), range(STENCIL - 1)
    if count < STENCIL:
        return np.full(x.shape, np.nan), np.zeros(count)
    index = np.arange(count)
    first, last = _run_ends(joined)
    start = np.clip(index - STENCIL // 2, first, np.maximum(last - STENCIL + 1, first))
    start = np.minimum(start, count - STENCIL)  # of a short run, which has no rate
    neighbours = [start + j + (start + j >= index) for j in pairs]
    d = [t[neighbour] - t for neighbour in neighbours]
    rate, squares, total = np.zeros_like(x), np.zeros(count), np.zeros(count)
    for j in pairs:
        weight = 1.0 / d[j]
        for i in pairs:
            weight *= d[i] / (d[i] - d[j]) if i != j else 1.0
        for k, values in enumerate(x):
            rate[k] += weight * (values[neighbours[j]] - values)
        squares += weight**2
        total += weight
    rate[:, last - first + 1 < STENCIL] = np.nan
    return rate, np.sqrt(squares + total**2)


def _run_ends(joined: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the first and the last sample of each sample's run of connected ones, shape (m,)."""
    ends = np.append(np.flatnonzero(~joined), len(joined))
    starts = np.append(0, ends[:-1] + 1)
    run = np.searchsorted(ends, np.arange(len(joined) + 1))
    return starts[run], ends[run]
