"""Mobility and motions against Pinocchio: open chains whose loops frame Jacobians close."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from known_mechanisms import bennett, coupled_loops, four_bar, nine_revolutes, ring, sarrus
from random_networks import assert_same_space, matrix, null_space, random_network, reframed, unit
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.mobility import analyse_mobility
from urmpipe_models.networks.parts import Joint, JointKind

pin = pytest.importorskip("pinocchio")

SAME = 1e-9  # of projections: both Jacobians round to 1e-15, the worst condition here is below 1e4


@dataclass
class Oracle:
    """An open chain of Pinocchio: the joints one by one in the order of a network, loops closed by frames.

    Attributes:
        model: Pinocchio's.
        frames: Of each body reached by a joint its frame's number.
        closures: Pairs of frames that must be one: a body reached by a second joint, and the body.
        columns: The number of each variable of the network by joint and index, in Pinocchio's velocity.
    """

    model: Any = field(default_factory=pin.Model)
    frames: dict[str, int] = field(default_factory=dict)
    closures: list[tuple[int, int]] = field(default_factory=list)
    columns: dict[tuple[str, int], int] = field(default_factory=dict)
    q: list[float] = field(default_factory=list)


def se3(full: NDArray[Any]) -> Any:
    return pin.SE3(full[:3, :3], full[:3, 3])


def oracle_of(network: Network) -> Oracle:
    """Return an open chain: every joint moves a copy of its far body; the first copy is the body itself."""
    oracle = Oracle()
    oracle.frames[network.ground] = 0
    left = list(network.joints)
    while left:
        joint = next(one for one in left if oracle.frames.keys() & set(one.bodies))
        left.remove(joint)
        add_joint(oracle, joint)
    return oracle


def add_joint(oracle: Oracle, joint: Joint) -> None:
    """Append a joint behind the body that is there; one of whose bodies both are there closes a loop."""
    forward = joint.bodies[0] in oracle.frames
    near, far = joint.bodies if forward else joint.bodies[::-1]
    sign = 1.0 if forward else -1.0
    first, second = (matrix(one) for one in (joint.frames if forward else joint.frames[::-1]))
    base = oracle.model.frames[oracle.frames[near]]
    parent, placement = base.parentJoint, base.placement * se3(first)
    kinds = {
        "revolute": (pin.JointModelRY,),
        "prismatic": (pin.JointModelPY,),
        "cylindrical": (pin.JointModelRY, pin.JointModelPY),
    }
    for k, kind in enumerate(kinds[joint.kind]):
        number = oracle.model.addJoint(parent, kind(), placement, f"{joint.name} {k}")
        oracle.columns[joint.name, k] = len(oracle.q)
        oracle.q.append(sign * (joint.start[k] if joint.start else 0.0))
        parent, placement = number, pin.SE3.Identity()
    copy = oracle.model.addFrame(
        pin.Frame(f"{far} by {joint.name}", parent, 0, se3(np.linalg.inv(second)), pin.FrameType.OP_FRAME)
    )
    if far in oracle.frames:
        oracle.closures.append((copy, oracle.frames[far]))
    else:
        oracle.frames[far] = copy


def constraint_jacobian(oracle: Oracle) -> FloatArray:
    """Return what each loop's frames move against each other, shape (6 loops, variables)."""
    data, q = oracle.model.createData(), np.array(oracle.q)
    pin.computeJointJacobians(oracle.model, data, q)
    pin.updateFramePlacements(oracle.model, data)
    rows = []
    for copy, body in oracle.closures:
        gap = data.oMf[copy].actInv(data.oMf[body])
        np.testing.assert_allclose(
            gap.homogeneous, np.eye(4), rtol=0.0, atol=1e-12
        )  # Pinocchio closes it, too
        one, other = (
            pin.getFrameJacobian(oracle.model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            for frame in (copy, body)
        )
        rows.append(one - other)
    return np.concatenate(rows)


def signs_of(network: Network, oracle: Oracle) -> dict[str, float]:
    """Return -1 of joints that Pinocchio walks from their second body to their first."""
    found = {}
    for one in network.joints:
        number = oracle.model.getJointId(f"{one.name} 0")
        name = next(f.name for f in oracle.model.frames if f.name.endswith(f" by {one.name}"))
        assert number
        found[one.name] = 1.0 if name == f"{one.bodies[1]} by {one.name}" else -1.0
    return found


def row_space(jacobian: FloatArray) -> FloatArray:
    _, values, rows = np.linalg.svd(jacobian)
    return np.asarray(rows[: int((values > 1e-8 * values[0]).sum())].T)


def assert_as_pinocchio(network: Network) -> int:
    """Hold mobility and the row space of the Jacobian to Pinocchio's; return the mobility."""
    mechanism, oracle = build_mechanism(network), oracle_of(network)
    theirs = constraint_jacobian(oracle)
    ours = evaluate_closure(mechanism, mechanism.start[:, np.newaxis]).jacobian[:, :, 0]
    signs = signs_of(network, oracle)
    aligned = np.zeros_like(theirs)
    for column, one in enumerate(mechanism.variables):
        aligned[:, column] = signs[one.owner] * theirs[:, oracle.columns[one.owner, one.index]]
    rank = np.linalg.matrix_rank(theirs, tol=1e-8)
    found = analyse_mobility(mechanism, mechanism.start)
    assert found.mobility == theirs.shape[1] - rank
    assert found.rank == rank
    assert_same_space(row_space(ours), row_space(aligned), SAME)
    assert_same_space(null_space(ours), null_space(aligned), SAME)
    return found.mobility


MECHANISMS = {
    "four-bar": (four_bar(), 1),
    "bennett": (bennett(), 1),
    "sarrus": (sarrus(), 1),
    "nine revolutes": (nine_revolutes(), 3),
    "coupled loops": (coupled_loops(), 1),
    "folded parallelogram": (four_bar(1.0, 2.0, 1.0, 2.0, 0.0), 2),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_known_mechanisms_move_as_in_pinocchio(name: str, seed: int | None) -> None:
    network, mobility = MECHANISMS[name]
    if seed is not None:
        network = reframed(network, np.random.default_rng(seed))
    assert assert_as_pinocchio(network) == mobility


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_random_loops_move_as_in_pinocchio(seed: int) -> None:
    """Revolute, prismatic and cylindrical joints at random, up to three loops, either direction."""
    rng = np.random.default_rng(seed)
    kinds: list[JointKind] = ["revolute", "prismatic", "cylindrical"]
    network = random_network(rng, bodies=5, extra=1 + seed % 3, elements=0, kinds=kinds)
    assert_as_pinocchio(network)


@pytest.mark.parametrize("seed", range(10))
def test_slides_and_hinges_in_a_ring_move_as_in_pinocchio(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kinds = "".join(rng.choice(list("rpc"), 7))
    axes = np.array([unit(one) for one in rng.normal(size=(7, 3))])
    network = reframed(ring(kinds, axes, rng.uniform(-1.0, 1.0, (7, 3))), rng)
    assert assert_as_pinocchio(network) >= 1


def test_a_rigid_constraint_of_pinocchio_gives_the_same_rank() -> None:
    """`RigidConstraintModel` of 6 rows in the place of frame Jacobians, for Bennett's linkage."""
    network = bennett()
    oracle = oracle_of(network)
    copy, body = (oracle.model.frames[k] for k in oracle.closures[0])
    contact = pin.RigidConstraintModel(
        pin.ContactType.CONTACT_6D, oracle.model, copy.parentJoint, copy.placement, body.parentJoint,
        body.placement, pin.ReferenceFrame.LOCAL,
    )  # fmt: skip
    data, held = oracle.model.createData(), contact.createData()
    pin.computeJointJacobians(oracle.model, data, np.array(oracle.q))
    jacobian = pin.getConstraintJacobian(oracle.model, data, contact, held)
    mechanism = build_mechanism(network)
    assert jacobian.shape == (6, 4)
    assert analyse_mobility(mechanism, mechanism.start).rank == np.linalg.matrix_rank(jacobian, tol=1e-8) == 3
