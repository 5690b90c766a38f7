"""The energies of an arm and the power of its tool, as polynomials."""

from __future__ import annotations

from typing import NamedTuple

from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.inertial import Inertial
from urmpipe_models.lagrange.angles import rounded
from urmpipe_models.lagrange.bodies import Body, Triple, apply, bodies, matrix, point, velocity
from urmpipe_models.lagrange.variables import Polynomial, Variables, total
from urmpipe_models.transform import Transform


class Energies(NamedTuple):
    """What Lagrange's equations are made of.

    Attributes:
        kinetic: T in [J].
        potential: U in [J].
        power: Of the wrench on the tool centre point, in [W].
    """

    kinetic: Polynomial
    potential: Polynomial
    power: Polynomial


def energies(chain: Chain, variables: Variables) -> Energies:
    """Return T = sum 1/2 m v^2 + 1/2 omega^T I omega, U = -sum m g^T r, and f^T v + m^T omega of the tool.

    All in the axes of the base, towards which gravity and wrench are turned.

    Args:
        chain: The arm, with masses.
        variables: Those of the arm.

    Source: [Iso9283]_ eq. 8-12.
    """
    world = rounded(Transform(chain.base.columns))  # from the world's axes to the base's
    found = {one.name: one for one in bodies(chain, variables)}
    carried = [(found[one.joint], one) for one in chain.inertials if one.joint is not None]
    kinetic = total((_kinetic(body, one, variables) for body, one in carried), variables)
    gravity = [variables.constant(-x) for x in world.rotate(chain.gravity)]
    potential = total(
        (
            variables.constant(one.mass) * _dot(gravity, point(body.frame, one.centre, variables))
            for body, one in carried
        ),
        variables,
    )
    last = found[chain.joints[-1].name]
    tool = point(last.frame, (chain.tip @ chain.tool).translation, variables)
    turn = matrix(world, variables)
    force, moment = (
        apply(turn, [*part, variables.constant(0.0)])[:3]
        for part in (variables.wrench[:3], variables.wrench[3:])
    )
    return Energies(kinetic, potential, _dot(force, velocity(tool, variables)) + _dot(moment, last.base_spin))


def _kinetic(body: Body, one: Inertial, variables: Variables) -> Polynomial:
    """Return 1/2 m v^2 + 1/2 omega^T I omega of a mass, in [J]."""
    speed = velocity(point(body.frame, one.centre, variables), variables)
    ixx, iyy, izz, ixy, ixz, iyz = one.inertia
    rows = ((ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz))
    turned = [_dot([variables.constant(x) for x in row], body.spin) for row in rows]
    half = variables.constant(0.5)
    return half * variables.constant(one.mass) * _dot(speed, speed) + half * _dot(body.spin, turned)


def _dot(a: Triple, b: Triple) -> Polynomial:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
