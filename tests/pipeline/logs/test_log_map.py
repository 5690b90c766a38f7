"""Maps: what is said once about a lab's logs; what was inferred of one log reads the next one."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.errors import OptionError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, format_map, map_of, read_log, read_map

Write = Callable[..., Path]
Read = Callable[..., JointLog]

KUKA = (
    "Zeit;X_Act;Y_Act;Z_Act;A_Act;B_Act;C_Act;A1;A2\n"
    "0;100,5;200;300;10;20;30;-90;10,5\n"
    "12;101;200;300;10;20;30;-89;11\n"
    "24;102;200;300;10;20;30;-88;12\n"
)

MAP = """
delimiter = ";"
decimal = ","
base = [0, 0, 0.8]
tool = [0, 0, 0.15, 0, 0, 1.5]
robot = "arms/arm.toml"

time = "Zeit"
joints = ["A2", "A1"]
names = ["shoulder", "base"]
signs = [1, -1]
offsets = [0, 90]
position = ["X_Act", "Y_Act", "Z_Act"]
orientation = ["A_Act", "B_Act", "C_Act"]
rotation = "zyx"
interval.base = [-180, 180]

[unit]
Zeit = "ms"
A1 = "deg"
A2 = "deg"
X_Act = "mm"
Y_Act = "mm"
Z_Act = "mm"
A_Act = "deg"
B_Act = "deg"
C_Act = "deg"
"""


def test_everything_that_a_map_says(write: Write) -> None:
    said = read_map(write(MAP, "lab.toml"))
    log = read_log([write(KUKA)], said)
    assert log.joints == ("shoulder", "base")
    np.testing.assert_allclose(np.degrees(log.q), [[10.5, 180.0], [11.0, 179.0], [12.0, 178.0]], atol=1e-13)
    assert log.t_ns.tolist() == [0, 12_000_000, 24_000_000]
    assert log.tcp_position is not None
    np.testing.assert_allclose(log.tcp_position[0], [0.1005, 0.2, 0.3], atol=1e-15)
    assert log.rotation_form == "zyx"
    assert log.tcp_rotation is not None
    np.testing.assert_allclose(np.degrees(log.tcp_rotation[0]), [10, 20, 30], atol=1e-13)
    assert said.interval == {"base": (-180.0, 180.0)}
    assert (said.base, said.tool) == ((0, 0, 0.8), (0, 0, 0.15, 0, 0, 1.5))
    assert Path(said.robot or "").parts[-2:] == ("arms", "arm.toml")
    assert Path(said.robot or "").is_absolute()
    assert not log.warnings


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (KUKA, {"unit": {"": "deg", "Zeit": "ms"}}),
        ("0.0 0.1\n0.2 0.3\n0.4 0.6\n", {"unit": {"": "rad"}, "period": 0.01}),
        ("sec,nanosec,q1 [deg],q2 [deg]\n5,0,1,2\n5,5000000,2,3\n", {}),
        ("t [s],q2,q1,qd2,qd1\n0,1,2,0,0\n0.1,1,2,0,0\n0.2,1,2,0,0\n", {"joints": ("q2", "q1")}),
        ("t [s],q1 [deg],qx,qy,qz,qw,x [m],y [m],z [m]\n0,1,0,0,0,1,1,2,3\n0.1,2,0,0,0,1,1,2,3\n", {}),
        ("Time (s),a (deg),b (mm)\n0,1,2\n0.05,2,3\n", {}),
        ('t,"q, ""1""",Gelenk 2\n0,0.1,0.2\n0.1,0.1,0.2\n', {"joints": ('q, "1"', "Gelenk 2")}),
    ],
)
def test_what_was_inferred_reads_the_log_again(text: str, options: dict[str, object], write: Write) -> None:
    path = write(text)
    log = read_log([path], LogMap(**options))  # type: ignore[arg-type]
    said = read_map(write(format_map(map_of(log)), "lab.toml"))
    again = read_log([path], said)
    assert (again.joints, again.units, again.columns) == (log.joints, log.units, log.columns)
    for name in ("t_ns", "q", "qd", "tcp_position", "tcp_rotation"):
        np.testing.assert_array_equal(getattr(again, name), getattr(log, name))
    for doubted in (log, again):  # what is only assumed is not given by its map
        doubts = [(w.kind, w.assumption) for w in doubted.warnings if w.assumption]
        assert doubts == [(w.kind, w.assumption) for w in log.warnings if w.assumption]


def test_a_written_map_has_the_evidence_of_its_entries(write: Write) -> None:
    text = "t [s],q1 [deg],q2,x,y,z\n0,31,2,1,2,3\n0.1,32,3,1,2,3\n"
    log = read_log([write(text)], LogMap(joints=("q1", "q2"), names=("a", "b")))
    lines = format_map(map_of(log, LogMap(joints=("q1", "q2"), names=("a", "b")))).splitlines()
    assert lines[4:] == [
        'delimiter = "comma"  # named: it makes rows of 6 cells',
        'decimal = "point"  # named: with it most cells are numbers',
        'time = "t [s]"  # named: its name',
        'joints = ["q1 [deg]", "q2"]  # given',
        'names = ["a", "b"]',
        'position = ["x", "y", "z"]  # named: their names',
        "",
        "# signs = [1, -1, ...] and offsets = [0, 90, ...] correct the joints: q = sign * value + offset.",
        "# interval.q1 = [-180, 180] is the interval to which the program limits a joint.",
        "",
        "[unit]",
        '"q1 [deg]" = "deg"  # named: its name',
        '"q2" = "deg"  # named: as the other joint columns',
        *(
            f'# "{axis}" = "m"  # assumed: no unit is given for x, y, z: the positions are taken as m'
            for axis in "xyz"
        ),
    ]


def test_robot_and_frames_come_back(write: Write) -> None:
    log = read_log([write("t [s],q1 [rad]\n0,1\n1,2\n")])
    said = read_map(
        write(
            format_map(map_of(log, None, "ur5e", (0.0, 0.0, 0.5), (0.1, 0.2, 0.3, 0.0, 0.5, 0.0))), "lab.toml"
        )
    )
    assert (said.robot, said.base, said.tool) == ("ur5e", (0.0, 0.0, 0.5), (0.1, 0.2, 0.3, 0.0, 0.5, 0.0))


def test_a_map_takes_units(write: Write) -> None:
    text = """
    base = [0, "1cm", "800mm", 0, 0, "90deg"]
    tool = [0, 0, "150mm"]
    time = "none"
    period = "5ms"
    joints = ["q1"]
    interval = {q1 = ["-180deg", "180deg"]}
    """
    said = read_map(write(text, "lab.toml"))
    assert (said.base, said.tool) == ((0.0, 0.01, 0.8, 0.0, 0.0, math.pi / 2), (0.0, 0.0, 0.15))
    assert (said.period, said.interval) == (0.005, {"q1": ("-180deg", "180deg")})
    with pytest.raises(OptionError) as error:
        read_map(write('tool = [0, 0, "15deg"]\nperiod = "5mm"\n', "lab.toml"))
    assert [one.message.partition(": ")[2] for one in error.value.findings[:2]] == [
        "found '15deg', allowed: a finite number",
        "found '5mm', allowed: a time in s, such as 0.005 or 5ms",
    ]


def test_an_empty_map_says_nothing(write: Write) -> None:
    assert read_map(write("", "lab.toml")) == LogMap()


def test_everything_that_is_wrong_with_a_map(write: Write, tmp_path: Path) -> None:
    text = """
delimeter = ";"
tool = [1, 2]
robot = 5
signs = 2
rotation = "zyy"
position = "x"
rows = "0:3"
unit = 5
[clock]
column = "t"
"""
    said = refusal(OptionError, read_map, write(text, "lab.toml")).replace(f"{tmp_path}/", "")
    wrong, unknown = said.split("\n")[:-2], said.split("\n")[-2:]
    assert wrong == [
        "lab.toml: key robot: found 5, allowed: a non-empty text",
        "lab.toml: key tool: found [1.0, 2.0], allowed: X, Y, Z or X, Y, Z, RX, RY, RZ in m and rad",
        "lab.toml: key rows: found '0:3', allowed: rows from 1, both ends included, such as 2:-1 or"
        " 1:99,101:-1; -1 is the last",
        "lab.toml: key signs: found 2, allowed: a list of 1 or -1, such as [1, -1]",
        "lab.toml: key position: found 'x', allowed: columns by name or number, such as q1,q2 or 2,3",
        "lab.toml: key rotation: found 'zyy', allowed: vector, rpy, zyx, xyz, zyz, zxz, quat_xyzw, quat_wxyz,"
        " matrix",
        "lab.toml: key unit: found 5, allowed: a unit of every angle, such as deg, or units by column, such"
        " as q1=deg",
    ]
    assert [one.partition("; allowed: source, robot,")[0] for one in unknown] == [
        "lab.toml: key delimeter: unknown (did you mean delimiter?)",
        "lab.toml: key clock: unknown",
    ]


def test_a_map_that_is_no_toml(write: Write, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"lab.toml:2: not valid TOML: "):
        read_map(write("a = 1\nb = \n", "lab.toml"))
    with pytest.raises(OptionError, match=r"lab2.toml: cannot be read: No such file or directory"):
        read_map(tmp_path / "lab2.toml")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"signs": (1,)}, "signs: found 1, allowed: one for each of the 2 joints"),
        ({"signs": (1, 2)}, "signs: found 2, allowed: 1 or -1"),
        ({"offsets": (1.0,) * 3}, "offsets: found 3, allowed: one for each of the 2 joints"),
        ({"names": ("a", "a")}, "names: found a, a, allowed: a name for each of the 2 joints, each once"),
    ],
)
def test_corrections_that_do_not_fit(
    options: dict[str, object], said: str, wrong: Callable[..., list[str]]
) -> None:
    assert wrong("t [s],q1 [rad],q2 [rad]\n0,1,2\n1,1,2\n", **options) == [said]


def test_a_sign_turns_the_recorded_rates_too(read: Read) -> None:
    text = "t [s],q1 [rad],qd1 [rad/s]\n" + "".join(f"{k / 10},{k / 10},1\n" for k in range(5))
    log = read(text, joints=("q1",), signs=(-1,), offsets=(0.5,))
    np.testing.assert_allclose(log.q[:, 0], 0.5 - np.arange(5) / 10, atol=1e-15)
    assert log.qd is not None
    assert log.qd[:, 0].tolist() == [-1.0] * 5


def test_the_map_of_a_log_of_one_row_has_no_period(write: Write) -> None:
    path = write("q1,q2\n0.5,1.5\n")
    read_again = read_map(write(format_map(map_of(read_log([path]))), "lab.toml"))
    assert (read_again.period, read_log([path], read_again).rows) == (None, 1)


def test_the_map_of_a_log_with_a_file_of_times_reads_both_again(write: Write) -> None:
    files = [write("q1,q2\n0.5,1\n0.4,2\n0.3,3\n", "q.csv"), write("1\n1.005\n1.01\n", "time.csv")]
    log = read_log(files)
    again = read_log(files, read_map(write(format_map(map_of(log)), "lab.toml")))
    assert again.t_ns.tolist() == log.t_ns.tolist() == [0, 5_000_000, 10_000_000]
