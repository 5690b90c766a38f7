"""Orientations in the forms in which logs record them, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation, Slerp

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import (
    FORMS,
    RotationForm,
    angle_between,
    column_count,
    conjugate,
    quaternion_product,
    slerp,
    to_matrices,
    to_quaternions,
)

ROUNDING = 1e-14
"""Some tens of rounding errors of numbers up to 1."""


def recorded(rotation: Rotation, form: RotationForm) -> FloatArray:
    """SciPy's columns of a form; capital letters are axes that move along."""
    match form:
        case "vector":
            return rotation.as_rotvec()
        case "rpy":
            return rotation.as_euler("xyz")
        case "quat_xyzw":
            return rotation.as_quat()
        case "quat_wxyz":
            return rotation.as_quat()[:, [3, 0, 1, 2]]
        case "matrix":
            return rotation.as_matrix().reshape(-1, 9)
    return rotation.as_euler(form.upper())  # type: ignore[call-overload,no-any-return]


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_rotation_that_scipy_wrote(form: RotationForm) -> None:
    rotation = Rotation.random(500, rng=np.random.default_rng(3))
    columns = recorded(rotation, form)
    assert columns.shape == (500, column_count(form))
    found = to_quaternions(columns, form)
    np.testing.assert_allclose(angle_between(found, rotation.as_quat()), 0.0, atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=ROUNDING)


@pytest.mark.parametrize("form", FORMS)
def test_a_missing_sample_stays_missing(form: RotationForm) -> None:
    columns = recorded(Rotation.random(3, rng=np.random.default_rng(4)), form)
    columns[1, -1] = np.nan
    found = to_quaternions(columns, form)
    assert np.isnan(found[1]).any()
    assert np.isfinite(found[[0, 2]]).all()


def test_half_turns_as_matrices() -> None:
    """1 + trace R is 0: only another component can be divided by."""
    half_turns = Rotation.from_rotvec(np.pi * np.eye(3))
    found = to_quaternions(half_turns.as_matrix().reshape(-1, 9), "matrix")
    np.testing.assert_allclose(np.abs(found), np.eye(3, 4), atol=ROUNDING)


def test_a_quaternion_is_brought_to_unit_length() -> None:
    found = to_quaternions(np.array([[0.0, 0.0, 0.0, 2.0]]), "quat_xyzw")
    assert found.tolist() == [[0.0, 0.0, 0.0, 1.0]]


def test_quaternions_of_rotation_vectors() -> None:
    half = np.sqrt(0.5)
    found = to_quaternions(
        np.array([[0, 0, 0], [0, 0, np.pi / 2], [np.pi, 0, 0], [0, -np.pi / 2, 0], [1e-9, 0, 0]]), "vector"
    )
    expected = [[0, 0, 0, 1], [0, 0, half, half], [1, 0, 0, 0], [0, -half, 0, half], [5e-10, 0, 0, 1]]
    np.testing.assert_allclose(found, expected, atol=1e-15)  # a few rounding errors of numbers up to 1


def test_the_angle_between_an_orientation_and_its_negative_is_none() -> None:
    first = Rotation.random(10, rng=np.random.default_rng(5))
    turned = first * Rotation.from_rotvec([0.0, 0.0, 0.25])
    np.testing.assert_allclose(angle_between(first.as_quat(), -turned.as_quat()), 0.25, atol=ROUNDING)
    np.testing.assert_allclose(angle_between(first.as_quat(), -first.as_quat()), 0.0, atol=ROUNDING)


def test_matrices_are_those_of_scipy() -> None:
    rotation = Rotation.random(500, rng=np.random.default_rng(6))
    np.testing.assert_allclose(to_matrices(rotation.as_quat()), rotation.as_matrix(), atol=ROUNDING)
    np.testing.assert_array_equal(to_matrices(np.array([[0.0, 0.0, 0.0, 1.0]])), np.eye(3)[np.newaxis])


def test_a_product_is_the_second_rotation_followed_by_the_first() -> None:
    first, second = (Rotation.random(200, rng=np.random.default_rng(seed)) for seed in (7, 8))
    found = quaternion_product(first.as_quat(), second.as_quat())
    np.testing.assert_allclose(to_matrices(found), (first * second).as_matrix(), atol=ROUNDING)
    undone = quaternion_product(conjugate(first.as_quat()), found)
    np.testing.assert_allclose(to_matrices(undone), second.as_matrix(), atol=ROUNDING)


def test_angles_are_exact_from_nothing_to_half_a_turn() -> None:
    """The cosine of an angle near 0 or pi has half of its digits: arccos would be off by 1e-8."""
    first = Rotation.random(1, rng=np.random.default_rng(9))
    near = np.concatenate(([0.0], np.logspace(-15, -1, 57)))
    for angle in (*near, *(np.pi - near)):
        turned = first * Rotation.from_rotvec([0.0, angle, 0.0])
        found = float(angle_between(first.as_quat(), turned.as_quat())[0])
        assert found == pytest.approx(angle, rel=0.0, abs=2e-15)  # some rounding errors of numbers up to pi


unit_quaternions = arrays(np.float64, (3, 4), elements=st.floats(-1, 1)).filter(
    lambda quat: bool((np.linalg.norm(quat, axis=1) > 1e-3).all())
)


@settings(max_examples=50, deadline=None)
@given(unit_quaternions, unit_quaternions, st.floats(0, 1))
def test_orientations_between_two_are_those_of_scipy(
    first: FloatArray, second: FloatArray, share: float
) -> None:
    one, other = (quat / np.linalg.norm(quat, axis=1, keepdims=True) for quat in (first, second))
    # Half a turn apart both ways round are as short, and either may be taken.
    assume(bool((angle_between(one, other) < np.pi - 1e-6).all()))
    found = slerp(one, other, np.full(3, share))
    for k in range(3):
        ends = Rotation.from_quat(np.vstack((one[k], other[k])))
        expected = Slerp([0.0, 1.0], ends)([share]).as_quat()
        assert angle_between(found[[k]], expected)[0] < ROUNDING
        passed = angle_between(one[[k]], found[[k]])[0]
        assert passed == pytest.approx(share * angle_between(one[[k]], other[[k]])[0], rel=0, abs=ROUNDING)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=ROUNDING)


def test_at_an_end_of_the_way_stands_that_end() -> None:
    there, missing = np.array([[0.5, 0.5, 0.5, 0.5]]), np.full((1, 4), np.nan)
    np.testing.assert_array_equal(slerp(there, missing, np.array([0.0])), there)
    np.testing.assert_array_equal(slerp(missing, there, np.array([1.0])), there)
    assert np.isnan(slerp(there, missing, np.array([0.5]))).all()
