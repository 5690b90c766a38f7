"""Drawings in pixels (SVG): arms, paths and solids along the axes of the world, and the room of their texts.

1. `Box`, `text_box`, `least_overlapping`: the room of a text, and the best of several places for it.
2. `Piece`, `draw_sorted`: convex solids by their outlines (`convex_hull`), and lines; a nearer one is drawn
   over a farther one.
3. `Sketch`, `draw_projections`: views of one scale, aligned as in a technical drawing, each with numbers at
   its axes; `draw_along_normal` is one large view along the normal of a plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import centres_of_mass_over_log
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import escape_html
from urmpipe_pipeline.presentation.palette import INK_COLOUR, MASS_COLOUR, REFERENCE_COLOUR
from urmpipe_pipeline.presentation.parts import spot_at
from urmpipe_pipeline.presentation.scene import PlaneView, Spot, ball_sizes

LETTER_WIDTH, LINE_HEIGHT = 0.58, 1.2  # about, for letters of size 1

SIZE, LARGE = 420, 620  # px, longest side of each of several views, and of a single view
MARGIN = 50  # px around the content of each view: a name is next to its point
SCALE_PX, TITLE_PX, HEAD_PX = (
    44,
    30,
    40,
)  # for the numbers of an axis, the title of a view, that of the picture
MIN_TICK_PX = 50  # between two numbers of an axis
NEAR_PX = 10  # spots in a view that are nearer share one name
NAME_PX, NAME_GAP_PX, EDGE_PX = (
    12.0,
    12.0,
    4.0,
)  # letters of names; their distance from places, from the left edge
FAR_PX = 1e5  # outside any picture
MASS_PX = 16  # radius of the dot of the largest mass; the others are as large as balls of one density
LEGEND_PX, LEGEND_WIDE = (
    28,
    520,
)  # height of the line that explains these dots; least width of a picture with it
HALO = 'stroke="white" stroke-width="4" paint-order="stroke"'  # keeps a text readable over a line

# Places of a text next to its point: in shares of its width to the right, in lines below it.
TEXT_PLACES = (
    (1, -1), (-1, -1), (1, 1), (-1, 1), (1, 0), (-1, 0),
    (0, -1.3), (0, 1.3), (1, -2), (-1, 2), (1, 2), (-1, -2),
)  # fmt: skip


class Box(NamedTuple):
    """A rectangle in pixels: its left, top, right and bottom, y down."""

    left: float
    top: float
    right: float
    bottom: float

    def shared(self, other: Box) -> float:
        """Return the area that two boxes share, in square pixels."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.bottom, other.bottom) - max(self.top, other.top)
        return width * height if width > 0.0 and height > 0.0 else 0.0

    def grown(self, margin: float) -> Box:
        """Return the box with a margin in pixels at each side."""
        return Box(self.left - margin, self.top - margin, self.right + margin, self.bottom + margin)

    def shifted(self, right: float) -> Box:
        """Return the box moved to the right by some pixels."""
        return Box(self.left + right, self.top, self.right + right, self.bottom)

    @property
    def middle(self) -> tuple[float, float]:
        """Middle in pixels."""
        return (self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0


def text_width(text: str, size: float) -> float:
    """Return the approximate width of a text in pixels, in letters of a size in pixels."""
    return LETTER_WIDTH * size * len(text)


def text_box(x: float, y: float, text: str, size: float) -> Box:
    """Return the box of a text around a point in pixels, in letters of a size in pixels."""
    half_width, half_height = text_width(text, size) / 2.0, LINE_HEIGHT * size / 2.0
    return Box(x - half_width, y - half_height, x + half_width, y + half_height)


def least_overlapping(candidates: Sequence[Box], obstacles: Iterable[Box]) -> Box:
    """Return the first of the boxes that share the least area with obstacles."""
    obstacles = list(obstacles)
    return min(candidates, key=lambda box: round(sum(box.shared(obstacle) for obstacle in obstacles), 3))


class Piece(NamedTuple):
    """A convex solid by its outline, or a line.

    Attributes:
        points: Corners of the solid, or vertices of the line, in [m], shape (n, 3).
        colour: Colour of the outline or the line, #rrggbb.
        width: Width of the outline or the line in pixels.
        fill: Colour of the solid, #rrggbb; empty for a line.
        opacity: Opacity of the fill, 0..1.
        dashed: Whether the line is dashed.
        front: Whether it is drawn over pieces that are not, at any distance.
        faint: Whether it shows a further position: it is drawn under everything else, and its line is as
            transparent as its fill.
    """

    points: FloatArray
    colour: str
    width: float = 1.5
    fill: str = ""
    opacity: float = 1.0
    dashed: bool = False
    front: bool = False
    faint: bool = False


def draw_sorted(
    pieces: Sequence[Piece], to_pixels: Callable[[FloatArray], FloatArray], towards: FloatArray
) -> Iterator[str]:
    """Yield solids and lines, the farthest first.

    Args:
        pieces: Solids and lines, in any order.
        to_pixels: Returns points in [m], shape (n, 3), in pixels, shape (n, 2).
        towards: Direction towards the viewer [-], shape (3,).
    """

    def order(piece: Piece) -> tuple[int, float]:
        return piece.front - piece.faint, round(float((piece.points @ towards).mean()), 9)

    for piece in sorted(pieces, key=order):
        dashed = ' stroke-dasharray="6 4"' if piece.dashed else ""
        line = f'stroke="{piece.colour}" stroke-width="{piece.width:g}" stroke-linejoin="round"{dashed}'
        line += f' stroke-opacity="{piece.opacity:g}"' if piece.faint else ""
        if piece.fill:
            corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in convex_hull(to_pixels(piece.points)))
            yield f'<polygon points="{corners}" fill="{piece.fill}" fill-opacity="{piece.opacity:g}" {line}/>'
        else:
            yield polyline(to_pixels(piece.points), line)


def convex_hull(points: FloatArray) -> list[tuple[float, float]]:
    """Return the corners of the convex hull of points in pixels, shape (n, 2), around it.

    Source: Andrew, 1979, the monotone chain.
    """
    ordered = sorted({(x, y) for x, y in np.round(points, 1).tolist()})
    chains: list[list[tuple[float, float]]] = []
    for sweep in (ordered, ordered[::-1]):
        chain: list[tuple[float, float]] = []
        for x, y in sweep:
            while len(chain) > 1:
                (x1, y1), (x2, y2) = chain[-2:]
                if (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1) > 0.0:  # a turn to the left
                    break
                chain.pop()
            chain.append((x, y))
        chains.append(chain[:-1])
    return [*chains[0], *chains[1]] or ordered


def polyline(points: FloatArray, style: str) -> str:
    """Return a line through points in pixels, shape (n, 2), without those that are not finite."""
    vertices = " ".join(f"{x:.1f},{y:.1f}" for x, y in points[np.isfinite(points).all(axis=1)])
    return f'<polyline points="{vertices}" fill="none" {style}/>'


class ProjectionView(NamedTuple):
    """A view along an axis.

    Attributes:
        title: Title of the view.
        right: Number of the coordinate to the right.
        up: Number of the coordinate upwards.
        column: Its column among the views, from the left; views in one column share `right`.
        row: Its row, from the top; views in one row share `up`.
        names: Names of the axes to the right and upwards; empty for x, y, z.
    """

    title: str
    right: int
    up: int
    column: int
    row: int
    names: tuple[str, str] = ("", "")

    @property
    def axis_names(self) -> tuple[str, str]:
        """Names of the axes to the right and upwards: x, y or z where no others are set."""
        return self.names[0] or "xyz"[self.right], self.names[1] or "xyz"[self.up]


SIDEWAYS = ProjectionView("from the side", 0, 2, 0, 0)
FRONT = ProjectionView("from the front", 1, 2, 1, 0)
ABOVE = ProjectionView("from above", 0, 1, 0, 1)


class Mass(NamedTuple):
    """A mass of an arm: its centre in [m], and its mass in [kg]."""

    position: tuple[float, float, float]
    mass: float


class Sketch(NamedTuple):
    """What is drawn, in the order of drawing, except `pieces`.

    Attributes:
        arms: Base and points p1..pn of each arm in [m], shape (n + 1, 3).
        path: Path of a point in [m], shape (m, 3).
        spots: Points with a text.
        masses: Masses of the arms.
        commanded: Commanded path of the point in [m], shape (k, 3); grey, under the path.
        pieces: Solids and lines, in any order; drawn first.
        names: Texts next to points that have no mark.
        name_gap: Distance of these texts from their points in pixels.
    """

    arms: Sequence[FloatArray] = ()
    path: FloatArray = np.empty((0, 3))
    spots: Sequence[Spot] = ()
    masses: Sequence[Mass] = ()
    commanded: FloatArray = np.empty((0, 3))
    pieces: Sequence[Piece] = ()
    names: Sequence[Spot] = ()
    name_gap: float = NAME_GAP_PX

    @property
    def extent(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest coordinates in [m], shape (3,) each."""
        places = [*(spot.position for spot in self.spots), *(mass.position for mass in self.masses)]
        solids = [piece.points for piece in self.pieces]
        points = np.concatenate(
            [*self.arms, *solids, self.path, self.commanded, np.array(places).reshape(-1, 3)]
        )
        points = points[np.isfinite(points).all(axis=1)]
        return points.min(axis=0), points.max(axis=0)


class _Frame(NamedTuple):
    """A view in the picture: its left top corner and its size in pixels, and the scale in pixels per [m]."""

    view: ProjectionView
    corner: FloatArray
    size: FloatArray
    low: FloatArray
    scale: float

    @property
    def axes(self) -> list[int]:
        """Coordinates of the scene to the right and upwards: 0, 1, 2 for x, y, z."""
        return [self.view.right, self.view.up]

    @property
    def towards(self) -> FloatArray:
        """Direction towards the viewer [-], shape (3,)."""
        return np.cross(*np.eye(3)[self.axes])

    @property
    def outside(self) -> list[Box]:
        """The areas outside its four sides."""
        (left, top), (right, bottom) = self.corner.tolist(), (self.corner + self.size).tolist()
        return [
            Box(-FAR_PX, -FAR_PX, left, FAR_PX),
            Box(right, -FAR_PX, FAR_PX, FAR_PX),
            Box(-FAR_PX, -FAR_PX, FAR_PX, top),
            Box(-FAR_PX, bottom, FAR_PX, FAR_PX),
        ]

    def to_pixels(self, points: FloatArray) -> FloatArray:
        """Return points in [m], shape (n, 3), in pixels, shape (n, 2)."""
        flat = MARGIN + self.scale * (points - self.low)[:, self.axes]
        return np.asarray(self.corner + [0.0, self.size[1]] + flat * [1.0, -1.0])

    def ticks(self, axis: int) -> Iterator[tuple[float, float]]:
        """Yield the values of an axis in [m] that have a number, and their coordinates in pixels."""
        least = MIN_TICK_PX / self.scale
        power = 10.0 ** math.floor(math.log10(least))
        step = next(digit * power for digit in (1, 2, 5, 10) if digit * power >= least * (1.0 - 1e-9))
        first = self.low[self.axes[axis]] - MARGIN / self.scale
        last = first + self.size[axis] / self.scale
        for value in (step * np.arange(math.ceil(first / step), math.floor(last / step) + 1)).tolist():
            point = self.low.copy()
            point[self.axes[axis]] = value
            yield value, self.to_pixels(point[np.newaxis])[0, axis]


def draw_along_normal(sketch: Sketch, plane: PlaneView, title: str) -> str:
    """Return a sketch as one large view along the normal of a plane, in the coordinates of that plane.

    Args:
        sketch: What is drawn: its spots, pieces and names.
        plane: View along the normal.
        title: Title of the picture.
    """
    axes, (right, up, normal) = plane.axes, plane.axis_names
    view = ProjectionView(f"along {normal}", 0, 1, 0, 0, (right, up))

    def rotated(spots: Sequence[Spot]) -> list[Spot]:
        return [replace(spot, position=spot_at(np.array(spot.position) @ axes)) for spot in spots]

    flat = Sketch(
        spots=rotated(sketch.spots),
        pieces=[piece._replace(points=piece.points @ axes) for piece in sketch.pieces],
        names=rotated(sketch.names),
        name_gap=NAME_GAP_PX * LARGE / SIZE,
    )
    return draw_projections(flat, (view,), title, size=LARGE)


def draw_projections(
    sketch: Sketch, views: Sequence[ProjectionView], title: str, mark: str = "", size: float = SIZE
) -> str:
    """Return views of a sketch, each with its axes.

    Args:
        sketch: What is drawn.
        views: The views.
        title: Title of the picture.
        mark: Comment at the start of the file, by which a file of ours is recognised.
        size: Longest extent of the content of a view, in pixels.
    """
    frames = _layout_frames(sketch, views, size)
    ends = [frame.corner + frame.size for frame in frames]
    width, bottom = np.max(ends, axis=0) + np.array([20.0, SCALE_PX])
    width, height = (max(width, LEGEND_WIDE), bottom + LEGEND_PX) if sketch.masses else (width, bottom)
    box = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}"'
    return "\n".join(
        (
            *([f"<!-- {mark} -->"] if mark else []),
            f'<svg xmlns="http://www.w3.org/2000/svg" {box} font-family="sans-serif" font-size="13">',
            f"<title>{escape_html(title)}</title>",
            '<rect width="100%" height="100%" fill="white"/>',
            f'<text x="{SCALE_PX}" y="24" font-size="17">{escape_html(title)}</text>',
            *(line for frame in frames for line in (*_draw_axes(frame), *_draw_content(sketch, frame))),
            *_draw_legend(sketch, bottom),
            "</svg>\n",
        )
    )


def _layout_frames(sketch: Sketch, views: Sequence[ProjectionView], size: float) -> list[_Frame]:
    """Return the frames of the views: columns as wide and rows as high as the content of their views."""
    low, high = sketch.extent
    shown = sorted({axis for view in views for axis in (view.right, view.up)})
    scale = size / float((high - low)[shown].max() or 1.0)
    sizes = 2 * MARGIN + scale * (high - low)
    widths = {view.column: sizes[view.right] + SCALE_PX for view in views}
    heights = {view.row: sizes[view.up] + SCALE_PX + TITLE_PX for view in views}
    frames = []
    for view in views:
        left = SCALE_PX + sum(widths[k] for k in widths if k < view.column)
        top = HEAD_PX + TITLE_PX + sum(heights[k] for k in heights if k < view.row)
        frames.append(_Frame(view, np.array([left, top]), sizes[[view.right, view.up]], low, scale))
    return frames


def _draw_axes(frame: _Frame) -> Iterator[str]:
    """Yield the title of a view, its frame, and lines at round values of its axes, with numbers."""
    (left, top), (width, height) = frame.corner, frame.size
    bottom, right = top + height, left + width
    names = frame.view.axis_names
    yield f'<text x="{left:.1f}" y="{top - 8:.1f}" fill="#555">{escape_html(frame.view.title)}</text>'
    box = f'x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"'
    yield f'<rect {box} fill="none" stroke="#c3cad0"/>'
    grid, number = 'stroke="#e4e8eb"', 'fill="#5b6770" font-size="11"'
    for value, x in frame.ticks(0):
        text = _format_tick(value)
        yield f'<line x1="{x:.1f}" y1="{top:.1f}" x2="{x:.1f}" y2="{bottom:.1f}" {grid}/>'
        yield f'<text x="{x:.1f}" y="{bottom + 15:.1f}" text-anchor="middle" {number}>{text}</text>'
    for value, y in frame.ticks(1):
        text = _format_tick(value)
        yield f'<line x1="{left:.1f}" y1="{y:.1f}" x2="{right:.1f}" y2="{y:.1f}" {grid}/>'
        yield f'<text x="{left - 5:.1f}" y="{y + 4:.1f}" text-anchor="end" {number}>{text}</text>'
    middle = left + width / 2.0
    yield f'<text x="{middle:.1f}" y="{bottom + 30:.1f}" text-anchor="middle" {number}>{names[0]} [m]</text>'
    yield f'<text x="{left - 5:.1f}" y="{top - 8:.1f}" text-anchor="end" {number}>{names[1]} [m]</text>'


def _format_tick(value: float) -> str:
    return f"{value:.6g}" if abs(value) > 1e-9 else "0"


def _draw_content(sketch: Sketch, frame: _Frame) -> Iterator[str]:
    """Yield pieces, arms, paths, masses and spots in a view; several arms are lighter than one."""
    yield from draw_sorted(sketch.pieces, frame.to_pixels, frame.towards)
    single = len(sketch.arms) == 1
    width, opacity = (8, 1.0) if single else (4, 0.4)
    for arm in sketch.arms:
        style = f'stroke="#4a7ba6" stroke-width="{width}" stroke-linejoin="round" opacity="{opacity:g}"'
        yield polyline(frame.to_pixels(arm), style)
    if len(sketch.commanded):
        yield polyline(frame.to_pixels(sketch.commanded), f'stroke="{REFERENCE_COLOUR}" stroke-width="3"')
    if len(sketch.path):
        yield polyline(frame.to_pixels(sketch.path), 'stroke="#d55e00" stroke-width="2"')
    centres = frame.to_pixels(np.array([mass.position for mass in sketch.masses]).reshape(-1, 3))
    for centre, size in zip(centres, ball_sizes([mass.mass for mass in sketch.masses]), strict=True):
        yield _mass_dot(centre, MASS_PX * size)
    places = frame.to_pixels(np.array([spot.position for spot in sketch.spots]).reshape(-1, 3))
    for spot, (x, y) in zip(sketch.spots, places.tolist(), strict=True):
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{5 if single else 3}" fill="{spot.colour}"/>'
    for (x, y), text in _merge_near(places, [spot.words for spot in sketch.spots]):
        if text:
            yield f'<text x="{x + 8:.1f}" y="{y - 6:.1f}" {HALO}>{escape_html(text)}</text>'
    yield from _draw_names(sketch.names, frame, sketch.name_gap)


def _draw_names(names: Sequence[Spot], frame: _Frame, gap: float) -> Iterator[str]:
    """Yield texts next to their points, where they overlap least with the frame and with each other."""
    places = frame.to_pixels(np.array([name.position for name in names]).reshape(-1, 3))
    colours = {name.words: name.colour for name in names}
    obstacles = frame.outside
    for (x, y), text in _merge_near(places, [name.words for name in names]):
        half = text_width(text, NAME_PX) / 2.0
        candidates = [
            text_box(x + across * (half + gap), y + lines * (gap + 5.0), text, NAME_PX)
            for across, lines in TEXT_PLACES
        ]
        box = least_overlapping(candidates, obstacles)
        box = box.shifted(max(EDGE_PX - box.left, 0.0))
        obstacles.append(box)
        at = f'x="{box.middle[0]:.1f}" y="{box.middle[1] + 4.5:.1f}" text-anchor="middle"'
        fill = colours.get(text, INK_COLOUR)
        style = f'class="name" {at} font-size="{NAME_PX:g}" fill="{fill}" {HALO}'
        yield f"<text {style}>{escape_html(text)}</text>"


def _mass_dot(centre: FloatArray, radius: float) -> str:
    style = f'fill="{MASS_COLOUR}" fill-opacity="0.85" stroke="{INK_COLOUR}"'
    return f'<circle cx="{centre[0]:.1f}" cy="{centre[1]:.1f}" r="{radius:.1f}" {style}/>'


def _draw_legend(sketch: Sketch, top: float) -> Iterator[str]:
    """Yield the line that explains the dots of masses, below the views."""
    if sketch.masses:
        masses = [mass.mass for mass in sketch.masses]
        text = f"mass centres, as large as balls of one density: {min(masses):.3g} to {max(masses):.3g} kg"
        yield _mass_dot(np.array([SCALE_PX + 8.0, top + 8.0]), 8.0)
        yield f'<text x="{SCALE_PX + 24}" y="{top + 12:.1f}">{text}</text>'


def _merge_near(places: FloatArray, texts: Sequence[str]) -> Iterator[tuple[tuple[float, float], str]]:
    """Yield points in pixels and their texts; points that are near to each other have one text."""
    rest = list(range(len(places)))
    while rest:
        first = rest[0]
        near = [k for k in rest if np.linalg.norm(places[k] - places[first]) < NEAR_PX]
        rest = [k for k in rest if k not in near]
        x, y = places[first].tolist()
        yield (x, y), ", ".join(dict.fromkeys(texts[k] for k in near))


def label_skeleton(skeleton: FloatArray) -> list[Spot]:
    """Return the points of an arm with their names, from its skeleton in [m], shape (n + 1, 3)."""
    names = [("base", "#222"), *((f"p{k}", "#d55e00") for k in range(1, len(skeleton)))]
    return [Spot(spot_at(point), *name) for point, name in zip(skeleton, names, strict=True)]


def chain_masses(chain: Chain, q: FloatArray) -> list[Mass]:
    """Return the masses of an arm, if it has some, at joint values in [rad] or [m], shape (joints,)."""
    if not chain.inertials:
        return []
    centres = centres_of_mass_over_log(chain, q[np.newaxis])[0]
    masses = [float(body.mass) for body in chain.inertials]
    return [Mass(spot_at(centre), mass) for centre, mass in zip(centres, masses, strict=True) if mass > 0.0]
