"""The equations of motion against Pinocchio's, on random states."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

from made_masses import with_masses
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import (
    centres_of_mass_over_log,
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
    torque_terms,
)
from urmpipe_models.dynamics.links import Wrench, kinetic_energy, potential_energy
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import Transform, from_offset
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.urdf import read_urdf

SAME = 1e-10
"""Relative to the largest value of a state: what is required; found are 1e-13."""

STATES = 1000

URDFS = {
    "panda": ("Gepetto_example-robot-data/panda.urdf", "panda_hand_tcp"),
    "ur5": ("Gepetto_example-robot-data/ur5_robot.urdf", "tool0"),
    "iiwa7": ("FancySafeBot_fsb-library/lbr_iiwa7_r800.urdf", "link7"),
}


def pinocchio_of(chain: Chain) -> Any:
    """A model of Pinocchio's, joint by joint from frames and axes; a fixed joint moves what follows it."""
    model = pinocchio.Model()
    parent, frame = 0, se3(chain.base)
    add_bodies(model, parent, frame, chain, None)
    for joint in chain.joints:
        frame = frame * se3(joint.origin)
        if joint.kind != "fixed":
            turns = joint.kind == "revolute"
            kind = pinocchio.JointModelRevoluteUnaligned if turns else pinocchio.JointModelPrismaticUnaligned
            parent = model.addJoint(parent, kind(np.array(joint.axis)), frame, joint.name)
            frame = pinocchio.SE3.Identity()
        add_bodies(model, parent, frame, chain, joint.name)
    tool = frame * se3(chain.tip) * se3(chain.tool)
    model.addFrame(pinocchio.Frame("tool", parent, tool, pinocchio.FrameType.OP_FRAME))
    model.gravity.linear = np.array(chain.gravity)
    return model


def add_bodies(model: Any, parent: int, frame: Any, chain: Chain, joint: str | None) -> None:
    for one in chain.inertials:
        if one.joint == joint and parent:
            ixx, iyy, izz, ixy, ixz, iyz = one.inertia
            inertia = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
            body = pinocchio.Inertia(one.mass, np.array(one.centre), inertia)
            model.appendBodyToJoint(parent, body, frame)


def se3(frame: Transform) -> Any:
    return pinocchio.SE3(np.array(frame.rotation, dtype=float), np.array(frame.translation, dtype=float))


def made_up() -> tuple[Chain, Any]:
    """urm6 with masses that are made up, and Pinocchio's model of it."""
    base = from_offset((0.3, -0.2, 0.5, 0.4, -0.3, 0.2))
    chain = with_masses(load_robot("urm6")).placed(base, from_offset((0.0, 0.1, 0.2)))
    return chain, pinocchio_of(chain)


def of_urdf(path: Path, tip: str) -> tuple[Chain, Any]:
    """An arm of a URDF, and the model of Pinocchio's own reader, with its other joints locked."""
    chain = read_urdf(path, tip_link=tip)
    model = pinocchio.buildModelFromUrdf(str(path))
    others = [model.getJointId(one) for one in model.names[1:] if one not in chain.coordinates]
    for one in others:  # links that move on their own are no part of the arm
        model.inertias[one] = pinocchio.Inertia.Zero()
    if others:
        model = pinocchio.buildReducedModel(model, others, pinocchio.neutral(model))
    frame = model.frames[model.getFrameId(tip)]
    model.addFrame(pinocchio.Frame("tool", frame.parentJoint, frame.placement, pinocchio.FrameType.OP_FRAME))
    return chain, model


class States:
    """An arm in random states: rows for Pinocchio, columns for the functions under test."""

    def __init__(self, chain: Chain, model: Any) -> None:
        self.chain, self.model, self.data = chain, model, model.createData()
        rng, count = np.random.default_rng(21), len(self.chain.coordinates)
        sizes = (np.pi, 3.0, 10.0)
        self.q, self.qd, self.qdd = (size * rng.uniform(-1.0, 1.0, (STATES, count)) for size in sizes)
        self.columns = [list(rows.T) for rows in (self.q, self.qd, self.qdd)]
        self.force = 20.0 * rng.uniform(-1.0, 1.0, (STATES, 6))
        x, y, z, mx, my, mz = self.force.T
        self.wrench = Wrench((x, y, z), (mx, my, mz))

    def tool_torques(self) -> FloatArray:
        """J^T F of the tool, along the axes of the world."""
        frame, axes = self.model.getFrameId("tool"), pinocchio.LOCAL_WORLD_ALIGNED
        jacobians = (pinocchio.computeFrameJacobian(self.model, self.data, q, frame, axes) for q in self.q)
        return np.array([J.T @ force for J, force in zip(jacobians, self.force, strict=True)])

    def rnea(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        rows = zip(q, qd, qdd, strict=True)
        return np.array([pinocchio.rnea(self.model, self.data, *row).copy() for row in rows])


@pytest.fixture(scope="module", params=["urm6", *URDFS])
def states(request: pytest.FixtureRequest) -> States:
    if request.param == "urm6":
        return States(*made_up())
    robots: Path = request.getfixturevalue("shared") / "robots"  # urm6 needs none of it
    file, tip = URDFS[request.param]
    return States(*of_urdf(robots / file, tip))


def assert_same(found: Any, expected: FloatArray, within: float = SAME) -> None:
    """The largest difference of each state is within a part of its largest value."""
    rows = np.reshape(expected, (STATES, -1))
    got = np.reshape(np.array(found), rows.shape)
    worst = np.abs(got - rows).max(axis=1) / np.abs(rows).max(axis=1)
    assert worst.max() <= within


def test_inverse_dynamics_are_those_of_pinocchio(states: States) -> None:
    q, qd, qdd = states.columns
    free = np.array(inverse_dynamics(states.chain, q, qd, qdd)).T
    assert_same(free, states.rnea(states.q, states.qd, states.qdd))
    pushed = np.array(inverse_dynamics(states.chain, q, qd, qdd, states.wrench)).T
    assert_same(pushed, states.rnea(states.q, states.qd, states.qdd) - states.tool_torques())


def test_the_mass_matrix_is_that_of_pinocchio_symmetric_and_positive(states: States) -> None:
    rows = mass_matrix(states.chain, states.columns[0])
    found = np.array([[np.broadcast_to(one, STATES) for one in row] for row in rows]).transpose(2, 0, 1)
    np.testing.assert_array_equal(found, found.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(found).min() > 0.0
    upper = [np.triu(pinocchio.crba(states.model, states.data, q)) for q in states.q]
    expected = [half + np.triu(half, 1).T for half in upper]
    assert_same(found, np.array(expected))


def test_forward_dynamics_are_those_of_pinocchio_and_undo_the_inverse(states: States) -> None:
    q, qd, tau = states.columns
    found = forward_dynamics(states.chain, q, qd, tau)
    rows = zip(states.q, states.qd, states.qdd, strict=True)
    expected = [pinocchio.aba(states.model, states.data, *row).copy() for row in rows]
    assert_same(np.array(found).T, np.array(expected))
    pushed = forward_dynamics(states.chain, q, qd, tau, states.wrench)
    again = inverse_dynamics(states.chain, q, qd, pushed, states.wrench)
    # q'' reaches 1e5 for torques of 10 about a light wrist, and M's condition is some 1e4
    scale = 1.0 + np.abs(np.array(pushed)).max(axis=0)
    assert (np.abs(np.array(again) - np.array(tau)).max(axis=0) <= 1e-12 * scale).all()


def test_energies_and_centres_are_those_of_pinocchio(states: States) -> None:
    q, qd, _ = states.columns
    kinetic, potential = kinetic_energy(states.chain, q, qd), potential_energy(states.chain, q)
    rows = [*zip(states.q, states.qd, strict=True)]
    expected = [pinocchio.computeKineticEnergy(states.model, states.data, *row) for row in rows]
    assert_same(kinetic, np.array(expected))
    heights = np.array([pinocchio.computePotentialEnergy(states.model, states.data, row) for row in states.q])
    level = potential - heights  # Pinocchio leaves out the base, which stands still
    np.testing.assert_allclose(level, level[0], rtol=0.0, atol=1e-12 * np.abs(potential).max())
    joints, inertials = states.chain.joints, states.chain.inertials
    first = next(k for k, joint in enumerate(joints) if joint.kind != "fixed")
    carriers = [joint.name for joint in joints[first:]]
    moving = [k for k, one in enumerate(inertials) if one.joint in carriers]
    masses = np.array([inertials[k].mass for k in moving])
    found = masses @ centres_of_mass_over_log(states.chain, states.q)[:, moving] / masses.sum()
    whole = [pinocchio.centerOfMass(states.model, states.data, row).copy() for row in states.q]
    assert_same(found, np.array(whole))


def test_the_terms_are_those_of_pinocchio_and_sum_to_the_inverse(states: States) -> None:
    q, qd, qdd = states.columns
    terms = torque_terms(states.chain, q, qd, qdd, states.wrench)
    still = np.zeros_like(states.q)
    weight = states.rnea(states.q, still, still)
    assert_same(rows_of(terms.gravity), weight)
    assert_same(rows_of(terms.inertia), states.rnea(states.q, still, states.qdd) - weight)
    rates = states.rnea(states.q, states.qd, still) - weight
    assert_same(rows_of(terms.centrifugal) + rows_of(terms.coriolis), rates)
    one_by_one = np.zeros_like(still)
    for k in range(still.shape[1]):
        alone = np.where(np.arange(still.shape[1]) == k, states.qd, 0.0)
        one_by_one += states.rnea(states.q, alone, still) - weight
    assert_same(rows_of(terms.centrifugal), one_by_one)
    assert_same(rows_of(terms.tool), -states.tool_torques())
    total = rows_of(inverse_dynamics(states.chain, q, qd, qdd, states.wrench))
    # two sums of some thousand products each, of the size of the torques
    assert_same(sum(map(rows_of, terms)), total, 1e-12)


def rows_of(elements: Sequence[Any]) -> FloatArray:
    """One element a coordinate as rows; gravity gives a joint along the vertical the constant 0."""
    return np.array([np.broadcast_to(one, STATES) for one in elements], dtype=float).T
