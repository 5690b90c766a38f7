"""A co-simulation in the terminal: how it ended, the verdicts, the extremes of its signals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe.printing.columns import Column, print_columns
from urmpipe.printing.terminal import judged_line, new_console, new_table, say
from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.wording import meter_words
from urmpipe_pipeline.simulations.simulation import Signal, Simulation, extremes

if TYPE_CHECKING:
    from rich.console import Console

    from urmpipe_fmus.cosim.system import System


SHOWN = 12
"""Signals whose extremes are printed; the others are counted."""


AT_ONCE = 5
"""As many as a delta meter has: x, y, z, norm, and whether they are tolerated."""

_Row = tuple[str, str, FloatArray]
"""Name, unit and values of a scalar signal."""


def print_simulation(result: Simulation, wall: float) -> None:
    """Print what was simulated and how fast, each verdict, and the extremes of each output.

    Args:
        result: The simulation.
        wall: What it took in [s].
    """
    console = new_console()
    console.print(_head(result, wall), soft_wrap=True)
    for one in result.verdicts:
        console.print(judged_line(one.verdict, f"{one.block}: {meter_words(one)}"), soft_wrap=True)
    _print_extremes(console, result)


def _head(result: Simulation, wall: float) -> str:
    """Return how long it is, in which steps, and how fast it was."""
    step = f"communication step {1e3 * result.step:.6g} ms"
    faster = f", {result.duration / wall:.3g} times faster than real time" if result.duration > wall else ""
    samples = text.counted(len(result.t_ns), "sample")
    if len(result.t_ns) > 1 and (period := result.duration / (len(result.t_ns) - 1)) > 1.5 * result.step:
        step += f", a sample every {1e3 * period:.6g} ms"
    return f"{result.name}: {samples} over {text.seconds(result.duration)} s, {step}; in {wall:.2g} s{faster}"


def _print_extremes(console: Console, result: Simulation) -> None:
    """Print the least and the largest value of some signals of every block; those that stand still last."""
    rows = list(_by_turns(result))
    if not rows or not len(result.t_ns):
        return
    blocks = list(dict.fromkeys(block for block, _ in rows))
    shown = sorted(rows[:SHOWN], key=lambda one: (_stands_still(one[1]), blocks.index(one[0])))
    print_columns(console, "Signals", list(_columns([row for _, row in shown], result.t)))
    if len(rows) > SHOWN:
        console.print(f"... and {len(rows) - SHOWN} more; --json has all, and the recording")


def _by_turns(result: Simulation) -> list[tuple[str, _Row]]:
    """Return every scalar with its block: some of each block in turns, what stands still behind the rest.

    The blocks come first whose outputs no other block takes, which judge or end the system, with `AT_ONCE`
    rows a turn; of the others one a turn, first what another block takes of them.
    """
    taken = set(result.connections.values())
    inner = {source.partition(".")[0] for source in taken}
    turns: list[tuple[bool, int, bool, str, _Row]] = []
    signals = sorted(result.signals, key=lambda one: taken.isdisjoint((one.name, *one.names)))
    for block in dict.fromkeys(one.block for one in result.signals):
        rows = [row for one in signals if one.block == block for row in _scalars(one)]
        rows.sort(key=_stands_still)
        at_once = 1 if block in inner else AT_ONCE
        turns += [
            (_stands_still(row), k // at_once, block in inner, block, row) for k, row in enumerate(rows)
        ]
    return [(block, row) for *_, block, row in sorted(turns, key=lambda one: one[:3])]


def _stands_still(row: _Row) -> bool:
    return not len(row[2]) or bool(np.ptp(row[2]) == 0.0)


def _scalars(signal: Signal) -> Iterator[_Row]:
    """Yield name, unit and values of each scalar of a signal."""
    for name, values in zip(signal.names, signal.columns.T, strict=True):
        yield name, signal.unit, values


def _columns(rows: Sequence[_Row], t: FloatArray) -> Iterator[Column]:
    """Yield the columns of the table: a row a scalar."""
    found = [extremes(values, t) for _, _, values in rows]
    yield Column("Signal", [f"{name} [{unit}]" if unit else name for name, unit, _ in rows], key=True)
    for head, key, form in (
        ("first", "first", _number), ("min", "min", _number), ("at t [s]", "t_min", _time),
        ("max", "max", _number), ("at t [s]", "t_max", _time), ("last", "last", _number),
    ):  # fmt: skip
        yield Column(head, [form(one[key]) for one in found])


def _number(value: float | None) -> str | None:
    return None if value is None else f"{value + 0.0:.6g}"  # + 0.0: no -0


def _time(value: float | None) -> str | None:
    return None if value is None else text.seconds(value)


def print_systems(systems: Sequence[System]) -> None:
    """Print the shipped systems: a line each, and their arguments."""
    table = new_table("System", "What it is", "--set", title="Systems")
    for one in systems:
        table.add_row(one.name, one.description, "\n".join(f"{k}={v}" for k, v in one.arguments.items()))
    new_console().print(table)
    say("Run one: urmpipe simulate SYSTEM [--set NAME=VALUE]")
    say("Change anything else of it: urmpipe simulate SYSTEM --write-system FILE.toml")
