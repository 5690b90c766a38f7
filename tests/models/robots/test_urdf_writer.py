"""URDF out: read back, it is the same arm, by Pinocchio too."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from asserting import refusal
from urmpipe_models.arm.chain import Box, Capsule, Chain, Cylinder, Inertial, Joint, Sphere, Visual
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain
from urmpipe_models.arm.solids import build_placeholder_solids
from urmpipe_models.dynamics.links import chain_to_links
from urmpipe_models.errors import OutputError, RobotError
from urmpipe_models.kinematics.forward import forward, frames_over_log, joint_values
from urmpipe_models.math3d import from_offset, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import urdf_text, write_urdf

SAME = 1e-12
"""What the issue asks for; four frames that pass through angles and back err by 1e-15 each."""


def assert_same(chain: Chain, back: Chain) -> None:
    """Hold every point of two chains together, in a pose with all coordinates different."""
    assert back.name == chain.name
    assert back.coordinates == chain.coordinates
    for one, other in zip(chain.joints, back.joints, strict=True):
        expected = replace(one, origin=other.origin, axis=other.axis)
        expected = expected if one.kind != "fixed" else Joint(one.name, "fixed", other.origin)
        assert other == expected
    q = [0.3 + 0.2 * k for k in range(len(chain.coordinates))]
    for a, b in zip(forward(chain, q), forward(back, q), strict=True):
        np.testing.assert_allclose(a.translation, b.translation, rtol=0.0, atol=SAME)
        np.testing.assert_allclose(a.rotation, b.rotation, rtol=0.0, atol=SAME)
    for frame in ("base", "tip", "tool"):
        a, b = getattr(chain, frame), getattr(back, frame)
        assert a.translation == b.translation
        np.testing.assert_allclose(a.rotation, b.rotation, rtol=0.0, atol=SAME)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_the_file_read_back_is_the_same_chain(
    visual_chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    """With its efforts, its masses on each joint in order, and its shapes likewise."""
    chain = data.draw(visual_chains)
    write_urdf(chain, tmp_path / "chain.urdf")
    back = read_urdf(tmp_path / "chain.urdf")
    assert_same(chain, back)
    assert [one.joint for one in back.inertials] == [one.joint for one in chain.inertials]
    for one, other in zip(chain.inertials, back.inertials, strict=True):
        numbers, again = ([mass.mass, *mass.centre, *mass.inertia] for mass in (one, other))
        np.testing.assert_allclose(again, numbers, rtol=SAME, atol=SAME)
    assert (back.gravity, back.left_out, back.drives) == ((0.0, 0.0, -9.81), (), ())  # URDF has none
    for joint in (None, *(joint.name for joint in chain.joints)) if chain.visuals else ():
        visuals, read = ([one for one in arm.visuals if one.joint == joint] for arm in (chain, back))
        for visual, found in zip(visuals, read, strict=True):
            assert replace(visual, origin=found.origin) == found
            np.testing.assert_allclose(visual.origin.rotation, found.origin.rotation, rtol=0.0, atol=SAME)
            np.testing.assert_allclose(visual.origin.translation, found.origin.translation, rtol=0, atol=SAME)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_dh_arms_come_back(dh_rows: SearchStrategy[list[DHRow]], data: st.DataObject, tmp_path: Path) -> None:
    chain = dh_chain("arm", data.draw(dh_rows), tool=from_offset([0.1, 0.2, 0.3, 1.0, 2.0, 3.0]))
    write_urdf(chain, tmp_path / "chain.urdf")
    assert_same(chain, read_urdf(tmp_path / "chain.urdf"))


@pytest.mark.parametrize("name", robot_names())
def test_the_catalogues_arms_come_back(name: str, tmp_path: Path) -> None:
    chain = load_robot(name).placed(from_offset([1.0, 2.0, 3.0]), from_offset([0.0, 0.0, 0.15]))
    write_urdf(chain, tmp_path / "robot.urdf")
    back = read_urdf(tmp_path / "robot.urdf")
    assert_same(chain, back)
    assert back.point_names == chain.point_names


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25)
@given(data=st.data())
def test_pinocchio_reads_the_file_as_the_same_chain(
    chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    pin = pytest.importorskip("pinocchio")
    chain = data.draw(chains.filter(lambda one: bool(one.name)))
    model = pin.buildModelFromXML(urdf_text(chain))
    q = [0.3 + 0.2 * k for k in range(len(chain.coordinates))]
    moving = [joint.name for joint in chain.joints if joint.kind != "fixed"]
    assert list(model.names)[1:] == moving
    values = dict(zip([joint.name for joint in chain.joints], joint_values(chain, q), strict=True))
    configuration: list[float] = []
    for name, joint_model in zip(moving, list(model.joints)[1:], strict=True):
        value = values[name]
        configuration += [math.cos(value), math.sin(value)] if joint_model.nq == 2 else [value]
    peers = model.createData()
    pin.framesForwardKinematics(model, peers, np.array(configuration))
    *poses, tip = forward(chain, q)
    for k, pose in enumerate(poses, start=1):  # p_k: where joint k + 1 sits on link k
        link = peers.oMf[model.getFrameId(f"link{k}", pin.FrameType.BODY)]
        at_joint = link.act(np.array(chain.joints[k].origin.translation))
        np.testing.assert_allclose(pose.translation, at_joint, rtol=0.0, atol=SAME)
        np.testing.assert_allclose(pose.rotation, link.rotation, rtol=0.0, atol=SAME)
    end = peers.oMf[model.getFrameId("tool0", pin.FrameType.BODY)]
    np.testing.assert_allclose(tip.translation, end.translation, rtol=0.0, atol=SAME)
    np.testing.assert_allclose(tip.rotation, end.rotation, rtol=0.0, atol=SAME)


@pytest.mark.parametrize(
    "chain",
    [
        load_robot("urm6"),
        dh_chain("bent", [DHRow(0.3, 0.1, -0.2, 0.4), DHRow(1.0, -0.2, 0.0, 2.0), DHRow(0.0, 0.0, 0.3, 0.0)]),
    ],
    ids=lambda chain: str(chain.name),
)
def test_an_arm_that_shows_nothing_gets_solids_in_shapes_that_urdf_has(chain: Chain, tmp_path: Path) -> None:
    """They are read by another name of their material; by ours they are left out."""
    path = tmp_path / "arm.urdf"
    write_urdf(chain, path)
    assert read_urdf(path).visuals == ()
    text = path.read_text(encoding="utf-8")
    assert "<capsule" not in text
    path.write_text(text.replace('material name="urmpipe"', 'material name="mine"'), encoding="utf-8")
    found = iter(read_urdf(path).visuals)
    for solid in build_placeholder_solids(chain):
        one, origin = next(found), solid.origin
        shape = solid.shape
        if isinstance(shape, Capsule):
            shape = Cylinder(shape.radius, shape.length)
            for half in (-shape.length / 2.0, shape.length / 2.0):
                ball = next(found)
                assert (ball.joint, ball.shape) == (solid.joint, Sphere(shape.radius))
                end = origin.point((0.0, 0.0, half))
                np.testing.assert_allclose(ball.origin.translation, end, rtol=0.0, atol=SAME)
        assert (one.joint, one.shape) == (solid.joint, shape)
        np.testing.assert_allclose(one.origin.translation, origin.translation, rtol=0.0, atol=SAME)
        np.testing.assert_allclose(one.origin.rotation, origin.rotation, rtol=0.0, atol=SAME)
    assert not list(found)


def test_limits_of_acceleration_make_it_the_version_of_urdf_that_has_them() -> None:
    free, limited = Joint("free"), Joint("limited", "prismatic", acceleration=2.5)
    frame = Joint("frame", "fixed", acceleration=3.0)
    assert '<robot name="arm">' in urdf_text(Chain("arm", (free, frame)))
    text = urdf_text(Chain("arm", (free, frame, limited)))
    assert '<robot name="arm" version="1.2">' in text
    limits = [line.strip() for line in text.splitlines() if "<limit " in line]
    assert ["acceleration" in line for line in limits] == [False, True]
    assert limits[1].endswith('acceleration="2.5"/>')


def test_names_are_escaped(tmp_path: Path) -> None:
    chain = Chain("<a> & \"b\" 'c'", (Joint('<j> & "k"'),))
    write_urdf(chain, tmp_path / "odd.urdf")
    back = read_urdf(tmp_path / "odd.urdf")
    assert (back.name, back.coordinates) == (chain.name, chain.coordinates)


def test_reserved_joint_names_are_refused(tmp_path: Path) -> None:
    chain = Chain("odd", (Joint("urmpipe_tip"), Joint("urmpipe_mass_link1_2"), Joint("tip")))
    assert refusal(RobotError, write_urdf, chain, tmp_path / "odd.urdf") == (
        "robot odd: joint name urmpipe_tip, urmpipe_mass_link1_2 stands for base, tip, tool or a mass"
    )
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "a.urdf"
    assert (
        refusal(OutputError, write_urdf, Chain("a", (Joint("j"),)), path)
        == f"{path}: cannot be written: No such file or directory"
    )


def test_a_written_file_is_whole_and_alone(tmp_path: Path) -> None:
    write_urdf(Chain("a", (Joint("j"),)), tmp_path / "a.urdf")
    assert [path.name for path in tmp_path.iterdir()] == ["a.urdf"]
    assert (tmp_path / "a.urdf").read_text(encoding="utf-8").endswith("</robot>\n")


def test_a_second_mass_of_a_joint_is_a_link_fixed_to_the_first(tmp_path: Path) -> None:
    inertials = tuple(Inertial(on, mass, (0.0, 0.0, mass)) for on in (None, "j") for mass in (1.0, 2.0, 3.0))
    chain = Chain("arm", (Joint("j", origin=translation(0.0, 0.0, 1.0)),), inertials=inertials)
    write_urdf(chain, tmp_path / "arm.urdf")
    back = read_urdf(tmp_path / "arm.urdf")  # the further masses are no ends of the arm
    assert [(one.joint, one.mass, one.centre, one.source) for one in back.inertials] == [
        (None, 1.0, (0.0, 0.0, 1.0), "link base_link"),
        (None, 2.0, (0.0, 0.0, 2.0), "link base_link_mass2"),
        (None, 3.0, (0.0, 0.0, 3.0), "link base_link_mass3"),
        ("j", 1.0, (0.0, 0.0, 1.0), "link link1"),
        ("j", 2.0, (0.0, 0.0, 2.0), "link link1_mass2"),
        ("j", 3.0, (0.0, 0.0, 3.0), "link link1_mass3"),
    ]


def assert_same_inertias(chain: Chain, model: Any) -> None:
    """Hold mass, moment and inertia about the origin of each moving link against those of Pinocchio."""
    for one in chain_to_links(chain).links:
        other = model.inertias[model.getJointId(one.joint.name)]
        np.testing.assert_allclose(one.mass, other.mass, rtol=SAME)
        np.testing.assert_allclose(one.moment, other.mass * other.lever, rtol=0.0, atol=SAME)
        np.testing.assert_allclose(one.inertia, other.matrix()[3:, 3:], rtol=0.0, atol=SAME)


@pytest.mark.parametrize(
    ("file", "tip"),
    [("ur5_robot.urdf", "tool0"), ("panda.urdf", "panda_link8"), ("panda.urdf", "panda_hand")],
)
def test_pinocchio_reads_the_same_inertias(shared: Path, file: str, tip: str) -> None:
    pin = pytest.importorskip("pinocchio")
    path = shared / "robots" / "Gepetto_example-robot-data" / file
    assert_same_inertias(read_urdf(path, tip_link=tip), pin.buildModelFromUrdf(str(path)))


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(data=st.data())
def test_pinocchio_reads_the_file_that_was_written(
    heavy_chains: SearchStrategy[Chain], data: st.DataObject
) -> None:
    pin = pytest.importorskip("pinocchio")
    chain = data.draw(heavy_chains.filter(lambda one: bool(one.name and one.inertials)))
    assert_same_inertias(chain, pin.buildModelFromXML(urdf_text(chain)))


def test_pinocchio_sees_the_visuals_where_they_are(tmp_path: Path) -> None:
    pin = pytest.importorskip("pinocchio")
    robot = load_robot("ur5e").placed(from_offset([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
    origin = from_offset([0.1, 0.0, 0.2, 0.3, 0.2, 0.1])
    box = Visual(None, Box((0.1, 0.2, 0.3)), origin, (1.0, 0.5, 0.0, 1.0))
    cylinders = (Visual(joint.name, Cylinder(0.05, 0.4), origin) for joint in robot.joints)
    chain = replace(robot, visuals=(box, *cylinders))
    text = urdf_text(chain)
    model = pin.buildModelFromXML(text)
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)
    q = np.array([0.3, -0.4, 0.5, -0.6, 0.7, -0.8])
    configuration = [
        part
        for value, joint in zip(q, list(model.joints)[1:], strict=True)
        for part in ([math.cos(value), math.sin(value)] if joint.nq == 2 else [value])
    ]
    data, placed = model.createData(), geometry.createData()
    pin.forwardKinematics(model, data, np.array(configuration))
    pin.updateGeometryPlacements(model, data, geometry, placed)
    position, rotation = frames_over_log(chain, q[np.newaxis])
    names = [None, *(joint.name for joint in chain.joints)]
    for visual, peer in zip(chain.visuals, placed.oMg, strict=True):
        k = names.index(visual.joint)
        np.testing.assert_allclose(
            position[0, k] + rotation[0, k] @ np.array(origin.translation), peer.translation, atol=SAME
        )
        np.testing.assert_allclose(rotation[0, k] @ np.array(origin.rotation), peer.rotation, atol=SAME)
    np.testing.assert_array_equal(geometry.geometryObjects[0].meshColor, [1.0, 0.5, 0.0, 1.0])
