"""Joints and bodies of an arm in one frame: the origin of its first link, the axes of the world.

A joint's rate q' moves all that it carries by the field v(r) = q' (z x r + v); a body answers to any field
a(r) = G r + b with forces that its mass, its moment h and its second moments S = sum m r r^T give:

    sum m a = G h + m b        sum m r x a = sum over k of e_k x (G S + b h^T) e_k
"""

from __future__ import annotations

from dataclasses import dataclass

from urmpipe_models.dynamics.inverse import PosedLinks
from urmpipe_models.dynamics.links import Symmetric, summed, turned
from urmpipe_models.elementwise import ZERO, Element, Vector, add, cross, dot, minus, plus, scale, times
from urmpipe_models.transform import Transform


@dataclass(frozen=True, slots=True)
class Field:
    """A field of velocity or acceleration of a rigid body: G r + b.

    Attributes:
        gradient: The rows of G, in [1/s] or [1/s2].
        offset: b, in [m/s] or [m/s2].
    """

    gradient: tuple[Vector, Vector, Vector] = (ZERO, ZERO, ZERO)
    offset: Vector = ZERO

    def __add__(self, other: Field) -> Field:
        """Return the sum of two fields."""
        rows = zip(self.gradient, other.gradient, strict=True)
        x, y, z = (add(*pair) for pair in rows)
        return Field((x, y, z), add(self.offset, other.offset))

    def scaled(self, factor: Element) -> Field:
        """Return the field times a factor."""
        x, y, z = (scale(factor, row) for row in self.gradient)
        return Field((x, y, z), scale(factor, self.offset))

    def after(self, other: Field) -> Field:
        """Return G (G' r + b'): how this motion turns the velocities of another."""
        turn = Transform(self.gradient)
        return Field((turn @ Transform(other.gradient)).rotation, turn.rotate(other.offset))


@dataclass(frozen=True, slots=True)
class Body:
    """Masses, about the common origin in the axes of the world.

    Attributes:
        mass: m in [kg].
        moment: h = sum m r in [kg.m].
        second: S = sum m r r^T in [kg.m2].
    """

    mass: Element = 0.0
    moment: Vector = ZERO
    second: Symmetric = (ZERO, ZERO, ZERO)

    def __add__(self, other: Body) -> Body:
        """Return both bodies as one."""
        return Body(
            plus(self.mass, other.mass), add(self.moment, other.moment), summed(self.second, other.second)
        )


@dataclass(frozen=True, slots=True)
class Force:
    """A force in [N] and its moment about the common origin in [N.m], along the axes of the world."""

    force: Vector = ZERO
    moment: Vector = ZERO

    def __add__(self, other: Force) -> Force:
        """Return the sum of two forces."""
        return Force(add(self.force, other.force), add(self.moment, other.moment))


@dataclass(frozen=True, slots=True)
class MovingLink:
    """A joint and what it carries.

    Attributes:
        coordinate: Index of the coordinate that the joint follows.
        turns: Whether it turns; else it slides.
        axis: z of a joint that turns, 0 of one that slides, times its multiplier [-].
        slide: v: what the velocity at the common origin is per unit of the coordinate, in [m] or [-].
        body: What it carries.
    """

    coordinate: int
    turns: bool
    axis: Vector
    slide: Vector
    body: Body

    def field(self, rate: Element) -> Field:
        """Return the velocities of all that the joint carries, of a rate of the coordinate."""
        x, y, z = scale(rate, self.axis)
        skew = ((0.0, minus(0.0, z), y), (z, 0.0, minus(0.0, x)), (minus(0.0, y), x, 0.0))
        return Field(skew, scale(rate, self.slide))

    def torque(self, force: Force) -> Element:
        """Return what a force on all that the joint carries is for its coordinate, in [N.m] or [N]."""
        return plus(dot(self.axis, force.moment), dot(self.slide, force.force))


def moving_links(posed: PosedLinks) -> tuple[list[MovingLink], Vector]:
    """Return the moving joints and bodies of an arm from the base outwards, and where its tool is [m]."""
    chain, arm, (first, *others) = posed
    found, pose = [], Transform(chain.base.rotation)
    for link, frame in zip(arm.links, (Transform(first.rotation), *others), strict=True):
        pose = pose @ frame
        along = scale(link.multiplier, pose.rotate(link.joint.axis))
        turns = link.joint.kind == "revolute"
        axis, slide = (along, cross(pose.translation, along)) if turns else (ZERO, along)
        body = _placed(pose, link.mass, link.moment, _second_moments(link.inertia))
        found.append(MovingLink(link.coordinate, turns, axis, slide, body))
    return found, pose.point(arm.tool.translation)


def inertial_force(body: Body, field: Field) -> Force:
    """Return the force and moment that give a body accelerations G r + b in [m/s2].

    See the formulas of this module.

    Args:
        body: The body.
        field: G in [1/s2] and b in [m/s2].
    """
    b, (hx, hy, hz) = field.offset, body.moment
    turn = Transform(field.gradient)
    rows = (turn @ Transform(body.second)).rotation
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = (
        add(row, (times(b[k], hx), times(b[k], hy), times(b[k], hz))) for k, row in enumerate(rows)
    )
    force = add(turn.rotate(body.moment), scale(body.mass, b))
    return Force(force, (minus(zy, yz), minus(xz, zx), minus(yx, xy)))


def _second_moments(inertia: Symmetric) -> Symmetric:
    """Return S = tr(I) / 2 1 - I of an inertia about the same point, in [kg.m2]."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    half = scale(0.5, (minus(plus(yy, zz), xx), minus(plus(xx, zz), yy), minus(plus(xx, yy), zz)))
    xy, xz, yz = minus(0.0, xy), minus(0.0, xz), minus(0.0, yz)
    return (half[0], xy, xz), (xy, half[1], yz), (xz, yz, half[2])


def _placed(pose: Transform, mass: Element, moment: Vector, second: Symmetric) -> Body:
    """Return a body that is given in a frame: S' = R S R^T + R h p^T + p (R h)^T + m p p^T."""
    p, own = pose.translation, pose.rotate(moment)
    moment = add(own, scale(mass, p))  # R h + m p
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = turned(pose, second)

    def shifted(value: Element, i: int, k: int) -> Element:
        """Return an entry of S': (R h)_i p_k + p_i (R h + m p)_k are added."""
        return plus(value, plus(times(own[i], p[k]), times(p[i], moment[k])))

    xy, xz, yz = shifted(xy, 0, 1), shifted(xz, 0, 2), shifted(yz, 1, 2)
    return Body(
        mass, moment, ((shifted(xx, 0, 0), xy, xz), (xy, shifted(yy, 1, 1), yz), (xz, yz, shifted(zz, 2, 2)))
    )
