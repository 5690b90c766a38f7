"""Chain: a serial arm as frames and joints, with its parameters, masses, shapes and drives.

The tool centre point of an arm with n joints is at

    T(q) = B  O_1 M_1(q_1) ... O_n M_n(q_n)  E  W

with the base B in the world, the frame O_k of joint k in the moving frame of the joint before it, the motion
M_k about or along the joint's axis, the end E of the arm in the last moving frame, and the tool W. A joint
that is not fixed either has a coordinate in q or mimics the coordinate of another joint:
value = multiplier q + offset (`kinematics.forward.joint_values`).

    Mimic, Joint   one joint: kind, frame, axis, limits
    Chain          the arm; it checks all its parts and reports all errors at once
    Parameter      the lengths and angles whose elementary motions make the frames
    Inertial       the masses on the frames
    Visual         the shapes on the frames, and where the files of meshes are
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Literal, TypeAlias
from urllib.parse import unquote

import numpy as np

from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.drives import JointDrive
from urmpipe_models.elementwise import ZERO, Element, Vector
from urmpipe_models.errors import RobotError, escape_html, format_unknown_name
from urmpipe_models.math3d import Step, Transform, compose, compose_steps

GRAVITY: tuple[float, float, float] = (0.0, 0.0, -9.81)  # [m/s2], world frame; default of robot files
AXIS_TOLERANCE = 1e-9  # deviation of an axis from unit length: rounding, not a forgotten normalisation
MAX_COORDINATE = 1e6  # [m], of a frame's origin: products of several much larger ones overflow

JointKind = Literal["revolute", "prismatic", "fixed"]


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: value = multiplier * q[joint] + offset (rad or m)."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint of a chain, with its frame.

    Attributes:
        name: Its name, unique in the chain.
        kind: revolute (any range), prismatic, or fixed: a frame that carries a sensor.
        origin: The joint's frame at q = 0, in the moving frame of the joint before it (or the base).
        axis: Unit vector of rotation or translation in the joint's frame [-].
        lower: Lower limit, in [rad] or [m].
        upper: Upper limit, in [rad] or [m].
        velocity: Largest speed, in [rad/s] or [m/s].
        acceleration: Largest acceleration either way, in [rad/s2] or [m/s2].
        effort: Largest torque or force either way, in [N.m] or [N].
        mimic: The joint that it follows, if it has no coordinate.
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
        """Yield the errors of the axis, the limits and the kind."""
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
class Chain(Displayable):
    """A serial chain from its base to its tip.

    The points p1..pn are the ends of its segments: p_k is the origin of the frame that follows
    joint k, rotated like the moving frame of joint k; the last one is the tool centre point (tip and
    tool included). For a URM arm they are the p_i of the paper.

    Attributes:
        name: The robot's name.
        joints: Joints from the base outwards; fixed ones are frames that may carry a sensor.
        tip: The end of the arm in the frame of the last joint.
        base: The base frame in the world.
        tool: The tool centre point in the tip's frame.
        start: Calibration pose q(0), in [rad] or [m], one value per coordinate.
        description: One line of text.
        source: Origin of the numbers.
        visuals: The shapes of the arm; empty if the description has no shapes.
        inertials: The masses of the arm; empty if the description has no masses.
        gravity: Acceleration of gravity in the world's frame, in [m/s2]; `base` rotates the arm in it.
        left_out: Links of a URDF that the arm carries and that other joints move: their masses are not
            among the `inertials`.
        mass_faults: Why the masses of a URDF are not used; then there are no `inertials`.
        drives: What drives or holds the joints; empty if the description has no drives.
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
        for kind, parts in (("a visual", self.visuals), ("an inertial", self.inertials)):
            for part in parts:
                yield from part.faults()
            carriers = {part.joint for part in parts if part.joint is not None}
            for carrier in sorted(carriers - set(names)):
                yield f"{kind} hangs on {carrier}, no joint of the chain; allowed: {', '.join(names)}"
        yield from self._frame_faults()
        if not all(math.isfinite(element) for element in self.gravity if isinstance(element, Real)):
            yield f"gravity {[*self.gravity]}; allowed: finite numbers"
        yield from self._drive_faults()
        if len(self.start) != len(self.coordinates):
            yield f"start has {len(self.start)} values; allowed: {len(self.coordinates)}, one a coordinate"

    def _frame_faults(self) -> Iterator[str]:
        frames = {"the tip": self.tip, "the base": self.base, "the tool": self.tool}
        frames |= {f"joint {joint.name}": joint.origin for joint in self.joints}
        for name, frame in frames.items():
            numbers = [float(element) for element in frame.translation if isinstance(element, Real)]
            if not all(abs(number) <= MAX_COORDINATE for number in numbers):
                yield f"{name} stands at {numbers} m; allowed: {MAX_COORDINATE:g} m at most"  # plain: ok

    def _drive_faults(self) -> Iterator[str]:
        for drive in self.drives:
            yield from drive.faults()
        driven = [drive.joint for drive in self.drives]
        for name in sorted(set(driven)):
            if name not in self.coordinates:
                allowed = f"a joint with a coordinate: {', '.join(self.coordinates)}"
                yield f"drives.{name}: found a drive for it, allowed: {allowed}"
            elif driven.count(name) > 1:
                yield f"drives.{name}: found {driven.count(name)} times, allowed: once"

    @cached_property
    def moving(self) -> tuple[Joint, ...]:
        """The joints that have a coordinate, in the order of q: neither fixed nor mimics."""
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
        """The lengths and angles of the arm from the base to the tool; a repeated name gets a prime."""
        parameters: dict[str, Parameter] = {}
        for index, (frame, place) in enumerate(zip(self.frames, self.frame_names, strict=True)):
            steps = frame_to_steps(frame)
            for k, step in enumerate(steps):
                if isinstance(step, Transform):
                    continue
                name = step.name or f"{place}.{'r' * (step.kind == 'about')}{step.axis}"
                while name in parameters:
                    name += "'"
                parameters[name] = Parameter(
                    name, step.kind, step.axis, step.value, step.source, place, index,
                    compose(steps[:k]), compose(steps[k + 1 :]),
                )  # fmt: skip
        return tuple(parameters.values())

    def with_parameters(self, values: Mapping[str, Element]) -> Chain:
        """Return the same arm with other values of some parameters.

        Args:
            values: By name, in [m] and [rad], any elements.

        Raises:
            RobotError: With every name that no parameter has.
        """
        index = {parameter.name: parameter.frame_index for parameter in self.parameters}
        unknown = [
            f"robot {self.name}: parameter: {format_unknown_name(n, index)}" for n in values if n not in index
        ]
        if unknown:
            raise RobotError(*unknown)
        frames = list(self.frames)
        for k in {index[name] for name in values}:
            parameters = (parameter for parameter in self.parameters if parameter.frame_index == k)
            new = (values.get(parameter.name, parameter.value) for parameter in parameters)
            frames[k] = compose_steps(
                *(
                    replace(step, value=next(new)) if isinstance(step, Step) else step
                    for step in frame_to_steps(frames[k])
                )
            )
        base, *origins, tip, tool = frames
        joints = (replace(joint, origin=at) for joint, at in zip(self.joints, origins, strict=True))
        return replace(self, joints=tuple(joints), tip=tip, base=base, tool=tool)

    def placed(self, base: Transform | None = None, tool: Transform | None = None) -> Chain:
        """Return the same arm on another base or with another tool."""
        return replace(self, base=base or self.base, tool=tool or self.tool)

    def _headline(self) -> str:
        moving = format_count(len(self.coordinates), "coordinate")
        return format_headline(self.name, self.description, f"{moving} ({', '.join(self.coordinates)})")

    def _table(self) -> str:
        """Return the joints as HTML: written here because a model does not import pandas."""
        rows = "".join(
            f"<tr><td>{escape_html(joint.name)}</td><td>{joint.kind}</td>"
            f"<td>{joint.lower:.6g}</td><td>{joint.upper:.6g}</td></tr>"
            for joint in self.joints
        )
        return f"<table><tr><th>joint</th><th>kind</th><th>lower</th><th>upper</th></tr>{rows}</table>"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One length or angle of an arm, and its place: its frame is before @ motion(value) @ after.

    Attributes:
        name: Its name, unique in the arm.
        kind: along: a translation along its axis; about: a rotation about it.
        axis: x, y or z of the frame that `before` reaches.
        value: In [m] along, in [rad] about the axis, any element.
        source: What described it, in a few words.
        place: Name of its frame: base, a joint's name, tip or tool.
        frame_index: Index of its frame in `Chain.frames`; 0 is the base.
        before: The product of the motions before it in its frame.
        after: The product of the motions after it in its frame.
    """

    name: str
    kind: Literal["along", "about"]
    axis: Literal["x", "y", "z"]
    value: Element
    source: str
    place: str
    frame_index: int
    before: Transform
    after: Transform

    @property
    def unit(self) -> str:
        """Of its value: m or rad."""
        return "m" if self.kind == "along" else "rad"


def frame_to_steps(frame: Transform) -> tuple[Transform | Step, ...]:
    """Return the elementary motions and constants whose product is a frame.

    A frame without them becomes x, y, z, its rotation as a constant, and rotations by 0 about z, y, x.
    """
    if frame.steps is not None:
        return frame.steps
    x, y, z = frame.translation
    return (
        Step("along", "x", x, source="frame"),
        Step("along", "y", y, source="frame"),
        Step("along", "z", z, source="frame"),
        Transform(frame.rotation),
        Step("about", "z", source="frame"),
        Step("about", "y", source="frame"),
        Step("about", "x", source="frame"),
    )


# Tolerances of the triangle inequality of principal moments. A thin rod whose inertia was rotated and printed
# with three digits violates it by up to 0.8 % of the largest moment; a rounded point mass by m r^2.
MOMENT_TOLERANCE = 1e-2  # as a fraction of the largest principal moment
POINT_RADIUS = 3e-5  # r in [m]

_Six: TypeAlias = tuple[Element, Element, Element, Element, Element, Element]
_SixNumbers: TypeAlias = tuple[float, float, float, float, float, float]
_ThreeNumbers: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Inertial:
    """A mass that a frame of the arm carries; a frame may carry several.

    Attributes:
        joint: Name of the joint whose moving frame carries it; None for the base, which does not move.
        mass: m in [kg].
        centre: Its centre in the frame that carries it, in [m].
        inertia: ixx, iyy, izz, ixy, ixz, iyz about the centre, along the axes of the frame, in [kg.m2];
            the products are those of the inertia matrix, -integral of x y dm.
        source: Origin of the numbers.
    """

    joint: str | None
    mass: Element = field(metadata={"stored": float})
    centre: Vector = field(default=ZERO, metadata={"stored": _ThreeNumbers})
    inertia: _Six = field(default=(0.0,) * 6, metadata={"stored": _SixNumbers})
    source: str = ""

    @property
    def place(self) -> str:
        """The joint that carries it, as text for messages."""
        return "the base" if self.joint is None else f"joint {self.joint}"

    @property
    def matrix(self) -> tuple[Vector, Vector, Vector]:
        """The rows of the inertia matrix about the centre, in [kg.m2]."""
        ixx, iyy, izz, ixy, ixz, iyz = self.inertia
        return (ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz)

    @property
    def principal_moments(self) -> tuple[float, float, float]:
        """The moments of inertia about the principal axes through the centre, ascending, in [kg.m2]."""
        low, middle, high = np.linalg.eigvalsh(np.array(self.matrix, dtype=np.float64)).tolist()
        return low, middle, high

    def faults(self) -> Iterator[str]:
        """Yield why no body has this mass and inertia; symbols, as in a trace, are not checked."""
        values = (self.mass, *self.centre, *self.inertia)
        if not all(isinstance(value, Real) for value in values):
            return
        where = f"inertial on {self.place}"
        if not np.isfinite(np.array(values, dtype=np.float64)).all():
            yield f"{where}: found a number that is not finite in {[*map(float, values)]}; allowed: finite"
            return
        mass = float(self.mass)
        if mass < 0.0:
            yield f"{where}: mass {mass:g} kg; allowed: 0 or more"
        if mass == 0.0 and any(self.inertia):
            yield f"{where}: mass 0 with an inertia; allowed: a mass, or no inertia"
        low, middle, high = self.principal_moments
        moments = f"principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg.m2"
        slack = MOMENT_TOLERANCE * max(high, 0.0) + max(mass, 0.0) * POINT_RADIUS**2
        if low < -slack:
            yield f"{where}: {moments}; allowed: 0 or more"
        elif low + middle < high - slack:
            yield f"{where}: {moments}; allowed: none above the sum of the other two"


Colour: TypeAlias = tuple[float, float, float, float]  # red, green, blue and opacity, each 0..1


@dataclass(frozen=True, slots=True)
class Box:
    """A box around its origin, with its edges along the axes: `size` in [m]."""

    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder along z around its origin: `radius` and `length` in [m]."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Capsule:
    """A cylinder along z with half a ball at each end: `radius`, and `length` without the balls, in [m]."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball around its origin: `radius` in [m]."""

    radius: float


@dataclass(frozen=True, slots=True)
class Mesh:
    """A file of triangles in [m], times `scale`.

    `file` is a path, or a URL if `resolve_mesh_path` does not allow the file.
    """

    file: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


Shape: TypeAlias = Box | Cylinder | Capsule | Sphere | Mesh


@dataclass(frozen=True, slots=True)
class Visual:
    """A shape that a frame of the arm carries.

    Attributes:
        joint: Name of the joint whose moving frame carries it; None for the base of the arm.
        shape: The shape.
        origin: The shape's frame in the frame that carries it.
        colour: Its colour; None if the description has no colour.
    """

    joint: str | None
    shape: Shape
    origin: Transform = field(default_factory=Transform)
    colour: Colour | None = None

    def faults(self) -> Iterator[str]:
        """Yield the errors of the shape: a negative size, or a component of the colour outside 0..1."""
        is_mesh = isinstance(self.shape, Mesh)  # a negative scale mirrors
        sizes: list[float] = [] if is_mesh else np.ravel([*asdict(self.shape).values()]).tolist()
        if any(size < 0.0 for size in sizes):
            yield f"a {type(self.shape).__name__.lower()} of negative size {min(sizes):g}; allowed: 0 or more"
        if self.colour is not None and not all(0.0 <= share <= 1.0 for share in self.colour):
            yield f"colour {', '.join(f'{share:g}' for share in self.colour)}; allowed: shares from 0 to 1"

    def with_resolved_mesh(self, folder: Path) -> Visual:
        """Return the same shape with the path of its mesh file, given the folder of the description."""
        if not isinstance(self.shape, Mesh):
            return self
        return replace(self, shape=replace(self.shape, file=resolve_mesh_path(self.shape.file, folder)))


PACKAGE, FILE = "package://", "file://"  # schemes of a reference to a mesh
PACKAGE_PATH = "ROS_PACKAGE_PATH"  # environment variable of ROS: folders that meshes may be taken from


def resolve_mesh_path(reference: str, folder: Path) -> str:
    """Return the path of a mesh file, if a description in a folder may take it.

    A description takes files from its folder, from the ROS package around it, from packages next to it,
    and from folders that the user lists in ROS_PACKAGE_PATH, all links followed: no other file gets into a
    recording, whatever the description refers to. A ROS package is a folder with a file package.xml.

    Args:
        reference: A path, relative to the folder or absolute, or file://PATH, or package://PACKAGE/PATH.
        folder: The folder of the description.

    Returns:
        An absolute path; an unknown package as it was written; a file that may not be taken as its URL,
        which begins with file://.
    """
    if "\0" in reference:  # no path contains it
        return reference
    folder = folder.absolute()
    entries = os.environ.get(PACKAGE_PATH, "").split(os.pathsep)
    listed = [Path(entry).absolute() for entry in entries if entry]
    if reference.startswith(PACKAGE):
        name, _, path = reference.removeprefix(PACKAGE).partition("/")
        if not name.strip("."):  # empty, or a step up
            return reference
        parents = (folder, *folder.parents, *listed)
        candidates = (parent if parent.name == name else parent / name for parent in parents)
        package = next((candidate for candidate in candidates if candidate.is_dir()), None)
        if package is None:
            return reference
        file = package / path
    else:
        path = unquote(reference.removeprefix(FILE)) if reference.startswith(FILE) else reference
        file, package = folder / path, next(filter(_is_package, folder.parents), folder)
    roots = [folder, *([package] if _is_package(package) else []), *listed]
    try:
        is_allowed = any(file.resolve().is_relative_to(root.resolve()) for root in roots)
    except (OSError, RuntimeError):  # links in a circle
        is_allowed = False
    return str(file) if is_allowed else file.as_uri()


def _is_package(folder: Path) -> bool:
    return (folder / "package.xml").is_file()
