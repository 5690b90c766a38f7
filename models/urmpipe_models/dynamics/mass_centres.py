"""Where the masses of an arm are, and how they move."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.inertial import Inertial
from urmpipe_models.dynamics.links import check_masses
from urmpipe_models.elementwise import ZERO, Element, Vector, add, cross, scale, subtract
from urmpipe_models.kinematics.frames import frames, joint_rates
from urmpipe_models.transform import Transform


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


def mass_centres(chain: Chain, q: Sequence[Element]) -> list[Vector]:
    """Return the centres of the masses of an arm in the world [m], in the order of `chain.inertials`.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].

    Source: [Iso9283]_ eq. 8.
    """
    placed = dict(zip((None, *(joint.name for joint in chain.joints)), frames(chain, q), strict=True))
    return [placed[one.joint].point(one.centre) for one in chain.inertials]


def _frame_motions(
    chain: Chain, q: Sequence[Element], qd: Sequence[Element]
) -> Iterator[tuple[Transform, Vector, Vector]]:
    """Yield pose, velocity of the origin and angular velocity in the world, of the base and every joint."""
    base, *moved = frames(chain, q)
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
