"""Torques that are noise: said where smoothing takes it away, and never of a motion that is only sharp."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from arm_motion import clock
from asserting import there
from presented import cells, figures
from urmpipe_models.dynamics.equations import torques_over_log
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.section import Table
from urmpipe_pipeline.results import present, read_recording, write_recording
from urmpipe_pipeline.runs.derivatives import Method, derivatives
from urmpipe_pipeline.runs.ingest import ingest_log, with_robot
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources import ReadOptions

UR10 = load_robot("ur10")
TSP = 0.005
T = clock(600, TSP)
START = np.array([0.1, -1.2, 1.0, -0.5, 0.3, 0.2])


def smooth(t: FloatArray = T) -> FloatArray:
    """Return a slow motion of six joints in [rad], shape (n, 6)."""
    return START + 0.3 * np.sin(2.0 * t[:, np.newaxis] + np.arange(6))


def noise(size: float) -> FloatArray:
    """Return white noise of a standard deviation in [rad], shape (600, 6)."""
    return np.random.default_rng(1).normal(0.0, size, (len(T), 6))


def speed_steps() -> FloatArray:
    """Return a motion to and fro at constant speeds, the turns not all at once."""
    return START + 0.5 * np.abs((T[:, np.newaxis] / 2.0 + np.arange(6) / 7.0) % 1.0 - 0.5)


def acceleration_steps() -> FloatArray:
    """Return a motion whose accelerations change their sign every 0.1 s."""
    bang = np.where((T[:, np.newaxis] + np.arange(6) / 50.0) % 0.2 < 0.1, 5.0, -5.0)
    return START + np.cumsum(np.cumsum(bang, axis=0), axis=0) * TSP**2


def log_of(folder: Path, q: FloatArray, form: str = "%.15g", *, t: FloatArray | None = T) -> Path:
    """Write a log of joint values in [rad], with times in [s] or without."""
    path, names = folder / "log.csv", [f"q{k} [rad]" for k in range(1, 7)]
    table = q if t is None else np.column_stack((t, q))
    forms = [form] * 6 if t is None else ["%.3f", *[form] * 6]
    header = ",".join(names if t is None else ["t [s]", *names])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt=forms)
    return path


def noisy(run: Run) -> list[LogWarning]:
    return [one for one in run.warnings if one.kind == "torque-noise"]


def rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


@pytest.mark.parametrize(
    ("q", "form", "others"),
    [(smooth(), "%.3f", "q1, q3 and q4"), (smooth() + noise(1e-4), "%.9f", "q1 and q3")],
)
def test_noise_and_fixed_decimals_are_said_with_the_torques_that_smoothing_leaves(
    q: FloatArray, form: str, others: str, tmp_path: Path
) -> None:
    run = ingest_log([log_of(tmp_path, q, form)], robot=UR10)
    rough, calm = (
        torques_over_log(UR10, run.q, *derivatives(run.q, TSP, way)) for way in ("central", "savgol")
    )
    np.testing.assert_array_equal(run.tau, rough)
    (warning,) = noisy(run)
    assert warning.message == (
        "joint values are noisy or coarse for torques: accelerations by differences give"
        f" q2 {rms(rough)[1]:.4g} N.m rms, smoothed over 31 samples"
        f" {rms(calm)[1]:.4g} N.m; also {others}"
    )
    assert warning.hints == (Hint("derivative", "savgol", "smooths the accelerations"),)
    followed = ingest_log([log_of(tmp_path, q, form)], robot=UR10, derivative="savgol")
    assert noisy(followed) == []
    true = torques_over_log(UR10, smooth(), *derivatives(smooth(), TSP))
    assert np.abs(rms(there(followed.tau)) - rms(true)).max() < 0.02 * rms(true).max()


@pytest.mark.parametrize("make", [smooth, speed_steps, acceleration_steps, lambda: smooth() + noise(1e-7)])
def test_smooth_and_sharp_motions_are_no_noise(make: Callable[[], FloatArray], tmp_path: Path) -> None:
    assert noisy(ingest_log([log_of(tmp_path, make(), "%.12f")], robot=UR10)) == []


def test_a_fast_motion_with_few_samples_is_no_noise(tmp_path: Path) -> None:
    """At 50 ms the smoothing window of 1.55 s is longer than the period of 1 s: it takes the motion away."""
    t = clock(600, 0.05)
    q = START + 0.1 * np.sin(2.0 * np.pi * t[:, np.newaxis] + np.arange(6))
    run = ingest_log([log_of(tmp_path, q, "%.12f", t=t)], robot=UR10)
    assert noisy(run) == []
    calm = torques_over_log(UR10, run.q, *derivatives(run.q, 0.05, "savgol"))
    assert rms(there(run.tau) - calm)[0] > rms(calm)[0]


def test_a_step_that_is_no_motion_is_no_noise(tmp_path: Path) -> None:
    q = smooth()
    q[300:, 0] += 2.0
    run = ingest_log([log_of(tmp_path, q, "%.12f")], robot=UR10)
    assert np.isnan(there(run.tau)).any()
    assert noisy(run) == []


@pytest.mark.parametrize("rows", [1, 3, 31])
def test_a_log_no_longer_than_a_window_has_no_measure(rows: int, tmp_path: Path) -> None:
    run = ingest_log([log_of(tmp_path, (smooth() + noise(1e-3))[:rows], "%.9f", t=T[:rows])], robot=UR10)
    assert noisy(run) == []


@pytest.mark.parametrize("read", [ReadOptions(), ReadOptions(poses=True)])
def test_an_assumed_pace_and_still_poses_are_no_noise(read: ReadOptions, tmp_path: Path) -> None:
    run = ingest_log([log_of(tmp_path, smooth() + noise(1e-4), "%.9f", t=None)], robot=UR10, read=read)
    assert noisy(run) == []


def test_it_rests_on_the_robot(tmp_path: Path) -> None:
    bare = replace(UR10, inertials=())
    run = ingest_log([log_of(tmp_path, smooth() + noise(1e-4), "%.9f")], robot=bare)
    assert noisy(run) == []
    heavy = with_robot(run, UR10)
    assert len(noisy(heavy)) == 1
    assert noisy(with_robot(heavy, bare)) == []


# --- what made the accelerations -------------------------------------------------------------------


def torque_table(run: Run) -> list[Table]:
    return [one for one in present(run).body.tables if one.title == "Joint torques"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("derivative", "rows", "made", "words"),
    [
        (None, 600, "central", "central differences"),
        ("savgol", 600, "savgol", "savgol over 31 samples"),
        ("savgol", 20, "savgol", "savgol over 19 samples"),
        ("savgol", 4, "central", "central differences"),
    ],
)
def test_what_made_the_accelerations_is_told(
    derivative: Method | None, rows: int, made: str, words: str, tmp_path: Path
) -> None:
    path = log_of(tmp_path, smooth()[:rows], t=T[:rows])
    run = ingest_log([path], robot=UR10, derivative=derivative)
    assert (run.derivative, run.to_dict()["derivative"]) == (made, made)
    (table,) = torque_table(run)
    assert table.note == (
        "The torque that the motion takes, by inverse dynamics, without friction and load at the tool."
        f" Accelerations: {words}."
    )
    (figure,) = (one for one in figures(present(run).body) if one.title == "Joint torques")
    assert figure.caption == (
        "What the joints must exert for this motion, by the masses of the robot (inverse dynamics); friction"
        f" and a load at the tool are not in it. Accelerations: {words}. First all joints, then each,"
        " numbered from the base. Dashed: its effort limit; blue: within it; red: beyond it."
    )
    write_recording(run, tmp_path / "log.rrd")
    back = read_recording(tmp_path / "log.rrd")
    assert isinstance(back, Run) and back.derivative == made


@pytest.mark.parametrize(("factor", "made"), [(-4.0, "recorded"), (4.0, "central")])
def test_recorded_accelerations_are_told_where_they_are_taken(
    factor: float, made: str, tmp_path: Path
) -> None:
    q = smooth()
    path = log_of(tmp_path, q)
    names = ["t [s]", *(f"q{k} [rad]" for k in range(1, 7)), *(f"dd_q{k} [rad/s2]" for k in range(1, 7))]
    table = np.column_stack((T, q, factor * (q - START)))
    np.savetxt(path, table, "%.15g", ",", header=",".join(names), comments="")
    assert ingest_log([path], robot=UR10).derivative == made


def test_a_recording_that_does_not_tell_says_nothing(tmp_path: Path) -> None:
    run = replace(ingest_log([log_of(tmp_path, smooth())], robot=UR10), derivative="")
    assert "Accelerations" not in torque_table(run)[0].note
    assert run.to_dict()["derivative"] is None


# --- logs without a torque -------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [1, 2])
def test_a_log_too_short_for_accelerations_has_no_torques(rows: int, tmp_path: Path) -> None:
    run = ingest_log([log_of(tmp_path, smooth()[:rows], t=T[:rows])], robot=UR10)
    assert (run.tau, run.derivative) == (None, "")
    assert (run.to_dict()["torques"], run.to_dict()["derivative"]) == ([], None)
    assert torque_table(run) == []
    assert [one for one in figures(present(run).body) if "orque" in one.title] == []


def test_a_joint_without_a_torque_has_no_share(tmp_path: Path) -> None:
    run = ingest_log([log_of(tmp_path, smooth())], robot=UR10)
    tau = there(run.tau).copy()
    tau[:, 2] = np.nan
    run = replace(run, tau=tau)
    told = run.to_dict()["torques"][2]
    assert np.isnan(told["max"]) and told["effort"] == UR10.moving[2].effort
    assert (told["effort_share"], told["out_fraction"]) == (None, None)
    (table,) = torque_table(run)
    assert (cells(table)["effort_share"][2], cells(table)["out_fraction"][2]) == (None, None)
