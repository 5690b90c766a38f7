"""What each kind of joint does: its matrix T, and the twists of its variables. Elementwise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

from urmpipe_models.elementwise import ZERO, Element, Vector, add, cross, scale
from urmpipe_models.networks.parts import Joint, frame_of
from urmpipe_models.networks.rotations import rotation_of, turning_of
from urmpipe_models.transform import Transform, rotation_y, translation

Screws: TypeAlias = list[tuple[Vector, Vector]]
"""Angular velocity [rad] and velocity [m] of the point at the ground's origin, a unit of each value."""


AXES = ("m", "n", "m x n")
"""What the directions of a joint's frame are called."""

TURNING, SLIDING = ("revolute", "cylindrical", "helical"), ("prismatic", "cylindrical")
"""The kinds that turn about n, and those that slide along it, whatever else they do."""


def joint_frame(joint: Joint, values: Sequence[Element]) -> Transform:
    """Return T, the frame a of the second body seen from that of the first.

    Args:
        joint: The joint.
        values: Its variables in [rad] and [m]; of a user joint the nine entries of m, n [-] and a in [m].

    Source: [KinematicSystems]_ section 3.2.2, with its errata.
    """
    if joint.kind == "user":
        return frame_of(_three(values, 0), _three(values, 3), _three(values, 6))
    if joint.kind == "global":
        return rotation_of(_three(values, 0))
    if joint.kind == "prismatic":
        return translation(0.0, values[0], 0.0)
    turned = rotation_y(values[0])
    slid = {"revolute": 0.0, "helical": joint.pitch * values[0]}.get(joint.kind, values[-1])
    return Transform(turned.rotation, (0.0, slid, 0.0))


def joint_screws(joint: Joint, values: Sequence[Element], at: Transform) -> Screws:
    """Return the twists of the second body against the first in the ground, one a value.

    Of theta: (n, p x n); of s: (0, n); of a helical joint: (n, p x n + pitch n); of the rotation vector:
    the rotation as each entry changes. Of a user joint: the rotation and shift as each entry of m, n and a
    changes; their sum over all entries is T' T^-1.

    Args:
        joint: The joint.
        values: As in `joint_frame`.
        at: The frame a of the first body in the ground.
    """
    n, p = at.columns[1], at.translation
    turning, sliding = (n, cross(p, n)), (ZERO, n)
    if joint.kind == "revolute":
        return [turning]
    if joint.kind == "prismatic":
        return [sliding]
    if joint.kind == "cylindrical":
        return [turning, sliding]
    if joint.kind == "helical":
        return [(n, add(turning[1], scale(joint.pitch, n)))]
    if joint.kind == "global":
        axes = [at.rotate(axis) for axis in turning_of(_three(values, 0))]
        return [(axis, cross(p, axis)) for axis in axes]
    return _user_screws(values, at)


def forbidden(
    joint: Joint, values: Sequence[Element], at: Transform
) -> Iterator[tuple[str, str, tuple[Vector, Vector]]]:
    """Yield what a joint does not let its bodies do: in words, in which unit, and as a twist in the ground.

    Turns about and shifts along the axes m, n and m x n of its frame that none of its variables makes, and
    what its driven variables would do.

    Args:
        joint: The joint.
        values: As in `joint_frame`.
        at: The frame a of the first body in the ground.
    """
    origin = (at @ joint_frame(joint, values)).translation
    for k, name in enumerate(AXES):
        axis = at.columns[k]
        if not (joint.kind == "global" or (k == 1 and joint.kind in TURNING)):
            yield f"rotation about {name}", "rad", (axis, cross(origin, axis))
        if not (k == 1 and joint.kind in SLIDING):
            yield f"translation along {name}", "m", (ZERO, axis)
    screws = joint_screws(joint, values, at)
    for drive, unit, screw in zip(joint.drives, joint.units, screws, strict=False):
        if drive is not None:
            yield "drive", unit, screw


def _user_screws(values: Sequence[Element], at: Transform) -> Screws:
    """Return the twists of the nine entries of a user joint.

    w = (m x m' + n x n' + k x k') / 2 with k = m x n, whose rate is m' x n + m x n'.
    """
    m, n, a = (_three(values, 3 * i) for i in range(3))
    k = cross(m, n)
    screws: Screws = []
    for axis in _AXES:
        screws.append(_about(add(cross(m, axis), cross(k, cross(axis, n))), a, at))
    for axis in _AXES:
        screws.append(_about(add(cross(n, axis), cross(k, cross(m, axis))), a, at))
    return [*screws, *((ZERO, at.rotate(axis)) for axis in _AXES)]


def _about(doubled: Vector, a: Vector, at: Transform) -> tuple[Vector, Vector]:
    """Return the twist of a rotation about the point a of a frame: (w, a x w) in the ground."""
    w = at.rotate(scale(0.5, doubled))
    return w, cross(at.point(a), w)


_AXES: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _three(values: Sequence[Element], first: int) -> Vector:
    return values[first], values[first + 1], values[first + 2]
