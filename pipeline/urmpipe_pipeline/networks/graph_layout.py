"""Where the graph of a network stands in a picture: bodies as boxes, joints and elements as lines.

Places come from the lengths of the ways between bodies (stress majorization, Gansner, Koren and North, 2004),
from several starts, of which the drawing with the fewest crossings stands. The same graph gives the same one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.presentation.projections import (
    LINE_HEIGHT,
    Box,
    least_overlapping,
    text_box,
    text_width,
)

TEXT_PX = 13.0
"""Size of letters in pixels."""

NODE_PX, PAD_PX, LEAST_PX, GAP_PX = 32.0, 12.0, 52.0, 26.0
"""Height of a body, room beside its name, its least width, and what bodies are apart at least, in pixels."""

SPACE_PX = 34.0
"""What a line between two bodies is longer than its words, in pixels."""

STARTS, STEPS, TURNS = 14, 150, 24
"""Starts of the layout, steps from each, and turns of the best that are tried."""

MANY, FEW = 40, 2
"""With more bodies, so few starts and turns are tried: nobody reads such a graph word by word."""

ALONG = (0.5, 0.42, 0.58, 0.34, 0.66, 0.27, 0.73)
"""Where on a line its words may stand, as shares of it."""

CURVE = 24
"""Pieces of a curve."""

BOWS = (0.0, 40.0, -40.0, 75.0, -75.0, 110.0, -110.0)
"""How far the middle of a line may stand off, in pixels, so that it does not go through a body."""


@dataclass(frozen=True, slots=True)
class Edge:
    """A joint or an element: its name, the words at it, and its bodies."""

    name: str
    words: str
    bodies: tuple[str, str]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """An edge in the picture: its curve from its first body [px], shape (k, 2), and the box of its words."""

    edge: Edge
    curve: FloatArray
    words: Box


@dataclass(frozen=True, slots=True, eq=False)
class GraphLayout:
    """A graph in a picture, all in pixels, y down.

    Attributes:
        nodes: The box of each body by its name.
        lines: The edges.
    """

    nodes: Mapping[str, Box]
    lines: tuple[Line, ...]

    def loop(self, names: Sequence[str]) -> FloatArray:
        """Return the way around a loop in pixels, shape (k, 2), given the names of its edges in order."""
        lines = {one.edge.name: one for one in self.lines}
        edges = [lines[name].edge for name in names if name in lines]
        here = next((one for one in edges[0].bodies if len(edges) < 3 or one not in edges[1].bodies), "")
        way = []
        for edge in edges:
            curve = lines[edge.name].curve
            way.append(curve if edge.bodies[0] == here else curve[::-1])
            here = edge.bodies[1] if edge.bodies[0] == here else edge.bodies[0]
        return np.concatenate(way)

    @property
    def bounds(self) -> Box:
        """The box around all of it."""
        boxes = np.array([*self.nodes.values(), *(one.words for one in self.lines)])
        curves = np.concatenate([np.empty((0, 2)), *(one.curve for one in self.lines)])
        low = np.min([boxes[:, :2].min(axis=0), *curves], axis=0)
        high = np.max([boxes[:, 2:].max(axis=0), *curves], axis=0)
        return Box(*low.tolist(), *high.tolist())


def graph_layout(names: Sequence[str], edges: Sequence[Edge]) -> GraphLayout:
    """Return a layout of bodies, the ground first, and what edges them."""
    sizes = np.array([[max(LEAST_PX, text_width(name, TEXT_PX) + 2.0 * PAD_PX), NODE_PX] for name in names])
    numbers = {name: k for k, name in enumerate(names)}
    ends = np.array([[numbers[name] for name in edge.bodies] for edge in edges], dtype=np.int64).reshape(
        -1, 2
    )
    wanted = _ways(sizes, ends, edges)
    tried = slice(FEW if len(names) > MANY else None)
    starts = np.array([*_starts(len(names), ends)][tried])
    best = min(_settled(starts, wanted), key=lambda one: round(_tangle(one, ends, wanted), 2))
    turned = (_apart(_facing(one), sizes) for one in [*_turned(best)][tried])
    layouts = (_laid_out(names, one, sizes, edges, ends) for one in turned)
    return min(layouts, key=lambda one: round(_cost(one), 1))


def _ways(sizes: FloatArray, ends: IntArray, edges: Sequence[Edge]) -> FloatArray:
    """Return how far bodies should be apart in pixels, shape (n, n): the shortest way between each two."""
    n = len(sizes)
    ways = np.full((n, n), np.inf)
    np.fill_diagonal(ways, 0.0)
    for (i, j), edge in zip(ends.tolist(), edges, strict=True):
        beside = int((np.sort(ends, axis=1) == sorted((i, j))).all(axis=1).sum()) - 1
        length = (
            (sizes[i, 0] + sizes[j, 0]) / 2.0 + text_width(edge.words, TEXT_PX) + SPACE_PX + 10.0 * beside
        )
        ways[i, j] = ways[j, i] = max(length, ways[i, j] if np.isfinite(ways[i, j]) else 0.0)
    for k in range(n):
        ways = np.minimum(ways, ways[:, k : k + 1] + ways[k : k + 1])
    longest = float(ways[np.isfinite(ways)].max(initial=0.0))
    return np.where(np.isfinite(ways), ways, longest + 150.0)


def _starts(n: int, ends: IntArray) -> Iterator[FloatArray]:
    """Yield places on a circle: as the bodies are given, as they hang together, and as chance puts them."""
    chance = np.random.default_rng(0)
    orders = [np.arange(n), np.array(_in_depth(n, ends)), *(chance.permutation(n) for _ in range(STARTS - 2))]
    angle = 2.0 * np.pi * np.arange(n) / n
    ring = 60.0 * n * np.column_stack((np.cos(angle), np.sin(angle)))
    for order in orders:
        places = np.empty((n, 2))
        places[order] = ring
        yield places


def _in_depth(n: int, ends: IntArray) -> list[int]:
    """Return the bodies in the order of a search in depth from the ground."""
    found: list[int] = []
    waiting = list(range(n))[::-1]
    while waiting:
        here = waiting.pop()
        if here not in found:
            found.append(here)
            near = [b if a == here else a for a, b in ends.tolist() if here in (a, b)]
            waiting += [one for one in near[::-1] if one not in found]
    return found


def _settled(places: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return places in pixels, shape (starts, n, 2), moved until their distances are nearly as wanted."""
    if len(wanted) < 2:
        return places
    weights = np.where(wanted > 0.0, 1.0 / np.where(wanted > 0.0, wanted, 1.0) ** 2, 0.0)
    inverse = np.linalg.pinv(np.diag(weights.sum(axis=1)) - weights)
    for _ in range(STEPS):
        apart = np.linalg.norm(places[:, :, np.newaxis] - places[:, np.newaxis], axis=3)
        pull = weights * wanted / np.maximum(apart, 1e-9)
        places = inverse @ (pull.sum(axis=2)[:, :, np.newaxis] * places - pull @ places)
    return places


def _tangle(places: FloatArray, ends: IntArray, wanted: FloatArray) -> float:
    """Return how tangled a drawing is: lines that cross, bodies on lines, distances not as wanted."""
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    ratio = apart / np.where(wanted > 0.0, wanted, 1.0)
    off = np.where(wanted > 0.0, (ratio - 1.0) ** 2, 0.0).sum() / max(len(places), 1)
    pairs = sorted({(min(a, b), max(a, b)) for a, b in ends.tolist()})
    crossings = sum(
        _cross(places[list(one)], places[list(other)])
        for one, other in combinations(pairs, 2)
        if not {*one} & {*other}
    )
    hidden = sum(
        _distance(places[k], places[list(pair)]) < NODE_PX
        for pair in pairs
        for k in range(len(places))
        if k not in pair
    )
    return crossings + hidden + 0.3 * float(off)


def _cross(one: FloatArray, other: FloatArray) -> bool:
    """Return whether two pieces of lines in pixels, shape (2, 2) each, cross."""

    def side(line: FloatArray, point: FloatArray) -> float:
        """Return a number whose sign tells on which side of a line a point is."""
        (x, y), (u, v) = line[1] - line[0], point - line[0]
        return float(x * v - y * u)

    return side(one, other[0]) * side(one, other[1]) < 0.0 and side(other, one[0]) * side(other, one[1]) < 0.0


def _distance(point: FloatArray, line: FloatArray) -> float:
    """Return how far a point is from a piece of a line, all in pixels."""
    along = line[1] - line[0]
    share = float(np.clip((point - line[0]) @ along / max(float(along @ along), 1e-9), 0.0, 1.0))
    return float(np.linalg.norm(point - line[0] - share * along))


def _turned(places: FloatArray) -> Iterator[FloatArray]:
    """Yield places in pixels, shape (n, 2), turned about their middle."""
    middle = places - places.mean(axis=0)
    for angle in np.pi * np.arange(TURNS) / TURNS:
        c, s = np.cos(angle), np.sin(angle)
        yield middle @ np.array([[c, s], [-s, c]])


def _facing(places: FloatArray) -> FloatArray:
    """Return places in pixels, shape (n, 2), flipped so that the ground is at the left below, y down."""
    flips = np.where(places[0] * [-1.0, 1.0] < -1e-6, -1.0, 1.0)
    return np.asarray(places * flips)


def _apart(places: FloatArray, sizes: FloatArray) -> FloatArray:
    """Return places in pixels, shape (n, 2), of bodies of some sizes, moved until none is on another."""
    found = np.array(places)
    for _ in range(100):
        moved = False
        for i, j in combinations(range(len(found)), 2):
            between = found[j] - found[i]
            room = (sizes[i] + sizes[j]) / 2.0 + GAP_PX - np.abs(between)
            if (room > 0.01).all():
                axis = int(np.argmin(room))
                step = room[axis] / 2.0 * (1.0 if between[axis] >= 0.0 else -1.0)
                found[i, axis] -= step
                found[j, axis] += step
                moved = True
        if not moved:
            break
    return found


def _laid_out(
    names: Sequence[str], places: FloatArray, sizes: FloatArray, edges: Sequence[Edge], ends: IntArray
) -> GraphLayout:
    """Return the layout of bodies at places in pixels, shape (n, 2)."""
    corners = np.hstack((places - sizes / 2.0, places + sizes / 2.0))
    nodes = {name: Box(*row) for name, row in zip(names, corners.tolist(), strict=True)}
    taken = list(nodes.values())
    lines = []
    curves = list(_curves(places, taken, edges, ends))
    for edge, curve in zip(edges, curves, strict=True):
        spots = curve[[round(share * CURVE) for share in ALONG]].tolist()
        words = least_overlapping([text_box(x, y, edge.words, TEXT_PX) for x, y in spots], taken)
        taken.append(words)
        lines.append(Line(edge, curve, words))
    return GraphLayout(nodes, tuple(lines))


def _curves(
    places: FloatArray, nodes: Sequence[Box], edges: Sequence[Edge], ends: IntArray
) -> Iterator[FloatArray]:
    """Yield the curve of each edge in pixels, shape (k, 2): straight if it can be."""
    pairs = [tuple(sorted(pair)) for pair in ends.tolist()]
    for k, (i, j) in enumerate(ends.tolist()):
        alike = [m for m, pair in enumerate(pairs) if pair == pairs[k]]
        low, high = places[min(i, j)], places[max(i, j)]
        u = (high - low) / max(float(np.linalg.norm(high - low)), 1e-9)
        normal = np.array([-u[1], u[0]])
        if len(alike) > 1:
            wide = max(text_width(edges[m].words, TEXT_PX) for m in alike)
            step = abs(normal[0]) * wide + abs(normal[1]) * LINE_HEIGHT * TEXT_PX + 8.0
            bow = step * (alike.index(k) - (len(alike) - 1) / 2.0)
        else:
            others = [box for m, box in enumerate(nodes) if m not in (i, j)]
            bow = _least_bow(low, high, normal, others)
        curve = _bowed(low, high, bow * normal)
        yield curve if i <= j else curve[::-1]


def _least_bow(low: FloatArray, high: FloatArray, normal: FloatArray, boxes: Sequence[Box]) -> float:
    """Return the least bow in pixels that goes through no box, else through the fewest."""
    hits: list[int] = []
    for bow in BOWS:
        hits.append(_hits(_bowed(low, high, bow * normal), boxes))
        if not hits[-1]:
            return bow
    return BOWS[int(np.argmin(hits))]


def _bowed(low: FloatArray, high: FloatArray, bow: FloatArray) -> FloatArray:
    """Return a curve between two places whose middle is off by a bow, all in pixels, shape (k, 2)."""
    t = np.linspace(0.0, 1.0, CURVE + 1)[:, np.newaxis]
    return (1.0 - t) * low + t * high + 4.0 * t * (1.0 - t) * bow


def _hits(curve: FloatArray, boxes: Sequence[Box]) -> int:
    """Return how many boxes a curve in pixels, shape (k, 2), goes through or close by."""
    x, y = curve.T
    left, top, right, bottom = np.array([one.grown(6.0) for one in boxes]).reshape(-1, 4, 1).swapaxes(0, 1)
    return int(((x > left) & (x < right) & (y > top) & (y < bottom)).any(axis=1).sum())


def _cost(one: GraphLayout) -> float:
    """Return how hard a layout is to read: words on bodies, on words, and on lines; then how large it is."""
    nodes, words = list(one.nodes.values()), [line.words for line in one.lines]
    on_nodes = sum(word.shared(node) for word in words for node in nodes)
    on_words = sum(a.shared(b) for a, b in combinations(words, 2))
    crossed = sum(
        _hits(line.curve, [other.words.grown(-7.0) for other in one.lines if other is not line])
        for line in one.lines
    )
    through = sum(
        _hits(line.curve, [box for name, box in one.nodes.items() if name not in line.edge.bodies])
        for line in one.lines
    )
    bounds = one.bounds
    size = (bounds.right - bounds.left) + 1.6 * (bounds.bottom - bounds.top)
    return 20.0 * on_nodes + 10.0 * on_words + 100.0 * crossed + 400.0 * through + size
