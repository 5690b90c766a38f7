"""What makes a group one: products of poses and of quaternions, held to the same laws."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import Transform, conjugate, from_offset, quaternion_product, to_matrices

ROUNDING = 1e-14
"""Three products of entries of up to 4, a dozen roundings each."""


def homogeneous(frame: Transform) -> FloatArray:
    """Return a pose as a matrix, shape (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = frame.rotation, frame.translation
    return matrix


def unit(values: list[float]) -> FloatArray:
    """Return a unit quaternion, shape (1, 4)."""
    quaternion = np.array([values[:4]]) + np.array([[0.0, 0.0, 0.0, 4.0]])  # never of no length
    return np.asarray(quaternion / np.linalg.norm(quaternion))


@dataclass(frozen=True)
class Group:
    """How elements are made, multiplied and inverted, and the matrices that stand for them."""

    element: Callable[[list[float]], Any]
    product: Callable[[Any, Any], Any]
    inverse: Callable[[Any], Any]
    identity: Any
    matrix: Callable[[Any], FloatArray]


POSES = Group(from_offset, lambda a, b: a @ b, Transform.inverse, Transform(), homogeneous)
QUATERNIONS = Group(
    unit, quaternion_product, conjugate, np.array([[0.0, 0.0, 0.0, 1.0]]), lambda a: to_matrices(a)[0]
)

elements = st.lists(st.floats(-3.0, 3.0, allow_subnormal=False), min_size=6, max_size=6)


@pytest.mark.parametrize("group", [POSES, QUATERNIONS], ids=["poses", "quaternions"])
class TestGroup:
    @settings(max_examples=30, deadline=None)
    @given(one=elements, two=elements, three=elements)
    def test_products_are_associative_and_those_of_the_matrices(
        self, group: Group, one: list[float], two: list[float], three: list[float]
    ) -> None:
        a, b, c = (group.element(each) for each in (one, two, three))
        left, right = group.product(group.product(a, b), c), group.product(a, group.product(b, c))
        self.assert_same(group, left, right)
        expected = group.matrix(a) @ group.matrix(b) @ group.matrix(c)
        np.testing.assert_allclose(group.matrix(left), expected, rtol=0.0, atol=ROUNDING)

    @settings(max_examples=30, deadline=None)
    @given(one=elements, two=elements)
    def test_inverses_are_inverse_from_both_sides_and_of_products_in_reverse(
        self, group: Group, one: list[float], two: list[float]
    ) -> None:
        a, b = group.element(one), group.element(two)
        self.assert_same(group, group.product(a, group.inverse(a)), group.identity)
        self.assert_same(group, group.product(group.inverse(a), a), group.identity)
        self.assert_same(group, group.inverse(group.inverse(a)), a)
        reverse = group.product(group.inverse(b), group.inverse(a))
        self.assert_same(group, group.inverse(group.product(a, b)), reverse)

    @settings(max_examples=20, deadline=None)
    @given(one=elements)
    def test_the_identity_changes_nothing(self, group: Group, one: list[float]) -> None:
        a = group.element(one)
        self.assert_same(group, group.product(a, group.identity), a)
        self.assert_same(group, group.product(group.identity, a), a)

    def assert_same(self, group: Group, a: Any, b: Any) -> None:
        np.testing.assert_allclose(group.matrix(a), group.matrix(b), rtol=0.0, atol=ROUNDING)
