"""Ingest and derivatives against laws and oracles; the rest is in ingest.cases and grid.cases."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np
from scipy.signal import savgol_filter

from asserting import there
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_with_recorded_tcp
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.runs.derivatives import WINDOW, Method, derivatives
from urmpipe_pipeline.runs.ingest import ingest_log

RAD = LogMap(unit={"": "rad"})
TSP = 0.005
T = TSP * np.arange(400, dtype=np.float64)


def write(path: Path, q: FloatArray, header: str = "t,q1,q2,q3,q4,q5,q6") -> Path:
    table = np.column_stack([TSP * np.arange(len(q)), q])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.17g")
    return path


@pytest.mark.slow
@given(st_np.arrays(float, st.tuples(st.integers(3, 60), st.just(6)), elements=st.floats(-1.5, 1.5)))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_wrapped_log_is_unwrapped_and_the_arm_does_not_notice(tmp_path: Path, steps: FloatArray) -> None:
    x = np.cumsum(steps, axis=0)
    x -= 2 * np.pi * np.round(x[0] / (2 * np.pi))
    wrapped, robot = x - 2 * np.pi * np.floor((x + np.pi) / (2 * np.pi)), load_robot("urm6")
    run = ingest_log([write(tmp_path / "log.csv", wrapped)], robot=robot, read=RAD)
    np.testing.assert_allclose(run.q, x, rtol=0, atol=3e-14)  # to 90 rad: two roundings of 1.4e-14
    # the arm is 1.35 m long: an angle's rounding of 3e-14 moves its tip by less than 1e-12
    position = positions_over_log(robot, wrapped)
    np.testing.assert_allclose(there(run.tcp).position, position, rtol=0, atol=1e-12)


@pytest.mark.filterwarnings("error")
def test_huge_numbers_are_read_without_a_warning_of_numpy(tmp_path: Path) -> None:
    q = np.tile(np.linspace(0.2, 0.9, 40)[:, None], (1, 12))
    q[7, [1, 6, 8, 9]] = 1e300, 1e200, 1e300, 1e250
    path = write(tmp_path / "log.csv", q, "t,q1,q2,q3,q4,q5,q6,x,y,z,rx,ry,rz")
    run = ingest_log([path], robot=load_robot("ur5e"), read=RAD)
    assert run.q[7, 1] == 1e300


def test_real_jumps_that_are_no_wraps_stay(shared: Path) -> None:
    run = ingest_log([shared / "logs" / "plotjuggler" / "fake_joints.csv"], read=RAD)
    assert run.repolarizations == ()
    large = [(one.row, one.joint) for one in run.audit if one.kind == "unexplained"]
    assert large == [(row, f"field.position.joint_{j}") for row, j in ((2, 0), (1412, 3), (1413, 3))]
    (warning,) = [one for one in run.warnings if one.kind == "large-step"]
    assert (warning.row, warning.message) == (
        2,
        "3 steps of field.position.joint_0 and field.position.joint_3 by more than 90 deg are not wraps and"
        " are kept; the largest, of field.position.joint_3 by 682.7 deg, is to row 1412",
    )
    assert "recorded-rates" in [one.kind for one in run.warnings]  # its velocity columns are all 0


def test_a_real_controller_log_agrees_with_the_catalogue(shared: Path) -> None:
    log = shared / "logs" / "ur5e-rtde-static" / "robot_data.csv"
    run = ingest_log([log], robot=load_robot("ur5e"))
    result = compare_with_recorded_tcp(run, CompareOptions({"axis": 0.002}))
    assert result.verdict == "pass"
    assert 0.001 < result.runs[0].statistics["norm"].max < 0.002  # nominal geometry: within 1.6 mm


@pytest.mark.parametrize("method", ["central", "savgol"])
def test_a_parabola_is_differentiated_exactly(method: Method) -> None:
    q = np.column_stack([1.0 + 2.0 * T - 3.0 * T**2, T, np.ones_like(T)])
    qd, qdd = derivatives(q, TSP, method)
    # q to 10 rounds at 1e-15; over T^2 = 2.5e-5 this is 1e-10, the filter's sums a little more
    np.testing.assert_allclose(qd, np.column_stack([2.0 - 6.0 * T, np.ones_like(T), 0 * T]), atol=1e-9)
    np.testing.assert_allclose(qdd, np.column_stack([np.full_like(T, -6.0), 0 * T, 0 * T]), atol=1e-7)


def test_central_differences_are_second_order() -> None:
    qd, qdd = derivatives(np.sin(T)[:, None], TSP)
    assert np.abs(qd[:, 0] - np.cos(T)).max() < TSP**2  # error T^2 / 6 inside, T^2 / 3 at the ends
    assert np.abs(qdd[1:-1, 0] + np.sin(T)[1:-1]).max() < TSP**2


def test_four_digit_angles_need_smoothing() -> None:
    q, inner = np.round(2.0 * np.sin(T)[:, None], 3), slice(WINDOW, -WINDOW)
    rough, smooth = (
        np.abs(derivatives(q, TSP, method)[1] + 2.0 * np.sin(T)[:, None])[inner].max()
        for method in ("central", "savgol")
    )
    assert rough > 10.0 and smooth < 1.0


@pytest.mark.parametrize("count", [5, 6, 30, 31, 32, 400, 16_500])
def test_smoothing_is_that_of_savitzky_and_golay(count: int) -> None:
    q = np.random.default_rng(count).normal(size=(count, 3))
    window = min(WINDOW, count - 1 + count % 2)
    for k, got in enumerate(derivatives(q, TSP, "savgol"), start=1):
        expected = savgol_filter(q, window, 3, deriv=k, delta=TSP, axis=0)
        # 31 products, each rounded at 1e-16 of the largest value, and the fit's condition of 1e2
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("row", [0, 5, 20, 200, 394, 399])
def test_smoothing_leaves_a_gap_around_a_missing_sample_and_nothing_else(row: int) -> None:
    q = np.column_stack([np.sin(T), T])
    complete = derivatives(q, TSP, "savgol")
    q[row, 0] = np.nan
    half = WINDOW // 2
    fitted = np.clip(np.arange(len(T)), half, len(T) - 1 - half)  # the middle of the window that is fitted
    lost = np.abs(fitted - row) <= half
    for got, expected in zip(derivatives(q, TSP, "savgol"), complete, strict=True):
        np.testing.assert_array_equal(np.isnan(got), np.column_stack([lost, np.zeros_like(lost)]))
        np.testing.assert_array_equal(got[~lost], expected[~lost])
