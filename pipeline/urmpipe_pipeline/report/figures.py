"""The figures of a report over time: deviation, joints, motion of the tool centre point."""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline.audit_entry import AuditEntry
from urmpipe_pipeline.comparison import AXES, Deviation
from urmpipe_pipeline.joint_log import FloatArray
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS, joint_colour
from urmpipe_pipeline.report import text
from urmpipe_pipeline.report.spec import (
    DASHES,
    MUTED,
    Figure,
    Panel,
    Spec,
    band,
    instant,
    label,
    level,
    line,
    marks,
    stacked,
    stroke,
)
from urmpipe_pipeline.results import Run

PANEL_PX = 112
"""Height of one plot among some on a common time axis."""

JOINTS_PX = 230
"""Height of a plot of all joints."""

MARKED = 1000
"""Repolarizations marked at most: a browser draws no more of them with ease."""

AROUND_PX = 64
"""Height of what stands above and below them: legend and time axis."""


def deviation_figure(deviation: Deviation) -> Figure:
    """Return delta per axis and its norm with their tolerances, and the speed of the tool, over time."""
    panels = [_delta_panel(deviation, number, name) for number, name in enumerate(AXES)]
    speed = _speed_panel(deviation.run, deviation.t)
    panels += speed
    t_worst, duration = float(deviation.t[deviation.worst]), deviation.run.duration
    largest = ", ".join(
        f"{text.SYMBOLS[name]} {text.millimetres(deviation.statistics[name].max)} mm"
        f" at {text.seconds(deviation.statistics[name].t_max)} s"
        for name in AXES
    )
    return Figure(
        "Deviation" + (" and speed" if speed else "") + " over time",
        "Reference minus actual. Dashed: the tolerance. Diamonds: the largest value of each. "
        "Dotted: the worst moment.",
        f"Deviation of {deviation.name} from the reference over time. Largest absolute values: {largest}.",
        stacked(panels, duration, [instant(t_worst, f"worst {text.seconds(t_worst)} s", duration)]),
        PANEL_PX * len(panels) + AROUND_PX,
    )


def motion_figure(run: Run) -> Figure | None:
    """Return position, speed and acceleration of the tool centre point over time."""
    if run.tcp is None:
        return None
    position = Panel(
        "p [m]",
        [
            line(run.t, column, name, AXIS_COLOURS[name], "m", showlegend=True)
            for name, column in zip("xyz", run.tcp.position.T, strict=True)
        ],
        share=2.0,
    )
    acceleration = np.linalg.norm(run.tcp.acceleration, axis=1)
    panels = [
        position,
        *_speed_panel(run, run.t),
        Panel("‖a‖ [m/s²]", [line(run.t, acceleration, "acceleration", MUTED, "m/s²")], from_zero=True),
    ]
    speed = np.linalg.norm(run.tcp.velocity, axis=1)
    reached = f"; the speed reaches {np.nanmax(speed):.4f} m/s" if np.isfinite(speed).any() else ""
    return Figure(
        "Motion of the tool centre point",
        "Position, speed and acceleration by forward kinematics.",
        f"Position, speed and acceleration of the tool centre point of {run.name} over time{reached}.",
        stacked(panels, run.duration),
        PANEL_PX * 4 + AROUND_PX,
    )


def joints_figure(run: Run) -> Figure | None:
    """Return the joints as the file has them and repolarized, every repolarization marked."""
    if not run.log.joints:
        return None
    unit = run.joint_unit()
    before = [*_joint_lines(run, run.log.t, run.log.q, f"{unit} in the file", True), *_raw_marks(run)]
    after = [*_joint_lines(run, run.t, run.q, unit, False), *_after_marks(run)]
    panels = [Panel(f"in the file [{unit}]", before), Panel(f"repolarized [{unit}]", after)]
    count = len(run.repolarizations)
    return Figure(
        "Joints before and after repolarization",
        _marks_caption(count),
        f"Joint values of {run.name} over time, as in the file and after"
        f" {text.counted(count, 'repolarization')}: {', '.join(run.log.joints)}.",
        stacked(panels, run.duration),
        2 * JOINTS_PX + AROUND_PX,
    )


def _delta_panel(deviation: Deviation, number: int, name: str) -> Panel:
    """Return one quantity of the deviation with its tolerance and its largest value."""
    values = deviation.delta[:, number] * 1e3
    statistics = deviation.statistics[name]
    shapes: list[Spec] = []
    if statistics.tolerance is not None:
        high = statistics.tolerance * 1e3
        low = 0.0 if name == "norm" else -high
        said = f"{'±' if low else ''}{text.limit(statistics.tolerance)} mm"
        shapes = [band(low, high), level(high, said)] + ([level(low)] if low else [])
    peak = np.searchsorted(deviation.sample, [statistics.sample_max])
    symbol = text.SYMBOLS[name]
    colour = AXIS_COLOURS[name]
    traces = [
        line(deviation.t, values, symbol, colour, "mm"),
        marks(deviation.t[peak], values[peak], colour, "diamond", name=f"largest {symbol}"),
    ]
    return Panel(f"{symbol} [mm]", traces, shapes, from_zero=name == "norm")


def _speed_panel(run: Run, t: FloatArray) -> list[Panel]:
    """Return the tool's speed at some times in [s], or nothing without kinematics."""
    if run.tcp is None:
        return []
    speed = np.interp(t, run.t, np.linalg.norm(run.tcp.velocity, axis=1))
    return [Panel("‖v‖ [m/s]", [line(t, speed, "speed", MUTED, "m/s")], from_zero=True)]


def _joint_lines(run: Run, t: FloatArray, q: FloatArray, unit: str, legend: bool) -> list[Spec]:
    """Return one line a joint; the legend switches a joint in both panels."""
    lines = []
    for j, name in enumerate(run.log.joints):
        style = stroke(joint_colour(j), DASHES[j // len(JOINT_COLOURS) % len(DASHES)])
        more = {"line": style, "legendgroup": f"joint{j}", "showlegend": legend}
        lines.append(line(t, q[:, j], name, style["color"], unit, **more))
    return lines


def _marks_caption(count: int) -> str:
    """Say what the triangles are."""
    if not count:
        return "No joint had to be repolarized."
    which = "each" if count <= MARKED else f"each of the first {MARKED}"
    return (
        f"{text.counted(count, 'repolarization')}: a triangle stands at {which},"
        " up where a turn was added, down where one was taken."
    )


def _raw_marks(run: Run) -> list[Spec]:
    """Return a triangle half way down each jump of the file."""
    return [
        _triangles(run, j, items, np.array([run.log.q[item.sample, j] - item.step / 2 for item in items]))
        for j, items in _by_joint(run)
    ]


def _after_marks(run: Run) -> list[Spec]:
    """Return a triangle on the repolarized line at each instant t_r."""
    return [
        _triangles(run, j, items, np.interp([item.t for item in items], run.t, run.q[:, j]))
        for j, items in _by_joint(run)
    ]


def _by_joint(run: Run) -> list[tuple[int, list[AuditEntry]]]:
    """Return the repolarizations that are marked, by the index of their joint."""
    found: dict[int, list[AuditEntry]] = {}
    for item in run.repolarizations[:MARKED]:
        found.setdefault(run.log.joints.index(item.joint), []).append(item)
    return list(found.items())


def _triangles(run: Run, j: int, items: list[AuditEntry], values: FloatArray) -> Spec:
    notes = [
        f"repolarization of {label(item.joint)}, row {item.row}: step {item.step:+.4f} rad,"
        f" k {item.before} → {item.after}"
        for item in items
    ]
    symbols = ["triangle-up" if item.after > item.before else "triangle-down" for item in items]
    return marks(
        np.array([item.t for item in items]),
        values,
        joint_colour(j),
        symbols,
        name=f"{label(run.log.joints[j])}, repolarization",
        legendgroup=f"joint{j}",
        text=notes,
        hoverinfo="text",
        hovertemplate="%{text}<extra></extra>",
    )
