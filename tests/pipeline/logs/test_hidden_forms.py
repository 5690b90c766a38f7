"""One damaged row that hides how a table is written, or what its columns hold: the row is named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from urmpipe_pipeline.joint_log import JointLog

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]

SPECIMENS = Path(__file__).parents[2] / "specimens"
K = np.arange(40)
Q = np.c_[0.4 * np.sin(K / 9), 1 + 0.2 * np.cos(K / 7)]
TURNS = Rotation.from_rotvec(np.linspace(0, 1, 40)[:, np.newaxis] * [0.3, 0.4, 1.0])
NUMBER = "a number, or an empty, Null or NaN cell where a sample is missing"
MAY_BE = (
    "the time, a counter or a joint; --time 1 or --time none specifies it;"
    " --joints A,B,C names the joint columns"
)  # fmt: skip


def text(rows: Sequence[Sequence[object]], delimiter: str = ",") -> list[str]:
    return [delimiter.join(map(str, row)) for row in rows]


def with_line(lines: Sequence[str], number: int, line: str) -> str:
    """The text with another line in place of one, counted from 1."""
    return "\n".join([*lines[: number - 1], line, *lines[number:]]) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize("at", [1, 2, 11, 20])
def test_rows_of_ros2_with_a_message_among_them(wrong: Wrong, read: Read, at: int) -> None:
    lines = (SPECIMENS / "ros2_echo_joint_states.csv").read_text().splitlines()
    sound = read("\n".join(lines))
    torn = lines[at - 1]
    assert wrong(with_line(lines, at, torn[60:]))[0].startswith(f"log.csv:{at}: found ")
    letters = torn.replace("joint,1.", "joint,1.x", 1)
    assert wrong(with_line(lines, at, letters)) == [
        f"log.csv:{at}, column position.elbow_joint: found '{letters.split(',')[9]}', allowed: {NUMBER}"
    ]
    many = [line.replace("17400", f"{17400 + k // 20}", 1) for k, line in enumerate(lines * 10)]
    assert sound.joints[0].startswith("position.")
    said = "\n".join(wrong(with_line(many, at + 40, "[WARN] late")))
    assert "found 1 cell ('[WARN] late')" in said


def test_the_first_row_of_another_publisher_is_named(wrong: Wrong) -> None:
    lines = (SPECIMENS / "wrong" / "two_publishers.csv").read_text().splitlines()
    arm = lines[0].split(",")[3:9]
    assert wrong("\n".join(lines)) == [
        f"log.csv:2: found a row with the joints finger_joint among rows with {', '.join(arm)},"
        " allowed: one publisher; keep the rows of one of them"
    ]


LABELLED = [f"Time: {0.01 * k:.2f} q values: [{a:.4f}, {b:.4f}] Type: 0" for k, (a, b) in enumerate(Q)]


@pytest.mark.parametrize("at", [1, 2, 20, 40])
def test_a_torn_row_with_labels(wrong: Wrong, read: Read, at: int) -> None:
    """Also the first, which was taken for a line above the rows; one without any label is a warning."""
    row = LABELLED[at - 1]
    shown = f"found '{row[:37]}...', allowed: "
    torn = f"found {row[:-18]!r}, allowed: as many [ as ]"
    assert wrong(with_line(LABELLED, at, row[:-18])) == [f"log.csv:{at}: {torn}"]
    assert wrong(with_line(LABELLED, at, row.replace("Type", "Typ"))) == [
        f"log.csv:{at}: {shown}rows with Time: q values: Type:"
    ]
    lines = ["started", *LABELLED]
    log = read(with_line(lines, at + 2, row[24:35])) if at < 40 else read(with_line(lines, 42, "[WARN] late"))
    left_out = row[24:35].strip() if at < 40 else "[WARN] late"
    assert [w.message for w in log.warnings] == [
        f"1 line without the labels of the rows is left out, first line {at + 2}: {left_out!r}"
    ]


@pytest.mark.parametrize("at", [2, 3, 20, 41])
def test_a_row_without_its_number_below_a_header_that_does_not_name_the_index(
    wrong: Wrong, read: Read, at: int
) -> None:
    lines = ["q1 q2 q3", *text(np.c_[K, Q, Q[:, 0]].astype(object), " ")]
    lines = [line.replace(".0 ", " ", 1) for line in lines]
    assert read("\n".join(lines)).joints == ("q1", "q2", "q3")
    cells = lines[at - 1].split(" ")
    for cell in ("x", "99"):
        assert wrong(with_line(lines, at, " ".join([cell, *cells[1:]]))) == [
            f"log.csv:{at}: found {cell!r}, allowed: a count, as before what line 1 names"
        ]
    assert wrong(with_line(lines, at, " ".join(cells[:3])))[0] == f"log.csv:{at}: found 3 cells, allowed: 4"


@pytest.mark.parametrize("at", [2, 3, 20, 41])
def test_a_row_with_a_cell_behind_those_that_the_header_names(wrong: Wrong, at: int) -> None:
    lines = ["t,q1,q2", *(f"{line}," for line in text(np.c_[K / 100, Q]))]
    assert wrong(with_line(lines, at, lines[at - 1] + "7")) == [
        f"log.csv:{at}: found '7', allowed: no cell behind what line 1 names"
    ]


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 1486559106.0])
@pytest.mark.parametrize("at", [2, 20, 39])
@pytest.mark.parametrize("cell", ["0.0", "9e9", "", "x"])
def test_a_damaged_time_without_a_header_is_asked_for_and_no_joint(
    wrong: Wrong, read: Read, at: int, cell: str, start: float
) -> None:
    lines = text(np.c_[start + K / 100, Q])
    assert read("\n".join(lines)).joints == ("q1", "q2")
    rest = lines[at - 1].partition(",")[2]
    assert wrong(with_line(lines, at, f"{cell},{rest}")) == [
        f"log.csv:{at}: found {cell!r} in a first column that otherwise increases, which may be {MAY_BE}"
    ]


def test_of_columns_that_run_evenly_together_each_may_be_the_time(read: Read, wrong: Wrong) -> None:
    lines = text(np.c_[1 + K / 100, 2 + K / 50])
    assert wrong("\n".join(lines))[0].startswith("log.csv:1: found columns 1, 2, which increase")
    assert read("\n".join(lines), time="none").joints == ("q1", "q2")
    assert read("\n".join(lines), time="2").joints == ("q1",)


def test_joints_whose_values_have_length_1_in_most_rows_hide_no_orientation(read: Read) -> None:
    near = np.c_[0.6 + 1e-4 * np.sin(K), 0.8 + 1e-4 * np.cos(K)]
    near[-8:] += 0.1
    assert read("\n".join(text(near))).joints == ("q1", "q2")


@pytest.mark.parametrize("at", [1, 20, 40])
def test_a_row_that_hides_a_pose_without_a_header(wrong: Wrong, at: int) -> None:
    lines = text(np.c_[Q, Q[:, :1], TURNS.as_quat()].round(6))
    cells = lines[at - 1].split(",")
    joints = "--joints A,B,C names the joint columns, in the robot's order"
    found = "found no orientation in columns 4, 5, 6, 7, allowed: one in every row, as in most"
    assert wrong(with_line(lines, at, ",".join([*cells[:-1], "0.2"]))) == [f"log.csv:{at}: {found}; {joints}"]
    matrix = np.tile(np.eye(4), (40, 1, 1))
    matrix[:, :3, :3], matrix[:, :2, 3] = TURNS.as_matrix(), Q
    lines = text(np.c_[Q, matrix.reshape(40, 16)].round(6))
    cells = lines[at - 1].split(",")
    found = "found no orientation in columns 3, 4, ... 13 more ..., 18, allowed: one in every row, as in most"
    assert wrong(with_line(lines, at, ",".join([*cells[:2], "3", *cells[3:]]))) == [
        f"log.csv:{at}: {found}; {joints}"
    ]


@pytest.mark.parametrize("at", [2, 9, 17])
def test_a_row_that_hides_a_recorded_orientation_is_named_in_the_warning(read: Read, at: int) -> None:
    for name, entry in (("tcp_matrix_16", "T00"), ("tcp_matrix_12", "r11")):
        lines = (SPECIMENS / f"{name}.csv").read_text().splitlines()
        cells = lines[at - 1].split(",")
        cells[lines[0].split(",").index(entry)] = "3"
        warnings = read(with_line(lines, at, ",".join(cells))).warnings
        found = [
            (w.row, "hold no orientation in 1 row" in w.message) for w in warnings if w.kind == "tcp-not-read"
        ]
        assert found == [(at - 1, True)]
    lines = (SPECIMENS / "tcp_quaternion_xyzw.csv").read_text().splitlines()
    names, cells = lines[0].split(","), lines[at - 1].split(",")
    for name in ("qx", "qy", "qz", "qw"):
        cells[names.index(name)] = "0"
    warnings = read(with_line(lines, at, ",".join(cells))).warnings
    assert [(w.row, w.message) for w in warnings if w.kind == "orientation"] == [
        (
            at - 1,
            "qx, qy, qz, qw hold quaternions of length 0 in 1 row of 16, first in this one, allowed: 1;"
            " they are not used",
        )
    ]
