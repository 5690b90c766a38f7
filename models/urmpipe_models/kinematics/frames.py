"""The frames of a chain, elementwise: the value of every joint, and what it moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.elementwise import Element, Vector, add, plus, scale, times
from urmpipe_models.transform import Transform, turned_vector


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
    """Return the tool centre point in the world [m], without its orientation.

    Inward recursion: the point in a link's frame becomes the same point in the frame before,
    p' = o + R Rot(axis, q) p, from the tool to the base. It turns a vector where `frames` turns three.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
    """
    point = chain.tip.point(chain.tool.translation)
    for joint, value in zip(reversed(chain.joints), reversed(joint_values(chain, q)), strict=True):
        if joint.kind == "revolute":
            point = turned_vector(point, joint.axis, value)
        elif joint.kind == "prismatic":
            point = add(point, scale(value, joint.axis))
        point = joint.origin.point(point)
    return chain.base.point(point)


def _value(joint: Joint, of: dict[str, Element]) -> Element:
    """Return the value of a joint from those of the coordinates."""
    if joint.kind == "fixed":
        return 0.0
    if joint.mimic is None:
        return of[joint.name]
    return plus(times(joint.mimic.multiplier, of[joint.mimic.joint]), joint.mimic.offset)
