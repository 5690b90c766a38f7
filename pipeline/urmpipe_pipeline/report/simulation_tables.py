"""The tables of a simulation: verdicts, blocks, connections, parameters and start values, signals."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.delta_verdict import DeltaVerdict
from urmpipe_pipeline.comparison.symbols import SYMBOLS
from urmpipe_pipeline.report.tables import Cell, Column, Table, judged, listing, numbers, words
from urmpipe_pipeline.simulations.simulation import Signal, Simulation, extremes


def simulations_table(simulations: Sequence[Simulation], links: Sequence[str]) -> Table:
    """Return one line a simulation."""
    columns = (
        *words("System", "Verdict"),
        *numbers("Blocks", "Signals", "Samples", "Duration [s]", "Communication step [s]", "Warnings"),
    )
    rows = tuple(
        (
            Cell(one.name, href=link),
            judged(one.verdict),
            Cell(str(len(one.blocks))),
            Cell(str(sum(signal.columns.shape[1] for signal in one.signals))),
            Cell(str(len(one.t_ns))),
            Cell(text.seconds(one.duration)),
            Cell(text.seconds(one.step)),
            Cell(str(len(one.warnings))),
        )
        for one, link in zip(simulations, links, strict=True)
    )
    return Table("What was simulated", columns, rows)


def meters_table(verdicts: Sequence[DeltaVerdict]) -> Table:
    """Return what each delta meter found."""
    columns = (
        Column("Delta meter"),
        *numbers("Worst [mm]", "Allowed [mm]"),
        Column("Of"),
        *numbers("At t [s]", "Sample", "Out of tolerance", "Samples"),
        Column("Verdict"),
    )
    rows = tuple(
        (
            Cell(one.block),
            Cell(text.millimetres(one.worst, one.allowed)),
            Cell(text.limit(one.allowed)),
            Cell(SYMBOLS[one.quantity]),
            Cell(text.seconds(one.t)),
            Cell(str(one.sample)),
            Cell(f"{one.out_of_tolerance} ({text.percent(one.share_out)})"),
            Cell(str(one.samples)),
            judged(one.verdict),
        )
        for one in verdicts
    )
    return Table("Delta meters", columns, rows)


def blocks_table(simulation: Simulation) -> Table:
    """Return what the blocks are, and by which content they are known again."""
    rows = [(one.name, one.kind, one.source, one.content, one.description) for one in simulation.blocks]
    columns = words("Block", "Kind", "Which", "GUID or hash", "Description")
    return listing(f"Blocks ({len(rows)})", columns, rows)


def connections_table(simulation: Simulation) -> Table:
    """Return where each input gets its values from."""
    rows = list(simulation.connections.items())
    return listing(f"Connections ({len(rows)})", words("Input", "From"), rows, folded=True)


def settings_table(simulation: Simulation) -> Table:
    """Return the parameters and start values of all blocks."""
    columns = (
        *words("Variable", "Part"), Column("Value", number=True), *words("Unit", "Given by"),
    )  # fmt: skip
    rows = [
        (
            f"{block.name}.{one.variable}",
            one.causality,
            f"{one.value:.10g}",
            one.unit or text.NOTHING,
            "the system" if one.given else "the block",
        )
        for block in simulation.blocks
        for one in block.settings
    ]
    return listing(f"Parameters and start values ({len(rows)})", columns, rows)


def signals_table(simulation: Simulation) -> Table:
    """Return the ends and the extremes of every scalar signal."""
    columns = (
        *words("Signal", "Unit"),
        *numbers("First", "Last", "Least", "at t [s]", "Largest", "at t [s]"),
    )
    rows = [row for one in simulation.signals for row in _signal_rows(one, simulation)]
    return listing(f"Signals ({len(rows)})", columns, rows, folded=True)


def _signal_rows(one: Signal, simulation: Simulation) -> list[tuple[str, ...]]:
    rows = []
    for name, values in zip(one.names, one.columns.T, strict=True):
        found = extremes(values, simulation.t)
        cells = (
            text.NOTHING if value is None else text.seconds(value) if key.startswith("t_") else f"{value:.6g}"
            for key, value in found.items()
        )
        rows.append((name, one.unit or text.NOTHING, *cells))
    return rows
