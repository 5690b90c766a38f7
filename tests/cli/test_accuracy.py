"""`urmpipe accuracy` with native FMUs: the error that decides, and the same motion by `simulate`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import urmpipe
from answered import full_answer
from driven_paths import CONTOUR, PERIOD, begun, joint_log, planned, set_points_log
from urmpipe_fmus.native import native_unavailable_reason
from urmpipe_models.planning.path import cube_rows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import robot_toml

ROUNDED = 1e-11
"""The planner solves the joints for the tool to within 1e-12 m of the path, of whose points there are two."""


@pytest.mark.slow
def test_the_error_that_decides_is_chosen_and_a_cube_is_its_rows() -> None:
    # as short a path as reaches 0.3 m/s; the contour of test_iso9283_accuracy.py begins there: the same FMU
    cube = "cube:wall,a=0.1,r=0.01,x=1.7,y=0.25,z=1"
    between = 0.0021  # m: between the two errors at 0.3 m/s
    line = f"accuracy --robot irb60 --path {cube} --limit {between} --velocities 0.27,0.3"
    keys = ("verdict", "limited_error", "errors", "path_errors", "running_speed", "probed")
    by_time, by_path = (full_answer(f"{line} --error {which}", *keys)[:2] for which in ("time", "path"))
    assert [code for code, _ in (by_time, by_path)] == [1, 0]
    assert [found["verdict"] for _, found in (by_time, by_path)] == ["fail", "pass"]
    assert [found["limited_error"] for _, found in (by_time, by_path)] == ["time", "path"]
    found = by_path[1]
    error, speed = found["errors"][1], found["running_speed"]
    assert found["path_errors"][1] < between < error
    is_within = {one["velocity"]: one["path_error"] <= between for one in found["probed"]}
    assert is_within[speed]
    assert min(v for v, good in is_within.items() if not good and v > speed) <= 1.01 * speed * (1 + 1e-12)
    assert 0.3 in is_within
    rows = cube_rows("wall", 0.1, 0.01, np.array([1.7, 0.25, 1.0]))
    assert [one.error for one in urmpipe.accuracy(rows, "irb60", velocities=[0.3]).errors] == [error]


@pytest.mark.slow
@pytest.mark.skipif(
    bool(native_unavailable_reason(())), reason=f"runs native FMUs: {native_unavailable_reason(())}"
)
def test_driven_arm_from_a_log_compared_with_the_plan_has_the_errors_of_accuracy(tmp_path: Path) -> None:
    velocity = 1.0  # m/s: on the way voltages are at their limits and below
    arm = load_robot("irb60")
    plan = planned(CONTOUR, arm, velocity, tmp_path / "plan.csv")
    (tmp_path / "arm.toml").write_text(robot_toml(begun(arm, plan)), encoding="utf-8")
    set_points_log(tmp_path / "points.csv", plan, [0, 1, 2])
    inputs = "".join(
        f'"arm.{name}[{k}]" = {{ log = "points.csv", column = "{column}{k}" }}\n'
        for k in (1, 2, 3)
        for column, name in (("theta", "set_phi"), ("omega", "set_phid"), ("alpha", "set_phidd"))
    )
    (tmp_path / "system.toml").write_text(
        f'[system]\nstep = {PERIOD}\n[blocks.arm]\nunit = "driven_arm"\nrobot = "arm.toml"\n'
        f"start = {{ force = [0.0, 0.0, 0.0], moment = [0.0, 0.0, 0.0] }}\n[inputs]\n{inputs}",
        encoding="utf-8",
    )
    simulated = urmpipe.simulate(tmp_path / "system.toml")
    assert simulated.failed is None
    log = joint_log(tmp_path / "log.csv", arm, simulated.signal("arm.phi").values)
    (run,) = urmpipe.compare(tmp_path / "plan.csv", log, robot="irb60").runs
    (errors,) = urmpipe.accuracy(CONTOUR, arm, velocities=[velocity]).errors
    assert run.start == pytest.approx([0.0] * 4, abs=ROUNDED)  # at rest it is where the path begins
    assert errors.error is not None and errors.path_error is not None
    assert errors.path_error > 1e-4  # m: there is something to compare
    assert run.statistics["norm"].max == pytest.approx(errors.error, rel=0, abs=ROUNDED)
    assert run.statistics["path"].max == pytest.approx(errors.path_error, rel=0, abs=ROUNDED)
