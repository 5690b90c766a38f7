"""The parameters of an arm: the named lengths and angles whose elementary motions make its frames.

The masses of an arm: what its frames carry.

What an arm looks like: shapes on its frames, as a robot description tells them.

The chain: a serial arm as frames and joints, whatever it was described by.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
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


@dataclass(frozen=True, slots=True)
class Parameter:
    """One length or angle of an arm, and where it acts: its frame is before @ motion(value) @ after.

    Attributes:
        name: Its name, unique in the arm.
        kind: along: it shifts along its axis; about: it turns about it.
        axis: x, y or z of the frame that `before` reaches.
        value: In [m] along, in [rad] about the axis, any element.
        source: What described it, in a few words.
        place: Name of its frame: base, a joint's name, tip or tool.
        frame_index: Place of its frame in `Chain.frames`; 0 is the base.
        before: What stands before it in its frame.
        after: What stands after it in its frame.
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


def parameters_of(frames: Sequence[Transform], places: Sequence[str]) -> Iterator[Parameter]:
    """Yield the parameters of frames from the base outwards; a repeated name gets a prime.

    Args:
        frames: Those of an arm, each in the one before it.
        places: Their names.
    """
    names: set[str] = set()
    for index, (frame, place) in enumerate(zip(frames, places, strict=True)):
        parts = frame_to_steps(frame)
        for k, step in enumerate(parts):
            if isinstance(step, Transform):
                continue
            name = step.name or f"{place}.{'r' * (step.kind == 'about')}{step.axis}"
            while name in names:
                name += "'"
            names.add(name)
            before, after = compose(parts[:k]), compose(parts[k + 1 :])
            yield Parameter(name, step.kind, step.axis, step.value, step.source, place, index, before, after)


def frame_to_steps(frame: Transform) -> tuple[Transform | Step, ...]:
    """Return what a frame is made of.

    One that does not tell is x, y, z, then its rotation as a constant, then turns by 0 about z, y, x.
    """
    if frame.made_of is not None:
        return frame.made_of
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


def with_values(frame: Transform, values: Sequence[Element]) -> Transform:
    """Return a frame with other values of its parameters, in [m] and [rad], multiplied again."""
    given = iter(values)
    parts = frame_to_steps(frame)
    return compose_steps(
        *(replace(one, value=next(given)) if isinstance(one, Step) else one for one in parts)
    )


GRAVITY: tuple[float, float, float] = (0.0, 0.0, -9.81)
"""The acceleration of gravity in the world's frame, in [m/s2], where a robot file gives no other."""

PRINTED_DIGITS = 1e-2
"""Principal moments may miss what a body can have by this share of the largest: a thin rod that was turned
and printed with three digits misses it by up to 0.8 %."""

SMALLEST_RADIUS = 3e-5
"""They may also miss it by what the mass has at this radius in [m]: rounding of a point mass."""

_Six: TypeAlias = tuple[Element, Element, Element, Element, Element, Element]
_SixNumbers: TypeAlias = tuple[float, float, float, float, float, float]
_ThreeNumbers: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Inertial:
    """A mass that a frame of the arm carries; a frame may carry several.

    Attributes:
        joint: Name of the joint whose moving frame carries it; None for the base, which stands still.
        mass: m in [kg].
        centre: Its centre in the frame that carries it, in [m].
        inertia: ixx, iyy, izz, ixy, ixz, iyz about the centre, along the axes of the frame, in [kg.m2];
            the products are those of the inertia matrix, -integral of x y dm.
        source: Where the numbers come from.
    """

    joint: str | None
    mass: Element = field(metadata={"stored": float})
    centre: Vector = field(default=ZERO, metadata={"stored": _ThreeNumbers})
    inertia: _Six = field(default=(0.0,) * 6, metadata={"stored": _SixNumbers})
    source: str = ""

    @property
    def place(self) -> str:
        """The joint that carries it in words, for messages."""
        return "the base" if self.joint is None else f"joint {self.joint}"

    @property
    def matrix(self) -> tuple[Vector, Vector, Vector]:
        """The rows of the inertia matrix about the centre, in [kg.m2]."""
        ixx, iyy, izz, ixy, ixz, iyz = self.inertia
        return (ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz)

    @property
    def principal_moments(self) -> tuple[float, float, float]:
        """The moments of inertia about the principal axes through the centre, the least first, in [kg.m2]."""
        low, middle, high = np.linalg.eigvalsh(np.array(self.matrix, dtype=np.float64)).tolist()
        return low, middle, high

    def faults(self) -> Iterator[str]:
        """Yield why no body has this mass and inertia; of what is no number, as in a trace, nothing."""
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
        slack = PRINTED_DIGITS * max(high, 0.0) + max(mass, 0.0) * SMALLEST_RADIUS**2
        if low < -slack:
            yield f"{where}: {moments}; allowed: 0 or more"
        elif low + middle < high - slack:
            yield f"{where}: {moments}; allowed: none above the sum of the other two"


Colour: TypeAlias = tuple[float, float, float, float]
"""Red, green, blue and opacity, each 0..1."""

PACKAGE, FILE = "package://", "file://"
"""What a reference to a mesh may begin with."""

PACKAGE_PATH = "ROS_PACKAGE_PATH"
"""The environment variable that lists folders of which meshes may be taken, as ROS has it."""


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
    """A file of triangles in [m], times `scale`: `file` is a path, or a URL that `mesh_file` did not take."""

    file: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


Shape: TypeAlias = Box | Cylinder | Capsule | Sphere | Mesh


@dataclass(frozen=True, slots=True)
class Visual:
    """A shape that a frame of the arm carries.

    Attributes:
        joint: Name of the joint whose moving frame carries it; None for the base of the arm.
        shape: What it is.
        origin: The shape's frame in the frame that carries it.
        colour: Its colour; None where the description gives none.
    """

    joint: str | None
    shape: Shape
    origin: Transform = field(default_factory=Transform)
    colour: Colour | None = None

    def faults(self) -> Iterator[str]:
        """Yield what no shape can have: a negative size, or a share of a colour beyond 0..1."""
        mesh = isinstance(self.shape, Mesh)  # a negative scale mirrors
        sizes: list[float] = [] if mesh else np.ravel([*asdict(self.shape).values()]).tolist()
        if any(size < 0.0 for size in sizes):
            yield f"a {type(self.shape).__name__.lower()} of negative size {min(sizes):g}; allowed: 0 or more"
        if self.colour is not None and not all(0.0 <= share <= 1.0 for share in self.colour):
            yield f"colour {', '.join(f'{share:g}' for share in self.colour)}; allowed: shares from 0 to 1"

    def located(self, folder: Path) -> Visual:
        """Return the same shape with its mesh file looked up from the folder of the description."""
        if not isinstance(self.shape, Mesh):
            return self
        return replace(self, shape=replace(self.shape, file=resolve_mesh_path(self.shape.file, folder)))


def resolve_mesh_path(reference: str, folder: Path) -> str:
    """Return where a mesh file stands, if a description in a folder may take it.

    A description takes files from its own folder, from the ROS package that it stands in, from those around,
    and from folders that the user lists in ROS_PACKAGE_PATH, all links followed: nothing else gets into a
    recording, whoever wrote the description. A ROS package is a folder with a file package.xml.

    Args:
        reference: A path, relative to the folder or absolute, or file://PATH, or package://PACKAGE/PATH.
        folder: Where the description stands.

    Returns:
        An absolute path; a reference to a package that is not there as it was written; of a file that may not
        be taken its URL, which begins with file://.
    """
    if "\0" in reference:  # which no path holds
        return reference
    folder = folder.absolute()
    if not reference.startswith(PACKAGE):
        path = unquote(reference.removeprefix(FILE)) if reference.startswith(FILE) else reference
        file, package = folder / path, next((one for one in folder.parents if _is_package(one)), folder)
    elif (root := _package(reference, folder)) is not None:
        file, package = root / reference.removeprefix(PACKAGE).partition("/")[2], root
    else:
        return reference
    roots = [folder, *([package] if _is_package(package) else []), *_listed_folders()]
    try:
        taken = any(file.resolve().is_relative_to(one.resolve()) for one in roots)
    except (OSError, RuntimeError):  # links in a circle
        taken = False
    return str(file) if taken else file.as_uri()


def _package(reference: str, folder: Path) -> Path | None:
    """Return the folder of the package of a reference: beside or above a folder, or a listed one."""
    name = reference.removeprefix(PACKAGE).partition("/")[0]
    if not name.strip("."):  # a step up is no name
        return None
    around = (one if one.name == name else one / name for one in (folder, *folder.parents))
    listed = (one if one.name == name else one / name for one in _listed_folders())
    return next((one for one in (*around, *listed) if one.is_dir()), None)


def _is_package(folder: Path) -> bool:
    return (folder / "package.xml").is_file()


def _listed_folders() -> list[Path]:
    """Return the folders that the user lists in ROS_PACKAGE_PATH."""
    return [Path(one).absolute() for one in os.environ.get(PACKAGE_PATH, "").split(os.pathsep) if one]


JointKind = Literal["revolute", "prismatic", "fixed"]

AXIS_TOLERANCE = 1e-9
"""An axis may differ from unit length by this: rounding, not a forgotten normalisation."""

MAX_COORDINATE = 1e6
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
class Chain(Displayable):
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
            if not all(abs(one) <= MAX_COORDINATE for one in numbers):
                yield f"{where} stands at {numbers} m; allowed: {MAX_COORDINATE:g} m at most"

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
        unknown = [
            f"robot {self.name}: parameter: {format_unknown_name(n, index)}" for n in values if n not in index
        ]
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
        moving = format_count(len(self.coordinates), "coordinate")
        return format_headline(self.name, self.description, f"{moving} ({', '.join(self.coordinates)})")

    def _table(self) -> str:
        """Return a row a joint: its name, kind and limits; a model knows no pandas."""
        rows = "".join(
            f"<tr><td>{escape_html(one.name)}</td><td>{one.kind}</td><td>{one.lower:.6g}</td><td>{one.upper:.6g}</td></tr>"
            for one in self.joints
        )
        return f"<table><tr><th>joint</th><th>kind</th><th>lower</th><th>upper</th></tr>{rows}</table>"
