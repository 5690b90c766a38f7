"""Whole logs that deviate for a known reason, and their diagnosis."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe import ingest
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, compare_with_recorded_tcp
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.runs.run import Run

TRACKER = Path(__file__).resolve().parents[3] / "shared/logs/ur10-laser-tracker/measurements_grid.csv"
"""Poses of a UR10 that a laser tracker measured; outside the repository."""

POSES = 300
"""Of the tracker's poses that one trial draws."""


def diagnosed(reference: Run, log: Run) -> Diagnosis:
    """Return why a log deviates from a reference; both start together."""
    found = compare_runs(reference, [log], CompareOptions(diagnose=True)).runs[0].diagnosis
    assert found is not None
    return found


def diagnosed_record(log: Run) -> Diagnosis:
    """Return why the joints of a log do not lead where it was measured."""
    found = compare_with_recorded_tcp(log, CompareOptions(diagnose=True)).runs[0].diagnosis
    assert found is not None
    return found


@cache
def tracked() -> Run:
    """Return the poses of the tracker."""
    return ingest(TRACKER, robot="ur10")


def drawn(run: Run, rows: IntArray, q: FloatArray | None = None, robot: Chain | None = None) -> Run:
    """Return some still poses of a run, with other joints or another arm if given.

    Args:
        run: Still poses.
        rows: Which, shape (k,).
        q: Joints of all of them in [rad], shape (n, joints).
        robot: The arm.
    """
    arm = run.robot if robot is None else robot
    assert arm is not None
    joints = (run.q if q is None else q)[rows]
    rates = run.qd[rows], run.qdd[rows]
    log = replace(run.log, **{**_kept(run.log, rows), "q": joints})
    changed = {"log": log, "q": joints, "tcp": point_over_log(arm, joints, *rates), "robot": arm, "audit": ()}
    return replace(run, **{**_kept(run, rows), **changed})


def _kept(one: Run | JointLog, rows: IntArray) -> dict[str, Any]:
    """Return the arrays of all rows, cut to some of them, by their fields."""
    arrays = ((of.name, getattr(one, of.name)) for of in fields(one))
    return {name: a[rows] for name, a in arrays if isinstance(a, np.ndarray) and len(a) == len(one.t_ns)}
