"""Closed forms against those of EAIK (C++), in number and value, away from singular poses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asserting import there
from spherical_arms import SPECIAL, inverse_of, random_arm, random_joints
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.kinematics.forward import chain_to_screws, jacobian_over_log
from urmpipe_models.robots.catalogue import load_robot

CLEAR = 1e-2
"""The least singular value of the Jacobian away from singular poses, angles in [rad], lengths in [m]."""

AGREEMENT = 1e-8
"""EAIK works to some 1e-11, and a least singular value of 0.01 makes a hundred times more of it."""


def clear_poses(chain: Chain, generator: np.random.Generator, count: int) -> FloatArray:
    """Up to `count` random joint values away from singular poses."""
    q = random_joints(generator, chain, 4 * count)
    return q[np.linalg.svd(jacobian_over_log(chain, q), compute_uv=False)[:, -1] > CLEAR][:count]


def assert_agreement(chain: Chain, q: FloatArray) -> None:
    """Hold our solutions of the poses at q against those of EAIK, both ways."""
    hp = pytest.importorskip("eaik.IK_HP", reason="needs eaik")
    found = there(chain_to_screws(chain))
    links = np.vstack((found.point[:1], np.diff(found.point, axis=0), found.position - found.point[-1]))
    peer = hp.HPRobot(found.direction, links)
    assert peer.hasSphericalWrist()
    targets = forward_targets(chain, q)
    solutions = inverse_of(chain).solve(targets)
    for row in range(len(q)):
        ours = solutions.q[row][solutions.reached[row]]
        if np.linalg.svd(jacobian_over_log(chain, ours), compute_uv=False)[:, -1].min() < CLEAR:
            continue  # another solution of the pose is singular
        pose = np.eye(4)
        pose[:3, 3] = targets.position[row]
        pose[:3, :3] = there(targets.rotation)[row] @ found.rotation.T
        answer = peer.IK(pose)
        theirs = np.array(answer.Q)[~np.array(answer.is_LS, dtype=bool)]
        away = ours[:, None] - theirs[None]
        away -= 2 * math.pi * np.round(away / (2 * math.pi))
        distance = np.abs(away).max(axis=2)
        assert len(ours) == len(theirs)
        assert distance.min(axis=0).max() < AGREEMENT
        assert distance.min(axis=1).max() < AGREEMENT


@pytest.mark.slow
@pytest.mark.parametrize("special", [name for name in SPECIAL if name != "plain"])
def test_arms_with_axes_that_meet_or_are_parallel(special: str) -> None:
    generator = np.random.default_rng(21)
    held = 0
    while held < 3:
        chain = random_arm(generator, special)
        q = clear_poses(chain, generator, 60)
        if len(q) == 60:  # else a small arm
            assert_agreement(chain, q)
            held += 1


@pytest.mark.parametrize("robot", ["arm6", "articulated6r"])
def test_arms_of_the_papers(robot: str) -> None:
    chain = load_robot(robot)
    q = clear_poses(chain, np.random.default_rng(22), 200)
    assert len(q) > 100
    assert_agreement(chain, q)
