"""Chosen solutions as a run: times, gaps, and poses that no motion joins."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solved import FILE, solved
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.kinematics.forward import points_over_log, positions_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.joint_log import LogWarning

UR5E = load_robot("ur5e")
STEP_NS = 5_000_000


def way(rows: int) -> FloatArray:
    """Return a slow motion of six joints that passes pi with the last."""
    t = np.arange(rows)[:, None] * STEP_NS / 1e9
    return np.array([0.1, -1.2, 1.3, -0.4, 0.7, 3.1]) + np.array([0.3, 0.2, -0.2, 0.4, -0.3, 0.5]) * t


def wrapped(q: FloatArray) -> FloatArray:
    return np.asarray(np.remainder(q + math.pi, 2 * math.pi) - math.pi)


def test_a_path_goes_the_way_of_a_log() -> None:
    q = way(200)
    start_ns = 12_000_000_000
    times = start_ns + np.arange(200) * STEP_NS
    run = solved("path", UR5E, wrapped(q), times).as_run()
    assert run.timed
    assert [(entry.joint, entry.row) for entry in run.repolarizations] == [
        (UR5E.coordinates[5], 1 + int(np.argmax(q[:, 5] > math.pi)))
    ]
    np.testing.assert_allclose(run.q, q, rtol=0, atol=1e-14)  # turns added: rounding
    # Central differences of a straight line: its slope, with the rounding of 3 rad over 0.01 s.
    np.testing.assert_allclose(
        run.qd, np.tile([0.3, 0.2, -0.2, 0.4, -0.3, 0.5], (200, 1)), rtol=0, atol=1e-12
    )
    assert run.tcp is not None
    # The turn added rounds q by 1e-16 rad, at an arm of 1 m.
    np.testing.assert_allclose(run.tcp.position, positions_over_log(UR5E, q), rtol=0, atol=1e-14)
    assert (run.log.clock_start_ns, run.tsp, run.log.source) == (start_ns, 0.005, "ik")
    np.testing.assert_array_equal(run.t_ns, times - start_ns)
    assert (run.provenance.command, run.provenance.inputs) == ("ik", (FILE,))
    assert run.warnings == ()


def test_targets_without_times_are_no_motion() -> None:
    q = np.array([way(1)[0], way(1)[0] + 2.0, -way(1)[0], way(1)[0] - 3.0])
    run = solved("targets", UR5E, q).as_run()
    assert not run.timed
    assert (run.t.tolist(), run.tsp) == ([0.0, 1.0, 2.0, 3.0], 0.0)  # the numbers of the rows
    np.testing.assert_array_equal(run.q, q)  # no turn is resolved between poses that no motion joins
    assert run.tcp is not None
    np.testing.assert_array_equal(run.tcp.position, points_over_log(UR5E, q)[:, -1])
    for rates in (run.qd, run.qdd, run.tcp.velocity, run.tcp.acceleration):
        assert np.isnan(rates).all()
    assert (run.audit, run.warnings) == ((), ())


def test_units_of_joints_that_turn_and_slide() -> None:
    slider = Chain("slider", (Joint("z", "prismatic"), Joint("turn")))
    run = solved("targets", slider, np.array([[0.25, 0.5]])).as_run()
    assert run.log.units == {"z": "m", "turn": "rad"}


@pytest.mark.parametrize("timed", [True, False])
def test_nothing_is_interpolated_across_unreachable_targets(timed: bool) -> None:
    q = way(9)
    q[[3, 4, 7]] = np.nan
    reasons = ("", "", "", "too far; too near", "too far", "", "", "too far", "")
    times = np.arange(9) * STEP_NS if timed else None
    run = solved("targets", UR5E, q, times, reasons=reasons, targets=forward_targets(UR5E, way(9))).as_run()
    missing = [3, 4, 7]
    assert run.tcp is not None
    for values in (run.q, run.log.q, run.tcp.position):
        assert np.flatnonzero(np.isnan(values).all(axis=1)).tolist() == missing
        assert np.isfinite(np.delete(values, missing, axis=0)).all()
    said = "no solution for 3 of 9 targets, here the first: too far"
    assert run.warnings == (LogWarning("unreachable", said, 4),)


def test_uneven_times_are_resampled_but_not_across_an_unreachable_target() -> None:
    times = np.array([0, 5, 11, 16, 20, 26, 30]) * 1_000_000
    q = np.linspace(0.0, 0.3, 7)[:, None] + np.zeros((7, 6))
    q[3] = np.nan
    run = solved("path", UR5E, q, times).as_run()
    before, after = run.t_ns <= times[2], run.t_ns >= times[4]
    assert np.isfinite(run.q[before | after]).all()
    assert np.isnan(run.q[~(before | after)]).all()
    assert (~(before | after)).any()


def test_a_solved_path_compares_with_itself() -> None:
    for times in (np.arange(50) * STEP_NS, None):
        run = solved("path", UR5E, way(50), times).as_run()
        assert compare_runs(run, [run], CompareOptions({"axis": 1e-9})).verdict == "pass"


def test_single_poses_are_no_motion_to_be_compared_with() -> None:
    """Rows are no times: interpolated, two poses would make a way that nobody requested."""
    poses = solved("poses", UR5E, way(50)).as_run()
    motion = solved("motion", UR5E, way(50), np.arange(50) * STEP_NS).as_run()
    for reference, runs in ((motion, [poses]), (poses, [motion]), (poses, [poses, motion])):
        with pytest.raises(LogError, match="targets without times, which are not a motion") as error:
            compare_runs(reference, runs)
        assert {one.file for one in error.value.findings} == {FILE.name}
    with pytest.raises(OptionError, match="sync"):
        compare_runs(poses, [poses], CompareOptions(sync=0.5))
    for k in (0, 7):
        moved = way(50)
        moved[k, 0] += 1e-3
        found = compare_runs(poses, [solved("moved", UR5E, moved).as_run()])
        assert found.runs[0].worst == k


def test_where_nothing_is_reachable_there_is_a_run_without_poses() -> None:
    for times in (None, np.arange(5) * STEP_NS):
        run = solved(
            "far", UR5E, np.full((5, 6), np.nan), times, targets=forward_targets(UR5E, way(5))
        ).as_run()
        assert np.isnan(run.q).all()
        assert run.warnings == (
            LogWarning("unreachable", "no solution for 5 of 5 targets, here the first", 1),
        )
