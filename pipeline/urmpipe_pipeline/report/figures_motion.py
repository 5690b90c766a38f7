"""How a tool centre point moves: Figures 10 and 13 of the paper, for any log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.continuity import continuous_euler
from urmpipe_models.kinematics.forward import PointLog
from urmpipe_pipeline import text
from urmpipe_pipeline.decimate import POINTS
from urmpipe_pipeline.palette import AXIS_COLOURS, joint_colour
from urmpipe_pipeline.report.spec import MUTED, Figure, Panel, Spec, stacked
from urmpipe_pipeline.report.traces import line, shaded
from urmpipe_pipeline.runs.results import Run

MOTION_PX = 170
"""Height of one plot of three coordinates."""

AROUND_PX = 64
"""Height of what stands above and below them: legend and time axis."""

METRE_DIGITS = 6
"""Digits after the point of a coordinate in [m]: micrometres."""

EULER = {"rz": "z", "ry": "y", "rx": "x"}
"""The Euler angles and the axes whose colours they have."""


def motion_figure(run: Run) -> Figure | None:
    """Return position, velocity, acceleration and orientation of the tool centre point over time.

    By kinematics; of a log without them the position and the orientation that it recorded, if any.
    """
    if run.tcp is None:
        return _recorded_figure(run)
    point = point_name(run)
    panels = [
        Panel(f"{point} [m]", coordinates(run.t, run.tcp.position, "p", "m", legend=True)),
        Panel("v [m/s]", [*coordinates(run.t, run.tcp.velocity, "v", "m/s"), size(run.t, run.tcp, "v")]),
        Panel(
            "a [m/s²]", [*coordinates(run.t, run.tcp.acceleration, "a", "m/s²"), size(run.t, run.tcp, "a")]
        ),
        Panel(
            "rz, ry, rx [rad]", _euler(run.t, run.tcp), shaded(run.t, run.tcp.singular, run.duration, MUTED)
        ),
    ]
    singular = int(np.count_nonzero(run.tcp.singular))
    left_out = (
        f" Tinted: {text.counted(singular, 'sample')} with ry at ±π/2, where rz and rx are not separately"
        " defined."
        if singular
        else ""
    )
    unwrapped = "" if run.repolarizations or not run.log.joints else " No joint had to be repolarized."
    return Figure(
        "Motion of the tool centre point",
        f"{point}, its velocity v and acceleration a with their norms, and its Euler angles (moving Z-Y-X, in"
        " the colours of their axes), by forward kinematics. The angles go on past ±π, so that none jumps."
        f"{left_out}{unwrapped}",
        f"Motion of {point} of {run.name} over time by forward kinematics. {_reached(run.tcp)}",
        stacked(panels, run.duration),
        MOTION_PX * len(panels) + AROUND_PX,
    )


def pose_by_row_figure(run: Run) -> Figure | None:
    """Return position and orientation of the tool centre point where no motion joins one row and the next."""
    if run.tcp is None:
        return None
    point = point_name(run)
    singular = shaded(run.t, run.tcp.singular, run.duration, MUTED)
    panels = [
        Panel(f"{point} [m]", coordinates(run.t, run.tcp.position, "p", "m", legend=True)),
        Panel("rz, ry, rx [rad]", _euler_lines(run.t, run.tcp.euler_zyx), singular),
    ]
    return Figure(
        "Poses of the tool centre point",
        f"{point} and its Euler angles (moving Z-Y-X, in the colours of their axes), by forward kinematics:"
        " a pose a target.",
        f"Poses of {point} of {run.name} by forward kinematics.",
        stacked(panels, run.duration),
        MOTION_PX * len(panels) + AROUND_PX,
    )


def coordinates(
    t: FloatArray,
    values: FloatArray,
    symbol: str,
    unit: str,
    *,
    legend: bool = False,
    said: str = "",
    points: int = POINTS,
) -> list[Spec]:
    """Return x, y and z of something over time, in their colours.

    Args:
        t: Times in [s], shape (n,).
        values: In `unit`, shape (n, 3).
        symbol: Its letter.
        unit: Its unit.
        legend: Whether the legend stands at these lines; it switches an axis in all panels.
        said: What is said of them after the name.
        points: How many samples of each may stay.
    """
    digits = METRE_DIGITS if unit == "m" else 4
    return [
        line(
            t,
            column,
            f"{symbol}{name}{said}",
            AXIS_COLOURS[name],
            unit,
            digits=digits,
            points=points,
            legendgroup=name,
            showlegend=legend,
        )
        for name, column in zip("xyz", values.T, strict=True)
    ]


def size(t: FloatArray, motion: PointLog, symbol: str) -> Spec:
    """Return the norm of the velocity (v) or of the acceleration (a) over time.

    Args:
        t: Times in [s], shape (n,).
        motion: The tool centre point at these.
        symbol: v or a.
    """
    values, unit = (motion.velocity, "m/s") if symbol == "v" else (motion.acceleration, "m/s²")
    norm = np.linalg.norm(values, axis=1)
    shown = symbol == "v"
    return line(t, norm, f"‖{symbol}‖", AXIS_COLOURS["norm"], unit, legendgroup="norm", showlegend=shown)


def point_name(run: Run) -> str:
    """Return what the paper calls the tool centre point: p7 of an arm with seven segments."""
    return f"p{len(run.robot.joints)}" if run.robot is not None else "p"


def _euler(t: FloatArray, motion: PointLog) -> list[Spec]:
    """Return rz, ry and rx without jumps between the names of one rotation, open where they have none."""
    angles = np.where(motion.singular[:, np.newaxis], np.nan, motion.euler_zyx)
    return _euler_lines(t, continuous_euler(angles))


def _euler_lines(t: FloatArray, angles: FloatArray) -> list[Spec]:
    """Return rz, ry and rx as they are."""
    return [
        line(t, column, name, AXIS_COLOURS[axis], "rad", legendgroup=axis)
        for (name, axis), column in zip(EULER.items(), angles.T, strict=True)
    ]


def _recorded_figure(run: Run) -> Figure | None:
    """Return the position and the orientation that a log without kinematics recorded itself."""
    panels = []
    if run.tcp_recorded is not None:
        panels.append(Panel("p [m]", coordinates(run.t, run.tcp_recorded, "p", "m", legend=True)))
    if run.rotation_recorded is not None:
        panels.append(_rotation(run, run.rotation_names, run.rotation_recorded))
    if not panels:
        return None
    return Figure(
        "Motion of the tool centre point",
        "As the log recorded it: without a robot there are no kinematics.",
        f"Motion of the tool centre point over time, as {run.name} recorded it.",
        stacked(panels, run.duration),
        MOTION_PX * len(panels) + AROUND_PX,
    )


def _rotation(run: Run, names: Sequence[str], values: FloatArray) -> Panel:
    """Return a recorded orientation in its own form; a quaternion has no unit."""
    unit = "" if len(names) == 4 else "rad"
    lines = [
        line(run.t, column, name, joint_colour(i), unit, showlegend=True)
        for i, (name, column) in enumerate(zip(names, values.T, strict=True))
    ]
    return Panel(f"orientation [{unit or '-'}]", lines)


def _reached(motion: PointLog) -> str:
    """Say between which places it moves and how fast."""
    if not np.isfinite(motion.position).any():
        return "It has no value."
    low, high = (text.point(end(motion.position, axis=0)) for end in (np.nanmin, np.nanmax))
    said = f"It stays within ({low}) m and ({high}) m"
    for values, word, unit in (
        (motion.velocity, "speed", "m/s"),
        (motion.acceleration, "acceleration", "m/s²"),
    ):
        norm = np.linalg.norm(values, axis=1)
        if np.isfinite(norm).any():
            said += f"; its {word} reaches {np.nanmax(norm):.4f} {unit}"
    return f"{said}."
