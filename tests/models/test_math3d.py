"""Transforms, Euler angles and forms of orientations: SciPy, and the laws of their groups."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation, Slerp

from asserting import assert_near
from orientation_columns import orientation_columns
from urmpipe_models.elementwise import Element, FloatArray
from urmpipe_models.math3d import (
    FORMS,
    RotationForm,
    Transform,
    column_count,
    conjugate,
    euler_zxz,
    euler_zyx,
    from_offset,
    from_rpy,
    from_zxz,
    is_angular,
    matrix_to_rpy,
    quaternion_product,
    rotation_about,
    rotation_angle,
    rotation_x,
    rotation_y,
    rotation_z,
    slerp,
    to_matrices,
    to_quaternions,
    to_rotation_vectors,
    translation,
)

ROUNDING = 2e-15  # a few products of entries up to 1, each rounded to 1.1e-16
angles = st.floats(-math.pi, math.pi)
units = st.floats(-1.0, 1.0)


def homogeneous(frame: Transform) -> FloatArray:
    """Return a pose as a matrix, shape (4, 4)."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = frame.rotation, frame.translation
    return result


AXES = [(1.0, 0, 0), (0, -1.0, 0), (0, 0, 1.0), (0.6, 0.0, -0.8), (1e-8, 0.0, 1.0), (0.0, 1.0, -1e-9)]
directions = st.tuples(angles, angles).map(
    lambda at: Rotation.from_euler("ZY", at).as_matrix()[:, 2].tolist()
)


@given(st.sampled_from(AXES) | directions, angles, st.lists(units, min_size=6, max_size=6))
def test_rotation_about_is_scipys_and_orthogonal_and_a_factor_of_rotated(
    axis: Sequence[float], angle: float, values: list[float]
) -> None:
    about, frame = rotation_about(axis, angle), from_offset(values)
    assert_near(about.rotation, Rotation.from_rotvec(angle * np.array(axis)).as_matrix(), ROUNDING)
    assert_near((about @ about.inverse()).rotation, np.eye(3), ROUNDING)
    turned = frame.rotated(axis, angle)
    assert_near(turned.rotation, (frame @ about).rotation, ROUNDING)
    assert turned.translation == frame.translation


@pytest.mark.parametrize(("turn", "axis"), [(rotation_x, "x"), (rotation_y, "y"), (rotation_z, "z")])
@pytest.mark.parametrize("quarters", range(-4, 5))
def test_constant_right_angles_are_exact(
    turn: Callable[[float], Transform], axis: str, quarters: int
) -> None:
    angle = quarters * math.pi / 2
    expected = np.rint(Rotation.from_euler(axis, angle).as_matrix())
    np.testing.assert_array_equal(turn(angle).rotation, expected)


@pytest.mark.parametrize("angle", [-2.5 * math.pi, 2.5 * math.pi])
def test_beyond_a_turn_a_constant_is_an_angle_as_any(angle: float) -> None:
    cosine = rotation_z(angle).rotation[0][0]
    assert cosine != 0.0
    assert abs(cosine - math.cos(angle)) < 1e-24  # so far pi is known: `elementwise.cosine_sine`


def test_constants_fold_away() -> None:
    q = np.linspace(-1.0, 1.0, 5)
    turned = translation(0.0, 0.0, 0.3) @ rotation_y(math.pi / 2) @ rotation_z(q)
    assert [row[2] for row in turned.rotation] == [1.0, 0.0, 0.0]
    assert turned.translation == (0.0, 0.0, 0.3)


class Convention(NamedTuple):
    """Euler angles about moving axes: their names in SciPy, the middle angles that are singular, and those
    that are well-conditioned."""

    axes: str
    build: Callable[[float, float, float], Transform]
    angles: Callable[[Any], tuple[Element, Element, Element, Element]]
    singular: tuple[float, ...]
    regular: tuple[float, float]


RIGHT = math.pi / 2
CONVENTIONS = [
    Convention("ZYX", lambda rz, ry, rx: from_rpy(rx, ry, rz), euler_zyx, (-RIGHT, RIGHT), (-1.5, 1.5)),
    Convention("ZXZ", from_zxz, euler_zxz, (0.0, math.pi, -math.pi), (0.07, 3.07)),
]
conventions = pytest.mark.parametrize("convention", CONVENTIONS, ids=lambda convention: convention.axes)
NEAR_SINGULAR = [side * 10.0**power for side in (-1.0, 1.0) for power in np.linspace(-9.5, -7.0, 26)]


@conventions
@given(data=st.data(), first=angles, last=angles)
def test_euler_angles_are_scipys_and_come_back(
    convention: Convention, data: st.DataObject, first: float, last: float
) -> None:
    near = st.builds(operator.add, st.sampled_from(convention.singular), st.sampled_from(NEAR_SINGULAR))
    middle = data.draw(angles | st.floats(*convention.regular) | near)
    rotation = convention.build(first, middle, last).rotation
    assert_near(rotation, Rotation.from_euler(convention.axes, [first, middle, last]).as_matrix(), ROUNDING)
    *got, singular = map(float, convention.angles(rotation))
    if convention.regular[0] <= middle <= convention.regular[1]:
        # the sine of the angle between is ill-conditioned by 1 / cos(ry) or 1 / sin(x), up to 15
        assert_near(np.sin(np.subtract(got, (first, middle, last)) / 2.0), 0.0, 15 * ROUNDING)
        assert not singular
    assert convention.axes == "ZYX" or got[1] >= 0.0
    # below a cosine (sine) of 1e-9 first and last are lost, above they are known to 1e-16 / cosine: 1e-7 at
    # worst, but they err together; the convention drops at most the cosine itself
    assert_near(convention.build(got[0], got[1], got[2]).rotation, rotation, 3e-7)


@conventions
@given(data=st.data(), first=angles, last=angles)
def test_in_singular_poses_the_last_angle_is_zero_and_the_first_turns_all(
    convention: Convention, data: st.DataObject, first: float, last: float
) -> None:
    middle = data.draw(st.sampled_from(convention.singular))
    rotation = convention.build(first, middle, last).rotation
    got_first, got_middle, got_last, singular = map(float, convention.angles(rotation))
    assert (got_last, singular) == (0.0, True)
    assert got_middle == pytest.approx(abs(middle) if convention.axes == "ZXZ" else middle, rel=0, abs=1e-15)
    assert_near(convention.build(got_first, got_middle, 0.0).rotation, rotation, ROUNDING)


@conventions
def test_euler_angles_of_a_column_are_those_of_each_rotation(convention: Convention) -> None:
    middles = [0.0, 0.3, math.pi / 2, math.pi, -math.pi / 2]
    singles = [convention.build(0.5, middle, 0.2).rotation for middle in middles]
    columns = convention.angles(np.moveaxis(np.array(singles, dtype=float), 0, -1))
    np.testing.assert_array_equal(np.transpose(columns), [convention.angles(single) for single in singles])


@pytest.mark.parametrize(("x", "singular"), [(1e-8, False), (1e-10, True)])
def test_below_a_sine_of_1e_9_zxz_angles_are_singular(x: float, singular: bool) -> None:
    for near in (x, math.pi - x):
        z1, _, z2, flag = euler_zxz(from_zxz(0.4, near, 0.5).rotation)
        assert flag == singular
        if not singular:
            assert_near((z1, z2), (0.4, 0.5), 1e-7)  # 1e-16 / 1e-8, and some


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_half_a_turn_is_pi_whatever_the_sign_of_zero(zero: float) -> None:
    """C and NumPy would else give pi and -pi for the same rotation."""
    z1, _, z2, _ = euler_zxz(((-1.0, 0.0, zero), (0.0, 0.0, 1.0), (zero, 1.0, 0.0)))
    assert (z1, z2) == (math.pi, 0.0)
    z1, _, z2, _ = euler_zxz(((1.0, 0.0, zero), (0.0, 0.0, -1.0), (zero, -1.0, 0.0)))
    assert (z1, z2) == (0.0, math.pi)
    assert matrix_to_rpy(((-1.0, zero, zero), (zero, -1.0, zero), (zero, zero, 1.0))) == (0.0, 0.0, math.pi)
    assert matrix_to_rpy(((1.0, zero, zero), (zero, -1.0, zero), (zero, zero, -1.0))) == (math.pi, 0.0, 0.0)


@given(angles, angles | st.sampled_from([math.pi / 2, -math.pi / 2]), angles)
def test_rpy_gives_the_rotation_back_everywhere(rx: float, ry: float, rz: float) -> None:
    rotation = from_rpy(rx, ry, rz).rotation
    assert_near(from_rpy(*matrix_to_rpy(rotation)).rotation, rotation, ROUNDING)


@given(st.lists(units, min_size=9, max_size=9))
def test_offsets_come_back_and_a_point_is_that_of_the_4x4_matrix(values: list[float]) -> None:
    frame, (x, y, z) = from_offset(values[:6]), values[6:]
    assert frame.translation == tuple(values[:3])
    assert_near(matrix_to_rpy(frame.rotation), values[3:6], 2 * ROUNDING)  # 1 / cos(1) < 2
    shift = from_offset(values[:3])
    assert (shift.translation, matrix_to_rpy(shift.rotation)) == (tuple(values[:3]), (0.0, 0.0, 0.0))
    assert_near([*frame.point((x, y, z)), 1.0], homogeneous(frame) @ [x, y, z, 1.0], ROUNDING)


SMALL = 1e-14  # of numbers up to 1; or three products of entries up to 4, a dozen roundings each


class Group(NamedTuple):
    """A group: its elements from six numbers, its operations, and the matrices of its elements."""

    element: Callable[[list[float]], Any]
    product: Callable[[Any, Any], Any]
    inverse: Callable[[Any], Any]
    identity: Any
    matrix: Callable[[Any], FloatArray]


def unit_quaternion(values: list[float]) -> FloatArray:
    quaternion = np.array([values[:4]]) + np.array([[0.0, 0.0, 0.0, 4.0]])  # never of length 0
    return np.asarray(quaternion / np.linalg.norm(quaternion))


GROUPS = {
    "poses": Group(from_offset, lambda a, b: a @ b, Transform.inverse, Transform(), homogeneous),
    "quaternions": Group(
        unit_quaternion, quaternion_product, conjugate, np.array([[0.0, 0.0, 0.0, 1.0]]),
        lambda a: to_matrices(a)[0],
    ),
}  # fmt: skip
elements = st.lists(st.floats(-3.0, 3.0, allow_subnormal=False), min_size=6, max_size=6)


@pytest.mark.parametrize("name", GROUPS)
@settings(max_examples=30, deadline=None)
@given(first=elements, second=elements, third=elements)
def test_poses_and_quaternions_are_groups_and_multiply_as_their_matrices(
    name: str, first: list[float], second: list[float], third: list[float]
) -> None:
    element, product, inverse, identity, as_matrix = GROUPS[name]
    a, b, c = map(element, (first, second, third))
    ab = product(a, b)
    for left, right in (
        (product(ab, c), product(a, product(b, c))),
        (product(a, inverse(a)), identity),
        (product(inverse(a), a), identity),
        (inverse(inverse(a)), a),
        (inverse(ab), product(inverse(b), inverse(a))),
        (product(a, identity), a),
        (product(identity, a), a),
    ):
        assert_near(as_matrix(left), as_matrix(right), SMALL)
    assert_near(as_matrix(product(ab, c)), as_matrix(a) @ as_matrix(b) @ as_matrix(c), SMALL)


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_rotation_that_scipy_wrote_and_no_missing_sample(form: RotationForm) -> None:
    rotation = Rotation.random(500, rng=np.random.default_rng(3))
    columns = orientation_columns(rotation, form)
    assert columns.shape == (500, column_count(form))
    assert is_angular(form) == (form not in ("quat_xyzw", "quat_wxyz", "matrix"))
    found = to_quaternions(columns, form)
    assert_near(rotation_angle(found, rotation.as_quat()), 0.0, SMALL)
    assert_near(np.linalg.norm(found, axis=1), 1.0, SMALL)
    columns[1, -1] = np.nan
    missing = np.isnan(to_quaternions(columns, form)).any(axis=1)
    assert np.flatnonzero(missing).tolist() == [1]


def test_quaternions_are_brought_to_unit_length_and_half_and_small_turns_keep_their_digits() -> None:
    assert to_quaternions(np.array([[0.0, 0.0, 0.0, 2.0]]), "quat_xyzw").tolist() == [[0.0, 0.0, 0.0, 1.0]]
    found = to_quaternions(np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0], [np.pi, 0.0, 0.0]]), "vector")
    expected = [[0.0, 0.0, 0.0, 1.0], [5e-10, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]]
    assert_near(found, expected, 1e-16)  # the cosine of pi / 2
    # of half a turn 1 + trace R is 0: only another component can be divided by
    half_turns = Rotation.from_rotvec(np.pi * np.eye(3)).as_matrix().reshape(-1, 9)
    assert_near(np.abs(to_quaternions(half_turns, "matrix")), np.eye(3, 4), SMALL)


def test_matrices_and_rotation_vectors_are_those_of_scipy_for_either_sign() -> None:
    rotation = Rotation.random(500, rng=np.random.default_rng(6))
    for quaternions in (rotation.as_quat(), -rotation.as_quat()):
        assert_near(to_matrices(quaternions), rotation.as_matrix(), SMALL)
        assert_near(to_rotation_vectors(quaternions), rotation.as_rotvec(), SMALL)
    np.testing.assert_array_equal(to_matrices(np.array([[0.0, 0.0, 0.0, 1.0]])), np.eye(3)[np.newaxis])


def test_angles_are_exact_from_nothing_to_half_a_turn_for_either_sign() -> None:
    """The cosine of an angle near 0 or pi has half of its digits: arccos would be off by 1e-8."""
    first = Rotation.random(1, rng=np.random.default_rng(9))
    near = np.concatenate(([0.0], np.logspace(-15, -1, 57)))
    for angle in (*near, 0.25, *(np.pi - near)):
        turned = (first * Rotation.from_rotvec([0.0, angle, 0.0])).as_quat()
        for quaternion in (turned, -turned):
            # some rounding errors of numbers up to pi
            assert_near(rotation_angle(first.as_quat(), quaternion), [angle], 2e-15)


unit_quaternions = (
    arrays(np.float64, (3, 4), elements=st.floats(-1, 1))
    .map(lambda quat: (quat, np.linalg.norm(quat, axis=1, keepdims=True)))
    .filter(lambda pair: bool((pair[1] > 1e-3).all()))
    .map(lambda pair: pair[0] / pair[1])
)


@settings(max_examples=50, deadline=None)
@given(unit_quaternions, unit_quaternions, st.floats(0, 1))
def test_orientations_between_two_are_those_of_scipy(
    first: FloatArray, second: FloatArray, share: float
) -> None:
    # Half a turn apart both ways round are as short, and either may be taken.
    assume(bool((rotation_angle(first, second) < np.pi - 1e-6).all()))
    found = slerp(first, second, np.full(3, share))
    ends = [Rotation.from_quat(pair) for pair in np.stack((first, second), axis=1)]
    expected = np.vstack([Slerp([0.0, 1.0], pair)([share]).as_quat() for pair in ends])
    assert_near(rotation_angle(found, expected), 0.0, SMALL)
    assert_near(rotation_angle(first, found), share * rotation_angle(first, second), SMALL)
    assert_near(np.linalg.norm(found, axis=1), 1.0, SMALL)


def test_at_an_end_of_the_way_stands_that_end() -> None:
    there, missing = np.array([[0.5, 0.5, 0.5, 0.5]]), np.full((1, 4), np.nan)
    np.testing.assert_array_equal(slerp(there, missing, np.array([0.0])), there)
    np.testing.assert_array_equal(slerp(missing, there, np.array([1.0])), there)
    assert np.isnan(slerp(there, missing, np.array([0.5]))).all()
