"""What the tests of exports share: a run with everything, and a comparison of two logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run

START_NS = 1_700_000_000_123_456_789
"""A clock of our years, to the nanosecond."""


def write_log(path: Path, rows: int = 40, *, shift: float = 0.0, pose: bool = True) -> Path:
    """Write a log of a UR5e that turns past +pi, with the pose that it recorded itself."""
    t = np.arange(rows) * 0.01
    q = np.degrees(np.column_stack([3.0 + 2.0 * t, *(0.2 * k + 0.5 * np.sin(t + k) for k in range(5))]))
    q = (q + 180.0) % 360.0 - 180.0
    position, _ = poses_over_log(load_robot("ur5e"), np.radians(q))
    names = ["stamp [ns]", *(f"q{k} [deg]" for k in range(1, 7))]
    names += ["x [mm]", "y [mm]", "z [mm]"] if pose else []
    lines = [",".join(names)]
    for k in range(rows):
        cells = [f"{value:.6f}" for value in q[k]]
        cells += [repr(value) for value in ((position[k] + shift) * 1e3).tolist()] if pose else []
        lines.append(",".join([str(START_NS + 10_000_000 * k), *cells]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run with a robot, a wrap, and a recorded position."""
    log = write_log(tmp_path_factory.mktemp("run") / "log.csv")
    return ingest_log([log], robot=load_robot("ur5e"))


@pytest.fixture(scope="session")
def comparison(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    """Two logs held against a run; the second one is shorter."""
    folder = tmp_path_factory.mktemp("comparison")
    robot = load_robot("ur5e")
    names = (("a, first", 40), ("b", 30))
    logs = [ingest_log([write_log(folder / f"{name}.csv", rows)], robot=robot) for name, rows in names]
    return compare_runs(run, logs)
