"""`urmpipe demo` goes the whole way: what each of its logs was made with is what its diagnosis names."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from asserting import there
from thinned_logs import lay_thinned_logs
from urmpipe.main import run
from urmpipe_datasets import LOGS
from urmpipe_pipeline.diagnosis.result import Diagnosis


@dataclass(frozen=True)
class Demo:
    """The folder that the demo wrote, and what it printed."""

    folder: Path
    out: str

    def diagnosis(self, name: str) -> Diagnosis:
        """Return the diagnosis of a log, as it was recorded."""
        recorded = urmpipe.read_recording(self.folder / "demo.rrd")
        assert isinstance(recorded, urmpipe.Comparison)
        return there(next(one for one in recorded.runs if one.name == name).diagnosis)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    """What the demo leaves in an empty folder."""
    out = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out):
        patch.chdir(tmp_path_factory.mktemp("demo"))
        assert run(["demo"]) == 0
        return Demo(Path.cwd() / "urmpipe-demo", out.getvalue())


@pytest.mark.slow
def test_the_demo_goes_the_whole_way(demo: Demo) -> None:
    assert sorted(path.name for path in demo.folder.iterdir()) == [
        "coppeliasim.rrd", "counter_rotating.rrd", "demo.rrd", "matlab.rrd", "report.html", "solidworks.rrd",
    ]  # fmt: skip
    assert (demo.folder / "report.html").stat().st_size < 15e6
    assert demo.out.startswith("Four logs of one motion. Three should pass. ")
    *_, as_expected, more, first, second, third, fourth, logs, report, recording = demo.out.splitlines()
    assert as_expected.startswith("All verdicts are as expected: ")
    assert more == "counter-rotating module does not. Why each log deviates:"
    assert [one.split(":")[0].strip() for one in (first, second, third)] == [
        "coppeliasim",
        "matlab",
        "solidworks",
    ]
    assert fourth == "  counter_rotating: module 3 (phi3) counter-rotates: rms 416.57 mm -> 0.0001 mm"
    assert logs == f"Logs:      {LOGS}  (try the commands with them)"
    assert report == f"Report:    {Path('urmpipe-demo', 'report.html')}  (open it in any browser)"
    assert recording.startswith(f"Recording: {Path('urmpipe-demo', 'demo.rrd')}  (open it: ")


@pytest.mark.slow
def test_the_demo_answers_in_json(
    urmpipe: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = lay_thinned_logs(tmp_path / "few")
    monkeypatch.setattr("urmpipe_datasets.LOGS", few)  # the same motion, in fewer rows
    (tmp_path / "urmpipe-demo").mkdir()
    ran = urmpipe("demo", "--json")
    assert ran.code == 0, ran.err
    answer = json.loads(ran.out)
    assert answer["as_expected"] is True
    assert {one["name"]: one["verdict"] for one in answer["runs"]} == {
        "coppeliasim": "pass",
        "matlab": "pass",
        "solidworks": "pass",
        "counter_rotating": "fail",
    }


@pytest.mark.slow
def test_a_module_that_turns_the_other_way(demo: Demo) -> None:
    found = demo.diagnosis("counter_rotating")
    (cause,) = found.causes
    assert (cause.kind, cause.name, cause.joints) == ("joint_sign", "phi3", ("q3",))
    assert found.undecided == ()
    assert (found.verdict, round(1e3 * found.rms, 2)) == ("fail", 416.57)
    assert found.unexplained.rms < 1e-6


@pytest.mark.slow
def test_a_log_that_starts_4_ms_late(demo: Demo) -> None:
    found = demo.diagnosis("matlab")
    (cause,) = found.causes
    assert (cause.kind, found.undecided) == ("time_lag", ())
    assert cause.value[0] == pytest.approx(-4e-3, abs=2e-5)
    assert cause.low[0] < -4e-3 < cause.high[0]
    assert (found.verdict, round(1e3 * found.rms, 2)) == ("pass", 1.61)
    assert found.unexplained.rms < 2e-5


@pytest.mark.slow
def test_a_base_that_stands_elsewhere_and_its_twin(demo: Demo) -> None:
    found = demo.diagnosis("solidworks")
    (cause,) = found.causes
    assert (cause.kind, found.undecided) == ("base_shift", ())
    np.testing.assert_allclose(cause.value, (1.5e-3, -1.2e-3, 1.6e-3), rtol=0, atol=1e-6)
    assert cause.equivalents == ("r1 (z)",)  # the first module stands on the base: its height is the base's
    assert found.unexplained.rms < 1e-6


@pytest.mark.slow
def test_what_a_damped_inverse_leaves_has_no_cause_that_explains_much(demo: Demo) -> None:
    found = demo.diagnosis("coppeliasim")
    told = [*found.causes, *(cause for one in found.undecided for cause in one.causes)]
    assert all(cause.rms_after > 0.8 * cause.rms_before for cause in told)
    assert found.unexplained.rms > 0.9 * found.rms
