"""Paths and solids in space as plotly.js draws them: equal scale on all axes, the z axis up."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import ns_to_seconds
from urmpipe_pipeline.presentation.curves import choose_point_count, decimate
from urmpipe_pipeline.presentation.figure import SpaceFigure
from urmpipe_pipeline.presentation.layout import LIMITED_SCALE, value_scales
from urmpipe_pipeline.presentation.palette import VALUE_SCALE
from urmpipe_pipeline.presentation.parts import spot_at
from urmpipe_pipeline.presentation.scene import Arrows, Path, PlaneView, Sheets, Solid, Spot
from urmpipe_pipeline.report.spec import Figure, Spec, base_layout, space_axis, typed
from urmpipe_pipeline.report.traces import label

CAMERA = {"eye": {"x": 1.5, "y": -1.5, "z": 0.86}, "center": {"x": 0.0, "y": 0.0, "z": -0.2}}
"""Looked at from the front right, a little from above; in lengths of the scene."""

AROUND, CLOSEST = 0.05, 1e-3
"""Space around a slim path as a share of its extent, and half of the shortest axis in [m]."""

SLIM = 1.7
"""Largest extent over the geometric mean of the three: from there on plotly.js, which keeps the volume of the
scene, draws the longest axis out of view."""

SCENE_PX = 540
"""Height of a scene."""

DOT_PX, PLACE_PX = 3, 6
"""Width of the dot that an arrow starts from, or a pose stands at; of a place that stands on a path."""

TINT = 0.12
"""Opacity of a sheet: several behind each other still let a path through."""

LIGHT = {"ambient": 0.6, "diffuse": 0.6, "specular": 0.1}
"""How solids are lit: their colours stay those of the legend."""

BACK_PX, FRONT_PX, VALUES_PX = 2, 5, 6
"""Width of a path: of those in the back, of the one in front, and of one that its values colour."""


PLANE_SIZE, PLANE_DISTANCE, PLANE_CENTRE, PLANE_TILT = 1.75, 1.9, -0.1, 0.25
"""Of a planar mechanism: its longest axis, how far away the eye is, and what it looks at above the middle, in
lengths of the scene; the angle between the eye and the normal in [rad]."""


def drawn_space(figure: SpaceFigure) -> Figure:
    """Return paths, places and solids in space."""
    lined = any(path.line for path in figure.paths)
    traces = [
        _path(path, FRONT_PX if path is figure.paths[-1] else BACK_PX, PLACE_PX if lined else DOT_PX)
        for path in figure.paths
    ]
    places = [np.asarray(path.position[:]) for path in figure.paths]
    if figure.arrows is not None:
        traces += _arrows(figure.arrows)
        places += [figure.arrows.start, figure.arrows.end]
    if figure.sheets is not None and len(figure.sheets.corners):
        traces = [*_sheets(figure.sheets), *traces]
        places.append(figure.sheets.corners.reshape(-1, 3))
    traces += _solids(_lifted(figure))
    places += [one.points for one in figure.solids if not one.hidden]
    return Figure(
        figure.title,
        figure.caption,
        figure.alt,
        _scene([*traces, *_spots(figure.spots)], places, figure.plane),
        SCENE_PX,
        space=True,
        folded=figure.folded,
    )


def _path(path: Path, width: int, dot: int) -> Spec:
    """Return a path as a line or as dots; the pointer tells its time or row, its place and its value."""
    position = np.asarray(path.position[:])
    timed = path.t_ns is not None
    rows = np.arange(len(position)) if path.sample is None else np.asarray(path.sample)
    t = np.asarray(rows + 1.0, np.float64) if path.t_ns is None else ns_to_seconds(path.t_ns[:])
    unit, factor = text.SHOWN.get(path.unit, (path.unit, 1.0))
    values = np.full(len(position), np.nan) if path.values is None else factor * np.asarray(path.values[:])
    columns = position if path.values is None else np.column_stack([position, values])
    kept = np.union1d(
        decimate(columns, choose_point_count(path.t_ns), t), np.asarray(path.kept, dtype=np.int64)
    )
    place, t, shown = (_picked(one, kept, path.sample) for one in (position, t, values))
    said = "t %{customdata[0]:.3f} s" if timed else "row %{customdata[0]}"
    said += "<br>x %{x:.4f} m<br>y %{y:.4f} m<br>z %{z:.4f} m"
    if path.values is not None:
        said += f"<br>%{{customdata[1]:.{text.MAX_DECIMALS}f}} {label(unit)}"
    style = {"color": path.colour, "width": width, "dash": "dash" if path.supposed else "solid"}
    return _in_space(place) | {
        "mode": "lines" if path.line else "markers",
        "marker": {"color": path.colour, "size": dot},
        "name": label(path.name),
        "showlegend": path.values is None,  # a line of many colours is told by its colour scale
        "customdata": typed(t if path.values is None else np.column_stack([t, shown]), "f8"),
        "hovertemplate": f"{said}<extra>{label(path.name)}</extra>",
        "line": style
        if path.values is None
        else _by_value(path.name, shown, unit, path.limit and factor * path.limit),
    }


def _picked(values: FloatArray, kept: IntArray, sample: IntArray | None) -> FloatArray:
    """Return the values that are drawn, and one that is missing wherever rows are missing between two."""
    if sample is None or not len(kept):
        return values[kept]
    gaps = np.cumsum(np.diff(sample[:], prepend=sample[0]) > 1)[kept]
    return np.insert(values[kept].astype(np.float64), np.flatnonzero(np.diff(gaps) > 0) + 1, np.nan, axis=0)


def _by_value(name: str, values: FloatArray, unit: str, limit: float | None) -> Spec:
    """Return a line's style that colours it by its values, all in one unit, with their scale."""
    largest = float(np.nanmax(values, initial=0.0))
    scales = value_scales(values, limit)
    ticks: Spec = {}
    if scales is not None:
        places = scales.height(np.array(scales.ticks())).tolist()
        words = ["0", f"{limit:.4g} allowed", f"{scales.ticks()[2]:.4g}"]
        ticks = {"tickvals": places, "ticktext": words}
    colours = VALUE_SCALE if scales is None else LIMITED_SCALE
    return {
        "color": typed(values if scales is None else scales.height(values)),
        "colorscale": [list(stop) for stop in colours],
        "cmin": 0.0,
        "cmax": largest or 1.0 if scales is None else 1.0,
        "width": VALUES_PX,
        "showscale": True,
        "colorbar": ticks
        | {
            "title": {"text": f"{label(name)} [{label(unit) or '-'}]", "side": "top"},
            "orientation": "h",
            "thickness": 10,
            "len": 0.6,
            "y": 0,
            "yanchor": "top",
        },
    }


def _sheets(sheets: Sheets) -> Iterator[Spec]:
    """Yield sheets, two triangles each, and their outlines; one entry of the legend switches both."""
    corners, name, first = sheets.corners, label(sheets.name), 4 * np.arange(len(sheets.corners))
    shared = {"name": name, "legendgroup": name, "hoverinfo": "skip"}
    triangles = np.concatenate([first + np.array([[0], [1], [2]]), first + np.array([[0], [2], [3]])], axis=1)
    x, y, z = (typed(column) for column in corners.reshape(-1, 3).T)
    faces = dict(zip("ijk", triangles.tolist(), strict=True))
    look = {"color": sheets.colour, "opacity": TINT, "flatshading": True, "showlegend": False}
    yield {"type": "mesh3d", "x": x, "y": y, "z": z} | faces | shared | look
    closed = np.concatenate((corners, corners[:, :1], np.full_like(corners[:, :1], np.nan)), axis=1)
    style = {"mode": "lines", "line": {"color": sheets.colour, "width": BACK_PX}}
    yield _in_space(closed.reshape(-1, 3)) | shared | style


def _lifted(figure: SpaceFigure) -> tuple[Solid, ...]:
    """Return solids; those of a planar mechanism have their words before them, where none hides them."""
    if figure.plane is None or not figure.solids:
        return figure.solids
    normal = figure.plane.axes[:, 2]
    front = max(float((one.points @ normal).max()) for one in figure.solids if len(one.points))
    places = (np.array(one.at) + (front - np.array(one.at) @ normal) * normal for one in figure.solids)
    return tuple(replace(one, at=spot_at(place)) for one, place in zip(figure.solids, places, strict=True))


def _solids(solids: tuple[Solid, ...]) -> Iterator[Spec]:
    """Yield solids with their lines and words; those of one entry of the legend are switched together."""
    told: set[str] = set()
    for one in solids:
        name = label(one.legend or one.name)
        shared = {"name": name, "legendgroup": name, "showlegend": name not in told}
        shared |= {"visible": "legendonly"} if one.hidden else {}
        told.add(name)
        own = label(one.name)
        corners, places = np.unique(one.triangles.reshape(-1, 3), axis=0, return_inverse=True)
        x, y, z = (typed(column) for column in corners.T)
        faces = dict(zip("ijk", places.reshape(-1, 3).T.tolist(), strict=True))
        look = {"color": one.colour, "opacity": one.opacity, "flatshading": True, "hoverinfo": "name"}
        told_as = {"hovertemplate": f"{own}<extra></extra>", "lighting": LIGHT}
        yield {"type": "mesh3d", "x": x, "y": y, "z": z} | faces | look | shared | told_as
        rest = shared | {"showlegend": False}
        if one.lines:
            apart = [np.vstack((line, np.full((1, 3), np.nan))) for line in one.lines]
            style = {"mode": "lines", "line": {"color": one.colour, "width": BACK_PX}, "hoverinfo": "skip"}
            yield _in_space(np.concatenate(apart)) | rest | style
        if one.label:
            words = {"mode": "text", "text": [label(one.label)], "hoverinfo": "skip"}
            yield _in_space(np.array([one.at])) | rest | words


def _arrows(arrows: Arrows) -> Iterator[Spec]:
    """Yield arrows as lines, a dot where each starts; both in the colour of what it stands for."""
    unit, factor = text.SHOWN.get(arrows.unit, (arrows.unit, 1.0))
    values, row = factor * arrows.values, arrows.sample + 1
    limit = arrows.limit and factor * arrows.limit
    style, scales = _by_value(arrows.name, values, unit, limit), value_scales(values, limit)
    heights = values if scales is None else scales.height(values)
    apart = np.full_like(arrows.start, np.nan)
    yield _in_space(np.stack((arrows.start, arrows.end, apart), axis=1).reshape(-1, 3)) | {
        "mode": "lines",
        "name": label(arrows.name),
        "showlegend": False,
        "hoverinfo": "skip",
        "line": style | {"color": typed(np.repeat(heights, 3)), "width": FRONT_PX, "showscale": False},
    }
    said = "row %{customdata[0]}<br>x %{x:.4f} m<br>y %{y:.4f} m<br>z %{z:.4f} m"
    said += f"<br>%{{customdata[1]:.{text.MAX_DECIMALS}f}} {label(unit)}"
    yield _in_space(arrows.start) | {
        "mode": "markers",
        "name": label(arrows.name),
        "showlegend": False,
        "customdata": typed(np.column_stack([row, values]), "f8"),
        "hovertemplate": f"{said}<extra>{label(arrows.name)}</extra>",
        "marker": {name: style[name] for name in style if name != "width"} | {"size": DOT_PX},
    }


def _spots(spots: tuple[Spot, ...]) -> Iterator[Spec]:
    """Yield what decides as diamonds, and the ends, the first of them round."""
    ends = iter(("circle",))
    for spot in spots:
        symbol = "diamond" if spot.always else next(ends, "square")
        name = label(spot.words)
        yield _in_space(np.array([spot.position])) | {
            "mode": "markers",
            "name": name,
            "marker": {"color": spot.colour, "size": 6, "symbol": symbol},
            "hovertemplate": f"x %{{x:.4f}} m<br>y %{{y:.4f}} m<br>z %{{z:.4f}} m<extra>{name}</extra>",
        }


def _in_space(position: FloatArray) -> Spec:
    x, y, z = (typed(column) for column in position.T)
    return {"type": "scatter3d", "x": x, "y": y, "z": z}


def _scene(traces: list[Spec], positions: list[FloatArray], plane: PlaneView | None) -> Spec:
    """Return a scene with equal scale on all axes; around slim paths in [m], all axes are equally long."""
    axes = {f"{name}axis": space_axis(f"{name} [m]") for name in "xyz"}
    scene = axes | {"aspectmode": "data", "camera": CAMERA}
    every = np.concatenate([np.empty((0, 3)), *positions])
    known = every[np.isfinite(every).all(axis=1)]
    low, high = (known.min(axis=0), known.max(axis=0)) if len(known) else (np.zeros(3), np.zeros(3))
    half = np.maximum((high - low) / 2.0 * (1.0 + AROUND), CLOSEST)
    if plane is not None:  # plotly.js would enlarge what is flat beyond the view
        shape = dict(zip("xyz", (PLANE_SIZE * half / half.max()).tolist(), strict=True))
        scene |= {"aspectmode": "manual", "aspectratio": shape, "camera": _camera(plane)}
        across = "xyz"[int(np.argmax(np.abs(plane.axes[:, 2])))]
        axes[f"{across}axis"] |= {"showticklabels": False, "title": {"text": ""}}  # seen from its end
    elif len(known) and _slim(low, high):
        half, scene["aspectmode"] = np.full(3, half.max()), "cube"
    if scene["aspectmode"] != "data":
        for name, middle, around in zip("xyz", (low + high) / 2.0, half, strict=True):
            axes[f"{name}axis"]["range"] = [float(middle - around), float(middle + around)]
    layout = base_layout() | {"scene": scene, "margin": {"l": 0, "r": 0, "t": 0, "b": 56}}
    return {"data": traces, "layout": layout}


def _camera(plane: PlaneView) -> Spec:
    """Return a camera that looks along the normal of a plane, a little from above or from the front."""
    _, up, normal = plane.axes.T
    tilt = PLANE_TILT if up[2] > 0.5 else -PLANE_TILT
    eye = PLANE_DISTANCE * (np.cos(tilt) * normal + np.sin(tilt) * up)
    places = {"eye": eye, "up": up, "center": PLANE_CENTRE * up}  # the numbers of an axis stand below
    return {name: dict(zip("xyz", place.tolist(), strict=True)) for name, place in places.items()}


def _slim(low: FloatArray, high: FloatArray) -> bool:
    """Tell whether what lies between two corners is much longer than wide or high."""
    extent = np.maximum(high - low, CLOSEST)
    return bool(extent.max() > SLIM * np.prod(np.cbrt(extent)))
