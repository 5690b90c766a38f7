"""Joints beyond their limits and faster than they can be are said; what rounding and clocks do is not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from arm_motion import arm, clock, found, swing
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_pipeline.joint_log import LogWarning


def test_a_joint_beyond_its_limits_is_counted() -> None:
    q, t = swing()
    beyond = np.flatnonzero(q[:, 0] > 0.905)  # rounding explains 5 mrad
    worst = int(np.argmax(q[:, 0]))
    limited = Chain("arm", (Joint("q1", lower=-1.2, upper=0.9), Joint("q2"), Joint("q3", lower=-2.0)))
    assert 100 < len(beyond) < 400
    assert found(q, t, limited) == [
        LogWarning(
            "joint-limit",
            f"q1 is beyond its limits of -1.2 to 0.9 rad in {len(beyond)} of 400 rows, at worst"
            f" {q[worst, 0]:.6g} in row {worst + 1}: check robot, unit, sign and zero",
            int(beyond[0]) + 1,
        )
    ]


def test_several_joints_beyond_their_limits_are_one_warning() -> None:
    q, t = swing()
    (warning,) = found(q, t, arm(3, lower=-0.5, upper=0.5))
    beyond = [np.flatnonzero(np.abs(column) > 0.505) for column in q.T]
    worst = int(np.argmax(np.abs(q).max(axis=0)))
    others = " and ".join(f"q{j + 1} ({len(beyond[j])} rows)" for j in range(3) if j != worst)
    assert (warning.kind, warning.row) == ("joint-limit", min(int(rows[0]) for rows in beyond) + 1)
    assert warning.message.startswith(f"q{worst + 1} is beyond its limits of -0.5 to 0.5 rad in ")
    assert warning.message.endswith(f"; also {others}: check robot, unit, sign and zero")


def test_several_joints_that_are_too_fast_are_one_warning() -> None:
    q, t = swing()
    q[200:, 1] += 0.3
    q[100:, 2] -= 0.4
    (warning,) = found(q, t)
    assert (warning.kind, warning.row) == ("speed-limit", 101)
    assert warning.message.startswith("q3 moves faster than 20 rad/s in 1 of 399 steps, at worst at ")
    assert warning.message.endswith(" rad/s to row 101; also q2 (1 step): check robot, unit and clock")


def test_limits_hold_after_the_repolarization() -> None:
    t = clock(2000, 0.005)
    turned = np.column_stack([1.0 * t, 0.1 * t])
    wrapped = np.mod(turned + np.pi, 2.0 * np.pi) - np.pi
    limited = arm(2, lower=-2 * np.pi, upper=2 * np.pi)
    (warning,) = found(wrapped, t, limited)
    assert warning.kind == "joint-limit"
    assert warning.message.startswith(
        "q1 is beyond its limits of -6.28319 to 6.28319 rad in 742 of 2000 rows"
    )
    assert warning.row == 1259  # t = 6.29 s: more than a turn and 0.005 rad
    assert found(wrapped, t, arm(2)) == []


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (3.1416, "rad", 0),  # the robot's file says 3.14
        (3.16, "rad", 1),
        (np.radians(181.0), "deg", 0),  # whole degrees: 180.4 is 180, 180.6 is 181
        (np.radians(183.0), "deg", 1),
    ],
)
def test_what_rounding_explains_is_within_the_limits(value: float, unit: str, said: int) -> None:
    q = np.full((50, 1), value)
    robot = arm(1, lower=-3.14, upper=3.14)
    assert len(found(q, clock(50, 0.005), robot, unit=unit)) == said


def test_values_that_are_missing_hide_no_limit() -> None:
    q, t = swing()
    q[100:120, 1] = np.nan
    q[200, 1] = 1.3
    kinds = [w.kind for w in found(q, t, arm(3, lower=-1.1, upper=1.1))]
    assert kinds == ["joint-limit", "speed-limit"]


# Speeds


def test_a_step_that_no_joint_can_do_is_named() -> None:
    q, t = swing()
    q[200:, 1] += 0.4
    step = q[200, 1] - q[199, 1]
    (warning,) = found(q, t)
    assert warning == LogWarning(
        "speed-limit",
        f"q2 moves faster than 20 rad/s in 1 of 399 steps, at worst at {step / 0.005:.4g} rad/s to row 201:"
        " check robot, unit and clock",
        201,
    )


def test_the_robot_says_how_fast_its_joints_are() -> None:
    q, t = swing()
    slow = Chain("arm", (Joint("q1", velocity=0.5), Joint("q2", velocity=1.1), Joint("q3")))
    (warning,) = found(q, t, slow)
    speed = np.abs(np.diff(q[:, 0])) / 0.005
    many = int((speed > 0.55 + 5 * np.median(np.abs(np.diff(q[:, 0], 2))) / 0.005).sum())
    assert warning.message.startswith(f"q1 moves faster than 0.5 rad/s in {many} of 399 steps")
    assert found(q, t, arm(3, velocity=1.4)) == []


def test_a_step_that_is_told_already_is_not_told_again() -> None:
    q, t = swing()
    q[200:, 1] += 2.5  # large-step
    q[0, 0] += 0.5  # outlier-first
    assert [w.kind for w in found(q, t)] == ["outlier-first"]


def test_sliding_joints_are_fast_only_by_their_robot() -> None:
    q, t = swing()
    q[200:, 1] += 0.4
    assert found(q, t, slides=True) == []
    robot = Chain("gantry", tuple(Joint(f"q{j}", kind="prismatic", velocity=2.0) for j in range(3)))
    (warning,) = found(q, t, robot, slides=True)
    assert "q2 moves faster than 2 m/s in 1 of 399 steps" in warning.message


def wraps() -> dict[str, Any]:
    t = clock(3000, 0.005)
    return {"q": np.mod(np.outer(t, [1.0, -2.0]) + np.pi, 2 * np.pi) - np.pi, "t": t}


def hurrying_clock() -> dict[str, Any]:
    """Rows of an even motion whose clock is late by up to a period: some follow within 5 us."""
    q, t = swing(1000, 0.001)
    late = np.where(np.arange(1000) % 10 == 3, 0.000995, 0.0)
    return {"q": q, "t": t + late}


def tenths_of_degrees() -> dict[str, Any]:
    """A step of the format is 1.75 rad/s."""
    q, t = swing(2000, 0.001)
    return {"q": np.radians(np.round(np.degrees(q), 1)), "t": t, "unit": "deg", "robot": arm(3, velocity=1.5)}


def four_digits() -> dict[str, Any]:
    """A step of the format is 1 mrad, 1 rad/s."""
    q, t = swing(2000, 0.001)
    q = np.array([[float(f"{value:.3e}") for value in row] for row in 2.0 * q])
    return {"q": q, "t": t, "digits": 4, "robot": arm(3, velocity=2.8)}


def noise() -> dict[str, Any]:
    """Potentiometers: 10 mrad of noise at 1 kHz is 50 rad/s."""
    q, t = swing(5000, 0.001)
    return {"q": q + np.random.default_rng(4).normal(0.0, 0.01, q.shape), "t": t}


def gap() -> dict[str, Any]:
    q, t = swing(2000)
    kept = np.r_[0:500, 900:2000]
    return {"q": q[kept], "t": t[kept]}


def unknown_times() -> dict[str, Any]:
    q, t = swing(400, 0.1)
    return {"q": q * [1.0, 2.0, 3.0], "t": 0.05 * t, "timed": False}


SLOW_ENOUGH = [wraps, hurrying_clock, tenths_of_degrees, four_digits, noise, gap, unknown_times]


@pytest.mark.parametrize("make", SLOW_ENOUGH)
def test_what_is_no_impossible_speed(make: Callable[[], dict[str, Any]]) -> None:
    assert found(**make()) == []


# Sound logs at random
