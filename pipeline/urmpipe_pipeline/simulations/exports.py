"""What leaves of a simulation: every signal, and the tip of each arm as a trajectory."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from urmpipe_models.errors import Finding, Hint, RecordingError
from urmpipe_pipeline.presentation.exports import ExportColumn, Exports, ExportTable, Poses, Rows, Times
from urmpipe_pipeline.runs.exports import export_metadata, poses_by_kinematics
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.text import drop_surrogates


def exports(simulation: Simulation) -> Exports:
    """Return what can leave of a simulation."""
    about = export_metadata(simulation.name, simulation.provenance) | {
        "description": simulation.description,
        "step": simulation.step,
        "failed": simulation.failed,
        "verdict": simulation.verdict,
        "verdicts": [one.to_dict() for one in simulation.verdicts],
        "system": simulation.system_text,
    }
    rows = Rows(partial(simulation_table, simulation), partial(_fields, simulation))
    return Exports("simulation", about, {"simulated": rows}, {"": lambda rows: _poses(simulation)}, {})


def simulation_table(simulation: Simulation) -> ExportTable:
    """Return every signal of a simulation, a column a scalar: t, then `block.variable` with its unit."""
    columns = [ExportColumn("t [s]", "s", Times(simulation.t_ns, "s"))]
    for one in simulation.signals:
        unit = drop_surrogates(one.unit)
        behind = f" [{unit}]" if unit else ""
        columns += [
            ExportColumn(f"{drop_surrogates(name)}{behind}", unit, np.ascontiguousarray(values))
            for name, values in zip(one.names, one.columns.T, strict=True)
        ]
    return ExportTable(tuple(columns), simulation.t_ns)


def _fields(simulation: Simulation, table: ExportTable) -> dict[str, Any]:
    """Return the fields of a simulation in the units of its signals: a column a scalar, and their names.

    The system file and why it failed stand in the metadata, in ASCII.
    """
    signals = [column for column in table.columns if not isinstance(column.values, Times)]
    values = [np.asarray(column.values) for column in signals]
    return {
        "name": drop_surrogates(simulation.name),
        "t": simulation.t[:, np.newaxis],  # a vector without a row would be written as 0 x 0
        "clock_ns": simulation.t_ns[:, np.newaxis],
        "values": np.column_stack(values) if values else np.empty((len(simulation.t_ns), 0)),
        "names": [column.name for column in signals],
        "units": [column.unit for column in signals],
    }


def _poses(simulation: Simulation) -> list[Poses]:
    """Return the trajectory of the tip of each arm."""
    where = str(simulation.recording) if simulation.recording else simulation.name
    if not simulation.arms:
        hint = Hint("to", "csv", "writes its signals")
        raise RecordingError(Finding("no block of kinematics, so no pose", where, hints=(hint,)))
    several = len(simulation.arms) > 1
    return [
        poses_by_kinematics(arm.block if several else "", arm.chain, simulation.t_ns, arm.q, where)
        for arm in simulation.arms
    ]
