"""Targets, search options and solutions: what all solvers take and return."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from urmpipe_models.ik.solutions import (
    DEFAULT_SEARCH,
    SearchOptions,
    SingularPoses,
    Solutions,
    Targets,
    empty_solutions,
    format_with_limits,
    forward_targets,
    pose_errors,
)
from urmpipe_models.robots.catalogue import load_robot

TURN = 2.0 * math.pi


def two_targets() -> Solutions:
    """Two targets with two branches of one joint; the second target lacks the first branch."""
    q = np.array([[[3.0], [-1.0]], [[np.nan], [0.5]]])
    reasons = np.array([["", ""], ["too far", ""]], dtype=np.object_)
    where = np.array([[True, False], [False, True]])
    return Solutions(q, ("up", "down"), reasons, (SingularPoses("arm stretched", where),))


def test_labels_and_shortfall_have_defaults_of_the_right_shape() -> None:
    found = two_targets()
    assert found.labels.tolist() == [["up", "down"], ["up", "down"]]
    assert found.shortfall.tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert found.reached.tolist() == [[True, True], [False, True]]


def test_the_nearest_solution_is_taken_by_the_shorter_way() -> None:
    found, start = two_targets(), np.array([-3.0])
    assert found.nearest_column(start, np.array([math.inf])).tolist() == [1, 1]
    assert found.nearest_column(start, np.array([TURN])).tolist() == [0, 1]
    np.testing.assert_allclose(
        found.nearest(start, np.array([TURN])), [[3.0 - TURN], [0.5 - TURN]], atol=1e-15
    )
    np.testing.assert_allclose(found.nearest(start, np.array([math.inf])), [[-1.0], [0.5]])
    assert found.nearest_column(np.array([[2.0], [2.0]]), np.array([math.inf])).tolist() == [0, 1]  # one each


def test_where_there_are_none_reasons_can_be_made_longer() -> None:
    none = empty_solutions(["short", ""], ("up", "down"), 3)
    assert none.q.shape == (2, 2, 3) and np.isnan(none.q).all()
    assert none.reasons.tolist() == [["short", "short"], ["", ""]]
    none.reasons[0] += ", and more"
    assert none.reasons.tolist() == [["short, and more"] * 2, ["", ""]]


def test_what_is_picked_keeps_branch_reason_family_and_shortfall() -> None:
    picked = two_targets().select(np.array([1, 0]), "nearest")
    assert picked.branches == ("nearest",)
    assert picked.labels.tolist() == [["down"], ["up"]]
    assert picked.reasons.tolist() == [[""], ["too far"]]
    assert picked.singular[0].where.tolist() == [[False], [False]]
    assert picked.shortfall.shape == (2, 1)
    assert picked.q[0, 0, 0] == -1.0 and np.isnan(picked.q[1, 0, 0])


def test_a_target_without_solutions_has_each_reason_once() -> None:
    none = empty_solutions(["too far", "not finite"], ("up", "down"), 3)
    assert [none.reason(0), none.reason(1)] == ["too far", "not finite"]
    assert none.q.shape == (2, 2, 3) and not none.reached.any()
    assert two_targets().reason(1) is None
    assert two_targets().families(0) == ["arm stretched"]
    assert np.isnan(none.nearest(np.zeros(3), np.full(3, math.inf))).all()


def test_four_digits_are_given_where_they_tell_the_numbers_apart_and_else_up_to_all() -> None:
    assert format_with_limits(2.71828, -3.14159, 1.0) == ("2.718", "-3.142", "1")
    assert format_with_limits(2.7000001, 2.7) == ("2.7000001", "2.7")
    assert format_with_limits(1.0 + 1e-9, 1.0, 1.0 + 2e-9) == ("1.000000001", "1", "1.000000002")
    assert format_with_limits(math.nextafter(0.1, 1.0), 0.1) == ("0.10000000000000002", "0.10000000000000001")
    assert format_with_limits(0.1, 0.1) == ("0.10000000000000001", "0.10000000000000001")


def test_the_usual_search_makes_sense() -> None:
    assert list(DEFAULT_SEARCH.faults()) == []
    assert list(SearchOptions(1e-9, 0, 0).faults()) == []
    assert list(SearchOptions(restarts=np.int64(3)).faults()) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"tolerance": 0.0}, "tolerance: found 0 m, allowed: more than 0, finite"),
        ({"tolerance": -1.0}, "tolerance: found -1 m, allowed: more than 0, finite"),
        ({"tolerance": math.inf}, "tolerance: found inf m, allowed: more than 0, finite"),
        ({"tolerance": math.nan}, "tolerance: found nan m, allowed: more than 0, finite"),
        ({"tolerance": {"axis": 0.1}}, "tolerance: found {'axis': 0.1}, allowed: a number of m, more than 0"),
        ({"restarts": -2}, "restarts: found -2, allowed: a whole number, 0 or more"),
        ({"restarts": 2.5}, "restarts: found 2.5, allowed: a whole number, 0 or more"),
        ({"seed": -1}, "seed: found -1, allowed: a whole number, 0 or more"),
        ({"seed": "1"}, "seed: found '1', allowed: a whole number, 0 or more"),
    ],
)
def test_a_value_that_makes_no_sense_is_told(wrong: dict[str, Any], text: str) -> None:
    assert [str(one) for one in SearchOptions(**wrong).faults()] == [text]


def test_all_values_that_make_no_sense_are_told() -> None:
    told = SearchOptions(tolerance=-1.0, restarts=-1, seed=-1).faults()
    assert [fault.parameter for fault in told] == ["tolerance", "restarts", "seed"]


ARM = load_robot("arm6")
Q = np.array([[0.3, 0.8, -0.6, 0.5, 0.7, 0.2]])


def turned(vector: list[float]) -> Targets:
    """Return the pose of the arm, turned in the world by a rotation vector in [rad]."""
    there = forward_targets(ARM, Q)
    assert there.rotation is not None
    return Targets(there.position, Rotation.from_rotvec(vector).as_matrix() @ there.rotation)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.one_of(st.floats(0.0, 3.1), st.floats(-15.0, 0.0).map(lambda power: 10.0**power)),
)
def test_the_turn_is_the_rotation_vector_in_the_world(axis: list[float], angle: float) -> None:
    vector = angle * np.array(axis) / np.linalg.norm(axis)
    position, turn = pose_errors(ARM, Q, turned(vector.tolist()))
    assert np.abs(position).max() == 0.0
    assert np.abs(turn[0] - vector).max() < 1e-14  # some rounding of the two matrices; far below any angle


@pytest.mark.parametrize("angle", [np.pi, np.pi - 1e-9, np.pi - 1e-4])
def test_half_a_turn_has_its_whole_angle(angle: float) -> None:
    _, turn = pose_errors(ARM, Q, turned([0.0, -angle, 0.0]))
    assert np.linalg.norm(turn) == pytest.approx(angle, abs=1e-14)


def test_where_there_is_no_pose_there_is_no_turn_and_positions_have_none_at_all() -> None:
    there = forward_targets(ARM, Q)
    position, turn = pose_errors(ARM, np.full((1, 6), np.nan), there)
    assert np.isnan(position).all()
    assert np.isnan(turn).all()
    position, turn = pose_errors(ARM, Q, Targets(there.position + np.array([1.0, 0.0, 0.0])))
    assert position[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert turn.tolist() == [[0.0, 0.0, 0.0]]
