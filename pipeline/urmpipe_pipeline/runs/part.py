"""A part of a run: some of its rows, as a run of their own."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from urmpipe_models.kinematics.forward import PointLog
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.runs.results import RowJoints, Run


def part_of(run: Run, first: int, last: int, name: str) -> Run:
    """Return some rows of a run, both ends included, on their own clock, with the joints' turns as they are.

    The warnings stay with the whole.

    Args:
        run: The run.
        first: The first row, from 0.
        last: The last row, from 0.
        name: What the part is called.
    """
    rows = slice(first, last + 1)
    log, begins = _log(run.log, rows, name), int(run.rows_ns[first])
    grid = rows
    if run.rows is not None:  # the grid has samples of its own
        ends = int(run.rows_ns[last])
        grid = slice(*np.searchsorted(run.t_ns, [begins, ends + 1]).tolist())
    tcp = run.tcp
    if tcp is not None:
        tcp = PointLog(**{one.name: getattr(tcp, one.name)[grid] for one in fields(tcp)})
    audit = (
        replace(one, row=one.row - first, t=one.t - begins / 1e9)
        for one in run.audit
        if first < one.sample <= last
    )
    return replace(
        run, name=name, log=log, t_ns=run.t_ns[grid] - begins, q=run.q[grid], qd=run.qd[grid],
        qdd=run.qdd[grid], tcp=tcp,
        tcp_recorded=None if run.tcp_recorded is None else run.tcp_recorded[grid],
        tau=None if run.tau is None else run.tau[grid], audit=tuple(audit), warnings=(), recording=None,
        rows=None if run.rows is None else RowJoints(run.rows.t_ns[rows] - begins, run.rows.q[rows]),
    )  # fmt: skip


def _log(log: JointLog, rows: slice, name: str) -> JointLog:
    """Return some rows of a log, on their own clock."""
    begins = int(log.t_ns[rows.start])
    arrays: dict[str, Any] = {
        one: None if (values := getattr(log, one)) is None else values[rows]
        for one in ("q", "qd", "qdd", "tcp_position", "tcp_rotation")
    }
    return replace(
        log, name=name, t_ns=log.t_ns[rows] - begins, clock_start_ns=log.clock_start_ns + begins,
        first_line=log.first_line + rows.start, **arrays,
    )  # fmt: skip
