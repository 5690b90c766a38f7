"""How far a tool is from its targets: the way, and the turn as a rotation vector."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from urmpipe_models.ik.solutions import Targets, forward_targets, pose_errors
from urmpipe_models.robots.catalogue import load_robot

ARM = load_robot("arm6")
Q = np.array([[0.3, 0.8, -0.6, 0.5, 0.7, 0.2]])


def turned(vector: list[float]) -> Targets:
    """Return the pose of the arm, turned in the world by a rotation vector in [rad]."""
    there = forward_targets(ARM, Q)
    assert there.rotation is not None
    return Targets(there.position, Rotation.from_rotvec(vector).as_matrix() @ there.rotation)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.one_of(st.floats(0.0, 3.1), st.floats(-15.0, 0.0).map(lambda power: 10.0**power)),
)
def test_the_turn_is_the_rotation_vector_in_the_world(axis: list[float], angle: float) -> None:
    vector = angle * np.array(axis) / np.linalg.norm(axis)
    position, turn = pose_errors(ARM, Q, turned(vector.tolist()))
    assert np.abs(position).max() == 0.0
    assert np.abs(turn[0] - vector).max() < 1e-14  # some rounding of the two matrices; far below any angle


@pytest.mark.parametrize("angle", [np.pi, np.pi - 1e-9, np.pi - 1e-4])
def test_half_a_turn_has_its_whole_angle(angle: float) -> None:
    _, turn = pose_errors(ARM, Q, turned([0.0, -angle, 0.0]))
    assert np.linalg.norm(turn) == pytest.approx(angle, abs=1e-14)


def test_where_there_is_no_pose_there_is_no_turn_and_positions_have_none_at_all() -> None:
    there = forward_targets(ARM, Q)
    position, turn = pose_errors(ARM, np.full((1, 6), np.nan), there)
    assert np.isnan(position).all()
    assert np.isnan(turn).all()
    position, turn = pose_errors(ARM, Q, Targets(there.position + np.array([1.0, 0.0, 0.0])))
    assert position[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert turn.tolist() == [[0.0, 0.0, 0.0]]
