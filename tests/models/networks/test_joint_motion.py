"""Rotation vectors and joints: matrix exponentials, differences, constraints, poses of networks."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import random_networks as rn
from known_mechanisms import tied
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks import joint_motion as jm
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.parts import JOINT_UNITS, Body, Control, Expression, Joint, JointKind

ROUNDING = 1e-13  # products of some ten matrices with entries near 1, and scipy's expm
ROTATION_ROUNDING = 1e-14  # entries of rotations are sums of a few products of rounded numbers up to pi^2

# --- rotation vectors

ANGLES = [
    0.0, 1e-300, 1e-160, 1e-12, *(factor * jm.SMALL_ANGLE_SQUARED**0.5 for factor in (0.99, 1.0, 1.01)),
    1e-3, 1.0, np.pi - 1e-9, np.pi, np.pi + 1e-9, 5.0, 2.0 * np.pi, 40.0,
]  # fmt: skip


def vectors(angle: float) -> FloatArray:
    """Return 20 rotation vectors of an angle, those along the axes among them, shape (3, 20)."""
    axes = np.random.default_rng(1).normal(size=(3, 20))
    axes[:, :3], axes[:, 3:6] = np.eye(3), -np.eye(3)
    return np.asarray(angle * axes / np.linalg.norm(axes, axis=0))


def rotations(q: FloatArray) -> FloatArray:
    """Return the rotations of rotation vectors, shape (n, 3, 3)."""
    rows = jm.exp3((q[0], q[1], q[2])).rotation
    return np.array(rows).transpose(2, 0, 1)


@pytest.mark.parametrize("angle", ANGLES)
def test_rotations_are_orthogonal_and_equal_the_matrix_exponential(angle: float) -> None:
    q = vectors(angle)
    found = rotations(q)
    size = max(1.0, angle)  # the rounding of the angle itself turns by eps |q|
    rn.assert_close(found @ found.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), ROTATION_ROUNDING)
    rn.assert_close(np.linalg.det(found), 1.0, ROTATION_ROUNDING)
    expected = np.array([expm(rn.generator(one, (0.0, 0.0, 0.0)))[:3, :3] for one in q.T])
    rn.assert_close(found, expected, 10 * ROTATION_ROUNDING * size)  # expm squares 6 times


def test_series_and_closed_form_meet_where_they_take_over() -> None:
    """Both neglect less than rounding: no step in the rotation, nor in what turns it, at the threshold."""
    axis = vectors(1.0)
    below, above = ((1.0 + sign * 1e-15) * jm.SMALL_ANGLE_SQUARED**0.5 * axis for sign in (-1, 1))
    for function in (jm.exp3, jm.left_jacobian):
        one, other = (
            np.array(getattr(found, "rotation", found))
            for found in (function((q[0], q[1], q[2])) for q in (below, above))
        )
        # the closed forms of 1 - cos and a - sin lose digits there, which count times |q| = 1e-4
        rn.assert_close(one, other, 1e-13)


def test_the_printed_matrix_is_no_rotation() -> None:
    """T(1,1) = u1 u3 v + cos(theta), as printed, has a determinant up to 1.025, that of the errata."""

    def rotation(q: FloatArray, column: int) -> FloatArray:
        theta = float(np.linalg.norm(q))
        full: FloatArray = np.array(jm.joint_frame(Joint("G", "global", ("a", "b")), q.tolist()).rotation)
        full[0, 0] = q[0] * q[column] / theta**2 * (1.0 - np.cos(theta)) + np.cos(theta)
        return full

    corrected, printed = (rotation(np.array([0.3, -0.5, 0.4]), column) for column in (0, 2))
    rn.assert_close(corrected, Rotation.from_rotvec([0.3, -0.5, 0.4]).as_matrix(), ROTATION_ROUNDING)
    assert abs(np.linalg.det(corrected) - 1.0) < ROTATION_ROUNDING
    assert abs(np.linalg.det(printed) - 1.0) > 0.01
    assert np.abs(printed @ printed.T - np.eye(3)).max() > 0.01
    vectors = np.random.default_rng(2).normal(size=(200, 3))
    assert max(abs(np.linalg.det(rotation(q, 2)) - 1.0) for q in vectors) > 0.025


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 0.99e-4, 1.01e-4, 1e-2, 1.0, 3.0, np.pi, 5.0, 6.0])
def test_the_left_jacobian_is_the_derivative_of_the_rotation_and_has_its_inverse(angle: float) -> None:
    q = vectors(angle)
    jacobians: FloatArray = np.array(jm.left_jacobian((q[0], q[1], q[2]))).transpose(2, 1, 0)
    for at, rotation, jacobian in zip(q.T, rotations(q), jacobians, strict=True):
        rates = rn.difference(lambda x: rotations(x).transpose(1, 2, 0), at, 1e-2)
        w = rates.transpose(2, 0, 1) @ rotation.T
        # differences of step 1e-2: truncation 1e-12 / 140, rounding 1e-14
        rn.assert_close(jacobian, np.array([w[:, 2, 1], w[:, 0, 2], w[:, 1, 0]]), 2e-12)
    back = jm.left_jacobian_inverse(q).transpose(2, 0, 1)
    # near 2 pi the inverse grows like 1 / (2 pi - angle), here 1 / 0.28
    rn.assert_close(back @ jacobians, np.tile(np.eye(3), (20, 1, 1)), 1e-12)


@pytest.mark.parametrize("angle", [*ANGLES, 3.0 * np.pi - 1e-6, 3.0 * np.pi + 1e-6, 100.0])
def test_wrapped_vectors_turn_the_same_by_half_a_turn_at_most(angle: float) -> None:
    q = vectors(angle)
    short = np.array(jm.wrap_rotation_vector(tuple(q)))
    assert (np.linalg.norm(short, axis=0) <= np.pi + 1e-14 * max(1.0, angle)).all()
    # 2 pi n is rounded to eps |q|
    rn.assert_close(rotations(short), rotations(q), 1e-13 * max(1.0, angle))


def build_arm(joints: list[Joint]) -> Mechanism:
    bodies = tuple(Body(f"b{k}") for k in range(1, len(joints) + 1))
    return build_mechanism(Network("arm", bodies, tuple(joints)))


@pytest.mark.parametrize("seed", range(20))
def test_a_global_joint_is_three_revolutes_whose_axes_meet(seed: int) -> None:
    """The second axis across both others they reach every rotation; twists span the same three."""
    rng = np.random.default_rng(seed)
    at, q = rn.random_pose(rng), rng.normal(size=3)
    turn, centre = at[:3, :3], at[:3, 3]
    ball = build_arm([Joint("G", "global", ("ground", "b1"), (rn.transform(at), rn.transform(at)))])
    for one in vectors(2.5).T:  # and its centre stays where it is
        rn.assert_close((rn.pose_of(ball, one, "b1") @ at)[:3, 3], centre, 1e-14)

    # R = R(n1, t1) R(n2, t2) R(n3, t3) with n2 across both others: angles of Davenport
    seen = rng.uniform(0.3, 1.2)
    axes = np.array([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (np.cos(seen), 0.0, np.sin(seen))]) @ turn.T
    angles = np.asarray(Rotation.from_rotvec(turn @ q).as_davenport(axes, "intrinsic"))
    ends = pairwise(("ground", "b1", "b2", "b3"))
    hinges = zip("ABC", ends, axes, strict=True)
    three = build_arm([tied(name, "revolute", end, rn.vec(n), rn.vec(centre)) for name, end, n in hinges])

    # rounding of seven matrix products
    rn.assert_close(rn.pose_of(three, angles, "b3"), rn.pose_of(ball, q, "b1"), 1e-13)
    # 1e-10: differences are good to 1e-12, the least sine of these axes with each other is 0.05
    ours, theirs = (
        rn.column_space(rn.body_jacobian(*one)) for one in ((ball, q, "b1"), (three, angles, "b3"))
    )
    rn.assert_same_space(ours, theirs, 1e-9)


# --- joints


def joint_of(kind: JointKind, rng: np.random.Generator) -> Joint:
    return rn.joint_between("J", kind, ("ground", "b"), {"ground": np.eye(4), "b": rn.random_pose(rng)}, rng)


def twists_of(joint: Joint, q: FloatArray, at: FloatArray) -> FloatArray:
    """Return what `joint_twists` returns, shape (6, k)."""
    return np.array([(*w, *v) for w, v in jm.joint_twists(joint, list(q), rn.transform(at))]).T


@pytest.mark.parametrize("kind", rn.KINDS)
@pytest.mark.parametrize("seed", range(5))
def test_joints_move_as_matrix_exponentials_by_their_twists_and_forbid_all_others(
    kind: JointKind, seed: int
) -> None:
    """Twists and those that it forbids are six, independent; a driven joint forbids what drives it."""
    rng = np.random.default_rng(seed)
    for _ in range(2):
        joint, q, at = joint_of(kind, rng), np.array(rn.random_values(kind, rng)), rn.random_pose(rng)
        rn.assert_close(rn.matrix(jm.joint_frame(joint, list(q))), rn.motion(kind, q, joint.pitch), ROUNDING)

        def pose(q: FloatArray, at: FloatArray = at, joint: Joint = joint) -> FloatArray:
            return at @ rn.motion(joint.kind, q, joint.pitch)

        rates = rn.difference(rn.one_by_one(pose), q, 1e-2)
        expected = [rn.twist_of(rate @ np.linalg.inv(pose(q))) for rate in np.moveaxis(rates, -1, 0)]
        # differences of step 1e-2: 1e-12 / 140 of truncation, 1e-14 of rounding
        allowed = twists_of(joint, q, at)
        rn.assert_close(allowed.T, np.array(expected), 3e-12)
        names, _, refused = zip(*jm.constraint_twists(joint, list(q), rn.transform(at)), strict=True)
        assert len(set(names)) == len(names)
        every = np.column_stack([allowed, *(np.array((*w, *v)) for w, v in refused)])
        assert every.shape == (6, 6)
        # points and axes near 1: of a joint that allowed what it forbids the least would be 1e-16
        assert np.linalg.svd(every, compute_uv=False)[-1] > 1e-2
        fixed = replace(joint, values=(Expression("s"),) * len(q))
        constraints = list(jm.constraint_twists(fixed, list(q), rn.transform(at)))
        drives = [(unit, (*w, *v)) for name, unit, (w, v) in constraints if name == "drive"]
        assert ([unit for unit, _ in drives], len(constraints)) == ([*JOINT_UNITS[kind]], 6)
        np.testing.assert_array_equal(np.array([twist for _, twist in drives]).T, allowed)


def user_motion() -> tuple[Expression, ...]:
    """Return R = Rz(s t) Rx(t), a = (s, t^2, sin(s t)) as a user joint's nine formulas of s and t."""
    m = ("cos(s * t)", "sin(s * t)", "0")
    n = ("-sin(s * t) * cos(t)", "cos(s * t) * cos(t)", "sin(t)")
    return tuple(map(Expression, (*m, *n, "s", "t ** 2", "sin(s * t)")))


def test_a_user_joint_moves_as_its_formulas_say() -> None:
    """Its pose, and its derivatives by both controls, against the rotations typed in as exponentials."""
    joint = Joint("U", "user", ("ground", "b"), motion=user_motion())
    arm = build_mechanism(Network("user", (Body("b"),), (joint,), controls=(Control("s"), Control("t"))))

    def expected(x: FloatArray) -> FloatArray:
        s, t = x
        pose = rn.motion("global", (0.0, 0.0, s * t)) @ rn.motion("global", (t, 0.0, 0.0))
        pose[:3, 3] = s, t**2, np.sin(s * t)
        return pose

    for x in np.random.default_rng(1).uniform(-1.5, 1.5, (20, 2)):
        rn.assert_close(rn.matrix(arm.poses(list(x))["b"]), expected(x), ROUNDING)
        values = arm.joint_values(joint, x)
        screws = twists_of(joint, np.array([float(one.value) for one in values]), np.eye(4))
        rates = rn.difference(rn.one_by_one(expected), x, 1e-2)
        for k in range(2):
            twist = screws @ np.array([float(one.gradient.get(k, 0.0)) for one in values])
            # truncation of step 1e-2 with seventh derivatives up to 1.5^7 = 17
            rn.assert_close(twist, rn.twist_of(rates[:, :, k] @ np.linalg.inv(expected(x))), 1e-11)


# --- poses of whole networks, by matrices alone


def poses_by_matrices(network: Network, names: set[str]) -> rn.Poses:
    """Return the pose of each body along some joints, visited until nothing new is found."""
    poses: rn.Poses = {network.ground: np.eye(4)}
    while len(poses) < len(network.body_names):
        for joint in (joint for joint in network.joints if joint.name in names):
            a, b = joint.bodies
            if a in poses and b not in poses:
                poses[b] = poses[a] @ rn.joint_matrix(joint, joint.start)
            elif b in poses and a not in poses:
                poses[a] = poses[b] @ np.linalg.inv(rn.joint_matrix(joint, joint.start))
    return poses


@pytest.mark.parametrize("seed", range(20))
def test_poses_and_gaps_of_random_networks_are_those_of_matrices(seed: int) -> None:
    """Trees in either direction, loops cut at any joint, closed at the start and open elsewhere."""
    rng = np.random.default_rng(seed)
    closed = rn.random_network(rng, bodies=5, extra=3)
    mechanism = build_mechanism(closed)
    assert np.abs(evaluate_closure(mechanism, mechanism.start[:, np.newaxis]).residual).max() < ROUNDING
    # other starts: its loops are open
    joints = tuple(replace(joint, start=rn.random_values(joint.kind, rng)) for joint in closed.joints)
    network = replace(closed, joints=joints)
    mechanism = build_mechanism(network)
    tree = {network.joints[one.joint].name for one in mechanism.graph.branches}
    expected = poses_by_matrices(network, tree)
    for name, pose in expected.items():
        rn.assert_close(rn.pose_of(mechanism, mechanism.start, name), pose, ROUNDING)
    residual = evaluate_closure(mechanism, mechanism.start[:, np.newaxis]).residual[:, 0]
    for k, cut in enumerate(mechanism.graph.cuts):
        joint = network.joints[cut]
        a, b = joint.bodies
        second = rn.matrix(joint.frames[1])
        E = np.linalg.inv(expected[a] @ rn.joint_matrix(joint, joint.start) @ second) @ expected[b] @ second
        gap = residual[6 * k : 6 * k + 6]
        rn.assert_close(gap[:3], E[:3, 3], ROUNDING)
        # a rotation vector near pi is good to the root of rounding
        rn.assert_close(gap[3:], Rotation.from_matrix(E[:3, :3]).as_rotvec(), 1e-6)
        rn.assert_close(rn.motion("global", gap[3:])[:3, :3], E[:3, :3], ROUNDING)
