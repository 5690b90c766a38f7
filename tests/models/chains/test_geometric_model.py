"""The geometric model of chains of rotations and translations, against matrix products and the chain."""

from __future__ import annotations

import math
from typing import Any

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from direct_geometric_model import geometric_model
from urmpipe_models.arm.geometric_models import GeometricModelRow, geometric_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import forward

ROUNDING = 2e-14
"""Up to seven products of matrices and sums of vectors of up to 14 m."""

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


def test_a_chain_of_rows_names_its_joints_and_keeps_their_kinds() -> None:
    rows = (GeometricModelRow("T", "x", name="slide"), GeometricModelRow("R", "y"))
    chain = geometric_chain("arm", rows, start=(0.1, 0.2), description="two joints", source="a test")
    assert [(joint.name, joint.kind, joint.axis) for joint in chain.joints] == [
        ("slide", "prismatic", (1.0, 0.0, 0.0)),
        ("q2", "revolute", (0.0, 1.0, 0.0)),
    ]
    assert (chain.start, chain.description, chain.source) == ((0.1, 0.2), "two joints", "a test")
    bare = geometric_chain("arm", rows)
    assert (bare.start, bare.description, bare.source) == ((0.0, 0.0), "", "")
    with pytest.raises(RobotError) as caught:
        geometric_chain("none", ())
    assert str(caught.value) == "robot none: has no moving joint; at least one is needed"


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
