"""Whether a log can be the motion of an arm: its first and last row, repeated rows, limits and speeds.

- `JointMotion`: values, times, steps and the resolution of the number format.
- `find_end_outliers`: a first or last row that is off the motion of the others.
- `mean_repeats`, `repeated_sample_warnings`: values that stay the same for several rows.
- `limit_warnings`, `speed_warning`: joints that leave their limits or move faster than they can.

The values stay as they are: each check returns warnings. A check is silent where noise, the number format of
the file or an uneven clock explains what it sees.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray, row_blocks
from urmpipe_models.errors import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.repolarization.interval import fold_rows
from urmpipe_pipeline.sources.units.unit_evidence import FASTEST

COARSEST = 0.02
"""No number format is taken to be coarser than this in [rad] or [m]: whole degrees are finer."""


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """What the checks look at.

    Attributes:
        names: The joints.
        units: rad or m for each.
        q: Joint values, repolarized, in [rad] or [m], shape (n, joints), n > 1; NaN where one is missing.
        t_ns: Times in [ns], shape (n,), strictly increasing.
        period: Median time between rows in [s].
        inner: Largest step of each joint between rows other than the first and the last, in [rad] or [m],
            shape (joints,); NaN where a value is missing.
        fineness: How far apart the file's number format lets two values of each joint be, in [rad] or [m],
            shape (joints,).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    q: FloatArray
    t_ns: IntArray
    period: float
    inner: FloatArray
    fineness: FloatArray

    @classmethod
    def of(cls, log: JointLog, q: FloatArray, turning: NDArray[np.bool_]) -> JointMotion:
        """Return the motion of a log.

        Its joints, repolarized, are in [rad] or [m], shape (n, joints); which turn, shape (joints,).
        """
        inner = largest_steps(q[1:-1]) if len(q) > 3 else np.zeros(q.shape[1])
        units = tuple("rad" if turns else "m" for turns in turning)
        return cls(log.joints, units, q, log.t_ns, log.period, inner, format_steps(log))

    @property
    def ends(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """The first and the last row, each with the row beside it."""
        last = len(self.q) - 1
        return (0, 1), (last, last - 1)


def largest_steps(q: FloatArray) -> FloatArray:
    """Return the largest step of each column from row to row, shape (joints,); NaN if a value is missing.

    Steps and q, shape (n, joints), n > 1, are in [rad] or [m].
    """
    blocks = row_blocks(len(q) - 1)
    steps = [fold_rows(np.maximum, np.abs(q[1:][block] - q[:-1][block])) for block in blocks]
    return np.asarray(np.max(steps, axis=0))


def format_steps(log: JointLog) -> FloatArray:
    """Return how far apart the file's number format lets two values of a joint be, in SI, shape (joints,).

    Seen in samples of the values: the decimals that they all get by with, or the significant digits where
    the file was seen to be quantised; 0 for a format that is finer than matters.
    """
    columns = {column.name: column for column in log.columns if column.role == "joint"}
    rows = np.linspace(0, len(log.q) - 1, 256).astype(np.int64)
    steps = np.zeros(len(log.joints))
    for j, name in enumerate(log.joints):
        if name in columns:
            factor, offset = columns[name].factor, columns[name].offset
            written = log.q[rows, j] / factor - offset  # but for the sign
            steps[j] = min(_format_step(written[~np.isnan(written)], log.digits) * factor, COARSEST)
    return steps


def _format_step(written: FloatArray, digits: int | None) -> float:
    """Return the step of the format of some values in the file's own unit."""
    if digits is not None:
        largest = np.abs(written).max(initial=0.0)
        return float(10.0 ** (np.floor(np.log10(largest)) + 1 - digits)) if largest > 0.0 else 0.0
    for decimals in range(5):
        scaled = written * 10.0**decimals
        if np.allclose(scaled, np.rint(scaled), rtol=0.0, atol=1e-6):
            return float(10.0**-decimals)
    return 0.0


JOINT_LIMIT = "joint-limit"
SPEED_LIMIT = "speed-limit"

FAR = 5.0
"""An outlying end is further off than so many times the largest step between the other rows."""

LEAST_STEP = 0.01
"""A step below this in [rad] or [m], beside that of the number format, makes no outlier."""

MAX_DECELERATION = 100.0
"""Acceleration in [rad/s2] or [m/s2] that no joint of an arm reaches: a smaller one may be a hard start."""

LEAST_ROWS = 10
"""A log of fewer rows tells too little of the motion to call one of them an outlier."""

LEAST_RUNS = 10
"""So many runs of repeated rows make a pattern."""

EVEN_SHARE = 0.95
"""Share of the runs of repeated rows that are about equally long where a controller is slow."""

REST = 3
"""A run of repeated rows so many times longer than the usual one is an arm that stands still."""

OVERSHOOT = 1.1
"""A controller may pass a nominal limit of speed by a tenth."""

NOISE = 5.0
"""Times the median second difference: no noise step in a million is larger (Gaussian noise: 5.8 sigma)."""

ROUNDED_LIMIT = 0.005
"""Robot files round their limits, in [rad] or [m]: 6.28 is 0.0032 short of a turn."""


def plausibility_warnings(
    log: JointLog,
    q: FloatArray,
    robot: Chain | None,
    turning: NDArray[np.bool_],
    told: NDArray[np.int64],
    *,
    timed: bool,
    tsp: float = 0.0,
) -> list[LogWarning]:
    """Return what an arm would hardly have done.

    Args:
        log: The log.
        q: Its joint values, repolarized, in [rad] or [m], shape (n, joints).
        robot: The arm, with its limits; None if it is not known.
        turning: Which joints turn (the others slide), shape (joints,).
        told: Row and joint index of steps that a warning speaks of already, shape (u, 2).
        timed: Whether the times are those of the motion; else nothing is said of speeds.
        tsp: Period of the grid in [s]: one as long as values stay takes each of them once.
    """
    if len(q) < 2 or not q.shape[1]:
        return []
    motion = JointMotion.of(log, q, turning)
    outliers = find_end_outliers(motion)
    held = mean_repeats(motion)
    warnings = [*outlier_warnings(motion, outliers), *repeated_sample_warnings(motion, held, tsp)]
    if robot is not None:
        warnings += _beyond_limits(motion, robot)
    if timed:
        steps = np.maximum(outliers, (1, 0))  # a step belongs to the row that it ends in
        limits = speed_limits(robot, turning)
        warnings += speed_warning(motion, limits, np.vstack((told, steps)), held * motion.period)
    return warnings


def find_end_outliers(motion: JointMotion) -> NDArray[np.int64]:
    """Return row and joint index, shape (k, 2), where the first or last row is off the motion of the others.

    It is if the joint steps there by more than `FAR` times what it does anywhere else, and starts or stops
    harder than an arm can.
    """
    q, t_ns = motion.q, motion.t_ns
    found = [np.empty((0, 2), dtype=np.int64)]
    for row, beside in motion.ends if len(q) >= LEAST_ROWS else ():
        dt = max(abs(int(t_ns[row]) - int(t_ns[beside])) / 1e9, motion.period)
        least = np.maximum(
            LEAST_STEP + motion.fineness, np.maximum(FAR * motion.inner, MAX_DECELERATION * dt**2)
        )
        joints = np.flatnonzero(np.abs(q[row] - q[beside]) > least)  # never where values are missing: NaN
        found.append(np.column_stack((np.full(len(joints), row), joints)))
    return np.concatenate(found)


def outlier_warnings(motion: JointMotion, outliers: NDArray[np.int64]) -> list[LogWarning]:
    """Return a warning for each end that is an outlier: which joints are off, and by how much.

    Outliers are row and joint index, shape (k, 2), as `find_end_outliers` returns them.
    """
    q, warnings = motion.q, []
    for row, beside in motion.ends:
        joints = outliers[outliers[:, 0] == row, 1].tolist()
        if joints:
            steps = ", ".join(
                f"{motion.names[j]} by {abs(q[row, j] - q[beside, j]):.4g} {motion.units[j]}"
                f" (other steps: at most {motion.inner[j]:.4g})"
                for j in joints
            )
            said = f"an outlier, off the motion of the other rows: {steps}"
            said = f"{said}; it is kept; remove it from the file if the arm was not there"
            warnings.append(LogWarning("outlier-last" if row else "outlier-first", said, row + 1))
    return warnings


def mean_repeats(motion: JointMotion) -> float:
    """Return how many rows a moving arm's values stay bit for bit the same, on average; 1 where they do not.

    More than 1 is a slow controller polled fast: its differences are stairs. An arm at rest makes few runs
    of repeated rows, all long; where the numbers are coarse for a slow motion, they change by a digit, one
    joint here, one there.
    """
    changes = np.flatnonzero(~_repeats(motion.q))
    runs = np.diff(changes)
    usual = float(np.median(runs)) if len(runs) >= LEAST_RUNS else 1.0
    if usual < 2.0:
        return 1.0
    moving = runs <= REST * usual
    even = (runs >= 2) & (np.abs(runs - usual) <= max(1.0, usual / 4))
    if moving.sum() < LEAST_RUNS or even[moving].mean() < EVEN_SHARE or not _in_one_go(motion.q, changes):
        return 1.0
    return float(runs[moving].mean())


def repeated_sample_warnings(motion: JointMotion, rows: float, tsp: float) -> list[LogWarning]:
    """Return a warning if values stay for several rows, as `mean_repeats` returns, longer than tsp in [s]."""
    time = rows * motion.period
    once = float(f"{time:.4g}")
    if rows == 1.0 or tsp >= once:
        return []
    repeats = _repeats(motion.q)
    said = f"the joint values change only every {rows:.3g} rows ({time * 1e3:.4g} ms)"
    count = f"{int(repeats.sum())} of {len(motion.q)} rows repeat the row before"
    said = f"{said}, {count}: a slow controller polled fast?"
    hints = (Hint("tsp", once, "takes each value once"),)
    return [LogWarning("repeated-samples", said, int(np.argmax(repeats)) + 2, hints=hints)]


def _repeats(q: FloatArray) -> NDArray[np.bool_]:
    """Tell which rows, from the second on, are the row before in every joint."""
    same: NDArray[np.bool_] = q[1:, 0] == q[:-1, 0]
    for j in range(1, q.shape[1]):
        if not same.any():
            break
        same &= q[1:, j] == q[:-1, j]
    return same


def _in_one_go(q: FloatArray, changes: NDArray[np.int64]) -> bool:
    """Tell whether the joints change together, or by steps of several sizes, and not digit by digit."""
    steps = np.abs(q[changes + 1] - q[changes])
    together = ((steps > 0.0).sum(axis=1) > 1).mean() >= EVEN_SHARE
    small, large = np.quantile(np.fmax.reduce(steps, axis=1), (0.1, 0.9))
    return bool(together or large > 1.5 * small)


def limit_warnings(log: JointLog, q: FloatArray, robot: Chain) -> list[LogWarning]:
    """Return a warning for each joint of a log that leaves the limits of an arm.

    Its joint values are in [rad] or [m], shape (n, joints).
    """
    turning = np.array([joint.kind == "revolute" for joint in robot.moving])
    return _beyond_limits(JointMotion.of(log, q, turning), robot)


def _beyond_limits(motion: JointMotion, robot: Chain) -> list[LogWarning]:
    """Return a warning if joints leave their limits: which, how often, where first, where worst."""
    q, slack = motion.q, ROUNDED_LIMIT + motion.fineness
    lower, upper = np.array([(joint.lower, joint.upper) for joint in robot.moving]).T
    if not np.isfinite((lower, upper)).any():
        return []
    kept = (fold_rows(np.minimum, q) >= lower - slack) & (fold_rows(np.maximum, q) <= upper + slack)
    found = []
    for j in np.flatnonzero(~kept).tolist():  # also the columns where values are missing: NaN
        beyond = np.maximum(lower[j] - q[:, j], q[:, j] - upper[j])
        rows = np.flatnonzero(beyond > slack[j])
        if len(rows):
            worst = int(rows[np.argmax(beyond[rows])])
            limits = f"its limits of {lower[j]:.6g} to {upper[j]:.6g} {motion.units[j]}"
            where = f"in {len(rows)} of {len(q)} rows, at worst {q[worst, j]:.6g} in row {worst + 1}"
            said = f"{motion.names[j]} is beyond {limits} {where}"
            found.append(_OfJoint(motion.names[j], rows, float(beyond[worst]), said))
    check = "check robot, unit, sign and zero"
    return [LogWarning(JOINT_LIMIT, *_in_one(found, "row", check))] if found else []


def speed_limits(robot: Chain | None, turning: NDArray[np.bool_]) -> FloatArray:
    """Return the largest speed of each joint in [rad/s] or [m/s], shape (joints,).

    It is the robot's, else `FASTEST` for one that turns, shape (joints,), else inf.
    """
    fallback = np.where(turning, FASTEST, np.inf)
    if robot is None:
        return fallback
    own = np.array([joint.velocity for joint in robot.moving])
    return np.where(np.isfinite(own), own, fallback)


def speed_warning(
    motion: JointMotion, limits: FloatArray, told: NDArray[np.int64], period: float
) -> list[LogWarning]:
    """Return a warning if joints step faster than they can: which, how often, where first, where worst.

    Rows closer in time than the usual period in [s] are taken to be that far apart: it is their clock that
    hurries. Limits are in [rad/s] or [m/s], shape (joints,); steps that a warning speaks of already are row
    and joint index, shape (u, 2).
    """
    q = motion.q
    largest = np.max([motion.inner, *(np.abs(q[row] - q[beside]) for row, beside in motion.ends)], axis=0)
    suspects = np.flatnonzero(~(largest <= OVERSHOOT * limits * period + motion.fineness)).tolist()
    dt = np.maximum(np.diff(motion.t_ns) / 1e9, period) if suspects else np.empty(0)
    found = []
    for j in suspects:
        steps = np.abs(np.diff(q[:, j]))
        fast = steps > OVERSHOOT * limits[j] * dt + motion.fineness[j] + _noise(q[:, j])
        fast[told[told[:, 1] == j, 0] - 1] = False
        rows = np.flatnonzero(fast)
        if len(rows):
            speeds = steps[rows] / dt[rows]
            worst = f"at worst at {speeds.max():.4g} {motion.units[j]}/s to row {rows[np.argmax(speeds)] + 2}"
            said = f"{motion.names[j]} moves faster than {limits[j]:.4g} {motion.units[j]}/s"
            said = f"{said} in {len(rows)} of {len(steps)} steps, {worst}"
            found.append(_OfJoint(motion.names[j], rows + 1, float(speeds.max() / limits[j]), said))
    return [LogWarning(SPEED_LIMIT, *_in_one(found, "step", "check robot, unit and clock"))] if found else []


class _OfJoint(NamedTuple):
    """What is odd of a joint: in which rows, how odd at worst, and said in words."""

    name: str
    rows: NDArray[np.int64]
    worst: float
    said: str


def _in_one(found: list[_OfJoint], place: str, check: str) -> tuple[str, int]:
    """Return what is odd of some joints in one sentence, the worst in words, and the first row from 1."""
    worst = max(found, key=lambda one: one.worst)
    others = [f"{one.name} ({text.counted(len(one.rows), place)})" for one in found if one is not worst]
    said = f"{worst.said}; also {text.enumerated(others)}" if others else worst.said
    return f"{said}: {check}", min(int(one.rows[0]) for one in found) + 1


def _noise(column: FloatArray) -> float:
    """Return how large a step is that noise alone may make, from what is not smooth in a column."""
    second = np.abs(np.diff(column, 2))
    second = second[~np.isnan(second)]
    return NOISE * float(np.median(second)) if len(second) else 0.0
