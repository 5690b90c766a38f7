"""The moving parts of an arm as bodies: what is fixed to a joint's frame is one body with it.

Where the masses of an arm are, and how they move.

The energies of an arm.

A force and a moment on the tool of an arm.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.elementwise import (
    ZERO,
    Element,
    Vector,
    add,
    cross,
    dot,
    minus,
    plus,
    scale,
    subtract,
    times,
)
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import iter_frames, jacobian, joint_rates
from urmpipe_models.math3d import Transform

Symmetric: TypeAlias = tuple[Vector, Vector, Vector]
"""The rows of a symmetric matrix."""


_Placed: TypeAlias = tuple[Transform, Inertial]
"""A mass, and the frame that carries it in the moving frame of a joint."""


@dataclass(frozen=True, slots=True)
class Link:
    """A moving joint and the body that it carries.

    Attributes:
        joint: The joint, one that moves; its origin counts from the moving frame of the link before it.
        coordinate: Index of the coordinate that it follows.
        multiplier: Change of its value per unit of the coordinate: 1, of a mimic its multiplier.
        mass: m of all that is fixed to its moving frame, in [kg].
        moment: h, the sum of mass times centre in that frame, in [kg.m].
        inertia: I about the origin of that frame, in [kg.m2].
    """

    joint: Joint
    coordinate: int
    multiplier: float
    mass: Element
    moment: Vector
    inertia: Symmetric


@dataclass(frozen=True, slots=True)
class Links:
    """The moving parts of an arm.

    Attributes:
        links: From the base outwards.
        tool: The tool centre point in the moving frame of the last link.
    """

    links: tuple[Link, ...]
    tool: Transform


def check_masses(chain: Chain) -> None:
    """Refuse an arm without masses.

    Raises:
        RobotError: Naming the key that is missing, or with what is wrong with the masses of its URDF.
    """
    if chain.mass_faults:
        raise RobotError(*chain.mass_faults)
    if all(isinstance(one.mass, float) and one.mass == 0.0 for one in chain.inertials):
        raise RobotError(
            f"robot {chain.name}: key inertials: found none, allowed: the masses of the arm"
            " (in a URDF <inertial>)"
        )


def chain_to_links(chain: Chain) -> Links:
    """Return the moving parts of an arm; masses before the first moving joint stand still and are left out.

    m = sum m_k, h = sum m_k c_k, I = sum I_k + m_k (c_k^2 1 - c_k c_k^T), with centres and inertias in the
    moving frame of the joint (parallel axis theorem).

    Args:
        chain: The arm.

    Raises:
        RobotError: If it has no masses.
    """
    check_masses(chain)
    index = {name: k for k, name in enumerate(chain.coordinates)}
    carried: dict[str | None, list[Inertial]] = {}
    for one in chain.inertials:
        carried.setdefault(one.joint, []).append(one)
    moving: list[tuple[Joint, list[_Placed]]] = []
    frame = Transform()  # of what follows in the moving frame before it
    for joint in chain.joints:
        frame = frame @ joint.origin
        if joint.kind != "fixed":
            moving.append((replace(joint, origin=frame), []))
            frame = Transform()
        if moving:  # what stands before the first of them does not move
            moving[-1][1].extend((frame, one) for one in carried.get(joint.name, ()))
    links = (
        Link(joint, index[joint.name], 1.0, *_body(bodies))
        if joint.mimic is None
        else Link(joint, index[joint.mimic.joint], joint.mimic.multiplier, *_body(bodies))
        for joint, bodies in moving
    )
    return Links(tuple(links), frame @ chain.tip @ chain.tool)


def _body(bodies: Sequence[_Placed]) -> tuple[Element, Vector, Symmetric]:
    """Return mass, moment and inertia about the origin of bodies, each in a frame of its own."""
    mass: Element = 0.0
    moment, inertia = ZERO, (ZERO, ZERO, ZERO)
    for frame, one in bodies:
        centre = frame.point(one.centre)
        mass, moment = plus(mass, one.mass), add(moment, scale(one.mass, centre))
        inertia = sum_symmetric(
            inertia, rotate_inertia(frame, one.matrix), point_mass_inertia(one.mass, centre)
        )
    return mass, moment, inertia


def rotate_inertia(frame: Transform, matrix: Symmetric) -> Symmetric:
    """Return R A R^T: a symmetric matrix, given in a frame, seen from where the frame stands."""
    turn = Transform(frame.rotation)
    rows = Transform((turn @ Transform(matrix) @ Transform(turn.columns)).rotation).rotation
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = rows
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


def point_mass_inertia(mass: Element, centre: Vector) -> Symmetric:
    """Return m (c^2 1 - c c^T) in [kg.m2], the inertia about the origin of a mass in [kg] at c in [m]."""
    x, y, z = centre
    mx, my, mz = scale(mass, centre)
    xx, yy, zz = times(mx, x), times(my, y), times(mz, z)
    xy, xz, yz = minus(0.0, times(mx, y)), minus(0.0, times(mx, z)), minus(0.0, times(my, z))
    return (plus(yy, zz), xy, xz), (xy, plus(xx, zz), yz), (xz, yz, plus(xx, yy))


def sum_symmetric(*matrices: Symmetric) -> Symmetric:
    """Return the sum of symmetric matrices."""
    total: Symmetric = (ZERO, ZERO, ZERO)
    for one in matrices:
        total = add(total[0], one[0]), add(total[1], one[1]), add(total[2], one[2])
    return total


@dataclass(frozen=True, slots=True)
class MassMotion:
    """A mass of an arm and its motion.

    Attributes:
        inertial: The mass.
        centre: r_s, its centre in the world, in [m].
        velocity: v_s of the centre in the world, in [m/s].
        omega: Angular velocity in the axes of the frame that carries it, in [rad/s].
    """

    inertial: Inertial
    centre: Vector
    velocity: Vector
    omega: Vector


def mass_motions(chain: Chain, q: Sequence[Element], qd: Sequence[Element]) -> list[MassMotion]:
    """Return the motion of every mass of an arm, in the order of `chain.inertials`.

    r_s = T_i r_i (eq. 8). v_s = D_i r_i with D_i = D_(i-1) A_i + T_(i-1) Q_i A_i q_i' (eq. 9-11) is here the
    velocity of the frame's origin and omega x R r_i, frame by frame. omega_i = B_i^T omega_(i-1) + z q_i'
    (eq. 12), for joints of either kind, z being the axis in the joint's own frame.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 8-12.
    """
    check_masses(chain)
    moving = dict(
        zip((None, *(joint.name for joint in chain.joints)), _frame_motions(chain, q, qd), strict=True)
    )
    found = []
    for one in chain.inertials:
        frame, velocity, omega = moving[one.joint]
        lever = frame.rotate(one.centre)
        spin = cross(omega, lever)
        own = Transform(frame.columns).rotate(omega)
        found.append(MassMotion(one, add(frame.translation, lever), add(velocity, spin), own))
    return found


def centres_of_mass(chain: Chain, q: Sequence[Element]) -> list[Vector]:
    """Return the centres of the masses of an arm in the world [m], in the order of `chain.inertials`.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].

    Source: [Iso9283]_ eq. 8.
    """
    placed = dict(zip((None, *(joint.name for joint in chain.joints)), iter_frames(chain, q), strict=True))
    return [placed[one.joint].point(one.centre) for one in chain.inertials]


def _frame_motions(
    chain: Chain, q: Sequence[Element], qd: Sequence[Element]
) -> Iterator[tuple[Transform, Vector, Vector]]:
    """Yield pose, velocity of the origin and angular velocity in the world, of the base and every joint."""
    base, *moved = iter_frames(chain, q)
    before, velocity, omega = base.translation, ZERO, ZERO
    yield base, velocity, omega
    for frame, joint, rate in zip(moved, chain.joints, joint_rates(chain, qd), strict=True):
        velocity = add(velocity, cross(omega, subtract(frame.translation, before)))
        own = scale(rate, frame.rotate(joint.axis))
        if joint.kind == "prismatic":
            velocity = add(velocity, own)
        else:
            omega = add(omega, own)  # a fixed joint's rate is 0
        before = frame.translation
        yield frame, velocity, omega


def kinetic_energy(chain: Chain, q: Sequence[Element], qd: Sequence[Element]) -> Element:
    """Return T = 1/2 sum (m v_s^2 + omega . I omega) in [J].

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ section 3, from eq. 9 and 12.
    """
    energy: Element = 0.0
    for one in mass_motions(chain, q, qd):
        spin = Transform(one.inertial.matrix).rotate(one.omega)
        twice = plus(times(one.inertial.mass, dot(one.velocity, one.velocity)), dot(one.omega, spin))
        energy = plus(energy, times(0.5, twice))
    return energy


def potential_energy(chain: Chain, q: Sequence[Element]) -> Element:
    """Return U = -sum m g . r_s in [J], 0 with all masses at the world's origin.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ section 3, from eq. 8.
    """
    check_masses(chain)
    energy: Element = 0.0
    for one, centre in zip(chain.inertials, centres_of_mass(chain, q), strict=True):
        energy = minus(energy, times(one.mass, dot(chain.gravity, centre)))
    return energy


class Wrench(NamedTuple):
    """What acts on the tool centre point from outside, along the axes of the world.

    Eq. 13 of [Iso9283]_ counts the opposite: what the tool does to its surroundings.

    Attributes:
        force: In [N].
        moment: In [N.m].
    """

    force: Vector = ZERO
    moment: Vector = ZERO


def wrench_power(chain: Chain, q: Sequence[Element], qd: Sequence[Element], wrench: Wrench) -> Element:
    """Return (J^T F) . q', the power of what acts on the tool, in [W].

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        wrench: What acts on the tool centre point from outside.
    """
    power: Element = 0.0
    for column, rate in zip(jacobian(chain, q), qd, strict=True):
        for entry, given in zip(column, (*wrench.force, *wrench.moment), strict=True):
            power = plus(power, times(times(entry, rate), given))
    return power
