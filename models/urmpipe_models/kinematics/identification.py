"""Identification Jacobian: effect of small changes of an arm's frames on its tool centre point.

A change is a twist between two joints, F' = A exp(v) A^-1 F: a translation along, or a rotation about, an
axis of a frame A there. Lengths and tilts of modules, Denavit-Hartenberg parameters, base and tool are such
twists.

    sensitivities   the columns (u, 0) of a translation along u, (u x (p - o), u) of a rotation  [Khalil2002]_
    apply_twists    the arm with twists of some size, and the same twists relative to its new frames
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import ZERO, Element, Vector, cross, scale, subtract
from urmpipe_models.kinematics.forward import iter_frames
from urmpipe_models.math3d import Transform, rotation_about, translation

BASE = 0  # place of the base; joint k (from 1) has place k, the tip n + 1, the tool n + 2


@dataclass(frozen=True, slots=True)
class Twist:
    """A possible change of a frame of a chain: F' = A exp(v) A^-1 F.

    Attributes:
        place: Index of the frame F: `BASE`, 1..n of the joints, n + 1 of the tip, n + 2 of the tool.
        kind: along (a translation in [m]) or about (a rotation in [rad]).
        axis: Unit vector in the frame A [-].
        frame: A, in the frame that F is given in.
    """

    place: int
    kind: Literal["along", "about"]
    axis: tuple[float, float, float]
    frame: Transform

    def motion(self, value: Element) -> Transform:
        """Return exp(v) of a value in [m] or [rad]."""
        if self.kind == "along":
            return translation(*scale(value, self.axis))
        return rotation_about(self.axis, value)


def sensitivities(chain: Chain, q: Sequence[Element], twists: Sequence[Twist]) -> list[tuple[Vector, Vector]]:
    """Return the columns of the identification Jacobian: the motion of the tool centre point by each twist.

    For a translation along u: (u, 0); for a rotation about u through o: (u x (p - o), u), all in the world.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        twists: The changes.

    Returns:
        One per twist: the translation in [m] and the rotation in [rad] per unit of it.

    Source: [Khalil2002]_ section 11.4.
    """
    *parents, last = [Transform(), *iter_frames(chain, q)]
    parents += [last, last @ chain.tip]
    return sensitivity_columns(parents, (parents[-1] @ chain.tool).translation, twists)


def sensitivity_columns(
    parents: Sequence[Transform], target: Vector, twists: Sequence[Twist]
) -> list[tuple[Vector, Vector]]:
    """Return the motion of a point by each twist, as `sensitivities` does for the tool centre point.

    Args:
        parents: For each place the frame in which its frame is given, in the world.
        target: The point in the world in [m], any elements.
        twists: The changes.
    """
    columns: list[tuple[Vector, Vector]] = []
    for twist in twists:
        parent = parents[twist.place]
        axis = parent.rotate(twist.frame.rotate(twist.axis))
        if twist.kind == "along":
            columns.append((axis, ZERO))
        else:
            columns.append((cross(axis, subtract(target, parent.point(twist.frame.translation))), axis))
    return columns


def apply_twists(chain: Chain, changes: Sequence[tuple[Twist, float]]) -> tuple[Chain, list[Twist]]:
    """Return a chain with some frames changed, and the twists relative to the new frames.

    Args:
        chain: The arm.
        changes: Twists, each with its value in [m] or [rad].

    Returns:
        The changed arm, and the same twists for its `sensitivities`.
    """
    (base, *origins, tip, tool), located = apply_twists_to_frames(chain.frames, changes)
    if not any(value for _, value in changes):
        return chain, located
    joints = tuple(replace(joint, origin=origin) for joint, origin in zip(chain.joints, origins, strict=True))
    return replace(chain, joints=joints, base=base, tip=tip, tool=tool), located


def apply_twists_to_frames(
    places: Sequence[Transform], changes: Sequence[tuple[Twist, float]]
) -> tuple[list[Transform], list[Twist]]:
    """Return frames after changes, and the twists relative to the new frames.

    Several changes of one frame are multiplied in their order; the first is the outermost.

    Args:
        places: The frame of each place, in the one before it.
        changes: Twists, each with its value in [m] or [rad].
    """
    motions: dict[int, Transform] = {}
    located = []
    for twist, value in changes:
        before = motions.get(twist.place)
        located.append(twist if before is None else replace(twist, frame=before @ twist.frame))
        if value:
            motion = twist.frame @ twist.motion(value) @ twist.frame.inverse()
            motions[twist.place] = motion if before is None else before @ motion
    return [motions[k] @ frame if k in motions else frame for k, frame in enumerate(places)], located
