"""Sound logs have no warning of plausibility; the messages are in plausibility.cases."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from arm_motion import KINDS, arm, clock, found
from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.plausibility import largest_steps

FORMATS: dict[str, tuple[str, Callable[[FloatArray], FloatArray]]] = {
    "exact": ("rad", lambda q: q),
    "2 decimals": ("rad", lambda q: np.round(q, 2)),
    "whole degrees": ("deg", lambda q: np.radians(np.round(np.degrees(q), 0))),
    "noise": ("rad", lambda q: q + np.random.default_rng(5).normal(0.0, 1e-3, q.shape)),
}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("spoiled", ["even", "jitter", "lost rows", "lost values", "wrapped"])
def test_sound_logs_have_no_warning(form: str, spoiled: str) -> None:
    rng, (unit, rounded) = np.random.default_rng(6), FORMATS[form]
    for period in (0.001, 0.005, 0.05, 0.2):
        t = clock(int(rng.integers(20, 2000)), period)
        joints = int(rng.integers(1, 8))
        swings = np.sin(np.outer(t, rng.uniform(0.1, 1.9, joints)) + rng.uniform(0.0, 6.0, joints))
        q = swings * rng.uniform(0.2, 1.0, joints)  # up to 1.9 rad/s
        if spoiled == "wrapped":
            q = np.mod(q + 3.0 + np.pi, 2.0 * np.pi) - np.pi
        q = rounded(q)
        if spoiled == "jitter":
            t = t + rng.uniform(0.0, 0.9 * period, len(t))
        elif spoiled == "lost rows":
            kept = np.sort(rng.choice(len(t), len(t) * 9 // 10, replace=False))
            t, q = t[kept], q[kept]
        elif spoiled == "lost values":
            q = np.where(rng.random(q.shape) < 0.05, np.nan, q)
        assert found(q, t, arm(joints, velocity=2.2), unit=unit) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "pattern", ["coppeliasim.csv", "matlab.csv", "counter_rotating.csv", "solidworks/phi*.csv"]
)
def test_bundled_logs_have_no_warning(pattern: str) -> None:
    run = ingest_log(sorted(LOGS.glob(pattern)), robot=load_robot("urm6"))
    assert {warning.kind for warning in run.warnings} <= {"assumed-unit"}


REAL = {
    "ur5e-rtde-static/robot_data.csv": "ur5e",
    "ur-rtde-10rows/robot_data.csv": "ur5e",
    "panda-matlab-ascii/q_Traj1_Grad.txt": None,
    "panda-matlab-ascii/q_Traj1_PI.txt": None,
    "unitree-z1-noheader/joint_states.csv": None,
    "pybotics-ur10-fk/ur10-joints-poses.csv": "ur10",
}


@pytest.mark.slow
@pytest.mark.parametrize("file", REAL)
def test_sound_real_logs_have_no_warning(file: str, shared: Path) -> None:
    robot = load_robot(name) if (name := REAL[file]) else None
    joints = ("1", "2", "3", "4", "5", "6") if "unitree" in file else ()  # of its twelve columns
    run = ingest_log([shared / "logs" / file], robot=robot, read=LogMap(joints=joints))
    assert KINDS & {warning.kind for warning in run.warnings} == set()


def test_a_real_log_has_an_outlier_which_stays(shared: Path) -> None:
    run = ingest_log([shared / "logs" / "nurds-2joint" / "joint_states.csv"])
    (warning,) = [one for one in run.warnings if one.kind in KINDS]
    assert (warning.kind, warning.row) == ("outlier-first", 1)
    assert "joint1 by 0.6856 rad (other steps: at most 0.09092);" in warning.message
    assert run.log.q[0, 0] == 0.7116998434066772


def test_the_largest_step_is_that_of_numpy() -> None:
    for rows in (2, 63, 64, 65, 16_384, 16_385, 40_000):
        q = np.random.default_rng(rows).normal(size=(rows, 5))
        np.testing.assert_array_equal(largest_steps(q), np.abs(np.diff(q, axis=0)).max(axis=0))
        q[rows // 2, 3] = np.nan
        assert np.isnan(largest_steps(q)).tolist() == [False, False, False, True, False]
