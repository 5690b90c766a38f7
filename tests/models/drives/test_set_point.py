"""Set points as closed forms of time: their promises of the move, and that the outputs belong together."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from urmpipe_models.drives import (
    CORNER_SLACK,
    RAMP,
    STEP,
    TRAPEZOID,
    JointMotion,
    evaluate_setpoint,
    ramp,
    step,
    trapezoid,
)

positions = st.floats(-10.0, 10.0)
limits = st.floats(0.05, 20.0)


def duration(way: float, speed: float, acceleration: float) -> float:
    """Return how long a trapezoid takes: its two halves are a triangle where it is too short."""
    if way < speed**2 / acceleration:
        return float(2.0 * np.sqrt(way / acceleration))
    return way / speed + speed / acceleration


def test_the_step_is_at_its_target_from_its_time_on() -> None:
    found = step(np.array([0.0, 0.999, 1.0, 5.0]), 1.0, 0.5, -2.0)
    np.testing.assert_array_equal(found.position, [0.5, 0.5, -2.0, -2.0])
    np.testing.assert_array_equal(found.velocity, np.zeros(4))
    np.testing.assert_array_equal(found.acceleration, np.zeros(4))


def test_a_corner_is_reached_just_its_slack_early() -> None:
    early = np.array([np.nextafter(-CORNER_SLACK, -1.0), -CORNER_SLACK])
    np.testing.assert_array_equal(step(early, 0.0, 0.5, -2.0).position, [0.5, -2.0])
    np.testing.assert_array_equal(ramp(early, 0.0, 0.5, -2.0, 3.0).velocity, [0.0, -3.0])


def test_the_ramp_goes_with_its_speed_all_the_way() -> None:
    found = ramp(np.array([0.0, 1.0, 1.25, 2.0, 3.0]), 1.0, 0.5, -1.5, 2.0)
    np.testing.assert_array_equal(found.position, [0.5, 0.5, 0.0, -1.5, -1.5])
    np.testing.assert_array_equal(found.velocity, [0.0, -2.0, -2.0, 0.0, 0.0])
    np.testing.assert_array_equal(found.acceleration, np.zeros(5))


def test_the_way_of_a_ramp_is_what_lies_between_its_ends() -> None:
    found = ramp(np.array([0.5, 0.75, 1.0]), 0.0, 3.0, 1.0, 2.0)
    np.testing.assert_array_equal(found.position, [2.0, 1.5, 1.0])
    np.testing.assert_array_equal(found.velocity, [-2.0, -2.0, 0.0])


def test_the_trapezoid_at_its_corners_and_midway() -> None:
    # 4 rad with 2 rad/s and 4 rad/s2: 0.5 s up over 0.5 rad, 1.5 s level over 3 rad, 0.5 s down.
    t = 1.0 + np.array([-0.5, 0.0, 0.25, 0.5, 1.25, 2.0, 2.25, 2.5, 9.0])
    found = trapezoid(t, 1.0, -1.0, 3.0, 2.0, 4.0)
    np.testing.assert_allclose(
        found.position, [-1.0, -1.0, -0.875, -0.5, 1.0, 2.5, 2.875, 3.0, 3.0], rtol=0.0, atol=1e-15
    )
    np.testing.assert_allclose(
        found.velocity, [0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0, 0.0], rtol=0.0, atol=1e-15
    )
    np.testing.assert_array_equal(found.acceleration, [0.0, 4.0, 4.0, 0.0, 0.0, -4.0, -4.0, 0.0, 0.0])


def test_a_short_trapezoid_is_a_triangle_that_turns_back_halfway() -> None:
    found = trapezoid(np.array([0.25, 0.5, 0.75, 1.0]), 0.0, 0.0, 1.0, 100.0, 4.0)
    np.testing.assert_array_equal(found.position, [0.125, 0.5, 0.875, 1.0])
    np.testing.assert_array_equal(found.velocity, [1.0, 2.0, 1.0, 0.0])
    np.testing.assert_array_equal(found.acceleration, [4.0, -4.0, -4.0, 0.0])


@given(positions, positions, limits, limits, st.floats(-1.0, 1.0))
@example(1.0, 1.0, 2.0, 10.0, 0.1)
@example(0.0, 5e-324, 2.0, 10.0, 0.1)
def test_a_trapezoid_keeps_its_limits_stays_on_its_way_and_arrives_to_the_bit_on_time(
    initial: float, target: float, speed: float, acceleration: float, begin: float
) -> None:
    total = duration(abs(target - initial), speed, acceleration)
    t = begin + np.linspace(-0.1, 1.1, 401) * max(total, 1e-3)
    found = trapezoid(t, begin, initial, target, speed, acceleration)
    slack = 1.0 + 1e-12  # a product of roots, rounded
    assert np.abs(found.velocity).max() <= speed * slack
    assert np.abs(found.acceleration).max() <= acceleration
    low, high = sorted((initial, target))
    assert found.position.min() >= low - 1e-12
    assert found.position.max() <= high + 1e-12
    arrived = t >= begin + total * slack + 1e-12
    assert (found.position[arrived] == target).all()
    assert (found.velocity[arrived] == 0.0).all()
    assert (found.position[t < begin] == initial).all()


@given(positions, positions, limits, limits)
def test_velocity_is_the_rate_of_the_position_and_acceleration_that_of_the_velocity(
    initial: float, target: float, speed: float, acceleration: float
) -> None:
    total = duration(abs(target - initial), speed, acceleration)
    t = np.linspace(-0.5, total + 0.5, 2_001)
    found = trapezoid(t, 0.0, initial, target, speed, acceleration)
    h = t[1] - t[0]
    rounded = 1e-15 * (total + 1.0)  # of differences of times
    means = 0.5 * (found.velocity[1:] + found.velocity[:-1])
    # Exact but for an interval with a corner in it, where the trapezoidal rule is off by a h / 4 at most.
    np.testing.assert_allclose(
        np.diff(found.position),
        h * means,
        rtol=0.0,
        atol=0.25 * acceleration * h * h + 4.0 * speed * rounded + 1e-14,
    )
    rise = min(speed / acceleration, np.sqrt(abs(target - initial) / acceleration))
    corners = np.searchsorted(t, [0.0, rise, total - rise, total])
    smooth = np.ones(len(t) - 1, dtype=bool)
    for beside in (-2, -1, 0):  # a corner on a sample may be rounded to either side of it
        smooth[corners + beside] = False
    np.testing.assert_allclose(
        np.diff(found.velocity)[smooth],
        h * found.acceleration[:-1][smooth],
        rtol=0.0,
        atol=4.0 * acceleration * rounded,
    )


@pytest.mark.parametrize("parts", [1, 3, 7, 16, 50])
def test_communication_points_meet_a_corner_though_their_times_are_rounded(parts: int) -> None:
    step_of = 5e-3 / parts
    points = np.arange(100 * parts)
    for t in (points * step_of + step_of, np.cumsum(np.full(100 * parts, step_of))):
        for found in (step(t, 0.1, 0.0, 1.0).position, ramp(t, 0.1, 0.0, 1.0, 1.0).velocity):
            assert np.argmax(found > 0.5) == 20 * parts - 1
        assert np.argmax(trapezoid(t, 0.1, 0.0, 1.0, 1.0, 10.0).acceleration > 0.0) == 20 * parts - 1


@pytest.mark.parametrize("kind", [STEP, RAMP, TRAPEZOID])
def test_the_kind_chooses_the_form_for_columns_and_numbers_alike(kind: int) -> None:
    t = np.linspace(0.0, 2.0, 41)
    arguments = (0.1, 0.5, 1.5, 2.0, 10.0)
    forms: list[JointMotion] = [step(t, *arguments[:3]), ramp(t, *arguments[:4]), trapezoid(t, *arguments)]
    found = evaluate_setpoint(kind, t, *arguments)
    np.testing.assert_array_equal(found, forms[kind])
    one = evaluate_setpoint(float(kind), float(t[9]), *arguments)
    assert [float(value) for value in one] == [column[9] for column in found]
