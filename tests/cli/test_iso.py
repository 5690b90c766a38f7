"""`urmpipe iso`: what comes in, what comes out, exit codes, recordings and baselines."""

from __future__ import annotations

import csv
import json
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import urmpipe
from driven_paths import joint_log
from panda_log import panda
from rail_arm import rail_arm
from repeated import PLACE, along, judged, logs, overall, value, written
from repeated import told as told_by
from urmpipe.main import run
from urmpipe_fmus.native import native_unavailable_reason
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import to_quaternions
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.results import read_recording

Captured = pytest.CaptureFixture[str]

SQUARE = [(0.3, 0.1, 0.2), (0.4, 0.1, 0.2), (0.4, 0.2, 0.2), (0.3, 0.2, 0.2), (0.3, 0.1, 0.2)]
"""Corners in [m]."""

NOISE = 2e-5
"""Standard deviation of what a cycle trembles, in [m]."""


@pytest.fixture(scope="module")
def laid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a square to run, four cycles of it, and all of them in one log."""
    folder = tmp_path_factory.mktemp("laid")
    rng = np.random.default_rng(1)
    square = along(SQUARE, 0.2)
    cycles = [square + 1e-4 + NOISE * rng.standard_normal(square.shape) for _ in range(4)]
    written(folder / "square.csv", square)
    logs(folder, cycles)
    written(folder / "all.csv", np.vstack(cycles))
    return folder


@pytest.fixture(autouse=True)
def folder(laid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that folder, to work in."""
    shutil.copytree(laid, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


FILES = [f"cycle{k}.csv" for k in range(1, 5)]


def iso(*arguments: str) -> int:
    """Return the exit code of a test on the command line, without a word of what is fine."""
    return run(["iso", "square.csv", *arguments, "-q", "-o", "run.rrd"])


def answer(captured: Captured, *arguments: str) -> dict[str, object]:
    """Return what a test prints as JSON."""
    captured.readouterr()
    run(["iso", "square.csv", *arguments, "--json", "-o", "run.rrd"])
    found: dict[str, object] = json.loads(captured.readouterr().out)
    return found


def read(path: str) -> Comparison:
    """Return the comparison of a recording."""
    found = read_recording(Path(path))
    assert isinstance(found, Comparison)
    return found


@pytest.mark.slow
def test_without_a_tolerance_nothing_is_judged(capsys: Captured) -> None:
    assert run(["iso", "square.csv", *FILES]) == 0
    printed = capsys.readouterr().out
    assert "no criterion is judged" in printed
    assert "After ISO 9283" in printed
    told = answer(capsys, *FILES)
    assert told["verdict"] is None
    runs = told["runs"]
    assert isinstance(runs, list)
    assert [one["name"] for one in runs] == [f"cycle{k}" for k in range(1, 5)]
    assert {one["verdict"] for one in runs} == {None}


@pytest.mark.slow
def test_json_has_the_cycles_and_every_criterion(capsys: Captured) -> None:
    told = answer(capsys, *FILES, "--tolerance", "AP=0.4mm")["iso"]
    assert isinstance(told, dict)
    assert sorted(told) == ["criteria", "cycles", "failed_cycles", "poses", "reference_rows"]
    assert told["poses"] == 1
    for k, one in enumerate(told["cycles"], 1):
        assert (one["name"], one["row"], one["last_row"]) == (f"cycle{k}", 1, 601)
        assert one["sync_offset"] == pytest.approx(0.0, abs=2e-3)  # s: a shift of 0.1 mm is 0.5 ms at 0.2 m/s
    (ap,) = [one for one in told["criteria"] if (one["name"], one["at"]) == ("AP", None)]
    # Five standard errors of the mean of 4 x 51 rows of noise a coordinate: 5 sqrt(3) NOISE / sqrt(200).
    assert ap["value"] == pytest.approx(np.sqrt(3.0) * 1e-4, abs=1.3e-5)
    assert {k: ap[k] for k in ("unit", "cycles", "tolerance", "verdict")} == {
        "unit": "m", "cycles": 4, "tolerance": 4e-4, "verdict": "pass",
    }  # fmt: skip
    units = {one["name"]: one["unit"] for one in told["criteria"]}
    assert {units[name] for name in ("AV", "RV")} == {"1"}
    assert (units["FV"], units["PSt"]) == ("m/s", "s")
    places = {one["at"] for one in told["criteria"] if one["name"] == "AT"}
    assert places == {None, *(f"plane {k}" for k in range(1, 51))}


def test_one_cycle_has_what_needs_no_spread() -> None:
    found = overall(told_by(Path("square.csv"), Path("cycle1.csv")))
    given = {name for name, value in found.items() if value is not None}
    assert given == {"AP", "PSt", "OV", "AT", "CR", "CO", "AV", "FV"}


@pytest.mark.slow
def test_junit_and_csv_have_the_criteria() -> None:
    assert iso(*FILES, "--tolerance", "AP=0.1mm,RP=1mm", "--junit", "v.xml", "--csv", "v.csv") == 1
    root = ET.parse("v.xml").getroot()
    cases = {one.get("name"): one.find("failure") is not None for one in root.iter("testcase")}
    assert cases == {"AP": True, "RP": False}
    with Path("v.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    test = read("run.rrd").iso
    assert test is not None
    assert [row["name"] for row in rows] == [one.name for one in test.criteria]
    assert [row["value"] for row in rows] == [
        "" if one.value is None else repr(one.value) for one in test.criteria
    ]


@pytest.mark.slow
def test_a_recording_read_back_has_the_same_criteria_bit_for_bit() -> None:
    made = urmpipe.iso("square.csv", FILES, tolerance="AP=0.4mm", output="run.rrd", junit="v.xml")
    again = read("run.rrd")
    assert made.iso is not None
    assert again.iso is not None
    assert again.iso.criteria == made.iso.criteria
    assert again.iso.cycles == made.iso.cycles
    assert again.verdict == "pass"
    assert made.iso.path is not None
    assert again.iso.path is not None
    assert again.iso.path.crossed.tobytes() == made.iso.path.crossed.tobytes()
    assert judged(made).to_dict() == judged(again).to_dict()


@pytest.mark.slow
def test_recordings_are_cycles_too() -> None:
    for name in ("square", *(f"cycle{k}" for k in range(1, 5)), "all"):
        urmpipe.ingest(f"{name}.csv", output=f"{name}.rrd")
    files = told_by(Path("square.csv"), [Path(one) for one in FILES])
    again = told_by(Path("square.rrd"), [Path(f"cycle{k}.rrd") for k in range(1, 5)])
    assert again.criteria == files.criteria
    assert (
        told_by(Path("square.rrd"), Path("all.rrd")).criteria
        == told_by(Path("square.csv"), Path("all.csv")).criteria
    )


def test_targets_replace_the_rests_of_the_reference() -> None:
    Path("targets.csv").write_text("x [mm],y [mm],z [mm]\n300,100,201\n", encoding="utf-8")
    found = told_by(Path("square.csv"), [Path(one) for one in FILES], targets="targets.csv")
    # 0.1 mm beside the square in x and y, 0.9 mm below the target in z; noise as above.
    assert value(found, "AP") == pytest.approx(np.sqrt(1e-8 + 1e-8 + 0.81e-6), abs=1.3e-5)


def test_a_lab_s_tolerance_is_for_logs_one_by_one() -> None:
    Path("urmpipe.toml").write_text("[compare]\ntolerance = 'axis=1mm'\nsync = 'start'\n", encoding="utf-8")
    assert iso(*FILES) == 0
    assert read("run.rrd").tolerance == {}
    assert {one.sync.mode for one in read("run.rrd").runs} == {"auto"}


@pytest.mark.slow
def test_a_later_test_is_held_against_an_earlier_one(capsys: Captured) -> None:
    assert iso(*FILES) == 0
    Path("run.rrd").rename("before.rrd")
    square = along(SQUARE, 0.2)
    rng = np.random.default_rng(2)
    logs(Path(), [square + 2e-4 + NOISE * rng.standard_normal(square.shape) for _ in range(4)])
    assert (
        iso(*FILES, "--baseline", "before.rrd", "--junit", "v.xml", "--noise", "0.05mm,FV=1m/s,PSt=9s,OV=9mm")
        == 1
    )
    result = read("run.rrd")
    assert result.baseline is not None
    worse = {one.now.name for one in result.baseline.worse_criteria}
    assert {"AP", "AT"} <= worse
    assert "RP" not in worse
    failed = {
        one.get("name") for one in ET.parse("v.xml").iter("testcase") if one.find("failure") is not None
    }
    assert failed == worse
    Path("run.rrd").rename("now.rrd")
    told = answer(capsys, *FILES, "--baseline", "now.rrd")
    baseline = told["baseline"]
    assert isinstance(baseline, dict)
    assert told["verdict"] == baseline["verdict"] == "pass"
    assert all(one["before"] == one["now"] for one in baseline["criteria"])


def joints_of(arm: Chain) -> FloatArray:
    """Return joint values from rest to rest and back in [rad] or [m], shape (n, joints)."""
    share = np.concatenate([np.zeros(100), np.sin(np.linspace(0.0, np.pi, 401)) ** 2, np.zeros(100)])
    return np.array(arm.start) + share[:, np.newaxis] * np.linspace(0.2, 0.4, len(arm.start))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5e", "panda (URDF)", "rail arm (URDF)"])
def test_joints_and_their_tool_tell_the_same(name: str, shared: Path) -> None:
    arm = {"ur5e": lambda: load_robot("ur5e"), "panda (URDF)": lambda: panda(shared)}.get(name, rail_arm)()
    rng = np.random.default_rng(3)
    q = joints_of(arm)
    cycles = [q + 1e-5 * rng.standard_normal(q.shape) for _ in range(3)]
    joint_log(Path("ref.csv"), arm, q)
    many = [joint_log(Path(f"j{k}.csv"), arm, one) for k, one in enumerate(cycles)]
    by_joints = told_by(Path("ref.csv"), many, robot=arm)
    written(Path("tool.csv"), poses_over_log(arm, q)[0])
    tools = [written(Path(f"t{k}.csv"), poses_over_log(arm, one)[0]) for k, one in enumerate(cycles)]
    by_tool = overall(told_by(Path("tool.csv"), tools))
    angles = [one for one in overall(by_joints) if "_r" in one]
    assert len(angles) == 12  # of the joints, which have an orientation
    found = overall(by_joints)
    for criterion in ("AT", "RT", "CR", "CO", "AV", "RV", "FV"):
        # Kinematics of the same joints, computed twice: rounding, in m, m/s and shares.
        assert found.get(criterion) == pytest.approx(by_tool.get(criterion), abs=1e-9), criterion
    for criterion in ("AP", "RP"):
        # Orientations tremble, too: they rest a few rows later. Noise of 1e-5 rad at 1 m, of 40 rows.
        assert found[criterion] == pytest.approx(by_tool[criterion], abs=5e-6), criterion


@pytest.mark.slow
def test_a_plan_gives_its_corners_stops_and_speed() -> None:
    rows = [
        "x,y,z,r",
        "0.3,-0.2,0.3,0",
        "0.5,-0.2,0.3,0.02",
        "0.5,0.2,0.3,0",
        "0.3,0.2,0.3,0.01",
        "0.3,0,0.3,0",
    ]
    Path("rows.csv").write_text("\n".join(rows), encoding="utf-8")
    plan = urmpipe.plan("rows.csv", velocity=0.2, acceleration=2.0, output="plan.rrd")
    written(Path("as_planned.csv"), plan.position, plan.t)
    for reference in (plan, "plan.rrd"):
        test = judged(urmpipe.iso(reference, ["as_planned.csv", "as_planned.csv"]))
        assert test.poses is not None
        assert test.path is not None
        assert test.poses.command == pytest.approx(plan.stops, abs=1e-12)  # rounding
        corners = np.array([one.point for one in test.path.corners])
        wanted = np.array([plan.corners[0], plan.stops[1], plan.corners[1]])
        assert corners == pytest.approx(wanted, abs=1e-6)
        assert [one.commanded for one in test.path.legs] == pytest.approx(
            [0.2] * len(test.path.legs), abs=1e-9
        )
        assert len(test.path.legs) == 4
        found = overall(test)
        assert found["AP"] == pytest.approx(
            0.0, abs=7e-6
        )  # up to 2.5 ms beside a stop: a t^2 / 2 = 6.25e-6 m
        for name in ("RP", "AT", "RT", "RV", "AV"):
            assert found[name] == pytest.approx(0.0, abs=1e-12), name  # the very samples, cut twice alike


@pytest.mark.slow
@pytest.mark.skipif(
    bool(native_unavailable_reason(())), reason=f"runs native FMUs: {native_unavailable_reason(())}"
)
def test_repeated_logs_of_simulate_come_through() -> None:
    arm, values = load_robot("ur3"), urmpipe.simulate("driven-arm", step=5e-4).signal("arm.phi").values
    many = [joint_log(Path(f"s{k}.csv"), arm, values) for k in range(3)]
    test = told_by(many[0], many, robot="ur3")
    told = overall(test)
    assert len(test.cycles) == 3
    assert told["AT"] == pytest.approx(0.0, abs=1e-12)  # one simulation, three times: rounding
    assert told["RT"] == pytest.approx(0.0, abs=1e-12)


def test_a_robot_that_overshoots_a_stop_of_a_plan_is_taken_where_it_rests() -> None:
    Path("rows.csv").write_text("x,y,z,r\n0.3,-0.2,0.3,0\n0.5,-0.2,0.3,0\n0.5,0,0.3,0\n", encoding="utf-8")
    plan = urmpipe.plan("rows.csv", velocity=0.2, acceleration=2.0)
    beyond = plan.position.copy()
    swing = 5e-4 * np.exp(-np.arange(400) / 20.0) * np.sin(np.arange(400) / 6.0)
    stop = int(np.argmin(np.linalg.norm(beyond - plan.stops[1], axis=1)))
    rest = np.repeat(plan.stops[1][np.newaxis], 400, axis=0)
    rest[:, 0] += swing
    log = np.vstack([beyond[:stop], rest, beyond[stop:]])
    written(Path("overshoots.csv"), log)
    test = judged(urmpipe.iso(plan, "overshoots.csv"))
    # What swings is down to exp(-10) of 0.5 mm in the second half of the rest of 2 s.
    assert value(test, "AP", "pose 2") == pytest.approx(0.0, abs=3e-8)


def test_cycles_that_never_rest_are_judged_by_their_path(capsys: Captured) -> None:
    square = along(SQUARE, 0.2, rest=0.0)
    written(Path("whole.csv"), np.vstack([square[:-1]] * 5))
    told = answer(capsys, "whole.csv")
    found = told["iso"]
    assert isinstance(found, dict)
    warnings = told["warnings"]
    assert isinstance(warnings, list)
    assert found["poses"] == 0
    assert len(found["cycles"]) == 5
    assert "no-rests" in [one["kind"] for one in warnings]
    (at,) = [one["value"] for one in found["criteria"] if (one["name"], one["at"]) == ("AT", None)]
    assert at == pytest.approx(0.0, abs=1e-12)  # the very places


TURNED = (*PLACE, "qx", "qy", "qz", "qw")


def turned_square(ry: float) -> FloatArray:
    """Return the square with a tool that is turned by ry in [rad], shape (n, 7)."""
    square = along(SQUARE, 0.2)
    quat = to_quaternions(np.array([[0.2, ry, 0.1]]), "zyx")
    return np.column_stack([square, np.tile(quat, (len(square), 1))])


@pytest.mark.slow
@pytest.mark.parametrize(("ry", "kinds"), [(1.0, []), (1.55, ["euler-singular"])])
def test_angles_that_are_not_separately_defined_are_told(
    ry: float, kinds: list[str], capsys: Captured
) -> None:
    written(Path("square.csv"), turned_square(ry), names=TURNED)
    logs(Path(), [turned_square(ry) + 1e-9] * 2, TURNED)
    told = answer(capsys, "cycle1.csv", "cycle2.csv")["warnings"]
    assert isinstance(told, list)
    assert [one["kind"] for one in told if one["kind"] != "few-cycles"] == kinds


def test_a_cycle_without_orientation_is_told(capsys: Captured) -> None:
    written(Path("square.csv"), turned_square(1.0), names=TURNED)
    logs(Path(), [turned_square(1.0)] * 2, TURNED)
    told = answer(capsys, "cycle1.csv", "cycle2.csv", "cycle3.csv")
    warnings = told["warnings"]
    assert isinstance(warnings, list)
    said = [one["message"] for one in warnings if one["kind"] == "no-orientation"]
    assert said == ["no angle is judged: cycle3 has no orientation"]


def test_where_a_closed_cycle_starts_it_attains_nothing() -> None:
    done = along(SQUARE, 0.2)
    done[-100:, 2] += 3e-4  # it starts in the pose, and comes back beside it
    written(Path("back.csv"), done)
    assert value(told_by(Path("square.csv"), Path("back.csv")), "AP") == pytest.approx(3e-4, abs=1e-12)
