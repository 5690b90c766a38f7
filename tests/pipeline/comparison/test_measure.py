"""What is measured beside delta, against independent code; `measure.cases` has joints and gaps."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation, Slerp

from asserting import there
from made_runs import path_run, run_of
from orientation_columns import orientation_columns
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import FORMS, RotationForm
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, tcp_trajectory
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.measure import Quantity, compute_statistics, correlation, measure
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources import ReadOptions
from urmpipe_pipeline.trajectories import Sync, match

LOGS = Path(__file__).parents[3] / "datasets" / "urmpipe_datasets" / "logs"
T = np.linspace(0.0, 5.0, 300)
SIDES = ((0.005, "path"), (0.0047, "log"))


def held(reference: Run, log: Run, **tolerance: float) -> Deviation:
    return compare_runs(reference, [log], CompareOptions(tolerance or {"axis": 1e9})).runs[0]


# Orientations


def poses(count: int) -> tuple[FloatArray, Rotation]:
    rng = np.random.default_rng(3)
    return rng.uniform(-1, 1, (count, 3)), Rotation.random(count, rng=rng)


@pytest.mark.parametrize("form", FORMS)
def test_the_angle_is_that_between_recorded_orientations_of_any_form(form: RotationForm) -> None:
    position, rotation = poses(50)
    turned = rotation * Rotation.from_rotvec([0.0, 0.3, 0.4])
    found = held(
        path_run(position, rotation.as_quat(), "quat_xyzw"),
        path_run(position, orientation_columns(turned, form), form, name="log"),
    )
    np.testing.assert_allclose(there(found.angle), 0.5, atol=1e-14)  # some tens of rounding errors
    assert (found.statistics["angle"].unit, found.statistics["angle"].kind) == ("rad", "angle")


def test_the_reference_turns_on_the_great_arc_between_its_samples() -> None:
    position, rotation = poses(20)
    wanted = Slerp(np.arange(20.0), rotation)(np.arange(0, 19.01, 0.25))
    at = np.column_stack(
        [np.interp(np.arange(0, 19.01, 0.25), np.arange(20), column) for column in position.T]
    )
    found = held(
        path_run(position, rotation.as_quat(), "quat_xyzw", tsp=0.02),
        path_run(at, wanted.as_quat(), "quat_xyzw", name="log"),
    )
    np.testing.assert_allclose(there(found.angle), 0.0, atol=1e-14)
    assert found.statistics["norm"].max < 1e-14


# What has no value


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


# Path


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.3, 3.0))
def test_the_path_is_never_further_than_the_place_at_that_time(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    wanted = np.cumsum(rng.normal(0, 0.01, (120, 3)), axis=0)
    wanted[rng.integers(0, 120, 5)] = np.nan
    done = rng.normal(0, 0.05, (150, 3))
    found = held(path_run(wanted), path_run(done, tsp=0.005 * share, name="log"))
    assert (found.path <= found.delta[:, 3]).all()


# Speed and its correlation


def test_the_speed_of_positions_is_that_of_the_parabola_through_the_neighbours() -> None:
    position = np.column_stack([T**2, 2 * T, np.zeros(300)])
    step = round(T[1], 9)
    found = held(path_run(position, tsp=step), path_run(position, tsp=step, name="b"))
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


# Blocks of rows


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


def test_sums_are_those_of_parts_of_a_fixed_size() -> None:
    """The mean of 200,000 values, to the last bits; all rows at once would round elsewhere."""
    values = np.random.default_rng(9).normal(1.0, 1.0, 200_000)
    rows = np.arange(len(values))
    found = compute_statistics(Quantity("norm", "norm", "m", values), rows / 1e3, rows, {})
    assert found.mean == pytest.approx(math.fsum(values) / len(values), rel=1e-15)
    assert found.rms == pytest.approx(math.sqrt(math.fsum(values**2) / len(values)), rel=1e-15)
    deviations = (values - found.mean) ** 2
    assert found.std == pytest.approx(math.sqrt(math.fsum(deviations) / len(values)), rel=1e-15)


# The sample logs

PRINTED = 6 * np.radians(0.00005) * 1.35
"""In [m]: four decimals of a degree, six joints, 1.35 m from the first to the tip of a stretched urm6."""


@pytest.fixture(scope="module")
def demo() -> Comparison:
    robot, read = load_robot("urm6"), ReadOptions(unit={"": "rad"})
    path = ingest_log([LOGS / "path.csv"])
    matlab = ingest_log([LOGS / "matlab.csv"], robot=robot, read=read)
    solidworks = ingest_log(log_files(LOGS / "solidworks"), robot=robot, name="solidworks")
    return compare_runs(path, [matlab, solidworks])


@pytest.mark.slow
def test_a_log_that_is_late_deviates_as_fast_as_it_moves(demo: Comparison) -> None:
    """Fig. 9b of [UrmArm2021]_: the norm is largest where the effector is fastest."""
    matlab = demo.runs[0]
    assert there(matlab.speed_correlation) > 0.9999
    assert matlab.speed[matlab.worst] > 0.999 * matlab.speed.max()


@pytest.mark.slow
def test_the_base_of_solidworks_stands_two_and_a_half_millimetres_off(demo: Comparison) -> None:
    norm = demo.runs[1].statistics["norm"]
    assert norm.mean == pytest.approx(2.5e-3, abs=1e-7)  # roundings mean out over 7383 samples
    assert np.abs(demo.runs[1].delta[:, 3] - 2.5e-3).max() < PRINTED


def test_start_takes_the_base_of_solidworks_away(demo: Comparison) -> None:
    reference = ingest_log([LOGS / "path.csv"])
    found = compare_runs(reference, [demo.runs[1].run], CompareOptions(align="start")).runs[0]
    assert found.alignment.translation == pytest.approx((1.5e-3, -1.2e-3, 1.6e-3), abs=PRINTED)
    assert found.alignment.moved(found.actual).max() == pytest.approx(2.5e-3, abs=PRINTED)
    assert found.statistics["norm"].max < 2 * PRINTED  # what rounding leaves here and at the start
