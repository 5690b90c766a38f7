"""The equations of motion against Pinocchio's, on random states."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from made_masses import with_masses
from pinocchio_arms import add_frame, pinocchio, pinocchio_model
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics import equations
from urmpipe_models.dynamics.equations import forward_dynamics, inverse_dynamics, torque_terms
from urmpipe_models.dynamics.links import Wrench, kinetic_energy, potential_energy
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import from_offset
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.urdf import read_urdf

SAME = 1e-10  # relative to the largest value of a state: what is required; found are 1e-13
STATES = 1000

URDFS = {
    "panda": ("Gepetto_example-robot-data/panda.urdf", "panda_hand_tcp"),
    "ur5": ("Gepetto_example-robot-data/ur5_robot.urdf", "tool0"),
    "iiwa7": ("FancySafeBot_fsb-library/lbr_iiwa7_r800.urdf", "link7"),
}


def of_urdf(path: Path, tip: str) -> tuple[Chain, Any]:
    """An arm of a URDF, and the model of Pinocchio's own reader, with its other joints locked."""
    chain = read_urdf(path, tip_link=tip)
    model = pinocchio.buildModelFromUrdf(str(path))
    others = [model.getJointId(name) for name in model.names[1:] if name not in chain.coordinates]
    for joint in others:  # links that move on their own are no part of the arm
        model.inertias[joint] = pinocchio.Inertia.Zero()
    if others:
        model = pinocchio.buildReducedModel(model, others, pinocchio.neutral(model))
    frame = model.frames[model.getFrameId(tip)]
    add_frame(model, "tool", frame.parentJoint, frame.placement)
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
        self.wrench = Wrench(tuple(self.force.T[:3]), tuple(self.force.T[3:]))

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
        base = from_offset((0.3, -0.2, 0.5, 0.4, -0.3, 0.2))
        chain = with_masses(load_robot("urm6")).placed(base, from_offset((0.0, 0.1, 0.2)))
        return States(chain, pinocchio_model(chain))
    robots: Path = request.getfixturevalue("shared") / "robots"  # urm6 needs none of it
    file, tip = URDFS[request.param]
    return States(*of_urdf(robots / file, tip))


def assert_same(values: Any, expected: Any, within: float = SAME) -> None:
    """The largest difference of each state is within a part of its largest value."""
    rows = np.reshape(expected, (STATES, -1))
    largest = np.abs(np.reshape(values, rows.shape) - rows).max(axis=1) / np.abs(rows).max(axis=1)
    assert largest.max() <= within


def rows_of(elements: Sequence[Any]) -> FloatArray:
    """One element per coordinate as rows; gravity gives a joint along the vertical the constant 0."""
    return np.array([np.broadcast_to(element, STATES) for element in elements], dtype=float).T


def test_inverse_dynamics_and_its_terms_are_those_of_pinocchio(states: States) -> None:
    q, qd, qdd = states.columns
    without_wrench = states.rnea(states.q, states.qd, states.qdd)
    assert_same(rows_of(inverse_dynamics(states.chain, q, qd, qdd)), without_wrench)
    total = rows_of(inverse_dynamics(states.chain, q, qd, qdd, states.wrench))
    assert_same(total, without_wrench - states.tool_torques())
    terms = torque_terms(states.chain, q, qd, qdd, states.wrench)
    still = np.zeros_like(states.q)
    weight = states.rnea(states.q, still, still)
    assert_same(rows_of(terms.gravity), weight)
    assert_same(rows_of(terms.inertia), states.rnea(states.q, still, states.qdd) - weight)
    rates = states.rnea(states.q, states.qd, still) - weight
    assert_same(rows_of(terms.centrifugal) + rows_of(terms.coriolis), rates)
    single = [states.rnea(states.q, states.qd * unit, still) - weight for unit in np.eye(still.shape[1])]
    assert_same(rows_of(terms.centrifugal), np.sum(single, axis=0))
    assert_same(rows_of(terms.tool), -states.tool_torques())
    # two sums of some thousand products each, of the size of the torques
    assert_same(sum(map(rows_of, terms)), total, 1e-12)


def test_the_mass_matrix_is_that_of_pinocchio_symmetric_and_positive(states: States) -> None:
    rows = equations.mass_matrix(states.chain, states.columns[0])
    M = np.transpose([rows_of(row) for row in rows], (1, 0, 2))
    assert_array_equal(M, M.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(M).min() > 0.0
    upper = [np.triu(pinocchio.crba(states.model, states.data, q)) for q in states.q]
    assert_same(M, [half + np.triu(half, 1).T for half in upper])


def test_forward_dynamics_are_those_of_pinocchio_and_undo_the_inverse(states: States) -> None:
    q, qd, tau = states.columns
    rows = zip(states.q, states.qd, states.qdd, strict=True)
    expected = [pinocchio.aba(states.model, states.data, *row).copy() for row in rows]
    assert_same(rows_of(forward_dynamics(states.chain, q, qd, tau)), expected)
    pushed = forward_dynamics(states.chain, q, qd, tau, states.wrench)
    again = inverse_dynamics(states.chain, q, qd, pushed, states.wrench)
    # q'' reaches 1e5 for torques of 10 about a light wrist, and M's condition is some 1e4
    scale = 1.0 + np.abs(np.array(pushed)).max(axis=0)
    assert (np.abs(np.array(again) - np.array(tau)).max(axis=0) <= 1e-12 * scale).all()


def test_energies_and_centres_are_those_of_pinocchio(states: States) -> None:
    (q, qd, _), model, data = states.columns, states.model, states.data
    kinetic, potential = kinetic_energy(states.chain, q, qd), potential_energy(states.chain, q)
    rows = zip(states.q, states.qd, strict=True)
    assert_same(kinetic, [pinocchio.computeKineticEnergy(model, data, *row) for row in rows])
    level = potential - [pinocchio.computePotentialEnergy(model, data, row) for row in states.q]
    # Pinocchio leaves out the base, which stands still
    assert_allclose(level, level[0], rtol=0.0, atol=1e-12 * np.abs(potential).max())
    joints, inertials = states.chain.joints, states.chain.inertials
    first = next(k for k, joint in enumerate(joints) if joint.kind != "fixed")
    carriers = [joint.name for joint in joints[first:]]
    moving = [k for k, body in enumerate(inertials) if body.joint in carriers]
    masses = np.array([inertials[k].mass for k in moving])
    centre = masses @ equations.centres_of_mass_over_log(states.chain, states.q)[:, moving] / masses.sum()
    assert_same(centre, [pinocchio.centerOfMass(model, data, row).copy() for row in states.q])
