"""Targets in the 3D view: frames, points, a dashed path, and those missed with why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from asserting import there
from recordable import build_solved
from recorded import entities, packed, static
from solved import solved
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Targets
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS
from urmpipe_pipeline.recording.views.geometry import NEAR, ball, drawn_arm, drawn_targets, extent
from urmpipe_pipeline.results import present, write_recording
from urmpipe_pipeline.solved_targets.result import IkResult
from urmpipe_pipeline.solved_targets.scene import scene

ROOT = "/shown/scene/targets"


def test_targets_without_times_are_frames_and_no_path(tmp_path: Path) -> None:
    one = build_solved(timed=False)
    path = write_recording(one, tmp_path / "solved.rrd")
    strips = np.array(static(path, f"{ROOT}/frames", "LineStrips3D:strips"))
    assert strips.shape == (120, 2, 3)
    # Single precision over 1 m.
    np.testing.assert_allclose(strips[::3, 0], one.targets.position, rtol=0, atol=1e-6)
    axes = (strips[:, 1] - strips[:, 0]).reshape(40, 3, 3)
    length = np.linalg.norm(axes, axis=2)
    expected = there(one.targets.rotation).transpose(0, 2, 1)
    np.testing.assert_allclose(axes / length[..., None], expected, rtol=0, atol=1e-5)  # 1e-7 over 0.1 m
    colours = [packed(AXIS_COLOURS[axis]) for axis in "xyz"]
    assert static(path, f"{ROOT}/frames", "LineStrips3D:colors") == colours * 40
    assert entities(path, ROOT) == {f"{ROOT}/{leaf}" for leaf in ("frames", "missed")}


def test_a_long_path_is_dashed_and_positions_are_points() -> None:
    long = drawn_targets(there(scene(build_solved(rows=200)).targets))
    assert (len(long.origin), len(long.points)) == (0, 0)
    assert len(long.strips) > 10
    few = build_solved(rows=20, timed=False)
    points = drawn_targets(
        there(scene(replace(few, targets=Targets(few.targets.position), angle=None)).targets)
    )
    np.testing.assert_array_equal(points.points, few.targets.position[few.reached])
    np.testing.assert_array_equal(points.missed, few.targets.position[~few.reached])
    assert (len(points.origin), points.strips) == (0, ())


def test_targets_that_are_missed_say_why(tmp_path: Path) -> None:
    path = write_recording(build_solved(), tmp_path / "solved.rrd")
    assert static(path, f"{ROOT}/missed", "Points3D:labels") == [
        f"row {row}: the wrist centre is 1.2 m away, allowed: 0.1 to 0.9 m" for row in range(6, 10)
    ]
    assert static(path, f"{ROOT}/missed", "Points3D:show_labels") == [True]


def test_of_many_targets_that_are_missed_none_has_a_label(tmp_path: Path) -> None:
    one = solved_at(np.zeros((40, 3)), [True] * 9 + [False] * 31, "a; b")
    path = write_recording(one, tmp_path / "solved.rrd")
    assert static(path, f"{ROOT}/missed", "Points3D:show_labels") == [False]
    assert static(path, f"{ROOT}/missed", "Points3D:labels") == [f"row {row}: a" for row in range(1, 10)]


def solved_at(position: FloatArray, missed: list[bool], why: str = "far") -> IkResult:
    """Return targets at some places; the arm has a pose where they are not missed."""
    q = np.where(np.array(missed)[:, None], np.nan, [[0.1, -1.2, 1.3, -0.4, 0.7, 0.3]])
    reasons = tuple(why if one else "" for one in missed)
    return solved("targets", load_robot("ur5e"), q, reasons=reasons, targets=Targets(position))


def in_view(one: IkResult) -> FloatArray:
    """Return every point that is in view in [m], shape (n, 3)."""
    shown = scene(one)
    return extent(drawn_arm(shown.arms[0]), (), (), drawn_targets(there(shown.targets)))


def test_a_target_missed_by_far_does_not_make_the_arm_small() -> None:
    centre, radius = ball(in_view(solved_at(np.zeros((1, 3)), [False])))
    side = np.array([radius, 0.0, 0.0])
    for far, kept in ((0.9 * NEAR, True), (1.1 * NEAR, False), (1000.0, False)):
        place = centre + far * side
        points = in_view(solved_at(np.array([np.zeros(3), place]), [False, True]))
        assert bool((points == place).all(axis=1).any()) is kept


def test_where_all_is_missed_all_targets_are_in_view(tmp_path: Path) -> None:
    places = np.array([[100.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 50.0, 0.0]])
    one = solved_at(places, [True, True, True])
    np.testing.assert_array_equal(in_view(one), places[[0, 2]])
    write_recording(one, tmp_path / "far.rrd")


def test_targets_of_which_none_is_one_can_be_recorded(tmp_path: Path) -> None:
    one = solved_at(np.full((2, 3), np.nan), [True, True])
    np.testing.assert_array_equal(in_view(one), np.zeros((1, 3)))
    write_recording(one, tmp_path / "none.rrd")


def test_the_viewer_opens_at_the_first_target_with_an_arm() -> None:
    places = np.array([[100.0, 0.0, 0.0], [0.3, 0.2, 0.4], [0.3, 0.3, 0.4]])
    assert present(solved_at(places, [True, False, False])).opens_at_row == 1
    assert present(solved_at(places, [True, True, True])).opens_at_row == 0
