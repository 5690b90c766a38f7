"""Idle spins: a part that only two global joints hold spins about the line through their centres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.elementwise import Element, Vector, cross, dot, scale, subtract
from urmpipe_models.networks.closure import gap_of
from urmpipe_models.networks.graph import parts_without
from urmpipe_models.networks.joint_motion import joint_frame
from urmpipe_models.networks.mechanism import Configuration, Mechanism
from urmpipe_models.networks.parts import Joint
from urmpipe_models.networks.rotations import SMALL, rotation_of
from urmpipe_models.orientation import quaternions
from urmpipe_models.transform import Transform

COAXIAL = 1e-7
"""Share of the mechanism's length by which points may be beside an axis that they are on: see `RANK`."""


@dataclass(frozen=True, slots=True)
class IdleSpin:
    """A part that spins and moves nothing else.

    Attributes:
        joints: The two global joints.
        bodies: Its bodies, in the order of the network.
    """

    joints: tuple[Joint, Joint]
    bodies: tuple[str, ...]


def idle_spins(mechanism: Mechanism) -> tuple[IdleSpin, ...]:
    """Return the idle spins of a network; a part within which another spins is none itself."""
    network = mechanism.network
    free = [one for one in network.joints if one.kind == "global" and not any(one.drives)]
    found: list[IdleSpin] = []
    for pair in combinations(free, 2):
        for part in parts_without(network, [one.name for one in pair]):
            hangs = all(len(part & set(one.bodies)) == 1 for one in pair)
            if hangs and network.ground not in part:
                found.append(IdleSpin(pair, tuple(name for name in network.body_names if name in part)))
    return tuple(one for one in found if not any(set(other.bodies) < set(one.bodies) for other in found))


def spinning_parts(mechanism: Mechanism, x: FloatArray) -> tuple[str, ...]:
    """Return the names of the bodies that spin together, joined, of each idle spin at a configuration.

    Bodies of a part spin apart where the joint between them lets them turn about the line.

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
    """
    frames = mechanism.poses([float(value) for value in x])
    joints, found = mechanism.network.joints, []
    for spin in idle_spins(mechanism):
        ends = [_part_frame(joint, spin, frames).translation for joint in spin.joints]
        loose = (one for one in joints if one.name not in mechanism.network.coupled_joints)
        apart = [one.name for one in loose if _turns_about(one, frames, ends, mechanism.length)]
        pieces = parts_without(mechanism.network, [one.name for one in spin.joints] + apart)
        inner = (piece for piece in pieces if piece <= set(spin.bodies))
        found += [" + ".join(name for name in spin.bodies if name in piece) for piece in inner]
    return tuple(found)


def _turns_about(joint: Joint, frames: dict[str, Transform], ends: Sequence[Vector], length: float) -> bool:
    """Return whether a joint turns freely about the line through two points [m].

    Args:
        joint: The joint.
        frames: The bodies in the ground.
        ends: The points.
        length: That of the mechanism in [m].
    """
    if joint.kind not in ("revolute", "cylindrical") or joint.drives[0] is not None:
        return False
    at = frames[joint.bodies[0]] @ joint.frames[0]
    off = [np.linalg.norm(cross(subtract(end, at.translation), at.columns[1])) for end in ends]
    return bool(max(off) <= COAXIAL * length)


def unspun(mechanism: Mechanism, spins: Sequence[IdleSpin], x: FloatArray, start: FloatArray) -> FloatArray:
    """Return the same configurations with their idle spins as they are at the start.

    The part turns about the line u until the twist of its first joint about u is that of the start; both
    joints take that up: T' = T exp(phi [u]x), u in the frame a of the part.

    Args:
        mechanism: The network.
        spins: Its idle spins.
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        start: Those of the start, shape (variables,), likewise.

    Returns:
        The variables in [m], [rad] and as controls are given, shape (variables, n).
    """
    x = np.array(x)
    for spin in spins:
        frames = mechanism.poses(x)
        centres = [_part_frame(joint, spin, frames) for joint in spin.joints]
        apart = subtract(centres[1].translation, centres[0].translation)
        length = np.sqrt(sum(np.square(entry) for entry in apart))
        line: Vector = scale(1.0 / np.maximum(length, 1e-300), apart)
        turn: FloatArray | None = None
        for joint, frame in zip(spin.joints, centres, strict=True):
            first = mechanism.places[joint.name, 0]
            inverted = joint.bodies[0] in spin.bodies
            own = _turned(joint, x[first : first + 3], inverted)
            along = Transform(frame.columns).rotate(line)
            if turn is None:
                before = _turned(joint, start[first : first + 3, np.newaxis], inverted)
                turn = _twist(before, along, x.shape[1]) - _twist(own, along, x.shape[1])
            held = own @ rotation_of(scale(turn, along))
            x[first : first + 3] = gap_of(held.inverse() if inverted else held, x.shape[1])[3:]
    return x


def spin_angles(mechanism: Mechanism, spins: Sequence[IdleSpin], x: Configuration) -> list[Element]:
    """Return the angles of idle spins in [rad], which `unspun` keeps: twists of first joints about the lines.

    phi = 2 atan2(q . u sin(a / 2) / a, cos(a / 2)), a = |q|: q is the rotation vector of the joint, u the
    line.

    Args:
        mechanism: The network.
        spins: Its idle spins.
        x: The variables, one element each.
    """
    angles: list[Element] = []
    frames = mechanism.poses(x)
    for spin in spins:
        first, second = (_part_frame(joint, spin, frames) for joint in spin.joints)
        joint, distance = spin.joints[0], subtract(second.translation, first.translation)
        line = scale(1.0 / np.maximum(np.sqrt(dot(distance, distance)), 1e-300), distance)
        place = mechanism.places[joint.name, 0]
        q: Vector = (x[place], x[place + 1], x[place + 2])
        square = dot(q, q)
        angle = np.sqrt(np.where(square < SMALL, 1.0, square))
        sine = np.where(square < SMALL, 0.5 - square / 48.0, np.sin(0.5 * angle) / angle)
        cosine = np.where(square < SMALL, 1.0 - square / 8.0, np.cos(0.5 * angle))
        along = dot(q, Transform(first.columns).rotate(line))
        sign = -1.0 if joint.bodies[0] in spin.bodies else 1.0
        angles.append(2.0 * np.arctan2(sign * sine * along, cosine))
    return angles


def _part_frame(joint: Joint, spin: IdleSpin, frames: dict[str, Transform]) -> Transform:
    """Return the frame a of the part at a joint, in the ground."""
    side = 0 if joint.bodies[0] in spin.bodies else 1
    return frames[joint.bodies[side]] @ joint.frames[side]


def _turned(joint: Joint, q: FloatArray, inverted: bool) -> Transform:
    """Return how the part is turned at a joint against what it hangs on: T, or its inverse."""
    frame = joint_frame(joint, list(q))
    return frame.inverse() if inverted else frame


def _twist(turned: Transform, axis: Vector, n: int) -> FloatArray:
    """Return by which angles rotations turn about axes, 2 atan2(v . axis, w), in [rad], shape (n,)."""
    rows = np.empty((9, n))
    for k, entry in enumerate(entry for row in turned.rotation for entry in row):
        rows[k] = entry
    quat = quaternions(rows.T, "matrix")
    along = sum(quat[:, k] * axis[k] for k in range(3))
    return np.asarray(2.0 * np.arctan2(along, quat[:, 3]))
