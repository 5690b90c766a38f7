"""The torques of a motion, term by term."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from urmpipe_models.chains.chain import Chain
from urmpipe_models.dynamics.inverse import posed_links
from urmpipe_models.dynamics.screws import Field, Force, MovingLink, inertial_force, moving_links
from urmpipe_models.dynamics.wrench import Wrench
from urmpipe_models.elementwise import Element, Vector, add, cross, plus, scale


class TorqueTerms(NamedTuple):
    """What makes the torques of the joints, one element per coordinate each, in [N.m] or [N].

    Attributes:
        inertia: Of the accelerations q''.
        centrifugal: Of the squares of the rates q'.
        coriolis: Of the products of two rates.
        gravity: Of the weights.
        tool: Of what acts on the tool.
    """

    inertia: list[Element]
    centrifugal: list[Element]
    coriolis: list[Element]
    gravity: list[Element]
    tool: list[Element]


def torque_terms(
    chain: Chain,
    q: Sequence[Element],
    qd: Sequence[Element],
    qdd: Sequence[Element],
    wrench: Wrench | None = None,
) -> TorqueTerms:
    """Return the terms of the equations of motion, whose sum is `inverse_dynamics`.

    Each is a field of accelerations G r + b of what a joint m carries (see `screws`): inertia
    sum_j q_j'' W_j; centrifugal sum_j q_j'^2 W_j W_j; Coriolis 2 sum_(j < k) q_j' q_k' W_j W_k, all over the
    joints up to m; gravity -g. Two joints of one coordinate count as centrifugal: it is q'^2 that both have.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].
        wrench: What acts on the tool centre point from outside.

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 13: D_1, D_2, D_(1+k), E and J^T F, the last with the sign of a force from outside.
    """
    links, place = moving_links(posed_links(chain, q))
    inertia, centrifugal, coriolis = Field(), Field(), Field()
    rates = [Field() for _ in chain.coordinates]
    weight = Field(offset=scale(-1.0, chain.gravity))
    forces: list[tuple[Force, ...]] = []
    for link in links:
        own, c = link.field(qd[link.coordinate]), link.coordinate
        inertia += link.field(qdd[c])
        centrifugal += own.after(own) + rates[c].after(own).scaled(2.0)
        for k, other in enumerate(rates):
            if k != c:
                coriolis += other.after(own).scaled(2.0)
        rates[c] += own
        fields = (inertia, centrifugal, coriolis, weight)
        forces.append(tuple(inertial_force(link.body, field) for field in fields))
    tool = [Force()] * len(links)
    if wrench is not None:
        tool[-1] = _against(wrench, place)
    terms = [*zip(*forces, strict=True), tool]
    return TorqueTerms(*(_torques(links, each, len(chain.coordinates)) for each in terms))


def _torques(links: Sequence[MovingLink], forces: Sequence[Force], count: int) -> list[Element]:
    """Return what each coordinate gives where every link needs a force."""
    torques: list[Element] = [0.0] * count
    beyond = Force()
    for link, force in zip(reversed(links), reversed(forces), strict=True):
        beyond += force
        torques[link.coordinate] = plus(torques[link.coordinate], link.torque(beyond))
    return torques


def _against(wrench: Wrench, place: Vector) -> Force:
    """Return what the last link needs against what acts on the tool at its place."""
    moment = add(wrench.moment, cross(place, wrench.force))
    return Force(scale(-1.0, wrench.force), scale(-1.0, moment))
