"""Logs that Python holds: arrays and tables as what `ingest`, `compare` and `diagnose` take."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from scipy.spatial.transform import Rotation

import urmpipe
from asserting import there
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot

T = np.arange(80) * 0.01
Q = 0.4 * np.sin(T[:, np.newaxis] + np.arange(6))
NAMES = ["t [s]", *(f"q{k} [rad]" for k in range(1, 7))]
FRAME = pd.DataFrame(np.column_stack([T, Q]), columns=NAMES)
POSITION, ROTATION = poses_over_log(load_robot("ur5e"), Q)


def poses() -> np.ndarray[Any, Any]:
    """The poses of the arm as matrices, shape (n, 4, 4)."""
    matrices = np.tile(np.eye(4), (len(Q), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = ROTATION, POSITION
    return matrices


def test_arrays_give_what_their_file_gives(tmp_path: Path) -> None:
    FRAME.to_csv(tmp_path / "log.csv", index=False)
    wanted = urmpipe.ingest(tmp_path / "log.csv", "ur5e")
    for run in (urmpipe.ingest(t=T, q=Q, robot="ur5e"), urmpipe.ingest(FRAME, "ur5e")):
        assert (run.name, run.warnings, run.audit) == ("log", wanted.warnings, wanted.audit)
        for name in ("q", "qd", "qdd", "t_ns"):
            assert (getattr(run, name) == getattr(wanted, name)).all()


@pytest.mark.parametrize("shape", [(3,), (7,), (4, 4)])
def test_a_recorded_tool_centre_point(shape: tuple[int, ...]) -> None:
    quat = Rotation.from_matrix(ROTATION).as_quat()
    given = {(3,): POSITION, (7,): np.column_stack([POSITION, quat]), (4, 4): poses()}[shape]
    run = urmpipe.ingest(t=T, q=Q, recorded_tcp=given, robot="ur5e")
    np.testing.assert_array_equal(there(run.log.tcp_position), POSITION)
    assert run.warnings == ()
    if shape != (3,):
        turned = run.log.tcp_quat_xyzw
        assert turned is not None
        # A matrix and its quaternion are one rotation but for rounding.
        np.testing.assert_allclose(Rotation.from_quat(turned).as_matrix(), ROTATION, atol=1e-14)
    alone = urmpipe.ingest(t=T, recorded_tcp=given)
    assert (alone.log.joints, alone.log.rows) == ((), 80)


@pytest.mark.slow
def test_tables_are_operands() -> None:
    moved = FRAME.assign(**{"q1 [rad]": FRAME["q1 [rad]"] + 0.001})
    arrow = pa.Table.from_pandas(moved, preserve_index=False)
    compared = urmpipe.compare(FRAME, [moved, arrow, urmpipe.ingest(t=T, q=Q, name="arrays")], robot="ur5e")
    assert [one.name for one in compared.runs] == ["log 1", "log 2", "arrays"]
    assert compared.runs[0].statistics == compared.runs[1].statistics
    assert compared.runs[2].statistics["norm"].max == 0.0
    assert urmpipe.compare(FRAME, moved, robot="ur5e").name == "log-against-reference"
    assert urmpipe.compare(FRAME, arrow, robot="ur5e", time="t").runs[0].name == "log"
    diagnosis = urmpipe.diagnose(FRAME, moved, robot="ur5e")
    judged = there(diagnosis.comparison)
    assert isinstance(judged, urmpipe.Comparison)
    assert judged.runs[0].statistics == compared.runs[0].statistics


def test_the_map_and_the_recording_of_a_table(tmp_path: Path) -> None:
    frame = FRAME.rename(columns={name: f"axis {k}" for k, name in enumerate(NAMES[1:])})
    joints = [f"axis {k}" for k in range(6)]
    run = urmpipe.ingest(
        frame, "ur5e", joints=joints, unit="rad", write_map=tmp_path / "lab.toml", output=tmp_path / "log.rrd"
    )
    again = urmpipe.ingest(frame, map=tmp_path / "lab.toml")
    assert (again.q == run.q).all()
    stored = urmpipe.read_recording(tmp_path / "log.rrd")
    assert isinstance(stored, urmpipe.Run)
    np.testing.assert_array_equal(stored.q, run.q)
    assert run.log.files[0].name == "log"
    assert (
        run.log.files[0].sha256
        != urmpipe.ingest(frame.iloc[:40], map=tmp_path / "lab.toml").log.files[0].sha256
    )


def test_the_map_of_arrays_reads_their_table(tmp_path: Path) -> None:
    urmpipe.ingest(t=T, q=Q, names=list("abcdef"), robot="ur5e", write_map=tmp_path / "lab.toml")
    frame = pd.DataFrame(np.column_stack([T, Q]), columns=["t", *"abcdef"])
    assert (urmpipe.ingest(frame, map=tmp_path / "lab.toml").q == Q).all()
