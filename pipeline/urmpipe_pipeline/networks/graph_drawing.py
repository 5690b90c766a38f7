"""The graph of a network as SVG: bodies as boxes, joints and elements between them, loops shaded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import escape_html
from urmpipe_models.networks.parts import ConstraintElement, Control
from urmpipe_pipeline.networks.drives import Tie, caption, controlled, is_driven, ties
from urmpipe_pipeline.networks.graph_layout import TEXT_PX, Edge, GraphLayout, graph_layout
from urmpipe_pipeline.networks.parts_in_space import BODY_COLOURS, CONTROL_COLOUR, body_colour
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.presentation.palette import INK_COLOUR
from urmpipe_pipeline.presentation.projections import Box, text_width

MARGIN_PX, HEAD_PX, ROW_PX = 30.0, 40.0, 19.0
"""Around the graph, above it for the title, and for a line of the key, in pixels."""

LOOPS, CONTROLS = 10, 10
"""Loops, and controls, that have a line of the key each; the others are counted."""

WITHIN = 0.93
"""A loop is shaded up to this share of the way from its middle to its lines."""

OUTSIDE_PX = 11.0
"""How far the outline of a cluster is from its bodies, in pixels."""

LETTERS = f'font-family="sans-serif" font-size="{TEXT_PX:g}"'

HALO = 'stroke="white" stroke-width="4" paint-order="stroke" stroke-linejoin="round"'
"""Keeps words readable over a line."""

QUIET = "#5b6770"
"""Of the key and of what nothing drives."""


def graph_svg(result: NetworkResult) -> str:
    """Return the graph of a network: what is tied by what, which loops there are, and what drives them."""
    network = result.network
    owners = ties(network)
    edges = [Edge(name, caption(one), one.bodies) for name, one in owners.items()]
    layout = graph_layout(network.body_names, edges)
    bounds, key = layout.bounds.grown(MARGIN_PX), list(_key(result))
    title = f"Graph of {network.name}: {result.structure}"
    room = max([text_width(words, TEXT_PX) for words, _ in key], default=0.0) + 2.0 * MARGIN_PX
    wide = max(bounds.right - bounds.left, room, text_width(title, 17.0) + 2.0 * MARGIN_PX)
    high = HEAD_PX + bounds.bottom - bounds.top
    full = high + ROW_PX * len(key) + (14.0 if key else 0.0)
    shift = f"translate({(wide - bounds.left - bounds.right) / 2.0:.1f} {HEAD_PX - bounds.top:.1f})"
    size = f'width="{wide:.0f}" height="{full:.0f}" viewBox="0 0 {wide:.0f} {full:.0f}"'
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} {LETTERS}>',
            _title(title),
            '<rect width="100%" height="100%" fill="white"/>',
            f'<text x="{MARGIN_PX:.0f}" y="26" font-size="17">{escape_html(title)}</text>',
            f'<g transform="{shift}">',
            *_clusters(result, layout),
            *_loops(result, layout),
            *(part for line in layout.lines for part in _line(line.curve, owners[line.edge.name])),
            *(_body(result, name, box) for name, box in layout.nodes.items()),
            *(_words(line.edge.words, line.words, owners[line.edge.name]) for line in layout.lines),
            "</g>",
            *(_key_line(words, colour, high + 10.0 + ROW_PX * k) for k, (words, colour) in enumerate(key)),
            "</svg>\n",
        )
    )


def _loops(result: NetworkResult, layout: GraphLayout) -> Iterator[str]:
    """Yield the area of each loop, the largest first, in its own colour."""
    ways = [(layout.loop(loop), loop_colour(k), loop) for k, loop in enumerate(result.loops)]
    for way, colour, loop in sorted(ways, key=lambda one: -_area(one[0])):
        middle = way.mean(axis=0)
        place = _points(middle + WITHIN * (way - middle))
        look = f'fill="{colour}" fill-opacity="0.14" stroke="{colour}" stroke-opacity="0.35"'
        yield f'<polygon class="loop" points="{place}" {look}>{_title(", ".join(loop))}</polygon>'


def loop_colour(k: int) -> str:
    """Return the colour of a loop as #rrggbb, counted from 0."""
    return BODY_COLOURS[k % len(BODY_COLOURS)]


def _area(way: FloatArray) -> float:
    """Return the area within a way in pixels, shape (k, 2)."""
    x, y = way.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2.0


def _clusters(result: NetworkResult, layout: GraphLayout) -> Iterator[str]:
    """Yield an outline around the bodies of each part that joints hold together, if there are several."""
    from scipy.spatial import ConvexHull

    if len(result.clusters) < 2:
        return
    for cluster in result.clusters:
        corners = np.array(
            [
                corner
                for name in cluster
                for box in (layout.nodes[name].grown(OUTSIDE_PX),)
                for corner in ((box.left, box.top), (box.left, box.bottom), (box.right, box.top), box[2:])
            ]
        )
        way = _points(corners[ConvexHull(corners).vertices])
        look = (
            'fill="#eef2f5" stroke="#8f9ba0" stroke-dasharray="1 4" stroke-linecap="round" stroke-width="1.6"'
        )
        yield f'<polygon class="cluster" points="{way}" {look}>{_title(", ".join(cluster))}</polygon>'


def _line(curve: FloatArray, one: Tie) -> Iterator[str]:
    """Yield the line of a joint, or dashed of an element, with its bodies as its title."""
    colour = CONTROL_COLOUR if is_driven(one) else "#4d5963"
    dashed = ' stroke-dasharray="7 4"' if isinstance(one, ConstraintElement) else ""
    title = f"{one.name}: {one.kind}, {one.bodies[0]} - {one.bodies[1]}"
    yield (
        f'<polyline points="{_points(curve)}" fill="none" stroke="{colour}" stroke-width="2.2"{dashed}>'
        f"{_title(title)}</polyline>"
    )


def _body(result: NetworkResult, name: str, box: Box) -> str:
    """Return a body as a box with its name; the ground stands on a hatch."""
    colour = body_colour(result.network, name)
    x, y = box.middle
    place = _edges(box)
    at = f'x="{x:.1f}" y="{y + 4.5:.1f}" text-anchor="middle"'
    words = f'<text class="body" {at} fill="{INK_COLOUR}">{escape_html(name)}</text>'
    if name != result.network.ground:
        edge = f'rx="9" fill="white" stroke="{colour}" stroke-width="2.6"'
        return f"<rect {place} {edge}/>{words}"
    ticks = np.arange(box.left + 8.0, box.right + 0.1, 8.0)
    hatch = "".join(f"M{at:.1f} {box.bottom:.1f}l-8 8" for at in ticks.tolist())
    base = f"M{box.left:.1f} {box.bottom:.1f}H{box.right:.1f}"
    return (
        f'<rect {place} fill="#e9edf0" stroke="#5b6770" stroke-width="1.4"/>'
        f'<path class="hatch" d="{base}{hatch}" fill="none" stroke="#5b6770" stroke-width="1.6"/>{words}'
    )


def _words(words: str, box: Box, one: Tie) -> str:
    """Return the words at a line: its name in bold, what it is, and what drives it."""
    x, y = box.middle
    colour = CONTROL_COLOUR if is_driven(one) else INK_COLOUR
    name, rest = escape_html(one.name), escape_html(words[len(one.name) :])
    place = f'class="tie" x="{x:.1f}" y="{y + 4.5:.1f}" text-anchor="middle" fill="{colour}"'
    behind = f'<rect {_edges(box)} rx="5" fill="white" fill-opacity="0.75"/>'
    return f'{behind}<text {place} {HALO}><tspan font-weight="bold">{name}</tspan>{rest}</text>'


def _key(result: NetworkResult) -> Iterator[tuple[str, str]]:
    """Yield the lines of the key with their colours: controls, loops, kinds, clusters."""
    network = result.network
    yield from ((control_words(result, one), CONTROL_COLOUR) for one in network.controls[:CONTROLS])
    if (more := len(network.controls) - CONTROLS) > 0:
        yield f"and controls {', '.join(one.name for one in network.controls[-more:])}", CONTROL_COLOUR
    for k, loop in enumerate(result.loops[:LOOPS]):
        yield f"loop {k + 1}: {', '.join(loop)}", loop_colour(k)
    if (more := len(result.loops) - LOOPS) > 0:
        yield f"and {more} more loops", ""
    if len(result.clusters) > 1:
        yield "dotted: bodies that joints hold together", ""
    kinds = {one.kind: f"{caption(one).split()[len(one.name.split())]} {one.kind}" for one in network.joints}
    dashes = [f"dashed: elements ({', '.join(sorted({one.kind for one in network.elements}))})"]
    words = [*kinds.values(), *(dashes if network.elements else [])]
    if words:
        yield "; ".join(words), ""


def control_words(result: NetworkResult, control: Control) -> str:
    """Return a control with its value or its function, and what it drives."""
    shown = result.assemblies[0] if result.assemblies else result.nearest
    value = shown.values.get(control.name, (control.start,))[0] if shown else control.start
    words = f"= {value:.6g}" if control.value is None else f"= {control.value.text}"
    driven = ", ".join(controlled(result.network, control))
    return f"control {control.name} {words}" + (f" drives {driven}" if driven else "")


def _key_line(words: str, colour: str, y: float) -> str:
    """Return a line of the key, with a swatch if it has a colour."""
    swatch = f'<rect x="{MARGIN_PX:.0f}" y="{y - 10:.1f}" width="12" height="12" rx="2" fill="{colour}"/>'
    place = f'x="{MARGIN_PX + (20.0 if colour else 0.0):.0f}" y="{y:.1f}" fill="{QUIET}"'
    return f"{swatch if colour else ''}<text {place}>{escape_html(words)}</text>"


def _title(words: str) -> str:
    """Return what is shown where the pointer rests."""
    return f"<title>{escape_html(words)}</title>"


def _edges(box: Box) -> str:
    return " ".join(
        f'{name}="{value:.1f}"'
        for name, value in (
            ("x", box.left),
            ("y", box.top),
            ("width", box.right - box.left),
            ("height", box.bottom - box.top),
        )
    )


def _points(way: FloatArray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in way.tolist())
