"""Data sets of LeRobot, as its versions 2.1 and 3.0 write them: Parquet files and meta/info.json."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import urmpipe
from asserting import refusal
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.log_map import read_options

T = np.arange(60) * 0.02
Q = (0.5 * np.sin(2 * np.pi * 0.7 * T[:, None] + np.arange(6))).astype(np.float32)
ARM = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
LENGTHS = {0: 60, 1: 50, 2: 40}
RAD = LogMap(unit={"": "rad"})


def episode(number: int) -> pa.Table:
    """Return the rows of an episode; the state is Q plus its number."""
    rows = LENGTHS[number]
    q, kind, image = (
        Q[:rows] + np.float32(number),
        pa.list_(pa.float32(), 6),
        {"bytes": b"JPEG", "path": "0.jpg"},
    )
    return pa.table({
        "action": pa.array((q + np.float32(0.01)).tolist(), kind),
        "observation.state": pa.array(q.tolist(), kind),
        "observation.images.top": [image] * rows,
        "timestamp": T[:rows].astype(np.float32),
        "frame_index": np.arange(rows),
        "episode_index": np.full(rows, number),
        "task_index": np.zeros(rows, dtype=int),
    })  # fmt: skip


@pytest.fixture(params=[2, 3])
def data_set(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """Write a data set of three episodes: a file each, or two in one file."""
    version, folder = request.param, tmp_path / "pick"
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    names = {"motors": [f"main_{name}" for name in ARM]} if version == 2 else [f"{name}.pos" for name in ARM]
    feature = {"dtype": "float32", "shape": [6], "names": names}
    features = {"action": feature, "observation.state": feature, "timestamp": {"shape": [1], "names": None}}
    (folder / "meta" / "info.json").write_text(json.dumps({"fps": 50, "features": features}))
    of_file = {"episode_000000": [0], "episode_000001": [1], "episode_000002": [2]}
    of_file = of_file if version == 2 else {"file-000": [0, 1], "file-001": [2]}
    for name, numbers in of_file.items():
        rows = pa.concat_tables(map(episode, numbers))
        pq.write_table(rows, folder / "data" / "chunk-000" / f"{name}.parquet")
    if version == 3:
        index = {"episode_index": [0, 1, 2], "data/chunk_index": [0, 0, 0], "data/file_index": [0, 0, 1]}
        pq.write_table(pa.table(index), folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    return folder


def test_each_episode_is_a_choice(data_set: Path) -> None:
    with pytest.raises(LogError) as caught:
        read_log([data_set], RAD)
    (finding,) = caught.value.findings
    assert finding.found == "3 episodes: 0, 1, 2"
    for number, hint in enumerate(finding.hints):
        log = read_log([data_set], read_options({hint.parameter: hint.value}, RAD))
        rows = LENGTHS[number]
        assert (log.q == Q[:rows, :5] + np.float32(number)).all()  # not the gripper
        assert log.t_ns.tolist() == [20_000_000 * k for k in range(rows)]
        v3 = log.files[0].name.startswith("file-")
        prefix, suffix = ("", ".pos") if v3 else ("main_", "")
        assert log.joints == tuple(f"observation.state.{prefix}{name}{suffix}" for name in ARM[:5])
        assert [warning.kind for warning in log.warnings] == ["columns-passed-over"]  # the action
    assert refusal(OptionError, read_log, [data_set], LogMap(episode="9")).endswith(
        "found '9', allowed: the number of an episode: 0, 1, 2"
    )


def test_a_file_of_several_episodes_and_both_sides(data_set: Path) -> None:
    path = sorted((data_set / "data" / "chunk-000").iterdir())[0]
    if path.stem == "file-000":
        assert "--episode 1 reads episode 1" in refusal(LogError, read_log, [path], RAD)
        assert read_log([path], LogMap(episode="1", unit={"": "rad"})).rows == 50
    result = urmpipe.compare(
        data_set, sides="action,state", episode=1, unit="rad", tolerance="joint=0.1rad", sync="start"
    )
    assert result.runs[0].run.log.rows == 50
    assert result.runs[0].joint_delta is not None
    np.testing.assert_allclose(result.runs[0].joint_delta, 0.01, atol=1e-6)  # floats of 32 bits


def test_a_data_set_without_episodes(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text("{}")
    assert refusal(LogError, read_log, [tmp_path]) == (
        f"{tmp_path}: found a data set without episodes, allowed: one or more"
    )
    pq.write_table(episode(0), tmp_path / "data" / "a.parquet")
    (tmp_path / "meta" / "info.json").write_text("{")
    said = refusal(LogError, read_log, [tmp_path / "data" / "a.parquet"])
    assert said.startswith(f"{tmp_path}/meta/info.json: found a description that cannot be read (")
