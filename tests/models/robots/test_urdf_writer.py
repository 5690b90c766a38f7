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

from urmpipe_models.arm.chain import Box, Capsule, Chain, Cylinder, Joint, Sphere, Visual
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain
from urmpipe_models.arm.solids import build_placeholder_solids
from urmpipe_models.dynamics.links import chain_to_links
from urmpipe_models.kinematics.forward import forward, frames_over_log, joint_values
from urmpipe_models.math3d import Transform, from_offset
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import urdf_text, write_urdf

SAME = 1e-12
"""What the issue asks for; four frames that pass through angles and back err by 1e-15 each."""


def assert_same_frame(one: Any, other: Any) -> None:
    np.testing.assert_allclose(one.translation, other.translation, rtol=0.0, atol=SAME)
    np.testing.assert_allclose(one.rotation, other.rotation, rtol=0.0, atol=SAME)


def assert_same(chain: Chain, back: Chain) -> None:
    """Compare every point of two chains, in a pose with all coordinates different."""
    assert (back.name, back.coordinates) == (chain.name, chain.coordinates)
    for one, other in zip(chain.joints, back.joints, strict=True):
        expected = replace(one, origin=other.origin, axis=other.axis)
        expected = expected if one.kind != "fixed" else Joint(one.name, "fixed", other.origin)
        assert other == expected
    q = [0.3 + 0.2 * k for k in range(len(chain.coordinates))]
    for pose, read in zip(forward(chain, q), forward(back, q), strict=True):
        assert_same_frame(pose, read)
    for frame in ("base", "tip", "tool"):
        assert_same_frame(getattr(chain, frame), getattr(back, frame))
        assert getattr(chain, frame).translation == getattr(back, frame).translation


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_what_is_read_back(heavy_chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path) -> None:
    """The same chain with its efforts, its masses on each joint in order, and its shapes likewise."""
    chain = data.draw(heavy_chains)
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
            assert_same_frame(visual.origin, found.origin)


@pytest.mark.parametrize("name", robot_names())
def test_the_catalogues_arms_come_back(name: str, tmp_path: Path) -> None:
    chain = load_robot(name).placed(from_offset([1.0, 2.0, 3.0]), from_offset([0.0, 0.0, 0.15]))
    write_urdf(chain, tmp_path / "robot.urdf")
    back = read_urdf(tmp_path / "robot.urdf")
    assert_same(chain, back)
    assert back.point_names == chain.point_names


def configuration(model: Any, values: list[float]) -> Any:
    """Return joint values as Pinocchio has them: a joint without limits by its cosine and sine."""
    pairs = zip(values, list(model.joints)[1:], strict=True)
    return np.concatenate([[math.cos(x), math.sin(x)] if joint.nq == 2 else [x] for x, joint in pairs])


@settings(deadline=None, max_examples=25)
@given(data=st.data())
def test_pinocchio_reads_the_same_chain(chains: SearchStrategy[Chain], data: st.DataObject) -> None:
    pin = pytest.importorskip("pinocchio")
    chain = data.draw(chains.filter(lambda one: bool(one.name)))
    model = pin.buildModelFromXML(urdf_text(chain))
    q = [0.3 + 0.2 * k for k in range(len(chain.coordinates))]
    values = zip(chain.joints, joint_values(chain, q), strict=True)
    moving = {joint.name: float(value) for joint, value in values if joint.kind != "fixed"}
    assert list(model.names)[1:] == list(moving)
    peers = model.createData()
    pin.framesForwardKinematics(model, peers, configuration(model, list(moving.values())))
    *poses, tip = forward(chain, q)
    for k, pose in enumerate(poses, start=1):  # p_k: where joint k + 1 sits on link k
        link = peers.oMf[model.getFrameId(f"link{k}", pin.FrameType.BODY)]
        at_joint = link.act(np.array(chain.joints[k].origin.translation))
        assert_same_frame(pose, Transform(link.rotation, tuple(at_joint)))
    assert_same_frame(tip, peers.oMf[model.getFrameId("tool0", pin.FrameType.BODY)])


BENT = dh_chain("bent", [DHRow(0.3, 0.1, -0.2, 0.4), DHRow(1.0, -0.2, 0.0, 2.0), DHRow(0.0, 0.0, 0.3, 0.0)])


@pytest.mark.parametrize("chain", [load_robot("urm6"), BENT], ids=["urm6", "bent"])
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
        one, shape = next(found), solid.shape
        if isinstance(shape, Capsule):
            shape = Cylinder(shape.radius, shape.length)
            for half in (-shape.length / 2.0, shape.length / 2.0):
                ball = next(found)
                assert (ball.joint, ball.shape) == (solid.joint, Sphere(shape.radius))
                end = solid.origin.point((0.0, 0.0, half))
                np.testing.assert_allclose(ball.origin.translation, end, rtol=0.0, atol=SAME)
        assert (one.joint, one.shape) == (solid.joint, shape)
        assert_same_frame(one.origin, solid.origin)
    assert not list(found)


def assert_same_inertias(chain: Chain, model: Any) -> None:
    """Compare mass, moment and inertia about the origin of each moving link with those of Pinocchio."""
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
def test_pinocchio_reads_written_inertias(heavy_chains: SearchStrategy[Chain], data: st.DataObject) -> None:
    pin = pytest.importorskip("pinocchio")
    chain = data.draw(heavy_chains.filter(lambda one: bool(one.name and one.inertials)))
    assert_same_inertias(chain, pin.buildModelFromXML(urdf_text(chain)))


def test_pinocchio_sees_the_visuals_where_they_are() -> None:
    pin = pytest.importorskip("pinocchio")
    robot = load_robot("ur5e").placed(from_offset([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
    origin = from_offset([0.1, 0.0, 0.2, 0.3, 0.2, 0.1])
    box = Visual(None, Box((0.1, 0.2, 0.3)), origin, (1.0, 0.5, 0.0, 1.0))
    cylinders = (Visual(joint.name, Cylinder(0.05, 0.4), origin) for joint in robot.joints)
    chain = replace(robot, visuals=(box, *cylinders))
    text = urdf_text(chain)
    model = pin.buildModelFromXML(text)
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)
    q = [0.3, -0.4, 0.5, -0.6, 0.7, -0.8]
    data, placed = model.createData(), geometry.createData()
    pin.forwardKinematics(model, data, configuration(model, q))
    pin.updateGeometryPlacements(model, data, geometry, placed)
    position, rotation = frames_over_log(chain, np.array([q]))
    names = [None, *(joint.name for joint in chain.joints)]
    for visual, peer in zip(chain.visuals, placed.oMg, strict=True):
        k = names.index(visual.joint)
        assert_same_frame(Transform(rotation[0, k], position[0, k]) @ origin, peer)
    np.testing.assert_array_equal(geometry.geometryObjects[0].meshColor, [1.0, 0.5, 0.0, 1.0])
