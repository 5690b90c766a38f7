"""The values of the joints of a chain, and the frames that they move."""

from __future__ import annotations

import math

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.kinematics.forward import iter_frames, joint_values
from urmpipe_models.math3d import Transform, translation

ARM = Chain(
    "arm",
    (
        Joint("mount", "fixed", translation(0.0, 0.0, 0.5)),
        Joint("lift", "prismatic", axis=(0.0, 0.0, -1.0)),
        Joint("follow", "prismatic", axis=(1.0, 0.0, 0.0), mimic=Mimic("lift", -2.0, 0.25)),
        Joint("turn", axis=(0.0, 1.0, 0.0)),
        Joint("flange", "fixed", translation(0.0, 0.0, 0.125)),
    ),
    base=translation(1.0, 2.0, 3.0),
)


def test_a_fixed_joint_has_the_value_0_and_a_mimic_follows_its_line() -> None:
    assert joint_values(ARM, [0.5, 0.75]) == [0.0, 0.5, -2.0 * 0.5 + 0.25, 0.75, 0.0]


@pytest.mark.parametrize("q", [[], [0.5], [0.5, 0.75, 1.0]])
def test_there_is_a_value_for_each_coordinate_no_more_and_no_less(q: list[float]) -> None:
    with pytest.raises(ValueError, match="zip"):
        joint_values(ARM, q)
    with pytest.raises(ValueError, match="zip"):
        list(iter_frames(ARM, q))


def test_frames_are_the_base_and_what_each_joint_moves() -> None:
    found = list(iter_frames(ARM, [0.5, 0.0]))
    assert found[0] == ARM.base
    assert [frame.translation for frame in found] == [
        (1.0, 2.0, 3.0),
        (1.0, 2.0, 3.5),
        (1.0, 2.0, 3.0),
        (0.25, 2.0, 3.0),
        (0.25, 2.0, 3.0),
        (0.25, 2.0, 3.125),
    ]
    assert all(frame.rotation == Transform().rotation for frame in found)


def test_a_revolute_joint_turns_and_does_not_shift() -> None:
    *_, turned, flange = iter_frames(ARM, [0.5, math.pi / 2])
    assert turned.translation == (0.25, 2.0, 3.0)
    # a joint's value is no constant: cos(pi / 2) is 6e-17, as in a column
    np.testing.assert_allclose(turned.rotation, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(flange.translation, (0.375, 2.0, 3.0), rtol=1e-16)  # its z is x of the world
