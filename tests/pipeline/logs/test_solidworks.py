"""SolidWorks motion plots: one file a plot, in the language and the signs of the computer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import LogError
from urmpipe_pipeline.logs import LogMap, read_log

Arm = Callable[..., Chain]
Write = Callable[..., Path]
DEG = np.pi / 180


def plot(values: list[float], title: str = "Angular Displacement{n} (deg)", n: object = "") -> str:
    rows = "".join(f"{0.01 * k:.2f};{value:.4f}\n" for k, value in enumerate(values))
    return f"Time (sec);{title.format(n=n)}\n{rows}".replace(".", ",")


VALUES = {1: [1.5, 1.75, 2.0], 2: [-179.5, 179.75, 179.0], 10: [0.0, 0.25, 0.5]}


@pytest.fixture
def files(write: Write) -> list[Path]:
    """Three plots, as a shell lists them: 1, 10, 2."""
    return [write(plot(VALUES[n], n=n), f"joint{n}.csv") for n in (1, 10, 2)]


def test_plots_are_joined_in_the_order_of_their_numbers(files: list[Path], arm: Arm) -> None:
    log = read_log(files, robot=arm(3))
    assert (log.name, log.source) == ("joint", "solidworks")
    assert log.joints == ("Angular Displacement1", "Angular Displacement2", "Angular Displacement10")
    assert log.t_ns.tolist() == [0, 10_000_000, 20_000_000]
    np.testing.assert_array_equal(log.q, np.array([VALUES[1], VALUES[2], VALUES[10]]).T * DEG)
    assert log.q.flags.c_contiguous
    assert [file.name for file in log.files] == ["joint1.csv", "joint10.csv", "joint2.csv"]
    assert log.units["Angular Displacement2"] == "deg"


def test_numbers_of_the_columns_come_before_those_of_the_files(write: Write) -> None:
    files = [write(plot(VALUES[n], n=n), f"Plot{place}.csv") for place, n in ((1, 2), (2, 1))]
    log = read_log(files)
    assert log.joints == ("Angular Displacement1", "Angular Displacement2")
    np.testing.assert_array_equal(log.q, np.array([VALUES[1], VALUES[2]]).T * DEG)
    assert [(warning.kind, warning.message) for warning in log.warnings] == [
        (
            "plot-order",
            "the plots are joined by the numbers of their columns, which are not those of the files:"
            " Angular Displacement1 of Plot2.csv, Angular Displacement2 of Plot1.csv",
        )
    ]
    given = read_log(files, LogMap(joints=("Angular Displacement2", "Angular Displacement1")))
    np.testing.assert_array_equal(given.q, np.array([VALUES[2], VALUES[1]]).T * DEG)
    assert not given.warnings


def test_a_plot_that_is_missing_between_others_is_an_error(write: Write, arm: Arm, tmp_path: Path) -> None:
    files = [write(plot(VALUES[1], n=n), f"joint{n}.csv") for n in (1, 2, 4)]
    assert refusal(LogError, read_log, files) == (
        f"{tmp_path}: found plots with the numbers 1, 2, 4 and none with 3, allowed: a plot for each joint;"
        " add the missing one; --joints A,B,C names the joint columns, in the robot's order"
    )
    assert read_log(files, robot=arm(3)).q.shape == (3, 3)


LOG = "t,q1,q2\n0,1,2\n0.1,1,2\n"
NAMELESS = "0,1,5\n0.1,3,1\n0.2,2,6\n0.3,4,2\n"
WIDE = "".join(f"{row}{',1,2,7,4' * 4}\n" for row in NAMELESS.split())
"""As many columns as a log has that ends with a homogeneous transform."""


@pytest.mark.parametrize(
    "texts",
    [(LOG, LOG), (LOG, LOG.replace("q", "joint")), (NAMELESS, NAMELESS), (WIDE, WIDE)],
    ids=["of one maker", "of two makers", "without headers", "without headers, wide"],
)
@pytest.mark.parametrize("joints", [None, 2])
def test_a_folder_of_several_logs_is_told_as_such(
    texts: tuple[str, str], joints: int | None, write: Write, arm: Arm, tmp_path: Path
) -> None:
    files = [write(text, f"{day}.csv") for day, text in zip(("monday", "tuesday"), texts, strict=True)]
    assert refusal(LogError, read_log, files, robot=arm(joints) if joints else None) == (
        f"{tmp_path}: found 2 logs, each with joints of its own (monday.csv, tuesday.csv),"
        " allowed: one log, or its plots with one joint per file; name the logs one by one"
    )


def test_a_file_of_torques_or_of_joints_not_named_is_no_log_beside_the_joints(write: Write, arm: Arm) -> None:
    q, torques, others = (write(LOG.replace("q", name), f"{name}.csv") for name in ("q", "tau", "joint"))
    assert read_log([q, torques], robot=arm(2)).joints == ("q1", "q2")
    assert read_log([q, others], LogMap(joints=("joint2", "joint1"))).joints == ("joint2", "joint1")


def test_german_words_and_equal_titles(write: Write) -> None:
    text = {n: plot(VALUES[n], "Winkelverschiebung (grd)").replace("Time (sec)", "Zeit (s)") for n in (1, 2)}
    files = [write(text[n], f"Gelenk {n}.csv", "latin-1") for n in (2, 1)]
    log = read_log(files)
    assert log.joints == ("Gelenk 1", "Gelenk 2")
    assert log.units == {"Zeit": "s", "Gelenk 1": "deg", "Gelenk 2": "deg"}
    np.testing.assert_array_equal(log.q[:, 1], np.array(VALUES[2]) * DEG)


def test_plots_whose_names_have_no_numbers_keep_their_order(write: Write) -> None:
    title = "Angular Displacement (deg)"
    files = [write(plot(VALUES[n], title), f"{name}.csv") for n, name in ((2, "shoulder"), (1, "elbow"))]
    log = read_log(files)
    assert log.joints == ("shoulder", "elbow")
    assert log.name == "shoulder"


def test_one_file_may_hold_all_plots(write: Write) -> None:
    text = "Time (sec);Angular Displacement1 (deg);Angular Displacement2 (deg)\n0,00;1,5;-2\n0,01;1,6;-3\n"
    log = read_log([write(text)])
    assert log.source == "solidworks"
    np.testing.assert_array_equal(log.q, np.array([[1.5, -2.0], [1.6, -3.0]]) * DEG)


def test_degrees_are_the_default_of_the_source(write: Write) -> None:
    text = "Time;Angular Displacement1\n0,00;31,5\n0,01;31,6\n"
    log = read_log([write(text)])
    assert log.units["Angular Displacement1"] == "deg"
    assert not log.warnings


def test_differing_times_are_an_error(files: list[Path], write: Write, tmp_path: Path) -> None:
    write(files[2].read_text().replace("0,01;", "0,015;"), "joint2.csv")
    write("\n".join(files[1].read_text().split("\n")[:-2]), "joint10.csv")
    assert refusal(LogError, read_log, files).replace(f"{tmp_path}/", "").split("\n") == [
        "joint2.csv:3, column Time (sec): found 0.015 s, allowed: 0.01 s, as in joint1: the tables of one log"
        " share their times",
        "joint10.csv: found 2 rows, allowed: 3, as in joint1: the tables of one log share their times",
    ]


def test_errors_of_all_files_at_once(files: list[Path], write: Write, tmp_path: Path) -> None:
    write(files[0].read_text().replace("1,7500", "x"), "joint1.csv")
    write(files[2].read_text().replace("179,7500", "y"), "joint2.csv")
    with pytest.raises(LogError) as caught:
        read_log(files)
    said = "allowed: a number, or an empty, Null or NaN cell where a sample is missing"
    assert str(caught.value).replace(f"{tmp_path}/", "").split("\n") == [
        f"joint1.csv:3, column Angular Displacement1 (deg): found 'x', {said}",
        f"joint2.csv:3, column Angular Displacement2 (deg): found 'y', {said}",
    ]


def test_frames_beside_the_time_are_no_joint(write: Write) -> None:
    text = "Frame;Time (sec);Angular Displacement{n} (deg)\n1;0,00;1,5\n2;0,01;1,6\n"
    log = read_log([write(text.format(n=n), f"plot{n}.csv") for n in (1, 2)])
    assert log.joints == ("Angular Displacement1", "Angular Displacement2")


def test_a_plot_against_frames_has_no_clock(write: Write) -> None:
    text = "Frame;Angular Displacement1 (deg)\n1;1,5\n2;1,6\n3;1,7\n"
    log = read_log([write(text)], LogMap(period=0.04))
    assert log.t_ns.tolist() == [0, 40_000_000, 80_000_000]
