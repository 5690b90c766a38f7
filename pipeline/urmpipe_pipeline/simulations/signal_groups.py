"""Which signals of a simulation share a plot, and their colours: set points and answers, those of a block."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.verdict import DeltaMeterResult
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, JOINT_COLOURS, REFERENCE_COLOUR
from urmpipe_pipeline.simulations.simulation import Signal, Simulation

MOST = len(JOINT_COLOURS)
"""Lines in a plot, so that each has a colour of its own; only an array that has more gets more."""

NAMED = 3
"""Names in the title of a plot; of more, the first and the last."""

FAMILY = 3
"""So many blocks of one kind with the same variables are plotted together, variable by variable."""

SET, REAL = "set_", "real_"
"""How the two inputs of a controller begin whose rests agree: set_theta, real_theta."""

ANSWERS = "Set point and answer"
"""What the plots of what a controller is to hold and what it measures are called."""


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Signals in one unit which share a plot: those of a block, or one variable of several like blocks.

    Attributes:
        block: Name of the block, or "drive1 ... drive6" of several.
        unit: Their unit; empty for numbers without one.
        signals: At least one.
        verdict: The verdict on them, if they are what a delta meter is judged by.
        family: Whether they are of several blocks.
        wanted: How many of the first signals are set points of the others, drawn in the reference's grey.
    """

    block: str
    unit: str
    signals: tuple[Signal, ...]
    verdict: DeltaMeterResult | None = None
    family: bool = False
    wanted: int = 0

    @property
    def variables(self) -> str:
        """What is plotted: "theta1, theta2", or "Mk ... i" of many."""
        return shortened([array_name(one.variable) for one in self.signals])

    @property
    def names(self) -> tuple[tuple[str, ...], ...]:
        """What the legend calls each scalar, by signal: with its block where there are several."""
        return tuple(one.names if self.family else one.variables for one in self.signals)

    @property
    def display_unit(self) -> str:
        """The unit that people like to see all of them in; empty where they differ."""
        wanted = {one.display_unit for one in self.signals}
        return wanted.pop() if len(wanted) == 1 else ""

    @property
    def shown(self) -> tuple[str, float]:
        """The unit that they are shown in, and how many of it one of their own is."""
        return text.choose_unit(self.unit, self.display_unit)

    @property
    def colours(self) -> tuple[tuple[str, ...], ...]:
        """The colour of each scalar as #rrggbb, by signal: of three coordinates those of the axes."""
        widths = [one.columns.shape[1] for one in self.signals]
        spatial = self.verdict is not None or widths == [3]
        palette = tuple(AXIS_COLOURS.values()) if spatial else JOINT_COLOURS
        starts = [sum(widths[self.wanted : i]) for i in range(self.wanted, len(widths))]
        grey = tuple((REFERENCE_COLOUR,) * width for width in widths[: self.wanted])
        coloured = (
            tuple(palette[(start + k) % len(palette)] for k in range(width))
            for start, width in zip(starts, widths[self.wanted :], strict=True)
        )
        return (*grey, *coloured)


def groups_of(simulation: Simulation) -> list[Group]:
    """Return the groups of all signals but energies, by block in the order of their first signals."""
    families = _families(simulation)
    found: list[Group] = []
    for block in dict.fromkeys(one.block for one in simulation.signals):
        family = next((one for one in families if block in one), None)
        if family is None:
            found += _groups_of_block(simulation, block)
        elif block == family[0]:
            found += _groups_of_family(simulation, family)
    return found


def _plotted(simulation: Simulation, blocks: Collection[str]) -> list[Signal]:
    """Return the signals of some blocks; energies stand in the balance of all blocks."""
    return [one for one in simulation.signals if one.block in blocks and not one.is_energy]


def _families(simulation: Simulation) -> list[list[str]]:
    """Return the names of blocks of one kind that recorded the same variables; none that is judged."""
    judged = {one.block for one in simulation.verdicts}
    kinds: dict[object, list[str]] = {}
    for block in simulation.blocks:
        own = tuple(
            (one.variable, one.unit, one.columns.shape[1]) for one in _plotted(simulation, [block.name])
        )
        if own and block.name not in judged:
            kinds.setdefault((block.kind, block.source, own), []).append(block.name)
    return [names for names in kinds.values() if len(set(names)) >= FAMILY]


def _groups_of_family(simulation: Simulation, family: list[str]) -> Iterator[Group]:
    """Yield the signals of several blocks, variable by variable."""
    label = f"{family[0]} ... {family[-1]}"
    members = _plotted(simulation, family)
    for variable in dict.fromkeys(one.variable for one in members):
        some = [one for one in members if one.variable == variable]
        yield from (Group(label, some[0].unit, packed, None, True) for packed in _packed(some))


def _groups_of_block(simulation: Simulation, block: str) -> Iterator[Group]:
    """Yield what is judged first, then the other signals by unit."""
    verdict = next((one for one in simulation.verdicts if one.block == block), None)
    own = _plotted(simulation, [block])
    judged = [one for one in own if verdict is not None and one.variable in verdict.variables]
    if judged:
        yield Group(block, judged[0].unit, tuple(judged), verdict)
    others = [one for one in own if one not in judged]
    for unit in dict.fromkeys(one.unit for one in others):
        same = [one for one in others if one.unit == unit]
        yield from (Group(block, unit, packed) for packed in _packed(same))


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


def answers_of(simulation: Simulation) -> list[Group]:
    """Return the groups of what controllers are to hold and what they measure, one a quantity and unit.

    A block with an input set_NAME that is recorded, or connected to a recorded signal, is such a controller.
    It measures its input real_NAME; without one, its own output NAME.
    """
    signals = {one.name: one for one in simulation.signals}
    sources = {**{name: name for name in signals}, **simulation.connections}
    pairs: dict[tuple[str, str], list[tuple[Signal, Signal]]] = {}
    for name, source in sources.items():
        block, _, variable = name.rpartition(".")
        if not variable.startswith(SET):
            continue
        quantity = variable.removeprefix(SET)
        measured = sources.get(f"{block}.{REAL}{quantity}", f"{block}.{quantity}")
        wanted, real = _recorded(signals, source), _recorded(signals, measured)
        if wanted is not None and real is not None and wanted.unit == real.unit:
            pairs.setdefault((array_name(quantity), real.unit), []).append((wanted, real))
    return [_answers(unit, some) for (_, unit), some in pairs.items()]


def shortened(names: Sequence[str]) -> str:
    """Return some names for a title, each once: "theta1, theta2", or "Mk ... i" of many."""
    own = list(dict.fromkeys(names))
    return ", ".join(own) if len(own) <= NAMED else f"{own[0]} ... {own[-1]}"


def array_name(variable: str) -> str:
    """Return the name of the array that a scalar is an element of: phi of phi[1]; else its own."""
    return variable.partition("[")[0]


def _recorded(signals: Mapping[str, Signal], name: str) -> Signal | None:
    """Return the signal, or the element of an array, of a name in the system; None if there is none."""
    whole = signals.get(array_name(name))
    if name in signals or whole is None or name not in whole.names:
        return signals.get(name)
    i = whole.names.index(name)
    return replace(whole, variable=whole.variables[i], values=whole.columns[:, i])


def _answers(unit: str, pairs: list[tuple[Signal, Signal]]) -> Group:
    """Return the set points, each once, and behind them the answers."""
    wanted = tuple({one.name: one for one, _ in pairs}.values())
    real = tuple({one.name: one for _, one in pairs}.values())
    return Group(ANSWERS, unit, (*wanted, *real), family=True, wanted=len(wanted))
