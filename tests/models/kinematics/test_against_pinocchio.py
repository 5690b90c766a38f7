"""Forward kinematics against Pinocchio, on random poses."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from numpy.testing import assert_allclose

from pinocchio_arms import add_frame, pinocchio, pinocchio_model
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import jacobian, point_motions, points_over_log, poses_over_log
from urmpipe_models.math3d import from_offset
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import write_urdf

# In m and for the entries of R: rounding of some hundred operations on an arm of 1 to 2 m reaches about
# 1e-15; files that carry 16 digits add as much.
AGREES = 1e-12


def assert_same(model: Any, frames: list[str], chain: Chain) -> None:
    """Compare 1000 poses: the position of each frame, and of the last one the orientation."""
    q = np.random.default_rng(7).uniform(-math.pi, math.pi, (1000, len(chain.coordinates)))
    position, rotation = poses_over_log(chain, q)
    points = points_over_log(chain, q)[:, -len(frames) :]
    data, joints = model.createData(), list(model.joints)[1:]
    for k, row in enumerate(q):
        values = np.append(row, np.zeros(len(joints) - len(row)))  # fingers that the chain does not have
        pairs = zip(joints, values, strict=True)  # a continuous joint is a cosine and a sine
        parts = [[math.cos(value), math.sin(value)] if joint.nq == 2 else [value] for joint, value in pairs]
        pinocchio.framesForwardKinematics(model, data, np.concatenate(parts))
        poses = [data.oMf[model.getFrameId(frame)] for frame in frames]
        expected = [pose.translation for pose in (*poses, poses[-1])]
        assert_allclose([*points[k], position[k]], expected, rtol=0.0, atol=AGREES)
        assert_allclose(rotation[k], poses[-1].rotation, rtol=0.0, atol=AGREES)


LENGTHS = (0.243215, 0.21243, 0.21243, 0.21243, 0.21243, 0.21243, 0.042215)
TILT, HALF = math.radians(52.0), math.pi / 2
BY_HAND = {  # roll, pitch, x, z from each axis to the next, and after the last
    "urm6": [(0.0, 0.0, 0.0, 0.0), *((0.0, TILT, 0.0, z) for z in LENGTHS[:6]), (0.0, 0.0, 0.0, LENGTHS[6])],
    "ur5e": [
        (0.0, 0.0, 0.0, 0.0),
        *((HALF, 0.0, 0.0, 0.1625), (0.0, 0.0, -0.425, 0.0), (0.0, 0.0, -0.3922, 0.0)),
        *((HALF, 0.0, 0.0, 0.1333), (-HALF, 0.0, 0.0, 0.0997), (0.0, 0.0, 0.0, 0.0996)),
    ],
}
URDFS = [
    ("Gepetto_example-robot-data/panda.urdf", "panda_hand_tcp"),
    ("FancySafeBot_fsb-library/panda.urdf", "panda_hand"),
    ("ros-industrial_kuka_experimental/lbr_iiwa_14_r820.urdf", "tool0"),
]


@pytest.mark.parametrize("robot", BY_HAND)
def test_arms_are_those_built_by_hand(robot: str) -> None:
    model, parent, turn = pinocchio.Model(), 0, pinocchio.rpy.rpyToMatrix
    links = [pinocchio.SE3(turn(a, b, 0.0), np.array([x, 0.0, z])) for a, b, x, z in BY_HAND[robot]]
    for k in range(6):
        parent = model.addJoint(parent, pinocchio.JointModelRZ(), links[k], f"q{k}")
    add_frame(model, "tool", parent, math.prod(links[6:], start=pinocchio.SE3.Identity()))
    assert_same(model, ["tool"], load_robot(robot))


def test_every_point_of_urm6_is_that_of_the_exported_urdf(tmp_path: Path) -> None:
    chain = load_robot("urm6").placed(from_offset([0.1, -0.2, 0.3, 0.4, 0.5, 0.6]), from_offset([0, 0, 0.15]))
    write_urdf(chain, tmp_path / "urm6.urdf")
    model = pinocchio.buildModelFromUrdf(str(tmp_path / "urm6.urdf"))
    assert_same(model, [*(f"link{k}" for k in range(2, 8)), "tool0"], chain)


@pytest.mark.slow
@pytest.mark.parametrize(("file", "tip"), URDFS)
def test_urdfs_of_others(shared: Path, file: str, tip: str) -> None:
    path = shared / "robots" / file
    assert_same(pinocchio.buildModelFromUrdf(str(path)), [tip], read_urdf(path, tip_link=tip))


@settings(deadline=None, max_examples=25)
@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
def test_motions_and_jacobians(chains: SearchStrategy[Chain], data: st.DataObject, seed: int) -> None:
    chain = data.draw(chains.filter(lambda chain: not any(joint.mimic for joint in chain.joints)))
    model, aligned = pinocchio_model(chain), pinocchio.LOCAL_WORLD_ALIGNED
    state = model.createData()
    q, qd, qdd = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, len(chain.coordinates)))
    pinocchio.forwardKinematics(model, state, q, qd, qdd)
    pinocchio.updateFramePlacements(model, state)
    pinocchio.computeJointJacobians(model, state, q)
    for k, motion in enumerate(point_motions(chain, q, qd, qdd), 1):
        frame = model.getFrameId(f"p{k}" if k < len(chain.joints) else "tool")
        velocity = pinocchio.getFrameVelocity(model, state, frame, aligned).vector
        acceleration = pinocchio.getFrameClassicalAcceleration(model, state, frame, aligned).vector
        J = pinocchio.getFrameJacobian(model, state, frame, aligned).reshape(6, -1)
        assert_close(motion.pose.translation, state.oMf[frame].translation)
        assert_close(motion.pose.rotation, state.oMf[frame].rotation)
        assert_close([*motion.velocity, *motion.omega], velocity)
        assert_close([*motion.acceleration, *motion.alpha], acceleration)
        assert_close(np.array(jacobian(chain, q, k - 1), dtype=float).T, J)


def assert_close(values: Any, expected: FloatArray) -> None:
    """Compare values of some tens: levers of up to 10 m, times speeds of up to 7 and their squares."""
    assert_allclose(np.array(values, dtype=float), expected, rtol=AGREES, atol=30 * AGREES)
