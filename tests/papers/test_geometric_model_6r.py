"""[Geometric6R]_, equation by equation: what is printed right, what is not, and what it should be.

"The geometric modeling of the articulate 6R robot". Each equation is evaluated at the same 200 random
poses and compared with the products of the elementary matrices (eq. 21-26), which the paper starts from.
A printed form that is wrong is written down as printed, to show that it is.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy import cos, sin

from direct_geometric_model import geometric_model
from geometric_6r import (
    C1,
    C2,
    C3,
    C4,
    C5,
    C6,
    L0,
    L1,
    L2,
    L3,
    L4,
    LENGTHS,
    PRODUCT,
    Q1,
    Q2,
    Q3,
    R7,
    S1,
    S2,
    S3,
    S4,
    S5,
    S6,
    A,
    B,
    D,
    E,
    F,
    G,
    Q,
    assert_misprint,
    assert_same,
    entry,
    matrix,
    model,
    vector,
)
from urmpipe_models.arm.denavit_hartenberg import GeometricModelRow, articulated_6r, articulated_6r_rows
from urmpipe_models.kinematics.forward import forward

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
    rows[4] = GeometricModelRow("R", "x", offset)
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


def test_eq_17_holds_the_point() -> None:
    assert_same(vector(model().operational[:3]), vector(P6) + vector(P76))
