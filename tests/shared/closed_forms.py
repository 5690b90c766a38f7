"""Arms with a closed form, and the laws of their solutions: each meets its pose, and known ones are found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from asserting import there
from urmpipe_models.arm.chain import Chain, Joint, JointKind
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.closed import ClosedForm, exact_closed_form
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.math3d import Transform, from_offset, translation
from urmpipe_models.robots.catalogue import load_robot

EXACT = 1e-10  # what the issue asks of FK(IK(x)) in [m] and [rad]; regular poses are met to 1e-12
FOLD = 2e-5  # [rad] or [m]: given joint values come back to this, the digits of a pose near a fold of the arm

UR = ("ur3", "ur3e", "ur5", "ur5e", "ur10", "ur10e")
WRISTS = ("axes 5 and 6 meet", "axes 5 and 6 parallel", "axes 5 and 6 pass")  # of arms with parallel axes
SENSES = ((1, 1), (1, -1), (-1, 1), (-1, -1))  # of axes 3 and 4 along axis 2

SPECIAL: Mapping[str, Mapping[str, float]] = {
    "plain": {},
    "axes 1 and 2 meet": {"a1": 0.0},
    "axes 1 and 2 parallel": {"alpha1": 0.0},
    "axes 2 and 3 meet": {"a2": 0.0},
    "axes 2 and 3 parallel": {"alpha2": 0.0},
    "axes 2 and 3 against each other": {"alpha2": math.pi},
    "axes 1 and 2 meet, 2 and 3 parallel": {"a1": 0.0, "alpha2": 0.0},
    "anthropomorphic": {"a1": 0.0, "alpha1": math.pi / 2, "alpha2": 0.0, "d2": 0.0, "d3": 0.0, "a3": 0.0},
    "offset shoulder": {"alpha1": math.pi / 2, "alpha2": 0.0, "d2": 0.15, "d3": 0.0},
    "like a PUMA": {
        "a1": 0.0, "alpha1": -math.pi / 2, "alpha2": 0.0, "d2": 0.0, "a2": 0.4318, "a3": 0.0203,
        "d3": 0.15005, "alpha3": -math.pi / 2, "d4": 0.4318, "alpha4": math.pi / 2, "alpha5": -math.pi / 2,
    },
}  # fmt: skip
"""Parameters of standard DH rows that make an arm special; the others are drawn."""

KINDS: Mapping[str, JointKind] = {"R": "revolute", "P": "prismatic"}


def arm_with_wrist(
    rng: np.random.Generator, special: str = "plain", kinds: str = "RRR", **fixed: float
) -> Chain:
    """Return an arm with a spherical wrist on a random base, with a random tool, from standard DH rows.

    Args:
        rng: What the parameters are drawn from.
        special: A name of `SPECIAL`.
        kinds: Of joints 1 to 3, R or P each.
        fixed: Further parameters, such as a1, alpha2, d3.
    """
    drawn = {f"{name}{k}": rng.uniform(-0.5, 0.5) for name in "ad" for k in range(1, 7)}
    drawn |= {f"alpha{k}": rng.choice((-1, 1)) * rng.uniform(0.4, 2.7) for k in range(1, 7)}
    drawn |= {f"theta{k}": rng.uniform(-3.0, 3.0) for k in range(1, 7)}
    drawn |= {"a4": 0.0, "a5": 0.0, "d5": 0.0, **SPECIAL[special], **fixed}
    rows = [
        DHRow(drawn[f"theta{k}"], drawn[f"d{k}"], drawn[f"a{k}"], drawn[f"alpha{k}"], kind=KINDS[kind])
        for k, kind in enumerate(kinds + "RRR", start=1)
    ]
    base, tool = (from_offset(rng.uniform(-2.0, 2.0, 6).tolist()) for _ in range(2))
    return dh_chain("random", rows, base=base, tool=tool)


def arm_with_parallel_axes(
    rng: np.random.Generator, wrist: str, senses: tuple[int, int] = (1, 1), spread: float = 0.5
) -> Chain:
    """Return an arm with axes 2, 3, 4 parallel, every other twist and length random, on a base, with a tool.

    Axes 5 and 6 that pass each other do so about as far as `spread` in [m]; while they all but meet, and the
    arm has no closed form, it is drawn again, at most 20 times.
    """
    for _ in range(20):
        direction = rng.normal(size=(6, 3))
        direction[2], direction[3] = direction[1] * senses[0], direction[1] * senses[1]
        point = rng.uniform(-0.5, 0.5, (6, 3))
        point[5] = point[4] + (0.0 if wrist == WRISTS[0] else rng.uniform(-spread, spread, 3))
        if wrist == WRISTS[1]:
            direction[5] = direction[4]
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        steps = np.diff(np.vstack((np.zeros(3), point)), axis=0)
        pairs = enumerate(zip(steps.tolist(), direction.tolist(), strict=True))
        joints = tuple(Joint(f"j{k}", origin=from_offset(at), axis=tuple(axis)) for k, (at, axis) in pairs)
        base, tip, tool = (from_offset(rng.uniform(-1.0, 1.0, 6).tolist()) for _ in range(3))
        chain = Chain("random", joints, tip, base, tool)
        if exact_closed_form(chain) is not None:
            break
    return chain


def kr3() -> Chain:
    """Return a small arm whose axes 1, 4 and 6 point the other way: lengths of its public description."""
    frames = [(0.0, 0.0, 0.345), (0.02, 0.0, 0.0), (0.26, 0.0, 0.0)]
    frames += [(0.0, 0.0, 0.02), (0.26, 0.0, 0.0), (0.075, 0.0, 0.0)]
    y, back = (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)
    axes = [(0.0, 0.0, -1.0), y, y, back, y, back]
    pairs = enumerate(zip(frames, axes, strict=True), start=1)
    joints = (Joint(f"joint_a{k}", origin=translation(*frame), axis=axis) for k, (frame, axis) in pairs)
    return Chain("kr3r540", tuple(joints))


ELBOW = math.atan2(20.0, 130.0) - math.pi
"""theta3 of arm6 where the forearm, 20 mm across and 130 mm along, is in line with the upper arm."""


def q2_on_axis_1(q3: float) -> float:
    """Return theta2 that brings the wrist of arm6 over axis 1, for theta3."""
    tilt = q3 + math.pi / 2
    x = 120.0 + 20.0 * math.cos(tilt) - 130.0 * math.sin(tilt)
    y = 20.0 * math.sin(tilt) + 130.0 * math.cos(tilt)
    return math.acos(30.0 / math.hypot(x, y)) - math.atan2(y, x)


def articulated(d: tuple[float, ...], a: tuple[float, ...], slide: float | None = None) -> Chain:
    """Return an arm by d1 to d6 and a1 to a3 in [m]; joint 3 slides where its alpha is given in [rad]."""
    right = math.pi / 2
    twists = (right, 0.0, right) if slide is None else (-right, right, slide)
    kinds: list[JointKind] = ["revolute"] * 6
    kinds[2] = "revolute" if slide is None else "prismatic"
    rows = zip(d, (*a, 0.0, 0.0, 0.0), (*twists, -right, right, 0.0), kinds, strict=True)
    return dh_chain("articulated", [DHRow(d=d, a=a, alpha=alpha, kind=kind) for d, a, alpha, kind in rows])


def flat_arm(upper: float, fore: float) -> Chain:
    """Return an arm like a UR arm, whose axes 5 and 6 meet in the plane of its links, through axis 1."""
    right = math.pi / 2
    frames = [(0.0, 0.0, 0.0), (0.0, 0.1, 0.3, right), (upper, 0.0, 0.0), (fore, 0.0, 0.0)]
    frames += [(0.0, 0.0, 0.1, right), (0.0, 0.0, 0.1, -right)]
    joints = (Joint(name, origin=from_offset(frame)) for name, frame in zip("abcdef", frames, strict=True))
    return Chain("flat", tuple(joints), tip=translation(0.0, 0.0, 0.1))


def moved(chain: Chain, joint: int, *offset: float) -> Chain:
    """Return an arm with the frame of a joint moved in itself: x, y, z in [m] and rx, ry, rz in [rad]."""
    joints = list(chain.joints)
    joints[joint] = replace(joints[joint], origin=joints[joint].origin @ from_offset(offset))
    return replace(chain, joints=tuple(joints), visuals=())


def as_built(chain: Chain, deviation: float, seed: int = 3) -> Chain:
    """Return an arm each of whose joints is off in its frame by some m and rad, drawn from a Gaussian."""
    off = np.random.default_rng(seed).normal(0.0, deviation, (len(chain.joints), 6)).tolist()
    for joint, offset in enumerate(off):
        chain = moved(chain, joint, *offset)
    return chain


def arm_of_kind(rng: np.random.Generator, kind: str, number: int = 0) -> Chain:
    """Return a random arm of SPECIAL or WRISTS, of these with each sense of the axes in turn, or a robot."""
    if kind in SPECIAL:
        return arm_with_wrist(rng, kind)
    if kind in WRISTS:
        return arm_with_parallel_axes(rng, kind, SENSES[number % 4])
    return kr3() if kind == "kr3" else load_robot(kind)


def described_anew(chain: Chain, base: Transform, tool: Transform, zeros: FloatArray) -> Chain:
    """Return the same arm under other names, elsewhere, with another tool, joints counted from other zeros.

    Args:
        chain: An arm of plain revolute joints.
        base: Where it stands.
        tool: Its tool.
        zeros: What its joints are at where they now count 0, in [rad], shape (joints,).
    """
    joints = []
    left = Transform()
    for k, (joint, zero) in enumerate(zip(chain.moving, zeros.tolist(), strict=True)):
        joints.append(Joint(f"other{k}", joint.kind, left @ joint.origin, joint.axis))
        left = Transform().rotated(joint.axis, zero)
    return Chain("other", tuple(joints), tip=left @ chain.tip, base=base, tool=tool)


def random_joints(rng: np.random.Generator, chain: Chain, count: int) -> FloatArray:
    """Return joint values in [rad] or [m], shape (count, joints)."""
    return rng.uniform(-math.pi, math.pi, (count, len(chain.coordinates)))


def form_of(chain: Chain) -> ClosedForm:
    """Return the closed form of an arm that must have one."""
    return there(exact_closed_form(chain))


def assert_met(
    chain: Chain, targets: Targets, q: FloatArray, within: float = EXACT, angle: float | None = None
) -> None:
    """Compare joint values, shape (n, k, joints) or (n, joints), with their targets by forward kinematics.

    Args:
        within: Largest distance in [m], and angle in [rad] unless that is given.
    """
    q = q[:, np.newaxis] if q.ndim == 2 else q
    row, column = np.nonzero(np.isfinite(q).all(axis=2))
    errors = pose_errors(chain, q[row, column], targets.rows(row))
    distance, turn = (np.linalg.norm(error, axis=1) for error in errors)
    np.testing.assert_allclose(distance, 0.0, rtol=0, atol=within)
    np.testing.assert_allclose(turn, 0.0, rtol=0, atol=within if angle is None else angle)


def assert_solved(chain: Chain, targets: Targets, solutions: Solutions, within: float = EXACT) -> None:
    """Assert that every solution meets its target, and that there is a solution or a reason, never both."""
    assert_met(chain, targets, solutions.q, within)
    np.testing.assert_array_equal(solutions.reached, solutions.reasons == "")
    np.testing.assert_array_equal(np.isnan(solutions.q).any(axis=2), ~solutions.reached)


def distances(chain: Chain, solutions: Solutions, q: FloatArray) -> FloatArray:
    """Return how far each solution is from joint values, the largest joint, shape (n, k); inf of none."""
    away = solutions.q - q[:, None]
    turning = np.array([joint.kind == "revolute" for joint in chain.moving])
    away[..., turning] -= 2 * math.pi * np.round(away[..., turning] / (2 * math.pi))
    return np.where(solutions.reached, np.abs(away).max(axis=2), np.inf)


def solve_poses(
    chain: Chain,
    q: FloatArray,
    near: FloatArray | None = None,
    *,
    within: float = EXACT,
    given: float = FOLD,
    form: ClosedForm | None = None,
) -> Solutions:
    """Solve the poses of joint values, and assert the laws: each solution meets its pose, q is among them.

    Args:
        within: Largest distance and angle between a pose and that of a solution.
        given: Largest distance of the nearest solution from the joint values; infinity asks for none.
        form: By default the exact one of the arm.
    """
    targets = forward_targets(chain, q)
    solutions = (form or form_of(chain)).solve(targets, near)
    assert_solved(chain, targets, solutions, within)
    assert distances(chain, solutions, q).min(axis=1).max() <= given
    return solutions
