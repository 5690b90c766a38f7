"""What a drawing of a system shows: boxes with their ports, and lines between them.

Where the boxes of a diagram stand, and which way its wires go.

Boxes stand in layers from left to right, so that wires lead to the right but for those that feed back. A wire
has a level lane in each layer that it passes, one that feeds back in all layers from its source back to its
target, below both; between the layers wires are curves. Within a layer boxes and lanes are as near as can be
to what they are wired with.

Source: K. Sugiyama, S. Tagawa, M. Toda, Methods for visual understanding of hierarchical system structures,
IEEE Trans. SMC 11 (1981), 109-125.

A system drawn as SVG: blocks with their ports and units, and what is connected with what.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from itertools import pairwise
from pathlib import Path
from statistics import fmean
from textwrap import wrap
from typing import NamedTuple, TypeAlias

from urmpipe_fmus.cosim.checks import ELEMENT, Interface, StartValue
from urmpipe_fmus.cosim.plan import Plan
from urmpipe_fmus.cosim.system import Block

CHARACTER = 7.3
"""Width of a character of the drawing's fixed-width letters (12 px, 0.6 em) in [px]."""

ROW, HEAD, PAD = 18.0, 42.0, 10.0
"""Height of a port, height of a box's head, margin inside a box, in [px]."""

LONGEST = 36
"""Texts are cut to so many characters."""

IDLE = 10
"""So many outputs that lead nowhere are shown of a box."""


@dataclass(frozen=True, slots=True)
class Pin:
    """A port of a box: a scalar, or an array as one.

    Attributes:
        name: Of the variable.
        size: Number of elements; 1 for a scalar.
        unit: Their unit; empty if they have none.
        value: What an input has all the time that nothing is connected with; empty for any other port.
    """

    name: str
    size: int = 1
    unit: str = ""
    value: str = ""

    @property
    def label(self) -> str:
        """Name and size, and the value of an input that nothing changes."""
        size, value = f" ×{self.size}" if self.size > 1 else "", f" = {self.value}" if self.value else ""
        return cut(self.name) + size + value

    @property
    def length(self) -> int:
        """Number of characters of label and unit."""
        return len(self.label) + (len(self.unit) + 1 if self.unit else 0)


@dataclass(slots=True, eq=False)
class Box:
    """A block as it is drawn.

    Attributes:
        name: Of the block, or of a log.
        kind: What it is.
        left: Its inputs.
        right: Its outputs.
        hidden: How many outputs are not shown.
        layer: Its column, from the left.
        x: Its left edge in [px].
        y: Its upper edge in [px].
        log: Whether it is a log that inputs follow, no block.
    """

    name: str
    kind: str
    left: list[Pin] = field(default_factory=list)
    right: list[Pin] = field(default_factory=list)
    hidden: int = 0
    layer: int = 0
    x: float = 0.0
    y: float = 0.0
    log: bool = False

    @property
    def width(self) -> float:
        """Its width in [px]: all its texts fit."""
        rows = (
            max((one.length for one in self.left), default=0),
            max((one.length for one in self.right), default=0),
        )
        letters = max(sum(rows) + 3, len(cut(self.name)), len(cut(self.kind)), 10)
        return letters * CHARACTER + 2.0 * PAD

    @property
    def height(self) -> float:
        """Its height in [px]."""
        return HEAD + ROW * max(len(self.left), len(self.right) + bool(self.hidden)) + PAD / 2.0

    def offset(self, pins: Sequence[Pin], name: str) -> float:
        """Return how far below its upper edge a port is."""
        return HEAD + ROW * ([one.name for one in pins].index(name) + 0.5)


@dataclass(frozen=True, slots=True)
class Wire:
    """A line from an output to an input.

    Attributes:
        source: Box where it starts.
        output: Port where it starts.
        target: Box where it ends.
        input: Port where it ends.
        size: How many scalars go through.
        held: Whether the source holds its value between two samples, or two rows of a log.
    """

    source: str
    output: str
    target: str
    input: str
    size: int = 1
    held: bool = False


@dataclass(frozen=True, slots=True)
class Diagram:
    """Boxes by name, in the order of the system, and wires."""

    boxes: dict[str, Box]
    wires: tuple[Wire, ...]


def diagram(plan: Plan) -> Diagram:
    """Return what a drawing of a plan shows: its blocks, the logs that inputs follow, its connections."""
    paces = {block.name: _pace(plan, block) for block in plan.system.blocks}
    wires = [
        Wire(
            *link.connection.source,
            *link.connection.destination,
            len(link.scalars),
            paces[link.connection.source.block].held,
        )
        for link in plan.links
    ]
    logs = {one.log: Box(one.log, "log", log=True) for one in plan.system.inputs}
    for one in plan.system.inputs:
        pins = logs[one.log].right
        if one.column not in [pin.name for pin in pins]:
            pins.append(Pin(one.column))
        wires.append(Wire(one.log, one.column, *one.destination, held=not one.interpolate))
    ends = {(w.target, w.input) for w in wires} | {(w.source, w.output) for w in wires}
    boxes = {block.name: Box(block.name, block.kind + paces[block.name].said) for block in plan.system.blocks}
    for name, box in boxes.items():
        shown, used = plan.interfaces[name], {port for block, port in ends if block == name}
        box.left = [
            pin if pin.name in used else replace(pin, value=_value(plan, name, pin))
            for pin in _pins(shown, "input", used)
        ]
        outputs = list(_pins(shown, "output", used))
        idle = [pin for pin in outputs if pin.name not in used][IDLE:]
        box.right, box.hidden = [pin for pin in outputs if pin not in idle], len(idle)
    renamed = _log_names(logs, boxes)
    sources = {renamed[name]: box for name, box in logs.items()}
    wires = [_renamed(wire, renamed) if i >= len(plan.links) else wire for i, wire in enumerate(wires)]
    return Diagram({**sources, **boxes}, tuple(wires))


class _Pace(NamedTuple):
    """How often the outputs of a block change.

    Attributes:
        said: What is added to what the block is.
        held: Whether they are held between two samples, or two rows of a log.
    """

    said: str
    held: bool


def _pace(plan: Plan, block: Block) -> _Pace:
    """Return how often a block changes its outputs: a log source by its rows, others by a `period` in s."""
    if "log" in block.options:
        held = block.options.get("interpolate") is not True
        said = f", {'held' if held else 'interpolated'}: {Path(str(block.options['log'])).name}"
        return _Pace(said, held)
    period = plan.interfaces[block.name].variables.get("period")
    if period is None or period.unit != "s":
        return _Pace("", False)
    given = {start.variable.name: start.value for start in plan.starts[block.name]}
    return _Pace(f", every {1e3 * float(given.get('period', period.start or 0.0)):.6g} ms", True)


def _value(plan: Plan, block: str, pin: Pin) -> str:
    """Return what an input has all the time that nothing is connected with; of an array two elements."""
    given = {start.variable.name: _spelled(start) for start in plan.starts[block]}
    shown = [given[one.name] for one in plan.interfaces[block].elements(pin.name)]
    return shown[0] if len(set(shown)) == 1 else f"{shown[0]}, {shown[1]}{', …' * (len(shown) > 2)}"


def _spelled(start: StartValue) -> str:
    """Return a start value as a system file spells it, a Real in six digits."""
    if isinstance(start.value, str):
        return start.value
    if start.variable.type == "Boolean":
        return "true" if start.value else "false"
    return f"{start.value:.6g}" if start.variable.type == "Real" else f"{start.value:.0f}"


def _log_names(logs: Collection[str], blocks: Collection[str]) -> dict[str, str]:
    """Return what each log is called: its file's name, its whole path where two files have the same."""
    files = [Path(log).name for log in logs]
    names = {log: name if files.count(name) == 1 else log for log, name in zip(logs, files, strict=True)}
    return {log: f"{name} (log)" if name in blocks else name for log, name in names.items()}


def _renamed(wire: Wire, names: dict[str, str]) -> Wire:
    return replace(wire, source=names[wire.source])


def _pins(shown: Interface, causality: str, used: Iterable[str]) -> Iterable[Pin]:
    """Yield the ports of a causality; an array is one, unless its elements are connected one by one."""
    apart = {match[1] for match in map(ELEMENT.fullmatch, used) if match}
    for name in shown.names(causality):
        elements = shown.elements(name)
        if name in apart and name in shown.arrays:
            yield from (Pin(one.name, 1, one.unit) for one in elements)
        else:
            yield Pin(name, len(elements), elements[0].unit)


def cut(text: str) -> str:
    """Return a text that is not too long to be drawn."""
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


GAP, LANE = 26.0, 12.0
"""Between two boxes of a layer, and height of a lane, in [px]."""

CHANNEL = 64.0
"""Between two layers in [px]; half of it at both sides of the drawing."""

WIDEST = CHANNEL * 2.0 / 3.0
"""Reach of the control points of a loop in [px]: so far that it stays in its half of a channel."""

SWEEPS = 24
"""How often boxes and lanes are moved towards what they are wired with."""

Point: TypeAlias = tuple[float, float]


@dataclass(slots=True, eq=False)
class Lane:
    """A wire's way through a layer.

    Attributes:
        wire: The wire.
        layer: The layer.
        y: Its upper edge in [px].
    """

    wire: Wire
    layer: int
    y: float = 0.0
    height: float = LANE


Item = Box | Lane


class Layout:
    """A diagram with places for its boxes.

    Attributes:
        boxes: The boxes, with layer, x and y.
        wires: The wires.
        width: Of all in [px].
        height: Of all in [px].
    """

    def __init__(self, shown: Diagram) -> None:
        self.boxes, self.wires = shown.boxes, shown.wires
        self._lanes: dict[Wire, list[Lane]] = {wire: [] for wire in self.wires}
        _set_layers(self.boxes, self.wires)
        count = 1 + max(box.layer for box in self.boxes.values())
        self._layers: list[list[Item]] = [
            [box for box in self.boxes.values() if box.layer == layer] for layer in range(count)
        ]
        self._settle(sort=True)
        self._add_lanes()
        self._settle(sort=False)
        self._set_places()

    def back(self, wire: Wire) -> bool:
        """Return whether a wire feeds back."""
        return self.boxes[wire.source].layer >= self.boxes[wire.target].layer

    def way(self, wire: Wire) -> list[Point]:
        """Return where a wire starts, and the two control points and the end of each of its cubic curves."""
        source, target = self.boxes[wire.source], self.boxes[wire.target]
        y = self._ys(wire)
        stops = [(source.x + source.width, y[0], 1.0), (self._sides[source.layer][1], y[0], 1.0)]
        heading = -1.0 if self.back(wire) else 1.0
        for lane, at in zip(self._lanes[wire], y[1:-1], strict=True):
            ends = self._sides[lane.layer]
            stops += [(x, at, heading) for x in (ends if heading > 0.0 else ends[::-1])]
        stops += [(self._sides[target.layer][0], y[-1], 1.0), (target.x, y[-1], 1.0)]
        points = [stops[0][:2]]
        for (x0, y0, out), (x1, y1, into) in pairwise(stops):
            reach = abs(x1 - x0) / 2.0 or min(abs(y1 - y0) / 4.0, WIDEST)  # loops stand about each other
            points += [(x0 + out * reach, y0), (x1 - into * reach, y1), (x1, y1)]
        return points

    def _ys(self, wire: Wire) -> list[float]:
        """Return the y of a wire at its ends and in its lanes."""
        source, target = self.boxes[wire.source], self.boxes[wire.target]
        lanes = (lane.y + LANE / 2.0 for lane in self._lanes[wire])
        ends = (
            source.y + source.offset(source.right, wire.output),
            target.y + target.offset(target.left, wire.input),
        )
        return [ends[0], *lanes, ends[1]]

    def _add_lanes(self) -> None:
        """Give each wire its lanes; of those that feed back one goes about the other."""
        for wire in sorted(self.wires, key=lambda one: -self._ys(one)[-1]):
            first, last = self.boxes[wire.source].layer, self.boxes[wire.target].layer
            span = range(first, last - 1, -1) if self.back(wire) else range(first + 1, last)
            start, end = self._ys(wire)
            step = (end - start) / (len(span) + 1)
            lanes = [Lane(wire, layer, start + k * step) for k, layer in enumerate(span, 1)]
            for lane in lanes:
                self._layers[lane.layer].append(lane)
            self._lanes[wire] = lanes
            if self.back(wire):
                lanes[0].y = self._wanted_lane(lanes[0]) + GAP / 2.0
                for lane in lanes[1:]:
                    lane.y = lanes[0].y
        for layer in self._layers:
            layer.sort(key=_middle)

    def _settle(self, *, sort: bool) -> None:
        """Move boxes and lanes towards what they are wired with, without overlap; sorted or as they are."""
        for sweep in range(SWEEPS):
            for layer in self._layers if sweep % 2 == 0 else reversed(self._layers):
                for item, y in zip(layer, [self._wanted(item) for item in layer], strict=True):
                    item.y = y
                if sort:
                    layer.sort(key=_middle)
                _spread(layer)

    def _wanted(self, item: Item) -> float:
        """Return where an item would stand if it stood alone: by what leads to it, else by where it leads."""
        if isinstance(item, Lane):
            return self._wanted_lane(item)
        ahead = [(wire, self._ys(wire)) for wire in self.wires if not self.back(wire)]
        into = [y[-2] - y[-1] for wire, y in ahead if self.boxes[wire.target] is item]
        out = [y[1] - y[0] for wire, y in ahead if self.boxes[wire.source] is item]
        return item.y + fmean(into or out or [0.0])

    def _wanted_lane(self, lane: Lane) -> float:
        """Return where a lane would stand: in line with its wire; below the ends of one that feeds back."""
        wire, lanes = lane.wire, self._lanes[lane.wire]
        if self.back(wire):
            ends = self.boxes[wire.source], self.boxes[wire.target]
            return max(*(one.y for one in lanes), *(box.y + box.height for box in ends))
        y, place = self._ys(wire), lanes.index(lane) + 1
        return (y[place - 1] + y[place + 1]) / 2.0 - LANE / 2.0

    def _set_places(self) -> None:
        """Set the x of the boxes and the sides of the layers, and let y begin at 0."""
        items = [item for layer in self._layers for item in layer]
        top = min(item.y for item in items)
        for item in items:
            item.y -= top
        self.height = max(item.y + item.height for item in items)
        self._sides: list[tuple[float, float]] = []
        x = CHANNEL / 2.0
        for layer in self._layers:
            boxes = [one for one in layer if isinstance(one, Box)]
            width = max(box.width for box in boxes)
            for box in boxes:
                box.x = x + (width - box.width) / 2.0
            self._sides.append((x, x + width))
            x += width + CHANNEL
        self.width = x - CHANNEL / 2.0


def _set_layers(boxes: dict[str, Box], wires: Sequence[Wire]) -> None:
    """Set the layers: the longest way from a source, wires that close a ring left aside."""
    after: dict[str, list[str]] = {name: [] for name in boxes}
    for wire in wires:
        after[wire.source].append(wire.target)
    targets = {wire.target for wire in wires if wire.source != wire.target}
    roots = [name for name in boxes if name not in targets]
    order = list(_order([*roots, *boxes], after))[::-1]
    ahead = {name: [t for t in after[name] if order.index(t) > order.index(name)] for name in order}
    for name in order:
        for target in ahead[name]:
            boxes[target].layer = max(boxes[target].layer, boxes[name].layer + 1)
    for name in roots:  # a source stands beside what it feeds
        if ahead[name]:
            boxes[name].layer = min(boxes[target].layer for target in ahead[name]) - 1


def _order(roots: Sequence[str], after: dict[str, list[str]]) -> Iterator[str]:
    """Yield what can be reached from some roots, each after all that it leads to but for rings."""
    seen: set[str] = set()
    for root in roots:
        stack = [] if root in seen else [(root, iter(after[root]))]
        seen.add(root)
        while stack:
            target = next(stack[-1][1], None)
            if target is None:
                yield stack.pop()[0]
            elif target not in seen:
                seen.add(target)
                stack.append((target, iter(after[target])))


def _middle(item: Item) -> float:
    """Return the y of the middle of a box or a lane."""
    return item.y + item.height / 2.0


def _spread(items: Sequence[Item]) -> None:
    """Move items apart that would overlap, in their order, as little as can be (least squares).

    With the items' heights taken off it is a monotone regression: neighbours that would overlap are pooled.
    """
    taken, at = [], 0.0
    for item in items:
        beside = GAP / 2.0 if isinstance(item, Box) else 0.0
        taken.append(at + beside)
        at += item.height + 2.0 * beside
    pools: list[list[float]] = []
    for item, below in zip(items, taken, strict=True):
        pools.append([item.y - below])
        while len(pools) > 1 and fmean(pools[-2]) > fmean(pools[-1]):
            last = pools.pop()
            pools[-1] += last
    means = [fmean(pool) for pool in pools for _ in pool]
    for item, mean, below in zip(items, means, taken, strict=True):
        item.y = mean + below


MARGIN = 24.0
"""Around the drawing in [px]."""

LINE, TITLE = 17.0, 22.0
"""Height of a line of the description, and of the title, in [px]."""

LARGER = 16.0 / 12.0
"""The title's letters for one of the rest."""

NARROWEST = 420.0
"""Least width of the drawing in [px]: room for its title."""

STYLE = """
.paper{fill:#ffffff}.box{fill:#f5f7fa;stroke:#5b6b7d}.head{fill:#dfe7f0}.log .head{fill:#e8e0cf}
.wire{fill:none;stroke:#3a6ea5;stroke-width:1.4;stroke-linejoin:round}
.array{stroke-width:2.8}.held{stroke-dasharray:7 4}.back{stroke:#a55a3a}
.tip{fill:#3a6ea5}.back-tip{fill:#a55a3a}
text{fill:#1c2733;font:12px ui-monospace,"DejaVu Sans Mono",monospace}
.name{font-weight:bold}.quiet{fill:#5a6875}.title{font-size:16px;font-weight:bold}.many{font-size:10px}
@media (prefers-color-scheme:dark){.paper{fill:#14191f}.box{fill:#1e262f;stroke:#8496a8}.head{fill:#2b3947}
.log .head{fill:#453d2b}.wire{stroke:#7fb2e5}.back{stroke:#e59b7f}.tip{fill:#7fb2e5}.back-tip{fill:#e59b7f}
text{fill:#e8edf2}.quiet{fill:#a3b1bf}}
"""


def system_svg(plan: Plan) -> str:
    """Return a drawing of a system as a self-contained SVG: the same text for the same system.

    Its colours are those of a light page, or of a dark one where the reader prefers that.
    """
    shown = diagram(plan)
    layout = Layout(shown)
    width = max(layout.width, NARROWEST)
    titles = wrap(plan.system.name, int(width / (LARGER * CHARACTER)))
    lines = wrap(plan.system.description, int(width / CHARACTER))
    below = MARGIN + TITLE * (len(titles) - 1)
    top = below + 2.0 * LINE + LINE * len(lines)
    key = [line for said in _key(layout) for line in wrap(said, int(width / CHARACTER))]
    full = (width + 2.0 * MARGIN, top + layout.height + MARGIN + LINE * len(key))
    body = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{full[0]:.0f}" height="{full[1]:.0f}"'
        f' viewBox="0 0 {full[0]:.0f} {full[1]:.0f}" role="img">',
        f"<title>{_text(plan.system.name)}</title><style>{STYLE}</style>",
        f'<rect class="paper" width="{full[0]:.0f}" height="{full[1]:.0f}"/>',
    ]
    for i, line in enumerate(titles):
        body.append(
            f'<text class="title" x="{MARGIN:g}" y="{MARGIN + 12 + TITLE * i:g}">{_text(line)}</text>'
        )
    for i, line in enumerate(lines):
        body.append(
            f'<text class="quiet" x="{MARGIN:g}" y="{below + 14 + LINE * (i + 1):g}">{_text(line)}</text>'
        )
    body.append(f'<g transform="translate({MARGIN:g} {top:.1f})">')
    for wire in layout.wires:
        body += _wire(wire, layout.way(wire), layout.back(wire))
    for name, box in shown.boxes.items():
        body += _box(name, box, _feeding(shown))
    for i, line in enumerate(key):
        body.append(
            f'<text class="quiet" x="0" y="{layout.height + LINE * (i + 1):.1f}">{_text(line)}</text>'
        )
    return "\n".join([*body, "</g></svg>", ""])


def _key(layout: Layout) -> Iterator[str]:
    """Yield what the lines mean, of those that are drawn."""
    if any(wire.held for wire in layout.wires):
        yield "Dashed: held between two samples, or two rows of a log."
    if any(wire.size > 1 for wire in layout.wires):
        yield "Thick: an array, with its size."
    if any(map(layout.back, layout.wires)):
        yield "Brown: back to a block further left."
    if any(pin.value for box in layout.boxes.values() for pin in box.left):
        yield "name = value: an input that nothing changes."


def _text(text: str) -> str:
    """Return a text for SVG; what no XML may hold is left out."""
    return escape("".join(one for one in text if one.isprintable()))


def _feeding(shown: Diagram) -> set[tuple[str, str]]:
    """Return the outputs that lead somewhere."""
    return {(wire.source, wire.output) for wire in shown.wires}


def _wire(wire: Wire, points: list[tuple[float, float]], back: bool) -> Iterator[str]:
    """Yield a wire with its tip, and how many scalars go through it."""
    start, *curves = (f"{x:.1f} {y:.1f}" for x, y in points)
    way = f"M{start} C{' '.join(curves)}"
    kinds = " ".join(["wire", *(["array"] if wire.size > 1 else []), *(["back"] if back else [])])
    kinds += " held" if wire.held else ""
    ends = f"{wire.source}.{wire.output} → {wire.target}.{wire.input}"
    yield f'<path class="{kinds}" d="{way}"><title>{_text(ends)}</title></path>'
    x, y = points[-1]
    tip = "back-tip" if back else "tip"
    yield f'<path class="{tip}" d="M{x:.1f} {y:.1f} l-8 -4 v8 z"/>'
    if wire.size > 1:
        x, y = points[0]
        yield f'<text class="many" x="{x + 5:.1f}" y="{y - 4:.1f}">{wire.size}</text>'


def _box(name: str, box: Box, feeding: set[tuple[str, str]]) -> Iterator[str]:
    """Yield a box with its name, its kind and its ports."""
    x, y, width, height = box.x, box.y, box.width, box.height
    yield '<g class="log">' if box.log else "<g>"
    yield f'<rect class="box" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="4"/>'
    head = f'x="{x + 1:.1f}" y="{y + 1:.1f}" width="{width - 2:.1f}" height="{HEAD - 6:.1f}"'
    yield f'<rect class="head" {head} rx="3"/>'
    yield f'<text class="name" x="{x + PAD:.1f}" y="{y + 16:.1f}">{_text(cut(name))}</text>'
    yield f'<text class="quiet" x="{x + PAD:.1f}" y="{y + 31:.1f}">{_text(cut(box.kind))}</text>'
    for i, pin in enumerate(box.left):
        yield _pin(pin, x + PAD, y + HEAD + ROW * (i + 0.5) + 4.0, "start", quiet=bool(pin.value))
    for i, pin in enumerate(box.right):
        quiet = (name, pin.name) not in feeding
        yield _pin(pin, x + width - PAD, y + HEAD + ROW * (i + 0.5) + 4.0, "end", quiet=quiet)
    if box.hidden:
        row = y + HEAD + ROW * (len(box.right) + 0.5) + 4.0
        yield _pin(Pin(f"{box.hidden} more"), x + width - PAD, row, "end", quiet=True)
    yield "</g>"


def _pin(pin: Pin, x: float, y: float, anchor: str, *, quiet: bool) -> str:
    """Return the text of a port: its name, and its unit in a quieter colour."""
    unit = f' <tspan class="quiet">{_text(pin.unit)}</tspan>' if pin.unit else ""
    kind = ' class="quiet"' if quiet else ""
    return f'<text{kind} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{_text(pin.label)}{unit}</text>'
