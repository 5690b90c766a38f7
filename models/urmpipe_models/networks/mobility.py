"""Mobility of an assembled network: how it moves, which constraints are redundant, which bodies spin idly.

1. Mobility = variables - rank of the scaled Jacobian J of the closure (`closure`), controls counted as
   variables. The rank is the number of singular values above RANK_TOLERANCE times the largest.
2. Where the rank falls only at this configuration, mobility by J is too large: `nearby_mobility` is that of
   assembled configurations a small distance away, along the null space of J. The configuration is special if
   it is less than the mobility here.
3. Redundant constraints: those whose release does not raise the mobility. A release adds a column to J;
   redundant are the constraints whose columns reach the left null space of J.
4. Formula of Kutzbach and Gruebler: 6 (bodies - 1) - sum of (6 - f) over joints with f freedoms - elements -
   values set by controls. Mobility = this figure + the number of redundant constraints.
5. Idle spins (passive rotations): a part that only two global joints hold spins about the line through their
   centres and moves nothing else. They count for the mobility but not as motion of a mechanism, and no drive
   prescribes them, so other chapters keep their angles as at the start (`reset_idle_spins`, `spin_angles`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from urmpipe_models.elementwise import (
    Element,
    FloatArray,
    IndexArray,
    Vector,
    cross,
    dot,
    scale,
    subtract,
)
from urmpipe_models.math3d import Transform, to_quaternions
from urmpipe_models.networks.closure import (
    evaluate_scaled_closure,
    iter_release_columns,
    pose_error,
    solve_closure,
    stack_elements,
)
from urmpipe_models.networks.joint_motion import SMALL_ANGLE_SQUARED, exp3, joint_frame
from urmpipe_models.networks.mechanism import Configuration, Mechanism, components_without
from urmpipe_models.networks.parts import Joint

NetworkKind = Literal["mechanism", "structure"]

# Singular values below this share of the largest count as 0: a configuration closes to about 1e-13, one at
# which the rank falls to the root of that.
RANK_TOLERANCE = 1e-7
PROBE_DISTANCE = 1e-2  # of configurations nearby, in lengths of the mechanism and [rad]
PROBE_COUNT = 8  # configurations nearby
MIN_PROBE_MOTION = 0.3  # share of PROBE_DISTANCE: of a structure that only seems to move each returns
TIE_TOLERANCE = 0.999  # redundant constraints that raise the rank by this share of the clearest are equal
COAXIAL_TOLERANCE = 1e-7  # distance of points from an axis, in lengths of the mechanism: see RANK_TOLERANCE


@dataclass(frozen=True, slots=True)
class RedundantConstraint:
    """A constraint that forbids what others forbid already.

    Attributes:
        joint: The joint or the element.
        constraint: Which of its constraints, such as "rotation about m".
    """

    joint: str
    constraint: str


@dataclass(frozen=True, slots=True)
class Mobility:
    """How much of an assembled network moves.

    Attributes:
        variables: Their number: controls that can be set, free variables of joints, six of each body that no
            joint ties to the ground.
        rank: Of the Jacobian.
        kutzbach: 6 (bodies - 1) - sum of (6 - f) - elements - values set by controls.
        redundant: Constraints whose release would free nothing; there are mobility - kutzbach of them.
        passive: Bodies that spin about the line through two global joints and move nothing else; those that
            spin together joined by " + ".
        nearby: The mobility at assembled configurations near to this one.
    """

    variables: int
    rank: int
    kutzbach: int
    redundant: tuple[RedundantConstraint, ...]
    passive: tuple[str, ...]
    nearby: int

    @property
    def mobility(self) -> int:
        """Variables less rank."""
        return self.variables - self.rank

    @property
    def special(self) -> bool:
        """Whether the rank falls here against assembled configurations nearby."""
        return self.nearby < self.mobility

    @property
    def kind(self) -> NetworkKind:
        """A mechanism if anything except idle spins moves, else a structure."""
        return "mechanism" if self.nearby > len(self.passive) else "structure"


def analyse_mobility(mechanism: Mechanism, x: FloatArray) -> Mobility:
    """Return how a network moves, controls included, at an assembly x, shape (variables,), in [m], [rad]."""
    variables = len(mechanism.variables)
    jacobian = evaluate_scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, :, 0]
    rank = _rank(jacobian)
    return Mobility(
        variables,
        rank,
        variables - mechanism.rows,
        tuple(_find_redundant(mechanism, x, jacobian, mechanism.rows - rank)),
        find_spinning_bodies(mechanism, x),
        nearby_mobility(mechanism, x, np.arange(variables)),
    )


def mobility_by_rank(mechanism: Mechanism, x: FloatArray, columns: IndexArray) -> int:
    """Return the number of some variables [-], shape (k,), less the rank of their Jacobian at x."""
    return len(columns) - _rank(evaluate_scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, columns, 0])


def nearby_mobility(mechanism: Mechanism, x: FloatArray, columns: IndexArray) -> int:
    """Return the mobility at assembled configurations near one; 0 if there are none.

    They are searched along the directions in which the Jacobian lets the network move.

    Args:
        mechanism: The network.
        x: The variables of an assembly, shape (variables,), in [m], [rad] and as controls are given.
        columns: The numbers of those that may change, shape (k,) [-].
    """
    null = _null_space(evaluate_scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, columns, 0])
    if not null.size:
        return 0
    steps = np.random.default_rng(0).normal(size=(null.shape[1], PROBE_COUNT))
    scales = mechanism.column_scales[columns, np.newaxis]
    starts = np.repeat(x[:, np.newaxis], PROBE_COUNT, axis=1)
    starts[columns] += scales * PROBE_DISTANCE * (null @ (steps / np.linalg.norm(steps, axis=0)))
    probes = solve_closure(mechanism, starts, columns)
    away = np.linalg.norm((probes.x[columns] - x[columns, np.newaxis]) / scales, axis=0)
    moved = np.flatnonzero((away > MIN_PROBE_MOTION * PROBE_DISTANCE) & (probes.gap < RANK_TOLERANCE))
    jacobians = evaluate_scaled_closure(mechanism, probes.x[:, moved]).jacobian[:, columns]
    return min((len(columns) - _rank(jacobian) for jacobian in jacobians.transpose(2, 0, 1)), default=0)


def find_blocked_controls(mechanism: Mechanism, x: FloatArray) -> tuple[str, ...]:
    """Return the controls that cannot be moved at an assembly, each with those before it fixed.

    The variables x have the shape (variables,), in [m], [rad] and as controls are given.
    """
    null = _null_space(evaluate_scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, :, 0])
    motions = null[mechanism.controls]
    blocked = []
    for k, place in enumerate(mechanism.controls):
        if _rank(motions[: k + 1], RANK_TOLERANCE) == _rank(motions[:k], RANK_TOLERANCE):
            blocked.append(mechanism.variables[place].owner)
    return tuple(blocked)


def _rank(jacobian: FloatArray, min_value: float = 0.0) -> int:
    """Return the rank of a scaled Jacobian; singular values up to `min_value` count as 0, too."""
    if not (jacobian.size and np.isfinite(jacobian).all()):
        return 0
    values = np.linalg.svd(jacobian, compute_uv=False)
    return int((values > max(RANK_TOLERANCE * values[0], min_value)).sum()) if values[0] > 0.0 else 0


def _null_space(jacobian: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the null space of a scaled Jacobian, shape (variables, mobility)."""
    if not len(jacobian):
        return np.eye(jacobian.shape[1])
    return np.asarray(np.linalg.svd(jacobian)[2][_rank(jacobian) :].T)


def _find_redundant(
    mechanism: Mechanism, x: FloatArray, jacobian: FloatArray, count: int
) -> Iterator[RedundantConstraint]:
    """Yield `count` redundant constraints: released one after the other, each raises the rank.

    Each time the one is taken that does so most clearly; of equal ones the last in the file.
    """
    if count <= 0:
        return
    left_null = np.linalg.svd(jacobian)[0][:, mechanism.rows - count :]
    constraints = list(iter_release_columns(mechanism, x))
    reach = np.array([column @ left_null for _, _, column in constraints])
    for _ in range(count):
        size = np.linalg.norm(reach, axis=1)
        best = int(np.flatnonzero(size >= TIE_TOLERANCE * size.max())[-1])
        yield RedundantConstraint(*constraints[best][:2])
        along = reach[best] / size[best]
        reach = reach - np.outer(reach @ along, along)


# ---------------------------------------------------------------------------------------- idle spins


@dataclass(frozen=True, slots=True)
class IdleSpin:
    """A part that spins and moves nothing else.

    Attributes:
        joints: The two global joints.
        bodies: Its bodies, in the order of the network.
    """

    joints: tuple[Joint, Joint]
    bodies: tuple[str, ...]


def find_idle_spins(mechanism: Mechanism) -> tuple[IdleSpin, ...]:
    """Return the idle spins of a network; without parts within which another spins."""
    network = mechanism.network
    free = [joint for joint in network.joints if joint.kind == "global" and not any(joint.drives)]
    spins: list[IdleSpin] = []
    for pair in combinations(free, 2):
        for part in components_without(network, [joint.name for joint in pair]):
            hangs = all(len(part & set(joint.bodies)) == 1 for joint in pair)
            if hangs and network.ground not in part:
                spins.append(IdleSpin(pair, tuple(name for name in network.body_names if name in part)))
    return tuple(spin for spin in spins if not any(set(other.bodies) < set(spin.bodies) for other in spins))


def find_spinning_bodies(mechanism: Mechanism, x: FloatArray) -> tuple[str, ...]:
    """Return the names of the bodies that spin together, joined, of each idle spin at a configuration.

    Bodies of a part spin separately where the joint between them lets them rotate about the line. The
    variables x have the shape (variables,), in [m], [rad] and as controls are given.
    """
    frames = mechanism.poses([float(value) for value in x])
    network, names = mechanism.network, []
    for spin in find_idle_spins(mechanism):
        ends = [_part_frame(joint, spin, frames).translation for joint in spin.joints]
        loose = [
            joint.name
            for joint in network.joints
            if joint.name not in network.coupled_joints
            and _turns_about(joint, frames, ends, mechanism.length)
        ]
        pieces = components_without(network, [*(joint.name for joint in spin.joints), *loose])
        inner = (piece for piece in pieces if piece <= set(spin.bodies))
        names += [" + ".join(name for name in spin.bodies if name in piece) for piece in inner]
    return tuple(names)


def _turns_about(joint: Joint, frames: dict[str, Transform], ends: Sequence[Vector], length: float) -> bool:
    """Return whether a joint turns freely about the line through two points [m]."""
    if joint.kind not in ("revolute", "cylindrical") or joint.drives[0] is not None:
        return False
    at = frames[joint.bodies[0]] @ joint.frames[0]
    offsets = [np.linalg.norm(cross(subtract(end, at.translation), at.columns[1])) for end in ends]
    return bool(max(offsets) <= COAXIAL_TOLERANCE * length)


def reset_idle_spins(
    mechanism: Mechanism, spins: Sequence[IdleSpin], x: FloatArray, start: FloatArray
) -> FloatArray:
    """Return configurations, shape (variables, n), in [m] and [rad], with their idle spins as at the start.

    The part rotates about the line u until the twist of its first joint about u is that of the start; both
    joints take that up: T' = T exp(phi [u]x), u in the frame a of the part.

    Args:
        mechanism: The network.
        spins: Its idle spins.
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        start: Those of the start, shape (variables,).
    """
    x = np.array(x)
    n = x.shape[1]
    for spin in spins:
        frames = mechanism.poses(x)
        centres = [_part_frame(joint, spin, frames) for joint in spin.joints]
        offset = subtract(centres[1].translation, centres[0].translation)
        length = np.sqrt(sum(np.square(entry) for entry in offset))
        line: Vector = scale(1.0 / np.maximum(length, 1e-300), offset)
        turn: FloatArray | None = None
        for joint, frame in zip(spin.joints, centres, strict=True):
            first = mechanism.variable_index[joint.name, 0]
            is_inverted = joint.bodies[0] in spin.bodies
            rotation = _part_rotation(joint, x[first : first + 3], is_inverted)
            along = Transform(frame.columns).rotate(line)
            if turn is None:
                before = _part_rotation(joint, start[first : first + 3, np.newaxis], is_inverted)
                turn = _twist_angle(before, along, n) - _twist_angle(rotation, along, n)
            target = rotation @ exp3(scale(turn, along))
            x[first : first + 3] = pose_error(target.inverse() if is_inverted else target, n)[3:]
    return x


def spin_angles(mechanism: Mechanism, spins: Sequence[IdleSpin], x: Configuration) -> list[Element]:
    """Return the angles of idle spins in [rad]: twists of first joints about the lines.

    phi = 2 atan2(q . u sin(a / 2) / a, cos(a / 2)), a = |q|: q is the rotation vector of the joint, u the
    line. `reset_idle_spins` keeps them. The variables x are one element each.
    """
    angles: list[Element] = []
    frames = mechanism.poses(x)
    for spin in spins:
        first, second = (_part_frame(joint, spin, frames) for joint in spin.joints)
        joint, distance = spin.joints[0], subtract(second.translation, first.translation)
        line = scale(1.0 / np.maximum(np.sqrt(dot(distance, distance)), 1e-300), distance)
        place = mechanism.variable_index[joint.name, 0]
        q: Vector = (x[place], x[place + 1], x[place + 2])
        square = dot(q, q)
        angle = np.sqrt(np.where(square < SMALL_ANGLE_SQUARED, 1.0, square))
        sine = np.where(square < SMALL_ANGLE_SQUARED, 0.5 - square / 48.0, np.sin(0.5 * angle) / angle)
        cosine = np.where(square < SMALL_ANGLE_SQUARED, 1.0 - square / 8.0, np.cos(0.5 * angle))
        along = dot(q, Transform(first.columns).rotate(line))
        sign = -1.0 if joint.bodies[0] in spin.bodies else 1.0
        angles.append(2.0 * np.arctan2(sign * sine * along, cosine))
    return angles


def _part_frame(joint: Joint, spin: IdleSpin, frames: dict[str, Transform]) -> Transform:
    """Return the frame a of the part at a joint, in the ground."""
    side = 0 if joint.bodies[0] in spin.bodies else 1
    return frames[joint.bodies[side]] @ joint.frames[side]


def _part_rotation(joint: Joint, q: FloatArray, is_inverted: bool) -> Transform:
    """Return the rotation of the part at a joint relative to the body that it hangs on: T, or its inverse."""
    frame = joint_frame(joint, list(q))
    return frame.inverse() if is_inverted else frame


def _twist_angle(rotation: Transform, axis: Vector, n: int) -> FloatArray:
    """Return the angles of rotations about axes, 2 atan2(v . axis, w), in [rad], shape (n,)."""
    rows = stack_elements([entry for row in rotation.rotation for entry in row], n)
    quat = to_quaternions(rows.T, "matrix")
    along = sum(quat[:, k] * axis[k] for k in range(3))
    return np.asarray(2.0 * np.arctan2(along, quat[:, 3]))
