"""Targets from files: whoever wrote them, the poses come out, and a wrong row stops no other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from make_specimens import paths
from specimen import SPECIMENS, Truth
from urmpipe_models.errors import LogError, UrmpipeError
from urmpipe_pipeline.inverse.target_file import TargetFile, read_targets
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.sources import ReadOptions, read_log, read_map

DATASETS = Path(__file__).parents[3] / "datasets" / "urmpipe_datasets" / "logs"
LOGS = Path(__file__).resolve().parents[3].parent / "shared" / "logs"

Read = Callable[..., TargetFile]
Wrong = Callable[..., list[str]]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Write a file and read its targets."""

    def read(text: str | bytes, tsp: float | None = None, **options: Any) -> TargetFile:
        path = tmp_path / "targets.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_targets(path, ReadOptions(**options), tsp)

    return read


@pytest.fixture
def wrong(read: Read, tmp_path: Path) -> Wrong:
    """Read a file that must be refused, and return what is said, one line a finding."""

    def wrong(*args: Any, **options: Any) -> list[str]:
        with pytest.raises(UrmpipeError) as caught:
            read(*args, **options)
        return str(caught.value).replace(f"{tmp_path}/", "").split("\n")

    return wrong


def assert_turned(targets: TargetFile, rotation: list[Any], atol: float = 1e-14) -> None:
    """Hold the targets' orientations against matrices, within a few roundings."""
    assert targets.rotation is not None
    np.testing.assert_allclose(targets.rotation, np.array(rotation), rtol=0, atol=atol)


def said(targets: TargetFile) -> list[tuple[str, str]]:
    return [(warning.kind, warning.message) for warning in targets.warnings]


# What a file cannot tell by itself, by specimen.
OPTIONS: dict[str, Mapping[str, Any]] = {
    "cad_path_no_header": {"units": {"1": "mm"}},
    "tcp_xyz_mm": {"units": {"TCP_X": "mm"}},
    "tcp_rotation_vector": {"rotation": "vector"},
    "tcp_quaternion_numbered": {"rotation": "quat_wxyz", "units": {"x": "mm"}},
    "tcp_matrix_16_mm": {"units": {"T_3": "mm"}},
    "tcp_matrix_no_header": {"units": {"10": "mm"}},
}
TRUTHS: dict[str, Truth] = {
    name: truth
    for name, one in SPECIMENS.items()
    if (truth := one.make().truth) is not None and truth.position is not None
}


def test_all_specimens_with_a_tool_are_tried() -> None:
    with_tool = {name for name in SPECIMENS if name.startswith("tcp_") and SPECIMENS[name].folder != "wrong"}
    assert len(TRUTHS) == 28
    assert with_tool <= TRUTHS.keys()
    assert OPTIONS.keys() <= TRUTHS.keys()


@pytest.mark.parametrize("name", TRUTHS)
def test_a_specimen_with_a_tool_gives_its_poses_as_targets(name: str) -> None:
    truth, targets = (
        TRUTHS[name],
        read_targets(paths(SPECIMENS[name])[0], ReadOptions(**OPTIONS.get(name, {}))),
    )
    assert targets.row.tolist() == list(range(1, len(truth.t) + 1))
    assert targets.faults == {}
    assert truth.position is not None
    np.testing.assert_allclose(targets.position, truth.position, rtol=0, atol=truth.position_within)
    assert (targets.rotation is None) == (truth.rotation is None)
    if truth.rotation is not None and targets.rotation is not None:
        between = Rotation.from_matrix(targets.rotation).inv() * truth.rotation
        assert between.magnitude().max() <= truth.rotation_within
    if targets.t_ns is not None:
        np.testing.assert_allclose(targets.t_ns / 1e9, truth.t, rtol=0, atol=truth.t_within)
        assert targets.clock_start_ns / 1e9 == pytest.approx(truth.start, abs=truth.t_within, rel=0)


@pytest.mark.parametrize("folder", ["ur5e-rtde-static", "ur-rtde-10rows"])
@pytest.mark.skipif(not LOGS.is_dir(), reason="the real logs in ../shared/logs are not here")
def test_the_recorded_tool_of_a_real_log_is_a_path(folder: str) -> None:
    path = LOGS / folder / "robot_data.csv"
    targets, log = read_targets(path), read_log([path])
    assert log.tcp_position is not None
    assert log.tcp_quat_xyzw is not None
    assert targets.position.tolist() == log.tcp_position.tolist()
    assert_turned(targets, list(Rotation.from_quat(log.tcp_quat_xyzw).as_matrix()))
    assert targets.t_ns is not None
    assert (targets.t_ns.tolist(), targets.file) == (log.t_ns.tolist(), log.files[0])


def test_a_matrix_of_a_real_log_without_a_header_is_a_pose() -> None:
    path = LOGS / "pybotics-ur10-fk" / "ur10-joints-poses.csv"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    table = np.loadtxt(path, delimiter=",")[:, -16:].reshape(-1, 4, 4)
    targets = read_targets(path, ReadOptions(units={"10": "mm"}))
    np.testing.assert_allclose(targets.position, table[:, :3, 3] / 1e3, rtol=1e-15, atol=0)
    assert_turned(targets, list(table[:, :3, :3]), atol=1e-8)


def test_the_path_of_the_demo_is_read_as_ingest_reads_it() -> None:
    targets, run = read_targets(DATASETS / "path.csv"), ingest_log([DATASETS / "path.csv"])
    assert run.log.tcp_position is not None
    assert targets.position.tolist() == run.log.tcp_position.tolist()
    assert targets.t_ns is not None
    assert targets.t_ns.tolist() == run.log.t_ns.tolist()
    assert (targets.rotation, targets.faults, targets.file) == (None, {}, run.log.files[0])


# Rows


def test_each_wrong_row_has_its_reason_and_the_others_stay(read: Read) -> None:
    targets = read(
        "x,y,z\n0.3,0.1,0.5\n0.3,abc,0.5\n0.3,,0.5\n0.3,inf,0.5\n0.1,0.2\n1,2,3,4\nout of order\n"
        "nan,0.1,NaN\n1e999,x y,\n0.4,0.1,0.5\n"
    )
    assert targets.faults == {
        2: "column y: found 'abc', allowed: a finite number",
        3: "column y: found no number, allowed: a finite number",
        4: "column y: found inf, allowed: a finite number",
        5: "found 2 cells, allowed: 3",
        6: "found 4 cells, allowed: 3",
        7: "found 1 cell ('out of order'), allowed: 3",
        8: "columns x, z: found no number, allowed: a finite number",
        9: "column y: found 'x y', allowed: a finite number; column x: found inf, allowed: a finite number;"
        " column z: found no number, allowed: a finite number",
    }
    assert targets.row.tolist() == list(range(1, 11))
    assert targets.position[[0, 9]].tolist() == [[0.3, 0.1, 0.5], [0.4, 0.1, 0.5]]
    assert np.isnan(targets.position[1:9]).all()


ROWS = {
    "0.3,0.1,0.5": None,
    "nan,0.1,0.5": "column x: found no number, allowed: a finite number",
    "0.1,0.2": "found 2 cells, allowed: 3",
    "0.1,0.2,0.3,0.4": "found 4 cells, allowed: 3",
    "0.1,abc,0.5": "column y: found 'abc', allowed: a finite number",
    "one,two,0.5": "column x: found 'one', allowed: a finite number;"
    " column y: found 'two', allowed: a finite number",
    "a,b,c": "found 'a,b,c', allowed: a row of numbers",
    "-0.5": "found 1 cell, allowed: 3",
    "to do": "found 1 cell ('to do'), allowed: 3",
}
"""Rows, and what is wrong with each."""


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_good_row_is_read_whatever_stands_around_it(read: Read, count: int) -> None:
    """Each order of rows of each kind, one of them good: most may be wrong, the first one too."""
    for rows in product(ROWS, repeat=count):
        if None not in map(ROWS.get, rows):
            continue
        targets = read("x,y,z\n" + "\n".join(rows) + "\n")
        reasons = {k + 1: said for k, row in enumerate(rows) if (said := ROWS[row])}
        assert (targets.faults, len(targets)) == (reasons, count), rows


@pytest.mark.parametrize(
    "text",
    [
        "sep=;\r\nx;y;z\r\n0,4;0,1;0,5\r\n0,4;da;0,5\r\n",
        "\ufeffx;y;z\n0,4;0,1;0,5\n0,4;da;0,5\n",
        "# taught\n# x y z\n0.4 0.1 0.5\n0.4 da 0.5\n",
        "Pick positions\n\nx,y,z\n[m],[m],[m]\n0.4,0.1,0.5\n0.4,da,0.5\n",
        "x;y;z\n(mm);(mm);(mm)\n400;100;500\n400;da;500\n",
        '"x";"y";"z"\n"0.4";"0.1";"0.5"\n"0.4";"da";"0.5"\n',
        "x,y,z,\n0.4,0.1,0.5,\n0.4,da,0.5,\n",
        "Title of x y z\nx,y,z\n0.4,0.1,0.5\n0.4,da,0.5\n",
        "x\ty\tz\r0.4\t0.1\t0.5\r0.4\tda\t0.5\r",
    ],
)
def test_the_header_may_be_written_as_programs_do(read: Read, text: str) -> None:
    targets = read(text)
    assert targets.position[0].tolist() == [0.4, 0.1, 0.5]
    assert targets.faults == {2: "column y: found 'da', allowed: a finite number"}


MISSING = "columns x, y, z: found no number, allowed: a finite number"


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("x,y,z\n0.3,abc,0.5\n", ["column y: found 'abc', allowed: a finite number"]),
        ("x,y,z\na,b,c\n", ["found 'a,b,c', allowed: a row of numbers"]),
        ("x,y,z\nnan,nan,nan\n-,#N/A,NULL\n", [MISSING, MISSING]),
        ("x, y, z\na, b, c\n", ["found 'a, b, c', allowed: a row of numbers"]),
        ("Taught\nx;y;z\n;nan;\n", [MISSING]),
        ("# taught\nx y z\nto be taught\n", ["found 'to be taught', allowed: a row of numbers"]),
        ("x,y,z\nmm,mm,mm\n?,?,?\n", ["found '?,?,?', allowed: a row of numbers"]),
        ("x,y,z\n1,2\n3,4\n5,6\n", ["found 2 cells, allowed: 3"] * 3),
        ("x,y,z,qx,qy,qz,qw\n1,2,3\n", ["found 3 cells, allowed: 7"]),
        ("x,y,z\n0,1,0,2,0,3\n", ["found 6 cells, allowed: 3"]),
        ("x,y,z\n1,0.2,0.3,0.4\n", ["found 4 cells, allowed: 3"]),
    ],
)
def test_all_rows_may_be_wrong(read: Read, text: str, faults: list[str]) -> None:
    targets = read(text)
    assert targets.faults == dict(enumerate(faults, start=1))
    assert np.isnan(targets.position).all()


def test_a_column_that_counts_rows_needs_no_name_if_there_are_rows_to_count(read: Read) -> None:
    """As R's write.table writes them; of a single row the fourth cell may as well be the wrong one."""
    targets = read("x,y,z\n1,0.3,0.1,0.5\n2,0.4,0.1,0.5\n")
    assert targets.position.tolist() == [[0.3, 0.1, 0.5], [0.4, 0.1, 0.5]]


def test_rows_with_another_decimal_sign_stop_no_other(read: Read) -> None:
    targets = read("x;y;z\n0.3;0.1;0.5\n0,3;0,1;0,5\n")
    assert targets.position[0].tolist() == [0.3, 0.1, 0.5]
    assert targets.faults == {2: "found '0,3;0,1;0,5', allowed: a row of numbers"}
    most = read("x;y;z\n0.3;0.1;0.5\n0,3;0,1;0,5\n0,4;0,1;0,5\n")
    assert most.faults == {1: "found '0.3;0.1;0.5', allowed: a row of numbers"}


def test_a_map_that_names_the_columns_finds_rows_that_are_all_wrong(read: Read) -> None:
    targets = read("a,b,c\nu,v,w\n", position=("a", "b", "c"))
    assert targets.faults == {1: "found 'u,v,w', allowed: a row of numbers"}


NINE = ",".join(f"r{i}{j}" for i in "123" for j in "123")
UNIT, TWICE = "1,0,0,0,1,0,0,0,1", "2,0,0,0,2,0,0,0,2"
NONE = f"columns {NINE.replace(',', ', ')}: found R R^T off I by 3 and det R = 8,"


@pytest.mark.parametrize("rows", [[TWICE, UNIT], [UNIT, TWICE], [TWICE], [TWICE, TWICE, UNIT]])
def test_matrices_that_are_none_do_not_make_positions_of_the_others(read: Read, rows: list[str]) -> None:
    targets = read(f"x,y,z,{NINE}\n" + "".join(f"0.3,0.1,0.5,{row}\n" for row in rows))
    allowed = "allowed: a rotation, 0.01 off at most, det R = 1"
    assert targets.faults == {k: f"{NONE} {allowed}" for k, row in enumerate(rows, 1) if row == TWICE}
    assert targets.rotation is not None
    for rotation, row in zip(targets.rotation, rows, strict=True):
        assert np.array_equal(
            rotation, np.full((3, 3), np.nan if row == TWICE else np.eye(3)), equal_nan=True
        )


@pytest.mark.parametrize("first", ["0", "1"])
@pytest.mark.parametrize("header", [True, False])
def test_a_transform_that_is_none_stops_no_other(read: Read, header: bool, first: str) -> None:
    names = ",".join(f"T{i + int(first)}{j + int(first)}" for i in range(4) for j in range(4))
    sound, wrong_row = "1,0,0,.3,0,1,0,.1,0,0,1,.5,0,0,0,1", "2,0,0,.3,0,1,0,.1,0,0,1,.5,0,0,0,1"
    targets = read((f"{names}\n" if header else "") + f"{wrong_row}\n{sound}\n{wrong_row}\n")
    assert list(targets.faults) == [1, 3]
    assert targets.position[1].tolist() == [0.3, 0.1, 0.5]
    assert targets.rotation is not None
    assert targets.rotation[1].tolist() == np.eye(3).tolist()


def test_a_transform_column_by_column_is_known_by_its_last_row(read: Read) -> None:
    targets = read("1 0 0 0 0 1 0 0 0 0 1 0 .3 .1 .5 1\n1 0 0 0 0 1 0 0 0 0 2 0 .3 .1 .5 1\n")
    assert targets.position[0].tolist() == [0.3, 0.1, 0.5]
    assert list(targets.faults) == [2]


def test_numbered_quaternions_of_which_some_are_none_are_asked_for_their_form(
    read: Read, wrong: Wrong
) -> None:
    text = "x,y,z,q1,q2,q3,q4\n0.3,0.1,0.5,0.5,0,0,0\n0.3,0.1,0.5,1,0,0,0\n"
    assert wrong(text) == [
        "targets.csv: found q1, q2, q3, q4, which may be quat_wxyz or quat_xyzw, allowed: one form;"
        " --rotation quat_wxyz or --rotation quat_xyzw says which"
    ]
    targets = read(text, rotation="quat_wxyz")
    assert list(targets.faults) == [1]
    assert targets.rotation is not None
    assert targets.rotation[1].tolist() == np.eye(3).tolist()
    assert read("x,y,z,q1,q2,q3,q4\n0.3,0.1,0.5,0.5,0,0,0\n", rotation="quat_wxyz").faults == {
        1: "columns q1, q2, q3, q4: found a quaternion of norm 0.5, allowed: 1 within 0.001"
    }


def test_quaternions_are_normalised_within_a_thousandth_and_else_faults(read: Read) -> None:
    rows = ["0,0,0,1", "0,0,0,0", "0.5,0,0,0", "0,0,0,-1.0009", "0,0,0.0009,-0.9989", "0,nan,0,1"]
    targets = read("x,y,z,qx,qy,qz,qw\n" + "".join(f"0.3,0.1,0.5,{row}\n" for row in rows))
    allowed = "allowed: 1 within 0.001"
    assert targets.faults == {
        2: f"columns qx, qy, qz, qw: found a quaternion of norm 0, {allowed}",
        3: f"columns qx, qy, qz, qw: found a quaternion of norm 0.5, {allowed}",
        5: f"columns qx, qy, qz, qw: found a quaternion of norm 0.9989, {allowed}",
        6: "column qy: found no number, allowed: a finite number",
    }
    assert targets.rotation is not None
    assert targets.rotation[[0, 3]].tolist() == [np.eye(3).tolist()] * 2
    assert np.isnan(targets.rotation[[1, 2, 4, 5]]).all()
    assert np.isnan(targets.position[[1, 2, 4, 5]]).all()
    assert targets.targets.position is targets.position


def test_a_matrix_that_is_no_rotation_is_a_fault(read: Read) -> None:
    names = "x,y,z," + ",".join(f"r{i}{j}" for i in "123" for j in "123")
    unit, mirror, twice = "1,0,0,0,1,0,0,0,1", "1,0,0,0,1,0,0,0,-1", "2,0,0,0,2,0,0,0,2"
    sampled = f"{names}\n" + f"0.3,0.1,0.5,{unit}\n" * 1000
    targets = read(f"{sampled}0.3,0.1,0.5,{mirror}\n0.3,0.1,0.5,{twice}\n")
    listed = "columns " + ", ".join(f"r{i}{j}" for i in "123" for j in "123")
    allowed = "allowed: a rotation, 0.01 off at most, det R = 1"
    assert targets.faults == {
        1001: f"{listed}: found R R^T off I by 0 and det R = -1, {allowed}",
        1002: f"{listed}: found R R^T off I by 3 and det R = 8, {allowed}",
    }


def test_empty_rows_of_a_spreadsheet_at_the_end_are_none(read: Read) -> None:
    assert len(read("x,y,z\n0.3,0.1,0.5\n,,\n,,\n")) == 1
    assert len(read("t,x,y,z\n0,0.3,0.1,0.5\n1,0.3,0.1,0.5\n,,,\n")) == 2
    assert read("x,y,z\n0.3,0.1,0.5\n,,\n0.3,0.1,0.5\n").faults == {
        2: "columns x, y, z: found no number, allowed: a finite number"
    }
    assert list(read("x,y,z\n0.3,0.1,0.5\nnan,nan,nan\n").faults) == [2]


def test_rows_are_counted_as_ingest_counts_them(read: Read, tmp_path: Path) -> None:
    head = "# taught by hand\nx,y,z\nm,m,m\n0.3,0.1,0.5\n# a remark\n\n"
    text = f"{head}0.3,here,0.5\n\n0.3,0.1\n% end\n0.3,0.1,0.5\n"
    targets = read(text)
    assert (targets.row.tolist(), list(targets.faults)) == ([1, 2, 3, 4], [2, 3])
    with pytest.raises(LogError) as caught:
        read_log([tmp_path / "targets.csv"], ReadOptions(source="path"))
    assert [finding.row for finding in caught.value.findings] == [2, 3]


def test_a_wrong_row_among_many_is_found(read: Read) -> None:
    lines = [f"{k * 1e-6:.6f},0.1,0.5" for k in range(30_000)]
    lines[12_345] = "0.3,0.1,here"
    targets = read("x,y,z\n" + "\n".join(lines) + "\n")
    assert targets.faults == {12_346: "column z: found 'here', allowed: a finite number"}
    assert targets.position[12_346].tolist() == [0.012346, 0.1, 0.5]


# Times


def test_a_file_with_times_is_a_path_on_its_own_clock(read: Read) -> None:
    targets = read("t [ms],x,y,z\n2000,0.3,0.1,0.5\n2005,0.3,0.1,0.6\n2011,0.3,0.1,0.7\n")
    assert targets.t_ns is not None
    assert (targets.t_ns.tolist(), targets.clock_start_ns) == ([0, 5_000_000, 11_000_000], 2 * 10**9)


def test_without_times_a_period_makes_a_path(read: Read) -> None:
    """Source: [UrmArm2021]_ eq. 22, t = i Tsp."""
    text = "x,y,z\n0.3,0.1,0.5\n0.3,0.1,0.6\n0.3,0.1,0.7\n"
    assert read(text).t_ns is None
    for targets in (read(text, 0.005), read(text, period=0.005)):
        assert targets.t_ns is not None
        assert targets.t_ns.tolist() == [0, 5_000_000, 10_000_000]
        assert said(targets) == []


def test_a_period_beside_a_clock_is_not_used(read: Read) -> None:
    targets = read("t [s],x,y,z\n0,0.3,0.1,0.5\n1,0.3,0.1,0.6\n", 0.005)
    unused = "--tsp is not used, since the file has a clock; --time none leaves that out"
    assert said(targets) == [("period-not-used", unused)]
    assert targets.t_ns is not None
    assert targets.t_ns.tolist() == [0, 10**9]


def test_a_row_without_a_time_is_a_fault_and_stands_between_its_neighbours(read: Read) -> None:
    rows = ["NaN", "1.0", "x", "", "1.3", "1.4", "-"]
    targets = read("t,x,y,z\n" + "".join(f"{time},0.3,0.1,0.5\n" for time in rows))
    missing = "column t: found no time, allowed: a time in every row"
    text = "column t: found 'x', allowed: a number in every row"
    assert targets.faults == {1: missing, 3: text, 4: missing, 7: missing}
    assert targets.t_ns is not None
    assert targets.t_ns.tolist() == [k * 10**8 for k in range(7)]
    assert targets.clock_start_ns == 9 * 10**8
    assert np.isfinite(targets.position).all(axis=1).tolist() == [
        False,
        True,
        False,
        False,
        True,
        True,
        False,
    ]


def test_times_of_years_stay_exact_beside_a_row_without_one(read: Read) -> None:
    """20,000,000.000000001 s is no double."""
    targets = read("t [s],x,y,z\n0,0.3,0.1,0.5\n,0.3,0.1,0.5\n20000000.000000001,0.3,0.1,0.5\n")
    assert targets.t_ns is not None
    assert targets.t_ns.tolist() == [0, 10**16, 2 * 10**16 + 1]


def test_dates_that_are_none_are_faults(read: Read) -> None:
    days = [
        "2021-04-11 22:27:21.500000",
        "2021-04-11 22:27:21.600000",
        "yesterday",
        "2021-04-11 22:27:21.800000",
    ]
    targets = read("time,x,y,z\n" + "".join(f"{day},0.3,0.1,0.5\n" for day in days))
    assert targets.faults == {3: "column time: found 'yesterday', allowed: times as in the other rows"}
    assert targets.t_ns is not None
    assert targets.t_ns.tolist() == [0, 10**8, 2 * 10**8, 3 * 10**8]


def test_times_that_repeat_or_run_backwards_are_an_error_of_the_file(wrong: Wrong) -> None:
    """As in a log: nothing tells which of the two rows is wrong."""
    assert wrong("t,x,y,z\n0,1,1,1\n0.3,1,1,1\n0.2,1,1,1\n,1,1,1\n0.2,1,1,1\n") == [
        "targets.csv:4, column t: found 0.2 s after 0.3 s, allowed: times that increase from row to row",
        "targets.csv:6, column t: found 0.2 s again, allowed: times that increase from row to row",
    ]
    assert wrong("t,x,y,z\n,1,1,1\n-,1,1,1\n") == [
        "targets.csv, column t: found no time in any of 2 rows, allowed: at least one;"
        " --time none leaves the column out"
    ]


# Units and forms


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("x,y,z", "0.3,-0.1,0.5"),
        ("X [mm],Y [mm],Z [mm]", "300,-100,500"),
        ("pos_x (cm),pos_y (cm),pos_z (cm)", "30,-10,50"),
        ("tcp_z,tcp_y,tcp_x", "0.5,-0.1,0.3"),
        ("name,X_act,Y_act,Z_act,note", "A,0.3,-0.1,0.5,taught"),
        ("x_mm,y_mm,z_mm", "300,-100,500"),
        ("tcp_x_cm,tcp_y_cm,tcp_z_cm", "30,-10,50"),
    ],
)
def test_positions_by_names_and_units(read: Read, header: str, row: str) -> None:
    targets = read(f"{header}\n{row}\n{row}\n")
    np.testing.assert_allclose(targets.position, [[0.3, -0.1, 0.5]] * 2, rtol=1e-15, atol=0)
    assert (targets.rotation, targets.t_ns, said(targets)) == (None, None, [])


EULER = (0.3, -0.2, 0.1)
"""rz, ry, rx in rad."""

R = Rotation.from_euler("ZYX", EULER).as_matrix()
QUATERNION = dict(zip("xyzw", Rotation.from_matrix(R).as_quat().tolist(), strict=True))
DEGREES = ",".join(map(repr, np.degrees(EULER).tolist()))


@pytest.mark.parametrize(
    ("header", "cells"),
    [
        ("rz,ry,rx", "0.3,-0.2,0.1"),
        ("rz (rad),ry (rad),rx (rad)", "0.3,-0.2,0.1"),
        ("rz [deg],ry [deg],rx [deg]", DEGREES),
        ("rz_deg,ry_deg,rx_deg", DEGREES),
        ("yaw,pitch,roll", "0.3,-0.2,0.1"),
        ("A [°],B [°],C [°]", DEGREES),
        *((",".join(f"q{a}" for a in order), ",".join(repr(QUATERNION[a]) for a in order))
          for order in ("xyzw", "wxyz", "zwyx")),
        ("r11,r12,r13,r21,r22,r23,r31,r32,r33", ",".join(map(repr, R.ravel().tolist()))),
    ],
)  # fmt: skip
def test_orientations_by_names_and_units(read: Read, header: str, cells: str) -> None:
    targets = read(f"x,y,z,{header}\n0.3,0.1,0.5,{cells}\n")
    assert_turned(targets, [R])
    assert said(targets) == []


def test_options_say_what_a_header_does_not(read: Read) -> None:
    text = f"x,y,z,rz,ry,rx\n300,100,500,{DEGREES}\n"
    targets = read(text, units={"x": "mm", "": "deg"})
    np.testing.assert_allclose(targets.position, [[0.3, 0.1, 0.5]], rtol=1e-15, atol=0)
    assert_turned(targets, [R])
    assert said(targets) == []
    assert said(read(text)) == [
        (
            "assumed-unit",
            "no unit is given for x, y, z: they are taken as m, though every row is beyond any arm;"
            " --unit mm says otherwise",
        ),
        (
            "assumed-unit",
            "no unit is given for rx, ry, rz: they are taken as rad, though most are beyond a turn;"
            " --unit rx=deg says otherwise",
        ),
    ]


def test_one_target_out_of_reach_does_not_change_the_unit(read: Read) -> None:
    targets = read("x,y,z\n0.3,0.1,0.5\n300,100,500\n400,100,500\n")
    assert targets.position.tolist() == [[0.3, 0.1, 0.5], [300.0, 100.0, 500.0], [400.0, 100.0, 500.0]]
    assert said(targets) == []


def test_rx_ry_rz_may_be_a_rotation_vector_and_the_option_is_named(read: Read) -> None:
    text = "x,y,z,rx,ry,rz\n0.3,0.1,0.5,0.1,-0.2,0.3\n"
    targets = read(text)
    assert_turned(targets, [R])
    assert said(targets) == [
        (
            "assumed-rotation",
            "rx, ry, rz are taken as angles about the moving axes Z, Y, X (rz, ry, rx);"
            " --rotation vector if they are a rotation vector, as UR writes",
        )
    ]
    vector = read(text, rotation="vector")
    turned = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    assert_turned(vector, [turned])
    assert said(vector) == []


MAP = 'a map (--map) says which: [tcp] position = ["X", "Y", "Z"], orientation = [...], form = "..."'


@pytest.mark.parametrize("names", ["W,P,R", "alpha,beta,gamma", "r11,r12,r13,r21", "j1,j2,j3,j4,j5,j6"])
def test_columns_that_may_be_an_orientation_are_not_left_out_in_silence(read: Read, names: str) -> None:
    cells = ",".join("1" for _ in names.split(","))
    targets = read(f"nr,note,t,x,y,z,{names}\n1,home,0,0.3,0.1,0.5,{cells}\n")
    listed = names.replace(",", ", ")
    told = f"x, y, z are targets without an orientation: {listed} are not used; {MAP}"
    assert said(targets) == [("columns-not-used", told)]
    named = read(f"x,y,z,{names}\n0.3,0.1,0.5,{cells}\n", position=("x", "y", "z"))
    assert (named.rotation, said(named)) == (None, [])


def test_a_form_without_an_orientation_is_refused(wrong: Wrong) -> None:
    assert wrong("x,y,z,W,P,R\n1,2,3,0,0,0\n", rotation="rpy") == [
        "targets.csv: --rotation: found rpy given for x, y, z and no orientation, allowed: its columns beside"
        f" them; {MAP}"
    ]
    assert wrong("x,y,z,u,v,w\n1,2,3,0,0,0\n", orientation=("u", "v", "w")) == [
        "orientation: found without a position, allowed: beside x, y, z"
    ]


def test_a_map_names_the_columns(read: Read, tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(
        '[tcp]\nposition = ["a", "b", "c"]\norientation = ["u", "v", "w"]\nform = "zyx"\n'
        '[units]\na = "mm"\nu = "deg"\n[[joints]]\ncolumn = "J1"\n'
    )
    said = read_map(tmp_path / "lab.toml").read
    targets = read(f"c;a;b;u;v;w\n500;300;100;{DEGREES.replace(',', ';')}\n", **{
        name: getattr(said, name) for name in ("position", "orientation", "rotation", "units", "joints")
    })  # fmt: skip
    np.testing.assert_allclose(targets.position, [[0.3, 0.1, 0.5]], rtol=1e-15, atol=0)
    assert_turned(targets, [R])


# Files without a header


def test_three_columns_without_names_are_positions_though_the_first_runs_evenly(read: Read) -> None:
    targets = read("0.1 0.3 0.5\n0.2 0.3 0.4\n0.3 0.3 0.5\n")
    assert targets.position[:, 0].tolist() == [0.1, 0.2, 0.3]
    assert targets.t_ns is None


def test_more_columns_without_names_need_an_even_time_or_the_form_of_the_orientation(
    read: Read, wrong: Wrong
) -> None:
    timed = read("0.0 0.3 0.1 0.5\n0.1 0.3 0.2 0.5\n0.2 0.3 0.1 0.5\n")
    assert timed.t_ns is not None
    assert (timed.t_ns.tolist(), timed.position[1].tolist()) == ([0, 10**8, 2 * 10**8], [0.3, 0.2, 0.5])
    six = "0.3 0.1 0.5 0.3 -0.2 0.1\n0.4 0.1 0.5 0.3 -0.2 0.1\n"
    without = (
        "columns without names, allowed: x, y, z alone or with an orientation; name the columns in a header"
    )
    assert wrong(six) == [
        f"targets.csv: found 6 {without}, or say which with --rotation vector|rpy|zyx|xyz|zyz|zxz"
    ]
    assert wrong("0.3 0.1 0.5 2 0 0 0\n") == [
        f"targets.csv: found 7 {without}, or say which with --rotation quat_xyzw|quat_wxyz, or say --time 1"
        " if the first is the time"
    ]
    assert wrong("0.3 0.1 0.5 2\n") == [
        f"targets.csv: found 4 {without}, or say --time 1 if the first is the time"
    ]
    assert wrong("0.3 0.1 0.5 0 1\n") == [f"targets.csv: found 5 {without}"]
    assert_turned(read(six, rotation="zyx"), [R, R])
    seven = "".join(
        f"{x} 0.1 0.5 " + " ".join(repr(QUATERNION[a]) for a in "wxyz") + "\n" for x in (0.3, 0.9, 0.4)
    )
    assert wrong(seven) == [
        "targets.csv: found 4, 5, 6, 7, which may be quat_xyzw or quat_wxyz, allowed: one form;"
        " --rotation quat_xyzw or --rotation quat_wxyz says which"
    ]
    assert_turned(read(seven, rotation="quat_wxyz"), [R] * 3)
    assert wrong(seven.split("\n")[0]) == wrong(seven)


def test_of_columns_without_names_the_form_tells_the_time_by_their_number(read: Read, wrong: Wrong) -> None:
    rows = [f"{t} 0.3 0.1 0.5 0 0 0 1\n" for t in (0.0, 0.1, 0.4)]
    targets = read("".join(rows), rotation="quat_xyzw")
    assert targets.t_ns is not None
    assert targets.t_ns.tolist() == [0, 10**8, 4 * 10**8]
    assert_turned(targets, [np.eye(3)] * 3)
    assert wrong("".join(row[:15] + "\n" for row in rows)) == [
        "targets.csv:1: found a first column that increases from row to row, which may be the time or"
        " a counter: say --time 1 or --time none"
    ]


def test_wrong_rows_without_names_stop_no_other(read: Read) -> None:
    targets = read("0.3,0.1,0.5\n0.3,abc,0.5\n0.3,def,0.5\n0.3,,0.5\n")
    assert targets.position[0].tolist() == [0.3, 0.1, 0.5]
    assert list(targets.faults) == [2, 3, 4]


# Files that are wrong as a whole


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("", ["targets.csv: found an empty file, allowed: a table with a row a sample"]),
        (b"\0\1\2" * 99, ["targets.csv: found a binary file, allowed: a text table (CSV)"]),
        ("x,y,z\n", ["targets.csv:1: found a header and no rows, allowed: a row a sample"]),
        (
            "t,q1,q2,q3\n0,1,2,3\n1,1,2,3\n",
            [
                "targets.csv: found no position in q1, q2, q3, allowed: x, y, z; name them so in the header,"
                ' or in a map (--map): [tcp] position = ["A", "B", "C"]'
            ],
        ),
        (
            "x [ft],y [ft],z [m]\n1,2,3\n",
            [
                "targets.csv, column x [ft]: found the unit 'ft', allowed: rad, deg, m, mm, cm;"
                " say which with --unit x=mm"
            ],
        ),
        (
            "x,y,z,rz,ry\n1,2,3,4,5\n",
            [
                "targets.csv: found rz, ry as a part of an orientation, allowed: all of rz, ry, rx or of"
                f" qx, qy, qz, qw, or none; {MAP}"
            ],
        ),
        (
            "x,y,z,quat_x,quat_y,rotvec_z,A\n1,2,3,4,5,6,7\n",
            [
                "targets.csv: found quat_x, quat_y, rotvec_z as a part of an orientation, allowed: all of"
                f" rz, ry, rx or of qx, qy, qz, qw, or none; {MAP}"
            ],
        ),
        (
            "x,y,z,rz,ry,rx,rx\n1,2,3,4,5,6,7\n",
            ["targets.csv:1, column rx: found as columns 6, 7, allowed: once; rename or remove the others"],
        ),
        (
            "x,y,z\n1,2,3\nx,y,z\n1,2,3\n",
            ["targets.csv:3: found the header again, allowed: one log a file; a second log begins here"],
        ),
        (
            "x,y,x,z\n1,2,3,4\n",
            ["targets.csv:1, column x: found as columns 1, 3, allowed: once; rename or remove the others"],
        ),
    ],
)  # fmt: skip
def test_a_file_that_is_wrong_as_a_whole_is_refused(wrong: Wrong, text: str, lines: list[str]) -> None:
    assert wrong(text) == lines


def test_options_that_make_no_sense_are_refused(wrong: Wrong) -> None:
    text = "x,y,z\n1,2,3\n"
    assert wrong(text, -1.0) == ["--tsp: found -1 s, allowed: a positive time of 1e-9 s or more"]
    assert wrong(text, period=0.0) == ["--period: found 0 s, allowed: a positive time of 1e-9 s or more"]
    assert wrong(text, units={"u": "mm"}) == ["--unit: found no column 'u', allowed: x, y, z"]
