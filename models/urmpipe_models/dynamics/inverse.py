"""Inverse dynamics: the torques that a motion needs, by the recursion of Newton and Euler."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from urmpipe_models.chains.chain import Chain
from urmpipe_models.dynamics.links import Link, Links, links_of
from urmpipe_models.dynamics.wrench import Wrench
from urmpipe_models.elementwise import ZERO, Element, Vector, add, cross, dot, plus, scale, subtract, times
from urmpipe_models.kinematics.frames import joint_values, moved
from urmpipe_models.transform import Transform


class PosedLinks(NamedTuple):
    """The moving parts of an arm in a pose.

    Attributes:
        chain: The arm.
        arm: Its moving parts.
        frames: The moving frame of each link in that of the link before it, the first one's in the base.
    """

    chain: Chain
    arm: Links
    frames: Sequence[Transform]


def inverse_dynamics(
    chain: Chain,
    q: Sequence[Element],
    qd: Sequence[Element],
    qdd: Sequence[Element],
    wrench: Wrench | None = None,
) -> list[Element]:
    """Return the torques that the joints must give for a motion.

    Outward, in the frame of each link: omega, alpha and a as in `kinematics.motion`, a of the base being -g.
    Inward: f = m a + alpha x h + omega x (omega x h), n = I alpha + omega x I omega + h x a, with what the
    next link needs; a joint that turns gives z . n, one that slides z . f. A mimic's counts with its
    multiplier towards the joint that it follows.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].
        wrench: What acts on the tool centre point from outside.

    Returns:
        One element per coordinate, in [N.m] of a joint that turns, in [N] of one that slides.

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 13, by the algorithm of [Luh1980]_.
    """
    return needed_torques(posed_links(chain, q), qd, qdd, wrench)


def needed_torques(
    posed: PosedLinks, qd: Sequence[Element], qdd: Sequence[Element], wrench: Wrench | None = None
) -> list[Element]:
    """Return `inverse_dynamics` of an arm in a pose."""
    chain, arm, frames = posed
    forces = _link_forces(posed, qd, qdd)
    if wrench is not None:
        forces[-1] = _less_tool(posed, forces[-1], wrench)
    torques: list[Element] = [0.0] * len(chain.coordinates)
    force, moment = ZERO, ZERO
    for link, frame, (own_force, own_moment) in zip(
        reversed(arm.links), reversed(frames), reversed(forces), strict=True
    ):
        force, moment = add(force, own_force), add(moment, own_moment)
        along = dot(link.joint.axis, moment if link.joint.kind == "revolute" else force)
        torques[link.coordinate] = plus(torques[link.coordinate], times(link.multiplier, along))
        if link is not arm.links[0]:  # nothing is wanted of what the base holds
            force = frame.rotate(force)
            moment = add(frame.rotate(moment), cross(frame.translation, force))
    return torques


def posed_links(chain: Chain, q: Sequence[Element], arm: Links | None = None) -> PosedLinks:
    """Return the moving parts of an arm in a pose.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        arm: Its moving parts, where they are known.

    Raises:
        RobotError: If the arm has no masses.
    """
    arm = arm or links_of(chain)
    values = dict(zip((joint.name for joint in chain.joints), joint_values(chain, q), strict=True))
    frames = [moved(link.joint.origin, link.joint, values[link.joint.name]) for link in arm.links]
    return PosedLinks(chain, arm, frames)


def _link_forces(
    posed: PosedLinks, qd: Sequence[Element], qdd: Sequence[Element]
) -> list[tuple[Vector, Vector]]:
    """Return the force on each link and its moment about the origin of the link's frame."""
    chain, arm, frames = posed
    omega, alpha = ZERO, ZERO
    a = Transform(chain.base.columns).rotate(scale(-1.0, chain.gravity))
    found = []
    for link, frame in zip(arm.links, frames, strict=True):
        back = Transform(frame.columns)
        a = add(a, _carried(omega, alpha, frame.translation))
        omega, alpha, a = back.rotate(omega), back.rotate(alpha), back.rotate(a)
        rate = scale(times(link.multiplier, qd[link.coordinate]), link.joint.axis)
        second = scale(times(link.multiplier, qdd[link.coordinate]), link.joint.axis)
        if link.joint.kind == "revolute":
            alpha = add(alpha, add(second, cross(omega, rate)))
            omega = add(omega, rate)
        else:
            a = add(a, add(second, scale(2.0, cross(omega, rate))))
        found.append(_needed(link, omega, alpha, a))
    return found


def _carried(omega: Vector, alpha: Vector, d: Vector) -> Vector:
    """Return alpha x d + omega x (omega x d)."""
    return add(cross(alpha, d), cross(omega, cross(omega, d)))


def _needed(link: Link, omega: Vector, alpha: Vector, a: Vector) -> tuple[Vector, Vector]:
    """Return the force and the moment about its origin that a link's motion needs."""
    inertia = Transform(link.inertia)
    force = add(scale(link.mass, a), _carried(omega, alpha, link.moment))
    spin = add(inertia.rotate(alpha), cross(omega, inertia.rotate(omega)))
    return force, add(spin, cross(link.moment, a))


def _less_tool(posed: PosedLinks, needed: tuple[Vector, Vector], wrench: Wrench) -> tuple[Vector, Vector]:
    """Return what the last link still needs where a wrench acts on the tool."""
    chain, arm, frames = posed
    force, moment = wrench
    for frame in (chain.base, *frames):
        back = Transform(frame.columns)
        force, moment = back.rotate(force), back.rotate(moment)
    moment = add(moment, cross(arm.tool.translation, force))
    return subtract(needed[0], force), subtract(needed[1], moment)
