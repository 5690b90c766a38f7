"""The chain: a serial arm as frames and joints, whatever it was described by."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Real
from typing import Literal

from urmpipe_models.chains.inertial import GRAVITY, Inertial
from urmpipe_models.chains.parameters import Parameter, parameters_of, with_values
from urmpipe_models.chains.visual import Visual
from urmpipe_models.display import Shown, line_of, number_of
from urmpipe_models.drives.joint_drives import JointDrive
from urmpipe_models.elementwise import Element, Vector
from urmpipe_models.errors import RobotError
from urmpipe_models.messages import in_html
from urmpipe_models.names import not_among
from urmpipe_models.transform import Transform

JointKind = Literal["revolute", "prismatic", "fixed"]

AXIS_TOLERANCE = 1e-9
"""An axis may differ from unit length by this: rounding, not a forgotten normalisation."""

FARTHEST = 1e6
"""Largest offset of a frame in [m]: products of several of much larger ones are no numbers any more."""


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: value = multiplier * q[joint] + offset (rad or m)."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint of a chain, with the frame it sits in.

    Attributes:
        name: Its name, unique in the chain.
        kind: revolute (any range), prismatic, or fixed: a frame that carries a sensor.
        origin: The joint's frame at q = 0, in the moving frame of the joint before it (or the base).
        axis: Unit vector of rotation or translation in the joint's frame [-].
        lower: Least value allowed, in [rad] or [m].
        upper: Largest value allowed, in [rad] or [m].
        velocity: Largest speed, in [rad/s] or [m/s].
        acceleration: Largest acceleration either way, in [rad/s2] or [m/s2].
        effort: Largest torque or force either way, in [N.m] or [N].
        mimic: The joint it follows, if it has no coordinate of its own.
    """

    name: str
    kind: JointKind = "revolute"
    origin: Transform = field(default_factory=Transform)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf
    mimic: Mimic | None = None

    def faults(self) -> Iterator[str]:
        """Yield what is wrong with its axis, its limits and its kind."""
        length = math.hypot(*self.axis)
        if abs(length - 1.0) > AXIS_TOLERANCE:
            yield f"joint {self.name}: axis {list(self.axis)} has length {length:g}; allowed: 1"
        if self.kind == "fixed" and self.mimic is not None:
            yield f"joint {self.name}: is fixed and mimics {self.mimic.joint}; allowed: one of the two"
        if not self.lower <= self.upper:
            yield f"joint {self.name}: lower limit {self.lower:g} above upper {self.upper:g}"
        for key in ("velocity", "acceleration", "effort"):
            if not getattr(self, key) > 0.0:
                yield f"joint {self.name}: {key} {getattr(self, key):g}; allowed: more than 0"


@dataclass(frozen=True, repr=False)
class Chain(Shown):
    """A serial chain from its base to its tip.

    The points p1..pn are the ends of its segments: p_k is the origin of the frame that follows
    joint k, turned as joint k leaves it; the last one is the tool centre point (tip and tool
    included). For a URM arm they are the p_i of the paper.

    Attributes:
        name: The robot's name.
        joints: Joints from the base outwards; fixed ones are frames that may carry a sensor.
        tip: The end of the arm in the frame of the last joint.
        base: Where the arm stands in the world.
        tool: The tool centre point in the tip's frame.
        start: Calibration pose q(0), in [rad] or [m], one value a coordinate.
        description: One line for people.
        source: Where the numbers come from.
        visuals: What the arm looks like; none where the description does not tell.
        inertials: The masses of the arm; none where the description does not tell.
        gravity: Acceleration of gravity in the world's frame, in [m/s2]; `base` turns the arm under it.
        left_out: Links of a URDF that the arm carries and that move by joints of their own: their masses
            are not among the `inertials`.
        mass_faults: Why the masses of a URDF are not used; then there are no `inertials`.
        drives: What drives or holds the joints; none where the description does not tell.
    """

    name: str
    joints: tuple[Joint, ...]
    tip: Transform = field(default_factory=Transform)
    base: Transform = field(default_factory=Transform)
    tool: Transform = field(default_factory=Transform)
    start: tuple[float, ...] = ()
    description: str = ""
    source: str = ""
    visuals: tuple[Visual, ...] = ()
    inertials: tuple[Inertial, ...] = ()
    gravity: Vector = GRAVITY
    left_out: tuple[str, ...] = ()
    mass_faults: tuple[str, ...] = ()
    drives: tuple[JointDrive, ...] = ()

    def __post_init__(self) -> None:
        if not self.start:
            object.__setattr__(self, "start", (0.0,) * len(self.coordinates))
        faults = [f"robot {self.name}: {fault}" for fault in self._faults()]
        if faults:
            raise RobotError(*faults)

    def _faults(self) -> Iterator[str]:
        """Yield what is wrong with the joints, what hangs on them, and the start."""
        names = [joint.name for joint in self.joints]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            yield f"joint names repeat: {', '.join(repeated)}; allowed: each once"
        if not self.coordinates:
            yield "has no moving joint; at least one is needed"
        for joint in self.joints:
            yield from joint.faults()
            if joint.mimic is not None and joint.mimic.joint not in self.coordinates:
                yield (
                    f"joint {joint.name} mimics {joint.mimic.joint}, no moving joint of the chain;"
                    f" allowed: {', '.join(self.coordinates)}"
                )
        for kind, carried in (("a visual", self.visuals), ("an inertial", self.inertials)):
            for one in carried:
                yield from one.faults()
            carriers = {one.joint for one in carried if one.joint is not None}
            for carrier in sorted(carriers - set(names)):
                yield f"{kind} hangs on {carrier}, no joint of the chain; allowed: {', '.join(names)}"
        yield from self._far_frames()
        if not all(math.isfinite(one) for one in self.gravity if isinstance(one, Real)):
            yield f"gravity {[*self.gravity]}; allowed: finite numbers"
        yield from self._drive_faults()
        if len(self.start) != len(self.coordinates):
            yield f"start has {len(self.start)} values; allowed: {len(self.coordinates)}, one a coordinate"

    def _far_frames(self) -> Iterator[str]:
        """Yield the frames that are farther away than can be computed with."""
        frames = {"the tip": self.tip, "the base": self.base, "the tool": self.tool}
        frames |= {f"joint {joint.name}": joint.origin for joint in self.joints}
        for where, frame in frames.items():
            numbers = [float(one) for one in frame.translation if isinstance(one, Real)]
            if not all(abs(one) <= FARTHEST for one in numbers):
                yield f"{where} stands at {numbers} m; allowed: {FARTHEST:g} m at most"

    def _drive_faults(self) -> Iterator[str]:
        """Yield the faults of the drives, and drives of joints that have no coordinate or have two."""
        driven = [one.joint for one in self.drives]
        for one in self.drives:
            yield from one.faults()
        for name in sorted(set(driven)):
            if name not in self.coordinates:
                allowed = f"a joint with a coordinate: {', '.join(self.coordinates)}"
                yield f"drives.{name}: found a drive for it, allowed: {allowed}"
            elif driven.count(name) > 1:
                yield f"drives.{name}: found {driven.count(name)} times, allowed: once"

    @cached_property
    def moving(self) -> tuple[Joint, ...]:
        """The joints that have a coordinate of their own, in the order of q."""
        return tuple(joint for joint in self.joints if joint.kind != "fixed" and joint.mimic is None)

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """The names of the coordinates q, in order."""
        return tuple(joint.name for joint in self.moving)

    @property
    def point_names(self) -> tuple[str, ...]:
        """p1..pn."""
        return tuple(f"p{k}" for k in range(1, len(self.joints) + 1))

    @property
    def frames(self) -> tuple[Transform, ...]:
        """The base, the frame of every joint, the tip and the tool, each in the one before it."""
        return (self.base, *(joint.origin for joint in self.joints), self.tip, self.tool)

    @property
    def frame_names(self) -> tuple[str, ...]:
        """The name of each of `frames`: base, those of the joints, tip, tool."""
        return ("base", *(joint.name for joint in self.joints), "tip", "tool")

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The lengths and angles that the arm is made from, from the base to the tool."""
        return tuple(parameters_of(self.frames, self.frame_names))

    def with_parameters(self, values: Mapping[str, Element]) -> Chain:
        """Return the same arm with other values of some parameters.

        Args:
            values: By name, in [m] and [rad], any elements.

        Raises:
            RobotError: With every name that no parameter has.
        """
        index = {one.name: one.frame_index for one in self.parameters}
        unknown = [f"robot {self.name}: parameter: {not_among(n, index)}" for n in values if n not in index]
        if unknown:
            raise RobotError(*unknown)
        frames = list(self.frames)
        for k in {index[name] for name in values}:
            own = (one for one in self.parameters if one.frame_index == k)
            frames[k] = with_values(frames[k], [values.get(one.name, one.value) for one in own])
        base, *origins, tip, tool = frames
        joints = (replace(joint, origin=at) for joint, at in zip(self.joints, origins, strict=True))
        return replace(self, joints=tuple(joints), tip=tip, base=base, tool=tool)

    def placed(self, base: Transform | None = None, tool: Transform | None = None) -> Chain:
        """Return the same arm on another base or with another tool."""
        return replace(self, base=base or self.base, tool=tool or self.tool)

    def _headline(self) -> str:
        """Return its name, what it is, and its coordinates."""
        moving = number_of(len(self.coordinates), "coordinate")
        return line_of(self.name, self.description, f"{moving} ({', '.join(self.coordinates)})")

    def _table(self) -> str:
        """Return a row a joint: its name, kind and limits; a model knows no pandas."""
        rows = "".join(
            f"<tr><td>{in_html(one.name)}</td><td>{one.kind}</td><td>{one.lower:.6g}</td><td>{one.upper:.6g}</td></tr>"
            for one in self.joints
        )
        return f"<table><tr><th>joint</th><th>kind</th><th>lower</th><th>upper</th></tr>{rows}</table>"
