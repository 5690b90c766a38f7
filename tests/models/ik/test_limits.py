"""Limits of joints, and their whole turns."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_models.arm.chain import Chain, Joint, JointKind, Mimic
from urmpipe_models.ik.limits import (
    LIMIT_ROUNDING,
    TURN,
    joint_periods,
    limit_solutions,
    shift_towards_limits,
    unwrap_within_limits,
    wrap_continuous_joints,
)
from urmpipe_models.ik.solutions import SingularPoses, Solutions


def arm(*joints: Joint) -> Chain:
    return Chain("arm", joints)


def one_solution(*q: float) -> Solutions:
    return Solutions(np.array([[q]]), ("only",), np.array([[""]], dtype=np.object_))


def test_only_a_joint_without_limits_turns_without_end() -> None:
    chain = arm(
        Joint("free"),
        Joint("limited", lower=-TURN, upper=TURN),
        Joint("half", upper=3.0),
        Joint("slides", kind="prismatic"),
        Joint("leads"),
        Joint("follows", mimic=Mimic("leads", 0.5)),
        Joint("undone"),
        Joint("undoes", mimic=Mimic("undone", -1.0, 0.3)),
        Joint("winds"),
        Joint("rope", "prismatic", mimic=Mimic("winds", 1.0)),
    )
    assert joint_periods(chain).tolist() == [TURN, math.inf, math.inf, math.inf, math.inf, TURN, math.inf]


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_beyond_a_limit_by_just_the_rounding_is_on_it(kind: JointKind, sign: float) -> None:
    chain = arm(Joint("held", kind, lower=0.0, upper=0.0))
    assert limit_solutions(chain, one_solution(sign * LIMIT_ROUNDING)).q.tolist() == [[[0.0]]]
    assert np.isnan(limit_solutions(chain, one_solution(sign * 1.01 * LIMIT_ROUNDING)).q).all()


def test_each_joint_that_two_limits_hold_is_put_into_the_turn_nearest_to_their_middle() -> None:
    chain = arm(
        Joint("held", lower=2.0, upper=10.0),
        Joint("half", lower=5.0),
        Joint("slide", "prismatic", lower=20.0, upper=30.0),
    )
    found = shift_towards_limits(chain, np.array([[0.5, 0.5, 0.5], [9.5, 9.5, 9.5]]))
    np.testing.assert_allclose(found, [[0.5 + TURN, 0.5, 0.5], [9.5 - TURN, 9.5, 9.5]], rtol=0, atol=2e-15)
    assert found.dtype == np.float64


def test_a_joint_is_shifted_by_turns_into_its_limits_and_then_as_near_as_may_be() -> None:
    chain = arm(
        Joint("free"),
        Joint("two_turns", lower=-TURN, upper=TURN),
        Joint("aside", lower=0.5, upper=6.0),
        Joint("slides", kind="prismatic", lower=-9.0, upper=9.0),
    )
    raw = one_solution(1.0, -3.0, -1.0, 8.0)
    at_zero = limit_solutions(chain, raw).q[0, 0]
    np.testing.assert_allclose(at_zero, [1.0, -3.0, TURN - 1.0, 8.0], atol=1e-15)
    near = limit_solutions(chain, raw, np.array([20.0, 4.0, 0.5, -8.0])).q[0, 0]
    np.testing.assert_allclose(near, [1.0 + 3 * TURN, TURN - 3.0, TURN - 1.0, 8.0], atol=1e-14)
    beyond = limit_solutions(chain, raw, np.array([[0.0, 99.0, 0.5, 0.0]])).q[0, 0]
    assert beyond[1] == TURN - 3.0  # the last turn that its limits allow, not the nearest to 99


def test_what_cannot_be_brought_into_its_limits_has_a_reason_with_figures() -> None:
    chain = arm(
        Joint("q1"), Joint("q3", lower=-2.7, upper=2.7), Joint("rail", kind="prismatic", lower=0.0, upper=0.5)
    )
    q = np.array([[[0.0, -2.9, 0.25], [0.0, 1.0, 0.75], [0.0, 3.0, -0.1], [0.0, 1.0, 0.25]]])
    reasons = np.array([["", "", "", ""]], dtype=np.object_)
    aligned = SingularPoses("wrist aligned", np.ones((1, 4), dtype=bool))
    found = limit_solutions(chain, Solutions(q, ("a", "b", "c", "d"), reasons, (aligned,)))
    assert found.reasons[0].tolist() == [
        "joint q3 at -2.9 rad, allowed: -2.7 to 2.7 rad",
        "joint rail at 0.75 m, allowed: 0 to 0.5 m",
        "joint q3 at 3 rad, allowed: -2.7 to 2.7 rad; joint rail at -0.1 m, allowed: 0 to 0.5 m",
        "",
    ]
    assert found.reached.tolist() == [[False, False, False, True]]
    assert found.singular[0].where.tolist() == [[False, False, False, True]]


def test_the_turn_told_is_the_one_nearest_to_the_limits() -> None:
    found = limit_solutions(arm(Joint("q1", lower=3.0, upper=4.0)), one_solution(-1.0))
    assert found.reason(0) == "joint q1 at 5.283 rad, allowed: 3 to 4 rad"


def test_a_joint_that_another_follows_by_half_is_not_turned() -> None:
    chain = arm(Joint("leads", lower=0.0, upper=7.0), Joint("follows", mimic=Mimic("leads", 0.5)))
    assert (
        limit_solutions(chain, one_solution(-1.0)).reason(0) == "joint leads at -1 rad, allowed: 0 to 7 rad"
    )


def test_what_there_was_no_solution_for_keeps_its_reason() -> None:
    nothing = Solutions(np.full((1, 1, 1), np.nan), ("only",), np.array([["too far"]], dtype=np.object_))
    found = limit_solutions(arm(Joint("q1", lower=-1.0, upper=1.0)), nothing)
    assert found.reason(0) == "too far" and np.isnan(found.q).all()


@pytest.mark.slow
@settings(deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(-20.0, 20.0), st.floats(0.0, 20.0), st.floats(-30.0, 30.0))
def test_of_all_turns_within_the_limits_the_nearest_is_taken(
    value: float, lower: float, width: float, near: float
) -> None:
    chain = arm(Joint("q1", lower=lower, upper=lower + width))
    found = limit_solutions(chain, one_solution(value), np.array([near]))
    turns = value + TURN * np.arange(-12, 13)
    allowed = turns[(turns >= lower) & (turns <= lower + width)]
    if len(allowed):
        assert abs(found.q[0, 0, 0] - near) <= np.abs(allowed - near).min() + 1e-9
        assert lower <= found.q[0, 0, 0] <= lower + width
        assert abs(math.remainder(found.q[0, 0, 0] - value, TURN)) < 1e-10
    else:
        # what is beyond a limit by rounding may count as on it
        assert not found.reached.any() or np.abs(turns - found.q[0, 0, 0]).min() < 1e-10


def test_within_pi_takes_turns_off_joints_without_end_alone_and_minus_pi_is_pi() -> None:
    period = np.array([TURN, np.inf, TURN, TURN])
    q = np.array([[-np.pi, -4.0, 3.5, np.pi], [np.pi, 9.0, -3.5, 7.0]])
    found = wrap_continuous_joints(q, period)
    assert found == pytest.approx(
        np.array([[np.pi, -4.0, 3.5 - TURN, np.pi], [np.pi, 9.0, TURN - 3.5, 7.0 - TURN]]), abs=1e-15
    )
    assert np.array_equal(wrap_continuous_joints(q[:, None], period), found[:, None])


def test_each_sample_is_in_the_turn_nearest_to_the_one_before_it_that_there_is() -> None:
    chain = Chain(
        "arm", (Joint("free"), Joint("limited", lower=-4.0, upper=4.0), Joint("slide", "prismatic"))
    )
    way = np.array([[2.0, 3.0, 9.0], [4.0, 3.5, 9.0], [6.0, 3.9, 0.0], [8.0, 3.9, 0.0], [10.0, 3.9, 0.0]])
    q = way - TURN * np.round(way / TURN) * [1.0, 1.0, 0.0]
    q[3] = np.nan
    found = unwrap_within_limits(chain, q, np.array([2.5 - TURN, 3.0, 0.0]))
    expected = way - np.array([TURN, 0.0, 0.0])
    expected[3] = np.nan
    expected[4, 0] -= TURN  # 4 rad after 6 are nearer by the other way: 2.28 back
    np.testing.assert_allclose(found, expected, rtol=0, atol=4e-15)
    assert np.isnan(q[3]).all() and not np.shares_memory(found, q)
