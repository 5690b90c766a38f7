"""Calibrated and real robots against a recorded TCP; the messages are in recorded_tcp.cases."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log, positions_over_log
from urmpipe_models.math3d import from_offset, translation
from urmpipe_models.robots.catalogue import kinematically_distinct_names, load_robot, robot_names
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.recorded_tcp import recorded_tcp_warnings

SIX = [name for name in robot_names() if len(load_robot(name).moving) == 6]
SAME_KINEMATICS = {"ur3": "ur3e", "ur3e": "ur3"}
ARMS = [name for name in kinematically_distinct_names() if len(load_robot(name).moving) in {4, 6, 7}]
REAL = {
    "ur5e-rtde-static/robot_data.csv": ("ur5e", {}),
    "ur-rtde-10rows/robot_data.csv": ("ur5e", {}),
    "ur5-factory-calibration/joint-eef-data.csv": ("ur5e", {}),
    "pybotics-ur10-fk/ur10-joints-poses.csv": ("ur10", {"": "deg"}),
}


def swing(joints: int = 6) -> FloatArray:
    t = np.linspace(0, 1, 60)[:, None]
    return 0.4 + np.arange(joints) * 0.3 + 0.5 * np.sin(t * (1 + 0.4 * np.arange(joints)))


def log_of(q: FloatArray, recorded: FloatArray) -> JointLog:
    names = tuple(f"q{k}" for k in range(1, 7))
    return JointLog("log", "table", (), np.arange(len(q)) * 5_000_000, names, q, tcp_position=recorded)


def calibrated(robot: Chain, size: float, rng: np.random.Generator) -> Chain:
    """Return an arm as it was built: its frames are off by a size in [m], and in [rad] per half a metre."""
    frames = [
        replace(
            joint, origin=joint.origin @ from_offset([*rng.normal(0, size, 3), *rng.normal(0, 2 * size, 3)])
        )
        for joint in robot.joints
    ]
    return replace(robot, joints=tuple(frames))


def any_motion(rng: np.random.Generator) -> FloatArray:
    """Joints that swing, some of them or all, little or much, about any pose or a square one."""
    t = np.linspace(0, 1, int(rng.choice([12, 60, 300])))[:, None]
    about = rng.choice(np.pi / 2 * np.arange(-2, 3), 6) if rng.random() < 0.5 else rng.uniform(-3, 3, 6)
    wide = rng.uniform(0, 1.5, 6) * rng.choice([0.02, 0.1, 0.5, 1.0]) * (rng.random(6) < rng.choice([0.3, 1]))
    return np.asarray(about + wide * np.sin(t * rng.uniform(0.5, 6, 6) + rng.uniform(0, 6, 6)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_the_recorded_tcp_identifies_a_robot(name: str, tmp_path: Path) -> None:
    robot = load_robot(name)
    joints = len(robot.moving)
    table = np.column_stack((0.005 * np.arange(60), swing(joints), positions_over_log(robot, swing(joints))))
    header = ["t [s]", *(f"q{k} [rad]" for k in range(1, joints + 1)), "x [m]", "y [m]", "z [m]"]
    np.savetxt(tmp_path / "log.csv", table, "%.9f", ",", header=",".join(header), comments="")
    run = ingest_log([tmp_path / "log.csv"])
    assert run.robot == robot and run.tcp is not None
    (inference,) = [one for one in run.log.inferences if one.what == "robot"]
    assert inference.value == name and inference.evidence.startswith("its kinematics come within ")


@pytest.mark.slow
@pytest.mark.parametrize("true", SIX)
def test_another_robot_of_the_catalogue_is_found_with_a_tool_and_a_calibration(true: str) -> None:
    rng = np.random.default_rng(SIX.index(true))
    tool = translation(0.02, 0.0, 0.15)
    recorded = positions_over_log(calibrated(load_robot(true).placed(tool=tool), 3e-4, rng), swing())
    assert recorded_tcp_warnings(load_robot(true), log_of(swing(), recorded)) == []
    for other in sorted({*SIX} - {true, SAME_KINEMATICS.get(true)}):
        (warning,) = recorded_tcp_warnings(load_robot(other), log_of(swing(), recorded))
        assert ("robot", true) in [(hint.parameter, hint.value) for hint in warning.hints]


@pytest.mark.slow
def test_right_logs_have_no_warning() -> None:
    """With the calibration of a real arm, noise and rounding, a tool that is set or not."""
    for seed in range(48):
        rng = np.random.default_rng(seed)
        robot, q = load_robot(SIX[seed % len(SIX)]), any_motion(rng)
        tool = from_offset([*rng.uniform(-0.1, 0.2, 3), *rng.uniform(-1, 1, 3)])
        real = calibrated(robot.placed(tool=tool), rng.choice([0.0, 3e-4, 6e-4]), rng)
        noisy = positions_over_log(real, q) + rng.normal(0, rng.choice([0, 1e-4, 1e-3]), (len(q), 3))
        log = log_of(q, np.round(noisy, rng.choice([4, 9])))
        if seed % 2:
            rotation = poses_over_log(real, q)[1].reshape(-1, 9)
            log = replace(log, tcp_rotation=rotation, rotation_form="matrix")
        set_up = robot.placed(tool=tool) if seed % 3 else robot
        assert recorded_tcp_warnings(set_up, log) == [], f"seed {seed}"


@pytest.mark.slow
@pytest.mark.parametrize("file", REAL)
def test_real_logs_differ_from_any_other_robot(file: str, shared: Path) -> None:
    robot, unit = REAL[file]
    run = ingest_log([shared / "logs" / file], robot=load_robot(robot), read=LogMap(unit=unit))
    assert [one for one in run.warnings if one.kind.startswith("recorded-tcp")] == []
    for other in [] if "10rows" in file else sorted({*SIX} - {robot}):
        (warning,) = recorded_tcp_warnings(load_robot(other), run.log)
        assert [(hint.parameter, hint.value) for hint in warning.hints] == [("robot", robot)], other
        assert f": the kinematics of {robot} agree within " in warning.message
