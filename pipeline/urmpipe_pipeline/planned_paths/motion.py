"""A plan as a run: its joints as the log's, its path as the tool centre point that the log recorded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.math3d import COLUMN_NAMES
from urmpipe_pipeline.joint_log import SOLVED, JointLog, LogColumn, LogWarning
from urmpipe_pipeline.planned_paths.planned_joints import PlannedJoints
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.ingest import tcp_motion
from urmpipe_pipeline.runs.run import Run


def run_of_plan(
    name: str,
    joints: PlannedJoints | None,
    tsp: float,
    t_ns: IntArray,
    position: FloatArray,
    quat_xyzw: FloatArray | None,
    warnings: tuple[LogWarning, ...],
    made: Provenance,
) -> Run:
    """Return a plan as a run, its rates and accelerations as they were planned.

    Args:
        name: What to call it.
        joints: The joints, n rows; None without an arm.
        tsp: From sample to sample in [s].
        t_ns: Times in integer [ns], shape (n,).
        position: Where the tool shall be in [m], shape (n, 3).
        quat_xyzw: How it shall be turned [-], shape (n, 4); None where that is left open.
        warnings: What a person should know.
        made: How it was planned.
    """
    chain, none = None if joints is None else joints.chain, np.empty((len(t_ns), 0))
    q, qd, qdd = (none, none, none) if joints is None else (joints.q, joints.qd, joints.qdd)
    log = JointLog(
        name=name, source=SOLVED, files=made.inputs, t_ns=t_ns,
        joints=() if chain is None else chain.coordinates, q=q,
        tcp_position=position, tcp_rotation=quat_xyzw,
        rotation_form=None if quat_xyzw is None else "quat_xyzw",
        columns=tuple(_columns(chain, turned=quat_xyzw is not None)), warnings=warnings,
    )  # fmt: skip
    tcp, noticed = tcp_motion(chain, q, qd, qdd)
    return Run(
        name=name, log=log, robot=chain, tsp=tsp, t_ns=t_ns, q=q, qd=qd, qdd=qdd, tcp=tcp,
        tcp_recorded=position, audit=(), warnings=(*warnings, *noticed), provenance=made,
        tau=None if joints is None else joints.tau, derivative="" if joints is None else "planned",
    )  # fmt: skip


def _columns(chain: Chain | None, *, turned: bool) -> Iterator[LogColumn]:
    """Yield the columns that the plan has as a file."""
    yield LogColumn("t", "t [s]", "time", 0, "s", number=1)
    number = 1
    for j, joint in enumerate(chain.moving if chain else ()):
        unit, number = "rad" if joint.kind == "revolute" else "m", number + 1
        yield LogColumn(joint.name, f"{joint.name} [{unit}]", "joint", j, unit, number=number)
    for j, axis in enumerate("xyz"):
        number += 1
        yield LogColumn(axis, f"{axis} [m]", "position", j, "m", number=number)
    for j, component in enumerate(COLUMN_NAMES["quat_xyzw"] if turned else ()):
        number += 1
        yield LogColumn(component, component, "rotation", j, "", number=number)
