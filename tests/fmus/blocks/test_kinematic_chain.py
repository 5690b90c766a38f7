"""The kinematics of an arm as a unit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sliding_arm import sliding_arm
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.blocks.kinematic_chain import kinematic_chain
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.run import run
from urmpipe_models.arm.chain import Chain, Sphere, Visual
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


def inputs_of(robot: Chain, names: tuple[str, str], q: FloatArray) -> dict[str, FloatArray]:
    """The inputs of the joints that turn and of those that slide."""
    slides = np.array([joint.kind == "prismatic" for joint in robot.moving])
    columns = {names[0]: q[:, ~slides], names[1]: q[:, slides]}
    return {name: column for name, column in columns.items() if column.size}


@pytest.mark.parametrize("name", ROBOTS)
def test_points_and_sensors_are_those_of_the_kinematics_over_a_log(name: str) -> None:
    robot, rng = ROBOTS[name], np.random.default_rng(3)
    q, qd, qdd = rng.uniform(-3.0, 3.0, (3, 40, len(robot.coordinates)))
    model = kinematic_chain(robot, sensors=robot.point_names, rates=True)
    t = np.linspace(0.0, 1.0, 40, dtype=np.float64)
    given = inputs_of(robot, ("phi", "s"), q) | inputs_of(robot, ("phid", "sd"), qd)
    found = run(model, t, given | inputs_of(robot, ("phidd", "sdd"), qdd))
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


def test_the_points_of_a_urm_arm_are_those_of_a_log_to_the_last_bit() -> None:
    robot, q = load_robot("urm6"), np.random.default_rng(4).uniform(-9.0, 9.0, (200, 6))
    found = run(kinematic_chain(robot), np.linspace(0.0, 1.0, 200, dtype=np.float64), {"phi": q})
    assert np.array_equal(found["p7"], points_over_log(robot, q)[:, -1])


def first(model: BlockModel, name: str) -> list[float]:
    """What a variable starts with."""
    instance = Instance(model)
    owner = next(one for one in model.variables if one.name == name)
    return [float(one) for one in instance.get([instance.reference(scalar) for scalar in owner.names])]


def test_it_starts_at_the_calibration_pose_that_the_paper_prints() -> None:
    model = make_block("kinematic_chain", robot=load_robot("urm6"))
    assert first(model, "phi") == [0.0, np.pi, 0.0, np.pi, 0.0, np.pi]
    assert np.round(first(model, "p7"), 9).tolist() == [0.167397124, 0.0, 1.102644902]
    assert first(model, "lengths") == [0.243215, *[0.21243] * 5, 0.042215]
    assert np.degrees(first(model, "tilts")).round(12).tolist() == [52.0] * 6


def test_lengths_and_tilts_are_tuned_while_it_runs() -> None:
    model, rng = kinematic_chain(load_robot("urm4")), np.random.default_rng(5)
    instance = Instance(model)
    instance.do_step(0.0, 0.005)
    q, lengths, tilts = rng.uniform(-3.0, 3.0, 4), rng.uniform(0.1, 0.3, 5), rng.uniform(0.0, 1.5, 4)
    for name, values in (("phi", q), ("lengths", lengths), ("tilts", tilts)):
        places = [instance.reference(f"{name}[{k}]") for k in range(1, len(values) + 1)]
        instance.set(places, values.tolist())
    p5 = instance.get([instance.reference(f"p5[{k}]") for k in (1, 2, 3)])
    arm = urm_chain("other", lengths.tolist(), tilts.tolist())
    np.testing.assert_allclose(p5, positions_over_log(arm, q[np.newaxis])[0], rtol=0.0, atol=ROUNDING)


def test_the_frames_of_any_arm_are_tuned() -> None:
    robot = sliding_arm()
    frames = {name: np.random.default_rng(k).uniform(-1.0, 1.0, 6) for k, name in enumerate(
        ["origin2", "origin5", "tip", "base", "tool"]
    )}  # fmt: skip
    start = {name: frame[:3] for name, frame in frames.items()}
    start |= {f"{name}_rpy": frame[3:] for name, frame in frames.items()}
    made = {}
    for name, (x, y, z, rx, ry, rz) in frames.items():
        made[name] = Transform(from_rpy(rx, ry, rz).rotation, (x, y, z))
    joints = list(robot.joints)
    for place, name in ((1, "origin2"), (4, "origin5")):
        joints[place] = replace(joints[place], origin=made[name])
    other = replace(robot, joints=tuple(joints), tip=made["tip"], base=made["base"], tool=made["tool"])
    found = run(kinematic_chain(robot), np.array([0.0]), {}, start)
    q = np.array([robot.start])
    np.testing.assert_allclose(found["p5"], positions_over_log(other, q), rtol=0.0, atol=ROUNDING)


def test_joints_that_turn_and_joints_that_slide_are_inputs_in_their_own_units() -> None:
    model = kinematic_chain(sliding_arm(), rates=True)
    assert [(one.name, one.unit, one.size, one.starts) for one in model.inputs] == [
        ("phi", "rad", 2, (0.3, -0.4)),
        ("phid", "rad/s", 2, (0.0, 0.0)),
        ("phidd", "rad/s2", 2, (0.0, 0.0)),
        ("s", "m", 1, (0.2,)),
        ("sd", "m/s", 1, (0.0,)),
        ("sdd", "m/s2", 1, (0.0,)),
    ]
    assert model.inputs[0].description == "Angles of the joints turn, wrist"
    assert model.inputs[3].description == "Ways of the joints slide"


def test_outputs_are_the_points_and_sensors_that_were_asked_for_in_the_order_of_the_arm() -> None:
    model = kinematic_chain(load_robot("urm6"), points=["p7", "p2"], sensors=["p6", "p1"])
    assert [one.name for one in model.computed] == [
        *("p2", "p7"),
        *("rz1", "ry1", "rx1", "singular1"),
        *("rz6", "ry6", "rx6", "singular6"),
    ]
    with_rates = kinematic_chain(load_robot("urm6"), points=[], rates=True)
    assert [one.name for one in with_rates.computed] == ["rz7", "ry7", "rx7", "singular7", "v7", "a7"]


def test_an_angle_beyond_a_joints_range_has_its_place() -> None:
    robot = load_robot("ur5e")
    assert all(joint.upper < 10.0 for joint in robot.moving)
    q = np.full((1, 6), 20.0 * np.pi)
    found = run(kinematic_chain(robot), np.array([0.0]), {"phi": q})
    np.testing.assert_allclose(
        found["p6"], positions_over_log(robot, np.zeros((1, 6))), rtol=0.0, atol=1e-13
    )  # 20 pi is no multiple of 2 pi in doubles: 1e-14 rad off


def test_at_ry_of_a_right_angle_the_convention_is_told() -> None:
    robot = urm_chain("wrist", [0.3, 0.1], [np.pi / 2])
    found = run(kinematic_chain(robot), np.array([0.0, 1.0]), {"phi": np.array([[0.5], [0.2]])})
    assert found["singular2"].tolist() == [1.0, 1.0]
    assert found["rx2"].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(found["rz2"], [0.5, 0.2], rtol=0.0, atol=1e-15)


def test_the_looks_of_an_arm_and_their_files_are_not_in_the_recipe() -> None:
    robot = replace(load_robot("urm4"), visuals=(Visual(None, shape=Sphere(0.1)),))
    model = kinematic_chain(robot)
    assert "visuals" not in model.recipe.arguments["robot"]
    assert model.recipe == kinematic_chain(replace(robot, visuals=())).recipe


def test_an_arm_of_a_urdf_is_taken() -> None:
    shared = Path(__file__).resolve().parents[3].parent / "shared" / "robots"
    files = sorted(shared.rglob("*.urdf"))
    if not files:
        pytest.skip("the folder shared with robots of others is not beside this repository")
    robot = load_robot(files[0])
    q = np.random.default_rng(6).uniform(-1.0, 1.0, (5, len(robot.coordinates)))
    found = run(
        kinematic_chain(robot), np.linspace(0.0, 1.0, 5, dtype=np.float64), inputs_of(robot, ("phi", "s"), q)
    )
    np.testing.assert_allclose(
        found[robot.point_names[-1]], positions_over_log(robot, q), rtol=0.0, atol=ROUNDING
    )


def test_lengths_and_tilts_are_parameters_of_what_was_described_by_them() -> None:
    lengths, tilts = (0.3, 0.2, 0.1, 0.05), (0.4, 0.0, -0.5)
    arm = urm_chain("c", lengths, tilts, directions=[1, -1, -1]).placed(from_offset((1.0, 2.0, 3.0)))
    told = {one.name: one.start for one in kinematic_chain(arm).parameters}
    assert (told["lengths"], told["tilts"], told["base"]) == (lengths, tilts, (1.0, 2.0, 3.0))
    bent = replace(arm, tip=from_offset((0.001, 0.0, 0.05)))
    for other in (bent, load_robot("ur5e")):
        names = {one.name for one in kinematic_chain(other).parameters}
        assert "tip_rpy" in names
        assert "lengths" not in names
