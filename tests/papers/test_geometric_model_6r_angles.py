"""The geometric model of a 6R arm: its Euler angles, eq. 16 and 34-38."""

from __future__ import annotations

import numpy as np
from numpy import cos, sin

from geometric_6r import (
    C1,
    C2,
    C3,
    C4,
    C5,
    Q1,
    Q2,
    Q3,
    Q4,
    Q5,
    Q6,
    R7,
    ROUNDING,
    S1,
    S2,
    S3,
    S4,
    S5,
    A,
    B,
    D,
    E,
    assert_misprint,
    assert_same,
    entry,
    matrix,
    model,
)
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import euler_zxz, from_zxz


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


def test_eq_17_holds_the_angles_of_the_mended_forms() -> None:
    first, second = numerators_of_gamma()
    alpha, beta, gamma = model().operational[3:]
    for got, expected in [(alpha, alpha_z()), (beta, beta_x()), (gamma, np.arctan2(first, second))]:
        np.testing.assert_allclose(sin((got - expected) / 2.0), 0.0, atol=1e-13)  # 1 / sin(beta) of rounding
