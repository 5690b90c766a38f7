"""Where the boxes of a diagram stand, and which way its wires go.

Boxes stand in layers from left to right, so that wires lead to the right but for those that feed back. A wire
has a level lane in each layer that it passes, one that feeds back in all layers from its source back to its
target, below both; between the layers wires are curves. Within a layer boxes and lanes are as near as can be
to what they are wired with.

Source: K. Sugiyama, S. Tagawa, M. Toda, Methods for visual understanding of hierarchical system structures,
IEEE Trans. SMC 11 (1981), 109-125.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from typing import TypeAlias

from urmpipe_fmus.cosim.diagram import Box, Diagram, Wire

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
