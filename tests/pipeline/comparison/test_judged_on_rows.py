"""Logs are judged on their own rows: no grid takes anything from what was measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import urmpipe
from made_runs import ingested
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, tcp_trajectory
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.runs.run import Run

UR5E = load_robot("ur5e")


def uneven(rows: int, seed: int, mean: float = 0.01) -> FloatArray:
    """Times in [s] whose steps vary by a factor of three, shape (rows,)."""
    steps = np.random.default_rng(seed).uniform(0.5, 1.5, rows - 1) * mean
    return np.concatenate(([0.0], np.cumsum(steps)))


def motion(t: FloatArray) -> FloatArray:
    """Joint values in [rad] of an arm that moves, shape (n, 6)."""
    return np.column_stack([0.4 * np.sin(0.7 * t + k) + 0.3 * k - 0.8 for k in range(6)])


def path(t: FloatArray, position: FloatArray) -> Run:
    return ingested(t, position=position, name="path")


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10**6), st.integers(1, 198), st.floats(0.004, 0.5), st.sampled_from([None, 0.002, 0.02])
)
def test_a_spike_of_one_row_keeps_its_height_to_the_bit(
    seed: int, row: int, height: float, tsp: float | None
) -> None:
    t = uneven(200, seed)
    q = motion(t)
    wanted = positions_over_log(UR5E, q)
    wanted[row, 2] += height  # the reference has the spike at a row of the log: nothing is interpolated
    run = ingested(t, q, UR5E, tsp=tsp)
    assert run.resampled
    one = compare_runs(path(t, wanted), [run]).runs[0]
    exact = np.abs(wanted - tcp_trajectory(run).position)
    assert one.statistics["z"].max == exact[row, 2]
    assert one.statistics["z"].sample_max == row
    assert one.row(one.statistics["z"]) == row + 1
    assert one.verdict == "fail"
    assert len(one.sample) == 200


def test_the_log_s_own_spike_fails_where_the_grid_would_lose_half_of_it() -> None:
    t = uneven(500, 7)
    true = motion(t)
    done = true.copy()
    done[250, 1] += 0.01  # about 6 mm at the tool
    result = compare_runs(ingested(t, true, UR5E, name="asked"), [ingested(t, done, UR5E)])
    one = result.runs[0]
    assert one.verdict == "fail" and int(np.count_nonzero(one.out_of_tolerance)) == 1
    there = np.linalg.norm(positions_over_log(UR5E, true[[250]]) - positions_over_log(UR5E, done[[250]]))
    assert one.statistics["norm"].max == pytest.approx(there, rel=1e-12)  # FK of one row and of many
    run = one.run
    assert run.tcp is not None
    on_grid = np.linalg.norm(run.tcp.position - positions_over_log(UR5E, motion(run.t)), axis=1).max()
    assert on_grid < 0.95 * there  # what the verdict rested on before


@pytest.mark.slow
@pytest.mark.parametrize("rounded", [False, True])
def test_no_grid_changes_a_verdict(tmp_path: Path, *, rounded: bool) -> None:
    rng = np.random.default_rng(1)
    t: FloatArray = np.round(np.arange(300) / 300, 3) if rounded else uneven(300, 3)
    q = motion(t) + rng.normal(0, 1e-3, (300, 6))
    names = ["asked", "done"]
    for name, values in zip(names, (motion(t), q), strict=True):
        table = np.column_stack((t, values))
        header = "t," + ",".join(f"q{k + 1} [rad]" for k in range(6))
        np.savetxt(tmp_path / f"{name}.csv", table, "%.12g", ",", header=header, comments="")
    asked, done = (tmp_path / f"{name}.csv" for name in names)
    told = [
        urmpipe.compare(asked, done, "ur5e", tsp=tsp).to_dict()["runs"][0]["delta"]
        for tsp in (None, 0.001, 0.0077, 0.05)
    ]
    assert told.count(told[0]) == len(told)


def test_nothing_is_interpolated_across_gaps_and_steps_of_the_reference() -> None:
    t = np.linspace(0.0, 0.99, 100)
    q = motion(t)
    q[50:] += np.pi / 2 + 0.2  # a step that no motion explains
    kept = np.delete(np.arange(100), np.arange(20, 30))
    reference = ingested(t[kept], q[kept], UR5E, name="asked")
    between = t[:-1] + 0.005
    log = ingested(between, motion(between), UR5E)
    one = compare_runs(reference, [log], CompareOptions({"axis": 9.0})).runs[0]
    lost = np.setdiff1d(np.arange(99), one.sample)
    np.testing.assert_array_equal(lost, [*range(19, 30), 49])
    at = 49  # a point on the straight line across the step: no way leads through it
    wanted = tcp_trajectory(reference)
    assert wanted.discontinuities is not None
    row = int(wanted.discontinuities[0])
    point = wanted.position[row : row + 2].mean(axis=0)
    there = np.where(np.arange(99)[:, np.newaxis] == at - 1, point, positions_over_log(UR5E, motion(between)))
    one = compare_runs(reference, [path(between, there)], CompareOptions({"axis": 9.0})).runs[0]
    length = float(np.linalg.norm(np.diff(wanted.position[row : row + 2], axis=0)))
    assert one.path[list(one.sample).index(at - 1)] > 0.4 * length


def test_rows_count_alike_however_far_apart_they_are() -> None:
    """As in evo: a mean over rows, not over time."""
    t = np.concatenate((np.linspace(0.0, 0.089, 90), np.linspace(0.1, 1.0, 10)))
    q = motion(t)
    wanted = positions_over_log(UR5E, q)
    wanted[90:, 0] += 0.002
    one = compare_runs(path(t, wanted), [ingested(t, q, UR5E)]).runs[0]
    assert one.statistics["x"].mean == pytest.approx(0.1 * 0.002, rel=1e-9)  # rounding of the sums


def test_a_baseline_made_on_the_grid_is_listed_as_made_otherwise_and_not_as_worse() -> None:
    t = uneven(200, 11)
    q = motion(t)
    wanted = positions_over_log(UR5E, q)
    wanted[70, 0] += 0.02
    now = compare_runs(path(t, wanted), [ingested(t, q, UR5E)])
    before = before_rows(now)
    found = urmpipe.compare(now, baseline=before).baseline
    assert found is not None
    assert found.verdict == "pass" and not found.changes
    assert [(one.what, one.before, one.now) for one in found.differences] == [
        ("judged on of log", "the grid", "the log's rows")
    ]
    regular = np.linspace(0.0, 0.995, 200)
    q = motion(regular)
    wanted = positions_over_log(UR5E, q)
    now = compare_runs(path(regular, wanted + 0.001), [ingested(regular, q, UR5E)])
    earlier = before_rows(compare_runs(path(regular, wanted), [ingested(regular, q, UR5E)]))
    found = urmpipe.compare(now, baseline=earlier).baseline
    assert found is not None and found.verdict == "fail"  # a regular log's rows were its grid


def test_a_recording_that_was_judged_on_the_grid_names_the_row_of_the_log() -> None:
    t = uneven(200, 11)
    run = ingested(t, motion(t), UR5E)
    on_grid = replace(run, rows=None, warnings=())
    wanted = positions_over_log(UR5E, on_grid.q)
    wanted[150, 0] += 0.02
    (one,) = compare_runs(path(on_grid.t, wanted), [on_grid]).runs
    earlier = replace(one, run=replace(run, rows=None))
    nearest = int(np.argmin(np.abs(run.log.t_ns - run.t_ns[150])))
    assert earlier.row(one.worst_statistics) == nearest + 1 != 151


def before_rows(result: Comparison) -> Comparison:
    """Return a comparison as recordings hold it that were made before logs were judged on their rows."""
    runs = tuple(replace(one, run=replace(one.run, rows=None)) for one in result.runs)
    return replace(result, runs=runs, on_rows=False)
