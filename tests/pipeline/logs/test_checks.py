"""Everything that is wrong with a log, at once, with its line; what is missing is said."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asserting import INCREASE, OTHER_TIME
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import read_log

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Arm = Callable[..., Chain]

NUMBER = "allowed: a number, or an empty, Null or NaN cell where a sample is missing"


def test_all_findings_at_once(wrong: Wrong, arm: Arm) -> None:
    text = """t,q1,q2,note
0,1,2,a
0.1,1,2
0.05,x,3,b
0.05,1,inf,c
,1,2,d

0.3,1,2,3,4
a,note,by,hand
soon,1,2,e
0.5,1,1_000,f
0.5,-1e999,2,g
0.45,1,2,h
"""
    assert wrong(text, arm(2)) == [
        "log.csv:3: found 3 cells, allowed: 4",
        f"log.csv:4, column q1: found 'x', {NUMBER}",
        "log.csv:5, column q2: found inf, allowed: finite numbers",
        f"log.csv:6, column t: found no time, allowed: a time in every row{OTHER_TIME}",
        "log.csv:8: found 5 cells, allowed: 4",
        "log.csv:9: found 'a,note,by,hand', allowed: a row of numbers",
        f"log.csv:10, column t: found 'soon', allowed: a number in every row{OTHER_TIME}",
        f"log.csv:11, column q2: found '1_000', {NUMBER}",
        "log.csv:12, column q1: found -inf, allowed: finite numbers",
        f"log.csv:13, column t: found 0.45 s after 0.5 s, {INCREASE}",
    ]


def test_rows_and_columns_of_findings(read: Read) -> None:
    with pytest.raises(LogError) as caught:
        read("# a comment\nt,q1\n\n0,1\n0.1,2\n\n0.1,x\n")
    assert [(f.line, f.row, f.column) for f in caught.value.findings] == [(7, 3, "q1"), (7, 3, "t")]


def test_blank_lines_count_where_every_row_was_parsed(wrong: Wrong) -> None:
    assert wrong("t,q1\n\n0,1\n0.2,2\n\n0.1,3\n0.3,inf\n") == [
        f"log.csv:6, column t: found 0.1 s after 0.2 s, {INCREASE}",
        "log.csv:7, column q1: found inf, allowed: finite numbers",
    ]


def test_times_are_shown_in_the_files_unit(wrong: Wrong) -> None:
    assert wrong("t_ms,q1\n0,1\n5,2\n2.5,3\n") == [
        f"log.csv:4, column t_ms: found 2.5 ms after 5 ms, {INCREASE}"
    ]
    assert wrong("%time,q1\n1486559106139796569,1\n1486559106139796568,2\n") == [
        f"log.csv:3, column %time: found 1486559106139796568 ns after 1486559106139796569 ns, {INCREASE}"
    ]


def test_many_findings_are_counted(wrong: Wrong) -> None:
    rows = [f"{0.1 * k:.1f},{'x' if k % 2 else 1}" for k in range(100)]
    lines = wrong("\n".join(["t,q1", *rows]))
    assert lines[:20] == [f"log.csv:{2 * k + 3}, column q1: found 'x', {NUMBER}" for k in range(20)]
    assert lines[20:] == ["log.csv: 30 more findings"]


def test_a_wrong_row_far_behind_the_head(wrong: Wrong) -> None:
    rows = [f"{0.005 * k:.3f},{k % 3}.5,{k % 5}.25" for k in range(40_000)]
    rows[30_000] = "150.0,1.5"
    rows[35_000] = "175.0,abc,1.5"
    assert wrong("\n".join(["t,q1,q2", *rows])) == [
        "log.csv:30002: found 2 cells, allowed: 3",
        f"log.csv:35002, column q1: found 'abc', {NUMBER}",
        "log.csv: 2 of 40000 rows cannot be read; --skip-bad leaves them out",
    ]


def test_lines_of_spaces_and_of_utf_16(wrong: Wrong) -> None:
    text = "t q1 q2\n0 1 2\n0.1 1\n0.2 1 x\n"
    expected = ["log.csv:3: found 2 cells, allowed: 3", f"log.csv:4, column q2: found 'x', {NUMBER}"]
    assert wrong(text.replace(" ", "   ")) == expected
    assert wrong(text.replace(" ", ";"), encoding="utf-16") == expected


def test_a_decimal_point_between_decimal_commas(wrong: Wrong) -> None:
    """1.500 may be a thousand and a half: it is not guessed."""
    assert wrong("t;q1\n0,0;1,5\n0,1;1.500\n0,2;1,5\n") == [f"log.csv:3, column q1: found '1.500', {NUMBER}"]


def test_text_in_columns_that_do_not_matter(read: Read) -> None:
    assert read("t,q1,mode\n0,1,7\n0.1,2,n/a!\n0.2,3,8\n").rows == 3


def test_missing_samples(read: Read) -> None:
    log = read("t,q1,q2,q3\n0,,1,2\n0.1,Null,2,2\n0.2,NaN, ,2\n0.3,1,2,2\n")
    np.testing.assert_array_equal(np.isnan(log.q[:, 0]), [True, True, True, False])
    np.testing.assert_array_equal(np.isnan(log.q[:, 1]), [False, False, True, False])
    assert [(w.kind, w.row, w.message) for w in log.warnings if w.kind == "missing"] == [
        ("missing", 1, "q1 has no value in 3 of 4 rows, first in this one"),
        ("missing", 3, "q2 has no value in 1 of 4 rows, first in this one"),
    ]


def test_columns_that_lack_the_same_rows_are_one_warning(read: Read) -> None:
    log = read("t,q1,q2,q3,x,y,z\n0,,1,,,,\n0.1,1,,2,1,1,1\n0.2,1,2,2,1,1,1\n")
    assert [(w.row, w.message) for w in log.warnings if w.kind == "missing"] == [
        (1, "q1, q3, x, y, z have no value in 1 of 3 rows, first in this one"),
        (2, "q2 has no value in 1 of 3 rows, first in this one"),
    ]


def test_missing_samples_of_many_rows(read: Read) -> None:
    rows = [f"{0.005 * k:.3f},{'' if k % 1000 == 7 else k % 3},{k % 2}" for k in range(20_000)]
    log = read("\n".join(["t,q1,q2", *rows]))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(log.q[:, 0])), np.arange(7, 20_000, 1000))
    assert not np.isnan(log.q[:, 1]).any()
    assert log.warnings[-1].message == "q1 has no value in 20 of 20000 rows, first in this one"
    assert log.warnings[-1].row == 8


def test_a_joint_without_any_value(wrong: Wrong) -> None:
    assert wrong("t,q1,q2,q3\n0,,1,\n0.1,,2,\n") == [
        "log.csv, column q1: found no value in any of 2 rows, allowed: at least one",
        "log.csv, column q3: found no value in any of 2 rows, allowed: at least one",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,q1,q2\n", "log.csv:1: found a header and no rows, allowed: one row per sample"),
        ("\n \n", "log.csv: found no line with content, allowed: a table with one row per sample"),
        (
            "Once upon a time\nthere was a robot\nwith no numbers\n",
            "log.csv:1: found 'Once upon a time' and no row of numbers below it,"
            " allowed: a table with one row per sample",
        ),
        (
            "a letter\n1\n2 and 3\n4 or 5 and 6\n7, 8\n9 or 10 or 11 or 12\n",
            "log.csv:2: found '1' and lines of 1 to 2 cells, allowed: a table",
        ),
    ],
)
def test_no_table(wrong: Wrong, text: str, said: str) -> None:
    assert wrong(text) == [said]


def test_the_same_file_twice_is_joined_with_itself_no_further(tmp_path: Path) -> None:
    """Nothing is written, kept open or changed by reading."""
    path = tmp_path / "log.csv"
    path.write_text("t,q1\n0,1\n0.1,2\n")
    before = path.stat().st_mtime_ns
    first, second = read_log([path]), read_log([path])
    np.testing.assert_array_equal(first.q, second.q)
    assert path.stat().st_mtime_ns == before
    assert [item.name for item in tmp_path.iterdir()] == ["log.csv"]
