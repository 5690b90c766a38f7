"""The exports of an accuracy: the errors by velocity, the samples of all motions, the trajectories."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.accuracy.result import AccuracyResult
from urmpipe_pipeline.presentation.exports import (
    ExportColumn,
    Exports,
    ExportTable,
    Poses,
    Rows,
    Times,
    columns_of,
)
from urmpipe_pipeline.runs.exports import export_metadata, poses_by_kinematics
from urmpipe_pipeline.text import drop_surrogates


def exports(result: AccuracyResult) -> Exports:
    """Return the exports of an accuracy."""
    about = export_metadata(result.name, result.provenance) | {
        "robot": result.robot.name,
        "running_speed": result.running_speed,
        "limit": result.limit,
        "limited_error": result.limited_error,
        "verdict": result.verdict,
    }
    rows = {
        "velocities": Rows(partial(velocities_table, result), partial(_fields, result)),
        "samples": Rows(partial(samples_table, result), partial(_fields, result)),
    }
    return Exports("accuracy", about, rows, {"": lambda rows: _poses(result)}, {})


def velocities_table(result: AccuracyResult) -> ExportTable:
    """Return the errors at the requested velocities; NaN where the motion diverged."""
    rows = [(e.velocity, e.reached, e.error, e.path_error, e.saturated_share) for e in result.errors]
    names, units = ("velocity", "reached", "error", "path_error"), ("m/s", "m/s", "m", "m")
    values = np.array(rows, dtype=np.float64)
    return ExportTable(
        (*columns_of(names, units, values[:, :4]), ExportColumn("saturated_share", "", values[:, 4])), None
    )


def samples_table(result: AccuracyResult) -> ExportTable:
    """Return the samples of all motions, one motion after the other: points, deviation, joints, drives."""
    motions, joints = result.motions, [drop_surrogates(name) for name in result.robot.coordinates]
    driven, units, rates = (
        [drop_surrogates(name) for name in result.driven],
        result.joint_units,
        [f"{unit}/s" for unit in result.joint_units],
    )
    parts: tuple[tuple[list[str], list[str], list[FloatArray]], ...] = (
        (["velocity"], ["m/s"], [np.full((len(m), 1), m.velocity) for m in motions]),
        ([f"planned_{axis}" for axis in "xyz"], ["m"] * 3, [m.planned for m in motions]),
        (list("xyz"), ["m"] * 3, [m.position for m in motions]),
        (["dx", "dy", "dz", "norm"], ["m"] * 4, [m.delta for m in motions]),
        (["path"], ["m"], [m.from_path[:, np.newaxis] for m in motions]),
        ([f"set_{name}" for name in joints], units, [m.set_q for m in motions]),
        (joints, units, [m.q for m in motions]),
        ([f"set_d_{name}" for name in joints], rates, [m.set_qd for m in motions]),
        ([f"d_{name}" for name in joints], rates, [m.qd for m in motions]),
        ([f"u_{name}" for name in driven], ["V"] * len(driven), [m.voltage for m in motions]),
        ([f"i_a_{name}" for name in driven], ["A"] * len(driven), [m.current for m in motions]),
    )
    columns = [
        column
        for names, of_names, values in parts
        for column in columns_of(names, of_names, np.concatenate(values))
    ]
    t = ExportColumn("t [s]", "s", Times(np.concatenate([m.t_ns for m in motions]), "s"))
    return ExportTable((columns[0], t, *columns[1:]), None)


def _fields(result: AccuracyResult, table: ExportTable) -> dict[str, Any]:
    """Return the fields of a table of an accuracy: values in SI, their names and units, and the times."""
    columns = [column for column in table.columns if not isinstance(column.values, Times)]
    times = [column.values.ns / 1e9 for column in table.columns if isinstance(column.values, Times)]
    speed, limit, nothing = result.running_speed, result.limit, np.empty((0, 0))
    return {
        "name": drop_surrogates(result.name),
        "robot": drop_surrogates(result.robot.name),
        "t": times[0][:, np.newaxis] if times else nothing,
        "values": np.column_stack([np.asarray(column.values) for column in columns]),
        "names": [column.name for column in columns],
        "units": [column.unit for column in columns],
        "running_speed": nothing if speed is None else speed,
        "limit": nothing if limit is None else limit,
    }


def _poses(result: AccuracyResult) -> list[Poses]:
    """Return the trajectory of the tool at each velocity."""
    source = str(result.recording) if result.recording else result.name
    several = len(result.motions) > 1
    return [
        poses_by_kinematics(f"{m.velocity:g}" if several else "", result.robot, m.t_ns, m.q, source)
        for m in result.motions
    ]
