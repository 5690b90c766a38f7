"""The figures of a report in space: paths of the tool centre point, equal scale on all axes."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.wording import amount_words
from urmpipe_pipeline.decimate import POINTS, decimate
from urmpipe_pipeline.palette import AXIS_COLOURS, REFERENCE_COLOUR, run_colour
from urmpipe_pipeline.report.figures_motion import point_name
from urmpipe_pipeline.report.figures_repolarization import BEFORE_POINTS, wrongness
from urmpipe_pipeline.report.spec import FAULT, INK, Figure, Spec, base_layout, space_axis, typed
from urmpipe_pipeline.runs.playback import Playback
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Simulation

DEVIATION_SCALE = ((0.0, "#8fc1e3"), (0.35, "#e69f00"), (0.7, "#d55e00"), (1.0, "#6b0f00"))
"""Small to large deviation: darker all the way, blue to red, legible on white and to the colour-blind."""

CAMERA = {"eye": {"x": 1.5, "y": -1.5, "z": 0.86}, "center": {"x": 0.0, "y": 0.0, "z": -0.2}}
"""Looked at from the front right, a little from above; in lengths of the scene."""

HANDLING = "Drag to turn; pinch to zoom, with a mouse by the bar at the top right."

AROUND, CLOSEST = 0.05, 1e-3
"""Space around a slim path as a share of its extent, and half of the shortest axis in [m]."""

SLIM = 1.7
"""Largest extent over the geometric mean of the three: from there on plotly.js, which keeps the volume of the
scene, draws the longest axis out of view."""

SCENE_PX = 540
"""Height of a scene."""


def path_figure(deviation: Deviation) -> Figure:
    """Return the reference and the actual path in space, the actual one coloured by its deviation."""
    norm = deviation.delta[:, 3] * 1e3
    kept = decimate(np.column_stack([deviation.actual, norm]))
    actual = _trail(
        "actual", deviation.actual[kept], deviation.t[kept], norm[kept], line=_by_deviation(norm, kept)
    )
    reference = _way("reference", deviation.reference, deviation.t, REFERENCE_COLOUR, 2)
    place = deviation.place(deviation.decisive)
    spots = [*_ends(deviation.actual), _spot("decides", place, FAULT, "diamond")]
    return Figure(
        "Path in space",
        "Equal scale on all axes. The colour is the distance from the reference at the same time. "
        f"{HANDLING}",
        f"Paths of the reference and of {deviation.name} in three dimensions. The verdict was decided at"
        f" x, y, z = {text.point(place)} m: {amount_words(deviation.decisive)}.",
        _scene([reference, actual, *spots], deviation.actual, deviation.reference),
        SCENE_PX,
        space=True,
    )


def run_path_figure(run: Run) -> Figure | None:
    """Return the path of a run's tool centre point in space, by kinematics and as the log recorded it."""
    traces: list[Spec] = []
    if run.tcp_recorded is not None:
        traces.append(_way("recorded by the log", run.tcp_recorded, run.t, REFERENCE_COLOUR, 2))
    if run.tcp is not None:
        traces.append(_way("forward kinematics", run.tcp.position, run.t, AXIS_COLOURS["norm"], 4))
    known = run.tcp.position if run.tcp is not None else run.tcp_recorded
    if known is None or not np.isfinite(known).any():
        return None
    low, high = np.nanmin(known, axis=0), np.nanmax(known, axis=0)
    return Figure(
        "Path in space",
        f"The tool centre point, equal scale on all axes. {HANDLING}",
        f"Path of {run.name} in three dimensions, within ({text.point(low)}) m and ({text.point(high)}) m.",
        _scene([*traces, *_ends(known)], known),
        SCENE_PX,
        space=True,
    )


def arms_path_figure(simulation: Simulation) -> Figure | None:
    """Return the path of the tip of each arm of a simulation in space; None without an arm that moved."""
    found = [(arm.block, positions_over_log(arm.chain, arm.q)) for arm in simulation.arms]
    known = [position[np.isfinite(position).all(axis=1)] for _, position in found]
    every = np.concatenate([np.empty((0, 3)), *known])
    if not len(every):
        return None
    ways = [
        _way(block, position, simulation.t, run_colour(i), 4) for i, (block, position) in enumerate(found)
    ]
    low, high = every.min(axis=0), every.max(axis=0)
    spec = _scene([*ways, *_ends(known[0] if len(known[0]) else every)], every)
    return Figure(
        "Path in space",
        f"The tip of each arm, equal scale on all axes. {HANDLING}",
        f"Path of {', '.join(block for block, _ in found)} in three dimensions, within ({text.point(low)}) m"
        f" and ({text.point(high)}) m.",
        spec,
        SCENE_PX,
        space=True,
    )


def repolarized_path_figure(run: Run, played: Playback) -> Figure | None:
    """Return the path in space as the raw joints lead the tool centre point, and after repolarization.

    None without kinematics.
    """
    if run.tcp is None:
        return None
    after = run.tcp.position
    spots = _ends(after)
    if played.worst is not None:
        spots.append(_spot("furthest off", played.position[played.worst], FAULT, "diamond"))
    return Figure(
        "Path in space before and after repolarization",
        f"{wrongness(run, played)} A word in the legend hides or shows a path. {HANDLING}",
        f"Path of {point_name(run)} of {run.name} in three dimensions, as the angles of the file lead it and"
        f" after repolarization. {wrongness(run, played)}",
        _scene(
            [
                _way("before", played.position, played.t, FAULT, 2, BEFORE_POINTS),
                _way("after", after, run.t, AXIS_COLOURS["norm"], 5),
                *spots,
            ],
            after,
            played.position,
        ),
        SCENE_PX,
        space=True,
    )


def _by_deviation(norm: FloatArray, kept: IntArray) -> Spec:
    """Return a line's style that colours it by the norm in [mm], with its scale."""
    return {
        "color": typed(norm[kept]),
        "colorscale": [list(stop) for stop in DEVIATION_SCALE],
        "cmin": 0.0,
        "cmax": float(norm.max()) or 1.0,
        "width": 6,
        "showscale": True,
        "colorbar": {
            "title": {"text": "actual path: ‖Δ‖ [mm]", "side": "top"},
            "orientation": "h",
            "thickness": 10,
            "len": 0.6,
            "y": 0,
            "yanchor": "top",
        },
    }


def _way(
    name: str, position: FloatArray, t: FloatArray, colour: str, width: int, points: int = POINTS
) -> Spec:
    """Return a path of one colour."""
    kept = decimate(position, points, t)
    return _trail(name, position[kept], t[kept], None, line={"color": colour, "width": width})


def _trail(name: str, position: FloatArray, t: FloatArray, norm: FloatArray | None, **more: Spec) -> Spec:
    """Return a path in space; the pointer tells its time, place and deviation in [mm]."""
    told = "t %{customdata[0]:.3f} s<br>x %{x:.4f} m<br>y %{y:.4f} m<br>z %{z:.4f} m"
    told += "" if norm is None else "<br>‖Δ‖ %{customdata[1]:.4f} mm"
    columns = [t] if norm is None else [t, norm]
    return _in_space(position) | {
        "mode": "lines",
        "name": name,
        "showlegend": norm is None,  # a line of many colours is told by its colour scale
        "customdata": typed(np.column_stack(columns), "f8"),
        "hovertemplate": told + f"<extra>{name}</extra>",
        **more,
    }


def _ends(position: FloatArray) -> list[Spec]:
    """Return where a path starts and ends."""
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    if not len(known):
        return []
    start, end = position[known[0]], position[known[-1]]
    return [_spot("start", start, INK, "circle"), _spot("end", end, INK, "square")]


def _spot(name: str, position: FloatArray, colour: str, symbol: str) -> Spec:
    """Return one marked point in space."""
    return _in_space(position[np.newaxis]) | {
        "mode": "markers",
        "name": name,
        "marker": {"color": colour, "size": 6, "symbol": symbol},
        "hovertemplate": f"x %{{x:.4f}} m<br>y %{{y:.4f}} m<br>z %{{z:.4f}} m<extra>{name}</extra>",
    }


def _in_space(position: FloatArray) -> Spec:
    x, y, z = (typed(column) for column in position.T)
    return {"type": "scatter3d", "x": x, "y": y, "z": z}


def _scene(traces: list[Spec], *positions: FloatArray) -> Spec:
    """Return a scene with equal scale on all axes, the z axis up.

    Args:
        traces: What is in it.
        positions: Where that is, in [m], shape (any, 3) each: around a slim path all axes are equally long.
    """
    axes = {f"{name}axis": space_axis(f"{name} [m]") for name in "xyz"}
    scene = axes | {"aspectmode": "data", "camera": CAMERA}
    every = np.concatenate(positions)
    known = every[np.isfinite(every).all(axis=1)]
    if len(known) and _slim(low := known.min(axis=0), high := known.max(axis=0)):
        half = max(float((high - low).max()) / 2.0 * (1.0 + AROUND), CLOSEST)
        for name, middle in zip("xyz", ((low + high) / 2.0).tolist(), strict=True):
            axes[f"{name}axis"]["range"] = [middle - half, middle + half]
        scene["aspectmode"] = "cube"
    layout = base_layout() | {"scene": scene, "margin": {"l": 0, "r": 0, "t": 0, "b": 56}}
    return {"data": traces, "layout": layout}


def _slim(low: FloatArray, high: FloatArray) -> bool:
    """Tell whether what lies between two corners is much longer than wide or high."""
    extent = np.maximum(high - low, CLOSEST)
    return bool(extent.max() > SLIM * np.prod(extent) ** (1.0 / 3.0))
