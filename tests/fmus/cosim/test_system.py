"""A system file says what it means, and all that is wrong with it at once."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from asserting import refusal
from urmpipe_fmus.cosim import LogInput, Port, load_system, read_system, system_names, system_text
from urmpipe_models.errors import CosimulationError, Hint

WHOLE = """
[system]
name = "two"
description = "Two blocks"
step = 0.001
duration = 2
record_every = 5

[arguments]
log = "run.csv"
k = 2500.0
joints = 6
held = false

[blocks.source]
unit = "log_source"
log = "$log"
columns = ["$log", "u"]

[blocks.plant]
file = "plant.py"
joints = "$joints"
start = { k = "$k", "theta[1]" = 3.14 }

[blocks.other]
fmu = "sub/other.fmu"

[connections]
"plant.phi" = "source.q"
other.u = "plant.y"

[inputs]
"plant.u" = { log = "$log", column = "u", interpolate = "$held" }

[loops]
iterate = true
tolerance = 1e-6
"""


ELSE = "; all else is changed in the system's file"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "sub").mkdir()
    for name in ("run.csv", "plant.py", "sub/other.fmu"):
        (tmp_path / name).write_text("")
    (tmp_path / "two.toml").write_text(WHOLE)
    return tmp_path


def said(path: Path, text: str, **arguments: str) -> list[str]:
    path.write_text(text)
    with pytest.raises(CosimulationError) as caught:
        load_system(path, arguments)
    return [f"{finding.about}: {finding.message}" for finding in caught.value.findings]


def test_a_whole_file_is_read(folder: Path) -> None:
    system = load_system(folder / "two.toml")
    assert (system.name, system.description) == ("two", "Two blocks")
    assert (system.step, system.duration) == (0.001, 2.0)
    assert (system.record_every, system.iterate, system.tolerance) == (5, True, 1e-6)
    source, plant, other = system.blocks
    assert (source.unit, source.kind) == ("log_source", "log_source")
    assert (plant.file, plant.kind, other.fmu) == (folder / "plant.py", "plant.py", folder / "sub/other.fmu")
    assert plant.options == {"joints": 6}
    assert plant.start == {"k": 2500.0, "theta[1]": 3.14}
    links = [f"{link.destination} = {link.source}" for link in system.connections]
    assert links == ["plant.phi = source.q", "other.u = plant.y"]
    assert system.inputs == (
        LogInput(destination=Port("plant", "u"), log=str(folder / "run.csv"), column="u", interpolate=False),
    )
    assert source.options == {"log": str(folder / "run.csv"), "columns": [str(folder / "run.csv"), "u"]}


def test_names_of_units_and_columns_are_no_files(folder: Path) -> None:
    for name in ("log_source", "u"):
        (folder / name).touch()
    system = load_system(folder / "two.toml")
    assert system.blocks[0].unit == "log_source"
    assert system.inputs[0].column == "u"


def test_an_argument_is_left_as_it_is_given_and_of_its_defaults_type(folder: Path) -> None:
    system = load_system(folder / "two.toml", {"log": "run.csv", "k": "3", "joints": "4", "held": "true"})
    source, plant, _ = system.blocks
    assert source.options["log"] == "run.csv"  # the working folder's, not the one beside the system file
    assert plant.start["k"] == 3.0
    assert plant.options == {"joints": 4}
    assert system.inputs[0].interpolate is True
    assert system.arguments == {"log": "run.csv", "k": 3.0, "joints": 4, "held": True}


def test_everything_that_is_wrong_is_told_at_once(tmp_path: Path) -> None:
    text = """
surprise = 1
[system]
name = 5
step = 0.0
durations = 2.0
record_every = 1.5
[arguments]
log = "run.csv"
[blocks.a]
unit = "gain"
fmu = "none.fmu"
[blocks.b]
[blocks."c.d"]
unit = "x"
start = 3
[blocks.e]
fmu = "none.fmu"
robot = "urm6"
[blocks.f]
unit = "$lag"
[blocks]
g = 3
[connections]
"a.u" = "z.y"
"a" = "b.y"
"a.v" = 7
[inputs]
"a.w" = { log = "$log", colunm = "u" }
"a.x" = 1
"a.y" = { log = "", column = "u" }
[loops]
iterate = 1
tolerance = -1.0
"""
    assert said(tmp_path / "bad.toml", text, speed="3") == [
        f"argument speed: found 'speed', allowed: log{ELSE}",
        "blocks.f.unit: found '$lag' (did you mean $log?), allowed: $log ([arguments] names them)",
        "system.name: found 5, allowed: a text",
        'system.step: found 0.0, allowed: a time above 0 in s, or with its unit as in "1ms"',
        "system.record_every: found 1.5, allowed: an integer from 1",
        "system.durations: unknown (did you mean duration?); allowed: name, description, step, duration,"
        " record_every",
        "blocks.g: found 3, allowed: a table",
        "blocks.a: found unit and fmu, allowed: one of unit, file, fmu",
        "blocks.a.fmu: found 'none.fmu', allowed: a file that is there",
        "blocks.b: found none of them, allowed: one of unit, file, fmu",
        "blocks.c.d: found 'c.d' as a name, allowed: a letter, then letters, digits, _, -",
        "blocks.c.d.start: found 3, allowed: a table",
        "blocks.e.fmu: found 'none.fmu', allowed: a file that is there",
        "blocks.e.robot: unknown; allowed: fmu, start",
        "connections.a.u: block found 'z', allowed: a, b, c.d, e, f",
        "connections.a: found 'a', allowed: block.variable",
        "connections.a.v: found 7, allowed: its source as 'block.variable'",
        "inputs.a.w.column: found nothing, allowed: a text",
        "inputs.a.w.colunm: unknown (did you mean column?); allowed: log, column, interpolate",
        "inputs.a.x: found 1, allowed: { log = FILE, column = NAME }",
        "inputs.a.y.log: found '', allowed: a text that is not empty",
        "loops.iterate: found 1, allowed: true or false",
        "loops.tolerance: found -1.0, allowed: a number above 0",
        "surprise: unknown; allowed: system, arguments, blocks, connections, inputs, loops",
    ]


def test_arguments_must_be_of_their_defaults_type(folder: Path) -> None:
    assert said(folder / "two.toml", WHOLE, k="fast", held="maybe", lock="run.csv") == [
        "argument k: found 'fast', allowed: a number, like 2500.0",
        "argument held: found 'maybe', allowed: true, false, like False",
        f"argument lock: found 'lock', allowed: log, k, joints, held{ELSE}",
    ]


def test_an_argument_that_a_shipped_system_lacks_is_told_with_how_to_change_its_file() -> None:
    with pytest.raises(CosimulationError) as caught:
        load_system("one-drive", {"u": "3"})
    (found,) = caught.value.findings
    assert (found.file, found.about) == ("one-drive", "argument u")
    assert found.hints == (Hint("write_system", None, "makes a copy of it"),)
    assert found.format("command line").endswith(f"{ELSE}; --write-system FILE.toml makes a copy of it")


def test_words_of_a_system_and_of_its_units_are_joined_by_either_sign(tmp_path: Path) -> None:
    assert load_system("one_drive") == load_system("one-drive")
    assert system_text("one_drive") == system_text("one-drive")
    (tmp_path / "a.toml").write_text('[blocks.a]\nunit = "dc-drive"\n', encoding="utf-8")
    assert load_system(tmp_path / "a.toml").blocks[0].unit == "dc_drive"


@pytest.mark.parametrize("value", ["inf", "nan", "true", '"1mm"', "-0.1"])
def test_a_step_is_a_finite_number_above_zero(tmp_path: Path, value: str) -> None:
    text = f'[system]\nstep = {value}\n[blocks.a]\nunit = "x"\n'
    (found,) = said(tmp_path / "bad.toml", text)
    assert found.startswith("system.step: found ")
    assert found.endswith(', allowed: a time above 0 in s, or with its unit as in "1ms"')


@pytest.mark.parametrize(
    ("told", "step"),
    [("0.005", 0.005), ('"5ms"', 0.005), ('"5 ms"', 0.005), ('".5 s"', 0.5), ('"20us"', 2e-5)],
)
def test_a_step_is_told_in_s_or_with_its_unit(tmp_path: Path, told: str, step: float) -> None:
    (tmp_path / "a.toml").write_text(f'[system]\nstep = {told}\n[blocks.a]\nunit = "x"\n', encoding="utf-8")
    assert load_system(tmp_path / "a.toml").step == pytest.approx(step, rel=1e-15)  # a product's rounding


LINES = [
    """# a system
[system]
step = 0  # 3: system.step
[blocks.a]
unit = "x"
start = 3  # 6: blocks.a.start
[blocks."b c"]  # 7: blocks.b c
unit = "x"
[connections]
"a.u" = "z.y"  # 10: connections.a.u
a.v = 7  # 11: connections.a.v
""",
    """system.step = 0  # 1: system.step
[blocks]
a = { unit = "x", fmu = "y" }  # 3: blocks.a, 3: blocks.a.fmu
b.unit = "x"
b.start.k = 1
c.start = 3  # 6: blocks.c, 6: blocks.c.start
[connections]
a.u = 7  # 8: connections.a.u
""",
]


@pytest.mark.parametrize("text", LINES, ids=["tables", "dotted keys"])
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    faults = read_system(path).faults
    assert {fault.file for fault in faults} == {str(path)}
    places = [f"{fault.line}: {fault.about}" for fault in faults]
    assert places == re.findall(r"(?<=[#,] )\d+: [^,\n]+", text)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("[blocks.a]\n[system\n", 2, "not valid TOML: Expected ']' at the end of a table declaration"),
        (
            "[blocks.a]\nunit = dc_drive\n",
            2,
            'Invalid value (at line 2, column 8); a text needs quotes: unit = "dc_drive"',
        ),
    ],
)
def test_what_is_no_toml_is_told_with_its_line(tmp_path: Path, text: str, line: int, message: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CosimulationError) as caught:
        load_system(path)
    (fault,) = caught.value.findings
    assert (fault.file, fault.line) == (str(path), line)
    assert message in fault.message


def test_what_is_no_system_file_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drive.fmu").write_bytes(b"PK\xff")
    names = f"a TOML file, or one of {', '.join(system_names())}"
    Path("bad.toml").touch()
    for name, message in (
        (
            "drive.fmu",
            "drive.fmu: found an FMU, allowed: a TOML file in which it is a block, [blocks.NAME] fmu ="
            " 'drive.fmu'",
        ),
        ("no-such-system", f"system: found 'no-such-system', allowed: {names}"),
        ("bed.toml", f"system: found 'bed.toml' (did you mean bad.toml?), allowed: {names}"),
    ):
        assert refusal(CosimulationError, load_system, name) == message
    assert refusal(CosimulationError, system_text, "one-drve") == (
        f"system: found 'one-drve' (did you mean one-drive?), allowed: one of {', '.join(system_names())}"
    )
    assert said(Path("bad.toml"), "blocks = 3\n[system]\nstep = 1\n") == [
        "blocks: found 3, allowed: a table",
        "blocks: found none, allowed: at least one [blocks.NAME]",
    ]


@pytest.mark.parametrize("name", system_names())
def test_shipped_systems_are_read_and_named_as_their_files(name: str) -> None:
    system = load_system(name)
    assert (system.name, system.path.stem) == (name, name)
    assert system.description
    assert name != "log-to-delta" or system.step is None  # that of the log
