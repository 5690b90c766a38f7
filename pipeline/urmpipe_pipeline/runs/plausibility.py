"""Whether a log can be the motion of an arm: its first and last row, repeated rows, limits and speeds.

- `JointMotion`: values, times, steps and the resolution of the number format.
- `find_end_outliers`: a first or last row that is off the motion of the others.
- `mean_repeats`, `repeated_sample_warnings`: values that stay the same for several rows.
- `limit_warnings`, `speed_warning`: joints that leave their limits or move faster than they can.

The values stay as they are: each check returns warnings. A check is silent where noise, the number format of
the file or an uneven clock explains the values.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, row_blocks
from urmpipe_models.errors import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.logs.timestamps import MAX_JOINT_SPEED
from urmpipe_pipeline.repolarization.interval import fold_rows

JOINT_LIMIT = "joint-limit"
SPEED_LIMIT = "speed-limit"

MAX_RESOLUTION = 0.02  # rad or m, of a number format: whole degrees are finer
OUTLIER_RATIO = 5.0  # step to an outlier / largest step between the other rows
MIN_OUTLIER_STEP = 0.01  # rad or m, in addition to the resolution of the number format
MAX_DECELERATION = 100.0  # rad/s2 or m/s2; no joint of an arm reaches it, a smaller one may be a hard start
MIN_ROWS = 10  # of a log in which a row can be an outlier
MIN_RUNS = 10  # runs of repeated rows that make a pattern
MIN_EVEN_SHARE = 0.95  # share of the runs of about equal length if the controller is slow
MAX_RUN_RATIO = 3  # length of a run / usual length; longer runs are an arm at rest
OVERSHOOT = 1.1  # speed / limit; a controller may pass a nominal limit by a tenth
NOISE_RATIO = 5.0  # noise step / median second difference; one in a million is larger (Gaussian: 5.8 sigma)
LIMIT_SLACK = 0.005  # rad or m, since robot files round limits: 6.28 is 0.0032 below a turn


class JointMotion(NamedTuple):
    """The motion of a log that the checks use.

    Attributes:
        names: Names of the joints.
        units: rad or m of each joint.
        q: Repolarized joint values in [rad] or [m], shape (n, joints), n > 1; NaN where one is missing.
        t_ns: Times in integer [ns], strictly increasing, shape (n,).
        period: Median time between rows in [s].
        inner_max_step: Largest step of each joint between rows other than the first and the last, in [rad] or
            [m], shape (joints,); NaN if a value is missing.
        resolution: Resolution of the number format of each joint in [rad] or [m], shape (joints,).
        file_row: Data row of the file of a row, both from 1.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    q: FloatArray
    t_ns: IntArray
    period: float
    inner_max_step: FloatArray
    resolution: FloatArray
    file_row: Callable[[int], int]

    @classmethod
    def of(cls, log: JointLog, q: FloatArray, revolute: BoolArray) -> JointMotion:
        """Return the motion of a log.

        Args:
            log: The log.
            q: Its repolarized joint values in [rad] or [m], shape (n, joints).
            revolute: Which joints are revolute, shape (joints,).
        """
        inner = largest_steps(q[1:-1]) if len(q) > 3 else np.zeros(q.shape[1])
        units = tuple("rad" if turns else "m" for turns in revolute)
        return cls(log.joints, units, q, log.t_ns, log.period, inner, format_resolution(log), log.file_row)

    @property
    def ends(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """The first and the last row, each with its neighbour."""
        last = len(self.q) - 1
        return (0, 1), (last, last - 1)


def largest_steps(q: FloatArray) -> FloatArray:
    """Return the largest step of each column from row to row, shape (joints,); NaN if a value is missing.

    Steps and q, shape (n, joints), n > 1, are in [rad] or [m].
    """
    blocks = row_blocks(len(q) - 1)
    steps = [fold_rows(np.maximum, np.abs(q[1:][block] - q[:-1][block])) for block in blocks]
    return np.asarray(np.max(steps, axis=0))


def format_resolution(log: JointLog) -> FloatArray:
    """Return the resolution of the number format of each joint in [rad] or [m], shape (joints,).

    It is inferred from samples of the values: from the decimals that are enough for all of them, or from the
    significant digits of a quantised file; 0 for a format with more than four decimals.
    """
    columns = {column.name: column for column in log.columns if column.role == "joint"}
    rows = np.linspace(0, len(log.q) - 1, 256).astype(np.int64)
    resolution = np.zeros(len(log.joints))
    for j, name in enumerate(log.joints):
        if name in columns:
            factor, offset = columns[name].factor, columns[name].offset
            numbers = log.q[rows, j] / factor - offset  # the sign does not matter
            in_file = _number_resolution(numbers[~np.isnan(numbers)], log.digits)
            resolution[j] = min(in_file * factor, MAX_RESOLUTION)
    return resolution


def _number_resolution(numbers: FloatArray, digits: int | None) -> float:
    if digits is not None:
        largest = np.abs(numbers).max(initial=0.0)
        return float(10.0 ** (np.floor(np.log10(largest)) + 1 - digits)) if largest > 0.0 else 0.0
    for decimals in range(5):
        scaled = numbers * 10.0**decimals
        if np.allclose(scaled, np.rint(scaled), rtol=0.0, atol=1e-6):
            return float(10.0**-decimals)
    return 0.0


def plausibility_warnings(
    log: JointLog,
    q: FloatArray,
    robot: Chain | None,
    revolute: BoolArray,
    reported: IntArray,
    *,
    timed: bool,
    tsp: float = 0.0,
) -> list[LogWarning]:
    """Return warnings about implausible motion: outliers, repeated samples, limits, speeds.

    Args:
        log: The log.
        q: Its repolarized joint values in [rad] or [m], shape (n, joints).
        robot: The arm, with its limits; None if it is unknown.
        revolute: Which joints are revolute (the others are prismatic), shape (joints,).
        reported: Row and joint index of steps that other warnings report, shape (u, 2).
        timed: Whether the times are those of the motion; else speeds are not checked.
        tsp: Period of the grid in [s]: if values stay the same no longer than that, it takes each of them
            once.
    """
    if len(q) < 2 or not q.shape[1]:
        return []
    motion = JointMotion.of(log, q, revolute)
    outliers = find_end_outliers(motion)
    repeats = mean_repeats(motion)
    warnings = [*outlier_warnings(motion, outliers), *repeated_sample_warnings(motion, repeats, tsp)]
    if robot is not None:
        warnings += _limit_warnings(motion, robot)
    if timed:
        outlier_steps = np.maximum(outliers, (1, 0))  # a step has the index of the row that it ends in
        limits = speed_limits(robot, revolute)
        reported = np.vstack((reported, outlier_steps))
        warnings += speed_warning(motion, limits, reported, repeats * motion.period)
    return warnings


def find_end_outliers(motion: JointMotion) -> IntArray:
    """Return row and joint index, shape (k, 2), where the first or last row is off the motion of the others.

    The step there is larger than `OUTLIER_RATIO` times any other step of the joint, and takes a larger
    acceleration than an arm has.
    """
    q, t_ns = motion.q, motion.t_ns
    outliers = [np.empty((0, 2), dtype=np.int64)]
    for row, neighbour in motion.ends if len(q) >= MIN_ROWS else ():
        dt = max(abs(int(t_ns[row]) - int(t_ns[neighbour])) / 1e9, motion.period)
        threshold = np.maximum(OUTLIER_RATIO * motion.inner_max_step, MAX_DECELERATION * dt**2)
        threshold = np.maximum(MIN_OUTLIER_STEP + motion.resolution, threshold)
        joints = np.flatnonzero(np.abs(q[row] - q[neighbour]) > threshold)  # never if values are missing: NaN
        outliers.append(np.column_stack((np.full(len(joints), row), joints)))
    return np.concatenate(outliers)


def outlier_warnings(motion: JointMotion, outliers: IntArray) -> list[LogWarning]:
    """Return a warning for each end with outliers: which joints, and their steps.

    Outliers are row and joint index, shape (k, 2), as from `find_end_outliers`.
    """
    q, warnings = motion.q, []
    for row, neighbour in motion.ends:
        joints = outliers[outliers[:, 0] == row, 1].tolist()
        if joints:
            steps = ", ".join(
                f"{motion.names[j]} by {abs(q[row, j] - q[neighbour, j]):.4g} {motion.units[j]}"
                f" (other steps: at most {motion.inner_max_step[j]:.4g})"
                for j in joints
            )
            message = f"an outlier, off the motion of the other rows: {steps}"
            message += "; it is kept; remove it from the file if the arm was not there"
            warnings.append(LogWarning("outlier-last" if row else "outlier-first", message, row + 1))
    return warnings


def mean_repeats(motion: JointMotion) -> float:
    """Return the mean number of rows for which the values of a moving arm stay equal; 1 without a pattern.

    More than 1 is a slow controller that is polled fast: its differences are stairs. An arm at rest makes few
    runs of repeated rows, all long. Coarse numbers of a slow motion change by one digit, in one joint at a
    time.
    """
    changes = np.flatnonzero(~_is_repeated(motion.q))
    runs = np.diff(changes)
    usual = float(np.median(runs)) if len(runs) >= MIN_RUNS else 1.0
    if usual < 2.0:
        return 1.0
    moving = runs <= MAX_RUN_RATIO * usual
    even = (runs >= 2) & (np.abs(runs - usual) <= max(1.0, usual / 4))
    if moving.sum() < MIN_RUNS or even[moving].mean() < MIN_EVEN_SHARE:
        return 1.0
    steps = np.abs(motion.q[changes + 1] - motion.q[changes])
    together = ((steps > 0.0).sum(axis=1) > 1).mean() >= MIN_EVEN_SHARE
    small, large = np.quantile(np.fmax.reduce(steps, axis=1), (0.1, 0.9))
    return float(runs[moving].mean()) if together or large > 1.5 * small else 1.0


def repeated_sample_warnings(motion: JointMotion, repeats: float, tsp: float) -> list[LogWarning]:
    """Return a warning if values stay equal for several rows (`mean_repeats`) and longer than tsp in [s]."""
    time = repeats * motion.period
    period = float(f"{time:.4g}")
    if repeats == 1.0 or tsp >= period:
        return []
    repeated = _is_repeated(motion.q)
    message = f"the joint values change only every {repeats:.3g} rows ({time * 1e3:.4g} ms)"
    message += f", {int(repeated.sum())} of {len(motion.q)} rows repeat the row before"
    message += ": the log may be sampled faster than the controller runs"
    hints = (Hint("tsp", period, "takes each value once"),)
    return [LogWarning("repeated-samples", message, int(np.argmax(repeated)) + 2, hints=hints)]


def _is_repeated(q: FloatArray) -> BoolArray:
    """Return which rows, from the second on, equal the row before in every joint."""
    same: BoolArray = q[1:, 0] == q[:-1, 0]
    for j in range(1, q.shape[1]):
        if not same.any():
            break
        same &= q[1:, j] == q[:-1, j]
    return same


def limit_warnings(log: JointLog, q: FloatArray, robot: Chain) -> list[LogWarning]:
    """Return one warning about the joints of a log that leave the limits of an arm, or none.

    Joint values are in [rad] or [m], shape (n, joints).
    """
    revolute = np.array([joint.kind == "revolute" for joint in robot.moving])
    return _limit_warnings(JointMotion.of(log, q, revolute), robot)


def _limit_warnings(motion: JointMotion, robot: Chain) -> list[LogWarning]:
    q, slack = motion.q, LIMIT_SLACK + motion.resolution
    lower, upper = np.array([(joint.lower, joint.upper) for joint in robot.moving]).T
    if not np.isfinite((lower, upper)).any():
        return []
    is_within = (fold_rows(np.minimum, q) >= lower - slack) & (fold_rows(np.maximum, q) <= upper + slack)
    excesses = []
    for j in np.flatnonzero(~is_within).tolist():  # also the columns with missing values: NaN
        beyond = np.maximum(lower[j] - q[:, j], q[:, j] - upper[j])
        rows = np.flatnonzero(beyond > slack[j])
        if len(rows):
            worst = int(rows[np.argmax(beyond[rows])])
            limits = f"its limits of {lower[j]:.6g} to {upper[j]:.6g} {motion.units[j]}"
            message = f"{motion.names[j]} is beyond {limits} in {len(rows)} of {len(q)} rows"
            message += f", at worst {q[worst, j]:.6g} in row {motion.file_row(worst + 1)}"
            excesses.append(_Excess(motion.names[j], rows, float(beyond[worst]), message))
    return (
        [LogWarning(JOINT_LIMIT, *_join_excesses(excesses, "row", "check robot, unit, sign and zero"))]
        if excesses
        else []
    )


def speed_limits(robot: Chain | None, revolute: BoolArray) -> FloatArray:
    """Return the speed limit of each joint in [rad/s] or [m/s], shape (joints,).

    It is that of the robot, else `MAX_JOINT_SPEED` for revolute joints, shape (joints,), else inf.
    """
    fallback = np.where(revolute, MAX_JOINT_SPEED, np.inf)
    if robot is None:
        return fallback
    limits = np.array([joint.velocity for joint in robot.moving])
    return np.where(np.isfinite(limits), limits, fallback)


def speed_warning(
    motion: JointMotion, limits: FloatArray, reported: IntArray, period: float
) -> list[LogWarning]:
    """Return one warning about the joints that move faster than their limits, or none.

    Args:
        motion: The motion.
        limits: Speed limits in [rad/s] or [m/s], shape (joints,).
        reported: Row and joint index of steps that other warnings report, shape (u, 2).
        period: Usual period in [s], used for rows closer in time: their clock is assumed to be uneven.
    """
    q = motion.q
    end_steps = (np.abs(q[row] - q[neighbour]) for row, neighbour in motion.ends)
    largest = np.max([motion.inner_max_step, *end_steps], axis=0)
    is_slow = largest <= OVERSHOOT * limits * period + motion.resolution
    suspects = np.flatnonzero(~is_slow).tolist()  # also the columns with missing values: NaN
    dt = np.maximum(np.diff(motion.t_ns) / 1e9, period) if suspects else np.empty(0)
    excesses = []
    for j in suspects:
        steps, second = np.abs(np.diff(q[:, j])), np.abs(np.diff(q[:, j], 2))
        second = second[~np.isnan(second)]
        noise = NOISE_RATIO * float(np.median(second)) if len(second) else 0.0
        fast = steps > OVERSHOOT * limits[j] * dt + motion.resolution[j] + noise
        fast[reported[reported[:, 1] == j, 0] - 1] = False
        rows = np.flatnonzero(fast)
        if len(rows):
            speeds = steps[rows] / dt[rows]
            unit = f"{motion.units[j]}/s"
            message = f"{motion.names[j]} moves faster than {limits[j]:.4g} {unit}"
            message += f" in {len(rows)} of {len(steps)} steps"
            worst = motion.file_row(int(rows[np.argmax(speeds)]) + 2)
            message += f", at worst at {speeds.max():.4g} {unit} to row {worst}"
            excesses.append(_Excess(motion.names[j], rows + 1, float(speeds.max() / limits[j]), message))
    return (
        [LogWarning(SPEED_LIMIT, *_join_excesses(excesses, "step", "check robot, unit and clock"))]
        if excesses
        else []
    )


class _Excess(NamedTuple):
    """Rows, from 0, in which a joint exceeds a limit, the largest excess, and its description."""

    name: str
    rows: IntArray
    largest: float
    message: str


def _join_excesses(excesses: list[_Excess], noun: str, advice: str) -> tuple[str, int]:
    """Return the message of a warning, with the description of the worst joint, and its row, the first."""
    worst = max(excesses, key=lambda excess: excess.largest)
    joints = [
        f"{excess.name} ({format_count(len(excess.rows), noun)})"
        for excess in excesses
        if excess is not worst
    ]
    message = f"{worst.message}; also {text.join_list(joints)}" if joints else worst.message
    row = min(int(excess.rows[0]) for excess in excesses) + 1
    return f"{message}: {advice}", row
