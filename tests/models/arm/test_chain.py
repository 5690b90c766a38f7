"""The chain: its errors, its parameters, its masses, its meshes."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from scipy.spatial.transform import Rotation

from asserting import refusal
from urmpipe_models.arm.chain import (
    AXIS_TOLERANCE,
    GRAVITY,
    Box,
    Chain,
    Inertial,
    Joint,
    Mimic,
    Sphere,
    Visual,
    resolve_mesh_path,
)
from urmpipe_models.arm.denavit_hartenberg import (
    DHRow,
    GeometricModelRow,
    articulated_6r,
    dh_chain,
    geometric_chain,
    modified_dh_chain,
    urm_chain,
)
from urmpipe_models.drives import Drive, DrivenJoint, Gains, PassiveJoint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.math3d import Step, Transform, from_offset, rotation_x, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names


def test_coordinates_are_the_joints_that_move_by_themselves() -> None:
    follow = Joint("follow", mimic=Mimic("turn", 2.0))
    chain = Chain("arm", (Joint("mount", "fixed"), Joint("turn"), follow, Joint("slide", "prismatic")))
    assert chain.coordinates == ("turn", "slide")
    assert [joint.name for joint in chain.moving] == ["turn", "slide"]
    assert chain.start == (0.0, 0.0)
    assert chain.point_names == ("p1", "p2", "p3", "p4")


def test_placed_changes_base_and_tool_alone() -> None:
    chain = Chain("arm", (Joint("turn"),), tool=translation(0.0, 0.0, 0.1))
    base = translation(1.0, 2.0, 3.0)
    assert chain.placed(base).base == base
    assert chain.placed(base).tool == chain.tool
    assert chain.placed(tool=base) == Chain("arm", (Joint("turn"),), tool=base)
    assert chain.placed() == chain


def test_everything_wrong_is_said_at_once() -> None:
    joints = (
        Joint("a", axis=(0.0, 0.0, 2.0)),
        Joint("b", lower=1.0, upper=-1.0, velocity=0.0, acceleration=-1.0),
        Joint("b"),
        Joint("c", mimic=Mimic("d")),
    )
    assert refusal(RobotError, Chain, "arm", joints, start=(0.0,)).splitlines() == [
        "robot arm: joint names repeat: b; allowed: each once",
        "robot arm: joint a: axis [0.0, 0.0, 2.0] has length 2; allowed: 1",
        "robot arm: joint b: lower limit 1 above upper -1",
        "robot arm: joint b: velocity 0; allowed: more than 0",
        "robot arm: joint b: acceleration -1; allowed: more than 0",
        "robot arm: joint c mimics d, no moving joint of the chain; allowed: a, b, b",
        "robot arm: start has 1 values; allowed: 3, one a coordinate",
    ]


def test_limits_may_meet_a_rate_may_be_small_and_an_axis_may_be_rounded() -> None:
    held = Joint("held", lower=0.5, upper=0.5, velocity=1e-9, acceleration=1e-9)
    for length in (1.0 - 0.9 * AXIS_TOLERANCE, 1.0 + 0.9 * AXIS_TOLERANCE):
        assert Chain("arm", (held, Joint("turn", axis=(0.0, length, 0.0)))).coordinates == ("held", "turn")
    for length in (1.0 - 1.1 * AXIS_TOLERANCE, 1.0 + 1.1 * AXIS_TOLERANCE):
        with pytest.raises(RobotError, match=r"joint turn: axis \[.*\] has length 1; allowed: 1$"):
            Chain("arm", (Joint("turn", axis=(0.0, length, 0.0)),))


def test_limits_and_speeds_that_are_no_numbers_are_refused() -> None:
    joints = Joint("a", lower=math.nan), Joint("b", upper=math.nan), Joint("c", velocity=math.nan)
    more = Joint("d", acceleration=math.nan)
    assert refusal(RobotError, Chain, "arm", (*joints, more)).splitlines() == [
        "robot arm: joint a: lower limit nan above upper inf",
        "robot arm: joint b: lower limit -inf above upper nan",
        "robot arm: joint c: velocity nan; allowed: more than 0",
        "robot arm: joint d: acceleration nan; allowed: more than 0",
    ]


def test_a_chain_without_a_moving_joint_is_none() -> None:
    said = "robot rod: has no moving joint; at least one is needed"
    assert refusal(RobotError, Chain, "rod", (Joint("a", "fixed"),)) == said


@pytest.mark.parametrize("far", [1e7, -math.inf, math.nan])
def test_frames_that_cannot_be_computed_with_are_refused(far: float) -> None:
    frame = translation(0.0, far, 0.0)
    assert refusal(RobotError, Chain, "arm", (Joint("j", origin=frame),), frame).splitlines() == [
        f"robot arm: {name} stands at [0.0, {far}, 0.0] m; allowed: 1e+06 m at most"
        for name in ("the tip", "joint j")
    ]


def test_a_chain_shows_itself_by_its_coordinates_and_a_row_a_joint() -> None:
    joints = (Joint("a<b", lower=-1.5, upper=2.0), Joint("c", "prismatic"), Joint("d", "fixed"))
    chain = Chain("arm", joints, description="a test")
    assert repr(chain) == "<Chain arm: a test, 2 coordinates (a<b, c)>"
    assert chain._repr_html_() == (
        "<p><b>Chain</b> arm: a test, 2 coordinates (a&lt;b, c)</p>"
        "<table><tr><th>joint</th><th>kind</th><th>lower</th><th>upper</th></tr>"
        "<tr><td>a&lt;b</td><td>revolute</td><td>-1.5</td><td>2</td></tr>"
        "<tr><td>c</td><td>prismatic</td><td>-inf</td><td>inf</td></tr>"
        "<tr><td>d</td><td>fixed</td><td>-inf</td><td>inf</td></tr></table>"
    )
    assert repr(Chain("rod", (Joint("a"),))) == "<Chain rod: 1 coordinate (a)>"


BASE = ["base.x", "base.y", "base.z", "base.rz", "base.ry", "base.rx"]
TOOL = ["tool.x", "tool.y", "tool.z", "tool.rz", "tool.ry", "tool.rx"]

URDFS = {
    "FancySafeBot_fsb-library/lbr_iiwa7_r800.urdf": None,
    "FancySafeBot_fsb-library/panda.urdf": "panda_hand",
    "FancySafeBot_fsb-library/ur5.urdf": "tool0",
    "Gepetto_example-robot-data/panda.urdf": "panda_hand_tcp",
    "Gepetto_example-robot-data/ur10_robot.urdf": "tool0",
    "Gepetto_example-robot-data/ur3_robot.urdf": "tool0",
    "Gepetto_example-robot-data/ur5_robot.urdf": "tool0",
    "ros-industrial_kuka_experimental/lbr_iiwa_14_r820.urdf": None,
}
"""The URDFs beside this repository, with the link that ends the arm where its file leaves a choice."""


def bits(chain: Chain) -> bytes:
    """Every number of the frames: == takes 0.0 and -0.0 for the same."""
    numbers = [[*frame.translation, *(x for row in frame.rotation for x in row)] for frame in chain.frames]
    return np.array(numbers, dtype=float).tobytes()


def names_of(chain: Chain) -> list[str]:
    return [one.name for one in chain.parameters]


def values_of(chain: Chain) -> dict[str, float]:
    return {one.name: one.value for one in chain.parameters}


def rebuilds_itself(chain: Chain) -> None:
    again = chain.with_parameters(values_of(chain))
    assert again == chain
    assert bits(again) == bits(chain)
    assert values_of(again) == values_of(chain)


@pytest.mark.parametrize("name", robot_names())
def test_a_robot_with_its_own_values_is_the_same_bit_by_bit(name: str) -> None:
    rebuilds_itself(load_robot(name))


@pytest.mark.parametrize("file", URDFS)
def test_a_urdf_with_its_own_values_is_the_same_bit_by_bit(shared: Path, file: str) -> None:
    chain = load_robot(shared / "robots" / file, tip_link=URDFS[file])
    rebuilds_itself(chain)
    first = chain.joints[0].name
    assert chain.parameters[6].name == f"{first}.x"
    assert chain.parameters[6].source == f"URDF joint {first}"


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_a_frame_is_what_stands_before_a_parameter_its_motion_and_what_stands_after(
    chains: SearchStrategy[Chain], data: st.DataObject
) -> None:
    chain = data.draw(chains)
    assert len(set(names_of(chain))) == len(chain.parameters)
    for one in chain.parameters:
        frame = chain.frames[one.frame_index]
        again = one.before @ Step(one.kind, one.axis, one.value).frame @ one.after
        np.testing.assert_allclose(again.rotation, frame.rotation, rtol=0.0, atol=1e-15)  # of another order
        np.testing.assert_allclose(again.translation, frame.translation, rtol=0.0, atol=1e-15)


def test_names_and_sources_are_those_of_the_description() -> None:
    urm = urm_chain("two", (0.3, 0.2, 0.1), (0.5, -0.7))
    assert names_of(urm) == [*BASE, "r1", "theta2", "r2", "theta3", "r3", *TOOL]
    found = [(one.place, one.source, one.unit, one.value) for one in urm.parameters[6:11]]
    assert found == [
        ("phi2", "URM segment", "m", 0.3),
        ("phi2", "URM tilt", "rad", 0.5),
        ("effector", "URM segment", "m", 0.2),
        ("effector", "URM tilt", "rad", -0.7),
        ("tip", "URM segment", "m", 0.1),
    ]
    rows = [DHRow(name="turn"), DHRow(kind="prismatic")]
    dh = dh_chain("two", rows).parameters[6:14]
    assert " ".join(one.name for one in dh) == "theta_1 d_1 a_1 alpha_1 theta_2 d_2 a_2 alpha_2"
    assert [(one.place, one.source) for one in dh[3:5]] == [("q2", "DH row 1"), ("tip", "DH row 2")]
    craig = modified_dh_chain("two", rows).parameters[6:14]
    assert " ".join(one.name for one in craig) == "a_1 alpha_1 theta_1 d_1 a_2 alpha_2 theta_2 d_2"
    assert [(one.place, one.source) for one in craig[3:5]] == [("turn", "DH row 1"), ("q2", "DH row 2")]
    assert names_of(articulated_6r(0.1, 0.2, 0.3, 0.4, 0.05))[6:-6] == ["l0", "l1", "l2", "l3", "l4"]
    shifts = geometric_chain("one", [GeometricModelRow("T", "y")])
    assert names_of(shifts)[6:-6] == ["r1.x", "r1.y", "r1.z", "r2.x", "r2.y", "r2.z"]


def test_a_joint_called_base_or_tool_has_names_of_its_own() -> None:
    names = names_of(Chain("arm", (Joint("base"), Joint("tool"))))
    assert names[:7] == [*BASE, "base.x'"]
    assert names[12:13] == ["tool.x"]
    assert names[-6:] == [f"{one}'" for one in TOOL]


def test_a_frame_of_numbers_alone_turns_after_its_rotation() -> None:
    turned = rotation_x(0.5)
    tool = Transform(turned.rotation, (0.1, 0.2, 0.3))
    arm = Chain("arm", (Joint("a"),)).placed(tool=tool)
    assert [one.value for one in arm.parameters[-6:]] == [0.1, 0.2, 0.3, 0.0, 0.0, 0.0]
    assert arm.parameters[-1].before == tool
    changed = arm.with_parameters({"tool.x": 0.7, "tool.rx": 0.25})
    assert changed.tool.translation == (0.7, 0.2, 0.3)
    np.testing.assert_allclose(changed.tool.rotation, rotation_x(0.75).rotation, rtol=0.0, atol=1e-15)
    assert values_of(changed)["tool.rx"] == 0.25
    assert changed.with_parameters({"tool.rx": 0.0, "tool.x": 0.1}) == arm


def test_the_rest_of_the_arm_stays() -> None:
    arm = load_robot("urm6").placed(from_offset((1.0, 2.0, 3.0)))
    assert [one.value for one in arm.parameters[:3]] == [1.0, 2.0, 3.0]
    limited = replace(arm, joints=(replace(arm.joints[0], lower=-1.0), *arm.joints[1:]))
    changed = limited.with_parameters({"r3": 0.25})
    assert replace(changed, joints=limited.joints) == limited
    (moved,) = [k for k, joint in enumerate(changed.joints) if joint != limited.joints[k]]
    assert replace(changed.joints[moved], origin=limited.joints[moved].origin) == limited.joints[moved]
    assert limited.with_parameters({}) == limited


def test_every_unknown_name_is_told() -> None:
    arm, values = articulated_6r(0.1, 0.2, 0.3, 0.4, 0.05), {"l0": 0.2, "L_1": 0.2, "tool.w": 0.1}
    one, other = refusal(RobotError, arm.with_parameters, values).splitlines()
    assert one.startswith("robot articulated6r: parameter: found 'L_1' (did you mean l1?), allowed: l1, ")
    assert other.startswith(
        "robot articulated6r: parameter: found 'tool.w' (did you mean tool.z?), allowed: "
    )


DESCRIBED: dict[str, tuple[Callable[..., Chain], str]] = {
    "urm": (lambda *v: urm_chain("a", v[:3], v[3:5]), "r1 r2 r3 theta2 theta3"),
    "dh": (lambda *v: dh_chain("a", [DHRow(*v[:4]), DHRow(0.1, v[4])]), "theta_1 d_1 a_1 alpha_1 d_2"),
    "modified_dh": (
        lambda *v: modified_dh_chain("a", [DHRow(*v[:4]), DHRow(0.1, v[4])]),
        "theta_1 d_1 a_1 alpha_1 d_2",
    ),
    "articulated_6r": (articulated_6r, "l0 l1 l2 l3 l4"),
    "geometric": (
        lambda *v: geometric_chain("a", [GeometricModelRow("R", "y", v[:3])], tip=(v[3], v[4], 0.1)),
        "r1.x r1.y r1.z r2.x r2.y",
    ),
}


@pytest.mark.parametrize("kind", DESCRIBED)
@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=5, max_size=5),
    st.lists(st.floats(-2.0, 2.0), min_size=5, max_size=5),
)
def test_other_values_make_the_arm_that_they_describe(
    kind: str, values: Sequence[float], others: Sequence[float]
) -> None:
    made, names = DESCRIBED[kind]
    found = made(*values).with_parameters(dict(zip(names.split(), others, strict=True)))
    assert found == made(*others)
    assert bits(found) == bits(made(*others))


FILES = {
    "arm.urdf": (
        '<robot name="arm"><link name="a"/><link name="b"/><joint name="elbow" type="revolute">'
        '<parent link="a"/><child link="b"/>'
        '<origin xyz="0.1 {length} 0.3" rpy="0.4 {angle} 0.6"/></joint></robot>'
    ),
    "arm.toml": (
        'kind = "joints"\nname = "arm"\njoints = [{{ name = "elbow", origin = {{'
        " translation = [0.1, {length}, 0.3], rpy = [0.4, {angle}, 0.6] }} }}]\n"
    ),
}


@pytest.mark.parametrize("file", FILES)
def test_other_values_make_the_arm_of_a_changed_file(tmp_path: Path, file: str) -> None:
    path = tmp_path / file
    path.write_text(FILES[file].format(length=0.2, angle=0.5), encoding="utf-8")
    found = load_robot(path).with_parameters({"elbow.y": 0.25, "elbow.ry": -0.5})
    path.write_text(FILES[file].format(length=0.25, angle=-0.5), encoding="utf-8")
    assert (found, values_of(found)) == (load_robot(path), values_of(load_robot(path)))
    assert bits(found) == bits(load_robot(path))


def test_values_may_be_arrays() -> None:
    lengths: FloatArray = np.linspace(0.1, 0.4, 4)
    arm = load_robot("urm4")
    tcp = forward(arm.with_parameters({"r2": lengths}), arm.start)[-1].translation
    for k, length in enumerate(lengths.tolist()):
        one = forward(arm.with_parameters({"r2": length}), arm.start)[-1].translation
        np.testing.assert_allclose([np.broadcast_to(x, 4)[k] for x in tcp], one, rtol=0.0, atol=1e-15)


BALL = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)


def test_a_mass_alone_is_a_point_at_the_origin_of_its_frame() -> None:
    point = Inertial("j", 2.0)
    assert (point.centre, point.inertia, point.source) == ((0.0, 0.0, 0.0), (0.0,) * 6, "")
    assert (point.place, Inertial(None, 2.0).place) == ("joint j", "the base")
    assert Chain("arm", (Joint("j"),), inertials=(point,)).gravity == GRAVITY == (0.0, 0.0, -9.81)


@pytest.mark.parametrize(
    ("mass", "inertia", "fault"),
    [
        (-1.0, (0.0,) * 6, "inertial on joint j: mass -1 kg; allowed: 0 or more"),
        (0.0, BALL, "inertial on joint j: mass 0 with an inertia; allowed: a mass, or no inertia"),
        (
            1.0,
            (-0.1, 0.1, 0.1, 0.0, 0.0, 0.0),
            "inertial on joint j: principal moments -0.1, 0.1, 0.1 kg.m2; allowed: 0 or more",
        ),
        (
            1.0,
            (0.1, 0.1, 0.3, 0.0, 0.0, 0.0),
            "inertial on joint j: principal moments 0.1, 0.1, 0.3 kg.m2; allowed: none above the sum of the"
            " other two",
        ),
    ],
)
def test_masses_that_no_body_has_are_refused(
    mass: float, inertia: tuple[float, float, float, float, float, float], fault: str
) -> None:
    assert list(Inertial("j", mass, inertia=inertia).faults()) == [fault]


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([3, 4, 6]), st.sampled_from(["rod", "plate", "point"]))
def test_a_body_that_was_turned_and_printed_with_few_digits_is_a_body(
    seed: int, digits: int, what: str
) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.5, 1.0, 2)
    moments = {"rod": (0.0, a, a), "plate": (a, b, a + b), "point": (0.0, 0.0, 0.0)}[what]
    turn = Rotation.random(rng=rng).as_matrix()
    matrix = turn @ np.diag(moments) @ turn.T + 1e-20 * rng.normal()
    printed = [
        float(f"{matrix[i, k]:.{digits}g}")
        for i, k in zip((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2), strict=True)
    ]
    ixx, iyy, izz, ixy, ixz, iyz = printed
    assert list(Inertial("j", 1.0, inertia=(ixx, iyy, izz, ixy, ixz, iyz)).faults()) == []


def test_a_chain_says_all_that_is_wrong_with_masses_and_drives_at_once() -> None:
    drive = Drive(2500.0, 5.0, 100.0, 0.0, 0.5, 0.001, 0.5)
    inertials = (Inertial("j", -1.0), Inertial("k", 1.0), Inertial(None, 0.0, inertia=BALL))
    drives = (
        PassiveJoint("j", 0.0, -1.0),
        DrivenJoint("j", drive, 0.005, Gains(1.0, float("nan"), 0.0), 48.0),
        PassiveJoint("frame", 1.0, 0.0),
    )
    joints = (Joint("j", effort=-2.0), Joint("frame", "fixed"))
    said = refusal(RobotError, Chain, "arm", joints, inertials=inertials, drives=drives)
    assert said.splitlines() == [
        "robot arm: joint j: effort -2; allowed: more than 0",
        "robot arm: inertial on joint j: mass -1 kg; allowed: 0 or more",
        "robot arm: inertial on the base: mass 0 with an inertia; allowed: a mass, or no inertia",
        "robot arm: an inertial hangs on k, no joint of the chain; allowed: j, frame",
        "robot arm: drives.j.k: found 0, allowed: a finite number, 1e-09 or more",
        "robot arm: drives.j.l: found -1, allowed: a finite number, 0 or more",
        "robot arm: drives.j.C: found 0, allowed: a finite number, 1e-09 or more",
        "robot arm: drives.j.Kw: found nan, allowed: a finite number",
        "robot arm: drives.frame: found a drive for it, allowed: a joint with a coordinate: j",
        "robot arm: drives.j: found 2 times, allowed: once",
    ]


def test_numbers_that_are_not_finite_and_fixed_mimics_are_refused() -> None:
    nan, inf = float("nan"), float("inf")
    joints = (Joint("j"), Joint("held", "fixed", mimic=Mimic("j")))
    inertials = (Inertial("j", inf), Inertial(None, 1.0, (0.0, 0.0, nan), (1.0,) * 6))
    said = refusal(RobotError, Chain, "arm", joints, gravity=(0.0, nan, -9.81), inertials=inertials)
    odd, zeros, ones = "found a number that is not finite in", ", ".join(["0.0"] * 9), ", ".join(["1.0"] * 6)
    assert said.splitlines() == [
        "robot arm: joint held: is fixed and mimics j; allowed: one of the two",
        f"robot arm: inertial on joint j: {odd} [inf, {zeros}]; allowed: finite",
        f"robot arm: inertial on the base: {odd} [1.0, 0.0, 0.0, nan, {ones}]; allowed: finite",
        "robot arm: gravity [0.0, nan, -9.81]; allowed: finite numbers",
    ]


def package(folder: Path) -> Path:
    """Make a ROS package."""
    folder.mkdir(parents=True)
    (folder / "package.xml").touch()
    return folder


def test_meshes_are_looked_up_from_the_description(tmp_path: Path) -> None:
    ws = tmp_path / "ws"
    folder = package(ws / "my_arm") / "urdf"
    (folder / "tools").mkdir(parents=True)
    package(ws / "other")
    assert resolve_mesh_path("meshes/a.stl", folder) == f"{folder}/meshes/a.stl"
    assert resolve_mesh_path(f"{folder}/a.stl", folder) == f"{folder}/a.stl"
    assert resolve_mesh_path(f"file://{ws}/my_arm/urdf/a%20b.stl", folder) == f"{folder}/a b.stl"
    assert resolve_mesh_path("../meshes/a.stl", folder) == f"{folder}/../meshes/a.stl"
    assert resolve_mesh_path("package://my_arm/meshes/a.stl", folder) == f"{ws}/my_arm/meshes/a.stl"
    assert resolve_mesh_path("package://other/meshes/a.stl", folder) == f"{ws}/other/meshes/a.stl"
    assert resolve_mesh_path("package://tools/a.stl", folder) == f"{folder}/tools/a.stl"
    for gone in ("package://nowhere/a.stl", "package://", "package://../a.stl", "package://./a.stl"):
        assert resolve_mesh_path(gone, folder) == gone
    assert resolve_mesh_path("a\0.stl", folder) == "a\0.stl"
    assert resolve_mesh_path("https://example.org/a.stl", folder) == f"{folder}/https:/example.org/a.stl"


def test_a_description_takes_no_mesh_from_elsewhere_unless_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither by its path nor by steps up, links, links in a circle, or a folder that is no ROS package."""
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    home, folder = tmp_path / "home", tmp_path / "home" / "my_arm"
    folder.mkdir(parents=True)
    kept = package(tmp_path / "kept")
    for name in ("a.stl", "b c.stl"):
        (home / name).touch()
        (kept / name).touch()
    (folder / "link.stl").symlink_to(home / "a.stl")
    (folder / "there").symlink_to(home)
    (folder / "circle.stl").symlink_to(folder / "circle.stl")
    url = home.as_uri()
    asked = {
        "../a.stl": f"{url}/my_arm/../a.stl",
        f"{home}/b c.stl": f"{url}/b%20c.stl",
        f"{url}/b%20c.stl": f"{url}/b%20c.stl",
        "link.stl": f"{url}/my_arm/link.stl",
        "there/a.stl": f"{url}/my_arm/there/a.stl",
        "circle.stl": f"{url}/my_arm/circle.stl",
        "package://home/a.stl": f"{url}/a.stl",
        "package://there/a.stl": f"{url}/my_arm/there/a.stl",
        "package://kept/../home/a.stl": f"{kept.as_uri()}/../home/a.stl",
    }
    assert {one: resolve_mesh_path(one, folder) for one in asked} == asked
    assert resolve_mesh_path("package://kept/a.stl", folder) == f"{kept}/a.stl"

    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'gone'}{os.pathsep}{home}{os.pathsep}")
    assert resolve_mesh_path("../a.stl", folder) == f"{folder}/../a.stl"
    assert resolve_mesh_path(f"{url}/b%20c.stl", folder) == f"{home}/b c.stl"
    assert resolve_mesh_path("package://there/a.stl", folder) == f"{folder}/there/a.stl"
    assert resolve_mesh_path("circle.stl", folder) == f"{url}/my_arm/circle.stl"
    far = tmp_path / "far"
    assert resolve_mesh_path("package://my_arm/a.stl", far) == f"{folder}/a.stl"


def test_a_visual_hangs_on_a_joint_of_the_chain() -> None:
    visuals = (Visual("k", Sphere(1.0)), Visual(None, Sphere(1.0)))
    said = "robot arm: a visual hangs on k, no joint of the chain; allowed: j"
    assert refusal(RobotError, Chain, "arm", (Joint("j"),), visuals=visuals) == said


@pytest.mark.parametrize(
    ("visual", "said"),
    [
        (Visual(None, Sphere(-1.0)), "a sphere of negative size -1; allowed: 0 or more"),
        (Visual(None, Box((1.0, -2.0, 3.0))), "a box of negative size -2; allowed: 0 or more"),
        (
            Visual(None, Sphere(1.0), colour=(255.0, 0.0, 0.0, 1.0)),
            "colour 255, 0, 0, 1; allowed: shares from 0 to 1",
        ),
    ],
)
def test_what_no_shape_can_have_is_refused(visual: Visual, said: str) -> None:
    assert refusal(RobotError, Chain, "arm", (Joint("j"),), visuals=(visual,)) == f"robot arm: {said}"
