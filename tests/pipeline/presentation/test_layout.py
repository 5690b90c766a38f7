"""The axis of two scales and the small multiples of a panel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_pipeline.presentation.figure import Line, Mark, Over, Panel
from urmpipe_pipeline.presentation.layout import (
    BAND_SHARE,
    CLOSE_SHARE,
    FAINT,
    TwoScales,
    small_multiples,
    two_scales,
)

LIMIT = 0.0035
T_NS = np.arange(4, dtype=np.int64)
SIZES = st.floats(-1e3, 1e3)


def panel(largest: float, **more: object) -> Panel:
    """A panel whose line reaches a value, with a limit of 3.5 mm."""
    line = Line(np.array([0.0, -largest, np.nan, largest / 2]), ("Δx",), ("#c25000",))
    return Panel("Δx", "m", (line,), T_NS, **{"limit": LIMIT} | more)  # type: ignore[arg-type]


def test_a_tolerance_vanishes_below_far_larger_values_only() -> None:
    assert two_scales(panel(0.999 * FAINT * LIMIT)) is None
    assert two_scales(panel(0.807)) == TwoScales(LIMIT, 0.807)


@pytest.mark.parametrize(
    "more",
    [{"limit": None}, {"limit": 0.0}, {"logarithmic": True}, {"over": Over(np.arange(4.0), "‖v‖", "m/s")}],
)
def test_without_a_band_nothing_vanishes(more: dict[str, object]) -> None:
    assert two_scales(panel(0.807, **more)) is None


def test_values_far_within_the_tolerance_are_shown_close_up_where_they_are_the_subject() -> None:
    few = 0.5 * LIMIT / FAINT
    assert two_scales(panel(few)) is None
    assert two_scales(panel(0.0, close=0.0)) is None
    assert two_scales(panel(few, close=1.001 * LIMIT / FAINT)) is None
    scales = two_scales(panel(1e-9, close=few))  # as its neighbours: a rounding does not fill an axis
    assert scales == TwoScales(few, LIMIT, CLOSE_SHARE)
    np.testing.assert_allclose(scales.height(np.array([few, -LIMIT])), [CLOSE_SHARE, -1.0])
    assert scales.ticks() == pytest.approx([0.0, 1e-4, LIMIT])  # in m: few is 0.146 mm
    assert two_scales(panel(0.807, close=0.9)) == two_scales(panel(0.807))


@given(SIZES, st.floats(1e-3, 10.0), st.floats(12.0, 1e3))
@settings(deadline=None)
def test_an_axis_of_two_scales_grows_and_has_an_inverse(value: float, limit: float, ratio: float) -> None:
    scales = TwoScales(limit, ratio * limit)
    values = np.array([value, -value, value + 1e-6 * (1.0 + abs(value))])
    heights = scales.height(values)
    assert heights[1] == -heights[0]
    assert heights[2] > heights[0]
    assert scales.value(heights) == pytest.approx(values, rel=1e-9, abs=1e-9)  # a few roundings


def test_the_band_takes_its_share_and_the_ticks_are_round() -> None:
    scales = TwoScales(3.5, 807.0)
    found = scales.height(np.array([0.0, 3.5, -3.5, 807.0, np.nan]))
    np.testing.assert_array_equal(found, [0.0, BAND_SHARE, -BAND_SHARE, 1.0, np.nan])
    assert scales.ticks() == [0.0, 3.5, 500.0]
    assert TwoScales(3.5, 271.0).ticks() == [0.0, 3.5, 200.0]


def pairs(joints: int, wanted: int) -> Panel:
    """Set points as lines of their own before the answers of an arm in one array."""
    some = tuple(Line(np.full(4, float(k)), (f"set {k}",), ("#888888",), dashed=True) for k in range(wanted))
    answers = np.arange(4.0)[:, np.newaxis] + np.arange(joints)
    names = tuple(f"q{k}" for k in range(joints))
    marks = tuple(Mark(0, 0.0, "up", "#c25000", "a turn", name) for name in names)
    return Panel("theta", "rad", (*some, Line(answers, names, ("#c25000",) * joints)), T_NS, marks=marks)


def test_each_answer_stands_alone_with_its_set_point() -> None:
    found = small_multiples(pairs(6, 6))
    assert [one.title for one in found] == [f"q{k}" for k in range(6)]
    for k, one in enumerate(found):
        wanted, answer = one.lines
        assert (wanted.names, wanted.dashed, answer.names, answer.dashed) == (
            (f"set {k}",),
            True,
            (f"q{k}",),
            False,
        )
        np.testing.assert_array_equal(wanted.values[:], np.full(4, float(k)))
        np.testing.assert_array_equal(answer.values[:], np.arange(4.0) + k)
        assert [mark.name for mark in one.marks] == [f"q{k}"]


def test_one_set_point_of_many_stands_with_each() -> None:
    assert [one.lines[0].names for one in small_multiples(pairs(3, 1))] == [("set 0",)] * 3


@pytest.mark.parametrize(("joints", "wanted"), [(2, 2), (6, 0), (6, 4)])
def test_few_lines_and_those_that_no_order_pairs_stay_together(joints: int, wanted: int) -> None:
    whole = pairs(joints, wanted)
    assert small_multiples(whole) == (whole,)
