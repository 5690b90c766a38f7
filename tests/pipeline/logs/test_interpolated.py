"""Rows of an orientation that was interpolated across its jump are found, said and not used."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import (
    RotationForm,
    rotation_angle,
    to_quaternions,
    to_rotation_vectors,
)
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs.rotation import find_interpolated_rows

Read = Callable[..., JointLog]

PERIOD = 0.02
COLUMNS = {"vector": "rx ry rz", "rpy": "roll pitch yaw", "quat_xyzw": "qx qy qz qw"}


def joints(t: FloatArray) -> FloatArray:
    """Return joint values in [rad] at times in [s] of a UR5e whose tool comes by a half turn."""
    q = np.array([0.0, -1.2, 1.2, -1.5, -1.57, 0.3]) + 0.5 * np.sin(t[:, None] + np.arange(6))
    q[:, 5] += 1.5 * np.sin(0.7 * t)
    return q


def oriented(quat: FloatArray, form: str) -> FloatArray:
    """Return orientations, shape (n, 4) [-], as a controller spells them: its jumps are where it has them."""
    if form == "vector":
        return to_rotation_vectors(quat)
    if form == "quat_xyzw":
        return np.asarray(quat * np.where(quat[:, 3:] < 0.0, -1.0, 1.0))
    x, y, z, w = quat.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(2 * (w * y - z * x))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.column_stack((roll, pitch, yaw))


def true(robot: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    position, rotation = poses_over_log(robot, q)
    return position, to_quaternions(rotation.reshape(-1, 9), "matrix")


def resampled(t: FloatArray, values: FloatArray, ratio: float) -> tuple[FloatArray, FloatArray]:
    """Return times and values on a grid that is finer by a ratio, interpolated as they are."""
    grid = np.arange(0.0, t[-1], PERIOD / ratio)
    return grid, np.column_stack([np.interp(grid, t, column) for column in values.T])


def text(form: str, ratio: float) -> tuple[str, FloatArray]:
    """Return the CSV of a log resampled by a ratio, and its joints in [rad]."""
    robot, t = load_robot("ur5e"), PERIOD * np.arange(600.0)
    position, quat = true(robot, joints(t))
    grid, table = resampled(t, np.hstack((joints(t), position, oriented(quat, form))), ratio)
    unit = "" if form.startswith("quat") else " [rad]"
    names = ["t [s]", *(f"q{k} [rad]" for k in range(1, 7)), "x [m]", "y [m]", "z [m]"]
    names += [name + unit for name in COLUMNS[form].split()]
    rows = [",".join(map(repr, row)) for row in np.column_stack((grid, table)).tolist()]
    return "\n".join([",".join(names), *rows, ""]), table[:, :6]


def kinds(log: JointLog) -> list[str]:
    return [warning.kind for warning in log.warnings]


@pytest.mark.slow
@pytest.mark.parametrize("form", COLUMNS)
@pytest.mark.parametrize("ratio", [1.25, 2.0, 8.0])
def test_rows_between_the_ends_of_a_jump_are_not_used(form: RotationForm, ratio: float, read: Read) -> None:
    robot = load_robot("ur5e")
    content, q = text(form, ratio)
    log = read(content, robot, rotation=form)
    assert log.tcp_rotation is not None
    apart = rotation_angle(to_quaternions(log.tcp_rotation, form), true(robot, q)[1])
    missing = np.isnan(apart)
    (said,) = [warning for warning in log.warnings if warning.kind == "interpolated-orientation"]
    assert said.row == int(np.argmax(missing)) + 1
    assert f"in {missing.sum()} rows of {len(q)}, first in this one" in said.message
    # what is left is off by what a chord of 20 ms is off a motion of 1 rad/s
    assert np.nanmax(apart) < 1e-3
    log = read(content, rotation=form)
    assert log.tcp_rotation is not None
    np.testing.assert_array_equal(np.isnan(log.tcp_rotation).any(axis=1), missing)


@pytest.mark.parametrize("form", COLUMNS)
def test_jumps_without_a_row_between_are_none(form: RotationForm, read: Read) -> None:
    log = read(text(form, 1.0)[0], load_robot("ur5e"), rotation=form)
    assert log.tcp_rotation is not None
    assert np.abs(np.diff(log.tcp_rotation, axis=0)).max() > 0.8  # it jumps
    assert not np.isnan(log.tcp_rotation).any()
    assert "interpolated-orientation" not in kinds(log)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["vector", "rpy"])
def test_many_rows_between_the_ends_of_a_jump_are_not_used(form: RotationForm, read: Read) -> None:
    robot = load_robot("ur5e")
    content, q = text(form, 20.0)
    log = read(content, robot, rotation=form)
    assert log.tcp_rotation is not None
    assert "interpolated-orientation" in kinds(log)
    apart = rotation_angle(to_quaternions(log.tcp_rotation, form), true(robot, q)[1])
    assert np.nanmax(apart) <= 0.35  # a row of 20 is 18 deg off, 0.31 rad; the chord adds less than 0.04
    assert np.isnan(apart).mean() < 0.02


@pytest.mark.parametrize("form", ["vector", "rpy"])
def test_a_tool_recorded_late_is_no_interpolation(form: RotationForm, read: Read) -> None:
    """Two rows late, the orientation is off by as much as it turns meanwhile."""
    robot, t = load_robot("ur5e"), PERIOD * np.arange(300.0)
    q = joints(4.0 * np.maximum(t - 3.0, 0.0))  # at rest, then at 4 rad/s and more
    position, quat = true(robot, np.vstack((q[:1], q[:1], q[:-2])))
    names = ["t [s]", *(f"q{k} [rad]" for k in range(1, 7)), "x [m]", "y [m]", "z [m]"]
    names += [f"{name} [rad]" for name in COLUMNS[form].split()]
    table = np.column_stack((t, q, position, oriented(quat, form)))
    content = "\n".join([",".join(names), *(",".join(map(repr, row)) for row in table.tolist()), ""])
    assert "interpolated-orientation" not in kinds(read(content, robot, rotation=form))


turns = st.tuples(st.floats(0.2, 0.8), st.floats(-0.5, 0.5), st.integers(0, 100))


@given(turns, st.sampled_from([1.0, np.degrees(1.0)]), st.integers(2, 8), st.floats(0.0, 1e-4))
def test_each_row_between_is_found_in_any_unit(
    turn: tuple[float, float, int], factor: float, ratio: int, noise: float
) -> None:
    """An angle that goes by +-180 deg, beside others: the rows off by more than the noise are found."""
    t, (rate, other, seed) = PERIOD * np.arange(400.0), turn
    first = np.pi - rate * 4.0 + rate * t + 0.01  # passes pi in the middle
    angles = np.column_stack((first, other + 0.3 * np.sin(t), 0.2 * np.cos(t)))
    angles += np.random.default_rng(seed).normal(0.0, noise, angles.shape)
    spelled = angles.copy()
    spelled[:, 0] = np.mod(angles[:, 0] + np.pi, 2 * np.pi) - np.pi
    grid, values = resampled(t, spelled * factor, ratio)
    _, smooth = resampled(t, angles, ratio)
    off = rotation_angle(to_quaternions(values / factor, "rpy"), to_quaternions(smooth, "rpy"))
    np.testing.assert_array_equal(find_interpolated_rows(values), off > 0.1)
    assert not find_interpolated_rows(spelled * factor).any()
    assert len(grid) == len(values)
