"""The moving parts of an arm as bodies: what is fixed to a joint's frame is one body with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.chains.inertial import Inertial
from urmpipe_models.elementwise import ZERO, Element, Vector, add, minus, plus, scale, times
from urmpipe_models.errors import RobotError
from urmpipe_models.transform import Transform

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


def links_of(chain: Chain) -> Links:
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
        inertia = summed(inertia, turned(frame, one.matrix), about_origin(one.mass, centre))
    return mass, moment, inertia


def turned(frame: Transform, matrix: Symmetric) -> Symmetric:
    """Return R A R^T: a symmetric matrix, given in a frame, seen from where the frame stands."""
    turn = Transform(frame.rotation)
    rows = Transform((turn @ Transform(matrix) @ Transform(turn.columns)).rotation).rotation
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = rows
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


def about_origin(mass: Element, centre: Vector) -> Symmetric:
    """Return m (c^2 1 - c c^T) in [kg.m2], the inertia about the origin of a mass in [kg] at c in [m]."""
    x, y, z = centre
    mx, my, mz = scale(mass, centre)
    xx, yy, zz = times(mx, x), times(my, y), times(mz, z)
    xy, xz, yz = minus(0.0, times(mx, y)), minus(0.0, times(mx, z)), minus(0.0, times(my, z))
    return (plus(yy, zz), xy, xz), (xy, plus(xx, zz), yz), (xz, yz, plus(xx, yy))


def summed(*matrices: Symmetric) -> Symmetric:
    """Return the sum of symmetric matrices."""
    total: Symmetric = (ZERO, ZERO, ZERO)
    for one in matrices:
        total = add(total[0], one[0]), add(total[1], one[1]), add(total[2], one[2])
    return total
