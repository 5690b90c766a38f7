"""`urmpipe fmu build` and `check`, and `urmpipe.build_fmu`: real FMUs, compiled and run."""

from __future__ import annotations

import json
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
from urmpipe.systems.units import unit_of
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


def test_the_list_as_json_has_all_digits_and_names_with_either_sign(urmpipe: RunCommand) -> None:
    listed = {name: urmpipe("fmu", "list", name, "--json").out for name in ("dc_drive", "dc-drive")}
    assert listed["dc_drive"] == listed["dc-drive"]
    parts = {one["name"]: one for one in json.loads(listed["dc_drive"])["variables"]}
    assert [parts["Mk"][key] for key in ("part", "unit", "start")] == [
        "output, continuous",
        "N.m",
        "computed",
    ]
    variables = json.loads(urmpipe("fmu", "list", "kinematic_chain", "--json").out)["variables"]
    (tilts,) = [one["start"] for one in variables if one["name"].startswith("tilts")]
    assert tilts == "0.9075712110370514 (52 deg)"
    listed_units = json.loads(urmpipe("fmu", "list", "--json").out)["units"]
    assert tuple(one["name"] for one in listed_units) == block_names()
    options = {one["name"]: [option["name"] for option in one["options"]] for one in listed_units}
    assert options["log_source"] == ["log", "columns", "interpolate"]


@pytest.mark.slow
def test_a_path_is_p_and_a_folder_of_plots_is_one_log() -> None:
    assert unit_of("log_source", log=LOGS / "path.csv").variables[0].names == ("p[1]", "p[2]", "p[3]")
    plots = unit_of("log_source", log=LOGS / "solidworks").table
    assert plots is not None
    assert plots.columns == 6
