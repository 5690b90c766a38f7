"""Velocities and accelerations of the points of a chain, elementwise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.elementwise import ZERO, Element, Vector, add, cross, scale
from urmpipe_models.kinematics.frames import joint_rates, joint_values, moved
from urmpipe_models.transform import Transform


@dataclass(frozen=True, slots=True)
class Motion:
    """Pose and its first two derivatives of one point, in the world.

    Attributes:
        pose: Position in [m] and rotation.
        velocity: In [m/s].
        acceleration: In [m/s2].
        omega: Angular velocity in [rad/s].
        alpha: Angular acceleration in [rad/s2].
    """

    pose: Transform
    velocity: Vector
    acceleration: Vector
    omega: Vector
    alpha: Vector


def motions(
    chain: Chain, q: Sequence[Element], qd: Sequence[Element], qdd: Sequence[Element]
) -> tuple[Motion, ...]:
    """Return pose, velocity and acceleration of the points p1..pn, from q, q' and q''.

    Outward recursion over the joints, with d the way from one frame's origin to the next:
    v' = v + omega x d, a' = a + alpha x d + omega x (omega x d); a revolute joint adds z q' to omega and
    z q'' + omega x z q' to alpha, a prismatic one z q' to v and z q'' + 2 omega x z q' to a.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].

    Source: [UrmArm2021]_ section 3, Figure 10 b and c (v7 of q', a7 of q'' and q'^2).
    """
    return tuple(each_motion(chain, q, qd, qdd))


def each_motion(
    chain: Chain, q: Sequence[Element], qd: Sequence[Element], qdd: Sequence[Element]
) -> Iterator[Motion]:
    """Yield the motions of p1..pn; who wants one of them need not keep the arrays of all.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].
    """
    values, rates, second = joint_values(chain, q), joint_rates(chain, qd), joint_rates(chain, qdd)
    body = Motion(chain.base, ZERO, ZERO, ZERO, ZERO)
    for k, joint in enumerate(chain.joints):
        at_joint = _carried(body, joint.origin)
        if k > 0:
            end = Transform(body.pose.rotation, at_joint.pose.translation)
            yield replace(at_joint, pose=end)
        body = _driven(at_joint, joint, values[k], rates[k], second[k])
    yield _carried(body, chain.tip @ chain.tool)


def _carried(state: Motion, origin: Transform) -> Motion:
    """Return the motion of a frame fixed to a moving body."""
    d = state.pose.rotate(origin.translation)
    spin = cross(state.omega, d)
    turned = Transform(state.pose.rotation) @ Transform(origin.rotation)
    return Motion(
        Transform(turned.rotation, add(state.pose.translation, d)),
        add(state.velocity, spin),
        add(state.acceleration, add(cross(state.alpha, d), cross(state.omega, spin))),
        state.omega,
        state.alpha,
    )


def _driven(state: Motion, joint: Joint, value: Element, rate: Element, second: Element) -> Motion:
    """Return the motion of the joint's moving frame from that of its fixed one; a fixed joint slides by 0."""
    pose = moved(state.pose, joint, value)
    axis = state.pose.rotate(joint.axis)
    own, own_second = scale(rate, axis), scale(second, axis)
    coupling = cross(state.omega, own)
    if joint.kind == "revolute":
        omega = add(state.omega, own)
        alpha = add(state.alpha, add(own_second, coupling))
        return Motion(pose, state.velocity, state.acceleration, omega, alpha)
    slide = scale(value, axis)
    spin = cross(state.omega, slide)
    acceleration = add(cross(state.alpha, slide), cross(state.omega, spin))
    acceleration = add(acceleration, add(scale(2.0, coupling), own_second))
    return Motion(
        pose,
        add(state.velocity, add(spin, own)),
        add(state.acceleration, acceleration),
        state.omega,
        state.alpha,
    )
