"""The kinematics of an arm as a unit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sliding_arm import sliding_arm
from stepped_unit import SteppedUnit
from urmpipe_fmus.blocks.kinematic_chain import kinematic_chain
from urmpipe_fmus.run import run
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import point_over_log, points_over_log, positions_over_log
from urmpipe_models.math3d import Transform, from_offset, from_rpy
from urmpipe_models.robots.catalogue import load_robot, robot_names

ROUNDING = 1e-13
"""Some hundred operations on values of up to 20, in another order: each errs by 1e-16 of them."""


ROBOTS = {name: load_robot(name) for name in robot_names()} | {
    "slider": sliding_arm(),
    "counter-rotating": urm_chain(
        "c", [0.3, 0.2, 0.1, 0.05], [0.4, 0.0, -0.5], directions=[1, -1, -1], start=[0.1, 0.2, 0.3]
    ).placed(from_offset((1.0, 2.0, 3.0, 0.1, 0.2, 0.3)), from_offset((0.0, 0.1, 0.2, 0.0, 0.0, 1.0))),
}


def joint_inputs(robot: Chain, *motion: FloatArray) -> dict[str, FloatArray]:
    """Return the inputs of revolute and prismatic joints: of q, and of velocities and accelerations."""
    prismatic = np.array([joint.kind == "prismatic" for joint in robot.moving])
    inputs: dict[str, FloatArray] = {}
    for suffix, values in zip(("", "d", "dd"), motion, strict=False):
        inputs |= {f"phi{suffix}": values[:, ~prismatic], f"s{suffix}": values[:, prismatic]}
    return {name: column for name, column in inputs.items() if column.size}


@pytest.mark.parametrize("name", ROBOTS)
def test_points_and_sensors_are_those_of_the_kinematics_over_a_log(name: str) -> None:
    robot, rng = ROBOTS[name], np.random.default_rng(3)
    q, qd, qdd = rng.uniform(-3.0, 3.0, (3, 40, len(robot.coordinates)))
    model = kinematic_chain(robot, sensors=robot.point_names, rates=True)
    found = run(model, np.linspace(0.0, 1.0, 40, dtype=np.float64), joint_inputs(robot, q, qd, qdd))
    skeleton = points_over_log(robot, q)
    for k, point in enumerate(robot.point_names):
        number, motion = point[1:], point_over_log(robot, q, qd, qdd, k)
        np.testing.assert_allclose(found[point], skeleton[:, k + 1], rtol=0.0, atol=ROUNDING)
        np.testing.assert_allclose(found[f"v{number}"], motion.velocity, rtol=0.0, atol=10 * ROUNDING)
        # accelerations are products of two speeds of up to 20
        np.testing.assert_allclose(found[f"a{number}"], motion.acceleration, rtol=0.0, atol=400 * ROUNDING)
        angles = np.column_stack([found[f"{angle}{number}"] for angle in ("rz", "ry", "rx")])
        difference = np.mod(angles - motion.euler_zyx + np.pi, 2.0 * np.pi) - np.pi  # a turn is none
        np.testing.assert_allclose(difference, 0.0, atol=1e-10)  # up to 1 / cos(ry) of rounding
        assert np.array_equal(found[f"singular{number}"] == 1.0, motion.singular)


def test_lengths_and_tilts_are_tuned_while_it_runs() -> None:
    unit, rng = SteppedUnit("kinematic_chain", robot=load_robot("urm4")), np.random.default_rng(5)
    unit.do_step(0.0, 0.005)
    q, lengths, tilts = rng.uniform(-3.0, 3.0, 4), rng.uniform(0.1, 0.3, 5), rng.uniform(0.0, 1.5, 4)
    unit.put(phi=q, lengths=lengths, tilts=tilts)
    arm = urm_chain("other", lengths.tolist(), tilts.tolist())
    place = positions_over_log(arm, q[np.newaxis])[0]
    np.testing.assert_allclose(unit.read("p5"), place, rtol=0.0, atol=ROUNDING)


def test_the_frames_of_any_arm_are_tuned() -> None:
    robot, rng = sliding_arm(), np.random.default_rng(0)
    start: dict[str, Any] = {}
    frames: dict[str, Any] = {}
    for name in ("origin2", "origin5", "tip", "base", "tool"):
        (x, y, z, rx, ry, rz) = frame = rng.uniform(-1.0, 1.0, 6)
        start |= {name: frame[:3], f"{name}_rpy": frame[3:]}
        frames[name] = Transform(from_rpy(rx, ry, rz).rotation, (x, y, z))
    joints = list(robot.joints)
    for place, name in ((1, "origin2"), (4, "origin5")):
        joints[place] = replace(joints[place], origin=frames.pop(name))
    other = replace(robot, joints=tuple(joints), **frames)
    unit = SteppedUnit("kinematic_chain", start, robot=robot)
    place = positions_over_log(other, np.array([robot.start]))[0]
    np.testing.assert_allclose(unit.read("p5"), place, rtol=0.0, atol=ROUNDING)


def test_an_arm_of_a_urdf_is_taken(shared: Path) -> None:
    robot = load_robot(min((shared / "robots").rglob("*.urdf")))
    q = np.random.default_rng(6).uniform(-1.0, 1.0, (5, len(robot.coordinates)))
    found = run(kinematic_chain(robot), np.linspace(0.0, 1.0, 5, dtype=np.float64), joint_inputs(robot, q))
    last = found[robot.point_names[-1]]
    np.testing.assert_allclose(last, positions_over_log(robot, q), rtol=0.0, atol=ROUNDING)
