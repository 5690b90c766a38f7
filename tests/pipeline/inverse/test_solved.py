"""Solved joint values as a run: times, gaps, ghosts, and what does not fit together."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.errors import LogError, OptionError
from urmpipe_models.inverse.solutions import Solutions
from urmpipe_models.inverse.targets import Targets, targets_of
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.orientation import matrices
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.inverse.solved import Ghost, ghosts_of, goals_of, row_times, solved_run
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.runs.results import Run

UR5E = load_robot("ur5e")
STEP_NS = 5_000_000
FILE = SourceFile("targets.csv", "0" * 64, 123)


def solved(name: str, chain: Chain, t_ns: IntArray | None, q: FloatArray, **rest: Any) -> Run:
    """Return a run of targets whose place does not matter."""
    times = row_times(len(q)) if t_ns is None else t_ns
    rest.setdefault("goals", goals_of(Targets(np.zeros((len(times), 3))), times))
    return solved_run(name, chain, t_ns, q, **rest)


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
    run = solved("path", UR5E, times, wrapped(q), files=[FILE], options={"seed": 0, "start": None})
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
    assert run.provenance.options == {"seed": 0, "robot": "ur5e"}
    assert run.warnings == ()


def test_targets_without_times_stand_a_second_apart_and_are_no_motion() -> None:
    q = np.array([way(1)[0], way(1)[0] + 2.0, -way(1)[0], way(1)[0] - 3.0])
    run = solved("targets", UR5E, None, q)
    assert run.t_ns.tolist() == row_times(4).tolist() == [0, 10**9, 2 * 10**9, 3 * 10**9]
    assert run.tsp == 1.0
    np.testing.assert_array_equal(run.q, q)  # no turn is resolved between poses that no motion joins
    assert run.tcp is not None
    np.testing.assert_array_equal(run.tcp.position, positions_over_log(UR5E, q))
    for rates in (run.qd, run.qdd, run.tcp.velocity, run.tcp.acceleration):
        assert np.isnan(rates).all()
    assert (run.audit, run.warnings) == ((), ())


@pytest.mark.parametrize("timed", [True, False])
def test_nothing_is_interpolated_across_unreachable_targets(timed: bool) -> None:
    q = way(9)
    q[3:5] = np.nan
    q[7, 2] = np.nan  # a solution lacks a joint: it is none
    times = np.arange(9) * STEP_NS if timed else row_times(9)
    goals = goals_of(
        targets_of(UR5E, way(9)), times, [None] * 3 + ["too far; too near", "too far", *([None] * 4)]
    )
    run = solved("targets", UR5E, times if timed else None, q, goals=goals)
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
    run = solved("path", UR5E, times, q)
    before, after = run.t_ns <= times[2], run.t_ns >= times[4]
    assert np.isfinite(run.q[before | after]).all()
    assert np.isnan(run.q[~(before | after)]).all()
    assert (~(before | after)).any()


def test_a_ghost_is_where_another_solution_is() -> None:
    chosen = way(4)
    chosen[3] = np.nan
    other = way(4) + 0.5
    q = np.stack((chosen, other, np.full((4, 6), np.nan), chosen + 2 * math.pi), axis=1)
    q[1, 1] = np.nan  # the second branch ends for a target
    q[2, 1] = chosen[2] - 2 * math.pi  # and meets the chosen solution in another
    solutions = Solutions(q, ("a", "b", "c", "d"), np.full((4, 4), "", dtype=np.object_))
    times = row_times(4)
    found = ghosts_of(solutions, times)
    assert [ghost.name for ghost in found] == ["a", "b", "d"]
    run = solved("targets", UR5E, None, chosen, ghosts=found)
    (ghost,) = run.ghosts
    assert ghost.name == "b"
    np.testing.assert_array_equal(ghost.t_ns, times[[0, 3]])
    np.testing.assert_array_equal(ghost.q, other[[0, 3]])


def test_a_turn_of_a_sliding_joint_is_another_solution() -> None:
    slider = Chain("slider", (Joint("z", "prismatic"), Joint("turn")))
    q = np.array([[0.25, 0.5]])
    far = Ghost("far", row_times(1), q + np.array([2 * math.pi, 0.0]))
    near = Ghost("near", row_times(1), q + np.array([0.0, 2 * math.pi]))
    run = solved("targets", slider, None, q, ghosts=(far, near))
    assert [ghost.name for ghost in run.ghosts] == ["far"]
    assert run.log.units == {"z": "m", "turn": "rad"}


def test_goals_and_ghosts_have_times_from_the_first_row_on() -> None:
    targets = targets_of(UR5E, way(3))
    times = 7_000_000_000 + np.arange(3) * STEP_NS
    ghost = Ghost("other", times[1:], way(3)[1:] + 0.5)
    run = solved(
        "path", UR5E, times, way(3), goals=goals_of(targets, times, [None, "", None]), ghosts=[ghost]
    )
    assert run.goals is not None
    np.testing.assert_array_equal(run.goals.t_ns, np.arange(3) * STEP_NS)
    np.testing.assert_array_equal(run.goals.position, targets.position)
    assert run.goals.quat_xyzw is not None
    assert targets.rotation is not None
    # A rotation as a quaternion and back: rounding.
    np.testing.assert_allclose(matrices(run.goals.quat_xyzw), targets.rotation, rtol=0, atol=1e-15)
    assert (run.goals.reasons, run.goals.branches) == (("", "", ""), ())
    assert goals_of(targets, times, None, ["a", "", "b"]).branches == ("a", "", "b")
    assert goals_of(targets, times, None, np.array(["", "", ""], dtype=object)).branches == ()
    assert not run.goals.missed.any()
    (other,) = run.ghosts
    np.testing.assert_array_equal(other.t_ns, [STEP_NS, 2 * STEP_NS])
    np.testing.assert_array_equal(other.q, ghost.q)


def test_a_solved_path_compares_with_itself() -> None:
    times = np.arange(50) * STEP_NS
    for run in (solved("path", UR5E, times, way(50)), solved("path", UR5E, None, way(50))):
        assert compare_runs(run, [run], CompareOptions({"axis": 1e-9})).verdict == "pass"


def test_single_poses_are_no_motion_to_be_compared_with() -> None:
    """A second a row is no time: interpolated, two poses would make a way that nobody asked for."""
    poses = solved("poses", UR5E, None, way(50))
    motion = solved("motion", UR5E, np.arange(50) * STEP_NS, way(50))
    said = (
        "found targets without times, which are no motion, allowed: a log or a path of its own times;"
        " ik(tsp=SECONDS) gives the targets some"
    )
    for reference, runs in ((motion, [poses]), (poses, [motion]), (poses, [poses, motion])):
        with pytest.raises(LogError) as error:
            compare_runs(reference, runs)
        assert {one.sentence() for one in error.value.findings} == {said}
        assert {one.file for one in error.value.findings} == {"poses"}
    with pytest.raises(OptionError, match=r"^sync: found 0.5 of targets without times, allowed: start, row"):
        compare_runs(poses, [poses], CompareOptions(sync=0.5))
    for k in (0, 7):
        moved = way(50)
        moved[k, 0] += 1e-3
        found = compare_runs(poses, [solved("moved", UR5E, None, moved)])
        assert found.runs[0].worst == k


def test_where_nothing_is_reachable_there_is_a_run_without_poses() -> None:
    for times in (None, np.arange(5) * STEP_NS):
        run = solved("far", UR5E, times, np.full((5, 6), np.nan))
        assert np.isnan(run.q).all()
        said = "no solution for 5 of 5 targets, here the first"
        assert run.warnings == (LogWarning("unreachable", said, 1),)
        alone = solved("far", UR5E, None if times is None else times[:1], np.full((1, 6), np.nan))
        assert [one.message for one in alone.warnings] == ["no solution for 1 of 1 targets"]


def test_all_that_does_not_fit_together_is_told_at_once() -> None:
    times = np.array([0, 5, 5])
    ghost = Ghost("left", np.array([0, 4]), way(2))
    goals = goals_of(targets_of(UR5E, way(2)), times[:2])
    with pytest.raises(LogError) as error:
        solved("path", UR5E, times, way(3), ghosts=(ghost,), goals=goals)
    assert [(one.message, one.file, one.row) for one in error.value.findings] == [
        ("found a time that is not later than the one before, allowed: increasing times", "path", 3),
        ("found a time of left that no row has, allowed: the times of the rows", "path", None),
        ("found targets at other times than the rows, allowed: one a row", "path", None),
    ]
    goals = replace(goals_of(targets_of(UR5E, way(3)), row_times(3), ["", "far"]), branches=("a",))
    ghosts = (
        Ghost("short", row_times(3), way(2)),
        Ghost("holed", row_times(2), np.array([[0.0] * 6, [np.nan] * 6])),
        Ghost("turned", row_times(2)[::-1], way(2)),
    )
    with pytest.raises(LogError) as error:
        solved("poses", UR5E, None, way(3), ghosts=ghosts, goals=goals)
    assert [one.message for one in error.value.findings] == [
        "found 2 x 6 joint values of short, allowed: 3 x 6",
        "found a joint value missing in holed, allowed: rows that are whole",
        "found times of turned in disorder, allowed: increasing times",
        "found 2 reasons of 3 targets, allowed: one each",
        "found 1 branches chosen of 3 targets, allowed: one each",
    ]
    with pytest.raises(LogError, match="found no target, allowed: one or more"):
        solved("path", UR5E, None, np.empty((0, 6)))
    with pytest.raises(LogError, match="found 5 joints, allowed: 6"):
        solved("path", UR5E, None, np.zeros((2, 5)))
    with pytest.raises(LogError, match="found 3 times of 2 targets, allowed: one each"):
        solved("path", UR5E, np.arange(3), way(2))
