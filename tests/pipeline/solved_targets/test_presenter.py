"""What solved targets show: headline, facts, tables, checks, events, and what stands in space."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import urmpipe
from solved import solved
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import DEFAULT_SEARCH, forward_targets, pose_errors
from urmpipe_models.math3d import to_matrices
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.presentation.figure import Figure
from urmpipe_pipeline.presentation.section import Presentation, Table, Value
from urmpipe_pipeline.results import present
from urmpipe_pipeline.solved_targets.given_targets import given_targets
from urmpipe_pipeline.solved_targets.parts import unreached
from urmpipe_pipeline.solved_targets.presenter import headline
from urmpipe_pipeline.solved_targets.request import Request
from urmpipe_pipeline.solved_targets.result import IkResult
from urmpipe_pipeline.solved_targets.scene import ghosts, opening_row, scene
from urmpipe_pipeline.solved_targets.solving import solve_targets

UR5E, ARM6 = load_robot("ur5e"), load_robot("arm6")
STEP_NS = 10_000_000


def way(rows: int) -> FloatArray:
    """Return a slow motion of six joints."""
    sway = np.sin(np.outer(np.arange(rows) / 40, np.arange(1, 7)))
    return np.asarray(np.array([0.3, 0.8, -0.6, 0.5, 0.7, 0.2]) + 0.2 * sway)


@pytest.fixture(scope="module")
def path() -> IkResult:
    """A path of arm6 of which some rows are out of reach, with every branch beside it."""
    targets = forward_targets(ARM6, way(40))
    targets.position[17:20, 2] = 3.0
    given = given_targets(targets, 7.0 + 0.01 * np.arange(40), None, None)
    return solve_targets(Request(ARM6, given, way(1)[0], True, False, "auto", DEFAULT_SEARCH))


def test_rows_out_of_reach_for_one_reason_are_one_line_whatever_its_numbers() -> None:
    arm = load_robot("ur5e")
    poses = np.tile(np.eye(4), (7, 1, 1))
    poses[:, 0, 3] = [0.3, 1.1, 1.2, 1.3, 0.3, 1.5, 1.5]
    poses[6, :3, 3] = np.nan
    found = urmpipe.ik(poses, arm)
    first = [(reason or "").split("; ")[0] for reason in found.reasons]
    assert list(unreached(found)) == [
        f"rows 2-4: row 3: {first[2]}",
        f"row 6: {first[5]}",
        f"row 7: {first[6]}",
    ]
    same = np.repeat(poses[1:2], 3, axis=0)
    assert list(unreached(urmpipe.ik(same, arm))) == [f"rows 1-3: {first[1]}"]


def test_a_joint_that_is_too_fast_twice_is_one_joint() -> None:
    arm = load_robot("ur5e")
    q = np.tile([0.1, -0.9, 1.2, -0.5, 0.7, 0.2], (40, 1))
    q[:, 0] += np.cumsum(np.where((np.arange(40) // 10) % 2, 0.05, 0.001))
    found = urmpipe.ik(forward_targets(arm, q), arm, tsp=0.01, start=q[0].tolist())
    assert found.path is not None
    assert [one.joint for one in found.path.speed_violations] == ["shoulder_pan_joint"] * 2
    assert headline(found).endswith(" (closed form: three parallel axes), with 1 joint too fast")


def test_every_ghost_brings_the_tool_to_the_targets_as_the_chosen_solution_does(path: IkResult) -> None:
    shown = scene(path)
    chosen, *others = shown.arms
    assert shown.targets is not None and shown.targets.quat_xyzw is not None and path.t_ns is not None
    assert not chosen.ghost and chosen.vanishes and all(one.ghost and one.vanishes for one in others)
    assert len(others) == 7
    reached = path.reached
    assert np.array_equal(shown.targets.reached, reached)
    assert np.flatnonzero(~reached).tolist() == [17, 18, 19]
    assert path.targets.rotation is not None
    back = to_matrices(shown.targets.quat_xyzw)
    assert np.abs(back - path.targets.rotation).max() < 1e-15  # a rotation as a quaternion and back
    for arm in (chosen, *others):
        assert arm.t_ns is not None
        assert np.array_equal(np.flatnonzero(np.isnan(arm.q).all(axis=1)), [17, 18, 19])
        for miss in pose_errors(ARM6, arm.q[reached], path.targets.rows(reached)):
            assert np.abs(miss).max() < 1e-10
    for ghost in others:
        away = ghost.q[reached] - path.q[reached]
        away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
        assert np.abs(away).max(axis=1).min() > 0.1  # another branch, at every row
    (way_of_tool,) = shown.paths
    assert np.abs(way_of_tool.position[reached] - path.targets.position[reached]).max() < 1e-10
    assert isinstance(chosen.label, tuple)
    assert set(chosen.label) == {f"chosen: {path.branch[0]}", ""}
    assert [bool(one) for one in shown.targets.reasons] == (~reached).tolist()


def test_a_ghost_is_where_another_solution_is() -> None:
    chosen = way(4)
    chosen[3] = np.nan
    other = way(4) + 0.5
    other[1] = np.nan  # the second branch ends for a target
    other[2] = chosen[2] - 2 * math.pi  # and meets the chosen solution in another
    none = np.full((4, 6), np.nan)
    found = solved(
        "targets", UR5E, chosen, others={"b": other, "c": none, "d": chosen + 2 * math.pi},
        targets=forward_targets(UR5E, way(4)),
    )  # fmt: skip
    (ghost,) = ghosts(found)
    assert ghost.name == "b"
    assert np.flatnonzero(np.isfinite(ghost.q).all(axis=1)).tolist() == [0, 3]
    assert np.array_equal(ghost.q[[0, 3]], other[[0, 3]])
    assert ghosts(replace(found, all_solutions=False)) == ()


def test_a_turn_of_a_sliding_joint_is_another_solution() -> None:
    slider = Chain("slider", (Joint("z", "prismatic"), Joint("turn")))
    q = np.array([[0.25, 0.5]])
    others = {"far": q + np.array([2 * math.pi, 0.0]), "near": q + np.array([0.0, 2 * math.pi])}
    assert [ghost.name for ghost in ghosts(solved("targets", slider, q, others=others))] == ["far"]


def panels(shown: Presentation) -> list[tuple[bool, bool]]:
    """Return of each panel whether it has times, and whether its rows are points."""
    return [
        (panel.t_ns is not None, line.points)
        for figure in shown.body.figures()
        if isinstance(figure, Figure)
        for view in figure.views
        for panel in view.panels
        for line in panel.lines
    ]


def test_targets_without_times_show_no_time(path: IkResult) -> None:
    q = way(5)
    q[0] = np.nan
    poses = solved(
        "poses", ARM6, q, targets=forward_targets(ARM6, way(5)), reasons=("too far", "", "", "", "")
    )
    shown = present(poses)
    assert set(panels(shown)) == {(False, True)}
    assert {one.t_ns for one in shown.body.events()} == {None}
    space = scene(poses)
    assert [arm.t_ns for arm in space.arms] == [None]
    assert (space.paths, space.targets and space.targets.t_ns) == ((), None)
    assert shown.opens_at_row == opening_row(poses) == 1  # the first row that is reached
    assert set(panels(present(path))) == {(True, False)}
    assert (present(path).opens_at_ns, present(path).opens_at_row) == (0, None)


def test_the_checks_are_the_verdict(path: IkResult) -> None:
    q = np.tile([0.1, -0.9, 1.2, -0.5, 0.7, 0.2], (30, 1))
    q[:, 0] += 0.05 * np.arange(30)  # 5 rad/s
    fast = urmpipe.ik(forward_targets(UR5E, q), UR5E, tsp=0.01, start=q[0].tolist())
    whole = solved("poses", ARM6, way(3))
    for one, failed in ((path, ["unreachable"]), (fast, ["joint-too-fast"]), (whole, [])):
        shown = present(one)
        assert [check.kind for check in shown.body.checks if check.verdict == "fail"] == failed
        assert shown.verdict == shown.body.verdict == one.verdict == ("fail" if failed else "pass")


def solutions(one: IkResult) -> Table:
    """The first table that is not about targets without a solution."""
    return next(table for table in present(one).body.tables if "without a solution" not in table.title)


def test_the_table_has_the_solutions_of_the_result(path: IkResult) -> None:
    every = urmpipe.ik(forward_targets(ARM6, way(2)), ARM6, every=True)
    for one, rows in ((every, int(every.solutions.reached.sum())), (replace(every, all_solutions=False), 2)):
        table = solutions(one)
        columns = {column.key: list(column.cells) for column in table.columns}
        assert len(columns["row"]) == rows
        frame = one.to_frame() if one.all_solutions else one.to_frame().query("nearest")
        for key in ("position_error", *ARM6.coordinates):
            told = [cell.number for cell in columns[key] if isinstance(cell, Value)]
            assert told == pytest.approx(frame[key].tolist(), abs=5.1e-10)  # joints are rounded to 1e-9
    joints = {column.key: list(column.cells) for column in solutions(path).columns}
    assert [cell.number for cell in joints["end"] if isinstance(cell, Value)] == pytest.approx(
        path.q[-1].tolist(), abs=5.1e-10
    )
