"""Which branch is which in the 3D view: colours, thickness, and names that can be read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recorded import rows_of, static
from urmpipe_pipeline.palette import GHOST_COLOURS, rgb, run_colour
from urmpipe_pipeline.recording.ghost_arms import POSES, bones_of, fullest_time
from urmpipe_pipeline.recording.ghost_drawing import AXIS_RADIUS, LINK_RADIUS, OPACITY, THIN
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.recording.views.camera import FIELD_OF_VIEW, eye_distance, in_the_picture, seen
from urmpipe_pipeline.recording.views.label_places import NAME_SIZE, extent_of, name_places, placed_names
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.solved_targets.drawn_run import Ghost

MakeSolved = Callable[..., Run]

STEP_NS = 20_000_000  # of the motion that make_solved makes


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
        assert static(path, f"{entity}/name", "Points3D:show_labels") == [True]
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


def test_the_second_of_two_ghosts_is_half_as_thick_and_axes_are_thinner_than_links(
    make_solved: MakeSolved, tmp_path: Path
) -> None:
    run = make_solved(names=("a", "b"))
    path = write_recording(run, tmp_path / "solved.rrd")
    size = scene_of(run).ball()[1]
    expected = np.repeat((LINK_RADIUS, AXIS_RADIUS), 6) * size  # ur5e: six links, six axes
    for name, share in (("a", 1.0), ("b", THIN)):
        radii = rows_of(path, f"/branches/{name}/arm", "Capsules3D:radii")
        np.testing.assert_allclose(
            radii[2 * STEP_NS], share * expected, rtol=1e-6, atol=0
        )  # single precision
    assert (THIN, LINK_RADIUS > 2 * AXIS_RADIUS) == (0.5, True)


def test_of_two_ghosts_with_the_same_links_one_is_seen_inside_the_other(make_solved: MakeSolved) -> None:
    run = make_solved(names=tuple("abcdefgh"))
    assert [ghost.thin for ghost in scene_of(run).ghosts] == [False, True] * 4


def test_a_name_may_stand_at_the_end_of_a_bone_or_in_its_middle() -> None:
    start, end = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 4.0]])
    np.testing.assert_array_equal(
        name_places(start, end), [[1.0, 0.0, 0.0], [1.0, 0.0, 4.0], [0.5, 0.0, 0.0], [1.0, 0.0, 2.0]]
    )


def test_a_name_that_no_view_can_show_is_shown_as_far_as_it_can(make_solved: MakeSolved) -> None:
    run = named_run(make_solved(names=("a\ud800b", "c")), ("d\ud800",) * 40)
    scene = scene_of(run)
    assert [ghost.name for ghost in scene.ghosts] == ["a?b", "c"]
    assert scene.chosen is not None
    assert set(scene.chosen.texts) == {"chosen: d?"}


@pytest.mark.parametrize(("view", "count"), [(0.0, 8), (30.0, 3)])
def test_names_do_not_lie_on_each_other_in_the_view(view: float, count: int) -> None:
    """Where much else is in view, the arms are small beside their names."""
    arms = np.random.default_rng(3).normal(size=(count, 5, 24, 3))
    arms[0, 2] = np.nan  # there the arm has no pose, and its name no place
    named = placed_names(arms, view)
    picture, box = in_the_picture(arms), np.array(NAME_SIZE) * (view or extent_of(arms))
    for pose in range(5):
        at = picture[np.arange(count), pose, named[:, pose]]
        gaps = np.abs(at[:, None] - at[None]) / box
        np.fill_diagonal(gaps[..., 0], np.inf)
        there = np.isfinite(at).all(axis=1)
        assert there.sum() == (count - 1 if pose == 2 else count)
        assert (gaps.max(axis=2)[np.ix_(there, there)] >= 1.0).all()


def test_what_is_nearer_is_larger_in_the_picture() -> None:
    """Held against the angles at which the eye sees points, from where it is."""
    points = np.random.default_rng(4).normal(size=(50, 3))
    points[7] = np.nan
    found = seen(points)
    found -= (np.nanmin(found, axis=0) + np.nanmax(found, axis=0)) / 2
    distance = eye_distance(found)
    angles = np.arctan2(found[:, :2], (distance - found[:, 2])[:, None])
    picture = in_the_picture(points)
    np.testing.assert_allclose(picture, distance * np.tan(angles), rtol=0, atol=1e-13)  # rounding over 10 m
    assert np.nanmax(np.abs(angles[:, 1])) < FIELD_OF_VIEW / 2
    np.testing.assert_array_equal(in_the_picture(points[:1]), [[0.0, 0.0]])


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
