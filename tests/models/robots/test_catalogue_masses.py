"""The masses of the catalogue against the URDFs that they are from."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.dynamics.equations import inverse_dynamics, mass_matrix
from urmpipe_models.math3d import Transform, rotation_z
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.urdf import read_urdf

SAME = 1e-9
"""In [kg.m2] and [N.m]: right angles of the URDFs of Universal Robots' arms have twelve digits."""

URDFS = {
    "ur3": ("ur3_robot.urdf", "base_link", "tool0", rotation_z(math.pi)),
    "ur10": ("ur10_robot.urdf", "base_link", "tool0", rotation_z(math.pi)),
    "panda": ("panda.urdf", "panda_link0", "panda_link8", Transform()),
}
"""The file, its first and last link, and where the catalogue's base stands in the first."""


def test_three_arms_have_masses_of_a_urdf_and_irb60_assumed_ones() -> None:
    assert {name for name in robot_names() if load_robot(name).inertials} == {*URDFS, "irb60", "irb60-spring"}
    assert all(one.source.startswith("assumption: ") for one in load_robot("irb60").inertials)


@pytest.mark.parametrize("name", URDFS)
def test_an_arm_needs_the_torques_of_its_urdf(shared: Path, name: str) -> None:
    file, first, last, base = URDFS[name]
    path = shared / "robots" / "Gepetto_example-robot-data" / file
    urdf, arm = read_urdf(path, base_link=first, tip_link=last), load_robot(name).placed(base)
    links = tuple(
        one for one in urdf.inertials if one.source != "link panda_hand"
    )  # a tool of the catalogue's
    urdf = replace(urdf, inertials=links)
    assert sum(one.mass for one in arm.inertials) == pytest.approx(sum(one.mass for one in urdf.inertials))
    random = np.random.default_rng(1)
    for _ in range(5):
        q, qd, qdd = random.uniform(-2.0, 2.0, (3, len(arm.coordinates))).tolist()
        np.testing.assert_allclose(mass_matrix(arm, q), mass_matrix(urdf, q), rtol=0.0, atol=SAME)
        for rates in (([0.0] * len(q),) * 2, (qd, qdd)):  # at rest gravity alone
            needed, expected = (inverse_dynamics(one, q, *rates) for one in (arm, urdf))
            np.testing.assert_allclose(needed, expected, rtol=0.0, atol=1e2 * SAME)  # up to 100 N.m
