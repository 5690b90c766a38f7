"""Chosen solutions as a run: a motion where the targets have times, else poses that no motion joins.

A motion goes the way of a log that was read: audit, grid, derivatives, kinematics. Between two poses without
times there is no motion, so such a run has no rates, and no turns are resolved in it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.joint_log import ROW_NS, SOLVED, JointLog, LogColumn, LogWarning
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.ingest import log_to_run
from urmpipe_pipeline.runs.run import Run


def run_of_solutions(
    name: str,
    chain: Chain,
    q: FloatArray,
    t_ns: IntArray | None,
    clock_start_ns: int,
    warnings: tuple[LogWarning, ...],
    made: Provenance,
) -> Run:
    """Return joint values that inverse kinematics found as a run.

    Args:
        name: What to call it.
        chain: The arm, with base and tool.
        q: The chosen solutions in [rad] or [m], shape (n, joints); NaN where there is none: there the run has
            no pose, and nothing is interpolated.
        t_ns: Times from the first row in integer [ns], shape (n,); None without times.
        clock_start_ns: The clock at the first row in integer [ns].
        warnings: What a person should know.
        made: How the solutions were made.

    Raises:
        LogError: If the times need a grid without end.
    """
    timed = t_ns is not None
    log = JointLog(
        name=name, source=SOLVED, files=made.inputs, joints=chain.coordinates, q=q,
        t_ns=np.arange(len(q), dtype=np.int64) * ROW_NS if t_ns is None else t_ns,
        clock_start_ns=clock_start_ns, columns=tuple(_columns(chain, timed=timed)), warnings=warnings,
        timed=timed,
    )  # fmt: skip
    return log_to_run(log, chain, LogMap(), provenance=made)


def _columns(chain: Chain, *, timed: bool) -> Iterator[LogColumn]:
    """Yield what the columns would be if the joint values stood in a file, so that they can be exported."""
    if timed:
        yield LogColumn("t", "t [s]", "time", 0, "s", number=1)
    for j, joint in enumerate(chain.moving):
        unit = "rad" if joint.kind == "revolute" else "m"
        yield LogColumn(joint.name, f"{joint.name} [{unit}]", "joint", j, unit, number=j + 1 + timed)
