"""What is modelled, and its Jacobian: against arms and joints that are altered elsewhere, and differences."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altered_arm import (
    DURATION,
    Numbers,
    altered,
    arm_model,
    called,
    nominal,
    poses,
    rich_motion,
    state_of,
    times,
)
from differences import assert_slope
from rail_arm import rail_arm
from sliding_arm import sliding_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import Transform
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis.fit import Model
from urmpipe_pipeline.diagnosis.hypotheses import (
    Group,
    State,
    assign_columns,
    base_groups,
    joint_groups,
    time_groups,
    tool_groups,
)
from urmpipe_pipeline.diagnosis.models import TOOL, ArmModel, JointModel, TcpModel
from urmpipe_pipeline.diagnosis.motion import Clock, Motion
from urmpipe_pipeline.runs.reading_errors import Edit, axis_edits

ARMS = (load_robot("urm6"), load_robot("ur5e"), load_robot("panda"), rail_arm(), sliding_arm())
T = times(40)
ROWS = np.arange(2, 38)
BASES = {edits[0].kind: edits for edits in axis_edits(base_known=True)}
"""The last of those that are turned, and of those that are mirrored."""
THIRD = 100.0
"""The most that a third derivative is by a number: 6 m by an angle, 50 m/s3 by the lag."""


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


def left_of(model: Model, state: State, column: int, h: float) -> FloatArray:
    values = state.values.copy()
    values[column] += h
    return model.residual(State(values, state.edits), ROWS)


def assert_linear(model: Model, state: State) -> None:
    """Hold the Jacobian against differences; what moves joints by more than its number has a smaller step."""
    left, jacobian = model.linear(state, ROWS)
    np.testing.assert_array_equal(left, model.residual(state, ROWS))
    far = {"clock_drift": DURATION, "sag": 100.0}
    kinds = [group.kind for group in model.groups for _ in group.columns]
    for k, (column, kind) in enumerate(zip(jacobian, kinds, strict=True)):
        if kind == "servo_lag":  # a filter over samples a second apart: see its own test
            continue
        long = far.get(kind, 1.0)
        slope = partial(left_of, model, state, k)
        assert_slope(slope, -column, third=THIRD * long**3, size=10.0, h=1e-5 / long)


def at_data(chain: Chain, numbers: float, edits: tuple[Edit, ...] = ()) -> tuple[ArmModel, State]:
    """A log beside what it would be with all causes of some size, and the explanation that says so.

    A turn that is left is its vector but for its third power: its slope holds where none is left.
    """
    moved = rich_motion(chain)
    model = nominal(chain, moved, T, oriented=True)
    state = state_of(model, sizes(model, numbers), edits)
    left = model.residual(state, np.arange(model.rows))[:3]
    there, _ = model.arm(state)
    q = model.motion.joints(state, model.groups, model.clock, model.sample, np.arange(model.rows), chain).q
    position, rotation = poses(there, q.T, oriented=True)
    inside = np.isfinite(left).all(axis=0)
    np.testing.assert_allclose(left[:, inside], (model.position - position)[:, inside], atol=1e-13)
    return replace(model, position=position, rotation=rotation), state


@pytest.mark.slow
@pytest.mark.parametrize("chain", ARMS, ids=lambda chain: chain.name)
@pytest.mark.parametrize("size", [0.0, 0.3])
def test_the_jacobian_of_an_arm_is_its_slope(chain: Chain, size: float) -> None:
    assert_linear(*at_data(chain, size))


def test_it_is_so_with_edits() -> None:
    edits = (
        Edit("joint_sign", (1,)), Edit("joints_swapped", (0, 2)), Edit("half_turn", (4,), first=20),
        Edit("joint_coupled", (3, 2), -1.0), Edit("joint_unit", (5,), 0.5), *BASES["base_rotation"],
    )  # fmt: skip
    assert_linear(*at_data(ARMS[0], 0.1, edits))


def test_it_is_so_of_a_mirrored_base_in_another_unit() -> None:
    model, state = at_data(load_robot("ur5e"), 0.1)
    mirror = np.array(BASES["base_mirrored"][0].matrix)
    assert model.rotation is not None
    rotation = np.einsum("ij,jkn,kl->iln", mirror, model.rotation, mirror.T)
    edits = (*BASES["base_mirrored"], Edit("path_unit", value=0.5, name="reference in half"))
    assert_linear(
        replace(model, position=2.0 * mirror @ model.position, rotation=rotation), state._replace(edits=edits)
    )


@pytest.mark.slow
def test_it_is_so_with_another_robot() -> None:
    assert_linear(
        *at_data(load_robot("ur5e"), 0.1, (Edit("other_robot", robot=load_robot("ur10"), name="ur10"),))
    )


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
    position, rotation = altered(model, moved, numbers, edits)
    left = arm_model(chain, moved, t, position, rotation).residual(
        state_of(model, numbers, edits), np.arange(len(t))
    )
    # half a period away a compliance of 0.005 s2 takes q'' at up to 2 rad/s3 from the sample, 2 m away; but
    # where the joint jumps the altered log looks to the other side
    some = np.isfinite(left).all(axis=0) & (np.abs(np.arange(len(t)) - 3000) > 10)
    some &= (np.abs(moved(t, 1)) > 0.02).all(axis=1)  # play changes sides between samples
    assert some.mean() > 0.5
    assert np.abs(left[:, some]).max() < 0.0025 * 0.005 * 2.0 * 2.0


def test_what_a_servo_makes_of_a_motion_follows_its_equation() -> None:
    """T y' + y = x, of samples 9 ms apart, and its slope by T."""
    t = times(4001)
    moved = rich_motion(rail_arm())
    groups = assign_columns(joint_groups(["m", *["rad"] * 5], rail_arm().coordinates, rail_arm(), timed=True))
    motion = Motion(t, *(moved(t, order).T.copy() for order in range(3)))
    rows, clock = np.arange(len(t)), Clock(t, -1.0, t)
    model = JointModel(groups, motion, clock, rows, moved(t).T, (True, *[False] * 5), rail_arm())
    servo = next(group for group in groups if group.kind == "servo_lag")

    def behind(constant: float) -> State:
        values = np.zeros(sum(len(group.columns) for group in groups))
        values[list(servo.columns)] = -constant
        return State(values)

    y, later, slower = (moved(t).T - model.residual(behind(one), rows) for one in (0.11, 0.1101, 0.1099))
    left = 0.11 * np.gradient(y, t, axis=1) + y - moved(t).T
    # the start fades in 4.6 s to e^-40; a difference leaves h^2 y''' / 6, of up to 2 rad/s3
    assert np.abs(left[:, 500:-2]).max() < 0.11 * 8.5e-5 / 6.0 * 2.0
    (slope,) = model.linear(behind(0.11), rows, [servo])[1]
    np.testing.assert_allclose(slope[:, 500:-2], (slower - later)[:, 500:-2] / 2e-4, atol=1e-4)


def joints_model(numbers: float) -> tuple[JointModel, State]:
    moved = rich_motion(rail_arm())
    names = rail_arm().coordinates
    groups = assign_columns(joint_groups(["m", *["rad"] * 5], names, rail_arm(), timed=True))
    motion = Motion(T, *(moved(T, order).T.copy() for order in range(3)))
    model = JointModel(
        groups, motion, Clock(T, -1.0, T), np.arange(len(T)), moved(T).T, (True, *[False] * 5), rail_arm()
    )
    rng = np.random.default_rng(4)
    sizes = [0.001 if group.kind == "sag" else 0.1 for group in groups]
    return model, State(numbers * np.array(sizes) * rng.uniform(-1.0, 1.0, len(groups)))


@pytest.mark.parametrize(("size", "direction"), [(0.0, -1.0), (1.0, -1.0), (1.0, 1.0)])
def test_the_jacobian_of_joints_is_their_slope(size: float, direction: float) -> None:
    model, state = joints_model(size)
    assert_linear(replace(model, clock=model.clock._replace(direction=direction)), state)


def place_model(numbers: float) -> tuple[TcpModel, State]:
    """A path of poses beside where it would be with all causes of some size."""
    chain, moved = rail_arm(), rich_motion(rail_arm())
    (position, rotation), step = poses(chain, moved(T), oriented=True), 1e-4
    after, before = (poses(chain, moved(T + by), oriented=False)[0] for by in (step, -step))
    motion = Motion(T, position, (after - before) / (2.0 * step), np.zeros_like(position))
    groups = assign_columns(
        [*tool_groups(Transform(), TOOL, has_rotation=True), *base_groups(Transform()), *time_groups()]
    )
    model = TcpModel(groups, motion, rotation, Clock(T, -1.0, T), np.arange(len(T)), position, rotation)
    rng = np.random.default_rng(4)
    state = State(numbers * rng.uniform(-0.2, 0.2, sum(len(group.columns) for group in groups)))
    return model, state


def test_the_jacobian_of_a_place_is_its_slope_at_no_change() -> None:
    assert_linear(*place_model(0.0))


def test_it_is_so_far_away_where_nothing_of_the_turn_is_left() -> None:
    model, state = place_model(1.0)
    of = whole_frames(model, state)
    base, tool = (rotation_matrix(state.of(of[kind])) for kind in ("base_rotation", "tool_rotation"))
    assert model.turns is not None
    assert_linear(replace(model, rotation=np.einsum("ij,jkn,kl->iln", base, model.turns, tool)), state)


def whole_frames(model: Model, state: State) -> dict[str, Group]:
    """Return the groups by kind, of frames those with three numbers; the others become 0."""
    of: dict[str, Group] = {group.kind: group for group in model.groups}  # the last of a kind
    for group in model.groups:
        if group is not of[group.kind] or group.name == "clock":
            state.values[list(group.columns)] = 0.0
    return of


def rotation_matrix(rpy: FloatArray) -> FloatArray:
    """Rz Ry Rx by SciPy."""
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix())


def test_a_place_is_the_base_then_the_pose_then_the_tool() -> None:
    model, state = place_model(1.0)
    of = whole_frames(model, state)
    assert model.turns is not None
    tip = model.motion.value + np.einsum("ijn,j->in", model.turns, state.of(of["tool_shift"]))
    there = rotation_matrix(state.of(of["base_rotation"])) @ tip + state.of(of["base_shift"])[:, np.newaxis]
    left = model.residual(state, np.arange(model.rows))[:3]
    np.testing.assert_allclose(left, model.position - there, atol=1e-14)


def test_groups_are_the_parameters_that_an_arm_is_known_by() -> None:
    for robot in ("urm6", "ur5e", "panda"):
        chain, model = load_robot(robot), nominal(load_robot(robot), rich_motion(load_robot(robot)), T)
        values = {one.name: float(one.value) for one in chain.parameters}
        for group in (one for one in model.groups if one.name in values):
            longer = chain.with_parameters({group.name: values[group.name] + 0.01})
            wanted = poses(longer, rich_motion(chain)(T), oriented=False)[0]
            state = state_of(model, {f"{group.kind}:{group.name}": np.array([0.01])})
            np.testing.assert_allclose(
                model.residual(state, ROWS), (model.position - wanted)[:, ROWS], atol=1e-13
            )


def named(groups: tuple[Group, ...], kind: str) -> list[str]:
    return [one.name for one in groups if one.kind == kind]


def test_an_arm_without_such_parameters_has_a_length_a_segment_and_two_tilts_a_joint() -> None:
    model = nominal(rail_arm(), rich_motion(rail_arm()), T)
    assert len(named(model.groups, "link_length")) == 7
    assert [name for name in named(model.groups, "tilt") if name.startswith("lift")] == [
        "lift about x",
        "lift about y",
    ]
    assert named(model.groups, "joint_offset") == [*rail_arm().coordinates]
