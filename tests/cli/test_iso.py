"""`urmpipe iso` beside kinematics and plans; iso.cases has the command."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import urmpipe
from asserting import there
from driven_paths import joint_log
from panda_log import panda
from rail_arm import rail_arm
from repeated import judged, overall, told, value, written
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5e", "panda (URDF)", "rail arm (URDF)"])
def test_joints_and_their_tool_tell_the_same(name: str, shared: Path) -> None:
    arm = {"ur5e": lambda: load_robot("ur5e"), "panda (URDF)": lambda: panda(shared)}.get(name, rail_arm)()
    rng = np.random.default_rng(3)
    share = np.concatenate([np.zeros(100), np.sin(np.linspace(0.0, np.pi, 401)) ** 2, np.zeros(100)])
    q = np.array(arm.start) + share[:, np.newaxis] * np.linspace(0.2, 0.4, len(arm.start))
    cycles = [q + 1e-5 * rng.standard_normal(q.shape) for _ in range(3)]
    joint_log(Path("ref.csv"), arm, q)
    many = [joint_log(Path(f"j{k}.csv"), arm, one) for k, one in enumerate(cycles)]
    by_joints = overall(told(Path("ref.csv"), many, robot=arm))
    written(Path("tool.csv"), poses_over_log(arm, q)[0])
    tools = [written(Path(f"t{k}.csv"), poses_over_log(arm, one)[0]) for k, one in enumerate(cycles)]
    by_tool = overall(told(Path("tool.csv"), tools))
    assert sum("_r" in one for one in by_joints) == 12  # of the joints, which have an orientation
    for criterion in ("AT", "RT", "CR", "CO", "AV", "RV", "FV"):
        # Kinematics of the same joints, computed twice: rounding, in m, m/s and shares.
        assert by_joints.get(criterion) == pytest.approx(by_tool.get(criterion), abs=1e-9), criterion
    for criterion in ("AP", "RP"):
        # Orientations tremble, too: they rest a few rows later. Noise of 1e-5 rad at 1 m, of 40 rows.
        assert by_joints[criterion] == pytest.approx(by_tool[criterion], abs=5e-6), criterion


@pytest.mark.slow
def test_a_plan_gives_its_corners_stops_and_speed() -> None:
    rows = ["0.3,-0.2,0.3,0", "0.5,-0.2,0.3,0.02", "0.5,0.2,0.3,0", "0.3,0.2,0.3,0.01", "0.3,0,0.3,0"]
    Path("rows.csv").write_text("\n".join(["x,y,z,r", *rows]), encoding="utf-8")
    plan = urmpipe.plan("rows.csv", velocity=0.2, acceleration=2.0, output="plan.rrd")
    written(Path("as_planned.csv"), plan.position, plan.t)
    for reference in (plan, "plan.rrd"):
        test = judged(urmpipe.iso(reference, ["as_planned.csv", "as_planned.csv"]))
        assert there(test.poses).command == pytest.approx(plan.stops, abs=1e-12)  # rounding
        corners = np.array([one.point for one in there(test.path).corners])
        wanted = np.array([plan.corners[0], plan.stops[1], plan.corners[1]])
        assert corners == pytest.approx(wanted, abs=1e-6)
        assert [one.commanded for one in there(test.path).legs] == pytest.approx([0.2] * 4, abs=1e-9)
        found = overall(test)
        # Up to 2.5 ms beside a stop: a t^2 / 2 = 6.25e-6 m.
        assert found["AP"] == pytest.approx(0.0, abs=7e-6)
        for name in ("RP", "AT", "RT", "RV", "AV"):
            assert found[name] == pytest.approx(0.0, abs=1e-12), name  # the very samples, cut twice alike


def test_a_robot_that_overshoots_a_stop_of_a_plan_is_taken_where_it_rests() -> None:
    Path("rows.csv").write_text("x,y,z,r\n0.3,-0.2,0.3,0\n0.5,-0.2,0.3,0\n0.5,0,0.3,0\n", encoding="utf-8")
    plan = urmpipe.plan("rows.csv", velocity=0.2, acceleration=2.0)
    way, stop = plan.position, plan.stops[1]
    swing = 5e-4 * np.exp(-np.arange(400) / 20.0) * np.sin(np.arange(400) / 6.0)
    row = int(np.argmin(np.linalg.norm(way - stop, axis=1)))
    rest = stop + np.outer(swing, [1.0, 0.0, 0.0])
    written(Path("overshoots.csv"), np.vstack([way[:row], rest, way[row:]]))
    test = judged(urmpipe.iso(plan, "overshoots.csv"))
    # What swings is down to exp(-10) of 0.5 mm in the second half of the rest of 2 s.
    assert value(test, "AP", "pose 2") == pytest.approx(0.0, abs=3e-8)
