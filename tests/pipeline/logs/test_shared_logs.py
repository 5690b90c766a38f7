"""Real logs from public repositories, held beside this one: read right, or refused in one line."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import urmpipe
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import LogError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import PASSED_OVER
from urmpipe_pipeline.logs import LogMap, read_log

Arm = Callable[..., Chain]

LOGS = Path(__file__).resolve().parents[3].parent / "shared" / "logs"
pytestmark = pytest.mark.skipif(not LOGS.is_dir(), reason="the real logs in ../shared/logs are not here")


def kinds(warnings: tuple[object, ...]) -> list[str]:
    return [warning.kind for warning in warnings]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("folder", "rows", "period"), [("ur5e-rtde-static", 256, 0.1), ("ur-rtde-10rows", 10, 0.008)]
)
def test_ur_rtde(folder: str, rows: int, period: float, arm: Arm) -> None:
    path = LOGS / folder / "robot_data.csv"
    log = read_log([path], robot=arm(6))
    with path.open(newline="") as file:
        table = [line for line in csv.reader((line.strip("\r\n") for line in file), delimiter=" ") if line]
    names, last = table[0], table[-1]
    assert (log.source, log.rows, log.period, log.first_line) == ("ur-rtde", rows, period, 2)
    assert log.joints == tuple(f"actual_q_{k}" for k in range(6))
    assert log.q[-1].tolist() == [float(last[names.index(f"actual_q_{k}")]) for k in range(6)]
    assert log.qd is not None
    assert log.qd[-1].tolist() == [float(last[names.index(f"actual_qd_{k}")]) for k in range(6)]
    assert log.tcp_position is not None
    assert log.tcp_position[-1].tolist() == [
        float(last[names.index(f"actual_TCP_pose_{k}")]) for k in range(3)
    ]
    assert log.tcp_quat_xyzw is not None
    assert kinds(log.warnings) == [PASSED_OVER]


def test_epoch_of_ur_rtde_is_exact() -> None:
    """4029.5389999999998 and 4029.6389999999997 are 100 ms apart."""
    log = read_log([LOGS / "ur5e-rtde-static" / "robot_data.csv"])
    assert log.t_ns[:3].tolist() == [0, 100_000_000, 200_000_000]
    assert log.clock_start == 4029.539


def test_rostopic_echo(arm: Arm) -> None:
    log = read_log([LOGS / "plotjuggler" / "fake_joints.csv"], robot=arm(6))
    assert (log.source, log.rows, log.clock_start) == ("ros", 2725, 1486559106139796569 / 10**9)
    assert log.t_ns[:3].tolist() == [0, 564_113, 1_633_048]
    assert log.joints == tuple(f"field.position.joint_{k}" for k in range(6))
    assert log.q[1, 0] - log.q[0, 0] == pytest.approx(-3.99473, abs=1e-5)  # the jump that is no wrap
    assert log.q[-1].tolist() == [0.576058272031] * 6
    assert log.qd is not None
    assert not log.qd.any()
    assert kinds(log.warnings) == ["gap"]


def test_plotjuggler_with_empty_cells() -> None:
    path = LOGS / "plotjuggler" / "turtle.csv"
    with pytest.raises(
        LogError, match=r"found no joint columns in /turtle1/cmd_vel/angular/x, .*--joints A,B,C"
    ):
        read_log([path])
    column = "/turtle2/cmd_vel/angular/z"
    log = read_log([path], LogMap(joints=("/turtle1/cmd_vel/linear/x", column)))
    assert (log.source, log.rows, log.joints[1]) == ("plotjuggler", 563, column)
    assert log.clock_start == 1396293888.886
    assert np.isnan(log.q[0, 0])
    assert log.q[0, 1] == -1.286809
    assert log.q[6, 0] == 2.0
    assert [(w.row, w.message) for w in log.warnings if w.kind == "missing"] == [
        (first, f"{name} has no value in {np.isnan(log.q[:, j]).sum()} of 563 rows, first in this one")
        for j, (name, first) in enumerate(zip(log.joints, (1, 7), strict=True))
    ]


def test_quoted_and_padded_dates() -> None:
    """01/20/2021 can only be the 20th of January."""
    path = LOGS / "plotjuggler" / "simple_parse_timestamp.csv"
    log = read_log([path], LogMap(joints=("A", "B", "C", "D"), unit={"": "rad"}))
    assert log.t_ns.tolist() == [0, 200_000_000, 400_000_000, 600_000_000, 610_000_000]
    assert log.clock_start_ns == 1_611_137_492_332_000_000  # 2021-01-20 10:11:32.332 UTC
    assert log.units["timestamp"] == "date"
    assert np.isnan(log.q[3, 3])
    assert log.q[3, :3].tolist() == [6.0, 4.0, -2.0]


def test_epoch_in_seconds(arm: Arm) -> None:
    path = LOGS / "nurds-2joint" / "joint_states.csv"
    log = read_log([path], robot=arm(2))
    assert (log.rows, log.joints) == (986, ("joint1", "joint2"))
    assert log.t_ns[1] == 10_108_700  # 1740416404.0571585 - 1740416404.0470498, which floats cannot hold
    assert log.q[0].tolist() == [0.7116998434066772, 0.006745942402631044]
    assert kinds(log.warnings) == ["assumed-unit"]
    with pytest.raises(
        LogError, match=r"found 2 joint columns \(joint1, joint2\) and none with number 3, 4, 5, 6, "
    ):
        read_log([path], robot=arm(6))


@pytest.mark.parametrize("joints", [6, None])
def test_twelve_columns_without_a_header_are_asked_about(arm: Arm, joints: int | None) -> None:
    path = LOGS / "unitree-z1-noheader" / "joint_states.csv"
    robot = arm(joints) if joints else None
    with pytest.raises(LogError, match="found 12 columns that no header names") as asked:
        read_log([path], robot=robot)
    answer = asked.value.findings[0].hints[0].value
    assert answer == ["1-6"]
    log = read_log([path], LogMap(joints=tuple(map(str, answer))), robot)
    assert log.q.shape == (2099, 6)
    assert log.q[0, 1] == 0.7844660375193842
    assert (log.first_line, log.period) == (1, 0.005)
    assert kinds(log.warnings) == ["assumed-period", "assumed-unit"]


@pytest.mark.parametrize(
    ("name", "first"), [("q_Traj1_PI.txt", 0.76916151), ("q_Traj1_Grad.txt", -0.16159558)]
)
def test_matlab_save_ascii(name: str, first: float, arm: Arm) -> None:
    log = read_log([LOGS / "panda-matlab-ascii" / name], LogMap(period=0.01), arm(7))
    assert log.q.shape == (1001, 7)
    assert log.q[0, 0] == first
    np.testing.assert_array_equal(log.q, np.loadtxt(LOGS / "panda-matlab-ascii" / name))
    assert log.period == 0.01
    assert log.digits is None  # eight digits are not coarse


def test_joints_and_matrices_without_header(arm: Arm) -> None:
    path = LOGS / "pybotics-ur10-fk" / "ur10-joints-poses.csv"
    with pytest.raises(
        LogError, match=r"found values up to 179 in phi1, .* and no unit, allowed: rad or deg"
    ):
        read_log([path], robot=arm(6))
    log = read_log([path], LogMap(unit={"": "deg"}), arm(6))
    np.testing.assert_array_equal(log.q[0], np.array([-45, 147, -39, 96, 49, 67]) * (np.pi / 180))
    assert (log.rows, log.first_line) == (20, 2)


@pytest.mark.parametrize(
    ("name", "rows", "period", "start", "first", "last"),
    [
        ("iiwa-dmp-text/iiwa_example1.txt", 1724, 0.003, 12.39, -0.0001, -0.1573),
        ("iiwa14-fri-text/pour1.txt", 1625, 0.003, 6.159, -0.05752, 0.00001),
        ("iiwa14-fri-text/iiwa14_singularity_change_config.txt", 994, 0.015, 0.015, -0.05576, -0.06191),
    ],
)
def test_fri_text(
    name: str, rows: int, period: float, start: float, first: float, last: float, arm: Arm
) -> None:
    path = LOGS / name
    log = read_log([path], robot=arm(7))
    assert (log.source, log.rows, log.period, log.clock_start) == ("fri", rows, period, start)
    assert log.joints == tuple(f"q_{k + 1}" for k in range(7))
    assert (log.q[0, 0], log.q[-1, 6]) == (first, last)
    lists = [line.split("[")[1].split("]")[0] for line in path.read_text().splitlines()]
    np.testing.assert_array_equal(log.q, [[float(cell) for cell in text.split(",")] for text in lists])
    assert log.tcp_position is None  # p0 is a virtual position
    assert not log.warnings


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("README.md", r"cells, allowed: a table$"),
        ("panda-matlab-ascii/frankaEmikaPanda.urdf", r"found the model of a robot, allowed: a text table; "),
    ],
)
def test_text_that_is_no_log(name: str, said: str) -> None:
    with pytest.raises(LogError, match=said):
        read_log([LOGS / name])


def test_eighteen_measured_points_are_poses_of_a_ur5e() -> None:
    result = urmpipe.compare(LOGS / "ur5-factory-calibration" / "joint-eef-data.csv")
    (one,) = result.runs
    assert (one.run.log.rows, one.run.timed, one.run.robot and one.run.robot.name) == (18, False, "ur5e")
    assert {one.run.log.units[name] for name in one.run.log.joints} == {"deg"}
    assert one.run.log.units["X"] == "mm"
    norm = one.statistics["norm"]
    assert (round(1e3 * norm.mean, 2), round(1e3 * norm.max, 2)) == (1.08, 1.72)
    assert not result.warnings and not result.assumptions


def test_a_grid_that_a_laser_tracker_measured() -> None:
    """Its clock is a label: dates of digits alone, which run backwards in nine places."""
    path = LOGS / "ur10-laser-tracker" / "measurements_grid.csv"
    log = read_log([path])
    assert (log.rows, log.timed, log.externally_measured) == (11_911, False, True)
    assert not [column for column in log.columns if column.role == "time"]
    known = read_log([path], robot=load_robot("ur10"))
    assert known.rotation_form == "xyz"
    assert {known.units[f"measurement_{axis}"] for axis in "xyz"} == {"mm"}
    assert {known.units[f"measurement_r{axis}"] for axis in "xyz"} == {"deg"}


def test_random_poses_without_a_header() -> None:
    path = LOGS / "pybotics-ur10-fk" / "ur10-joints-poses.csv"
    log = read_log([path], LogMap(unit={"": "deg"}), load_robot("ur10"))
    assert (log.rows, log.timed) == (20, False)
