"""Solved joint values in the 3D view: branches drawn where they are, told apart, and gone where not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rerun.chunk import RrdReader

from urmpipe_models.catalogue import load_robot
from urmpipe_models.chain import Chain, Joint
from urmpipe_models.inverse.targets import Targets, targets_of
from urmpipe_models.kinematics import points_over_log
from urmpipe_models.orientation import matrices
from urmpipe_models.urdf_reader import read_urdf
from urmpipe_pipeline.compare import compare_runs
from urmpipe_pipeline.joint_log import FloatArray
from urmpipe_pipeline.palette import GHOST_COLOURS, rgb, run_colour
from urmpipe_pipeline.recording import write_recording
from urmpipe_pipeline.recording.entities import places_of
from urmpipe_pipeline.recording.eye import seen
from urmpipe_pipeline.recording.ghost_arms import POSES, bones_of, fullest_time
from urmpipe_pipeline.recording.ghost_drawing import OPACITY, capsules
from urmpipe_pipeline.recording.ghost_names import NAME_SIZE, name_places, placed_names
from urmpipe_pipeline.recording.plots import Plots
from urmpipe_pipeline.recording.scene import NEAR, scene_of
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.results import Run
from urmpipe_pipeline.solved import Ghost, goals_of, row_times, solved_run

MakeSolved = Callable[..., Run]

FIRST = "/branches/right\\,\\ elbow\\ up\\,\\ flipped"
STEP_NS = 20_000_000  # of the motion that make_solved makes


def rows_of(path: Path, entity: str, name: str) -> dict[int, list[Any]]:
    """Return one component of an entity by its times in [ns]."""
    found: dict[int, list[Any]] = {}
    for chunk in RrdReader(path).store().stream().filter(content=entity, components=name):
        batch = chunk.to_record_batch()
        if "t" in batch.schema.names:
            times = batch.column("t").to_numpy(zero_copy_only=False).astype(np.int64).tolist()
            found |= zip(times, batch.column(name).to_pylist(), strict=True)
    return dict(sorted(found.items()))


def static(path: Path, entity: str, name: str) -> Any:
    """Return one component of an entity that stands at all times."""
    stream = RrdReader(path).store().stream().filter(content=entity, components=name)
    (row,) = [row for chunk in stream for row in chunk.to_record_batch().column(name).to_pylist()]
    return row


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


# --- which is which --------------------------------------------------------------------------------


def test_each_branch_has_a_colour_of_its_own_and_its_name(make_solved: MakeSolved, tmp_path: Path) -> None:
    names = tuple(f"branch {k}" for k in range(1, 9))
    run = make_solved(names=names)
    path = write_recording(run, tmp_path / "solved.rrd")
    assert len(set(GHOST_COLOURS.values())) == 8
    assert run_colour(0) == list(GHOST_COLOURS.values())[-1]
    for name, colour in zip(names, GHOST_COLOURS.values(), strict=True):
        entity = f"/branches/{name.replace(' ', chr(92) + ' ')}"
        red, green, blue = rgb(colour)
        packed = red << 24 | green << 16 | blue << 8
        assert static(path, f"{entity}/arm", "Capsules3D:colors") == [packed | OPACITY]
        assert static(path, f"{entity}/name", "Points3D:colors") == [packed | 255]
        assert static(path, f"{entity}/name", "Points3D:labels") == [name]
    told = summary(run).splitlines()
    table = told.index("| branch | drawn | rows | branch | drawn | rows |")
    assert told[table + 2 : table + 8] == [
        "| chosen | solid, its tip orange | 36 | branch 5 | purple | 22 |",
        "| branch 1 | sky blue | 30 | branch 6 | sand | 20 |",
        "| branch 2 | violet | 28 | branch 7 | silver | 18 |",
        "| branch 3 | vermilion | 26 | branch 8 | orange | 16 |",
        "| branch 4 | green | 24 |  |  |  |",
        "",
    ]


def test_many_branches_are_counted(make_solved: MakeSolved) -> None:
    told = summary(make_solved(names=tuple(f"{k}" for k in range(12)), rows=20))
    assert "| 2 | vermilion | 18 | 7 | orange | 13 |" in told
    assert "| 8 |" not in told
    assert "and 4 more branches" in told


def test_of_two_ghosts_with_the_same_links_one_is_seen_inside_the_other(make_solved: MakeSolved) -> None:
    run = make_solved(names=tuple("abcdefgh"))
    assert [ghost.thin for ghost in scene_of(run).ghosts] == [False, True] * 4


def test_names_do_not_lie_on_each_other_in_the_view() -> None:
    arms = np.random.default_rng(3).normal(size=(8, 5, 24, 3))
    arms[0, 2] = np.nan  # there the arm has no pose, and its name no place
    named = placed_names(arms)
    every = seen(arms)
    box = np.array(NAME_SIZE) * np.linalg.norm(
        np.nanmax(every, axis=(0, 1, 2)) - np.nanmin(every, axis=(0, 1, 2))
    )
    for pose in range(5):
        at = every[np.arange(8), pose, named[:, pose], :2]
        gaps = np.abs(at[:, None] - at[None]) / box
        np.fill_diagonal(gaps[..., 0], np.inf)
        there = np.isfinite(at).all(axis=1)
        assert there.sum() == (7 if pose == 2 else 8)
        assert (gaps.max(axis=2)[np.ix_(there, there)] >= 1.0).all()


def test_the_name_of_an_arm_stands_where_it_differs_most_from_the_others() -> None:
    chosen = np.arange(15.0).reshape(1, 5, 3)
    ghost = chosen + np.array([0.0, 0.1, 3.0, 0.2, 0.0])[:, None]
    assert placed_names(np.array([chosen, ghost]))[0].tolist() == [2]


def named_run(run: Run, branches: tuple[str, ...]) -> Run:
    """Return a solved run whose chosen solutions have names."""
    assert run.goals is not None
    return replace(run, goals=replace(run.goals, branches=branches))


def test_the_name_of_the_branch_chosen_stands_at_the_arm(make_solved: MakeSolved, tmp_path: Path) -> None:
    branches = ("up",) * 5 + ("",) * 4 + ("up",) * 3 + ("down",) * 28
    run = named_run(make_solved(timed=False), branches)
    path = write_recording(run, tmp_path / "solved.rrd")
    second = 1_000_000_000
    said = {at // second: row for at, row in rows_of(path, "/robot/name", "Points3D:labels").items()}
    assert said == {k: [f"chosen: {name}"] for k, name in enumerate(branches) if name} | {5: []}
    places = rows_of(path, "/robot/name", "Points3D:positions")
    assert [at // second for at, row in places.items() if not row] == [5]
    assert run.robot is not None
    candidates = name_places(*bones_of(run.robot, run.log.q[[12]]))[0]
    # Single precision over 1 m.
    assert np.abs(candidates - np.array(places[12 * second])).max(axis=1).min() < 1e-6


def test_the_branch_chosen_has_a_name_only_beside_others(make_solved: MakeSolved) -> None:
    run = named_run(make_solved(), ("up",) * 40)
    assert scene_of(run).chosen is not None
    assert scene_of(replace(run, ghosts=())).chosen is None
    assert scene_of(named_run(run, ())).chosen is None
    nowhere = replace(run.log, q=np.full_like(run.log.q, np.nan))
    assert scene_of(replace(run, log=nowhere, q=nowhere.q)).chosen is None
    assert "| chosen: up | solid, its tip orange | 36 |" in summary(run)
    assert "| chosen | solid, its tip orange | 36 |" in summary(named_run(run, ("up", "down") * 20))


def test_along_a_motion_a_new_branch_is_told_at_its_row(make_solved: MakeSolved) -> None:
    run = named_run(make_solved(rows=9000), ("up",) * 4001 + ("down",) * 4999)
    chosen = scene_of(run).chosen
    assert chosen is not None
    assert len(chosen.texts) <= POSES + 3
    told = dict(zip((chosen.t_ns // STEP_NS).tolist(), chosen.texts, strict=True))
    assert told[4001] == "chosen: down"
    assert {told[row] for row in told if row < 4001} == {"chosen: up"}


def test_of_many_single_poses_the_ghosts_of_the_first_are_drawn(make_solved: MakeSolved) -> None:
    """Of every tenth, say, a ghost would stand beside the arm of another target."""
    (ghost, _) = scene_of(make_solved(rows=POSES + 50, timed=False)).ghosts
    there = [*range(20), *range(30, POSES)]
    assert (ghost.t_ns // 1_000_000_000).tolist() == there
    assert (ghost.gone.t_ns // 1_000_000_000).tolist() == [20, POSES]


def test_a_ghost_on_every_second_row_is_drawn_there_alone_and_not_without_end(
    make_solved: MakeSolved,
) -> None:
    run = make_solved(rows=9000)
    ghost = run.ghosts[0]
    rows = np.arange(0, 9000, 2)
    sparse = Ghost("sparse", run.log.t_ns[rows], np.resize(ghost.q, (len(rows), 6)))
    (drawn,) = scene_of(replace(run, ghosts=(sparse,))).ghosts
    assert POSES // 2 <= len(drawn.t_ns) <= 2 * POSES + 2
    assert set(drawn.t_ns.tolist()) <= set(sparse.t_ns.tolist())
    np.testing.assert_array_equal(drawn.gone.t_ns, run.log.t_ns[1::2])


def test_a_name_keeps_its_place_in_a_motion_and_leaps_between_single_poses(make_solved: MakeSolved) -> None:
    names = tuple(f"{k}" for k in range(8))
    motion, poses = (scene_of(make_solved(timed=timed, names=names)).ghosts for timed in (True, False))
    assert [len(set(ghost.named.tolist())) for ghost in motion] == [1] * 8
    assert max(len(set(ghost.named.tolist())) for ghost in poses) > 1


def test_the_viewer_opens_where_most_branches_are(make_solved: MakeSolved, tmp_path: Path) -> None:
    run = make_solved()
    assert fullest_time(run) == 2 * STEP_NS  # the arm and both ghosts, for the first time
    path = write_recording(run, tmp_path / "solved.rrd")
    assert Store(path).opens_at_ns == 2 * STEP_NS


# --- the targets -----------------------------------------------------------------------------------


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
    drawn = {chunk.entity_path for chunk in RrdReader(path).store().stream().filter(content="/targets/**")}
    assert drawn == {f"/targets/{leaf}" for leaf in ("frames", "missed", "position", "quat_xyzw")}
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


def test_a_comparison_draws_no_ghosts(make_solved: MakeSolved) -> None:
    run = make_solved()
    scene = scene_of(compare_runs(run, [run]))
    assert (scene.ghosts, scene.goals) == ((), None)


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
