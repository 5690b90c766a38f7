"""What stands in the files, as the tools read it that people open them with."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from pyarrow.csv import read_csv
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from asserting import there
from exported import export_result
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables import FORMATS, ExportOptions, Format
from urmpipe_pipeline.tables import RowNames as Rows

START_NS = 1_700_000_000_123_456_789
GRID = [
    "t [s]",
    *(f"q{k} [rad]" for k in range(1, 7)),
    *(f"d_q{k} [rad/s]" for k in range(1, 7)),
    *(f"dd_q{k} [rad/s2]" for k in range(1, 7)),
    "px [m]", "py [m]", "pz [m]", "vx [m/s]", "vy [m/s]", "vz [m/s]", "ax [m/s2]", "ay [m/s2]", "az [m/s2]",
    "rz [rad]", "ry [rad]", "rx [rad]", "recorded_tcp_x [m]", "recorded_tcp_y [m]", "recorded_tcp_z [m]",
]  # fmt: skip


def grid_values(run: Run) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """The columns of GRID."""
    assert run.tcp is not None and run.tcp_recorded is not None
    tcp = run.tcp
    parts = (run.t, run.q, run.qd, run.qdd, tcp.position, tcp.velocity, tcp.acceleration, tcp.euler_zyx)
    return np.column_stack([*parts, run.tcp_recorded])


def write(result: Run | Comparison, path: Path, to: Format, rows: Rows | None = None) -> Path:
    export_result(result, path, ExportOptions(to, rows))
    return path


def test_a_csv_of_the_grid_has_every_double(run: Run, tmp_path: Path) -> None:
    frame = read_csv(write(run, tmp_path / "a.csv", "csv")).to_pandas()
    assert list(frame.columns) == GRID
    np.testing.assert_array_equal(frame.to_numpy(), grid_values(run))


def test_parquet_of_the_grid_has_every_double_its_units_and_its_origin(run: Run, tmp_path: Path) -> None:
    path = write(run, tmp_path / "a.parquet", "parquet")
    frame = pd.read_parquet(path)
    assert list(frame.columns) == [*GRID, "clock [ns]"]
    np.testing.assert_array_equal(frame[GRID].to_numpy(), grid_values(run))
    assert frame["clock [ns]"].tolist() == (START_NS + run.t_ns).tolist()
    schema = pq.read_schema(path)
    assert schema.field("dd_q1 [rad/s2]").metadata == {b"unit": b"rad/s2"}
    about = json.loads(schema.metadata[b"urmpipe"])
    assert about["robot"] == "ur5e"
    assert about["inputs"][0]["sha256"] == run.log.files[0].sha256
    assert about["clock_start_ns"] == START_NS


def test_parquet_of_the_file_has_its_own_numbers(run: Run, tmp_path: Path) -> None:
    table = pq.read_table(write(run, tmp_path / "a.parquet", "parquet", "file"))
    degrees = [f"q{k} [deg]" for k in range(1, 7)]
    assert table.column_names == ["stamp [ns]", *degrees, "x [mm]", "y [mm]", "z [mm]", "clock [ns]"]
    assert str(table.schema.field("stamp [ns]").type) == "int64"
    assert table["stamp [ns]"].to_pylist() == [START_NS + 10_000_000 * k for k in range(40)]
    assert table["q1 [deg]"][1].as_py() == round(np.degrees(3.02), 6)
    assert table.schema.field("x [mm]").metadata == {b"unit": b"mm"}


def test_missing_samples_are_nulls_and_empty_cells(run: Run, tmp_path: Path) -> None:
    q = run.q.copy()
    q[3, 2] = np.nan
    holed = replace(run, q=q)
    table = pq.read_table(write(holed, tmp_path / "a.parquet", "parquet"))
    assert table["q3 [rad]"].null_count == 1
    assert not table["q3 [rad]"][3].is_valid
    line = write(holed, tmp_path / "a.csv", "csv").read_text().splitlines()[4]
    assert line.split(",")[3] == ""


def test_mat_of_the_grid_is_a_struct_in_si(run: Run, tmp_path: Path) -> None:
    struct = loadmat(write(run, tmp_path / "a.mat", "mat"), simplify_cells=True)["run"]
    assert run.tcp is not None and run.tcp_recorded is not None
    for field, values in (
        ("t", run.t), ("q", run.q), ("qd", run.qd), ("qdd", run.qdd), ("p", run.tcp.position),
        ("v", run.tcp.velocity), ("a", run.tcp.acceleration), ("euler_zyx", run.tcp.euler_zyx),
        ("p_recorded", run.tcp_recorded), ("clock_ns", START_NS + run.t_ns),
    ):  # fmt: skip
        np.testing.assert_array_equal(struct[field], values)
    assert struct["joints"].tolist() == ["q1", "q2", "q3", "q4", "q5", "q6"]
    assert struct["units"]["qd"].tolist() == ["rad/s"] * 6
    assert struct["units"]["p"] == "m"
    assert json.loads(struct["metadata"])["robot"] == "ur5e"


def test_mat_of_the_file_has_its_own_numbers_and_names(run: Run, tmp_path: Path) -> None:
    struct = loadmat(write(run, tmp_path / "a.mat", "mat", "file"), simplify_cells=True)["run"]
    assert struct["names"].tolist()[5:] == ["q6 [deg]", "x [mm]", "y [mm]", "z [mm]"]
    assert struct["units"].tolist() == ["deg"] * 6 + ["mm"] * 3
    assert struct["values"].shape == (40, 9)
    assert struct["values"][1, 0] == round(np.degrees(3.02), 6)
    assert (struct["clock_names"], struct["clock_units"]) == ("stamp [ns]", "ns")
    assert struct["clock_ns"].tolist() == [START_NS + 10_000_000 * k for k in range(40)]


def test_mat_without_a_robot_has_empty_fields(run: Run, tmp_path: Path) -> None:
    bare = replace(run, robot=None, tcp=None, tcp_recorded=None)
    struct = loadmat(write(bare, tmp_path / "a.mat", "mat"), simplify_cells=True)["run"]
    assert struct["p"].size == struct["v"].size == struct["p_recorded"].size == 0
    assert struct["units"]["q"].tolist() == ["rad"] * 6


def test_mat_of_one_joint_keeps_its_shapes(run: Run, tmp_path: Path) -> None:
    one = replace(run, robot=None, tcp=None, log=replace(run.log, joints=("äxis",), q=run.log.q[:, :1]))
    one = replace(one, q=run.q[:, :1], qd=run.qd[:, :1], qdd=run.qdd[:, :1])
    struct = loadmat(write(one, tmp_path / "a.mat", "mat"))["run"][0, 0]
    assert struct["q"].shape == (40, 1)
    assert struct["joints"].shape == (1, 1)
    assert struct["joints"][0, 0].item() == "äxis"


def test_a_mat_file_says_what_it_is_and_stays_one(run: Run, tmp_path: Path) -> None:
    head = write(run, tmp_path / "a.mat", "mat").read_bytes()[:128]
    assert head[:116].rstrip() == b"MATLAB 5.0 MAT-file, urmpipe export"
    assert head[124:] == b"\x00\x01IM"  # version 5, little endian


def test_tum_of_the_grid_is_the_pose_by_forward_kinematics(run: Run, tmp_path: Path) -> None:
    path = write(run, tmp_path / "a.tum", "tum")
    first, names, *lines = path.read_text().splitlines()
    assert (first, names) == ("# urmpipe export", "# t[s] x[m] y[m] z[m] qx qy qz qw")
    assert lines[0].startswith("1700000000.123456789 ")
    assert lines[39].startswith("1700000000.513456789 ")
    rows = np.loadtxt(path)
    assert run.robot is not None and run.tcp is not None
    # The position is computed by another recursion than the velocities: rounding apart by some 1e-16 m.
    np.testing.assert_allclose(rows[:, 1:4], run.tcp.position, rtol=0, atol=1e-14)
    _, rotation = poses_over_log(run.robot, run.q)
    # A quaternion's entries carry the rounding of nine products each: some 1e-16.
    np.testing.assert_allclose(Rotation.from_quat(rows[:, 4:]).as_matrix(), rotation, rtol=0, atol=1e-14)
    assert (np.einsum("ij,ij->i", rows[1:, 4:], rows[:-1, 4:]) > 0).all()


def test_tum_as_recorded_has_the_recorded_rotation(run: Run, tmp_path: Path) -> None:
    vectors = np.column_stack([np.zeros(40), np.zeros(40), np.linspace(0.1, 6.0, 40)])
    vectors[4] = np.nan
    recorded = replace(run, log=replace(run.log, tcp_rotation=vectors, rotation_form="vector"))
    result = export_result(recorded, tmp_path / "a.tum", ExportOptions("tum", tcp="recorded"))
    assert (result.rows, result.left_out, result.files[0].rows) == ("file", 1, 39)
    assert [warning.message for warning in result.warnings] == ["1 of 40 rows have no pose: left out"]
    rows = np.loadtxt(tmp_path / "a.tum")
    np.testing.assert_array_equal(rows[:, 1:4], np.delete(there(run.log.tcp_position), 4, axis=0))
    kept = np.delete(vectors, 4, axis=0)
    # Past half a turn the vector of a rotation is another one: compared as matrices, to some 1e-16.
    np.testing.assert_allclose(
        Rotation.from_quat(rows[:, 4:]).as_matrix(),
        Rotation.from_rotvec(kept).as_matrix(),
        rtol=0,
        atol=1e-14,
    )


def test_tum_of_the_file_has_its_rows(run: Run, tmp_path: Path) -> None:
    path = write(replace(run, q=run.q[:7], t_ns=run.t_ns[:7]), tmp_path / "a.tum", "tum", "file")
    rows = np.loadtxt(path)
    np.testing.assert_array_equal(rows[:, 1:4], poses_over_log(there(run.robot), run.log.q)[0])


def test_a_comparison_is_one_table(comparison: Comparison, tmp_path: Path) -> None:
    frame = read_csv(write(comparison, tmp_path / "a.csv", "csv")).to_pandas()
    assert frame["run"].value_counts().to_dict() == {"a, first": 40, "b": 30}
    for run in comparison.runs:
        own = frame[frame["run"] == run.name]
        assert own["sample"].tolist() == run.sample.tolist()
        assert own["t [s]"].tolist() == run.t.tolist()
        for what, axes in (("delta", ("x", "y", "z", "norm")), ("reference", "xyz"), ("actual", "xyz")):
            names = [f"{what}_{axis} [m]" for axis in axes]
            np.testing.assert_array_equal(own[names].to_numpy(), getattr(run, what))
        assert own["out_of_tolerance"].tolist() == run.out_of_tolerance.tolist()
    again = pd.read_parquet(write(comparison, tmp_path / "a.parquet", "parquet"))
    pd.testing.assert_frame_equal(
        again.drop(columns="clock [ns]"), frame, check_dtype=False, check_exact=True
    )


def test_a_comparison_is_a_struct_with_a_cell_a_log(comparison: Comparison, tmp_path: Path) -> None:
    path = write(comparison, tmp_path / "a.mat", "mat")
    struct = loadmat(path, simplify_cells=True)["comparison"]
    assert struct["verdict"] == comparison.verdict
    assert struct["tolerance"] == comparison.tolerance
    for found, run in zip(struct["runs"], comparison.runs, strict=True):
        assert found["name"] == run.name
        np.testing.assert_array_equal(found["delta"], run.delta)
        np.testing.assert_array_equal(found["out_of_tolerance"], run.out_of_tolerance)


def test_a_comparison_is_two_trajectories_a_log(comparison: Comparison, tmp_path: Path) -> None:
    result = export_result(comparison, tmp_path / "c.tum", ExportOptions("tum"))
    names = ["c-a,_first-reference.tum", "c-a,_first-actual.tum", "c-b-reference.tum", "c-b-actual.tum"]
    assert [one.path.name for one in result.files] == names
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert [one.rows for one in result.files] == [40, 40, 30, 30]
    assert [warning.kind for warning in result.warnings] == ["no-orientation"]
    reference, actual = (np.loadtxt(tmp_path / name) for name in names[:2])
    np.testing.assert_array_equal(reference[:, 1:4], comparison.runs[0].reference)
    np.testing.assert_array_equal(actual[:, 1:4], comparison.runs[0].actual)
    np.testing.assert_array_equal(reference[:, 0], actual[:, 0])
    assert (actual[:, 4:] == [0, 0, 0, 1]).all()


@pytest.mark.parametrize("to", ["csv", "parquet", "mat"])
def test_a_name_keeps_its_signs_inside_the_file(comparison: Comparison, tmp_path: Path, to: Format) -> None:
    odd = replace(comparison, runs=(replace(comparison.runs[0], name='a "b", c;ü'),))
    path = write(odd, tmp_path / f"a.{to}", to)
    if to == "mat":
        found = loadmat(path, simplify_cells=True)["comparison"]["runs"]["name"]
    else:
        found = (read_csv(path) if to == "csv" else pq.read_table(path))["run"][0].as_py()
    assert found == 'a "b", c;ü'


@pytest.mark.parametrize("to", FORMATS)
def test_names_that_no_text_can_hold_do_not_stop_it(
    comparison: Comparison, tmp_path: Path, to: Format
) -> None:
    """A file name of bytes that are no UTF-8 has lone surrogates for them in Python."""
    odd = "a\udcff"
    log = replace(comparison.runs[0].run.log, joints=(odd, *"bcdef"))
    run = replace(comparison.runs[0].run, name=odd, log=log)
    changed = replace(comparison, name=odd, runs=(replace(comparison.runs[0], name=odd, run=run),))
    assert export_result(changed, tmp_path / f"c.{to}", ExportOptions(to)).files[0].rows == 40
    assert export_result(run, tmp_path / f"r.{to}", ExportOptions(to)).files[0].rows == 40
