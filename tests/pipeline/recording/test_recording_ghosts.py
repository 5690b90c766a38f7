"""Laws of ghosts: where their bones and names are, and that they are gone where there is no solution."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from recordable import STEP_NS, build_solved
from recorded import rows_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_models.math3d import to_matrices
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.recording.views.geometry import POSES, bones_of, drawn_labels
from urmpipe_pipeline.recording.views.label_places import name_places
from urmpipe_pipeline.recording.views.scene_drawing import capsules
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.solved_targets.scene import ghosts, scene


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


def test_each_ghost_is_drawn_where_its_joints_put_it_and_gone_elsewhere(tmp_path: Path) -> None:
    """Rerun shows the last value that there was, so one must say that there is none."""
    one = build_solved()
    path = write_recording(one, tmp_path / "solved.rrd")
    for number, ghost in enumerate(ghosts(one)):
        there = np.flatnonzero(np.isfinite(ghost.q).all(axis=1)).tolist()
        start, end = bones_of(one.robot, ghost.q)
        begins, quaternions, lengths = (
            rows_of(path, f"/shown/scene/ghost/{number}", f"Capsules3D:{part}")
            for part in ("translations", "quaternions", "lengths")
        )
        assert [at // STEP_NS for at, values in begins.items() if values] == there
        for row in there:
            begin, quat, length = (np.array(part[row * STEP_NS]) for part in (begins, quaternions, lengths))
            along = to_matrices(quat.astype(np.float64)) @ (0.0, 0.0, 1.0) * length[:, None]
            np.testing.assert_allclose(begin, start[row], rtol=0, atol=1e-6)  # single precision over 1 m
            np.testing.assert_allclose(begin + along, end[row], rtol=0, atol=1e-6)


def test_along_a_motion_a_new_branch_is_named_at_its_row() -> None:
    one = build_solved(rows=9000)
    labels = np.array(one.solutions.labels)
    labels[:4001, 0], labels[4001:, 0] = "up", "down"
    arms = scene(replace(one, solutions=replace(one.solutions, labels=labels))).arms
    chosen = drawn_labels(arms, 0.0, 12)[0]
    assert len(chosen.texts) <= POSES + 3
    told = dict(zip(chosen.moving.rows.tolist(), chosen.texts, strict=True))
    assert told[4001] == "chosen: down"
    assert {told[row] for row in told if row < 4001} == {"chosen: up"}


@pytest.mark.parametrize("timed", [True, False])
def test_a_name_keeps_its_place_in_a_motion_and_leaps_between_single_poses(timed: bool) -> None:
    arms = scene(build_solved(timed=timed, names=tuple(map(str, range(8))))).arms
    found = []  # at how many of its places the name of each arm stands
    for arm, label in zip(arms, drawn_labels(arms, 0.0, 12), strict=True):
        every = name_places(*bones_of(arm.chain, arm.q[label.moving.rows]))
        away = np.linalg.norm(every - label.position[:, None], axis=2)
        found.append(len(set(np.argmin(away, axis=1).tolist())))
    assert found == [1] * 9 if timed else max(found) > 1
