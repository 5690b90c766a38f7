"""The tables of a simulation: verdicts, blocks, connections, settings, the extremes of its signals."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import overload

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.verdict import SYMBOLS, DeltaMeterResult
from urmpipe_pipeline.presentation.parts import Heads, columns_of, table_of
from urmpipe_pipeline.presentation.section import Cell, Judged, Ref, Table, Value
from urmpipe_pipeline.simulations.simulation import Signal, Simulation, extremes

FIRST = 12
"""Signals whose extremes are read first."""

AT_ONCE = 5
"""As many as a delta meter has: x, y, z, norm, and whether they are tolerated."""

PLACE = 3
"""As many as the tip of an arm has: x, y, z."""

POINT = re.compile(r"p(\d+)")
"""The points of an arm, from its base outwards."""


def meters_table(simulation: Simulation) -> Iterator[Table]:
    """Yield what each delta meter found, if there is one."""
    heads: Heads[DeltaMeterResult] = {
        "block": ("Delta meter", lambda one: Ref(one.block)),
        "verdict": ("Verdict", lambda one: Judged(one.verdict)),
        "quantity": ("of", lambda one: SYMBOLS[one.quantity]),
        "worst": ("worst", lambda one: Value(one.worst, "m", one.allowed, one.verdict, one.utilisation)),
        "allowed": ("allowed", lambda one: Value(one.allowed, "m", given=True)),
        "t": ("at t", lambda one: Value(one.t, "s")),
        "sample": ("sample", lambda one: Value(one.sample)),
        "out_of_tolerance": ("samples out", lambda one: Value(one.out_of_tolerance)),
        "out_fraction": ("out", lambda one: Value(one.out_fraction, "%")),
        "samples": ("samples", lambda one: Value(one.samples)),
    }
    if simulation.verdicts:
        yield Table("Delta meters", columns_of(simulation.verdicts, heads))


def blocks_table(simulation: Simulation) -> Table:
    """Return what the blocks are, and by which content they are known again."""
    rows = [(one.name, one.kind, one.source, one.content, one.description) for one in simulation.blocks]
    heads = {
        "name": "Block", "kind": "Kind", "source": "Which", "content": "GUID or hash",
        "description": "Description",
    }  # fmt: skip
    return table_of(f"Blocks ({len(rows)})", heads, rows)


def connections_table(simulation: Simulation) -> Table:
    """Return where each input gets its values from."""
    rows = list(simulation.connections.items())
    return table_of(f"Connections ({len(rows)})", {"input": "Input", "from": "From"}, rows, folded=True)


def settings_table(simulation: Simulation) -> Table:
    """Return the parameters and start values of all blocks."""
    by = {True: "the system", False: "the block"}
    rows = [
        (f"{block.name}.{one.variable}", one.causality, f"{one.value:.10g}", one.unit, by[one.from_system])
        for block in simulation.blocks
        for one in block.settings
    ]
    heads = {
        "variable": "Variable", "causality": "Part", "value": "Value", "unit": "Unit", "given": "Given by",
    }  # fmt: skip
    return table_of(f"Parameters and start values ({len(rows)})", heads, rows)


@dataclass(frozen=True, eq=False)
class Scalar:
    """A scalar of a signal, whose extremes are computed when they are shown.

    Attributes:
        block: Its block.
        name: Its name in the system.
        unit: Its unit; empty for none.
        values: In its unit, shape (n,).
        t: Times in [s], shape (n,).
    """

    block: str
    name: str
    unit: str
    values: FloatArray
    t: FloatArray

    @cached_property
    def extremes(self) -> dict[str, float | None]:
        """First, last, least and largest value, and when the latter stand."""
        return extremes(self.values, self.t)

    @cached_property
    def constant(self) -> bool:
        """Whether it never changes."""
        return not len(self.values) or bool(np.ptp(self.values) == 0.0)


def signals_table(simulation: Simulation) -> Table:
    """Return the ends and the extremes of every scalar signal."""
    scalars = list(_scalars(simulation, simulation.signals))
    return Table(f"Signals ({len(scalars)})", columns_of(scalars, _heads()), folded=True)


def first_signals_table(simulation: Simulation) -> Iterator[Table]:
    """Yield the same of some signals of every block; those that never change come last."""
    if len(simulation.t_ns) and simulation.signals:
        first = FirstSignals(simulation)
        more = first.total - len(first)
        note = f"{more} more signals: in the recording, and in the JSON output." if more > 0 else ""
        yield Table("Signals", columns_of(first, _heads()), note)


class FirstSignals(Sequence[Scalar]):
    """The signals that are read first, chosen when they are shown: that looks at all values.

    Of each block the first scalar, of those whose outputs no other block takes, which end the system, the
    first `PLACE`, of those which judge it `AT_ONCE`; then one more of each a turn. What another block takes
    comes first, then the tip of an arm, its inner points last.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self.total: int = sum(one.columns.shape[1] for one in simulation.signals)

    def __len__(self) -> int:
        return min(FIRST, self.total)

    @overload
    def __getitem__(self, index: int) -> Scalar: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[Scalar]: ...

    def __getitem__(self, index: int | slice) -> Scalar | Sequence[Scalar]:
        return self._chosen[index]

    @cached_property
    def _chosen(self) -> list[Scalar]:
        turns = sorted(self._turns(), key=lambda one: one[:3])
        blocks = list(dict.fromkeys(one.block for *_, one in turns))
        chosen = [one for *_, one in turns[:FIRST]]
        return sorted(chosen, key=lambda one: (one.constant, blocks.index(one.block)))

    def _turns(self) -> Iterator[tuple[bool, int, bool, Scalar]]:
        """Yield every scalar behind what it is ordered by."""
        found = self._simulation
        taken = set(found.connections.values())
        inner = {source.partition(".")[0] for source in taken}
        judges = {one.block for one in found.verdicts}
        for block in dict.fromkeys(one.block for one in found.signals):
            signals = _outermost_first([one for one in found.signals if one.block == block])
            signals.sort(key=lambda one: taken.isdisjoint((one.name, *one.names)))
            own = sorted(_scalars(found, signals), key=lambda one: one.constant)
            first = AT_ONCE if block in judges else 1 if block in inner else PLACE
            turns = (max(k - first + 1, 0) for k in range(len(own)))
            yield from (
                (one.constant, turn, block in inner, one) for turn, one in zip(turns, own, strict=True)
            )


def _outermost_first(signals: Sequence[Signal]) -> list[Signal]:
    """Return the signals of a block, the last point of an arm first, the others from the tip inwards last."""
    numbers = {id(one): int(found[1]) for one in signals if (found := POINT.fullmatch(one.variable))}
    tip = max(numbers.values(), default=0)

    def place(one: Signal) -> tuple[int, int]:
        """Return the rank of a signal."""
        number = numbers.get(id(one))
        return (1, 0) if number is None else (0 if number == tip else 2, -number)

    return sorted(signals, key=place)


def _scalars(simulation: Simulation, signals: Sequence[Signal]) -> Iterator[Scalar]:
    """Yield the scalars of some signals."""
    t = simulation.t
    for signal in signals:
        for name, values in zip(signal.names, signal.columns.T, strict=True):
            yield Scalar(signal.block, name, signal.unit, values, t)


def _heads() -> Heads[Scalar]:
    """Return the columns of the extremes, by their keys."""

    def number(key: str) -> Callable[[Scalar], Cell]:
        return lambda one: Value(one.extremes[key], "s" if key.startswith("t_") else "")

    keys = ("first", "min", "t_min", "max", "t_max", "last")
    return {
        "name": ("Signal", lambda one: one.name),
        "unit": ("Unit", lambda one: one.unit),
        **{key: ("at t" if key.startswith("t_") else key, number(key)) for key in keys},
    }
