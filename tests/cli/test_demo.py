"""`urmpipe demo` goes the whole way: what each of its logs was made with is what its diagnosis names."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from asserting import there
from thinned_logs import lay_thinned_logs
from urmpipe.main import run
from urmpipe_datasets import LOGS


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder that the demo wrote, and what it printed."""
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()) as out:
        patch.chdir(tmp_path_factory.mktemp("demo"))
        assert run(["demo"]) == 0
        return Path.cwd() / "urmpipe-demo", out.getvalue()


@pytest.mark.slow
def test_the_demo_goes_the_whole_way(demo: tuple[Path, str]) -> None:
    assert sorted(path.name for path in demo[0].iterdir()) == [
        "coppeliasim.rrd", "counter_rotating.rrd", "demo.rrd", "matlab.rrd", "report.html", "solidworks.rrd",
    ]  # fmt: skip
    assert (demo[0] / "report.html").stat().st_size < 15e6
    assert demo[1].startswith("Four logs of one motion. Three should pass. ")
    *_, as_expected, more, first, second, third, fourth, logs, report, recording = demo[1].splitlines()
    assert as_expected.startswith("All verdicts are as expected: ")
    assert more == "counter-rotating module does not. Why each log deviates:"
    assert [one.split(":")[0].strip() for one in (first, second, third)] == [
        "coppeliasim",
        "matlab",
        "solidworks",
    ]
    assert fourth == "  counter_rotating: module 3 (phi3) has a reversed sign: rms 416.57 mm -> 0.0001 mm"
    assert logs == f"Logs:      {LOGS}  (try the commands with them)"
    assert report == f"Report:    {Path('urmpipe-demo', 'report.html')}  (open it in any browser)"
    assert recording.startswith(f"Recording: {Path('urmpipe-demo', 'demo.rrd')}  (open it: ")


@pytest.mark.slow
def test_the_demo_answers_in_json(
    urmpipe: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The same motion, in fewer rows.
    monkeypatch.setattr("urmpipe_datasets.LOGS", lay_thinned_logs(tmp_path / "few"))
    (tmp_path / "urmpipe-demo").mkdir()
    ran = urmpipe("demo", "--json")
    assert ran.code == 0, ran.err
    answer = json.loads(ran.out)
    assert answer["as_expected"] is True
    failing = [one["name"] for one in answer["runs"] if one["verdict"] != "pass"]
    assert (len(answer["runs"]), failing) == (4, ["counter_rotating"])


@pytest.mark.slow
def test_each_diagnosis_names_what_its_log_was_made_with(demo: tuple[Path, str]) -> None:
    comparison = urmpipe.read_recording(demo[0] / "demo.rrd")
    assert isinstance(comparison, urmpipe.Comparison)
    found = {one.name: there(one.diagnosis) for one in comparison.runs}
    causes = {name: one.causes[0] for name, one in found.items() if name != "coppeliasim"}
    assert {name: (one.kind, one.name, one.equivalents) for name, one in causes.items()} == {
        "matlab": ("time_lag", "clock", ("servo lag",)),
        "solidworks": ("base_shift", "base", ("r1 (z)",)),  # the first module stands on the base: its height
        "counter_rotating": ("joint_sign", "phi3", ()),
    }
    assert all((len(found[name].causes), found[name].undecided) == (1, ()) for name in causes)
    lag = causes["matlab"]
    assert lag.value[0] == pytest.approx(-4e-3, abs=2e-5)
    assert lag.low[0] < -4e-3 < lag.high[0]
    np.testing.assert_allclose(causes["solidworks"].value, (1.5e-3, -1.2e-3, 1.6e-3), rtol=0, atol=1e-6)
    # The base is off by 2.5 mm: the length of that vector.
    assert {name: (found[name].verdict, round(1e3 * found[name].rms, 2)) for name in causes} == {
        "matlab": ("pass", 1.61),
        "solidworks": ("pass", 2.5),
        "counter_rotating": ("fail", 416.57),
    }
    assert found["matlab"].unexplained.rms < 2e-5
    assert max(found["solidworks"].unexplained.rms, found["counter_rotating"].unexplained.rms) < 1e-6


@pytest.mark.slow
def test_a_damped_inverse_has_no_cause_that_explains_much(demo: tuple[Path, str]) -> None:
    comparison = urmpipe.read_recording(demo[0] / "demo.rrd")
    assert isinstance(comparison, urmpipe.Comparison)
    found = next(there(one.diagnosis) for one in comparison.runs if one.name == "coppeliasim")
    named = [*found.causes, *(cause for one in found.undecided for cause in one.causes)]
    assert all(cause.rms_after > 0.8 * cause.rms_before for cause in named)
    assert found.unexplained.rms > 0.9 * found.rms
