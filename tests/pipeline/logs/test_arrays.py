"""Arrays in cells and text with labels: read as the flat table that they mean, with the file's own lines."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import INCREASE
from urmpipe_models.arm.chain import Chain
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Arm = Callable[..., Chain]

T = [0.0, 0.005, 0.01, 0.015]
Q = np.round(np.random.default_rng(3).uniform(-3, 3, (4, 7)), 8)


def found(log: JointLog, what: str) -> str:
    return next(inference.value for inference in log.inferences if inference.what == what)


@pytest.mark.parametrize(
    "cell", [np.array, list, tuple, lambda row: row.tolist(), lambda row: tuple(row.tolist())]
)
@pytest.mark.parametrize("name", ["q", "position", "joint_positions", "theta", "joint angles"])
def test_pandas_writes_arrays_as_their_str(tmp_path: Path, cell: Callable[..., object], name: str) -> None:
    """str of an array of seven goes over two lines; a list of np.float64 names the type in each number."""
    path = tmp_path / "log.csv"
    pd.DataFrame({"time": T, name: [cell(row) for row in Q]}).to_csv(path, index=False)
    log = read_log([path])
    assert log.joints == tuple(f"{name}_{k + 1}" for k in range(7))
    np.testing.assert_array_equal(log.q, Q)
    assert log.t_ns.tolist() == [0, 5_000_000, 10_000_000, 15_000_000]
    assert found(log, "arrays") == f"{name} (7)"


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", ","), ("|", ".")]
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_several_columns_of_arrays_beside_others(
    tmp_path: Path, separator: str, decimal: str, encoding: str
) -> None:
    """pandas writes the decimals of arrays as points whatever the decimal sign of the table."""
    path = tmp_path / "log.csv"
    frame = pd.DataFrame(
        {
            "t": T,
            "task": ["pick up", "pick [a, b]", "place (1 2)", "größe"],
            "q [deg]": list(Q),
            "qd": list(2 * Q),
            "load": [0.5, np.nan, 1.5, 2.5],
        }
    )
    frame.to_csv(path, sep=separator, decimal=decimal, encoding=encoding)
    log = read_log([path])
    np.testing.assert_array_equal(log.q, Q * (np.pi / 180))
    assert log.qd is not None
    assert set(log.units.values()) == {"s", "deg", "deg/s"}
    np.testing.assert_array_equal(log.qd, np.array(pd.DataFrame(2 * Q)) * (np.pi / 180))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.integers(1, 30), st.integers(2, 9), st.booleans(), st.sampled_from(["\n", "\r\n"]))
def test_any_number_of_rows_and_columns(rows: int, joints: int, lists: bool, newline: str) -> None:
    values = np.round(np.random.default_rng(rows).uniform(-3, 3, (rows, joints)), 8)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        cells = [row.tolist() if lists else row for row in values]
        frame = pd.DataFrame({"t": np.arange(rows) * 0.01, "q": cells})
        frame.to_csv(path, index=False, lineterminator=newline)
        log = read_log([path], LogMap(time="t"))
    np.testing.assert_array_equal(log.q, values)


def test_matrices_are_flat_and_no_joints(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    poses = [np.eye(4) * (k + 1) for k in range(4)]
    pd.DataFrame({"t": T, "q": list(Q), "pose": poses}).to_csv(path, index=False)
    log = read_log([path])
    np.testing.assert_array_equal(log.q, Q)
    assert found(log, "arrays") == "q (7), pose (16)"


def test_plain_cells_that_look_like_arrays(read: Read, wrong: Wrong) -> None:
    text = 't,q,note\n0,"[1 2]",\n0.1,"[3 4]","[by hand]"\n0.2,"[5 6]",end\n'
    assert read(text).q.tolist() == [[1, 2], [3, 4], [5, 6]]
    assert wrong('t,q,qd_1,qd_2\n0,"[1 2]",1,1\n0.1,"[3 4]",1,[1]\n0.2,"[5 6]",1,1\n') == [
        "log.csv:3, column qd_2: found '[1]', allowed: a number,"
        " or an empty, Null or NaN cell where a sample is missing"
    ]


@pytest.mark.slow
def test_control_signs_beyond_the_head(read: Read, wrong: Wrong) -> None:
    lines = [f"{0.1 * k:.1f},[1 {k % 3}]" for k in range(9000)]
    lines[8000] = "800.0,\x01"
    said = "found '\\x01', allowed: an array of 2 numbers"
    assert wrong("\n".join(["t,q", *lines]))[0] == f"log.csv:8002, column q: {said}"


def test_missing_samples_in_arrays(read: Read) -> None:
    log = read('t,q\n0,"[1. nan]"\n0.1,"[2. 3.]"\n0.2,\n0.3,"[None, 4]"\n')
    np.testing.assert_array_equal(log.q, [[1, np.nan], [2, 3], [np.nan, np.nan], [np.nan, 4]])


def test_arrays_without_header(read: Read, arm: Arm) -> None:
    text = "0.00 [0.1, 0.2, 0.3]\n0.05 [0.4, 0.5, 0.6]\n0.10 [0.4, 0.5, 0.7]\n"
    log = read(text, arm(3))
    assert log.q.tolist() == [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.4, 0.5, 0.7]]
    assert log.t_ns.tolist() == [0, 50_000_000, 100_000_000]


def test_numbers_in_brackets_in_names_are_no_arrays(read: Read) -> None:
    assert read("t,state.q[0],state.q[1]\n0,1,2\n0.1,2,3\n").joints == ("state.q[0]", "state.q[1]")


def test_wrong_arrays_are_named_by_their_first_line(wrong: Wrong) -> None:
    rows = [f'{0.1 * k:.1f},"[ 0.1 0.2\n  0.3]"' for k in range(6)]
    rows[1] = '0.1,"[ 0.1 0.2\n  ]"'
    rows[2] = '0.2,"[ 0.1 0.2\n  0.3 0.4]"'
    rows[4] = '0.4,"[ 0.1 0.2\n  0.3"'
    rows[5] = "0.5,7"
    assert wrong("\n".join(["t,q", *rows])) == [
        "log.csv:4, column q: found an array of 2 numbers, allowed: 3, as in the other rows",
        "log.csv:6, column q: found an array of 4 numbers, allowed: 3, as in the other rows",
        "log.csv:10: found '0.4,\"[ 0.1 0.2 0.3', allowed: as many [ as ]",
        "log.csv:12, column q: found '7', allowed: an array of 3 numbers",
    ]


def test_arrays_that_only_together_have_the_right_length(wrong: Wrong) -> None:
    rows = ["0.1,[1 2 3],[4 5]"] + [f"{0.1 * k:.1f},[1 2],[3 4 5]" for k in range(2, 6)]
    assert wrong("\n".join(["t,q,qd", *rows])) == [
        "log.csv:2, column q: found an array of 3 numbers, allowed: 2, as in the other rows"
    ]


def test_times_that_run_backwards_name_the_first_line_of_the_row(wrong: Wrong) -> None:
    rows = [f'{time},"[ 0.1 0.2\n  0.3]"' for time in (0.1, 0.3, 0.2, 0.4)]
    assert wrong("\n".join(["t,q", *rows])) == [f"log.csv:6, column t: found 0.2 s after 0.3 s, {INCREASE}"]


@pytest.mark.parametrize("array", ["[0,1 0,2]", "[0,1; 0,2]"])
def test_decimal_commas_in_arrays_are_not_guessed(wrong: Wrong, array: str) -> None:
    assert wrong(f't;q\n0;"{array}"\n1;"{array}"\n') == [
        f"log.csv:2: found '\"{array}\"', allowed: arrays whose numbers have decimal points"
    ]


FRI = "Time: {:.6f}  q values: [{}] p0 values: [0.66434, 0.10551, 0.38457] Type: 0 K gains0.000000\n"


def fri(rows: int = 4) -> str:
    cells = [",  ".join(f"{value:.5f}" for value in Q[k % 4]) for k in range(rows)]
    return "".join(FRI.format(0.015 * (k + 1), text) for k, text in enumerate(cells))


@pytest.mark.parametrize("before", ["", "\n", "K gains 200.0 200.0 50.0\n", "connected\n\nmonitoring\n"])
def test_fri_text(read: Read, arm: Arm, before: str) -> None:
    log = read(before + fri(), arm(7))
    np.testing.assert_array_equal(log.q, np.round(Q, 5))
    assert log.t_ns.tolist() == [0, 15_000_000, 30_000_000, 45_000_000]
    assert (log.source, log.tcp_position, log.clock_start) == ("fri", None, 0.015)
    assert found(log, "columns not used") == "p0_1, p0_2, p0_3, Type, K gains"
    assert log.first_line == 1 + before.count("\n")


def test_other_lines_among_rows_are_left_out_and_counted(read: Read, wrong: Wrong) -> None:
    lines = fri().splitlines(keepends=True)
    lines[1:1] = ["Connection quality: GOOD\n", "\n"]
    lines[4:4] = ["Seq: 5\n"]  # ends like a label, and is none
    log = read("".join(lines))
    np.testing.assert_array_equal(log.q, np.round(Q, 5))
    assert [(w.kind, w.message) for w in log.warnings] == [
        (
            "other-lines",
            "2 lines without the labels of the rows are left out, first line 2: 'Connection quality: GOOD'",
        )
    ]
    lines[5] = lines[5].replace("0.66434, ", "")
    assert wrong("".join(lines)) == [
        "log.csv:6, column p0: found an array of 2 numbers, allowed: 3, as in the other rows"
    ]


def test_torn_and_swapped_labels_are_errors(wrong: Wrong) -> None:
    lines = fri(6).splitlines(keepends=True)
    lines[1] = lines[1][30:]
    lines[3] = lines[3].replace("q values", "_").replace("p0 values", "q values").replace("_", "p0 values")
    shown = [line.strip() if len(line) <= 41 else line.strip()[:37] + "..." for line in lines]
    allowed = "allowed: rows with Time: q values: p0 values: Type: K gains"
    assert wrong("".join(lines))[1:] == [f"log.csv:4: found {shown[3]!r}, {allowed}"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "row",
    [
        "t={0:.3f}, q1={1}, q2={2}\n",
        "  Time : {0:.3f}   J1 : {1}   J2 : {2}  \n",
        "time = {0:.3f} | joint1 = {1} | joint2 = {2}\n",
        "Time: {0:.3f} joints: ({1} {2})\n",
        "t: {0:.3f}; state: moving; q: [{1}; {2}]; dq: [0.0; 0.0]\n",
    ],
)
@pytest.mark.parametrize("rows", [1, 5, 40_000])
def test_any_constant_labels(read: Read, row: str, rows: int) -> None:
    values = np.round(np.cos(np.arange(2 * rows).reshape(-1, 2)), 6)
    log = read("".join(row.format(0.002 * (k + 1), *pair) for k, pair in enumerate(values.tolist())))
    np.testing.assert_array_equal(log.q, values)
    np.testing.assert_array_equal(log.t_ns, 2_000_000 * np.arange(rows))


def test_decimal_commas_behind_labels(read: Read) -> None:
    log = read("Zeit: 0,1 A1: 1,5 A2: -2\nZeit: 0,2 A1: 1,25 A2: -3,5\n")
    assert log.q.tolist() == [[1.5, -2], [1.25, -3.5]]
    assert log.t_ns.tolist() == [0, 100_000_000]


def test_words_before_numbers_are_no_labels(read: Read) -> None:
    """A space between cells is no label: NaN 0.5 is two cells."""
    log = read("q1 q2 q3 q4\nNaN 0.5 NaN 0.5\n1 0.5 1 0.5\nNaN 0.5 NaN 0.5\n")
    assert log.q.shape == (3, 4)


@pytest.mark.slow
def test_many_blocks_of_arrays_and_of_labels(tmp_path: Path) -> None:
    """60,000 rows are several megabytes: rows over two lines and rows of labels are cut between blocks."""
    q = np.round(np.sin(np.arange(360_000.0)).reshape(-1, 6), 5)
    array, label = tmp_path / "array.csv", tmp_path / "label.txt"
    rows = [[f"{value:.5f}" for value in row] for row in q.tolist()]
    texts = [
        f'{0.01 * k:.2f},"[ {" ".join(row[:4])}\n   {" ".join(row[4:])}]"\n' for k, row in enumerate(rows)
    ]
    array.write_text("t,q\n" + "".join(texts))
    label.write_text("".join(FRI.format(0.01 * k, ", ".join(row)) for k, row in enumerate(rows)))
    for path in (array, label):
        log = read_log([path])
        np.testing.assert_array_equal(log.q, q)
        np.testing.assert_array_equal(log.t_ns, 10_000_000 * np.arange(len(q)))
