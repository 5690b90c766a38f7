"""What an arm would hardly have done is said; what noise, formats and clocks do is not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from arm_motion import KINDS, arm, clock, found, log_of, swing
from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.plausibility import format_resolution, largest_steps
from urmpipe_pipeline.sources import ReadOptions

SHARED = Path(__file__).parents[4] / "shared" / "logs"
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="the folder shared is not beside the checkout")


def test_a_first_row_off_the_motion_is_an_outlier() -> None:
    q, t = swing()
    q[0, 1] += 0.3
    step = q[0, 1] - q[1, 1]
    usual = np.abs(np.diff(q[1:-1, 1])).max()
    assert found(q, t) == [
        LogWarning(
            "outlier-first",
            f"an outlier, off the motion of the other rows: q2 by {step:.4g} rad (other steps: at most"
            f" {usual:.4g}); it is kept; remove it from the file if the arm was not there",
            1,
        )
    ]


def test_a_first_row_of_zeros_is_one_warning_for_all_joints() -> None:
    q, t = swing()
    q[0] = 0.0
    (warning,) = found(q, t)
    assert (warning.kind, warning.row) == ("outlier-first", 1)
    assert [name in warning.message for name in ("q1 by 0.", "q2 by 0.", "q3 by 0.")] == [True] * 3


def test_a_last_row_off_the_motion_is_an_outlier() -> None:
    q, t = swing()
    q[-1, 2] -= 0.5
    (warning,) = found(q, t)
    assert (warning.kind, warning.row) == ("outlier-last", 400)
    assert warning.message.startswith("an outlier, off the motion of the other rows: q3 by 0.")


def test_an_outlier_of_a_resting_arm_is_one() -> None:
    q = np.full((50, 2), 0.7)
    q[0] = 0.0
    assert [w.kind for w in found(q, clock(50, 0.01))] == ["outlier-first"]


def transient() -> tuple[FloatArray, FloatArray]:
    """A controller that settles: each step half of the one before."""
    t = clock(200, 0.005)
    return (0.2 * 0.5 ** np.arange(200))[:, None] * [1.0, -1.0], t


def stop_at_one_hertz() -> tuple[FloatArray, FloatArray]:
    """An arm that moves for the first second of a log with a row a second, and then rests."""
    q = np.full((60, 2), 0.5)
    q[0] = 0.0
    return q, np.arange(60.0)


def late_second_row() -> tuple[FloatArray, FloatArray]:
    """A recorder that waits for 2 s between its first row and its second."""
    q, t = swing(800)
    late = np.r_[0, 400:799]
    return q[late], t[late]


def jumps_everywhere() -> tuple[FloatArray, FloatArray]:
    """Poses, not a motion."""
    return np.random.default_rng(1).uniform(-0.7, 0.7, (100, 3)), clock(100, 0.05)


def too_short() -> tuple[FloatArray, FloatArray]:
    q, t = swing(9)
    q[0] += 0.3
    return q, t


def first_value_missing() -> tuple[FloatArray, FloatArray]:
    q, t = swing()
    q[0] = np.nan
    return q, t


def noisy_rest() -> tuple[FloatArray, FloatArray]:
    q = np.random.default_rng(2).normal(0.0, 1e-4, (1000, 3))
    q[1:, 0] = q[1, 0]  # and a joint that never moves again
    return q, clock(1000, 0.001)


def first_digit() -> tuple[FloatArray, FloatArray]:
    """A joint that creeps, in a format of two decimals: its last digit changes once, at the start."""
    q = np.full((200, 2), 0.02)
    q[0, 0] = 0.01
    return q, clock(200, 0.001)


NO_OUTLIERS = [
    swing, transient, stop_at_one_hertz, late_second_row, jumps_everywhere, too_short, first_value_missing,
    noisy_rest, first_digit,
]  # fmt: skip


@pytest.mark.parametrize("make", NO_OUTLIERS)
def test_what_is_no_outlier(make: Callable[[], tuple[FloatArray, FloatArray]]) -> None:
    q, t = make()
    assert [w.kind for w in found(q, t) if w.kind.startswith("outlier")] == []


# Repeated samples


@pytest.mark.parametrize(
    ("ratio", "said"),
    [
        (4.0, "4 rows (20 ms), 300 of 400 rows repeat the row before: a slow controller polled fast?"),
        (2.5, "2.5 rows (12.5 ms), 240 of 400 rows repeat the row before: a slow controller polled fast?"),
    ],
)  # fmt: skip
def test_a_slow_controller_polled_fast_repeats_its_rows(ratio: float, said: str) -> None:
    q, t = swing()
    (warning,) = found(q[(np.arange(400) // ratio * ratio).astype(int)], t)
    assert (warning.kind, warning.row) == ("repeated-samples", 2)
    assert warning.message == f"the joint values change only every {said}"
    assert warning.hints == (Hint("tsp", ratio * 0.005, "takes each value once"),)


def test_a_rest_among_repeated_rows_changes_nothing() -> None:
    q, t = swing(800)
    motion = np.r_[0:300, np.full(200, 300), 300:600]
    assert [w.kind for w in found(q[motion[np.arange(800) // 4 * 4]], t)] == ["repeated-samples"]


def test_the_speed_of_a_slow_controller_is_that_between_its_values() -> None:
    q, t = swing()
    polled = q[np.arange(400) // 4 * 4]  # 1.4 rad/s in steps of four rows: 5.6 rad/s from row to row
    assert [w.kind for w in found(polled, t, arm(3, velocity=1.5))] == ["repeated-samples"]
    assert [w.kind for w in found(polled, t, arm(3, velocity=0.5))][-1] == "speed-limit"


def held_once() -> tuple[FloatArray, FloatArray]:
    q, t = swing()
    q[100] = q[99]
    return q, t


def at_rest() -> tuple[FloatArray, FloatArray]:
    q, t = swing(2000)
    q[100:] = q[100]
    return q, t


def digit_by_digit() -> tuple[FloatArray, FloatArray]:
    """One joint crawls at a constant pace, in a format of 3 decimals: it changes every 4th row."""
    t = clock(2000, 0.005)
    return np.round(np.column_stack([0.05 * t, np.full(2000, 0.3)]), 3), t


def several_digit_by_digit() -> tuple[FloatArray, FloatArray]:
    q, t = swing(4000, 0.0005)
    return np.round(q, 2), t


def flicker() -> tuple[FloatArray, FloatArray]:
    """Encoders of an arm at rest, a digit up or down now and then."""
    rng = np.random.default_rng(3)
    return 1e-3 * np.cumsum(rng.choice([-1, 0, 0, 0, 0, 1], (5000, 2)), axis=0), clock(5000, 0.002)


@pytest.mark.parametrize("make", [swing, held_once, at_rest, digit_by_digit, several_digit_by_digit, flicker])
def test_what_is_no_slow_controller(make: Callable[[], tuple[FloatArray, FloatArray]]) -> None:
    q, t = make()
    assert found(q, t) == []


# Limits


FORMATS: list[tuple[str, Callable[[FloatArray], FloatArray]]] = [
    ("rad", lambda q: q),
    ("rad", lambda q: np.round(q, 2)),
    ("deg", lambda q: np.radians(np.round(np.degrees(q), 0))),
    ("rad", lambda q: q + np.random.default_rng(5).normal(0.0, 1e-3, q.shape)),
]


@pytest.mark.parametrize(("unit", "rounded"), FORMATS, ids=["exact", "2 decimals", "whole degrees", "noise"])
@pytest.mark.parametrize("spoiled", ["even", "jitter", "lost rows", "lost values", "wrapped"])
def test_nothing_is_said_of_sound_logs(
    unit: str, rounded: Callable[[FloatArray], FloatArray], spoiled: str
) -> None:
    rng = np.random.default_rng(6)
    for period in (0.001, 0.005, 0.05, 0.2):
        t = clock(int(rng.integers(20, 2000)), period)
        joints = int(rng.integers(1, 8))
        swings = np.sin(np.outer(t, rng.uniform(0.1, 1.9, joints)) + rng.uniform(0.0, 6.0, joints))
        q = swings * rng.uniform(0.2, 1.0, joints)  # up to 1.9 rad/s
        if spoiled == "wrapped":
            q = np.mod(q + 3.0 + np.pi, 2.0 * np.pi) - np.pi
        q = rounded(q)
        if spoiled == "jitter":
            t = t + rng.uniform(0.0, 0.9 * period, len(t))
        elif spoiled == "lost rows":
            kept = np.sort(rng.choice(len(t), len(t) * 9 // 10, replace=False))
            t, q = t[kept], q[kept]
        elif spoiled == "lost values":
            q = np.where(rng.random(q.shape) < 0.05, np.nan, q)
        assert found(q, t, arm(joints, velocity=2.2), unit=unit) == []


# Real logs, and the whole way


@pytest.mark.slow
@pytest.mark.parametrize(
    "pattern", ["coppeliasim.csv", "matlab.csv", "counter_rotating.csv", "solidworks/phi*.csv"]
)
def test_nothing_is_said_of_the_bundled_logs(pattern: str) -> None:
    run = ingest_log(sorted(LOGS.glob(pattern)), robot=load_robot("urm6"))
    assert {w.kind for w in run.warnings} <= {"assumed-unit"}


@pytest.mark.slow
@needs_shared
@pytest.mark.parametrize(
    ("file", "robot"),
    [
        ("ur5e-rtde-static/robot_data.csv", "ur5e"),
        ("ur-rtde-10rows/robot_data.csv", "ur5e"),
        ("panda-matlab-ascii/q_Traj1_Grad.txt", None),
        ("panda-matlab-ascii/q_Traj1_PI.txt", None),
        ("unitree-z1-noheader/joint_states.csv", None),
        ("pybotics-ur10-fk/ur10-joints-poses.csv", "ur10"),
    ],
)
def test_nothing_is_said_of_sound_real_logs(file: str, robot: str | None) -> None:
    joints = ("1", "2", "3", "4", "5", "6") if "unitree" in file else ()  # of its twelve columns
    run = ingest_log([SHARED / file], robot=robot and load_robot(robot), read=ReadOptions(joints=joints))  # type: ignore[arg-type]
    assert KINDS & {w.kind for w in run.warnings} == set()


@needs_shared
def test_the_real_log_with_an_outlier_says_so() -> None:
    run = ingest_log([SHARED / "nurds-2joint" / "joint_states.csv"])
    (warning,) = [w for w in run.warnings if w.kind in KINDS]
    assert warning == LogWarning(
        "outlier-first",
        "an outlier, off the motion of the other rows: joint1 by 0.6856 rad (other steps: at most"
        " 0.09092);"
        " it is kept; remove it from the file if the arm was not there",
        1,
    )
    assert run.log.q[0, 0] == 0.7116998434066772


def test_without_a_clock_nothing_is_said_of_speeds(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{0.2 * k if k < 5 else 1.0:.3f},{0.1 * (k % 2):.6f}" for k in range(30)]
    path.write_text("q1[rad],q2[rad]\n" + "\n".join(rows) + "\n")
    assert [w.kind for w in ingest_log([path]).warnings] == ["assumed-period"]
    given = ingest_log([path], read=ReadOptions(period=0.005))
    assert [w.kind for w in given.warnings] == ["speed-limit"]


@pytest.mark.parametrize("rows", [1, 2, 3, 4])
def test_nothing_is_said_of_a_log_of_few_rows(rows: int) -> None:
    q, t = swing(rows)
    assert found(q, t, arm(3, lower=-1.0, upper=1.0, velocity=2.0)) == []


def test_nothing_is_said_of_a_path(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("t[s],x[m],y[m],z[m]\n0,0,0,0\n0.1,9,9,9\n0.2,0,0,0\n")
    assert ingest_log([path]).warnings == ()


def test_the_largest_step_is_that_of_numpy() -> None:
    for rows in (2, 63, 64, 65, 16_384, 16_385, 40_000):
        q = np.random.default_rng(rows).normal(size=(rows, 5))
        np.testing.assert_array_equal(largest_steps(q), np.abs(np.diff(q, axis=0)).max(axis=0))
        q[rows // 2, 3] = np.nan
        assert np.isnan(largest_steps(q)).tolist() == [False, False, False, True, False]


def test_the_step_of_the_format_is_seen() -> None:
    q, t = swing()
    assert format_resolution(log_of(np.round(q, 3), t)).tolist() == [0.001, 0.001, 0.001]
    assert format_resolution(log_of(q, t)).tolist() == [0.0, 0.0, 0.0]
    degrees = np.radians(np.round(np.degrees(q), 1))
    np.testing.assert_allclose(format_resolution(log_of(degrees, t, "deg")), np.radians(0.1))
    assert format_resolution(log_of(10.0 * q, t, digits=4)).tolist() == [0.001, 0.001, 0.001]
