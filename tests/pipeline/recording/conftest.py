"""A real motion of the urm6 arm, as a run, for the tests of the recording."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from urmpipe_models.chain import Chain
from urmpipe_models.kinematics import point_over_log
from urmpipe_models.urm import urm_chain
from urmpipe_pipeline.audit_entry import AuditEntry
from urmpipe_pipeline.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison import Comparison
from urmpipe_pipeline.joint_log import FloatArray, Inference, JointLog, LogColumn, LogWarning, SourceFile
from urmpipe_pipeline.provenance import provenance
from urmpipe_pipeline.results import Run

LENGTHS = (0.243215, 0.212430, 0.212430, 0.212430, 0.212430, 0.212430, 0.042215)
TILT = math.radians(52.0)
PERIOD_NS = 5_000_000

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def arm() -> Chain:
    """Return urm6. Source: [UrmArm2021]_ Table 1."""
    start = (0.0, math.pi, 0.0, math.pi, 0.0, math.pi)
    return urm_chain("urm6", LENGTHS, (TILT,) * 6, start=start, source="UrmArm2021, Table 1")


def motion(t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, q' and q'' of six joints that leave the calibration pose, the first and the last by turns."""
    start = np.array([0.0, math.pi, 0.0, math.pi, 0.0, math.pi])
    sway, pace = np.array([0.5, 0.7, 0.9, 0.8, 0.6, 1.0]), np.array([0.31, 0.23, 0.41, 0.29, 0.37, 0.17])
    drift = np.array([0.45, 0.0, 0.0, 0.0, 0.0, -0.7])
    phase = np.outer(t, pace) * 2 * math.pi / 5
    speed = pace * 2 * math.pi / 5
    q = start + sway * np.sin(phase) + np.outer(t, drift)
    return q, sway * speed * np.cos(phase) + drift, -sway * speed**2 * np.sin(phase)


def repolarizations(raw: FloatArray, t: FloatArray, names: tuple[str, ...]) -> tuple[AuditEntry, ...]:
    """Return the wraps in raw."""
    found = []
    for j, name in enumerate(names):
        turns = 0
        for row in (np.flatnonzero(np.abs(np.diff(raw[:, j])) > math.pi) + 1).tolist():
            step = float(raw[row, j] - raw[row - 1, j])
            change = -round(step / (2 * math.pi))
            half = float(t[row] - t[row - 1]) / 2
            found.append(AuditEntry(name, row + 1, float(t[row]) - half, half, step, turns, turns + change))
            turns += change
    return tuple(found)


def build_run(
    name: str = "coppeliasim",
    rows: int = 1500,
    offset: float = 0.0,
    robot: Chain | None = None,
    **log_fields: object,
) -> Run:
    """Return a run of `rows` samples; `offset` in [rad] turns its second joint away."""
    chain = robot or arm()
    t_ns = np.arange(rows, dtype=np.int64) * PERIOD_NS
    t = t_ns / 1e9
    q, qd, qdd = motion(t)
    q[:, 1] += offset
    raw = np.remainder(q + math.pi, 2 * math.pi) - math.pi
    file = SourceFile(f"{name}.csv", "0" * 64, 12345)
    joints = tuple(f"phi{k}" for k in range(1, 7))
    log = JointLog(
        name=name, source="table", files=(file,), t_ns=t_ns, joints=joints, q=raw, clock_start_ns=50_000_000,
        columns=tuple(LogColumn(n, n, "joint", j, "rad") for j, n in enumerate(joints)), digits=4,
        inferences=(Inference("delimiter", ",", "found in line 1"),),
        warnings=(LogWarning("gap", "two rows lie far apart", 7),),
    )  # fmt: skip
    log = replace(log, **log_fields)  # type: ignore[arg-type]
    return Run(
        name=name, log=log, robot=chain, tsp=0.005, t_ns=t_ns, q=q, qd=qd, qdd=qdd,
        tcp=point_over_log(chain, q, qd, qdd), tcp_recorded=None,
        audit=repolarizations(raw, t, joints), warnings=log.warnings,
        provenance=provenance("ingest", {"robot": "urm6", "tsp": None}, [file]),
    )  # fmt: skip


def build_comparison(names: tuple[str, ...] = ("coppeliasim", "matlab"), rows: int = 1500) -> Comparison:
    """Return the comparison of runs, each a bit further from the reference, with the reference."""
    offsets = [0.002 * (i + 1) for i in range(len(names))]
    runs = [build_run(name, rows, offset) for name, offset in zip(names, offsets, strict=True)]
    return compare_runs(build_run("asked for", rows), runs, CompareOptions({"axis": 0.0035}))


@pytest.fixture
def make_run() -> MakeRun:
    return build_run


@pytest.fixture
def make_comparison() -> MakeComparison:
    return build_comparison
