"""Pose and Jacobian with a vector an array, against the kinematics that has an array an entry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from urmpipe_models.arm.chain import Chain
from urmpipe_models.ik.task import prepare_chain, tool_motion
from urmpipe_models.kinematics.forward import jacobian_over_log, poses_over_log
from urmpipe_models.robots.catalogue import load_robot


@settings(max_examples=40, deadline=None)
@given(data=st.data(), rows=st.integers(1, 4))
def test_any_chain_has_the_pose_and_the_jacobian_of_its_kinematics(
    chains: SearchStrategy[Chain], data: st.DataObject, rows: int
) -> None:
    """Fixed frames, slides, mimics, any axis; entries of some metres at most, some products: 1e-12."""
    chain = data.draw(chains)
    q = np.random.default_rng(rows).uniform(-3.0, 3.0, (rows, len(chain.coordinates)))
    tool = tool_motion(prepare_chain(chain), np.ascontiguousarray(q.T))
    position, rotation = poses_over_log(chain, q)
    np.testing.assert_allclose(tool.position.T, position, atol=1e-12)
    np.testing.assert_allclose(tool.columns.transpose(2, 1, 0), rotation, atol=1e-12)
    np.testing.assert_allclose(tool.jacobian.transpose(2, 0, 1), jacobian_over_log(chain, q), atol=1e-12)


@pytest.mark.parametrize("robot", ["urm6", "urm8", "panda", "ur5e"])
def test_a_row_has_the_same_bits_alone_and_beside_others(robot: str) -> None:
    arm = prepare_chain(load_robot(robot))
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (len(arm.chain.coordinates), 50))
    whole = tool_motion(arm, q)
    for rows in ([0], [7, 9], list(range(13, 50))):
        for part, all_rows in zip(tool_motion(arm, q[:, rows].copy()), whole, strict=True):
            np.testing.assert_array_equal(part, all_rows[..., rows])
