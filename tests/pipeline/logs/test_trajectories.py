"""Trajectories without a header: TUM and KITTI, whatever their clock, and whatever robot is given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

Read = Callable[..., JointLog]
MakeArm = Callable[..., Chain]

JOINTS = [None, 6, 8]
"""Arms with these numbers of joints, or none."""


def poses(rows: int, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times of an irregular clock, positions and quaternions x, y, z, w of a motion."""
    rng = np.random.default_rng(seed)
    t, s = np.cumsum(rng.uniform(0.002, 0.02, rows)), np.linspace(0.0, 1.0, rows)
    position = np.column_stack((0.5 + 0.2 * s, 0.3 * np.sin(5.0 * s), 0.4 + 0.1 * np.cos(9.0 * s)))
    turned = Rotation.from_rotvec(np.column_stack((1.5 * np.sin(3.0 * s), 2.0 * s, np.cos(2.0 * s))))
    return t, position, np.asarray(turned.as_quat())


def text(*columns: FloatArray, delimiter: str = " ", head: str = "") -> str:
    rows = np.column_stack(columns).tolist()
    return head + "".join(delimiter.join(map(repr, row)) + "\n" for row in rows)


def transforms(position: FloatArray, quat: FloatArray) -> FloatArray:
    """Return the first three rows of homogeneous transforms, row by row, shape (n, 12)."""
    found = np.concatenate((Rotation.from_quat(quat).as_matrix(), position[:, :, np.newaxis]), axis=2)
    return np.asarray(found.reshape(-1, 12))


def assert_path(log: JointLog, position: FloatArray, quat: FloatArray) -> None:
    assert (log.joints, log.source) == ((), "path")
    assert log.tcp_position is not None and log.tcp_quat_xyzw is not None
    np.testing.assert_array_equal(log.tcp_position, position)
    same = np.abs((log.tcp_quat_xyzw * quat).sum(axis=1))
    np.testing.assert_allclose(same, 1.0, rtol=0.0, atol=1e-12)  # rounding of a matrix and back


@pytest.mark.slow
@pytest.mark.parametrize("joints", JOINTS)
@pytest.mark.parametrize("rows", [1, 2, 200])
@pytest.mark.parametrize("clock", ["even", "irregular", "unix", "rows", "rising x"])
def test_tum_is_a_path_with_an_orientation(
    clock: str, rows: int, joints: int | None, read: Read, arm: MakeArm
) -> None:
    t, position, quat = poses(rows)
    others = {"even": np.arange(rows) * 0.01, "unix": 1.7e9 + t, "rows": np.arange(1.0, rows + 1)}
    t = np.asarray(others.get(clock, t), dtype=np.float64)
    if clock == "rising x":
        position[:, 0] = 3.0 * t
    log = read(text(t, position, quat), arm(joints) if joints else None, name="a.txt")
    assert_path(log, position, quat)
    np.testing.assert_allclose(log.t, t - t[0], rtol=0.0, atol=5e-7)  # a double near 1.7e9 has 2.4e-7 s
    assumed = [one for one in log.warnings if one.kind == "assumed-form"]
    assert [one.assumption for one in assumed] == ["the quaternions are x, y, z, w"]


@pytest.mark.slow
@pytest.mark.parametrize("joints", JOINTS)
@pytest.mark.parametrize("delimiter", [" ", ",", "\t", ";"])
@pytest.mark.parametrize("head", ["", "# a trajectory\n", "# timestamp tx ty tz qx qy qz qw\n"])
def test_eight_numbers_with_a_quaternion_are_never_joints(
    head: str, delimiter: str, joints: int | None, read: Read, arm: MakeArm
) -> None:
    t, position, quat = poses(60)
    robot = arm(joints) if joints else None
    written = text(
        t,
        position,
        quat,
        delimiter=delimiter,
        head=head.replace(" ", delimiter).replace("#" + delimiter, "# "),
    )
    log = read(written, robot)
    assert log.joints == ()
    np.testing.assert_array_equal(log.tcp_position, position)
    if log.rotation_form is None:  # asked for, by whoever writes no TUM
        (asked,) = [one for one in log.warnings if one.kind == "orientation"]
        assert [hint.value for hint in asked.hints] == ["quat_xyzw", "quat_wxyz"]
        log = read(written, robot, rotation="quat_xyzw")
    assert_path(log, position, quat)


@pytest.mark.parametrize("joints", JOINTS)
def test_a_quaternion_that_jumps_between_its_two_names_is_one(
    joints: int | None, read: Read, arm: MakeArm
) -> None:
    t, position, quat = poses(60)
    jumping = np.where(np.arange(60)[:, np.newaxis] % 7 < 3, -quat, quat)
    log = read(text(t, position, jumping), arm(joints) if joints else None)
    assert_path(log, position, quat)
    assert log.tcp_rotation is not None and log.tcp_quat_xyzw is not None
    np.testing.assert_array_equal(log.tcp_rotation, jumping)
    assert (np.abs(np.diff(log.tcp_quat_xyzw, axis=0)) < 0.2).all()


def test_the_other_order_of_a_quaternion_is_told(read: Read) -> None:
    t, position, quat = poses(60)
    log = read(text(t, position, quat[:, [3, 0, 1, 2]]), rotation="quat_wxyz")
    assert_path(log, position, quat)
    assert not [one for one in log.warnings if one.kind == "assumed-form"]


@pytest.mark.slow
@pytest.mark.parametrize("joints", JOINTS)
@pytest.mark.parametrize("rows", [1, 2, 60])
@pytest.mark.parametrize("form", ["kitti", "with a clock", "whole", "whole with a clock"])
def test_twelve_numbers_that_are_a_transform_are_a_path(
    form: str, rows: int, joints: int | None, read: Read, arm: MakeArm
) -> None:
    t, position, quat = poses(rows)
    columns = [transforms(position, quat)]
    if form.startswith("whole"):
        columns.append(np.tile([0.0, 0.0, 0.0, 1.0], (rows, 1)))
    if form.endswith("clock"):
        columns.insert(0, t[:, np.newaxis])
    log = read(text(*columns), arm(joints) if joints else None)
    assert_path(log, position, quat)
    assert log.rotation_form == "matrix"
    if form.endswith("clock"):
        np.testing.assert_allclose(log.t, t - t[0], rtol=0.0, atol=1e-9)
    else:
        assert [one.kind for one in log.warnings if one.role == "time"] == ["assumed-period"]


@pytest.mark.parametrize("joints", [None, 6, 12])
def test_the_times_of_kitti_stand_in_a_file_of_their_own(
    joints: int | None, write: Callable[..., Path], arm: MakeArm
) -> None:
    t, position, quat = poses(60)
    files = [write(text(transforms(position, quat)), "00.txt"), write(text(t), "times.txt")]
    for ordered in (files, files[::-1]):
        log = read_log(ordered, LogMap(), arm(joints) if joints else None)
        assert_path(log, position, quat)
        np.testing.assert_allclose(log.t, t - t[0], rtol=0.0, atol=1e-9)
        assert not [one for one in log.warnings if one.role == "time"]


def test_joints_that_the_user_names_come_first(read: Read) -> None:
    t, position, quat = poses(60)
    log = read(text(t, position, quat), joints=("5", "6", "7", "8"), time="1")
    np.testing.assert_array_equal(log.q, quat)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.integers(2, 60), st.integers(0, 2**31), st.sampled_from([7, 8, 12, 13, 16]))
def test_random_joints_are_no_trajectory(
    tmp_path_factory: pytest.TempPathFactory, rows: int, seed: int, count: int
) -> None:
    rng = np.random.default_rng(seed)
    q = np.cumsum(rng.uniform(-0.02, 0.02, (rows, count)), axis=0) + rng.uniform(1.0, 2.0, count)
    path = tmp_path_factory.mktemp("a") / "a.txt"
    path.write_text(text(np.arange(rows, dtype=np.float64) * 0.01, q))
    log = read_log([path], LogMap(time="1", joints=tuple(str(k) for k in range(2, count + 2))))
    np.testing.assert_array_equal(log.q, q)
