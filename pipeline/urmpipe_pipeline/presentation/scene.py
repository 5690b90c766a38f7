"""What stands in space: arms that move, paths, targets, solids. Neither thinned out nor named as entities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy import bool_
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import Element, FloatArray, IntArray, Vector
from urmpipe_models.math3d import to_matrices

BoolArray: TypeAlias = NDArray[bool_]


class PlaneView(NamedTuple):
    """A view along the normal of a plane.

    Attributes:
        right: Direction that goes to the right, a unit vector [-].
        up: Direction that goes up, a unit vector [-], perpendicular to `right`.
    """

    right: Vector
    up: Vector

    @property
    def axes(self) -> FloatArray:
        """The directions to the right, up and towards the viewer as columns [-], shape (3, 3)."""
        right, up = np.array([self.right, self.up], np.float64)
        return np.column_stack((right, up, np.cross(right, up)))

    @property
    def axis_names(self) -> tuple[str, str, str]:
        """What these directions are called: x, y, z with their sign, others by their components."""
        right, up, normal = self.axes.T
        normal = normal * np.sign(normal[np.argmax(np.abs(normal))])  # a view has no direction by its name
        return _direction_name(right), _direction_name(up), _direction_name(normal)


def _direction_name(direction: FloatArray) -> str:
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) > 1.0 - 1e-9:
        return ("-" if direction[largest] < 0.0 else "") + "xyz"[largest]
    return f"({', '.join(f'{part:.3g}' for part in (direction + 0.0).tolist())})"


@dataclass(frozen=True, slots=True)
class ArmMark:
    """A word at a point of an arm, which it follows.

    Attributes:
        point: Number of the point: 0 the base, k the end of joint k's segment, where joint k + 1 stands.
        words: What is written there.
        colour: As #rrggbb.
        segment: True for the middle of the segment that ends there.
    """

    point: int
    words: str
    colour: str
    segment: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """An arm that moves.

    Attributes:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints); NaN where there is no pose.
        t_ns: Time of each pose in [ns], shape (n,); None: its row number.
        colour: Of its tip; of a ghost, of all of it.
        label: What is written at it; one text, or one a pose.
        ghost: True for another solution, drawn faintly beside the arm.
        vanishes: True if nothing is drawn where there is no pose; else the last pose stays.
        kept: Rows that are drawn in any case.
        marks: Words at its points; not of a ghost.
        masses: Whether the centres of its masses are drawn, as large as balls of one density; not of a ghost.
    """

    chain: Chain
    q: FloatArray
    t_ns: IntArray | None
    colour: str
    label: str | tuple[str, ...] = ""
    ghost: bool = False
    vanishes: bool = False
    kept: tuple[int, ...] = ()
    marks: tuple[ArmMark, ...] = ()
    masses: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Where a point goes.

    Attributes:
        name: What the legend calls it.
        position: In [m], shape (n, 3); broken where it is NaN.
        t_ns: Times in [ns], shape (n,); None: it does not move along it.
        colour: As #rrggbb.
        asked: True for what was asked for: drawn broad and dashed, so that what was done shows in the gaps.
        supposed: True for what would be: a page and a figure draw it thin and dashed.
        label: What is written at the moving point.
        values: What it is coloured by (small to large), in `unit`, shape (n,); None for its colour.
        unit: SI unit of `values`.
        limit: What is allowed of `values`, in `unit`: their colours change there; None for nothing.
        sample: Row numbers, shape (n,): broken where one is missing; None: none is missing.
        kept: Rows that are drawn in any case.
        vanishes: True if there is no moving point where there is no position.
        line: False if only the moving point is drawn: nothing joins its places, or another path is its line.
            Without times all of them are drawn then.
    """

    name: str
    position: FloatArray
    t_ns: IntArray | None
    colour: str
    asked: bool = False
    supposed: bool = False
    label: str = ""
    values: FloatArray | None = None
    unit: str = "m"
    limit: float | None = None
    sample: IntArray | None = None
    kept: tuple[int, ...] = ()
    vanishes: bool = False
    line: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Arrows:
    """Something at places, drawn from each as an arrow in the colour of its size.

    Attributes:
        name: What it is, and how much larger it is drawn.
        start: Where the arrows start in [m], shape (n, 3).
        end: Where they end in [m], shape (n, 3).
        values: What they stand for (small to large), in `unit`, shape (n,).
        sample: Row numbers, from 0, shape (n,).
        unit: SI unit of `values`.
        limit: What is allowed of `values`, in `unit`; None for nothing.
    """

    name: str
    start: FloatArray
    end: FloatArray
    values: FloatArray
    sample: IntArray
    unit: str = "m"
    limit: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Sheets:
    """Flat pieces of planes that one sees through.

    Attributes:
        name: What the legend calls them.
        corners: Of rectangles, one after the other around each, in [m], shape (n, 4, 3).
        colour: As #rrggbb.
    """

    name: str
    corners: FloatArray
    colour: str


@dataclass(frozen=True, slots=True, eq=False)
class Balls:
    """Balls that one sees through.

    Attributes:
        name: What they are, and how much larger they are drawn.
        centre: In [m], shape (n, 3).
        radius: In [m], shape (n,).
        colour: As #rrggbb.
    """

    name: str
    centre: FloatArray
    radius: FloatArray
    colour: str


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The pose of a frame over time.

    Attributes:
        position: Origin in [m], shape (n, 3).
        quat_xyzw: Orientation as unit quaternions [-], shape (n, 4).
        t_ns: Times in [ns], shape (n,).
    """

    position: FloatArray
    quat_xyzw: FloatArray
    t_ns: IntArray

    def points(self, points: FloatArray) -> FloatArray:
        """Return points of the frame in [m], shape (k, 3), over time in [m], shape (n, k, 3)."""
        turned = np.einsum("nij,kj->nki", to_matrices(self.quat_xyzw), points)
        return np.asarray(turned + self.position[:, np.newaxis])


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A thing as its surface, with lines on and about it.

    Attributes:
        group: What it belongs to, such as bodies: the viewer's tree has it below that.
        name: What it is called there, unique within its group.
        colour: As #rrggbb.
        triangles: Of its surface in [m], shape (n, 3, 3).
        lines: In [m], shape (k, 3) each.
        opacity: Of its surface, 0..1.
        label: What is written at it; empty for nothing.
        at: Where that is written, x, y, z in [m].
        legend: What a page's legend calls it; solids that share it are one entry.
        hidden: Whether it is there to be switched on only.
        motion: Pose of its frame over time, in which triangles, lines and `at` are then; None if it does not
            move.
    """

    group: str
    name: str
    colour: str
    triangles: FloatArray
    lines: tuple[FloatArray, ...] = ()
    opacity: float = 1.0
    label: str = ""
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    legend: str = ""
    hidden: bool = False
    motion: Motion | None = None

    @property
    def points(self) -> FloatArray:
        """Its corners and vertices in [m], shape (n, 3); if it moves, those of its box at all times."""
        points = np.concatenate([self.triangles.reshape(-1, 3), *self.lines])
        if self.motion is None or not len(points):
            return points
        low, high = points.min(axis=0), points.max(axis=0)
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
        return self.motion.points(low + corners * (high - low)).reshape(-1, 3)


@dataclass(frozen=True, slots=True, eq=False)
class MovingLines:
    """Lines whose points move, such as a rod between two bodies.

    Attributes:
        group: What they belong to, such as elements.
        name: What they are called there, unique within the group.
        colour: As #rrggbb.
        lines: Points of each line over time in [m], shape (n, k, 3) each.
        t_ns: Times in [ns], shape (n,).
        radius: Of the lines in [m]; 0 for thin lines.
        label: What is written in the middle of the first line; empty for nothing.
    """

    group: str
    name: str
    colour: str
    lines: tuple[FloatArray, ...]
    t_ns: IntArray
    radius: float = 0.0
    label: str = ""


@dataclass(frozen=True, slots=True)
class Spot:
    """A place with a word.

    Attributes:
        position: In [m].
        words: What is written there.
        colour: As #rrggbb.
        always: True for what decides; False for ends and the like, which only a page marks.
    """

    position: tuple[float, float, float]
    words: str
    colour: str
    always: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Poses that were asked for.

    Attributes:
        position: In [m], shape (n, 3).
        quat_xyzw: Orientations [-], shape (n, 4); None where none was asked for.
        reached: Which of them are reached, shape (n,).
        t_ns: Times in [ns], shape (n,); None without times.
        reasons: Why they are not, one each; empty where nothing is known.
    """

    position: FloatArray
    quat_xyzw: FloatArray | None
    reached: BoolArray
    t_ns: IntArray | None
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What the 3D view shows.

    Attributes:
        title: The name of the view: whose arm it is, and what else must be said of it.
        arms: The moving arm first, ghosts behind it.
        paths: From the back to the front.
        spots: Places with a word.
        targets: What was asked for, if it was poses.
        arrows: What is drawn at places, at all times.
        balls: What is drawn about places, at all times.
        solids: Bodies and other things, at rest or moving.
        moving_lines: Lines whose points move.
        plane: The view along the normal of a planar mechanism; None for the general one.
    """

    title: str = ""
    arms: tuple[Arm, ...] = ()
    paths: tuple[Path, ...] = ()
    spots: tuple[Spot, ...] = ()
    targets: Targets | None = None
    arrows: Arrows | None = None
    balls: Balls | None = None
    solids: tuple[Solid, ...] = ()
    moving_lines: tuple[MovingLines, ...] = ()
    plane: PlaneView | None = None


def ball_sizes(masses: Sequence[Element]) -> FloatArray:
    """Return the radii of balls of one density with some masses in [kg], the largest 1, shape (n,)."""
    sizes = np.cbrt(np.array(masses, dtype=np.float64))
    return np.asarray(sizes / (sizes.max(initial=0.0) or 1.0))
