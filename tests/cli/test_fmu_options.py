"""What units are made of on the command line: names, robots, logs, options; and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from urmpipe.commands.fmu import option_value
from urmpipe.systems.logs import read_mapped_table, read_table
from urmpipe.systems.units import unit_of
from urmpipe_datasets import LOGS
from urmpipe_fmus.blocks import block_names
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.robots.catalogue import load_robot


def refusal(*arguments: object, **options: object) -> list[str]:
    """Return all that is wrong with a unit."""
    with pytest.raises(UrmpipeError) as error:
        unit_of(*arguments, **options)  # type: ignore[arg-type]
    return [str(one) for one in error.value.findings]


def test_the_list_has_every_unit_and_its_options(urmpipe: Any) -> None:
    ran = urmpipe("fmu", "list", "--json")
    assert (ran.code, ran.err) == (0, "")
    listed = {one["name"]: one for one in json.loads(ran.out)["units"]}
    assert tuple(listed) == block_names()
    assert [one["name"] for one in listed["log_source"]["options"]] == ["log", "columns", "interpolate"]
    table = urmpipe("fmu", "list").out
    assert all(name in table for name in block_names())
    assert "--robot" in table
    assert "-s joints=" in table


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("6", 6),
        ("0.5", 0.5),
        ("true", True),
        ("held", "held"),
        ('"p7"', "p7"),
        ('["p6", "p7"]', ["p6", "p7"]),
        ("p6, p7", ["p6", "p7"]),
        ("", ""),
        ("= 1", "= 1"),
    ],
)
def test_a_value_is_what_toml_has_or_words(text: str, value: object) -> None:
    assert option_value(text) == value


def test_a_log_is_its_rows_in_si_from_its_start(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t [ms],q1 [deg],q2 [deg]\n5,180,0\n10,170,-90\n", encoding="utf-8")
    found = read_table(path)
    assert found.columns == (("q", "rad", 2),)
    np.testing.assert_array_equal(found.table.t_ns, [0, 5_000_000])
    # one product of two doubles: a unit in the last place
    np.testing.assert_allclose(found.table.values, np.radians([[180.0, 0.0], [170.0, -90.0]]), rtol=2.3e-16)


@pytest.mark.slow
def test_a_path_is_p_and_a_folder_of_plots_is_one_log() -> None:
    assert unit_of("log_source", log=LOGS / "path.csv").variables[0].names == ("p[1]", "p[2]", "p[3]")
    plots = unit_of("log_source", log=LOGS / "solidworks").table
    assert plots is not None
    assert plots.columns == 6


def test_joints_that_slide_are_apart_from_those_that_turn(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,q1 [deg],q2 [mm],q3 [deg]\n0,180,1000,90\n1,170,2000,80\n", encoding="utf-8")
    found = read_table(path)
    assert found.columns == (("q", "rad", 2), ("s", "m", 1))
    # one product of two doubles: a unit in the last place
    np.testing.assert_allclose(found.table.values[0], [np.pi, np.pi / 2, 1.0], rtol=2.3e-16)


def test_columns_of_any_table_are_variables_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("t,u (V),i (A)\n0,1,2\n1,3,4\n", encoding="utf-8")
    unit = unit_of("log_source", log=path, options={"columns": ["i", "u"]})
    assert [(one.name, one.unit, one.size) for one in unit.variables] == [("i", "A", None), ("u", "V", None)]
    assert unit.table is not None
    np.testing.assert_array_equal(unit.table.values, [[2.0, 1.0], [4.0, 3.0]])


def test_a_row_without_a_value_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q2\n0,1,2\n1,,2\n2,1,2\n", encoding="utf-8")
    assert refusal("log_source", log=path) == [
        f"{path}, row 2, column q[1]: found 1 row without a value, allowed: one in every row"
    ]


def test_a_unit_says_what_it_lacks() -> None:
    assert refusal("kinematic_chain") == [
        "unit kinematic_chain: found no robot; --robot NAME|FILE sets one, in a system file robot = ..."
    ]
    assert refusal("log_source") == [
        "unit log_source: found no log; --log LOG sets one, in a system file log = ..."
    ]
    assert refusal("repolarizer") == [
        "unit repolarizer: option joints: not found, it needs the number of joints, such as 6"
    ]


def test_a_unit_refuses_what_it_does_not_take() -> None:
    assert refusal("delta_meter", robot="urm6", log="log.csv") == [
        "unit delta_meter: found a robot (urm6), allowed: none, the unit has no such option",
        "unit delta_meter: found a log (log.csv), allowed: none, the unit has no such option",
    ]
    assert refusal("repolarizer", options={"joints": 6, "turns": 2}) == [
        "unit repolarizer: option turns: found, allowed: joints; a parameter is set where the unit runs, in a"
        " system by start = { turns = ... }, in another tool as the FMU's start value"
    ]
    assert refusal(unit_of("delta_meter"), options={"joints": 6}) == [
        "unit delta_meter: found joints, allowed: no options, it is complete"
    ]


def test_a_chain_is_taken_as_a_robot() -> None:
    arm = load_robot("urm4")
    unit = unit_of("kinematic_chain", robot=arm)
    assert unit.inputs[0].starts == tuple(arm.start)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("kinematic_chan",),
            "unit: found 'kinematic_chan' (did you mean kinematic_chain?), allowed: kine",
        ),
        (("kinematic_chain", "--robot", "urm7"), "unknown robot 'urm7' (did you mean urm8?)"),
        (
            ("repolarizer", "-s", "joints=nan"),
            "repolarizer: option joints: found nan, allowed: an integer",
        ),
        (("repolarizer", "-s", "joints"), "found 'joints', allowed: NAME=VALUE, each name once"),
        (("repolarizer", "-s", "joints=6", "-s", "joints=7"), "found 'joints=7', allowed: NAME=VALUE"),
        (
            ("delta_meter", "--platforms", "amiga", "--platforms", "linux64"),
            "found amiga, allowed: linux64, win64",
        ),
        (("delta_meter", "--platforms", "linux64,amiga"), "found amiga, allowed: linux64, win64"),
        (("log_source", "--log", "missing.csv"), "missing.csv: found no such file"),
        (("missing.py",), "missing.py"),
        (("delta_meter", "--map", "lab.toml"), "map (--map): found without a log; --log LOG sets one"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(
    urmpipe: Any, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    ran = urmpipe("fmu", "build", *arguments)
    assert (ran.code, ran.out) == (2, "")
    assert said in ran.err
    assert "Traceback" not in ran.err
    assert list(tmp_path.iterdir()) == []


def test_a_unit_is_told_what_a_map_says_of_its_log(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q2\n0,1,2\n1,1.1,2.1\n", encoding="utf-8")
    *_, warning = (one for one in read_mapped_table(path).warnings if one.kind == "assumed-unit")
    written = "--map FILE.toml from urmpipe ingest --unit {} --write-map FILE.toml"
    assert str(warning).endswith(f"; {written.format('deg')} overrides this")
    path.write_text("time,q1,q2\n0,1,2\n1000,1,2\n2000,1,2\n", encoding="utf-8")
    (said,) = refusal("log_source", log=path)
    assert f"; {written.format('time=ms')} specifies it" in said
    (tmp_path / "lab.toml").write_text('[units]\ntime = "ms"\n', encoding="utf-8")
    table = read_mapped_table(path, log_map=tmp_path / "lab.toml").table
    assert table.t_ns.tolist() == [0, 10**9, 2 * 10**9]
