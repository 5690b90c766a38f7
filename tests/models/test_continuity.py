"""Continuity of orientations: the same rotations, no jump between their names."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import FORMS, RotationForm, from_rpy, to_quaternions
from urmpipe_models.wraps import (
    unwrap_euler,
    unwrap_orientations,
    unwrap_quaternions,
    unwrap_rotation_vectors,
)

SIZE = 1e-13
"""Angles to 20 rad are wrapped and turned back, two roundings of 4e-15, and go through sine and cosine."""

steps = st.lists(st.tuples(*[st.floats(-0.3, 0.3)] * 3), min_size=1, max_size=60)


def matrices(angles: FloatArray) -> FloatArray:
    return np.array([np.array(from_rpy(rx, ry, rz).rotation, dtype=float) for rz, ry, rx in angles])


def wrap(x: FloatArray) -> FloatArray:
    return x - 2 * np.pi * np.floor((x + np.pi) / (2 * np.pi))


@settings(max_examples=40, deadline=None)
@given(steps, st.lists(st.booleans(), min_size=60, max_size=60))
def test_quaternions_of_any_sign_become_continuous(moves: list[tuple[float, ...]], flips: list[bool]) -> None:
    true = np.cumsum(np.array([[0.0, 0.0, 0.0, 5.0], *([*move, 0.0] for move in moves)]), axis=0)
    true /= np.linalg.norm(true, axis=1)[:, np.newaxis]
    signs = np.where([False, *flips[: len(moves)]], -1.0, 1.0)
    np.testing.assert_array_equal(unwrap_quaternions(true * signs[:, np.newaxis]), true)


@given(st.lists(st.floats(-0.9, 0.9), min_size=1, max_size=60), st.floats(0.0, 0.02), st.floats(0.3, 3.0))
def test_a_turn_about_a_drifting_axis_goes_on_past_pi(turns: list[float], drift: float, start: float) -> None:
    """The angle stays away from whole turns, about which no vector is continuous."""
    angle = np.clip(start + np.cumsum([0.0, *turns]), 0.3, 5.9)
    lean = drift * np.arange(len(angle))
    axis = np.column_stack((np.sin(lean), np.zeros(len(angle)), np.cos(lean)))
    true = axis * angle[:, np.newaxis]
    recorded = axis * wrap(angle)[:, np.newaxis]  # of a length up to pi, as a controller writes it
    np.testing.assert_allclose(unwrap_rotation_vectors(recorded), true, rtol=0, atol=SIZE)


@given(st.lists(st.tuples(*[st.floats(-6.0, 6.0)] * 3), min_size=1, max_size=40))
@example([(0.0, 0.0, 4.0), (0.0, 0.0, 1.6e-160)])
@example([(0.0, 0.0, 4.0), (0.0, 5e-324, 0.0)])
def test_continuous_vectors_are_the_same_rotations(vectors: list[tuple[float, ...]]) -> None:
    v = np.array(vectors)
    found = unwrap_rotation_vectors(v)
    np.testing.assert_array_equal(found[0], v[0])
    before, after = (to_quaternions(one, "vector") for one in (v, found))
    same = np.abs(np.einsum("ij,ij->i", before, after))
    # 40 samples may add up to 40 turns: the half angles, to 125 rad, round at 3e-14
    np.testing.assert_allclose(same, 1.0, rtol=0, atol=1e-12)


def test_a_flip_at_pi_is_undone_and_a_rest_keeps_its_axis() -> None:
    v = np.array([[0.0, 0.0, 3.1], [0.0, 0.0, -3.1], [np.nan] * 3, [0.0, 0.0, -0.1], [0.0, 0.0, 0.0]])
    full = 2 * np.pi
    expected = [[0, 0, 3.1], [0, 0, full - 3.1], [np.nan] * 3, [0, 0, full - 0.1], [0, 0, full]]
    np.testing.assert_allclose(unwrap_rotation_vectors(v), expected, rtol=0, atol=2e-15)


def test_a_record_that_begins_with_rests_goes_on_about_the_first_axis_that_there_is() -> None:
    v = np.array([[0.0] * 3, [0.0] * 3, [0.0, 3.0, 0.0], [0.0, 3.0 - 2 * np.pi, 0.0], [0.0] * 3])
    expected = [[0.0] * 3, [0.0] * 3, [0.0, 3.0, 0.0], [0.0, 3.0, 0.0], [0.0] * 3]
    np.testing.assert_allclose(unwrap_rotation_vectors(v), expected, rtol=0, atol=1e-15)


def test_a_vector_goes_on_by_a_turn_though_none_of_its_components_is_large() -> None:
    """From (1, 1, 1) to (-1, -1, -1): two square roots of 3 back, or a turn less so much on."""
    v = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]])
    expected = [[1.0] * 3, [2 * np.pi / np.sqrt(3.0) - 1.0] * 3]
    np.testing.assert_allclose(unwrap_rotation_vectors(v), expected, rtol=0, atol=1e-15)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    steps,
    st.lists(st.booleans(), min_size=60, max_size=60),
    st.integers(0, 59),
    st.tuples(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0)),
)
def test_euler_angles_of_either_family_become_continuous(
    moves: list[tuple[float, ...]], swaps: list[bool], missing: int, start: tuple[float, float, float]
) -> None:
    true = np.cumsum(np.array([start, *moves]), axis=0)
    true[:, 1] = np.clip(true[:, 1], -1.2, 1.2)  # at +-pi/2 the two families meet
    swapped = np.array([False, *swaps[: len(moves)]])[:, np.newaxis]
    recorded = wrap(np.where(swapped, true * [1.0, -1.0, 1.0] + np.pi, true))
    recorded[0] = true[0]
    np.testing.assert_allclose(matrices(recorded), matrices(true), rtol=0, atol=SIZE)
    np.testing.assert_allclose(unwrap_euler(recorded), true, rtol=0, atol=SIZE)
    if 0 < missing < len(true):  # steps of up to 0.6 then, still below the quarter turn between the families
        recorded[missing] = true[missing] = np.nan
        np.testing.assert_allclose(unwrap_euler(recorded), true, rtol=0, atol=SIZE)


def test_euler_angles_go_straight_through_the_vertical() -> None:
    """ry from 80 to 100 deg: atan2 names it 80 with rz and rx half a turn off."""
    ry = np.radians(np.arange(80.0, 101.0, 3.0))
    true = np.column_stack((np.full_like(ry, 0.3), ry, np.full_like(ry, -0.2)))
    beyond = (ry > np.pi / 2)[:, np.newaxis]
    recorded = np.where(beyond, wrap(true * [1.0, -1.0, 1.0] + np.pi), true)
    np.testing.assert_allclose(unwrap_euler(recorded), true, rtol=0, atol=1e-14)


def test_of_two_names_that_are_equally_near_the_recorded_one_stays() -> None:
    """A quarter turn of two axes: the other family, half a turn off, is a quarter turn away as well."""
    recorded = np.array([[0.0, 0.0, 0.0], [-np.pi / 2, 0.0, -np.pi / 2]])
    np.testing.assert_array_equal(unwrap_euler(recorded, proper=True), recorded)
    half_a_turn = np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0]])
    np.testing.assert_array_equal(unwrap_quaternions(half_a_turn), half_a_turn)


@pytest.mark.parametrize(
    ("work", "width"), [(unwrap_quaternions, 4), (unwrap_rotation_vectors, 3), (unwrap_euler, 3)]
)
def test_records_without_samples_pass_through(work: object, width: int) -> None:
    assert callable(work)
    assert work(np.empty((0, width))).shape == (0, width)
    assert np.isnan(work(np.full((3, width), np.nan))).all()
    assert work(np.zeros((2, width))).tolist() == np.zeros((2, width)).tolist()


FLIPPED: dict[RotationForm, list[list[float]]] = {
    "vector": [[0.6 * 3.1, 0.0, 0.8 * 3.1], [0.6 * (3.1 - 2 * np.pi), 0.0, 0.8 * (3.1 - 2 * np.pi)]],
    "rpy": [[0.1, 0.2, 0.3], [0.1 - np.pi, np.pi - 0.2, 0.3 - np.pi]],
    "zyx": [[0.1, 1.5, 0.3], [0.1 + np.pi, np.pi - 1.5, 0.3 - np.pi]],
    "xyz": [[0.1, -1.5, 0.3], [0.1 + np.pi, np.pi + 1.5, 0.3 + np.pi]],
    "zyz": [[0.1, 0.2, 0.3], [0.1 + np.pi, -0.2, 0.3 - np.pi]],
    "zxz": [[0.1, -0.2, 0.3], [0.1 - np.pi, 0.2, 0.3 + np.pi]],
    "quat_xyzw": [[0.5, -0.5, 0.5, -0.5], [-0.5, 0.5, -0.5, 0.5]],
    "quat_wxyz": [[0.6, 0.0, 0.8, 0.0], [-0.6, 0.0, -0.8, 0.0]],
    "matrix": [[0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]] * 2,
}
"""Two names of one rotation in each form."""


@pytest.mark.parametrize("form", FORMS)
def test_two_names_of_one_rotation_become_one_in_every_form(form: RotationForm) -> None:
    recorded = np.array(FLIPPED[form])
    before = to_quaternions(recorded, form)
    # what stands in the table are two names of one rotation: the quaternions agree but for their sign
    np.testing.assert_allclose(np.abs(before[0] @ before[1]), 1.0, rtol=0, atol=1e-15)
    found = unwrap_orientations(recorded, form)
    # pi is added and taken away: a few roundings of 4e-16
    np.testing.assert_allclose(found, recorded[[0, 0]], rtol=0, atol=3e-15)
