"""Forward kinematics against printed numbers, differences, logs, and the product of exponentials."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm

from asserting import there
from differences import assert_slope
from urmpipe_models import math3d
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.arm.denavit_hartenberg import DHRow, modified_dh_chain, urm_chain
from urmpipe_models.elementwise import BLOCK, FloatArray, row_blocks
from urmpipe_models.kinematics import forward as fk
from urmpipe_models.kinematics.forward import Screws, chain_to_screws, forward, point_motions, poses_over_log
from urmpipe_models.math3d import Transform, from_offset, rotation_x, rotation_y, rotation_z, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names

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
SCREWS = there(chain_to_screws(SLIDING_ARM))
ALTERNATING = (0.0, math.pi, 0.0, math.pi, 0.0, math.pi)
# In m and for the entries of R: rounding of some hundred operations on 1 to 2 m is about 1e-15
AGREES = 1e-12


def test_frames_are_the_base_and_what_each_joint_moves() -> None:
    """A fixed joint has the value 0, and a mimic follows its line."""
    assert fk.joint_values(ARM, [0.5, 0.75]) == [0.0, 0.5, -2.0 * 0.5 + 0.25, 0.75, 0.0]
    frames = list(fk.iter_frames(ARM, [0.5, 0.0]))
    x_z = [(1.0, 3.0), (1.0, 3.5), (1.0, 3.0), (0.25, 3.0), (0.25, 3.0), (0.25, 3.125)]
    assert frames[0] == ARM.base
    assert [frame.translation for frame in frames] == [(x, 2.0, z) for x, z in x_z]
    assert all(frame.rotation == Transform().rotation for frame in frames)
    *_, turned, flange = fk.iter_frames(ARM, [0.5, math.pi / 2])
    assert turned.translation == (0.25, 2.0, 3.0)
    # a joint's value is no constant: cos(pi / 2) is 6e-17, as in a column
    assert_allclose(turned.rotation, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], rtol=0.0, atol=1e-16)
    assert_allclose(flange.translation, (0.375, 2.0, 3.0), rtol=1e-16)  # its z is x of the world


def test_a_mimic_moves_with_its_leader_and_has_no_coordinate() -> None:
    chain = replace(ARM, joints=ARM.joints[1:3], start=())
    assert chain.coordinates == ("lift",)
    assert_allclose(fk.jacobian(chain, [0.2]), [[-2.0, 0.0, -1.0, 0.0, 0.0, 0.0]])
    assert_allclose(point_motions(chain, [0.2], [1.5], [0.0])[-1].velocity, [-3.0, 0.0, -1.5])


@pytest.mark.parametrize(
    "call",
    [
        *(partial(fk.joint_values, ARM, [0.5] * count) for count in (0, 1, 3)),
        *(partial(fk.forward, ARM, [0.5] * count) for count in (0, 1, 3)),
        *(partial(point_motions, ARM, [0.5] * 2, [0.0] * k, [0.0] * n) for k, n in ((1, 2), (2, 1), (3, 2))),
        *(partial(fk.screws_to_chain, SCREWS, names) for names in (("a",), ("a", "b", "c"))),
    ],
)
def test_there_is_a_value_for_each_coordinate_and_a_name_for_each_screw(call: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match=r"zip\(\) argument \d is (shorter|longer) than argument"):
        call()


def test_poses_of_urm6_are_the_papers() -> None:
    urm6 = load_robot("urm6")
    assert urm6.start == ALTERNATING
    p7 = forward(urm6, ALTERNATING)[-1].translation
    assert_allclose(p7, [0.167397124, 0.0, 1.102644902], atol=1e-9)  # printed to 1e-9
    at_zero = forward(urm6, (0.0,) * 6)[-1].translation
    assert_allclose(at_zero, [0.119616, 0.0, -0.067661], atol=5e-7)  # printed to 1e-6
    straight = urm_chain("straight", (0.243215, *[0.21243] * 5, 0.042215), (0.0,) * 6)
    assert_allclose(forward(straight, ALTERNATING)[-1].translation, [0.0, 0.0, 1.34758], atol=1e-9)


def test_every_point_of_a_urm_arm_is_equation_7() -> None:
    """p_{i+1} = Rz1 [r1 + sum_k prod_j (Ry_{j+1} Rz_{j+1}) r_{k+1}], r_k along z."""
    chain, lengths = load_robot("urm8"), (0.243215, *[0.21243] * 7, 0.042215)
    phi = np.random.default_rng(7).uniform(-math.pi, math.pi, 8).tolist()
    p, rotation, tilt = np.zeros(3), rotation_z(phi[0]), rotation_y(math.radians(52.0))
    for r, following, point in zip(lengths, [*phi[1:], 0.0, 0.0], forward(chain, phi), strict=True):  # no Rz9
        p = p + rotation.rotate((0.0, 0.0, r))
        assert_allclose(point.translation, p, atol=AGREES)
        rotation = rotation @ tilt @ rotation_z(following)


def test_the_poses_that_pybotics_kept_of_a_ur10(shared: Path) -> None:
    half = math.pi / 2
    rows = [  # modified DH of pybotics' UR10: alpha, a, theta, d
        (0.0, 0.0, 0.0, 0.118), (half, 0.0, math.pi, 0.0), (0.0, 0.6127, 0.0, 0.0),
        (0.0, 0.5716, 0.0, 0.1639), (-half, 0.0, 0.0, 0.1157), (half, 0.0, math.pi, 0.0922),
    ]  # fmt: skip
    chain = modified_dh_chain("ur10", [DHRow(theta, d, a, alpha) for alpha, a, theta, d in rows])
    path = shared / "logs" / "pybotics-ur10-fk" / "ur10-joints-poses.csv"
    with path.open(encoding="utf-8") as file:
        values = np.array([row for row in csv.reader(file) if not row[0].startswith("#")], dtype=float)
    poses = values[:, 6:].reshape(-1, 4, 4)
    assert len(poses) == 20
    position, rotation = poses_over_log(chain, np.radians(values[:, :6]))
    assert_allclose(position, poses[:, :3, 3] / 1000.0, rtol=0.0, atol=1e-9)
    assert_allclose(rotation, poses[:, :3, :3], rtol=0.0, atol=AGREES)


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
def test_motions_are_slopes_of_poses(chains: SearchStrategy[Chain], data: st.DataObject, seed: int) -> None:
    chain = data.draw(chains)
    q, qd, qdd = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, len(chain.coordinates)))

    def at(t: float) -> list[FloatArray]:
        """Return position, rotation, velocity and omega of every point at a time."""
        values = q + qd * t + 0.5 * qdd * t * t
        motions, poses = point_motions(chain, values, qd + qdd * t, qdd), forward(chain, values)
        parts = [[pose.translation for pose in poses], [pose.rotation for pose in poses]]
        rates = [[motion.velocity for motion in motions], [motion.omega for motion in motions]]
        return [np.array(values, dtype=float) for values in (*parts, *rates)]

    here = point_motions(chain, q, qd, qdd)
    rotations = [np.array(motion.pose.rotation, dtype=float) for motion in here]
    spins = [np.cross(motion.omega, R, axisb=0, axisc=0) for motion, R in zip(here, rotations, strict=True)]
    # levers of up to 10 m, each derivative times speeds of up to 7
    assert_slope(lambda t: at(t)[0], [motion.velocity for motion in here], third=1e4, size=10.0)
    assert_slope(lambda t: at(t)[1], spins, third=1e3)
    assert_slope(lambda t: at(t)[2], [motion.acceleration for motion in here], third=1e5, size=100.0)
    assert_slope(lambda t: at(t)[3], [motion.alpha for motion in here], third=1e4, size=10.0)
    for k, motion in enumerate(here):  # the very velocity that the recursion finds
        J = np.array(fk.jacobian(chain, q, k), dtype=float).T
        velocity = np.array([*motion.velocity, *motion.omega], dtype=float)
        # levers of up to 10 m, times speeds of up to 7
        assert_allclose(velocity, J @ qd, rtol=AGREES, atol=30 * AGREES)


@pytest.mark.parametrize("count", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5])
def test_a_log_is_its_rows_in_blocks(count: int) -> None:
    chain = load_robot("urm6")
    q, qd, qdd = np.random.default_rng(3).uniform(-4.0, 4.0, (3, count, 6))
    position, rotation = poses_over_log(chain, q)
    point, skeleton = fk.point_over_log(chain, q, qd, qdd, 3), fk.points_over_log(chain, q)
    J = fk.jacobian_over_log(chain, q, 3)
    shapes = [values.shape[1:] for values in (position, rotation, skeleton, J) if len(values) == count]
    assert shapes == [(3,), (3, 3), (8, 3), (6, 6)]
    for k in {0, count // 2, BLOCK - 1, BLOCK, count - 1} & set(range(count)):
        poses, motion = forward(chain, q[k].tolist()), point_motions(chain, q[k], qd[k], qdd[k])[3]
        tip = fk.tip_pose(chain, q[k].tolist())
        assert_array_equal(position[k], tip.translation)
        assert_array_equal(rotation[k], tip.rotation)
        assert_same(skeleton[k], [(0.0, 0.0, 0.0), *(pose.translation for pose in poses)])
        vectors = [motion.pose.translation, motion.velocity, motion.acceleration]
        assert_same([point.position[k], point.velocity[k], point.acceleration[k]], vectors)
        assert_same([*point.euler_zyx[k], point.singular[k]], math3d.euler_zyx(motion.pose.rotation))
        assert_same(J[k].T, fk.jacobian(chain, q[k], 3))
    assert_array_equal(fk.positions_over_log(chain, q), position)
    for rows in row_blocks(count):  # blocks in parallel give the very bits of one after the other
        block = fk.point_over_log(chain, q[rows], qd[rows], qdd[rows], 3)
        for name in ("position", "velocity", "acceleration", "euler_zyx", "singular"):
            assert_array_equal(getattr(point, name)[rows], getattr(block, name))


def assert_same(values: Any, expected: Any) -> None:
    """The same lines; a float's whole quarter turns are exact, a column's not: 1e-16, times speeds of 4^2."""
    assert_allclose(values, np.array(expected, dtype=float), rtol=1e-13, atol=1e-13)


def test_positions_are_those_of_poses_and_missing_samples_touch_no_other_row() -> None:
    tool = from_offset([0.1, 0, 0.2, 1, 2, 3])
    chain = load_robot("panda").placed(from_offset([1, 2, 3, 0.4, 0.5, 0.6]), tool)
    q = np.random.default_rng(7).uniform(-math.pi, math.pi, (1000, 7))
    complete = fk.positions_over_log(chain, q)
    assert_array_equal(complete, poses_over_log(chain, q)[0])
    q[2, 1] = np.nan
    complete[2] = np.nan
    assert_array_equal(fk.positions_over_log(chain, q), complete)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(-20, 20), min_size=6, max_size=6), st.integers(0, 2**32 - 1))
def test_whole_turns_change_nothing(turns: list[int], seed: int) -> None:
    q, chain = np.random.default_rng(seed).uniform(-math.pi, math.pi, (1, 6)), load_robot("urm6")
    turned = poses_over_log(chain, q + 2 * math.pi * np.array(turns))
    for here, there_ in zip(poses_over_log(chain, q), turned, strict=True):
        assert_allclose(here, there_, rtol=0.0, atol=1e-12)


def test_screws_are_those_of_the_world_base_and_tool_included() -> None:
    # The base turns x to y and y to -x; the slide's frame lies on its side, so that its -z is y before.
    assert_array_equal(SCREWS.direction, [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    assert_array_equal(SCREWS.point, [[1.0, 0.0, 0.5], [1.0, 2.0, 0.5]])
    assert_array_equal(SCREWS.revolute, [True, False])
    assert_array_equal(SCREWS.rotation, [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert_array_equal(SCREWS.position, [1.0, 2.0, 3.5])
    assert SCREWS.size == 2.0 + 3.0  # from axis to axis, and to the tip
    assert there(chain_to_screws(Chain("point", (Joint("a"),)))).size == 1.0  # never 0
    assert chain_to_screws(Chain("arm", (Joint("a"), Joint("b", mimic=Mimic("a"))))) is None
    joint, base = Joint("a", origin=translation(1, 2, 3), axis=(0, 0, 1)), ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    screws = there(chain_to_screws(Chain("of integers", (joint,), base=Transform(base))))
    columns = (screws.direction, screws.point, screws.rotation, screws.position)
    assert [values.dtype for values in columns] == [np.float64] * 4


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


def assert_product_of_exponentials(chain: Chain) -> None:
    """Compare it with forward kinematics, and with those of a chain of the same screws."""
    screws, names = there(chain_to_screws(chain)), tuple(f"n{k}" for k in range(len(chain.coordinates)))
    rebuilt = fk.screws_to_chain(screws, names)
    assert (rebuilt.name, rebuilt.coordinates) == ("screws", names)
    q = np.random.default_rng(8).uniform(-2.0, 2.0, (3, len(chain.coordinates)))
    for row, position, rotation in zip(q, *poses_over_log(chain, q), strict=True):
        pose, tip = product_of_exponentials(screws, row), fk.tip_pose(rebuilt, row)
        assert_allclose(pose[:3, 3], position, rtol=0.0, atol=AGREES)
        assert_allclose(pose[:3, :3], rotation, rtol=0.0, atol=AGREES)
        # ten frames and more with shifts of up to 1.7 m and slides of up to 2 m: some 30 m, rounded each time
        assert_allclose(np.array(tip.translation, dtype=float), position, rtol=0.0, atol=1e-13)
        assert_allclose(np.array(tip.rotation, dtype=float), rotation, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("robot", [name for name in robot_names() if chain_to_screws(load_robot(name))])
def test_the_product_of_exponentials_is_the_tip_of_robots_without_mimics(robot: str) -> None:
    base, tool = from_offset((0.1, -0.2, 0.3, 0.4, 0.5, 0.6)), from_offset((0.0, 0.1, 0.15))
    assert_product_of_exponentials(load_robot(robot).placed(base, tool))


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_tip_and_exponentials_of_any_chain(chains: SearchStrategy[Chain], data: st.DataObject) -> None:
    chain = data.draw(chains)
    q = np.linspace(-1.0, 1.0, len(chain.coordinates)).tolist()
    tip, last = fk.tip_pose(chain, q), forward(chain, q)[-1]
    # from the tool to the base instead of from the base to the tool: rounding of some 30 m, 20 joints
    assert_allclose(tip.translation, last.translation, rtol=0.0, atol=1e-13)
    assert_allclose(np.array(tip.rotation, float), np.array(last.rotation, float), rtol=0.0, atol=1e-14)
    assert fk.tip_position(chain, q) == tip.translation
    joints = tuple(replace(joint, mimic=None) for joint in chain.joints)
    assert_product_of_exponentials(replace(chain, joints=joints, start=()))
