"""Random arms with a spherical wrist, plain and special, and how their solutions are held to their poses."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from closed_forms import form_by
from urmpipe_models.arm.chain import Chain, Joint, JointKind
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Solutions, Targets, pose_errors
from urmpipe_models.ik.spherical import SphericalWrist, spherical_wrist
from urmpipe_models.math3d import Transform, from_offset

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


def random_arm(
    generator: np.random.Generator, special: str = "plain", kinds: str = "RRR", **fixed: float
) -> Chain:
    """Return an arm on a random base, with a random tool, from standard DH rows.

    Args:
        generator: What the parameters are drawn from.
        special: A name of `SPECIAL`.
        kinds: Of joints 1 to 3, R or P each.
        fixed: Further parameters, such as a1, alpha2, d3.
    """
    drawn = {f"{name}{k}": generator.uniform(-0.5, 0.5) for name in "ad" for k in range(1, 7)}
    drawn |= {f"alpha{k}": generator.choice((-1, 1)) * generator.uniform(0.4, 2.7) for k in range(1, 7)}
    drawn |= {f"theta{k}": generator.uniform(-3.0, 3.0) for k in range(1, 7)}
    drawn |= {"a4": 0.0, "a5": 0.0, "d5": 0.0, **SPECIAL[special], **fixed}
    rows = [
        DHRow(drawn[f"theta{k}"], drawn[f"d{k}"], drawn[f"a{k}"], drawn[f"alpha{k}"], kind=KINDS[kind])
        for k, kind in enumerate(kinds + "RRR", start=1)
    ]
    base, tool = (from_offset(generator.uniform(-2.0, 2.0, 6).tolist()) for _ in range(2))
    return dh_chain("random", rows, base=base, tool=tool)


def random_joints(generator: np.random.Generator, chain: Chain, count: int) -> FloatArray:
    """Return joint values in [rad] or [m], shape (count, joints)."""
    return generator.uniform(-math.pi, math.pi, (count, len(chain.coordinates)))


def inverse_of(chain: Chain) -> SphericalWrist:
    """Return the closed form of an arm that must have one."""
    return form_by(spherical_wrist, chain)


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


def assert_reached(chain: Chain, targets: Targets, solutions: Solutions, within: float = 1e-10) -> None:
    """Hold every solution against its target by forward kinematics, in [m] and [rad]."""
    for slot in range(solutions.q.shape[1]):
        there = solutions.reached[:, slot]
        position, rotation = pose_errors(chain, solutions.q[there, slot], targets.rows(there))
        np.testing.assert_allclose(position, 0.0, rtol=0, atol=within, err_msg=solutions.branches[slot])
        np.testing.assert_allclose(rotation, 0.0, rtol=0, atol=within, err_msg=solutions.branches[slot])


def away_from(chain: Chain, solutions: Solutions, q: FloatArray) -> FloatArray:
    """Return how far each solution is from joint values, the largest joint, shape (n, k); inf of none."""
    away = solutions.q - q[:, None]
    turning = np.array([joint.kind == "revolute" for joint in chain.moving])
    away[..., turning] -= 2 * math.pi * np.round(away[..., turning] / (2 * math.pi))
    return np.where(solutions.reached, np.abs(away).max(axis=2), np.inf)


def assert_explained(solutions: Solutions) -> None:
    """Hold that there is a solution or a reason, never both, and that joints are in (-pi, pi]."""
    np.testing.assert_array_equal(solutions.reached, solutions.reasons == "")
    np.testing.assert_array_equal(np.isnan(solutions.q).any(axis=2), ~solutions.reached)
