"""Changes of an arm's frames: how they move its tool centre point, against changed arms and differences."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest

from differences import assert_slope
from rail_arm import rail_arm
from sliding_arm import sliding_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.kinematics.identification import BASE, Twist, apply_twists, sensitivities
from urmpipe_models.math3d import Transform, from_offset
from urmpipe_models.robots.catalogue import load_robot

ARMS = (load_robot("urm6"), load_robot("ur5e"), load_robot("panda"), rail_arm(), sliding_arm())
SKEW = from_offset((0.3, -0.2, 0.1, 0.4, -0.7, 1.1))
AXIS = (0.48, -0.6, 0.64)

Changes = Sequence[tuple[Twist, float]]

REACH = 6.0
"""No arm here reaches as far in [m]: the most that a third derivative of its pose by an angle can be."""


def q_of(chain: Chain, samples: int = 4) -> FloatArray:
    return np.random.default_rng(1).uniform(-1.0, 1.0, (samples, len(chain.coordinates)))


def twists_of(chain: Chain) -> list[Twist]:
    """A shift and a turn on a skew axis of each frame."""
    places = range(BASE, len(chain.joints) + 3)
    return [Twist(place, kind, AXIS, SKEW) for place in places for kind in ("along", "about")]


def pose_after(
    chain: Chain, q: FloatArray, changes: Sequence[tuple[Twist, float]], k: int, h: float
) -> FloatArray:
    """Position and rotation of an arm, shape (n, 4, 3), one of whose changes is h larger."""
    more = [(twist, value + h * (i == k)) for i, (twist, value) in enumerate(changes)]
    position, rotation = poses_over_log(apply_twists(chain, more)[0], q)
    return np.concatenate((position[:, np.newaxis], rotation), axis=1)


def assert_sensitive(chain: Chain, changes: Changes) -> None:
    """Hold the sensitivities of a changed arm against differences of the pose: p' = v, R' = [w] R."""
    q = q_of(chain)
    there, located = apply_twists(chain, changes)
    rotation = poses_over_log(there, q)[1]
    for k, (velocity, turn) in enumerate(sensitivities(there, list(q.T), located)):
        v, w = (np.array(np.broadcast_arrays(*one, q[:, 0])[:3]).T for one in (velocity, turn))
        slope = np.concatenate(
            (v[:, np.newaxis], np.cross(w[:, np.newaxis], rotation, axisa=2, axisb=1, axisc=1)), axis=1
        )
        assert_slope(partial(pose_after, chain, q, changes, k), slope, third=REACH, size=REACH)


@pytest.mark.parametrize("chain", ARMS, ids=lambda chain: chain.name)
def test_sensitivities_are_the_slopes_of_the_pose(chain: Chain) -> None:
    assert_sensitive(chain, [(twist, 0.0) for twist in twists_of(chain)])


@pytest.mark.slow
@pytest.mark.parametrize("chain", ARMS, ids=lambda chain: chain.name)
def test_they_are_so_at_large_changes_too(chain: Chain) -> None:
    rng = np.random.default_rng(2)
    assert_sensitive(chain, [(twist, float(rng.uniform(-0.5, 0.5))) for twist in twists_of(chain)])


def test_a_base_that_is_turned_turns_all_poses() -> None:
    chain, q = ARMS[0], q_of(ARMS[0])
    turn = Twist(BASE, "about", (0.0, 0.0, 1.0), Transform())
    position, _ = poses_over_log(apply_twists(chain, [(turn, 0.3)])[0], q)
    x, y, z = poses_over_log(chain, q)[0].T
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(
        position, np.column_stack([c * x - s * y, s * x + c * y, z]), atol=1e-15 * REACH
    )


def test_the_first_of_two_changes_of_a_frame_is_the_outermost() -> None:
    chain, q = ARMS[0], q_of(ARMS[0])
    turn, shift = (Twist(BASE, kind, (1.0, 0.0, 0.0), Transform()) for kind in ("about", "along"))
    lift = Twist(BASE, "along", (0.0, 0.0, 1.0), Transform())
    there = apply_twists(chain, [(turn, np.pi / 2), (lift, 0.1), (shift, 0.2)])[0]
    x, y, z = poses_over_log(chain, q)[0].T
    wanted = np.column_stack([x + 0.2, -(z + 0.1), y])
    np.testing.assert_allclose(poses_over_log(there, q)[0], wanted, atol=1e-15 * REACH)


def test_no_change_gives_the_arm_itself() -> None:
    chain = ARMS[0]
    twists = twists_of(chain)
    there, located = apply_twists(chain, [(twist, 0.0) for twist in twists])
    assert there is chain
    assert located == twists
