"""What `export` writes of a run, `ingest` reads: without options, without a question, the same to the bit."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
import pytest

import urmpipe
from urmpipe_datasets import LOGS
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables import Format

Made: TypeAlias = Callable[[str], Run]

FORMATS: Sequence[Format] = ("csv", "parquet", "mat")

T = np.arange(60) * 0.01
Q = (np.array([3.0, 0.2, -0.4, 1.0, 0.5, 2.0]) + T[:, np.newaxis] * [2, -0.3, 0.6, 0.1, 1.1, -2] + np.pi) % (
    2 * np.pi
) - np.pi


def table(names: Sequence[str], *columns: Any) -> pd.DataFrame:
    """Return columns under names."""
    arrays = [np.asarray(column)[:, np.newaxis] if np.ndim(column) == 1 else column for column in columns]
    flat = [column for array in arrays for column in np.asarray(array).T]
    return pd.DataFrame(dict(zip(names, flat, strict=True)))


def joints(unit: str) -> list[str]:
    return [f"q{k} [{unit}]" for k in range(1, 7)]


def with_pose() -> pd.DataFrame:
    """A log with the pose of a UR5e as a rotation vector, in mm."""
    from scipy.spatial.transform import Rotation

    position, rotation = poses_over_log(load_robot("ur5e"), Q)
    names = ["t [ms]", *joints("deg"), "x [mm]", "y [mm]", "z [mm]", "rx", "ry", "rz"]
    return table(names, 1e3 * T, np.degrees(Q), position * 1e3, Rotation.from_matrix(rotation).as_rotvec())


def uneven() -> pd.DataFrame:
    """Steps that are not even: the grid has other samples."""
    t = T + 0.002 * np.sin(np.arange(60.0))
    return table(["t [s]", *joints("rad")], t, Q)


def missing() -> pd.DataFrame:
    frame = table(["t [s]", *joints("rad")], T, Q)
    frame.iloc[7, 3] = np.nan
    return frame


STAMPS = 1_700_000_000_123_456_789 + np.arange(60) * 10_000_000
DATES = pd.Series(pd.to_datetime(STAMPS)).astype(str)

RATES = [f"qd{k} [rad/s]" for k in range(1, 7)]
SLOPES = np.gradient(np.unwrap(Q, axis=0), 0.01, axis=0)
SPLIT = table(["sec", "nanosec", *joints("rad")], STAMPS // 10**9, STAMPS % 10**9, Q)

CASES: dict[str, tuple[pd.DataFrame, dict[str, Any]]] = {
    "rad over s": (table(["t [s]", *joints("rad")], T, Q), {}),
    "epoch in s": (table(["stamp [s]", *joints("rad")], 1_700_000_000.25 + T, Q), {}),
    "pose": (with_pose(), {"robot": "ur5e"}),
    "uneven": (uneven(), {"robot": "ur5e"}),
    "missing": (missing(), {}),
    "recorded rates": (table(["t [s]", *joints("rad"), *RATES], T, Q, SLOPES), {}),
    "sec and nanosec": (SPLIT.astype({"sec": int, "nanosec": int}), {}),
    "named by hand": (
        table(["tick", "shoulder", "upper", "fore", "x", "y", "z"], T, Q),
        {"unit": "rad", "time": "tick", "joints": ["fore", "x", "shoulder", "y", "z", "upper"]},
    ),
    "a path": (table(["t [s]", "x [m]", "y [m]", "z [m]"], T, Q[:, 3:]), {}),
}  # fmt: skip


def dated() -> pd.DataFrame:
    frame = table(["t", *joints("rad")], T, Q)
    return frame.assign(t=DATES)


CASES["dates"] = (dated(), {})

KEPT_BY_CSV = set(CASES) - {"named by hand"}
"""A CSV has the names of the file and no more: what these did not tell is asked again."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Return the run of a case, read once."""

    @cache
    def made(case: str) -> Run:
        frame, options = CASES[case]
        path = tmp_path_factory.mktemp("case") / "log.csv"
        frame.to_csv(path, index=False)
        return urmpipe.ingest(path, **options)

    return made


def again(tmp_path: Path, run: Run, rows: Any, to: Format) -> Run:
    """Return the run of an export, read without options but the arm."""
    path = tmp_path / f"again-{rows}.{to}"
    urmpipe.export(run, path, rows=rows)
    return urmpipe.ingest(path, run.robot)


def same(found: Any, wanted: Any) -> None:
    """Compare arrays to the bit, NaN with NaN."""
    assert (found is None) == (wanted is None)
    if found is not None:
        np.testing.assert_array_equal(found, wanted, strict=True)


@pytest.mark.slow
@pytest.mark.parametrize("to", FORMATS)
@pytest.mark.parametrize("case", CASES)
def test_the_rows_of_the_file_come_back(made: Made, tmp_path: Path, case: str, to: Format) -> None:
    if to == "csv" and case not in KEPT_BY_CSV:
        pytest.skip("a CSV does not tell it")
    run = made(case)
    found = again(tmp_path, run, "file", to)
    one, other = found.log, run.log
    for name in ("q", "t_ns", "qd", "qdd", "tcp_position", "tcp_rotation"):
        same(getattr(one, name), getattr(other, name))
    assert (one.clock_start_ns, one.joints) == (other.clock_start_ns, other.joints)
    assert one.rotation_form == other.rotation_form
    assert {w.kind for w in found.warnings} <= {w.kind for w in run.warnings}


@pytest.mark.slow
@pytest.mark.parametrize("to", FORMATS)
@pytest.mark.parametrize("case", CASES)
def test_the_grid_comes_back(made: Made, tmp_path: Path, case: str, to: Format) -> None:
    run = made(case)
    found = again(tmp_path, run, "grid", to)
    for name in ("q", "t_ns", "tcp_recorded"):
        same(getattr(found, name), getattr(run, name))
    if run.log.joints:
        same(found.qd, run.qd)
        same(found.qdd, run.qdd)
    assert found.log.joints == run.log.joints
    # A CSV of the grid counts from the first row: it has no clock of the file.
    assert found.log.clock_start_ns == (0 if to == "csv" else run.log.clock_start_ns)
    assert {w.kind for w in found.warnings} <= {w.kind for w in run.warnings}
    assert not found.repolarizations


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_tables_of_results_come_back(made: Made, tmp_path: Path, case: str) -> None:
    run = made(case)
    log = urmpipe.ingest(run.log.to_frame(), run.robot)
    same(log.log.q, run.log.q)
    same(log.log.t_ns, run.log.t_ns)
    same(log.log.tcp_position, run.log.tcp_position)
    same(log.log.tcp_rotation, run.log.tcp_rotation)
    assert {w.kind for w in log.warnings} <= {w.kind for w in run.warnings}
    if run.log.joints:
        run.to_frame().to_parquet(tmp_path / "frame.parquet")
        for found in (
            urmpipe.ingest(run.to_frame(), run.robot),
            urmpipe.ingest(tmp_path / "frame.parquet", run.robot),
        ):
            for name in ("q", "qd", "qdd", "t_ns"):
                same(getattr(found, name), getattr(run, name))


@pytest.mark.slow
def test_a_mat_file_of_another_process_is_the_same(made: Made, tmp_path: Path) -> None:
    written = tmp_path / "log.mat"
    urmpipe.export(made("dates"), written, rows="file")
    copy = shutil.copy(written, tmp_path / "copy.mat")  # read in a process of its own
    one, other = urmpipe.ingest(copy).log, urmpipe.ingest(written).log
    same(one.q, other.q)
    same(one.t_ns, other.t_ns)
    assert (one.clock_start_ns, one.joints) == (other.clock_start_ns, other.joints)


@pytest.mark.slow
@pytest.mark.parametrize("to", FORMATS)
def test_still_poses_come_back(tmp_path: Path, to: Format) -> None:
    q = np.random.default_rng(3).uniform(-2, 2, (40, 6))
    table(joints("rad"), q).to_csv(tmp_path / "poses.csv", index=False)
    run = urmpipe.ingest(tmp_path / "poses.csv", "ur5e", poses=True)
    for rows in ("grid", "file"):
        found = again(tmp_path, run, rows, to)
        same(found.log.q, q)
        assert not found.log.timed


@pytest.mark.slow
@pytest.mark.parametrize("to", FORMATS)
@pytest.mark.parametrize("name", ["coppeliasim.csv", "matlab.csv", "path.csv"])
def test_logs_of_other_programs_come_back(tmp_path: Path, name: str, to: Format) -> None:
    run = urmpipe.ingest(LOGS / name, "urm6", rotation="zyx" if name == "matlab.csv" else None)
    grid = again(tmp_path, run, "grid", to)
    same(grid.q, run.q)
    same(grid.t_ns, run.t_ns)
    same(grid.tcp_recorded, run.tcp_recorded)
    file = again(tmp_path, run, "file", to) if to != "csv" else run
    log: JointLog = file.log
    same(log.q, run.log.q)
    same(log.t_ns, run.log.t_ns)
    same(log.tcp_rotation, run.log.tcp_rotation)


def test_a_grid_with_another_column_is_read_by_what_is_ours(made: Made, tmp_path: Path) -> None:
    run = made("pose")
    urmpipe.export(run, tmp_path / "grid.csv")
    frame = pd.read_csv(tmp_path / "grid.csv").assign(load=1.0)
    found = urmpipe.ingest(frame, "ur5e")
    same(found.q, run.q)
    frame = frame.rename(columns={"dd_q6 [rad/s2]": "other"})
    assert urmpipe.ingest(frame, "ur5e").log.source == "table"
