"""A plan is a log that ingest, compare, ik and simulate read without options."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import urmpipe
from asserting import refusal, there
from plan_logs import PLANS, Planned
from urmpipe_models.errors import LogError
from urmpipe_models.robots.robot_file import robot_toml

CATALOGUE = [name for name, plan in PLANS.items() if there(plan().robot).name in ("ur5e", "urm6")]
OWN = [name for name in PLANS if name not in CATALOGUE]

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


def test_both_kinds_of_arms_are_there() -> None:
    assert (len(CATALOGUE), len(OWN)) == (4, 4)


@pytest.mark.parametrize("name", CATALOGUE)
def test_ingest_finds_an_arm_of_the_catalogue_by_the_recorded_tool(name: str, tmp_path: Path) -> None:
    plan = PLANS[name]()
    run = urmpipe.ingest(plan.write(tmp_path / "plan.csv"))
    assert (run.robot, list(run.warnings)) == (plan.robot, [])
    # Forward kinematics of the same numbers, in another order of sums.
    np.testing.assert_allclose(there(run.tcp).position, plan.position, rtol=0, atol=1e-14)


def compared(
    reference: Path, log: Path, plan: Planned, *, given: bool
) -> tuple[str | None, float, list[str]]:
    """Return the verdict of a comparison, the largest deviation in [m] and the kinds of the warnings."""
    found = urmpipe.compare(reference, log, robot=plan.robot if given else None)
    (run,) = found.to_dict()["runs"]
    return found.verdict, run["delta"]["norm"]["max"], [warning.kind for warning in found.warnings]


@pytest.mark.parametrize(
    ("name", "given"), [*((name, False) for name in CATALOGUE), *((name, True) for name in PLANS)]
)
def test_compare_takes_it_on_either_side(name: str, given: bool, tmp_path: Path) -> None:
    plan = PLANS[name]()
    log, path = plan.write(tmp_path / "plan.csv"), plan.alone().write(tmp_path / "path.csv")
    for reference, other, warned in ((path, log, []), (log, path, ["path-as-log"]), (log, log, [])):
        verdict, largest, kinds = compared(reference, other, plan, given=given)
        assert (verdict, kinds) == ("pass", warned)
        assert largest <= 1e-14  # forward kinematics of the same numbers


@pytest.mark.parametrize("name", OWN)
def test_compare_asks_for_an_arm_that_the_log_cannot_tell_or_takes_what_was_recorded(
    name: str, tmp_path: Path
) -> None:
    plan = PLANS[name]()
    log, path = plan.write(tmp_path / "plan.csv"), plan.alone().write(tmp_path / "path.csv")
    assert refusal(LogError, urmpipe.compare, path, log) == (
        "plan.csv: no robot, so no forward kinematics; robot=NAME|FILE gives one;"
        ' tcp="recorded" goes by the recorded tool centre point'
    )
    found = urmpipe.compare(path, log, tcp="recorded")
    assert (found.verdict, list(found.warnings)) == ("pass", [])


@pytest.mark.parametrize("name", PLANS)
def test_ik_comes_back_to_it(name: str, tmp_path: Path) -> None:
    plan = PLANS[name]()
    log = plan.write(tmp_path / "plan.csv")
    solved = urmpipe.ik(log, robot=there(plan.robot))
    assert [warning.kind for warning in solved.warnings if warning.kind != "singular"] == []
    assert solved.targets.position.tolist() == plan.position.tolist()
    assert (solved.targets.rotation is None) == (plan.quat_xyzw is None)
    assert there(solved.t_ns).tolist() == (np.arange(len(plan.q)) * 5_000_000).tolist()
    assert solved.reached.all()


@pytest.mark.parametrize("name", PLANS)
def test_simulate_plays_it_into_an_arm(name: str, tmp_path: Path) -> None:
    plan = PLANS[name]()
    arm = there(plan.robot)
    plan.write(tmp_path / "plan.csv")
    (tmp_path / "arm.toml").write_text(robot_toml(arm), encoding="utf-8")
    ways = {"revolute": '"chain.phi" = "plan.q"\n', "prismatic": '"chain.s" = "plan.s"\n'}
    connections = [ways[kind] for kind in ways if kind in {joint.kind for joint in arm.moving}]
    (tmp_path / "planned.toml").write_text(SYSTEM + "".join(connections), encoding="utf-8")
    result = urmpipe.simulate(tmp_path / "planned.toml")
    assert list(result.warnings) == []
    assert result.signal("plan.p").values.tolist() == plan.position.tolist()
    tip = result.signal(f"chain.{arm.point_names[-1]}").values
    np.testing.assert_allclose(
        tip, plan.position, rtol=0, atol=1e-14
    )  # forward kinematics of the same numbers
