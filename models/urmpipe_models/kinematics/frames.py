"""The frames of a chain, elementwise: the value of every joint, and what it moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.elementwise import Element, Vector, add, plus, scale, times
from urmpipe_models.transform import Transform, turned_vectors


def joint_values(chain: Chain, q: Sequence[Element]) -> list[Element]:
    """Return the value of every joint of the chain, mimics included, fixed ones as 0 (rad or m)."""
    of = dict(zip(chain.coordinates, q, strict=True))
    return [_value(joint, of) for joint in chain.joints]


def joint_rates(chain: Chain, rates: Sequence[Element]) -> list[Element]:
    """Return the derivative of every joint's value: as `joint_values`, but a mimic's offset drops out."""
    of = dict(zip(chain.coordinates, rates, strict=True))
    return [
        times(joint.mimic.multiplier, of[joint.mimic.joint]) if joint.mimic else of.get(joint.name, 0.0)
        for joint in chain.joints
    ]


def frames(chain: Chain, q: Sequence[Element]) -> Iterator[Transform]:
    """Yield the base and the moving frame of every joint, in the world: what the links hang on.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
    """
    frame = chain.base
    yield frame
    for joint, value in zip(chain.joints, joint_values(chain, q), strict=True):
        frame = moved(frame @ joint.origin, joint, value)
        yield frame


def moved(at_joint: Transform, joint: Joint, value: Element) -> Transform:
    """Return the joint's moving frame from its fixed one and its value in [rad] or [m]."""
    if joint.kind == "revolute":
        return at_joint.turned(joint.axis, value)
    if joint.kind == "prismatic":
        return Transform(at_joint.rotation, at_joint.point(scale(value, joint.axis)))
    return at_joint


def tip_position(chain: Chain, q: Sequence[Element]) -> Vector:
    """Return the tool centre point in the world [m], without its orientation: that of `tip_pose`.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
    """
    return from_tip(chain, q, chain.tip.point(chain.tool.translation))[0]


def from_tip(chain: Chain, q: Sequence[Element], point: Vector, *directions: Vector) -> list[Vector]:
    """Return a point [m] and directions that are given in the frame of the last joint, in the world.

    Inward recursion: what is known in a link's frame becomes the same in the frame before,
    p' = o + R Rot(axis, q) p and v' = R Rot(axis, q) v, from the tool to the base. It turns one vector for
    each of them where `frames` turns three.
    """
    vectors = [point, *directions]
    for joint, value in zip(reversed(chain.joints), reversed(joint_values(chain, q)), strict=True):
        if joint.kind == "revolute":
            vectors = turned_vectors(vectors, joint.axis, value)
        elif joint.kind == "prismatic":
            vectors[0] = add(vectors[0], scale(value, joint.axis))
        vectors = [joint.origin.point(vectors[0]), *map(joint.origin.rotate, vectors[1:])]
    return [chain.base.point(vectors[0]), *map(chain.base.rotate, vectors[1:])]


def _value(joint: Joint, of: dict[str, Element]) -> Element:
    """Return the value of a joint from those of the coordinates."""
    if joint.kind == "fixed":
        return 0.0
    if joint.mimic is None:
        return of[joint.name]
    return plus(times(joint.mimic.multiplier, of[joint.mimic.joint]), joint.mimic.offset)
