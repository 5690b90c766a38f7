"""What is measured beside delta, against independent code; `measure.cases` has joints and gaps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation, Slerp

from asserting import there
from made_runs import URM6, ingested, path_run, run_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, tcp_trajectory
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.measure import Quantity, compute_statistics, correlation, measure
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import Sync, match

T = np.linspace(0.0, 5.0, 300)
SIDES = ((0.005, "path"), (0.0047, "log"))


def compared(reference: Run, log: Run) -> Deviation:
    return compare_runs(reference, [log], CompareOptions({"axis": 1e9})).runs[0]


def test_the_reference_turns_on_the_great_arc_between_its_samples() -> None:
    rng = np.random.default_rng(3)
    position, rotation = rng.uniform(-1, 1, (20, 3)), Rotation.random(20, rng=rng)
    wanted = Slerp(np.arange(20.0), rotation)(np.arange(0, 19.01, 0.25))
    at = [np.interp(np.arange(0, 19.01, 0.25), np.arange(20), column) for column in position.T]
    log = path_run(np.column_stack(at), wanted.as_quat(), name="log")
    found = compared(path_run(position, rotation.as_quat(), tsp=0.02), log)
    np.testing.assert_allclose(there(found.angle), 0.0, atol=1e-14)
    assert found.statistics["norm"].max < 1e-14


@settings(max_examples=50, deadline=None)
@given(
    values=hnp.arrays(float, st.integers(1, 30), elements=st.floats(-2.0, 2.0)),
    missing=st.sets(st.integers(0, 29)),
)
def test_what_has_no_value_is_out_of_its_tolerance_and_counted(values: FloatArray, missing: set[int]) -> None:
    rows = [row for row in missing if row < len(values)][: len(values) - 1]
    values[rows] = np.nan
    count, t = np.arange(len(values)), np.linspace(0.0, 1.0, len(values))
    measured = Quantity("angle", "angle", "rad", values)
    one = compute_statistics(measured, t, count, {"angle": 1.0})
    assert (one.samples, one.missing) == (len(values) - len(rows), len(rows))
    above = int(np.count_nonzero(np.abs(values) > 1.0))
    assert (
        one.out_of_tolerance
        == above + len(rows)
        == int(np.count_nonzero(measured.out_of_tolerance({"angle": 1.0})))
    )
    assert round(there(one.out_fraction) * len(values)) == one.out_of_tolerance
    assert one.verdict == ("fail" if above or rows else "pass")
    free = compute_statistics(measured, t, count, {"axis": 1.0})
    assert (free.verdict, free.out_of_tolerance, free.missing) == (None, None, len(rows))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.3, 3.0))
def test_the_path_is_never_further_than_the_place_at_that_time(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    wanted = np.cumsum(rng.normal(0, 0.01, (120, 3)), axis=0)
    wanted[rng.integers(0, 120, 5)] = np.nan
    done = rng.normal(0, 0.05, (150, 3))
    found = compared(path_run(wanted), path_run(done, tsp=0.005 * share, name="log"))
    assert (found.path <= found.delta[:, 3]).all()


def test_the_speed_of_positions_is_that_of_the_parabola_through_the_neighbours() -> None:
    position = np.column_stack([T**2, 2 * T, np.zeros(300)])
    step = round(T[1], 9)
    found = compared(path_run(position, tsp=step), path_run(position, tsp=step, name="b"))
    expected = np.hypot(2 * T, 2.0)
    np.testing.assert_allclose(found.speed[1:-1], expected[1:-1], rtol=1e-7)  # the period rounds to 1 ns
    np.testing.assert_allclose(
        found.speed, np.linalg.norm(np.gradient(position, T, axis=0), axis=1), rtol=1e-7
    )


def test_a_correlation_is_that_of_numpy() -> None:
    rng = np.random.default_rng(6)
    first = rng.normal(size=500)
    second = first + rng.normal(size=500)
    first[3], second[7] = np.nan, np.nan
    both = np.isfinite(first) & np.isfinite(second)
    expected = np.corrcoef(first[both], second[both])[0, 1]
    assert correlation(first, second) == pytest.approx(expected, abs=1e-14)
    assert correlation(second, 2.0 * second) == pytest.approx(1.0, abs=1e-15)
    assert correlation(first, -first) == pytest.approx(-1.0, abs=1e-15)


@pytest.mark.parametrize("block_rows", [1, 7, 100, 299])
@pytest.mark.parametrize("kind", ["joints", "poses", "path"])
def test_no_size_of_the_blocks_changes_a_bit(kind: str, block_rows: int) -> None:
    rng = np.random.default_rng(8)
    position, rotation = np.cumsum(rng.normal(0, 0.01, (300, 3)), axis=0), Rotation.random(300, rng=rng)
    q = np.sin(np.outer(T, np.arange(1.0, 7.0)))
    quat = np.where(rng.random((300, 1)) < 0.1, np.nan, rotation.as_quat())
    runs = {
        "joints": (run_of(q + rng.normal(0, 0.01, (300, 6))), run_of(q)),
        "poses": tuple(path_run(position, quat, tsp=tsp, name=name) for tsp, name in SIDES),
        "path": tuple(path_run(position, tsp=tsp, name=name) for tsp, name in SIDES),
    }[kind]
    reference, log = (replace(tcp_trajectory(run), discontinuities=np.array([40, 41])) for run in runs)
    late = np.where(np.arange(300) < 200, 0, 300_000_000)
    reference, log = (replace(side, t_ns=side.t_ns + late) for side in (reference, log))
    missing = log.position.copy()
    missing[rng.integers(0, 300, 9)] = np.nan
    log = replace(log, position=missing)

    def measured(**sizes: int) -> Deviation:
        matched = match(reference, log, Sync("given", 0.0123), **sizes)
        assert len(matched.sample) > 200
        return measure(runs[1], reference, log, matched, {"axis": 0.01, "coverage": 0.9}, **sizes)

    at_once, in_blocks = measured(), measured(block_rows=block_rows)
    for name in ("sample", "t_ns", "reference", "actual", "delta", "path", "speed", "angle", "joint_delta"):
        first, second = getattr(at_once, name), getattr(in_blocks, name)
        assert (first is None) == (second is None)
        assert first is None or first.tobytes() == second.tobytes()
    assert at_once.to_dict() == in_blocks.to_dict()


def test_statistics_are_those_of_numpy_and_the_sign_is_reference_minus_actual() -> None:
    rng = np.random.default_rng(5)
    q = np.sin(np.outer(T, np.arange(1.0, 7.0))) + np.arange(6.0)
    shift = rng.normal(0.001, 0.0005, (300, 3))
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


def test_sums_are_those_of_parts_of_a_fixed_size() -> None:
    """The mean of 200,000 values, to the last bits; all rows at once would round elsewhere."""
    values = np.random.default_rng(9).normal(1.0, 1.0, 200_000)
    rows = np.arange(len(values))
    found = compute_statistics(Quantity("norm", "norm", "m", values), rows / 1e3, rows, {})
    assert found.mean == pytest.approx(math.fsum(values) / len(values), rel=1e-15)
    assert found.rms == pytest.approx(math.sqrt(math.fsum(values**2) / len(values)), rel=1e-15)
    deviations = (values - found.mean) ** 2
    assert found.std == pytest.approx(math.sqrt(math.fsum(deviations) / len(values)), rel=1e-15)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10**6), st.integers(1, 198), st.floats(0.004, 0.5), st.sampled_from([None, 0.002, 0.02])
)
def test_a_spike_of_one_row_keeps_its_height_to_the_bit(
    seed: int, row: int, height: float, tsp: float | None
) -> None:
    robot, steps = load_robot("ur5e"), np.random.default_rng(seed).uniform(0.005, 0.015, 199)
    t = np.concatenate(([0.0], np.cumsum(steps)))
    q = np.column_stack([0.4 * np.sin(0.7 * t + k) + 0.3 * k - 0.8 for k in range(6)])
    wanted = positions_over_log(robot, q)
    wanted[row, 2] += height  # the reference has the spike at a row of the log: nothing is interpolated
    run = ingested(t, q, robot, tsp=tsp)
    assert run.resampled
    one = compare_runs(ingested(t, position=wanted), [run]).runs[0]
    exact = np.abs(wanted - tcp_trajectory(run).position)
    z = one.statistics["z"]
    assert (z.max, z.sample_max, one.row(z)) == (exact[row, 2], row, row + 1)
    assert (one.verdict, len(one.sample)) == ("fail", 200)
