"""URDF files of others, inertias by Pinocchio, and encodings. urdf.cases has the rest."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.errors import RobotError
from urmpipe_models.robots.urdf import read_urdf

TURNED = """<robot name="arm"><link name="r"/><link name="a">
<inertial><origin rpy="0.4 -0.7 1.9"/><mass value="1"/>
<inertia ixx="0.2" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="0.4"/></inertial></link>
<joint name="j" type="continuous"><parent link="r"/><child link="a"/></joint></robot>"""


@pytest.fixture
def panda(shared: Path) -> Path:
    return shared / "robots" / "Gepetto_example-robot-data" / "panda.urdf"


def test_the_fingers_of_a_gripper(panda: Path) -> None:
    assert refusal(RobotError, read_urdf, panda) == (
        f"{panda}: found panda_finger_joint2 on the arm beside the way to panda_leftfinger, as of a gripper;"
        " --tip-link LINK chooses one: panda_hand, panda_hand_tcp, panda_leftfinger, panda_rightfinger"
    )
    message = refusal(RobotError, read_urdf, panda, tip_link="panda_rightfinger")
    assert "joint panda_finger_joint2: mimics panda_finger_joint1, which is not on the chain" in message


def test_the_hand_adds_to_the_flange_and_the_fingers_are_left_out(panda: Path) -> None:
    chain = read_urdf(panda, tip_link="panda_link8")
    hand = chain.inertials[-1]
    assert (hand.joint, hand.mass, hand.source) == ("panda_joint8", 0.73, "link panda_hand")
    c = -0.01 * math.sqrt(0.5)  # the hand is turned by -45 deg about z
    np.testing.assert_allclose(hand.centre, (c, -c, 0.03), rtol=1e-15)
    assert chain.left_out == ("panda_leftfinger", "panda_rightfinger")
    assert [one.effort for one in chain.moving] == [87.0] * 4 + [12.0] * 3


@pytest.mark.parametrize("encoding", ["gb2312", "no-such"])
def test_an_encoding_that_cannot_be_read_is_one_line(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?><robot name="a"/>', encoding="ascii")
    message = refusal(RobotError, read_urdf, path)
    assert message.startswith(f"{path}: cannot be decoded: ")
    assert message.endswith("; allowed: UTF-8")


def test_an_inertia_is_turned_by_the_rpy_of_its_origin(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(TURNED, encoding="utf-8")
    ixx, iyy, izz, ixy, ixz, iyz = read_urdf(tmp_path / "arm.urdf").inertials[0].inertia
    pin = pytest.importorskip("pinocchio")
    rotation = pin.rpy.rpyToMatrix(0.4, -0.7, 1.9)
    expected = rotation @ np.diag([0.2, 0.3, 0.4]) @ rotation.T
    found = [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-15)
