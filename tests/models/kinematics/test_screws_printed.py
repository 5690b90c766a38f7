"""The joints of a chain as screws: printed ones, and that they are the same arm."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asserting import there
from urmpipe_models.arm.chain import Chain, Joint, JointKind, Mimic
from urmpipe_models.kinematics.forward import chain_to_screws, screws_to_chain, tip_pose
from urmpipe_models.math3d import Transform, from_offset, rotation_x, rotation_z, translation

ARM = Chain(
    "arm",
    (
        Joint("turn", origin=translation(0.0, 0.0, 0.5)),
        Joint("flange", "fixed", translation(2.0, 0.0, 0.0)),
        Joint("slide", "prismatic", rotation_x(math.pi / 2), axis=(0.0, 0.0, -1.0)),
    ),
    tip=translation(0.0, 3.0, 0.0),
    base=Transform(rotation_z(math.pi / 2).rotation, (1.0, 0.0, 0.0)),
    tool=rotation_x(-math.pi / 2),
)

WHOLE = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def test_screws_stand_in_the_world_base_and_tool_included() -> None:
    found = there(chain_to_screws(ARM))
    # The base turns x to y and y to -x; the slide's frame lies on its side, so that its -z is y before.
    np.testing.assert_array_equal(found.direction, [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(found.point, [[1.0, 0.0, 0.5], [1.0, 2.0, 0.5]])
    np.testing.assert_array_equal(found.revolute, [True, False])
    np.testing.assert_array_equal(found.rotation, [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(found.position, [1.0, 2.0, 3.5])
    assert found.size == 2.0 + 3.0  # from axis to axis, and to the tip


def test_an_arm_whose_axes_meet_in_its_tip_has_the_size_1() -> None:
    found = there(chain_to_screws(Chain("wrist", (Joint("a"), Joint("b", axis=(1.0, 0.0, 0.0))))))
    assert found.size == 1.0


def test_a_joint_that_follows_another_is_no_screw() -> None:
    assert chain_to_screws(Chain("arm", (Joint("a"), Joint("b", mimic=Mimic("a"))))) is None


def test_screws_are_floats_whatever_numbers_describe_the_arm() -> None:
    whole = Chain("arm", (Joint("a", origin=translation(1, 2, 3), axis=(0, 0, 1)),), base=Transform(WHOLE))
    found = there(chain_to_screws(whole))
    for one in (found.direction, found.point, found.rotation, found.position):
        assert one.dtype == np.float64


def test_each_screw_of_a_chain_has_a_name() -> None:
    found = there(chain_to_screws(ARM))
    for names in (("a",), ("a", "b", "c")):
        with pytest.raises(ValueError, match="zip"):
            screws_to_chain(found, names)


def random_arm(rng: np.random.Generator) -> Chain:
    """An arm of one to seven joints of each kind, at least one of which moves, in any frames."""

    def frame() -> Transform:
        return from_offset(rng.uniform(-1.0, 1.0, 6).tolist())

    def joint(k: int) -> Joint:
        kinds: tuple[JointKind, ...] = ("revolute", "prismatic", "fixed")
        x, y, z = frame().rotation[0]
        return Joint(f"j{k}", kinds[rng.integers(3)] if k else "revolute", frame(), (x, y, z))

    joints = tuple(joint(k) for k in range(rng.integers(1, 8)))
    return Chain("arm", joints, frame(), frame(), frame())


def test_a_chain_of_the_screws_is_the_same_arm() -> None:
    rng = np.random.default_rng(21)
    for _ in range(30):
        chain = random_arm(rng)
        found = there(chain_to_screws(chain))
        names = tuple(f"n{k}" for k in range(len(chain.coordinates)))
        again = screws_to_chain(found, names)
        assert (again.name, again.coordinates) == ("screws", names)
        q = rng.uniform(-3.0, 3.0, len(names)).tolist()
        expected, got = tip_pose(chain, q), tip_pose(again, q)
        # ten frames and more with shifts of up to 1.7 m and slides of up to 3 m: some 30 m, rounded each time
        np.testing.assert_allclose(got.translation, expected.translation, rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(got.rotation, expected.rotation, rtol=0.0, atol=1e-14)
