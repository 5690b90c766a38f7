"""The bound on an arm's reach: nothing that it can reach lies beyond, and what does is told."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.ik.path_numeric import find_out_of_reach, max_reach
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.math3d import Transform, translation
from urmpipe_models.robots.catalogue import load_robot


@pytest.mark.parametrize("robot", ["urm6", "panda", "iiwa14", "ur5e", "arm6"])
def test_no_posture_is_too_far(robot: str) -> None:
    arm = load_robot(robot).placed(base=translation(5.0, -3.0, 1.0), tool=translation(0.1, 0.0, 0.2))
    q = np.random.default_rng(0).uniform(-math.pi, math.pi, (5000, len(arm.coordinates)))
    assert not any(find_out_of_reach(arm, forward_targets(arm, q), None))


def test_a_stretched_planar_arm_reaches_the_bound_and_no_farther() -> None:
    arm = Chain(
        "two", (Joint("a"), Joint("b", origin=translation(1.0, 0.0, 0.0))), tip=translation(0.5, 0, 0)
    )
    assert max_reach(arm) == 1.5
    assert forward_targets(arm, np.zeros((1, 2))).position[0, 0] == 1.5
    away = Targets(np.array([[1.5, 0.0, 0.0], [0.0, 1.502, 0.0], [math.nan, 0.0, 0.0]]))
    assert find_out_of_reach(arm, away, None) == [
        "", "the target is 1.502 m from the first joint, allowed: 1.500 m at most", ""
    ]  # fmt: skip
    assert find_out_of_reach(arm, away, 0.002) == ["", "", ""]


def test_prismatic_joints_add_their_strokes() -> None:
    slide = Joint("x", "prismatic", lower=-0.7, upper=0.5)
    arm = Chain("slide", (slide, Joint("a")), tip=translation(0.2, 0.0, 0.0))
    assert max_reach(arm) == pytest.approx(0.9, abs=1e-15)
    follower = Joint("y", "prismatic", mimic=Mimic("x", -2.0, 0.1))
    both = replace(arm, joints=(slide, follower), tip=Transform(), start=())
    assert max_reach(both) == pytest.approx(0.7 + 1.5, abs=1e-15)
    endless = replace(arm, joints=(Joint("x", "prismatic"), Joint("a")))
    assert max_reach(endless) == math.inf
    assert find_out_of_reach(endless, Targets(np.array([[1e9, 0.0, 0.0]])), None) == [""]
