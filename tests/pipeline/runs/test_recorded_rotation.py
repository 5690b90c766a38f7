"""The recorded orientation of a run: on the grid, without jumps between the names of one rotation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from asserting import there
from exported import export_result
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import COLUMN_NAMES, RotationForm, column_count
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables import ExportOptions

ROWS = 200
TURN = np.linspace(2.0, 7.0, ROWS)
"""An angle about a fixed axis that goes on past pi: a rotation vector flips its sign there."""

AXIS = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
PRINTED = 1e-8
"""Nine decimals in the file, and rounding."""


def ingest(
    path: Path, names: list[str], columns: FloatArray, form: RotationForm | None, tsp: float | None
) -> Run:
    position = TURN[:, np.newaxis] * (0.1, 0.05, 0.02)
    table = np.column_stack((0.005 * np.arange(ROWS), np.sin(TURN), position, columns))
    header = ",".join(["t [s]", "q1 [rad]", "x [m]", "y [m]", "z [m]", *names])
    np.savetxt(path, table, "%.9f", ",", header=header, comments="")
    return ingest_log([path], read=LogMap(rotation=form), tsp=tsp)


def recorded() -> FloatArray:
    return Rotation.from_rotvec(TURN[:, np.newaxis] * AXIS).as_rotvec()


@pytest.mark.parametrize("tsp", [None, 0.01])
def test_a_rotation_vector_goes_on_past_pi(tsp: float | None, tmp_path: Path) -> None:
    vectors = recorded()
    assert np.abs(np.diff(vectors, axis=0)).max() > 2.0  # as the file has it, it jumps
    run = ingest(tmp_path / "log.csv", ["rx [rad]", "ry [rad]", "rz [rad]"], vectors, "vector", tsp)
    assert run.rotation_names == ("rx", "ry", "rz")
    expected = TURN[:, np.newaxis] * AXIS
    np.testing.assert_allclose(
        there(run.rotation_recorded), expected if tsp is None else expected[::2], atol=PRINTED
    )
    np.testing.assert_allclose(there(run.log.tcp_rotation), vectors, atol=PRINTED)  # the file's own stay


def test_a_matrix_becomes_a_quaternion_without_jumps(tmp_path: Path) -> None:
    rotation = Rotation.from_rotvec(TURN[:, np.newaxis] * AXIS)
    names = [f"r{i}{j}" for i in "123" for j in "123"]
    run = ingest(tmp_path / "log.csv", names, rotation.as_matrix().reshape(-1, 9), None, 0.0125)
    quaternions = there(run.rotation_recorded)
    assert run.rotation_names == COLUMN_NAMES["quat_xyzw"]
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-14)
    assert np.abs(np.diff(quaternions, axis=0)).max() < 0.05  # a jump would be 2 times its size
    # linear between samples 0.025 rad apart: off by a part of its square
    between = (
        Rotation.from_quat(quaternions)
        * Rotation.from_rotvec(np.interp(run.t, 0.005 * np.arange(ROWS), TURN)[:, np.newaxis] * AXIS).inv()
    )
    assert between.magnitude().max() < 1e-4


def test_it_comes_back_from_a_recording_and_leaves_with_the_grid(tmp_path: Path) -> None:
    run = ingest(tmp_path / "log.csv", ["rx [rad]", "ry [rad]", "rz [rad]"], recorded(), "vector", None)
    back = read_recording(write_recording(run, tmp_path / "log.rrd"))
    assert isinstance(back, Run)
    np.testing.assert_array_equal(back.rotation_recorded, run.rotation_recorded)
    export_result(run, tmp_path / "grid.csv", ExportOptions("csv"), [])
    table = np.genfromtxt(tmp_path / "grid.csv", delimiter=",", names=True, deletechars="")
    np.testing.assert_array_equal(table["recorded_rx_[rad]"], there(run.rotation_recorded)[:, 0])


def test_a_log_without_an_orientation_has_none(tmp_path: Path) -> None:
    run = ingest(tmp_path / "log.csv", [], np.empty((ROWS, 0)), None, None)
    assert (run.rotation_recorded, run.rotation_names) == (None, ())


def test_each_form_has_a_name_for_each_column() -> None:
    assert {form: len(names) for form, names in COLUMN_NAMES.items()} == {
        form: column_count(form) for form in COLUMN_NAMES
    }
