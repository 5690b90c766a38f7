"""Every real log of ../shared/logs: right, or one question whose printed answer leads to what it holds.

What must be read of each comes from numpy, csv and regular expressions here, never from the reader."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from asking import Truth, judge, outcome
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.logs import LogMap

LOGS = Path(__file__).resolve().parents[4].parent / "shared" / "logs"
pytestmark = pytest.mark.skipif(not LOGS.is_dir(), reason="the real logs in ../shared/logs are not here")

DEG = np.pi / 180


def exact_epoch(texts: list[str]) -> FloatArray:
    """Return times from the first of decimal texts, which floats of 1.7e9 s do not hold."""
    whole = [(int(text.split(".")[0]), float("0." + text.split(".")[1])) for text in texts]
    return np.array([(a - whole[0][0]) + (b - whole[0][1]) for a, b in whole])


def named(path: Path, joints: list[str], time: str = "", delimiter: str = ",") -> Truth:
    """Return columns by name of a CSV file."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file, delimiter=delimiter))
    q = np.array([[float(row[name]) for name in joints] for row in rows])
    t = exact_epoch([row[time] if "." in row[time] else row[time] + ".0" for row in rows]) if time else None
    return Truth(q, t, t_within=1e-7)


def abb(path: Path) -> Truth:
    return Truth(np.loadtxt(path, delimiter=","))


def recorder(path: Path) -> Truth:
    """Return six joints and their rates behind sec and nsec, under a title and two header lines."""
    values = np.array(
        [line.rstrip(",\n").split(",") for line in path.read_text().splitlines()[4:] if line.strip()]
    )
    seconds, nanoseconds = values[:, 0].astype(np.int64), values[:, 1].astype(np.int64)
    t: FloatArray = ((seconds - seconds[0]) * 10**9 + nanoseconds - nanoseconds[0]) / 1e9
    return Truth(values[:, 2:8].astype(float), t, qd=values[:, 8:14].astype(float))


def motoman(path: Path) -> Truth:
    """Return two arms of six axes and a station of two, in rad; a question may lead to the first arm."""
    cells = [line.split(",") for line in path.read_text().splitlines()]
    values = np.array(cells, dtype=float)
    t: FloatArray = np.asarray(np.round(values[:, 0] - values[0, 0], 6))
    return Truth(values[:, 1:], t, t_within=2e-6, answers=(values[:, 1:7], values[:, 7:13], values[:, 1:13]))


def isaac(path: Path) -> Truth:
    return named(path, ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"])


def mujoco(path: Path) -> Truth:
    return named(path, [f"j{k}" for k in range(6)], "time")


def plc(path: Path) -> Truth:
    """Return phi_r_1 to phi_r_6 in deg at 0.8 ms."""
    found = re.findall(r"^phi_r_(\d+) : ARRAY\[.*?\] OF REAL := \[(.*?)\]", path.read_text(), re.M)
    values = np.column_stack([np.array(text.split(","), dtype=float) for _, text in sorted(found)])
    t: FloatArray = 0.0008 * np.arange(len(values), dtype=np.float64)
    return Truth(values * DEG, t, t_within=1e-7)


def youbot(path: Path) -> Truth:
    """Return the five joints behind phi, x, y; the last row is an end mark of zeros."""
    rows = np.loadtxt(path, delimiter=",")
    return Truth(rows[: len(rows) - (not rows[-1].any()), 3:8])


def unitree(path: Path) -> Truth:
    return Truth(np.loadtxt(path, delimiter=",")[:, :6])


def rtde(path: Path) -> Truth:
    rows = [line.split(" ") for line in path.read_text().splitlines() if line.strip()]
    names, cells = rows[0], rows[1:]
    q = np.array([[float(row[names.index(f"actual_q_{k}")]) for k in range(6)] for row in cells])
    return Truth(q, exact_epoch([row[0] for row in cells]), t_within=1e-6)


def fri(path: Path) -> Truth:
    lines = path.read_text().splitlines()
    q = np.array([[float(cell) for cell in line.split("[")[1].split("]")[0].split(",")] for line in lines])
    t = np.array([float(line.split()[1]) for line in lines])
    return Truth(q, t - t[0], t_within=1e-6)


def panda(path: Path) -> Truth:
    return Truth(np.loadtxt(path))


def nurds(path: Path) -> Truth:
    return named(path, ["joint1", "joint2"], "timestamp")


def rostopic(path: Path) -> Truth:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    stamps = [int(row["%time"]) for row in rows]
    q = np.array([[float(row[f"field.position{k}"]) for k in range(6)] for row in rows])
    return Truth(q, np.array([(stamp - stamps[0]) / 1e9 for stamp in stamps]))


def pybotics(path: Path) -> Truth:
    return Truth(np.loadtxt(path, delimiter=",")[:, :6] * DEG)


def tracker(path: Path) -> Truth:
    names = [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ]
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file, delimiter=";"))
    return Truth(np.array([[float(row[name].replace(",", ".")) for name in names] for row in rows]))


def calibration(path: Path) -> Truth:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))[1:]
    return Truth(np.array([[float(cell) for cell in row[:6]] for row in rows]) * DEG)


Oracle = Callable[[Path], Truth]

LOGS_READ: Mapping[str, tuple[Oracle, str]] = {
    "abb-egm-irb120/theta_actual.txt": (abb, ""),
    "abb-egm-irb120/theta_desired.txt": (abb, ""),
    "traj-recorder-ros2/salva.csv": (recorder, ""),
    "motoman-dx200/joint_recording.csv": (motoman, ""),
    "kuka-weigand-plc/data_target_system.txt": (plc, ""),
    "ur5e-isaaclab/joint_log.csv": (isaac, ""),
    "ur5-mujoco-rttsa/joint_trajectory.csv": (mujoco, ""),
    "iiwa-dmp-text/iiwa_example1.txt": (fri, ""),
    "iiwa14-fri-text/iiwa14_singularity_change_config.txt": (fri, "iiwa14"),
    "iiwa14-fri-text/pour1.txt": (fri, ""),
    "nurds-2joint/joint_states.csv": (nurds, ""),
    "panda-matlab-ascii/q_Traj1_Grad.txt": (panda, ""),
    "panda-matlab-ascii/q_Traj1_PI.txt": (panda, ""),
    "plotjuggler/fake_joints.csv": (rostopic, ""),
    "pybotics-ur10-fk/ur10-joints-poses.csv": (pybotics, ""),
    "unitree-z1-noheader/joint_states.csv": (unitree, ""),
    "ur-rtde-10rows/robot_data.csv": (rtde, "ur5e"),
    "ur10-laser-tracker/measurements_grid.csv": (tracker, "ur10"),
    "ur5-factory-calibration/joint-eef-data.csv": (calibration, "ur5e"),
    "ur5e-rtde-static/robot_data.csv": (rtde, "ur5e"),
}
"""What must be read of each, and the robot that is given with it, if any."""

NO_LOGS = (
    "ur5-factory-calibration/calibration.conf",
    "ur5-factory-calibration/urcontrol.conf.UR5",
    "ur10-laser-tracker/tracker_probe_to_flange.txt",
    "plotjuggler/turtle.csv",
    "panda-matlab-ascii/frankaEmikaPanda.urdf",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGS_READ)
def test_a_real_log_is_read_right_or_asked_about(name: str) -> None:
    oracle, robot = LOGS_READ[name]
    path = LOGS / name
    verdict = judge([path], oracle(path), LogMap(), load_robot(robot) if robot else None)
    assert verdict.good, verdict


@pytest.mark.parametrize("name", NO_LOGS)
def test_what_is_no_log_gets_one_line(name: str) -> None:
    came = outcome([LOGS / name], LogMap(), None).came
    assert isinstance(came, UrmpipeError), came
    assert len(str(came).splitlines()) == 1
    # No unit of anything would make it a log.
    assert not [hint for one in came.findings for hint in one.hints if hint.parameter == "unit"], came


def test_the_wheels_of_a_youbot_are_asked_about_before_any_unit() -> None:
    """Which columns are joints only its owner knows: five behind phi, x and y, and before four wheels."""
    path = LOGS / "youbot-vrep-scene8" / "configurations.csv"
    first = outcome([path], LogMap(), None)
    assert isinstance(first.came, UrmpipeError), first.said
    about = {hint.parameter for one in first.came.findings for hint in one.hints}
    assert "joints" in about and "unit" not in about, first.said
    verdict = judge([path], youbot(path), LogMap(joints=("4", "5", "6", "7", "8")), None)
    assert verdict.good, verdict
