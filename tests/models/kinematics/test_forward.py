"""Forward kinematics against Pinocchio, printed numbers, differences, and the product of exponentials."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from scipy.linalg import expm

from asserting import there
from differences import assert_slope
from urmpipe_models.arm.chain import Chain, Joint, JointKind, Mimic
from urmpipe_models.arm.denavit_hartenberg import DHRow, modified_dh_chain, urm_chain
from urmpipe_models.elementwise import BLOCK, FloatArray, row_blocks
from urmpipe_models.kinematics.forward import (
    Screws,
    chain_to_screws,
    forward,
    iter_frames,
    jacobian,
    jacobian_over_log,
    joint_values,
    point_motions,
    point_over_log,
    points_over_log,
    poses_over_log,
    positions_over_log,
    screws_to_chain,
    tip_pose,
    tip_position,
)
from urmpipe_models.math3d import (
    Transform,
    euler_zyx,
    from_offset,
    from_rpy,
    rotation_x,
    rotation_z,
    translation,
)
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import write_urdf

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


LENGTHS = (0.243215, 0.21243, 0.21243, 0.21243, 0.21243, 0.21243, 0.042215)
TILT = math.radians(52.0)
ALTERNATING = (0.0, math.pi, 0.0, math.pi, 0.0, math.pi)

AGREES = 1e-12
"""Against other programs, in m and for the entries of R: rounding of some hundred operations on an arm of
1 to 2 m reaches about 1e-15; files that carry 16 digits add as much."""


def random_poses(chain: Chain, count: int = 1000, reach: float = math.pi) -> FloatArray:
    return np.random.default_rng(7).uniform(-reach, reach, (count, len(chain.coordinates)))


def matrix(rotation: Any) -> FloatArray:
    return np.array(rotation, dtype=float)


def test_the_calibration_pose_is_the_papers() -> None:
    p7 = forward(load_robot("urm6"), ALTERNATING)[-1].translation
    np.testing.assert_allclose(p7, [0.167397124, 0.0, 1.102644902], atol=1e-9)  # printed to 1e-9
    assert load_robot("urm6").start == ALTERNATING


def test_the_pose_at_zero_and_the_stretched_arm_are_the_papers() -> None:
    at_zero = forward(load_robot("urm6"), (0.0,) * 6)[-1].translation
    np.testing.assert_allclose(at_zero, [0.119616, 0.0, -0.067661], atol=5e-7)  # printed to 1e-6
    stretched = urm_chain("straight", LENGTHS, (0.0,) * 6)
    np.testing.assert_allclose(
        forward(stretched, ALTERNATING)[-1].translation, [0.0, 0.0, 1.34758], atol=1e-9
    )


def test_every_point_of_a_urm_arm_is_equation_7() -> None:
    """p_{i+1} = Rz1 [r1 + sum_k prod_j (Ry_{j+1} Rz_{j+1}) r_{k+1}], r_k along z."""
    chain = load_robot("urm8")
    lengths = [0.243215, *[0.21243] * 7, 0.042215]
    phi = [*random_poses(chain, 1)[0], 0.0]  # no Rz9
    rotation = matrix(from_rpy(0.0, 0.0, phi[0]).rotation)
    p = rotation @ [0.0, 0.0, lengths[0]]
    for k, point in enumerate(forward(chain, phi[:-1])):
        np.testing.assert_allclose(point.translation, p, atol=AGREES)
        if k < 8:
            turned = from_rpy(0.0, TILT, 0.0) @ from_rpy(0.0, 0.0, phi[k + 1])
            rotation = rotation @ matrix(turned.rotation)
            p = p + rotation @ [0.0, 0.0, lengths[k + 1]]


class Peer:
    """A chain as Pinocchio's model, its frames named by the points p1..pn."""

    def __init__(self, model: Any, frames: Sequence[int]) -> None:
        self.pin = pytest.importorskip("pinocchio")
        self.model, self.frames = model, frames
        self.data = model.createData()

    def configuration(self, q: FloatArray) -> FloatArray:
        """Return q as Pinocchio counts it: a continuous joint is a cosine and a sine."""
        parts = [
            [math.cos(value), math.sin(value)] if joint.nq == 2 else [value]
            for joint, value in zip(list(self.model.joints)[1:], q, strict=True)
        ]
        return np.array([value for part in parts for value in part])

    def poses(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and rotations of the frames, shape (frames, ...)."""
        self.pin.framesForwardKinematics(self.model, self.data, self.configuration(q))
        placed = [self.data.oMf[frame] for frame in self.frames]
        return np.array([one.translation for one in placed]), np.array([one.rotation for one in placed])


def peer_of_chain(chain: Chain) -> Peer:
    """Build a chain in Pinocchio joint by joint (no mimics)."""
    pin = pytest.importorskip("pinocchio")
    kinds = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}

    def placed(frame: Transform) -> Any:
        return pin.SE3(matrix(frame.rotation), np.array(frame.translation, dtype=float))

    model, frames = pin.Model(), []
    parent, here = 0, placed(chain.base)
    for k, joint in enumerate(chain.joints):
        at_joint = here * placed(joint.origin)
        if k > 0:
            end = pin.SE3(here.rotation, at_joint.translation)
            frames.append(model.addFrame(pin.Frame(f"p{k}", parent, end, pin.FrameType.OP_FRAME)))
        if joint.kind == "fixed":
            here = at_joint
        else:
            axis = np.array(joint.axis)
            parent, here = (
                model.addJoint(parent, kinds[joint.kind](axis), at_joint, joint.name),
                pin.SE3.Identity(),
            )
    tip = here * placed(chain.tip) * placed(chain.tool)
    frames.append(model.addFrame(pin.Frame("tip", parent, tip, pin.FrameType.OP_FRAME)))
    return Peer(model, frames)


def peer_of_urdf(path: Path, links: Sequence[str]) -> Peer:
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(path))
    return Peer(model, [model.getFrameId(link) for link in links])


def assert_agrees_with_peer(chain: Chain, peer: Peer, q: FloatArray, padding: int = 0) -> None:
    """Compare the tool centre point, the peer's last frame, on every row of q."""
    position, rotation = poses_over_log(chain, q)
    for k, row in enumerate(q):
        p, R = peer.poses(np.append(row, np.zeros(padding)))
        np.testing.assert_allclose(position[k], p[-1], rtol=0.0, atol=AGREES)
        np.testing.assert_allclose(rotation[k], R[-1], rtol=0.0, atol=AGREES)


def test_urm6_is_pinocchios_built_by_hand() -> None:
    pin = pytest.importorskip("pinocchio")
    model, parent = pin.Model(), 0
    tilt = pin.rpy.rpyToMatrix(0.0, TILT, 0.0)
    for k in range(6):
        frame = pin.SE3(tilt, np.array([0.0, 0.0, LENGTHS[k - 1]])) if k else pin.SE3.Identity()
        parent = model.addJoint(parent, pin.JointModelRZ(), frame, f"phi{k + 1}")
    effector = pin.SE3(tilt, np.array([0.0, 0.0, LENGTHS[5]])) * pin.SE3(
        np.eye(3), np.array([0.0, 0.0, LENGTHS[6]])
    )
    frame = model.addFrame(pin.Frame("p7", parent, effector, pin.FrameType.OP_FRAME))
    chain = load_robot("urm6")
    assert_agrees_with_peer(chain, Peer(model, [frame]), random_poses(chain))


def test_every_point_of_urm6_is_pinocchios_of_the_exported_urdf(tmp_path: Path) -> None:
    chain = load_robot("urm6").placed(from_offset([0.1, -0.2, 0.3, 0.4, 0.5, 0.6]), from_offset([0, 0, 0.15]))
    write_urdf(chain, tmp_path / "urm6.urdf")
    peer = peer_of_urdf(tmp_path / "urm6.urdf", [*(f"link{k}" for k in range(2, 8)), "tool0"])
    q = random_poses(chain)
    skeleton = points_over_log(chain, q)
    for k, row in enumerate(q):
        np.testing.assert_allclose(skeleton[k, 1:], peer.poses(row)[0], rtol=0.0, atol=AGREES)
    assert_agrees_with_peer(chain, peer, q)


def test_ur5e_is_pinocchios_of_its_dh_parameters() -> None:
    pin = pytest.importorskip("pinocchio")
    half = math.pi / 2
    rows = [
        (0.1625, 0.0, half), (0.0, -0.425, 0.0), (0.0, -0.3922, 0.0),
        (0.1333, 0.0, half), (0.0997, 0.0, -half), (0.0996, 0.0, 0.0),
    ]  # fmt: skip
    model, parent, link = pin.Model(), 0, pin.SE3.Identity()
    for k, (d, a, alpha) in enumerate(rows):
        parent = model.addJoint(parent, pin.JointModelRZ(), link, f"q{k}")
        link = pin.SE3(pin.rpy.rpyToMatrix(alpha, 0.0, 0.0), np.array([a, 0.0, d]))
    frame = model.addFrame(pin.Frame("flange", parent, link, pin.FrameType.OP_FRAME))
    chain = load_robot("ur5e")
    assert_agrees_with_peer(chain, Peer(model, [frame]), random_poses(chain))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "tip", "others"),
    [
        ("Gepetto_example-robot-data/panda.urdf", "panda_hand_tcp", 2),  # two fingers beside the chain
        ("FancySafeBot_fsb-library/panda.urdf", "panda_hand", 2),
        ("ros-industrial_kuka_experimental/lbr_iiwa_14_r820.urdf", "tool0", 0),
    ],
)
def test_urdfs_of_others_are_pinocchios(shared: Path, file: str, tip: str, others: int) -> None:
    path = shared / "robots" / file
    chain = read_urdf(path, tip_link=tip)
    assert_agrees_with_peer(chain, peer_of_urdf(path, [tip]), random_poses(chain), padding=others)


@settings(deadline=None, max_examples=25)
@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
def test_motion_and_jacobian_of_every_point_are_pinocchios(
    chains: SearchStrategy[Chain], data: st.DataObject, seed: int
) -> None:
    pin = pytest.importorskip("pinocchio")
    chain = data.draw(chains.filter(lambda one: not any(joint.mimic for joint in one.joints)))
    peer = peer_of_chain(chain)
    q, qd, qdd = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, len(chain.coordinates)))
    model, peers, aligned = peer.model, peer.data, pin.LOCAL_WORLD_ALIGNED
    pin.forwardKinematics(model, peers, q, qd, qdd)
    pin.updateFramePlacements(model, peers)
    pin.computeJointJacobians(model, peers, q)
    for k, (frame, motion) in enumerate(zip(peer.frames, point_motions(chain, q, qd, qdd), strict=True)):
        velocity = pin.getFrameVelocity(model, peers, frame, aligned).vector
        acceleration = pin.getFrameClassicalAcceleration(model, peers, frame, aligned).vector
        J = pin.getFrameJacobian(model, peers, frame, aligned).reshape(6, -1)
        assert_close(motion.pose.translation, peers.oMf[frame].translation)
        assert_close(motion.pose.rotation, peers.oMf[frame].rotation)
        assert_close([*motion.velocity, *motion.omega], velocity)
        assert_close([*motion.acceleration, *motion.alpha], acceleration)
        assert_close(np.array(jacobian(chain, q, k), dtype=float).T, J)


def assert_close(got: Any, expected: Any) -> None:
    """Hold values of some tens: levers of up to 10 m, times speeds of up to 7 and their squares."""
    np.testing.assert_allclose(np.array(got, dtype=float), expected, rtol=AGREES, atol=30 * AGREES)


def test_the_poses_that_pybotics_kept_of_a_ur10(shared: Path) -> None:
    half = math.pi / 2
    rows = [  # modified DH of pybotics' UR10: alpha, a, theta, d
        (0.0, 0.0, 0.0, 0.118), (half, 0.0, math.pi, 0.0), (0.0, 0.6127, 0.0, 0.0),
        (0.0, 0.5716, 0.0, 0.1639), (-half, 0.0, 0.0, 0.1157), (half, 0.0, math.pi, 0.0922),
    ]  # fmt: skip
    chain = modified_dh_chain("ur10", [DHRow(theta, d, a, alpha) for alpha, a, theta, d in rows])
    path = shared / "logs" / "pybotics-ur10-fk" / "ur10-joints-poses.csv"
    with path.open(encoding="utf-8") as file:
        lines = [row for row in csv.reader(file) if not row[0].startswith("#")]
    values = np.array(lines, dtype=float)
    poses = values[:, 6:].reshape(-1, 4, 4)
    assert len(poses) == 20
    position, rotation = poses_over_log(chain, np.radians(values[:, :6]))
    np.testing.assert_allclose(position, poses[:, :3, 3] / 1000.0, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(rotation, poses[:, :3, :3], rtol=0.0, atol=AGREES)


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
def test_motions_are_the_differences_of_poses_and_of_each_other(
    chains: SearchStrategy[Chain], data: st.DataObject, seed: int
) -> None:
    chain = data.draw(chains)
    q, qd, qdd = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, len(chain.coordinates)))

    def at(t: float) -> tuple[FloatArray, ...]:
        """Return position, rotation, velocity and omega of every point at a time."""
        values = q + qd * t + 0.5 * qdd * t * t
        moved, poses = point_motions(chain, values, qd + qdd * t, qdd), forward(chain, values)
        parts = ([one.translation for one in poses], [one.rotation for one in poses])
        rates = ([one.velocity for one in moved], [one.omega for one in moved])
        return tuple(np.array(one, dtype=float) for one in (*parts, *rates))

    here = point_motions(chain, q, qd, qdd)
    spins = [np.cross(matrix(one.omega), matrix(one.pose.rotation), axisb=0, axisc=0) for one in here]
    # levers of up to 10 m, each derivative times speeds of up to 7
    assert_slope(lambda t: at(t)[0], [one.velocity for one in here], third=1e4, size=10.0)
    assert_slope(lambda t: at(t)[1], spins, third=1e3)
    assert_slope(lambda t: at(t)[2], [one.acceleration for one in here], third=1e5, size=100.0)
    assert_slope(lambda t: at(t)[3], [one.alpha for one in here], third=1e4, size=10.0)
    for k, motion in enumerate(here):  # the very velocity that the recursion finds
        J = np.array(jacobian(chain, q, k), dtype=float).T
        assert_close([*motion.velocity, *motion.omega], J @ qd)


def test_a_mimic_moves_with_its_leader_and_has_no_coordinate() -> None:
    chain = Chain(
        "parallel gripper",
        (
            Joint("turn"),
            Joint("slide", "prismatic", translation(0.1, 0.0, 0.0), (1.0, 0.0, 0.0)),
            Joint("back", "prismatic", Transform(), (1.0, 0.0, 0.0), mimic=Mimic("slide", -2.0, 0.5)),
        ),
    )
    assert chain.coordinates == ("turn", "slide")
    assert joint_values(chain, [0.3, 0.2]) == [0.3, 0.2, pytest.approx(0.1)]
    tip = forward(chain, [0.0, 0.2])[-1].translation
    np.testing.assert_allclose(tip, [0.1 + 0.2 + 0.1, 0.0, 0.0], atol=1e-15)  # rounding
    J = np.array(jacobian(chain, [0.0, 0.2]), dtype=float)
    np.testing.assert_allclose(J[1], [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    (motion,) = point_motions(chain, [0.0, 0.2], [0.0, 1.0], [0.0, 0.0])[-1:]
    np.testing.assert_allclose(motion.velocity, [-1.0, 0.0, 0.0])
    for qd, qdd in (([0.0], [0.0, 0.0]), ([0.0, 0.0], [0.0]), ([0.0] * 3, [0.0, 0.0])):
        with pytest.raises(ValueError, match=r"zip\(\) argument 2 is (shorter|longer) than argument 1"):
            point_motions(chain, [0.0, 0.2], qd, qdd)


@pytest.mark.parametrize("count", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5])
def test_a_log_is_its_rows_in_blocks(count: int) -> None:
    chain = load_robot("urm6")
    q, qd, qdd = np.random.default_rng(3).uniform(-4.0, 4.0, (3, count, 6))
    position, rotation = poses_over_log(chain, q)
    point = point_over_log(chain, q, qd, qdd, 3)
    skeleton = points_over_log(chain, q)
    J = jacobian_over_log(chain, q, 3)
    assert position.shape == (count, 3)
    assert rotation.shape == (count, 3, 3)
    assert skeleton.shape == (count, 8, 3)
    assert J.shape == (count, 6, 6)
    for k in {0, count // 2, BLOCK - 1, BLOCK, count - 1} & set(range(count)):
        poses, motion = forward(chain, q[k].tolist()), point_motions(chain, q[k], qd[k], qdd[k])[3]
        tip = tip_pose(chain, q[k].tolist())
        np.testing.assert_array_equal(position[k], tip.translation)
        np.testing.assert_array_equal(rotation[k], tip.rotation)
        same(skeleton[k], [(0.0, 0.0, 0.0), *(pose.translation for pose in poses)])
        same(point.position[k], motion.pose.translation)
        same(point.velocity[k], motion.velocity)
        same(point.acceleration[k], motion.acceleration)
        *angles, singular = euler_zyx(motion.pose.rotation)
        same(point.euler_zyx[k], angles)
        assert point.singular[k] == singular
        same(J[k].T, jacobian(chain, q[k], 3))
    np.testing.assert_array_equal(positions_over_log(chain, q), position)


def same(got: Any, expected: Any) -> None:
    """The same lines; a float's whole quarter turns are exact, a column's not: 1e-16, times speeds of 4^2."""
    np.testing.assert_allclose(got, np.array(expected, dtype=float), rtol=1e-13, atol=1e-13)


def test_blocks_side_by_side_give_the_very_bits_of_one_after_the_other() -> None:
    chain = load_robot("ur5e")
    q, qd, qdd = np.random.default_rng(5).uniform(-4.0, 4.0, (3, 2 * BLOCK + 100, 6))
    side_by_side = point_over_log(chain, q, qd, qdd)
    for rows in row_blocks(len(q)):
        alone = point_over_log(chain, q[rows], qd[rows], qdd[rows])
        for name in ("position", "velocity", "acceleration", "euler_zyx", "singular"):
            np.testing.assert_array_equal(getattr(side_by_side, name)[rows], getattr(alone, name))


def test_missing_samples_are_missing_and_touch_no_other_row() -> None:
    chain = load_robot("urm6")
    q = random_poses(chain, 4)
    clean = positions_over_log(chain, q)
    q[2, 1] = np.nan
    got = positions_over_log(chain, q)
    assert np.isnan(got[2]).all()
    np.testing.assert_array_equal(got[[0, 1, 3]], clean[[0, 1, 3]])


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(-20, 20), min_size=6, max_size=6), st.integers(0, 2**32 - 1))
def test_whole_turns_change_nothing(turns: list[int], seed: int) -> None:
    q = np.random.default_rng(seed).uniform(-math.pi, math.pi, (1, 6))
    chain = load_robot("urm6")
    for a, b in zip(
        poses_over_log(chain, q), poses_over_log(chain, q + 2 * math.pi * np.array(turns)), strict=True
    ):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_tip_pose_is_the_last_of_forward(chains: SearchStrategy[Chain], data: st.DataObject) -> None:
    chain = data.draw(chains)
    q = np.linspace(-1.0, 1.0, len(chain.coordinates)).tolist()
    tip, last = tip_pose(chain, q), forward(chain, q)[-1]
    # from the tool to the base instead of from the base to the tool: rounding of some 30 m, 20 joints
    np.testing.assert_allclose(tip.translation, last.translation, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(matrix(tip.rotation), matrix(last.rotation), rtol=0.0, atol=1e-14)
    assert tip_position(chain, q) == tip.translation


def test_positions_are_those_of_poses_far_from_the_world_and_with_a_tool() -> None:
    chain = load_robot("panda").placed(
        from_offset([1, 2, 3, 0.4, 0.5, 0.6]), from_offset([0.1, 0, 0.2, 1, 2, 3])
    )
    q = random_poses(chain)
    np.testing.assert_array_equal(positions_over_log(chain, q), poses_over_log(chain, q)[0])


SLIDING_ARM = Chain(
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

IDENTITY = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def test_screws_stand_in_the_world_base_and_tool_included() -> None:
    found = there(chain_to_screws(SLIDING_ARM))
    # The base turns x to y and y to -x; the slide's frame lies on its side, so that its -z is y before.
    np.testing.assert_array_equal(found.direction, [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(found.point, [[1.0, 0.0, 0.5], [1.0, 2.0, 0.5]])
    np.testing.assert_array_equal(found.revolute, [True, False])
    np.testing.assert_array_equal(found.rotation, [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(found.position, [1.0, 2.0, 3.5])
    assert found.size == 2.0 + 3.0  # from axis to axis, and to the tip
    for names in (("a",), ("a", "b", "c")):  # each screw has a name
        with pytest.raises(ValueError, match="zip"):
            screws_to_chain(found, names)


def test_a_joint_that_follows_another_is_no_screw() -> None:
    assert chain_to_screws(Chain("arm", (Joint("a"), Joint("b", mimic=Mimic("a"))))) is None


def test_screws_are_floats_whatever_numbers_describe_the_arm() -> None:
    whole = Chain("arm", (Joint("a", origin=translation(1, 2, 3), axis=(0, 0, 1)),), base=Transform(IDENTITY))
    found = there(chain_to_screws(whole))
    for one in (found.direction, found.point, found.rotation, found.position):
        assert one.dtype == np.float64


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


LED_BY_NONE = [name for name in robot_names() if chain_to_screws(load_robot(name))]  # no mimics


def product_of_exponentials(arm: Screws, q: FloatArray) -> FloatArray:
    """Return T(q) = exp(xi_1 q_1) ... exp(xi_n q_n) T(0), shape (4, 4), by SciPy's matrix exponential."""
    pose, zero = np.eye(4), np.eye(4)
    zero[:3, :3], zero[:3, 3] = arm.rotation, arm.position
    for (x, y, z), point, revolute, value in zip(arm.direction, arm.point, arm.revolute, q, strict=True):
        twist = np.zeros((4, 4))
        if revolute:
            twist[:3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        twist[:3, 3] = np.cross(point, (x, y, z)) if revolute else (x, y, z)
        pose = pose @ expm(twist * value)
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


def test_the_size_is_the_way_from_axis_to_axis_to_the_tip_and_never_0() -> None:
    joints = (Joint("a"), Joint("b", origin=translation(0.3, 0.0, 0.4)))
    assert there(chain_to_screws(Chain("l", joints, translation(0, 2, 0)))).size == 2.5
    assert there(chain_to_screws(Chain("point", (Joint("a"),)))).size == 1.0
