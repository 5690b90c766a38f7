"""How the joints turn what they carry: joints with parallel axes turn it by one angle, the sum of theirs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.elementwise import Vector, dot
from urmpipe_models.transform import Transform, rotation_about

ROUNDING = 1e-15
"""Entries of constant rotations that differ by this from 0 or 1 are meant as 0 and 1."""

PARALLEL = 1e-12
"""Axes whose directions differ by this are parallel: of a torque it is less than its rounding."""

Angle = tuple[float, ...]
"""A sum of joint values: a factor for each coordinate."""


class Turn(NamedTuple):
    """A rotation Rot(axis, angle) inner, with the same axis since its joints are parallel.

    Attributes:
        axis: Unit vector in the frame where the parallel joints begin [-].
        angle: The factors of the coordinates in the angle.
        inner: A constant rotation.
    """

    axis: Vector
    angle: Angle
    inner: Transform = Transform()

    def __matmul__(self, rotation: Transform) -> Turn:
        """Return the turn that a constant rotation follows."""
        return self._replace(inner=rounded(self.inner @ Transform(rotation.rotation)))


class Step(NamedTuple):
    """A joint on the way from the base to the tip.

    Attributes:
        joint: The joint.
        before: The turn of the body before it.
        at: The same with the joint's frame at q = 0.
        begins: Whether its axis is not parallel to that of the turn: a new turn begins in its frame.
        after: The turn of the body that it moves.
        value: The factors of the coordinates in its value.
        offset: The constant in its value, in [rad] or [m].
    """

    joint: Joint
    before: Turn
    at: Turn
    begins: bool
    after: Turn
    value: Angle
    offset: float


def steps(chain: Chain) -> Iterator[Step]:
    """Yield the joints of an arm from the base to the tip, with the turns before and after each."""
    turn = Turn((0.0, 0.0, 1.0), (0.0,) * len(chain.coordinates))
    for joint in chain.joints:
        value, offset = _value(chain, joint)
        before, at = turn, turn @ joint.origin
        turn, begins = at, False
        if joint.kind == "revolute":
            sign = _sense(at, joint)
            begins = sign == 0
            if begins:
                turn = Turn(joint.axis, value, rounded(rotation_about(joint.axis, offset)))
            else:
                angle = tuple(_snapped(a + sign * b) for a, b in zip(at.angle, value, strict=True))
                turn = at._replace(angle=angle) @ rotation_about(joint.axis, offset)
        yield Step(joint, before, at, begins, turn, value, offset)


def rounded(rotation: Transform) -> Transform:
    """Return a constant rotation whose entries are exactly 0 or 1 where they are nearly so."""
    x, y, z = (tuple(map(_snapped, row)) for row in rotation.rotation)
    return Transform((x, y, z))  # type: ignore[arg-type]


def _snapped(value: float) -> float:
    """Return the whole number next to a value where it is nearly that."""
    return float(round(value)) if abs(value - round(value)) < ROUNDING else value


def _sense(turn: Turn, joint: Joint) -> int:
    """Return 1 or -1 for a joint that turns about the axis of a turn, one way or the other; else 0."""
    cosine = dot(turn.inner.rotate(joint.axis), turn.axis)
    across = max(abs(a - cosine * b) for a, b in zip(turn.inner.rotate(joint.axis), turn.axis, strict=True))
    return 0 if across > PARALLEL else round(cosine)


def _value(chain: Chain, joint: Joint) -> tuple[Angle, float]:
    """Return a joint's value: the factor of each coordinate, and a constant in [rad] or [m]."""
    name, factor, offset = joint.name, 1.0, 0.0
    if joint.mimic is not None:
        name, factor, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
    if joint.kind == "fixed":
        factor = 0.0
    return tuple(factor if one == name else 0.0 for one in chain.coordinates), offset
