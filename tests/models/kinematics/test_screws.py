"""The joints of a chain as screws: the product of exponentials, and back to a chain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from asserting import there
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import Screws, chain_to_screws, poses_over_log, screws_to_chain
from urmpipe_models.math3d import from_offset, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names

AGREES = 1e-12
"""Levers of up to 10 m, some hundred roundings."""

LED_BY_NONE = [
    name for name in robot_names() if all(joint.mimic is None for joint in load_robot(name).joints)
]
"""The arms of the catalogue whose joints follow no other."""


def exponential(direction: FloatArray, point: FloatArray, revolute: bool, q: float) -> FloatArray:
    """Return exp(xi q) of a screw by the series of its 4x4 matrix."""
    twist = np.zeros((4, 4))
    if revolute:
        x, y, z = direction
        twist[:3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        twist[:3, 3] = -np.cross(direction, point)
    else:
        twist[:3, 3] = direction
    term, total = np.eye(4), np.eye(4)
    for k in range(1, 40):
        term = term @ twist * (q / k)
        total = total + term
    return total


def product_of_exponentials(arm: Screws, q: FloatArray) -> FloatArray:
    """Return T(q) = exp(xi_1 q_1) ... exp(xi_n q_n) T(0), shape (4, 4)."""
    pose = np.eye(4)
    for each in zip(arm.direction, arm.point, arm.revolute, q.tolist(), strict=True):
        pose = pose @ exponential(*each)
    zero = np.eye(4)
    zero[:3, :3], zero[:3, 3] = arm.rotation, arm.position
    return pose @ zero


def assert_kinematics(chain: Chain, arm: Screws) -> None:
    """Hold the product of exponentials against forward kinematics."""
    q = np.random.default_rng(8).uniform(-2.0, 2.0, (3, len(chain.coordinates)))
    for row, position, rotation in zip(q, *poses_over_log(chain, q), strict=True):
        pose = product_of_exponentials(arm, row)
        np.testing.assert_allclose(pose[:3, 3], position, rtol=0.0, atol=AGREES)
        np.testing.assert_allclose(pose[:3, :3], rotation, rtol=0.0, atol=AGREES)


@pytest.mark.parametrize("robot", LED_BY_NONE)
def test_the_product_of_exponentials_is_the_tip(robot: str) -> None:
    chain = load_robot(robot).placed(
        from_offset((0.1, -0.2, 0.3, 0.4, 0.5, 0.6)), from_offset((0.0, 0.1, 0.15))
    )
    arm = there(chain_to_screws(chain))
    assert_kinematics(chain, arm)


@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_so_it_is_of_any_chain_without_mimics_and_of_the_chain_made_of_its_screws(
    chains: SearchStrategy[Chain], data: st.DataObject
) -> None:
    chain = data.draw(chains)
    chain = replace(chain, joints=tuple(replace(joint, mimic=None) for joint in chain.joints), start=())
    arm = there(chain_to_screws(chain))
    assert_kinematics(chain, arm)
    assert_kinematics(screws_to_chain(arm, chain.coordinates), arm)


def test_a_chain_whose_joints_follow_others_has_none() -> None:
    assert chain_to_screws(Chain("follows", (Joint("a"), Joint("b", mimic=Mimic("a", 2.0, 0.0))))) is None


def test_the_size_is_the_way_from_axis_to_axis_to_the_tip_and_never_0() -> None:
    arm = chain_to_screws(
        Chain("l", (Joint("a"), Joint("b", origin=translation(0.3, 0.0, 0.4))), translation(0, 2, 0))
    )
    assert there(arm).size == 2.5
    point = there(chain_to_screws(Chain("point", (Joint("a"),))))
    assert point.size == 1.0
