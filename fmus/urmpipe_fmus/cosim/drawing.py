"""Drawing of a system as SVG: blocks with their ports and units, logs, and connections.

1. `build_diagram`: boxes with pins (an array is one pin), and wires between them, without places.
2. `Layout`: places of boxes and wires. Boxes are in layers from left to right, so that wires lead to the
   right, except those that feed back. A wire has a level lane in each layer that it passes; one that feeds
   back has lanes in all layers from its source to its target, below both. Between the layers, wires are cubic
   curves. Within a layer, boxes and lanes are as near as possible to what they are connected with: each sweep
   moves them there, and removes overlaps in the least squares sense (monotone regression).
3. `system_svg`: the text of the SVG.

Source: K. Sugiyama, S. Tagawa, M. Toda, Methods for visual understanding of hierarchical system structures,
IEEE Trans. SMC 11 (1981), 109-125.
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

CHARACTER = 7.3  # px; width of a character of the fixed-width font (12 px, 0.6 em)
ROW, HEAD, PAD = 18.0, 42.0, 10.0  # px; height of a port and of a box's head, margin inside a box
MAX_CHARACTERS = 36  # longer texts are truncated
MAX_UNCONNECTED_OUTPUTS = 10  # shown of a box
GAP, LANE = 26.0, 12.0  # px; between two boxes of a layer, and height of a lane
CHANNEL = 64.0  # px; between two layers, half of it at both sides of the drawing
MAX_LOOP_REACH = CHANNEL * 2.0 / 3.0  # px; control points of a loop, which stays in its half of a channel
SWEEPS = 24  # in which boxes and lanes are moved to what they are connected with
MARGIN = 24.0  # px; around the drawing
LINE, TITLE = 17.0, 22.0  # px; height of a line of the description, and of the title
TITLE_SCALE = 16.0 / 12.0  # font size of the title relative to the rest
MIN_WIDTH = 420.0  # px; of the drawing, so that there is room for its title

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

Point: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Pin:
    """A port of a box: a scalar, or an array.

    Attributes:
        name: Of the variable.
        size: Number of elements; 1 for a scalar.
        unit: Their unit; empty if they have none.
        value: Constant value of an input without a connection; empty for any other port.
    """

    name: str
    size: int = 1
    unit: str = ""
    value: str = ""

    @property
    def label(self) -> str:
        """Name, size, and constant value."""
        size, value = f" ×{self.size}" if self.size > 1 else "", f" = {self.value}" if self.value else ""
        return truncate(self.name) + size + value

    @property
    def length(self) -> int:
        """Number of characters of label and unit."""
        return len(self.label) + (len(self.unit) + 1 if self.unit else 0)


@dataclass(slots=True, eq=False)
class Box:
    """A block as it is drawn.

    Attributes:
        name: Of the block, or of a log.
        kind: Its block model or file, as text.
        left: Its inputs.
        right: Its outputs.
        hidden: Number of outputs that are not shown.
        layer: Its column, from the left.
        x: Its left edge in [px].
        y: Its upper edge in [px].
        log: Whether it is a log that inputs follow, and not a block.
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
        rows = sum(max((pin.length for pin in pins), default=0) for pins in (self.left, self.right))
        characters = max(rows + 3, len(truncate(self.name)), len(truncate(self.kind)), 10)
        return characters * CHARACTER + 2.0 * PAD

    @property
    def height(self) -> float:
        """Its height in [px]."""
        return HEAD + ROW * max(len(self.left), len(self.right) + bool(self.hidden)) + PAD / 2.0

    def offset(self, pins: Sequence[Pin], name: str) -> float:
        """Return the distance in [px] of a port below the upper edge."""
        return HEAD + ROW * ([pin.name for pin in pins].index(name) + 0.5)


@dataclass(frozen=True, slots=True)
class Wire:
    """A line from an output to an input.

    Attributes:
        source: Box where it starts.
        output: Port where it starts.
        target: Box where it ends.
        input: Port where it ends.
        size: Number of scalars.
        is_stepwise: Whether its value is constant between two samples, or two rows of a log.
    """

    source: str
    output: str
    target: str
    input: str
    size: int = 1
    is_stepwise: bool = False


@dataclass(frozen=True, slots=True)
class Diagram:
    """Boxes by name, in the order of the system, and wires."""

    boxes: dict[str, Box]
    wires: tuple[Wire, ...]


def truncate(text: str) -> str:
    """Return a text of at most `MAX_CHARACTERS`."""
    return text if len(text) <= MAX_CHARACTERS else text[: MAX_CHARACTERS - 1] + "…"


def build_diagram(plan: Plan) -> Diagram:
    """Return the diagram of a plan: its blocks, the logs that inputs follow, its connections."""
    rates = {block.name: _output_rate(plan, block) for block in plan.system.blocks}
    wires = [
        Wire(
            *link.connection.source,
            *link.connection.destination,
            len(link.scalars),
            rates[link.connection.source.block].is_stepwise,
        )
        for link in plan.links
    ]
    log_names = _log_names({log_input.log: None for log_input in plan.system.inputs}, plan.interfaces)
    logs = {name: Box(log, "log", log=True) for log, name in log_names.items()}
    for log_input in plan.system.inputs:
        name, column = log_names[log_input.log], log_input.column
        if column not in [pin.name for pin in logs[name].right]:
            logs[name].right.append(Pin(column))
        wires.append(Wire(name, column, *log_input.destination, is_stepwise=not log_input.interpolate))
    boxes = {}
    for block in plan.system.blocks:
        interface = plan.interfaces[block.name]
        used = {wire.input for wire in wires if wire.target == block.name}
        used |= {wire.output for wire in wires if wire.source == block.name}
        outputs = list(_pins(interface, "output", used))
        hidden = [pin for pin in outputs if pin.name not in used][MAX_UNCONNECTED_OUTPUTS:]
        boxes[block.name] = Box(
            block.name,
            block.kind + rates[block.name].text,
            left=[
                pin if pin.name in used else replace(pin, value=_constant(plan, block.name, pin))
                for pin in _pins(interface, "input", used)
            ],
            right=[pin for pin in outputs if pin not in hidden],
            hidden=len(hidden),
        )
    return Diagram({**logs, **boxes}, tuple(wires))


class _OutputRate(NamedTuple):
    """Rate of change of a block's outputs: as text, and whether they are constant between samples or rows."""

    text: str
    is_stepwise: bool


def _output_rate(plan: Plan, block: Block) -> _OutputRate:
    """Return the rate of a block's outputs: by the rows of a log source, or a `period` in s."""
    if "log" in block.options:
        interpolated = block.options.get("interpolate") is True
        mode = "interpolated" if interpolated else "held"
        return _OutputRate(f", {mode}: {Path(str(block.options['log'])).name}", not interpolated)
    period = plan.interfaces[block.name].variables.get("period")
    if period is None or period.unit != "s":
        return _OutputRate("", False)
    values = {start.variable.name: start.value for start in plan.starts[block.name]}
    return _OutputRate(f", every {1e3 * float(values.get('period', period.start or 0.0)):.6g} ms", True)


def _log_names(logs: Collection[str], blocks: Collection[str]) -> dict[str, str]:
    """Return the displayed name of each log: its file name, or its path if two files have the same name."""
    files = [Path(log).name for log in logs]
    names = {log: name if files.count(name) == 1 else log for log, name in zip(logs, files, strict=True)}
    return {log: f"{name} (log)" if name in blocks else name for log, name in names.items()}


def _pins(interface: Interface, causality: str, used: Iterable[str]) -> Iterator[Pin]:
    """Yield the ports of a causality; an array is one, unless its elements are connected individually."""
    split = {match[1] for match in map(ELEMENT.fullmatch, used) if match}
    for name in interface.names(causality):
        elements = interface.elements(name)
        if name in split and name in interface.arrays:
            yield from (Pin(element.name, 1, element.unit) for element in elements)
        else:
            yield Pin(name, len(elements), elements[0].unit)


def _constant(plan: Plan, block: str, pin: Pin) -> str:
    """Return the constant value of an input without a connection; of an array two elements."""
    values = {start.variable.name: _format_start(start) for start in plan.starts[block]}
    texts = [values[element.name] for element in plan.interfaces[block].elements(pin.name)]
    return texts[0] if len(set(texts)) == 1 else f"{texts[0]}, {texts[1]}{', …' * (len(texts) > 2)}"


def _format_start(start: StartValue) -> str:
    """Return a start value as a system file spells it, a Real in six digits."""
    if isinstance(start.value, str):
        return start.value
    if start.variable.type == "Boolean":
        return "true" if start.value else "false"
    return f"{start.value:.6g}" if start.variable.type == "Real" else f"{start.value:.0f}"


@dataclass(slots=True, eq=False)
class Lane:
    """A wire's way through a layer.

    Attributes:
        wire: The wire.
        layer: The layer.
        y: Its upper edge in [px].
        height: In [px].
    """

    wire: Wire
    layer: int
    y: float = 0.0
    height: float = LANE


Item = Box | Lane


class Layout:
    """Places of the boxes and wires of a diagram.

    Attributes:
        boxes: The boxes, with layer, x and y.
        wires: The wires.
        width: Of all in [px].
        height: Of all in [px].
    """

    def __init__(self, diagram: Diagram) -> None:
        self.boxes, self.wires = diagram.boxes, diagram.wires
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

    def is_feedback(self, wire: Wire) -> bool:
        """Return whether a wire feeds back."""
        return self.boxes[wire.source].layer >= self.boxes[wire.target].layer

    def route(self, wire: Wire) -> list[Point]:
        """Return the start of a wire, and two control points and the end of each of its cubic curves."""
        source, target = self.boxes[wire.source], self.boxes[wire.target]
        y = self._ys(wire)
        stops = [(source.x + source.width, y[0], 1.0), (self._sides[source.layer][1], y[0], 1.0)]
        heading = -1.0 if self.is_feedback(wire) else 1.0
        for lane, lane_y in zip(self._lanes[wire], y[1:-1], strict=True):
            ends = self._sides[lane.layer]
            stops += [(x, lane_y, heading) for x in (ends if heading > 0.0 else ends[::-1])]
        stops += [(self._sides[target.layer][0], y[-1], 1.0), (target.x, y[-1], 1.0)]
        points = [stops[0][:2]]
        for (x0, y0, out), (x1, y1, into) in pairwise(stops):
            reach = abs(x1 - x0) / 2.0 or min(abs(y1 - y0) / 4.0, MAX_LOOP_REACH)  # loops enclose each other
            points += [(x0 + out * reach, y0), (x1 - into * reach, y1), (x1, y1)]
        return points

    def _ys(self, wire: Wire) -> list[float]:
        """Return the y of a wire at its ends and in its lanes."""
        source, target = self.boxes[wire.source], self.boxes[wire.target]
        return [
            source.y + source.offset(source.right, wire.output),
            *(lane.y + LANE / 2.0 for lane in self._lanes[wire]),
            target.y + target.offset(target.left, wire.input),
        ]

    def _add_lanes(self) -> None:
        """Give each wire its lanes; those that feed back enclose each other."""
        for wire in sorted(self.wires, key=lambda wire: -self._ys(wire)[-1]):
            first, last = self.boxes[wire.source].layer, self.boxes[wire.target].layer
            is_feedback = self.is_feedback(wire)
            span = range(first, last - 1, -1) if is_feedback else range(first + 1, last)
            start, end = self._ys(wire)
            step = (end - start) / (len(span) + 1)
            lanes = [Lane(wire, layer, start + k * step) for k, layer in enumerate(span, 1)]
            for lane in lanes:
                self._layers[lane.layer].append(lane)
            self._lanes[wire] = lanes
            if is_feedback:
                lanes[0].y = self._target_y(lanes[0]) + GAP / 2.0
                for lane in lanes[1:]:
                    lane.y = lanes[0].y
        for layer in self._layers:
            layer.sort(key=_middle)

    def _settle(self, *, sort: bool) -> None:
        """Move boxes and lanes to what they are connected with, without overlap; sorted or in their order."""
        for sweep in range(SWEEPS):
            for layer in self._layers if sweep % 2 == 0 else reversed(self._layers):
                for item, y in zip(layer, [self._target_y(item) for item in layer], strict=True):
                    item.y = y
                if sort:
                    layer.sort(key=_middle)
                _remove_overlaps(layer)

    def _target_y(self, item: Item) -> float:
        """Return the y of an item in line with its wires, regardless of overlaps.

        A box follows the wires that lead to it, else those from it; a lane its wire, or is below the ends of
        a wire that feeds back.
        """
        if isinstance(item, Box):
            ahead = [(wire, self._ys(wire)) for wire in self.wires if not self.is_feedback(wire)]
            into = [y[-2] - y[-1] for wire, y in ahead if self.boxes[wire.target] is item]
            out = [y[1] - y[0] for wire, y in ahead if self.boxes[wire.source] is item]
            return item.y + fmean(into or out or [0.0])
        wire, lanes = item.wire, self._lanes[item.wire]
        if self.is_feedback(wire):
            ends = self.boxes[wire.source], self.boxes[wire.target]
            return max(*(lane.y for lane in lanes), *(box.y + box.height for box in ends))
        y, place = self._ys(wire), lanes.index(item) + 1
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
            boxes = [item for item in layer if isinstance(item, Box)]
            width = max(box.width for box in boxes)
            for box in boxes:
                box.x = x + (width - box.width) / 2.0
            self._sides.append((x, x + width))
            x += width + CHANNEL
        self.width = x - CHANNEL / 2.0


def _set_layers(boxes: dict[str, Box], wires: Sequence[Wire]) -> None:
    """Set the layers: the longest way from a source, without the wires that close a ring."""
    after: dict[str, list[str]] = {name: [] for name in boxes}
    for wire in wires:
        after[wire.source].append(wire.target)
    targets = {wire.target for wire in wires if wire.source != wire.target}
    roots = [name for name in boxes if name not in targets]
    order = list(_iter_reachable([*roots, *boxes], after))[::-1]
    ahead = {name: [t for t in after[name] if order.index(t) > order.index(name)] for name in order}
    for name in order:
        for target in ahead[name]:
            boxes[target].layer = max(boxes[target].layer, boxes[name].layer + 1)
    for name in roots:  # a source is next to what it feeds
        if ahead[name]:
            boxes[name].layer = min(boxes[target].layer for target in ahead[name]) - 1


def _iter_reachable(roots: Sequence[str], after: dict[str, list[str]]) -> Iterator[str]:
    """Yield what can be reached from some roots, each after all that it leads to, except in rings."""
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
    return item.y + item.height / 2.0


def _remove_overlaps(items: Sequence[Item]) -> None:
    """Move items that overlap apart, in their order, by as little as possible (least squares).

    Without the heights of the items it is a monotone regression: neighbours that would overlap are pooled.
    """
    taken, y = [], 0.0  # the height taken by the items above each one
    for item in items:
        margin = GAP / 2.0 if isinstance(item, Box) else 0.0
        taken.append(y + margin)
        y += item.height + 2.0 * margin
    pools: list[list[float]] = []
    for item, above in zip(items, taken, strict=True):
        pools.append([item.y - above])
        while len(pools) > 1 and fmean(pools[-2]) > fmean(pools[-1]):
            last = pools.pop()
            pools[-1] += last
    means = [fmean(pool) for pool in pools for _ in pool]
    for item, mean, above in zip(items, means, taken, strict=True):
        item.y = mean + above


def system_svg(plan: Plan) -> str:
    """Return a drawing of a system as a self-contained SVG: the same text for the same system.

    Its colours are those of a light page, or of a dark one where the reader prefers that.
    """
    diagram = build_diagram(plan)
    layout = Layout(diagram)
    width = max(layout.width, MIN_WIDTH)
    titles = wrap(plan.system.name, int(width / (TITLE_SCALE * CHARACTER)))
    lines = wrap(plan.system.description, int(width / CHARACTER))
    below = MARGIN + TITLE * (len(titles) - 1)
    top = below + 2.0 * LINE + LINE * len(lines)
    legend = [line for entry in _legend(layout) for line in wrap(entry, int(width / CHARACTER))]
    full = (width + 2.0 * MARGIN, top + layout.height + MARGIN + LINE * len(legend))
    body = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{full[0]:.0f}" height="{full[1]:.0f}"'
        f' viewBox="0 0 {full[0]:.0f} {full[1]:.0f}" role="img">',
        f"<title>{_escape(plan.system.name)}</title><style>{STYLE}</style>",
        f'<rect class="paper" width="{full[0]:.0f}" height="{full[1]:.0f}"/>',
    ]
    for i, line in enumerate(titles):
        body.append(
            f'<text class="title" x="{MARGIN:g}" y="{MARGIN + 12 + TITLE * i:g}">{_escape(line)}</text>'
        )
    for i, line in enumerate(lines):
        body.append(
            f'<text class="quiet" x="{MARGIN:g}" y="{below + 14 + LINE * (i + 1):g}">{_escape(line)}</text>'
        )
    body.append(f'<g transform="translate({MARGIN:g} {top:.1f})">')
    for wire in layout.wires:
        body += _wire_svg(wire, layout.route(wire), layout.is_feedback(wire))
    connected = {(wire.source, wire.output) for wire in diagram.wires}
    for name, box in diagram.boxes.items():
        body += _box_svg(name, box, connected)
    for i, line in enumerate(legend):
        body.append(
            f'<text class="quiet" x="0" y="{layout.height + LINE * (i + 1):.1f}">{_escape(line)}</text>'
        )
    return "\n".join([*body, "</g></svg>", ""])


def _legend(layout: Layout) -> Iterator[str]:
    """Yield the meaning of the kinds of lines that are drawn."""
    if any(wire.is_stepwise for wire in layout.wires):
        yield "Dashed: held between two samples, or two rows of a log."
    if any(wire.size > 1 for wire in layout.wires):
        yield "Thick: an array, with its size."
    if any(map(layout.is_feedback, layout.wires)):
        yield "Brown: back to a block further left."
    if any(pin.value for box in layout.boxes.values() for pin in box.left):
        yield "name = value: an input that nothing changes."


def _escape(text: str) -> str:
    """Return a text for SVG, without the characters that XML does not allow."""
    return escape("".join(character for character in text if character.isprintable()))


def _wire_svg(wire: Wire, points: Sequence[Point], is_feedback: bool) -> Iterator[str]:
    """Yield a wire with its tip, and the number of its scalars."""
    start, *curves = (f"{x:.1f} {y:.1f}" for x, y in points)
    kinds = {"wire": True, "array": wire.size > 1, "back": is_feedback, "held": wire.is_stepwise}  # plain: ok
    classes = " ".join(kind for kind, applies in kinds.items() if applies)
    ends = f"{wire.source}.{wire.output} → {wire.target}.{wire.input}"
    path = f'd="M{start} C{" ".join(curves)}"'
    yield f'<path class="{classes}" {path}><title>{_escape(ends)}</title></path>'
    x, y = points[-1]
    tip = "back-tip" if is_feedback else "tip"
    yield f'<path class="{tip}" d="M{x:.1f} {y:.1f} l-8 -4 v8 z"/>'
    if wire.size > 1:
        x, y = points[0]
        yield f'<text class="many" x="{x + 5:.1f}" y="{y - 4:.1f}">{wire.size}</text>'


def _box_svg(name: str, box: Box, connected: Collection[tuple[str, str]]) -> Iterator[str]:
    """Yield a box with its name, its kind and its ports."""
    x, y, width, height = box.x, box.y, box.width, box.height
    yield '<g class="log">' if box.log else "<g>"
    yield f'<rect class="box" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="4"/>'
    head = f'x="{x + 1:.1f}" y="{y + 1:.1f}" width="{width - 2:.1f}" height="{HEAD - 6:.1f}"'
    yield f'<rect class="head" {head} rx="3"/>'
    yield f'<text class="name" x="{x + PAD:.1f}" y="{y + 16:.1f}">{_escape(truncate(name))}</text>'
    yield f'<text class="quiet" x="{x + PAD:.1f}" y="{y + 31:.1f}">{_escape(truncate(box.kind))}</text>'
    rows = [("start", x + PAD, i, pin, bool(pin.value)) for i, pin in enumerate(box.left)]
    outputs = [(pin, (name, pin.name) not in connected) for pin in box.right]
    if box.hidden:
        outputs.append((Pin(f"{box.hidden} more"), True))
    rows += [("end", x + width - PAD, i, pin, quiet) for i, (pin, quiet) in enumerate(outputs)]
    for anchor, text_x, i, pin, quiet in rows:
        unit = f' <tspan class="quiet">{_escape(pin.unit)}</tspan>' if pin.unit else ""
        place = f'x="{text_x:.1f}" y="{y + HEAD + ROW * (i + 0.5) + 4.0:.1f}" text-anchor="{anchor}"'
        kind = ' class="quiet"' if quiet else ""
        yield f"<text{kind} {place}>{_escape(pin.label)}{unit}</text>"
    yield "</g>"
