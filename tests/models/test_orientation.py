"""Orientations in the forms in which logs record them, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from urmpipe_models.kinematics import FloatArray
from urmpipe_models.orientation import FORMS, RotationForm, angle_between, quaternions, width

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
    assert columns.shape == (500, width(form))
    found = quaternions(columns, form)
    np.testing.assert_allclose(angle_between(found, rotation.as_quat()), 0.0, atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=ROUNDING)


@pytest.mark.parametrize("form", FORMS)
def test_a_missing_sample_stays_missing(form: RotationForm) -> None:
    columns = recorded(Rotation.random(3, rng=np.random.default_rng(4)), form)
    columns[1, -1] = np.nan
    found = quaternions(columns, form)
    assert np.isnan(found[1]).any()
    assert np.isfinite(found[[0, 2]]).all()


def test_half_turns_as_matrices() -> None:
    """1 + trace R is 0: only another component can be divided by."""
    half_turns = Rotation.from_rotvec(np.pi * np.eye(3))
    found = quaternions(half_turns.as_matrix().reshape(-1, 9), "matrix")
    np.testing.assert_allclose(np.abs(found), np.eye(3, 4), atol=ROUNDING)


def test_a_quaternion_is_brought_to_unit_length() -> None:
    found = quaternions(np.array([[0.0, 0.0, 0.0, 2.0]]), "quat_xyzw")
    assert found.tolist() == [[0.0, 0.0, 0.0, 1.0]]


def test_quaternions_of_rotation_vectors() -> None:
    half = np.sqrt(0.5)
    found = quaternions(
        np.array([[0, 0, 0], [0, 0, np.pi / 2], [np.pi, 0, 0], [0, -np.pi / 2, 0], [1e-9, 0, 0]]), "vector"
    )
    expected = [[0, 0, 0, 1], [0, 0, half, half], [1, 0, 0, 0], [0, -half, 0, half], [5e-10, 0, 0, 1]]
    np.testing.assert_allclose(found, expected, atol=1e-15)  # a few rounding errors of numbers up to 1


def test_the_angle_between_an_orientation_and_its_negative_is_none() -> None:
    first = Rotation.random(10, rng=np.random.default_rng(5))
    turned = first * Rotation.from_rotvec([0.0, 0.0, 0.25])
    np.testing.assert_allclose(angle_between(first.as_quat(), -turned.as_quat()), 0.25, atol=ROUNDING)
    np.testing.assert_allclose(angle_between(first.as_quat(), -first.as_quat()), 0.0, atol=ROUNDING)
