"""Files whose columns have types: Parquet, Feather and MAT, whoever wrote them, and damaged ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.feather as pf
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from asserting import refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

T = np.arange(50) * 0.01
Q = np.sin(9 * T[:, np.newaxis] + np.arange(6.0))
RAD = LogMap(unit={"": "rad"})


def frame() -> pd.DataFrame:
    return pd.DataFrame(np.column_stack([T, Q]), columns=["t [s]", *(f"q{k} [rad]" for k in range(1, 7))])


def is_the_motion(log: JointLog) -> None:
    """Compare a log with the motion, bit for bit."""
    assert (log.q == Q).all()
    assert log.t_ns.tolist() == [10_000_000 * k for k in range(50)]


WRITERS: dict[str, Callable[[Path], Any]] = {
    "pandas": lambda path: frame().to_parquet(path),
    "Arrow in groups of rows": lambda path: pq.write_table(pa.table(dict(frame())), path, row_group_size=7),
    "compressed": lambda path: frame().to_parquet(path, compression="zstd"),
    "text of a dictionary beside": lambda path: (
        frame().assign(mode=pd.Categorical(["run"] * 50)).to_parquet(path)
    ),
    "Feather": lambda path: pf.write_feather(pa.table(dict(frame())), path),
    "an Arrow file": lambda path: pf.write_feather(pa.table(dict(frame())), path, compression="uncompressed"),
}


@pytest.mark.parametrize("writer", WRITERS)
def test_typed_columns_are_read_whatever_the_file_is_called(tmp_path: Path, writer: str) -> None:
    for name in ("log.parquet", "log.csv"):
        WRITERS[writer](tmp_path / name)
        log = read_log([tmp_path / name])
        is_the_motion(log)
        assert (log.name, log.files[0].name, log.warnings) == ("log", name, ())


def test_lists_as_lerobot_writes_them(tmp_path: Path) -> None:
    q = Q.astype(np.float32)
    columns = {
        "observation.state": pa.array(q.tolist(), pa.list_(pa.float32(), 6)),
        "timestamp": pa.array(T.astype(np.float32)),
        "frame_index": np.arange(50),
        "episode_index": np.zeros(50, dtype=int),
    }
    pq.write_table(pa.table(columns), tmp_path / "episode_000000.parquet")
    log = read_log([tmp_path / "episode_000000.parquet"], RAD)
    assert (log.q == q).all()
    assert log.t_ns.tolist() == [10_000_000 * k for k in range(50)]


def damaged(path: Path, write: Callable[[Path], Any], kept: int | float) -> str:
    """Return what is said of the beginning of a file: so many bytes, or this share of it."""
    write(path)
    data = path.read_bytes()
    path.write_bytes(data[: kept if isinstance(kept, int) else int(kept * len(data))])
    return refusal(LogError, read_log, [path])


@pytest.mark.slow
@pytest.mark.parametrize("kept", [4, 20, 0.5, 0.99])
@pytest.mark.parametrize("name", ["log.parquet", "log.mat"])
def test_truncated_files_are_one_line(tmp_path: Path, name: str, kept: float) -> None:
    def write(path: Path) -> None:
        frame().to_parquet(path) if name == "log.parquet" else savemat(
            path, {"t": T, "q": Q}, do_compression=True
        )

    said = damaged(tmp_path / name, write, 129 if name == "log.mat" and kept == 20 else kept)
    assert said.startswith(f"{tmp_path / name}:")
    assert "\n" not in said


def test_encrypted_and_empty_files_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    path.write_bytes(b"PARE" + bytes(100) + b"PARE")
    assert refusal(LogError, read_log, [path]) == (
        f"{path}: found an encrypted Parquet file, allowed: one without encryption"
    )
    path.write_bytes(b"")
    assert refusal(LogError, read_log, [path]) == (
        f"{path}: found an empty file, allowed: a table with one row per sample"
    )
    pq.write_table(pa.table({"a": ["x"], "b": ["y"]}), path)
    assert (
        refusal(LogError, read_log, [path])
        == f"{path}: found no number in a, b, allowed: one column per joint"
    )
    pq.write_table(pa.table({"t": pa.array([], pa.float64())}), path)
    assert (
        refusal(LogError, read_log, [path])
        == f"{path}: found a table without rows, allowed: one row per sample"
    )


MATS: dict[str, dict[str, Any]] = {
    "vector and matrix": {"t": T, "q": Q},
    "column and matrix": {"t": T[:, np.newaxis], "q": Q, "fs": 100.0, "robot": "UR5e"},
    "joints as rows": {"t": T, "q": Q.T},
    "another matrix": {"t": T, "q": Q, "DH": np.zeros((6, 4))},
    "a struct": {"log": {"t": T, "q": Q, "name": "run"}},
    "vectors": {"t": T, **{f"q{k}": Q[:, k - 1] for k in range(1, 7)}},
    "cells beside": {"t": T, "q": Q, "names": np.array(["a", "b"], dtype=object)},
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "compressed"),
    [*((what, False) for what in MATS), ("vector and matrix", True), ("a struct", True)],
)
def test_mat_files_of_others(tmp_path: Path, what: str, compressed: bool) -> None:
    savemat(tmp_path / "log.mat", MATS[what], do_compression=compressed)
    log = read_log([tmp_path / "log.mat"], RAD)
    is_the_motion(log)
    assert log.warnings == ()


@pytest.mark.slow
def test_a_matrix_alone_has_its_samples_along_its_longer_side(tmp_path: Path) -> None:
    for q in (Q, Q.T):
        savemat(tmp_path / "log.mat", {"q": q})
        log = read_log([tmp_path / "log.mat"], LogMap(unit={"": "rad"}, period=0.01))
        is_the_motion(log)


@pytest.mark.slow
def test_a_mat_file_without_samples_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    savemat(path, {"name": "run", "fs": 100.0})
    said = refusal(LogError, read_log, [path])
    assert said.startswith(
        f"{path}: found no numbers with one row per sample in name, fs, allowed: such as t"
    )
    assert "\n" not in said


def test_what_save_ascii_writes_is_text(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    np.savetxt(path, np.column_stack([T, Q]), fmt="%14.7e")
    np.testing.assert_allclose(read_log([path], RAD).q, Q, atol=5e-8)  # eight digits
