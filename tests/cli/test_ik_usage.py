"""Wrong use of `urmpipe ik`: what a person is told, word for word."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from urmpipe.main import run

POSE = "x,y,z,rz,ry,rx\n-0.069,0,0.112,0.785398163,-1.570796327,-0.785398163\n"

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with one target of arm6."""
    (tmp_path / "targets.csv").write_text(POSE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys: Captured, *arguments: str) -> list[str]:
    """Return the lines that say why a command is refused; it writes nothing."""
    before = sorted(path.name for path in Path.cwd().iterdir())
    assert run(["ik", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sorted(path.name for path in Path.cwd().iterdir()) == before
    return err.splitlines()


@pytest.mark.parametrize(
    ("units", "said"),
    [
        (
            ["mm", "deg"],
            "found mm and deg without a column, allowed: one unit, or that of a column as COLUMN=UNIT",
        ),
        (
            ["x=mm", "x=m"],
            "found mm and m for x, allowed: one unit, or that of a column as COLUMN=UNIT",
        ),
        (
            ["rz=deg, ry=deg, rz=rad"],
            "found deg and rad for rz, allowed: one unit, or that of a column as COLUMN=UNIT",
        ),
    ],
)
def test_no_unit_is_dropped(capsys: Captured, units: list[str], said: str) -> None:
    options = [word for unit in units for word in ("--unit", unit)]
    assert refused(capsys, "targets.csv", "--robot", "arm6", *options) == [f"error: unit (--unit): {said}"]


def test_a_unit_that_is_given_twice_alike_is_one(folder: Path) -> None:
    (folder / "in_mm.csv").write_text("x,y,z,rz,ry,rx\n-69,0,112,45,-90,-45\n")
    units = ["--unit", "mm", "--unit", "rz=deg", "--unit", "mm"]
    assert run(["ik", "in_mm.csv", "--robot", "arm6", *units]) == 0


def test_without_a_robot(capsys: Captured) -> None:
    (said,) = refused(capsys, "targets.csv")
    assert said == (
        "error: robot (--robot): found none, allowed: a TOML, a URDF or one of arm6, articulated6r,"
        " iiwa14, irb60, irb60-spring, panda, ur3, ur5, ur10, ur3e, ur5e, ur10e, urm4, urm6, urm8"
    )


def test_a_tool_without_a_robot(capsys: Captured) -> None:
    (said,) = refused(capsys, "targets.csv", "--tool", "0,0,0.1")
    assert said == ("error: tool (--tool): found without a robot; --robot NAME|FILE sets one")


def test_all_that_is_wrong_is_told_at_once(capsys: Captured) -> None:
    assert refused(capsys, "nowhere.csv", "--robot", "arm6", "-o", "log.txt") == [
        "error: output (--output): found 'log.txt', allowed: a name that ends in .csv (a joint log) or"
        " .rrd (a"
        " recording)",
        "error: nowhere.csv: found no such file",
    ]


def test_an_unknown_robot(capsys: Captured) -> None:
    (said,) = refused(capsys, "targets.csv", "--robot", "arm66")
    assert said.startswith("error: unknown robot 'arm66' (did you mean arm6?); allowed: arm6, ")


def test_a_start_of_the_wrong_length(capsys: Captured) -> None:
    (said,) = refused(capsys, "targets.csv", "--robot", "arm6", "--start", "0,0,1.57")
    assert said == (
        "error: start (--start): found 3 values, allowed: 6, one for each of theta1, theta2, theta3,"
        " theta4, theta5, theta6"
    )


def test_a_start_beyond_the_limits_of_joints(capsys: Captured) -> None:
    start = "0,-45,0,-135,0,90,2.8974"  # joint 7 ends at 2.8973
    assert refused(capsys, "targets.csv", "--robot", "panda", "--start", start) == [
        "error: start (--start): found panda_joint2 = -45 rad, allowed: -1.7628 to 1.7628 rad; in deg?",
        "error: start (--start): found panda_joint4 = -135 rad, allowed: -3.0718 to -0.0698 rad; in deg?",
        "error: start (--start): found panda_joint6 = 90 rad, allowed: -0.0175 to 3.7525 rad; in deg?",
    ]


FIXED = '<robot name="fixed"><link name="a"/><link name="b"/>{}</robot>'
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="a"/><child link="{2}"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
)


@pytest.mark.parametrize(
    ("joints", "said"),
    [
        (JOINT.format("j", "fixed", "b"), "robot fixed: has no moving joint; at least one is needed"),
        (
            '<link name="c"/>' + JOINT.format("j", "revolute", "b") + JOINT.format("k", "revolute", "c"),
            "found 2 ends with 1 moving joints; --tip-link LINK chooses one: b, c",
        ),
    ],
)
def test_a_robot_that_is_no_arm(capsys: Captured, folder: Path, joints: str, said: str) -> None:
    (folder / "fixed.urdf").write_text(FIXED.format(joints))
    assert refused(capsys, "targets.csv", "--robot", "fixed.urdf") == [f"error: fixed.urdf: {said}"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "targets.csv: found an empty file, allowed: a table with one row per sample"),
        ("x,y,z\n", "targets.csv:1: found a header and no rows, allowed: one row per sample"),
        (
            "t,q1,q2\n0,1,2\n1,2,3\n",
            "targets.csv: found no position in q1, q2, allowed: x, y, z; name them so in the header;"
            ' --map FILE.toml names them: [tcp] position = ["A", "B", "C"]',
        ),
    ],
)
def test_files_without_targets(capsys: Captured, folder: Path, text: str, said: str) -> None:
    (folder / "targets.csv").write_text(text)
    assert refused(capsys, "targets.csv", "--robot", "arm6") == [f"error: {said}"]


def test_a_recording_is_no_table_of_targets(capsys: Captured, folder: Path) -> None:
    assert run(["ik", "targets.csv", "--robot", "arm6", "-q", "-o", "run.rrd"]) == 0
    assert refused(capsys, "run.rrd", "--robot", "arm6") == [
        "error: run.rrd: found a recording, allowed: a table (CSV) of targets"
    ]


def test_targets_in_mm_that_are_read_as_m(capsys: Captured, folder: Path) -> None:
    (folder / "mm.csv").write_text("x,y,z\n-69,0,112\n-70,0,112\n")
    assert run(["ik", "mm.csv", "--robot", "arm6", "--restarts", "0"]) == 1
    assert capsys.readouterr().err == (
        "warning: no unit is given for x, y, z: they are taken as m, though every row is beyond any arm;"
        " --unit mm overrides this\n"
    )
    for units in (["mm"], ["x=mm"], ["m", "x=mm", "y=mm", "z=mm"]):
        given = [word for unit in units for word in ("--unit", unit)]
        assert run(["ik", "mm.csv", "--robot", "arm6", "-q", *given]) == 0


def test_no_row_that_is_a_target(capsys: Captured, folder: Path) -> None:
    (folder / "bad.csv").write_text("x,y,z\nnan,0,0\n0,inf,0.1\n0,0\n")
    assert run(["ik", "bad.csv", "--robot", "arm6"]) == 1
    out, err = capsys.readouterr()
    assert out.splitlines() == [
        "FAIL  bad: arm6 reaches 0 of 3 targets (iterative)",
        "      Not reached: row 1: column x: found no number, allowed: a finite number",
        "      Not reached: row 2: column y: found inf, allowed: a finite number",
        "      Not reached: row 3: found 2 cells, allowed: 3",
    ]
    assert err == ""


def test_a_closed_form_that_there_is_not(capsys: Captured) -> None:
    assert refused(capsys, "targets.csv", "--robot", "urm6", "--method", "closed") == [
        "error: method (--method): robot urm6 has no closed form, allowed: closed for six joints whose"
        " last three"
        " axes meet in a point or whose axes 2, 3 and 4 are parallel, exactly or nearly;"
        " --method iterative searches"
    ]
    assert refused(capsys, "targets.csv", "--robot", "urm6", "--method", "closed", "--tsp", "1") == [
        "error: method (--method): found closed with a path of urm6 that has no closed form, allowed: auto"
    ]


def test_a_method_that_a_path_does_not_take(capsys: Captured) -> None:
    assert refused(capsys, "targets.csv", "--robot", "arm6", "--tsp", "1", "--method", "iterative") == [
        "error: method (--method): found iterative with a path, allowed: auto; --method auto takes the"
        " closed form of"
        " the arm if it has one"
    ]


JOINTS = "allowed: joint values in rad and m, or with units, such as 0,180deg,500mm"


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        (
            "--start",
            "0,a,0,0,0,0",
            f"found '0,a,0,0,0,0', {JOINTS}",
        ),
        (
            "--start",
            "0,nan,0,0,0,0",
            f"found '0,nan,0,0,0,0', {JOINTS}",
        ),
        ("--tsp", "0", "found '0', allowed: a positive time in s, such as 0.005 or 5ms"),
        (
            "--tolerance",
            "norm=3mm",
            "found 'norm=3mm', allowed: a positive length in m, such as 0.0004 or 0.4mm",
        ),
        *(
            (
                "--tolerance",
                value,
                f"found {value!r}, allowed: a positive length in m, such as 0.0004 or 0.4mm",
            )
            for value in ("0", "-1", "nan", "3.5 km", "angle=1deg")
        ),
        ("--restarts", "-1", "found '-1', allowed: a whole number, 0 or more"),
        ("--seed", "-1", "found '-1', allowed: a whole number, 0 or more"),
        ("--method", "magic", "found 'magic', allowed: auto, closed, iterative"),
    ],
)
def test_values_that_make_no_sense(capsys: Captured, option: str, value: str, said: str) -> None:
    lines = refused(capsys, "targets.csv", "--robot", "arm6", option, value)
    assert lines[-1].endswith(said)


def test_errors_as_json(capsys: Captured) -> None:
    assert run(["ik", "targets.csv", "--json"]) == 2
    (error,) = json.loads(capsys.readouterr().out)["errors"]
    assert error["message"].startswith("robot (--robot): found none, allowed: ")


def test_a_robot_among_the_operands_is_told_by_its_option(capsys: Captured) -> None:
    assert refused(capsys, "arm6", "targets.csv") == [
        "error: found targets.csv besides the rest, allowed: urmpipe ik [OPTIONS] TARGETS|PATH; --robot"
        " sets a robot"
    ]
