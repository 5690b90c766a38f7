from __future__ import annotations

import math

import numpy as np

from urmpipe_models.ik.solutions import SingularPoses, Solutions, empty_solutions

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


def test_where_there_are_none_reasons_can_be_made_longer() -> None:
    none = empty_solutions(["short", ""], ("up", "down"), 3)
    assert none.q.shape == (2, 2, 3) and np.isnan(none.q).all()
    assert none.reasons.tolist() == [["short", "short"], ["", ""]]
    none.reasons[0] += ", and more"
    assert none.reasons.tolist() == [["short, and more"] * 2, ["", ""]]


def test_each_target_can_have_a_start_of_its_own() -> None:
    assert two_targets().nearest_column(np.array([[2.0], [2.0]]), np.array([math.inf])).tolist() == [0, 1]


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
