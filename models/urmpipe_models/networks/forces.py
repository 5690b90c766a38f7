"""Static forces in a network: what the drives must hold, and what joints and elements transmit.

With loads Q (forces on the variables by virtual work) and the closure F(y, d) = 0, multipliers lambda hold
the variables that follow, and the drives the rest:

    J_y^T lambda = -Q_y,    tau_d = -(Q_d + J_d^T lambda)

lambda are the wrenches of cut joints and the forces of elements; the joints of the spanning tree transmit
what the bodies beyond them need for equilibrium. If constraints are redundant, lambda is not unique:
components of reactions that depend on the choice are NaN, as they depend on the elasticity of the bodies.

Wrenches are moment [N.m] about the origin of the ground, then force [N], along the axes of the ground.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray, IndexArray, Vector, add, cross, dot, subtract
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.closure import (
    body_twists,
    evaluate_closure,
    iter_chunks,
    iter_twist_maps,
    stack_elements,
)
from urmpipe_models.networks.continuation import BranchDerivatives
from urmpipe_models.networks.mechanism import Mechanism, Placements
from urmpipe_models.networks.parts import Joint

UNDETERMINED = 1e-7  # share of a unit multiplier that a component takes from redundant constraints


@dataclass(frozen=True, slots=True)
class Wrench:
    """A load on a body.

    Attributes:
        body: Name of the body.
        point: Where it acts, in the frame of the body in [m].
        force: Along the axes of the ground in [N].
        moment: About the axes of the ground in [N.m].
    """

    body: str
    point: Vector = (0.0, 0.0, 0.0)
    force: Vector = (0.0, 0.0, 0.0)
    moment: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """Forces of a network in equilibrium at n configurations.

    Attributes:
        drives: Forces of the prescribed variables in [N.m] of an angle, [N] of a length, shape (driven, n);
            of a control per its own unit.
        reactions: Of each joint by its name, on its second body: force [N] along m, n, m x n of its frame and
            moment [N.m] about them, shape (6, n); of each element its force [N], positive if it pushes its
            bodies apart, of a pair its force [N] or moment [N.m] on its second variable, shape (1, n). What
            pairs exert along the variables of their joints is no reaction of these. NaN where redundant
            constraints leave it undetermined.
    """

    drives: FloatArray
    reactions: dict[str, FloatArray]


def compute_forces(
    mechanism: Mechanism,
    x: FloatArray,
    driven: IndexArray,
    free: IndexArray,
    wrenches: Sequence[Wrench] = (),
    torques: Mapping[str, float] | None = None,
    slopes: Sequence[BranchDerivatives] = (),
) -> Forces:
    """Return the forces that hold a network under loads.

    Args:
        mechanism: The network.
        x: Configurations that close, shape (variables, n), in [m], [rad] and as controls are given.
        driven: The numbers of the prescribed variables, shape (driven,) [-].
        free: The numbers of those that follow, shape (free,) [-].
        wrenches: Loads on bodies.
        torques: Loads on the first variable of joints, by their names, in [N.m] or [N].
        slopes: Derivatives along the line of the drives at samples where branches meet. There the force of a
            single drive follows from virtual work along the branch; those of several drives, and the
            reactions, are not determined.
    """
    n = x.shape[1]
    drives = np.zeros((len(driven), n))
    reactions = {joint.name: np.zeros((6, n)) for joint in mechanism.network.joints}
    reactions |= {element.name: np.zeros((1, n)) for element in mechanism.network.elements}
    for rows in iter_chunks(n):
        equilibrium = _Equilibrium(mechanism, x[:, rows], driven, free, wrenches, torques or {})
        drives[:, rows] = equilibrium.drives
        for name, values in equilibrium.reactions().items():
            reactions[name][:, rows] = values
    for near, first, _ in slopes:
        equilibrium = _Equilibrium(mechanism, x[:, near], driven, free, wrenches, torques or {})
        work = -np.einsum("vk,vk->k", equilibrium.forces, first)
        drives[:, near] = work / first[driven] if len(driven) == 1 else np.nan
        for values in reactions.values():
            values[:, near] = np.nan
    return Forces(drives, reactions)


class _Equilibrium:
    """The equilibrium at some configurations: forces on the variables, of the drives, and multipliers."""

    def __init__(
        self,
        mechanism: Mechanism,
        x: FloatArray,
        driven: IndexArray,
        free: IndexArray,
        wrenches: Sequence[Wrench],
        torques: Mapping[str, float],
    ) -> None:
        self.mechanism, self.x = mechanism, x
        self.loads = _wrenches_in_ground(mechanism, x, wrenches)
        twists = body_twists(mechanism, x)
        forces = np.zeros_like(x)
        for body, wrench in self.loads.items():
            forces += np.einsum("kn,kvn->vn", wrench, twists[body])
        for joint in mechanism.network.joints:
            if joint.name in torques:
                value = mechanism.joint_values(joint, x)[0]
                for place, slope in value.gradient.items():
                    forces[place] += torques[joint.name] * slope
        self.forces = forces
        jacobian = evaluate_closure(mechanism, x).jacobian * mechanism.row_scales[:, np.newaxis, np.newaxis]
        followers = jacobian[:, free] * mechanism.column_scales[free, np.newaxis]
        left, values, right = np.linalg.svd(followers.transpose(2, 0, 1))
        count = values.shape[1]
        kept = values > 1e-9 * values[:, :1] if count else values.astype(bool)
        inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
        loads = -(forces[free] * mechanism.column_scales[free, np.newaxis]).T
        turned = np.einsum("nkf,nf->nk", right[:, :count], loads) * inverse
        multipliers = np.einsum("nrk,nk->rn", left[:, :, :count], turned)
        self.drives = -(forces[driven] + np.einsum("rdn,rn->dn", jacobian[:, driven], multipliers))
        self.multipliers = multipliers * mechanism.row_scales[:, np.newaxis]
        rank = int(kept.sum(axis=1).min()) if kept.size else 0
        self.redundant = (
            left[:, :, rank:].transpose(1, 2, 0) * mechanism.row_scales[:, np.newaxis, np.newaxis]
        )

    def reactions(self) -> dict[str, FloatArray]:
        """Return what each joint and element transmits; NaN where it is not determined."""
        reactions = self._transmitted(self.multipliers, self.loads)
        for k in range(self.redundant.shape[1]):
            shares = self._transmitted(self.redundant[:, k], {})
            sizes = np.array([1.0] * 3 + [self.mechanism.length] * 3)[:, np.newaxis]  # of force, of moment
            for name, share in shares.items():
                unknown = np.abs(share) * self.mechanism.length > UNDETERMINED * sizes[: len(share)]
                reactions[name] = np.where(unknown, np.nan, reactions[name])
        return reactions

    def _transmitted(self, multipliers: FloatArray, loads: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return reactions for multipliers, shape (rows, n), and wrenches on bodies in the ground, (6, n)."""
        network, n = self.mechanism.network, self.x.shape[1]
        on_bodies = {name: np.array(loads.get(name, np.zeros((6, n)))) for name in network.body_names}
        ground_wrenches: dict[str, FloatArray] = {}
        reactions: dict[str, FloatArray] = {}
        for constraint, rows, twist_map in iter_twist_maps(self.mechanism, self.x):
            wrench = np.einsum("rkn,rn->kn", twist_map, multipliers[rows])
            on_bodies[constraint.bodies[1]] += wrench
            on_bodies[constraint.bodies[0]] -= wrench
            ground_wrenches[constraint.name] = wrench
            if len(twist_map) == 1:
                reactions[constraint.name] = multipliers[rows]
        placements = self.mechanism.placements(self.x)
        cut_names = {network.joints[cut].name for cut in self.mechanism.graph.cuts}
        for joint, wrench in self._pair_wrenches(multipliers, placements):
            if joint.name in cut_names:  # a cut joint, whose multipliers hold its variable, too
                ground_wrenches[joint.name] = ground_wrenches[joint.name] - wrench
            else:
                on_bodies[joint.bodies[1]] += wrench
                on_bodies[joint.bodies[0]] -= wrench
        for branch in reversed(self.mechanism.graph.branches):
            joint = network.joints[branch.joint]
            needed = -on_bodies[branch.child]  # what the joint must exert on the body beyond it
            on_bodies[branch.parent] = on_bodies[branch.parent] - needed
            ground_wrenches[joint.name] = needed * branch.sign
        for joint in network.joints:
            reactions[joint.name] = _at_frame(ground_wrenches[joint.name], placements.joints[joint.name])
        return reactions

    def _pair_wrenches(
        self, multipliers: FloatArray, placements: Placements
    ) -> Iterator[tuple[Joint, FloatArray]]:
        """Yield what pairs exert along the variables of their joints, on second bodies, in the ground.

        The moment about n of an angle, the force along n of a length, as wrenches, shape (6, n).
        """
        mechanism = self.mechanism
        joints = {joint.name: joint for joint in mechanism.network.joints}
        controls = mechanism.control_values(self.x)
        for row, element in enumerate(mechanism.network.elements, 6 * len(mechanism.graph.cuts)):
            rates = mechanism.pair_error(element, self.x, controls)[1] if element.is_pair else {}
            for (name, index), rate in rates.items():
                joint, at = joints[name], placements.joints[name]
                n = at.columns[1]
                turns = joint.units[index] == "rad"
                twist = (*n, 0.0, 0.0, 0.0) if turns else (*cross(at.translation, n), *n)
                components = [component * rate * multipliers[row] for component in twist]
                yield joint, stack_elements(components, self.x.shape[1])


def _wrenches_in_ground(
    mechanism: Mechanism, x: FloatArray, wrenches: Sequence[Wrench]
) -> dict[str, FloatArray]:
    """Return moments about the origin of the ground [N.m] and forces [N] on bodies, shape (6, n) each."""
    poses = mechanism.poses(x)
    loads: dict[str, FloatArray] = {}
    for wrench in wrenches:
        arm = cross(poses[wrench.body].point(wrench.point), wrench.force)
        components = (*add(arm, wrench.moment), *wrench.force)
        loads[wrench.body] = loads.get(wrench.body, 0.0) + stack_elements(components, x.shape[1])
    return loads


def _at_frame(wrench: FloatArray, at: Transform) -> FloatArray:
    """Return force and moment of a wrench in the ground along the axes of a frame about its origin."""
    moment, force = tuple(wrench[:3]), tuple(wrench[3:])
    moment = subtract(moment, cross(at.translation, force))
    components = [dot(axis, vector) for vector in (force, moment) for axis in at.columns]
    return stack_elements(components, wrench.shape[1])
