"""What leaves of a comparison: the compared samples and both trajectories of all logs, and criteria."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, RecordingError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES, Deviation
from urmpipe_pipeline.iso9283.result import IsoTest
from urmpipe_pipeline.iso9283.tables import COLUMNS
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.exports import (
    ExportColumn,
    Exports,
    ExportTable,
    Poses,
    Rows,
    Times,
    columns_of,
)
from urmpipe_pipeline.runs.exports import clock_stamps, export_metadata
from urmpipe_pipeline.text import drop_surrogates
from urmpipe_pipeline.trajectories import joint_order

NO_ORIENTATION = LogWarning(
    "no-orientation",
    "a comparison holds positions: every orientation is written as 0 0 0 1, compare translations only",
)


def exports(comparison: Comparison) -> Exports:
    """Return what can leave of a comparison."""
    about = export_metadata(comparison.name, comparison.provenance) | {
        "reference": comparison.reference.name,
        "tolerance": dict(comparison.tolerance),
        "verdict": comparison.verdict,
        "runs": [run.name for run in comparison.runs],
    }
    rows = {"compared": Rows(partial(delta_table, comparison), lambda table: _fields(comparison))}
    if comparison.iso is not None:
        rows["criteria"] = Rows(partial(criteria_table, comparison.iso), partial(_criteria, comparison))
    poses = {"": lambda rows: _poses(comparison)}
    return Exports("comparison", about, rows, poses, {}, (NO_ORIENTATION,))


def delta_table(comparison: Comparison) -> ExportTable:
    """Return the compared samples of all logs, one below the other: deviation, reference and actual in SI.

    Where joints alone are compared, their deviations, under the names that the reference has for them.
    """
    runs = comparison.runs
    names = np.repeat([drop_surrogates(run.name) for run in runs], [len(run.sample) for run in runs])
    columns = [
        ExportColumn("run", "", names),
        ExportColumn("sample", "", np.concatenate([run.sample for run in runs])),
    ]
    timed = all(run.run.timed for run in runs)
    if timed:
        columns.append(ExportColumn("t [s]", "s", Times(np.concatenate([run.t_ns for run in runs]), "s")))
    placed = all(run.statistics for run in runs)
    if not placed:
        joints, units = comparison.reference.joints, comparison.reference.joint_units
        values = np.concatenate([_joint_delta(comparison, run) for run in runs])
        columns += columns_of([f"delta_{name}" for name in joints], units, values)
    for what, axes in (("delta", AXES), ("reference", AXES[:3]), ("actual", AXES[:3])) if placed else ():
        values = np.concatenate([getattr(run, what) for run in runs])
        columns += columns_of([f"{what}_{axis}" for axis in axes], ["m"] * len(axes), values)
    outside = np.concatenate([run.out_of_tolerance for run in runs]).astype(np.int64)
    columns.append(ExportColumn("out_of_tolerance", "", outside))
    clock = np.concatenate([run.run.log.clock_start_ns + run.t_ns for run in runs])
    return ExportTable(tuple(columns), clock if timed else None)


def criteria_table(test: IsoTest) -> ExportTable:
    """Return a row a criterion and place of a test after ISO 9283, then a failed cycle, in SI.

    What is not there is NaN or empty. Each row has its own unit: 1 of a share.
    """
    rows = list(test.rows())
    texts = {
        name: np.array([str(row[name] or "") for row in rows]) for name in ("name", "at", "unit", "verdict")
    }
    numbers = {
        name: np.array([math.nan if row[name] is None else row[name] for row in rows])
        for name in ("value", "tolerance")
    }
    every = texts | numbers | {"cycles": np.array([row["cycles"] for row in rows])}
    columns = (ExportColumn(name, "", every[name]) for name in COLUMNS)
    return ExportTable(tuple(columns), None)


def _criteria(comparison: Comparison, table: ExportTable) -> dict[str, Any]:
    """Return the fields of a table of criteria: its texts as cells, its numbers as arrays."""
    columns = {one.name: np.asarray(one.values) for one in table.columns}
    return {
        "comparison": drop_surrogates(comparison.name),
        "reference": drop_surrogates(comparison.reference.name),
        **{name: values.tolist() if values.dtype.kind == "U" else values for name, values in columns.items()},
    }


def _joint_delta(comparison: Comparison, run: Deviation) -> FloatArray:
    """Return a log's deviations in the order of the reference's joints [rad] or [m], shape (m, joints)."""
    order = joint_order(comparison.reference.joints, run.run.log.joints) or ()
    return np.column_stack(run.values)[:, np.argsort(order)]


def _fields(comparison: Comparison) -> dict[str, Any]:
    """Return the fields of a comparison in SI, with a struct a log in the cell `runs`."""
    return {
        "name": drop_surrogates(comparison.name),
        "reference": drop_surrogates(comparison.reference.name),
        "verdict": comparison.verdict,
        "tolerance": dict(comparison.tolerance),
        "runs": [_deviation(comparison, run) for run in comparison.runs],
    }


def _deviation(comparison: Comparison, run: Deviation) -> dict[str, Any]:
    """Return the fields of a log; where joints alone are compared, their names and deviations."""
    timed, nothing = run.run.timed, np.empty((0, 0))
    joints = [*map(drop_surrogates, comparison.reference.joints)]
    placed = {"delta": run.delta, "reference": run.reference, "actual": run.actual}
    return {
        "name": drop_surrogates(run.name),
        "verdict": run.verdict,
        "sample": run.sample,
        "t": run.t if timed else nothing,
        "clock_ns": run.run.log.clock_start_ns + run.t_ns if timed else nothing,
        **(placed if run.statistics else {"joints": joints, "delta": _joint_delta(comparison, run)}),
        "out_of_tolerance": run.out_of_tolerance,
    }


def _poses(comparison: Comparison) -> list[Poses]:
    """Return the reference and the log at the compared samples of each log, both on the log's clock.

    Raises:
        RecordingError: If joints alone are compared.
    """
    if not comparison.worst.statistics:
        where = str(comparison.recording or comparison.name)
        raise RecordingError(Finding("a comparison of joints alone, so no pose", where))
    found = []
    for one in comparison.runs:
        clock = clock_stamps(one.run, one.t_ns)
        upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(clock), 1))
        prefix = "" if len(comparison.runs) == 1 else f"{one.name}-"
        found.append(Poses(f"{prefix}reference", clock, one.reference, upright))
        found.append(Poses(f"{prefix}actual", clock, one.actual, upright))
    return found
