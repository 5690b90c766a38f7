"""`urmpipe.ik` in Python: files and arrays, the table, progress, and what holds for any target."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import urmpipe
from urmpipe_models.ik.solutions import forward_targets, pose_errors
from urmpipe_models.kinematics.singularity import singularity_over_log
from urmpipe_models.math3d import to_quaternions

Q = np.array([[0.3, 0.8, -0.6, 0.5, 0.7, 0.2], [-1.0, 0.5, -0.2, 1.0, -0.8, 2.0]])
ARM = urmpipe.load_robot("arm6")
TARGETS = forward_targets(ARM, Q)


def test_a_file_matrices_and_targets_have_the_same_solutions(tmp_path: Path) -> None:
    rotation = TARGETS.rotation
    assert rotation is not None
    table = np.column_stack([TARGETS.position, to_quaternions(rotation.reshape(-1, 9), "matrix")])
    file = tmp_path / "targets.csv"
    np.savetxt(file, table, delimiter=",", header="x,y,z,qx,qy,qz,qw", comments="", fmt="%.17g")
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotation, TARGETS.position
    of_targets = urmpipe.ik(TARGETS, "arm6")
    for given_poses, targets in ((poses, slice(None)), (poses[1], slice(1, None))):
        found = urmpipe.ik(given_poses, ARM).solutions.q
        assert np.array_equal(found, of_targets.solutions.q[targets], equal_nan=True)
    of_file = urmpipe.ik(file, "arm6")
    assert np.nanmax(np.abs(of_file.solutions.q - of_targets.solutions.q)) < 1e-9  # 1 digit of the quaternion
    assert (of_file.name, of_targets.name) == ("targets", "targets")


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
    targets = TARGETS.rows(np.array([0, 1, 0]))
    targets.position[2] = 2.0, 0.0, 0.1
    found = urmpipe.ik(targets, "arm6")
    frame = found.to_frame()
    columns = ["row", "branch", *ARM.coordinates, "position_error", "angle", "nearest", "reason"]
    assert list(frame.columns) == columns
    for row, count in enumerate(found.solutions.reached[:2].sum(axis=1).tolist(), start=1):
        part = frame[frame["row"] == row]
        assert len(part) == part["branch"].nunique() == count > 1
        assert part["nearest"].sum() == 1
        q = part[list(ARM.coordinates)].to_numpy()
        for miss in pose_errors(ARM, q, targets.rows(np.full(count, row - 1))):
            assert np.abs(miss).max() < 1e-10
    (last,) = frame[frame["row"] == 3].to_dict("records")
    assert (last["reason"], last["branch"], last["nearest"]) == (found.reasons[2], "", False)
    assert np.isnan([last["theta1"], *found.q[2]]).all()
    assert found.branch[2] == ""


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "every"), [("urm6", False), ("urm6", True), ("arm6", True)])
def test_progress_is_reported_and_changes_nothing(robot: str, every: bool) -> None:
    arm = urmpipe.load_robot(robot)
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (600, 6))
    q[550] = 0.0  # a wrist of arm6 that is aligned, in the second block
    targets = forward_targets(arm, q)
    targets.position[7] = np.nan
    shares: list[float] = []
    whole = urmpipe.ik(targets, arm, every=every, restarts=2)
    blocks = urmpipe.ik(targets, arm, every=every, restarts=2, progress=shares.append)
    assert shares == [512 / 600, 1.0]
    assert np.array_equal(whole.solutions.q, blocks.solutions.q, equal_nan=True)
    assert whole.to_dict() == blocks.to_dict()


def test_a_path_tells_where_it_comes_nearest_to_a_singular_pose() -> None:
    q = np.tile(Q[0], (30, 1))
    q[:, 4] = 0.3 + np.abs(np.arange(30) - 11) / 30  # sigma falls with sin theta5
    found = urmpipe.ik(forward_targets(ARM, q), ARM, tsp=0.01, start=q[0].tolist()).to_dict()["singularity"]
    log = singularity_over_log(ARM, q)
    assert (found["row"], found["t"]) == (12, 0.11)
    assert found["smallest"] == pytest.approx(log.smallest[11], rel=1e-9)
    assert found["manipulability"] == pytest.approx(log.manipulability[11], rel=1e-9)
    assert urmpipe.ik(np.full((2, 3), 9.0), ARM, tsp=0.01, restarts=0).to_dict()["singularity"] is None


def test_joints_without_limits_can_be_written_within_pi() -> None:
    free = replace(ARM, joints=tuple(replace(one, lower=-np.inf, upper=np.inf) for one in ARM.joints))
    q = Q[0] + np.outer(np.linspace(0.0, 7.0, 200), [1.0, 0, 0, 0, 0, 0])
    poses = forward_targets(free, q)
    turned = urmpipe.ik(poses, free, tsp=0.01, start=q[0].tolist())
    within = urmpipe.ik(poses, free, tsp=0.01, start=q[0].tolist(), within_pi=True)
    assert turned.q[-1, 0] - turned.q[0, 0] == pytest.approx(7.0, abs=1e-9)
    assert np.abs(within.q).max() <= np.pi
    assert np.abs(np.exp(1j * within.q) - np.exp(1j * turned.q)).max() < 1e-12
    for is_within, turns in ((False, 2), (True, 0)):
        far = urmpipe.ik(TARGETS, free, start=(Q[0] + 4 * np.pi).tolist(), within_pi=is_within)
        assert np.abs(far.q[0] - Q[0] - 2 * turns * np.pi).max() < 1e-9
