"""The plots of a test after ISO 9283 over the length of the path, and the path with its tube in space."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import escape_html
from urmpipe_pipeline import text
from urmpipe_pipeline.iso9283.corners import CornerPath
from urmpipe_pipeline.iso9283.result import AttainedPoses, CutPath, IsoTest
from urmpipe_pipeline.iso9283.tables import amount
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
"""Of accuracy and repeatability of the path."""

TUBE_COLOUR = RUN_COLOURS["sky blue"]
"""Of the tube of RT about the mean path, and of the balls of RP."""

CYCLES_COLOUR = RUN_COLOURS["violet"]
"""Of the cycles."""

FACTORS = tuple(
    digit * 10**power for power in range(4, -1, -1) for digit in (5, 2, 1) if digit * 10**power > 1
)
"""How many times a deviation may be drawn, the largest first."""

SEEN = 0.12
"""An enlarged deviation may be this share of the radius of the command."""

WIDE = 1.5
"""Planes that are further apart than so many median steps have a corner between them."""

RINGS, AROUND = 60, 24
"""Rings that a tube is drawn by, at most, and the pieces of each."""

POINTS, LEAST_POINTS = 20_000, 120
"""Points of all cycles' speeds together, about, and of each at least."""

MARKED = 8
"""Corners marked in the plot of the speed, at most: the words of more would overlap."""


def deviation_figure(test: IsoTest, path: CutPath) -> Figure:
    """Return AT and RT over the length of the path, with what is allowed of them."""
    values = {"AT": path.accuracy}
    if path.repeatability is not None:
        values["RT"] = path.repeatability
    gaps = _gaps(path)
    over = Over(np.insert(path.s, gaps, np.nan), "s", "m", joined=True)  # a length that is NaN parts a line
    allowed = {one.name: one.tolerance for one in test.overall}
    panels = tuple(
        _panel(name, np.insert(one, gaps, 0.0), over, allowed.get(name)) for name, one in values.items()
    )
    most = {name: int(np.argmax(one)) for name, one in values.items()}
    worst = (
        f"{name} at most {amount(float(values[name][k]), 'm')} at s = {amount(float(path.s[k]), 'm')}"
        for name, k in most.items()
    )
    dashed = " Grey: what is allowed." if any(allowed.get(name) is not None for name in values) else ""
    none = "; there are none about corners" if path.corners else ""
    return Figure(
        "Accuracy and repeatability along the path",
        f"At each plane that cuts the command, over its length{none}. AT: distance of the mean path; RT:"
        f" radius of the tube about the mean path. Diamonds: the largest.{dashed}",
        f"{len(path.s)} planes cut a path of {amount(path.total, 'm')}. {'; '.join(worst)}.",
        (View("Accuracy and repeatability along the path", panels),),
    )


def _panel(name: str, values: FloatArray, over: Over, allowed: float | None) -> Panel:
    """Return a criterion at the planes in [m], shape (m,), with what is allowed of it."""
    most = int(np.argmax(values))
    line = Line(values, (name,), (COLOURS[name],), strong=True)
    said = f"{name} {amount(float(values[most]), 'm')}"
    mark = Mark(most, float(values[most]), "diamond", COLOURS[name], said, name)
    lines = (line,) if allowed is None else (_at_ends(f"{name} allowed", allowed, len(values)), line)
    return Panel(name, "m", lines, signed=False, marks=(mark,), over=over, small=True)


def _at_ends(name: str, allowed: float, count: int) -> Line:
    """Return what is allowed in [m] as a line from the first to the last of so many rows."""
    values = np.full(count, np.nan)
    values[[0, -1]] = allowed
    return Line(values, (name,), (REFERENCE_COLOUR,), dashed=True)


def speed_figure(path: CutPath) -> Figure:
    """Return the speed of all cycles over the length of the path, their mean and the commanded one.

    The cycles are one line, with a gap behind each: a legend of many cycles would be longer than the plot.
    """
    rows = len(path.speed_s)
    s, cycles = _in_a_row(path)
    mean = np.full(rows, np.nan)
    known = np.isfinite(path.speed).any(axis=0)
    mean[known] = np.nanmean(path.speed[:, known], axis=0)
    lines = [
        Line(np.concatenate((np.full(2 * rows, np.nan), cycles)), ("cycles",), (CYCLES_COLOUR,)),
        Line(_in(1, path.commanded_speed, len(s)), ("commanded",), (INK_COLOUR,), dashed=True),
        Line(_in(0, mean, len(s)), ("mean",), (DEVIATION_COLOUR,), strong=True),
    ]
    over = Over(np.concatenate((path.speed_s, path.speed_s, s)), "s", "m", joined=True)
    marks = tuple(_leg_marks(path, mean))
    panel = Panel("v", "m/s", tuple(lines), signed=False, marks=marks, over=over)
    legs = "; ".join(mark.words for mark in marks)
    return Figure(
        "Speed along the path",
        "The speed of each cycle, their mean and the commanded speed over the length of the command."
        " Diamonds: the middle of each straight leg with a constant commanded speed, on whose middle half AV,"
        " RV and FV rest. Dotted: corners.",
        f"Speed of {text.counted(len(path.speed), 'cycle')} over a path of {amount(path.total, 'm')}."
        f" {legs or 'No leg is judged'}.",
        (View("Speed along the path", (panel,)),),
        dict(_corner_rows(path)),
    )


def _in(block: int, values: FloatArray, more: int) -> FloatArray:
    """Return values, shape (q,), in the first or the second of two blocks of rows that more rows follow."""
    nothing = np.full(len(values), np.nan)
    blocks = [nothing, nothing]
    blocks[block] = values
    return np.concatenate((*blocks, np.full(more, np.nan)))


def _in_a_row(path: CutPath) -> tuple[FloatArray, FloatArray]:
    """Return the speeds of all cycles one behind the other, thinned out: lengths in [m] and speeds in [m/s].

    Where one ends and the next begins, the length is NaN and the speed is none that counts: that is a gap.
    """
    s, speeds = [], []
    for speed in path.speed:
        rows = decimate(speed, max(POINTS // len(path.speed), LEAST_POINTS))
        rows = rows[np.isfinite(speed[rows])]
        s.append(np.append(path.speed_s[rows], np.nan))
        speeds.append(np.append(speed[rows], 0.0))
    return np.concatenate(s), np.concatenate(speeds)


def _leg_marks(path: CutPath, mean: FloatArray) -> Iterator[Mark]:
    """Yield a mark in the middle of each leg on the mean speed in [m/s], shape (q,)."""
    for leg in path.legs:
        row = int(np.argmin(np.abs(path.speed_s - (leg.begins + leg.ends) / 2.0)))
        if np.isfinite(mean[row]):
            told = (
                ("AV", amount(leg.accuracy, "1", signed=True)),
                ("RV", amount(leg.repeatability, "1")),
                ("FV", amount(leg.fluctuation, "m/s")),
            )
            said = ", ".join(f"{name} {value}" for name, value in told if value != text.NOTHING)
            yield Mark(row, float(mean[row]), "diamond", DEVIATION_COLOUR, f"{leg.name}: {said}", "mean")


def _corner_rows(path: CutPath) -> Iterator[tuple[int, str]]:
    """Yield the row of the drawn speeds that each corner stands at; nothing of many corners."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path.path, axis=0), axis=1)))
    least = 0  # corners come one after the other: a path may pass one place twice
    for corner in path.corners if len(path.corners) <= MARKED else ():
        near = least + int(np.argmin(np.linalg.norm(path.path[least:] - corner.point, axis=1)))
        least = near
        yield int(np.argmin(np.abs(path.speed_s - length[near]))), corner.name


def path_figure(path: CutPath) -> SpaceFigure:
    """Return the mean path in the colours of AT, with the tube of RT about it, both enlarged."""
    factor = enlarged(path, None)
    tube = tube_of(path, factor)
    of_tube = "" if tube is None else " Blue rings: the tube of RT about it, as much enlarged."
    worst = int(np.argmax(path.accuracy))
    return SpaceFigure(
        "Mean path and its tube",
        "Equal scale on all axes. Grey: command. Coloured by AT: the mean path, its deviation drawn"
        f" x{factor}.{of_tube}",
        f"Mean path of {text.counted(len(path.crossed), 'cycle')} in space, its deviation drawn x{factor}."
        f" AT at most {amount(float(path.accuracy[worst]), 'm')} at x, y, z ="
        f" {text.point(path.command[worst])} m.",
        tuple(one for one in (command_path(path), tube, mean_of(path, factor)) if one is not None),
        ends(path.path),
    )


def command_path(path: CutPath) -> Path:
    """Return the command as a line."""
    return Path("command", path.path, None, REFERENCE_COLOUR, asked=True)


def mean_of(path: CutPath, factor: int) -> Path:
    """Return the mean path with its deviation so many times as large, in the colours of AT."""
    gaps = _gaps(path)
    position = np.insert(path.command + factor * (path.mean - path.command), gaps, np.nan, axis=0)
    values = np.insert(path.accuracy, gaps, np.nan)
    return Path(f"AT, deviation x{factor}", position, None, AXIS_COLOURS["norm"], values=values)


def _gaps(path: CutPath) -> IntArray:
    """Return before which planes there is a corner, about which no plane cuts the path, shape (g,)."""
    step = np.diff(path.s)
    return np.flatnonzero(step > WIDE * np.median(step)) + 1 if len(step) else np.empty(0, np.int64)


def tube_of(path: CutPath, factor: int) -> Path | None:
    """Return rings of the radius RT about the mean path, both so many times as large; None of one cycle."""
    if path.repeatability is None:
        return None
    rows = np.unique(np.linspace(0, len(path.s) - 1, min(RINGS, len(path.s))).astype(np.int64))
    centre = path.command[rows] + factor * (path.mean - path.command)[rows]
    rings = circles(centre, path.normal[rows], factor * path.repeatability[rows])
    return Path(f"tube of RT x{factor}", rings, None, TUBE_COLOUR)


def circles(centre: FloatArray, normal: FloatArray, radius: FloatArray) -> FloatArray:
    """Return circles one behind the other, a row of NaN between two.

    Args:
        centre: In [m], shape (n, 3).
        normal: The direction that each stands across [-], shape (n, 3).
        radius: In [m], shape (n,).

    Returns:
        In [m], shape (26 n, 3).
    """
    least = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)[:, np.newaxis, np.newaxis]
    points = centre + radius[:, np.newaxis] * (np.cos(angle) * first + np.sin(angle) * second)
    gap = np.full((1, *centre.shape), np.nan)
    return np.concatenate((points, gap)).transpose(1, 0, 2).reshape(-1, 3)


def enlarged(path: CutPath | None, poses: AttainedPoses | None) -> int:
    """Return how many times the deviations of a test may be drawn, so that they stay small in its scene."""
    largest, places = [0.0], []
    if path is not None:
        spread = 0.0 if path.repeatability is None else path.repeatability
        largest.append(float(np.max(path.accuracy + spread)))
        places.append(path.path)
    if poses is not None:
        largest.append(float(np.linalg.norm(poses.attained - poses.command, axis=2).max()))
        places.append(poses.command)
    every = np.concatenate(places)
    radius = float(np.linalg.norm(np.ptp(every, axis=0))) / 2.0 or 1.0
    return next((one for one in FACTORS if one * max(largest) <= SEEN * radius), 1)


MOST = 12
"""Poses, or corners, that are drawn: the worst."""

POSE_PX, CORNER_PX = 170, 250
"""Width and height of a view of a pose, and of one of a corner, in pixels."""

GAP_PX, HEAD_PX, FOOT_PX, LEGEND_PX = 52, 44, 36, 30
"""Room at the left of a view for its numbers, above it for titles, below it, and for the legend [px]."""

TICKS_PX = 36
"""Pixels between two numbers of an axis, at least."""

VIEW_FACTOR = 1.15
"""How much further a view goes than what is in it."""

VIEW_MARGIN, FURTHEST = 4.0, 4.0
"""A view of a corner goes so many round-off errors around it, or overshoots, and so many times further if its
overshoot stands there."""

VERTICES = 600
"""Vertices of a line in a view of a corner, about."""

CORNER_AT = (0.6, 0.3)
"""Where a corner stands in its view: the legs come from the left and go up."""

MIN_HALF_WIDTH = 1e-7
"""A view goes at least so far in [m]: less is what rounding leaves."""

ABREAST = {"poses": 2, "corners": 4}
"""Poses and corners that stand beside each other, at most."""

HALO = 'stroke="white" stroke-width="4" paint-order="stroke" stroke-linejoin="round"'
"""Keeps a label readable over a line."""

ATTAINED, MIDDLE = AXIS_COLOURS["norm"], DEVIATION_COLOUR
"""Colours of attained points and mean paths, and of barycentres and what is measured from them."""


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """A square in which a plane is seen, in [mm] about a point.

    Attributes:
        left: In pixels.
        top: In pixels.
        size: Its width and height in pixels.
        half: Half of its width in [m].
        origin: Where the point stands about which it is seen, as shares of its width and height, from the
            left and from below.
    """

    left: float
    top: float
    size: float
    half: float
    origin: tuple[float, float] = (0.5, 0.5)

    def placed(self, points: FloatArray) -> FloatArray:
        """Return points about the origin in [m], to the right and up, shape (n, 2), in pixels."""
        right, up = self.origin
        origin = np.array([self.left + right * self.size, self.top + (1.0 - up) * self.size])
        return np.asarray(origin + points * [1.0, -1.0] * self.pixels)

    @property
    def pixels(self) -> float:
        """Pixels per [m]."""
        return self.size / 2.0 / self.half

    def ticks(self, origin: float) -> list[float]:
        """Return the round values that have a number, in [mm], on an axis with its zero at a share of it."""
        least = 1e3 * TICKS_PX / self.pixels
        power = 10.0 ** math.floor(math.log10(least))
        step = next(
            digit * power for digit in (1.0, 2.0, 2.5, 5.0, 10.0) if digit * power >= least * (1.0 - 1e-9)
        )
        low, high = (
            math.floor(2e3 * self.half * share / step * (1.0 - 1e-9)) for share in (origin, 1.0 - origin)
        )
        return [step * k for k in range(-low, high + 1)]

    def frame(self, right: str, up: str, clip: str) -> Iterator[str]:
        """Yield its edge, its numbers in [mm], and the region that what is in it is cut to."""
        edge = f'x="{self.left:.1f}" y="{self.top:.1f}" width="{self.size:g}" height="{self.size:g}"'
        bottom, end = self.top + self.size, self.left + self.size
        yield f'<clipPath id="{clip}"><rect {edge}/></clipPath>'
        yield f'<rect {edge} fill="none" stroke="#c3cad0"/>'
        small = 'fill="#5b6770" font-size="10"'
        left = self.left - 4.0
        for value in self.ticks(self.origin[0]):
            x = self.placed(np.array([[value, 0.0]]) / 1e3)[0, 0]
            across = f'x1="{x:.1f}" y1="{self.top:.1f}" x2="{x:.1f}" y2="{bottom:.1f}"'
            yield f'<line {across} stroke="#e4e8eb"/>'
            yield f'<text x="{x:.1f}" y="{bottom + 13:.1f}" text-anchor="middle" {small}>{value:.6g}</text>'
        for value in self.ticks(self.origin[1]):
            y = self.placed(np.array([[0.0, value]]) / 1e3)[0, 1]
            along = f'x1="{self.left:.1f}" y1="{y:.1f}" x2="{end:.1f}" y2="{y:.1f}"'
            yield f'<line {along} stroke="#e4e8eb"/>'
            yield f'<text x="{left:.1f}" y="{y + 3:.1f}" text-anchor="end" {small}>{value:.6g}</text>'
        yield f'<text x="{end:.1f}" y="{bottom + 27:.1f}" text-anchor="end" {small}>{right} [mm]</text>'
        yield f'<text x="{self.left:.1f}" y="{self.top - 5:.1f}" {small}>{up} [mm]</text>'


def pose_drawing(test: IsoTest, poses: AttainedPoses) -> Drawing:
    """Return each pose as the cloud of its attained points, in three projections of one scale."""
    ap, rp = (_values(test, name, len(poses.command)) for name in ("AP", "RP"))
    chosen = _worst(np.nan_to_num(ap) + np.nan_to_num(rp))
    across = min(ABREAST["poses"], len(chosen))
    wide, high = 3 * (POSE_PX + GAP_PX), HEAD_PX + POSE_PX + FOOT_PX
    parts: list[str] = []
    for place, k in enumerate(chosen):
        left, top = wide * (place % across), high * (place // across)
        parts += _pose(poses, k, (ap[k], rp[k]), left, top)
    rows = -(-len(chosen) // across)
    words = f"{_which('poses', len(chosen), len(poses.command))}, in mm about the command"
    about = f"{words}. Cross: command; dots: attained; crimson: barycentre and, around it, the circle of RP."
    entries = (
        (f'<path d="{_cross(0.0, 0.0)}" stroke="{INK_COLOUR}" stroke-width="2"/>', "command"),
        (f'<circle r="3" fill="{ATTAINED}"/>', "attained"),
        (f'<circle r="4" fill="{MIDDLE}"/>', "barycentre"),
        (f'<circle r="6" fill="none" stroke="{MIDDLE}" stroke-width="1.5"/>', "RP about it"),
    )
    svg = _svg(wide * across, high * rows, f"{words}, after ISO 9283", parts, entries)
    told = "; ".join(_pose_words(k, ap[k], rp[k]) for k in chosen)
    return Drawing("Attained poses", f"{about} {told}.", svg)


def corner_drawing(test: IsoTest, path: CutPath) -> Drawing:
    """Return each corner enlarged, in the plane of its legs, with CR and CO as lengths."""
    size = np.array([max(one.rounding, one.overshoot or 0.0) for one in path.corners])
    chosen = _worst(size)
    across = min(ABREAST["corners"], len(chosen))
    wide, high = CORNER_PX + GAP_PX, HEAD_PX + CORNER_PX + FOOT_PX
    parts: list[str] = []
    for place, k in enumerate(chosen):
        left, top = wide * (place % across), high * (place // across)
        parts += _corner_view(path.corners[k], left, top)
    rows = -(-len(chosen) // across)
    words = f"{_which('corners', len(chosen), len(path.corners))}, in mm, in the plane of its two legs"
    entries = (
        (
            f'<path d="M-9 0H9" stroke="{REFERENCE_COLOUR}" stroke-width="4"/>',
            "command, to the right, then up",
        ),
        (f'<path d="M-9 0H9" stroke="{ATTAINED}" stroke-width="2"/>', "mean path"),
        (f'<path d="M-9 0H9" stroke="{MIDDLE}" stroke-width="2"/>', "CR and CO"),
    )
    svg = _svg(wide * across, high * rows, f"{words}, after ISO 9283", parts, entries)
    told = "; ".join(f"{path.corners[k].name}: {_corner_words(path.corners[k])}" for k in chosen)
    return Drawing("Corners, enlarged", f"{words}. Grey: command; orange: mean path. {told}.", svg)


def _values(test: IsoTest, name: str, count: int) -> FloatArray:
    """Return a criterion of each pose in its unit, NaN where it has no value, shape (count,)."""
    found = {one.at: one.value for one in test.criteria if one.name == name}
    values = (found.get(f"pose {k + 1}") for k in range(count))
    return np.array([math.nan if one is None else one for one in values])


def _worst(sizes: FloatArray) -> list[int]:
    """Return the numbers of the largest of some sizes in [m], shape (n,), in their own order."""
    return sorted(np.argsort(-sizes, kind="stable")[:MOST].tolist())


def _which(noun: str, drawn: int, every: int) -> str:
    """Return how many are drawn: "3 poses", "the 12 worst of 50 poses"."""
    if drawn < every:
        return f"The {drawn} worst of {every} {noun}"
    return f"Each of {every} {noun}" if every > 1 else f"The only {noun[:-1]}"


def _pose(poses: AttainedPoses, k: int, sizes: tuple[float, float], left: float, top: float) -> Iterator[str]:
    """Yield a pose in three projections, from a corner of the drawing in pixels on."""
    cloud = poses.attained[:, k] - poses.command[k]
    centre, radius = cloud.mean(axis=0), float(np.nan_to_num(sizes[1]))
    furthest = max(float(np.abs(cloud).max()), float(np.abs(centre).max()) + radius, MIN_HALF_WIDTH)
    yield _title(_pose_words(k, *sizes), left, top)
    for column, look in enumerate((SIDEWAYS, FRONT, ABOVE)):
        at = left + GAP_PX + column * (POSE_PX + GAP_PX)
        view = _View(at, top + HEAD_PX, POSE_PX, VIEW_FACTOR * furthest)
        clip = f"pose{k + 1}-{column}"
        yield from view.frame("xyz"[look.right], "xyz"[look.up], clip)
        yield f'<text x="{at + POSE_PX:.1f}" y="{view.top - 5:.1f}" {SMALL_END}>{look.title}</text>'
        axes = [look.right, look.up]
        middle = view.placed(centre[np.newaxis, axes])[0].tolist()
        yield f'<g clip-path="url(#{clip})">{_cloud(view.placed(cloud[:, axes]))}'
        yield _circle(middle, radius * view.pixels, f'fill="none" stroke="{MIDDLE}" stroke-width="1.5"')
        yield _circle(middle, 4.0, f'fill="{MIDDLE}" stroke="white"')
        origin = view.placed(np.zeros((1, 2)))[0].tolist()
        yield f'<path d="{_cross(*origin)}" stroke="{INK_COLOUR}" stroke-width="2"/></g>'


def _corner_view(one: CornerPath, left: float, top: float) -> Iterator[str]:
    """Yield a corner with CR and CO, from a corner of the drawing in pixels on."""
    view = _View(left + GAP_PX, top + HEAD_PX, CORNER_PX, _half(one), CORNER_AT)
    clip, axes = one.name.replace(" ", ""), _plane(one)
    yield _title(f"{one.name}: {_corner_words(one)}", left, top)
    yield from view.frame("along", "aside", clip)
    yield f'<g clip-path="url(#{clip})" fill="none" stroke-linejoin="round">'
    for points, look in (
        (one.command, f'stroke="{REFERENCE_COLOUR}" stroke-width="5"'),
        (one.mean, f'stroke="{ATTAINED}" stroke-width="2"'),
    ):
        visible = _inside((points - one.point) @ axes, 2.0 * view.half)
        yield f'<path d="{_polyline(view.placed(visible))}" {look}/>'
    yield "</g>"
    lengths = {"CR": (one.point, one.nearest)}
    if one.beyond is not None and one.foot is not None:
        away = float(np.linalg.norm(one.beyond - one.point))
        if away <= view.half:
            lengths["CO"] = (one.foot, one.beyond)
        else:
            bottom = f'x="{view.left + 6:.1f}" y="{view.top + view.size - 8:.1f}"'
            yield f'<text {bottom} fill="#5b6770">CO: {amount(away, "m")} from the corner</text>'
    for name, both in lengths.items():
        yield from _length(name, view.placed((np.array(both) - one.point) @ axes))


def _inside(points: FloatArray, near: float) -> FloatArray:
    """Return of a line in [m], shape (n, 2), what is near enough to be seen, thinned out.

    A mean path has a vertex for each row of each cycle.
    """
    within = np.flatnonzero(np.abs(points).max(axis=1) <= near)
    if len(within):
        points = points[max(within[0] - 1, 0) : within[-1] + 2]
    return np.asarray(points[decimate(points, VERTICES)])


def _half(one: CornerPath) -> float:
    """Return half of the width of a corner's view in [m]: so that CR and CO are seen.

    An overshoot that stands far away for its size is left out: beside the way there nothing would be seen.
    """
    legs = max(float(np.linalg.norm(one.command[end] - one.point)) for end in (0, -1))
    half = min(VIEW_MARGIN * max(one.rounding, one.overshoot or 0.0), legs)
    away = 0.0 if one.beyond is None else VIEW_FACTOR * float(np.linalg.norm(one.beyond - one.point))
    return max(half, away if away <= FURTHEST * half else 0.0, MIN_HALF_WIDTH)


def _plane(one: CornerPath) -> FloatArray:
    """Return the axes of a corner's view, shape (3, 2): along its first leg, and aside to the second."""
    before, behind = one.point - one.command[0], one.command[-1] - one.point
    right = before / np.linalg.norm(before)
    for aside in (behind, one.mean.mean(axis=0) - one.point, *np.eye(3)):  # where the path turns back
        up = aside - (aside @ right) * right
        if (size := float(np.linalg.norm(up))) > 1e-6 * float(np.linalg.norm(before)):
            return np.column_stack((right, up / size))
    raise AssertionError("one of three axes is off any line")


def _length(name: str, ends: FloatArray) -> Iterator[str]:
    """Yield a length between two places in pixels, shape (2, 2), with its name."""
    (x1, y1), (x2, y2) = ends.tolist()
    place = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    yield f'<line class="{name}" {place} stroke="{MIDDLE}" stroke-width="2"/>'
    yield from (_circle(end, 2.5, f'fill="{MIDDLE}"') for end in ends.tolist())
    at = (x2 - 8.0, y2 - 4.0, "end") if name == "CR" else ((x1 + x2) / 2.0, (y1 + y2) / 2.0 - 8.0, "middle")
    yield f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" text-anchor="{at[2]}" {HALO}>{name}</text>'


def _pose_words(k: int, ap: float, rp: float) -> str:
    said = f"pose {k + 1}: AP {amount(ap, 'm')}"
    return said if math.isnan(rp) else f"{said}, RP {amount(rp, 'm')}"


def _corner_words(one: CornerPath) -> str:
    said = f"CR {amount(one.rounding, 'm')}"
    return said if one.overshoot is None else f"{said}, CO {amount(one.overshoot, 'm')}"


SMALL_END = 'fill="#5b6770" font-size="10" text-anchor="end"'


def _title(words: str, left: float, top: float) -> str:
    return f'<text x="{left + GAP_PX:.1f}" y="{top + 20:.1f}">{escape_html(words)}</text>'


def _cloud(points: FloatArray) -> str:
    """Return dots at places in pixels, shape (n, 2), in one element: there may be thousands."""
    way = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points.tolist())
    look = f'stroke="{ATTAINED}" stroke-width="6" stroke-linecap="round" stroke-opacity="0.75"'
    return f'<path class="attained" d="{way}" {look}/>'


def _circle(centre: Sequence[float], radius: float, look: str) -> str:
    return f'<circle cx="{centre[0]:.1f}" cy="{centre[1]:.1f}" r="{radius:.1f}" {look}/>'


def _cross(x: float, y: float) -> str:
    return f"M{x - 7:.1f} {y:.1f}h14M{x:.1f} {y - 7:.1f}v14"


def _polyline(points: FloatArray) -> str:
    """Return a line through places in pixels, shape (n, 2)."""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points.tolist())


def _svg(
    width: float, height: float, title: str, parts: Sequence[str], entries: Sequence[tuple[str, str]]
) -> str:
    """Return a drawing with a legend below: signs about the origin, and what they mean."""
    width, whole = width + 20, height + LEGEND_PX
    size = f'width="{width:.0f}" height="{whole:.0f}" viewBox="0 0 {width:.0f} {whole:.0f}"'
    legend, x = [], float(GAP_PX) + 10.0
    for sign, words in entries:
        legend.append(f'<g transform="translate({x:.0f} {height + 10:.0f})">{sign}')
        legend.append(f'<text x="14" y="4">{escape_html(words)}</text></g>')
        x += 40.0 + 6.6 * len(words)
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="12">',
            f"<title>{escape_html(title)}</title>",
            '<rect width="100%" height="100%" fill="white"/>',
            *parts,
            *legend,
            "</svg>\n",
        )
    )
