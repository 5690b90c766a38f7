"""The figures of a test after ISO 9283.

1. Plots over the length of the path: AT and RT (`deviation_figure`), speed (`speed_figure`).
2. Space: the mean path with the tube of RT around it (`path_figure`), also for the scene.
3. Drawings (SVG), much enlarged: attained points of poses (`pose_drawing`), mean paths at corners
   (`corner_drawing`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import escape_html
from urmpipe_pipeline import text
from urmpipe_pipeline.iso9283.corners import CornerPath
from urmpipe_pipeline.iso9283.result import AttainedPoses, CutPath, IsoTest
from urmpipe_pipeline.iso9283.tables import format_amount
from urmpipe_pipeline.presentation.curves import decimate
from urmpipe_pipeline.presentation.figure import Drawing, Figure, Line, Mark, Over, Panel, SpaceFigure, View
from urmpipe_pipeline.presentation.palette import (
    AXIS_COLOURS,
    DEVIATION_COLOUR,
    INK_COLOUR,
    REFERENCE_COLOUR,
    RUN_COLOURS,
)
from urmpipe_pipeline.presentation.parts import ends
from urmpipe_pipeline.presentation.projections import ABOVE, FRONT, SIDEWAYS
from urmpipe_pipeline.presentation.scene import Path

COLOURS = {"AT": AXIS_COLOURS["norm"], "RT": AXIS_COLOURS["z"]}
TUBE_COLOUR = RUN_COLOURS["sky blue"]  # of the tube of RT around the mean path, and of the balls of RP
CYCLES_COLOUR = RUN_COLOURS["violet"]
ATTAINED_COLOUR = AXIS_COLOURS["norm"]  # of attained points and mean paths in drawings
MEASURE_COLOUR = DEVIATION_COLOUR  # of barycentres, and of the lengths that are measured from them

FACTORS = tuple(
    digit * 10**power for power in range(4, -1, -1) for digit in (5, 2, 1) if digit * 10**power > 1
)  # by which a deviation may be enlarged, the largest first
MAX_DISPLAYED = 0.12  # of the radius of the command: an enlarged deviation
CORNER_GAP = 1.5  # median steps between planes: a larger one has a corner inside
MAX_RINGS = 60  # of a tube
RING_PIECES = 24
SPEED_POINTS = 20_000  # of all cycles together, about
MIN_SPEED_POINTS = 120  # of each cycle
MAX_MARKED = 8  # corners in the plot of the speed: the labels of more would overlap

MAX_DRAWN = 12  # poses, or corners, in a drawing: the worst
POSE_PX, CORNER_PX = 170, 250  # px, width and height of a view of a pose, and of a corner
GAP_PX, HEAD_PX, FOOT_PX, LEGEND_PX = 52, 44, 36, 30  # px, left of a view, above it, below it, for the legend
TICKS_PX = 36  # px between two numbers of an axis, at least
VIEW_MARGIN = 1.15  # width of a view / width of its content
CORNER_MARGIN = 4.0  # half width of a view of a corner / its CR or CO
MAX_WIDENING = 4.0  # of that width, to show an overshoot that is far from its corner
CORNER_VERTICES = 600  # of a line in a view of a corner, about
CORNER_ORIGIN = (0.6, 0.3)  # where a corner is in its view: the legs come from the left and go up
MIN_HALF_WIDTH = 1e-7  # m, of a view: less is rounding
MAX_ABREAST = {"poses": 2, "corners": 4}
HALO = 'stroke="white" stroke-width="4" paint-order="stroke" stroke-linejoin="round"'  # of a label on a line
SMALL = 'fill="#5b6770" font-size="10"'


def deviation_figure(test: IsoTest, path: CutPath) -> Figure:
    """Return AT and RT over the length of the path, with their tolerances."""
    values = {"AT": path.accuracy}
    if path.repeatability is not None:
        values["RT"] = path.repeatability
    gaps = _corner_gaps(path)
    over = Over(np.insert(path.s, gaps, np.nan), "s", "m", joined=True)  # a NaN length interrupts the line
    tolerances = {criterion.name: criterion.tolerance for criterion in test.overall}
    panels = tuple(
        _deviation_panel(name, np.insert(at_planes, gaps, 0.0), over, tolerances.get(name))
        for name, at_planes in values.items()
    )
    worst = []
    for name, at_planes in values.items():
        k = int(np.argmax(at_planes))
        largest, s = format_amount(float(at_planes[k]), "m"), format_amount(float(path.s[k]), "m")
        worst.append(f"{name} at most {largest} at s = {s}")
    dashed = " Grey: what is allowed." if any(tolerances.get(name) is not None for name in values) else ""
    none = "; there are none about corners" if path.corners else ""
    return Figure(
        "Accuracy and repeatability along the path",
        f"At each plane that cuts the command, over its length{none}. AT: distance of the mean path; RT:"
        f" radius of the tube about the mean path. Diamonds: the largest.{dashed}",
        f"{len(path.s)} planes cut a path of {format_amount(path.total, 'm')}. {'; '.join(worst)}.",
        (View("Accuracy and repeatability along the path", panels),),
    )


def _deviation_panel(name: str, values: FloatArray, over: Over, tolerance: float | None) -> Panel:
    """Return the panel of a criterion at the planes in [m], shape (m,)."""
    k = int(np.argmax(values))
    lines = [Line(values, (name,), (COLOURS[name],), strong=True)]
    label = f"{name} {format_amount(float(values[k]), 'm')}"
    mark = Mark(k, float(values[k]), "diamond", COLOURS[name], label, name)
    if tolerance is not None:
        limit = np.full(len(values), np.nan)
        limit[[0, -1]] = tolerance
        lines.insert(0, Line(limit, (f"{name} allowed",), (REFERENCE_COLOUR,), dashed=True))
    return Panel(name, "m", tuple(lines), signed=False, marks=(mark,), over=over, small=True)


def speed_figure(path: CutPath) -> Figure:
    """Return the speed of all cycles over the length of the path, their mean and the commanded one.

    The cycles are one line, with a gap after each: a legend of many cycles would be longer than the plot.
    """
    s, cycles = _concatenate_speeds(path)
    mean = np.full(len(path.speed_s), np.nan)
    known = np.isfinite(path.speed).any(axis=0)
    mean[known] = np.nanmean(path.speed[:, known], axis=0)
    no_mean, no_cycle = np.full(len(mean), np.nan), np.full(len(s), np.nan)
    lines = (
        Line(np.concatenate((no_mean, no_mean, cycles)), ("cycles",), (CYCLES_COLOUR,)),
        Line(
            np.concatenate((no_mean, path.commanded_speed, no_cycle)),
            ("commanded",),
            (INK_COLOUR,),
            dashed=True,
        ),
        Line(np.concatenate((mean, no_mean, no_cycle)), ("mean",), (DEVIATION_COLOUR,), strong=True),
    )
    over = Over(np.concatenate((path.speed_s, path.speed_s, s)), "s", "m", joined=True)
    marks = tuple(_leg_marks(path, mean))
    panel = Panel("v", "m/s", lines, signed=False, marks=marks, over=over)
    legs = "; ".join(mark.words for mark in marks)
    return Figure(
        "Speed along the path",
        "The speed of each cycle, their mean and the commanded speed over the length of the command."
        " Diamonds: the middle of each straight leg with a constant commanded speed; AV, RV and FV are"
        " evaluated on its middle half. Dotted: corners.",
        f"Speed of {format_count(len(path.speed), 'cycle')} over a path of {format_amount(path.total, 'm')}."
        f" {legs or 'No leg is judged'}.",
        (View("Speed along the path", (panel,)),),
        dict(_corner_rows(path)),
    )


def _concatenate_speeds(path: CutPath) -> tuple[FloatArray, FloatArray]:
    """Return lengths in [m] and speeds in [m/s] of all cycles one after the other, thinned out.

    Between two cycles the length is NaN, which interrupts the line; the speed there is not drawn.
    """
    s, speeds = [], []
    for speed in path.speed:
        rows = decimate(speed, max(SPEED_POINTS // len(path.speed), MIN_SPEED_POINTS))
        rows = rows[np.isfinite(speed[rows])]
        s.append(np.append(path.speed_s[rows], np.nan))
        speeds.append(np.append(speed[rows], 0.0))
    return np.concatenate(s), np.concatenate(speeds)


def _leg_marks(path: CutPath, mean: FloatArray) -> Iterator[Mark]:
    """Yield a mark in the middle of each leg on the mean speed in [m/s], shape (q,)."""
    for leg in path.legs:
        row = int(np.argmin(np.abs(path.speed_s - (leg.begins + leg.ends) / 2.0)))
        if np.isfinite(mean[row]):
            values = (
                ("AV", format_amount(leg.accuracy, "1", signed=True)),
                ("RV", format_amount(leg.repeatability, "1")),
                ("FV", format_amount(leg.fluctuation, "m/s")),
            )
            label = ", ".join(f"{name} {value}" for name, value in values if value != text.NOTHING)
            yield Mark(row, float(mean[row]), "diamond", DEVIATION_COLOUR, f"{leg.name}: {label}", "mean")


def _corner_rows(path: CutPath) -> Iterator[tuple[int, str]]:
    """Yield the row of the drawn speeds of each corner; none if there are many corners."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path.path, axis=0), axis=1)))
    vertex = 0  # corners come one after the other: a path may pass one point twice
    for corner in path.corners if len(path.corners) <= MAX_MARKED else ():
        vertex += int(np.argmin(np.linalg.norm(path.path[vertex:] - corner.point, axis=1)))
        yield int(np.argmin(np.abs(path.speed_s - length[vertex]))), corner.name


def path_figure(path: CutPath) -> SpaceFigure:
    """Return the mean path in the colours of AT, with the tube of RT around it, both enlarged."""
    factor = display_factor(path, None)
    of_tube = tube(path, factor)
    caption = "" if of_tube is None else " Blue rings: the tube of RT about it, as much enlarged."
    worst = int(np.argmax(path.accuracy))
    return SpaceFigure(
        "Mean path and its tube",
        "Equal scale on all axes. Grey: command. Coloured by AT: the mean path, its deviation drawn"
        f" x{factor}.{caption}",
        f"Mean path of {format_count(len(path.crossed), 'cycle')} in space, its deviation drawn x{factor}."
        f" AT at most {format_amount(float(path.accuracy[worst]), 'm')} at x, y, z ="
        f" {text.format_point(path.command[worst])} m.",
        tuple(line for line in (command_line(path), of_tube, mean_line(path, factor)) if line is not None),
        ends(path.path),
    )


def command_line(path: CutPath) -> Path:
    """Return the command as a line."""
    return Path("command", path.path, None, REFERENCE_COLOUR, asked=True)


def mean_line(path: CutPath, factor: int) -> Path:
    """Return the mean path with its deviation enlarged by a factor, in the colours of AT."""
    gaps = _corner_gaps(path)
    position = np.insert(path.command + factor * (path.mean - path.command), gaps, np.nan, axis=0)
    values = np.insert(path.accuracy, gaps, np.nan)
    return Path(f"AT, deviation x{factor}", position, None, AXIS_COLOURS["norm"], values=values)


def _corner_gaps(path: CutPath) -> IntArray:
    """Return the planes before which there is a corner, around which no plane cuts the path, shape (g,)."""
    step = np.diff(path.s)
    return np.flatnonzero(step > CORNER_GAP * np.median(step)) + 1 if len(step) else np.empty(0, np.int64)


def tube(path: CutPath, factor: int) -> Path | None:
    """Return rings of the radius RT around the mean path, both enlarged by a factor; None for one cycle."""
    if path.repeatability is None:
        return None
    rows = np.unique(np.linspace(0, len(path.s) - 1, min(MAX_RINGS, len(path.s))).astype(np.int64))
    centre = path.command[rows] + factor * (path.mean - path.command)[rows]
    rings = circles(centre, path.normal[rows], factor * path.repeatability[rows])
    return Path(f"tube of RT x{factor}", rings, None, TUBE_COLOUR)


def circles(centre: FloatArray, normal: FloatArray, radius: FloatArray) -> FloatArray:
    """Return circles one after the other, a row of NaN between two.

    Args:
        centre: In [m], shape (n, 3).
        normal: The normal of the plane of each [-], shape (n, 3).
        radius: In [m], shape (n,).

    Returns:
        In [m], shape (26 n, 3).
    """
    least = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    angle = np.linspace(0.0, 2.0 * np.pi, RING_PIECES + 1)[:, np.newaxis, np.newaxis]
    points = centre + radius[:, np.newaxis] * (np.cos(angle) * first + np.sin(angle) * second)
    gap = np.full((1, *centre.shape), np.nan)
    return np.concatenate((points, gap)).transpose(1, 0, 2).reshape(-1, 3)


def display_factor(path: CutPath | None, poses: AttainedPoses | None) -> int:
    """Return the factor by which the deviations of a test are enlarged; they stay small in its scene."""
    largest, places = [0.0], []
    if path is not None:
        spread = 0.0 if path.repeatability is None else path.repeatability
        largest.append(float(np.max(path.accuracy + spread)))
        places.append(path.path)
    if poses is not None:
        largest.append(float(np.linalg.norm(poses.attained - poses.command, axis=2).max()))
        places.append(poses.command)
    radius = float(np.linalg.norm(np.ptp(np.concatenate(places), axis=0))) / 2.0 or 1.0
    return next((factor for factor in FACTORS if factor * max(largest) <= MAX_DISPLAYED * radius), 1)


class _View(NamedTuple):
    """A square that shows a plane, with axes in [mm] from a point.

    Attributes:
        left: In pixels.
        top: In pixels.
        size: Its width and height in pixels.
        half: Half of its width in [m].
        origin: Where the point is, as shares of its width and height, from the left and from below.
    """

    left: float
    top: float
    size: float
    half: float
    origin: tuple[float, float] = (0.5, 0.5)

    @property
    def scale(self) -> float:
        """Pixels per [m]."""
        return self.size / 2.0 / self.half

    def to_pixels(self, points: FloatArray) -> FloatArray:
        """Return points from the origin in [m], to the right and up, shape (n, 2), in pixels."""
        right, up = self.origin
        origin = np.array([self.left + right * self.size, self.top + (1.0 - up) * self.size])
        return np.asarray(origin + points * [1.0, -1.0] * self.scale)

    def ticks(self, origin: float) -> list[float]:
        """Return the round numbers in [mm] of an axis with its zero at a share of it."""
        least = 1e3 * TICKS_PX / self.scale
        power = 10.0 ** math.floor(math.log10(least))
        step = next(
            digit * power for digit in (1.0, 2.0, 2.5, 5.0, 10.0) if digit * power >= least * (1.0 - 1e-9)
        )
        low, high = (
            math.floor(2e3 * self.half * share / step * (1.0 - 1e-9)) for share in (origin, 1.0 - origin)
        )
        return [step * k for k in range(-low, high + 1)]

    def frame(self, right: str, up: str, clip: str) -> Iterator[str]:
        """Yield its edge, its numbers in [mm], and the region to which its content is cut."""
        edge = f'x="{self.left:.1f}" y="{self.top:.1f}" width="{self.size:g}" height="{self.size:g}"'
        bottom, end = self.top + self.size, self.left + self.size
        yield f'<clipPath id="{clip}"><rect {edge}/></clipPath>'
        yield f'<rect {edge} fill="none" stroke="#c3cad0"/>'
        left = self.left - 4.0
        for value in self.ticks(self.origin[0]):
            x = self.to_pixels(np.array([[value, 0.0]]) / 1e3)[0, 0]
            across = f'x1="{x:.1f}" y1="{self.top:.1f}" x2="{x:.1f}" y2="{bottom:.1f}"'
            yield f'<line {across} stroke="#e4e8eb"/>'
            yield f'<text x="{x:.1f}" y="{bottom + 13:.1f}" text-anchor="middle" {SMALL}>{value:.6g}</text>'
        for value in self.ticks(self.origin[1]):
            y = self.to_pixels(np.array([[0.0, value]]) / 1e3)[0, 1]
            along = f'x1="{self.left:.1f}" y1="{y:.1f}" x2="{end:.1f}" y2="{y:.1f}"'
            yield f'<line {along} stroke="#e4e8eb"/>'
            yield f'<text x="{left:.1f}" y="{y + 3:.1f}" text-anchor="end" {SMALL}>{value:.6g}</text>'
        yield f'<text x="{end:.1f}" y="{bottom + 27:.1f}" text-anchor="end" {SMALL}>{right} [mm]</text>'
        yield f'<text x="{self.left:.1f}" y="{self.top - 5:.1f}" {SMALL}>{up} [mm]</text>'


def pose_drawing(test: IsoTest, poses: AttainedPoses) -> Drawing:
    """Return each pose as the cloud of its attained points, in three projections of one scale."""
    ap, rp = (criterion_by_pose(test, name, len(poses.command)) for name in ("AP", "RP"))
    drawn = _worst(np.nan_to_num(ap) + np.nan_to_num(rp))
    columns = min(MAX_ABREAST["poses"], len(drawn))
    width, height = 3 * (POSE_PX + GAP_PX), HEAD_PX + POSE_PX + FOOT_PX
    parts: list[str] = []
    for place, k in enumerate(drawn):
        parts += _pose_views(poses, k, (ap[k], rp[k]), width * (place % columns), height * (place // columns))
    rows = -(-len(drawn) // columns)
    title = f"{_count_drawn('poses', len(drawn), len(poses.command))}, in mm about the command"
    legend = (
        (f'<path d="{_cross(0.0, 0.0)}" stroke="{INK_COLOUR}" stroke-width="2"/>', "command"),
        (f'<circle r="3" fill="{ATTAINED_COLOUR}"/>', "attained"),
        (f'<circle r="4" fill="{MEASURE_COLOUR}"/>', "barycentre"),
        (f'<circle r="6" fill="none" stroke="{MEASURE_COLOUR}" stroke-width="1.5"/>', "RP about it"),
    )
    svg = _svg(width * columns, height * rows, f"{title}, after ISO 9283", parts, legend)
    signs = "Cross: command; dots: attained; crimson: barycentre and, around it, the circle of RP."
    values = "; ".join(_format_pose(k, ap[k], rp[k]) for k in drawn)
    return Drawing("Attained poses", f"{title}. {signs} {values}.", svg)


def corner_drawing(path: CutPath) -> Drawing:
    """Return each corner enlarged, in the plane of its legs, with CR and CO as lengths."""
    drawn = _worst(np.array([max(corner.rounding, corner.overshoot or 0.0) for corner in path.corners]))
    columns = min(MAX_ABREAST["corners"], len(drawn))
    width, height = CORNER_PX + GAP_PX, HEAD_PX + CORNER_PX + FOOT_PX
    parts: list[str] = []
    for place, k in enumerate(drawn):
        parts += _corner_view(path.corners[k], width * (place % columns), height * (place // columns))
    rows = -(-len(drawn) // columns)
    count = _count_drawn("corners", len(drawn), len(path.corners))
    title = f"{count}, in mm, in the plane of its two legs"
    legend = (
        (
            f'<path d="M-9 0H9" stroke="{REFERENCE_COLOUR}" stroke-width="4"/>',
            "command, to the right, then up",
        ),
        (f'<path d="M-9 0H9" stroke="{ATTAINED_COLOUR}" stroke-width="2"/>', "mean path"),
        (f'<path d="M-9 0H9" stroke="{MEASURE_COLOUR}" stroke-width="2"/>', "CR and CO"),
    )
    svg = _svg(width * columns, height * rows, f"{title}, after ISO 9283", parts, legend)
    values = "; ".join(f"{path.corners[k].name}: {_format_corner(path.corners[k])}" for k in drawn)
    return Drawing("Corners, enlarged", f"{title}. Grey: command; orange: mean path. {values}.", svg)


def criterion_by_pose(test: IsoTest, name: str, count: int) -> FloatArray:
    """Return a criterion of each pose in its unit, NaN where it has no value, shape (count,)."""
    values = {criterion.at: criterion.value for criterion in test.criteria if criterion.name == name}
    by_pose = (values.get(f"pose {k + 1}") for k in range(count))
    return np.array([math.nan if value is None else value for value in by_pose])


def _worst(sizes: FloatArray) -> list[int]:
    """Return the numbers of the largest sizes in [m], shape (n,), in their order."""
    return sorted(np.argsort(-sizes, kind="stable")[:MAX_DRAWN].tolist())


def _count_drawn(noun: str, drawn: int, total: int) -> str:
    if drawn < total:
        return f"The {drawn} worst of {total} {noun}"
    return f"Each of {total} {noun}" if total > 1 else f"The only {noun[:-1]}"


def _pose_views(
    poses: AttainedPoses, k: int, sizes: tuple[float, float], left: float, top: float
) -> Iterator[str]:
    """Yield a pose with its AP and RP in [m] in three projections, from a corner of the drawing in pixels."""
    cloud = poses.attained[:, k] - poses.command[k]
    centre, radius = cloud.mean(axis=0), float(np.nan_to_num(sizes[1]))
    half = max(float(np.abs(cloud).max()), float(np.abs(centre).max()) + radius, MIN_HALF_WIDTH)
    yield _title(_format_pose(k, *sizes), left, top)
    for column, projection in enumerate((SIDEWAYS, FRONT, ABOVE)):
        x = left + GAP_PX + column * (POSE_PX + GAP_PX)
        view = _View(x, top + HEAD_PX, POSE_PX, VIEW_MARGIN * half)
        clip = f"pose{k + 1}-{column}"
        yield from view.frame("xyz"[projection.right], "xyz"[projection.up], clip)
        end = f'x="{x + POSE_PX:.1f}" y="{view.top - 5:.1f}"'
        yield f'<text {end} {SMALL} text-anchor="end">{projection.title}</text>'
        axes = [projection.right, projection.up]
        middle = view.to_pixels(centre[np.newaxis, axes])[0].tolist()
        yield f'<g clip-path="url(#{clip})">{_dots(view.to_pixels(cloud[:, axes]))}'
        yield _circle(
            middle, radius * view.scale, f'fill="none" stroke="{MEASURE_COLOUR}" stroke-width="1.5"'
        )
        yield _circle(middle, 4.0, f'fill="{MEASURE_COLOUR}" stroke="white"')
        origin = view.to_pixels(np.zeros((1, 2)))[0].tolist()
        yield f'<path d="{_cross(*origin)}" stroke="{INK_COLOUR}" stroke-width="2"/></g>'


def _corner_view(corner: CornerPath, left: float, top: float) -> Iterator[str]:
    """Yield a corner with CR and CO, from a corner of the drawing in pixels."""
    view = _View(left + GAP_PX, top + HEAD_PX, CORNER_PX, _corner_half_width(corner), CORNER_ORIGIN)
    clip, axes = corner.name.replace(" ", ""), _corner_axes(corner)
    yield _title(f"{corner.name}: {_format_corner(corner)}", left, top)
    yield from view.frame("along", "aside", clip)
    yield f'<g clip-path="url(#{clip})" fill="none" stroke-linejoin="round">'
    for points, style in (
        (corner.command, f'stroke="{REFERENCE_COLOUR}" stroke-width="5"'),
        (corner.mean, f'stroke="{ATTAINED_COLOUR}" stroke-width="2"'),
    ):
        visible = _clip((points - corner.point) @ axes, 2.0 * view.half)
        yield f'<path d="{_polyline(view.to_pixels(visible))}" {style}/>'
    yield "</g>"
    lengths = {"CR": (corner.point, corner.nearest)}
    if corner.overshoot_point is not None and corner.nearest_on_leg is not None:
        distance = float(np.linalg.norm(corner.overshoot_point - corner.point))
        if distance <= view.half:
            lengths["CO"] = (corner.nearest_on_leg, corner.overshoot_point)
        else:
            bottom = f'x="{view.left + 6:.1f}" y="{view.top + view.size - 8:.1f}"'
            yield f'<text {bottom} fill="#5b6770">CO: {format_amount(distance, "m")} from the corner</text>'
    for name, both in lengths.items():
        yield from _length(name, view.to_pixels((np.array(both) - corner.point) @ axes))


def _clip(points: FloatArray, half: float) -> FloatArray:
    """Return the visible part of a line in [m], shape (n, 2), thinned out.

    A mean path has a vertex for each row of each cycle.
    """
    inside = np.flatnonzero(np.abs(points).max(axis=1) <= half)
    if len(inside):
        points = points[max(inside[0] - 1, 0) : inside[-1] + 2]
    return np.asarray(points[decimate(points, CORNER_VERTICES)])


def _corner_half_width(corner: CornerPath) -> float:
    """Return half of the width of a corner's view in [m], so that CR and CO are visible.

    An overshoot that is far away for its size is left out: next to that distance nothing would be visible.
    """
    legs = max(float(np.linalg.norm(corner.command[end] - corner.point)) for end in (0, -1))
    half = min(CORNER_MARGIN * max(corner.rounding, corner.overshoot or 0.0), legs)
    distance = 0.0
    if corner.overshoot_point is not None:
        distance = VIEW_MARGIN * float(np.linalg.norm(corner.overshoot_point - corner.point))
    return max(half, distance if distance <= MAX_WIDENING * half else 0.0, MIN_HALF_WIDTH)


def _corner_axes(corner: CornerPath) -> FloatArray:
    """Return the axes of a corner's view, shape (3, 2): along its first leg, and from it to the second."""
    before, after = corner.point - corner.command[0], corner.command[-1] - corner.point
    right = before / np.linalg.norm(before)
    for aside in (after, corner.mean.mean(axis=0) - corner.point, *np.eye(3)):  # if the path turns back
        up = aside - (aside @ right) * right
        if (size := float(np.linalg.norm(up))) > 1e-6 * float(np.linalg.norm(before)):
            return np.column_stack((right, up / size))
    raise AssertionError("one of three axes is off any line")


def _length(name: str, points: FloatArray) -> Iterator[str]:
    """Yield a length between two points in pixels, shape (2, 2), with its name."""
    (x1, y1), (x2, y2) = points.tolist()
    place = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    yield f'<line class="{name}" {place} stroke="{MEASURE_COLOUR}" stroke-width="2"/>'
    yield from (_circle(point, 2.5, f'fill="{MEASURE_COLOUR}"') for point in points.tolist())
    x, y, anchor = x2 - 8.0, y2 - 4.0, "end"
    if name == "CO":
        x, y, anchor = (x1 + x2) / 2.0, (y1 + y2) / 2.0 - 8.0, "middle"
    yield f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {HALO}>{name}</text>'


def _format_pose(k: int, ap: float, rp: float) -> str:
    accuracy = f"pose {k + 1}: AP {format_amount(ap, 'm')}"
    return accuracy if math.isnan(rp) else f"{accuracy}, RP {format_amount(rp, 'm')}"


def _format_corner(corner: CornerPath) -> str:
    rounding = f"CR {format_amount(corner.rounding, 'm')}"
    return rounding if corner.overshoot is None else f"{rounding}, CO {format_amount(corner.overshoot, 'm')}"


def _title(title: str, left: float, top: float) -> str:
    return f'<text x="{left + GAP_PX:.1f}" y="{top + 20:.1f}">{escape_html(title)}</text>'


def _dots(points: FloatArray) -> str:
    """Return dots at points in pixels, shape (n, 2), in one element: there may be thousands."""
    path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points.tolist())
    style = f'stroke="{ATTAINED_COLOUR}" stroke-width="6" stroke-linecap="round" stroke-opacity="0.75"'
    return f'<path class="attained" d="{path}" {style}/>'


def _circle(centre: Sequence[float], radius: float, style: str) -> str:
    return f'<circle cx="{centre[0]:.1f}" cy="{centre[1]:.1f}" r="{radius:.1f}" {style}/>'


def _cross(x: float, y: float) -> str:
    return f"M{x - 7:.1f} {y:.1f}h14M{x:.1f} {y - 7:.1f}v14"


def _polyline(points: FloatArray) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points.tolist())


def _svg(
    width: float, height: float, title: str, parts: Sequence[str], legend: Sequence[tuple[str, str]]
) -> str:
    """Return a drawing with a legend below: signs around the origin, and their labels."""
    width, total = width + 20, height + LEGEND_PX
    size = f'width="{width:.0f}" height="{total:.0f}" viewBox="0 0 {width:.0f} {total:.0f}"'
    entries, x = [], float(GAP_PX) + 10.0
    for sign, label in legend:
        entries.append(f'<g transform="translate({x:.0f} {height + 10:.0f})">{sign}')
        entries.append(f'<text x="14" y="4">{escape_html(label)}</text></g>')
        x += 40.0 + 6.6 * len(label)
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="12">',
            f"<title>{escape_html(title)}</title>",
            '<rect width="100%" height="100%" fill="white"/>',
            *parts,
            *entries,
            "</svg>\n",
        )
    )
