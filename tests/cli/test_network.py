"""`urmpipe network` by laws: branches, poses in JSON, logs that read back; network.cases has its answers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import urmpipe
from answered import full_answer, json_answer
from asserting import there


@pytest.mark.slow
def test_solves_with_the_last_values_as_start_stay_on_one_branch() -> None:
    found = urmpipe.network_solve("four-bar", controls={"crank": 0.0})
    for k in range(1, 74):
        start = found.assemblies[0].values
        found = urmpipe.network_solve("four-bar", controls={"crank": math.radians(5.0 * k)}, start=start)
        # sin(B) > 0 on the branch of the start; the other assembly is at -B, far away
        assert math.sin(found.assemblies[0].values["B"][0]) > 0.0
        assert len(found.distances) == 2 and found.distances[1] > 5.0 * found.distances[0]


@pytest.mark.parametrize("command", ["check", "solve"])
def test_json_has_the_poses_of_bodies(command: str) -> None:
    (answer,) = json_answer(f"network {command} rssr --set crank=2", "assemblies")["assemblies"]
    expected = urmpipe.network_solve("rssr", controls={"crank": 2}).assemblies[0].poses
    assert list(answer["poses"]) == list(urmpipe.load_network("rssr").body_names)
    for pose, matrix in zip(answer["poses"].values(), expected, strict=True):
        assert pose["position"] == matrix[:3, 3].tolist()
        rotation = Rotation.from_quat(pose["quat_xyzw"]).as_matrix()
        assert rotation == pytest.approx(matrix[:3, :3], abs=1e-14)  # rounding of a conversion
        assert pose["quat_xyzw"][3] >= 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "drives",
    [
        "four-bar crank=0:360deg --point coupler:0.45,0.2,0",
        "slider-crank crank=0:5 --point rod",
        "stewart-gough-driven leg1=0.8:0.81 leg2=0.8:0.82 leg3=0.8:0.83 leg4=0.8:0.84 leg5=0.8:0.85"
        " leg6=0.8:0.86 --point platform:0,0,0.1",
        "cam-follower turn=0:360 --point follower",
    ],
)
def test_a_log_of_a_motion_reads_back(drives: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The CSV without any option; the recording has the same, and is an operand of compare and export."""
    monkeypatch.chdir(tmp_path)
    for file in ("run.csv", "run.rrd"):
        answer = full_answer(f"network drive {drives} --steps 50 -o {file}", "output")
        assert answer == (0, {"output": file}, [])
    moved = urmpipe.read_recording("run.rrd")
    assert isinstance(moved, urmpipe.NetworkMotion)
    places = there(moved.point_motion)[0]
    read = urmpipe.ingest("run.csv")
    assert read.log.joints == moved.joints
    np.testing.assert_array_equal(read.q, moved.joint_motion[0])
    np.testing.assert_array_equal(there(read.tcp_recorded), places)
    for operands in ("run.csv run.rrd", "run.rrd run.csv"):
        (pair,) = json_answer(f"compare {operands} -o pair.rrd", "runs")["runs"]
        assert (pair["samples"], pair["delta"]["norm"]["max"], pair["angle"]["max"]) == (51, 0.0, 0.0)
    json_answer("export run.rrd -o out.csv")
    table = pd.read_csv("out.csv")
    joints = table.to_numpy()[:, 1 : len(moved.joints) + 1]
    np.testing.assert_array_equal(joints, moved.joint_motion[0])
    np.testing.assert_array_equal(table[[f"recorded_tcp_{axis} [m]" for axis in "xyz"]], places)


@pytest.mark.parametrize(
    ("file", "share"), [("run.csv", 0.1), ("run.csv", 0.8), ("run.rrd", 0.1), ("run.rrd", 0.95)]
)
def test_ctrl_c_leaves_no_file(tmp_path: Path, file: str, share: float) -> None:
    def stop(done: float) -> None:
        if done >= share:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        urmpipe.network_drive(
            "four-bar", {"crank": (0, 1)}, output=tmp_path / file, draw=tmp_path / "a.svg", progress=stop
        )
    assert list(tmp_path.iterdir()) == []
