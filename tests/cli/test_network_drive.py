"""`urmpipe network drive`: what it prints, writes and exits with; its logs in the other commands."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import urmpipe as api
from asserting import there

Run = Callable[..., Any]

LINKAGE = ("network", "drive", "four-bar")
TURN = (*LINKAGE, "crank=0:360deg", "--point", "coupler:0.45,0.2,0")


@pytest.mark.slow
def test_a_motion_is_printed_in_words_and_as_json(urmpipe: Run) -> None:
    ran = urmpipe(*TURN, "--steps", "20")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("PASS  four-bar: crank 0 deg to 360 deg, 21 rows in 0.100 s\n")
    assert "theta4    crank  rad/rad" in ran.out
    ran = urmpipe(*TURN, "--steps", "20", "--wrench", "coupler:0.45,0.2,0:0,-50,0", "--json")
    found = json.loads(ran.out)
    assert set(found) == {
        "schema", "name", "verdict", "drives", "law", "rows", "requested", "duration", "tsp", "joints",
        "events", "transmission", "distance", "point", "forces", "warnings", "output",
    }  # fmt: skip
    assert found["drives"] == [{"name": "crank", "unit": "rad", "begin": 0.0, "end": 2 * math.pi}]
    assert (found["rows"], found["requested"], found["duration"]) == (21, 21, 0.1)
    assert (found["verdict"], found["events"]) == ("pass", [])
    assert found["point"] == {"body": "coupler", "point": [0.45, 0.2, 0.0]}
    moved = api.network_drive(
        "four-bar", {"crank": (0, "360deg")}, steps=20, point=("coupler", (0.45, 0.2, 0)),
        wrenches=["coupler:0.45,0.2,0:0,-50,0"],
    )  # fmt: skip
    assert moved.to_dict() == found
    assert moved.forces is not None
    assert found["forces"]["drives"] == {"crank": np.abs(moved.forces.drives).max()}
    reactions = found["forces"]["reactions"]
    assert {name for name, value in reactions.items() if value is None} == {
        name
        for name, values in zip(moved.forces.names, moved.forces.reactions.T, strict=True)
        if np.isnan(values).any()
    }


def test_a_motion_that_ends_early_exits_with_1_and_keeps_what_it_reached(
    urmpipe: Run, tmp_path: Path
) -> None:
    ran = urmpipe(*LINKAGE, "theta4=85deg:160deg", "--steps", "50", "-o", "run.csv")
    assert ran.code == 1
    # where crank and coupler are folded: 0.5^2 = 1 + 0.7^2 + 2 * 0.7 cos(theta4)
    limit = math.acos((0.5**2 - 1 - 0.7**2) / 1.4)
    assert ran.out.startswith("FAIL  four-bar: theta4 85 deg to 160 deg, ")
    assert (
        f"turns back at theta4 = {limit:.9g} rad ({math.degrees(limit):.4f} deg)" in ran.out.splitlines()[0]
    )
    found = json.loads(urmpipe(*LINKAGE, "theta4=85deg:160deg", "--steps", "50", "--json").out)
    assert (found["verdict"], found["requested"], found["events"][0]["kind"]) == ("fail", 51, "turns back")
    assert found["rows"] == 1 + math.floor((math.degrees(limit) - 85) / 1.5)
    reached = pd.read_csv(tmp_path / "run.csv")["theta4 (rad)"].iloc[-1]
    assert reached == pytest.approx(math.radians(151), abs=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("four-bar", "crank=0:360deg", "--point", "coupler:0.45,0.2,0"),
        ("slider-crank", "crank=0:5", "--point", "rod"),
        ("stewart-gough-driven", *(f"leg{k}=0.8:0.8{k}" for k in range(1, 7)), "--point", "platform:0,0,0.1"),
        ("cam-follower", "turn=0:360", "--point", "follower"),
    ],
)
def test_a_log_of_a_motion_reads_back(urmpipe: Run, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    """The CSV without any option; the recording has the same, and is an operand of compare and export."""
    for file in ("run.csv", "run.rrd"):
        ran = urmpipe("network", "drive", *arguments, "--steps", "50", "-o", file)
        assert (ran.code, ran.err) == (0, "")
        assert file in ran.out
    moved = api.read_recording(tmp_path / "run.rrd")
    assert isinstance(moved, api.NetworkMotion)
    places = there(moved.point_motion)[0]
    read = api.ingest(tmp_path / "run.csv")
    assert read.log.joints == moved.joints
    np.testing.assert_array_equal(read.q, moved.joint_motion[0])
    np.testing.assert_array_equal(there(read.tcp_recorded), places)
    for operands in (("run.csv", "run.rrd"), ("run.rrd", "run.csv")):
        ran = urmpipe("compare", *operands, "--json", "-o", "pair.rrd")
        assert ran.code == 0
        (pair,) = json.loads(ran.out)["runs"]
        assert (pair["samples"], pair["delta"]["norm"]["max"], pair["angle"]["max"]) == (51, 0.0, 0.0)
    assert urmpipe("export", "run.rrd", "-o", "out.csv").code == 0
    table = pd.read_csv(tmp_path / "out.csv")
    joints = table.to_numpy()[:, 1 : len(moved.joints) + 1]
    np.testing.assert_array_equal(joints, moved.joint_motion[0])
    np.testing.assert_array_equal(table[[f"recorded_tcp_{axis} [m]" for axis in "xyz"]], places)


@pytest.mark.slow
def test_a_late_log_is_diagnosed_as_late(urmpipe: Run, tmp_path: Path) -> None:
    """Each row has the values of the row before: 5 ms late."""
    assert urmpipe(*TURN, "--duration", "2s", "--law", "quintic", "-o", "run.csv").code == 0
    head, *rows = (tmp_path / "run.csv").read_text().splitlines()
    late = [
        f"{row.split(',')[0]},{before.split(',', 1)[1]}"
        for row, before in zip(rows, [rows[0], *rows], strict=False)
    ]
    (tmp_path / "late.csv").write_text("\n".join([head, *late, ""]))
    ran = urmpipe("diagnose", "run.csv", "late.csv")
    assert ran.code == 1
    assert ran.out.startswith("FAIL  the clocks differ by 5 ms (the log is late): ")
    assert "--sync -0.005 sets the clocks" in ran.out
    ran = urmpipe("compare", "run.csv", "late.csv", "--sync", "-0.005", "--json")
    assert (ran.code, json.loads(ran.out)["runs"][0]["delta"]["norm"]["max"]) == (0, 0.0)


def test_a_log_drives_by_the_names_of_its_columns(urmpipe: Run, tmp_path: Path) -> None:
    t = 0.005 * np.arange(101)
    (tmp_path / "log.csv").write_text(
        pd.DataFrame({"t": t, "crank (rad)": 0.9 + t, "other (rad)": t}).to_csv(index=False)
    )
    by_log = urmpipe(*LINKAGE, "--log", "log.csv", "-o", "by-log.csv")
    by_range = urmpipe(*LINKAGE, "crank=0.9:1.4", "--steps", "100", "-o", "by-range.csv")
    assert (by_log.code, by_range.code) == (0, 0)
    first, second = (pd.read_csv(tmp_path / file).to_numpy() for file in ("by-log.csv", "by-range.csv"))
    # Newton ends at gaps of 1e-13, from either side
    np.testing.assert_allclose(first, second, rtol=0, atol=1e-12)
    renamed = urmpipe(*LINKAGE, "crank=other", "--log", "log.csv", "--json")
    assert json.loads(renamed.out)["drives"] == [{"name": "crank", "unit": "rad", "begin": 0.0, "end": 0.5}]


def test_a_drawing_and_a_recording_are_written(urmpipe: Run, tmp_path: Path) -> None:
    ran = urmpipe(*TURN, "--steps", "20", "-o", "run.rrd", "--draw", "run.svg")
    assert ran.code == 0
    assert (tmp_path / "run.svg").read_text().startswith("<!-- Generator: urmpipe ")
    read = api.read_recording(tmp_path / "run.rrd")
    assert isinstance(read, api.NetworkMotion)
    moved = api.network_drive("four-bar", {"crank": (0, "360deg")}, steps=20, point="coupler:0.45,0.2,0")
    for name in ("x", "xd", "xdd", "t_ns", "distance"):
        np.testing.assert_array_equal(getattr(read, name), getattr(moved, name))
    assert (read.events, read.transmission, read.network) == (moved.events, moved.transmission, moved.network)
    frame = read.to_frame()
    assert list(frame.columns[:6]) == ["t", "theta2", "A", "B", "theta4", "d_theta2"]
    assert {"dd_theta4", "x", "vx", "ax", "distance"} <= set(frame.columns)
    pd.testing.assert_frame_equal(frame, moved.to_frame())


@pytest.mark.parametrize(
    ("file", "share"), [("run.csv", 0.1), ("run.csv", 0.8), ("run.rrd", 0.1), ("run.rrd", 0.95)]
)
def test_ctrl_c_leaves_no_file(tmp_path: Path, file: str, share: float) -> None:
    def stop(done: float) -> None:
        if done >= share:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        api.network_drive(
            "four-bar", {"crank": (0, 1)}, output=tmp_path / file, draw=tmp_path / "a.svg", progress=stop
        )
    assert list(tmp_path.iterdir()) == []
