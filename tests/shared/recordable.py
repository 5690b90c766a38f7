"""Results to record: a real motion of the urm6 arm as a run, its comparisons, solved targets."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from solved import solved
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.joint_log import Inference, JointLog, LogColumn, LogWarning, SourceFile
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.repolarization.audit import AuditEntry
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.solved_targets.result import IkResult

LENGTHS = (0.243215, 0.212430, 0.212430, 0.212430, 0.212430, 0.212430, 0.042215)
TILT = math.radians(52.0)
PERIOD_NS = 5_000_000


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
        provenance=build_provenance("ingest", {"robot": "urm6", "tsp": None}, [file]),
    )  # fmt: skip


def build_comparison(names: tuple[str, ...] = ("coppeliasim", "matlab"), rows: int = 1500) -> Comparison:
    """Return the comparison of runs, each a bit further from the reference, with the reference."""
    offsets = [0.002 * (i + 1) for i in range(len(names))]
    runs = [build_run(name, rows, offset) for name, offset in zip(names, offsets, strict=True)]
    return compare_runs(build_run("asked for", rows), runs, CompareOptions({"axis": 0.0035}))


STEP_NS = 20_000_000
TOO_FAR = "the wrist centre is 1.2 m away, allowed: 0.1 to 0.9 m"
BRANCHES = ("right, elbow up, flipped", "left, elbow down, not flipped")


def slow_motion(rows: int) -> FloatArray:
    """Return a slow motion of six joints, a row 20 ms."""
    t = np.arange(rows)[:, None] * STEP_NS / 1e9
    return np.array([0.1, -1.2, 1.3, -0.4, 0.7, 0.3]) + np.array([0.3, 0.2, -0.2, 0.4, -0.3, 0.5]) * t


def build_solved(
    rows: int = 40, timed: bool = True, names: tuple[str, ...] = BRANCHES, robot: Chain | None = None
) -> IkResult:
    """Return solved targets: rows 5 to 8 out of reach; ghost k is there from row 2 k on, but for 20 to 29."""
    chain, q = robot or load_robot("ur5e"), slow_motion(rows)
    targets = forward_targets(chain, q)
    q[5:9] = np.nan
    reasons = tuple(TOO_FAR if 5 <= k < 9 else "" for k in range(rows))
    others = {}
    for k, name in enumerate(names):
        there = np.r_[2 * k : min(20, rows), 30:rows] if rows > 30 else np.arange(min(k, rows - 1), rows)
        others[name] = np.full_like(q, np.nan)
        others[name][there] = slow_motion(rows)[there] + 0.3 * (k + 1)
        others[name][5:9] = np.nan
    t_ns = np.arange(rows) * STEP_NS if timed else None
    return solved("targets", chain, q, t_ns, others=others, reasons=reasons, targets=targets)
