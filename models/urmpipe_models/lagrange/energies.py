"""The energies of an arm and the power of its tool, as polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.inertial import Inertial
from urmpipe_models.elementwise import Vector
from urmpipe_models.lagrange.angles import rounded
from urmpipe_models.lagrange.bodies import Body, Triple, apply, bodies, column, matrix, shifted, velocity
from urmpipe_models.lagrange.variables import Polynomial, Variables, scalar_product, total
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
    found = {one.step.joint.name: one for one in bodies(chain, variables)}
    carried = [(found[one.joint], one) for one in chain.inertials if one.joint is not None]
    gravity = world.rotate(chain.gravity)
    kinetic = total((_kinetic(*pair, variables) for pair in carried), variables, of_masses=True)
    potential = total((_potential(*pair, gravity, variables) for pair in carried), variables, of_masses=True)
    tool = _point(found[chain.joints[-1].name], (chain.tip @ chain.tool).translation, variables)
    turn = matrix(world.rotation, variables)
    force, moment = (apply(turn, part, variables) for part in (variables.wrench[:3], variables.wrench[3:]))
    moved = [*velocity(tool, variables), *_turning([*found.values()], variables)]
    return Energies(kinetic, potential, scalar_product([*force, *moment], moved, variables))


def _kinetic(body: Body, one: Inertial, variables: Variables) -> Polynomial:
    """Return 1/2 m v^2 + 1/2 omega^T I omega of a mass, in [J]."""
    speed = velocity(_point(body, one.centre, variables), variables)
    turned = apply(matrix(one.matrix, variables), body.spin, variables)
    momenta = [*(variables.constant(one.mass) * x for x in speed), *turned]
    return variables.constant(0.5) * scalar_product(momenta, [*speed, *body.spin], variables)


def _potential(body: Body, one: Inertial, gravity: Vector, variables: Variables) -> Polynomial:
    """Return -m g^T r of a mass, in [J]."""
    weight = [variables.constant(-one.mass * x) for x in gravity]
    return scalar_product(weight, _point(body, one.centre, variables), variables)


def _point(body: Body, place: Vector, variables: Variables) -> Triple:
    """Return where a point in [m] of a body is, in the base [m]."""
    return shifted(body.place, body.rotation, column(place, variables), variables)


def _turning(found: Sequence[Body], variables: Variables) -> Triple:
    """Return the angular velocity of the last body, along the base: each joint's rate on its axis."""
    turning = [(rotation, step) for step, rotation, *_ in found if step.joint.kind == "revolute"]
    axes = [apply(rotation, column(step.joint.axis, variables), variables) for rotation, step in turning]
    rates = [variables.rate(step.value) for _, step in turning]
    return [scalar_product([axis[k] for axis in axes], rates, variables) for k in range(3)]
