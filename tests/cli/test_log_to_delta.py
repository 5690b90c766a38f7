"""`log-to-delta`: what `compare` measures, as connected blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import urmpipe
from thinned_logs import lay_thinned_logs
from urmpipe.api.simulate import simulate
from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.sources.tables.text import fingerprint


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of the bundled logs, in fewer rows."""
    return lay_thinned_logs(tmp_path_factory.mktemp("logs"))


@pytest.mark.slow
@pytest.mark.parametrize("log", ["coppeliasim.csv", "matlab.csv", "solidworks", "counter_rotating.csv"])
def test_log_to_delta_is_what_compare_says(log: str, logs: Path) -> None:
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


@pytest.fixture
def slow_motion(tmp_path: Path) -> dict[str, str]:
    """A log at 10 ms, twice the step of most systems, and the path of exactly its motion."""
    return write_motion(tmp_path, np.arange(40, dtype=np.float64) / 100.0, "%.18e")


def write_motion(tmp_path: Path, t: FloatArray, digits: str) -> dict[str, str]:
    """Write a log with times in [s], shape (n,), and the path of exactly its motion."""
    q = 0.8 * np.sin(3.0 * t)[:, None] * np.linspace(0.3, 1.0, 6)
    x = point_over_log(load_robot("urm6"), q, np.zeros_like(q), np.zeros_like(q)).position
    files = {"log": tmp_path / "log.csv", "reference": tmp_path / "path.csv"}
    heads = {"log": [f"phi{i} [rad]" for i in range(1, 7)], "reference": [f"{axis} [m]" for axis in "xyz"]}
    for name, values in (("log", q), ("reference", x)):
        form = [digits, *["%.18e"] * values.shape[1]]
        header = ",".join(["t [s]", *heads[name]])
        np.savetxt(files[name], np.column_stack([t, values]), form, ",", header=header, comments="")
    return {name: str(path) for name, path in files.items()}


@pytest.mark.slow
def test_a_log_of_another_period_is_judged_at_its_samples(slow_motion: dict[str, str]) -> None:
    result = simulate("log-to-delta", arguments=slow_motion)
    assert (result.step, result.verdict, result.warnings) == (0.01, "pass", ())
    assert result.verdicts[0].worst < 1e-12  # the path is the log's own, but for rounding


@pytest.mark.slow
@pytest.mark.parametrize("digits", ["%.9f", "%.3f"])
def test_a_log_whose_period_no_clock_writes_exactly_is_judged_at_its_samples(
    tmp_path: Path, digits: str
) -> None:
    motion = write_motion(tmp_path, np.arange(40) / 30.0, digits)
    result = simulate("log-to-delta", arguments=motion, backend="python")
    assert (len(result.t_ns), result.verdict, result.warnings) == (40, "pass", ())
    # The path is the log's own; its clock is up to half a unit of the last digit off the points, at 3.5 m/s.
    assert result.verdicts[0].worst < 3.5 * 0.5 * 10.0 ** -int(digits[2])


@pytest.mark.slow
def test_a_step_between_the_samples_of_a_log_is_told(slow_motion: dict[str, str]) -> None:
    result = simulate("log-to-delta", arguments=slow_motion, step=0.005)
    assert [(one.kind, one.message) for one in result.warnings] == [(
        "held",
        "block log: 39 of 79 communication points lie between samples of the log, where the previous"
        " sample is held for at most 5 ms: deviations there are not those of the log",
    )]  # fmt: skip


@pytest.fixture(scope="module")
def shipped(tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    """The shipped system with its own logs, where the user has a path for something else."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("shipped"))
        Path("path.csv").write_text("t,x,y,z\n0,0,0,9\n1,0,0,9\n")
        return simulate("log-to-delta", duration=0.5)


@pytest.mark.slow
def test_the_bundled_logs_are_those_of_a_shipped_system(shipped: Simulation) -> None:
    assert shipped.verdict == "pass"
    assert fingerprint(LOGS / "path.csv") in shipped.provenance.inputs


@pytest.mark.slow
def test_the_arm_of_a_kinematic_chain_is_that_of_its_joints(shipped: Simulation) -> None:
    (arm,) = shipped.arms
    assert (arm.block, arm.chain.name) == ("chain", "urm6")
    np.testing.assert_array_equal(arm.q, shipped.signal("repolarizer.q").values)
    assert shipped.t[-1] == 0.5


@pytest.mark.slow
def test_every_file_is_traced_and_every_log_warns(shipped: Simulation) -> None:
    assert [one.name for one in shipped.provenance.inputs] == [
        "log-to-delta.toml", "coppeliasim.csv", "path.csv",
    ]  # fmt: skip
    assert [one.kind for one in shipped.warnings] == ["assumed-unit"]
    assert shipped.provenance.options["arguments"]["robot"] == "urm6"
    blocks = {one.name: one for one in shipped.blocks}
    assert [(one.variable, one.value, one.from_system) for one in blocks["delta"].settings] == [
        ("tolerance", 0.0035, False)
    ]
