"""The plots of an accuracy: errors over velocity; of each motion deviation, joints, voltages, currents."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion
from urmpipe_pipeline.accuracy.parts import ERROR_DEFINITIONS, format_velocity
from urmpipe_pipeline.accuracy.published import published_points
from urmpipe_pipeline.accuracy.result import DECIDES, AccuracyResult
from urmpipe_pipeline.presentation.figure import Figure, Line, Mark, Over, Panel, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, INK_COLOUR, REFERENCE_COLOUR, joint_colour
from urmpipe_pipeline.runs.figures import joint_panels

MAX_MARKED = 6  # corners in the plots: the labels of more would overlap

ERRORS = {"time": ("error", AXIS_COLOURS["norm"]), "path": ("path error", AXIS_COLOURS["z"])}
"""Name and colour of each error."""


def velocity_figure(result: AccuracyResult) -> Figure:
    """Return both errors over the velocity, with published ones, the limit and the running speed.

    Source: [Iso9283]_ Fig. 7.
    """
    by_velocity = {errors.velocity: errors for errors in (*result.probed, *result.errors)}
    points = {point.velocity: point for point in published_points(result.robot.name, result.rows)}
    at = sorted({*by_velocity, *points})
    order = sorted(DECIDES, key=lambda which: which == result.limited_error)  # what decides is in front
    lines = []
    for which in order:
        values = [
            getattr(by_velocity[v], "error" if which == "time" else "path_error")
            if v in by_velocity
            else None
            for v in at
        ]
        name, colour = ERRORS[which]
        lines.append(Line(_known(values), (name,), (colour,), strong=which == result.limited_error))
    marks = []
    if points:
        values = [points[v].error if v in points else None for v in at]
        lines.append(Line(_known(values), ("published",), (INK_COLOUR,), points=True))
        marks += [
            Mark(
                at.index(v),
                point.error,
                "up" if point.least else "cross",
                INK_COLOUR,
                f"published: {'more than ' if point.least else ''}{1e3 * point.error:g} mm",
                "published",
            )
            for v, point in points.items()
        ]
    name, colour = ERRORS[result.limited_error]
    marks += [
        Mark(
            at.index(errors.velocity),
            error,
            "diamond",
            colour,
            f"{format_velocity(errors.velocity)}: {text.format_quantity(error, 'm')}",
            name,
        )
        for errors in result.errors
        if (error := result.judged_error(errors)) is not None
    ]
    over = Over(np.array(at), "velocity", "m/s", joined=True)
    panel = Panel(
        "largest error", "m", tuple(lines), limit=result.limit, signed=False, marks=tuple(marks), over=over,
        logarithmic=True, small=True, limit_name="limit",
    )  # fmt: skip
    return Figure(
        "Error over velocity",
        _velocity_caption(result, published=bool(points)),
        f"Largest errors of {result.robot.name} on {result.name} over the velocity:"
        f" {_format_errors(result)}.",
        (View("error over velocity", (panel,)),),
        {}
        if result.running_speed is None
        else {at.index(result.running_speed): f"{format_velocity(result.running_speed)}"},
    )


def motion_figures(result: AccuracyResult, motion: DrivenMotion) -> Iterator[Figure]:
    """Yield the plots of a motion: its deviation, its joints, voltages and currents.

    Source: [Iso9283]_ Fig. 5 and 6.
    """
    yield _deviation(result, motion)
    yield _joints(result, motion)
    yield _drives(result, motion)


def _velocity_caption(result: AccuracyResult, *, published: bool) -> str:
    caption = "The axis is logarithmic. Strong: the error that decides,"
    caption += f" {ERROR_DEFINITIONS[result.limited_error]}. Diamonds: the given velocities."
    caption += " Dashed: the limit." if result.limit is not None else ""
    if result.running_speed is not None:
        caption += " Dotted: the running speed, the largest within it."
    if published:
        caption += ' Dark crosses: [Iso9283] Fig. 7; at the triangle only "more than" is known.'
    diverged = [format_velocity(errors.velocity) for errors in result.errors if errors.diverged is not None]
    return caption + (f" No point at {text.join_list(diverged)}: the arm diverged." if diverged else "")


def _format_errors(result: AccuracyResult) -> str:
    """Return the error that decides at each velocity."""
    parts = []
    for errors in result.errors:
        error = result.judged_error(errors)
        value = "diverged" if error is None else text.format_quantity(error, "m")
        parts.append(f"{format_velocity(errors.velocity)} {value}")
    return "; ".join(parts)


def _deviation(result: AccuracyResult, motion: DrivenMotion) -> Figure:
    """Return delta, its norm, and the distance from the path, with the limit of the one that decides."""
    limits = {which: result.limit if which == result.limited_error else None for which in DECIDES}
    panels = [
        Panel(
            f"Δ{axis}",
            "m",
            (Line(motion.delta[:, i], (f"Δ{axis}",), (AXIS_COLOURS[axis],)),),
            motion.t_ns,
            small=True,
        )
        for i, axis in enumerate("xyz")
    ]
    norm, far = motion.delta[:, 3], motion.from_path
    panels.append(_size("‖Δ‖", norm, AXIS_COLOURS["norm"], motion, limits["time"]))
    path = _size("path", far, AXIS_COLOURS["norm"], motion, limits["path"])
    drawn = "" if result.limit is None else " Dashed: the limit; tinted: out of it."
    return Figure(
        "Deviation over time",
        "Δ is planned minus real at the same time; path is the distance from the nearest point of the path."
        f" Diamonds: the largest. Dotted: middles of corners.{drawn}",
        f"Deviation at {format_velocity(motion.velocity)}: at most"
        f" {text.format_quantity(float(norm.max()), 'm')} from the set point,"
        f" {text.format_quantity(float(far.max()), 'm')} from the path.",
        (View("delta = planned - real", tuple(panels)), View("Distance from the path", (path,))),
        _instants(motion),
        opened=0 if result.limited_error == "time" else 1,
        share=2.4,
    )


def _size(title: str, values: FloatArray, colour: str, motion: DrivenMotion, limit: float | None) -> Panel:
    """Return a distance in [m], shape (n,), with its limit and its largest value."""
    peaks = (int(np.argmax(values)),)
    return Panel(
        title, "m", (Line(values, (title,), (colour,)),), motion.t_ns, limit, signed=False, peaks=peaks,
        small=True, limit_name="limit",
    )  # fmt: skip


def _joints(result: AccuracyResult, motion: DrivenMotion) -> Figure:
    """Return values and rates of the joints, each with its set point."""
    names = result.robot.coordinates
    views = tuple(
        View(
            title, tuple(_with_set_points(names, result.joint_units, symbol, values, set_points, motion, per))
        )
        for title, symbol, values, set_points, per in (
            ("Joints", "q", motion.q, motion.set_q, ""),
            ("Rates", "q′", motion.qd, motion.set_qd, "/s"),
        )
    )
    return Figure(
        "Joints over time",
        "Values and rates of the joints. Grey, dashed: what was set.",
        f"Values and rates of {', '.join(names)} at {format_velocity(motion.velocity)}, each with what was"
        " set.",
        views,
        share=2.0,
    )


def _with_set_points(
    names: Sequence[str], units: Sequence[str], symbol: str, values: FloatArray, set_points: FloatArray,
    motion: DrivenMotion, per: str,
) -> Iterator[Panel]:  # fmt: skip
    """Yield joints over time, shape (n, joints), in front of their set points of the same shape."""
    # as separate arrays: the viewer draws stored ones in the order of their names, set points in front
    real, commanded = (
        joint_panels(names, units, symbol, each[:], motion.t_ns, per=per) for each in (values, set_points)
    )
    for panel, set_panel in zip(real, commanded, strict=True):
        (line,) = set_panel.lines
        grey = (REFERENCE_COLOUR,) * len(line.names)
        set_line = replace(line, names=tuple(f"{name} set" for name in line.names), colours=grey, dashed=True)
        yield replace(panel, lines=(set_line, *panel.lines))


def _drives(result: AccuracyResult, motion: DrivenMotion) -> Figure:
    """Return voltages with their limits, and currents."""
    names, colours = (
        result.driven,
        [joint_colour(result.robot.coordinates.index(name)) for name in result.driven],
    )
    panels = []
    for limit in dict.fromkeys(motion.limits.tolist()):
        drives = np.flatnonzero(motion.limits == limit)
        line = Line(
            motion.voltage[:, drives],
            tuple(names[j] for j in drives),
            tuple(colours[j] for j in drives),
            steps=True,
        )
        panels.append(Panel("u", "V", (line,), motion.t_ns, limit, share=1.5, limit_name="largest voltage"))
    current = Panel("i", "A", (Line(motion.current, names, tuple(colours)),), motion.t_ns, share=1.5)
    return Figure(
        "Voltages and currents",
        "Voltages of the drives, dashed: the largest that they have; and their currents.",
        f"Voltages and currents of {', '.join(names)} at {format_velocity(motion.velocity)}. At the limit:"
        f" {text.format_percent(motion.errors.saturated_share)} of the samples.",
        (View("Voltages", tuple(panels)), View("Currents", (current,))),
        share=1.6,
    )


def _instants(motion: DrivenMotion) -> dict[int, str]:
    """Return the times of corners, unless there are many, and of the divergence, in [ns]."""
    passed = motion.corner_times_ns[motion.corner_times_ns <= motion.t_ns[-1]].tolist()
    instants = (
        {at: f"corner {k}" for k, at in enumerate(passed, start=1)} if len(passed) <= MAX_MARKED else {}
    )
    return instants if motion.diverged is None else instants | {int(motion.t_ns[-1]): "diverged"}


def _known(values: Sequence[float | None]) -> FloatArray:
    """Return errors in [m], NaN for None, shape (velocities,)."""
    return np.array([np.nan if value is None else value for value in values])
