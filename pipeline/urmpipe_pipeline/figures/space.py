"""Paths and solids in space: equal scale on all axes, the z axis up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.artist import Artist
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, FuncNorm, LinearSegmentedColormap, Normalize, to_rgba
from matplotlib.legend import Legend
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.proj3d import proj_transform

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.figures.letters import drawable
from urmpipe_pipeline.figures.panels import in_unit
from urmpipe_pipeline.figures.sheet import INCH, Sheet, em, fitting, sheet
from urmpipe_pipeline.figures.size import Size
from urmpipe_pipeline.joint_log import ns_to_seconds
from urmpipe_pipeline.presentation.curves import choose_point_count, decimate
from urmpipe_pipeline.presentation.figure import SpaceFigure
from urmpipe_pipeline.presentation.layout import LIMITED_SCALE, value_scales
from urmpipe_pipeline.presentation.palette import VALUE_SCALE
from urmpipe_pipeline.presentation.scene import Path, Sheets, Solid

VALUES = LinearSegmentedColormap.from_list("urmpipe values", list(VALUE_SCALE))
LIMITED = LinearSegmentedColormap.from_list("urmpipe values with a limit", list(LIMITED_SCALE))
"""Small to large; up to a limit, and beyond it."""

VIEW = {"elev": 22.0, "azim": -50.0}
"""Looked at from the front right, a little from above, in [deg]."""

HIGH = 0.72
"""Height of a scene at most, in widths of the sheet."""

SLIM = 1.7
"""Largest extent over the geometric mean of the three: from there on all axes are equally long."""

AROUND, CLOSEST = 0.05, 1e-3
"""Space around a path as a share of its extent, and half of the shortest axis in [m]."""

LABEL_PAD, TICK_PAD = -0.7, -0.35
"""From an axis to its words and to its ticks' words, beyond what matplotlib leaves, in sizes of the font."""

LINE, SCALE, BAR, BAR_HIGH = 1.25, 3.6, 1.0, 0.6
"""Heights in sizes of the font: of a line of the legend, of a scale of colours, from its top to the end of
its bar, and of the bar."""

MARGIN = 0.98
"""Width and height of a scene with its words, in those of the sheet."""

TINT, LIGHTEST = 0.12, 2000
"""Opacity of a sheet; triangles of solids from where on they are drawn as a picture within a PDF or SVG."""

BACK, FRONT = 0.7, 1.6
"""Width of paths: of those in the back, and of the one in front, in widths of a line."""


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """A scale of colours.

    Attributes:
        norm: From values to shares of it.
        colours: From shares to colours.
        words: Quantity and unit.
        ticks: Values that have a tick, with its words; empty for round ones.
    """

    norm: Normalize
    colours: Colormap
    words: str
    ticks: Mapping[float, str]

    @classmethod
    def of(cls, values: FloatArray, limit: float | None, words: str) -> Scale:
        """Return the scale of some values, shape (n,), and of what is allowed of them, all in one unit."""
        scales = value_scales(values, limit)
        if scales is None:
            return cls(Normalize(0.0, float(np.nanmax(values, initial=0.0)) or 1.0), VALUES, words, {})
        norm = FuncNorm((scales.height, scales.value), 0.0, scales.top)
        ticks = {one: f"{one:.4g}{' allowed' * (one == scales.inner)}" for one in scales.ticks()}
        return cls(norm, LIMITED, words, ticks)

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the colours of values, shape (n, 4)."""
        return np.asarray(self.colours(self.norm(values)))


def drawn_space(figure: SpaceFigure, size: Size) -> Sheet:
    """Return paths, places and solids in space."""
    made = sheet(size, 0.0, laid_out=False)
    axes = made.add_subplot(projection="3d", **VIEW)
    entries: dict[str, Artist] = {}
    for one in figure.solids:
        if not one.hidden:
            entries |= _solid(axes, one)
    if figure.sheets is not None and len(figure.sheets.corners):
        entries |= _sheets(axes, figure.sheets)
    scales = [_path(axes, path, size, entries, front=path is figure.paths[-1]) for path in figure.paths]
    scales.append(_arrows(axes, figure))
    entries |= _spots(axes, figure)
    _equal(axes, _places(figure))
    _name(axes, size)
    _place(made, axes, size, entries, [one for one in scales if one is not None])
    return made


def _name(axes: Axes3D, size: Size) -> None:
    """Name the axes, near to their ticks."""
    for name in "xyz":
        axis = getattr(axes, f"{name}axis")
        axis.set_pane_color("white")
        axis.labelpad = LABEL_PAD * size.font
        axes.tick_params(name, pad=TICK_PAD * size.font)
        getattr(axes, f"set_{name}label")(f"{name} [m]")


def _place(made: Sheet, axes: Axes3D, size: Size, entries: dict[str, Artist], scales: list[Scale]) -> None:
    """Put the legend above the scene, the scales of its colours below, and make the sheet as high as that."""
    made.set_figheight(HIGH * size.width / INCH)
    square, box = _fitted(made, axes)

    def write(columns: int) -> Legend:
        """Write the legend in so many columns."""
        legend: Legend = axes.legend(
            [*entries.values()], [*entries], loc="upper left", ncols=columns, borderaxespad=0.0,
            bbox_to_anchor=(0.01, 0.995), bbox_transform=made.transFigure,
        )  # fmt: skip
        return legend

    lines = fitting(write, made, len(entries)) if entries else 0
    dot = INCH / made.dpi
    below = SCALE * len(scales) * em(size)
    whole = LINE * lines * em(size) + box.height * dot + below
    made.set_figheight(whole / INCH)
    raised = square.translated(0.0, below / dot - box.y0)
    axes.set_position(raised.transformed(made.transFigure.inverted()))
    for number, scale in enumerate(reversed(scales), start=1):
        bottom = (SCALE * number - BAR) * em(size) / whole
        bar = made.colorbar(
            ScalarMappable(scale.norm, scale.colours), orientation="horizontal",
            cax=made.add_axes((0.2, bottom, 0.6, BAR_HIGH * em(size) / whole)),
        )  # fmt: skip
        if scale.ticks:
            bar.set_ticks([*scale.ticks], labels=[*scale.ticks.values()])
        bar.set_label(scale.words)
        bar.outline.set_visible(False)


def _fitted(made: Sheet, axes: Axes3D) -> tuple[Bbox, Bbox]:
    """Make a scene as large as the sheet; return the square that holds it and its extent, in dots.

    Words do not grow with it: the second step is nearly exact.
    """
    room = made.bbox.shrunk(MARGIN, MARGIN)
    square = Bbox.from_bounds(0.0, (room.height - room.width) / 2.0, room.width, room.width)
    for _ in range(2):
        axes.set_position(square.transformed(made.transFigure.inverted()))
        box = _extent(made, axes)
        grown = min(room.width / box.width, room.height / box.height)
        middle = np.add(square.p0, square.p1) / 2.0
        away = np.array(made.bbox.size) / 2.0 - middle - grown * (np.add(box.p0, box.p1) / 2.0 - middle)
        half = grown * square.width / 2.0
        square = Bbox([middle + away - half, middle + away + half])
    axes.set_position(square.transformed(made.transFigure.inverted()))
    return square, _extent(made, axes)


def _extent(made: Sheet, axes: Axes3D) -> Bbox:
    """Return where the corners of a scene and the words at its axes are drawn, in dots."""
    made.draw_without_rendering()
    corners = np.array(list(product(axes.get_xlim(), axes.get_ylim(), axes.get_zlim()))).T
    x, y, _ = proj_transform(*corners, axes.get_proj())
    boxes = [Bbox.null()]
    boxes[0].update_from_data_xy(axes.transData.transform(np.column_stack((x, y))))
    boxes += [one.get_tightbbox(made.renderer) for one in (axes.xaxis, axes.yaxis, axes.zaxis)]
    return Bbox.union(boxes)


def _path(axes: Axes3D, path: Path, size: Size, entries: dict[str, Artist], *, front: bool) -> Scale | None:
    """Draw a path as a line, as one of many colours, or as dots, and tell the legend, or return its scale."""
    place, values, limit, unit = _kept(path)
    width = size.font / 8.0 * (FRONT if front else BACK)
    if path.values is not None and path.line:
        pieces = np.stack((place[:-1], place[1:]), axis=1)
        scale = Scale.of(values, limit, in_unit(path.name, unit))
        _coloured(axes, pieces, scale(values[1:]), width)
        return scale
    look = (
        {"linestyle": ":" if path.supposed else "--" if path.asked else "-"}
        if path.line
        else {"marker": "o", "linestyle": "none"}
    )
    (line,) = axes.plot(*place.T, color=path.colour, linewidth=width, markersize=2.5, **look)
    entries[drawable(path.name)] = line
    return None


def _kept(path: Path) -> tuple[FloatArray, FloatArray, float | None, str]:
    """Return the drawn places of a path, their values, the limit and unit of these; NaN breaks the line."""
    position = np.asarray(path.position[:], np.float64)
    unit, factor = text.SHOWN.get(path.unit, (path.unit, 1.0))
    values = np.full(len(position), np.nan) if path.values is None else factor * np.asarray(path.values[:])
    rows = np.arange(len(position)) if path.sample is None else np.asarray(path.sample[:])
    t = np.asarray(rows + 1.0) if path.t_ns is None else ns_to_seconds(path.t_ns[:])
    columns = position if path.values is None else np.column_stack([position, values])
    kept = np.union1d(
        decimate(columns, choose_point_count(path.t_ns), t), np.asarray(path.kept, dtype=np.int64)
    )
    gaps = np.cumsum(np.diff(rows, prepend=rows[:1]) > 1)[kept]
    breaks = np.flatnonzero(np.diff(gaps) > 0) + 1
    place = np.insert(position[kept], breaks, np.nan, axis=0)
    return place, np.insert(values[kept], breaks, np.nan), path.limit and factor * path.limit, unit


def _coloured(axes: Axes3D, ends: FloatArray, colours: FloatArray, width: float) -> None:
    """Draw pieces of lines, shape (n, 2, 3), each in its colour, shape (n, 4)."""
    whole = np.isfinite(ends).all(axis=(1, 2))
    if whole.any():  # matplotlib cannot place an empty collection
        lines = Line3DCollection(ends[whole], colors=colours[whole], linewidths=width, capstyle="round")
        axes.add_collection3d(lines)


def _sheets(axes: Axes3D, sheets: Sheets) -> dict[str, Artist]:
    """Draw sheets that one sees through, with their edges; return what a legend says of them."""
    look = {"facecolors": to_rgba(sheets.colour, TINT), "edgecolors": sheets.colour, "linewidths": BACK}
    drawn = Poly3DCollection(sheets.corners, **look)
    axes.add_collection3d(drawn)
    return _proxy(sheets.name, sheets.colour)


def _solid(axes: Axes3D, one: Solid) -> dict[str, Artist]:
    """Draw a solid with its lines and words; return what a legend says of it."""
    if len(one.triangles):
        drawn = Poly3DCollection(
            one.triangles, facecolors=to_rgba(one.colour, one.opacity), shade=True, linewidths=0.0,
            rasterized=len(one.triangles) > LIGHTEST,
        )  # fmt: skip
        axes.add_collection3d(drawn)
    for line in one.lines:
        axes.plot(*line.T, color=one.colour, linewidth=BACK)
    if one.label:
        axes.text(*one.at, drawable(one.label), fontsize="small")
    return _proxy(one.legend or one.name, one.colour)


def _proxy(name: str, colour: str) -> dict[str, Artist]:
    return {drawable(name): Patch(facecolor=colour, linewidth=0.0)}


def _arrows(axes: Axes3D, figure: SpaceFigure) -> Scale | None:
    """Draw arrows as lines from a dot, in the colours of their sizes, and return the scale of these."""
    if (arrows := figure.arrows) is None or not len(arrows.values):
        return None
    unit, factor = text.SHOWN.get(arrows.unit, (arrows.unit, 1.0))
    ends, values = np.stack((arrows.start, arrows.end), axis=1), factor * arrows.values
    scale = Scale.of(values, arrows.limit and factor * arrows.limit, in_unit(arrows.name, unit))
    _coloured(axes, ends, scale(values), FRONT)
    axes.scatter(*arrows.start.T, color=scale(values), s=6.0, depthshade=False)
    return scale


def _spots(axes: Axes3D, figure: SpaceFigure) -> dict[str, Artist]:
    """Draw what decides as diamonds, and the ends, the first of them round; return what a legend says."""
    ends = iter("o")
    found: dict[str, Artist] = {}
    for spot in figure.spots:
        shape = "D" if spot.always else next(ends, "s")
        (found[drawable(spot.words)],) = axes.plot(
            *np.array([spot.position]).T, shape, color=spot.colour, markeredgecolor="white", zorder=9
        )
    return found


def _places(figure: SpaceFigure) -> FloatArray:
    """Return all places that the axes hold, shape (n, 3)."""
    every = [np.asarray(path.position[:]) for path in figure.paths]
    every += [one.points for one in figure.solids if not one.hidden]
    if figure.arrows is not None:
        every += [figure.arrows.start, figure.arrows.end]
    if figure.sheets is not None:
        every.append(figure.sheets.corners.reshape(-1, 3))
    joined: FloatArray = np.concatenate([np.empty((0, 3)), *every])
    known: FloatArray = joined[np.isfinite(joined).all(axis=1)]
    return known


def _equal(axes: Axes3D, places: FloatArray) -> None:
    """Give all axes one scale; around slim paths they are equally long."""
    low, high = (places.min(axis=0), places.max(axis=0)) if len(places) else (np.zeros(3), np.ones(3))
    half = np.maximum((high - low) / 2.0 * (1.0 + AROUND), CLOSEST)
    if half.max() > SLIM * np.prod(half) ** (1.0 / 3.0):
        half[:] = half.max()
    for name, middle, around in zip("xyz", (low + high) / 2.0, half, strict=True):
        getattr(axes, f"set_{name}lim")(middle - around, middle + around)
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4))
    axes.set_box_aspect(tuple(half))
