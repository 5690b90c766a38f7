"""How a log deviates, over time and over speed: Figures 9 and 12 of the paper, for any log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import AXES, Deviation, Statistics
from urmpipe_pipeline.comparison.symbols import SYMBOLS
from urmpipe_pipeline.comparison.wording import correlation
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS, REFERENCE_COLOUR, joint_colour
from urmpipe_pipeline.report.spec import MUTED, Figure, Panel, Spec, axis, base_layout, stacked, typed
from urmpipe_pipeline.report.traces import (
    DASHES,
    band,
    instant,
    label,
    level,
    line,
    marks,
    precision,
    shaded,
    stroke,
    told,
)

PANEL_PX = 112
"""Height of one plot among some on a common time axis."""

JOINTS_PX = 210
"""Height of a plot of all joints."""

AROUND_PX = 64
"""Height of what stands above and below them: legend and time axis."""

LOW = 3.0
"""Largest values above so many tolerances leave no room for a word between the tolerance and 0."""

DOTS = 1500
"""Points of a cloud: a browser draws no more of them with ease."""

STRENGTHS = ((0.7, "strongly"), (0.4, "moderately"), (0.2, "weakly"))
"""From which |r| on two quantities go together, in words."""


def deviation_figure(deviation: Deviation) -> Figure:
    """Return delta, its norm and the distance from the path with tolerances, and the tool's speed."""
    named = [(name, SYMBOLS[name], AXIS_COLOURS[name]) for name in AXES]
    columns = [*zip(named, deviation.delta.T, strict=True), (("path", "path", MUTED), deviation.path)]
    panels = [
        _panel(deviation, deviation.statistics[name], symbol, colour, values)
        for (name, symbol, colour), values in columns
    ]
    speed = np.isfinite(deviation.speed).any()
    if speed:
        drawn = line(deviation.t, deviation.speed, "speed", MUTED, "m/s")
        panels.append(Panel("‖v‖ [m/s]", [drawn], from_zero=True))
    at, duration = deviation.decisive.t_max, deviation.run.duration
    largest = ", ".join(
        f"{symbol} {_most(deviation.statistics[name])} at {text.seconds(deviation.statistics[name].t_max)} s"
        for (name, symbol, _), _ in columns
    )
    return Figure(
        "Deviation" + (" and speed" if speed else "") + " over time",
        "Δ is reference minus actual at the same time; path is the distance from the reference's path, time"
        " left out. Dashed: the tolerance; tinted: out of it. Diamonds: the largest value of each. Dotted:"
        " when the verdict was decided.",
        f"Deviation of {deviation.name} from the reference over time. Largest absolute values: {largest}."
        f" {_out_of_tolerance(deviation)}",
        stacked(panels, duration, [instant(at, f"decides at {text.seconds(at)} s", duration)]),
        PANEL_PX * len(panels) + AROUND_PX,
    )


def pose_figure(deviation: Deviation) -> Figure | None:
    """Return the deviation of the orientation and of the joints, with their tolerances; None without both."""
    angle = deviation.statistics.get("angle")
    panels = []
    if angle is not None and deviation.angle is not None:
        panels.append(_panel(deviation, angle, "angle", REFERENCE_COLOUR, deviation.angle))
    joints = list(deviation.joint_statistics.values())
    units = [unit for unit in text.SHOWN if any(one.unit == unit for one in joints)]
    panels += [_joints_panel(deviation, joints, unit) for unit in units]
    if not panels:
        return None
    subjects = ([] if angle is None else ["orientation"]) + (["joints"] if joints else [])
    held = [*([] if angle is None else [angle]), *joints]
    largest = ", ".join(f"{one.quantity} {_most(one)}" for one in held)
    return Figure(
        f"Deviation of {' and '.join(subjects)}",
        "The angle between the two orientations; reference minus actual of each joint, whole turns at the"
        " start left out. Dashed: the tolerance; tinted: out of it.",
        f"Deviation of the {' and the '.join(subjects)} of {deviation.name}. Largest absolute values:"
        f" {largest}.",
        stacked(panels, deviation.run.duration),
        sum(round(PANEL_PX * panel.share) for panel in panels) + AROUND_PX,
    )


def speed_figure(deviation: Deviation) -> Figure | None:
    """Return the norm over the tool's speed; None where the speed is not known."""
    norm = deviation.delta[:, 3] * 1e3
    known = np.flatnonzero(np.isfinite(deviation.speed) & np.isfinite(norm))
    if not len(known):
        return None
    evenly = known[np.unique(np.linspace(0, len(known) - 1, min(DOTS, len(known))).astype(np.int64))]
    kept = np.union1d(evenly, [deviation.worst]) if deviation.worst in known else evenly
    said = _correlation(deviation.speed_correlation)
    layout = base_layout() | {
        "xaxis": axis("‖v‖ [m/s]") | {"rangemode": "tozero"},
        "yaxis": axis("‖Δ‖ [mm]") | {"rangemode": "tozero"},
        "hovermode": "closest",
    }
    return Figure(
        "Deviation over speed",
        f"Each point is a sample. {said}",
        f"Norm of the deviation of {deviation.name} over the speed of its tool centre point. {said}",
        {"data": [_cloud(deviation, norm, kept)], "layout": layout},
        300,
        over="v",
    )


def _panel(
    deviation: Deviation, statistics: Statistics, symbol: str, colour: str, values: FloatArray
) -> Panel:
    """Return one quantity over time with its tolerance and its largest value."""
    unit, factor = text.SHOWN[statistics.unit]
    shown = values * factor
    peak = np.searchsorted(deviation.sample, [statistics.sample_max])
    traces = [
        line(deviation.t, shown, symbol, colour, unit),
        marks(deviation.t[peak], shown[peak], colour, "diamond", name=f"largest {symbol}"),
    ]
    size = statistics.kind != "axis"
    shapes = _tolerance(deviation, statistics, [values], from_zero=size)
    return Panel(f"{symbol} [{unit}]", traces, shapes, from_zero=size)


def _joints_panel(deviation: Deviation, joints: Sequence[Statistics], unit: str) -> Panel:
    """Return the deviation of the joints of one unit, each in its colour."""
    shown, factor = text.SHOWN[unit]
    columns = [] if deviation.joint_delta is None else list(deviation.joint_delta.T)
    chosen = [(j, one) for j, one in enumerate(joints) if one.unit == unit]
    traces = [
        line(
            deviation.t,
            columns[j] * factor,
            one.quantity,
            joint_colour(j),
            shown,
            line=stroke(joint_colour(j), DASHES[j // len(JOINT_COLOURS) % len(DASHES)]),
            showlegend=True,
        )
        for j, one in chosen
    ]
    shapes = _tolerance(deviation, chosen[0][1], [columns[j] for j, _ in chosen], from_zero=False)
    return Panel(f"Δ joints [{shown}]", traces, shapes, share=JOINTS_PX / PANEL_PX)


def _tolerance(
    deviation: Deviation, statistics: Statistics, columns: Sequence[FloatArray], *, from_zero: bool
) -> list[Spec]:
    """Return what is allowed as a band between dashed lines, and the times at which a column is out of it."""
    if statistics.tolerance is None:
        return []
    unit, factor = text.SHOWN[statistics.unit]
    high = statistics.tolerance * factor
    low = 0.0 if from_zero else -high
    near_foot = from_zero and statistics.max > LOW * statistics.tolerance
    said = f"{'±' if low else ''}{high:.6g} {unit}"
    outside = np.any([np.abs(values) > statistics.tolerance for values in columns], axis=0)
    lines = [level(high, said, above=near_foot)] + ([level(low)] if low else [])
    return [band(low, high), *shaded(deviation.t, outside, deviation.run.duration), *lines]


def _cloud(deviation: Deviation, norm: FloatArray, kept: IntArray) -> Spec:
    """Return the norm in [mm] over the speed as points."""
    shown = norm[kept]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": label(deviation.name),
        "x": typed(deviation.speed[kept], precision(deviation.speed[kept])),
        "y": typed(shown, precision(shown)),
        "customdata": typed(deviation.t[kept], "f8"),
        "marker": {"color": AXIS_COLOURS["norm"], "size": 5, "opacity": 0.55, "line": {"width": 0}},
        "hovertemplate": f"‖v‖ %{{x:.4f}} m/s<br>‖Δ‖ %{{y:{told(shown)}}} mm<br>t %{{customdata:.6~f}} s"
        "<extra></extra>",
        "showlegend": False,
    }


def _correlation(r: float | None) -> str:
    """Say what the correlation of norm and speed means."""
    if r is None:
        return "The norm or the speed does not change, so nothing can be said of how they go together."
    strength = next((word for least, word in STRENGTHS if abs(r) >= least), "")
    if not strength:
        return f"r = {correlation(r)}: the deviation does not go with the speed."
    if r > 0:
        grows = f"the deviation grows {strength} with the speed"
        return f"r = {correlation(r)}: {grows}, as a lag in time makes it grow."
    return f"r = {correlation(r)}: the deviation shrinks {strength} with the speed."


def _most(statistics: Statistics) -> str:
    """Return a quantity's largest absolute value with its unit."""
    return text.quantity(statistics.max, statistics.unit)


def _out_of_tolerance(deviation: Deviation) -> str:
    """Say how much of the log is out of tolerance."""
    if all(one.tolerance is None for one in deviation.all_statistics):
        return "There is no tolerance."
    return f"Out of tolerance: {text.percent(deviation.share_out)} of the samples."
