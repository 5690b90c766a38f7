"""Ingest: the laws that hold from the file to the arm."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np

from asserting import refusal, there
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint, LogError, OptionError
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.math3d import translation
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.sources import ReadOptions

SHARED = Path(__file__).resolve().parents[3].parent / "shared"
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="the real logs of ../shared are not there")
URM6 = load_robot("urm6")
RAD = ReadOptions(unit={"": "rad"})


def write(path: Path, q: FloatArray, header: str = "t,q1,q2,q3,q4,q5,q6", tsp: float = 0.005) -> Path:
    t = tsp * np.arange(len(q))
    np.savetxt(path, np.column_stack([t, q]), delimiter=",", header=header, comments="", fmt="%.17g")
    return path


def wrap(x: FloatArray) -> FloatArray:
    return x - 2 * np.pi * np.floor((x + np.pi) / (2 * np.pi))


@pytest.mark.slow
@given(st_np.arrays(float, st.tuples(st.integers(3, 60), st.just(6)), elements=st.floats(-1.5, 1.5)))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_wrapped_log_is_unwrapped_and_the_arm_does_not_notice(tmp_path: Path, steps: FloatArray) -> None:
    x = np.cumsum(steps, axis=0)
    x -= 2 * np.pi * np.round(x[0] / (2 * np.pi))
    run = ingest_log([write(tmp_path / "log.csv", wrap(x))], robot=URM6, read=RAD)
    np.testing.assert_allclose(run.q, x, rtol=0, atol=3e-14)  # to 90 rad: two roundings of 1.4e-14
    # the arm is 1.35 m long: an angle's rounding of 3e-14 moves its tip by less than 1e-12
    np.testing.assert_allclose(there(run.tcp).position, positions_over_log(URM6, wrap(x)), rtol=0, atol=1e-12)


def test_every_repolarization_is_listed_with_its_place_and_turns(tmp_path: Path) -> None:
    x = np.zeros((40, 6))
    x[:, 2] = np.concatenate([np.linspace(2.0, 5.0, 20), np.linspace(5.0, 2.0, 20)])
    run = ingest_log([write(tmp_path / "log.csv", wrap(x))], robot=URM6, read=RAD)
    up, down = run.repolarizations
    first = int(np.argmax(x[:, 2] > np.pi))
    assert (up.joint, up.row, up.sample, up.before, up.after) == ("q3", first + 1, first, 0, 1)
    assert up.t == pytest.approx((first - 0.5) * 0.005, abs=1e-12)
    assert up.half_period == 0.0025
    assert up.step == pytest.approx(3.0 / 19 - 2 * np.pi, abs=1e-12)
    assert (down.before, down.after) == (1, 0)
    assert up.to_dict().keys() >= {"joint", "row", "sample", "t", "step", "from", "to"}


def test_without_a_robot_there_are_no_kinematics(tmp_path: Path) -> None:
    run = ingest_log([write(tmp_path / "log.csv", np.ones((5, 6)))], read=RAD)
    assert run.tcp is None
    assert run.robot is None
    assert "px" not in run.to_frame()
    assert run.to_dict()["robot"] is None


def test_prismatic_joints_are_not_repolarized(tmp_path: Path) -> None:
    arm = Chain("rail", (Joint("s", "prismatic"), Joint("phi", "revolute")), tip=translation(0.1, 0.0, 0.0))
    q = np.column_stack([np.array([0.0, 0.1, 6.3, 6.4, 0.1]), np.array([3.0, 3.1, -3.1, -3.0, 3.1])])
    run = ingest_log(
        [write(tmp_path / "log.csv", q, "t,q1,q2")],
        robot=arm,
        read=ReadOptions(unit={"q2": "rad", "q1": "m"}),
    )
    np.testing.assert_array_equal(run.q[:, 0], q[:, 0])
    assert [one.joint for one in run.repolarizations] == ["q2", "q2"]


def test_a_missing_cell_is_a_missing_sample(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", np.full((9, 6), 0.5))
    lines = path.read_text().splitlines()
    lines[4] = ",".join([*lines[4].split(",")[:3], "NaN", *lines[4].split(",")[4:]])
    path.write_text("\n".join(lines))
    run = ingest_log([path], robot=URM6, read=RAD)
    assert np.argwhere(np.isnan(run.q)).tolist() == [[3, 2]]
    assert np.isnan(there(run.tcp).position[3]).all()
    assert [w.kind for w in run.warnings] == ["missing"]


@pytest.mark.filterwarnings("error")
def test_huge_numbers_are_read_without_a_word_of_numpy(tmp_path: Path) -> None:
    q = np.tile(np.linspace(0.2, 0.9, 40)[:, None], (1, 12))
    q[7, [1, 6, 8, 9]] = 1e300, 1e200, 1e300, 1e250
    path = write(tmp_path / "log.csv", q, "t,q1,q2,q3,q4,q5,q6,x,y,z,rx,ry,rz")
    run = ingest_log([path], robot=load_robot("ur5e"), read=RAD)
    assert run.q[7, 1] == 1e300


def test_recorded_rates_are_used_where_they_agree(tmp_path: Path) -> None:
    t = 0.005 * np.arange(200)
    q, rates = np.sin(t)[:, None] + np.zeros(6), np.cos(t)[:, None] + np.zeros(6)
    header = "t,q1,q2,q3,q4,q5,q6,dq1,dq2,dq3,dq4,dq5,dq6"
    good = ingest_log([write(tmp_path / "a.csv", np.hstack([q, rates]), header)], robot=URM6, read=RAD)
    np.testing.assert_array_equal(good.qd, rates)
    bad = ingest_log([write(tmp_path / "b.csv", np.hstack([q, 0 * rates]), header)], robot=URM6, read=RAD)
    assert np.abs(bad.qd - rates).max() < 1e-5
    assert "recorded-rates" in [w.kind for w in bad.warnings]


@pytest.mark.parametrize(("factor", "unit", "wanted"), [(1000.0, "s", "ms"), (0.001, "ms", "s")])
def test_rates_that_agree_in_another_unit_of_time_name_it(
    tmp_path: Path, factor: float, unit: str, wanted: str
) -> None:
    t = 0.008 * np.arange(200)
    table = np.column_stack((t * factor * (1000.0 if unit == "ms" else 1.0), np.sin(t), np.cos(t)))
    path = tmp_path / "log.csv"
    np.savetxt(path, table, "%.17g", ",", header=f"t 1 [{unit}],q1 [rad],dq1 [rad/s]", comments="")
    (warning,) = [one for one in ingest_log([path]).warnings if one.kind == "recorded-rates"]
    hint = "ms" if wanted == "ms" else "s, not in ms"
    assert warning.message == (
        "the recorded rates do not agree with the differences of the joint values, but would with the time in"
        f" {hint}; the differences are used"
    )
    assert warning.hints == (Hint("unit", {"t 1": wanted}, "applies this"),)
    assert ingest_log([path], read=ReadOptions(unit={"t 1": wanted})).warnings == ()


def test_the_rates_that_export_writes_are_known_again(tmp_path: Path) -> None:
    t = 0.005 * np.arange(50)
    path = tmp_path / "log.csv"
    header = "t [s],joint1 [rad],d_joint1 [rad/s],dd_joint1 [rad/s2]"
    table = np.column_stack((t, np.sin(t), np.cos(t), -np.sin(t)))
    np.savetxt(path, table, "%.17g", ",", header=header, comments="")
    log = ingest_log([path]).log
    assert log.joints == ("joint1",)
    np.testing.assert_array_equal(np.hstack((there(log.qd), there(log.qdd))), table[:, 2:])


def test_the_table_has_a_row_a_grid_sample(tmp_path: Path) -> None:
    run = ingest_log([write(tmp_path / "log.csv", np.full((7, 6), 0.5))], robot=URM6, read=RAD)
    frame = run.to_frame()
    assert len(frame) == 7
    assert list(frame.columns[:3]) == ["t", "q1", "q2"]
    np.testing.assert_array_equal(frame[["px", "py", "pz"]].to_numpy(), there(run.tcp).position)


def test_a_log_with_other_joints_than_the_robot_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", np.ones((5, 3)), "t,q1,q2,q3")
    with pytest.raises(LogError, match="6"):
        ingest_log([path], robot=URM6, read=RAD)


@needs_shared
def test_real_jumps_that_are_no_wraps_stay() -> None:
    run = ingest_log([SHARED / "logs" / "plotjuggler" / "fake_joints.csv"], read=RAD)
    assert run.repolarizations == ()
    large = [(one.row, one.joint) for one in run.audit if one.kind == "unexplained"]
    assert large == [(row, f"field.position.joint_{j}") for row, j in ((2, 0), (1412, 3), (1413, 3))]
    (told,) = [one for one in run.warnings if one.kind == "large-step"]
    assert (told.row, told.message) == (
        2,
        "3 steps of field.position.joint_0 and field.position.joint_3 by more than 90 deg are not wraps and"
        " are kept; the largest, of field.position.joint_3 by 682.7 deg, is to row 1412",
    )
    assert "recorded-rates" in [w.kind for w in run.warnings]  # its velocity columns are all 0


@needs_shared
def test_a_real_controller_log_agrees_with_the_catalogue() -> None:
    from urmpipe_pipeline.comparison.compare import CompareOptions, compare_recorded

    run = ingest_log([SHARED / "logs" / "ur5e-rtde-static" / "robot_data.csv"], robot=load_robot("ur5e"))
    result = compare_recorded(run, CompareOptions({"axis": 0.002}))
    assert result.verdict == "pass"
    assert 0.001 < result.runs[0].statistics["norm"].max < 0.002  # nominal geometry: within 1.6 mm


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"tsp": 0.0}, "tsp (--tsp): found 0 s, allowed: a positive time below 1e+09 s"),
        ({"tsp": -0.005}, "tsp (--tsp): found -0.005 s, allowed: a positive time below 1e+09 s"),
        ({"tsp": math.nan}, "tsp (--tsp): found nan s, allowed: a positive time below 1e+09 s"),
        ({"derivative": "savgo"}, "derivative (--derivative): found savgo, allowed: central, savgol"),
        (
            {"read": ReadOptions(period=1e300)},
            "period (--period): found 1e+300 s, allowed: less than 2.30584e+09 s for 2 rows",
        ),
    ],
)  # fmt: skip
def test_options_that_make_no_sense_are_refused(tmp_path: Path, options: dict[str, Any], said: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text("q1,q2\n0,1\n1,2\n")
    assert refusal(OptionError, ingest_log, [path], **options) == said


@pytest.mark.parametrize("rows", [1, 2])
def test_few_samples_keep_their_recorded_rates(tmp_path: Path, rows: int) -> None:
    """Two samples have no differences of the second order: nothing contradicts what was recorded."""
    path = tmp_path / "log.csv"
    path.write_text("".join(["t,q1,qd1\n", "0,0.5,0.25\n", "0.1,0.6,0.75\n"][: rows + 1]))
    run = ingest_log([path], read=RAD)
    assert run.qd[:, 0].tolist() == [0.25, 0.75][:rows]
    assert "recorded-rates" not in [warning.kind for warning in run.warnings]
