"""Checking FMUs: good ones, ones of other tools, ones that fail, crash or hang, and files that are none."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from asserting import refusal
from foreign_fmus import STAIR, Foreign, Scalar, copy_changed, fmu, gain, trouble_in
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.build.fmu import build_fmu, cached_fmu
from urmpipe_fmus.check import check_fmu
from urmpipe_fmus.fmu_file import write_fmu
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.native import native_unavailable_reason, this_platform
from urmpipe_models.errors import FmuError

Make = Callable[..., BlockModel]
BACKENDS = ["python", "native"]


def built(model: BlockModel, folder: Path, backend: str = "python") -> Path:
    missing = native_unavailable_reason([this_platform()])
    if backend == "native" and missing:
        pytest.skip(f"needs the native backend: {missing}")
    if backend == "native":
        return Path(shutil.copy(cached_fmu(model, "native"), folder))
    return build_fmu(model, folder, backend=backend).path  # type: ignore[arg-type]


def changed(path: Path, old: str, new: str) -> Path:
    """The FMU with another model description."""
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    described = files["modelDescription.xml"].decode()
    assert old in described
    write_fmu(path, files | {"modelDescription.xml": described.replace(old, new).encode()})
    return path


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_good_fmu_has_no_problems_and_its_values_are_those_of_an_instance(
    model: BlockModel, tmp_path: Path, backend: str
) -> None:
    found = check_fmu(built(model, tmp_path, backend))
    instance = Instance(model)
    everything = range(len(model.scalars))
    before = [float(one) for one in instance.get(everything)]
    for k in range(found.steps):
        instance.do_step(k * found.step, found.step)
    assert (found.problems, found.ran, found.name) == ((), True, model.name)
    assert [one.name for one in found.variables] == [name for name, _ in model.scalars]
    # Native code may round the last bit of a function of the C library otherwise than NumPy.
    assert [one.before for one in found.variables] == pytest.approx(before, rel=1e-14, abs=1e-15)
    after = [float(one) for one in instance.get(everything)]
    assert [one.after for one in found.variables] == pytest.approx(after, rel=1e-13, abs=1e-15)


@pytest.mark.slow
def test_what_was_found_goes_into_json(make: Make, tmp_path: Path) -> None:
    path = built(make("playback"), tmp_path)
    found = json.loads(json.dumps(check_fmu(path).to_dict(), allow_nan=False))
    assert found["path"] == str(path)
    assert (found["step"], found["steps"], found["problems"], found["ran"]) == (0.1, 3, [], True)
    assert found["platforms"] == ["linux64", "win64"]
    assert found["variables"][2] == {
        "name": "between",
        "causality": "output",
        "variability": "continuous",
        "type": "Real",
        "unit": "m",
        "start": "",
        "min": None,
        "max": None,
        "before": 0.5,
        "after": 1.5,
        "description": "The second column, interpolated",
    }


FOREIGN = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Integer, Real, String
class Foreign(Fmi2Slave):
    def __init__(self, **options):
        super().__init__(**options)
        self.x, self.n, self.s = 0.0, 3, "text"
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Integer("n", causality=Fmi2Causality.output))
        self.register_variable(String("s", causality=Fmi2Causality.output))
    def do_step(self, time, step):
        self.x += step
        return True
"""


@pytest.mark.slow
def test_an_fmu_of_another_tool_is_checked_too(tmp_path: Path) -> None:
    (tmp_path / "foreign.py").write_text(FOREIGN)
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", "foreign.py"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    found = check_fmu(tmp_path / "Foreign.fmu")
    assert found.ran
    assert found.problems == (
        'The variable "n" (line 15) is of type Integer and must have variability != "continuous".',
        'The variable "s" (line 18) is of type String and must have variability != "continuous".',
        "ModelStructure/InitialUnknowns does not contain the expected set of variables. Expected {n, s, x}"
        " but was {}.",
    )
    assert [one.before for one in found.variables] == [0.0, 3, "text"]
    assert [one.after for one in found.variables] == [pytest.approx(20 * 0.005, rel=1e-14), 3, "text"]


@pytest.mark.slow
def test_files_of_the_working_folder_are_no_modules(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = built(make("arm"), tmp_path)
    (tmp_path / "json.py").write_text("raise SystemExit(9)", encoding="ascii")
    monkeypatch.chdir(tmp_path)
    assert check_fmu(path).problems == ()


def test_outputs_that_are_not_finite_are_a_problem_with_their_time() -> None:
    odd = Foreign(
        name="odd",
        scalars=(Scalar("y", 0), Scalar("z", 1), Scalar("x", 2, "local")),
        compute="v->r[0] = NAN; v->r[1] = v->time > 0.05 ? -INFINITY : 1; v->r[2] = NAN;",
        variable_step=False,
    )
    found = check_fmu(fmu(odd))
    assert found.problems[-2:] == (
        "at 0 s: found y = nan, allowed: outputs that are finite",
        "at 0.055 s: found z = -inf, allowed: outputs that are finite",
    )
    assert found.ran
    assert [(one.before, one.after) for one in found.variables] == [(None, None), (1.0, None), (None, None)]


@pytest.mark.slow
def test_a_run_that_the_fmu_ends_early_is_no_pass_and_its_values_are_those_of_its_last_time() -> None:
    report = check_fmu(fmu(replace(STAIR, start="m->v.r[0] = 0.0275;", variable_step=False)))
    said = "fmi2DoStep at 0.025 s ended the run (fmi2Discard, terminated) after 5 of 20 steps"
    assert (report.problems[1:], report.ran, report.variables[1].after) == ((said,), False, 0.0275)
    discards = trouble_in("step", "if (t > 0.022) return fmi2Discard;")
    (said,) = check_fmu(fmu(replace(discards, variable_step=False))).problems[1:]
    assert said == "fmi2DoStep at 0.025 s: fmi2DoStep failed with status 2 (discard)."


@pytest.mark.slow
def test_warnings_of_an_fmu_are_reported_and_are_no_problem() -> None:
    warm = 'if (t > 0.022) { LOG(m, fmi2Warning, "warm"); v->time = t + h; return fmi2Warning; }'
    for call, code, warning in (
        ("step", warm, "fmi2DoStep at 0.025 s returned fmi2Warning, and 14 more of its calls; its log: warm"),
        ("terminate", "return fmi2Warning;", "fmi2Terminate returned fmi2Warning"),
    ):
        report = check_fmu(fmu(replace(trouble_in(call, code), variable_step=False)))
        assert (report.problems[1:], report.ran, report.warnings) == ((), True, (warning,))


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["Jürgen", "100% sure", "a#b", "a%20b"])
def test_a_python_fmu_is_not_run_where_its_binary_would_crash(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    path = build_fmu(make("arm"), tmp_path, backend="python").path
    (tmp_path / folder).mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / folder))
    found = check_fmu(path)
    [problem] = found.problems
    run_in = rf"{re.escape(str(tmp_path / folder))}/urmpipe-check-\w+"
    assert re.fullmatch(
        rf"a Python FMU cannot run in {run_in}: pythonfmu reads of its address plain letters, digits,"
        r" - \. _ ~ and spaces only; allowed: another folder for temporary files \(TMPDIR, on Windows TEMP\),"
        r" or a native FMU",
        problem,
    )
    assert not found.ran
    assert [one.before for one in found.variables] == [None] * len(found.variables)


@pytest.mark.slow
def test_a_python_fmu_runs_in_a_folder_with_spaces(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "with a space").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "with a space"))
    assert check_fmu(build_fmu(make("arm"), tmp_path, backend="python").path).problems == ()


@pytest.mark.slow
def test_a_wrong_guid_is_told_with_what_the_fmu_logged(make: Make, tmp_path: Path) -> None:
    path = built(make("arm"), tmp_path, "native")
    found = check_fmu(changed(path, 'guid="{', 'guid="{0'))
    assert found.problems[0] == "fmi2Instantiate: Failed to instantiate model"
    assert found.problems[1].startswith("its log: unit arm: GUID: found {0")


@pytest.mark.slow
def test_problems_of_the_description_are_told_and_it_runs_all_the_same(make: Make, tmp_path: Path) -> None:
    path = built(make("spring"), tmp_path)
    found = check_fmu(changed(path, '<Unit name="kg">', '<Unit name="kilo">'))
    assert found.problems == ('The unit "kg" of variable "m" (line 40) is not defined.',)
    assert found.ran
    found = check_fmu(changed(path, '<Unit name="m">', '<Unit name="metre">'))
    assert found.problems == ("the validation ended with KeyError: 'm'",)
    assert found.ran


def test_without_a_binary_for_this_platform_it_is_not_run(make: Make, tmp_path: Path) -> None:
    other = "win64" if this_platform() == "linux64" else "linux64"
    path = build_fmu(make("arm"), tmp_path, backend="python", platforms=[other]).path
    found = check_fmu(path)
    assert found.problems == (
        f"found binaries for {other}, allowed for a run here: {this_platform()}; it was not run",
    )
    assert (found.ran, found.variables[0].before, found.variables[0].start) == (False, None, "0.1")


CO_SIMULATION = "FMI 2.0 for co-simulation, as most tools export it, too"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b'fmiVersion="2.0"', b'fmiVersion="3.0"', f"found FMI 3.0, allowed: {CO_SIMULATION}"),
        (b'fmiVersion="2.0"', b"", f"found no version of FMI, allowed: {CO_SIMULATION}"),
        (b"CoSimulation", b"ModelExchange", f"found no FMU for co-simulation, allowed: {CO_SIMULATION}"),
    ],
)
def test_fmus_of_other_kinds_are_refused_with_what_is_allowed(
    tmp_path: Path, old: bytes, new: bytes, said: str
) -> None:
    path = tmp_path / "other.fmu"
    copy_changed(fmu(gain()), path, "modelDescription.xml", lambda data: data.replace(old, new))
    assert refusal(FmuError, check_fmu, path) == f"{path}: {said}"


def test_files_that_are_no_fmus_are_refused_with_their_name(tmp_path: Path) -> None:
    missing, text, empty = (tmp_path / name for name in ("missing.fmu", "text.fmu", "empty.fmu"))
    text.write_text("no zip")
    write_fmu(empty, {"readme.txt": b""})
    broken = copy_changed(fmu(gain()), tmp_path / "broken.fmu", "modelDescription.xml", lambda _: b"<a>")
    allowed = ", allowed: an FMU, such as urmpipe fmu build makes of a unit"
    for path, said in (
        (missing, f"found no such file{allowed}"),
        (tmp_path / "text.zip", f"found no such file (did you mean {text}?){allowed}"),
        (tmp_path, f"found a folder{allowed}"),
        (text, f"found no zip, as an FMU is one{allowed}"),
        (empty, f"found a zip without modelDescription.xml{allowed}"),
    ):
        assert refusal(FmuError, check_fmu, path) == f"{path}: {said}"
    first, _, last = refusal(FmuError, check_fmu, broken).rpartition("; ")
    assert first.startswith(f"{broken}: modelDescription.xml cannot be read: no element found: line")
    assert last == "allowed: XML as FMI 2.0 has it"
