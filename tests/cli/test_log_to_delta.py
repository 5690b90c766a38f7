"""`log-to-delta`: what `compare` measures, as connected blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import urmpipe
from thinned_logs import lay_thinned_logs
from urmpipe.api.simulate import simulate
from urmpipe_datasets import LOGS
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.logs.formats.text import fingerprint


@pytest.mark.slow
@pytest.mark.parametrize("log", ["coppeliasim.csv", "matlab.csv", "solidworks", "counter_rotating.csv"])
def test_log_to_delta_is_what_compare_says(log: str, tmp_path: Path) -> None:
    logs = lay_thinned_logs(tmp_path)
    result = simulate(
        "log-to-delta",
        arguments={"log": str(logs / log), "reference": str(logs / "path.csv"), "robot": "urm6"},
    )
    compared = urmpipe.compare(logs / "path.csv", [logs / log], robot="urm6")
    (run,), (judged,) = compared.runs, result.verdicts
    np.testing.assert_array_equal(result.t_ns, run.run.t_ns[run.sample])
    # The same formulas on the same doubles; a compiler may round products that it fuses, 1e-16 m each.
    np.testing.assert_allclose(result.signal("delta.delta").values, run.delta[:, :3], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(result.signal("delta.norm").values, run.delta[:, 3], rtol=0.0, atol=1e-12)
    out = np.abs(run.delta[:, :3]).max(axis=1) > 0.0035
    np.testing.assert_array_equal(result.signal("delta.out_of_tolerance").values, out)
    assert judged.out_of_tolerance == int(out.sum())
    assert judged.worst == pytest.approx(np.abs(run.delta[:, :3]).max(), rel=0.0, abs=1e-12)  # as above
    assert judged.verdict == result.verdict == compared.verdict
    turns = result.signal("repolarizer.turns").values
    assert int(np.abs(np.diff(turns, axis=0)).sum()) == len(run.run.repolarizations)


def write_motion(folder: Path, rate: float, digits: str) -> dict[str, str]:
    """Write a log with times of so many digits, and the path of exactly its motion."""
    t = np.arange(40) / rate
    q = 0.8 * np.sin(3.0 * t)[:, None] * np.linspace(0.3, 1.0, 6)
    x = point_over_log(load_robot("urm6"), q, np.zeros_like(q), np.zeros_like(q)).position
    names = {"log": [f"phi{i} [rad]" for i in range(1, 7)], "reference": [f"{axis} [m]" for axis in "xyz"]}
    for name, values in (("log", q), ("reference", x)):
        header = ",".join(["t [s]", *names[name]])
        form = [digits, *["%.18e"] * values.shape[1]]
        np.savetxt(folder / name, np.column_stack([t, values]), form, ",", header=header, comments="")
    return {name: str(folder / name) for name in names}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "digits", "worst"),
    [
        (100.0, "%.18e", 1e-12),  # the path is the log's own, but for rounding
        (30.0, "%.9f", 3.5 * 0.5e-9),  # the clock is up to half a unit of the last digit off, at 3.5 m/s
        (30.0, "%.3f", 3.5 * 0.5e-3),
    ],
)
def test_a_log_of_another_period_or_one_no_clock_writes_exactly_is_judged_at_its_samples(
    tmp_path: Path, rate: float, digits: str, worst: float
) -> None:
    motion = write_motion(tmp_path, rate, digits)
    result = simulate("log-to-delta", arguments=motion, backend="python")
    assert (len(result.t_ns), result.verdict, result.warnings) == (40, "pass", ())
    assert result.step == pytest.approx(1.0 / rate, abs=1e-6)  # of 39 steps, by clocks of 1 ms and better
    assert result.verdicts[0].worst < worst


@pytest.mark.slow
def test_a_step_between_the_samples_of_a_log_is_a_warning(tmp_path: Path) -> None:
    motion = write_motion(tmp_path, 100.0, "%.18e")
    result = simulate("log-to-delta", arguments=motion, step=0.005, backend="python")
    assert [(one.kind, one.message) for one in result.warnings] == [(
        "held",
        "block log: 39 of 79 communication points lie between samples of the log, where the previous"
        " sample is held for at most 5 ms: deviations there are not those of the log",
    )]  # fmt: skip


@pytest.mark.slow
def test_a_shipped_system_has_its_own_logs_which_are_traced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("path.csv").write_text("t,x,y,z\n0,0,0,9\n1,0,0,9\n")  # a path for something else
    shipped = simulate("log-to-delta", duration=0.5)
    assert (shipped.verdict, shipped.t[-1]) == ("pass", 0.5)
    assert [one.name for one in shipped.provenance.inputs] == [
        "log-to-delta.toml", "coppeliasim.csv", "path.csv",
    ]  # fmt: skip
    assert fingerprint(LOGS / "path.csv") in shipped.provenance.inputs
    assert [one.kind for one in shipped.warnings] == ["assumed-unit"]
    assert shipped.provenance.options["arguments"]["robot"] == "urm6"
    (settings,) = [one.settings for one in shipped.blocks if one.name == "delta"]
    assert [(one.variable, one.value, one.from_system) for one in settings] == [("tolerance", 0.0035, False)]
    (arm,) = shipped.arms
    assert (arm.block, arm.chain.name) == ("chain", "urm6")
    np.testing.assert_array_equal(arm.q, shipped.signal("repolarizer.q").values)
