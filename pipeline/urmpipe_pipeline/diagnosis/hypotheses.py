"""The hypotheses of a diagnosis: groups of parameters that may differ, and the models that they change.

A cause of some size is a `Group` of one parameter, or of the three of a base or tool. A cause that is there
or not is an edit (`runs.reading_errors`). A `State` has both: edits, and a value for each parameter.

The groups are in the order of preference among those with the same effect: tool, base, clock, the zeros of
the joints, other effects of joints, then lengths and tilts of the data sheet, then those that are zero there.
A single axis of tool or base comes before all three.

A segment leads from one joint to the next and has six parameters: shifts along and turns about three axes.
The parameters of the robot file (URM, Denavit-Hartenberg) keep their names; the others are "sideways" along
and "about" the remaining axes. The turn about a revolute joint's axis, or the shift along a prismatic
joint's, is the zero of the joint.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple, Protocol, TypeAlias

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint, Parameter
from urmpipe_models.elementwise import ZERO, FloatArray, IntArray, Vector, cross, subtract
from urmpipe_models.kinematics.identification import BASE, Twist
from urmpipe_models.math3d import Transform
from urmpipe_pipeline.diagnosis.causes import Kind
from urmpipe_pipeline.runs.reading_errors import Edits

Axis: TypeAlias = tuple[float, float, float]

X, Y, Z = AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_AXES = dict(zip("xyz", AXES, strict=True))

NAMED_SOURCES = ("URM", "DH", "6R")  # beginnings of the sources of parameters with familiar names
NEGLIGIBLE = 1e-9  # [m] or [-]: rounding of a length or of a direction


class Group(NamedTuple):
    """A cause of some size: one parameter, or three of base and tool.

    Attributes:
        kind: Its kind.
        name: What it is of.
        unit: Of its parameters.
        columns: Their indices among all parameters.
        joint: Index of its joint; None of another cause.
        segment: The point that ends its segment; None of another cause.
        axis: Along or about which it acts in the frame of segment, base or tool; None of another cause, and
            of three parameters.
        twists: What it changes in the arm, one per parameter; empty for joints and time.
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
        """Return whether both are the same, or axes of the same frame."""
        return (self.kind, self.name) == (other.kind, other.name)


class State(NamedTuple):
    """An explanation: which causes there are, and their sizes.

    Attributes:
        values: Parameters of all groups, in the unit of each ([m], [rad], [s]); 0 if not taken, shape (p,).
        edits: The discrete causes.
    """

    values: FloatArray
    edits: Edits = ()

    def of(self, group: Group) -> FloatArray:
        """Return the parameters of a group, in its unit ([m], [rad], [s]), shape (k,)."""
        return self.values[list(group.columns)]


def null_state(groups: Iterable[Group]) -> State:
    """Return the explanation without any cause."""
    return State(np.zeros(sum(len(group.columns) for group in groups)))


def assign_columns(groups: Iterable[Group]) -> tuple[Group, ...]:
    """Return groups with consecutive columns for their parameters."""
    result: list[Group] = []
    first = 0
    for group in groups:
        count = len(group.columns)
        result.append(group._replace(columns=tuple(range(first, first + count))))
        first += count
    return tuple(result)


class Model(Protocol):
    """One side as a model with the hypotheses, and the data of the other side.

    c components of the residual: positions, then turns if both sides have orientations, or all joints.
    """

    @property
    def groups(self) -> tuple[Group, ...]:
        """The causes of some size."""

    @property
    def rows(self) -> int:
        """Number of compared rows."""

    @property
    def unit(self) -> Literal["m", "rad"]:
        """Unit of the deviation."""

    @property
    def of_joints(self) -> bool:
        """Whether the deviation is of the joints themselves, not of positions."""

    @property
    def sample(self) -> IntArray:
        """Rows of the log, shape (n,)."""

    @property
    def blocks(self) -> IntArray:
        """Noise level of each component, those with equal numbers share one, shape (c,)."""

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return data - model in [m] and [rad], shape (c, n); NaN where a side has no value."""

    def residuals(self, edits: Sequence[Edits], rows: IntArray) -> FloatArray:
        """Return the residuals of explanations without parameters in [m] and [rad], shape (k, c, n)."""

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the residual in [m] and [rad], shape (c, n), and the model's Jacobian, shape (p, c, n).

        Args:
            state: The explanation.
            rows: Indices of rows, shape (n,).
            groups: Whose parameters, in this order; all by default.
        """

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return the deviation that an explanation leaves, as it is judged, in [m] or [rad], shape (k, n)."""

    def target(self, rows: IntArray) -> FloatArray:
        """Return the data as they are judged, in [m] or [rad], shape (k, n)."""


def cause_groups(chain: Chain, names: Sequence[str], *, has_rotation: bool, timed: bool) -> Iterator[Group]:
    """Yield the groups of an arm and its log.

    Args:
        chain: The arm.
        names: The log's names of the joints.
        has_rotation: Whether orientations are compared, too.
        timed: Whether the log has times.
    """
    yield from tool_groups(chain.tool, len(chain.joints) + 2, has_rotation=has_rotation)
    yield from base_groups(chain.base)
    units = ["m" if joint.kind == "prismatic" else "rad" for joint in chain.moving]
    yield from joint_groups(units, names, chain, timed=timed)
    places = range(1, len(chain.joints) + 2)
    segments = [ranked for place in places for ranked in _segment_groups(chain, place)]
    ranks = [("link_length", True), ("tilt", True), ("link_length", False), ("link_shift", False)]
    for rank in (*ranks, ("tilt", False)):
        yield from (group for group, in_data_sheet in segments if (group.kind, in_data_sheet) == rank)


def joint_groups(
    units: Sequence[str], names: Sequence[str], chain: Chain | None, *, timed: bool
) -> Iterator[Group]:
    """Yield the groups of the clock and of each joint.

    Args:
        units: m or rad, one per joint.
        names: The log's names of the joints.
        chain: The arm, which sags under gravity; None for joints alone.
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
    """Return whether an arm has masses; else gravity acts at its tool centre point."""
    return any(inertial.mass != 0.0 for inertial in chain.inertials)


def base_groups(base: Transform) -> Iterator[Group]:
    """Yield the shifts and turns of a base along and about the axes of the world, through its origin."""
    at = Transform(translation=base.translation)
    yield from _frame_groups("base_shift", "base", BASE, at)
    yield from _frame_groups("base_rotation", "base", BASE, at)


def tool_groups(tool: Transform, place: int, *, has_rotation: bool) -> Iterator[Group]:
    """Yield the shifts of a tool in its frame, and its turns if there are orientations."""
    yield from _frame_groups("tool_shift", "tool", place, tool)
    if has_rotation:
        yield from _frame_groups("tool_rotation", "tool", place, tool)


def time_groups() -> Iterator[Group]:
    """Yield the offset and the drift of the log's clock."""
    yield Group("time_lag", "clock", "s", (0,))
    yield Group("clock_drift", "clock", "s/s", (0,))


def _frame_groups(kind: Kind, name: str, place: int, frame: Transform) -> Iterator[Group]:
    """Yield one parameter along or about each axis of a frame, then all three."""
    way: Literal["along", "about"] = "along" if kind.endswith("shift") else "about"
    unit = "m" if way == "along" else "rad"
    twists = tuple(Twist(place, way, axis, frame) for axis in AXES)
    for axis, twist in zip(AXES, twists, strict=True):
        yield Group(kind, name, unit, (0,), axis=axis, twists=(twist,))
    yield Group(kind, name, unit, (0, 1, 2), twists=twists)


def _segment_groups(chain: Chain, place: int) -> Iterator[tuple[Group, bool]]:
    """Yield the six parameters of the segment that ends in a frame, each with whether the data sheet has it.

    A frame without a length or turn at either end of the arm, or after a fixed joint, is no segment.
    """
    frame, count = chain.frames[place], len(chain.joints)
    named = [p for p in chain.parameters if p.frame_index == place and p.source.startswith(NAMED_SOURCES)]
    is_end = place in (1, count + 1) or chain.joints[place - 2].kind == "fixed"
    if not named and frame == Transform() and is_end:
        return
    yield from ((_parameter_group(p), bool(p.value)) for p in named if not p.name.startswith("theta_"))
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
            sideways = f"{name} sideways {letter}"
            yield Group("link_shift", sideways, "m", (0,), None, _point(place), twist.axis, (twist,)), False
    yield from ((tilt, False) for tilt in _tilts(chain, place, name, {p.axis for p in turns}, across))


def _parameter_group(parameter: Parameter) -> Group:
    place, axis = parameter.frame_index, _AXES[parameter.axis]
    kind: Kind = "link_length" if parameter.kind == "along" else "tilt"
    twist = Twist(place, parameter.kind, axis, parameter.before)
    unit = "m" if parameter.kind == "along" else "rad"
    return Group(kind, parameter.name, unit, (0,), None, _point(place), axis, (twist,))


def _tilts(chain: Chain, place: int, name: str, named: set[str], across: Transform) -> Iterator[Group]:
    """Yield the turns of a frame without a named parameter: of a joint those across its axis."""
    joint = chain.joints[place - 1] if place <= len(chain.joints) else None
    if named or joint is None or joint.kind == "fixed" or joint.mimic is not None:
        at = across if named else chain.frames[place]
        axes = {letter: axis for letter, axis in _AXES.items() if letter not in named}
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
    """Return two directions perpendicular to an axis and to each other, those of the frame if possible."""
    largest = int(np.argmax(np.abs(axis)))
    first = np.cross(axis, AXES[(largest + 2) % 3])
    first /= np.linalg.norm(first)
    return _axis(first), _axis(np.cross(axis, first))


def _axis(vector: FloatArray) -> Axis:
    """Return a unit vector as a tuple, without signed zeros."""
    x, y, z = (float(part) + 0.0 for part in vector)
    return x, y, z


def _letter(axis: Axis, default: str) -> str:
    """Return the letter of an axis of the frame, or a default."""
    near = (letter for letter, other in _AXES.items() if abs(np.dot(axis, other)) > 1.0 - NEGLIGIBLE)
    return next(near, default)
