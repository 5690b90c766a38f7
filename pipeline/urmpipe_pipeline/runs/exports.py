"""The tables of a run for export: its grid in SI, the columns of its file, and its poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, RecordingError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.wraps import unwrap_quaternions
from urmpipe_pipeline.joint_log import ROW_NS
from urmpipe_pipeline.presentation.exports import (
    ExportColumn,
    Exports,
    ExportTable,
    Poses,
    Rows,
    Times,
    columns_of,
)
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.file_columns import file_roles, file_table
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.text import drop_surrogates


def exports(run: Run) -> Exports:
    """Return the tables of a run."""
    about = export_metadata(run.name, run.provenance) | {
        "source": run.log.source,
        "robot": run.robot.name if run.robot else None,
        "joints": list(run.log.joints),
        "tsp": run.tsp if run.timed else None,
        "clock_start_ns": run.log.clock_start_ns if run.timed else None,
        "repolarizations": len(run.repolarizations),
        "columns": file_roles(run.log),
        "rotation_form": run.log.rotation_form,
    }
    rows = {
        "grid": Rows(partial(grid_table, run), lambda table: _grid_fields(run)),
        "file": Rows(partial(file_table, run.log), partial(_file_fields, run)),
    }
    poses: dict[str, Callable[[str], list[Poses]]] = {
        "fk": partial(run_poses, run),
        "recorded": lambda rows: [recorded_poses(run)],
    }
    return Exports("run", about, rows, poses, {"recorded": "file"})


def export_metadata(name: str, provenance: Provenance) -> dict[str, Any]:
    """Return the metadata of every export: the name of the result, and its provenance."""
    return {
        "name": name,
        "inputs": [asdict(file) for file in provenance.inputs],
        "command": provenance.command,
        "options": dict(provenance.options),
        "versions": dict(provenance.versions),
        "created": provenance.created,
    }


def grid_table(run: Run) -> ExportTable:
    """Return the run on its grid in SI, each name with its unit: t, q, q', q'', torques, tool centre point.

    Static poses have the row in place of t, and no derivatives.
    """
    timed = run.timed
    columns = [ExportColumn("t [s]", "s", Times(run.t_ns, "s"))]
    if not timed:
        columns = [ExportColumn("row", "", np.arange(1, len(run.t_ns) + 1))]
    units = run.joint_units
    joints = [drop_surrogates(name) for name in run.log.joints]
    orders = (("", "", run.q), ("d_", "/s", run.qd), ("dd_", "/s2", run.qdd))
    for prefix, order, values in orders[: 3 if timed else 1]:
        names = [prefix + name for name in joints]
        columns += columns_of(names, [unit + order for unit in units], values)
    if run.tau is not None:
        columns += columns_of([f"tau_{name}" for name in joints], run.torque_units, run.tau)
    if run.tcp is not None:
        points = (
            ("p", "m", run.tcp.position), ("v", "m/s", run.tcp.velocity), ("a", "m/s2", run.tcp.acceleration),
        )  # fmt: skip
        for name, unit, values in points[: 3 if timed else 1]:
            columns += columns_of([name + axis for axis in "xyz"], [unit] * 3, values)
        columns += columns_of(["rz", "ry", "rx"], ["rad"] * 3, run.tcp.euler_zyx)
    if run.tcp_recorded is not None:
        columns += columns_of([f"recorded_tcp_{axis}" for axis in "xyz"], ["m"] * 3, run.tcp_recorded)
    if run.rotation_recorded is not None:
        unit = "rad" if len(run.rotation_names) == 3 else "1"
        names = [f"recorded_{name}" for name in run.rotation_names]
        columns += columns_of(names, [unit] * len(names), run.rotation_recorded)
    return ExportTable(tuple(columns), run.log.clock_start_ns + run.t_ns if timed else None)


def _grid_fields(run: Run) -> dict[str, Any]:
    """Return the fields of a run on its grid, in SI: t, q, qd, qdd, tau, p, v, a, euler_zyx, p_recorded.

    Missing ones are empty: the point without kinematics, torques without masses, times and derivatives of
    static poses.
    """
    units = run.joint_units
    tcp = run.tcp
    empty = np.empty((0, 0))
    timed = run.timed
    return {
        "name": drop_surrogates(run.name),
        "rows": "grid",
        "t": run.t if timed else empty,
        "clock_ns": run.log.clock_start_ns + run.t_ns if timed else empty,
        "q": run.q,
        "qd": run.qd if timed else empty,
        "qdd": run.qdd if timed else empty,
        "tau": empty if run.tau is None else run.tau,
        "p": empty if tcp is None else tcp.position,
        "v": tcp.velocity if tcp is not None and timed else empty,
        "a": tcp.acceleration if tcp is not None and timed else empty,
        "euler_zyx": empty if tcp is None else tcp.euler_zyx,
        "p_recorded": empty if run.tcp_recorded is None else run.tcp_recorded,
        "joints": [drop_surrogates(name) for name in run.log.joints],
        "units": {
            "t": "s", "clock_ns": "ns", "q": list(units), "qd": [f"{unit}/s" for unit in units],
            "qdd": [f"{unit}/s2" for unit in units], "tau": run.torque_units, "p": "m", "v": "m/s",
            "a": "m/s2", "euler_zyx": "rad", "p_recorded": "m",
        },
    }  # fmt: skip


def _file_fields(run: Run, table: ExportTable) -> dict[str, Any]:
    """Return the fields of the rows of the file: values in its units, their names, and the exact clock."""
    columns = [column for column in table.columns if not isinstance(column.values, Times)]
    clock = [column for column in table.columns if isinstance(column.values, Times)]
    return {
        "name": drop_surrogates(run.name),
        "rows": "file",
        "t": run.log.t if run.timed else np.empty((0, 0)),
        "clock_ns": np.empty((0, 0)) if table.clock_ns is None else table.clock_ns,
        "values": np.column_stack([np.asarray(column.values) for column in columns]),
        "names": [column.name for column in columns],
        "units": [column.unit for column in columns],
        "clock_names": [column.name for column in clock],
        "clock_units": [column.unit for column in clock],
    }


def poses_by_kinematics(name: str, robot: Chain, clock_ns: IntArray, q: FloatArray, about: str) -> Poses:
    """Return the poses of the tip of an arm by forward kinematics, without the rows that miss a joint.

    Args:
        name: Name of the trajectory.
        robot: The arm.
        clock_ns: Times in integer [ns], shape (n,).
        q: Joint values in [rad] or [m], shape (n, joints).
        about: The recording or result that an error names.

    Raises:
        RecordingError: If no row has a pose.
    """
    there = np.flatnonzero(np.isfinite(q).all(axis=1))
    if not len(there):
        raise RecordingError(Finding("no row with a pose", about))
    from scipy.spatial.transform import Rotation

    position, rotation = poses_over_log(robot, q[there])
    quat = np.asarray(Rotation.from_matrix(rotation).as_quat(), dtype=np.float64)
    return Poses(name, clock_ns[there], position, unwrap_quaternions(quat), len(q) - len(there))


def run_poses(run: Run, rows: str) -> list[Poses]:
    """Return the poses of a run by forward kinematics, at the rows of its grid or of its file.

    Raises:
        RecordingError: If it has no robot, no joints, or no row with a pose.
    """
    if run.robot is None or not run.log.joints:
        missing = "robot" if run.log.joints else "joints"
        at_ingest = Hint("robot", effect="gives it", call="ingest")
        recorded = Hint("tcp", "recorded", "takes what the log recorded")
        raise _pose_error(run, f"no {missing}, so no pose", at_ingest, recorded)
    t_ns, q = (run.t_ns, run.q) if rows == "grid" else (run.log.t_ns, run.log.q)
    return [poses_by_kinematics("", run.robot, clock_stamps(run, t_ns), q, _recording_or_name(run))]


def clock_stamps(run: Run, t_ns: IntArray) -> IntArray:
    """Return the clock of a run at times in [ns], shape (n,); of static poses the row numbers as seconds."""
    return t_ns + (run.log.clock_start_ns if run.timed else ROW_NS)


def recorded_poses(run: Run) -> Poses:
    """Return the poses that a log recorded.

    Raises:
        RecordingError: If it recorded none.
    """
    position, quat = run.log.tcp_position, run.log.tcp_quat_xyzw
    if position is None or quat is None:
        missing = "position" if position is None else "orientation"
        hint = Hint("tcp", "fk", "takes the poses of a robot")
        raise _pose_error(run, f"no recorded {missing}, so no recorded pose", hint)
    there = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(quat).all(axis=1))
    if not len(there):
        raise _pose_error(run, "no row with a pose")
    return Poses(
        "", clock_stamps(run, run.log.t_ns[there]), position[there], quat[there], len(position) - len(there)
    )


def _pose_error(run: Run, message: str, *hints: Hint) -> RecordingError:
    return RecordingError(Finding(message, _recording_or_name(run), hints=hints))


def _recording_or_name(run: Run) -> str:
    return str(run.recording) if run.recording else run.name
