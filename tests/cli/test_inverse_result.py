"""`urmpipe.ik` in Python: arrays in, a result with a table, JSON and a notebook's display out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import urmpipe
from ik_runs import wave
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import forward_targets, pose_errors
from urmpipe_models.kinematics.singularity import singularity_over_log
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.text import to_json_value

Q = np.array([[0.3, 0.8, -0.6, 0.5, 0.7, 0.2], [-1.0, 0.5, -0.2, 1.0, -0.8, 2.0]])
ARM = urmpipe.load_robot("arm6")
TARGETS = forward_targets(ARM, Q)


def matrices(targets: urmpipe.Targets) -> FloatArray:
    """Return poses as matrices, shape (n, 4, 4)."""
    poses = np.tile(np.eye(4), (len(targets), 1, 1))
    poses[:, :3, 3] = targets.position
    assert targets.rotation is not None
    poses[:, :3, :3] = targets.rotation
    return poses


def test_a_file_matrices_and_targets_are_one_and_the_same(tmp_path: Path) -> None:
    rotation = TARGETS.rotation
    assert rotation is not None
    table = np.column_stack([TARGETS.position, to_quaternions(rotation.reshape(-1, 9), "matrix")])
    file = tmp_path / "targets.csv"
    np.savetxt(file, table, delimiter=",", header="x,y,z,qx,qy,qz,qw", comments="", fmt="%.17g")
    of_file, of_arrays = urmpipe.ik(file, "arm6"), urmpipe.ik(matrices(TARGETS), ARM)
    of_targets = urmpipe.ik(TARGETS, "arm6")
    assert np.array_equal(of_arrays.solutions.q, of_targets.solutions.q, equal_nan=True)
    assert np.nanmax(np.abs(of_file.solutions.q - of_targets.solutions.q)) < 1e-9  # 1 digit of the quaternion
    assert (of_file.name, of_targets.name) == ("targets", "targets")
    one = urmpipe.ik(matrices(TARGETS)[1], "arm6")
    assert np.array_equal(one.solutions.q[0], of_targets.solutions.q[1], equal_nan=True)


def test_a_transposed_pose_is_none_and_stops_no_other() -> None:
    poses = matrices(TARGETS)
    poses[1] = poses[1].T
    x, y, z = TARGETS.position[1]
    found = urmpipe.ik(poses, "arm6")
    assert found.reasons == [
        None,
        f"the last row of the matrix is {x:g}, {y:g}, {z:g}, 1, allowed: 0, 0, 0, 1",
    ]
    alone = urmpipe.ik(poses[:1], "arm6")
    assert np.array_equal(found.solutions.q[:1], alone.solutions.q, equal_nan=True)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_the_solution_nearest_to_the_start_is_the_start_itself(seed: int) -> None:
    q = np.random.default_rng(seed).uniform(-3.0, 3.0, 6)
    found = urmpipe.ik(forward_targets(ARM, q[None]), ARM, start=q.tolist())
    distances = np.linalg.norm(found.solutions.q[0] - q, axis=1)
    assert found.chosen[0] == int(np.nanargmin(distances))
    assert np.nanmin(distances) < 1e-5  # near a singular pose rounding of 1e-16 leaves its root
    assert found.position_error[0, found.chosen[0]] < 1e-10


def test_the_table_has_every_solution_and_why_there_is_none() -> None:
    poses = matrices(TARGETS)
    poses = np.concatenate([poses, poses[:1]])
    poses[2, :3, 3] = 2.0, 0.0, 0.1
    found = urmpipe.ik(poses, "arm6")
    assert found.verdict == "fail"
    assert found.reached.tolist() == [True, True, False]
    frame = found.to_frame()
    columns = ["row", "branch", *ARM.coordinates, "position_error", "angle", "nearest", "reason"]
    assert list(frame.columns) == columns
    for row, count in enumerate(found.solutions.reached[:2].sum(axis=1).tolist(), start=1):
        part = frame[frame["row"] == row]
        assert len(part) == count > 1
        assert part["nearest"].sum() == 1
        assert part["branch"].nunique() == count
        q = part[list(ARM.coordinates)].to_numpy()
        position, turn = pose_errors(ARM, q, TARGETS.rows(np.full(count, row - 1)))
        assert np.abs(position).max() < 1e-10
        assert np.abs(turn).max() < 1e-10
    (last,) = frame[frame["row"] == 3].to_dict("records")
    assert last["reason"] == found.reasons[2]
    assert np.isnan(last["theta1"])
    assert last["branch"] == ""
    assert not last["nearest"]
    assert np.isnan(found.q[2]).all()
    assert found.branch[2] == ""


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "every"), [("urm6", False), ("urm6", True), ("arm6", True)])
def test_progress_is_told_and_changes_nothing(robot: str, every: bool) -> None:
    arm = urmpipe.load_robot(robot)
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (600, 6))
    q[550] = 0.0  # a wrist of arm6 that is aligned, in the second block
    targets = forward_targets(arm, q)
    targets.position[7] = np.nan
    told: list[float] = []
    options = {"every": every, "restarts": 2}
    whole = urmpipe.ik(targets, arm, **options)  # type: ignore[arg-type]
    blocks = urmpipe.ik(targets, arm, **options, progress=told.append)  # type: ignore[arg-type]
    assert told == [512 / 600, 1.0]
    assert np.array_equal(whole.solutions.q, blocks.solutions.q, equal_nan=True)
    assert whole.to_dict() == blocks.to_dict()
    assert [one.family for one in blocks.solutions.singular] == [
        one.family for one in whole.solutions.singular
    ]


def test_a_notebook_shows_the_table() -> None:
    found = urmpipe.ik(TARGETS, "arm6")
    shown = found._repr_html_()
    assert shown.startswith("<p><b>IkResult</b> PASS targets: arm6 reaches 2 targets (")
    assert "theta1" in shown
    assert all(branch in shown for branch in found.branch)


def test_positions_take_any_orientation() -> None:
    found = urmpipe.ik(TARGETS.position, "arm6")
    assert (found.method, found.angle) == ("iterative", None)
    assert found.position_error.max() < 1e-9
    assert "angle" not in found.to_frame()
    assert found.to_dict()["targets"][0]["solutions"][0]["angle"] is None


def test_arrays_with_times_are_a_path() -> None:
    q = wave(Q[0], 0.2, 30)
    poses = forward_targets(ARM, q)
    with_times = urmpipe.ik(poses, ARM, t=0.01 * np.arange(30) + 5.0, start=q[0].tolist())
    by_period = urmpipe.ik(poses, ARM, tsp=0.01, start=q[0].tolist())
    assert np.abs(with_times.q - q).max() < 1e-9
    assert np.array_equal(with_times.q, by_period.q)
    assert with_times.path is not None
    assert with_times.to_dict()["targets"][0]["t"] == 5.0
    assert with_times.to_frame()["t"].tolist() == pytest.approx((5.0 + 0.01 * np.arange(30)).tolist())
    assert json.loads(json.dumps(to_json_value(by_period.to_dict())))["verdict"] == "pass"


def test_a_path_tells_where_it_comes_nearest_to_a_singular_pose() -> None:
    q = np.tile(Q[0], (30, 1))
    q[:, 4] = 0.3 + np.abs(np.arange(30) - 11) / 30  # sigma falls with sin theta5
    found = urmpipe.ik(forward_targets(ARM, q), ARM, tsp=0.01, start=q[0].tolist()).to_dict()["singularity"]
    log = singularity_over_log(ARM, q)
    assert (found["row"], found["t"]) == (12, 0.11)
    assert found["smallest"] == pytest.approx(log.smallest[11], rel=1e-9)
    assert found["manipulability"] == pytest.approx(log.manipulability[11], rel=1e-9)
    assert urmpipe.ik(np.full((2, 3), 9.0), ARM, tsp=0.01, restarts=0).to_dict()["singularity"] is None


def test_a_path_beyond_the_reach_stays_on_its_branch_at_the_nearest_points() -> None:
    arm = urmpipe.load_robot("ur5e")
    poses = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (60, 1, 1))
    poses[:, 0, 3] = 0.55 + 0.4 * np.sin(np.linspace(0.5, 2.6, 60))  # out beyond the reach, and back
    poses[:, 2, 3] = 0.2
    beyond = urmpipe.ik(poses, arm, tsp=0.1).solutions.reached[:, 0]
    assert 5 < (~beyond).sum() < 50
    found = urmpipe.ik(poses, arm, tsp=0.1, tolerance=0.1)
    assert found.reached.all()
    assert found.path is not None
    assert not found.path.jumps
    assert np.abs(np.diff(found.q, axis=0)).max() < 0.5


def test_joints_without_limits_can_be_written_within_pi() -> None:
    free = replace(ARM, joints=tuple(replace(one, lower=-np.inf, upper=np.inf) for one in ARM.joints))
    q = Q[0] + np.outer(np.linspace(0.0, 7.0, 200), [1.0, 0, 0, 0, 0, 0])
    poses = forward_targets(free, q)
    turned = urmpipe.ik(poses, free, tsp=0.01, start=q[0].tolist())
    within = urmpipe.ik(poses, free, tsp=0.01, start=q[0].tolist(), within_pi=True)
    assert turned.q[-1, 0] - turned.q[0, 0] == pytest.approx(7.0, abs=1e-9)
    assert np.abs(within.q).max() <= np.pi
    assert np.abs(np.exp(1j * within.q) - np.exp(1j * turned.q)).max() < 1e-12
    far = urmpipe.ik(TARGETS, free, start=(Q[0] + 4 * np.pi).tolist())
    assert np.abs(far.q[0] - Q[0] - 4 * np.pi).max() < 1e-9
    near = urmpipe.ik(TARGETS, free, start=(Q[0] + 4 * np.pi).tolist(), within_pi=True)
    assert np.abs(near.q[0] - Q[0]).max() < 1e-9
