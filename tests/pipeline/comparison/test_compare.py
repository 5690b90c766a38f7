"""Statistics, repaired logs and uncertain offsets, from plain arrays; `compare.cases` has the answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from asserting import there
from made_runs import TSP, URM6, path_run, run_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, compare_with_recorded_tcp
from urmpipe_pipeline.joint_log import LogColumn
from urmpipe_pipeline.repolarization.audit import audit_log

COLUMNS = tuple(LogColumn(f"q{i + 1}", f"q{i + 1}", "joint", i, "rad") for i in range(6))


@pytest.fixture
def q() -> FloatArray:
    t = TSP * np.arange(500)
    return np.column_stack([0.5 * np.sin(t * (1 + i)) + i for i in range(6)])


def test_statistics_are_those_of_numpy_and_the_sign_is_reference_minus_actual(q: FloatArray) -> None:
    rng = np.random.default_rng(5)
    shift = rng.normal(0.001, 0.0005, (500, 3))
    wanted = positions_over_log(URM6, q) + shift
    deviation = compare_runs(path_run(wanted), [run_of(q)]).runs[0]
    np.testing.assert_allclose(deviation.delta[:, :3], shift, atol=1e-15)  # p of 1 m rounds at 2e-16
    one = deviation.statistics["y"]
    y = deviation.delta[:, 1]
    worst = int(np.argmax(np.abs(y)))
    assert (one.max, one.sample_max, one.t_max) == (np.abs(y).max(), worst, worst * 0.005)
    assert one.rms == pytest.approx(np.sqrt(np.mean(y**2)), rel=1e-14)
    assert (one.mean, one.std) == (float(np.mean(y)), float(np.std(y)))
    assert one.p95 == np.percentile(np.abs(y), 95)
    norm = deviation.statistics["norm"]
    assert norm.verdict is None
    assert norm.tolerance is None
    assert norm.max == pytest.approx(np.linalg.norm(shift, axis=1).max(), rel=1e-12)
    assert deviation.start == tuple(deviation.delta[0])


def test_an_estimate_that_is_not_certain_is_told(q: FloatArray) -> None:
    rng = np.random.default_rng(3)
    wanted = path_run(positions_over_log(URM6, q) + rng.normal(scale=0.011, size=(500, 3)))
    result = compare_runs(wanted, [run_of(q)], CompareOptions(sync="auto"))
    precision = there(result.runs[0].sync.precision)
    assert precision > 0.1 * TSP
    said = [one.message for one in result.warnings if one.kind == "sync-uncertain"]
    assert len(said) == 1
    assert f"is known to +-{1e3 * precision:.2g} ms (standard error); the period is 5 ms" in said[0]


def test_a_log_alone_is_compared_as_it_was_repaired() -> None:
    t = TSP * np.arange(200)
    true = np.column_stack([np.pi + 0.5 * (t - 0.5024), *(0.1 * np.sin(t + k) for k in range(5))])
    there = (true + np.pi) % (2 * np.pi) - np.pi
    wrap = int(np.argmax(np.abs(np.diff(there[:, 0])))) + 1
    there[wrap, 0] = (there[wrap - 1, 0] + there[wrap + 1, 0]) / 2
    log = replace(run_of(there, recorded=positions_over_log(URM6, true)).log, columns=COLUMNS)
    found = audit_log(log, URM6, repaired=True)
    assert [entry.kind for entry in found.entries] == ["repaired", "wrap"]
    run = replace(run_of(found.q), log=log, audit=found.entries)
    # A straight line between samples 5 ms apart misses a sine of 1 rad/s2 by 1e-5 rad at the most.
    assert compare_with_recorded_tcp(run).runs[0].delta.max() < 1e-5
    assert (
        compare_with_recorded_tcp(run_of(there, recorded=positions_over_log(URM6, true))).runs[0].delta.max()
        > 0.1
    )
