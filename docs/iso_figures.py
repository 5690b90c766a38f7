"""Draw the pictures of docs/iso.md: what each criterion after ISO 9283 measures.

    python docs/iso_figures.py

Deviations are enlarged; each length that is drawn is what the package computes of the drawn cycles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.command_path import CommandCorner, CommandPath
from urmpipe_pipeline.iso9283.corners import CornerPath, corner_path
from urmpipe_pipeline.iso9283.criteria import accuracy, repeatability
from urmpipe_pipeline.iso9283.motion import Rest, build_motion
from urmpipe_pipeline.iso9283.poses import settling_and_overshoot

Place: TypeAlias = Sequence[float] | FloatArray
"""Where something is, to the right and up, shape (2,); what follows counts for nothing."""

PICTURES = Path(__file__).resolve().parent / "pictures"
HEIGHT = 300
COMMAND, MEAN, CYCLE, VALUE, AID = "#333", "#1f77b4", "#9ecae1", "#d62728", "#888"
"""Colours: what was commanded, the mean of the cycles, each cycle, a criterion, lines that help."""

BOLD, DASHED, DOTTED = "stroke-width='2.5'", "stroke-dasharray='5 3'", "stroke-dasharray='2 3'"

CLOUD = np.array([[14, 6], [18, 12], [11, 16], [20, 3], [13, 11], [9, 7], [17, 17], [16, 8.0]])
"""Attained points of eight cycles from the commanded one, to the right and up."""

ACROSS = np.array([[8, 17], [14, 24], [6, 9], [17, 14], [10, 26.0]])
"""Crossings of five cycles from that of the command, likewise."""


@dataclass(frozen=True, slots=True)
class Panel:
    """A part of a picture.

    Attributes:
        left: Where it begins in [px].
        origin: Where its origin is in [px] from its upper left corner.
        scale: Pixels a unit, to the right and up.
    """

    left: float
    origin: tuple[float, float]
    scale: tuple[float, float] = (1.0, 1.0)

    def at(self, place: Place) -> tuple[float, float]:
        """Return a place in [px] of the picture."""
        return self.left + self.origin[0] + self.scale[0] * place[0], self.origin[1] - self.scale[1] * place[
            1
        ]

    def title(self, words: str) -> str:
        """Return its title."""
        return f'<text x="{self.left + 12:.1f}" y="22" {_font(COMMAND)} font-weight="bold">{words}</text>'

    def line(self, points: FloatArray, colour: str, style: str = "") -> str:
        """Return a line through points, shape (n, 2)."""
        written = " ".join("{:.1f},{:.1f}".format(*self.at(one)) for one in points.tolist())
        return f'<polyline points="{written}" fill="none" stroke="{colour}" {style}/>'

    def dot(self, place: Place, colour: str, radius: float = 4.0) -> str:
        """Return a point; its radius is in [px]."""
        x, y = self.at(place)
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{colour}"/>'

    def cross(self, place: Place) -> str:
        """Return the mark of a commanded point."""
        x, y = self.at(place)
        path = f"M{x - 6:.1f},{y:.1f}h12M{x:.1f},{y - 6:.1f}v12"
        return f'<path d="{path}" stroke="{COMMAND}" stroke-width="2"/>'

    def circle(self, place: Place, radius: float) -> str:
        """Return a circle."""
        x, y = self.at(place)
        size = f'r="{self.scale[0] * radius:.1f}" stroke="{VALUE}"'
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" {size} fill="none" {DASHED}/>'

    def text(self, place: Place, words: str, colour: str = COMMAND, anchor: str = "start") -> str:
        """Return words."""
        x, y = self.at(place)
        return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {_font(colour)}>{words}</text>'

    def value(self, first: Place, last: Place) -> str:
        """Return a criterion, drawn as a length between two places."""
        ends = np.array([self.at(first), self.at(last)])
        step = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        across = 4.0 * np.array([-step[1], step[0]])
        strokes = [ends, *(np.array([one - across, one + across]) for one in ends)]
        path = "".join("M{:.1f},{:.1f}L{:.1f},{:.1f}".format(*one.ravel()) for one in strokes)
        return f'<path d="{path}" stroke="{VALUE}" stroke-width="2"/>'


def _font(colour: str) -> str:
    return f'font-family="sans-serif" font-size="13" fill="{colour}"'


def _in_space(points: FloatArray) -> FloatArray:
    """Return points of fewer coordinates, shape (..., k), in space, shape (..., 3)."""
    return np.concatenate((points, np.zeros((*points.shape[:-1], 3 - points.shape[-1]))), axis=-1)


def poses() -> list[str]:
    """Return AP and RP, AD and vAP, stabilisation time and overshoot, a panel each."""
    cloud = Panel(0.0, (85.0, 215.0), (5.0, 5.0))
    return [cloud.title("A pose: AP, RP"), *_spread(cloud, CLOUD, "P"), *_two_poses(), *_settled()]


def _spread(here: Panel, points: FloatArray, kind: str) -> list[str]:
    """Return points of several cycles round the commanded one, shape (n, 2), with two criteria."""
    centre, placed = points.mean(axis=0), _in_space(points[:, np.newaxis])
    both = repeatability(placed)
    assert both is not None
    radius = float(both[0])
    off = float(accuracy(placed, np.zeros((1, 3)))[0]) * centre / np.linalg.norm(centre)
    edge = centre + radius * np.array([-0.6, 0.8])
    return [
        here.circle(centre, radius),
        *(here.dot(one, CYCLE) for one in points),
        here.dot(centre, MEAN, 5.0),
        here.cross((0.0, 0.0)),
        here.text((-14.0, -5.0), "commanded"),
        here.value((0.0, 0.0), off),
        here.text(np.add(0.55 * centre, [-4.5, 1.5]), f"A{kind}", VALUE),
        here.value(centre, edge),
        here.text(np.add(edge, [-4.0, 0.0]), f"R{kind}", VALUE),
        here.line(np.add(centre, [[0.3, -1.5], [3.0, -radius - 2.0]]), MEAN),
        here.text(np.add(centre, [-2.0, -radius - 5.0]), "barycentre", MEAN),
    ]


def _two_poses() -> list[str]:
    """Return the distance of two poses, and one pose that is attained from two directions."""
    here = Panel(290.0, (45.0, 200.0))
    first, second, other = (12.0, 10.0), (165.0, 12.0), (150.0, -16.0)
    return [
        here.title("Two poses: AD. Two directions: vAP"),
        here.line(np.array([[0, 0], [150, 0], [150, 130]]), COMMAND, DOTTED),
        *(here.cross(one) for one in ((0, 0), (150, 0))),
        here.line(np.array([[0, -40], [150, -40]]), COMMAND),
        here.text((75, -57), "commanded distance", COMMAND, "middle"),
        here.line(np.array([first, second]), MEAN),
        *(here.dot(one, MEAN, 5.0) for one in (first, second, other)),
        here.text((80, 18), "mean distance", MEAN, "middle"),
        here.text((75, -76), "AD: the difference of both", VALUE, "middle"),
        here.value(second, other),
        here.text((172, -8), "vAP", VALUE),
        here.text((-8, -18), "pose 1"),
        here.text((158, 32), "pose 2"),
        here.text((143, 118), "once from above,", COMMAND, "end"),
        here.text((143, 100), "once from the left", COMMAND, "end"),
    ]


def _settled() -> list[str]:
    """Return a swing about the final pose over time, with its band."""
    band, t = 0.12, np.linspace(0.0, 1.0, 401)
    swing = np.maximum(t - 0.15, 0.0)
    away = -np.exp(-9.0 * swing) * np.cos(22.0 * swing)
    motion = build_motion("swing", t, _in_space(away[:, np.newaxis]), None, timed=True)
    found = settling_and_overshoot(motion, 0, Rest(300, 400), band)
    assert found is not None
    lasting, beyond = found
    begins, most = float(t[int(np.argmax(np.abs(away) <= band))]), float(t[int(np.argmax(away))])
    ends, below = begins + lasting, -1.15
    here = Panel(590.0, (15.0, 150.0), (215.0, 95.0))
    return [
        here.title("Settling: PSt, OV"),
        *(here.line(np.array([[0, edge], [1, edge]]), AID) for edge in (band, -band)),
        here.line(np.array([[0, 0], [1, 0]]), COMMAND, DASHED),
        here.line(np.column_stack((t, away)), MEAN, BOLD),
        *(here.line(np.array([[one, below], [one, 0]]), AID) for one in (begins, ends)),
        here.text((1.03, -0.04), "final pose"),
        here.text((1.03, band + 0.04), "band"),
        here.value((most, 0.0), (most, beyond)),
        here.text((most + 0.03, beyond + 0.06), "OV", VALUE),
        here.value((begins, below), (ends, below)),
        here.text((ends + 0.03, below - 0.04), "PSt", VALUE),
        here.text((0.0, 1.0), "along the approach, over time"),
    ]


def paths() -> list[str]:
    """Return a path with its planes and cycles, and one plane seen along the path."""
    command = np.array([*([x, 0.0] for x in range(0, 340, 10)), *([330.0, y] for y in range(10, 210, 10))])
    path = CommandPath(
        build_motion("path", np.arange(0.0, len(command)), _in_space(command), None, timed=True)
    )
    planes, (corner,) = path.even_planes(7), path.corners
    before, behind = path.planes_at(np.array(corner.zone)).point
    cycles = [_beside(command, shift) for shift in (2.0, 8.0, -3.0, 13.0, 5.0)]
    across = 26.0 * np.cross(planes.normal, [0.0, 0.0, 1.0])
    here, plane = Panel(0.0, (20.0, 240.0)), Panel(430.0, (110.0, 225.0), (5.0, 5.0))
    return [
        here.title("The path, cut by planes"),
        here.line(command, COMMAND, BOLD),
        *(here.line(one, CYCLE) for one in cycles),
        here.line(np.mean(cycles, axis=0), MEAN, BOLD),
        here.line(np.array([before, corner.point, behind]), VALUE, "stroke-width='4'"),
        *(
            here.line(np.array([point - a, point + a]), AID, DASHED)
            for point, a in zip(planes.point, across, strict=True)
        ),
        here.text((0, -16), "command"),
        here.text((50, 36), "mean path", MEAN),
        here.text((172, -42), "planes, even in arc length", AID, "middle"),
        here.text((310, 60), "zone of the corner:", VALUE, "end"),
        here.text((310, 44), "no plane", VALUE, "end"),
        plane.title("One plane, seen along the path: AT, RT"),
        *_spread(plane, ACROSS, "T"),
    ]


def _beside(command: FloatArray, shift: float) -> FloatArray:
    """Return a cycle that rounds the corner of a command, shape (n, 2), to its left by a shift and a wave."""
    ends = np.vstack((np.repeat(command[:1], 2, axis=0), command, np.repeat(command[-1:], 2, axis=0)))
    smooth = np.column_stack([np.convolve(one, np.ones(5) / 5.0, "valid") for one in ends.T])
    along = np.gradient(smooth, axis=0)
    left = along[:, ::-1] * [-1.0, 1.0] / np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(smooth + (shift + 7.0 * np.sin(0.15 * np.arange(len(command))))[:, np.newaxis] * left)


def corners() -> list[str]:
    """Return a corner: how the mean path rounds it, and how far it goes beyond the second leg."""
    found, here = _corner(), Panel(0.0, (230.0, 240.0), (3.5, 3.5))
    assert found.overshoot_point is not None and found.nearest_on_leg is not None
    return [
        here.title("A corner, from the mean path: CR, CO"),
        here.line(found.command, COMMAND, BOLD),
        here.line(found.mean, MEAN, BOLD),
        here.dot(found.point, COMMAND),
        here.value(found.point, found.nearest),
        here.text(np.add(found.nearest[:2], [-2.0, 2.0]), "CR", VALUE, "end"),
        here.value(found.nearest_on_leg, found.overshoot_point),
        here.text(np.add(found.overshoot_point[:2], [2.0, 0.0]), "CO", VALUE),
        here.text((2.0, -4.0), "corner"),
        here.text((-59.0, -5.0), "first leg of the command"),
        here.text((-2.0, 52.0), "second leg", COMMAND, "end"),
        here.text((-59.0, 3.0), "mean path", MEAN),
    ]


def _corner() -> CornerPath:
    """Return how a controlled motion takes a corner of 90 deg: rounded, then beyond the second leg."""
    step = 0.005
    t = step * np.arange(-480, 300)
    place, speed, done = np.array([-240.0, 0.0]), np.zeros(2), []
    for asked in np.column_stack((np.minimum(100.0 * t, 0.0), np.maximum(100.0 * t, 0.0))):
        speed = speed + step * (25.0 * (asked - place) - 4.5 * speed)
        place = place + step * speed
        done.append(place)
    mean = _in_space(np.array(done))
    east, north, _ = np.eye(3)
    corner = CommandCorner(np.zeros(3), east, north, 60.0, 60.0, (0.0, 120.0), (54.0, 66.0), is_straight=True)
    command = np.array([-60.0 * east, np.zeros(3), 60.0 * north])
    return corner_path("corner 1", corner, command, mean[(mean[:, 0] > -60.0) & (mean[:, 1] < 60.0)])


def speeds() -> list[str]:
    """Return the speed of all cycles on a leg: AV, RV, FV."""
    s = np.linspace(0.0, 1.0, 300)
    commanded, middle = np.clip(np.minimum(s, 1.0 - s) / 0.12, 0.0, 1.0), (s >= 0.25) & (s <= 0.75)
    cycles = [
        commanded * (share + 0.05 * np.sin(20.0 * s + 2.0 * k) + 0.03 * np.sin(47.0 * s + k))
        for k, share in enumerate((0.78, 0.84, 0.88, 0.80))
    ]
    means = [float(one[middle].mean()) for one in cycles]
    mean, spread = float(np.mean(means)), 3.0 * float(np.std(means, ddof=1))
    least, most = float(cycles[0][middle].min()), float(cycles[0][middle].max())
    here = Panel(0.0, (60.0, 250.0), (440.0, 185.0))
    x, y = here.at((0.25, 1.15))
    return [
        here.title("The speed on a straight leg: AV, RV, FV"),
        f'<rect x="{x:.1f}" y="{y:.1f}" width="220" height="213" fill="#f2f2f2"/>',
        here.text((0.5, 0.05), "middle half of the leg", AID, "middle"),
        *(here.line(np.column_stack((s, one)), CYCLE) for one in cycles),
        here.line(np.column_stack((s, commanded)), COMMAND, f"{BOLD} {DASHED}"),
        here.line(np.array([[0.25, mean], [0.75, mean]]), MEAN, BOLD),
        here.text((0.09, 0.99), "v_c", COMMAND, "end"),
        here.value((0.33, 1.0), (0.33, mean)),
        here.text((0.345, 1.04), "AV · v_c", VALUE),
        *(here.line(np.array([[0.25, edge], [0.76, edge]]), AID) for edge in (least, most)),
        here.value((0.72, most), (0.72, least)),
        here.text((0.735, least - 0.11), "FV of this cycle", VALUE, "end"),
        *(here.dot((1.08, one), CYCLE) for one in means),
        here.dot((1.08, mean), MEAN),
        here.value((1.08, mean - spread), (1.08, mean + spread)),
        here.text((1.11, mean + 0.03), "means of the cycles:"),
        here.text((1.11, mean - 0.07), "± RV · v_c", VALUE),
        here.text((1.08, 0.0), "along the leg"),
    ]


DRAWINGS: dict[str, tuple[Callable[[], list[str]], int]] = {
    "iso-poses.svg": (poses, 900),
    "iso-paths.svg": (paths, 740),
    "iso-corners.svg": (corners, 400),
    "iso-speed.svg": (speeds, 700),
}
"""What is drawn in each picture, and how wide it is in [px]."""


def picture(name: str) -> str:
    """Return a drawing (SVG)."""
    marks, width = DRAWINGS[name]
    size = f'width="{width}" height="{HEIGHT}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {HEIGHT}" {size}>'
    return "\n".join([head, f'<rect {size} fill="#fff"/>', *marks(), "</svg>\n"])


if __name__ == "__main__":
    for one in DRAWINGS:
        (PICTURES / one).write_text(picture(one), encoding="utf-8")
