"""Tables as the usual writers leave them: pandas, numpy, csv, spreadsheets, MATLAB."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.csv
import pytest

from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import read_log, source_names

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Arm = Callable[..., Chain]

T = [0.0, 0.005, 0.01]
Q = np.array([[0.1, -1.25], [0.2, -1.5], [0.3, -1.75]])


def found(log: JointLog, what: str) -> str:
    return next(inference.value for inference in log.inferences if inference.what == what)


def assert_the_log(log: JointLog) -> None:
    assert log.joints == ("q1", "q2")
    assert log.t_ns.tolist() == [0, 5_000_000, 10_000_000]
    np.testing.assert_array_equal(log.q, Q)
    assert log.q.flags.c_contiguous
    assert log.q.dtype == np.float64


def frame() -> pd.DataFrame:
    return pd.DataFrame({"t": T, "q1": Q[:, 0], "q2": Q[:, 1]})


@pytest.mark.parametrize(
    ("separator", "decimal", "name"),
    [
        (",", ".", "comma"),
        (";", ",", "semicolon"),
        (";", ".", "semicolon"),
        ("\t", ",", "tab"),
        ("|", ".", "bar"),
    ],
)
def test_pandas_to_csv(tmp_path: Path, separator: str, decimal: str, name: str) -> None:
    path = tmp_path / "log.csv"
    frame().to_csv(path, index=False, sep=separator, decimal=decimal)
    log = read_log([path])
    assert_the_log(log)
    assert found(log, "delimiter") == name
    assert found(log, "decimal sign") == {".": "point", ",": "comma"}[decimal]
    assert log.first_line == 2


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
def test_encodings(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "log.csv"
    table = frame().rename(columns={"q1": "q1 [°]", "q2": "q2 [°]"})
    table.to_csv(path, index=False, encoding=encoding)
    log = read_log([path])
    np.testing.assert_array_equal(log.q, Q * (np.pi / 180))
    assert log.units == {"t": "s", "q1": "deg", "q2": "deg"}


def test_words_with_spaces_between_tabs(read: Read) -> None:
    log = read("t\tq1\tq2\tnote\n0.0\t0.1\t0.2\tall is well\n0.1\t0.2\t0.3\tstill so\n")
    assert log.joints == ("q1", "q2")
    assert log.q.tolist() == [[0.1, 0.2], [0.2, 0.3]]


def test_pandas_row_index_is_no_joint(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    frame().to_csv(path)
    assert_the_log(read_log([path]))


def test_pandas_time_index_without_name(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    frame().set_index("t").to_csv(path, index_label=False, header=["q1", "q2"])
    path.write_text("," + path.read_text() if not path.read_text().startswith(",") else path.read_text())
    log = read_log([path])
    assert_the_log(log)
    assert found(log, "time column") == "column 1"


def test_pandas_columns_without_names(tmp_path: Path, arm: Arm) -> None:
    path = tmp_path / "log.csv"
    pd.DataFrame(np.c_[Q, Q]).to_csv(path, index=False)
    log = read_log([path], robot=arm(4))
    np.testing.assert_array_equal(log.q, np.c_[Q, Q])
    assert log.joints == ("phi1", "phi2", "phi3", "phi4")


def test_numpy_savetxt(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    np.savetxt(path, np.c_[T, Q], header="t q1 q2")
    assert_the_log(read_log([path]))


def test_numpy_savetxt_with_names_by_commas_over_numbers_by_spaces(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    np.savetxt(path, np.c_[T, Q], header="t,q1,q2")
    assert_the_log(read_log([path]))


def test_csv_writer_with_quotes(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file, quoting=csv.QUOTE_ALL)
        writer.writerow(["t", "q1", "q2"])
        writer.writerows(np.c_[T, Q].tolist())
    assert_the_log(read_log([path]))


def test_comma_inside_a_quoted_name(read: Read) -> None:
    log = read('"t","angle, left","angle, right"\n0,0.1,0.2\n0.1,0.3,0.4\n')
    assert log.joints == ("angle, left", "angle, right")


def test_quoted_decimal_commas_between_commas(read: Read) -> None:
    log = read('"t","q1","q2"\n"0,0","0,1","-1,25"\n"0,005","0,2","-1,5"\n"0,01","0,3","-1,75"\n')
    assert_the_log(log)


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r", "\r\r\n"])
def test_line_ends(read: Read, newline: str) -> None:
    text = "t,q1,q2\n0,0.1,-1.25\n0.005,0.2,-1.5\n0.01,0.3,-1.75\n"
    assert_the_log(read(text.replace("\n", newline)))
    assert_the_log(read(text.replace("\n", newline).rstrip("\r\n")))


def test_runs_of_spaces_and_tabs(read: Read) -> None:
    assert_the_log(read("  t   q1\tq2 \n  0  0.1   -1.25  \n 0.005 0.2\t-1.5\r\n0.01    0.3   -1.75\n"))


@pytest.mark.parametrize(
    "text",
    [
        "t,q1,q2,\n0,0.1,-1.25,\n0.005,0.2,-1.5,\n0.01,0.3,-1.75,\n",
        "t,q1,q2\n0,0.1,-1.25,\n0.005,0.2,-1.5,\n0.01,0.3,-1.75,\n",
        "t,q1,q2,\n0,0.1,-1.25\n0.005,0.2,-1.5\n0.01,0.3,-1.75\n",
    ],
)
def test_trailing_delimiters(read: Read, text: str) -> None:
    assert_the_log(read(text))


def test_trailing_delimiters_without_header(read: Read, arm: Arm) -> None:
    for robot in (None, arm(2)):
        assert read("0.1,0.5,\n0.3,0.2,\n0.2,0.1,\n", robot).q.tolist() == [
            [0.1, 0.5],
            [0.3, 0.2],
            [0.2, 0.1],
        ]


def test_titles_comments_and_units_around_the_header(read: Read) -> None:
    log = read(
        "Motion of 3 May\n# made by a simulator, twice\n\nt;q1;q2\n[s];[deg];[deg]\n0;1,5;2\n0,1;2,5;3\n"
    )
    assert log.units == {"t": "s", "q1": "deg", "q2": "deg"}
    assert log.first_line == 6
    np.testing.assert_array_equal(log.q, np.array([[1.5, 2.0], [2.5, 3.0]]) * (np.pi / 180))


def test_a_comment_between_the_rows_is_no_row(read: Read) -> None:
    assert_the_log(read("t,q1,q2\n0,0.1,-1.25\n# paused\n0.005,0.2,-1.5\n0.01,0.3,-1.75\n"))


def test_blank_lines_and_empty_rows_at_the_end(read: Read) -> None:
    assert_the_log(read("t;q1;q2\n0;0,1;-1,25\n\n0,005;0,2;-1,5\n0,01;0,3;-1,75\n;;\n;;\n\n"))


def test_fortran_exponents(read: Read) -> None:
    assert_the_log(read("t,q1,q2\n0,1.d-1,-1.25d0\n0.005,0.2D+00,-1.5\n0.01,0.3,-1.75\n"))


def test_whole_numbers_are_not_taken_for_decimals(read: Read) -> None:
    log = read("t [ms],q1\n0,1\n5,2\n10,3\n")
    assert log.t_ns.tolist() == [0, 5_000_000, 10_000_000]
    assert log.q.tolist() == [[1.0], [2.0], [3.0]]


def test_without_header_the_columns_are_joints(read: Read, arm: Arm) -> None:
    text = "0.1,0.2,0.3,0.4\n0.05,0.1,0.5,0.7\n"
    assert read(text).joints == ("q1", "q2", "q3", "q4")
    assert read(text, arm(4)).first_line == 1


def test_more_columns_without_names_than_joints_are_asked_about(read: Read, arm: Arm) -> None:
    text = "0.1,0.2,0.3,0.4\n0.05,0.1,0.5,0.7\n"
    with pytest.raises(LogError, match="found 4 columns that no header names") as asked:
        read(text, arm(3))
    answers = [hint.value for hint in asked.value.findings[0].hints]
    assert answers == [["1-3"], ["2-4"], None]
    log = read(text, arm(3), joints=answers[0])
    assert log.joints == ("phi1", "phi2", "phi3")
    assert log.q.tolist() == [[0.1, 0.2, 0.3], [0.05, 0.1, 0.5]]
    assert found(log, "columns not used") == "4"


@pytest.mark.parametrize(
    ("text", "joints"),
    [
        ("0,0.5\n1,0.4\n2,0.6\n", None),  # a counter
        ("0.0,0.5,1\n0.01,0.6,1\n0.02,0.7,1\n", None),  # two columns run evenly
        ("7.0,0.5,1\n7.009,0.6,0\n7.031,0.5,1\n", 2),  # an uneven clock beside all joints
        ("7.0,0.5,1\n7.01,0.4,0\n", 2),  # two rows
    ],
)
def test_without_header_a_first_column_that_may_be_a_time_is_asked_for(
    read: Read, wrong: Wrong, arm: Arm, text: str, joints: int | None
) -> None:
    robot = arm(joints) if joints else None
    said = "found a first column that increases from row to row, which may be the time, a counter or a joint"
    hint = "--time 1 or --time none specifies it; --joints A,B,C names the joint columns"
    assert wrong(text, robot) == [f"log.csv:1: {said}; {hint}"]
    first = [float(line.partition(",")[0]) for line in text.splitlines()]
    others = text.partition("\n")[0].count(",")
    assert read(text, robot, time="1").q.shape[1] == others
    assert read(text, robot, joints=[str(k + 2) for k in range(others)]).q[0, 0] == 0.5
    assert read(text, time="none").q[:, 0].tolist() == first


def test_without_header_a_first_column_in_even_steps_is_the_time(read: Read, arm: Arm) -> None:
    text = "0.00 0.1 0.3\n0.05 0.2 0.1\n0.10 0.1 0.2\n"
    log = read(text, arm(2))
    assert log.t_ns.tolist() == [0, 50_000_000, 100_000_000]
    assert log.q.tolist() == [[0.1, 0.3], [0.2, 0.1], [0.1, 0.2]]
    assert read(text, arm(3)).q.shape == (3, 3)  # three joints take all three columns


def test_without_header_no_column_has_the_name_of_one(read: Read) -> None:
    log = read("0.0,0.1,2.5\n0.01,0.3,2.4\n0.02,0.4,2.9\n")
    assert [(column.name, column.header) for column in log.columns] == [("1", ""), ("q1", ""), ("q2", "")]


def test_delimiter_and_decimal_sign_can_be_given(read: Read) -> None:
    assert_the_log(
        read("t;q1;q2\n0;0,1;-1,25\n0,005;0,2;-1,5\n0,01;0,3;-1,75\n", delimiter="semicolon", decimal=",")
    )


def test_a_path_is_a_log_without_joints(read: Read, arm: Arm) -> None:
    for robot in (None, arm(6)):
        log = read("t,x,y,z\n0,0.1,0.2,0.3\n0.005,0.4,0.5,0.6\n", robot)
        assert log.source == "path"
        assert log.joints == ()
        assert log.q.shape == (2, 0)
        assert log.tcp_position is not None
        assert log.tcp_position.tolist() == [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]


def test_a_path_without_header_must_be_called_one(read: Read) -> None:
    log = read("0 0.1 0.2 0.3\n0.1 0.4 0.5 0.6\n0.2 0.5 0.5 0.6\n", source="path")
    assert log.tcp_position is not None
    assert log.tcp_position[1].tolist() == [0.4, 0.5, 0.6]
    assert log.period == 0.1


def test_a_path_beside_joints_if_the_user_asks_for_it(read: Read) -> None:
    text = "t,q1,x,y,z\n0,1,0.1,0.2,0.3\n0.1,1,0.1,0.2,0.3\n"
    assert read(text).joints == ("q1",)
    log = read(text, source="path")
    assert (log.source, log.joints) == ("path", ())
    assert log.tcp_position is not None
    assert log.tcp_position[0].tolist() == [0.1, 0.2, 0.3]


def test_provenance(read: Read) -> None:
    log = read("t,q1\n0,1\n", name="first run.csv")
    (file,) = log.files
    assert log.name == "first run"
    assert (file.name, file.size) == ("first run.csv", 9)
    assert file.sha256 == "2ed1e6de7e909fc9b6c974234ccdc15d2d0560ac4b32a5a27e0e1aee2ee15f1a"


def test_source_names() -> None:
    assert source_names() == (
        *(
            "coppeliasim",
            "urmpipe",
            "network",
            "ur-rtde",
            "libfranka",
            "ros",
            "ros2",
            "fri",
            "kuka-rsi",
            "abb",
            "plotjuggler",
            "solidworks",
            "matlab",
        ),
        *("path", "table"),
    )


def test_decimal_commas_over_many_blocks(tmp_path: Path) -> None:
    """pyarrow's own decimal_point mixes up decimals between threads; 300,000 rows are several blocks."""
    rows = np.arange(300_000)
    path = tmp_path / "log.csv"
    path.write_text("t;q1\n" + "".join(f"{k // 1000},{k % 1000:03d};{k % 5},5\n" for k in rows.tolist()))
    log = read_log([path])
    np.testing.assert_array_equal(log.t_ns, rows * 1_000_000)
    np.testing.assert_array_equal(log.q[:, 0], rows % 5 + 0.5)


def test_a_table_whose_used_columns_are_all_empty_is_refused(wrong: Wrong) -> None:
    said = "found no row with a time or a number in the columns that are used, allowed: at least one"
    assert wrong("t,q1,x\n,,1\n,,2\n,,3\n") == [f"log.csv: {said}"]


@pytest.mark.parametrize("comment", ["# note", "% note", "// note"])
def test_comments_between_rows_are_left_out_alike(read: Read, comment: str) -> None:
    log = read(f"t,q1\n0,1\n{comment}\n1,2\n")
    np.testing.assert_array_equal(log.q[:, 0], [1.0, 2.0])


def test_an_infinite_time_among_the_first_rows_is_named(wrong: Wrong) -> None:
    said = wrong("t,q1\n0,1\n1.#INF,2\n0.2,3\n")
    assert len(said) == 1
    assert said[0].startswith("log.csv:3, column t: found '1.#INF', allowed: ")


def test_names_that_a_file_does_not_have_are_no_headers(read: Read) -> None:
    echo = "7,0,,a,b,0.5,1.5,0,0,0,0\n7,5000000,,a,b,0.6,1.6,0,0,0,0\n"
    labels = "Time: 0.1  q values: [0.5, 1.5]\nTime: 0.2  q values: [0.6, 1.6]\n"
    for text in (echo, labels):
        log = read(text)
        assert log.q.tolist() == [[0.5, 1.5], [0.6, 1.6]]
        assert {column.header for column in log.columns} == {""}


def test_a_block_that_the_parser_loses_is_read_all_the_same(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    parse = pyarrow.csv.read_csv
    lost: list[bool] = []

    def lose_the_first(*args: object, **options: object) -> object:
        if not lost:
            lost.append(True)
            raise pyarrow.ArrowException("a chunk failed converting for an unknown reason")
        return parse(*args, **options)

    monkeypatch.setattr(pyarrow.csv, "read_csv", lose_the_first)
    text = "t,q1,q2\n" + "".join(f"{0.005 * k:.3f},{0.0001 * k:.4f},1.5\n" for k in range(9000))
    log = read(text)
    assert lost
    np.testing.assert_array_equal(log.q[:, 0], [float(f"{0.0001 * k:.4f}") for k in range(9000)])
    assert log.t_ns.tolist() == [5_000_000 * k for k in range(9000)]
