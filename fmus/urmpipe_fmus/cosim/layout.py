"""Where the boxes of a diagram stand, and which way its wires go.

Boxes stand in layers from left to right, so that wires lead to the right but for those that feed back. A wire
that passes a layer has a lane there; one that feeds back has lanes in all layers from its source back to its
target, below both. Within a layer boxes and lanes are as near as they can be to what they are wired with.

Source: K. Sugiyama, S. Tagawa, M. Toda, Methods for visual understanding of hierarchical system structures,
IEEE Trans. SMC 11 (1981), 109-125.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from urmpipe_fmus.cosim.diagram import Box, Diagram, Wire

GAP = 26.0
"""Between two boxes of a layer in [px]."""

LANE = 12.0
"""Height of a lane in [px]."""

SWEEPS = 12
"""How often boxes and lanes are moved towards what they are wired with."""


@dataclass(slots=True, eq=False)
class Lane:
    """A wire's way through a layer.

    Attributes:
        wire: The wire.
        layer: The layer.
        back: Whether it leads to the left.
        y: Its upper edge in [px].
    """

    wire: Wire
    layer: int
    back: bool
    y: float = 0.0
    height: float = LANE


Item = Box | Lane


class Layout:
    """A diagram with places for its boxes.

    Attributes:
        boxes: The boxes, with layer and y.
        lanes: The lanes of each wire, in the order in which it goes through them.
        layers: The boxes and lanes of each layer, from above.
    """

    def __init__(self, shown: Diagram) -> None:
        self.boxes, self.wires = shown.boxes, shown.wires
        self._set_layers()
        self.layers: list[list[Item]] = [[] for _ in range(1 + max(b.layer for b in self.boxes.values()))]
        for box in self.boxes.values():
            self.layers[box.layer].append(box)
        self.lanes: dict[Wire, list[Lane]] = {wire: [] for wire in self.wires}
        self._order_boxes()
        self._settle()
        self._add_lanes()
        self._settle()
        top = min(item.y for layer in self.layers for item in layer)
        for layer in self.layers:
            for item in layer:
                item.y -= top

    def start(self, wire: Wire) -> float:
        """Return the y at which a wire leaves its source."""
        box = self.boxes[wire.source]
        return box.y + box.offset(box.right, wire.output)

    def end(self, wire: Wire) -> float:
        """Return the y at which a wire reaches its target."""
        box = self.boxes[wire.target]
        return box.y + box.offset(box.left, wire.input)

    def back(self, wire: Wire) -> bool:
        """Return whether a wire feeds back."""
        return self.boxes[wire.source].layer >= self.boxes[wire.target].layer

    def _set_layers(self) -> None:
        """Set the layers: the longest way from a source, wires that close a ring left aside."""
        after: dict[str, list[str]] = {name: [] for name in self.boxes}
        for wire in self.wires:
            after[wire.source].append(wire.target)
        targets = {wire.target for wire in self.wires if wire.source != wire.target}
        roots = [name for name in self.boxes if name not in targets]
        closing, order = _closing([*roots, *self.boxes], after)
        for name in order:
            for target in after[name]:
                if (name, target) not in closing:
                    box = self.boxes[target]
                    box.layer = max(box.layer, self.boxes[name].layer + 1)
        for name in reversed(order):  # a source stands beside what it feeds
            ahead = [self.boxes[t].layer for t in after[name] if (name, t) not in closing]
            if name in roots and ahead:
                self.boxes[name].layer = min(ahead) - 1

    def _order_boxes(self) -> None:
        """Order each layer by where the boxes before it stand that its boxes are wired with."""
        for layer in self.layers[1:]:
            keys = {}
            for i, box in enumerate(layer):
                before = [self.boxes[w.source] for w in self.wires if self.boxes[w.target] is box]
                shares = [
                    self._share(one) for one in before if isinstance(box, Box) and one.layer < box.layer
                ]
                own = (i + 0.5) / len(layer)
                keys[id(box)] = (sum(shares) / len(shares) if shares else own, i)
            layer.sort(key=lambda one: keys[id(one)])

    def _share(self, box: Box) -> float:
        """Return how far down its layer a box is, 0 to 1."""
        layer = self.layers[box.layer]
        return (layer.index(box) + 0.5) / len(layer)

    def _add_lanes(self) -> None:
        """Give each wire its lanes, and put them among the boxes."""
        nested = sorted(
            self.wires, key=lambda one: -self.end(one)
        )  # of those that feed back, one about the other
        for wire in nested:
            source, target = self.boxes[wire.source], self.boxes[wire.target]
            back = self.back(wire)
            span = (
                range(source.layer, target.layer - 1, -1) if back else range(source.layer + 1, target.layer)
            )
            below = max(source.y + source.height, target.y + target.height) + GAP / 2.0
            for layer in span:
                share = (layer - source.layer) / (target.layer - source.layer) if not back else 0.0
                y = below if back else self.start(wire) + share * (self.end(wire) - self.start(wire))
                lane = Lane(wire, layer, back, y - LANE / 2.0)
                self.lanes[wire].append(lane)
                self.layers[layer].append(lane)
        for items in self.layers:
            place = {id(one): i for i, one in enumerate(items)}
            items.sort(key=lambda one: (one.y + one.height / 2.0, place[id(one)]))

    def _settle(self) -> None:
        """Move boxes and lanes towards what they are wired with, without overlap and in their order."""
        for sweep in range(SWEEPS):
            for layer in self.layers if sweep % 2 == 0 else reversed(self.layers):
                wanted = [self._wanted(item) for item in layer]
                for item, y in zip(layer, _spread(layer, wanted), strict=True):
                    item.y = y

    def _wanted(self, item: Item) -> float:
        """Return where an item would stand if it stood alone: by what leads to it, else by where it leads."""
        if isinstance(item, Lane):
            return self._wanted_lane(item)
        into, out = [], []
        for wire in (one for one in self.wires if not self.back(one)):
            way = self._way(wire)
            if self.boxes[wire.target] is item:
                into.append(way[-2] - way[-1])
            if self.boxes[wire.source] is item:
                out.append(way[1] - way[0])
        moves = into or out
        return item.y + (sum(moves) / len(moves) if moves else 0.0)

    def _way(self, wire: Wire) -> list[float]:
        """Return the y of a wire at its ends and in its lanes."""
        return [self.start(wire), *(one.y + LANE / 2.0 for one in self.lanes[wire]), self.end(wire)]

    def _wanted_lane(self, lane: Lane) -> float:
        """Return where a lane would stand: in line with its wire; below the ends of one that feeds back."""
        wire = lane.wire
        if lane.back:
            ends = self.boxes[wire.source], self.boxes[wire.target]
            return max(*(one.y for one in self.lanes[wire]), *(box.y + box.height for box in ends))
        way = self._way(wire)
        place = self.lanes[wire].index(lane) + 1
        return (way[place - 1] + way[place + 1]) / 2.0 - LANE / 2.0


def _closing(roots: Sequence[str], after: dict[str, list[str]]) -> tuple[set[tuple[str, str]], list[str]]:
    """Return the edges that close a ring on the way from some roots, and an order without them."""
    closing: set[tuple[str, str]] = set()
    done: list[str] = []
    seen: set[str] = set()
    for root in roots:
        stack = [] if root in seen else [(root, iter(after[root]))]
        seen.add(root)
        while stack:
            name, edges = stack[-1]
            target = next(edges, None)
            if target is None:
                done.append(name)
                stack.pop()
            elif target in (one for one, _ in stack):
                closing.add((name, target))
            elif target not in seen:
                seen.add(target)
                stack.append((target, iter(after[target])))
    return closing, done[::-1]


def _spread(items: Sequence[Item], wanted: Sequence[float]) -> list[float]:
    """Return places without overlap, in order, as near as can be (least squares) to those wanted.

    With the items' heights taken off it is a monotone regression: neighbours that would overlap are pooled.
    """
    taken, at = [], 0.0
    for i, item in enumerate(items):
        taken.append(at)
        following = items[i + 1] if i + 1 < len(items) else item
        lanes = isinstance(item, Lane), isinstance(following, Lane)
        at += item.height + (0.0 if all(lanes) else GAP / 2.0 if any(lanes) else GAP)
    pools: list[list[float]] = []  # mean, count
    for y, below in zip(wanted, taken, strict=True):
        pools.append([y - below, 1.0])
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            mean, count = pools.pop()
            last = pools[-1]
            last[0] = (last[0] * last[1] + mean * count) / (last[1] + count)
            last[1] += count
    flat = [mean for mean, count in pools for _ in range(int(count))]
    return [mean + below for mean, below in zip(flat, taken, strict=True)]
