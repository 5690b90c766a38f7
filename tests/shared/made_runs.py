"""Runs made of arrays, as `ingest` returns those of files: paths of poses, and arms, a row each 5 ms."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_models.math3d import RotationForm
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.joint_log import JointLog, SourceFile
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.provenance import Provenance, build_provenance
from urmpipe_pipeline.runs.derivatives import derivatives
from urmpipe_pipeline.runs.ingest import log_to_run
from urmpipe_pipeline.runs.run import Run

TSP = 0.005
URM6 = urm_chain("urm6", [0.243215, *[0.21243] * 5, 0.042215], [np.radians(52)] * 6)


def path_run(
    position: FloatArray,
    rotation: FloatArray | None = None,
    form: RotationForm = "quat_xyzw",
    *,
    name: str = "path",
    tsp: float = TSP,
) -> Run:
    """A path: a log without joints, with orientations if there are any."""
    return run_of(np.empty((len(position), 0)), None, position, rotation, form, name=name, tsp=tsp)


def run_of(
    q: FloatArray,
    robot: Chain | None = URM6,
    recorded: FloatArray | None = None,
    rotation: FloatArray | None = None,
    form: RotationForm = "quat_xyzw",
    *,
    name: str = "log",
    joints: tuple[str, ...] = (),
    tsp: float = TSP,
) -> Run:
    """A run of joint values, by default q1, q2, ..., with the poses that it recorded, if any."""
    t_ns = np.arange(len(q)) * round(tsp * 1e9)
    log = JointLog(
        name, "table", (SourceFile(f"{Path(name).name}.csv", "0" * 64, 1),), t_ns,
        joints or tuple(f"q{k + 1}" for k in range(q.shape[1])), q, tcp_position=recorded,
        tcp_rotation=rotation, rotation_form=None if rotation is None else form,
    )  # fmt: skip
    qd, qdd = derivatives(q, tsp)
    tcp = None if robot is None else point_over_log(robot, q, qd, qdd)
    return Run(
        name, log, robot, tsp, t_ns, q, qd, qdd, tcp, recorded, (), (), Provenance("ingest", {}, (), {}, "")
    )


def ingested(
    t: FloatArray,
    q: FloatArray | None = None,
    robot: Chain | None = None,
    *,
    position: FloatArray | None = None,
    quaternions: FloatArray | None = None,
    name: str = "log",
    tsp: float | None = None,
) -> Run:
    """The run that `ingest` makes of joints, or of a path of poses (x, y, z, w), at these times in [s]."""
    q = np.empty((len(t), 0)) if q is None else q
    names = tuple(f"q{k + 1}" for k in range(q.shape[1]))
    log = JointLog(
        name, "table", (), np.rint(t * 1e9).astype(np.int64), names, q,
        tcp_position=position, tcp_rotation=quaternions,
        rotation_form=None if quaternions is None else "quat_xyzw",
    )  # fmt: skip
    return log_to_run(log, robot, LogMap(), provenance=build_provenance("ingest", {}, ()), tsp=tsp)


def off(x: float, samples: int = 100) -> FloatArray:
    """A deviation that grows from 0 to x along x."""
    return np.column_stack([np.linspace(0.0, x, samples), np.zeros((samples, 2))])


def paths(deltas: Mapping[str, FloatArray], **options: Any) -> Comparison:
    """Paths compared with a path, each off by reference - log in [m], shape (n, 3)."""
    length = max(map(len, deltas.values()))
    reference = np.column_stack([np.linspace(0.0, 1.0, length), np.zeros(length), np.ones(length)])
    runs = [path_run(reference[: len(delta)] - delta, name=name) for name, delta in deltas.items()]
    return compare_runs(path_run(reference), runs, CompareOptions(**options))


def arms(deltas: Mapping[str, FloatArray], **options: Any) -> Comparison:
    """Arms compared with an arm, each off by reference - log in [rad], shape (n, 6)."""
    t = TSP * np.arange(max(map(len, deltas.values())))
    q = np.column_stack([0.5 * np.sin(t * (1 + i)) + i for i in range(6)])
    runs = [run_of(q[: len(delta)] - delta, name=name) for name, delta in deltas.items()]
    return compare_runs(run_of(q, name="wanted"), runs, CompareOptions(**options))
