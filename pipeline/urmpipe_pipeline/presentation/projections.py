"""Words in a drawing: how much room they take, and where they stand beside others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import centres_of_mass_over_log
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import escape_html
from urmpipe_pipeline.presentation.palette import INK_COLOUR, MASS_COLOUR, REFERENCE_COLOUR
from urmpipe_pipeline.presentation.parts import spot_at
from urmpipe_pipeline.presentation.scene import PlaneView, Spot, ball_sizes

WIDE, HIGH = 0.58, 1.2
"""Width of a letter and height of a line, about, for a size of letters of 1."""


class Box(NamedTuple):
    """A rectangle in pixels: its left, top, right and bottom, y down."""

    left: float
    top: float
    right: float
    bottom: float

    def shared(self, other: Box) -> float:
        """Return the area that it shares with another, in square pixels."""
        wide = min(self.right, other.right) - max(self.left, other.left)
        high = min(self.bottom, other.bottom) - max(self.top, other.top)
        return wide * high if wide > 0.0 and high > 0.0 else 0.0

    def grown(self, by: float) -> Box:
        """Return it with so many more pixels at each side."""
        return Box(self.left - by, self.top - by, self.right + by, self.bottom + by)

    def shifted(self, right: float) -> Box:
        """Return it so many pixels further to the right."""
        return Box(self.left + right, self.top, self.right + right, self.bottom)

    @property
    def middle(self) -> tuple[float, float]:
        """Its middle in pixels."""
        return (self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0


def width_of(words: str, size: float) -> float:
    """Return how wide words are in pixels, about, in letters of a size in pixels."""
    return WIDE * size * len(words)


def box_about(x: float, y: float, words: str, size: float) -> Box:
    """Return the room for words about a place in pixels, in letters of a size in pixels."""
    wide, high = width_of(words, size) / 2.0, HIGH * size / 2.0
    return Box(x - wide, y - high, x + wide, y + high)


def freest(candidates: Sequence[Box], taken: Iterable[Box]) -> Box:
    """Return the first of the boxes that share least with what is taken."""
    others = list(taken)
    return min(candidates, key=lambda one: round(sum(one.shared(other) for other in others), 3))


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A convex solid by its outline, or a line.

    Attributes:
        points: Corners of the solid, or vertices of the line, in [m], shape (n, 3).
        colour: Of the outline or the line, as #rrggbb.
        width: Of the outline or the line in pixels.
        fill: Of the solid, as #rrggbb; empty for a line.
        opacity: Of the fill, 0..1.
        dashed: Whether the line is.
        front: Whether it is drawn before what is not, however near that is.
        faint: Whether it is a further position: it is drawn behind all else, and its line is as transparent
            as its fill.
    """

    points: FloatArray
    colour: str
    width: float = 1.5
    fill: str = ""
    opacity: float = 1.0
    dashed: bool = False
    front: bool = False
    faint: bool = False


def drawn_pieces(
    pieces: Sequence[Piece], placed: Callable[[FloatArray], FloatArray], towards: FloatArray
) -> Iterator[str]:
    """Yield solids and lines, those behind first.

    Args:
        pieces: What is drawn.
        placed: Returns points in [m], shape (n, 3), in pixels, shape (n, 2).
        towards: The way to who looks at them [-], shape (3,).
    """

    def order(one: Piece) -> tuple[int, float]:
        return one.front - one.faint, round(float((one.points @ towards).mean()), 9)

    for one in sorted(pieces, key=order):
        dashed = ' stroke-dasharray="6 4"' if one.dashed else ""
        line = f'stroke="{one.colour}" stroke-width="{one.width:g}" stroke-linejoin="round"{dashed}'
        line += f' stroke-opacity="{one.opacity:g}"' if one.faint else ""
        if one.fill:
            way = " ".join(f"{x:.1f},{y:.1f}" for x, y in outline(placed(one.points)))
            yield f'<polygon points="{way}" fill="{one.fill}" fill-opacity="{one.opacity:g}" {line}/>'
        else:
            yield polyline(placed(one.points), line)


def outline(points: FloatArray) -> list[tuple[float, float]]:
    """Return the corners of the convex hull of points in pixels, shape (n, 2), around it.

    Source: Andrew, 1979, the monotone chain.
    """
    every = sorted({(x, y) for x, y in np.round(points, 1).tolist()})
    halves: list[list[tuple[float, float]]] = []
    for some in (every, every[::-1]):
        half: list[tuple[float, float]] = []
        for x, y in some:
            while len(half) > 1 and _left_turn(half[-2], half[-1], (x, y)) <= 0.0:
                half.pop()
            half.append((x, y))
        halves.append(half[:-1])
    return [*halves[0], *halves[1]] or every


def _left_turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return twice the area of a triangle in square pixels, negative if it is clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def polyline(points: FloatArray, style: str) -> str:
    """Return a line through points in pixels, shape (n, 2)."""
    way = " ".join(f"{x:.1f},{y:.1f}" for x, y in points[np.isfinite(points).all(axis=1)])
    return f'<polyline points="{way}" fill="none" {style}/>'


SIZE, LARGE = 420, 620
"""Longest side of a drawing in pixels: of each of several views, and of a single view."""

MARGIN = 50
"""Free around what is drawn in each view, in pixels: a name stands beside its point."""

SCALE_PX, TITLE_PX, HEAD_PX = 44, 30, 40
"""Room for the numbers of an axis, for the title of a view, and for that of the picture, in pixels."""

APART_PX = 50
"""Pixels between two numbers of an axis, at least."""

NEAR_PX = 10
"""Spots nearer than this in a view have one name, in pixels."""

NAME_PX, BESIDE_PX, EDGE_PX = 12.0, 12.0, 4.0
"""Size of the letters of names, and how far they are from their places and from the left edge, in pixels."""

AROUND = (
    (1, -1),
    (-1, -1),
    (1, 1),
    (-1, 1),
    (1, 0),
    (-1, 0),
    (0, -1.3),
    (0, 1.3),
    (1, -2),
    (-1, 2),
    (1, 2),
    (-1, -2),
)
"""Where words stand beside a place: in shares of their width to the right, in lines below it."""

FAR_PX = 1e5
"""Beyond any picture, in pixels."""

MASS_PX = 16
"""Radius of the dot of the largest mass, in pixels; the others are as large as balls of one density."""

LEGEND_PX, LEGEND_WIDE = 28, 520
"""Height and least width of a picture for the line below it that says what these dots are, in pixels."""

HALO = 'stroke="white" stroke-width="4" paint-order="stroke"'
"""Keeps a label readable over a line."""


@dataclass(frozen=True, slots=True)
class View:
    """A look along one axis.

    Attributes:
        title: What it is called.
        right: Number of the coordinate that goes to the right.
        up: Number of the one that goes up.
        column: Its place among the views from the left.
        row: And from the top: views above each other share `right`, those beside each other `up`.
        names: What the axes to the right and up are called.
    """

    title: str
    right: int
    up: int
    column: int
    row: int
    names: tuple[str, str] = ("", "")

    @property
    def axis_names(self) -> tuple[str, str]:
        """Names of the axes to the right and up: x, y or z where no others are set."""
        return self.names[0] or "xyz"[self.right], self.names[1] or "xyz"[self.up]


SIDEWAYS = View("from the side", 0, 2, 0, 0)
FRONT = View("from the front", 1, 2, 1, 0)
ABOVE = View("from above", 0, 1, 0, 1)


@dataclass(frozen=True, slots=True)
class Mass:
    """A mass of an arm: where its centre is in [m], and how much it is in [kg]."""

    position: tuple[float, float, float]
    mass: float


@dataclass(frozen=True, slots=True, eq=False)
class Sketch:
    """What is drawn, from the back to the front.

    Attributes:
        arms: The base and the points p1..pn of each arm in [m], shape (n + 1, 3).
        path: Where a point goes in [m], shape (m, 3).
        spots: Places with a word.
        masses: Masses of the arms.
        asked: Where the point was to go in [m], shape (k, 3); grey, behind the path.
        pieces: Solids and lines, in any order: what is nearer hides what is behind.
        names: Words beside places, which have no mark of their own.
        name_gap: Distance of these words from their places in pixels.
    """

    arms: Sequence[FloatArray] = ()
    path: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    spots: Sequence[Spot] = ()
    masses: Sequence[Mass] = ()
    asked: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    pieces: Sequence[Piece] = ()
    names: Sequence[Spot] = ()
    name_gap: float = BESIDE_PX

    @property
    def extent(self) -> tuple[FloatArray, FloatArray]:
        """Its least and its largest coordinates in [m], shape (3,) each."""
        places = [*(one.position for one in self.spots), *(one.position for one in self.masses)]
        solids = [one.points for one in self.pieces]
        every = np.concatenate([*self.arms, *solids, self.path, self.asked, np.array(places).reshape(-1, 3)])
        every = every[np.isfinite(every).all(axis=1)]
        return every.min(axis=0), every.max(axis=0)


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """Where a view stands in the picture, in pixels: its left, top, width and height, and pixels per [m]."""

    view: View
    corner: FloatArray
    size: FloatArray
    low: FloatArray
    scale: float

    @property
    def axes(self) -> list[int]:
        """The coordinates of the scene that run right and up: 0, 1, 2 for x, y, z."""
        return [self.view.right, self.view.up]

    @property
    def towards(self) -> FloatArray:
        """The way to who looks at the view [-], shape (3,)."""
        return np.cross(*np.eye(3)[self.axes])

    @property
    def outside(self) -> list[Box]:
        """What is beyond its four sides."""
        (left, top), (right, bottom) = self.corner.tolist(), (self.corner + self.size).tolist()
        return [
            Box(-FAR_PX, -FAR_PX, left, FAR_PX),
            Box(right, -FAR_PX, FAR_PX, FAR_PX),
            Box(-FAR_PX, -FAR_PX, FAR_PX, top),
            Box(-FAR_PX, bottom, FAR_PX, FAR_PX),
        ]

    def placed(self, points: FloatArray) -> FloatArray:
        """Return points in [m], shape (n, 3), in pixels, shape (n, 2)."""
        flat = MARGIN + self.scale * (points - self.low)[:, self.axes]
        return np.asarray(self.corner + [0.0, self.size[1]] + flat * [1.0, -1.0])

    def ticks(self, axis: int) -> FloatArray:
        """Return the values of one of its axes in [m] that have a number, shape (n,)."""
        step = _round_step(APART_PX / self.scale)
        first = self.low[self.axes[axis]] - MARGIN / self.scale
        last = first + self.size[axis] / self.scale
        return step * np.arange(math.ceil(first / step), math.floor(last / step) + 1)


def projected_along(sketch: Sketch, plane: PlaneView, title: str) -> str:
    """Return a sketch as one large view along the normal of a plane, in the coordinates of that plane.

    Args:
        sketch: What is drawn.
        plane: From where it is seen.
        title: What the picture shows.
    """
    axes, (right, up, normal) = plane.axes, plane.axis_names
    view = View(f"along {normal}", 0, 1, 0, 0, (right, up))

    def turned(spots: Sequence[Spot]) -> list[Spot]:
        return [replace(one, position=spot_at(np.array(one.position) @ axes)) for one in spots]

    flat = Sketch(
        spots=turned(sketch.spots),
        pieces=[replace(one, points=one.points @ axes) for one in sketch.pieces],
        names=turned(sketch.names),
        name_gap=BESIDE_PX * LARGE / SIZE,
    )
    return projected(flat, (view,), title, size=LARGE)


def projected(sketch: Sketch, views: Sequence[View], title: str, mark: str = "", size: float = SIZE) -> str:
    """Return views of a sketch, each with its axes.

    Args:
        sketch: What is drawn.
        views: From where it is seen.
        title: What the picture shows.
        mark: A comment at its start, by which a file of ours is known.
        size: Longest extent of what is drawn, in pixels.
    """
    frames = _frames(sketch, views, size)
    width, bottom = np.max([one.corner + one.size for one in frames], axis=0) + np.array([20.0, SCALE_PX])
    width, height = (max(width, LEGEND_WIDE), bottom + LEGEND_PX) if sketch.masses else (width, bottom)
    box = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}"'
    return "\n".join(
        (
            *([f"<!-- {mark} -->"] if mark else []),
            f'<svg xmlns="http://www.w3.org/2000/svg" {box} font-family="sans-serif" font-size="13">',
            f"<title>{escape_html(title)}</title>",
            '<rect width="100%" height="100%" fill="white"/>',
            f'<text x="{SCALE_PX}" y="24" font-size="17">{escape_html(title)}</text>',
            *(line for one in frames for line in (*_scales(one), *_drawn(sketch, one))),
            *_legend(sketch, bottom),
            "</svg>\n",
        )
    )


def _frames(sketch: Sketch, views: Sequence[View], size: float) -> list[_Frame]:
    """Return where the views stand: columns as wide and rows as high as what is seen in them."""
    low, high = sketch.extent
    shown = sorted({axis for view in views for axis in (view.right, view.up)})
    scale = size / float((high - low)[shown].max() or 1.0)
    sizes = 2 * MARGIN + scale * (high - low)
    across = {view.column: sizes[view.right] + SCALE_PX for view in views}
    down = {view.row: sizes[view.up] + SCALE_PX + TITLE_PX for view in views}
    return [
        _Frame(
            view,
            np.array(
                [
                    SCALE_PX + sum(across[k] for k in across if k < view.column),
                    HEAD_PX + TITLE_PX + sum(down[k] for k in down if k < view.row),
                ]
            ),
            sizes[[view.right, view.up]],
            low,
            scale,
        )
        for view in views
    ]


def _scales(frame: _Frame) -> Iterator[str]:
    """Yield the title of a view, its frame, and lines at round values of its axes, with numbers."""
    (left, top), (width, height) = frame.corner, frame.size
    bottom, right = top + height, left + width
    names = frame.view.axis_names
    yield f'<text x="{left:.1f}" y="{top - 8:.1f}" fill="#555">{escape_html(frame.view.title)}</text>'
    box = f'x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"'
    yield f'<rect {box} fill="none" stroke="#c3cad0"/>'
    grid, number = 'stroke="#e4e8eb"', 'fill="#5b6770" font-size="11"'
    for value in frame.ticks(0).tolist():
        x = frame.placed(_at(frame, 0, value))[0, 0]
        yield f'<line x1="{x:.1f}" y1="{top:.1f}" x2="{x:.1f}" y2="{bottom:.1f}" {grid}/>'
        yield f'<text x="{x:.1f}" y="{bottom + 15:.1f}" text-anchor="middle" {number}>{_number(value)}</text>'
    for value in frame.ticks(1).tolist():
        y = frame.placed(_at(frame, 1, value))[0, 1]
        yield f'<line x1="{left:.1f}" y1="{y:.1f}" x2="{right:.1f}" y2="{y:.1f}" {grid}/>'
        yield f'<text x="{left - 5:.1f}" y="{y + 4:.1f}" text-anchor="end" {number}>{_number(value)}</text>'
    middle = left + width / 2.0
    yield f'<text x="{middle:.1f}" y="{bottom + 30:.1f}" text-anchor="middle" {number}>{names[0]} [m]</text>'
    yield f'<text x="{left - 5:.1f}" y="{top - 8:.1f}" text-anchor="end" {number}>{names[1]} [m]</text>'


def _drawn(sketch: Sketch, frame: _Frame) -> Iterator[str]:
    """Yield arms, path and spots in a view; several arms are lighter than one."""
    yield from drawn_pieces(sketch.pieces, frame.placed, frame.towards)
    alone = len(sketch.arms) == 1
    width, opacity = (8, 1.0) if alone else (4, 0.4)
    for arm in sketch.arms:
        style = f'stroke="#4a7ba6" stroke-width="{width}" stroke-linejoin="round" opacity="{opacity:g}"'
        yield polyline(frame.placed(arm), style)
    if len(sketch.asked):
        yield polyline(frame.placed(sketch.asked), f'stroke="{REFERENCE_COLOUR}" stroke-width="3"')
    if len(sketch.path):
        yield polyline(frame.placed(sketch.path), 'stroke="#d55e00" stroke-width="2"')
    centres = frame.placed(np.array([one.position for one in sketch.masses]).reshape(-1, 3))
    for place, size in zip(centres, ball_sizes([one.mass for one in sketch.masses]), strict=True):
        yield _mass(place, MASS_PX * size)
    placed = frame.placed(np.array([spot.position for spot in sketch.spots]).reshape(-1, 3))
    for spot, (x, y) in zip(sketch.spots, placed.tolist(), strict=True):
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{5 if alone else 3}" fill="{spot.colour}"/>'
    for (x, y), words in _names(placed, [spot.words for spot in sketch.spots]):
        if words:
            yield f'<text x="{x + 8:.1f}" y="{y - 6:.1f}" {HALO}>{escape_html(words)}</text>'
    yield from _beside(sketch.names, frame, sketch.name_gap)


def _beside(names: Sequence[Spot], frame: _Frame, gap: float) -> Iterator[str]:
    """Yield words beside their places, where others leave room; those of places that are near together."""
    placed = frame.placed(np.array([one.position for one in names]).reshape(-1, 3))
    colours = {one.words: one.colour for one in names}
    taken = frame.outside
    for (x, y), words in list(_names(placed, [one.words for one in names])):
        half = width_of(words, NAME_PX) / 2.0
        box = freest(
            [
                box_about(x + across * (half + gap), y + up * (gap + 5.0), words, NAME_PX)
                for across, up in AROUND
            ],
            taken,
        )
        box = box.shifted(max(EDGE_PX - box.left, 0.0))
        taken.append(box)
        at = f'x="{box.middle[0]:.1f}" y="{box.middle[1] + 4.5:.1f}" text-anchor="middle"'
        fill = colours.get(words, INK_COLOUR)
        style = f'class="name" {at} font-size="{NAME_PX:g}" fill="{fill}" {HALO}'
        yield f"<text {style}>{escape_html(words)}</text>"


def _mass(place: FloatArray, radius: float) -> str:
    """Return the dot of a mass at a place in pixels, shape (2,), with its radius in pixels."""
    style = f'fill="{MASS_COLOUR}" fill-opacity="0.85" stroke="{INK_COLOUR}"'
    return f'<circle cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="{radius:.1f}" {style}/>'


def _legend(sketch: Sketch, top: float) -> Iterator[str]:
    """Yield what the dots of masses are, below the views, whose end is given in pixels from the top."""
    if sketch.masses:
        masses = [one.mass for one in sketch.masses]
        words = f"mass centres, as large as balls of one density: {min(masses):.3g} to {max(masses):.3g} kg"
        yield _mass(np.array([SCALE_PX + 8.0, top + 8.0]), 8.0)
        yield f'<text x="{SCALE_PX + 24}" y="{top + 12:.1f}">{words}</text>'


def _names(placed: FloatArray, words: Sequence[str]) -> Iterator[tuple[tuple[float, float], str]]:
    """Yield where names stand, in pixels, and what they are: one of spots that are near to each other."""
    left = list(range(len(placed)))
    while left:
        first = left[0]
        near = [k for k in left if np.linalg.norm(placed[k] - placed[first]) < NEAR_PX]
        left = [k for k in left if k not in near]
        x, y = placed[first].tolist()
        yield (x, y), ", ".join(dict.fromkeys(words[k] for k in near))


def _at(frame: _Frame, axis: int, value: float) -> FloatArray:
    """Return a point of which one of the frame's coordinates has a value in [m], shape (1, 3)."""
    point = frame.low.copy()
    point[frame.axes[axis]] = value
    return np.asarray(point[np.newaxis])


def _round_step(least: float) -> float:
    """Return the least of 1, 2, 5, 10, ... that is no less than a step in [m]."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(digit * power for digit in (1.0, 2.0, 5.0, 10.0) if digit * power >= least * (1.0 - 1e-9))


def _number(value: float) -> str:
    return f"{value:.6g}" if abs(value) > 1e-9 else "0"


def chain_spots(skeleton: FloatArray) -> list[Spot]:
    """Return the names of the points of an arm: its skeleton in [m], shape (n + 1, 3)."""
    names = [("base", "#222"), *((f"p{k}", "#d55e00") for k in range(1, len(skeleton)))]
    return [Spot(spot_at(point), *name) for point, name in zip(skeleton, names, strict=True)]


def chain_masses(chain: Chain, q: FloatArray) -> list[Mass]:
    """Return the masses of an arm, if it has some, at joint values in [rad] or [m], shape (joints,)."""
    if not chain.inertials:
        return []
    centres = centres_of_mass_over_log(chain, q[np.newaxis])[0]
    masses = [float(one.mass) for one in chain.inertials]
    return [Mass(spot_at(place), mass) for place, mass in zip(centres, masses, strict=True) if mass > 0.0]
