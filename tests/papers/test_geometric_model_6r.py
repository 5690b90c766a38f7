"""[Geometric6R]_, equation by equation: what is printed right, what is not, and what it should be.

"The geometric modeling of the articulate 6R robot". Each equation is evaluated at the same 200 random
poses and compared with the products of the elementary matrices (eq. 21-26), which the paper starts from.
A printed form that is wrong is written down as printed, to show that it is.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy import cos, sin

from direct_geometric_model import GeometricModel, geometric_model
from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.articulated_6r import articulated_6r, articulated_6r_rows
from urmpipe_models.chains.geometric_model import GeometricRow
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.transform import euler_zxz, from_zxz

ROUNDING = 1e-14
"""Sums of some ten products of up to 6 sines and cosines, each step rounded to 1.1e-16."""

WRONG = 0.1
"""What a misprint is off by at least somewhere among 200 random poses: nothing that rounding does."""

L0, L1, L2, L3, L4 = LENGTHS = (0.31, 0.17, 0.53, 0.41, 0.23)
"""Any lengths; the paper prints none."""

Q = np.random.default_rng(6).uniform(-np.pi, np.pi, (6, 200))
Q1, Q2, Q3, Q4, Q5, Q6 = Q
C1, C2, C3, C4, C5, C6 = cos(Q)
S1, S2, S3, S4, S5, S6 = sin(Q)

# what the printed forms repeat in brackets
A = -S1 * C2 * C3 + S1 * S2 * S3
B = C1 * C2 * C3 - C1 * S2 * S3
D = S1 * C2 * S3 + S1 * S2 * C3
E = -C1 * C2 * S3 - C1 * S2 * C3
F = S2 * C3 + C2 * S3
G = -S2 * S3 + C2 * C3


def matrix(rows: Any) -> FloatArray:
    """Return rows of elements as matrices, shape (200, 3, 3)."""
    entries = [[np.broadcast_to(entry, 200) for entry in row] for row in rows]
    return np.moveaxis(np.array(entries, dtype=float), 2, 0)


def vector(elements: Any) -> FloatArray:
    """Return elements as vectors, shape (200, 3)."""
    return np.column_stack([np.broadcast_to(element, 200) for element in elements])


def about_x(angle: FloatArray) -> FloatArray:
    """Eq. 22, 23, 25."""
    c, s = cos(angle), sin(angle)
    return matrix([[1, 0, 0], [0, c, -s], [0, s, c]])


def about_z(angle: FloatArray) -> FloatArray:
    """Eq. 21, 24, 26."""
    c, s = cos(angle), sin(angle)
    return matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


class Product(NamedTuple):
    """[R]_k^0 as products of the elementary matrices, and p_{k,k-1} of eq. 40-44 from them."""

    rotations: list[FloatArray]
    steps: list[FloatArray]


def multiplied() -> Product:
    turns = [about_z(Q1), about_x(Q2), about_x(Q3), about_z(Q4), about_x(Q5), about_z(Q6)]
    rotations = [matrix(np.eye(3))]
    for turn in turns:
        rotations.append(rotations[-1] @ turn)
    ups = (L0, L1, L2, L3, 0.0, 0.0, L4)  # eq. 39: every r_k^{k-1} is along z
    return Product(rotations, [up * rotation[:, :, 2] for up, rotation in zip(ups, rotations, strict=True)])


PRODUCT = multiplied()
R7 = PRODUCT.rotations[6]  # the gripper's system 7 is parallel to 6


def entry(rotation: int, row: int, column: int) -> FloatArray:
    """Return entry (row, column) of [R]_rotation^0, counted from 1 as in the paper."""
    return PRODUCT.rotations[rotation][:, row - 1, column - 1]


def model() -> GeometricModel:
    return geometric_model(articulated_6r_rows(L0, L1, L2, L3), list(Q), (0.0, 0.0, L4))


def assert_same(got: Any, expected: FloatArray) -> None:
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=ROUNDING)


def assert_misprint(printed: FloatArray, right: FloatArray) -> None:
    assert np.abs(printed - right).max() > WRONG


# --- the model and the chain -----------------------------------------------------------------------


def test_eq_21_to_26_multiplied_are_the_model_and_the_chain() -> None:
    found = model()
    for k in range(6):
        assert_same(matrix(found.rotations[k]), PRODUCT.rotations[k + 1])
    for k in range(7):
        assert_same(vector(found.steps[k]), PRODUCT.steps[k])
        assert_same(vector(found.positions[k]), np.sum(PRODUCT.steps[: k + 1], axis=0))
    poses = forward(articulated_6r(*LENGTHS), list(Q))
    assert_same(matrix(poses[-1].rotation), R7)
    for k, pose in enumerate(poses, start=2):  # the chain's point k is the origin O_{k+1}
        assert_same(vector(pose.translation), vector(found.positions[k - 1]))


# --- rotations, eq. 27-32 --------------------------------------------------------------------------

RIGHT = {
    27: (2, [[C1, -S1 * C2, S1 * S2], [S1, C1 * C2, -C1 * S2], [0, S2, C2]]),
    28: (3, [[C1, A, D], [S1, B, E], [0, F, G]]),
    29: (
        4,
        [
            [C1 * C4 + A * S4, -C1 * S4 + A * C4, D],
            [S1 * C4 + B * S4, -S1 * S4 + B * C4, E],
            [F * S4, F * C4, G],
        ],
    ),
    30: (
        5,
        [
            [C1 * C4 + A * S4, (-C1 * S4 + A * C4) * C5 + D * S5, -(-C1 * S4 + A * C4) * S5 + D * C5],
            [S1 * C4 + B * S4, (-S1 * S4 + B * C4) * C5 + E * S5, -(-S1 * S4 + B * C4) * S5 + E * C5],
            [F * S4, F * C4 * C5 + G * S5, -F * C4 * S5 + G * C5],
        ],
    ),
    31: (
        6,
        [
            [
                (C1 * C4 + A * S4) * C6 + ((-C1 * S4 + A * C4) * C5 + D * S5) * S6,
                -(C1 * C4 + A * S4) * S6 + ((-C1 * S4 + A * C4) * C5 + D * S5) * C6,
                -(-C1 * S4 + A * C4) * S5 + D * C5,
            ],
            [
                (S1 * C4 + B * S4) * C6 + ((-S1 * S4 + B * C4) * C5 + E * S5) * S6,
                -(S1 * C4 + B * S4) * S6 + ((-S1 * S4 + B * C4) * C5 + E * S5) * C6,
                -(-S1 * S4 + B * C4) * S5 + E * C5,
            ],
            [
                F * S4 * C6 + (F * C4 * C5 + G * S5) * S6,
                -F * S4 * S6 + (F * C4 * C5 + G * S5) * C6,
                -F * C4 * S5 + G * C5,
            ],
        ],
    ),
}
"""By equation: which [R]_k^0 it is, and its entries; 27 as printed, the others with the misprints mended.

Eq. 32, [R]_7^0, is eq. 31 again.
"""


@pytest.mark.parametrize("equation", list(RIGHT))
def test_eq_27_and_the_mended_28_to_32_are_the_products(equation: int) -> None:
    system, entries = RIGHT[equation]
    assert_same(matrix(entries), PRODUCT.rotations[system])


MISPRINTS = {  # (equation, row, column): which [R]_k^0 it is, and the entry as printed
    (28, 3, 3): (3, S2 * S3 + C2 * C3),
    (29, 1, 1): (4, C1 * C4 + (S1 * C2 * C3 + S1 * S2 * S3) * S4),
    (29, 1, 2): (4, -C1 * S4 + (S1 * S2 * S3) * C4),
    (29, 2, 1): (4, S1 * S4 + (S1 * C2 * C3 - C1 * S2 * S3) * S4),
    (29, 2, 2): (4, S1 * S4 + B * C4),
    (30, 1, 3): (5, -(-C1 * S4 + A * C4) * S5 * D * C5),
    (30, 2, 2): (5, (-S1 * C4 + B * C4) * C5 + E * S5),
    (31, 1, 2): (6, -(C1 * C4 + A * S4) * C6 + ((-C1 * S4 + A * C4) * C5 + D * S5) * C6),
    (31, 2, 2): (6, (S1 * C4 + B * S4) * S6 + ((-S1 * S4 + B * C4) * C5 + E * S5) * C6),
    (31, 3, 2): (6, F * S4 * S6 + (F * C4 * C5 + G * S5) * C6),
    (31, 3, 3): (6, -F * C4 * S5 + (-S2 * S3 * C2 * C3) * C5),
    (32, 1, 3): (6, -(-C1 * S4 + A * C4) * S5 + (S1 * C2 * S3 + S1 * S2 * S3) * C5),
}


@pytest.mark.parametrize("where", list(MISPRINTS))
def test_entries_of_eq_28_to_32_as_printed_are_not(where: tuple[int, int, int]) -> None:
    system, printed = MISPRINTS[where]
    assert_misprint(printed, entry(system, *where[1:]))


# --- the Euler angles, eq. 16, 34-38 ---------------------------------------------------------------


def test_eq_34_is_the_rotation_of_the_angles() -> None:
    alpha, beta, gamma = Q1, Q2, Q3
    ca, cb, cg, sa, sb, sg = cos(alpha), cos(beta), cos(gamma), sin(alpha), sin(beta), sin(gamma)
    printed = [
        [ca * cg - sa * sg * cb, -ca * sg - sa * cg * cb, sa * sb],
        [sa * cg + ca * sg * cb, -sa * sg + ca * cg * cb, -ca * sb],
        [sg * sb, cg * sb, cb],
    ]
    assert_same(matrix(from_zxz(alpha, beta, gamma).rotation), matrix(printed))


def test_eq_16_gives_the_angles() -> None:
    (xx, yx, zx), (xy, yy, zy), (_, _, zz) = R7.transpose(1, 2, 0)
    alpha = np.arctan2(zx, -zy)
    beta = np.arctan2(zx * sin(alpha) - zy * cos(alpha), zz)
    gamma = np.arctan2(-yx * cos(alpha) - yy * sin(alpha), xx * cos(alpha) + xy * sin(alpha))
    *angles, singular = euler_zxz(tuple(tuple(row) for row in R7.transpose(1, 2, 0)))  # type: ignore[arg-type]
    for got, printed in zip(angles, (alpha, beta, gamma), strict=True):
        np.testing.assert_allclose(sin((got - printed) / 2.0), 0.0, atol=1e-13)  # 1 / sin(beta) of rounding
    assert not singular.any()
    assert_same(matrix(from_zxz(alpha, beta, gamma).rotation), R7)


def alpha_z() -> FloatArray:
    """Eq. 36 with its second argument whole: it breaks off after (-sq1 sq4 + (cq1 cq2."""
    first, second = -(-C1 * S4 + A * C4) * S5 + D * C5, (-S1 * S4 + B * C4) * S5 - E * C5
    return np.asarray(np.arctan2(first, second))


def radicand_of_beta() -> FloatArray:
    """The sum of eq. 37 as printed, without the (cq1^2 + sq1^2) = 1 beside it."""
    return np.asarray(
        S4**2 * S5**2
        + C5**2 * C2**2 * S3**2
        + S5**2 * C4**2 * C2**2 * C3**2
        + 2 * S5 * C4 * C2**2 * C3 * C5 * S3
        - 2 * S5**2 * C4**2 * C2 * C3 * S2 * S3
        + 2 * S5 * C4 * C2 * C3**2 * C5 * S2
        + S5**2 * C4**2 * S2**2 * S3**2
        + C5**2 * S2**2 * C3**2
        - 2 * S5 * C4 * S2 * S3**2 * C5 * C2
        + 2 * C5**2 * C2 * S3 * S2 * C3
    )


def lost_from_beta() -> FloatArray:
    """The term that eq. 37 lacks."""
    return np.asarray(-2 * S5 * C4 * S2**2 * S3 * C3 * C5)


def beta_x() -> FloatArray:
    """Eq. 37 with its root and the term that it lacks."""
    cosine = -C4 * S5 * C2 * S3 - C4 * S5 * S2 * C3 + C5 * C2 * C3 - C5 * S2 * S3
    return np.asarray(np.arctan2(np.sqrt(radicand_of_beta() + lost_from_beta()), cosine))


def numerators_of_gamma() -> tuple[FloatArray, FloatArray]:
    """The two sums above the roots of eq. 38, as printed."""
    q2, q3, q4, q5, q6 = Q2, Q3, Q4, Q5, Q6
    first = (
        cos(-q6 - q4 - q5 + q3 + q2)
        - 2 * cos(q6 + q3 + q2 + q4)
        - 2 * cos(-q6 + q3 + q2 + q4)
        + cos(-q6 - q4 + q5 + q3 + q2)
        + 2 * cos(q6 + q3 + q2 - q4)
        - cos(q6 + q4 + q5 + q3 + q2)
        - cos(q6 + q4 - q5 + q3 + q2)
        + 2 * cos(-q6 + q3 + q2 + q5)
        + 2 * cos(-q6 - q4 + q3 + q2)
        + cos(-q6 + q4 + q5 + q3 + q2)
        + cos(-q6 + q4 - q5 + q3 + q2)
        - 2 * cos(q6 + q2 + q3 + q5)
        + 2 * cos(q6 + q3 + q2 - q5)
        - 2 * cos(-q6 + q3 + q2 - q5)
        - cos(q6 - q4 + q5 + q3 + q2)
        - cos(q6 - q4 - q5 + q3 + q2)
    )
    second = (
        -2 * sin(q6 + q3 + q2 - q5)
        + sin(q6 + q4 + q5 + q3 + q2)
        + 2 * sin(q6 + q3 + q2 + q5)
        - 2 * sin(-q6 + q3 + q2 + q4)
        + sin(q6 - q4 + q5 + q3 + q2)
        + sin(q6 - q4 - q5 + q3 + q2)
        - 2 * sin(-q6 + q3 + q2 - q5)
        + sin(-q6 + q4 + q5 + q3 + q2)
        + sin(-q6 + q4 - q5 + q3 + q2)
        + 2 * sin(q6 + q3 + q2 + q4)
        + 2 * sin(-q6 - q4 + q3 + q2)
        + 2 * sin(-q6 + q3 + q2 + q5)
        - 2 * sin(q6 + q3 + q2 - q4)
        + sin(q6 + q4 - q5 + q3 + q2)
        + sin(-q6 - q4 + q5 + q3 + q2)
        + sin(-q6 - q4 - q5 + q3 + q2)
    )
    return first, second


def radicand_of_gamma(third: FloatArray) -> FloatArray:
    """The sum under either root of eq. 38; they differ in the third term alone."""
    turned = 2 * Q3 + 2 * Q2
    return np.asarray(
        4 * cos(2 * Q5 + 2 * Q4)
        - 2 * cos(2 * Q5 - 2 * Q4 + turned)
        + third
        + 4 * cos(2 * Q4 + turned)
        - 2 * cos(2 * Q5 + 2 * Q4 + turned)
        - 8 * cos(2 * Q4)
        + 40
        - 2 * cos(-2 * Q5 - 2 * Q4 + turned)
        + 4 * cos(-2 * Q5 + 2 * Q4)
        + 4 * cos(-2 * Q4 + turned)
        - 8 * cos(2 * Q5 + Q4 + turned)
        + 8 * cos(-2 * Q5 + Q4 + turned)
        - 8 * cos(2 * Q5 - Q4 + turned)
        - 8 * cos(turned)
        - 12 * cos(2 * Q5 + turned)
        + 8 * cos(-2 * Q5 - Q4 + turned)
        - 8 * cos(2 * Q5)
        - 12 * cos(-2 * Q5 + turned)
    )


THIRD_OF_THE_FIRST = -2 * cos(-2 * Q5 - 2 * Q4 + 2 * Q3 + 2 * Q2)
THIRD_OF_THE_SECOND = -2 * cos(-2 * Q5 + 2 * Q4 + 2 * Q3 + 2 * Q2)


def test_eq_36_whole_is_alpha_and_as_printed_is_not() -> None:
    right = np.arctan2(entry(6, 1, 3), -entry(6, 2, 3))
    np.testing.assert_allclose(sin((alpha_z() - right) / 2.0), 0.0, atol=1e-13)  # 1 / sin(beta) of rounding
    printed = np.arctan2(entry(6, 1, 3), -S1 * S4 + C1 * C2)
    assert_misprint(sin((printed - right) / 2.0), np.zeros(200))


def test_eq_37_with_its_root_and_lost_term_is_beta_and_as_printed_is_not() -> None:
    sine_squared = entry(6, 1, 3) ** 2 + entry(6, 2, 3) ** 2
    assert_same(radicand_of_beta() + lost_from_beta(), sine_squared)
    assert_misprint(radicand_of_beta(), sine_squared)
    right = np.arccos(entry(6, 3, 3))
    np.testing.assert_allclose(beta_x(), right, rtol=0.0, atol=1e-13)  # 1 / sin(beta) of rounding
    rootless = np.arctan2(sine_squared, entry(6, 3, 3))
    assert_misprint(rootless, right)


def test_eq_38_has_the_right_numerators_and_one_right_radicand() -> None:
    first, second = numerators_of_gamma()
    np.testing.assert_allclose(first, 8.0 * entry(6, 3, 1), rtol=0.0, atol=8 * ROUNDING)
    np.testing.assert_allclose(second, 8.0 * entry(6, 3, 2), rtol=0.0, atol=8 * ROUNDING)
    right = 64.0 * (1.0 - entry(6, 3, 3) ** 2)
    np.testing.assert_allclose(radicand_of_gamma(THIRD_OF_THE_SECOND), right, rtol=0.0, atol=64 * ROUNDING)
    assert_misprint(radicand_of_gamma(THIRD_OF_THE_FIRST), right)


def test_eq_38_with_the_second_radicand_in_both_places_is_gamma() -> None:
    first, second = numerators_of_gamma()
    root = np.sqrt(radicand_of_gamma(THIRD_OF_THE_SECOND))
    right = np.arctan2(entry(6, 3, 1), entry(6, 3, 2))
    gamma = np.arctan2(first / root, second / root)
    np.testing.assert_allclose(sin((gamma - right) / 2.0), 0.0, atol=1e-13)  # 1 / sin(beta) of rounding


# --- positions, eq. 40-50 --------------------------------------------------------------------------

P43 = [  # eq. 42
    -L3 / 2 * cos(Q3 + Q1 + Q2) + L3 / 2 * cos(Q3 - Q1 + Q2),
    -L3 / 2 * sin(Q3 - Q1 + Q2) - L3 / 2 * sin(Q3 + Q1 + Q2),
    cos(Q2 + Q3) * L3,
]
P76 = [  # eq. 44
    (-(-C1 * S4 + A * C4) * S5 + D * C5) * L4,
    (-(-S1 * S4 + B * C4) * S5 + E * C5) * L4,
    (-F * C4 * S5 + G * C5) * L4,
]
P3 = [S1 * S2 * L2, -C1 * S2 * L2, L0 + L1 + C2 * L2]  # eq. 46
P6 = [P3[0] + P43[0], P3[1] + P43[1], P3[2] + P43[2]]  # eq. 47, 48, 49

STEPS = [  # eq. 40-44
    [0, 0, L0],
    [0, 0, L1],
    [S1 * S2 * L2, -C1 * S2 * L2, C2 * L2],
    P43,
    [0, 0, 0],
    [0, 0, 0],
    P76,
]
POSITIONS = [[0, 0, L0], [0, 0, L0 + L1], P3, P6, P6, P6]  # eq. 45-49


@pytest.mark.parametrize("k", range(7))
def test_eq_40_to_44_are_the_steps(k: int) -> None:
    assert_same(vector(STEPS[k]), PRODUCT.steps[k])


@pytest.mark.parametrize("k", range(6))
def test_eq_45_to_49_are_the_origins(k: int) -> None:
    assert_same(vector(POSITIONS[k]), np.sum(PRODUCT.steps[: k + 1], axis=0))


def test_eq_43_needs_the_system_before_it() -> None:
    """[R]_3^0, as printed, only passes because [r]_5^4 is zero."""
    offset = (0.1, 0.2, 0.3)
    rows = [*articulated_6r_rows(L0, L1, L2, L3)]
    rows[4] = GeometricRow("R", "x", offset)
    p54 = vector(geometric_model(rows, list(Q)).steps[4])
    assert_same(PRODUCT.rotations[4] @ np.array(offset), p54)
    assert_misprint(PRODUCT.rotations[3] @ np.array(offset), p54)


def test_eq_50_is_eq_49_plus_44_and_as_printed_is_not() -> None:
    p7 = np.sum(PRODUCT.steps, axis=0)
    assert_same(vector(P6) + vector(P76), p7)
    assert_same(P6[2] + (-F * C4 * S5 + G * C5) * L4, p7[:, 2])  # z is right as printed
    assert_misprint(P6[0] - (C1 * S4 - A * C4 * S5 + D * C5) * L4, p7[:, 0])
    assert_misprint(P6[1] - (-S1 * S4 + B * C4 + E * C5) * S5 * L4, p7[:, 1])
    # the vector of operational coordinates repeats it with other brackets, and drops l4 in y and z
    assert_misprint(P6[0] + (-(C1 * S4 + A * C4 * S5) - D * C5) * L4, p7[:, 0])
    assert_misprint(P6[1] - (-S1 * S4 + B * C4) * S5 + E * C5, p7[:, 1])
    assert_misprint(P6[2] - F * C4 * S5 + G * C5, p7[:, 2])


def test_eq_17_holds_the_point_and_the_angles_of_the_mended_forms() -> None:
    first, second = numerators_of_gamma()
    *point, alpha, beta, gamma = model().operational
    assert_same(vector(point), vector(P6) + vector(P76))
    for got, expected in [(alpha, alpha_z()), (beta, beta_x()), (gamma, np.arctan2(first, second))]:
        np.testing.assert_allclose(sin((got - expected) / 2.0), 0.0, atol=1e-13)  # 1 / sin(beta) of rounding
