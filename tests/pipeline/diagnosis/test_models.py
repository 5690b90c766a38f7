"""Models, Jacobians and hypotheses: against arms and joints altered elsewhere, energies and differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altered_arm import Numbers, altered, arm_model, called, nominal, poses, rich_motion, state_of, times
from differences import assert_slope
from rail_arm import rail_arm
from sliding_arm import sliding_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.links import potential_energy
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import Transform, from_offset, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_pipeline.diagnosis import hypotheses
from urmpipe_pipeline.diagnosis.hypotheses import Group, Model, State, assign_columns, null_state
from urmpipe_pipeline.diagnosis.models import TOOL, ArmModel, JointModel, TcpModel
from urmpipe_pipeline.diagnosis.motion import Clock, Motion, gravity_torques, motion_of
from urmpipe_pipeline.runs import reading_errors as errors
from urmpipe_pipeline.runs.reading_errors import Edit, Edits

RAIL = rail_arm()
ARMS = (load_robot("urm6"), load_robot("ur5e"), load_robot("panda"), RAIL, sliding_arm())
UR5E = load_robot("ur5e").placed(from_offset([0.3, -0.2, 0.1, 0.1, 0.2, 0.3]), from_offset([0.0, 0.05, 0.1]))
T = times(40)
ROWS, ALL = np.arange(2, 38), np.arange(40)
CLOCK = Clock(T, -1.0, T)
AXES = tuple(errors.axis_edits(base_known=True))
BASES = {edits[0].kind: edits for edits in AXES}
"""The last of those that are turned, and of those that are mirrored."""
THIRD = 100.0
"""The most that a third derivative is by a number: 6 m by an angle, 50 m/s3 by the lag."""
STRUCTURE = ("link_length", "tilt", "link_shift")


def sizes(model: ArmModel, by: float) -> Numbers:
    """Some size of each cause, up to `by` in SI."""
    rng = np.random.default_rng(3)
    kinds = {"compliance": 0.1, "clock_drift": 0.01, "sag": 0.003}
    kinds |= dict.fromkeys(("time_lag", "servo_lag", "joint_lag"), 0.1)
    low = {"servo_lag": 0.0}  # below it a filter: see its own test
    return {
        called(g): by * kinds.get(g.kind, 1.0) * rng.uniform(low.get(g.kind, -1.0), 1.0, len(g.columns))
        for g in model.groups
    }


def assert_linear(model: Model, state: State) -> None:
    """Hold the Jacobian against differences; what moves joints by more than its number has a smaller step."""
    left, jacobian = model.linear(state, ROWS)
    np.testing.assert_array_equal(left, model.residual(state, ROWS))
    far, unit = {"clock_drift": T[-1], "sag": 100.0}, np.eye(len(state.values))
    kinds = [group.kind for group in model.groups for _ in group.columns]

    def along(direction: FloatArray, h: float) -> FloatArray:
        return model.residual(State(state.values + h * direction, state.edits), ROWS)

    for k, (column, kind) in enumerate(zip(jacobian, kinds, strict=True)):
        if kind == "servo_lag":  # a filter over samples a second apart: see its own test
            continue
        long = far.get(kind, 1.0)
        assert_slope(partial(along, unit[k]), -column, third=THIRD * long**3, size=10.0, h=1e-5 / long)


def at_data(chain: Chain, numbers: float, edits: tuple[Edit, ...] = ()) -> tuple[ArmModel, State]:
    """A log beside what it would be with all causes of some size, and the explanation that says so.

    A turn that is left is its vector but for its third power: its slope holds where none is left.
    """
    model = nominal(chain, rich_motion(chain), T, oriented=True)
    state = state_of(model, sizes(model, numbers), edits)
    left = model.residual(state, ALL)[:3]
    q = model.motion.joints(state, model.groups, model.clock, model.sample, ALL, chain).q
    position, rotation = poses(model.arm(state)[0], q.T, oriented=True)
    inside = np.isfinite(left).all(axis=0)
    np.testing.assert_allclose(left[:, inside], (model.position - position)[:, inside], atol=1e-13)
    return replace(model, position=position, rotation=rotation), state


def with_edits() -> tuple[ArmModel, State]:
    return at_data(ARMS[0], 0.1, (
        Edit("joint_sign", (1,)), Edit("joints_swapped", (0, 2)), Edit("half_turn", (4,), first=20),
        Edit("joint_coupled", (3, 2), -1.0), Edit("joint_unit", (5,), 0.5), *BASES["base_rotation"],
    ))  # fmt: skip


def on_mirrored_base_in_another_unit() -> tuple[ArmModel, State]:
    model, state = at_data(load_robot("ur5e"), 0.1)
    mirror = np.array(BASES["base_mirrored"][0].matrix)
    assert model.rotation is not None
    rotation = np.einsum("ij,jkn,kl->iln", mirror, model.rotation, mirror.T)
    edits = (*BASES["base_mirrored"], Edit("path_unit", value=0.5, name="reference in half"))
    model = replace(model, position=2.0 * mirror @ model.position, rotation=rotation)
    return model, state._replace(edits=edits)


def joint_model(numbers: float, direction: float) -> tuple[JointModel, State]:
    moved = rich_motion(RAIL)
    groups = assign_columns(hypotheses.joint_groups(["m", *["rad"] * 5], RAIL.coordinates, RAIL, timed=True))
    motion = Motion(T, *(moved(T, order).T.copy() for order in range(3)))
    clock = Clock(T, direction, T)
    model = JointModel(groups, motion, clock, ALL, moved(T).T, (True, *[False] * 5), RAIL)
    of_kinds = [0.001 if group.kind == "sag" else 0.1 for group in groups]
    values = np.random.default_rng(4).uniform(-1.0, 1.0, len(groups))
    return model, State(numbers * np.array(of_kinds) * values)


def tcp_model(chain: Chain, *, timed: bool = False) -> TcpModel:
    """A path of poses beside itself."""
    (position, rotation), step = poses(chain, rich_motion(chain)(T), oriented=True), 1e-4
    after, before = (poses(chain, rich_motion(chain)(T + by), oriented=False)[0] for by in (step, -step))
    motion = Motion(T, position, (after - before) / (2.0 * step), np.zeros_like(position))
    groups = [*hypotheses.tool_groups(Transform(), TOOL, has_rotation=True)]
    groups += hypotheses.base_groups(Transform())
    groups += hypotheses.time_groups() if timed else ()
    return TcpModel(assign_columns(groups), motion, rotation, CLOCK, ALL, position, rotation)


def some_state(model: TcpModel) -> tuple[State, dict[str, Group]]:
    """An explanation with all three numbers of each frame, and its groups by kind."""
    count = sum(len(group.columns) for group in model.groups)
    state = State(np.random.default_rng(4).uniform(-0.2, 0.2, count))
    of: dict[str, Group] = {group.kind: group for group in model.groups}  # the last of a kind
    for group in model.groups:
        if group is not of[group.kind] or group.name == "clock":
            state.values[list(group.columns)] = 0.0
    return state, of


def at_rotated_data() -> tuple[TcpModel, State]:
    """Far away where nothing of the turn is left."""
    model = tcp_model(RAIL, timed=True)
    state, of = some_state(model)
    base, tool = (rotation_matrix(state.of(of[kind])) for kind in ("base_rotation", "tool_rotation"))
    assert model.turns is not None
    return replace(model, rotation=np.einsum("ij,jkn,kl->iln", base, model.turns, tool)), state


def rotation_matrix(rpy: FloatArray) -> FloatArray:
    """Rz Ry Rx by SciPy."""
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix())


LINEAR: dict[str, Callable[[], tuple[Model, State]]] = {
    "edits": with_edits,
    "mirrored base in another unit": on_mirrored_base_in_another_unit,
    "joints": partial(joint_model, 0.0, -1.0),
    "joints of the log far away": partial(joint_model, 1.0, -1.0),
    "joints of the reference far away": partial(joint_model, 1.0, 1.0),
    "tcp": lambda: (model := tcp_model(RAIL, timed=True), null_state(model.groups)),
    "tcp far away": at_rotated_data,
}
SLOW: dict[str, Callable[[], tuple[Model, State]]] = {
    **{f"{chain.name} {size}": partial(at_data, chain, size) for chain in ARMS for size in (0.0, 0.3)},
    "another robot": lambda: at_data(
        load_robot("ur5e"), 0.1, (Edit("other_robot", robot=load_robot("ur10"), name="ur10"),)
    ),
}


@pytest.mark.parametrize("case", [*LINEAR, *(pytest.param(case, marks=pytest.mark.slow) for case in SLOW)])
def test_a_jacobian_is_the_slope_of_its_model(case: str) -> None:
    assert_linear(*{**LINEAR, **SLOW}[case]())


def test_a_jacobian_of_some_groups_is_that_of_all_cut_down() -> None:
    model, state = at_data(ARMS[0], 0.1)
    some = [model.groups[k] for k in (2, 7, 20, -3)]
    columns = [c for group in some for c in group.columns]
    np.testing.assert_array_equal(model.linear(state, ROWS, some)[1], model.linear(state, ROWS)[1][columns])


def test_an_explanation_that_is_true_leaves_nothing() -> None:
    chain, t = ARMS[0], times(7383)
    moved = rich_motion(chain)
    model = nominal(chain, moved, t, oriented=True)
    numbers = sizes(model, 0.05)
    edits = (Edit("joint_sign", (1,)), Edit("joints_swapped", (3, 5)), Edit("mirrored", (4,), first=3000))
    data = arm_model(chain, moved, t, *altered(model, moved, numbers, edits))
    left = data.residual(state_of(model, numbers, edits), np.arange(len(t)))
    # half a period away a compliance of 0.005 s2 takes q'' at up to 2 rad/s3 from the sample, 2 m away; but
    # where the joint jumps the altered log looks to the other side
    some = np.isfinite(left).all(axis=0) & (np.abs(np.arange(len(t)) - 3000) > 10)
    some &= (np.abs(moved(t, 1)) > 0.02).all(axis=1)  # play changes sides between samples
    assert some.mean() > 0.5
    assert np.abs(left[:, some]).max() < 0.0025 * 0.005 * 2.0 * 2.0


def test_a_servo_follows_its_equation() -> None:
    """T y' + y = x, of samples 9 ms apart, and its slope by T."""
    t, moved = times(4001), rich_motion(RAIL)
    model, _ = joint_model(0.0, -1.0)
    motion, rows = Motion(t, *(moved(t, order).T.copy() for order in range(3))), np.arange(len(t))
    model = replace(model, motion=motion, clock=Clock(t, -1.0, t), sample=rows, q=moved(t).T)
    servo = next(group for group in model.groups if group.kind == "servo_lag")

    def lagging(constant: float) -> State:
        state = null_state(model.groups)
        state.values[list(servo.columns)] = -constant
        return state

    y, later, slower = (moved(t).T - model.residual(lagging(lag), rows) for lag in (0.11, 0.1101, 0.1099))
    left = 0.11 * np.gradient(y, t, axis=1) + y - moved(t).T
    # the start fades in 4.6 s to e^-40; a difference leaves h^2 y''' / 6, of up to 2 rad/s3
    assert np.abs(left[:, 500:-2]).max() < 0.11 * 8.5e-5 / 6.0 * 2.0
    (slope,) = model.linear(lagging(0.11), rows, [servo])[1]
    np.testing.assert_allclose(slope[:, 500:-2], (slower - later)[:, 500:-2] / 2e-4, atol=1e-4)


def test_a_tcp_is_moved_by_the_tool_then_the_base() -> None:
    model = tcp_model(RAIL, timed=True)
    state, of = some_state(model)
    assert model.turns is not None
    tip = model.motion.value + np.einsum("ijn,j->in", model.turns, state.of(of["tool_shift"]))
    moved = rotation_matrix(state.of(of["base_rotation"])) @ tip + state.of(of["base_shift"])[:, np.newaxis]
    np.testing.assert_allclose(model.residual(state, ALL)[:3], model.position - moved, atol=1e-14)


@pytest.mark.parametrize("chain", ARMS[:3], ids=lambda chain: chain.name)
def test_groups_are_the_parameters_that_an_arm_is_known_by(chain: Chain) -> None:
    model = nominal(chain, rich_motion(chain), T)
    values = {parameter.name: float(parameter.value) for parameter in chain.parameters}
    for group in (group for group in model.groups if group.name in values):
        longer = chain.with_parameters({group.name: values[group.name] + 0.01})
        expected = poses(longer, rich_motion(chain)(T), oriented=False)[0]
        left = model.residual(state_of(model, {called(group): np.array([0.01])}), ROWS)
        np.testing.assert_allclose(left, (model.position - expected)[:, ROWS], atol=1e-13)


def screw(frame: Transform, axis: tuple[float, float, float], *, about: bool) -> FloatArray:
    """Return the shift of the origin, then the turn, of a motion along or about an axis of a frame."""
    direction = np.array(frame.rotate(axis), dtype=float)
    moved = np.cross(np.array(frame.translation, dtype=float), direction) if about else direction
    return np.concatenate((moved, direction * about))


@pytest.mark.parametrize("name", robot_names())
def test_every_segment_of_an_arm_has_six_numbers_with_the_zeros_at_its_ends(name: str) -> None:
    chain = load_robot(name)
    groups = [*hypotheses.cause_groups(chain, chain.coordinates, has_rotation=True, timed=True)]
    assert len({called(group) for group in groups}) == len(groups)
    for place, frame in list(enumerate(chain.frames))[1:-1]:
        twists = [twist for g in groups if g.kind in STRUCTURE for twist in g.twists if twist.place == place]
        ends = [(chain.joints[place - 2], Transform())] * (place > 1)
        ends += [(joint, frame) for joint in chain.joints[place - 1 : place]]
        screws = [screw(twist.frame, twist.axis, about=twist.kind == "about") for twist in twists]
        screws += [
            screw(at, joint.axis, about=joint.kind == "revolute")
            for joint, at in ends if joint.kind != "fixed" and joint.mimic is None
        ]  # fmt: skip
        assert not twists or np.linalg.matrix_rank(np.array(screws)) == 6, chain.frame_names[place]


@pytest.mark.parametrize(
    ("cause", "step"),
    [
        ("link_shift:segment 4 sideways y", translation(0.0, 0.01, 0.0)),
        ("tilt:segment 4 about x", from_offset([0.0, 0.0, 0.0, 0.01, 0.0, 0.0])),
    ],
)
def test_a_module_is_shifted_and_turned_sideways(cause: str, step: Transform) -> None:
    chain, moved = ARMS[0], rich_motion(ARMS[0])
    length, joints = chain.with_parameters({"theta5": 0.0}).joints[4].origin, list(chain.joints)
    joints[4] = replace(joints[4], origin=length @ step @ length.inverse() @ joints[4].origin)
    position, _ = poses(replace(chain, joints=tuple(joints)), moved(T), oriented=False)
    model = replace(nominal(chain, moved, T), position=position)
    left = model.residual(state_of(model, {cause: np.array([0.01])}), ALL)
    np.testing.assert_allclose(left, 0.0, atol=1e-14)


@pytest.mark.parametrize("chain", [ARMS[2], ARMS[1], ARMS[4]], ids=lambda chain: chain.name)
def test_sag_is_the_slope_of_the_energy_in_gravity(chain: Chain) -> None:
    chain = chain.placed(from_offset([0.0, 0.0, 0.0, 0.4, 0.5, 0.6]))
    q = rich_motion(chain)(T)

    def energy(q: FloatArray) -> FloatArray:
        if chain.inertials:
            return np.asarray(potential_energy(chain, [*q.T]))
        return 9.80665 * poses_over_log(chain, q)[0][:, 2]

    slopes = [(energy(q + step) - energy(q - step)) / 2e-6 for step in 1e-6 * np.eye(q.shape[1])]
    np.testing.assert_allclose(gravity_torques(chain, q.T), slopes, atol=1e-6)


def test_play_changes_sides_where_a_joint_turns_back_and_not_by_noise_at_rest() -> None:
    t = np.arange(0.0, 22.0, 0.008)
    angle = np.clip(np.sin(0.6 * np.maximum(t - 1.0, 0.0)), -0.7, 0.7)  # rests at first, and at +-0.7
    q = np.array([angle + np.random.default_rng(1).normal(0.0, 2e-5, len(t)), -angle])
    groups = assign_columns(hypotheses.joint_groups(("rad", "rad"), ("a", "b"), None, timed=True))
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


def test_a_base_is_turned_or_mirrored_in_24_and_24_ways_less_one() -> None:
    kinds = [edit.kind for (edit,) in AXES]
    assert (kinds.count("base_rotation"), kinds.count("base_mirrored")) == (23, 24)
    assert len({edit.matrix for (edit,) in AXES}) == 47
    position, rotation = poses(UR5E, rich_motion(UR5E)(T), oriented=True)
    assert rotation is not None
    for model in (nominal(UR5E, rich_motion(UR5E), T, oriented=True), tcp_model(UR5E)):
        base = np.array(UR5E.base.translation) if isinstance(model, ArmModel) else np.zeros(3)
        for edits in AXES:
            (edit,), centre, back = edits, base, np.eye(3)
            if edit.kind == "base_rotation":
                axis, angle = edit.axis_angle
                assert 0.0 < angle <= np.pi + 1e-12
                assert next(component for component in axis if component) > 0.0 or angle < 3.0
                matrix = Rotation.from_rotvec(angle * np.array(axis)).as_matrix()
            else:
                letters = edit.name.strip("()").split(", ")
                columns = [np.eye(3)["xyz".index(name[-1])] * (-1.0) ** name.count("-") for name in letters]
                matrix = np.array(columns).T
                centre, back = np.zeros(3), matrix.T
            moved = matrix @ (position - centre[:, None]) + centre[:, None]
            turned = np.einsum("ij,jkn,kl->iln", matrix, rotation, back)
            data = replace(model, position=moved, rotation=turned)
            left = data.residual(null_state(model.groups)._replace(edits=edits), ALL)
            assert np.abs(left).max() < 1e-12, edits


def test_of_a_base_that_stands_anywhere_one_is_mirrored_and_all_fit_it() -> None:
    (only,) = errors.axis_edits(base_known=False)
    model = nominal(UR5E, rich_motion(UR5E), T, oriented=True)
    assert model.rotation is not None
    for matrix in (np.array(edits[0].matrix) for edits in AXES if edits[0].kind == "base_mirrored"):
        turned = np.einsum("ij,jkn,kl->iln", matrix, model.rotation, matrix.T)
        data = nominal(UR5E, rich_motion(UR5E), T, oriented=True)  # frames are fitted once per model
        data = replace(data, position=matrix @ model.position, rotation=turned, frames_open=True)
        left = data.residual(null_state(model.groups)._replace(edits=only), ALL)
        assert np.abs(left).max() < 1e-9


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
    turning = [joint.kind == "revolute" for joint in RAIL.moving]
    all_edits = [*errors.joint_unit_edits(turning), *errors.coupling_edits(turning)]
    assert len(set(all_edits)) == 11 * 2 + 5 * 4 * 2  # each of five joints, all others, or all
    model, q, h = nominal(RAIL, rich_motion(RAIL), T), rich_motion(RAIL)(T), 1e-5
    for edits in all_edits:
        assert 0 not in edits[0].joints  # a rail
        data = replace(model, position=poses(RAIL, changed_joints(edits[0], q), oriented=False)[0])
        left, by = data.residual(null_state(model.groups)._replace(edits=edits), ALL), edits[0].value
        np.testing.assert_allclose(left, 0.0, atol=1e-12 * max(by, 1.0))
        later = changed_joints(edits[0], rich_motion(RAIL)(T + h))
        rates = edits[0].of_joints(ALL, q.T, rich_motion(RAIL)(T, 1).T)[1]
        expected = (later - changed_joints(edits[0], q)) / h
        np.testing.assert_allclose(rates, expected.T, atol=1e-4 * max(by, 1.0))


@pytest.mark.parametrize(("kind", "side"), [*product(("arm", "tcp"), ("reference", "log"))])
def test_another_unit_leaves_the_noise_of_the_data_as_it_was_read(kind: str, side: str) -> None:
    model = nominal(UR5E, rich_motion(UR5E), T) if kind == "arm" else tcp_model(UR5E)
    noise = np.random.default_rng(2).normal(0.0, 1e-3, model.position.shape)
    for edits in errors.unit_edits(side):
        state, by = null_state(model.groups)._replace(edits=edits), edits[0].value
        if kind == "tcp" and side == "log":  # the model, beside a reference as it was read
            data, true = replace(model, position=by * model.position + noise), 1.0
        else:
            data, true = replace(model, position=model.position / by + noise), by
        np.testing.assert_allclose(data.residual(state, ALL)[:3], noise, atol=1e-12)
        np.testing.assert_allclose(data.deviation(state, ALL), true * noise, atol=1e-12)


@pytest.mark.parametrize("frames_open", [False, True])
def test_many_explanations_at_once_leave_what_each_leaves(frames_open: bool) -> None:
    arm = nominal(UR5E, rich_motion(UR5E), T, oriented=True)
    arm = replace(arm, position=arm.position + 0.01, clock=Clock(T + 1.0, -1.0, T), frames_open=frames_open)
    groups = assign_columns(hypotheses.joint_groups(["rad"] * 6, UR5E.coordinates, UR5E, timed=True))
    joints = JointModel(groups, arm.motion, arm.clock, ALL, arm.motion.value + 0.01, (False,) * 6, UR5E)
    turning, units = [True] * 6, [*errors.unit_edits("reference")]
    single = [*errors.sign_edits(6, most=6), *errors.swap_edits(6), *errors.joint_unit_edits(turning)]
    single += [*errors.coupling_edits(turning), *AXES, *units, *errors.robot_edits(UR5E)]
    several = [(*single[0], *AXES[5], *single[-1]), (*single[3], *AXES[-1], *units[0])]
    candidates: list[Edits] = [(), *single, *several]
    of_joints = [edits for edits in candidates if all(edit.joints for edit in edits)]
    placing = [edits for edits in candidates if not any(edit.joints or edit.robot for edit in edits)]
    cases: list[tuple[Model, list[Edits]]] = [
        (arm, candidates[:: 7 if frames_open else 1]), (joints, of_joints), (tcp_model(UR5E), placing)
    ]  # fmt: skip
    for model, explanations in cases:
        left = model.residuals(explanations, ALL)
        states = [null_state(model.groups)._replace(edits=edits) for edits in explanations]
        assert isinstance(model, TcpModel) or np.isnan(left).any()  # some rows lie outside its time
        np.testing.assert_allclose(left, [model.residual(state, ALL) for state in states], atol=1e-11)
