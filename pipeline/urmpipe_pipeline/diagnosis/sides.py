"""What two sides allow to be asked: a model of one, held against the other, and what they cannot tell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray, spread_rows
from urmpipe_models.kinematics.forward import jacobian, positions_over_log
from urmpipe_models.math3d import Transform, to_matrices
from urmpipe_pipeline import text
from urmpipe_pipeline.diagnosis.causes import STRUCTURE, NotLookedFor
from urmpipe_pipeline.diagnosis.hypotheses import (
    Group,
    base_groups,
    cause_groups,
    joint_groups,
    numbered,
    time_groups,
    tool_groups,
)
from urmpipe_pipeline.diagnosis.interpolation import (
    Cubics,
    Interpolated,
    SparseMotion,
    interpolated,
    with_cubics,
)
from urmpipe_pipeline.diagnosis.models import TOOL, ArmModel, JointsModel, PlaceModel
from urmpipe_pipeline.diagnosis.motion import Clock, Motion, motion_of
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
from urmpipe_pipeline.trajectories import Matched, Side, Trajectory

AT_REST = 3e-4
"""What moves by less in [m] or [rad] rests: three times what a UR5e at rest was logged to span in 25 s,
0.10 mrad and 0.10 mm."""

ORIENTED = 0.5
"""Orientations count where more than this share of the rows has them on both sides."""

LOOKED_AT = 2000
"""Values of a column from which its step is told."""

PARTS = (1, 2, 5, 10)
"""The least distance of two values that occur may be so many steps."""

WHOLE = 0.01
"""A value is a multiple of a step if it is no further off than this share of one."""

JOINTS = (
    "joint_sign", "joints_swapped", "joint_unit", "joint_coupled", "half_turn", "mirrored",
    "joint_offset", "joint_scale", "joint_lag", "servo_lag", "compliance", "backlash", "sag",
)  # fmt: skip
FRAMES = ("base_shift", "base_rotation", "tool_shift", "tool_rotation")
TIME = ("time_lag", "clock_drift", "servo_lag", "joint_lag", "compliance", "backlash")


@dataclass(frozen=True, eq=False)
class Question:
    """What is held against what, and what may be found.

    Attributes:
        model: The side that is modelled, beside the other.
        edits: What may be there or not.
        turning: Which joints turn, shape (joints,); none without joints.
        names: What the log calls its joints.
        own_names: What the arm calls them; as the log without one.
        rounding: What rounding and interpolation leave, of each component in [m] or [rad], shape (c,).
        forced: Groups that are unknown, and always taken.
        sign: 1 if the model is the log's, -1 if it is the reference's: of what stays, as reference - log.
        not_looked_for: What these sides cannot tell, and why.
    """

    model: ArmModel | JointsModel | PlaceModel
    edits: tuple[Edits, ...]
    turning: tuple[bool, ...]
    names: tuple[str, ...]
    own_names: tuple[str, ...]
    rounding: FloatArray
    forced: tuple[int, ...]
    sign: float
    not_looked_for: tuple[NotLookedFor, ...]


def build_question(matched: Matched, reference: Side, log: Side) -> Question:
    """Return what two sides, at the same times, allow to be asked."""
    if reference.run.timed and reference.run is not log.run:
        reference = reference._replace(trajectory=reference.trajectory.rows_with_value())
    if reference.by_joints and log.by_joints and matched.reference_q is not None:
        return _of_joints(matched, reference, log)
    if log.by_joints or reference.by_joints:
        return _of_arm(matched, reference, log)
    return _of_places(matched, reference, log)


def _of_joints(matched: Matched, reference: Side, log: Side) -> Question:
    """Return the question of joints on both sides."""
    run = log.run
    sliding = tuple(unit == "m" for unit in run.joint_units)
    units = ["m" if one else "rad" for one in sliding]
    groups = numbered(joint_groups(units, run.log.joints, run.robot, timed=run.timed))
    samples, lines = _ordered_joints(reference.trajectory, run), np.asarray(matched.reference_q)
    q = interpolated(matched, reference.trajectory, samples, lines, np.asarray(matched.actual_q))
    model = JointsModel(
        groups, _motion(run), _clock(matched, run, log=True), matched.sample, q.values.T.copy(), sliding,
        run.robot,
        _judged(matched, reference, log) if q.between or run.robot != reference.run.robot else None,
    )  # fmt: skip
    rounding = np.sqrt(_rounding(run.on_rows.q, run) ** 2 + _rounding(samples, run) ** 2 + q.error**2)
    told = NotLookedFor(
        (*STRUCTURE, *FRAMES, "base_mirrored", "path_unit", "other_robot"),
        _why_joints_show_none(reference, log),
    )
    turning = tuple(not one for one in sliding)
    edits = (
        *sign_edits(len(sliding), most=len(sliding)), *swap_edits(len(sliding)),
        *joint_unit_edits(turning), *coupling_edits(turning),
    )  # fmt: skip
    bare = () if run.robot else (NotLookedFor(("sag",), "without a robot gravity is unknown"),)
    return Question(
        model,
        edits,
        turning,
        run.log.joints,
        _own_names(run),
        rounding,
        (),
        1.0,
        (told, *bare, *_unknown_rates(run, model.motion)),
    )


def _why_joints_show_none(reference: Side, log: Side) -> str:
    """Return why joints on both sides show nothing of arm, base and tool, and what would."""
    recorded = [side.run.name for side in (reference, log) if side.run.log.tcp_position is not None]
    if not recorded:
        return "joints on both sides do not show them, and neither side recorded a tool centre point"
    alone = (
        f"{' and '.join(recorded)}, diagnosed alone, {'is' if len(recorded) == 1 else 'are'} compared with"
    )
    return f"joints on both sides do not show them: {alone} the recorded tool centre point"


def _of_arm(matched: Matched, reference: Side, log: Side) -> Question:
    """Return the question of joints on one side: what arm, joints and clock have that is not told."""
    own, other = (log, reference) if log.by_joints else (reference, log)
    run, robot = own.run, own.run.robot
    assert robot is not None  # a side without kinematics has no place, and is not compared by it
    place = _reference_place(matched, reference)
    position, quat = (
        (place.values, matched.reference_quat) if log.by_joints else (matched.actual, matched.actual_quat)
    )
    rotation = _turned(quat)
    names, timed = run.log.joints, log.run.timed
    open_frames = other.run.log.measured
    groups = numbered(cause_groups(robot, names, turned=rotation is not None, timed=timed))
    clock = _clock(matched, log.run, log=log.by_joints)
    motion, lines = _motion(run), matched.reference
    if place.between and not log.by_joints:
        cubics = Cubics.through(
            reference.trajectory.t_ns, np.asarray(reference.trajectory.q), reference.trajectory.broken
        )
        motion = SparseMotion(motion.t, motion.value, motion.rate, motion.second, motion.noise, cubics=cubics)
        lines = position + positions_over_log(robot, motion.at(clock.t)[0].T) - lines
    judged = lines.T.copy() if place.between and not open_frames else None
    model = ArmModel(
        robot, groups, motion, clock, matched.sample, position.T.copy(), rotation, open_frames, judged
    )
    rounding = np.sqrt(
        _rounding(other.trajectory.position, run) ** 2 + place.error**2
        + _by_joints(model, _rounding(run.on_rows.q, run)) ** 2
    )  # fmt: skip
    rounding = np.concatenate((rounding, np.zeros(len(model.blocks) - 3)))
    count, turning = len(robot.moving), tuple(joint.kind == "revolute" for joint in robot.moving)
    edits = (
        *sign_edits(count, most=2 if open_frames else count), *swap_edits(count),
        *joint_unit_edits(turning), *coupling_edits(turning),
        *axis_edits(base_known=not open_frames), *robot_edits(robot),
    )  # fmt: skip
    edits += () if open_frames else tuple(unit_edits("reference" if log.by_joints else "log"))
    forced = tuple(g for g, group in enumerate(groups) if open_frames and _whole_frame(group))
    told = [NotLookedFor(("turns",), "only joints on both sides show them")]
    if rotation is None:
        told.append(NotLookedFor(("tool_rotation",), "a side has no orientation"))
    if open_frames:
        told.append(
            NotLookedFor((*FRAMES, "path_unit"), "measured in a frame of its own: base and tool are unknown")
        )
    return Question(
        model, edits, turning, names, _own_names(run), rounding, forced,
        1.0 if log.by_joints else -1.0, (*told, *_unknown_rates(run, motion)),
    )  # fmt: skip


def _of_places(matched: Matched, reference: Side, log: Side) -> Question:
    """Return the question of a tool centre point on both sides, without joints."""
    run = log.run
    quat = matched.actual_quat
    oriented = _turned(quat) is not None
    rotation = _turned(matched.reference_quat) if oriented else None
    tool = tool_groups(Transform(), TOOL, turned=rotation is not None) if oriented else ()
    groups = numbered([*tool, *base_groups(Transform()), *(time_groups() if run.timed else ())])
    trajectory, place = log.trajectory, _reference_place(matched, reference)
    turns = None if trajectory.quat_xyzw is None or not oriented else _matrices(trajectory.quat_xyzw)
    model = PlaceModel(
        groups, motion_of(trajectory.t if run.timed else None, trajectory.position.T), turns,
        _clock(matched, run, log=True), matched.sample, place.values.T.copy(), rotation,
        matched.reference.T.copy() if place.between else None,
    )  # fmt: skip
    rounding = np.sqrt(
        _rounding(reference.trajectory.position, run) ** 2 + _rounding(matched.actual, run) ** 2
        + place.error**2
    )  # fmt: skip
    rounding = np.concatenate((rounding, np.zeros(len(model.blocks) - 3)))
    told = [NotLookedFor((*STRUCTURE, *JOINTS, "turns", "other_robot"), "no side has joints")]
    if not oriented:
        told.append(NotLookedFor(("tool_shift", "tool_rotation"), "the log has no orientation"))
    elif rotation is None:
        told.append(NotLookedFor(("tool_rotation",), "the reference has no orientation"))
    return Question(
        model,
        (*axis_edits(base_known=True), *unit_edits("reference", "log")),
        (),
        (),
        (),
        rounding,
        (),
        1.0,
        (*told, *_unknown_rates(run)),
    )


def _whole_frame(group: Group) -> bool:
    return group.kind in FRAMES and group.axis is None


def _reference_place(matched: Matched, reference: Side) -> Interpolated:
    """Return the tool centre point of the reference at the rows of the log."""
    samples = reference.trajectory.position
    return interpolated(matched, reference.trajectory, samples, matched.reference, matched.actual)


def _judged(matched: Matched, reference: Side, log: Side) -> FloatArray:
    """Return what is judged of a reference with joints: its place, else where they lead the log's arm."""
    robot, q = log.run.robot, np.asarray(matched.reference_q)
    if robot is None:
        return q.T.copy()
    if robot != reference.run.robot or np.isfinite(matched.reference).all():
        return matched.reference.T.copy()
    return positions_over_log(robot, q).T.copy()


def _own_names(run: Run) -> tuple[str, ...]:
    """Return what an arm calls its joints; without one what the log calls them."""
    return run.log.joints if run.robot is None else run.robot.coordinates


def _unknown_rates(run: Run, motion: Motion | None = None) -> Iterator[NotLookedFor]:
    """Yield that still poses tell nothing of time, and which joints of a log have no known accelerations."""
    if not run.timed:
        yield NotLookedFor(TIME, "still poses have no time")
    elif motion is not None:
        moves = np.fmax.reduce(motion.value, axis=1) - np.fmin.reduce(motion.value, axis=1) > AT_REST
        unknown = np.flatnonzero(moves & ~motion.second.any(axis=1)).tolist()
        if unknown:
            names = text.enumerated([run.log.joints[j] for j in unknown])
            yield NotLookedFor(
                ("compliance",), f"the rows do not show how {names} accelerate{'s' * (len(unknown) == 1)}"
            )


def _clock(matched: Matched, run: Run, *, log: bool) -> Clock:
    """Return the times of the compared rows on the clock of the modelled side."""
    if not run.timed:
        return Clock(matched.sample.astype(float), -1.0, np.zeros(len(matched.sample)))
    since = matched.t_ns / 1e9
    return Clock(since, -1.0, since) if log else Clock(since + matched.sync.offset, 1.0, since)


def _motion(run: Run) -> Motion:
    """Return the joints of a run on its log's rows, with their rates where they have times."""
    rows = run.on_rows
    motion = motion_of(rows.t_ns / 1e9 if run.timed else None, rows.q.T)
    return with_cubics(motion, rows.t_ns, rows.q) if run.timed else motion


def _turned(quat: FloatArray | None) -> FloatArray | None:
    """Return orientations as matrices, shape (3, 3, n); None where too few rows have one."""
    if quat is None or np.isfinite(quat).all(axis=1).mean() <= ORIENTED:
        return None
    return _matrices(quat)


def _matrices(quat: FloatArray) -> FloatArray:
    return to_matrices(quat).transpose(1, 2, 0).copy()


def _rounding(values: FloatArray, run: Run) -> FloatArray:
    """Return the root mean square error of rounding to the steps that columns are written in, shape (k,).

    Still poses are chosen in round numbers, which are exact.
    """
    if not run.timed:
        return np.zeros(values.shape[1])
    some = values[:: max(len(values) // LOOKED_AT, 1)]
    steps = np.array([_step(column[np.isfinite(column)]) for column in some.T])
    return np.asarray(steps / np.sqrt(12.0))


def _step(values: FloatArray) -> float:
    """Return the step that all values are multiples of: the least between two, or a part of it; else 0."""
    apart = np.diff(np.unique(values))
    for part in PARTS if len(apart) else ():
        step = float(apart.min()) / part
        if np.abs(values / step - np.rint(values / step)).max() < WHOLE:
            return step
    return 0.0


def _by_joints(model: ArmModel, rounding: FloatArray) -> FloatArray:
    """Return what the rounding of joints leaves of a position in [m], shape (3,)."""
    rows = spread_rows(model.rows, 100)
    q = model.motion.at(model.clock.t[rows])[0]
    columns = np.array([[np.nanmean(np.square(part * np.ones(len(rows)))) for part in column[:3]]
                        for column in jacobian(model.chain, list(q))])  # fmt: skip
    return np.asarray(np.sqrt((columns * rounding[:, np.newaxis] ** 2).sum(axis=0)))


def _ordered_joints(reference: Trajectory, run: Run) -> FloatArray:
    """Return the joints of a reference in the order of a log, by name, else by place, shape (m, joints)."""
    q, names = np.asarray(reference.q), run.log.joints
    return q[:, [reference.joints.index(one) for one in names]] if {*reference.joints} == {*names} else q
