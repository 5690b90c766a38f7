"""What leaves of an accuracy: the errors by velocity, the samples of all motions, the trajectories."""

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
    """Return what can leave of an accuracy."""
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
    """Return the errors of the velocities that were asked for; NaN where the motion diverged."""
    rows = [
        (one.velocity, one.reached, one.error, one.path_error, one.saturated_share) for one in result.errors
    ]
    names, units = ("velocity", "reached", "error", "path_error"), ("m/s", "m/s", "m", "m")
    values = np.array(rows, dtype=np.float64)
    return ExportTable(
        (*columns_of(names, units, values[:, :4]), ExportColumn("saturated_share", "", values[:, 4])), None
    )


def samples_table(result: AccuracyResult) -> ExportTable:
    """Return the samples of all motions one below the other: points, deviation, joints, drives."""
    motions, joints = result.motions, [drop_surrogates(name) for name in result.robot.coordinates]
    driven, units, rates = (
        [drop_surrogates(name) for name in result.driven],
        result.joint_units,
        [f"{one}/s" for one in result.joint_units],
    )
    parts: tuple[tuple[list[str], list[str], list[FloatArray]], ...] = (
        (["velocity"], ["m/s"], [np.full((len(one), 1), one.velocity) for one in motions]),
        ([f"planned_{axis}" for axis in "xyz"], ["m"] * 3, [one.planned for one in motions]),
        (list("xyz"), ["m"] * 3, [one.position for one in motions]),
        (["dx", "dy", "dz", "norm"], ["m"] * 4, [one.delta for one in motions]),
        (["path"], ["m"], [one.from_path[:, np.newaxis] for one in motions]),
        ([f"set_{name}" for name in joints], units, [one.set_q for one in motions]),
        (joints, units, [one.q for one in motions]),
        ([f"set_d_{name}" for name in joints], rates, [one.set_qd for one in motions]),
        ([f"d_{name}" for name in joints], rates, [one.qd for one in motions]),
        ([f"u_{name}" for name in driven], ["V"] * len(driven), [one.voltage for one in motions]),
        ([f"i_a_{name}" for name in driven], ["A"] * len(driven), [one.current for one in motions]),
    )
    columns = [
        column for names, own, some in parts for column in columns_of(names, own, np.concatenate(some))
    ]
    t = ExportColumn("t [s]", "s", Times(np.concatenate([one.t_ns for one in motions]), "s"))
    return ExportTable((columns[0], t, *columns[1:]), None)


def _fields(result: AccuracyResult, table: ExportTable) -> dict[str, Any]:
    """Return the fields of a table of an accuracy: values in SI, their names and units, and the times."""
    columns = [one for one in table.columns if not isinstance(one.values, Times)]
    times = [one.values.ns / 1e9 for one in table.columns if isinstance(one.values, Times)]
    speed, limit, nothing = result.running_speed, result.limit, np.empty((0, 0))
    return {
        "name": drop_surrogates(result.name),
        "robot": drop_surrogates(result.robot.name),
        "t": times[0][:, np.newaxis] if times else nothing,
        "values": np.column_stack([np.asarray(one.values) for one in columns]),
        "names": [one.name for one in columns],
        "units": [one.unit for one in columns],
        "running_speed": nothing if speed is None else speed,
        "limit": nothing if limit is None else limit,
    }


def _poses(result: AccuracyResult) -> list[Poses]:
    """Return the trajectory of the tool at each velocity."""
    where = str(result.recording) if result.recording else result.name
    several = len(result.motions) > 1
    return [
        poses_by_kinematics(f"{one.velocity:g}" if several else "", result.robot, one.t_ns, one.q, where)
        for one in result.motions
    ]
