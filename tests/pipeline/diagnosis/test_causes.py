"""What a deviation may come from: the causes of some size of each arm, and those that are there or not."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altered_arm import called, nominal, poses, rich_motion, state_of, times
from rail_arm import rail_arm
from sliding_arm import sliding_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.links import potential_energy
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import Transform, from_offset, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_pipeline.diagnosis.hypotheses import (
    Group,
    assign_columns,
    base_groups,
    cause_groups,
    joint_groups,
    null_state,
    tool_groups,
)
from urmpipe_pipeline.diagnosis.models import TOOL, ArmModel, JointModel, TcpModel
from urmpipe_pipeline.diagnosis.motion import Clock, Motion, gravity_torques, motion_of
from urmpipe_pipeline.runs.reading_errors import (
    Edit,
    Edits,
    axis_edits,
    coupling_edits,
    joint_unit_edits,
    robot_edits,
    sign_edits,
    swap_edits,
    unit_edits,
)

T = times(60)
EVERY = np.arange(60)
UR5E = load_robot("ur5e").placed(from_offset([0.3, -0.2, 0.1, 0.1, 0.2, 0.3]), from_offset([0.0, 0.05, 0.1]))
AXES = tuple(axis_edits(base_known=True))
ORDER = (
    "tool_shift", "tool_rotation", "base_shift", "base_rotation", "time_lag", "clock_drift", "servo_lag",
    "joint_offset", "joint_scale", "joint_lag", "compliance", "backlash", "sag",
    "link_length", "tilt", "link_length", "link_shift", "tilt",
)  # fmt: skip


def groups_of(chain: Chain) -> list[Group]:
    return [*cause_groups(chain, chain.coordinates, has_rotation=True, timed=True)]


def screw(frame: Transform, axis: tuple[float, float, float], *, about: bool) -> FloatArray:
    """Return the shift of the origin, then the turn, of a motion along or about an axis of a frame."""
    direction = np.array(frame.rotate(axis), dtype=float)
    moved = np.cross(np.array(frame.translation, dtype=float), direction) if about else direction
    return np.concatenate((moved, direction * about))


@pytest.mark.parametrize("name", robot_names())
def test_every_segment_of_an_arm_has_six_numbers_with_the_zeros_at_its_ends(name: str) -> None:
    chain = load_robot(name)
    groups = groups_of(chain)
    assert len({called(group) for group in groups}) == len(groups)
    for place, frame in list(enumerate(chain.frames))[1:-1]:
        twists = [one for g in groups if g.kind in ORDER[-3:] for one in g.twists if one.place == place]
        ends = [(chain.joints[place - 2], Transform())] * (place > 1)
        ends += [(joint, frame) for joint in chain.joints[place - 1 : place]]
        screws = [screw(one.frame, one.axis, about=one.kind == "about") for one in twists]
        screws += [
            screw(at, joint.axis, about=joint.kind == "revolute")
            for joint, at in ends if joint.kind != "fixed" and joint.mimic is None
        ]  # fmt: skip
        assert not twists or np.linalg.matrix_rank(np.array(screws)) == 6, chain.frame_names[place]


@pytest.mark.parametrize("name", ["ur5e", "panda"])
def test_what_a_cause_costs_least_comes_first(name: str) -> None:
    groups = groups_of(load_robot(name))
    kinds = [group.kind for group in groups]
    assert tuple(kind for kind, before in zip(kinds, [None, *kinds], strict=False) if kind != before) == ORDER
    frames = [group for group in groups if group.name in ("base", "tool")]
    assert [len(group.columns) for group in frames] == [1, 1, 1, 3] * 4
    assert all((group.axis is None) == (len(group.columns) == 3) for group in frames)


def test_a_module_is_shifted_and_turned_sideways() -> None:
    chain, moved = load_robot("urm6"), rich_motion(load_robot("urm6"))
    model = nominal(chain, moved, T)
    length = chain.with_parameters({"theta5": 0.0}).joints[4].origin
    for cause, step in (
        ("link_shift:segment 4 sideways y", translation(0.0, 0.01, 0.0)),
        ("tilt:segment 4 about x", from_offset([0.0, 0.0, 0.0, 0.01, 0.0, 0.0])),
    ):
        joints = list(chain.joints)
        joints[4] = replace(joints[4], origin=length @ step @ length.inverse() @ joints[4].origin)
        position, _ = poses(replace(chain, joints=tuple(joints)), moved(T), oriented=False)
        left = replace(model, position=position).residual(state_of(model, {cause: np.array([0.01])}), EVERY)
        np.testing.assert_allclose(left, 0.0, atol=1e-14)


@pytest.mark.parametrize(
    "chain", [load_robot("panda"), load_robot("ur5e"), sliding_arm()], ids=lambda c: c.name
)
def test_sag_is_the_slope_of_the_energy_in_gravity(chain: Chain) -> None:
    chain = chain.placed(from_offset([0.0, 0.0, 0.0, 0.4, 0.5, 0.6]))
    q = rich_motion(chain)(T)

    def energy(q: FloatArray) -> FloatArray:
        if chain.inertials:
            return np.asarray(potential_energy(chain, [*q.T]))
        return 9.80665 * poses_over_log(chain, q)[0][:, 2]

    slopes = [(energy(q + step) - energy(q - step)) / 2e-6 for step in 1e-6 * np.eye(q.shape[1])]
    np.testing.assert_allclose(gravity_torques(chain, q.T), slopes, atol=1e-6)
    unit = next(group.unit for group in groups_of(chain) if group.kind == "sag")
    assert unit == ("rad/(N m)" if chain.inertials else "rad/kg" if chain.name == "ur5e" else unit)


def test_play_changes_sides_where_a_joint_turns_back_and_not_by_noise_at_rest() -> None:
    t = np.arange(0.0, 22.0, 0.008)
    there = np.clip(np.sin(0.6 * np.maximum(t - 1.0, 0.0)), -0.7, 0.7)  # rests at first, and at +-0.7
    q = np.array([there + np.random.default_rng(1).normal(0.0, 2e-5, len(t)), -there])
    groups = assign_columns(joint_groups(("rad", "rad"), ("a", "b"), None, timed=True))
    model = JointModel(groups, motion_of(t, q), Clock(t, -1.0, t), np.arange(len(t)), q, (False, False))
    play = null_state(groups)
    for group in groups:
        play.values[list(group.columns)] = 0.004 * (group.kind == "backlash")

    def added(edits: Edits) -> FloatArray:
        with_play, without = (state._replace(edits=edits) for state in (play, null_state(groups)))
        return model.residual(without, np.arange(len(t))) - model.residual(with_play, np.arange(len(t)))

    for row, sign in zip(added(()), (1.0, -1.0), strict=True):
        np.testing.assert_allclose(np.abs(row), 0.002, atol=1e-15)
        assert np.sign(row[0]) == sign
        assert np.count_nonzero(np.diff(np.sign(row))) == 4  # 0.6 (t - 1) = pi / 2, 3 pi / 2, ...
    assert not added((Edit("joint_coupled", (0, 1), 1.0),))[0].any()  # the sum of both never moves


def mirrored_or_turned(edit: Edit, base: FloatArray) -> tuple[FloatArray, FloatArray, bool]:
    """Return matrix and centre of a change of a base, and whether it is a turn, from what is told of it."""
    if edit.kind == "base_rotation":
        axis, angle = edit.axis_angle
        assert 0.0 < angle <= np.pi + 1e-12
        assert next(one for one in axis if one) > 0.0 or angle < 3.0
        return Rotation.from_rotvec(angle * np.array(axis)).as_matrix(), base, True
    letters = edit.name.strip("()").split(", ")
    columns = [np.eye(3)["xyz".index(one[-1])] * (-1.0 if one[0] == "-" else 1.0) for one in letters]
    return np.array(columns).T, np.zeros(3), False


def posed_path(chain: Chain) -> tuple[FloatArray, FloatArray]:
    position, rotation = poses(chain, rich_motion(chain)(T), oriented=True)
    assert rotation is not None
    return position, rotation


def place_model(chain: Chain) -> TcpModel:
    position, rotation = posed_path(chain)
    groups = assign_columns([*tool_groups(Transform(), TOOL, has_rotation=True), *base_groups(Transform())])
    motion = Motion(T, position, np.zeros_like(position), np.zeros_like(position))
    return TcpModel(groups, motion, rotation, Clock(T, -1.0, T), EVERY, position, rotation)


def test_a_base_is_turned_or_mirrored_in_24_and_24_ways_less_one() -> None:
    assert [sum(edit.kind == kind for (edit,) in AXES) for kind in ("base_rotation", "base_mirrored")] == [
        23,
        24,
    ]
    assert len({edit.matrix for (edit,) in AXES}) == 47
    position, rotation = posed_path(UR5E)
    for model in (nominal(UR5E, rich_motion(UR5E), T, oriented=True), place_model(UR5E)):
        base = np.array(UR5E.base.translation) if isinstance(model, ArmModel) else np.zeros(3)
        for edits in AXES:
            matrix, centre, proper = mirrored_or_turned(edits[0], base)
            there = matrix @ (position - centre[:, None]) + centre[:, None]
            back = np.eye(3) if proper else matrix.T
            turned = np.einsum("ij,jkn,kl->iln", matrix, rotation, back)
            data = replace(model, position=there, rotation=turned)
            assert (
                np.abs(data.residual(null_state(model.groups)._replace(edits=edits), EVERY)).max() < 1e-12
            ), edits


def test_of_a_base_that_stands_anywhere_one_is_mirrored_and_all_fit_it() -> None:
    (only,) = axis_edits(base_known=False)
    position, rotation = posed_path(UR5E)
    for axes in (edits[0].matrix for edits in AXES if edits[0].kind == "base_mirrored"):
        matrix = np.array(axes)
        turned = np.einsum("ij,jkn,kl->iln", matrix, rotation, matrix.T)
        model = nominal(UR5E, rich_motion(UR5E), T, oriented=True)
        model = replace(model, position=matrix @ position, rotation=turned, frames_open=True)
        assert np.abs(model.residual(null_state(model.groups)._replace(edits=only), EVERY)).max() < 1e-9


def changed_joints(edit: Edit, q: FloatArray) -> FloatArray:
    """Return joints, shape (n, joints), as they are if one is in another unit or includes another."""
    q = q.copy()
    j, *other = edit.joints
    if edit.kind == "joint_unit":
        some = [j, *other]
        q[:, some] = np.degrees(q[:, some]) if edit.value > 1.0 else np.radians(q[:, some])
    else:
        q[:, j] = q[:, j] - q[:, other[0]] if edit.value < 0.0 else q[:, j] + q[:, other[0]]
    return q


def test_a_joint_in_another_unit_or_that_includes_another_is_read_right() -> None:
    chain = rail_arm()
    turning = [joint.kind == "revolute" for joint in chain.moving]
    every = [*joint_unit_edits(turning), *coupling_edits(turning)]
    assert len(set(every)) == 11 * 2 + 5 * 4 * 2  # each of five joints, all others, or all
    model, q = nominal(chain, rich_motion(chain), T), rich_motion(chain)(T)
    for edits in every:
        assert 0 not in edits[0].joints  # a rail
        data = replace(model, position=poses(chain, changed_joints(edits[0], q), oriented=False)[0])
        state = null_state(model.groups)._replace(edits=edits)
        np.testing.assert_allclose(data.residual(state, EVERY), 0.0, atol=1e-12 * max(edits[0].value, 1.0))
        at, h = rich_motion(chain)(T + 1e-5), 1e-5
        rates = (changed_joints(edits[0], at) - changed_joints(edits[0], q)) / h
        given = edits[0].of_joints(EVERY, q.T, rich_motion(chain)(T, 1).T)[1]
        np.testing.assert_allclose(given, rates.T, atol=1e-4 * max(edits[0].value, 1.0))


@pytest.mark.parametrize(("kind", "side"), [*product(("arm", "place"), ("reference", "log"))])
def test_another_unit_leaves_the_noise_of_the_data_as_it_was_read(kind: str, side: str) -> None:
    model = nominal(UR5E, rich_motion(UR5E), T) if kind == "arm" else place_model(UR5E)
    noise = np.random.default_rng(2).normal(0.0, 1e-3, model.position.shape)
    for edits in unit_edits(side):
        state, by = null_state(model.groups)._replace(edits=edits), edits[0].value
        if kind == "place" and side == "log":  # the model, beside a reference as it was read
            data, true = replace(model, position=by * model.position + noise), 1.0
        else:
            data, true = replace(model, position=model.position / by + noise), by
        np.testing.assert_allclose(data.residual(state, EVERY)[:3], noise, atol=1e-12)
        np.testing.assert_allclose(data.deviation(state, EVERY), true * noise, atol=1e-12)


def several(chain: Chain) -> list[Edits]:
    count, turning = len(chain.moving), [joint.kind == "revolute" for joint in chain.moving]
    every = [
        *sign_edits(count, most=count), *swap_edits(count), *joint_unit_edits(turning),
        *coupling_edits(turning), *AXES, *unit_edits("reference"), *robot_edits(chain),
    ]  # fmt: skip
    return [
        (),
        *every,
        (*every[0], *AXES[5], *every[-1]),
        (*every[3], *AXES[-1], *next(unit_edits("reference"))),
    ]


@pytest.mark.parametrize("frames_open", [False, True])
def test_many_explanations_at_once_leave_what_each_leaves(frames_open: bool) -> None:
    arm = nominal(UR5E, rich_motion(UR5E), T, oriented=True)
    arm = replace(
        arm, position=arm.position + 0.01, clock=arm.clock._replace(t=T + 1.0), frames_open=frames_open
    )
    joints = JointModel(
        assign_columns(joint_groups(["rad"] * 6, UR5E.coordinates, UR5E, timed=True)),
        arm.motion, arm.clock, EVERY, arm.motion.value + 0.01, (False,) * 6, UR5E,
    )  # fmt: skip
    every = several(UR5E)
    joint_edits = [edits for edits in every if all(edit.joints for edit in edits)]
    placing = [edits for edits in every if not any(edit.joints or edit.robot for edit in edits)]
    for model, taken in (
        (arm, every[:: 7 if frames_open else 1]),
        (joints, joint_edits),
        (place_model(UR5E), placing),
    ):
        left = model.residuals(taken, EVERY)
        each = [model.residual(null_state(model.groups)._replace(edits=edits), EVERY) for edits in taken]
        assert isinstance(model, TcpModel) or np.isnan(left).any()  # some rows lie outside its time
        np.testing.assert_allclose(left, each, atol=1e-11)


def test_a_step_beyond_the_bounds_of_an_arm_is_one_error() -> None:
    model = nominal(UR5E, rich_motion(UR5E), T)
    for cause in ("tool_shift:tool y", "base_shift:base", "link_length:d_1"):
        state = state_of(model, {cause: np.array([1e9])})
        for method in (model.residual, model.linear, model.deviation):
            with pytest.raises(RobotError, match="m at most"):
                method(state, EVERY)
