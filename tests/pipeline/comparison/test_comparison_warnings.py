"""What is told of a verdict that rests on little, or answers another question."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asserting import there
from made_runs import arms
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.measure import Quantity, compute_statistics
from urmpipe_pipeline.comparison.warnings import (
    weak_evidence,
)


@settings(max_examples=50, deadline=None)
@given(
    values=hnp.arrays(float, st.integers(1, 30), elements=st.floats(-2.0, 2.0)),
    missing=st.sets(st.integers(0, 29)),
)
def test_what_has_no_value_is_out_of_its_tolerance_and_counted(values: FloatArray, missing: set[int]) -> None:
    rows = [row for row in missing if row < len(values)][: len(values) - 1]
    values[rows] = np.nan
    count, t = np.arange(len(values)), np.linspace(0.0, 1.0, len(values))
    measured = Quantity("angle", "angle", "rad", values)
    one = compute_statistics(measured, t, count, {"angle": 1.0})
    assert (one.samples, one.missing) == (len(values) - len(rows), len(rows))
    above = int(np.count_nonzero(np.abs(values) > 1.0))
    assert (
        one.out_of_tolerance
        == above + len(rows)
        == int(np.count_nonzero(measured.out_of_tolerance({"angle": 1.0})))
    )
    assert round(there(one.out_fraction) * len(values)) == one.out_of_tolerance
    assert one.verdict == ("fail" if above or rows else "pass")
    free = compute_statistics(measured, t, count, {"axis": 1.0})
    assert (free.verdict, free.out_of_tolerance, free.missing) == (None, None, len(rows))


def test_a_log_at_rest_is_told_and_one_that_turns_about_its_tool_is_not() -> None:
    moving = arms({"log": np.zeros((50, 6))}).runs[0]
    still = replace(moving, actual=np.tile(moving.actual[0], (50, 1)))
    assert list(weak_evidence(moving)) == list(weak_evidence(still)) == []
    at_rest = replace(moving.run, q=np.tile(moving.run.q[0], (50, 1)))
    assert [one.kind for one in weak_evidence(replace(still, run=at_rest))] == ["one-pose"]


def test_encoders_that_flicker_are_no_motion() -> None:
    moving = arms({"log": np.zeros((50, 6))}).runs[0]
    flicker = np.where(np.arange(50) % 2, 1.05e-4, 0.0)[:, None]  # as a UR5e at rest was logged
    for scale, expected in ((1.0, ["one-pose"]), (3.0, [])):
        run = replace(moving.run, q=np.tile(moving.run.q[0], (50, 1)) + scale * flicker)
        still = replace(moving, actual=np.tile(moving.actual[0], (50, 1)) + flicker, run=run)
        assert [one.kind for one in weak_evidence(still)] == expected


def test_a_log_that_moves_only_where_it_is_not_compared_is_told() -> None:
    moving = arms({"log": np.zeros((50, 6))}).runs[0]
    q = moving.run.q.copy()
    q[:20] = q[0]
    for compared, expected in ((20, ["one-pose"]), (21, [])):
        kept = {name: getattr(moving, name)[:compared] for name in ("sample", "t_ns")}
        resting = replace(moving, **kept, actual=np.zeros((compared, 3)), run=replace(moving.run, q=q))
        assert [one.kind for one in weak_evidence(resting)] == expected
