"""What a deviation may come from: causes of some size, and causes that are there or not."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint, Parameter
from urmpipe_models.elementwise import ZERO, FloatArray, Vector, cross, subtract
from urmpipe_models.kinematics.identification import BASE, Twist
from urmpipe_models.math3d import Transform
from urmpipe_pipeline.diagnosis.causes import Kind
from urmpipe_pipeline.runs.reading_errors import Edits

Axis: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class Group:
    """A cause of some size: one number, or three of base and tool.

    Attributes:
        kind: What it is.
        name: What it is of.
        unit: Of its numbers.
        columns: Their places among all numbers.
        joint: Index of its joint; None of another cause.
        segment: The point that ends its segment; None of another cause.
        axis: Along or about which it acts in the frame of segment, base or tool; None of another cause, and
            of three numbers.
        twists: What it changes in the arm, one a number; none of joints and time.
    """

    kind: Kind
    name: str
    unit: str
    columns: tuple[int, ...]
    joint: int | None = None
    segment: str | None = None
    axis: Axis | None = None
    twists: tuple[Twist, ...] = ()

    def is_of_frame(self, other: Group) -> bool:
        """Tell whether both are the same, or axes of the same frame."""
        return (self.kind, self.name) == (other.kind, other.name)


@dataclass(frozen=True)
class State:
    """An explanation: what is changed, and by how much.

    Attributes:
        values: All numbers of all groups, in the unit of each ([m], [rad], [s]); 0 if not taken, shape (p,).
        edits: The causes that are there.
    """

    values: FloatArray
    edits: Edits = ()

    def of(self, group: Group) -> FloatArray:
        """Return the numbers of a group, in its unit ([m], [rad], [s]), shape (k,)."""
        return self.values[list(group.columns)]


def zero(groups: Iterable[Group]) -> State:
    """Return the explanation that nothing differs."""
    return State(np.zeros(sum(len(group.columns) for group in groups)))


def numbered(groups: Iterable[Group]) -> tuple[Group, ...]:
    """Return groups with places for their numbers, one behind the other."""
    result: list[Group] = []
    place = 0
    for group in groups:
        count = len(group.columns)
        result.append(replace(group, columns=tuple(range(place, place + count))))
        place += count
    return tuple(result)


X, Y, Z = AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

_AXES = dict(zip("xyz", AXES, strict=True))

KNOWN_BY = ("URM", "DH", "6R")
"""How the sources of parameters begin that people know an arm by."""

NEGLIGIBLE = 1e-9  # [m] or [-]: rounding of a length or of a direction


def cause_groups(chain: Chain, names: Sequence[str], *, turned: bool, timed: bool) -> Iterator[Group]:
    """Yield what may differ of an arm and its log.

    Args:
        chain: The arm.
        names: What the log calls its joints.
        turned: Whether orientations are compared, too.
        timed: Whether the log has times.
    """
    yield from tool_groups(chain.tool, len(chain.joints) + 2, turned=turned)
    yield from base_groups(chain.base)
    units = ["m" if joint.kind == "prismatic" else "rad" for joint in chain.moving]
    yield from joint_groups(units, names, chain, timed=timed)
    places = range(1, len(chain.joints) + 2)
    segments = [numbers for place in places for numbers in _segment_groups(chain, place)]
    ranks = [("link_length", True), ("tilt", True), ("link_length", False), ("link_shift", False)]
    for rank in (*ranks, ("tilt", False)):
        yield from (group for group, in_data_sheet in segments if (group.kind, in_data_sheet) == rank)


def joint_groups(
    units: Sequence[str], names: Sequence[str], chain: Chain | None, *, timed: bool
) -> Iterator[Group]:
    """Yield what may differ of the clock and of each joint.

    Args:
        units: m or rad of each joint.
        names: What the log calls them.
        chain: The arm, which gravity pulls at; None of joints alone.
        timed: Whether the log has times.
    """
    if timed:
        yield from time_groups()
        yield Group("servo_lag", "all joints", "s", (0,))
    sag = "" if chain is None else "/(N m)" if has_masses(chain) else "/kg"
    kinds: list[tuple[Kind, str | None]] = [("joint_offset", None), ("joint_scale", "")]
    kinds += [("joint_lag", "s"), ("compliance", "s2"), ("backlash", None)] if timed else []
    for kind, shared in kinds:
        for j, (unit, name) in enumerate(zip(units, names, strict=True)):
            yield Group(kind, name, unit if shared is None else shared, (0,), j)
    for j, (unit, name) in enumerate(zip(units, names, strict=True) if sag else ()):
        yield Group("sag", name, "m/N" if unit == "m" and sag != "/kg" else f"{unit}{sag}", (0,), j)


def has_masses(chain: Chain) -> bool:
    """Return whether gravity pulls at an arm itself; else it is taken to pull at its tool centre point."""
    return any(inertial.mass != 0.0 for inertial in chain.inertials)


def base_groups(base: Transform) -> Iterator[Group]:
    """Yield the shifts and turns of a base along and about the axes of the world, through its origin."""
    at = Transform(translation=base.translation)
    yield from _frame_groups("base_shift", "base", BASE, at)
    yield from _frame_groups("base_rotation", "base", BASE, at)


def tool_groups(tool: Transform, place: int, *, turned: bool) -> Iterator[Group]:
    """Yield how a tool may differ in its own frame; its turn only where there are orientations."""
    yield from _frame_groups("tool_shift", "tool", place, tool)
    if turned:
        yield from _frame_groups("tool_rotation", "tool", place, tool)


def time_groups() -> Iterator[Group]:
    """Yield the offset of the clock of a log, and its drift."""
    yield Group("time_lag", "clock", "s", (0,))
    yield Group("clock_drift", "clock", "s/s", (0,))


def _frame_groups(kind: Kind, name: str, place: int, frame: Transform) -> Iterator[Group]:
    """Yield one number along or about each axis of a frame, then all three."""
    way: Literal["along", "about"] = "along" if kind.endswith("shift") else "about"
    unit = "m" if way == "along" else "rad"
    twists = tuple(Twist(place, way, axis, frame) for axis in AXES)
    for axis, twist in zip(AXES, twists, strict=True):
        yield Group(kind, name, unit, (0,), axis=axis, twists=(twist,))
    yield Group(kind, name, unit, (0, 1, 2), twists=twists)


def _segment_groups(chain: Chain, place: int) -> Iterator[tuple[Group, bool]]:
    """Yield the six numbers of the segment that a frame ends, each with whether the data sheet has it.

    A frame without a length or turn at either end of the arm, or after a fixed joint, is no segment.
    """
    frame, count = chain.frames[place], len(chain.joints)
    named = [p for p in chain.parameters if p.frame_index == place and p.source.startswith(KNOWN_BY)]
    at_an_end = place in (1, count + 1) or chain.joints[place - 2].kind == "fixed"
    if not named and frame == Transform() and at_an_end:
        return
    yield from ((_of_parameter(p), bool(p.value)) for p in named if not p.name.startswith("theta_"))
    ends = [*(joint.name for joint in chain.joints), "tip"]
    number = re.sub(r"\D", "", named[0].name) if named else ""
    name = f"segment {number}" if number else f"segment to {ends[place - 1]}"
    lengths, turns = ([p for p in named if p.kind == kind] for kind in ("along", "about"))
    # after the last length and before the last turn, x, y and z are those of all named parameters
    across = turns[-1].before if turns else Transform(translation=frame.translation)
    if lengths:
        missing, at = [axis for axis in "xyz" if axis not in {p.axis for p in lengths}], across
    else:
        length, at = np.linalg.norm(frame.translation), Transform()
        along = int(np.argmax(np.abs(frame.translation))) if length > NEGLIGIBLE else None
        missing = [axis for k, axis in enumerate("xyz") if k != along]
        if along is not None:
            direction = _axis(np.array(frame.translation) / length)
            twist = Twist(place, "along", direction, at)
            yield Group("link_length", name, "m", (0,), None, _point(place), direction, (twist,)), True
    for letter in missing:
        twist = Twist(place, "along", _AXES[letter], at)
        if not _is_zero_of_joint(chain, place, twist):
            named_so = f"{name} sideways {letter}"
            yield Group("link_shift", named_so, "m", (0,), None, _point(place), twist.axis, (twist,)), False
    yield from ((tilt, False) for tilt in _tilts(chain, place, name, {p.axis for p in turns}, across))


def _of_parameter(parameter: Parameter) -> Group:
    """Return a named length or angle."""
    place, axis = parameter.frame_index, _AXES[parameter.axis]
    twist = Twist(place, parameter.kind, axis, parameter.before)
    if parameter.kind == "along":
        return Group("link_length", parameter.name, "m", (0,), None, _point(place), axis, (twist,))
    return Group("tilt", parameter.name, "rad", (0,), None, _point(place), axis, (twist,))


def _tilts(chain: Chain, place: int, name: str, taken: set[str], across: Transform) -> Iterator[Group]:
    """Yield the turns of a frame that no named parameter has: of a joint those across its axis."""
    joint = chain.joints[place - 1] if place <= len(chain.joints) else None
    if taken or joint is None or joint.kind == "fixed" or joint.mimic is not None:
        at = across if taken else chain.frames[place]
        axes = {letter: axis for letter, axis in _AXES.items() if letter not in taken}
    else:
        name, at = joint.name, joint.origin
        axes = {_letter(axis, letter): axis for letter, axis in zip("uv", _across(joint.axis), strict=True)}
    for letter, axis in axes.items():
        twist = Twist(place, "about", axis, at)
        if not _is_zero_of_joint(chain, place, twist):
            yield Group("tilt", f"{name} about {letter}", "rad", (0,), None, _point(place), axis, (twist,))


def _is_zero_of_joint(chain: Chain, place: int, twist: Twist) -> bool:
    """Return whether a twist moves the arm as the zero of a joint at either end of its segment does."""
    frame = chain.frames[place]
    ends: list[tuple[Joint, Vector, Vector]] = []  # with a direction and a point of its axis
    if place > 1:
        ends.append((chain.joints[place - 2], chain.joints[place - 2].axis, ZERO))
    if place <= len(chain.joints):
        joint = chain.joints[place - 1]
        ends.append((joint, frame.rotate(joint.axis), frame.translation))
    direction = twist.frame.rotate(twist.axis)
    for joint, axis, point in ends:
        moved = {"revolute": "about", "prismatic": "along"}.get(joint.kind)
        between = subtract(twist.frame.translation, point) if moved == "about" else ZERO
        off = (*cross(direction, axis), *cross(direction, between))
        if joint.mimic is None and moved == twist.kind and max(map(abs, off)) < NEGLIGIBLE:
            return True
    return False


def _point(place: int) -> str | None:
    """Return the point at the origin of a frame; None for the first joint, whose point is the base."""
    return f"p{place - 1}" if place > 1 else None


def _across(axis: Axis) -> tuple[Axis, Axis]:
    """Return two directions across an axis and across each other; those of the frame where it has them."""
    most = int(np.argmax(np.abs(axis)))
    first = np.cross(axis, AXES[(most + 2) % 3])
    first /= np.linalg.norm(first)
    return _axis(first), _axis(np.cross(axis, first))


def _axis(vector: np.ndarray) -> Axis:
    """Return a unit vector as a tuple, without signed zeros."""
    x, y, z = (float(part) + 0.0 for part in vector)
    return x, y, z


def _letter(axis: Axis, otherwise: str) -> str:
    """Return the letter of an axis of the frame, else another."""
    near = (letter for letter, other in _AXES.items() if abs(np.dot(axis, other)) > 1.0 - NEGLIGIBLE)
    return next(near, otherwise)
