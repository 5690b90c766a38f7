"""Differences of poses, and the turns of solutions within limits, of all values."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from asserting import there
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.ik.limits import TURN, limit_solutions
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.robots.catalogue import load_robot

ARM = load_robot("arm6")
Q = np.array([[0.3, 0.8, -0.6, 0.5, 0.7, 0.2]])


def turned(vector: list[float]) -> Targets:
    """Return the pose of the arm, turned in the world by a rotation vector in [rad]."""
    pose = forward_targets(ARM, Q)
    return Targets(pose.position, Rotation.from_rotvec(vector).as_matrix() @ there(pose.rotation))


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
    pose = forward_targets(ARM, Q)
    assert np.isnan(pose_errors(ARM, np.full((1, 6), np.nan), pose)).all()
    position, turn = pose_errors(ARM, Q, Targets(pose.position + np.array([1.0, 0.0, 0.0])))
    assert position[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert turn.tolist() == [[0.0, 0.0, 0.0]]


@pytest.mark.slow
@settings(deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(-20.0, 20.0), st.floats(0.0, 20.0), st.floats(-30.0, 30.0))
def test_the_nearest_turn_in_limits_is_taken(value: float, lower: float, width: float, near: float) -> None:
    chain = Chain("arm", (Joint("q1", lower=lower, upper=lower + width),))
    one = Solutions(np.array([[[value]]]), ("only",), np.array([[""]], dtype=np.object_))
    found = limit_solutions(chain, one, np.array([near]))
    turns = value + TURN * np.arange(-12, 13)
    allowed = turns[(turns >= lower) & (turns <= lower + width)]
    if len(allowed):
        assert abs(found.q[0, 0, 0] - near) <= np.abs(allowed - near).min() + 1e-9
        assert lower <= found.q[0, 0, 0] <= lower + width
        assert abs(math.remainder(found.q[0, 0, 0] - value, TURN)) < 1e-10
    else:
        # what is beyond a limit by rounding may count as on it
        assert not found.reached.any() or np.abs(turns - found.q[0, 0, 0]).min() < 1e-10
