"""Orientations as logs record them."""

import numpy as np

from urmpipe_models.orientation import quaternions


def test_quaternions_of_rotation_vectors() -> None:
    half = np.sqrt(0.5)
    found = quaternions(
        np.array([[0, 0, 0], [0, 0, np.pi / 2], [np.pi, 0, 0], [0, -np.pi / 2, 0], [1e-9, 0, 0]]),
        "vector",
    )
    expected = [[0, 0, 0, 1], [0, 0, half, half], [1, 0, 0, 0], [0, -half, 0, half], [5e-10, 0, 0, 1]]
    np.testing.assert_allclose(found, expected, atol=1e-15)  # a few rounding errors of numbers up to 1
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-15)
