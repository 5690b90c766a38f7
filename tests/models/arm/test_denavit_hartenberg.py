"""Chains from geometric models, against the products of their matrices."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from scipy.spatial.transform import Rotation

from asserting import refusal
from direct_geometric_model import geometric_model
from urmpipe_models.arm.denavit_hartenberg import (
    DHRow,
    GeometricModelRow,
    articulated_6r,
    dh_chain,
    geometric_chain,
    modified_dh_chain,
    urm_chain,
)
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.math3d import Transform, from_offset, translation

ROUNDING = 2e-14  # up to seven products of 4x4 matrices with entries of up to 14 m


def standard(row: DHRow, q: float) -> FloatArray:
    """A_i as the textbooks print it."""
    theta, d = (row.theta + q, row.d) if row.kind == "revolute" else (row.theta, row.d + q)
    ct, st_, ca, sa = math.cos(theta), math.sin(theta), math.cos(row.alpha), math.sin(row.alpha)
    return np.array(
        [
            [ct, -st_ * ca, st_ * sa, row.a * ct],
            [st_, ct * ca, -ct * sa, row.a * st_],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def modified(row: DHRow, q: float) -> FloatArray:
    """Craig's matrix, his equation 3.6."""
    theta, d = (row.theta + q, row.d) if row.kind == "revolute" else (row.theta, row.d + q)
    ct, st_, ca, sa = math.cos(theta), math.sin(theta), math.cos(row.alpha), math.sin(row.alpha)
    return np.array(
        [
            [ct, -st_, 0.0, row.a],
            [st_ * ca, ct * ca, -sa, -sa * d],
            [st_ * sa, ct * sa, ca, ca * d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def homogeneous(frame: Transform) -> FloatArray:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = frame.rotation, frame.translation
    return result


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@pytest.mark.parametrize(("build", "matrix"), [(dh_chain, standard), (modified_dh_chain, modified)])
@given(data=st.data())
def test_the_tip_is_the_product_of_the_matrices(
    build: Any, matrix: Any, dh_rows: SearchStrategy[list[DHRow]], data: st.DataObject
) -> None:
    rows = data.draw(dh_rows)
    q = data.draw(st.lists(st.floats(-4.0, 4.0), min_size=len(rows), max_size=len(rows)))
    base, tool = from_offset([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), from_offset([0.0, 0.0, 0.15])
    chain = build("arm", rows, base=base, tool=tool)
    expected = homogeneous(base)
    for row, value in zip(rows, q, strict=True):
        expected = expected @ matrix(row, value)
    got = homogeneous(forward(chain, q)[-1])
    np.testing.assert_allclose(got, expected @ homogeneous(tool), rtol=0.0, atol=ROUNDING)


@pytest.mark.slow
@given(data=st.data())
def test_the_points_of_a_standard_arm_are_its_frames_origins(
    dh_rows: SearchStrategy[list[DHRow]], data: st.DataObject
) -> None:
    rows = data.draw(dh_rows)
    expected = np.eye(4)
    for row, point in zip(rows, forward(dh_chain("arm", rows), [0.3] * len(rows)), strict=True):
        expected = expected @ standard(row, 0.3)
        np.testing.assert_allclose(point.translation, expected[:3, 3], rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("build", [dh_chain, modified_dh_chain])
def test_limits_and_speeds_of_rows_go_into_the_chain(build: Any) -> None:
    rows = [DHRow(name="turn", lower=-1.0, upper=2.0, velocity=3.0, acceleration=4.0, effort=5.0)]
    turn, slide = build("arm", [*rows, DHRow(kind="prismatic", upper=0.5)]).joints
    limits = (turn.lower, turn.upper, turn.velocity, turn.acceleration, turn.effort)
    assert (turn.name, limits) == ("turn", (-1.0, 2.0, 3.0, 4.0, 5.0))
    assert (slide.name, slide.kind, slide.lower, slide.upper) == ("q2", "prismatic", -math.inf, 0.5)
    plain = build("arm", rows)
    assert (plain.base, plain.tool) == (Transform(), Transform())


BUILDERS: dict[str, tuple[Any, int]] = {  # and the coordinates of the arm
    "dh": (partial(dh_chain, rows=[DHRow(), DHRow()]), 2),
    "modified_dh": (partial(modified_dh_chain, rows=[DHRow(), DHRow()]), 2),
    "geometric": (
        partial(geometric_chain, rows=[GeometricModelRow("T", "x"), GeometricModelRow("R", "y")]),
        2,
    ),
    "urm": (partial(urm_chain, lengths=(0.3, 0.2, 0.1), tilts=(0.5, -0.7)), 2),
    "articulated_6r": (partial(articulated_6r, 0.3, 0.1, 0.45, 0.4, 0.15), 6),
}


@pytest.mark.parametrize("kind", BUILDERS)
def test_name_start_and_words_go_into_the_chain(kind: str) -> None:
    build, count = BUILDERS[kind]
    chain = build(name="arm", start=range(count), description="short", source="a test")
    assert (chain.name, chain.start) == ("arm", tuple(map(float, range(count))))
    assert (chain.description, chain.source) == ("short", "a test")
    bare = build(name="arm")
    assert (bare.start, bare.description, bare.source) == ((0.0,) * count, "", "")


@pytest.mark.parametrize("build", [dh_chain, modified_dh_chain, geometric_chain])
def test_an_arm_needs_a_joint(build: Any) -> None:
    assert refusal(RobotError, build, "none", []) == "robot none: has no moving joint; at least one is needed"


@pytest.mark.parametrize(("build", "matrix"), [(dh_chain, standard), (modified_dh_chain, modified)])
def test_a_fixed_row_is_its_matrix_and_takes_no_coordinate(build: Any, matrix: Any) -> None:
    rows = [
        DHRow(0.1, 0.2, 0.3, 0.4),
        DHRow(0.5, 0.6, 0.7, 0.8, kind="fixed"),
        DHRow(0.9, -0.2, 0.1, -0.4, kind="prismatic"),
        DHRow(-0.3, 0.1, 0.2, 1.1, name="flange", kind="fixed"),
    ]
    chain = build("arm", rows)
    assert chain.coordinates == ("q1", "q2")
    assert [joint.name for joint in chain.joints] == ["q1", "frame2", "q2", "flange"]
    still = DHRow(0.5, 0.6, 0.7, 0.8), DHRow(-0.3, 0.1, 0.2, 1.1)  # the same rows as joints at 0
    expected = matrix(rows[0], 1.2) @ matrix(still[0], 0.0) @ matrix(rows[2], 0.7) @ matrix(still[1], 0.0)
    got = homogeneous(forward(chain, [1.2, 0.7])[-1])
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=ROUNDING)


TRTTR1 = (
    GeometricModelRow("T", "z", (0.0, 0.0, 0.4)),
    GeometricModelRow("R", "z", (0.0, 0.1, 0.2)),
    GeometricModelRow("T", "y", (0.05, 0.3, 0.0)),
    GeometricModelRow("T", "x", (0.1, 0.0, -0.2)),
    GeometricModelRow("R", "x", (0.0, 0.25, 0.0)),
)
"""Translations along all axes and rotations about two; its lengths are made up."""

TIP = (0.0, 0.12, 0.03)

lengths = st.floats(-1.0, 1.0, allow_subnormal=False)
geometric_rows = st.builds(
    GeometricModelRow,
    st.sampled_from(["R", "T"]),
    st.sampled_from(["x", "y", "z"]),
    st.tuples(lengths, lengths, lengths),
)


def products(rows: Any, q: Any, tip: Any) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return [R]_k^0 and p_{k,k-1} by NumPy and SciPy."""
    rotation, rotations, steps = np.eye(3), [], []
    for row, value in zip(rows, q, strict=True):
        axis = np.eye(3)["xyz".index(row.axis)]
        steps.append(rotation @ (np.array(row.r) + (value * axis if row.kind == "T" else 0.0)))
        if row.kind == "R":
            rotation = rotation @ Rotation.from_rotvec(value * axis).as_matrix()
        rotations.append(rotation)
    return rotations, [*steps, rotation @ np.array(tip)]


@pytest.mark.slow
@given(st.lists(geometric_rows, min_size=1, max_size=7), st.data())
def test_it_is_matrix_products_and_the_chain(rows: list[GeometricModelRow], data: st.DataObject) -> None:
    q = data.draw(st.lists(st.floats(-4.0, 4.0), min_size=len(rows), max_size=len(rows)))
    tip = data.draw(st.tuples(lengths, lengths, lengths))
    model = geometric_model(rows, q, tip)
    rotations, steps = products(rows, q, tip)
    np.testing.assert_allclose(model.rotations, rotations, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(model.steps, steps, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(model.positions, np.cumsum(steps, axis=0), rtol=0.0, atol=ROUNDING)
    poses = forward(geometric_chain("arm", rows, tip=tip), q)
    np.testing.assert_allclose(model.rotations[-1], poses[-1].rotation, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(model.positions[-1], poses[-1].translation, rtol=0.0, atol=ROUNDING)
    seen = model.seen(tip)
    assert seen[-1] == tip
    np.testing.assert_allclose(seen[0], steps[-1], rtol=0.0, atol=ROUNDING)


def test_rows_name_joints_and_give_their_kinds() -> None:
    rows = (GeometricModelRow("T", "x", name="slide"), GeometricModelRow("R", "y"))
    assert [(joint.name, joint.kind, joint.axis) for joint in geometric_chain("arm", rows).joints] == [
        ("slide", "prismatic", (1.0, 0.0, 0.0)),
        ("q2", "revolute", (0.0, 1.0, 0.0)),
    ]


def test_an_arm_that_slides_by_hand() -> None:
    s1, turn, s3, s4, swing = 0.1, math.pi / 2, 0.2, -0.3, math.pi / 2
    model = geometric_model(TRTTR1, [s1, turn, s3, s4, swing], TIP)
    # up by 0.4 + 0.1; then y becomes -x and x becomes y; then the gripper's y points up and its z along x
    expected = [
        (0.0, 0.0, 0.5),
        (0.0, 0.1, 0.2),
        (-0.5, 0.05, 0.0),
        (0.0, -0.2, -0.2),
        (-0.25, 0.0, 0.0),
        (0.03, 0.0, 0.12),
    ]
    np.testing.assert_allclose(model.steps, expected, rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(model.positions[-1], (-0.72, -0.05, 0.62), rtol=0.0, atol=2e-16)
    axes = model.equations[3:]
    np.testing.assert_allclose(axes, (0, 1, 0, 0, 0, 1, 1, 0, 0), rtol=0.0, atol=1e-16)
    assert model.equations[:3] == model.positions[-1]
    np.testing.assert_allclose(
        model.operational, (-0.72, -0.05, 0.62, math.pi / 2, math.pi / 2, 0.0), rtol=0.0, atol=2e-16
    )


def test_a_column_of_joint_values_and_symbols_take_the_same_lines() -> None:
    q = np.random.default_rng(5).uniform(-2.0, 2.0, (20, 5))
    columns = geometric_model(TRTTR1, list(q.T), TIP).operational
    singles = [geometric_model(TRTTR1, row, TIP).operational for row in q.tolist()]
    casadi.GlobalOptions.setNumpyMode(-1)
    symbols = casadi.SX.sym("q", 5)
    traced = casadi.vertcat(*geometric_model(TRTTR1, symbols.elements(), TIP).operational)
    function = casadi.Function("operational", [symbols], [traced])
    for k, single in enumerate(singles):
        got = [np.broadcast_to(column, 20)[k] for column in columns]
        np.testing.assert_allclose(got, single, rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(np.ravel(np.array(function(q[k]))), single, rtol=0.0, atol=1e-14)


LENGTHS = (0.3, 0.1, 0.45, 0.4, 0.15)


def test_six_joints_turn_about_z_x_x_z_x_z_the_last_three_in_the_wrist_centre() -> None:
    chain = articulated_6r(*LENGTHS)
    assert chain.name == "articulated6r"
    assert {joint.kind for joint in chain.joints} == {"revolute"}
    assert ["xyz"[joint.axis.index(1.0)] for joint in chain.joints] == ["z", "x", "x", "z", "x", "z"]
    heights = [joint.origin.translation for joint in chain.joints]
    assert heights == [(0.0, 0.0, z) for z in (*LENGTHS[:4], 0.0, 0.0)]
    assert chain.tip.translation == (0.0, 0.0, LENGTHS[4])


def test_urm_modules_are_joints_about_z_and_a_tilted_effector() -> None:
    chain = urm_chain("two", (0.3, 0.2, 0.1), (0.5, math.pi / 2), directions=(1, -1), start=(0.1, 0.2))
    assert chain.coordinates == ("phi1", "phi2")
    assert [joint.axis for joint in chain.moving] == [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    assert chain.joints[0].origin == Transform()
    assert chain.joints[1].origin.translation == (0.0, 0.0, 0.3)
    assert (chain.joints[2].name, chain.joints[2].kind) == ("effector", "fixed")
    assert chain.joints[2].origin.rotation == ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
    assert chain.tip == translation(0.0, 0.0, 0.1)
    limits = [(joint.upper, joint.velocity, joint.acceleration) for joint in chain.joints]
    assert limits == [(math.inf,) * 3] * 3


def test_urm_counts_and_directions_must_fit() -> None:
    said = "robot odd: 2 lengths and 2 tilts; n modules need n + 1 lengths and n tilts"
    assert refusal(RobotError, urm_chain, "odd", (0.3, 0.2), (0.5, 0.5)) == said
    said = "robot odd: directions [2]; allowed: 1 values, each 1 or -1"
    assert refusal(RobotError, urm_chain, "odd", (0.3, 0.2), (0.5,), directions=(2,)) == said
