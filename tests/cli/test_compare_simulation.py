"""A simulation is an operand: the motion of a block, compared with a path, a log or another block."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from asserting import there
from urmpipe_datasets import LOGS
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.results import read_recording
from urmpipe_pipeline.simulations.simulation import Simulation

PATH, LOG = "path.csv", "coppeliasim.csv"

of_one_backend = pytest.mark.parametrize("recorded", ["native"], indirect=True, scope="module")
"""Where a recording is a recording: no number is compared with another."""


@pytest.fixture(scope="module", params=["native", "python"])
def recorded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    """The bundled log through repolarizer and arm, and its recording."""
    path = tmp_path_factory.mktemp("simulated") / f"{request.param}.rrd"
    return urmpipe.simulate("log-to-delta", duration=0.5, backend=request.param, output=path)


@pytest.fixture(autouse=True)
def begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Path and log in the working folder, for somewhat longer than the simulation."""
    for name in (PATH, LOG):
        rows = (LOGS / name).read_text(encoding="utf-8").splitlines(keepends=True)
        (tmp_path / name).write_text("".join(rows[:108]), encoding="utf-8")
    monkeypatch.chdir(tmp_path)


def operands(simulation: Simulation) -> tuple[Simulation, Path]:
    return simulation, there(simulation.recording)


def assert_agrees(found: Comparison, simulation: Simulation) -> None:
    """Assert that a comparison found what the delta meter did, to the bit, in the same rows."""
    (run,), (meter,) = found.runs, simulation.verdicts
    np.testing.assert_array_equal(run.t_ns, simulation.t_ns)
    np.testing.assert_array_equal(run.delta[:, :3], simulation.signal("delta.delta").values)
    np.testing.assert_array_equal(run.delta[:, 3], simulation.signal("delta.norm").values)
    assert np.abs(run.delta[:, :3]).max() == meter.worst
    assert found.verdict == meter.verdict


@pytest.mark.slow
def test_the_tip_that_a_block_computed_is_judged_as_its_delta_meter_does(recorded: Simulation) -> None:
    for one in operands(recorded):
        assert_agrees(urmpipe.compare(PATH, one, block="chain", tcp="recorded"), recorded)
        found = urmpipe.compare(one, [one], block=["reference", "chain"], tcp="recorded")
        assert_agrees(found, recorded)


@pytest.mark.slow
def test_a_simulated_arm_compares_as_its_log_does(recorded: Simulation) -> None:
    """By its joints: as the log itself, to the bit, and so as the delta meter of Python, which adds alike."""
    (log,) = urmpipe.compare(PATH, LOG, robot="urm6").runs
    for one in operands(recorded):
        found = urmpipe.compare(PATH, one, block="chain")
        (run,) = found.runs
        np.testing.assert_array_equal(run.delta, log.delta[: len(run.delta)])
        assert there(run.run.robot).name == "urm6"
        if "python" in there(recorded.recording).name:
            assert_agrees(found, recorded)


@pytest.mark.slow
@pytest.mark.parametrize("block", ["chain", "repolarizer", "log"])
def test_a_simulated_arm_does_not_deviate_from_its_log(recorded: Simulation, block: str) -> None:
    for one in operands(recorded):
        (run,) = urmpipe.compare(LOG, one, robot="urm6", block=block).runs
        assert not there(run.joint_delta).any()
        assert not run.delta.any()
        (run,) = urmpipe.compare(one, LOG, robot="urm6", block=block).runs  # as the reference
        assert not run.delta.any()


@pytest.mark.slow
def test_its_own_tip_agrees_with_its_joints(recorded: Simulation) -> None:
    (run,) = urmpipe.compare(recorded, block="chain").runs
    # The same formulas on the same doubles; a compiler may round products that it fuses, 1e-16 m each.
    assert np.abs(run.delta).max() < 1e-14
    assert there(run.angle).max() < 1e-7  # of quaternions whose entries are a rounding apart: its root


@pytest.mark.slow
@of_one_backend
def test_the_block_is_asked_for_and_its_answers_work(
    recorded: Simulation, urmpipe: Callable[..., Any]
) -> None:
    path = there(recorded.recording)
    answers = [f"--block {one}" for one in ("chain", "log", "reference", "repolarizer")]
    ran = urmpipe("compare", PATH, path)
    allowed = " or ".join(answers)
    assert ran.code == 2
    assert ran.err == f"error: {path}: found 4 blocks with a motion, allowed: one; use {allowed}\n"
    for answer in answers:
        assert urmpipe("compare", PATH, path, *answer.split(), "-q").code == 0
    ran = urmpipe("compare", PATH, path, "--block", "delta")
    allowed = "chain, log, reference, repolarizer, which have a motion in"
    assert (ran.code, ran.err) == (2, f"error: block (--block): found 'delta', allowed: {allowed} {path}\n")


@pytest.mark.slow
@of_one_backend
def test_such_a_comparison_is_reported_and_diagnosed(
    recorded: Simulation, urmpipe: Callable[..., Any], tmp_path: Path
) -> None:
    path = there(recorded.recording)
    assert urmpipe("compare", PATH, path, "--block", "chain", "-o", "c.rrd").code == 0
    assert urmpipe("report", "c.rrd", "-o", "c.html").code == 0
    assert "log-to-delta (chain)" in (tmp_path / "c.html").read_text()
    back = read_recording(tmp_path / "c.rrd")
    assert isinstance(back, Comparison)
    assert there(back.runs[0].run.robot).name == "urm6"
    ran = urmpipe("diagnose", PATH, path, "--block", "chain", "--sync", "20ms")
    assert ran.code == 0
    assert "log-to-delta (chain) within tolerance against path" in ran.out
