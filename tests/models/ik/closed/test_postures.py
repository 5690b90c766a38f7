"""Of postures that are one, the first stays."""

from __future__ import annotations

import math

import numpy as np

from urmpipe_models.ik.position_arm import DUPLICATE_TOLERANCE, Meeting, mask_coincident, mask_duplicates

TURNING = np.array([True, True, False])
NAMES = ("one", "two", "three")


def test_of_equal_postures_the_first_stays_and_the_others_name_it() -> None:
    """Four targets: all differ, two are one beyond half a turn, all are one, one is the mirror of another."""
    q = np.array(
        [
            [[0.1, math.pi, 0.3, 0.4], [0.2, -math.pi, 0.3, -0.4], [0.3, 0.5, 0.3, 1.0]],
            [[0.1, 1.0, 0.3, 0.4], [0.1, 1.0, 0.3, -0.4], [0.1, 1.0, 0.3, 1.0]],
            [[0.1, 2.0, 7.0, 0.4], [0.1, 2.0, 7.0, -0.4], [0.1, 2.0, 7.0, 1.0]],
        ]
    )
    reasons = np.full((3, 4), "", dtype=np.object_)
    meeting: Meeting = {}
    mask_duplicates(q, TURNING, 1.0, NAMES, reasons, meeting)
    same = "the same as one: both meet here"
    assert reasons.tolist() == [["", "", "", ""], ["", same, same, ""], ["", "", same, ""]]
    np.testing.assert_array_equal(np.isnan(q), np.broadcast_to(reasons == same, q.shape))
    assert list(meeting) == ["postures meet"]
    expected = [[False, True, True, False], [False] * 4, [False] * 4]
    assert meeting["postures meet"].tolist() == expected
    assert meeting["postures meet"].dtype == bool


def test_postures_are_one_below_a_bound_that_grows_with_the_arm_for_slides_alone() -> None:
    for turn, slide, size, one in (
        (0.9 * DUPLICATE_TOLERANCE, 0.0, 4.0, True),
        (1.1 * DUPLICATE_TOLERANCE, 0.0, 4.0, False),
        (0.0, 0.9 * DUPLICATE_TOLERANCE * 4.0, 4.0, True),
        (0.0, DUPLICATE_TOLERANCE * 4.0, 4.0, False),
    ):
        q = np.zeros((3, 2, 1))
        q[1, 1], q[2, 1] = turn, slide
        meeting: Meeting = {}
        mask_duplicates(q, TURNING, size, NAMES, np.full((2, 1), "", dtype=np.object_), meeting)
        assert bool(np.isnan(q[0, 1, 0])) == bool(meeting) == one


def test_where_postures_met_before_they_meet_still() -> None:
    meeting: Meeting = {"postures meet": np.array([[True, False, False], [False, False, False]])}
    q = np.zeros((3, 2, 3))
    q[0, 1] = [1.0, 1.0, 0.0]
    mask_duplicates(q, TURNING, 1.0, NAMES, np.full((2, 3), "", dtype=np.object_), meeting)
    assert meeting["postures meet"].tolist() == [[True, False, True], [False] * 3]


def test_the_second_of_two_sides_or_elbows_is_left_out() -> None:
    names = np.array([["left up", "left down"], ["right up", "right down"]], dtype=np.object_)
    meet = np.array([[[True, False], [True, True]]] * 2)  # of each elbow or side the second target, or none
    for axis, sides, told in (
        (0, np.s_[1], ["left up", "left down"]),
        (1, np.s_[:, 1], ["left up", "right up"]),
    ):
        u1, u3 = np.ones((2, 2, 2, 2)), np.full((2, 2, 2, 2), 2.0)
        reasons = np.full((2, 2, 2), "", dtype=np.object_)
        reasons[..., 1] = "too far"
        mask_coincident(u1, u3, reasons, meet, names, axis)
        gone = np.zeros((2, 2, 2), dtype=bool)
        gone[sides] = meet[sides]
        for u, value in ((u1, 1.0), (u3, 2.0)):
            np.testing.assert_array_equal(u, np.where(gone, np.nan, value)[None].repeat(2, axis=0))
        first = np.where(gone[sides][:, 0], [f"the same as {one}: both meet here" for one in told], "")
        assert reasons[sides][:, 0].tolist() == first.tolist()
        assert (reasons[..., 1] == "too far").all()
        assert (np.count_nonzero(reasons[..., 0]) == np.count_nonzero(first)) and reasons.dtype == object
