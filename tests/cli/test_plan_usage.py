"""Wrong use of `urmpipe plan`: what a person is told, word for word, all of it at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from urmpipe.main import run
from urmpipe.parameters.motions import Plan
from urmpipe.parameters.param import params_of
from urmpipe_models.planning.laws import ARCS
from urmpipe_pipeline.planned_paths.request import LAWS

Captured = pytest.CaptureFixture[str]

CUBE = "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a path."""
    (tmp_path / "path.csv").write_text("x,y,z,r\n0,0,0,0\n0.1,0,0,0.01\n0.1,0.1,0,0\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys: Captured, *arguments: str) -> list[str]:
    """Return the lines that say why a command is refused; it writes nothing."""
    before = sorted(path.name for path in Path.cwd().iterdir())
    assert run(["plan", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sorted(path.name for path in Path.cwd().iterdir()) == before
    return [line.removeprefix("error: ") for line in err.splitlines()]


def test_laws_and_arcs_are_those_of_the_planner() -> None:
    params = params_of(Plan)
    assert (params["law"].kind.allowed, params["arcs"].kind.allowed) == (", ".join(LAWS), ", ".join(ARCS))


def test_all_that_is_wrong_is_told_at_once(capsys: Captured) -> None:
    cube = "cube:wall,a=0.06,r=0.03,x=1.7,y=0,z=1,plane=zz"
    options = ["--velocity", "0", "--acceleration", "-6", "--jerk", "3", "-o", "plan.txt"]
    timing = [
        "path: plane of a wall section: found 'zz', allowed: xy, xz, yz",
        "path: found a = 0.06 m, allowed: more than 2 r = 0.06 m",
        "velocity (--velocity): found 0.0, allowed: a finite number of m/s above 0",
        "acceleration (--acceleration): found -6.0, allowed: a finite number of m/s2 above 0",
        "jerk (--jerk): found a jerk with the law trapezoid, allowed: with the law jerk",
        "output (--output): found 'plan.txt', allowed: a name that ends in .csv (a plan) or .rrd (a"
        " recording)",
    ]
    unknown, *rest = refused(capsys, cube, *options, "--robot", "ur55")
    assert unknown.startswith("unknown robot 'ur55' (did you mean ur5?); allowed: arm6, ")
    assert rest == timing
    assert refused(capsys, cube, *options, "--robot", "irb60", "--start", "1,2") == [
        "start (--start): found 2 values, allowed: 4, one for each of theta1, theta2, theta3, theta4",
        *timing,
    ]


def test_a_law_that_the_arm_does_not_suit_is_told_beside_wrong_rows(capsys: Captured, folder: Path) -> None:
    (folder / "path.csv").write_text("x,y,z,r\n0,0,0,0\n0.1,0,0,-0.03\n0.1,0.1,0,0\n")
    row = "path.csv:3, column r: found -0.03, allowed: 0 or more, or an empty cell"
    lacks, no_robot, start = (
        "robot (--robot): found irb60 without the largest acceleration of theta1, theta2, theta3, allowed:"
        " a robot"
        " file with the key acceleration in limits, in rad/s2 or m/s2",
        "law (--law): found limits without a robot, allowed: with a robot",
        "start (--start): found without a robot; --robot NAME|FILE sets one",
    )
    for options, said in ((["--robot", "irb60"], [lacks]), (["--start", "1"], [start, no_robot])):
        assert refused(capsys, "path.csv", "--law", "limits", *options) == [*said, row]


def test_a_path_has_no_time(capsys: Captured) -> None:
    (said,) = refused(capsys, "path.csv", "--time", "t")
    assert said == "--time: no such option; see urmpipe plan --help"


def test_a_map_that_is_not_there_is_told_once(capsys: Captured) -> None:
    assert refused(capsys, "path.csv", "--map", "map.toml", "--velocity", "-1") == [
        "map.toml: cannot be read: No such file or directory",
        "velocity (--velocity): found -1.0, allowed: a finite number of m/s above 0",
    ]


@pytest.mark.slow
def test_the_base_of_a_map_stands_for_the_robot_beside_it(folder: Path) -> None:
    (folder / "map.toml").write_text("base = [0, 0, 0.1]\n")
    cube = ["plan", CUBE, "--robot", "irb60", "-q"]
    assert run([*cube, "--map", "map.toml", "-o", "a.csv"]) == 0
    assert run([*cube, "--base", "0,0,0.1", "-o", "b.csv"]) == 0
    assert (folder / "a.csv").read_text() == (folder / "b.csv").read_text()


REACH = "allowed: a point that the arm reaches"


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("x,y,z,r\n0,0,0,0\n0.1,0,0,-0.03\n0.1,0.1,0,x\n", [],
         ["path.csv:3, column r: found -0.03, allowed: 0 or more, or an empty cell",
          "path.csv:4, column r: found 'x', allowed: 0 or more, or an empty cell"]),
        ("x,y,z,r\n0,0,0,0\n0.1,0,0,0.03\n0.2,0,0,0.03\n0.3,0,0,0\n", [],
         ["path.csv:3, column r: found a radius of 0.03 m where the path goes straight on, allowed: 0, or row"
          " 3 off that line"]),
        ("x,y,z,corner_r\n0,0,0,0\n0.1,0,0,0.3\n0.1,0.5,0,0\n", [],
         ["path.csv:3, column corner_r: found 0.3 m, whose arc needs 0.3 m on the line from row 1 to row"
          " 2, allowed: its length, 0.1 m"]),
        ("x,y,z\n2,0,0.3\n0.4,0,0.3\n0,3,0\n", ["--robot", "ur5e"],
         [f"path.csv:2: found (2, 0, 0.3) m, 1.04 m out of reach of ur5e, {REACH}",
          f"path.csv:4: found (0, 3, 0) m, 2.04 m out of reach of ur5e, {REACH}"]),
        ("x,y,z,r\n0,0,0,0\n", [], ["path.csv: found 1 row, allowed: 2 or more"]),
    ],
    ids=["no radius", "collinear", "too large", "out of reach", "one row"],
)  # fmt: skip
def test_rows_that_make_no_path(
    capsys: Captured, folder: Path, text: str, options: list[str], said: list[str]
) -> None:
    (folder / "path.csv").write_text(text)
    assert refused(capsys, "path.csv", *options) == said


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--velocity", "5m"], "velocity (--velocity): found '5m', allowed: a speed in m/s, such as 0.25"
                               " or 250mm/s"),
        (
            ["--acceleration", "fast"],
            "acceleration (--acceleration): found 'fast', allowed: an acceleration in m/s2, such as 0.5 or"
            " 500mm/s2",
        ),
        (["--jerk", ""], "jerk (--jerk): found '', allowed: a jerk in m/s3, such as 60 or 60m/s3"),
        (["--velocity", "inf"], "velocity (--velocity): found 'inf', allowed: a speed in m/s, such as 0.25"
                                " or 250mm/s"),
        (["--tsp", "0s"], "tsp (--tsp): found '0s', allowed: a positive time in s, such as 0.005 or 5ms"),
        (["--tsp", "1e-9"],
         "tsp (--tsp): found 1e-09 s, allowed: a period that makes up to 1000000 samples of 4.78032 s"),
        (["--law", "limit"], "law (--law): found 'limit' (did you mean limits?), allowed: trapezoid, jerk,"
                             " limits"),
        (["--law", "jerk"], "jerk (--jerk): found no jerk with the law jerk, allowed: a number of m/s3"),
        (["--jerk", "5"], "jerk (--jerk): found a jerk with the law trapezoid, allowed: with the law jerk"),
        (["--law", "limits"], "law (--law): found limits without a robot, allowed: with a robot"),
        (["--law", "limits", "--robot", "irb60"],
         "robot (--robot): found irb60 without the largest acceleration of theta1, theta2, theta3,"
         " allowed: a robot"
         " file with the key acceleration in limits, in rad/s2 or m/s2"),
        (["--law", "limits", "--arcs", "total", "--robot", "irb60"],
         "robot (--robot): found irb60 without the largest acceleration of theta1, theta2, theta3,"
         " allowed: a robot"
         " file with the key acceleration in limits, in rad/s2 or m/s2\n"
         "arcs (--arcs): found total with the law limits, allowed: with the laws trapezoid and jerk"),
        (["--start", "0,0,0,0"], "start (--start): found without a robot; --robot NAME|FILE sets one"),
        (["--tool", "0,0,0.1"], "tool (--tool): found without a robot; --robot NAME|FILE sets one"),
    ],
)  # fmt: skip
def test_values_that_are_refused(capsys: Captured, options: list[str], said: str) -> None:
    assert refused(capsys, CUBE, *options) == said.splitlines()


@pytest.mark.parametrize(
    ("cube", "said"),
    [
        ("cube:wall,a=0.06,r=0.03,x=1,y=0,z=1", ["path: found a = 0.06 m, allowed: more than 2 r = 0.06 m"]),
        ("cube:diagonal,a=1,r=0,x=1,y=0,z=1,plane=xy",
         ["path: plane of a diagonal section: found 'xy', allowed: c1, c2, c3, c4"]),
        ("cube:wal,a=1,r=0,x=1", ["path: found no y, z, allowed: all of a, r, x, y, z",
                                  "path: found 'wal' (did you mean wall?), allowed: wall, diagonal"]),
    ],
)  # fmt: skip
def test_cubes_that_are_none(capsys: Captured, cube: str, said: list[str]) -> None:
    assert refused(capsys, cube) == said


def test_files_that_are_none(capsys: Captured) -> None:
    assert refused(capsys, "nowhere.csv") == ["nowhere.csv: found no such file"]
    assert run(["plan", "path.csv", "-o", "plan.rrd", "-q"]) == 0
    assert refused(capsys, "plan.rrd") == [
        "plan.rrd: found a recording, allowed: a table (CSV) of rows, or a test cube (cube:...)"
    ]
    (said,) = refused(capsys)
    assert said.startswith("found no PATH.csv|cube:..., allowed: urmpipe plan ")
