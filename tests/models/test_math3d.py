"""Transforms, Euler angles and forms of orientations: SciPy, and the laws of their groups."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

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


def matrix(rotation: Any) -> NDArray[np.float64]:
    return np.array(rotation, dtype=float)


def homogeneous(frame: Transform) -> FloatArray:
    """Return a pose as a matrix, shape (4, 4)."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = frame.rotation, frame.translation
    return result


def half_angle_errors(got: Any, expected: tuple[float, float, float]) -> list[float]:
    return [np.sin(np.subtract(a, b) / 2.0) for a, b in zip(got[:3], expected, strict=True)]


@given(angles, angles, angles)
def test_rotation_about_is_scipys_and_orthogonal(angle: float, polar: float, azimuth: float) -> None:
    axis = Rotation.from_euler("ZY", [azimuth, polar]).as_matrix()[:, 2]
    turned = rotation_about(axis.tolist(), angle)
    np.testing.assert_allclose(
        matrix(turned.rotation), Rotation.from_rotvec(angle * axis).as_matrix(), atol=ROUNDING
    )
    np.testing.assert_allclose(matrix((turned @ turned.inverse()).rotation), np.eye(3), atol=ROUNDING)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), angles)
@pytest.mark.parametrize(
    "axis", [(1.0, 0, 0), (0, -1.0, 0), (0, 0, 1.0), (0.6, 0.0, -0.8), (1e-8, 0.0, 1.0), (0.0, 1.0, -1e-9)]
)
def test_turned_is_the_product_with_rotation_about(
    axis: tuple[float, float, float], seed: int, angle: float
) -> None:
    frame = from_offset(np.random.default_rng(seed).uniform(-1.0, 1.0, 6).tolist())
    turned, product = frame.rotated(axis, angle), frame @ rotation_about(axis, angle)
    np.testing.assert_allclose(matrix(turned.rotation), matrix(product.rotation), atol=ROUNDING)
    assert turned.translation == frame.translation


@pytest.mark.parametrize(("turn", "axis"), [(rotation_x, "x"), (rotation_y, "y"), (rotation_z, "z")])
@pytest.mark.parametrize("quarters", range(-4, 5))
def test_constant_right_angles_are_exact(
    turn: Callable[[float], Transform], axis: str, quarters: int
) -> None:
    angle = quarters * math.pi / 2
    expected = np.rint(Rotation.from_euler(axis, angle).as_matrix())
    np.testing.assert_array_equal(matrix(turn(angle).rotation), expected)


@pytest.mark.parametrize("angle", [-2.5 * math.pi, 2.5 * math.pi])
def test_beyond_a_turn_a_constant_is_an_angle_as_any(angle: float) -> None:
    cosine = rotation_z(angle).rotation[0][0]
    assert cosine != 0.0
    assert abs(cosine - math.cos(angle)) < 1e-24  # so far pi is known: `elementwise.cosine_sine`


@settings(max_examples=40, deadline=None)
@given(st.lists(units, min_size=9, max_size=9))
def test_a_point_is_that_of_the_4x4_matrix(values: list[float]) -> None:
    a, point = from_offset(values[:6]), (values[6], values[7], values[8])
    seen = homogeneous(a) @ np.array([*point, 1.0])
    np.testing.assert_allclose(a.point(point), seen[:3], atol=ROUNDING)


def test_constants_fold_away() -> None:
    q = np.linspace(-1.0, 1.0, 5)
    turned = translation(0.0, 0.0, 0.3) @ rotation_y(math.pi / 2) @ rotation_z(q)
    (_, _, a13), (_, _, a23), (_, _, a33) = turned.rotation
    assert (a13, a23, a33) == (1.0, 0.0, 0.0)
    assert turned.translation == (0.0, 0.0, 0.3)


class Convention(NamedTuple):
    """Euler angles about moving axes: their names in SciPy, and the middle angles that are
    well-conditioned."""

    axes: str
    build: Callable[[float, float, float], Transform]
    angles: Callable[[Any], tuple[Element, Element, Element, Element]]
    regular: tuple[float, float]


CONVENTIONS = {
    "zyx": Convention("ZYX", lambda rz, ry, rx: from_rpy(rx, ry, rz), euler_zyx, (-1.5, 1.5)),
    "zxz": Convention("ZXZ", from_zxz, euler_zxz, (0.07, 3.07)),
}


@pytest.mark.parametrize("name", CONVENTIONS)
@given(first=angles, middle=angles, last=angles)
def test_euler_angles_are_scipys_about_moving_axes(
    name: str, first: float, middle: float, last: float
) -> None:
    convention = CONVENTIONS[name]
    expected = Rotation.from_euler(convention.axes, [first, middle, last]).as_matrix()
    got = convention.build(first, middle, last).rotation
    np.testing.assert_allclose(matrix(got), expected, atol=ROUNDING)


@pytest.mark.parametrize("name", CONVENTIONS)
@given(first=angles, share=st.floats(0.0, 1.0), last=angles)
def test_euler_angles_come_back_away_from_the_singular_ones(
    name: str, first: float, share: float, last: float
) -> None:
    convention = CONVENTIONS[name]
    low, high = convention.regular
    middle = low + share * (high - low)
    got = convention.angles(convention.build(first, middle, last).rotation)
    # the sine of the angle between is ill-conditioned by 1 / cos(ry) or 1 / sin(x), up to 15
    np.testing.assert_allclose(half_angle_errors(got, (first, middle, last)), 0.0, atol=15 * ROUNDING)
    assert not got[3]


@pytest.mark.parametrize(
    ("name", "middle"),
    [("zyx", math.pi / 2), ("zyx", -math.pi / 2), ("zxz", 0.0), ("zxz", math.pi), ("zxz", -math.pi)],
)
@given(first=angles, last=angles)
def test_in_singular_poses_the_last_angle_is_zero_and_the_first_turns_all(
    name: str, middle: float, first: float, last: float
) -> None:
    convention = CONVENTIONS[name]
    rotation = convention.build(first, middle, last).rotation
    got_first, got_middle, got_last, singular = convention.angles(rotation)
    assert singular
    assert got_last == 0.0
    assert got_middle == pytest.approx(abs(middle) if name == "zxz" else middle, abs=1e-15)
    back = convention.build(float(got_first), float(got_middle), 0.0).rotation
    np.testing.assert_allclose(matrix(back), matrix(rotation), atol=ROUNDING)


@pytest.mark.parametrize(
    ("name", "middle", "side"), [("zyx", math.pi / 2, -1.0), ("zxz", 0.0, 1.0), ("zxz", math.pi, 1.0)]
)
@given(power=st.floats(-9.5, -7.0), first=angles, last=angles)
def test_near_singular_poses_the_rotation_still_comes_back(
    name: str, middle: float, side: float, power: float, first: float, last: float
) -> None:
    convention = CONVENTIONS[name]
    rotation = convention.build(first, middle + side * 10.0**power, last).rotation
    back = convention.build(*map(float, convention.angles(rotation)[:3])).rotation
    # below a cosine (sine) of 1e-9 first and last are lost, above they are known to 1e-16 / cosine: 1e-7 at
    # worst, but they err together; the convention drops at most the cosine itself
    np.testing.assert_allclose(matrix(back), matrix(rotation), atol=3e-7)


@pytest.mark.parametrize("name", CONVENTIONS)
def test_euler_angles_of_a_column_are_those_of_each_rotation(name: str) -> None:
    build, angles_of = CONVENTIONS[name].build, CONVENTIONS[name].angles
    middles = [0.0, 0.3, math.pi / 2, math.pi, -math.pi / 2]
    singles = [build(0.5, middle, 0.2).rotation for middle in middles]
    columns = angles_of(np.moveaxis(np.array(singles, dtype=float), 0, -1))
    np.testing.assert_array_equal(np.transpose(columns), [angles_of(single) for single in singles])


@given(angles, st.floats(-math.pi, 0.0), angles)
def test_a_negative_x_is_the_same_rotation_as_a_positive_one(z1: float, x: float, z2: float) -> None:
    rotation = from_zxz(z1, x, z2).rotation
    got_z1, got_x, got_z2, _ = euler_zxz(rotation)
    assert got_x >= 0.0
    back = from_zxz(float(got_z1), float(got_x), float(got_z2)).rotation
    np.testing.assert_allclose(matrix(back), matrix(rotation), atol=3e-7)  # as near singular poses


@pytest.mark.parametrize(("x", "singular"), [(1e-8, False), (1e-10, True)])
def test_the_zxz_angles_are_told_apart_down_to_a_sine_of_1e_9(x: float, singular: bool) -> None:
    for near in (x, math.pi - x):
        z1, _, z2, flag = euler_zxz(from_zxz(0.4, near, 0.5).rotation)
        assert flag == singular
        if not singular:
            np.testing.assert_allclose((z1, z2), (0.4, 0.5), rtol=0.0, atol=1e-7)  # 1e-16 / 1e-8, and some


@settings(max_examples=50, deadline=None)
@given(angles, st.floats(-1.5, 1.5), angles)
def test_both_conventions_tell_the_same_rotation(rz: float, ry: float, rx: float) -> None:
    rotation = from_rpy(rx, ry, rz).rotation
    z1, x, z2, singular = euler_zxz(rotation)
    assume(not singular and np.sin(x) > 0.07)
    back = euler_zyx(from_zxz(float(z1), float(x), float(z2)).rotation)
    # ill-conditioned by 1 / sin(x) <= 15 there and by 1 / cos(ry) <= 15 back
    np.testing.assert_allclose(half_angle_errors(back, (rz, ry, rx)), 0.0, atol=225 * ROUNDING)


def test_a_zero_of_either_sign_gives_the_angle_pi() -> None:
    """C and NumPy would else tell pi and -pi of the same rotation."""
    for zero in (0.0, -0.0):
        z1, _, z2, _ = euler_zxz(((-1.0, 0.0, zero), (0.0, 0.0, 1.0), (zero, 1.0, 0.0)))
        assert (z1, z2) == (math.pi, 0.0)
        z1, _, z2, _ = euler_zxz(((1.0, 0.0, zero), (0.0, 0.0, -1.0), (zero, -1.0, 0.0)))
        assert (z1, z2) == (0.0, math.pi)


@given(angles, angles | st.sampled_from([math.pi / 2, -math.pi / 2]), angles)
def test_rpy_gives_the_rotation_back_everywhere(rx: float, ry: float, rz: float) -> None:
    rotation = from_rpy(rx, ry, rz).rotation
    np.testing.assert_allclose(
        matrix(from_rpy(*matrix_to_rpy(rotation)).rotation), matrix(rotation), atol=ROUNDING
    )


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_half_a_turn_is_pi_in_rpy(zero: float) -> None:
    assert matrix_to_rpy(((-1.0, zero, zero), (zero, -1.0, zero), (zero, zero, 1.0))) == (0.0, 0.0, math.pi)
    rx, ry, rz = matrix_to_rpy(((1.0, zero, zero), (zero, -1.0, zero), (zero, zero, -1.0)))
    assert (rx, ry, rz) == (math.pi, 0.0, 0.0)


@given(st.lists(units, min_size=6, max_size=6))
def test_offsets_come_back(values: list[float]) -> None:
    frame = from_offset(values)
    assert frame.translation == tuple(values[:3])
    np.testing.assert_allclose(matrix_to_rpy(frame.rotation), values[3:], atol=2 * ROUNDING)  # 1 / cos(1) < 2
    shift = from_offset(values[:3])
    assert (shift.translation, matrix_to_rpy(shift.rotation)) == (tuple(values[:3]), (0.0, 0.0, 0.0))


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
        np.testing.assert_allclose(as_matrix(left), as_matrix(right), rtol=0.0, atol=SMALL)
    expected = as_matrix(a) @ as_matrix(b) @ as_matrix(c)
    np.testing.assert_allclose(as_matrix(product(ab, c)), expected, rtol=0.0, atol=SMALL)


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
def test_every_form_gives_the_rotation_that_scipy_wrote_and_no_missing_sample(form: RotationForm) -> None:
    rotation = Rotation.random(500, rng=np.random.default_rng(3))
    columns = recorded(rotation, form)
    assert columns.shape == (500, column_count(form))
    assert is_angular(form) == (form not in ("quat_xyzw", "quat_wxyz", "matrix"))
    found = to_quaternions(columns, form)
    np.testing.assert_allclose(rotation_angle(found, rotation.as_quat()), 0.0, atol=SMALL)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=SMALL)
    columns[1, -1] = np.nan
    missing = np.isnan(to_quaternions(columns, form)).any(axis=1)
    assert np.flatnonzero(missing).tolist() == [1]


def test_half_turns_as_matrices() -> None:
    """1 + trace R is 0: only another component can be divided by."""
    half_turns = Rotation.from_rotvec(np.pi * np.eye(3))
    found = to_quaternions(half_turns.as_matrix().reshape(-1, 9), "matrix")
    np.testing.assert_allclose(np.abs(found), np.eye(3, 4), atol=SMALL)


def test_quaternions_are_brought_to_unit_length_and_small_turns_keep_their_digits() -> None:
    assert to_quaternions(np.array([[0.0, 0.0, 0.0, 2.0]]), "quat_xyzw").tolist() == [[0.0, 0.0, 0.0, 1.0]]
    found = to_quaternions(np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0], [np.pi, 0.0, 0.0]]), "vector")
    expected = [[0.0, 0.0, 0.0, 1.0], [5e-10, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]]
    np.testing.assert_allclose(found, expected, atol=1e-16)  # the cosine of pi / 2


def test_the_angle_between_an_orientation_and_its_negative_is_none() -> None:
    first = Rotation.random(10, rng=np.random.default_rng(5))
    turned = first * Rotation.from_rotvec([0.0, 0.0, 0.25])
    np.testing.assert_allclose(rotation_angle(first.as_quat(), -turned.as_quat()), 0.25, atol=SMALL)
    np.testing.assert_allclose(rotation_angle(first.as_quat(), -first.as_quat()), 0.0, atol=SMALL)


def test_matrices_are_those_of_scipy() -> None:
    rotation = Rotation.random(500, rng=np.random.default_rng(6))
    np.testing.assert_allclose(to_matrices(rotation.as_quat()), rotation.as_matrix(), atol=SMALL)
    np.testing.assert_array_equal(to_matrices(np.array([[0.0, 0.0, 0.0, 1.0]])), np.eye(3)[np.newaxis])


def test_angles_are_exact_from_nothing_to_half_a_turn() -> None:
    """The cosine of an angle near 0 or pi has half of its digits: arccos would be off by 1e-8."""
    first = Rotation.random(1, rng=np.random.default_rng(9))
    near = np.concatenate(([0.0], np.logspace(-15, -1, 57)))
    for angle in (*near, *(np.pi - near)):
        turned = first * Rotation.from_rotvec([0.0, angle, 0.0])
        found = float(rotation_angle(first.as_quat(), turned.as_quat())[0])
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
    assume(bool((rotation_angle(one, other) < np.pi - 1e-6).all()))
    found = slerp(one, other, np.full(3, share))
    for k in range(3):
        ends = Rotation.from_quat(np.vstack((one[k], other[k])))
        expected = Slerp([0.0, 1.0], ends)([share]).as_quat()
        assert rotation_angle(found[[k]], expected)[0] < SMALL
        passed = rotation_angle(one[[k]], found[[k]])[0]
        assert passed == pytest.approx(share * rotation_angle(one[[k]], other[[k]])[0], rel=0, abs=SMALL)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=SMALL)


def test_rotation_vectors_are_those_of_scipy_for_either_sign() -> None:
    rotation = Rotation.random(200, rng=np.random.default_rng(10))
    for quaternions in (rotation.as_quat(), -rotation.as_quat()):
        np.testing.assert_allclose(to_rotation_vectors(quaternions), rotation.as_rotvec(), atol=SMALL)


def test_at_an_end_of_the_way_stands_that_end() -> None:
    there, missing = np.array([[0.5, 0.5, 0.5, 0.5]]), np.full((1, 4), np.nan)
    np.testing.assert_array_equal(slerp(there, missing, np.array([0.0])), there)
    np.testing.assert_array_equal(slerp(missing, there, np.array([1.0])), there)
    assert np.isnan(slerp(there, missing, np.array([0.5]))).all()
