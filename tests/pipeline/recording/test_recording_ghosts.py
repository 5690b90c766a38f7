"""Solved targets in a recording: they come back as they were; ghosts are drawn where they are, else gone."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rerun.chunk import RrdReader

from recordable import build_solved
from recorded import packed, rows_of, static
from same_results import assert_comes_back, assert_same
from solved import solved
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Targets
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_models.math3d import to_matrices
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_pipeline.presentation.figure import Figure
from urmpipe_pipeline.presentation.palette import GHOST_COLOURS, run_colour
from urmpipe_pipeline.presentation.scene import Arm
from urmpipe_pipeline.recording.layout import ROW, TIME
from urmpipe_pipeline.recording.reader import Store
from urmpipe_pipeline.recording.views.geometry import (
    POSES,
    ball,
    bones_of,
    drawn_arm,
    drawn_ghosts,
    drawn_labels,
    extent,
)
from urmpipe_pipeline.recording.views.label_places import name_places
from urmpipe_pipeline.recording.views.scene_drawing import AXIS, LINK, OPACITY, THIN, capsules
from urmpipe_pipeline.recording.views.shapes import SEEN_THROUGH
from urmpipe_pipeline.results import present, read_recording, write_recording
from urmpipe_pipeline.solved_targets.scene import ghosts, scene

STEP_NS = 20_000_000  # of the motion that build_solved makes
SCENE = "/shown/scene"


# --- read back -------------------------------------------------------------------------------------


@pytest.mark.parametrize("timed", [True, False])
def test_solved_targets_come_back_as_they_were(timed: bool, tmp_path: Path) -> None:
    one = build_solved(timed=timed)
    if timed:
        one = replace(one, motion=one.as_run())
    assert_comes_back(one, tmp_path)


def test_positions_alone_and_targets_that_are_none_come_back(tmp_path: Path) -> None:
    one = build_solved(timed=False)
    position = one.targets.position.copy()
    position[5] = np.nan
    one = replace(one, targets=Targets(position), angle=None, all_solutions=False)
    assert_comes_back(one, tmp_path)


def test_branches_may_be_called_anything(tmp_path: Path) -> None:
    names = ("1", "q", "a/b", "a\\", "a", "a ", "", "unnamed", "elbow (2)", "ü, 肘", "**", "a\ud800b")
    one = build_solved(names=names, rows=20)
    assert [ghost.name for ghost in ghosts(one)] == list(names)
    path = write_recording(one, tmp_path / "solved.rrd")
    assert_same(read_recording(path), one)
    labels = rows_of(path, f"{SCENE}/label/11", "Points3D:labels")  # one has none
    assert {row[0] for row in labels.values() if row} == {"a?b"}  # what no view can show, as far as it can


# --- the bones -------------------------------------------------------------------------------------


@given(arrays(np.float64, (3,), elements=st.floats(-3.0, 3.0)))
@example(np.array([0.0, 0.0, -1.0]))
@example(np.array([0.0, 0.0, 1.0]))
@example(np.array([1e-9, 0.0, -1.0]))
@example(np.zeros(3))
def test_a_capsule_lies_along_its_bone(bone: FloatArray) -> None:
    length, quat = capsules(bone)
    along = to_matrices(quat.astype(np.float64)[None])[0] @ (0.0, 0.0, float(length))
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
        # cos of one value or of two: rounding
        np.testing.assert_allclose(both[:1], alone, rtol=0, atol=1e-15)
        assert np.isnan(both[1, -1]).all()


# --- where ghosts are ------------------------------------------------------------------------------


def drawn(path: Path, entity: str, name: str, *, timed: bool) -> dict[int, list[object]]:
    """Return one component of an entity of the scene by the row, from 0, at which it is drawn."""
    if timed:
        return {at // STEP_NS: row for at, row in rows_of(path, f"{SCENE}/{entity}", name).items()}
    return {at - 1: row for at, row in rows_of(path, f"{SCENE}/{entity}", name, "row").items()}


@pytest.mark.parametrize("timed", [True, False])
def test_each_ghost_is_drawn_where_its_joints_put_it_and_gone_elsewhere(timed: bool, tmp_path: Path) -> None:
    """Rerun shows the last value that there was, so one must say that there is none."""
    one = build_solved(timed=timed)
    path = write_recording(one, tmp_path / "solved.rrd")
    for number, ghost in enumerate(ghosts(one)):
        there = np.flatnonzero(np.isfinite(ghost.q).all(axis=1)).tolist()
        assert there == [*range(2 * number, 5), *range(9, 20), *range(30, 40)]
        start, end = bones_of(one.robot, ghost.q)
        sent = [
            drawn(path, f"ghost/{number}", f"Capsules3D:{part}", timed=timed)
            for part in ("translations", "quaternions", "lengths", "radii")
        ]
        for rows in sent:
            assert [row for row, values in rows.items() if values] == there
            assert [row for row, values in rows.items() if not values] == [5, 20]
        for row in there:
            begin, quat, length = (np.array(part[row], dtype=np.float64) for part in sent[:3])
            along = to_matrices(quat) @ (0.0, 0.0, 1.0) * length[:, None]
            np.testing.assert_allclose(begin, start[row], rtol=0, atol=1e-6)  # single precision over 1 m
            np.testing.assert_allclose(begin + along, end[row], rtol=0, atol=1e-6)


def test_the_arm_is_gone_where_a_target_has_no_solution(tmp_path: Path) -> None:
    path = write_recording(build_solved(), tmp_path / "solved.rrd")
    expected = dict.fromkeys((*range(5), *range(9, 40)), 1) | {5: 0}
    for entity in ("robot/tip", "point/targets"):
        found = drawn(path, entity, "Points3D:positions", timed=True)
        assert {row: min(len(values), 1) for row, values in found.items()} == expected


@pytest.mark.parametrize("own", [True, False])
def test_the_shapes_of_the_arm_are_too_small_to_be_seen_where_it_is_gone(
    own: bool, shapes: Path, tmp_path: Path
) -> None:
    robot = read_urdf(shapes)
    robot = robot if own else replace(robot, visuals=())
    path = write_recording(build_solved(robot=robot), tmp_path / "solved.rrd")
    for k in range(1, 7):
        entity = f"{SCENE}/robot/joint/turn{k}"
        assert rows_of(path, entity, "Transform3D:scale") == {5 * STEP_NS: [pytest.approx([1e-9] * 3)]}
        moved = rows_of(path, entity, "Transform3D:translation")
        assert [at // STEP_NS for at in moved] == [*range(6), *range(9, 40)]


def test_a_long_ghost_is_thinned_out_but_begins_where_it_begins() -> None:
    first, second = drawn_ghosts(scene(build_solved(rows=9000)).arms)
    for ghost, begins in ((first, {0, 9, 30}), (second, {2, 9, 30})):
        assert POSES // 2 <= len(ghost.moving.rows) <= POSES + 3
        assert begins <= set(ghost.moving.rows.tolist())


def test_of_many_single_poses_the_ghosts_of_the_first_are_drawn() -> None:
    """Of every tenth, say, a ghost would stand beside the arm of another target."""
    ghost, _ = drawn_ghosts(scene(build_solved(rows=POSES + 50, timed=False)).arms)
    assert ghost.moving.rows.tolist() == [*range(5), *range(9, 20), *range(30, POSES)]
    assert ghost.moving.gone.tolist() == [5, 20, POSES]


def test_a_ghost_on_every_second_row_is_drawn_there_alone_and_not_without_end() -> None:
    q = np.tile([0.1, -1.2, 1.3, -0.4, 0.7, 0.3], (9000, 1))
    q[1::2] = np.nan
    (ghost,) = drawn_ghosts([Arm(load_robot("ur5e"), q, np.arange(9000) * STEP_NS, "#000000", ghost=True)])
    assert POSES // 2 <= len(ghost.moving.rows) <= 2 * POSES + 2
    assert not (ghost.moving.rows % 2).any()
    np.testing.assert_array_equal(ghost.moving.gone, np.arange(1, 9000, 2))


def test_an_arm_that_only_slides_has_ghosts(tmp_path: Path) -> None:
    gantry = Chain("gantry", (Joint("x", "prismatic", axis=(1.0, 0.0, 0.0)), Joint("z", "prismatic")))
    q = np.array([[0.1, 0.2], [0.3, 0.4]])
    one = solved("one", gantry, q, others={"b": q + 0.5})
    (ghost,) = drawn_ghosts(scene(one).arms)
    np.testing.assert_array_equal(ghost.end, points_over_log(gantry, q + 0.5)[:, 1:])
    write_recording(one, tmp_path / "gantry.rrd")


# --- which is which --------------------------------------------------------------------------------


@pytest.mark.slow
def test_each_branch_has_a_colour_of_its_own_and_its_name(tmp_path: Path) -> None:
    names = tuple(f"branch {k}" for k in range(1, 9))
    path = write_recording(build_solved(names=names), tmp_path / "solved.rrd")
    assert len(set(GHOST_COLOURS.values())) == 8
    assert run_colour(0) == list(GHOST_COLOURS.values())[-1]
    for number, (name, colour) in enumerate(zip(names, GHOST_COLOURS.values(), strict=True)):
        faint = packed(colour) - 255 + OPACITY
        assert static(path, f"{SCENE}/ghost/{number}", "Capsules3D:colors") == [faint]
        label = f"{SCENE}/label/{number + 1}"
        assert static(path, label, "Points3D:colors") == [packed(colour)]
        assert static(path, label, "Points3D:show_labels") == [True]
        labels = rows_of(path, label, "Points3D:labels")
        assert {row[0] for row in labels.values() if row} == {name}


def test_the_second_of_two_ghosts_is_half_as_thick_and_axes_are_thinner_than_links(tmp_path: Path) -> None:
    path = write_recording(build_solved(names=tuple("abcd")), tmp_path / "solved.rrd")
    shapes = [
        np.array(drawn(path, f"ghost/{number}", "Capsules3D:radii", timed=True)[12]) for number in range(4)
    ]
    for radii, share in zip(shapes, (1.0, THIN) * 2, strict=True):
        np.testing.assert_allclose(radii, share * shapes[0], rtol=1e-6, atol=0)  # single precision
        np.testing.assert_allclose(
            radii[6:] / radii[:6], AXIS / LINK, rtol=1e-6, atol=0
        )  # six links, six axes
    assert (THIN, LINK > 2 * AXIS) == (0.5, True)


def test_the_name_of_the_branch_chosen_stands_at_the_arm(tmp_path: Path) -> None:
    one = build_solved(timed=False)
    labels = np.array(one.solutions.labels)
    labels[:12, 0], labels[12:, 0] = "up", "down"
    one = replace(one, solutions=replace(one.solutions, labels=labels))
    path = write_recording(one, tmp_path / "solved.rrd")
    said = drawn(path, "label/0", "Points3D:labels", timed=False)
    names = dict(enumerate(one.branch))
    assert said == {row: [f"chosen: {name}"] for row, name in names.items() if name} | {5: []}
    places = drawn(path, "label/0", "Points3D:positions", timed=False)
    assert [row for row, place in places.items() if not place] == [5]
    candidates = name_places(*bones_of(one.robot, one.q[[12]]))[0]
    # Single precision over 1 m.
    assert np.abs(candidates - np.array(places[12])).max(axis=1).min() < 1e-6


def test_the_branch_chosen_has_a_name_only_beside_others() -> None:
    one = build_solved()
    assert [bool(arm.label) for arm in scene(one).arms] == [True] * 3
    assert [bool(arm.label) for arm in scene(replace(one, all_solutions=False)).arms] == [False]


def test_along_a_motion_a_new_branch_is_told_at_its_row() -> None:
    one = build_solved(rows=9000)
    labels = np.array(one.solutions.labels)
    labels[:4001, 0], labels[4001:, 0] = "up", "down"
    arms = scene(replace(one, solutions=replace(one.solutions, labels=labels))).arms
    chosen = drawn_labels(arms, 0.0, 12)[0]
    assert len(chosen.texts) <= POSES + 3
    told = dict(zip(chosen.moving.rows.tolist(), chosen.texts, strict=True))
    assert told[4001] == "chosen: down"
    assert {told[row] for row in told if row < 4001} == {"chosen: up"}


def test_a_name_keeps_its_place_in_a_motion_and_leaps_between_single_poses() -> None:
    names = tuple(f"{k}" for k in range(8))

    def places(timed: bool) -> list[int]:
        """Return at how many of its places the name of each ghost stands."""
        arms = scene(build_solved(timed=timed, names=names)).arms
        found = []
        for arm, label in zip(arms, drawn_labels(arms, 0.0, 12), strict=True):
            every = name_places(*bones_of(arm.chain, arm.q[label.moving.rows]))
            away = np.linalg.norm(every - label.position[:, None], axis=2)
            found.append(len(set(np.argmin(away, axis=1).tolist())))
        return found

    assert places(timed=True) == [1] * 9
    assert max(places(timed=False)) > 1


def test_the_viewer_opens_where_most_branches_are(tmp_path: Path) -> None:
    store = Store(write_recording(build_solved(), tmp_path / "solved.rrd"))
    # At row 2 the arm and both ghosts are there for the first time.
    assert store.opening == (TIME, 2 * STEP_NS)
    store = Store(write_recording(build_solved(timed=False), tmp_path / "poses.rrd"))
    assert store.opening == (ROW, 3)  # rows count from 1


# --- without times ---------------------------------------------------------------------------------


def test_single_poses_stand_on_rows_alone(tmp_path: Path) -> None:
    """There is no time to play: every chunk that is drawn stands on the rows, from 1."""
    path = write_recording(build_solved(timed=False), tmp_path / "solved.rrd")
    on = set()
    for chunk in RrdReader(path).store().stream():
        if not chunk.is_static and not chunk.entity_path.startswith("/__"):
            on |= set(chunk.timeline_names)
    assert on == {"row"}


def test_what_is_shown_of_targets_without_times_has_no_line_and_no_speed() -> None:
    """A line from one pose to the next would look like a motion."""
    for timed, speeds in ((True, 5), (False, 0)):
        figures = present(build_solved(timed=timed)).body.figures()
        views = [view for figure in figures if isinstance(figure, Figure) for view in figure.views]
        units = [panel.unit for view in views for panel in view.panels]
        assert sum("/s" in unit for unit in units) == speeds
        lines = [line for view in views for panel in view.panels for line in panel.lines]
        assert {line.points for line in lines} == {not timed}


# --- what is in view -------------------------------------------------------------------------------


def test_all_of_the_arms_is_in_view() -> None:
    shown = scene(build_solved())
    arm = next(drawn_arm(one) for one in shown.arms)
    beside = drawn_ghosts(shown.arms)
    centre, radius = ball(extent(arm, beside, [], None))
    for ghost in beside:
        assert np.linalg.norm(ghost.end - centre, axis=2).max() <= radius * (1 + 1e-12)


def test_solids_are_seen_through_where_ghosts_can_be_inside(tmp_path: Path) -> None:
    for names, opacity in ((("a", "b"), round(255 * SEEN_THROUGH)), ((), 255)):
        path = write_recording(build_solved(names=names, rows=5), tmp_path / f"{opacity}.rrd")
        entity = f"{SCENE}/robot/joint/elbow_joint/visual\\ 1"
        assert [colour & 0xFF for colour in static(path, entity, "Cylinders3D:colors")] == [opacity]
