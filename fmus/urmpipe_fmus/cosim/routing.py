"""The way of each wire between the layers: straight lines, turned in the channels between them.

In a channel each wire that turns has a track, so that no two run along each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from urmpipe_fmus.cosim.diagram import Box, Wire
from urmpipe_fmus.cosim.layout import LANE, Layout

TRACK, SIDE = 9.0, 22.0
"""Between two tracks, and between a box and the first track, in [px]."""

STRAIGHT = 0.75
"""Ends that differ by less, in [px], are joined by a straight line."""


Shape = Literal["out", "through", "in"]
"""Of a turn: both ends to its left (where a wire that feeds back leaves a box), one at each side, or both to
its right."""


@dataclass(slots=True, eq=False)
class Turn:
    """A wire's way through a channel.

    Attributes:
        left: The y of the end to its left in [px]; of two at one side, where the wire comes from.
        right: The y of the other end.
        shape: At which sides its ends are.
        track: Number of its track, from the left.
    """

    left: float
    right: float
    shape: Shape = "through"
    track: int = 0

    @property
    def low(self) -> float:
        """The upper end of its track in [px]."""
        return min(self.left, self.right)

    @property
    def high(self) -> float:
        """The lower end of its track in [px]."""
        return max(self.left, self.right)

    @property
    def straight(self) -> bool:
        """Whether it needs no track."""
        return self.shape == "through" and self.high - self.low < STRAIGHT

    @property
    def rank(self) -> tuple[int, float, float]:
        """Where its track is among others, so that they cross little.

        Wires that turn around go about each other, the wider about the narrower. Of those that go down the
        upper one turns last, of those that go up first.
        """
        if self.shape != "through":
            return (0, self.high - self.low, 0.0) if self.shape == "out" else (3, self.low - self.high, 0.0)
        return (1, self.left, self.right) if self.right <= self.left else (2, -self.left, -self.right)


@dataclass(frozen=True, slots=True)
class Routes:
    """The points of each wire, and the size of all, in [px]."""

    points: dict[Wire, list[tuple[float, float]]]
    width: float
    height: float


def route(layout: Layout) -> Routes:
    """Set the x of a layout's boxes, and return the ways of its wires."""
    turns = {wire: _turns(layout, wire) for wire in layout.wires}
    channels: dict[int, list[Turn]] = {c: [] for c in range(-1, len(layout.layers))}
    for way in turns.values():
        for channel, turn in way:
            channels[channel].append(turn)
    edges, x = {}, 0.0
    for channel in range(-1, len(layout.layers)):
        count = _assign(channels[channel])
        used = bool(channels[channel]) or 0 <= channel < len(layout.layers) - 1
        edges[channel] = x + SIDE
        x += 2.0 * SIDE + TRACK * max(count - 1, 0) if used else 0.0
        if channel + 1 < len(layout.layers):
            boxes = [one for one in layout.layers[channel + 1] if isinstance(one, Box)]
            width = max((box.width for box in boxes), default=0.0)
            for box in boxes:
                box.x = x + (width - box.width) / 2.0
            x += width
    points = {wire: _points(layout, wire, way, edges) for wire, way in turns.items()}
    height = max(item.y + item.height for layer in layout.layers for item in layer)
    return Routes(points, x, height)


def _turns(layout: Layout, wire: Wire) -> list[tuple[int, Turn]]:
    """Return the channels that a wire goes through: channel c is to the right of layer c."""
    ys = [layout.start(wire), *(lane.y + LANE / 2.0 for lane in layout.lanes[wire]), layout.end(wire)]
    first, last = layout.boxes[wire.source].layer, len(ys) - 2
    if not layout.back(wire):
        return [(first + i, Turn(ys[i], ys[i + 1])) for i in range(last + 1)]
    between = [(first - i, Turn(ys[i + 1], ys[i])) for i in range(1, last)]
    ends = Turn(ys[0], ys[1], "out"), Turn(ys[-2], ys[-1], "in")
    return [(first, ends[0]), *between, (first - last, ends[1])]


def _assign(turns: list[Turn]) -> int:
    """Give each turn of a channel a track; return how many there are."""
    placed: list[Turn] = []
    for turn in sorted((one for one in turns if not one.straight), key=lambda one: one.rank):
        beside = [one.track for one in placed if one.low < turn.high + TRACK and turn.low < one.high + TRACK]
        turn.track = max(beside, default=-1) + 1
        placed.append(turn)
    return max((one.track for one in placed), default=-1) + 1


def _points(
    layout: Layout, wire: Wire, way: list[tuple[int, Turn]], edges: dict[int, float]
) -> list[tuple[float, float]]:
    """Return the corners of a wire."""
    source, target = layout.boxes[wire.source], layout.boxes[wire.target]
    points = [(source.x + source.width, layout.start(wire))]
    for channel, turn in way:
        if not turn.straight:
            x = edges[channel] + TRACK * turn.track
            ends = (
                (turn.left, turn.right)
                if turn.shape != "through" or not layout.back(wire)
                else (turn.right, turn.left)
            )
            points += [(x, y) for y in ends]
    return [*points, (target.x, layout.end(wire))]
