"""A network that moves: its scene for the viewer, its drawing as SVG, and its figure in space.

All three take a `MovingNetwork`. Bodies and joints move as solids in the frame of a body, elements as lines
whose points move.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.math3d import to_quaternions
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.parts import ConstraintElement, Joint
from urmpipe_pipeline.networks.drives import Tie, ties
from urmpipe_pipeline.networks.parts_in_space import (
    BODY_COLOURS,
    ROD,
    Placed,
    element_lines,
    find_plane,
    parts,
    placed_at,
)
from urmpipe_pipeline.networks.scene import joined_labels, part_solids
from urmpipe_pipeline.networks.sketch import mechanism_pieces, part_names, sketch_svg
from urmpipe_pipeline.presentation.figure import SpaceFigure
from urmpipe_pipeline.presentation.parts import spot_at
from urmpipe_pipeline.presentation.projections import Piece, Sketch
from urmpipe_pipeline.presentation.scene import Motion, MovingLines, Scene, Solid, Spot
from urmpipe_pipeline.presentation.scene import Path as CurvePath

Curve: TypeAlias = tuple[str, FloatArray]
"""Name of a traced point, and its positions in [m], shape (n, 3)."""

CURVE_COLOURS = (BODY_COLOURS[3], BODY_COLOURS[4], BODY_COLOURS[5], *BODY_COLOURS[:3])
"""One per curve, beginning with those that a network of four bodies has no body in."""

INSTANTS, GHOST_OPACITY = 6, 0.13
"""Further instants that a drawing shows, and their opacity."""

CLOSED = 1e-6
"""A curve whose ends are nearer than this share of its extent is closed."""

FIRST_BODY_KINDS = ("revolute", "global")
"""Joints whose symbols belong to the first body; of the others they slide with the second."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingNetwork:
    """A network over time.

    Attributes:
        network: The network.
        poses: Of the bodies in the order of `Network.body_names`, as matrices [-] and [m], shape
            (n, bodies, 4, 4).
        lengths: Of the elements in [m], shape (n, elements).
        t_ns: Times in [ns], shape (n,).
        curves: Traced points.
        title: Name of the view.
    """

    network: Network
    poses: FloatArray
    lengths: FloatArray
    t_ns: IntArray
    curves: Sequence[Curve] = ()
    title: str = ""

    def at(self, row: int) -> Placed:
        """Return where everything is at an instant."""
        return placed_at(self.network, self.poses[row], self.lengths[row])

    def of_body(self, body: str) -> FloatArray:
        """Return the poses of a body [-] and [m], shape (n, 4, 4)."""
        return self.poses[:, self.network.body_names.index(body)]

    def element_lines(self, k: int) -> tuple[FloatArray, ...]:
        """Return the lines of an element by its number in [m], shape (n, points, 3) each."""
        first, element = self.at(0), self.network.elements[k]
        lines = []
        for poses, length in zip(self.poses, self.lengths[:, k].tolist(), strict=True):
            here = replace(first, poses=dict(zip(self.network.body_names, poses, strict=True)))
            lines.append(element_lines(here, element, length))
        return tuple(np.array(line) for line in zip(*lines, strict=True))


def moving_scene(motion: MovingNetwork) -> Scene:
    """Return a network in motion for the viewer."""
    network, first, owners = motion.network, motion.at(0), ties(motion.network)
    solids: list[Solid] = []
    lines: list[MovingLines] = []
    for solid in part_solids(first):
        owner = owners.get(solid.name) if solid.group != "bodies" else None
        if isinstance(owner, ConstraintElement):
            strips = motion.element_lines(network.elements.index(owner))
            radius = ROD * first.extent if owner.kind == "gg" else 0.0
            lines.append(
                MovingLines(solid.group, solid.name, solid.colour, strips, motion.t_ns, radius, solid.label)
            )
            solids += _moving_surface(motion, owner, solid, strips[-1][:, 0])
        else:
            solids += _moving_solids(motion, owner, solid)
    paths = (
        CurvePath(name, position, motion.t_ns, colour, label=name)
        for (name, position), colour in _coloured(motion.curves)
    )
    return Scene(
        motion.title,
        paths=tuple(paths),
        solids=tuple(solids),
        moving_lines=tuple(lines),
        plane=find_plane(first),
    )


def motion_svg(motion: MovingNetwork) -> str:
    """Return a network in motion as SVG: a planar one in its plane, others in three projections.

    The first instant is drawn in full, further ones faintly; curves have their start and end marked.
    """
    network, first = motion.network, motion.at(0)
    first_parts = parts(first)
    pieces = [piece for row in _further_rows(motion.poses) for piece in _ghost(motion.at(row))]
    pieces += mechanism_pieces(network, first_parts)
    pieces += [Piece(position, colour, 2.0, front=True) for (_, position), colour in _coloured(motion.curves)]
    ends = [spot for curve, colour in _coloured(motion.curves) for spot in _curve_ends(*curve, colour)]
    marks = [replace(end, words="") for end in ends]
    sketch = Sketch(pieces=pieces, spots=marks, names=[*ends, *part_names(network, first_parts)])
    return sketch_svg(sketch, find_plane(first), motion.title)


def motion_space_figure(motion: MovingNetwork) -> SpaceFigure:
    """Return a network at its first instant in space, with the curves of its traced points."""
    first, name = motion.at(0), motion.network.name
    paths = tuple(
        CurvePath(label, position, None, colour) for (label, position), colour in _coloured(motion.curves)
    )
    caption = f"{name}, at the first instant. Grey: the ground; vermilion: what controls drive."
    alt = f"{name} in three dimensions, with the curves of {len(paths)} points."
    solids = joined_labels(list(part_solids(first)))
    return SpaceFigure("In space", caption, alt, paths, solids=solids, plane=find_plane(first))


def _coloured(curves: Sequence[Curve]) -> Iterator[tuple[Curve, str]]:
    """Yield curves with their colours."""
    for k, curve in enumerate(curves):
        yield curve, CURVE_COLOURS[k % len(CURVE_COLOURS)]


def _moving_solids(motion: MovingNetwork, owner: Tie | None, solid: Solid) -> Iterator[Solid]:
    """Yield a body, or a joint: its symbol with the body that it belongs to, its rail with the first one."""
    if not isinstance(owner, Joint):
        yield _carried(motion, solid, solid.name)
        return
    if owner.kind in FIRST_BODY_KINDS:
        yield _carried(motion, solid, owner.bodies[0])
        return
    if owner.kind in ("prismatic", "cylindrical", "helical"):
        rail = replace(
            solid,
            name=f"{solid.name} rail",
            triangles=np.empty((0, 3, 3)),
            lines=(_long_rail(motion, owner, solid.lines[0]),),
            label="",
        )
        yield _carried(motion, rail, owner.bodies[0])
    yield _carried(motion, replace(solid, lines=solid.lines[1:]), owner.bodies[1])


def _long_rail(motion: MovingNetwork, joint: Joint, rail: FloatArray) -> FloatArray:
    """Return the rail of a joint at the first instant, shape (2, 3) in [m], as long as the joint slides."""
    points = []
    for body, frame in zip(joint.bodies, joint.frames, strict=True):
        poses = motion.of_body(body)
        points.append(poses[:, :3, :3] @ np.array(frame.translation) + poses[:, :3, 3])
    axis = motion.of_body(joint.bodies[0])[:, :3, :3] @ np.array(joint.frames[0].rotation)[:, 1]
    slides = np.einsum("ni,ni->n", points[1] - points[0], axis)
    low, high = min(float(slides.min()), 0.0), max(float(slides.max()), 0.0)
    start, end = min(float(slides[0]), 0.0), max(float(slides[0]), 0.0)
    return rail + np.outer((low - start, high - end), axis[0])


def _carried(motion: MovingNetwork, solid: Solid, body: str) -> Solid:
    """Return a solid of the first instant as one that a body carries; the ground carries nothing away."""
    if body == motion.network.ground:
        return solid
    poses = motion.of_body(body)
    return _in_frame(solid, Motion(poses[:, :3, 3], _quaternions(poses), motion.t_ns), poses[0])


def _moving_surface(
    motion: MovingNetwork, element: ConstraintElement, solid: Solid, foot: FloatArray
) -> Iterator[Solid]:
    """Yield the plane or tube of an element, which follows its foot in [m], shape (n, 3)."""
    if element.kind not in ("eg", "gc"):
        return
    poses = motion.of_body(element.bodies[0]).copy()
    poses[:, :3, 3] = foot
    name = f"{solid.name} surface"
    surface = replace(solid, name=name, triangles=solid.triangles, lines=(), label="")
    yield _in_frame(surface, Motion(foot, _quaternions(poses), motion.t_ns), poses[0])


def _in_frame(solid: Solid, motion: Motion, pose: FloatArray) -> Solid:
    """Return a solid in the ground as one in a frame that moves, whose first pose is given, shape (4, 4)."""

    def local(points: FloatArray) -> FloatArray:
        return np.asarray((points - pose[:3, 3]) @ pose[:3, :3])

    return replace(
        solid,
        triangles=local(solid.triangles),
        lines=tuple(local(line) for line in solid.lines),
        at=spot_at(local(np.array(solid.at))),
        motion=motion,
    )


def _quaternions(poses: FloatArray) -> FloatArray:
    """Return the orientations of poses, shape (n, 4, 4), as quaternions x, y, z, w [-], shape (n, 4)."""
    return to_quaternions(poses[:, :3, :3].reshape(-1, 9), "matrix")


def _further_rows(poses: FloatArray) -> list[int]:
    """Return the rows of further instants, evenly spread; the last one if it differs from the first."""
    last = len(poses) - 1
    if last > 0 and np.allclose(poses[0], poses[-1], rtol=0.0, atol=CLOSED):
        spread = np.linspace(0.0, last, INSTANTS + 2)[1:-1]
    else:
        spread = np.linspace(0.0, last, INSTANTS + 1)[1:]
    return [row for row in np.unique(np.round(spread).astype(int)).tolist() if row]


def _ghost(at: Placed) -> Iterator[Piece]:
    """Yield a further instant: moving bodies and elements, faintly."""
    seen = [part for part in parts(at) if part.kind != "joint" and part.name != at.network.ground]
    for piece in mechanism_pieces(at.network, seen):
        yield piece._replace(width=0.8, opacity=GHOST_OPACITY, faint=True)


def _curve_ends(name: str, position: FloatArray, colour: str) -> Iterator[Spot]:
    """Yield the start and the end of a curve in [m], shape (n, 3)."""
    known = position[np.isfinite(position).all(axis=1)]
    if not len(known):
        return
    start, end = known[0], known[-1]
    closed = np.linalg.norm(end - start) <= CLOSED * np.linalg.norm(np.ptp(known, axis=0))
    yield Spot(spot_at(start), f"{name} start" + " and end" * bool(closed), colour)
    if not closed:
        yield Spot(spot_at(end), f"{name} end", colour)
