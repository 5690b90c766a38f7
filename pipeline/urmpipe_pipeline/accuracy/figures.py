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

MARKED = 6
"""Corners marked in the plots, at most: the words of more would overlap."""

ERRORS = {"time": ("error", AXIS_COLOURS["norm"]), "path": ("path error", AXIS_COLOURS["z"])}
"""Name and colour of each error."""


def velocity_figure(result: AccuracyResult) -> Figure:
    """Return both errors over the velocity, what is published beside them, the limit and the running speed.

    Source: [Iso9283]_ Fig. 7.
    """
    every = {one.velocity: one for one in (*result.probed, *result.errors)}
    points = {one.velocity: one for one in published_points(result.robot.name, result.rows)}
    at = sorted({*every, *points})
    order = sorted(DECIDES, key=lambda which: which == result.limited_error)  # what decides is in front
    lines = []
    for which in order:
        values = [
            getattr(every[v], "error" if which == "time" else "path_error") if v in every else None
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
                one.error,
                "up" if one.least else "cross",
                INK_COLOUR,
                f"published: {'more than ' if one.least else ''}{1e3 * one.error:g} mm",
                "published",
            )
            for v, one in points.items()
        ]
    name, colour = ERRORS[result.limited_error]
    marks += [
        Mark(
            at.index(one.velocity),
            found,
            "diamond",
            colour,
            f"{format_velocity(one.velocity)}: {text.format_quantity(found, 'm')}",
            name,
        )
        for one in result.errors
        if (found := result.judged_error(one)) is not None
    ]
    over = Over(np.array(at), "velocity", "m/s", joined=True)
    panel = Panel(
        "largest error", "m", tuple(lines), limit=result.limit, signed=False, marks=tuple(marks), over=over,
        logarithmic=True, small=True, limit_name="limit",
    )  # fmt: skip
    return Figure(
        "Error over velocity",
        _velocity_caption(result, published=bool(points)),
        f"Largest errors of {result.robot.name} on {result.name} over the velocity: {_errors_told(result)}.",
        (View("error over velocity", (panel,)),),
        {}
        if result.running_speed is None
        else {at.index(result.running_speed): f"{format_velocity(result.running_speed)}"},
    )


def motion_figures(result: AccuracyResult, motion: DrivenMotion) -> Iterator[Figure]:
    """Yield the plots of a motion: how it deviates, its joints, and what its drives did.

    Source: [Iso9283]_ Fig. 5 and 6.
    """
    yield _deviation(result, motion)
    yield _joints(result, motion)
    yield _drives(result, motion)


def _velocity_caption(result: AccuracyResult, *, published: bool) -> str:
    said = "The axis is logarithmic. Strong: the error that decides,"
    said += f" {ERROR_DEFINITIONS[result.limited_error]}. Diamonds: velocities asked for."
    said += " Dashed: the limit." if result.limit is not None else ""
    said += " Dotted: the running speed, the largest within it." if result.running_speed is not None else ""
    said += ' Dark crosses: [Iso9283] Fig. 7; at the triangle only "more than" is known.' if published else ""
    gone = [format_velocity(one.velocity) for one in result.errors if one.diverged is not None]
    return said + (f" No point at {text.join_list(gone)}: the arm diverged." if gone else "")


def _errors_told(result: AccuracyResult) -> str:
    """Return the error that decides at each velocity."""
    said = ((one, result.judged_error(one)) for one in result.errors)
    return "; ".join(
        f"{format_velocity(one.velocity)} {'diverged' if found is None else text.format_quantity(found, 'm')}"
        for one, found in said
    )


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
    """Return values and rates of the joints, each with what was set."""
    names = result.robot.coordinates
    views = tuple(
        View(title, tuple(_with_set(names, result.joint_units, symbol, values, wanted, motion, per)))
        for title, symbol, values, wanted, per in (
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


def _with_set(
    names: Sequence[str], units: Sequence[str], symbol: str, values: FloatArray, wanted: FloatArray,
    motion: DrivenMotion, per: str,
) -> Iterator[Panel]:  # fmt: skip
    """Yield joints over time, shape (n, joints), in front of their set values of the same shape."""
    # as arrays of their own: the viewer draws stored ones in the order of their names, what was set in front
    real, asked = (
        joint_panels(names, units, symbol, one[:], motion.t_ns, per=per) for one in (values, wanted)
    )
    for panel, before in zip(real, asked, strict=True):
        (line,) = before.lines
        grey = (REFERENCE_COLOUR,) * len(line.names)
        behind = replace(line, names=tuple(f"{name} set" for name in line.names), colours=grey, dashed=True)
        yield replace(panel, lines=(behind, *panel.lines))


def _drives(result: AccuracyResult, motion: DrivenMotion) -> Figure:
    """Return voltages with their limits, and currents."""
    names, colours = (
        result.driven,
        [joint_colour(result.robot.coordinates.index(one)) for one in result.driven],
    )
    panels = []
    for limit in dict.fromkeys(motion.limits.tolist()):
        own = np.flatnonzero(motion.limits == limit)
        line = Line(
            motion.voltage[:, own], tuple(names[j] for j in own), tuple(colours[j] for j in own), steps=True
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
    """Return when corners are passed, unless they are many, and when it diverged, in [ns]."""
    passed = motion.corner_times_ns[motion.corner_times_ns <= motion.t_ns[-1]].tolist()
    found = {at: f"corner {k}" for k, at in enumerate(passed, start=1)} if len(passed) <= MARKED else {}
    return found if motion.diverged is None else found | {int(motion.t_ns[-1]): "diverged"}


def _known(values: Sequence[float | None]) -> FloatArray:
    """Return errors in [m], NaN where there is none, shape (velocities,)."""
    return np.array([np.nan if one is None else one for one in values])
