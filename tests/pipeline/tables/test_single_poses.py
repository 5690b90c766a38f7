"""Targets solved without times leave as poses: nothing joins them, so there is no time and no velocity."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from exported import export_result
from solved import solved
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline import results
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables import ExportOptions, Format


@pytest.fixture
def run() -> Run:
    """Two targets without times, both reached."""
    robot = load_robot("ur5e")
    q = np.array([[1.7, -1.8, -1.5, -3.5, 1.6, -0.7], [-0.3, 0.1, 1.3, -0.6, 1.1, -2.4]])
    return solved("poses", robot, q).as_run()


def test_a_table_of_single_poses_counts_rows_and_has_nothing_per_second(run: Run, tmp_path: Path) -> None:
    assert not run.timed and run.robot is not None
    joints = [f"{joint.name} [rad]" for joint in run.robot.moving]
    wanted = ["row", *joints, "px [m]", "py [m]", "pz [m]", "rz [rad]", "ry [rad]", "rx [rad]"]
    formats: tuple[Format, ...] = ("csv", "parquet")
    for to in formats:
        found = export_result(run, tmp_path / f"poses.{to}", ExportOptions(to))
        assert [name for name, _ in found.columns] == wanted
    head, first, second = (tmp_path / "poses.csv").read_text().splitlines()
    assert (head.split(",")[0], first.split(",")[0], second.split(",")[0]) == ("row", "1", "2")


def test_a_mat_file_of_single_poses_has_no_times_and_nothing_per_second(run: Run) -> None:
    rows = results.exports(run).rows["grid"]
    fields = rows.fields(rows.table())
    assert [name for name in ("t", "clock_ns", "qd", "qdd", "v", "a") if fields[name].size] == []
    np.testing.assert_array_equal(fields["q"], run.q)
