"""Solved joint values in the 3D view: branches drawn where they are and gone where not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rerun.chunk import RrdReader

from recorded import rows_of, static
from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.inverse.targets import Targets, targets_of
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_models.orientation import matrices
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.urdf_reader import read_urdf
from urmpipe_pipeline.inverse.solved import Ghost, goals_of, row_times, solved_run
from urmpipe_pipeline.recording.entities import places_of
from urmpipe_pipeline.recording.ghost_arms import POSES, bones_of
from urmpipe_pipeline.recording.ghost_drawing import capsules
from urmpipe_pipeline.recording.plots import Plots
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.views.label_places import name_places
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.results import Run

MakeSolved = Callable[..., Run]

FIRST = "/branches/right\\,\\ elbow\\ up\\,\\ flipped"
STEP_NS = 20_000_000  # of the motion that make_solved makes


# --- the bones -------------------------------------------------------------------------------------


@given(arrays(np.float64, (3,), elements=st.floats(-3.0, 3.0)))
@example(np.array([0.0, 0.0, -1.0]))
@example(np.array([0.0, 0.0, 1.0]))
@example(np.array([1e-9, 0.0, -1.0]))
@example(np.zeros(3))
def test_a_capsule_lies_along_its_bone(bone: FloatArray) -> None:
    length, quat = capsules(bone)
    along = matrices(quat.astype(np.float64)[None])[0] @ (0.0, 0.0, float(length))
    np.testing.assert_allclose(along, bone, rtol=0, atol=3e-6)  # single precision over 5 m


def test_the_turn_of_a_wrist_shows_in_the_axes_of_its_joints_alone() -> None:
    arm = load_robot("arm6")
    q = np.array([[0.3, 0.4, 0.5, 0.6, 0.7, 0.8]])
    flipped = q * [1, 1, 1, 1, -1, 1] + [0, 0, 0, math.pi, 0, math.pi]
    points = points_over_log(arm, q)
    np.testing.assert_allclose(points_over_log(arm, flipped), points, rtol=0, atol=1e-15)
    (start, end), (other_start, other_end) = bones_of(arm, q), bones_of(arm, flipped)
    links, joints = len(arm.joints), len(arm.coordinates)
    assert start.shape == end.shape == (1, links + joints, 3)
    np.testing.assert_array_equal(start[:, :links], points[:, :-1])
    np.testing.assert_array_equal(end[:, :links], points[:, 1:])
    np.testing.assert_allclose(other_start, start, rtol=0, atol=1e-15)
    apart = np.linalg.norm(other_end - end, axis=2)[0]
    reach = np.linalg.norm(np.diff(points[0], axis=0), axis=1).sum()
    # The axis of joint 5 points the other way: its piece, a tenth of the reach long, on the other side.
    expected = np.zeros(links + joints)
    expected[links + 4] = 0.2 * reach
    np.testing.assert_allclose(apart, expected, rtol=0, atol=1e-15)


def test_a_pose_that_is_missing_takes_no_bone_from_the_others() -> None:
    arm = load_robot("arm6")
    q = np.array([[0.3, 0.4, 0.5, 0.6, 0.7, 0.8], [np.nan] * 6])
    for both, alone in zip(bones_of(arm, q), bones_of(arm, q[:1]), strict=True):
        np.testing.assert_allclose(
            both[:1], alone, rtol=0, atol=1e-15
        )  # cos of one value or of two: rounding
        assert np.isnan(both[1, -1]).all()


@pytest.mark.parametrize("timed", [True, False])
def test_each_ghost_is_drawn_where_its_joints_put_it(
    timed: bool, make_solved: MakeSolved, tmp_path: Path
) -> None:
    run = make_solved(timed=timed)
    assert run.robot is not None
    path = write_recording(run, tmp_path / "solved.rrd")
    (ghost, _) = run.ghosts
    start, end = bones_of(run.robot, ghost.q)
    sent = [
        rows_of(path, f"{FIRST}/arm", f"Capsules3D:{one}")
        for one in ("translations", "quaternions", "lengths")
    ]
    for row, at in enumerate(ghost.t_ns.tolist()):
        begin, quat, length = (np.array(one[at], dtype=np.float64) for one in sent)
        along = matrices(quat) @ (0.0, 0.0, 1.0) * length[:, None]
        np.testing.assert_allclose(begin, start[row], rtol=0, atol=1e-6)  # single precision over 1 m
        np.testing.assert_allclose(begin + along, end[row], rtol=0, atol=1e-6)
    named = scene_of(run).ghosts[0].named[-1]
    labelled = rows_of(path, f"{FIRST}/name", "Points3D:positions")
    last = int(ghost.t_ns[-1])
    np.testing.assert_allclose(labelled[last], name_places(start, end)[-1:, named], rtol=0, atol=1e-6)


def test_a_long_ghost_is_thinned_out_but_begins_where_it_begins(make_solved: MakeSolved) -> None:
    run = make_solved(rows=9000)
    step_ns = STEP_NS
    ghosts = scene_of(run).ghosts
    assert [len(ghost.t_ns) <= POSES + 2 for ghost in ghosts] == [True, True]
    assert [len(ghost.t_ns) >= POSES // 2 for ghost in ghosts] == [True, True]
    assert {0, 30 * step_ns} <= set(ghosts[0].t_ns.tolist())
    assert {2 * step_ns, 30 * step_ns} <= set(ghosts[1].t_ns.tolist())
    np.testing.assert_array_equal(ghosts[0].sample, ghosts[0].t_ns // step_ns)


# --- what is not there -----------------------------------------------------------------------------


@pytest.mark.parametrize("timed", [True, False])
def test_a_ghost_is_gone_where_there_is_no_such_solution(
    timed: bool, make_solved: MakeSolved, tmp_path: Path
) -> None:
    """Rerun shows the last value that there was, so one must say that there is none."""
    path = write_recording(make_solved(timed=timed), tmp_path / "solved.rrd")
    step_ns = STEP_NS if timed else 1_000_000_000
    second = "/branches/left\\,\\ elbow\\ down\\,\\ not\\ flipped"
    for branch, first in ((FIRST, 0), (second, 2)):
        there = [*range(first, 20), *range(30, 40)]
        counts = {"arm/Capsules3D:lengths": 12, "arm/Capsules3D:radii": 12, "name/Points3D:positions": 1}
        for what, count in counts.items():
            leaf, name = what.split("/")
            found = {at // step_ns: len(row) for at, row in rows_of(path, f"{branch}/{leaf}", name).items()}
            assert found == dict.fromkeys(there, count) | {20: 0}


def test_what_stands_at_rows_between_the_samples_has_the_sample_before() -> None:
    """The third row, at 45 ms, lies between two samples of the grid, one in 20 ms."""
    rows = np.array([0, 20, 45, 60, 80, 100]) * 1_000_000
    q = np.array([0.1, -1.2, 1.3, -0.4, 0.7, 0.3]) + 0.01 * np.arange(6)[:, None]
    q[5] = np.nan
    goals = goals_of(Targets(np.zeros((6, 3))), rows, None, ["a", "a", "b", "b", "b", ""])
    ghost = Ghost("b", rows[1:3], q[1:3] + 0.5)
    run = solved_run("path", load_robot("ur5e"), rows, q, goals=goals, ghosts=[ghost])
    assert (run.t_ns // 1_000_000).tolist() == [0, 20, 40, 60, 80, 100]
    scene = scene_of(run)
    (drawn,) = scene.ghosts
    assert (drawn.sample.tolist(), drawn.gone.sample.tolist()) == ([1, 2], [3])
    assert scene.chosen is not None
    assert (scene.chosen.sample.tolist(), scene.chosen.gone.sample.tolist()) == ([0, 1, 2, 3, 4], [5])


def test_the_arm_is_gone_where_a_target_has_no_solution(make_solved: MakeSolved, tmp_path: Path) -> None:
    path = write_recording(make_solved(), tmp_path / "solved.rrd")
    expected = dict.fromkeys((*range(5), *range(9, 40)), 1) | {5: 0}
    for entity, name in (
        ("robot/joints", "Points3D:positions"),
        ("robot/links", "LineStrips3D:strips"),
        ("point/targets", "Points3D:positions"),
    ):
        found = {at // STEP_NS: row for at, row in rows_of(path, f"/{entity}", name).items()}
        assert {row: min(len(values), 1) for row, values in found.items()} == expected


def test_the_shapes_of_the_arm_are_too_small_to_be_seen_where_it_is_gone(
    make_solved: MakeSolved, shapes: Path, tmp_path: Path
) -> None:
    path = write_recording(make_solved(robot=read_urdf(shapes)), tmp_path / "solved.rrd")
    for k in range(1, 7):
        scale = rows_of(path, f"/robot/joint/turn{k}", "Transform3D:scale")
        assert scale == {5 * STEP_NS: [pytest.approx([1e-9] * 3)]}
        moved = rows_of(path, f"/robot/joint/turn{k}", "Transform3D:translation")
        assert [at // STEP_NS for at in moved] == [*range(6), *range(9, 40)]


def test_the_arm_of_a_log_stays_where_a_sample_is_missing(make_solved: MakeSolved) -> None:
    run = replace(make_solved(), goals=None, ghosts=())
    arm = scene_of(run).arm
    assert arm is not None
    assert len(arm.gone.t_ns) == 0


def test_an_arm_that_only_slides_has_ghosts(tmp_path: Path) -> None:
    gantry = Chain("gantry", (Joint("x", "prismatic", axis=(1.0, 0.0, 0.0)), Joint("z", "prismatic")))
    q = np.array([[0.1, 0.2], [0.3, 0.4]])
    ghost = Ghost("b", row_times(2), q + 0.5)
    run = solved_run(
        "one", gantry, None, q, goals=goals_of(targets_of(gantry, q), row_times(2)), ghosts=[ghost]
    )
    (drawn,) = scene_of(run).ghosts
    np.testing.assert_array_equal(drawn.end, points_over_log(gantry, ghost.q)[:, 1:])
    write_recording(run, tmp_path / "gantry.rrd")


def test_a_branch_of_one_pose_is_drawn() -> None:
    q = np.array([[0.1, -1.2, 1.3, -0.4, 0.7, 0.3]])
    goals = goals_of(Targets(np.zeros((1, 3))), row_times(1))
    run = solved_run(
        "one", load_robot("ur5e"), None, q, goals=goals, ghosts=[Ghost("b", row_times(1), q + 1)]
    )
    (ghost,) = scene_of(run).ghosts
    assert (len(ghost.t_ns), len(ghost.gone.t_ns)) == (1, 0)


# --- the plots -------------------------------------------------------------------------------------


def test_single_poses_are_points_without_speeds(make_solved: MakeSolved, tmp_path: Path) -> None:
    """A line from one pose to the next would look like a motion."""
    for timed, style, other, speeds in (
        (True, "SeriesLines", "SeriesPoints", 5), (False, "SeriesPoints", "SeriesLines", 0),
    ):  # fmt: skip
        run = make_solved(timed=timed)
        path = write_recording(run, tmp_path / f"{timed}.rrd")
        names = static(path, "/joints/repolarized", f"{style}:names")
        assert tuple(names) == run.log.joints
        stream = RrdReader(path).store().stream()
        drawn = stream.filter(content="/joints/repolarized", components=f"{other}:names")
        assert list(drawn) == []
        plots, (place,) = Plots(run), places_of(run)
        titles = [str(view.name) for view in (*plots.speed(run, place), *plots.motion(run, place))]
        assert sum("/s" in title for title in titles) == speeds
        assert "TCP [m]" in titles
