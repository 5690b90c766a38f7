"""`urmpipe fmu build` and `check`, and `urmpipe.build_fmu`: real FMUs, compiled and run."""

from __future__ import annotations

import json
import re
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from foreign_fmus import HANGS, Foreign, Scalar, fmu, trouble_in
from urmpipe.api.build_fmu import build_fmu
from urmpipe_datasets import LOGS
from urmpipe_fmus.blocks import block_names
from urmpipe_fmus.check import check_fmu
from urmpipe_fmus.native import native_unavailable_reason
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_models.robots.catalogue import load_robot

RunCommand = Callable[..., Any]

PAGE = (Path(__file__).parents[2] / "docs" / "fmu.md").read_text(encoding="utf-8")


def needs_native() -> None:
    """Skip without a C compiler or casadi."""
    missing = native_unavailable_reason()
    if missing:
        pytest.skip(missing)


@pytest.fixture
def meter(tmp_path: Path) -> Path:
    """The FMU of the delta meter."""
    return build_fmu("delta_meter", backend="python", output=tmp_path).path


@pytest.mark.slow
def test_build_writes_the_fmu_and_says_what_is_inside(urmpipe: RunCommand, tmp_path: Path) -> None:
    needs_native()
    ran = urmpipe("fmu", "build", "kinematic_chain", "--robot", "urm6", "--json")
    told = json.loads(ran.out)
    path = tmp_path / "kinematic_chain.fmu"
    assert (ran.code, ran.err) == (0, "")
    assert (told["fmu"], told["unit"]) == ("kinematic_chain.fmu", "kinematic_chain")
    assert told["backend"] == "native"
    assert (told["size"], told["note"]) == (path.stat().st_size, None)
    assert told["size"] < 200_000
    checked = check_fmu(path)
    assert checked.problems == ()
    assert (checked.guid, list(checked.platforms)) == (told["guid"], told["platforms"])
    values = {one.name: one.before for one in checked.variables}
    arm = load_robot("urm6")
    tip = points_over_log(arm, np.array([arm.start]))[0, -1]
    # both evaluate the same products of cosines; C and NumPy may differ in the last bits of a cosine
    found = np.array([values[f"p7[{i}]"] for i in (1, 2, 3)], dtype=np.float64)
    np.testing.assert_allclose(found, tip, rtol=0.0, atol=1e-15)


@pytest.mark.slow
def test_the_same_unit_is_the_same_file(tmp_path: Path) -> None:
    first = build_fmu("repolarizer", options={"joints": 2}, backend="python", output=tmp_path / "a.fmu")
    second = build_fmu("repolarizer", options={"joints": 2}, backend="python", output=tmp_path / "b.fmu")
    other = build_fmu("repolarizer", options={"joints": 3}, backend="python", output=tmp_path / "c.fmu")
    assert first.path.read_bytes() == second.path.read_bytes()
    assert first.guid == second.guid != other.guid
    assert first.path == tmp_path / "a.fmu"


def test_an_fmu_of_ours_is_replaced_and_another_never(urmpipe: RunCommand, meter: Path) -> None:
    before = meter.read_bytes()
    ran = urmpipe("fmu", "build", "delta_meter", "--backend", "python")
    assert (ran.code, meter.read_bytes()) == (0, before)
    assert ran.out.splitlines()[1].startswith("FMU: delta_meter.fmu  (python, ")
    foreign = meter.with_name("foreign.fmu")
    with zipfile.ZipFile(meter) as source, zipfile.ZipFile(foreign, "w") as target:
        for name in source.namelist():
            text = source.read(name)
            described = name == "modelDescription.xml"
            target.writestr(name, text.replace(b'"urmpipe', b'"Dymola') if described else text)
    shutil.copy(foreign, meter)
    ran = urmpipe("fmu", "build", "delta_meter", "--backend", "python")
    said = "found a file that is not an FMU of urmpipe, allowed: a new name, or such an FMU to replace"
    assert (ran.code, ran.err) == (2, f"error: delta_meter.fmu: {said}\n")
    assert meter.read_bytes() == foreign.read_bytes()


def test_an_output_is_never_an_input(tmp_path: Path) -> None:
    unit = tmp_path / "unit.py"
    unit.write_text(example(), encoding="utf-8")
    with pytest.raises(UrmpipeError, match="found no folder, allowed: a folder that exists, or a name that"):
        build_fmu(unit, output=unit)
    shutil.copy(unit, tmp_path / "spring.fmu")
    with pytest.raises(UrmpipeError, match="found a file that is not an FMU of urmpipe"):
        build_fmu(unit, output=tmp_path)
    assert unit.read_text(encoding="utf-8") == example()


@pytest.mark.slow
def test_a_log_is_inside_its_fmu(tmp_path: Path) -> None:
    built = build_fmu("log_source", log=LOGS / "matlab.csv", backend="python", output=tmp_path)
    values = {one.name: one.before for one in check_fmu(built.path).variables}
    first = urmpipe.ingest(LOGS / "matlab.csv", robot="urm6").log.q[0]
    assert [values[f"q[{i}]"] for i in range(1, 7)] == first.tolist()


def test_build_tells_the_warnings_of_a_log(urmpipe: RunCommand, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("q1,q2\n0.5,1\n0.6,2\n", encoding="utf-8")
    ran = urmpipe("fmu", "build", "log_source", "--log", "log.csv", "--backend", "python")
    assert ran.code == 0
    assert "warning: log: no time column: the rows are taken as 5 ms apart" in ran.err


def example() -> str:
    """Return the unit of docs/fmu.md."""
    return PAGE.split("```python\n")[1].split("```")[0]


@pytest.mark.slow
def test_the_unit_of_the_page_is_built_and_runs(urmpipe: RunCommand, tmp_path: Path) -> None:
    (tmp_path / "my_unit.py").write_text(example(), encoding="utf-8")
    ran = urmpipe("fmu", "build", "my_unit.py", "-q")
    assert (ran.code, ran.out, ran.err) == (0, "", "")
    checked = check_fmu(tmp_path / "spring.fmu")
    assert (checked.problems, checked.ran) == ((), True)
    assert [one.name for one in checked.variables if one.causality == "output"] == ["x", "stopped"]


@pytest.mark.slow
def test_what_a_unit_prints_is_no_part_of_the_json(urmpipe: RunCommand, tmp_path: Path) -> None:
    talking = example().replace("spring = BlockModel(", "print('hello')\nspring = BlockModel(")
    talking = talking.replace('lambda v: {"stopped"', "lambda v: print('called') or {\"stopped\"")
    (tmp_path / "my_unit.py").write_text(talking, encoding="utf-8")
    ran = urmpipe("fmu", "build", "my_unit.py", "--backend", "python", "--json")
    assert (ran.code, json.loads(ran.out)["fmu"]) == (0, "spring.fmu")
    assert {"hello", "called"} <= set(ran.err.splitlines())
    system = '[system]\nduration = 0.1\n[blocks.spring]\nfile = "my_unit.py"\nstart = { F = 1.0 }\n'
    (tmp_path / "system.toml").write_text(system, encoding="utf-8")
    ran = urmpipe("simulate", "system.toml", "--backend", "python", "--json")
    assert (ran.code, json.loads(ran.out)["name"]) == (0, "system")


@pytest.mark.slow
def test_check_of_a_sound_fmu_is_0(urmpipe: RunCommand, meter: Path) -> None:
    ran = urmpipe("fmu", "check", meter.name)
    assert (ran.code, ran.err) == (0, "")
    lines = ran.out.splitlines()
    assert lines[1] == "No problem found."
    assert "out_of_tolerance" in ran.out
    assert lines[-1] == "Descriptions: in a terminal of 140 columns, or --json"  # its words would break here
    rows = [line.split()[0] for line in lines if line.strip()]
    assert [one for one in rows if ".." in one] == ["reference[1..3]", "actual[1..3]", "delta[1..3]"]
    told = json.loads(urmpipe("fmu", "check", meter.name, "--json").out)
    assert (told["schema"], told["fmu"], told["problems"]) == (1, "delta_meter.fmu", [])
    assert told["variables"][0] == {
        "name": "tolerance", "causality": "parameter", "variability": "tunable", "type": "Real", "unit": "m",
        "start": "0.0035", "min": 0.0, "max": None, "before": 0.0035, "after": 0.0035,
        "description": "Largest deviation allowed along x, y and z",
    }  # fmt: skip


@pytest.mark.slow
def test_check_of_a_broken_fmu_is_1(urmpipe: RunCommand, meter: Path) -> None:
    broken = meter.with_name("broken.fmu")
    with zipfile.ZipFile(meter) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            text = source.read(name)
            if name == "modelDescription.xml":
                text = text.replace(b'unit="m"', b'unit="furlong"', 1)
            target.writestr(name, text)
    ran = urmpipe("fmu", "check", broken.name, "--json")
    assert ran.code == 1
    assert any("furlong" in one for one in json.loads(ran.out)["problems"])


@pytest.mark.parametrize("content", [b"", b"t,q1\n0,1\n", b"PK\x03\x04"])
def test_check_of_what_is_no_fmu_is_2(urmpipe: RunCommand, tmp_path: Path, content: bytes) -> None:
    (tmp_path / "file.fmu").write_bytes(content)
    ran = urmpipe("fmu", "check", "file.fmu")
    assert (ran.code, ran.out) == (2, "")
    damaged = {b"": "an empty file", b"PK": "a zip that is cut off or damaged"}
    found = damaged.get(content[:2], "no zip, as an FMU is one")
    allowed = "an FMU, such as urmpipe fmu build makes of a unit"
    assert (ran.code, ran.err) == (2, f"error: file.fmu: found {found}, allowed: {allowed}\n")


def test_check_of_a_missing_file_is_2(urmpipe: RunCommand) -> None:
    ran = urmpipe("fmu", "check", "missing.fmu", "--json")
    assert ran.code == 2
    assert json.loads(ran.out)["errors"][0]["file"] == "missing.fmu"


def test_without_casadi_it_is_python_and_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from urmpipe.main import run

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "urmpipe_fmus.native.native_unavailable_reason", lambda platforms=(): "casadi is not installed"
    )
    assert run(["fmu", "build", "delta_meter"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[1].startswith("FMU: delta_meter.fmu  (python, ")
    assert err.startswith("note: delta_meter.fmu runs on Python, as no native one can be built here: casadi")
    said = (
        "backend (--backend): found native, which cannot be built here: casadi is not installed,"
        " allowed: python"
    )
    assert run(["fmu", "build", "delta_meter", "--backend", "native"]) == 2
    assert capsys.readouterr().err == f"error: {said}\n"
    assert run(["simulate", "one-drive", "--backend", "native"]) == 2
    assert capsys.readouterr().err == f"error: {said}\n"


@pytest.mark.slow
def test_units_on_python_are_a_warning_of_the_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "urmpipe_fmus.native.native_unavailable_reason", lambda platforms=(): "casadi is not installed"
    )
    told: list[str] = []
    with pytest.warns(UserWarning, match="the units run on Python"):
        result = urmpipe.simulate("one-drive", duration=0.002, on_message=told.append)
    said = "the units run on Python, a hundred times slower than native ones: casadi is not installed"
    assert [(one.kind, one.message) for one in result.warnings] == [("on-python", said)]
    assert told[0] == said


def test_the_variables_of_a_unit_are_listed(urmpipe: RunCommand) -> None:
    listed = json.loads(urmpipe("fmu", "list", "dc_drive", "--json").out)
    parts = {one["name"]: (one["part"], one["unit"], one["start"]) for one in listed["variables"]}
    assert parts["u"] == ("input, continuous", "V", "0")
    assert parts["Mk"] == ("output, continuous", "N.m", "computed")
    assert parts["C"] == ("parameter, tunable", "N.m/A", "0.05")
    ran = urmpipe("fmu", "list", "kinematic_chain")
    assert (ran.code, ran.err) == (0, "")
    assert "phi[1] .. [6]" in ran.out


def test_start_values_have_six_digits_in_the_table_and_all_in_json(urmpipe: RunCommand) -> None:
    printed = urmpipe("fmu", "list", "kinematic_chain").out
    assert "3.14159 (180" in printed
    assert "0.907571 (52" in printed
    assert not re.search(r"\d\.\d{7}", printed)
    variables = json.loads(urmpipe("fmu", "list", "kinematic_chain", "--json").out)["variables"]
    (tilts,) = [one["start"] for one in variables if one["name"].startswith("tilts")]
    assert tilts == "0.9075712110370514 (52 deg)"


def test_words_of_a_unit_are_joined_by_either_sign(urmpipe: RunCommand, tmp_path: Path) -> None:
    listed = urmpipe("fmu", "list", "dc_drive", "--json").out
    assert urmpipe("fmu", "list", "dc-drive", "--json").out == listed
    example = [urmpipe("fmu", "list", name).out for name in ("kinematic-chain", "kinematic_chain")]
    assert example[0] == example[1]
    assert (
        "These are the variables for urm6. Those for another arm: build it, then urmpipe fmu check"
        in example[0]
    )
    ran = urmpipe("fmu", "build", "delta-meter", "--backend", "python")
    assert (ran.code, [one.name for one in tmp_path.glob("*.fmu")]) == (0, ["delta_meter.fmu"])


def test_a_unit_that_is_none_is_told_with_those_that_are(urmpipe: RunCommand) -> None:
    ran = urmpipe("fmu", "list", "dc-driv")
    names = ", ".join(block_names())
    said = (
        f"unit: found 'dc-driv' (did you mean dc_drive?), allowed: {names}, or a .py file with a unit in it"
    )
    assert (ran.code, ran.out, ran.err) == (2, "", f"error: {said}\n")


def test_what_a_unit_does_not_have_is_told_before_it_is_read(urmpipe: RunCommand) -> None:
    ran = urmpipe("fmu", "build", "dc-drive", "--robot", "urm7", "--log", "missing.csv")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.splitlines() == [
        "error: unit dc_drive: found a robot (urm7), allowed: none, the unit has no such option",
        "error: unit dc_drive: found a log (missing.csv), allowed: none, the unit has no such option",
    ]


def test_what_was_built_is_told_and_a_folder_gets_it(urmpipe: RunCommand, tmp_path: Path) -> None:
    (tmp_path / "blocks").mkdir()
    ran = urmpipe("fmu", "build", "delta_meter", "--backend", "python", "-o", "blocks")
    built, file = ran.out.splitlines()
    said = "Deviation of a point from where it should be, and whether it is tolerated"
    assert built == f"Built delta_meter: {said}"
    assert file.startswith(f"FMU: {Path('blocks', 'delta_meter.fmu')}  (python, linux64, win64, ")
    ran = urmpipe("fmu", "build", "delta_meter", "--backend", "python", "-o", "none")
    allowed = "a folder that exists, or a name that ends in .fmu"
    assert (ran.code, ran.err) == (2, f"error: none: found no folder, allowed: {allowed}\n")


@pytest.mark.slow
def test_no_file_of_the_working_folder_is_taken_for_a_module(
    meter: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (meter.parent / "json.py").write_text("raise RuntimeError('run by mistake')\n", encoding="utf-8")
    monkeypatch.chdir(meter.parent)
    assert check_fmu(meter).problems == ()


@pytest.mark.slow
def test_check_tells_warnings_of_an_fmu_and_is_0_all_the_same(urmpipe: RunCommand) -> None:
    held = Scalar("y", 0, start="0", initial="exact")
    warm = Foreign(name="warm", scalars=(held,), terminate="return fmi2Warning;")
    path = fmu(replace(warm, variable_step=False))
    ran = urmpipe("fmu", "check", path)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.splitlines()[1:3] == ["warning: fmi2Terminate returned fmi2Warning", "No problem found."]
    assert json.loads(urmpipe("fmu", "check", path, "--json").out)["warnings"] == [
        "fmi2Terminate returned fmi2Warning"
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "said"),
    [("exit(0);", "ended the process with the exit code 0"), (HANGS, "did not return within 1 s")],
)
def test_check_of_an_fmu_that_does_not_come_to_its_end_is_1(
    urmpipe: RunCommand, code: str, said: str
) -> None:
    ran = urmpipe(
        "fmu", "check", fmu(replace(trouble_in("free", code), variable_step=False)), "--timeout", "1000ms"
    )
    assert (ran.code, ran.err) == (1, "")
    assert f"problem: fmi2FreeInstance {said}" in ran.out.splitlines()


def test_check_unpacks_nothing_outside_of_its_folder(urmpipe: RunCommand, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "out.fmu", "w") as archive:
        archive.writestr("../out.txt", "")
    ran = urmpipe("fmu", "check", "out.fmu")
    allowed = "paths below the FMU's folder, with / between their parts"
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == f"error: out.fmu: found the path ../out.txt, allowed: {allowed}\n"
