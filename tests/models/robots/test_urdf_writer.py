"""URDF out: read back, it is the same arm, by Pinocchio too."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from urmpipe_models.arm.chain import Capsule, Chain, Cylinder, Joint, Sphere
from urmpipe_models.arm.geometric_models import DHRow, dh_chain
from urmpipe_models.arm.solids import build_placeholder_solids
from urmpipe_models.errors import OutputError, RobotError
from urmpipe_models.kinematics.forward import forward, joint_values
from urmpipe_models.math3d import from_offset
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


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_the_file_read_back_is_the_same_chain(
    chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    chain = data.draw(chains)
    write_urdf(chain, tmp_path / "chain.urdf")
    assert_same(chain, read_urdf(tmp_path / "chain.urdf"))


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
    with pytest.raises(RobotError) as caught:
        chain = Chain("odd", (Joint("urmpipe_tip"), Joint("urmpipe_mass_link1_2"), Joint("tip")))
        write_urdf(chain, tmp_path / "odd.urdf")
    assert str(caught.value) == (
        "robot odd: joint name urmpipe_tip, urmpipe_mass_link1_2 stands for base, tip, tool or a mass"
    )
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "a.urdf"
    with pytest.raises(OutputError) as caught:
        write_urdf(Chain("a", (Joint("j"),)), path)
    assert str(caught.value) == f"{path}: cannot be written: No such file or directory"


def test_a_written_file_is_whole_and_alone(tmp_path: Path) -> None:
    write_urdf(Chain("a", (Joint("j"),)), tmp_path / "a.urdf")
    assert [path.name for path in tmp_path.iterdir()] == ["a.urdf"]
    assert (tmp_path / "a.urdf").read_text(encoding="utf-8").endswith("</robot>\n")
