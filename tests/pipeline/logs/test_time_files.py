"""Times in a file of their own: a column, or one row as long as the log."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asserting import INCREASE, OTHER_TIME, refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

Write = Callable[..., Path]

JOINTS = "0.5,1.5\n0.25,1.25\n0.125,1\n"


def read(*files: Path, **options: object) -> JointLog:
    return read_log(files, LogMap(**options))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("times", "name"),
    [
        ("1,1.005,1.01\n", "time.csv"),
        ("1,1.005,1.01", "vector.csv"),
        ("1;1,005;1,01\r\n", "t.csv"),
        ("   1.0000000e+00   1.0050000e+00   1.0100000e+00\r\n", "time.txt"),
        ("1\n1.005\n1.01\n", "t.csv"),
        ("1\n1.005\n1.01\n", "other.csv"),
        ("time [s]\n1\n1.005\n1.01\n", "other.csv"),
        ("t_ms\n1000\n1005\n1010\n", "other.csv"),
    ],
)
@pytest.mark.parametrize("header", ["", "q1,q2\n"])
@pytest.mark.parametrize("first", [True, False])
def test_a_file_of_times(write: Write, times: str, name: str, header: str, first: bool) -> None:
    files = [write(header + JOINTS, "q.csv"), write(times, name)]
    log = read(*(files if first else reversed(files)))
    assert log.t_ns.tolist() == [0, 5_000_000, 10_000_000]
    assert log.clock_start_ns == 10**9
    assert log.joints == ("q1", "q2")
    np.testing.assert_array_equal(log.q, [[0.5, 1.5], [0.25, 1.25], [0.125, 1.0]])
    assert [column.role for column in log.columns] == ["time", "joint", "joint"]
    assert "assumed-period" not in [warning.kind for warning in log.warnings]


@pytest.mark.slow
def test_a_row_of_times_longer_than_what_is_sniffed(write: Write) -> None:
    count = 50_000
    joints = write("".join(f"{k % 7}.5,{k % 3}.25\n" for k in range(count)), "q.csv")
    times = write(",".join(f"{0.005 * k:.3f}" for k in range(count)) + "\n", "time.csv")
    assert times.stat().st_size > 4 * 64 * 1024
    log = read_log([joints, times], LogMap(unit={"": "rad"}))
    np.testing.assert_array_equal(log.t_ns, np.arange(count) * 5_000_000)
    assert log.q[-1].tolist() == [(count - 1) % 7 + 0.5, (count - 1) % 3 + 0.25]
    assert [(i.value, i.evidence) for i in log.inferences if i.what == "time column"] == [
        ("time/1", "time.csv holds nothing but one row of times")
    ]


@pytest.mark.parametrize("times", ["0,0.005\n", "0\n0.005\n"])
def test_times_and_rows_must_be_as_many(write: Write, times: str) -> None:
    joints, clock = write(JOINTS, "q.csv"), write(times, "time.csv")
    if "," in times:
        clock = write("0,0.005,0.01,0.015\n", "time.csv")
    with pytest.raises(LogError) as caught:
        read(joints, clock)
    count = 4 if "," in times else 2
    assert str(caught.value) == f"{clock}: found {count} times, allowed: 3, as q.csv has rows"


def test_what_is_wrong_with_the_times_is_told(write: Write) -> None:
    joints, clock = write(JOINTS, "q.csv"), write("0,0.01,0.005\n", "time.csv")
    with pytest.raises(LogError) as caught:
        read(joints, clock)
    assert str(caught.value) == (f"{clock}:1, column 1: found 0.005 s after 0.01 s, {INCREASE}")
    clock = write("0,soon,0.005\n", "time.csv")
    with pytest.raises(LogError) as caught:
        read(joints, clock)
    said = "found 'soon', allowed: a number in every row"
    assert str(caught.value) == f"{clock}:1, column 1: {said}{OTHER_TIME}"


def test_two_clocks_are_one_too_many(write: Write) -> None:
    joints, clock = write("t,q1,q2\n0,1,2\n1,2,3\n", "q.csv"), write("0\n0.005\n", "time.csv")
    assert refusal(LogError, read, joints, clock) == (
        f"{joints}:1, column t: found a time here and in time.csv, allowed: one clock;"
        " --time COLUMN selects the column; --time none leaves both out"
    )


def test_two_joints_of_one_name_are_refused_wherever_the_times_stand(write: Write) -> None:
    clock, joints = write("0\n0.005\n", "time.csv"), write("q1,q1\n0.5,1.5\n0.25,1.25\n", "q.csv")
    for files in ([clock, joints], [joints, clock]):
        with pytest.raises(LogError, match=r"found as columns \d, \d, allowed: once"):
            read(*files)


def test_the_names_of_a_map_hold_beside_a_file_of_times(write: Write) -> None:
    files = [write(JOINTS, "q.csv"), write("1\n1.005\n1.01\n", "time.csv")]
    assert read(*files, names=("shoulder", "elbow")).joints == ("shoulder", "elbow")
