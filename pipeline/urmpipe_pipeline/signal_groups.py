"""Which signals of a simulation share a plot, and their colours: the same in the viewer and in the report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

from urmpipe_pipeline.delta_verdict import DeltaVerdict
from urmpipe_pipeline.display_unit import display_unit
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS
from urmpipe_pipeline.simulation import Signal, Simulation

MOST = len(JOINT_COLOURS)
"""Lines in a plot, so that each has a colour of its own; only an array that has more gets more."""

NAMED = 3
"""Variables that the title of a plot names; of more, the first and the last."""


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Signals of one block in one unit, which share a plot.

    Attributes:
        block: Name of the block.
        unit: Their unit; empty for numbers without one.
        signals: At least one.
        verdict: The verdict on them, if they are what a delta meter is judged by.
    """

    block: str
    unit: str
    signals: tuple[Signal, ...]
    verdict: DeltaVerdict | None = None

    @property
    def variables(self) -> str:
        """What is plotted: "theta1, theta2", or "Mk ... i" of many."""
        names = [one.variable for one in self.signals]
        return ", ".join(names) if len(names) <= NAMED else f"{names[0]} ... {names[-1]}"

    @property
    def bracket(self) -> str:
        """The unit as it stands behind a name: rad, or - for numbers without one."""
        return self.unit or "-"

    @property
    def shown(self) -> tuple[str, float]:
        """The unit that people like to see them in, if all have the same, and how many of it one unit is."""
        wanted = {one.display_unit for one in self.signals}
        return display_unit(self.unit, wanted.pop() if len(wanted) == 1 else "")

    @property
    def colours(self) -> tuple[tuple[str, ...], ...]:
        """The colour of each scalar as #rrggbb, by signal: of three coordinates those of the axes."""
        widths = [one.columns.shape[1] for one in self.signals]
        spatial = self.verdict is not None or widths == [3]
        palette = tuple(AXIS_COLOURS.values()) if spatial else JOINT_COLOURS
        starts = [sum(widths[:i]) for i in range(len(widths))]
        return tuple(
            tuple(palette[(start + k) % len(palette)] for k in range(width))
            for start, width in zip(starts, widths, strict=True)
        )


def groups_of(simulation: Simulation) -> list[Group]:
    """Return the groups of all signals, by block in the order in which the blocks first stand."""
    blocks = dict.fromkeys(one.block for one in simulation.signals)
    return [group for block in blocks for group in _groups_of_block(simulation, block)]


def _groups_of_block(simulation: Simulation, block: str) -> Iterator[Group]:
    """Yield what is judged first, then the other signals by unit."""
    verdict = next((one for one in simulation.verdicts if one.block == block), None)
    own = [one for one in simulation.signals if one.block == block]
    judged = [one for one in own if verdict is not None and one.variable in verdict.variables]
    if judged:
        yield Group(block, judged[0].unit, tuple(judged), verdict)
    others = [one for one in own if one not in judged]
    order = list(dict.fromkeys(one.unit for one in others))
    others.sort(key=lambda one: order.index(one.unit))
    for unit, signals in groupby(others, key=lambda one: one.unit):
        yield from (Group(block, unit, some) for some in _packed(list(signals)))


def _packed(signals: list[Signal]) -> Iterator[tuple[Signal, ...]]:
    """Yield as many signals at a time as a plot has colours for."""
    some: list[Signal] = []
    lines = 0
    for one in signals:
        width = one.columns.shape[1]
        if some and lines + width > MOST:
            yield tuple(some)
            some, lines = [], 0
        some.append(one)
        lines += width
    yield tuple(some)
