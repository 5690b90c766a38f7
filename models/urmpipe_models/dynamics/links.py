"""Links of an arm as rigid bodies, the motion of its masses, their energies, and the wrench on the tool.

1. `chain_to_links`: all masses fixed to a joint's moving frame are one body. About the origin of that frame
   m = sum m_k, h = sum m_k c_k, I = sum I_k + m_k (c_k^2 1 - c_k c_k^T).
2. `centres_of_mass`, `mass_motions`: position and velocity of each mass in the world ([Iso9283]_ eq. 8-12).
3. `kinetic_energy`, `potential_energy`: T = 1/2 sum (m v_s^2 + omega . I omega), U = -sum m g . r_s.
4. `wrench_power`: (J^T F) . q' of a force and a moment on the tool centre point.
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

Symmetric: TypeAlias = tuple[Vector, Vector, Vector]  # rows of a symmetric matrix


@dataclass(frozen=True, slots=True)
class Link:
    """A moving joint and the body that it carries.

    Attributes:
        joint: The joint; its origin is relative to the moving frame of the previous link.
        coordinate: Index of the coordinate that it follows.
        multiplier: Change of its value per unit of the coordinate: 1, for a mimic joint its multiplier.
        mass: m of all masses fixed to its moving frame, in [kg].
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
    """The moving links of an arm.

    Attributes:
        links: From the base outwards.
        tool: The tool centre point in the moving frame of the last link.
    """

    links: tuple[Link, ...]
    tool: Transform


def check_masses(chain: Chain) -> None:
    """Raise an error for an arm without masses.

    Raises:
        RobotError: With the missing key, or with the faults of the masses in its URDF.
    """
    if chain.mass_faults:
        raise RobotError(*chain.mass_faults)
    if all(isinstance(inertial.mass, float) and inertial.mass == 0.0 for inertial in chain.inertials):
        raise RobotError(
            f"robot {chain.name}: key inertials: found none, allowed: the masses of the arm"
            " (in a URDF <inertial>)"
        )


def chain_to_links(chain: Chain) -> Links:
    """Return the moving links of an arm; masses before the first moving joint do not move and are left out.

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
    for inertial in chain.inertials:
        carried.setdefault(inertial.joint, []).append(inertial)
    moving: list[tuple[Joint, list[tuple[Transform, Inertial]]]] = []  # each mass with its carrier's frame
    frame = Transform()  # of the next joint, in the moving frame of the previous moving joint
    for joint in chain.joints:
        frame = frame @ joint.origin
        if joint.kind != "fixed":
            moving.append((replace(joint, origin=frame), []))
            frame = Transform()
        if moving:
            moving[-1][1].extend((frame, inertial) for inertial in carried.get(joint.name, ()))
    links = (
        Link(joint, index[joint.name], 1.0, *_merge_bodies(bodies))
        if joint.mimic is None
        else Link(joint, index[joint.mimic.joint], joint.mimic.multiplier, *_merge_bodies(bodies))
        for joint, bodies in moving
    )
    return Links(tuple(links), frame @ chain.tip @ chain.tool)


def _merge_bodies(bodies: Sequence[tuple[Transform, Inertial]]) -> tuple[Element, Vector, Symmetric]:
    """Return mass, moment and inertia about the common origin of masses, each given in its frame."""
    mass: Element = 0.0
    moment, inertia = ZERO, (ZERO, ZERO, ZERO)
    for frame, inertial in bodies:
        centre = frame.point(inertial.centre)
        mass, moment = plus(mass, inertial.mass), add(moment, scale(inertial.mass, centre))
        offset = _point_mass_inertia(inertial.mass, centre)
        inertia = sum_symmetric(inertia, rotate_inertia(frame, inertial.matrix), offset)
    return mass, moment, inertia


def rotate_inertia(frame: Transform, matrix: Symmetric) -> Symmetric:
    """Return R A R^T: a symmetric matrix, given in a frame, in the axes in which the frame is given."""
    rotation = Transform(frame.rotation)
    rows = Transform((rotation @ Transform(matrix) @ Transform(rotation.columns)).rotation).rotation
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = rows
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


def _point_mass_inertia(mass: Element, centre: Vector) -> Symmetric:
    """Return m (c^2 1 - c c^T) in [kg.m2], the inertia about the origin of a mass in [kg] at c in [m]."""
    x, y, z = centre
    mx, my, mz = scale(mass, centre)
    xx, yy, zz = times(mx, x), times(my, y), times(mz, z)
    xy, xz, yz = minus(0.0, times(mx, y)), minus(0.0, times(mx, z)), minus(0.0, times(my, z))
    return (plus(yy, zz), xy, xz), (xy, plus(xx, zz), yz), (xz, yz, plus(xx, yy))


def sum_symmetric(*matrices: Symmetric) -> Symmetric:
    """Return the sum of symmetric matrices."""
    total: Symmetric = (ZERO, ZERO, ZERO)
    for matrix in matrices:
        total = add(total[0], matrix[0]), add(total[1], matrix[1]), add(total[2], matrix[2])
    return total


def centres_of_mass(chain: Chain, q: Sequence[Element]) -> list[Vector]:
    """Return the centres of the masses of an arm in the world [m], in the order of `chain.inertials`.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].

    Source: [Iso9283]_ eq. 8.
    """
    carriers = dict(zip((None, *(joint.name for joint in chain.joints)), iter_frames(chain, q), strict=True))
    return [carriers[inertial.joint].point(inertial.centre) for inertial in chain.inertials]


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
    names = (None, *(joint.name for joint in chain.joints))
    carriers = dict(zip(names, _frame_motions(chain, q, qd), strict=True))
    motions = []
    for inertial in chain.inertials:
        frame, velocity, omega = carriers[inertial.joint]
        lever = frame.rotate(inertial.centre)
        centre, rotated = add(frame.translation, lever), Transform(frame.columns).rotate(omega)
        motions.append(MassMotion(inertial, centre, add(velocity, cross(omega, lever)), rotated))
    return motions


def _frame_motions(
    chain: Chain, q: Sequence[Element], qd: Sequence[Element]
) -> Iterator[tuple[Transform, Vector, Vector]]:
    """Yield pose, velocity of the origin and angular velocity in the world, of the base and every joint."""
    base, *joint_frames = iter_frames(chain, q)
    previous, velocity, omega = base.translation, ZERO, ZERO
    yield base, velocity, omega
    for frame, joint, rate in zip(joint_frames, chain.joints, joint_rates(chain, qd), strict=True):
        velocity = add(velocity, cross(omega, subtract(frame.translation, previous)))
        relative = scale(rate, frame.rotate(joint.axis))
        if joint.kind == "prismatic":
            velocity = add(velocity, relative)
        else:
            omega = add(omega, relative)  # the rate of a fixed joint is 0
        previous = frame.translation
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
    for motion in mass_motions(chain, q, qd):
        spin = Transform(motion.inertial.matrix).rotate(motion.omega)
        twice = times(motion.inertial.mass, dot(motion.velocity, motion.velocity))
        energy = plus(energy, times(0.5, plus(twice, dot(motion.omega, spin))))
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
    for inertial, centre in zip(chain.inertials, centres_of_mass(chain, q), strict=True):
        energy = minus(energy, times(inertial.mass, dot(chain.gravity, centre)))
    return energy


class Wrench(NamedTuple):
    """External force and moment on the tool centre point, in world axes.

    Eq. 13 of [Iso9283]_ has the opposite sign: the wrench that the tool exerts on its surroundings.

    Attributes:
        force: In [N].
        moment: In [N.m].
    """

    force: Vector = ZERO
    moment: Vector = ZERO


def wrench_power(chain: Chain, q: Sequence[Element], qd: Sequence[Element], wrench: Wrench) -> Element:
    """Return (J^T F) . q', the power of an external wrench on the tool, in [W].

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        wrench: External wrench on the tool centre point.
    """
    power: Element = 0.0
    for column, rate in zip(jacobian(chain, q), qd, strict=True):
        for entry, load in zip(column, (*wrench.force, *wrench.moment), strict=True):
            power = plus(power, times(times(entry, rate), load))
    return power
