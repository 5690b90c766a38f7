"""A motion of the urm6 arm whose joints jump at +-pi, as runs and as a comparison."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_models.wraps import repolarize
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.joint_log import Inference, JointLog, LogColumn, LogWarning, SourceFile
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.repolarization.audit import AuditEntry
from urmpipe_pipeline.runs.derivatives import derivatives
from urmpipe_pipeline.runs.run import Run

LENGTHS = (0.243215, *(0.212430,) * 5, 0.042215)  # Table 1 of the paper, in m
TSP = 0.005
SAMPLES = 3000  # more than a drawn trace has points, so that every figure is decimated
JOINTS = tuple(f"phi{k}" for k in range(1, 7))
HOSTILE = "</script><img src=x onerror=alert(1)>\"'&%{y}<b>"
SHA256 = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"


def arm(first_length: float = LENGTHS[0]) -> Chain:
    """The arm of the paper; its first segment may be off."""
    return urm_chain("urm6", (first_length, *LENGTHS[1:]), [np.radians(52.0)] * 6)


def motion() -> FloatArray:
    """Six joints that turn smoothly for 15 s, phi1 more than once around, phi4 the other way."""
    t = TSP * np.arange(SAMPLES)
    q = 0.8 * np.sin(np.outer(t, [0.31, 0.23, 0.41, 0.17, 0.53, 0.37]) + np.arange(6))
    q[:, 0] += 0.9 * t
    q[:, 3] -= 0.4 * t
    return q


def ingested(name: str, q: FloatArray, robot: Chain | None, warnings: tuple[LogWarning, ...] = ()) -> Run:
    """The run of joints that an environment limits to +-pi."""
    raw = np.mod(q + np.pi, 2.0 * np.pi) - np.pi
    fixed = repolarize(raw, np.full(len(raw), TSP))
    qd, qdd = derivatives(fixed.q, TSP)
    t_ns = np.arange(len(raw)) * 5_000_000
    file = SourceFile(f"{name}.csv", SHA256, 1_234_567)
    log = JointLog(
        name,
        "table",
        (file,),
        t_ns,
        JOINTS,
        raw,
        columns=(
            LogColumn("t", "t", "time", 0, "s"),
            *(LogColumn(name, name, "joint", j, "rad") for j, name in enumerate(JOINTS)),
        ),
        inferences=(Inference("delimiter", ";", "every line has 7 fields with it"),),
    )
    turns = dict.fromkeys(range(6), 0)
    audit = []
    for row, j, change in zip(fixed.rows.tolist(), fixed.joints.tolist(), fixed.change.tolist(), strict=True):
        step = float(raw[row, j] - raw[row - 1, j])
        t_r = (row - 0.5) * TSP
        audit.append(AuditEntry(JOINTS[j], row + 1, t_r, TSP / 2, step, turns[j], turns[j] + change))
        turns[j] += change
    return Run(
        name=name,
        log=log,
        robot=robot,
        tsp=TSP,
        t_ns=t_ns,
        q=fixed.q,
        qd=qd,
        qdd=qdd,
        tcp=None if robot is None else point_over_log(robot, fixed.q, qd, qdd),
        tcp_recorded=None,
        audit=tuple(audit),
        warnings=warnings,
        provenance=Provenance(
            "ingest",
            {"robot": "urm6", "interval": [0, 1]},
            (file,),
            {"urmpipe": "0.1.0"},
            "2021-03-04T05:06:07+00:00",
        ),
    )


@pytest.fixture(scope="session")
def comparison() -> Comparison:
    """Two logs against a path: one from an arm with a base 2.5 mm too high, one with a joint 1 deg off."""
    q = motion()
    reference = ingested("path", q, arm())
    shifted = ingested("shifted", q, arm(LENGTHS[0] + 0.0025))
    off = ingested("joint-off", q + np.radians([0, 1, 0, 0, 0, 0]), arm(), (LogWarning("gap", "a gap", 7),))
    return compare_runs(reference, [shifted, off])


@pytest.fixture(scope="session")
def everything() -> Comparison:
    """The same two, worst first, with a tolerance for every kind and the second log half a second late."""
    q = motion()
    reference = ingested("path", q, arm())
    shifted = ingested("shifted", q, arm(LENGTHS[0] + 0.0025))
    off = ingested("joint-off", q[100:] + np.radians([0, 1, 0, 0, 0, 0]), arm())
    allowed = {"axis": 0.0035, "norm": 0.005, "path": 0.002, "angle": 0.01, "joint": 0.002}
    return compare_runs(reference, [shifted, off], CompareOptions(allowed, sync=0.5))


@pytest.fixture(scope="session")
def bare_run() -> Run:
    """A log of which no robot is known, with a stretch of missing samples."""
    run = ingested("bare", motion(), None)
    q = run.q.copy()
    q[1000:1100, 2] = np.nan
    return replace(run, q=q)


@pytest.fixture(scope="session")
def hostile() -> Comparison:
    """A comparison whose every text tries to break out of the page."""
    joints = tuple(f"{HOSTILE}{j}" for j in range(6))
    run = ingested(HOSTILE, motion()[:300], arm(), (LogWarning(HOSTILE, HOSTILE, 3),))
    log = replace(
        run.log,
        source=HOSTILE,
        joints=joints,
        files=(SourceFile(HOSTILE, HOSTILE, 1),),
        columns=tuple(LogColumn(n, n, "joint", j, HOSTILE) for j, n in enumerate(joints)),
        inferences=(Inference(HOSTILE, HOSTILE, HOSTILE),),
    )
    audit = tuple(replace(item, joint=joints[JOINTS.index(item.joint)]) for item in run.repolarizations)
    made = Provenance(HOSTILE, {HOSTILE: HOSTILE}, log.files, {HOSTILE: HOSTILE}, HOSTILE)
    run = replace(run, log=log, audit=audit, provenance=made)
    result = compare_runs(replace(run, name=f"{HOSTILE}0"), [run])  # runs of one name get another
    return replace(result, warnings=(LogWarning(HOSTILE, HOSTILE),), provenance=made)
