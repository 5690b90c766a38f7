"""A plan is written as a log: joints, the tool and the row of the path, and reads as it was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from asserting import there
from plan_logs import PLANS, STEP_NS, Planned, planned
from urmpipe_models.errors import OutputError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.outputs import PATH_ROW, TARGET_ROW, guarded_output
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.tables.joint_file import write_joint_log

INFERRED = {"ur5e", "urm6"}
"""Arms of the catalogue among the plans."""


def header(plan: Planned, path: Path) -> str:
    return plan.write(path).read_text(encoding="utf-8").splitlines()[0]


def test_the_header_names_joints_tool_and_row_with_their_units(tmp_path: Path) -> None:
    slides = "rail (m),reach (m),lift (m)"
    assert header(PLANS["sliding"](), tmp_path / "a.csv") == f"t (s),{slides},x (m),y (m),z (m),{PATH_ROW}"
    angles = ",".join(f"theta{k} (rad)" for k in (1, 2, 3, 4))
    tool = "x (m),y (m),z (m),qx,qy,qz,qw"
    assert header(PLANS["level"](), tmp_path / "b.csv") == f"t (s),{angles},{tool},{PATH_ROW}"
    alone = PLANS["level"]().alone()
    assert header(alone, tmp_path / "c.csv") == f"t (s),x (m),y (m),z (m),{PATH_ROW}"


def test_joints_called_as_the_tool_keep_their_names(tmp_path: Path) -> None:
    tool = "tcp_x (m),tcp_y (m),tcp_z (m),tcp_qx,tcp_qy,tcp_qz,tcp_qw"
    found = header(PLANS["gantry"](), tmp_path / "plan.csv")
    assert found == f"t (s),x (m),y (m),z (m),t (rad),{tool},{PATH_ROW}"


@pytest.mark.parametrize("name", PLANS)
@pytest.mark.parametrize("robot", [True, False])
def test_ingest_reads_it_bit_by_bit_without_a_warning(name: str, robot: bool, tmp_path: Path) -> None:
    plan = PLANS[name]()
    arm = there(plan.robot)
    run = ingest_log([plan.write(tmp_path / "plan.csv")], robot=arm if robot else None)
    assert [str(warning) for warning in run.warnings] == []
    assert run.log.joints == arm.coordinates
    assert run.log.q.tolist() == plan.q.tolist()
    assert run.log.t_ns.tolist() == (np.arange(len(plan.q)) * STEP_NS).tolist()
    assert there(run.log.tcp_position).tolist() == plan.position.tolist()
    assert (run.log.tcp_rotation is None) == (plan.quat_xyzw is None)
    if plan.quat_xyzw is not None:
        # A norm of 1 is rounded once more.
        np.testing.assert_allclose(there(run.log.tcp_quat_xyzw), plan.quat_xyzw, rtol=0, atol=1e-15)
    known = arm if robot else load_robot(arm.name) if arm.name in INFERRED else None
    assert run.robot == known


@pytest.mark.parametrize("scale", [1e-3, 1.0, 100.0])
def test_a_path_alone_is_read_wherever_it_is(scale: float, tmp_path: Path) -> None:
    """It starts at 0, 0, 0, which a controller writes where it knows no pose."""
    plan = PLANS["level"]().alone()
    moved = Planned(None, plan.q, scale * (plan.position - plan.position[0]), None, plan.row)
    run = ingest_log([moved.write(tmp_path / "plan.csv")])
    assert (list(run.warnings), run.log.joints) == ([], ())
    assert there(run.log.tcp_position).tolist() == moved.position.tolist()


def test_the_last_column_holds_the_row_of_the_path(tmp_path: Path) -> None:
    plan = PLANS["level"]()
    frame = pd.read_csv(plan.write(tmp_path / "plan.csv"))
    assert frame[PATH_ROW].tolist() == plan.row.tolist()
    assert frame["qw"].tolist() == there(plan.quat_xyzw)[:, 3].tolist()


def test_only_a_plan_is_replaced_by_a_plan_and_a_joint_log_by_a_joint_log(tmp_path: Path) -> None:
    plan, path = planned(load_robot("urm6"), oriented=False, rows=5), tmp_path / "log.csv"
    plan.write(path)
    assert len(pd.read_csv(plan.alone().write(path))) == 5
    other = tmp_path / "solved.csv"
    with guarded_output(other, [], "joints") as part:
        write_joint_log(part, other, joints=["q1"], units=["rad"], q=np.zeros((2, 1)), row=np.array([1, 2]))
    assert other.read_text(encoding="utf-8").startswith(f"q1 (rad),{TARGET_ROW}\n")
    with pytest.raises(OutputError, match="found a file that is no plan of urmpipe's, allowed: a new name"):
        plan.write(other)
    with (
        pytest.raises(OutputError, match="found a file that is no joint log of urmpipe's"),
        guarded_output(path, [], "joints"),
    ):
        pass


# The end of a plan whose duration is no multiple of the period


def test_a_last_row_between_the_others_makes_the_clock_uneven(tmp_path: Path) -> None:
    """So the last row of a plan holds its end at the next multiple of the period."""
    plan = PLANS["level"]().alone()
    lines = plan.write(tmp_path / "plan.csv").read_text(encoding="utf-8").splitlines()
    held = ingest_log([tmp_path / "plan.csv"])
    last = lines[-1].replace("0.995", "0.990324")
    (tmp_path / "cut.csv").write_text("\n".join([*lines[:-1], last]) + "\n", encoding="utf-8")
    cut = ingest_log([tmp_path / "cut.csv"])
    assert [warning.kind for warning in held.warnings] == []
    assert [warning.kind for warning in cut.warnings] == ["resampled"]
    assert (len(held.t_ns), len(cut.t_ns)) == (200, 199)
