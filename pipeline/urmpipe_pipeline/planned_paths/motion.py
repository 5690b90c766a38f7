"""A plan as a run: its joints as the log's, its path as the tool centre point that the log recorded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.orientation import NAMES
from urmpipe_pipeline.joint_log import SOLVED, JointLog, LogColumn, LogWarning
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.ingest import run_of
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.sources import ReadOptions


def run_of_plan(
    name: str,
    chain: Chain | None,
    t_ns: IntArray,
    q: FloatArray | None,
    position: FloatArray,
    quat_xyzw: FloatArray | None,
    warnings: tuple[LogWarning, ...],
    made: Provenance,
) -> Run:
    """Return a plan as a run.

    Args:
        name: What to call it.
        chain: The arm, with base and tool; None without one.
        t_ns: Times in integer [ns], shape (n,).
        q: Joint values in [rad] or [m], shape (n, joints), NaN where there is none; None without an arm.
        position: Where the tool shall be in [m], shape (n, 3).
        quat_xyzw: How it shall be turned [-], shape (n, 4); None where that is left open.
        warnings: What a person should know.
        made: How it was planned.

    Raises:
        LogError: If the times need a grid without end.
    """
    log = JointLog(
        name=name, source=SOLVED, files=made.inputs, t_ns=t_ns,
        joints=() if chain is None else chain.coordinates,
        q=np.empty((len(t_ns), 0)) if q is None else q,
        tcp_position=position, tcp_rotation=quat_xyzw,
        rotation_form=None if quat_xyzw is None else "quat_xyzw",
        columns=tuple(_columns(chain, turned=quat_xyzw is not None)), warnings=warnings,
    )  # fmt: skip
    return run_of(log, chain, ReadOptions(), made=made)


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
    for j, component in enumerate(NAMES["quat_xyzw"] if turned else ()):
        number += 1
        yield LogColumn(component, component, "rotation", j, "", number=number)
