"""The catalogue: the numbers and masses of its robots. catalogue.cases finds robots by name and file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.dynamics.equations import inverse_dynamics, mass_matrix
from urmpipe_models.kinematics.forward import forward, poses_over_log
from urmpipe_models.math3d import Transform, rotation_z
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict
from urmpipe_models.robots.urdf import read_urdf

DH = {  # d1, a2, a3, d4, d5, d6 in m, as Universal Robots publishes them
    "ur3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "ur5": (0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "ur10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "ur3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "ur5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "ur10e": (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
}
SPEEDS = {"ur3": (180,) * 3 + (360,) * 3, "ur5": (180,) * 6, "ur10": (120,) * 2 + (180,) * 4}  # deg/s


@pytest.mark.parametrize("name", robot_names())
def test_a_robot_says_what_it_is_and_starts_within_its_ranges(name: str) -> None:
    chain = load_robot(name)
    assert (chain.name, bool(chain.description), bool(chain.source)) == (name, True, True)
    assert chain_from_dict(chain_to_dict(chain)) == chain
    for joint, value in zip(chain.moving, chain.start, strict=True):
        assert joint.lower <= value <= joint.upper


@pytest.mark.parametrize("name", list(DH))
def test_universal_robots_geometry_limits_and_speeds(name: str) -> None:
    d1, a2, a3, d4, d5, d6 = DH[name]
    chain = load_robot(name)
    joints = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    assert chain.coordinates == tuple(f"{joint}_joint" for joint in joints)
    # stretched along -x (a2, a3 < 0), the wrist's offsets d4 and d6 to -y, d5 down
    tip = forward(chain, [0.0] * 6)[-1].translation
    np.testing.assert_allclose(tip, [a2 + a3, -d4 - d6, d1 - d5], atol=1e-15)  # rounding
    upright = forward(chain, chain.start)[-1].translation
    np.testing.assert_allclose(upright, [0.0, -d4 - d6, d1 - a2 - a3 + d5], atol=1e-15)
    assert [(joint.lower, joint.upper) for joint in chain.joints] == [(-2 * math.pi, 2 * math.pi)] * 6
    expected = np.radians(SPEEDS[name.removesuffix("e")])
    np.testing.assert_allclose([joint.velocity for joint in chain.joints], expected, rtol=1e-15)


@pytest.mark.parametrize("modules", [4, 6, 8])
def test_urm_arms_are_the_papers_modules(modules: int) -> None:
    chain = load_robot(f"urm{modules}")
    lengths = [joint.origin.translation[2] for joint in chain.joints[1:]] + [chain.tip.translation[2]]
    assert lengths == [0.243215, *[0.21243] * (modules - 1), 0.042215]
    assert chain.start == (0.0, math.pi) * (modules // 2)
    assert chain.coordinates == tuple(f"phi{k}" for k in range(1, modules + 1))
    assert len(chain.point_names) == modules + 1
    for joint in chain.joints[1:]:
        np.testing.assert_allclose(math.acos(joint.origin.rotation[0][0]), math.radians(52.0), rtol=1e-15)
    for joint in chain.joints:
        assert (joint.lower, joint.upper, joint.velocity) == (-math.inf, math.inf, math.inf)


def test_tips_of_the_papers_arms_at_zero() -> None:
    tip = forward(load_robot("arm6"), [0.0] * 6)[-1].translation
    np.testing.assert_allclose(tip, [-0.069, 0.0, 0.112], rtol=0.0, atol=1e-16)  # rounding
    tip = forward(load_robot("articulated6r"), [0.0] * 6)[-1].translation
    np.testing.assert_allclose(tip, [0.0, 0.0, 1.4], rtol=1e-15)  # straight up: the sum of its lengths


URDFS = {  # robot, file, its link at the robot's tip, FK to [m, -], speeds and ranges to [rad/s, rad]
    "panda of Gepetto": ("panda", "Gepetto_example-robot-data/panda.urdf", "panda_link8", 1e-15, 0.0),
    # its right angles have 12 digits: 2.6e-12 rad times seven of them and 1 m
    "panda of FancySafeBot": ("panda", "FancySafeBot_fsb-library/panda.urdf", "panda_link8", 5e-11, None),
    # its limits are degrees cut to four digits: 2.0942 for 120 deg
    "iiwa14": ("iiwa14", "ros-industrial_kuka_experimental/lbr_iiwa_14_r820.urdf", "tool0", 1e-15, 3e-4),
}


@pytest.mark.parametrize("which", list(URDFS))
def test_redundant_arms_are_those_of_urdfs_that_others_wrote(shared: Path, which: str) -> None:
    robot, file, tip, rounding, cut = URDFS[which]
    chain, other = load_robot(robot), load_robot(shared / "robots" / file, tip_link=tip)
    assert chain.coordinates == other.coordinates
    q = np.random.default_rng(3).uniform(-3.0, 3.0, (1000, 7))
    for got, expected in zip(poses_over_log(chain, q), poses_over_log(other, q), strict=True):
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=rounding)
    if cut is None:  # it gives other limits than the maker
        return
    limits = [[(one.lower, one.upper, one.velocity) for one in arm.moving] for arm in (chain, other)]
    np.testing.assert_allclose(limits[0], limits[1], rtol=0.0, atol=cut)


SAME = 1e-9
"""In [kg.m2] and [N.m]: right angles of the URDFs of Universal Robots' arms have twelve digits."""

MASS_URDFS = {
    "ur3": ("ur3_robot.urdf", "base_link", "tool0", rotation_z(math.pi)),
    "ur10": ("ur10_robot.urdf", "base_link", "tool0", rotation_z(math.pi)),
    "panda": ("panda.urdf", "panda_link0", "panda_link8", Transform()),
}
"""The file, its first and last link, and where the catalogue's base stands in the first."""


@pytest.mark.parametrize("name", MASS_URDFS)
def test_an_arm_needs_the_torques_of_its_urdf(shared: Path, name: str) -> None:
    file, first, last, base = MASS_URDFS[name]
    path = shared / "robots" / "Gepetto_example-robot-data" / file
    urdf, arm = read_urdf(path, base_link=first, tip_link=last), load_robot(name).placed(base)
    links = (one for one in urdf.inertials if one.source != "link panda_hand")  # a tool of the catalogue's
    urdf = replace(urdf, inertials=tuple(links))
    assert sum(one.mass for one in arm.inertials) == pytest.approx(sum(one.mass for one in urdf.inertials))
    random = np.random.default_rng(1)
    for _ in range(5):
        q, qd, qdd = random.uniform(-2.0, 2.0, (3, len(arm.coordinates))).tolist()
        np.testing.assert_allclose(mass_matrix(arm, q), mass_matrix(urdf, q), rtol=0.0, atol=SAME)
        for rates in (([0.0] * len(q),) * 2, (qd, qdd)):  # at rest gravity alone
            needed, expected = (inverse_dynamics(one, q, *rates) for one in (arm, urdf))
            np.testing.assert_allclose(needed, expected, rtol=0.0, atol=1e2 * SAME)  # up to 100 N.m
