"""Mobility and motions against Pinocchio: open chains whose loops rigid constraints of it close."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import random_networks as rn
from known_mechanisms import bennett, coupled_loops, four_bar, nine_revolutes, sarrus
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.mobility import analyse_mobility
from urmpipe_models.networks.parts import Joint, JointKind

pin = pytest.importorskip("pinocchio")

SAME = 1e-9  # of projections: both Jacobians round to 1e-15, the worst condition here is below 1e4


class Oracle:
    """An open chain of Pinocchio: a joint moves a copy of its far body; the first copy is the body itself.

    Attributes:
        frames: Each body's frame.
        closures: Pairs of frames that must be the same: a body reached by a second joint, and the body.
        columns: The sign and name of each joint variable in Pinocchio's velocity.
    """

    def __init__(self, network: Network) -> None:
        self.model, self.frames = pin.Model(), {network.ground: 0}
        self.closures: list[tuple[Any, Any]] = []
        self.columns: list[tuple[float, tuple[str, int]]] = []
        self.q: list[float] = []
        left = list(network.joints)
        while left:
            joint = next(one for one in left if self.frames.keys() & set(one.bodies))
            left.remove(joint)
            self.add(joint)

    def add(self, joint: Joint) -> None:
        """Append a joint behind the body that is there; where both are there, it closes a loop."""
        way = 1 if joint.bodies[0] in self.frames else -1
        (near, far), (first, second) = joint.bodies[::way], map(rn.matrix, joint.frames[::way])
        base = self.model.frames[self.frames[near]]
        parent, placement = base.parentJoint, base.placement * pin.SE3(first)
        kinds = {
            "r": (pin.JointModelRY,),
            "p": (pin.JointModelPY,),
            "c": (pin.JointModelRY, pin.JointModelPY),
        }
        for k, kind in enumerate(kinds[joint.kind[0]]):
            parent = self.model.addJoint(parent, kind(), placement, f"{joint.name} {k}")
            placement = pin.SE3.Identity()
            self.columns.append((way, (joint.name, k)))
            self.q.append(way * (joint.start[k] if joint.start else 0.0))
        inverse = pin.SE3(np.linalg.inv(second))
        copy = pin.Frame(f"{far} by {joint.name}", parent, 0, inverse, pin.FrameType.OP_FRAME)
        number = self.model.addFrame(copy)
        if far in self.frames:
            self.closures.append((number, self.frames[far]))
        else:
            self.frames[far] = number

    def constraint_jacobians(self) -> tuple[FloatArray, FloatArray]:
        """Return what each loop's frames move against each other, shape (6 loops, variables).

        Both by frames' Jacobians and by `RigidConstraintModel`.
        """
        data, model = self.model.createData(), self.model
        pin.computeJointJacobians(model, data, np.array(self.q))
        pin.updateFramePlacements(model, data)
        by_frames, by_constraints = [], []
        for closure in self.closures:
            gap = data.oMf[closure[0]].actInv(data.oMf[closure[1]])
            rn.assert_close(gap.homogeneous, np.eye(4), 1e-12)  # Pinocchio closes it, too
            world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            copy, body = (pin.getFrameJacobian(model, data, frame, world) for frame in closure)
            by_frames.append(copy - body)
            places = [(model.frames[k].parentJoint, model.frames[k].placement) for k in closure]
            contact = pin.RigidConstraintModel(
                pin.ContactType.CONTACT_6D, model, *places[0], *places[1], pin.ReferenceFrame.LOCAL
            )
            by_constraints.append(pin.getConstraintJacobian(model, data, contact, contact.createData()))
        return np.concatenate(by_frames), np.concatenate(by_constraints)


def assert_as_pinocchio(network: Network) -> int:
    """Compare mobility and the row space of the Jacobian with Pinocchio's; return the mobility."""
    mechanism, oracle = build_mechanism(network), Oracle(network)
    ours = evaluate_closure(mechanism, mechanism.start[:, np.newaxis]).jacobian[:, :, 0]
    found = analyse_mobility(mechanism, mechanism.start)
    columns = [mechanism.variable_index[name] for _, name in oracle.columns]
    for jacobian in oracle.constraint_jacobians():
        theirs = np.zeros_like(jacobian)
        theirs[:, columns] = [sign for sign, _ in oracle.columns] * jacobian
        rank = np.linalg.matrix_rank(theirs, tol=1e-8)
        assert (found.mobility, found.rank) == (theirs.shape[1] - rank, rank)
        rn.assert_same_space(rn.column_space(ours.T), rn.column_space(theirs.T), SAME)
    return found.mobility


MECHANISMS = {
    "four-bar": (four_bar(), 1),
    "bennett": (bennett(), 1),
    "sarrus": (sarrus(), 1),
    "nine revolutes": (nine_revolutes(), 3),
    "coupled loops": (coupled_loops(), 1),
    "folded parallelogram": (four_bar(1.0, 2.0, 1.0, 2.0, 0.0), 2),
}


@pytest.mark.parametrize("name", MECHANISMS)
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_known_mechanisms_move_as_in_pinocchio(name: str, seed: int | None) -> None:
    network, mobility = MECHANISMS[name]
    if seed is not None:
        network = rn.reframed(network, np.random.default_rng(seed))
    assert assert_as_pinocchio(network) == mobility


@pytest.mark.parametrize("seed", range(20))
def test_random_loops_move_as_in_pinocchio(seed: int) -> None:
    """Revolute, prismatic and cylindrical joints at random, up to three loops, either direction."""
    rng = np.random.default_rng(seed)
    kinds: list[JointKind] = ["revolute", "prismatic", "cylindrical"]
    network = rn.random_network(rng, bodies=5, extra=1 + seed % 3, elements=0, kinds=kinds)
    assert_as_pinocchio(network)
