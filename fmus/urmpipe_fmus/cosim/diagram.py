"""What a drawing of a system shows: boxes with their ports, and lines between them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from urmpipe_fmus.cosim.checks import Start
from urmpipe_fmus.cosim.interface import ELEMENT, Interface
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


def _spelled(start: Start) -> str:
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
