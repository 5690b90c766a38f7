"""Chains from geometric models, against the products of their matrices. geometric.cases has the rest."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from scipy.spatial.transform import Rotation

from direct_geometric_model import geometric_model
from urmpipe_models.arm import denavit_hartenberg as builders
from urmpipe_models.arm.denavit_hartenberg import DHRow, GeometricModelRow
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.math3d import Transform, from_offset

ROUNDING = 2e-14  # up to seven products of 4x4 matrices with entries of up to 14 m


def row_values(row: DHRow, q: float) -> tuple[float, ...]:
    """Return cosines and sines of theta and alpha, and d, of a row at its coordinate."""
    theta, d = (row.theta + q, row.d) if row.kind == "revolute" else (row.theta, row.d + q)
    return math.cos(theta), math.sin(theta), math.cos(row.alpha), math.sin(row.alpha), d


def standard(row: DHRow, q: float) -> FloatArray:
    """A_i as the textbooks print it."""
    ct, st_, ca, sa, d = row_values(row, q)
    rows = [ct, -st_ * ca, st_ * sa, row.a * ct], [st_, ct * ca, -ct * sa, row.a * st_], [0.0, sa, ca, d]
    return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])


def modified(row: DHRow, q: float) -> FloatArray:
    """Craig's matrix, his equation 3.6."""
    ct, st_, ca, sa, d = row_values(row, q)
    rows = [ct, -st_, 0.0, row.a], [st_ * ca, ct * ca, -sa, -sa * d], [st_ * sa, ct * sa, ca, ca * d]
    return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])


def homogeneous(frame: Transform) -> FloatArray:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = frame.rotation, frame.translation
    return result


MATRICES = [(builders.dh_chain, standard), (builders.modified_dh_chain, modified)]


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@pytest.mark.parametrize(("build", "matrix"), MATRICES)
@given(data=st.data())
def test_the_tip_is_the_product_of_the_matrices(
    build: Any, matrix: Any, dh_rows: SearchStrategy[list[DHRow]], data: st.DataObject
) -> None:
    """And the points of a standard arm are the origins of its frames."""
    rows = data.draw(dh_rows)
    q = data.draw(st.lists(st.floats(-4.0, 4.0), min_size=len(rows), max_size=len(rows)))
    base, tool = from_offset([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), from_offset([0.0, 0.0, 0.15])
    *_, tip = points = forward(build("arm", rows, base=base, tool=tool), q)
    expected = homogeneous(base)
    for row, value, point in zip(rows, q, points, strict=True):
        expected = expected @ matrix(row, value)
        if matrix is standard and point is not tip:
            np.testing.assert_allclose(point.translation, expected[:3, 3], rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(homogeneous(tip), expected @ homogeneous(tool), rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize(("build", "matrix"), MATRICES)
def test_a_fixed_row_is_its_matrix_and_takes_no_coordinate(build: Any, matrix: Any) -> None:
    first, second = DHRow(0.1, 0.2, 0.3, 0.4), DHRow(0.9, -0.2, 0.1, -0.4, kind="prismatic")
    still, end = DHRow(0.5, 0.6, 0.7, 0.8), DHRow(-0.3, 0.1, 0.2, 1.1, name="flange")
    chain = build("arm", [first, replace(still, kind="fixed"), second, replace(end, kind="fixed")])
    assert chain.coordinates == ("q1", "q2")
    assert [joint.name for joint in chain.joints] == ["q1", "frame2", "q2", "flange"]
    expected = matrix(first, 1.2) @ matrix(still, 0.0) @ matrix(second, 0.7) @ matrix(end, 0.0)
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
places = st.tuples(lengths, lengths, lengths)
geometric_rows = st.builds(GeometricModelRow, st.sampled_from("RT"), st.sampled_from("xyz"), places)


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
    tip = data.draw(places)
    model = geometric_model(rows, q, tip)
    rotations, steps = products(rows, q, tip)
    np.testing.assert_allclose(model.rotations, rotations, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(model.steps, steps, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(model.positions, np.cumsum(steps, axis=0), rtol=0.0, atol=ROUNDING)
    poses = forward(builders.geometric_chain("arm", rows, tip=tip), q)
    np.testing.assert_allclose(model.rotations[-1], poses[-1].rotation, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(model.positions[-1], poses[-1].translation, rtol=0.0, atol=ROUNDING)
    seen = model.seen(tip)
    assert seen[-1] == tip
    np.testing.assert_allclose(seen[0], steps[-1], rtol=0.0, atol=ROUNDING)


def test_an_arm_that_slides_by_hand() -> None:
    s1, turn, s3, s4, swing = 0.1, math.pi / 2, 0.2, -0.3, math.pi / 2
    model = geometric_model(TRTTR1, [s1, turn, s3, s4, swing], TIP)
    # up by 0.4 + 0.1; then y becomes -x and x becomes y; then the gripper's y points up and its z along x
    expected = [(0.0, 0.0, 0.5), (0.0, 0.1, 0.2), (-0.5, 0.05, 0.0), (0.0, -0.2, -0.2)]
    expected += [(-0.25, 0.0, 0.0), (0.03, 0.0, 0.12)]
    np.testing.assert_allclose(model.steps, expected, rtol=0.0, atol=1e-16)
    pose = (-0.72, -0.05, 0.62, math.pi / 2, math.pi / 2, 0.0)
    np.testing.assert_allclose(model.positions[-1], pose[:3], rtol=0.0, atol=2e-16)
    axes = model.equations[3:]
    np.testing.assert_allclose(axes, (0, 1, 0, 0, 0, 1, 1, 0, 0), rtol=0.0, atol=1e-16)
    assert model.equations[:3] == model.positions[-1]
    np.testing.assert_allclose(model.operational, pose, rtol=0.0, atol=2e-16)


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
