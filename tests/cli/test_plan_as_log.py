"""A plan is a log that ingest, compare, ik and simulate read without options."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import urmpipe
from asserting import refusal, there
from plan_logs import PATHS, planned, planned_alone
from urmpipe_models.errors import LogError
from urmpipe_models.robots.toml import robot_toml
from urmpipe_pipeline.logs import LogMap

CATALOGUE = [name for name in PATHS if name.startswith(("ur5e", "urm6"))]
OWN = [name for name in PATHS if name not in CATALOGUE]

CLOSE = 1e-12
"""The planner solves for the tool to within this of the path, in [m]: some 100 roundings of 1 m."""

SYSTEM = """
[system]
name = "planned"
step = 0.005

[blocks.plan]
unit = "log_source"
log = "plan.csv"

[blocks.chain]
unit = "kinematic_chain"
robot = "arm.toml"

[connections]
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "given"), [*((name, False) for name in CATALOGUE), *((name, True) for name in ("ur5e", *OWN))]
)
def test_compare_takes_it_on_either_side_or_asks_for_its_arm(name: str, given: bool, tmp_path: Path) -> None:
    log, path = tmp_path / "plan.csv", tmp_path / "path.csv"
    arm = planned(name, log).robot
    planned_alone(name, path)
    for reference, other, warned in ((path, log, []), (log, path, ["path-as-log"])):
        found = urmpipe.compare(reference, other, robot=arm if given else None)
        assert (found.verdict, [warning.kind for warning in found.warnings]) == ("pass", warned)
        assert found.to_dict()["runs"][0]["delta"]["norm"]["max"] <= CLOSE
    if name in OWN:  # those of the catalogue are found by the recorded tool
        assert refusal(LogError, urmpipe.compare, path, log) == (
            "plan.csv: no robot, so no forward kinematics; --robot NAME|FILE sets one;"
            " --tcp recorded uses the recorded tool centre point"
        )
        found = urmpipe.compare(path, log, tcp="recorded")
        assert (found.verdict, [one.kind for one in found.warnings]) == ("pass", ["same-data"])


@pytest.mark.slow
@pytest.mark.parametrize("name", PATHS)
def test_ik_comes_back_to_it(name: str, tmp_path: Path) -> None:
    plan = planned(name, tmp_path / "plan.csv")
    given = None
    if name == "gantry":  # its joints are called x, y, z: either may be the position
        said = refusal(LogError, urmpipe.ik, there(plan.log), robot=there(plan.robot))
        assert "found several positions: tcp_x (m), tcp_y (m), tcp_z (m); x (m), y (m), z (m)" in said
        place, turn = (
            [f"tcp_{axis}" for axis in axes] for axes in (["x", "y", "z"], ["qx", "qy", "qz", "qw"])
        )
        given = LogMap(position=(*place,), orientation=(*turn,), rotation="quat_xyzw")
    solved = urmpipe.ik(there(plan.log), robot=there(plan.robot), map=given)
    assert [warning.kind for warning in solved.warnings if warning.kind != "singular"] == []
    assert solved.targets.position.tolist() == plan.position.tolist()
    assert (solved.targets.rotation is None) == (plan.quat_xyzw is None)
    assert there(solved.t_ns).tolist() == (np.arange(len(plan)) * 5_000_000).tolist()
    assert solved.reached.all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5e", "level", "gantry"])
def test_simulate_plays_it_into_an_arm(name: str, tmp_path: Path) -> None:
    plan = planned(name, tmp_path / "plan.csv")
    arm = there(plan.robot)
    (tmp_path / "arm.toml").write_text(robot_toml(arm), encoding="utf-8")
    ways = {"revolute": '"chain.phi" = "plan.q"\n', "prismatic": '"chain.s" = "plan.s"\n'}
    connections = [ways[kind] for kind in ways if kind in {joint.kind for joint in arm.moving}]
    (tmp_path / "planned.toml").write_text(SYSTEM + "".join(connections), encoding="utf-8")
    # test_three_ways.py: compiled they give the same bits
    result = urmpipe.simulate(tmp_path / "planned.toml", backend="python")
    assert list(result.warnings) == []
    assert result.signal("plan.p").values.tolist() == plan.position.tolist()
    tip = result.signal(f"chain.{arm.point_names[-1]}").values
    np.testing.assert_allclose(tip, plan.position, rtol=0, atol=CLOSE)
