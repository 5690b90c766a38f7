"""`urmpipe diagnose`, of one log and of several: what is written, in JSON and in Python."""

from __future__ import annotations

import io
import json
import warnings
import xml.etree.ElementTree as ET
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

import urmpipe
from asserting import refusal, there
from same_results import assert_same
from urmpipe.main import run
from urmpipe_datasets import LOGS
from urmpipe_models.errors import LogError, OptionError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.presenter import remedy_hints
from urmpipe_pipeline.diagnosis.causes import Cause, Unexplained
from urmpipe_pipeline.presentation.section import Advice
from urmpipe_pipeline.results import present

Captured = pytest.CaptureFixture[str]

EVERY = 40
"""Of so many rows of a bundled log one is left: they show the same cause in less time."""

PATH, WRONG, RIGHT = NAMES = "path.csv", "counter_rotating.csv", "matlab.csv"
ARM = ("--robot", "urm6")
ANSWER = "module 3 (phi3) counter-rotates: rms 415.78 mm -> 0.0002 mm"
KEYS = [
    "schema", "name", "verdict", "samples", "coverage", "judged", "unit", "rms", "causes", "undecided",
    "unidentifiable", "recorded_tcp", "origin", "untested", "unexplained", "warnings", "recording",
]  # fmt: skip
CAUSE_KEYS = [
    "kind", "name", "joint", "segment", "axis", "value", "unit", "interval", "from_sample", "rows",
    "equivalents", "rms_before", "rms_after", "rms_alone", "effect", "exceeds_tolerance",
]  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Enter a folder with nothing but a path and two logs."""
    monkeypatch.chdir(tmp_path)
    lay_logs(tmp_path)
    return tmp_path


def lay_logs(folder: Path) -> None:
    """Write a path and two logs."""
    for name in NAMES:
        head, *rows = (LOGS / name).read_text(encoding="utf-8").splitlines(keepends=True)
        (folder / name).write_text("".join([head, *rows[::EVERY]]), encoding="utf-8")


@dataclass(frozen=True)
class Both:
    """What `diagnose` of one log and of two logs prints as JSON, and where it writes."""

    folder: Path
    diagnosed: dict[str, Any]
    compared: dict[str, Any]


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Both:
    """Both commands, run once."""
    folder, printed = tmp_path_factory.mktemp("both"), []
    lay_logs(folder)
    several = ["diagnose", PATH, WRONG, RIGHT, *ARM, "-o", "compared.rrd", "--junit", "verdict.xml"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for line in (["diagnose", PATH, WRONG, *ARM], several):
            with redirect_stdout(io.StringIO()) as out:
                assert run([*line, "--json"]) == 1
            printed.append(json.loads(out.getvalue()))
    return Both(folder, *printed)


def told(capsys: Captured) -> dict[str, Any]:
    """Return the JSON object that was printed."""
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.slow
def test_what_is_written_is_the_comparison_with_its_diagnosis(both: Both) -> None:
    names = ("counter_rotating-diagnosed.rrd", "compared.rrd")
    found, compared = (urmpipe.read_recording(both.folder / name) for name in names)
    assert isinstance(found, Comparison) and isinstance(compared, Comparison)
    assert there(found.runs[0].diagnosis).summary == ANSWER
    assert_same(found.runs[0].diagnosis, compared.runs[0].diagnosis)
    assert run(["report", str(both.folder / names[0]), "-o", "page.html", "-q"]) == 0
    assert "module 3 (phi3) counter-rotates" in Path("page.html").read_text("utf-8")


@pytest.mark.slow
def test_json_has_the_keys_that_are_promised(both: Both, capsys: Captured) -> None:
    found = both.diagnosed
    assert list(found) == KEYS
    assert (found["name"], found["verdict"], found["unit"]) == ("counter_rotating", "fail", "m")
    assert found["recording"] == "counter_rotating-diagnosed.rrd"
    (cause,) = found["causes"]
    assert list(cause) == CAUSE_KEYS
    assert (cause["kind"], cause["name"], cause["joint"]) == ("joint_sign", "phi3", "q3")
    assert cause["value"] is None
    assert [one["message"] for one in found["warnings"]][-1].startswith("no unit is given for x, y, z")
    compared = both.compared["runs"][0]
    same = [key for key in KEYS if key not in ("warnings", "recording")]
    assert {key: compared["diagnosis"][key] for key in same} == {key: found[key] for key in same}
    assert run(["compare", PATH, WRONG, *ARM, "--json"]) == 1
    assert told(capsys)["runs"][0]["diagnosis"] is None


@pytest.mark.slow
def test_junit_has_the_answer_as_a_property(both: Both) -> None:
    suite = there(ET.parse(both.folder / "verdict.xml").getroot().find("testsuite"))
    assert there(suite.find("properties/property[@name='cause']")).get("value") == ANSWER


@pytest.mark.slow
def test_a_finished_comparison_is_diagnosed_as_its_logs_are(capsys: Captured) -> None:
    logs = [RIGHT, WRONG]
    wanted = [one.diagnosis.to_dict() for one in urmpipe.diagnose(PATH, logs, "urm6").runs if one.diagnosis]
    compared = urmpipe.compare(PATH, logs, "urm6", output="made.rrd")
    for finished in (compared, "made.rrd"):
        made = urmpipe.diagnose(finished)
        assert isinstance(made, Comparison)
        assert [one.diagnosis.to_dict() for one in made.runs if one.diagnosis] == wanted
        assert made.verdict == compared.verdict
    two = [urmpipe.ingest(name, "urm6") for name in logs]  # the reference has joints
    (one,), (other,) = (
        urmpipe.diagnose(two[0], [two[1]]).runs,
        urmpipe.diagnose(urmpipe.compare(two[0], two[1])).runs,
    )
    assert there(one.diagnosis).to_dict() == there(other.diagnosis).to_dict()
    capsys.readouterr()
    assert run(["diagnose", "made.rrd", "-q", "-o", "why.rrd", "--junit", "why.xml"]) == 1
    assert capsys.readouterr().err.startswith("FAIL  1 of 2 logs (counter_rotating) out of tolerance")
    assert "module 3 (phi3) counter-rotates" in Path("why.xml").read_text("utf-8")


@pytest.mark.slow
def test_in_python_it_stands_in_its_comparison() -> None:
    with pytest.warns(urmpipe.UrmpipeWarning) as shown:
        found = urmpipe.diagnose(PATH, WRONG, robot="urm6")
    assert [one.filename for one in shown] == [__file__]
    assert found.summary == ANSWER
    assert repr(found) == f"<Diagnosis counter_rotating: {ANSWER}, 1 warning>"
    made = found.comparison
    assert isinstance(made, Comparison)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", urmpipe.UrmpipeWarning)
        compared = urmpipe.compare(PATH, WRONG, robot="urm6")
        assert urmpipe.report(found, "report.html").results == (made,)
    assert made.verdict == compared.verdict
    np.testing.assert_array_equal(made.runs[0].delta, compared.runs[0].delta)
    assert found.to_frame()["name"].tolist() == ["phi3"]


def test_in_python_operands_are_refused_by_their_names() -> None:
    number, listed = cast("tuple[Any, Any]", (3, [1.0]))
    said = refusal(OptionError, urmpipe.diagnose, number, listed)
    assert [line.split(":")[0] for line in said.splitlines()] == ["reference", "logs"]
    assert refusal(LogError, urmpipe.diagnose, PATH, RIGHT).startswith("matlab.csv: no robot")


@pytest.mark.slow
def test_poses_measured_from_outside_are_put_into_their_base_and_tool_first() -> None:
    arm = load_robot("ur5e")
    q = np.array([0.3, -1.2, 1.1, -0.7, -1.5, 0.4]) + np.random.default_rng(1).uniform(-1.0, 1.0, (40, 6))
    position, rotation = poses_over_log(arm, q)
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    seen = (position + rotation @ [0.01, 0.02, 0.1]) @ turned.T + [2.0, 1.0, 0.3]
    header = ",".join([*(f"q{k} [rad]" for k in range(1, 7)), "X [m]", "Y [m]", "Z [m]"])
    np.savetxt("tracker.csv", np.column_stack([q, seen]), "%.9f", ",", header=header, comments="")
    measured = ["X", "Y", "Z"]
    found = urmpipe.diagnose("tracker.csv", robot="ur5e", poses=True, measured=measured)
    assert isinstance(found.comparison, Comparison)
    assert found.comparison.runs[0].alignment.mode == "base+tool"
    assert (found.verdict, found.causes) == ("pass", ())
    assert found.rms < 1e-8  # the digits of the file


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setup", "parameters"),
    [
        ({"tool": (0.003, -0.005, 0.002)}, ["sync", "tool"]),
        ({"base": (0.01, -0.02, 0.03, 0.05, -0.1, 0.02)}, ["sync", "base"]),
        ({"base": (0.3, 0.0, 0.0), "tool": (0.0, 0.01, 0.0, 0.0, 0.4, 0.0)}, ["sync", "base", "tool"]),
        ({"sync": 0.2}, ["sync"]),
    ],
)
def test_what_to_do_removes_the_causes(setup: dict[str, Any], parameters: list[str]) -> None:
    diagnosis = urmpipe.diagnose(PATH, RIGHT, "urm6", unit="rad", **setup)
    (meaning,) = (fact.value for fact in present(diagnosis).body.facts if fact.name == "Meaning")
    assert isinstance(meaning, Advice)
    given = setup | {hint.parameter: hint.value for hint in meaning.hints}
    assert [hint.parameter for hint in meaning.hints] == parameters
    (run,) = urmpipe.compare(PATH, RIGHT, "urm6", unit="rad", **given).runs
    # 4 ms from rows 0.2 s apart lines leave 0.26 mm (4 ms x 196 ms / 2 of 0.65 m/s2), the diagnosis cubics
    assert there(run.statistics["norm"]).rms == pytest.approx(diagnosis.unexplained.rms, abs=2.6e-4)


@pytest.mark.slow
def test_the_unit_of_a_joint_is_an_option(folder: Path) -> None:
    table = pd.read_csv(RIGHT)
    table.assign(q3=np.degrees(table.q3)).to_csv("mixed.csv", index=False)
    (run,) = urmpipe.diagnose(PATH, ["mixed.csv"], "urm6", unit="rad").runs
    cause = Cause("joint_unit", "phi3", ("q3",), value=(np.pi / 180.0,))
    diagnosis = replace(there(run.diagnosis), causes=(cause,), unexplained=Unexplained(0.0))
    (hint,) = remedy_hints(replace(run, diagnosis=diagnosis))
    assert str(hint) == "--unit q3=deg"
    assert isinstance(hint.value, dict)
    right, mixed = (
        urmpipe.compare(PATH, log, "urm6", unit={"": "rad"} | unit).runs[0]
        for log, unit in ((RIGHT, {}), ("mixed.csv", hint.value))
    )
    assert mixed.statistics["norm"].rms == pytest.approx(right.statistics["norm"].rms)
