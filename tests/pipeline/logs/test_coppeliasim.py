"""CoppeliaSim's graph exports: several graphs in one file, 4 digits, Null."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Arm = Callable[..., Chain]

JOINTS = """/urm/jointGraph
Time (s),joint 1 (deg),joint 2 (deg)
0.000,+1.571e+00,0.0
0.050,+1.790e+02,Null
0.100,-1.790e+02,+3.000e+00
"""
TIP = """/urm/tipGraph
Time (s),x (m),y (m),z (m)
0.000,+1.000e-01,+2.000e-01,+3.000e-01
0.050,+1.100e-01,+2.100e-01,+3.100e-01
0.100,+1.200e-01,+2.200e-01,+3.200e-01
"""
DEG = np.pi / 180


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("text", [f"{JOINTS}\n{TIP}\n", f"{TIP}\n{JOINTS}\n", f"{JOINTS}\n{TIP}"])
def test_joints_and_tip_in_two_graphs(read: Read, text: str, newline: str) -> None:
    log = read(text.replace("\n", newline))
    assert log.source == "coppeliasim"
    assert log.joints == ("joint 1", "joint 2")
    assert log.t_ns.tolist() == [0, 50_000_000, 100_000_000]
    np.testing.assert_array_equal(log.q, np.array([[1.571, 0.0], [179.0, np.nan], [-179.0, 3.0]]) * DEG)
    assert log.tcp_position is not None
    assert log.tcp_position[2].tolist() == [0.12, 0.22, 0.32]
    assert log.units == {"Time": "s", "joint 1": "deg", "joint 2": "deg", "x": "m", "y": "m", "z": "m"}
    assert log.digits == 4
    assert [(w.kind, w.row) for w in log.warnings] == [("missing", 2)]
    assert log.warnings[0].message == "joint 2 has no value in 1 of 3 rows, first in this one"


def test_first_line_is_that_of_the_joints_graph(read: Read) -> None:
    assert read(f"{JOINTS}\n{TIP}").first_line == 3
    assert read(f"{TIP}\n{JOINTS}").first_line == 9


def test_joints_spread_over_graphs_of_the_same_times(read: Read, arm: Arm) -> None:
    second = TIP.replace("x (m),y (m),z (m)", "joint 3 (deg),joint 4 (deg),joint 5 (deg)")
    log = read(f"{JOINTS}\n{second}", arm(5))
    assert log.joints == tuple(f"joint {k}" for k in range(1, 6))
    np.testing.assert_array_equal(log.q[0], np.array([1.571, 0.0, 0.1, 0.2, 0.3]) * DEG)


def test_a_tip_sampled_at_other_times_is_left_out(read: Read) -> None:
    log = read(f"{JOINTS}\n{TIP.replace('0.050,', '0.051,')}")
    assert log.tcp_position is None
    assert ("other graphs", "left out") in [(i.what, i.value) for i in log.inferences]


def test_joints_sampled_at_other_times_are_an_error(wrong: Wrong) -> None:
    second = TIP.replace("x (m),y (m),z (m)", "joint 3 (deg),joint 4 (deg),joint 5 (deg)")
    assert wrong(f"{JOINTS}\n{second.replace('0.050,', '0.051,')}") == [
        "log.csv:10, column Time (s): found 0.051 s, allowed: 0.05 s, as in /urm/jointGraph:"
        " the tables of one log share their times"
    ]


def test_two_arms_are_ambiguous(wrong: Wrong, read: Read) -> None:
    text = f"{JOINTS}\n{JOINTS.replace('/urm/', '/other/')}"
    said = "allowed: once; --joints A,B,C selects them: give their numbers"
    assert wrong(text) == [
        f"log.csv:2, column joint 1 (deg): found as columns 2, 5, {said}",
        f"log.csv:2, column joint 2 (deg): found as columns 3, 6, {said}",
    ]
    log = read(text, joints=("5", "6"))
    assert log.joints == ("/other/jointGraph/joint 1", "/other/jointGraph/joint 2")
    assert log.first_line == 9


def test_a_bad_cell_in_the_second_graph_is_found_by_its_line(wrong: Wrong) -> None:
    assert wrong(f"{JOINTS}\n{TIP.replace('+3.100e-01', 'abc')}") == [
        "log.csv:10, column z (m): found 'abc', allowed: a number, or an empty, Null or NaN cell where a"
        " sample is missing"
    ]


def test_bytes_that_are_no_utf_8_do_not_shift_the_lines(wrong: Wrong) -> None:
    """Behind the first 64 KB, where the encoding is decided, and in the middle one of three graphs."""
    rows = 3000
    header = "Time (s),{0}1 (deg),{0}2 (deg)\n"
    body = "".join(f"{0.05 * k:.3f},{k % 90:+.3e},{k % 80:+.3e}\n" for k in range(rows))
    graphs = [f"/{name}\n{header.format(name)}{body}\n" for name in ("joint", "noise", "other")]
    text = "".join(graphs).encode()
    middle = text.index(b"/noise")
    text = text[:middle] + text[middle:].replace(b"+2.000e+00", b"\xe9\xe9\xe9", 1)
    said = wrong(text, joints=("2", "3", "5", "6"))
    line = 2 + rows + 1 + 2 + 3  # two header lines, the rows, a blank line, two header lines, row 3
    assert said[0].startswith(f"log.csv:{line}, column noise1 (deg): found '")
    assert said[1:] == ["log.csv: 1 of 3000 rows cannot be read; --skip-bad leaves them out"]


def test_robot_names_order_the_joints(read: Read, arm: Arm) -> None:
    text = JOINTS.replace("joint 1", "elbow").replace("joint 2", "shoulder")
    log = read(text, arm(2, names=("shoulder", "elbow")))
    assert log.joints == ("shoulder", "elbow")
    assert log.q[2].tolist() == [3.0 * DEG, -179.0 * DEG]


def test_graphs_may_follow_without_a_path(read: Read) -> None:
    log = read(f"{JOINTS}\n{TIP.partition(chr(10))[2]}")
    assert log.tcp_position is not None


def test_four_digits_only_if_all_cells_have_them(read: Read) -> None:
    assert read(JOINTS.replace("+1.571e+00", "+1.57e+00")).digits is None


@pytest.mark.slow
def test_a_large_export_is_read_in_blocks(write: Callable[..., object]) -> None:
    """More than a block and more than the head that is looked at: nothing may be lost where they end."""
    rows = 60_000
    body = "".join(f"{0.05 * k:.3f},{k % 300:+.3e},{-(k % 200):+.3e}\n" for k in range(rows))
    head = "\n".join(JOINTS.split("\n")[:2])
    path = write(f"{head}\n{body}\n{TIP}")
    log = read_log([path], LogMap(unit={"": "deg"}))  # type: ignore[list-item]
    assert log.rows == rows
    np.testing.assert_array_equal(log.q[:, 0], np.arange(rows) % 300 * DEG)
    np.testing.assert_array_equal(log.t_ns, np.arange(rows) * 50_000_000)


def test_a_path_whose_graphs_differ_in_their_times_is_refused(wrong: Callable[..., list[str]]) -> None:
    graphs = [
        f"/{axis}\nTime (s),{axis} (m)\n0.0,1\n{step},2\n"
        for axis, step in zip("xyz", (1, 2, 3), strict=True)
    ]
    said = wrong("\n".join(graphs))
    assert len(said) == 2
    assert all(line.startswith("log.csv:") for line in said)
