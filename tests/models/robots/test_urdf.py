"""URDF in: joints, masses, shapes, and whole error texts."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.arm.chain import (
    Box,
    Capsule,
    Chain,
    Cylinder,
    Inertial,
    Joint,
    Mesh,
    Mimic,
    Sphere,
    Visual,
)
from urmpipe_models.dynamics.links import check_masses
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import joint_values
from urmpipe_models.math3d import Transform, translation
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict
from urmpipe_models.robots.urdf import read_urdf

ARM = """<robot name="arm">
  <link name="root"/> <link name="a"/> <link name="b"/> <link name="c"/> <link name="flange"/>
  <joint name="j1" type="revolute">
    <parent link="root"/> <child link="a"/> <origin xyz="0 0 0.3" rpy="0 0 0"/> <axis xyz="0 0 2"/>
    <limit lower="-1" upper="2" effort="5" velocity="0.5" acceleration="3"/>
  </joint>
  <joint name="j2" type="continuous">
    <parent link="a"/> <child link="b"/> <limit lower="0" upper="0" effort="0" velocity="0" acceleration="0"/>
  </joint>
  <joint name="j3" type="prismatic">
    <parent link="b"/> <child link="c"/> <axis xyz="0 1 0"/> <mimic joint="j2" multiplier="0.5" offset="0.1"/>
  </joint>
  <joint name="sensor" type="fixed">
    <parent link="c"/> <child link="flange"/> <origin xyz="0.1 0 0"/>
  </joint>
</robot>
"""


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, parent: str, child: str, kind: str = "continuous", inside: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def robot(*elements: str) -> str:
    return "\n".join(['<robot name="arm">', *elements, "</robot>"])


def at(xyz: str) -> str:
    return f'<origin xyz="{xyz}"/>'


@pytest.fixture
def urdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Write a text as arm.urdf in an empty folder, the working one, and read it."""
    monkeypatch.chdir(tmp_path)

    def read(text: str, name: str = "arm.urdf", **options: str) -> Chain:
        Path(name).write_text(text, encoding="utf-8")
        return read_urdf(name, **options)

    return read


def complaint(read: Any, text: str, **options: str) -> list[str]:
    return refusal(RobotError, read, text, **options).splitlines()


def test_every_kind_of_joint_is_read(urdf: Any) -> None:
    assert urdf(ARM) == Chain(
        "arm",
        (
            Joint("j1", "revolute", translation(0.0, 0.0, 0.3), (0.0, 0.0, 1.0), -1.0, 2.0, 0.5, 3.0, 5.0),
            Joint("j2", "revolute", axis=(1.0, 0.0, 0.0)),  # URDF's default axis; a limit of 0 is not known
            Joint("j3", "prismatic", axis=(0.0, 1.0, 0.0), mimic=Mimic("j2", 0.5, 0.1)),
            Joint("sensor", "fixed", translation(0.1, 0.0, 0.0)),
        ),
        source="arm.urdf",
    )


def test_base_and_tip_are_chosen_by_name(urdf: Any) -> None:
    assert urdf(ARM, base_link="a", tip_link="c").coordinates == ("j2",)
    assert [joint.name for joint in urdf(ARM, tip_link="b").joints] == ["j1", "j2"]
    assert complaint(urdf, ARM, base_link="rot", tip_link="x") == [
        "arm.urdf: base link 'rot' is not in the file (did you mean root?); allowed: root, a, b, c, flange",
        "arm.urdf: tip link 'x' is not in the file; allowed: root, a, b, c, flange",
    ]
    assert complaint(urdf, ARM, base_link="b", tip_link="a") == [
        "arm.urdf: tip link a does not follow base link b; allowed: b, c, flange"
    ]


def test_of_several_ends_the_one_with_most_moving_joints_is_the_tip(urdf: Any) -> None:
    branches = [link("r"), link("a"), link("b"), link("c"), joint("j1", "r", "a"), joint("j2", "a", "b")]
    assert urdf(robot(*branches, joint("camera", "a", "c", "fixed"))).coordinates == ("j1", "j2")
    assert complaint(urdf, robot(*branches, joint("j3", "a", "c"))) == [
        "arm.urdf: found 2 ends with 2 moving joints; tip_link=LINK chooses one: b, c"
    ]
    assert urdf(robot(*branches, joint("j3", "a", "c")), tip_link="c").coordinates == ("j1", "j3")


def test_joints_that_the_arm_carries_beside_its_tip_need_a_choice_and_wheels_below_it_do_not(
    urdf: Any,
) -> None:
    arm = [link("r"), link("a"), link("b"), link("c"), link("d"), joint("j1", "r", "a")]
    arm += [joint("j2", "a", "b"), joint("left", "b", "c")]
    finger = joint("right", "b", "d", inside='<mimic joint="left"/>')
    assert complaint(urdf, robot(*arm, finger)) == [
        "arm.urdf: found right on the arm beside the way to c, as of a gripper; tip_link=LINK chooses"
        " one: b, c, d"
    ]
    assert urdf(robot(*arm, finger), tip_link="b").coordinates == ("j1", "j2")
    assert urdf(robot(*arm, joint("wheel", "r", "d"))).coordinates == ("j1", "j2", "left")
    footprint = [link("footprint"), joint("stands", "footprint", "r", "fixed")]
    assert urdf(robot(*footprint, *arm, joint("wheel", "r", "d"))).coordinates == ("j1", "j2", "left")


def test_several_roots_need_a_choice(urdf: Any) -> None:
    text = robot(link("r"), link("a"), link("stray"), joint("j1", "r", "a"))
    assert complaint(urdf, text) == [
        "arm.urdf: found 2 root links: r, stray; allowed: one root, or a base link chosen by name"
    ]
    assert urdf(text, base_link="r").coordinates == ("j1",)
    assert complaint(urdf, robot()) == [
        "arm.urdf: found no link; allowed: one root, or a base link chosen by name"
    ]


def test_everything_wrong_is_said_at_once_with_its_line(urdf: Any) -> None:
    text = robot(
        link("r"), link("a"), link("a"), "<link/>", link("b"), link("c"),
        joint("j1", "r", "a", "spinning"),
        joint("j1", "a", "b"),
        joint("j2", "a", "b", inside='<origin xyz="0 abc 0" rpy="1 2"/><axis xyz="0 0 0"/>'),
        joint("j3", "a", "b", "revolute", '<limit lower="2" upper="1" velocity="-1" '
              'effort="-3" acceleration="-2"/>'),
        joint("j4", "a", "cc", inside='<mimic joint="ghost" multiplier="nan"/>'),
        '<joint name="j5" type="fixed"><child link="c"/></joint>',
        '<joint type="fixed"/>',
    )  # fmt: skip
    assert complaint(urdf, text) == [
        "arm.urdf:4: link a: duplicate name; first defined in line 3",
        "arm.urdf:5: link without a name",
        "arm.urdf:8: joint j1: found type 'spinning'; allowed: revolute, continuous, prismatic, fixed",
        "arm.urdf:9: joint j1: duplicate name; first defined in line 8",
        "arm.urdf:10: joint j2: origin xyz: found '0 abc 0', expected three numbers",
        "arm.urdf:10: joint j2: origin rpy: found '1 2', expected three numbers",
        "arm.urdf:10: joint j2: axis is zero; allowed: a direction",
        "arm.urdf:11: joint j3: limit velocity: found -1; allowed: 0 (not known) or more",
        "arm.urdf:11: joint j3: limit acceleration: found -2; allowed: 0 (not known) or more",
        "arm.urdf:11: joint j3: limit effort: found -3; allowed: 0 (not known) or more",
        "arm.urdf:11: joint j3: limit: lower 2 above upper 1",
        "arm.urdf:12: joint j4: child 'cc'; allowed: a link of the file (did you mean c?)",
        "arm.urdf:12: joint j4: mimic multiplier: found 'nan', expected a number",
        'arm.urdf:13: joint j5: no <parent link="...">; allowed: one',
        "arm.urdf:14: joint without a name",
        "arm.urdf:11: link b: child of joints j2 and j3; allowed: one parent",
        "arm.urdf:12: joint j4: mimics 'ghost'; allowed: a joint of the file",
    ]


def test_each_end_and_axis_that_is_missing_is_said_by_itself(urdf: Any) -> None:
    text = robot(
        link("r") + link("another root"),
        '<joint name="j1" type="continuous"><parent link="r"/></joint>',
        '<joint name="j2" type="continuous"><parent link="r"/><axis xyz="0 0"/></joint>',
        '<joint name="j3"><parent link="r"/><limit velocity="x" lower="y" acceleration="z"/></joint>',
        '<joint name="j4" type="revolute"><parent link="r"/><mimic joint="j1" offset="x"/></joint>',
    )
    assert complaint(urdf, text) == [
        'arm.urdf:3: joint j1: no <child link="...">; allowed: one',
        'arm.urdf:4: joint j2: no <child link="...">; allowed: one',
        "arm.urdf:4: joint j2: axis xyz: found '0 0', expected three numbers",
        "arm.urdf:5: joint j3: found type ''; allowed: revolute, continuous, prismatic, fixed",
        'arm.urdf:5: joint j3: no <child link="...">; allowed: one',
        "arm.urdf:5: joint j3: limit velocity: found 'x', expected a number",
        "arm.urdf:5: joint j3: limit acceleration: found 'z', expected a number",
        "arm.urdf:5: joint j3: limit lower: found 'y', expected a number",
        'arm.urdf:6: joint j4: no <child link="...">; allowed: one',
        "arm.urdf:6: joint j4: mimic offset: found 'x', expected a number",
    ]


def test_where_a_link_has_two_parents_its_roots_are_not_asked_for(urdf: Any) -> None:
    text = robot(link("r"), link("s"), link("a"), joint("j1", "r", "a"), joint("j2", "s", "a"))
    assert complaint(urdf, text) == ["arm.urdf:6: link a: child of joints j1 and j2; allowed: one parent"]


def test_what_a_joint_leaves_out_is_what_urdf_takes_for_it(urdf: Any) -> None:
    limits = ["", '<limit velocity="2"/>', '<limit lower="-1"/>', '<limit upper="1"/>', "<axis/>"]
    limits.append('<limit acceleration="4"/>')
    names = [f"l{k}" for k in range(len(limits) + 1)]
    joints = [joint(f"j{k}", names[k], names[k + 1], "revolute", inside) for k, inside in enumerate(limits)]
    chain = urdf(robot(*map(link, names), *joints))
    inf = math.inf
    assert [(one.lower, one.upper, one.velocity, one.acceleration) for one in chain.joints] == [
        (-inf, inf, inf, inf), (-inf, inf, 2.0, inf), (-1.0, 0.0, inf, inf), (0.0, 1.0, inf, inf),
        (-inf, inf, inf, inf), (-inf, inf, inf, 4.0),
    ]  # fmt: skip
    assert chain.joints[4].axis == (1.0, 0.0, 0.0)


def test_an_axis_whose_length_is_1_but_for_rounding_keeps_its_bits(urdf: Any) -> None:
    axis = (0.12427743641858018, 0.509194982237367, -0.8516311342720586)
    assert math.hypot(*axis) == math.nextafter(1.0, 0.0)
    written = f'<axis xyz="{axis[0]!r} {axis[1]!r} {axis[2]!r}"/>'
    assert urdf(robot(link("a"), link("b"), joint("j", "a", "b", inside=written))).joints[0].axis == axis


def test_a_joint_that_is_fixed_in_a_chain_has_neither_axis_nor_limit_and_follows_none(urdf: Any) -> None:
    inside = '<axis xyz="0 0 0"/><limit lower="2" upper="1"/><mimic joint="ghost"/>'
    fixed = joint("f", "b", "c", "fixed", inside)
    beside = joint("g", "b", "d", "floating", '<axis xyz="0 0 0"/><mimic joint="ghost"/>')
    arm = robot(*map(link, "abcd"), joint("j", "a", "b"), fixed, beside)
    assert urdf(arm, tip_link="c").joints[1] == Joint("f", "fixed")


def test_an_axis_is_brought_to_unit_length_and_a_follower_goes_as_far_as_its_leader(urdf: Any) -> None:
    axis, follow = '<axis xyz="3 0 4"/>', '<mimic joint="j"/>'
    text = robot(*map(link, "abc"), joint("j", "a", "b", inside=axis), joint("f", "b", "c", inside=follow))
    chain = urdf(text)
    assert chain.joints[0].axis == (0.6, 0.0, 0.8)
    assert chain.joints[1].mimic == Mimic("j", 1.0, 0.0)


def test_loops_are_refused(urdf: Any) -> None:
    text = robot(
        link("a"), link("b"), link("c"), joint("j1", "a", "b"), joint("j2", "b", "c"), joint("j3", "c", "a")
    )
    assert complaint(urdf, text) == ["arm.urdf:7: links a -> b -> c -> a form a loop; allowed: a tree"]
    assert complaint(urdf, robot(link("a"), joint("j", "a", "a"))) == [
        "arm.urdf:3: links a -> a form a loop; allowed: a tree"
    ]


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_that_no_chain_holds_may_stand_beside_it(urdf: Any, kind: str) -> None:
    text = robot(link("r"), link("a"), link("b"), joint("j1", "r", "a", kind), joint("j2", "a", "b"))
    assert complaint(urdf, text) == [
        f"arm.urdf:5: joint j1: is {kind}; allowed on a chain: revolute, continuous, prismatic, fixed"
    ]
    assert urdf(text, base_link="a").coordinates == ("j2",)


def test_a_mimic_follows_through_others_to_the_joint_that_moves(urdf: Any) -> None:
    links = map(link, "rabc")
    text = robot(
        *links,
        joint("j1", "r", "a"),
        joint("j2", "a", "b", inside='<mimic joint="j1" multiplier="2" offset="0.5"/>'),
        joint("j3", "b", "c", inside='<mimic joint="j2" multiplier="-3" offset="1"/>'),
    )
    chain = urdf(text)
    assert chain.coordinates == ("j1",)
    assert joint_values(chain, [0.1]) == pytest.approx([0.1, 0.7, -1.1])


def test_a_mimic_of_a_joint_outside_the_chain_is_refused(urdf: Any) -> None:
    links = map(link, "rabc")
    follower = joint("j3", "a", "c", inside='<mimic joint="j2"/>')
    text = robot(*links, joint("j1", "r", "a"), joint("j2", "a", "b"), follower)
    assert urdf(text, tip_link="b").coordinates == ("j1", "j2")
    assert complaint(urdf, text, tip_link="c") == [
        "arm.urdf:8: joint j3: mimics j2, which is not on the chain r to c; allowed: j1"
    ]


def test_mimics_of_fixed_joints_of_themselves_and_of_none_are_refused(urdf: Any) -> None:
    links = map(link, "rabcde")
    text = robot(
        *links,
        joint("j0", "r", "a", "fixed"),
        joint("j1", "a", "b", inside='<mimic joint="j0"/>'),
        joint("j2", "b", "c", inside='<mimic joint="j3"/>'),
        joint("j3", "c", "d", inside='<mimic joint="j2"/>'),
        joint("j4", "d", "e", inside='<mimic joint="ghost"/>'),
    )
    assert complaint(urdf, text) == [
        "arm.urdf:12: joint j4: mimics 'ghost'; allowed: a joint of the file",
        "arm.urdf:9: joint j1: mimics j0, which is fixed; allowed: a moving joint",
        "arm.urdf:10: joint j2: mimics itself by way of j2",
        "arm.urdf:11: joint j3: mimics itself by way of j3",
    ]


def test_a_chain_without_a_moving_joint_is_refused_with_its_file(urdf: Any) -> None:
    text = robot(link("r"), link("a"), joint("j", "r", "a", "fixed"))
    assert complaint(urdf, text) == ["arm.urdf: robot arm: has no moving joint; at least one is needed"]


@pytest.mark.parametrize(
    "doctype",
    [
        '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]>',
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE r SYSTEM "http://localhost:1/r.dtd">',
        "<!DOCTYPE robot>",
    ],
)
def test_documents_that_could_expand_are_refused_unread(urdf: Any, doctype: str) -> None:
    assert complaint(urdf, f'<?xml version="1.0"?>\n{doctype}\n<robot name="&c;&x;"/>') == [
        "arm.urdf:2: found a document type (<!DOCTYPE ...>); allowed: XML without document type and entities"
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "arm.urdf:1: not well-formed XML: no element found"),
        ("<robot>\n<link></robot>", "arm.urdf:2: not well-formed XML: mismatched tag"),
        ("<robot name='&lol;'/>", "arm.urdf:1: not well-formed XML: undefined entity"),
        ("<sdf/>", "arm.urdf:1: found <sdf>; allowed: a URDF file, <robot>"),
        (
            '<robot xmlns:xacro="x"><link name="a"/><xacro:macro name="m"/></robot>',
            "arm.urdf: is a xacro file; expand it first: xacro arm.urdf -o arm.expanded.urdf",
        ),
    ],
)
def test_files_that_are_no_urdf_get_one_line(urdf: Any, text: str, said: str) -> None:
    assert complaint(urdf, text) == [said]


def test_a_file_larger_than_any_arm_is_refused(urdf: Any) -> None:
    links = "".join(f'<link name="l{k}"/>' for k in range(1001))
    assert complaint(urdf, f"<robot>{links}</robot>") == [
        "arm.urdf: found 1001 links or joints, allowed: 1000 at most"
    ]
    assert complaint(urdf, f"<robot>\n<link name='{'a' * 10_001}'/></robot>") == [
        "arm.urdf:2: found an attribute of 10001 letters, allowed: 10000 at most"
    ]
    assert complaint(urdf, "<robot>" + " " * 10**7) == ["arm.urdf: found 10 MB, allowed: 10 MB at most"]


@pytest.mark.slow
def test_what_nests_deep_or_is_no_file_is_one_line(urdf: Any) -> None:
    assert complaint(urdf, "<robot>" + "<a>" * 10**5 + "</a>" * 10**5 + "</robot>") == [
        "arm.urdf: found no link; allowed: one root, or a base link chosen by name"
    ]
    assert refusal(RobotError, read_urdf, "a\0.urdf") == "found 'a\\x00.urdf', allowed: the name of a file"
    os.mkfifo("pipe.urdf")
    assert (
        refusal(RobotError, read_urdf, "pipe.urdf") == "pipe.urdf: found a pipe or a device, allowed: a file"
    )


def test_long_lists_of_links_are_cut_and_only_the_first_faults_ask(urdf: Any) -> None:
    links = [link(f"l{k:02}") for k in range(20)]
    assert complaint(urdf, robot(*links)) == [
        f"arm.urdf: found 20 root links: {', '.join(f'l{k:02}' for k in range(16))} and 4 others; allowed:"
        " one root, or a base link chosen by name"
    ]
    joints = [joint(f"j{k}", "l00", f"L{k:02}x") for k in range(20)]
    said = complaint(urdf, robot(*links, *joints, joint("last", "l00", "L19x")))
    assert sum("did you mean" in one for one in said) == 20
    assert said[20].endswith("joint last: child 'L19x'; allowed: a link of the file")


def test_a_file_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    assert (
        refusal(RobotError, read_urdf, tmp_path / "none.urdf")
        == f"{tmp_path / 'none.urdf'}: cannot be read: No such file or directory"
    )


def test_the_fingers_of_a_gripper(shared: Path) -> None:
    path = shared / "robots" / "Gepetto_example-robot-data" / "panda.urdf"
    assert refusal(RobotError, read_urdf, path) == (
        f"{path}: found panda_finger_joint2 on the arm beside the way to panda_leftfinger, as of a gripper;"
        " tip_link=LINK chooses one: panda_hand, panda_hand_tcp, panda_leftfinger,"
        " panda_rightfinger"
    )
    said = "joint panda_finger_joint2: mimics panda_finger_joint1, which is not on the chain"
    assert said in refusal(RobotError, read_urdf, path, tip_link="panda_rightfinger")


@pytest.mark.parametrize("encoding", ["gb2312", "no-such"])
def test_an_encoding_that_cannot_be_read_is_one_line(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?><robot name="a"/>', encoding="ascii")
    said = refusal(RobotError, read_urdf, path)
    assert said.startswith(f"{path}: cannot be decoded: ")
    assert said.endswith("; allowed: UTF-8")


def inertial(mass: float, moments: tuple[float, ...] = (0.1, 0.1, 0.1), origin: str = "") -> str:
    ixx, iyy, izz = moments
    inertia = f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/>'
    return f'<inertial>{origin}<mass value="{mass}"/>{inertia}</inertial>'


def test_each_link_of_the_chain_weighs_on_the_joint_that_carries_it(urdf: Any) -> None:
    quarter = '<origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/>'
    chain = urdf(robot(
        link("r", inertial(5.0)), link("a", inertial(2.0, (0.1, 0.2, 0.25), quarter)),
        link("plate", inertial(0.5)), link("b"), link("end", inertial(0.0, (0.0, 0.0, 0.0))),
        joint("j1", "r", "a"), joint("sensor", "a", "plate", "fixed", at("0 0 1")),
        joint("j2", "plate", "b"), joint("flange", "b", "end", "fixed"),
    ))  # fmt: skip
    ball = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)
    assert chain.inertials == (
        Inertial(None, 5.0, inertia=ball, source="link r"),
        Inertial("j1", 2.0, (0.1, 0.0, 0.0), (0.2, 0.1, 0.25, 0.0, 0.0, 0.0), "link a"),
        Inertial("sensor", 0.5, inertia=ball, source="link plate"),
    )
    assert chain.left_out == ()


def test_an_inertia_is_turned_by_the_rpy_of_its_origin(urdf: Any) -> None:
    turned = '<origin rpy="0.4 -0.7 1.9"/>'
    chain = urdf(robot(link("r"), link("a", inertial(1.0, (0.2, 0.3, 0.4), turned)), joint("j", "r", "a")))
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
    joint("stands", "floor", "r", "fixed", at("0 0 0.5")), joint("j1", "r", "a"), joint("j2", "a", "b"),
    joint("clip", "a", "cable", "fixed", at("0 0.1 0")),
    joint("plugged", "cable", "plug", "fixed", at("0 0 0.2")),
    joint("grips", "plug", "finger", "prismatic"), joint("grown", "finger", "nail", "fixed"),
    joint("hangs", "a", "light", "floating"),
    joint("rolls", "r", "wheel"), joint("lies", "r", "box", "fixed", at("1 0 0")),
)  # fmt: skip


def test_what_is_fixed_beside_the_chain_is_carried_and_what_moves_on_it_is_left_out(urdf: Any) -> None:
    chain = urdf(robot(*GRIPPING), tip_link="b")
    assert [(one.source, one.joint, one.centre) for one in chain.inertials] == [
        ("link floor", None, (0.0, 0.0, 0.0)),
        ("link box", "stands", (1.0, 0.0, 0.0)),
        ("link a", "j1", (0.0, 0.0, 0.0)),
        ("link cable", "j1", (0.0, 0.1, 0.0)),
        ("link plug", "j1", (0.0, 0.1, 0.2)),
        ("link b", "j2", (0.0, 0.0, 0.0)),
    ]
    assert chain.left_out == ("finger", "nail")


def test_links_beyond_the_tip_and_above_the_base_are_no_part_of_the_chain(urdf: Any) -> None:
    shorter = urdf(robot(*GRIPPING), base_link="r", tip_link="a")
    assert [one.source for one in shorter.inertials] == ["link box", "link a", "link cable", "link plug"]
    assert shorter.left_out == ("b", "finger", "nail")


def test_what_hangs_on_base_tip_and_tool_is_carried_by_the_joint_before(urdf: Any) -> None:
    chain = urdf(robot(
        link("w", inertial(1.0)), link("r", inertial(2.0)), link("a"), link("t", inertial(3.0)),
        link("e", inertial(4.0)), joint("urmpipe_base", "w", "r", "fixed", at("0 0 1")), joint("j", "r", "a"),
        joint("urmpipe_tip", "a", "t", "fixed", at("0.1 0 0")),
        joint("urmpipe_tool", "t", "e", "fixed", at("0.1 0 0")),
    ))  # fmt: skip
    assert [(one.joint, one.mass, one.centre) for one in chain.inertials] == [
        (None, 1.0, (0.0, 0.0, -1.0)), (None, 2.0, (0.0, 0.0, 0.0)),
        ("j", 3.0, (0.1, 0.0, 0.0)), ("j", 4.0, (0.2, 0.0, 0.0)),
    ]  # fmt: skip


def test_masses_that_are_not_right_are_not_used_and_say_why_with_link_and_line(urdf: Any) -> None:
    """The kinematics are read; nothing is said of what stands still or moves on its own."""
    chain = urdf(robot(
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
        joint("twice", "d", "h", "fixed"), joint("rolls", "r", "wheel")), tip_link="d")  # fmt: skip
    assert (chain.coordinates, chain.inertials, chain.left_out) == (("j1", "j2", "j3", "j4"), (), ("g",))
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
    assert list(chain.mass_faults) == faults
    assert refusal(RobotError, check_masses, chain).splitlines() == faults
    assert chain_from_dict(chain_to_dict(chain)) == chain


def test_the_hand_adds_to_the_flange_and_the_fingers_are_left_out(shared: Path) -> None:
    path = shared / "robots" / "Gepetto_example-robot-data" / "panda.urdf"
    chain = read_urdf(path, tip_link="panda_link8")
    hand = chain.inertials[-1]
    assert (hand.joint, hand.mass, hand.source) == ("panda_joint8", 0.73, "link panda_hand")
    c = -0.01 * math.sqrt(0.5)  # the hand is turned by -45 deg about z
    np.testing.assert_allclose(hand.centre, (c, -c, 0.03), rtol=1e-15)
    assert chain.left_out == ("panda_leftfinger", "panda_rightfinger")
    assert [one.effort for one in chain.moving] == [87.0] * 4 + [12.0] * 3


VISUAL_ARM = """<robot name="arm">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="root">
    <visual><geometry><box size="0.1 0.2 0.3"/></geometry><material name="grey"/></visual>
    <collision><geometry><sphere radius="9"/></geometry></collision>
  </link>
  <link name="a">
    <visual>
      <origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/>
      <geometry><cylinder radius="0.05" length="0.2"/></geometry>
      <material name="red"><color rgba="1 0 0 0.5"/></material>
    </visual>
    <visual><geometry><sphere radius="0.06"/></geometry><material name="red"/></visual>
  </link>
  <link name="flange">
    <visual><geometry><capsule radius="0.01" length="0.03"/></geometry><material name="unknown"/></visual>
  </link>
  <link name="hand">
    <visual><geometry><mesh filename="meshes/hand.stl" scale="0.001 0.001 -0.001"/></geometry></visual>
  </link>
  <link name="beside"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <joint name="j1" type="continuous">
    <parent link="root"/><child link="a"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="plate" type="fixed"><parent link="a"/><child link="flange"/><origin xyz="0 0 0.2"/></joint>
  <joint name="j2" type="continuous">
    <parent link="flange"/><child link="hand"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="arm_beside" type="fixed"><parent link="a"/><child link="beside"/></joint>
</robot>
"""


def test_the_links_of_the_chain_keep_what_they_show(urdf: Any, tmp_path: Path) -> None:
    turned = Transform(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), (0.0, 0.0, 0.1))
    assert urdf(VISUAL_ARM).visuals == (
        Visual(None, Box((0.1, 0.2, 0.3)), colour=(0.5, 0.5, 0.5, 1.0)),
        Visual("j1", Cylinder(0.05, 0.2), turned, (1.0, 0.0, 0.0, 0.5)),
        Visual("j1", Sphere(0.06), colour=(1.0, 0.0, 0.0, 0.5)),
        Visual("plate", Capsule(0.01, 0.03)),
        Visual("j2", Mesh(str(tmp_path / "meshes" / "hand.stl"), (0.001, 0.001, -0.001))),
    )


def test_the_base_link_carries_what_it_shows_wherever_the_chain_begins(urdf: Any) -> None:
    chain = urdf(VISUAL_ARM, base_link="a")
    assert [(visual.joint, type(visual.shape)) for visual in chain.visuals] == [
        (None, Cylinder), (None, Sphere), ("plate", Capsule), ("j2", Mesh),
    ]  # fmt: skip


def test_a_colour_is_a_material_s_own_or_that_of_its_name(urdf: Any, tmp_path: Path) -> None:
    """A colour left out is white, a scale 1; materials without a name have nothing in common."""
    shape = "<geometry><mesh filename='a.stl'/></geometry>"
    materials = [
        "<material name='m'><color rgba='1 0 0 1'/></material>",
        "<material name='m'><color rgba='0 2 -1 1'/></material>",
        "<material name='m'/>",
        "<material><color rgba='0 0 1 1'/></material>",
        "<material/>",
        "<material name='w'><color/></material>",
        "<material name='urmpipe'/>",
        "",
    ]
    visuals = "".join(f"<visual>{shape}{material}</visual>" for material in materials)
    joint = "<joint name='j' type='continuous'><parent link='b'/><child link='e'/></joint>"
    text = f"<robot name='r'><link name='b'>{visuals}</link><link name='e'/>{joint}</robot>"
    found = urdf(text).visuals
    red, green, blue, white = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0), (1.0,) * 4
    assert [one.colour for one in found] == [red, green, red, blue, None, white, None]
    assert {one.shape for one in found} == {Mesh(str(tmp_path / "a.stl"), (1.0, 1.0, 1.0))}


def test_what_is_wrong_with_a_visual_is_said_with_its_line(urdf: Any) -> None:
    wrong = [
        "<visual/>",
        "<visual><geometry><plane/><box size='1 1'/></geometry></visual>",
        "<visual><geometry><plane/></geometry></visual>",
        "<visual><geometry><sphere radius='1'/><plane/><box size='1 1 1'/></geometry></visual>",
        "<visual><geometry><sphere/></geometry></visual>",
        "<visual><geometry><cylinder radius='-1' length='x'/></geometry></visual>",
        "<visual><geometry><mesh filename='' scale='1'/></geometry><origin rpy='0'/></visual>",
        "<visual><geometry><sphere radius='1'/></geometry>"
        "<material name='m'><color rgba='1 1 1'/></material></visual>",
    ]
    joint = "<joint name='j' type='continuous'><parent link='b'/><child link='e'/></joint>"
    text = "\n".join(
        ["<robot name='r'><link name='b'>", *wrong, "</link><link name='e'/>", joint, "</robot>"]
    )
    assert complaint(urdf, text) == [
        "arm.urdf:2: link b: visual: found no shape; allowed: one of box, cylinder, capsule, sphere, mesh",
        "arm.urdf:3: link b: visual: box size: found '1 1', expected three numbers",
        "arm.urdf:4: link b: visual: found plane; allowed: one of box, cylinder, capsule, sphere, mesh",
        "arm.urdf:5: link b: visual: found sphere, plane, box; allowed: one of box, cylinder, capsule,"
        " sphere, mesh",
        "arm.urdf:6: link b: visual: sphere: no radius; allowed: one",
        "arm.urdf:7: link b: visual: cylinder radius: found -1; allowed: 0 or more",
        "arm.urdf:7: link b: visual: cylinder length: found 'x', expected a number",
        "arm.urdf:8: link b: visual: mesh scale: found '1', expected three numbers",
        "arm.urdf:8: link b: visual: mesh: no filename; allowed: one",
        "arm.urdf:8: link b: visual: origin rpy: found '0', expected three numbers",
        "arm.urdf:9: link b: visual: color rgba: found '1 1 1', expected four numbers",
    ]


def test_what_stands_beside_the_chain_is_not_looked_at(urdf: Any) -> None:
    text = VISUAL_ARM.replace('<box size="1 1 1"/>', "<plane/>")
    assert urdf(text).visuals == urdf(VISUAL_ARM).visuals
