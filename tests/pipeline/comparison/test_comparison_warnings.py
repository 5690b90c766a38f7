"""What is told of a verdict that rests on little, or answers another question."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asserting import there
from made_runs import arms, paths
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.baseline import complete_noise
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.measure import Quantity, compute_statistics
from urmpipe_pipeline.comparison.warnings import (
    large_noises,
    large_tolerances,
    recorded_tcp_mismatch,
    weak_evidence,
)


def off(samples: int) -> FloatArray:
    """No deviation at all."""
    return np.zeros((samples, 3))


def told(result: Comparison) -> list[tuple[str, str]]:
    """Return the warnings of a comparison."""
    return [(one.kind, one.message) for one in result.warnings]


def test_a_noise_that_reaches_its_tolerance_is_told() -> None:
    noise = complete_noise({"axis": 0.5, "angle": 0.01})
    allowed = {"axis": 0.0035, "norm": 0.005, "angle": 0.01, "joint": 0.01}
    assert [(one.kind, one.message) for one in large_noises(noise, allowed)] == [
        (
            "large-noise",
            "a noise of 500 mm (axis) reaches the tolerance of 3.5 mm: nothing within it can be worse than"
            " the baseline; a number without a unit is in m",
        ),
        (
            "large-noise",
            "a noise of 0.572958 deg (angle) reaches the tolerance of 0.572958 deg: nothing within it can be"
            " worse than the baseline; a number without a unit is in rad",
        ),
    ]
    assert [
        one.message[:25] for one in large_noises({"axis": 1e-6, "x": 0.01}, {"x": 0.004, "y": 0.004})
    ] == ["a noise of 10 mm (x) reac"]
    assert list(large_noises(complete_noise(0.0034), {"axis": 0.0035})) == []
    (share,) = large_noises(complete_noise("AV=5%"), {"AV": 0.05})
    assert share.message.startswith("a noise of 5 % (AV) reaches the tolerance of 5 %")


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


def test_one_sample_is_one_pose() -> None:
    assert told(paths({"one": off(1)})) == [
        ("one-pose", "1 sample compared, all in one pose: the verdict is on that pose alone")
    ]


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


def test_a_log_that_ends_early_is_told_and_stands_behind_whole_ones() -> None:
    logs = {"early": off(44), "whole": np.full((1000, 3), 0.001), "nearly": off(990)}
    result = paths(logs, tolerance={"coverage": 0.04})
    assert [run.name for run in result.ranking] == ["nearly", "whole", "early"]
    assert [run.shares["coverage"].value for run in result.runs] == [0.044, 1.0, 0.99]
    shown = "it shows 44 of 1000 samples of path (4.4 %), longest unseen: 4.775 s from t = 0.220 s"
    shown += " of the reference"
    assert (result.verdict, told(result)) == ("pass", [("not-covered", shown)])
    failed = paths(logs)
    assert (failed.verdict, told(failed)) == ("fail", [])  # the verdict says it


def test_a_large_tolerance_without_a_unit_is_told() -> None:
    assert told(paths({"log": off(50) + 1e-9}, tolerance={"axis": 3.5, "norm": 0.1})) == [
        ("large-tolerance", "a tolerance of 3500 mm (axis) accepts any deviation: 3.5 is in m")
    ]
    assert [
        one.message for one in large_tolerances({"angle": 0.5, "joint": 0.17, "PSt": 9.0, "AV": 0.5})
    ] == ["a tolerance of 28.6479 deg (angle) accepts any deviation: 0.5 is in rad"]


def test_a_tool_centre_point_that_two_logs_recorded_and_nobody_judges_is_told() -> None:
    run = arms({"bad": np.zeros((50, 6))}).runs[0].run
    assert run.tcp is not None
    for away, expected in ((0.0005, []), (0.005, ["recorded-tcp-apart"])):
        beside = replace(run, log=replace(run.log, tcp_position=run.tcp.position + np.array((0, 0, away))))
        assert [one.kind for one in recorded_tcp_mismatch([beside], 1e-3)] == expected
    usual = (
        "usual up to 5 mm where a controller uses the calibration of its arm, which this robot model lacks"
    )
    more = "more than a calibration explains (5 mm): another robot, tool or base?"
    for away, shown, cause in ((0.00104, "1.040", usual), (0.0051, "5.100", more)):
        beside = replace(run, log=replace(run.log, tcp_position=run.tcp.position + np.array((0, 0, away))))
        assert next(recorded_tcp_mismatch([beside], 1e-3)).message == (
            f"its kinematics are up to {shown} mm from its recorded tool centre point, {cause};"
            " this verdict does not include that; a comparison of bad alone does"
        )
    assert list(recorded_tcp_mismatch([run], 1e-3)) == []
    (both,) = recorded_tcp_mismatch([beside, replace(beside, name="worse")], 1e-3)
    assert both.message == (
        "by forward kinematics bad is up to 5.100 mm and worse is up to 5.100 mm from the recorded tool"
        f" centre points, {more}; this verdict does not include that; a comparison of each alone does"
    )


def test_first_rows_that_recorded_another_tool_are_not_told_of_as_another_robot() -> None:
    run = arms({"bad": np.zeros((50, 6))}).runs[0].run
    assert run.tcp is not None
    position = run.tcp.position + np.array((0, 0, 0.0005))
    position[:4] = 0.0
    assert (
        list(recorded_tcp_mismatch([replace(run, log=replace(run.log, tcp_position=position))], 1e-3)) == []
    )
