"""A log before and after repolarization: Figure 5 of the paper, for any log."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.kinematics.forward import PointLog
from urmpipe_pipeline import text
from urmpipe_pipeline.decimate import POINTS
from urmpipe_pipeline.palette import JOINT_COLOURS, joint_colour
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry
from urmpipe_pipeline.report.figures_motion import coordinates, point_name
from urmpipe_pipeline.report.spec import FAULT, MUTED, Figure, Panel, Spec, stacked
from urmpipe_pipeline.report.traces import DASHES, instant, label, line, marks, stroke
from urmpipe_pipeline.runs.playback import MOST, PARTS, Playback
from urmpipe_pipeline.runs.results import Run

JOINTS_PX = 230
"""Height of a plot of all joints."""

POINT_PX = 140
"""Height of a plot of the tool centre point; all of them fit on a printed page."""

BEFORE_POINTS = 4000
"""Points of a line with jumps: it leaves its course and comes back within a sample, so that it needs more."""

MARKED = 1000
"""Repolarizations marked at most: a browser draws no more of them with ease."""

LEGEND_Y = 1.025
"""Where the legend begins, in heights of the plot: above the word at the head of a line through it."""

AROUND_PX = 64
"""Height of what stands above and below them: legend and time axis."""


def joints_figure(run: Run) -> Figure | None:
    """Return the joints as the file has them and repolarized, every repolarization marked; None of a path."""
    if not run.log.joints:
        return None
    unit, count = run.joint_unit(), len(run.repolarizations)
    joints = f"Joint values of {run.name} over time: {', '.join(run.log.joints)}."
    if not count:
        return Figure(
            "Joints",
            "No joint had to be repolarized: they are as in the file.",
            f"{joints} No joint had to be repolarized.",
            stacked([Panel(f"joints [{unit}]", _joint_lines(run, run.t, run.q, unit, True))], run.duration),
            JOINTS_PX + AROUND_PX,
        )
    before = [*_joint_lines(run, run.log.t, run.log.q, f"{unit} in the file", True), *_raw_marks(run)]
    after = [*_joint_lines(run, run.t, run.q, unit, False), *_after_marks(run)]
    panels = [Panel(f"before [{unit}]", before), Panel(f"after [{unit}]", after)]
    return Figure(
        "Joints before and after repolarization",
        _marks_caption(count),
        f"{joints} Above as in the file, below after {text.counted(count, 'repolarization')}.",
        stacked(panels, run.duration),
        2 * JOINTS_PX + AROUND_PX,
    )


def point_figure(run: Run, played: Playback) -> Figure | None:
    """Return the tool centre point, its speed and acceleration as the raw joints move it, and after.

    None without kinematics.
    """
    if run.tcp is None:
        return None
    point = point_name(run)
    panels = [
        Panel(
            f"{point} before [m]",
            coordinates(
                played.t, played.position, "p", "m", legend=True, said=" before", points=BEFORE_POINTS
            ),
        ),
        Panel(f"{point} after [m]", coordinates(run.t, run.tcp.position, "p", "m", said=" after")),
        *_sizes(run, run.tcp, played),
    ]
    worst = played.worst
    through = []
    if worst is not None:
        at = float(played.t[worst])
        through = [instant(at, f"furthest off {text.seconds(at)} s", run.duration)]
    spec = stacked(panels, run.duration, through)
    spec["layout"]["legend"] |= {"y": LEGEND_Y}
    return Figure(
        "Tool centre point before and after repolarization",
        f"{wrongness(run, played)} {explained(run)}",
        f"Position, speed and acceleration of {point} of {run.name} over time, as the angles of the file move"
        f" it and after repolarization. {wrongness(run, played)}",
        spec,
        sum(round(POINT_PX * panel.share) for panel in panels) + AROUND_PX,
    )


def wrongness(run: Run, played: Playback) -> str:
    """Say how far the tool centre point goes wrong at most, and when, and what becomes of its speed."""
    worst = played.worst
    if worst is None:
        return "How far the tool centre point goes wrong is not known."
    t = float(played.t[worst])
    guilty = min(run.repolarizations, key=lambda entry: abs(entry.t - t))
    off, at = text.millimetres(float(played.off[worst])), text.seconds(t)
    return (
        f"Before repolarization {point_name(run)} goes wrong by up to {off} mm, at t = {at} s, where"
        f" {guilty.joint} jumps (row {guilty.row}); its speed reaches {_reached(played.velocity)} m/s, its"
        f" acceleration {_reached(played.acceleration)} m/s²."
    )


def explained(run: Run) -> str:
    """Say what "before" means."""
    some = f" Of the jumps the first {MOST} are played back." if len(run.repolarizations) > MOST else ""
    return (
        "Before: the angles of the file, linear from row to row, as an environment shows them that plays the"
        f" log back with {PARTS} steps across each jump. After: repolarized.{some}"
    )


def _sizes(run: Run, after: PointLog, played: Playback) -> list[Panel]:
    """Return speed and acceleration before and after, each on its own scale."""
    found = []
    for symbol, unit, values, right in (
        ("v", "m/s", played.velocity, after.velocity),
        ("a", "m/s²", played.acceleration, after.acceleration),
    ):
        for word, t, vectors, colour, digits in (
            ("before", played.t, values, FAULT, 1),
            ("after", run.t, right, MUTED, 4),
        ):
            norm = np.linalg.norm(vectors, axis=1)
            points = BEFORE_POINTS if word == "before" else POINTS
            drawn = line(t, norm, f"‖{symbol}‖ {word}", colour, unit, digits=digits, points=points)
            found.append(Panel(f"‖{symbol}‖ {word} [{unit}]", [drawn], share=0.75, from_zero=True))
    return found


def _reached(vectors: FloatArray) -> str:
    """Return the largest norm, with no more digits than such a number has."""
    norm = np.linalg.norm(vectors, axis=1)
    return f"{np.nanmax(norm):.4g}" if np.isfinite(norm).any() else text.NOTHING


def _joint_lines(run: Run, t: FloatArray, q: FloatArray, unit: str, legend: bool) -> list[Spec]:
    """Return one line a joint; the legend switches a joint in both panels."""
    lines = []
    for j, name in enumerate(run.log.joints):
        style = stroke(joint_colour(j), DASHES[j // len(JOINT_COLOURS) % len(DASHES)])
        more: Spec = {"line": style, "legendgroup": f"joint{j}", "showlegend": legend}
        lines.append(line(t, q[:, j], name, style["color"], unit, **more))
    return lines


def _marks_caption(count: int) -> str:
    """Say what the triangles are."""
    which = "each" if count <= MARKED else f"each of the first {MARKED}"
    return (
        f"Above as in the file, below repolarized. {text.counted(count, 'repolarization')}: a triangle stands"
        f" at {which}, up where a turn was added, down where one was taken."
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
