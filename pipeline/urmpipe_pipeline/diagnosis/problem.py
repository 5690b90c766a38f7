"""The diagnosis problem of two sides: model, data, hypotheses, and what the data cannot test.

1. The model: joints on both sides, joints and an arm on one, or a tool centre point on both
   (`build_problem`).
2. The data at the rows of the log. A comparison joins the samples of a reference by lines, which are h^2 x''
   / 8 from a curved motion. That is part of a verdict, but no cause: causes are fitted to cubics through the
   same samples, with the error that remains (`interpolate_reference`).
   - The rate at a sample is that of the polynomial of degree 4 through the five nearest ones: exact to h^4.
   - Two samples and their rates give a cubic (Hermite). It is local, and may be used at uneven times.
   - The deviation of the log shows whether lines are nearer, as they are if the reference is a polygon.
   - Cubics through every second sample show how far cubics are from the motion.
3. The noise that rounding of the columns leaves: step / sqrt(12) (`_rounding`).
4. The hypotheses: groups of parameters, edits, and those that these sides cannot show (`NotLookedFor`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, spread_rows
from urmpipe_models.kinematics.forward import jacobian, positions_over_log
from urmpipe_models.math3d import Transform, to_matrices
from urmpipe_pipeline import text
from urmpipe_pipeline.diagnosis.causes import STRUCTURE, UntestedCauses
from urmpipe_pipeline.diagnosis.hypotheses import (
    Group,
    assign_columns,
    base_groups,
    cause_groups,
    joint_groups,
    time_groups,
    tool_groups,
)
from urmpipe_pipeline.diagnosis.models import TOOL, ArmModel, JointModel, TcpModel
from urmpipe_pipeline.diagnosis.motion import STENCIL, Clock, Motion, five_point_rates, motion_of
from urmpipe_pipeline.joint_log import has_gap_after
from urmpipe_pipeline.runs.grid import ROUNDING_NS
from urmpipe_pipeline.runs.reading_errors import (
    Edits,
    axis_edits,
    coupling_edits,
    joint_unit_edits,
    robot_edits,
    sign_edits,
    swap_edits,
    unit_edits,
)
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import Matched, Side, Trajectory, reference_rows

AT_REST = 3e-4  # [m] or [rad]; three times the span of a UR5e logged at rest for 25 s, 0.10 mm and 0.10 mrad
MIN_ORIENTED = 0.5  # fraction of the rows with orientations on both sides from which on these count
MAX_STEP_VALUES = 2000  # of a column, from which its step is determined
STEP_DIVISORS = (1, 2, 5, 10)  # steps in the least distance of two values
MULTIPLE_TOLERANCE = 0.01  # of a step, up to which a value is a multiple of it

MAX_NOISE_GAIN = 12.0  # rate times step: 0.95 at even times, 5.6 at an end; above, samples are too close
REFINEMENT = 4.0  # error at twice the step / error: 16 if smooth, 4 where the acceleration jumps
MIN_CUBIC_GAIN = 1.0  # rms difference of cubics from a motion, over the noise of a sample, for their use
MAX_PLACES = 2000  # between samples, where that is measured
STRAIGHT = 0.5  # lines are used if they leave less than this fraction of the mean square of cubics

JOINTS = (
    "joint_sign", "joints_swapped", "joint_unit", "joint_coupled", "half_turn", "mirrored",
    "joint_offset", "joint_scale", "joint_lag", "servo_lag", "compliance", "backlash", "sag",
)  # fmt: skip
FRAMES = ("base_shift", "base_rotation", "tool_shift", "tool_rotation")
TIME = ("time_lag", "clock_drift", "servo_lag", "joint_lag", "compliance", "backlash")


class Problem(NamedTuple):
    """The model and the hypotheses of a diagnosis.

    Attributes:
        model: The side that is modelled, with the data of the other.
        edits: Discrete causes, alone or together.
        is_revolute: Shape (joints,); empty without joints.
        log_joints: Names of the joints by the log.
        arm_joints: Names of the joints by the arm; by the log without one.
        rounding: Error of rounding and interpolation of each component in [m] or [rad], rms, shape (c,).
        forced: Groups that are unknown, and always fitted.
        sign: 1 if the model is the log's, -1 if it is the reference's: of the residual, as reference - log.
        untested: Causes that these sides cannot show, and why.
    """

    model: ArmModel | JointModel | TcpModel
    edits: tuple[Edits, ...]
    is_revolute: tuple[bool, ...]
    log_joints: tuple[str, ...]
    arm_joints: tuple[str, ...]
    rounding: FloatArray
    forced: tuple[int, ...]
    sign: float
    untested: tuple[UntestedCauses, ...]


def build_problem(matched: Matched, reference: Side, log: Side) -> Problem:
    """Return the diagnosis problem of two sides at the same times."""
    reference = reference._replace(trajectory=reference_rows(reference, log))
    if reference.by_joints and log.by_joints and matched.reference_q is not None:
        return _joint_problem(matched, reference, log)
    if log.by_joints or reference.by_joints:
        return _arm_problem(matched, reference, log)
    return _tcp_problem(matched, reference, log)


def _joint_problem(matched: Matched, reference: Side, log: Side) -> Problem:
    """Return the problem of joints on both sides."""
    run, names = log.run, log.run.log.joints
    sliding = tuple(unit == "m" for unit in run.joint_units)
    units = ["m" if is_sliding else "rad" for is_sliding in sliding]
    groups = assign_columns(joint_groups(units, names, run.robot, timed=run.timed))
    samples, lines = np.asarray(reference.trajectory.q), np.asarray(matched.reference_q)
    if {*reference.trajectory.joints} == {*names}:
        samples = samples[:, [reference.trajectory.joints.index(name) for name in names]]
    q = interpolate_reference(matched, reference.trajectory, samples, lines, np.asarray(matched.actual_q))
    judged = None
    if q.between or run.robot != reference.run.robot:
        judged = _judged_reference(matched, reference, log)
    model = JointModel(
        groups,
        _joint_motion(run),
        _clock(matched, run, of_log=True),
        matched.sample,
        q.values.T.copy(),
        sliding,
        run.robot,
        judged,
    )
    untested = [
        UntestedCauses(
            (*STRUCTURE, *FRAMES, "base_mirrored", "path_unit", "other_robot"),
            _why_joints_show_no_arm(reference, log),
        )
    ]
    if run.robot is None:
        untested.append(UntestedCauses(("sag",), "without a robot gravity is unknown"))
    is_revolute = tuple(not is_sliding for is_sliding in sliding)
    return Problem(
        model=model,
        edits=(
            *sign_edits(len(sliding), most=len(sliding)),
            *swap_edits(len(sliding)),
            *joint_unit_edits(is_revolute),
            *coupling_edits(is_revolute),
        ),
        is_revolute=is_revolute,
        log_joints=names,
        arm_joints=_arm_joints(run),
        rounding=np.sqrt(_rounding(run.on_rows.q, run) ** 2 + _rounding(samples, run) ** 2 + q.error**2),
        forced=(),
        sign=1.0,
        untested=(*untested, *_unknown_rates(run, model.motion)),
    )


def _why_joints_show_no_arm(reference: Side, log: Side) -> str:
    """Return why joints on both sides show nothing of arm, base and tool, and what would."""
    recorded = [side.run.name for side in (reference, log) if side.run.log.tcp_position is not None]
    if not recorded:
        return "joints on both sides do not show them, and neither side recorded a tool centre point"
    compared = (
        f"{' and '.join(recorded)}, diagnosed alone, {'is' if len(recorded) == 1 else 'are'} compared with"
    )
    return f"joints on both sides do not show them: {compared} the recorded tool centre point"


def _arm_problem(matched: Matched, reference: Side, log: Side) -> Problem:
    """Return the problem of joints on one side: arm, joints and clock."""
    modelled, other = (log, reference) if log.by_joints else (reference, log)
    run, robot = modelled.run, modelled.run.robot
    assert robot is not None  # a side without kinematics has no positions by its joints
    place = _reference_position(matched, reference)
    position, quat = (
        (place.values, matched.reference_quat) if log.by_joints else (matched.actual, matched.actual_quat)
    )
    rotation = _orientations(quat)
    names, timed = run.log.joints, log.run.timed
    frames_open = other.run.log.externally_measured
    groups = assign_columns(cause_groups(robot, names, has_rotation=rotation is not None, timed=timed))
    clock = _clock(matched, log.run, of_log=log.by_joints)
    motion, lines = _joint_motion(run), matched.reference
    if place.between and not log.by_joints:
        q, trajectory = np.asarray(reference.trajectory.q), reference.trajectory
        cubics = Cubics.through(trajectory.t_ns, q, trajectory.discontinuities)
        motion = SparseMotion(motion.t, motion.value, motion.rate, motion.second, motion.noise, cubics=cubics)
        lines = position + positions_over_log(robot, motion.at(clock.t)[0].T) - lines
    judged = lines.T.copy() if place.between and not frames_open else None
    model = ArmModel(
        robot, groups, motion, clock, matched.sample, position.T.copy(), rotation, frames_open, judged
    )
    rounding = np.sqrt(
        _rounding(other.trajectory.position, run) ** 2
        + place.error**2
        + _propagate(model, _rounding(run.on_rows.q, run)) ** 2
    )
    count, is_revolute = len(robot.moving), tuple(joint.kind == "revolute" for joint in robot.moving)
    edits = (
        *sign_edits(count, most=2 if frames_open else count),
        *swap_edits(count),
        *joint_unit_edits(is_revolute),
        *coupling_edits(is_revolute),
        *axis_edits(base_known=not frames_open),
        *robot_edits(robot),
    )
    edits += () if frames_open else tuple(unit_edits("reference" if log.by_joints else "log"))
    untested = [UntestedCauses(("turns",), "only joints on both sides show them")]
    if rotation is None:
        untested.append(UntestedCauses(("tool_rotation",), "a side has no orientation"))
    if frames_open:
        reason = "externally measured: the frames of base and tool are unknown"
        untested.append(UntestedCauses((*FRAMES, "path_unit"), reason))
    return Problem(
        model=model,
        edits=edits,
        is_revolute=is_revolute,
        log_joints=names,
        arm_joints=_arm_joints(run),
        rounding=np.concatenate((rounding, np.zeros(len(model.blocks) - 3))),
        forced=tuple(g for g, group in enumerate(groups) if frames_open and _is_full_frame(group)),
        sign=1.0 if log.by_joints else -1.0,
        untested=(*untested, *_unknown_rates(run, motion)),
    )


def _tcp_problem(matched: Matched, reference: Side, log: Side) -> Problem:
    """Return the problem of a tool centre point on both sides, without joints."""
    run, trajectory = log.run, log.trajectory
    is_oriented = _orientations(matched.actual_quat) is not None
    rotation = _orientations(matched.reference_quat) if is_oriented else None
    tool = tool_groups(Transform(), TOOL, has_rotation=rotation is not None) if is_oriented else ()
    groups = assign_columns([*tool, *base_groups(Transform()), *(time_groups() if run.timed else ())])
    place = _reference_position(matched, reference)
    turns = None if trajectory.quat_xyzw is None or not is_oriented else _matrices(trajectory.quat_xyzw)
    model = TcpModel(
        groups,
        motion_of(trajectory.t if run.timed else None, trajectory.position.T),
        turns,
        _clock(matched, run, of_log=True),
        matched.sample,
        place.values.T.copy(),
        rotation,
        matched.reference.T.copy() if place.between else None,
    )
    rounding = np.sqrt(
        _rounding(reference.trajectory.position, run) ** 2
        + _rounding(matched.actual, run) ** 2
        + place.error**2
    )
    untested = [UntestedCauses((*STRUCTURE, *JOINTS, "turns", "other_robot"), "no side has joints")]
    if not is_oriented:
        untested.append(UntestedCauses(("tool_shift", "tool_rotation"), "the log has no orientation"))
    elif rotation is None:
        untested.append(UntestedCauses(("tool_rotation",), "the reference has no orientation"))
    return Problem(
        model=model,
        edits=(*axis_edits(base_known=True), *unit_edits("reference", "log")),
        is_revolute=(),
        log_joints=(),
        arm_joints=(),
        rounding=np.concatenate((rounding, np.zeros(len(model.blocks) - 3))),
        forced=(),
        sign=1.0,
        untested=(*untested, *_unknown_rates(run)),
    )


def _is_full_frame(group: Group) -> bool:
    return group.kind in FRAMES and group.axis is None


def _judged_reference(matched: Matched, reference: Side, log: Side) -> FloatArray:
    """Return a reference with joints as it is judged: its positions, else those of the log's arm."""
    robot, q = log.run.robot, np.asarray(matched.reference_q)
    if robot is None:
        return q.T.copy()
    if robot != reference.run.robot or np.isfinite(matched.reference).all():
        return matched.reference.T.copy()
    return positions_over_log(robot, q).T.copy()


def _arm_joints(run: Run) -> tuple[str, ...]:
    return run.log.joints if run.robot is None else run.robot.coordinates


def _unknown_rates(run: Run, motion: Motion | None = None) -> Iterator[UntestedCauses]:
    """Yield that static poses show nothing of time, and which joints of a log have unknown accelerations."""
    if not run.timed:
        yield UntestedCauses(TIME, "static poses have no time")
    elif motion is not None:
        moves = np.fmax.reduce(motion.value, axis=1) - np.fmin.reduce(motion.value, axis=1) > AT_REST
        unknown = np.flatnonzero(moves & ~motion.second.any(axis=1)).tolist()
        if unknown:
            names = text.join_list([run.log.joints[j] for j in unknown])
            yield UntestedCauses(
                ("compliance",), f"the rows do not show how {names} accelerate{'s' * (len(unknown) == 1)}"
            )


def _clock(matched: Matched, run: Run, *, of_log: bool) -> Clock:
    """Return the times of the compared rows on the clock of the modelled side."""
    if not run.timed:
        return Clock(matched.sample.astype(float), -1.0, np.zeros(len(matched.sample)))
    since = matched.t_ns / 1e9
    return Clock(since, -1.0, since) if of_log else Clock(since + matched.sync.offset, 1.0, since)


def _joint_motion(run: Run) -> Motion:
    """Return the joints of a run on its log's rows, with their rates if they have times."""
    rows = run.on_rows
    motion = motion_of(rows.t_ns / 1e9 if run.timed else None, rows.q.T)
    return with_cubics(motion, rows.t_ns, rows.q) if run.timed else motion


def _orientations(quat: FloatArray | None) -> FloatArray | None:
    """Return orientations as matrices, shape (3, 3, n); None if too few rows have one."""
    if quat is None or np.isfinite(quat).all(axis=1).mean() <= MIN_ORIENTED:
        return None
    return _matrices(quat)


def _matrices(quat: FloatArray) -> FloatArray:
    return to_matrices(quat).transpose(1, 2, 0).copy()


def _rounding(values: FloatArray, run: Run) -> FloatArray:
    """Return the rms error of rounding to the steps in which columns are written, shape (k,).

    Static poses are chosen in round numbers, which are exact.
    """
    if not run.timed:
        return np.zeros(values.shape[1])
    some = values[:: max(len(values) // MAX_STEP_VALUES, 1)]
    steps = np.array([_step(column[np.isfinite(column)]) for column in some.T])
    return np.asarray(steps / np.sqrt(12.0))


def _step(values: FloatArray) -> float:
    """Return the step of which all values are multiples: the least distance, or a part of it; else 0."""
    distances = np.diff(np.unique(values))
    for divisor in STEP_DIVISORS if len(distances) else ():
        step = float(distances.min()) / divisor
        if np.abs(values / step - np.rint(values / step)).max() < MULTIPLE_TOLERANCE:
            return step
    return 0.0


def _propagate(model: ArmModel, rounding: FloatArray) -> FloatArray:
    """Return the error of positions in [m] due to that of the joints, shape (3,)."""
    rows = spread_rows(model.rows, 100)
    q = model.motion.at(model.clock.t[rows])[0]
    columns = np.array([[np.nanmean(np.square(part * np.ones(len(rows)))) for part in column[:3]]
                        for column in jacobian(model.chain, list(q))])  # fmt: skip
    return np.asarray(np.sqrt((columns * rounding[:, np.newaxis] ** 2).sum(axis=0)))


class Interpolated(NamedTuple):
    """A reference at the rows of a log.

    Attributes:
        values: The data to which causes are fitted in [m] or [rad], shape (n, k).
        error: Root mean square error of the interpolation in [m] or [rad], shape (k,).
        between: Whether rows of the log are between the samples of the reference.
    """

    values: FloatArray
    error: FloatArray
    between: bool


class Cubics(NamedTuple):
    """A cubic between each two samples: ((c3 u + c2) u + c1) u + c0, u the time after the first of them.

    Attributes:
        t: Times of the samples in [s], shape (m,).
        coefficients: c0 to c3 in any unit per power of [s], shape (4, k, m - 1).
    """

    t: FloatArray
    coefficients: FloatArray

    @classmethod
    def through(cls, t_ns: IntArray, values: FloatArray, broken: IntArray | None = None) -> Cubics:
        """Return the cubics through samples; a line where these do not give a rate.

        Args:
            t_ns: Times in integer [ns], strictly increasing, shape (m,), m > 1.
            values: In any unit, shape (m, k).
            broken: Samples that no motion connects to the next one, shape (b,).
        """
        t, x, joined = t_ns / 1e9, np.ascontiguousarray(values.T), _joined(t_ns, broken)
        step = np.diff(t)
        secant = np.diff(x) / step
        rate, gain = five_point_rates(t, x, joined)
        known = np.where(joined, step, 0.0)
        longer = np.maximum(np.append(0.0, known), np.append(known, 0.0))
        rate[:, gain * longer > MAX_NOISE_GAIN] = np.nan
        first, last = (np.where(np.isfinite(part), part, secant) for part in (rate[:, :-1], rate[:, 1:]))
        curved = (first + last - 2.0 * secant) / step
        return cls(t, np.array([x[:, :-1], first, (secant - first) / step - curved, curved / step]))

    def at(self, t: FloatArray) -> FloatArray:
        """Return values at times in [s], shape (n,), in their unit, shape (k, n)."""
        before = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        u = t - self.t[before]
        c0, c1, c2, c3 = self.coefficients
        return np.asarray(((c3[:, before] * u + c2[:, before]) * u + c1[:, before]) * u + c0[:, before])


def _joined(t_ns: IntArray, broken: IntArray | None) -> BoolArray:
    """Return which samples a motion connects to the next one, shape (m - 1,)."""
    joined = ~has_gap_after(t_ns)
    joined[[] if broken is None else broken] = False
    return joined


@dataclass(frozen=True, eq=False, kw_only=True)
class SparseMotion(Motion):
    """A motion whose samples are far from the times of the look-up: its values are those of cubics.

    Attributes:
        cubics: Through its samples.
    """

    cubics: Cubics

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return `Motion.at` with values of the cubics at times in [s], shape (n,)."""
        nearest, rate, second, inside = Motion.at(self, t)
        value = self.cubics.at(t)
        return np.where(np.isfinite(value), value, nearest), rate, second, inside


def with_cubics(motion: Motion, t_ns: IntArray, q: FloatArray) -> Motion:
    """Return a motion on cubics if its samples are so far from each other that this gains more than noise.

    Args:
        motion: The joints of a log.
        t_ns: Its times in integer [ns], shape (m,).
        q: Its joints in [rad] or [m], shape (m, joints).
    """
    if len(t_ns) < STENCIL + 1 or not np.isfinite(q).all():
        return motion
    some = slice(None, None, max(len(t_ns) // MAX_PLACES, 1))
    middle = (0.5 * (motion.t[:-1] + motion.t[1:]))[some]
    cubics = Cubics.through(t_ns, q)
    gain = np.sqrt(np.nanmean((cubics.at(middle) - motion.at(middle)[0]) ** 2, axis=1))
    noise = np.sqrt(
        np.mean(np.diff(q, STENCIL, axis=0) ** 2, axis=0) / 252.0
    )  # the sum of squares of its weights
    if not (gain > MIN_CUBIC_GAIN * noise).any():
        return motion
    return SparseMotion(motion.t, motion.value, motion.rate, motion.second, motion.noise, cubics=cubics)


def _reference_position(matched: Matched, reference: Side) -> Interpolated:
    """Return the tool centre point of the reference at the rows of the log."""
    samples = reference.trajectory.position
    return interpolate_reference(matched, reference.trajectory, samples, matched.reference, matched.actual)


def interpolate_reference(
    matched: Matched, reference: Trajectory, values: FloatArray, linear: FloatArray, log: FloatArray
) -> Interpolated:
    """Return a reference at the rows of a log, and the error of its interpolation.

    Args:
        matched: Both sides at the same times.
        reference: The reference at its samples.
        values: The values that are interpolated in [m] or [rad], shape (m, k).
        linear: The same on lines in [m] or [rad], at the rows of the log, shape (n, k).
        log: The same of the log in [m] or [rad], shape (n, k).
    """
    known_ns, at_ns = reference.t_ns, matched.t_ns + round(matched.sync.offset * 1e9)
    none = Interpolated(linear, np.zeros(linear.shape[1]), False)
    if len(known_ns) < STENCIL:
        return none
    after = np.clip(np.searchsorted(known_ns, at_ns), 1, len(known_ns) - 1)
    distance = np.minimum(*(np.abs(at_ns - known_ns[sample]) for sample in (after - 1, after)))
    fraction = float(np.mean(distance > ROUNDING_NS))
    if not fraction:
        return none
    cubic = Cubics.through(known_ns, values, reference.discontinuities).at(at_ns / 1e9).T
    cubic = np.where(np.isfinite(cubic), cubic, linear)
    on_lines, on_cubics = (_scatter(log - values_at, after) for values_at in (linear, cubic))
    if on_lines.sum() < STRAIGHT * on_cubics.sum():
        return Interpolated(linear, np.sqrt(on_lines), True)
    error = np.sqrt(fraction) * _cubic_error(known_ns, values, reference.discontinuities)
    return Interpolated(cubic, error, True)


def _scatter(deviation: FloatArray, step: IntArray) -> FloatArray:
    """Return the mean square of deviations, shape (n, k), from their mean in each step, shape (k,)."""
    known = np.isfinite(deviation).all(axis=1)
    step, deviation = step[known], deviation[known]
    count = np.maximum(np.bincount(step), 1)
    means = np.array([np.bincount(step, column) / count for column in deviation.T]).T
    return np.asarray(((deviation - means[step]) ** 2).sum(axis=0) / max(len(step), 1))


def _cubic_error(t_ns: IntArray, values: FloatArray, broken: IntArray | None) -> FloatArray:
    """Return the root mean square error of cubics, shape (k,): a fraction of that at twice the step."""
    joined = _joined(t_ns, broken)
    left_out = 1 + 2 * np.flatnonzero(joined[:-1:2] & joined[1::2])
    steps = None if broken is None else broken[broken < 2 * (len(t_ns[::2]) - 1)] // 2
    off = Cubics.through(t_ns[::2], values[::2], steps).at(t_ns[left_out] / 1e9) - values[left_out].T
    off = off[:, np.isfinite(off).all(axis=0)]
    return np.asarray(np.sqrt((off**2).sum(axis=1) / max(off.shape[1], 1)) / REFINEMENT)
