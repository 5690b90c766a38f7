"""The targets of solved joint values in the 3D view: frames, points, a way, and those missed with why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rerun.chunk import RrdReader

from recorded import static
from urmpipe_models.arrays import FloatArray
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.orientation import matrices
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import compare_runs
from urmpipe_pipeline.inverse.solved import goals_of, row_times, solved_run
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.palette import AXIS_COLOURS, rgb
from urmpipe_pipeline.recording.layout import opening_time
from urmpipe_pipeline.recording.scene import NEAR, scene_of
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.results import Run

MakeSolved = Callable[..., Run]


def test_targets_without_times_are_frames_and_no_way(make_solved: MakeSolved, tmp_path: Path) -> None:
    run = make_solved(timed=False)
    assert run.goals is not None
    path = write_recording(run, tmp_path / "solved.rrd")
    strips = np.array(static(path, "/targets/frames", "LineStrips3D:strips"))
    assert strips.shape == (120, 2, 3)
    # Single precision over 1 m.
    np.testing.assert_allclose(strips[::3, 0], run.goals.position, rtol=0, atol=1e-6)
    assert run.goals.quat_xyzw is not None
    axes = (strips[:, 1] - strips[:, 0]).reshape(40, 3, 3)
    length = np.linalg.norm(axes, axis=2)
    expected = matrices(run.goals.quat_xyzw).transpose(0, 2, 1)
    np.testing.assert_allclose(axes / length[..., None], expected, rtol=0, atol=1e-5)  # 1e-7 over 0.1 m
    packed = [
        red << 24 | green << 16 | blue << 8 | 255 for red, green, blue in map(rgb, AXIS_COLOURS.values())
    ]
    assert static(path, "/targets/frames", "LineStrips3D:colors") == packed[:3] * 40  # x, y, z
    drawn = {chunk.entity_path for chunk in RrdReader(path).store().stream().filter(content="/targets/**")}
    assert drawn == {f"/targets/{leaf}" for leaf in ("frames", "missed")}
    assert scene_of(run).ways[0].strips == ()


def test_a_long_path_is_a_dashed_way_and_positions_are_points(make_solved: MakeSolved) -> None:
    run = make_solved(rows=200)
    assert run.goals is not None
    goals = scene_of(run).goals
    assert goals is not None
    assert (len(goals.origin), len(goals.points)) == (0, 0)
    assert len(goals.strips) > 10
    alone = replace(run, goals=goals_of(Targets(run.goals.position), run.goals.t_ns))
    few = make_solved(rows=20, timed=False)
    assert few.goals is not None
    points = scene_of(replace(few, goals=goals_of(Targets(few.goals.position), few.goals.t_ns))).goals
    assert points is not None
    np.testing.assert_array_equal(points.points, few.goals.position)
    assert points.strips == ()
    assert scene_of(alone).goals is not None


def test_targets_that_are_missed_say_why(make_solved: MakeSolved, tmp_path: Path) -> None:
    path = write_recording(make_solved(), tmp_path / "solved.rrd")
    said = static(path, "/targets/missed", "Points3D:labels")
    assert said == [
        f"row {row}: the wrist centre is 1.2 m away, allowed: 0.1 to 0.9 m" for row in range(6, 10)
    ]
    assert static(path, "/targets/missed", "Points3D:show_labels") == [True]


def test_of_many_targets_that_are_missed_none_has_a_label(make_solved: MakeSolved, tmp_path: Path) -> None:
    run = make_solved()
    assert run.goals is not None
    many = replace(run.goals, reasons=("a; b",) * 9 + ("",) * 31)
    path = write_recording(replace(run, goals=many), tmp_path / "solved.rrd")
    assert static(path, "/targets/missed", "Points3D:show_labels") == [False]
    assert static(path, "/targets/missed", "Points3D:labels") == [f"row {row}: a" for row in range(1, 10)]


def solved_at(position: FloatArray, missed: list[bool]) -> Run:
    """Return a run of targets at some places; the arm has a pose where they are not missed."""
    q = np.where(np.array(missed)[:, None], np.nan, [[0.1, -1.2, 1.3, -0.4, 0.7, 0.3]])
    reasons = ["far" if one else "" for one in missed]
    goals = goals_of(Targets(position), row_times(len(missed)), reasons)
    return solved_run("targets", load_robot("ur5e"), None, q, goals=goals)


def test_a_target_missed_by_far_does_not_make_the_arm_small() -> None:
    arm = solved_at(np.zeros((1, 3)), [False])
    centre, radius = scene_of(arm).ball()
    side = np.array([radius, 0.0, 0.0])
    for far, kept in ((0.9 * NEAR, True), (1.1 * NEAR, False), (1000.0, False)):
        place = centre + far * side
        points = scene_of(solved_at(np.array([np.zeros(3), place]), [False, True])).points()
        assert bool((points == place).all(axis=1).any()) is kept


def test_where_all_is_missed_all_targets_are_in_view(tmp_path: Path) -> None:
    places = np.array([[100.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 50.0, 0.0]])
    run = solved_at(places, [True, True, True])
    np.testing.assert_array_equal(scene_of(run).points(), places[[0, 2]])
    write_recording(run, tmp_path / "far.rrd")


def test_a_run_without_a_target_that_is_one_can_be_recorded(tmp_path: Path) -> None:
    run = solved_at(np.full((2, 3), np.nan), [True, True])
    np.testing.assert_array_equal(scene_of(run).points(), np.zeros((1, 3)))
    write_recording(run, tmp_path / "none.rrd")


def test_the_viewer_opens_at_the_first_target_with_an_arm() -> None:
    places = np.array([[100.0, 0.0, 0.0], [0.3, 0.2, 0.4], [0.3, 0.3, 0.4]])
    assert opening_time(solved_at(places, [True, False, False])) == 1_000_000_000
    assert opening_time(solved_at(places, [True, True, True])) == 0


def test_rows_without_an_arm_are_told() -> None:
    counts = "Without times: the timeline counts rows, t = 0 s is row 1."
    places = np.array([[0.3, 0.2, 0.4], [0.3, 0.3, 0.4]])
    assert counts in summary(solved_at(places, [False, False])).splitlines()
    jump = replace(solved_at(places, [False, False]), warnings=(LogWarning("jump", "1 jump"),))
    assert counts in summary(jump).splitlines()
    told = summary(solved_at(places, [True, False])).splitlines()
    assert f"{counts} Rows that are not reached show no arm." in told


def test_a_comparison_draws_no_ghosts(make_solved: MakeSolved) -> None:
    run = make_solved()
    scene = scene_of(compare_runs(run, [run]))
    assert (scene.ghosts, scene.goals) == ((), None)
