"""`urmpipe network`: what it prints, writes and exits with."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from scipy.spatial.transform import Rotation

import urmpipe as api
from urmpipe_datasets import NETWORKS
from urmpipe_models.networks.file import network_names

Run = Callable[..., Any]

FOUR_BAR = (1.481134361, -2.271319288)
"""The rocker's angle of the shipped four-bar in both assemblies in [rad], to nine digits."""


def bennett(b: float) -> str:
    """Return the shipped Bennett linkage with other lengths b, as a share of its own."""
    lines = (NETWORKS / "bennett.toml").read_text(encoding="utf-8").splitlines()
    lengths = sorted({line.split("=")[1].split("#")[0].strip() for line in lines if line.startswith("a =")})
    other = lengths[-1]
    return "\n".join(
        f"a = {float(other) * b!r}" if line.split("#")[0].strip() == f"a = {other}" else line
        for line in lines
    )


def test_the_list_as_json_has_a_source_of_each(urmpipe: Run) -> None:
    listed = json.loads(urmpipe("network", "list", "--json").out)
    assert listed["schema"] == 1
    assert [one["name"] for one in listed["networks"]] == list(network_names())
    assert all(one["source"] and one["description"] for one in listed["networks"])


def test_solve_finds_both_assemblies_of_a_four_bar(urmpipe: Run) -> None:
    ran = urmpipe("network", "solve", "four-bar", "--all", "--json", "--restarts", "100")
    told = json.loads(ran.out)
    assert (ran.code, ran.err) == (0, "")
    keys = "schema name assemblies distances restarts reason closure_errors warnings output"
    assert set(told) == set(keys.split())
    angles = [one["variables"]["theta4"] for one in told["assemblies"]]
    assert angles == pytest.approx(FOUR_BAR, abs=1e-9)
    assert told["reason"] == "at least 2: 100 random starts in a row found nothing new"
    assert all(set(one) == {"variables", "poses", "residual", "mobility"} for one in told["assemblies"])
    assert told["restarts"] > 100
    near = json.loads(urmpipe("network", "solve", "four-bar", "--json").out)
    assert len(near["assemblies"]) == 1
    assert near["assemblies"][0]["variables"] == told["assemblies"][0]["variables"]


def test_a_control_is_set_and_held(urmpipe: Run) -> None:
    told = json.loads(urmpipe("network", "solve", "slider-crank", "--set", "crank=1.2", "--json").out)
    found = told["assemblies"][0]["variables"]
    # r cos(theta) + sqrt(l^2 - (r sin(theta) - e)^2)
    way = 0.3 * math.cos(1.2) + math.sqrt(0.8**2 - (0.3 * math.sin(1.2) - 0.1) ** 2)
    assert (found["crank"], found["theta"]) == (1.2, 1.2)
    assert found["s"] == pytest.approx(way, abs=1e-12)


def test_a_control_moves_on_the_branch_of_the_start_or_another_branch_is_reported(
    urmpipe: Run, tmp_path: Path
) -> None:
    for command in ("solve", "check"):
        turned = json.loads(urmpipe("network", command, "four-bar", "--set", "crank=4.712", "--json").out)
        assert turned["warnings"] == []
        assert turned["assemblies"][0]["variables"]["B"] == pytest.approx(1.4597, abs=1e-4)
    # driven by its rocker, the linkage has two ranges of it, which no motion joins
    text = (NETWORKS / "four-bar.toml").read_text(encoding="utf-8")
    text = text.replace('driven = "crank"', "start = 0.9").replace("start = 1.48", 'driven = "crank"')
    text = text.replace("[controls.crank]\nstart = 0.9", "[controls.crank]\nstart = 1.48")
    (tmp_path / "rocker.toml").write_text(text, encoding="utf-8")
    ran = urmpipe("network", "solve", "rocker.toml", "--set", "crank=-2", "--json")
    (warning,) = json.loads(ran.out)["warnings"]
    assert (ran.code, warning["kind"]) == (0, "other-branch")
    least = math.pi - math.acos((0.7**2 + 1.0 - (0.4 + 0.9) ** 2) / 1.4)  # crank and coupler in one line
    assert f"leads to crank = -2: it turns back at crank = {least:.6g}; " in ran.err


@pytest.mark.slow
def test_solves_with_the_last_values_as_start_stay_on_one_branch() -> None:
    found = api.network_solve("four-bar", controls={"crank": 0.0})
    for k in range(1, 74):
        start = found.assemblies[0].values
        found = api.network_solve("four-bar", controls={"crank": math.radians(5.0 * k)}, start=start)
        # sin(B) > 0 on the branch of the start; the other assembly is at -B, far away
        assert math.sin(found.assemblies[0].values["B"][0]) > 0.0
        assert len(found.distances) == 2 and found.distances[1] > 5.0 * found.distances[0]


def test_a_report_states_the_start_values_of_the_search(urmpipe: Run) -> None:
    assert urmpipe("network", "solve", "four-bar", "--start", "theta4=-2", "-o", "s.rrd").code == 0
    assert urmpipe("report", "s.rrd").code == 0
    assert '{"theta4": [-2.0]}' in unescape(Path("s.html").read_text(encoding="utf-8"))


def test_what_does_not_close_fails_with_its_loop_and_gap(urmpipe: Run, tmp_path: Path) -> None:
    (tmp_path / "longer.toml").write_text(bennett(1.05), encoding="utf-8")
    (tmp_path / "same.toml").write_text(bennett(1.0), encoding="utf-8")
    assert urmpipe("network", "check", "same.toml").code == 0
    ran = urmpipe("network", "check", "longer.toml", "--restarts", "50", "--json")
    told = json.loads(ran.out)
    assert ran.code == 1
    assert (told["mobility"], told["kind"], told["special"]) == (None, None, None)
    assert (told["variables"], told["kutzbach"]) == (4, -2)
    (gap,) = told["closure_errors"]
    assert set(gap["loop"]) == {"t1", "t2", "t3", "t4"}
    assert gap["m"] > 1e-3
    assert told["residual"] > 1e-3
    said = urmpipe("network", "check", "longer.toml", "--restarts", "50")
    assert said.code == 1
    assert said.out.startswith("FAIL  bennett: does not close: loop ")
    assert " mm" in said.out.splitlines()[0]
    solved = urmpipe("network", "solve", "longer.toml", "--restarts", "50", "--json")
    assert solved.code == 1
    assert json.loads(solved.out)["assemblies"] == []
    assert json.loads(solved.out)["reason"] == "none of 50 random starts closed"


@pytest.mark.slow
def test_a_recording_and_a_drawing_are_written_and_replaced(urmpipe: Run, tmp_path: Path) -> None:
    arguments = [
        "network",
        "solve",
        "rssr",
        "--all",
        "--restarts",
        "30",
        "-o",
        "rssr.rrd",
        "--draw",
        "rssr.svg",
    ]
    assert urmpipe(*arguments).code == 0
    ran = urmpipe(*arguments)
    assert ran.code == 0
    assert "rssr.rrd" in ran.out
    read = api.read_recording(tmp_path / "rssr.rrd")
    assert isinstance(read, api.NetworkResult)
    assert len(read.assemblies) == 2
    assert read.network == api.load_network("rssr")
    drawing = (tmp_path / "rssr.svg").read_text(encoding="utf-8")
    assert drawing.startswith("<!-- Generator: urmpipe ")
    texts = {one.text for one in ElementTree.fromstring(drawing).iter() if one.text}
    assert any("coupler" in text for text in texts)
    assert urmpipe("report", "rssr.rrd").code == 0
    assert "coupler" in (tmp_path / "rssr.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["cam-follower", "geared-five-bar", "rack-and-pinion"])
def test_pairs_are_drawn_recorded_and_reported(urmpipe: Run, tmp_path: Path, name: str) -> None:
    run, drawing = tmp_path / "run.rrd", tmp_path / "run.svg"
    ran = urmpipe("network", "check", name, "-o", run, "--draw", drawing)
    assert (ran.code, ran.err) == (0, "")
    network = api.load_network(name)
    words = "".join(ElementTree.parse(drawing).getroot().itertext())
    for one in network.elements:
        assert f"{one.name} {one.kind}" in words
    read = api.read_recording(run)
    assert isinstance(read, api.NetworkResult)
    assert read.network.elements == network.elements
    assert [one.limits for one in read.network.joints] == [one.limits for one in network.joints]
    assert urmpipe("report", run, "-o", tmp_path / "run.html").code == 0


@pytest.mark.parametrize("command", ["check", "solve"])
def test_json_has_the_poses_of_bodies(urmpipe: Run, command: str) -> None:
    told = json.loads(urmpipe("network", command, "rssr", "--set", "crank=2", "--json").out)
    expected = api.network_solve("rssr", controls={"crank": 2}).assemblies[0].poses
    poses = told["assemblies"][0]["poses"]
    assert list(poses) == list(api.load_network("rssr").body_names)
    for pose, matrix in zip(poses.values(), expected, strict=True):
        assert pose["position"] == matrix[:3, 3].tolist()
        rotation = Rotation.from_quat(pose["quat_xyzw"]).as_matrix()
        assert rotation == pytest.approx(matrix[:3, :3], abs=1e-14)  # rounding of a conversion
        assert pose["quat_xyzw"][3] >= 0.0


def test_python_gives_the_same_as_the_command(urmpipe: Run) -> None:
    checked = api.network_check("rssr", controls={"crank": 0.5})
    told = json.loads(urmpipe("network", "check", "rssr", "--set", "crank=0.5", "--json").out)
    assert checked.to_dict() == told
    assert checked.mobility is not None
    assert (checked.mobility.mobility, checked.mobility.passive) == (2, ("coupler",))
    frame = api.network_solve(api.load_network("rccc"), every=True, restarts=50).to_frame()
    assert list(frame["assembly"]) == [1, 2]
    assert {"crank", "r1", "c2_1", "c2_2", "residual", "mobility"} <= set(frame.columns)


@pytest.mark.skipif(
    not Path("/proc/version").exists(), reason="no folder that nobody may write to is known here"
)
def test_a_recording_where_nobody_may_write_is_refused_in_a_line(urmpipe: Run) -> None:
    ran = urmpipe("network", "check", "four-bar", "-o", "/proc/x.rrd")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("error: /proc/x.rrd: cannot be written: ")
    assert len(ran.err.splitlines()) == 1
