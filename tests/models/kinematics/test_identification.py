"""Changes of an arm's frames: how they move its tool centre point, against changed arms and differences."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

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

REACH = 6.0
"""No arm here reaches as far in [m]: the most that a third derivative of its pose by an angle can be."""


def twists_of(chain: Chain) -> list[Twist]:
    """A shift and a turn on a skew axis of each frame."""
    places = range(BASE, len(chain.joints) + 3)
    return [Twist(place, kind, AXIS, SKEW) for place in places for kind in ("along", "about")]


@pytest.mark.parametrize("chain", ARMS, ids=lambda chain: chain.name)
@pytest.mark.parametrize("largest", [0.0, pytest.param(0.5, marks=pytest.mark.slow)])
def test_sensitivities_are_the_slopes_of_the_pose(chain: Chain, largest: float) -> None:
    """Compare those of a changed arm with differences of the pose: p' = v, R' = [w] R."""
    q, twists = np.random.default_rng(1).uniform(-1.0, 1.0, (4, len(chain.coordinates))), twists_of(chain)
    values = np.random.default_rng(2).uniform(-largest, largest, len(twists)).tolist()
    changes = [*zip(twists, values, strict=True)]
    changed, located = apply_twists(chain, changes)
    rotation = poses_over_log(changed, q)[1]

    def pose(k: int, h: float) -> FloatArray:
        """Position and rotation of the arm, shape (n, 4, 3), whose change k is h larger."""
        more = [(twist, value + h * (i == k)) for i, (twist, value) in enumerate(changes)]
        position, rotation = poses_over_log(apply_twists(chain, more)[0], q)
        return np.concatenate((position[:, np.newaxis], rotation), axis=1)

    for k, (velocity, turn) in enumerate(sensitivities(changed, list(q.T), located)):
        v, w = (np.array(np.broadcast_arrays(*u, q[:, 0])[:3]).T[:, np.newaxis] for u in (velocity, turn))
        slope = np.concatenate((v, np.cross(w, rotation, axisa=2, axisb=1, axisc=1)), axis=1)
        assert_slope(partial(pose, k), slope, third=REACH, size=REACH)


def test_a_base_that_is_turned_turns_all_poses_and_the_first_of_two_changes_is_the_outermost() -> None:
    chain, q = ARMS[0], np.random.default_rng(1).uniform(-1.0, 1.0, (4, 6))
    x, y, z = poses_over_log(chain, q)[0].T
    c, s = np.cos(0.3), np.sin(0.3)
    twist = partial(Twist, BASE, frame=Transform())
    roll, lift = twist("about", axis=(1.0, 0.0, 0.0)), twist("along", axis=(0.0, 0.0, 1.0))
    shift = twist("along", axis=(1.0, 0.0, 0.0))
    for changes, expected in (
        ([(twist("about", axis=(0.0, 0.0, 1.0)), 0.3)], [c * x - s * y, s * x + c * y, z]),
        ([(roll, np.pi / 2), (lift, 0.1), (shift, 0.2)], [x + 0.2, -(z + 0.1), y]),
    ):
        position, _ = poses_over_log(apply_twists(chain, changes)[0], q)
        assert_allclose(position, np.column_stack(expected), atol=1e-15 * REACH)


def test_no_change_gives_the_arm_itself() -> None:
    twists = twists_of(ARMS[0])
    changed, located = apply_twists(ARMS[0], [(twist, 0.0) for twist in twists])
    assert changed is ARMS[0]
    assert located == twists
