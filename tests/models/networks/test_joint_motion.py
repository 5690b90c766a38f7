"""What joints do: poses against matrix exponentials, twists against differences, what they forbid."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from random_networks import (
    KINDS,
    Poses,
    difference,
    generator,
    joint_between,
    log_of,
    matrix,
    motion,
    one_by_one,
    random_network,
    random_pose,
    random_values,
    transform,
)
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.joint_motion import constraint_twists, joint_frame, joint_twists
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.parts import JOINT_UNITS, Body, Control, Expression, Joint, JointKind

ROUNDING = 1e-13
"""Products of some ten matrices with entries near 1, and scipy's expm."""


def joint_of(kind: JointKind, rng: np.random.Generator) -> Joint:
    return joint_between("J", kind, ("ground", "b"), {"ground": np.eye(4), "b": random_pose(rng)}, rng)


def twists_of(joint: Joint, q: FloatArray, at: FloatArray) -> FloatArray:
    """Return what `joint_twists` returns, shape (6, k)."""
    return np.array([(*w, *v) for w, v in joint_twists(joint, list(q), transform(at))]).T


def moved_from(at: FloatArray, joint: Joint, q: FloatArray) -> FloatArray:
    return at @ moved(joint, q)


def moved(joint: Joint, q: FloatArray) -> FloatArray:
    return motion(joint.kind, q, joint.pitch)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(5))
def test_joints_move_as_matrix_exponentials_of_their_twists(kind: JointKind, seed: int) -> None:
    rng = np.random.default_rng(seed)
    joint, q = joint_of(kind, rng), np.array(random_values(kind, rng))
    np.testing.assert_allclose(matrix(joint_frame(joint, list(q))), moved(joint, q), rtol=0.0, atol=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_twists_are_derivatives_of_matrix_exponentials(kind: JointKind) -> None:
    rng = np.random.default_rng(8)
    for _ in range(10):
        joint, q, at = joint_of(kind, rng), np.array(random_values(kind, rng)), random_pose(rng)
        rates = difference(one_by_one(partial(moved_from, at, joint)), q, 1e-2)
        inverse = np.linalg.inv(at @ moved(joint, q))
        found = twists_of(joint, q, at)
        for k in range(len(q)):
            expected = rates[:, :, k] @ inverse
            # differences of step 1e-2: 1e-12 / 140 of truncation, 1e-14 of rounding
            np.testing.assert_allclose(generator(found[:3, k], found[3:, k]), expected, rtol=0.0, atol=3e-12)


def turning_about(axis: int, angle: str) -> list[list[str]]:
    """Return the entries of a rotation about x, y or z as formulas."""
    rows = [["0"] * 3 for _ in range(3)]
    rows[axis][axis] = "1"
    j, k = (axis + 1) % 3, (axis + 2) % 3
    rows[j][j] = rows[k][k] = f"cos({angle})"
    rows[j][k], rows[k][j] = f"-sin({angle})", f"sin({angle})"
    return rows


def user_motion() -> tuple[Expression, ...]:
    """Return R = Rz(s t) Rx(t), a = (s, t^2, sin(s t)) as a user joint's nine formulas of s and t."""
    left, right = turning_about(2, "s * t"), turning_about(0, "t")
    R = [
        [" + ".join(f"({left[i][k]}) * ({right[k][j]})" for k in range(3)) for j in range(3)]
        for i in range(3)
    ]
    return tuple(
        map(
            Expression,
            [*(R[i][0] for i in range(3)), *(R[i][1] for i in range(3)), "s", "t ** 2", "sin(s * t)"],
        )
    )


@pytest.mark.slow
def test_a_user_joint_moves_as_its_formulas_say() -> None:
    """Its pose, and its derivatives by both controls, against the rotations typed in as exponentials."""
    joint = Joint("U", "user", ("ground", "b"), motion=user_motion())
    arm = build_mechanism(Network("user", (Body("b"),), (joint,), controls=(Control("s"), Control("t"))))

    def expected(x: FloatArray) -> FloatArray:
        s, t = x
        pose = motion("global", (0.0, 0.0, s * t)) @ motion("global", (t, 0.0, 0.0))
        pose[:3, 3] = s, t**2, np.sin(s * t)
        return pose

    for x in np.random.default_rng(1).uniform(-1.5, 1.5, (20, 2)):
        np.testing.assert_allclose(matrix(arm.poses(list(x))["b"]), expected(x), rtol=0.0, atol=ROUNDING)
        values = arm.joint_values(joint, x)
        screws = twists_of(joint, np.array([float(one.value) for one in values]), np.eye(4))
        rates = difference(one_by_one(expected), x, 1e-2)
        for k in range(2):
            twist = screws @ np.array([float(one.gradient.get(k, 0.0)) for one in values])
            # truncation of step 1e-2 with seventh derivatives up to 1.5^7 = 17
            np.testing.assert_allclose(
                generator(twist[:3], twist[3:]),
                rates[:, :, k] @ np.linalg.inv(expected(x)),
                rtol=0.0,
                atol=1e-11,
            )


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_joint_allows_and_forbids_is_all_that_there_is(kind: JointKind) -> None:
    """Its twists and those it forbids are six in number and independent; all are distinct by name."""
    rng = np.random.default_rng(4)
    for _ in range(10):
        joint, q, at = joint_of(kind, rng), np.array(random_values(kind, rng)), random_pose(rng)
        names, _, refused = zip(*constraint_twists(joint, list(q), transform(at)), strict=True)
        assert len(set(names)) == len(names)
        every = np.column_stack([twists_of(joint, q, at), *(np.array((*w, *v)) for w, v in refused)])
        assert every.shape == (6, 6)
        # points and axes near 1: of a joint that allowed what it forbids the least would be 1e-16
        assert np.linalg.svd(every, compute_uv=False)[-1] > 1e-2
        assert len(q) == len(JOINT_UNITS[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_a_driven_joint_forbids_what_it_is_driven_by(kind: JointKind) -> None:
    rng = np.random.default_rng(5)
    free = joint_of(kind, rng)
    joint = Joint(
        "J",
        kind,
        free.bodies,
        free.frames,
        values=(Expression("s"),) * len(JOINT_UNITS[kind]),
        pitch=free.pitch,
    )
    at, q = random_pose(rng), np.array(random_values(kind, rng))
    found = list(constraint_twists(joint, list(q), transform(at)))
    drives = np.array([(*w, *v) for name, _, (w, v) in found if name == "drive"]).T
    assert [unit for name, unit, _ in found if name == "drive"] == list(JOINT_UNITS[kind])
    np.testing.assert_array_equal(drives, twists_of(free, q, at))
    assert len(found) == 6


# --- poses of whole networks, by matrices alone


def joints_of(network: Network) -> dict[str, FloatArray]:
    """Return R = A_1 T A_2^-1 of each joint at its start."""
    return {
        one.name: matrix(one.frames[0])
        @ motion(one.kind, one.start, one.pitch)
        @ np.linalg.inv(matrix(one.frames[1]))
        for one in network.joints
    }


def poses_by_matrices(network: Network, names: set[str]) -> Poses:
    """Return the pose of each body along some joints, visited until nothing new is found."""
    moved = joints_of(network)
    poses: Poses = {network.ground: np.eye(4)}
    while len(poses) < len(network.body_names):
        for one in network.joints:
            a, b = one.bodies
            if one.name in names and a in poses and b not in poses:
                poses[b] = poses[a] @ moved[one.name]
            if one.name in names and b in poses and a not in poses:
                poses[a] = poses[b] @ np.linalg.inv(moved[one.name])
    return poses


def apart(network: Network, rng: np.random.Generator) -> Network:
    """Return a network with other starts: its loops are open."""
    joints = tuple(
        Joint(one.name, one.kind, one.bodies, one.frames, random_values(one.kind, rng), pitch=one.pitch)
        for one in network.joints
    )
    return Network(network.name, network.bodies, joints, network.elements)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_poses_and_gaps_of_random_networks_are_those_of_matrices(seed: int) -> None:
    """Trees in either direction, loops cut at any joint, closed at the start and open elsewhere."""
    rng = np.random.default_rng(seed)
    closed = random_network(rng, bodies=5, extra=3)
    mechanism = build_mechanism(closed)
    assert np.abs(evaluate_closure(mechanism, mechanism.start[:, np.newaxis]).residual).max() < ROUNDING
    network = apart(closed, rng)
    mechanism = build_mechanism(network)
    tree = {network.joints[one.joint].name for one in mechanism.graph.branches}
    expected = poses_by_matrices(network, tree)
    found = mechanism.poses(mechanism.start.tolist())
    for name, pose in expected.items():
        np.testing.assert_allclose(matrix(found[name]), pose, rtol=0.0, atol=ROUNDING)
    residual = evaluate_closure(mechanism, mechanism.start[:, np.newaxis]).residual[:, 0]
    for k, cut in enumerate(mechanism.graph.cuts):
        joint = network.joints[cut]
        a, b = joint.bodies
        E = np.linalg.inv(expected[a] @ joints_of(network)[joint.name] @ matrix(joint.frames[1])) @ (
            expected[b] @ matrix(joint.frames[1])
        )
        gap = residual[6 * k : 6 * k + 6]
        np.testing.assert_allclose(gap[:3], E[:3, 3], rtol=0.0, atol=ROUNDING)
        # a logarithm near pi is good to the root of rounding
        np.testing.assert_allclose(gap[3:], log_of(E), rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(motion("global", gap[3:])[:3, :3], E[:3, :3], rtol=0.0, atol=ROUNDING)
