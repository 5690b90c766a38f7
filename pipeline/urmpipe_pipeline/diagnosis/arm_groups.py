"""The causes of some size that an arm may have: lengths and tilts, joints, base and tool, time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.parameters import Parameter
from urmpipe_models.kinematics.identification import BASE, Twist
from urmpipe_models.transform import Transform
from urmpipe_pipeline.diagnosis.hypotheses import Axis, Group
from urmpipe_pipeline.diagnosis.result import Kind

X, Y, Z = AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

_AXES = dict(zip("xyz", AXES, strict=True))

KNOWN_BY = ("URM", "DH", "6R")
"""How the sources of parameters begin that people know an arm by."""

NEGLIGIBLE = 1e-9
"""A segment shorter than this in [m] has no direction."""


def arm_groups(chain: Chain, names: Sequence[str], *, turned: bool) -> Iterator[Group]:
    """Yield what may differ of an arm, what has a name of its own first.

    Args:
        chain: The arm.
        names: What the log calls its joints.
        turned: Whether orientations are held against each other, too.
    """
    yield from _segments(chain)
    yield from joint_groups(["m" if one.kind == "prismatic" else "rad" for one in chain.moving], names)
    yield from base_groups(chain.base)
    yield from tool_groups(chain.tool, len(chain.joints) + 2, turned=turned)


def joint_groups(units: Sequence[str], names: Sequence[str]) -> Iterator[Group]:
    """Yield the offset, the scale and the compliance of each joint, by their units and names."""
    for j, (unit, name) in enumerate(zip(units, names, strict=True)):
        yield Group("joint_offset", name, unit, (0,), j)
        yield Group("joint_scale", name, "", (0,), j)
        yield Group("compliance", name, "s2", (0,), j)


def base_groups(base: Transform) -> Iterator[Group]:
    """Yield how a base may stand elsewhere: shifted and turned in the world, about its own place."""
    at = Transform(translation=base.translation)
    yield _frame_group("base_shift", "base", BASE, at)
    yield _frame_group("base_rotation", "base", BASE, at)


def tool_groups(tool: Transform, place: int, *, turned: bool) -> Iterator[Group]:
    """Yield how a tool may differ in its own frame; its turn only where orientations are told."""
    yield _frame_group("tool_shift", "tool", place, tool)
    if turned:
        yield _frame_group("tool_rotation", "tool", place, tool)


def _frame_group(kind: Kind, name: str, place: int, frame: Transform) -> Group:
    """Return three numbers of a frame, along or about its axes."""
    way: Literal["along", "about"] = "along" if kind.endswith("shift") else "about"
    twists = tuple(Twist(place, way, axis, frame) for axis in AXES)
    return Group(kind, name, "m" if way == "along" else "rad", (0, 1, 2), twists=twists)


def time_groups() -> Iterator[Group]:
    """Yield the offset of the clock of a log, and its drift."""
    yield Group("time_lag", "clock", "s", (0,))
    yield Group("clock_drift", "clock", "s/s", (0,))


def _segments(chain: Chain) -> Iterator[Group]:
    """Yield the lengths and tilts of an arm: the parameters it is known by, else those of its frames."""
    own = [one for one in chain.parameters if one.source.startswith(KNOWN_BY) and _of_link(one, chain)]
    yield from (_of_parameter(one) for one in own)
    places = range(1, len(chain.joints) + 2)
    if not any(one.kind == "along" for one in own):
        yield from (length for place in places for length in _length(chain, place))
    if not any(one.kind == "about" for one in own):
        yield from (tilt for place in places[:-1] for tilt in _tilts(chain, place))


def _of_link(one: Parameter, chain: Chain) -> bool:
    """Tell whether a parameter is one of a link: the angle of a row is the offset of its joint."""
    return 0 < one.frame_index <= len(chain.joints) + 1 and not one.name.startswith("theta_")


def _of_parameter(one: Parameter) -> Group:
    """Return a named length or angle."""
    twist = Twist(one.frame_index, one.kind, _AXES[one.axis], one.before)
    kind, unit = ("link_length", "m") if one.kind == "along" else ("tilt", "rad")
    return Group(kind, one.name, unit, (0,), None, _segment(one.frame_index), _AXES[one.axis], (twist,))  # type: ignore[arg-type]


def _length(chain: Chain, place: int) -> Iterator[Group]:
    """Yield the length of the segment that a frame ends, along it; nothing where it has none."""
    along = np.array(chain.frames[place].translation, dtype=float)
    length = float(np.linalg.norm(along))
    if length > NEGLIGIBLE:
        axis = _axis(along / length)
        twist = Twist(place, "along", axis, Transform())
        name = [*(joint.name for joint in chain.joints), "tip"][place - 1]
        yield Group("link_length", f"segment to {name}", "m", (0,), None, _segment(place), axis, (twist,))


def _tilts(chain: Chain, place: int) -> Iterator[Group]:
    """Yield the tilts of a joint about both directions across its axis."""
    joint = chain.joints[place - 1]
    if joint.kind == "fixed":
        return
    for letter, axis in zip("uv", _across(joint.axis), strict=True):
        called = f"{joint.name} about {_said(axis, letter)}"
        twist = Twist(place, "about", axis, joint.origin)
        yield Group("tilt", called, "rad", (0,), None, _segment(place), axis, (twist,))


def _segment(place: int) -> str | None:
    """Return the point that a frame stands in; none of the first joint, which stands in the base."""
    return f"p{place - 1}" if place > 1 else None


def _across(axis: Axis) -> tuple[Axis, Axis]:
    """Return two directions across an axis and across each other; those of the frame where it has them."""
    most = int(np.argmax(np.abs(axis)))
    first = np.cross(axis, AXES[(most + 2) % 3])
    first /= np.linalg.norm(first)
    return _axis(first), _axis(np.cross(axis, first))


def _axis(vector: np.ndarray) -> Axis:
    """Return a unit vector as a tuple, without signed zeros."""
    x, y, z = (float(one) + 0.0 for one in vector)
    return x, y, z


def _said(axis: Axis, otherwise: str) -> str:
    """Return the letter of an axis of the frame, else another."""
    return next((letter for letter, own in _AXES.items() if abs(np.dot(axis, own)) > 1 - 1e-9), otherwise)
