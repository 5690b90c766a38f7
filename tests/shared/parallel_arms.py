"""Arms with three parallel axes, and what is held of their solutions."""

from __future__ import annotations

import math

import numpy as np

from closed_forms import form_by
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.closed import ClosedForm
from urmpipe_models.ik.parallel_axes import parallel_axes
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.kinematics.forward import chain_to_screws
from urmpipe_models.math3d import from_offset

UR = ("ur3", "ur3e", "ur5", "ur5e", "ur10", "ur10e")
WRISTS = ("meet", "parallel", "pass")
EXACT = 1e-10
"""What the issue asks of FK(IK(x)); regular poses are met to 1e-12."""


def form_of(chain: Chain) -> ClosedForm:
    """Return the closed form of an arm that must have one."""
    return form_by(parallel_axes, chain)


def poses(chain: Chain, count: int, seed: int = 0) -> tuple[FloatArray, Targets]:
    q = np.random.default_rng(seed).uniform(-math.pi, math.pi, (count, 6))
    return q, forward_targets(chain, q)


def assert_every_solution_meets(chain: Chain, targets: Targets, solutions: Solutions, within: float) -> None:
    row, column = np.nonzero(solutions.reached)
    position, angle = pose_errors(chain, solutions.q[row, column], targets.rows(row))
    assert np.abs(position).max(initial=0.0) < within
    assert np.abs(angle).max(initial=0.0) < within
    assert ((solutions.reasons != "") == ~solutions.reached).all()


def apart(solutions: Solutions, q: FloatArray) -> FloatArray:
    """Return how far the nearest solution is from q, the largest of the joints, by the shorter way."""
    away = np.abs(np.remainder(solutions.q - q[:, None] + math.pi, 2 * math.pi) - math.pi).max(axis=2)
    return np.asarray(np.where(solutions.reached, away, np.inf).min(axis=1))


def random_arm(
    rng: np.random.Generator, wrist: str, signs: tuple[int, int] = (1, 1), spread: float = 0.5
) -> Chain:
    """An arm with axes 2, 3, 4 parallel, every other twist and length random, on a base, with a tool.

    Of axes 5 and 6 that pass each other it is drawn again while they all but meet, at most 20 times.
    """
    for _ in range(20):
        chain = drawn_arm(rng, wrist, signs, spread)
        of_chain = chain_to_screws(chain)
        if of_chain is not None and parallel_axes(of_chain, chain.coordinates) is not None:
            break
    return chain


def drawn_arm(rng: np.random.Generator, wrist: str, signs: tuple[int, int], spread: float) -> Chain:
    """Draw an arm; axes 5 and 6 pass each other about as far as `spread` in [m]."""
    direction = rng.normal(size=(6, 3))
    direction[2], direction[3] = direction[1] * signs[0], direction[1] * signs[1]
    point = rng.uniform(-0.5, 0.5, (6, 3))
    point[5] = point[4] + (0.0 if wrist == "meet" else rng.uniform(-spread, spread, 3))
    if wrist == "parallel":
        direction[5] = direction[4]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    steps = np.diff(np.vstack((np.zeros(3), point)), axis=0)
    joints = tuple(
        Joint(f"j{k}", origin=from_offset(step.tolist()), axis=tuple(axis.tolist()))
        for k, (step, axis) in enumerate(zip(steps, direction, strict=True))
    )
    base, tip, tool = (from_offset(rng.uniform(-1.0, 1.0, 6).tolist()) for _ in range(3))
    return Chain("random", joints, tip, base, tool)


def rotation_matrix(rx: float, ry: float, rz: float) -> FloatArray:
    """Return Rz Ry Rx as an array of shape (1, 3, 3)."""
    return np.array(from_offset((0.0, 0.0, 0.0, rx, ry, rz)).rotation)[None]
