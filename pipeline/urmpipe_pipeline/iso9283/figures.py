"""The plots of a test after ISO 9283 over the length of the path, and the path with its tube in space."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.iso9283.result import AttainedPoses, CutPath, IsoTest
from urmpipe_pipeline.iso9283.wording import amount
from urmpipe_pipeline.presentation.curves import decimate
from urmpipe_pipeline.presentation.figure import Figure, Line, Mark, Over, Panel, SpaceFigure, View
from urmpipe_pipeline.presentation.palette import (
    AXIS_COLOURS,
    DEVIATION_COLOUR,
    INK_COLOUR,
    REFERENCE_COLOUR,
    RUN_COLOURS,
)
from urmpipe_pipeline.presentation.parts import ends
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
