"""A plan is written as a log: joints, the tool and the row of the path, and reads as it was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import urmpipe
from asserting import there
from plan_logs import PATHS, planned, planned_alone
from urmpipe_models.planning.path import PathRows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.outputs import PATH_ROW
from urmpipe_pipeline.runs.ingest import ingest_log

INFERRED = {"ur5e", "urm6"}
"""Arms of the catalogue among the plans."""


def header(log: Path | None) -> str:
    return there(log).read_text(encoding="utf-8").splitlines()[0]


def test_the_header_names_joints_tool_and_row_with_their_units(tmp_path: Path) -> None:
    slides = "rail (m),reach (m),lift (m)"
    path = tmp_path / "plan.csv"
    assert header(planned("sliding", path).log) == f"t (s),{slides},x (m),y (m),z (m),{PATH_ROW}"
    angles = ",".join(f"theta{k} (rad)" for k in (1, 2, 3, 4))
    tool = "x (m),y (m),z (m),qx,qy,qz,qw"
    assert header(planned("level", path).log) == f"t (s),{angles},{tool},{PATH_ROW}"
    assert header(planned_alone("level", path).log) == f"t (s),x (m),y (m),z (m),{PATH_ROW}"


def test_joints_called_as_the_tool_keep_their_names(tmp_path: Path) -> None:
    tool = "tcp_x (m),tcp_y (m),tcp_z (m),tcp_qx,tcp_qy,tcp_qz,tcp_qw"
    found = header(planned("gantry", tmp_path / "plan.csv").log)
    assert found == f"t (s),x (m),y (m),z (m),t (rad),{tool},{PATH_ROW}"


@pytest.mark.slow
@pytest.mark.parametrize("name", PATHS)
def test_ingest_reads_it_bit_by_bit_without_a_warning(name: str, tmp_path: Path) -> None:
    plan = planned(name, tmp_path / "plan.csv")
    arm = there(plan.robot)
    for given, known in ((arm, arm), (None, load_robot(arm.name) if arm.name in INFERRED else None)):
        run = ingest_log([there(plan.log)], robot=given)
        assert [str(warning) for warning in run.warnings] == []
        assert run.log.joints == arm.coordinates
        assert run.log.q.tolist() == there(plan.joints).q.tolist()
        assert run.log.t_ns.tolist() == plan.t_ns.tolist() == (np.arange(len(plan)) * 5_000_000).tolist()
        assert there(run.log.tcp_position).tolist() == plan.position.tolist()
        assert (run.log.tcp_rotation is None) == (plan.quat_xyzw is None)
        if plan.quat_xyzw is not None:
            # A norm of 1 is rounded once more.
            np.testing.assert_allclose(there(run.log.tcp_quat_xyzw), plan.quat_xyzw, rtol=0, atol=1e-15)
        assert run.robot == known


@pytest.mark.parametrize("scale", [1e-3, 1.0, 100.0])
def test_a_path_alone_is_read_wherever_it_is(scale: float, tmp_path: Path) -> None:
    """It starts at 0, 0, 0, which a controller writes where it knows no pose."""
    _, rows = PATHS["level"]()
    moved = PathRows(scale * (rows.position - rows.position[0]), rows.radius)
    plan = urmpipe.plan(moved, velocity=0.5 * scale, acceleration=6.0 * scale, output=tmp_path / "plan.csv")
    run = ingest_log([there(plan.log)])
    assert (list(run.warnings), run.log.joints) == ([], ())
    assert there(run.log.tcp_position).tolist() == plan.position.tolist()


def test_the_last_column_holds_the_row_of_the_path(tmp_path: Path) -> None:
    plan = planned("level", tmp_path / "plan.csv")
    frame = pd.read_csv(there(plan.log))
    assert frame.columns[-1] == PATH_ROW
    assert frame[PATH_ROW].tolist() == plan.row.tolist()
    assert {*plan.row.tolist()} == {1, 2}
    assert frame["qw"].tolist() == there(plan.quat_xyzw)[:, 3].tolist()


# The end of a plan whose duration is no multiple of the period


def test_a_last_row_between_the_others_makes_the_clock_uneven(tmp_path: Path) -> None:
    """So the last row of a plan holds its end at the next multiple of the period."""
    plan = planned_alone("level", tmp_path / "plan.csv")
    lines = there(plan.log).read_text(encoding="utf-8").splitlines()
    held = ingest_log([tmp_path / "plan.csv"])
    assert plan.t[-2] < plan.duration < plan.t[-1] - 1e-3
    _, _, cells = lines[-1].partition(",")
    (tmp_path / "cut.csv").write_text(
        "\n".join([*lines[:-1], f"{plan.duration!r},{cells}"]) + "\n", encoding="utf-8"
    )
    cut = ingest_log([tmp_path / "cut.csv"])
    assert [warning.kind for warning in held.warnings] == []
    assert [warning.kind for warning in cut.warnings] == ["resampled"]
    assert (len(held.t_ns), len(cut.t_ns)) == (len(plan), len(plan) - 1)
