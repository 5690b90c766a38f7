"""Denavit-Hartenberg arms against the products of their matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from urmpipe_models.arm.geometric_models import DHRow, dh_chain, modified_dh_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.math3d import Transform, from_offset

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
def test_names_limits_and_speeds_go_into_the_chain(build: Any) -> None:
    rows = [DHRow(name="turn", lower=-1.0, upper=2.0, velocity=3.0, acceleration=4.0)]
    rows += [DHRow(kind="prismatic", upper=0.5)]
    chain = build("arm", rows, start=(0.1, 0.2), description="two joints", source="a test")
    turn, slide = chain.joints
    assert (turn.name, turn.lower, turn.upper, turn.velocity, turn.acceleration) == (
        "turn",
        -1.0,
        2.0,
        3.0,
        4.0,
    )
    assert (slide.name, slide.kind, slide.lower, slide.upper) == ("q2", "prismatic", -math.inf, 0.5)
    assert (chain.name, chain.start) == ("arm", (0.1, 0.2))
    assert (chain.description, chain.source) == ("two joints", "a test")
    plain = build("arm", rows)
    assert (plain.start, plain.description, plain.source) == ((0.0, 0.0), "", "")
    assert (plain.base, plain.tool) == (Transform(), Transform())


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


def test_an_arm_needs_a_joint() -> None:
    for build in (dh_chain, modified_dh_chain):
        with pytest.raises(RobotError) as caught:
            build("none", [])
        assert str(caught.value) == "robot none: has no moving joint; at least one is needed"
