"""Which robot of the catalogue wrote a log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.math3d import translation
from urmpipe_models.robots.catalogue import kinematically_distinct_names, load_robot
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run

ROWS = 60
ARMS = [name for name in kinematically_distinct_names() if len(load_robot(name).moving) in {4, 6, 7}]


def motion(joints: int = 6) -> FloatArray:
    t = np.linspace(0, 1, ROWS)[:, None]
    return 0.4 + np.arange(joints) * 0.3 + 0.5 * np.sin(t * (1 + 0.4 * np.arange(joints)))


def ingest(path: Path, names: list[str], values: FloatArray) -> Run:
    table = np.column_stack((np.arange(ROWS) * 0.005, values))
    np.savetxt(path, table, "%.9f", ",", header=",".join(["t [s]", *names]), comments="")
    return ingest_log([path])


JOINTS = [f"q{k} [rad]" for k in range(1, 8)]
XYZ = ["x [m]", "y [m]", "z [m]"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_the_recorded_tcp_singles_a_robot_out(name: str, tmp_path: Path) -> None:
    robot = load_robot(name)
    joints = len(robot.moving)
    q = motion(joints)
    recorded = np.hstack((q, positions_over_log(robot, q)))
    run = ingest(tmp_path / "log.csv", [*JOINTS[:joints], *XYZ], recorded)
    assert run.robot == robot
    assert run.tcp is not None
    (said,) = [i for i in run.log.inferences if i.what == "robot"]
    assert said.value == name
    assert said.evidence.startswith("its kinematics come within ")


def test_a_tool_is_told_and_not_applied(tmp_path: Path) -> None:
    q = motion()
    robot = load_robot("ur10e")
    recorded = positions_over_log(robot.placed(tool=translation(0.0, 0.01, 0.15)), q)
    run = ingest(tmp_path / "log.csv", [*JOINTS[:6], *XYZ], np.hstack((q, recorded)))
    assert run.robot == robot
    (said,) = [i for i in run.log.inferences if i.what == "robot"]
    assert "with the tool 0.0000,0.0100,0.1500, which is not applied" in said.evidence.replace(
        "-0.0000", "0.0000"
    )


def test_a_pose_alone_tells_no_robot(tmp_path: Path) -> None:
    """With some tool every robot fits a single pose."""
    q = np.broadcast_to(motion()[:1], (ROWS, 6))
    robot = load_robot("ur10e")
    recorded = positions_over_log(robot.placed(tool=translation(0.0, 0.01, 0.15)), np.ascontiguousarray(q))
    run = ingest(tmp_path / "log.csv", [*JOINTS[:6], *XYZ], np.hstack((q, recorded)))
    assert (run.robot, run.tcp) == (None, None)


def test_an_arm_that_is_not_in_the_catalogue_is_none_of_it(tmp_path: Path) -> None:
    q = motion()
    recorded = positions_over_log(load_robot("ur5"), q) * 1.1
    run = ingest(tmp_path / "log.csv", [*JOINTS[:6], *XYZ], np.hstack((q, recorded)))
    assert run.robot is None


def test_joints_called_after_a_robot(tmp_path: Path) -> None:
    names = [f"/ur5e/{joint}/position [rad]" for joint in load_robot("ur5e").coordinates]
    run = ingest(tmp_path / "log.csv", names, motion())
    assert run.robot == load_robot("ur5e")
    (said,) = [i for i in run.log.inferences if i.what == "robot"]
    assert said.evidence == "its name in the names of the joint columns"


def test_an_arm_whose_joints_all_carry_its_name(tmp_path: Path) -> None:
    names = [f"{joint} [rad]" for joint in load_robot("panda").coordinates]
    assert ingest(tmp_path / "log.csv", names, motion(7)).robot == load_robot("panda")


def test_names_that_several_robots_share_tell_none(tmp_path: Path) -> None:
    names = [f"{joint} [rad]" for joint in load_robot("ur5e").coordinates]
    assert ingest(tmp_path / "log.csv", names, motion()).robot is None
