"""Arms with drives that are run along planned paths: by the unit, step by step, and as blocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import urmpipe
from fmu_run import FmuRun
from urmpipe.driven_runs import ArmUnit
from urmpipe_fmus.build.fmu import cached_fmu
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.planned_paths.result import PlannedPath

PERIOD = 5e-3
"""Time between two samples of the controllers in [s]."""

CONTOUR = "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"
"""The contour of [Iso9283] section 5."""

SHORT = "x,y,z,r\n1.7,0.3,1.0,0\n1.703,0.3,1.0,0.001\n1.704,0.297,1.0,0\n"
"""The start of the contour, and a corner after it."""


def short_path(folder: Path) -> Path:
    """Return a file of a path along which irb60 runs for a fifteenth of a second."""
    path = folder / "short.csv"
    path.write_text(SHORT, encoding="utf-8")
    return path


def planned(path: str | Path, arm: Chain, velocity: float, output: Path | None = None) -> PlannedPath:
    """Return the plan that `accuracy` makes of a path by itself."""
    return urmpipe.plan(path, arm, velocity=velocity, tsp=PERIOD, output=output)


def joints_of(plan: PlannedPath) -> FloatArray:
    """Return set values, rates and second derivatives of the joints of a plan, shape (3, n, joints)."""
    assert plan.joints is not None
    return np.array([plan.joints.q, plan.joints.qd, plan.joints.qdd])


def begun(arm: Chain, plan: PlannedPath) -> Chain:
    """Return an arm that starts where a plan does."""
    return replace(arm, start=tuple(joints_of(plan)[0, 0].tolist()))


def along(arm: ArmUnit, plan: PlannedPath, *, rest: float = 0.0, **start: Any) -> dict[str, FloatArray]:
    """Return q, q', u and i_a of an arm's native unit along a plan and at rest after it, shape (n, ...) each.

    Args:
        arm: The arm, at rest where the plan begins.
        plan: What leads its set points.
        rest: How long they are held at its end in [s].
        **start: Start values of the unit besides.
    """
    points = joints_of(plan)[:, :, arm.driven]
    still = points[:, -1:] * np.array([1.0, 0.0, 0.0])[:, np.newaxis, np.newaxis]
    points = np.concatenate((points, np.repeat(still, round(rest / PERIOD), axis=1)), axis=1)
    names = ("set_phi", "set_phid", "set_phidd")
    t = PERIOD * np.arange(points.shape[1], dtype=np.float64)
    with FmuRun(cached_fmu(arm.unit, "native"), arm.unit, {**arm.starts, **start}) as fmu:
        found = fmu.over(t, dict(zip(names, points, strict=True)))
    shown = [name for one in arm.unit.variables if one.causality == "output" for name in one.names]
    values = found[:, [shown.index(name) for name in arm.outputs]]
    count, driven_count = len(arm.robot.coordinates), len(arm.driven)
    ends = np.cumsum([count, count, driven_count])
    parts = dict(zip(("q", "qd", "u", "i_a"), np.split(values, ends, axis=1), strict=True))
    return {**parts, "all": values}


def written(path: Path, columns: Mapping[str, FloatArray]) -> Path:
    """Return a table (CSV) of columns, every value as the shortest text that gives the same double."""
    rows = np.column_stack([*columns.values()]).tolist()
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def joint_log(path: Path, arm: Chain, q: FloatArray) -> Path:
    """Return a log (CSV) of the joints of an arm, a row every 5 ms."""
    units = ["rad" if one.kind == "revolute" else "m" for one in arm.moving]
    t = {"t (s)": np.array([round(PERIOD * k, 9) for k in range(len(q))])}
    names = [f"{name} ({unit})" for name, unit in zip(arm.coordinates, units, strict=True)]
    return written(path, {**t, **dict(zip(names, q.T, strict=True))})


def set_points_log(path: Path, plan: PlannedPath, joints: list[int]) -> Path:
    """Return a table (CSV) of the set points of some joints: theta1, omega1, alpha1, theta2, ..."""
    columns = {"t (s)": np.array([round(PERIOD * k, 9) for k in range(len(plan))])}
    for k, joint in enumerate(joints, start=1):
        columns |= {f"{name}{k}": points for name, points in zip(
            ("theta", "omega", "alpha"), joints_of(plan)[:, :, joint], strict=True
        )}  # fmt: skip
    return written(path, columns)
