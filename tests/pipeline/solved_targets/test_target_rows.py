"""Rows of targets that are wrong stop no other; a file that is wrong as a whole is refused."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from asserting import INCREASE
from urmpipe_models.errors import LogError
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.solved_targets.target_file import TargetFile

Read = Callable[..., TargetFile]
Wrong = Callable[..., list[str]]


NAMED = "--orientation A,B,C with --position and --rotation names them"


def said(targets: TargetFile) -> list[tuple[str, str]]:
    return [(warning.kind, warning.message) for warning in targets.warnings]


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


@pytest.mark.slow
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
        " --rotation quat_wxyz or --rotation quat_xyzw specifies it"
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
    assert len(read("t [s],x,y,z\n0,0.3,0.1,0.5\n1,0.3,0.1,0.5\n,,,\n")) == 2
    assert read("x,y,z\n0.3,0.1,0.5\n,,\n0.3,0.1,0.5\n").faults == {
        2: "columns x, y, z: found no number, allowed: a finite number"
    }
    assert list(read("x,y,z\n0.3,0.1,0.5\nnan,nan,nan\n").faults) == [2]
    assert list(read('x,y,z\n0.3,0.1,0.5\n"').faults) == [2]


def test_rows_are_counted_as_ingest_counts_them(read: Read, tmp_path: Path) -> None:
    head = "# taught by hand\nx,y,z\nm,m,m\n0.3,0.1,0.5\n# a remark\n\n"
    text = f"{head}0.3,here,0.5\n\n0.3,0.1\n% end\n0.3,0.1,0.5\n"
    targets = read(text)
    assert (targets.row.tolist(), list(targets.faults)) == ([1, 2, 3, 4], [2, 3])
    with pytest.raises(LogError) as caught:
        read_log([tmp_path / "targets.csv"], LogMap(source="path"))
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
    unused = "no effect: the log has a clock"
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


def test_times_that_run_backwards_are_an_error_of_the_file(wrong: Wrong) -> None:
    """As in a log: nothing tells which of the two rows is wrong."""
    assert wrong("t,x,y,z\n0,1,1,1\n0.3,1,1,1\n0.2,1,1,1\n,1,1,1\n0.2,1,1,1\n") == [
        f"targets.csv:4, column t: found 0.2 s after 0.3 s, {INCREASE}",
    ]
    assert wrong("t,x,y,z\n,1,1,1\n-,1,1,1\n") == [
        "targets.csv, column t: found no time in any of 2 rows, allowed: at least one; --time none"
        " leaves the column out"
    ]


# Units and forms


def test_wrong_rows_without_names_stop_no_other(read: Read) -> None:
    targets = read("0.3,0.1,0.5\n0.3,abc,0.5\n0.3,def,0.5\n0.3,,0.5\n")
    assert targets.position[0].tolist() == [0.3, 0.1, 0.5]
    assert list(targets.faults) == [2, 3, 4]


# Files that are wrong as a whole


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("", ["targets.csv: found an empty file, allowed: a table with one row per sample"]),
        (b"\0\1\2" * 99, ["targets.csv: found a binary file, allowed: a text table (CSV)"]),
        ("x,y,z\n", ["targets.csv:1: found a header and no rows, allowed: one row per sample"]),
        (
            "t,q1,q2,q3\n0,1,2,3\n1,1,2,3\n",
            [
                "targets.csv: found no position in q1, q2, q3, allowed: x, y, z; name them so in the"
                " header; --position X,Y,Z names them"
            ],
        ),
        (
            "x [ft],y [ft],z [m]\n1,2,3\n",
            [
                "targets.csv, column x [ft]: found the unit 'ft', allowed: rad, deg, turn/N, m, mm, cm;"
                ' convert the values; --unit x=mm keeps the values unchanged'
            ],
        ),
        (
            "x,y,z,rz,ry\n1,2,3,4,5\n",
            [
                "targets.csv: found rz, ry as a part of an orientation, allowed: all of rz, ry, rx or of"
                f" qx, qy, qz, qw, or none; {NAMED}"
            ],
        ),
        (
            "x,y,z,quat_x,quat_y,rotvec_z,A\n1,2,3,4,5,6,7\n",
            [
                "targets.csv: found quat_x, quat_y, rotvec_z as a part of an orientation, allowed: all of"
                f" rz, ry, rx or of qx, qy, qz, qw, or none; {NAMED}"
            ],
        ),
        (
            "x,y,z,rz,ry,rx,rx\n1,2,3,4,5,6,7\n",
            ["targets.csv:1, column rx: found as columns 6, 7, allowed: once; rename or remove the others"],
        ),
        (
            "x,y,z\n1,2,3\nx,y,z\n1,2,3\n",
            ["targets.csv:3: found the header again, allowed: one log per file; a second log begins here"],
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
    assert wrong(text, -1.0) == ["tsp (--tsp): found -1 s, allowed: a positive time of 1e-9 s or more"]
    assert wrong(text, period=0.0) == [
        "period (--period): found 0 s, allowed: a positive time of 1e-9 s or more"
    ]
    assert wrong(text, unit={"u": "mm"}) == ["unit (--unit): found no column 'u', allowed: x, y, z"]
