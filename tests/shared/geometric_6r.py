"""The arm of the geometric model paper, multiplied out at random poses."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy import cos, sin

from direct_geometric_model import GeometricModel, geometric_model
from urmpipe_models.arm.denavit_hartenberg import articulated_6r_rows
from urmpipe_models.elementwise import FloatArray

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
