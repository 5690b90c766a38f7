"""The masses of URDF files: whose they are, what is refused, and the same out and in again."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from asserting import refusal
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.dynamics.links import chain_to_links, check_masses
from urmpipe_models.errors import RobotError
from urmpipe_models.math3d import translation
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import urdf_text, write_urdf

Read = Callable[..., Chain]

SAME = 1e-12
"""Relative to 1 kg, 1 m and 1 kg.m2: two frames that pass through angles and back err by 1e-15 each."""


@pytest.fixture
def urdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Read:
    """Write elements as arm.urdf in an empty folder, the working one, and read it."""
    monkeypatch.chdir(tmp_path)

    def read(*elements: str, **options: str) -> Chain:
        text = "\n".join(['<robot name="arm">', *elements, "</robot>"])
        Path("arm.urdf").write_text(text, encoding="utf-8")
        return read_urdf("arm.urdf", **options)

    return read


def inertial(mass: float, moments: tuple[float, ...] = (0.1, 0.1, 0.1), origin: str = "") -> str:
    ixx, iyy, izz = moments
    inertia = f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/>'
    return f'<inertial>{origin}<mass value="{mass}"/>{inertia}</inertial>'


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, parent: str, child: str, kind: str = "continuous", xyz: str = "0 0 0") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<origin xyz="{xyz}"/></joint>'


def test_each_link_of_the_chain_weighs_on_the_joint_that_carries_it(urdf: Read) -> None:
    quarter = '<origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/>'
    chain = urdf(
        link("r", inertial(5.0)), link("a", inertial(2.0, (0.1, 0.2, 0.25), quarter)),
        link("plate", inertial(0.5)), link("b"), link("end", inertial(0.0, (0.0, 0.0, 0.0))),
        joint("j1", "r", "a"), joint("sensor", "a", "plate", "fixed", "0 0 1"),
        joint("j2", "plate", "b"), joint("flange", "b", "end", "fixed"),
    )  # fmt: skip
    ball = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)
    assert chain.inertials == (
        Inertial(None, 5.0, inertia=ball, source="link r"),
        Inertial("j1", 2.0, (0.1, 0.0, 0.0), (0.2, 0.1, 0.25, 0.0, 0.0, 0.0), "link a"),
        Inertial("sensor", 0.5, inertia=ball, source="link plate"),
    )
    assert chain.left_out == ()


def test_an_inertia_is_turned_by_the_rpy_of_its_origin(urdf: Read) -> None:
    turned = '<origin rpy="0.4 -0.7 1.9"/>'
    chain = urdf(link("r"), link("a", inertial(1.0, (0.2, 0.3, 0.4), turned)), joint("j", "r", "a"))
    ixx, iyy, izz, ixy, ixz, iyz = chain.inertials[0].inertia
    pin = pytest.importorskip("pinocchio")
    rotation = pin.rpy.rpyToMatrix(0.4, -0.7, 1.9)
    expected = rotation @ np.diag([0.2, 0.3, 0.4]) @ rotation.T
    found = [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-15)


GRIPPING = (
    link("floor", inertial(9.0)), link("r"), link("a", inertial(2.0)), link("b", inertial(1.0)),
    link("cable", inertial(0.2)), link("plug", inertial(0.1)),
    link("finger", inertial(0.3)), link("nail", inertial(0.01)), link("light"),
    link("wheel", inertial(4.0)), link("box", inertial(3.0)),
    joint("stands", "floor", "r", "fixed", "0 0 0.5"), joint("j1", "r", "a"), joint("j2", "a", "b"),
    joint("clip", "a", "cable", "fixed", "0 0.1 0"), joint("plugged", "cable", "plug", "fixed", "0 0 0.2"),
    joint("grips", "plug", "finger", "prismatic"), joint("grown", "finger", "nail", "fixed"),
    joint("hangs", "a", "light", "floating"),
    joint("rolls", "r", "wheel"), joint("lies", "r", "box", "fixed", "1 0 0"),
)  # fmt: skip


def test_what_is_fixed_beside_the_chain_is_carried_and_what_moves_on_it_is_left_out(urdf: Read) -> None:
    chain = urdf(*GRIPPING, tip_link="b")
    assert [(one.source, one.joint, one.centre) for one in chain.inertials] == [
        ("link floor", None, (0.0, 0.0, 0.0)),
        ("link box", "stands", (1.0, 0.0, 0.0)),
        ("link a", "j1", (0.0, 0.0, 0.0)),
        ("link cable", "j1", (0.0, 0.1, 0.0)),
        ("link plug", "j1", (0.0, 0.1, 0.2)),
        ("link b", "j2", (0.0, 0.0, 0.0)),
    ]
    assert chain.left_out == ("finger", "nail")


def test_links_beyond_the_tip_and_above_the_base_are_no_part_of_the_chain(urdf: Read) -> None:
    shorter = urdf(*GRIPPING, base_link="r", tip_link="a")
    assert [one.source for one in shorter.inertials] == ["link box", "link a", "link cable", "link plug"]
    assert shorter.left_out == ("b", "finger", "nail")


def test_what_hangs_on_base_tip_and_tool_is_carried_by_the_joint_before(urdf: Read) -> None:
    chain = urdf(
        link("w", inertial(1.0)), link("r", inertial(2.0)), link("a"), link("t", inertial(3.0)),
        link("e", inertial(4.0)), joint("urmpipe_base", "w", "r", "fixed", "0 0 1"), joint("j", "r", "a"),
        joint("urmpipe_tip", "a", "t", "fixed", "0.1 0 0"),
        joint("urmpipe_tool", "t", "e", "fixed", "0.1 0 0"),
    )  # fmt: skip
    assert [(one.joint, one.mass, one.centre) for one in chain.inertials] == [
        (None, 1.0, (0.0, 0.0, -1.0)), (None, 2.0, (0.0, 0.0, 0.0)),
        ("j", 3.0, (0.1, 0.0, 0.0)), ("j", 4.0, (0.2, 0.0, 0.0)),
    ]  # fmt: skip


def test_masses_that_are_not_right_are_not_used_and_say_why_with_link_and_line(urdf: Read) -> None:
    """The kinematics are read; nothing is said of what stands still or moves on its own."""
    robot = urdf(
        link("r", "<inertial/>"),
        link("a", '<inertial><mass/>\n<inertia ixx="1" iyy="x" izz="1" ixz="0"/></inertial>'),
        link("b", inertial(math.inf, origin='<origin xyz="1"/>')),
        link("c", inertial(-1.0)),
        link("d", inertial(1.0, (0.1, 0.1, 0.3))),
        link("e", inertial(0.0)),
        link("f", "\n" + inertial(-2.0)),
        link("g", '<inertial><mass value="1"/></inertial>'),
        link("h", inertial(1.0) + inertial(2.0)),
        link("wheel", "<inertial/>"),
        joint("j1", "r", "a"), joint("j2", "a", "b"), joint("j3", "b", "c"), joint("j4", "c", "d"),
        joint("fixed", "c", "e", "fixed"), joint("onto", "a", "f", "fixed"), joint("moves", "b", "g"),
        joint("twice", "d", "h", "fixed"), joint("rolls", "r", "wheel"),
        tip_link="d",
    )  # fmt: skip
    assert (robot.coordinates, robot.inertials, robot.left_out) == (("j1", "j2", "j3", "j4"), (), ("g",))
    faults = [
        "arm.urdf:3: link a: inertial: mass: no value; allowed: a number each",
        "arm.urdf:4: link a: inertial: inertia: no ixy, iyz; allowed: a number each",
        "arm.urdf:4: link a: inertial: inertia iyy: found 'x', expected a number",
        "arm.urdf:10: link f: inertial on joint j1: mass -2 kg; allowed: 0 or more",
        "arm.urdf:5: link b: inertial: mass value: found 'inf', expected a number",
        "arm.urdf:5: link b: inertial: origin xyz: found '1', expected three numbers",
        "arm.urdf:6: link c: inertial on joint j3: mass -1 kg; allowed: 0 or more",
        "arm.urdf:8: link e: inertial on joint j3: mass 0 with an inertia; allowed: a mass, or no inertia",
        "arm.urdf:7: link d: inertial on joint j4: principal moments 0.1, 0.1, 0.3 kg.m2; allowed: none above"
        " the sum of the other two",
        "arm.urdf:12: link h: found a second <inertial>; allowed: one",
    ]
    assert list(robot.mass_faults) == faults
    assert refusal(RobotError, check_masses, robot).splitlines() == faults
    assert chain_from_dict(chain_to_dict(robot)) == robot


# --- out again -------------------------------------------------------------------------------------


def numbers(one: Inertial) -> list[float]:
    return [one.mass, *one.centre, *one.inertia]


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_the_masses_of_a_file_read_back_are_the_same(
    heavy_chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    chain = data.draw(heavy_chains)
    write_urdf(chain, tmp_path / "chain.urdf")
    back = read_urdf(tmp_path / "chain.urdf")
    assert [one.joint for one in back.inertials] == [one.joint for one in chain.inertials]
    for one, other in zip(chain.inertials, back.inertials, strict=True):
        np.testing.assert_allclose(numbers(other), numbers(one), rtol=SAME, atol=SAME)
    moving = [(one.effort, other.effort) for one, other in zip(chain.moving, back.moving, strict=True)]
    assert all(one == other for one, other in moving)
    assert (back.gravity, back.left_out, back.drives) == ((0.0, 0.0, -9.81), (), ())  # URDF has none


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


# --- against Pinocchio -----------------------------------------------------------------------------


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


def test_the_hand_adds_to_the_flange_and_the_fingers_are_left_out(shared: Path) -> None:
    path = shared / "robots" / "Gepetto_example-robot-data" / "panda.urdf"
    chain = read_urdf(path, tip_link="panda_link8")
    hand = chain.inertials[-1]
    assert (hand.joint, hand.mass, hand.source) == ("panda_joint8", 0.73, "link panda_hand")
    c = -0.01 * math.sqrt(0.5)  # the hand is turned by -45 deg about z
    np.testing.assert_allclose(hand.centre, (c, -c, 0.03), rtol=1e-15)
    assert chain.left_out == ("panda_leftfinger", "panda_rightfinger")
    assert [one.effort for one in chain.moving] == [87.0] * 4 + [12.0] * 3
