"""What an arm looks like: read from URDF and robot files, and written back."""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

from asserting import refusal
from urmpipe_models.arm.chain import (
    Box,
    Capsule,
    Chain,
    Cylinder,
    Joint,
    Mesh,
    Shape,
    Sphere,
    Visual,
    resolve_mesh_path,
)
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import frames_over_log
from urmpipe_models.math3d import Transform, from_offset, translation
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict, read_robot_file, robot_toml
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import urdf_text, write_urdf

SAME = 1e-12
"""A frame that passes through angles and back errs by 1e-15."""

ARM = """<robot name="arm">
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


def arm(folder: Path, text: str = ARM) -> Path:
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_links_of_the_chain_keep_what_they_show(tmp_path: Path) -> None:
    turned = Transform(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), (0.0, 0.0, 0.1))
    assert read_urdf(arm(tmp_path)).visuals == (
        Visual(None, Box((0.1, 0.2, 0.3)), colour=(0.5, 0.5, 0.5, 1.0)),
        Visual("j1", Cylinder(0.05, 0.2), turned, (1.0, 0.0, 0.0, 0.5)),
        Visual("j1", Sphere(0.06), colour=(1.0, 0.0, 0.0, 0.5)),
        Visual("plate", Capsule(0.01, 0.03)),
        Visual("j2", Mesh(str(tmp_path / "meshes" / "hand.stl"), (0.001, 0.001, -0.001))),
    )


def test_the_base_link_carries_what_it_shows_wherever_the_chain_begins(tmp_path: Path) -> None:
    chain = read_urdf(arm(tmp_path), base_link="a")
    assert [(visual.joint, type(visual.shape)) for visual in chain.visuals] == [
        (None, Cylinder), (None, Sphere), ("plate", Capsule), ("j2", Mesh),
    ]  # fmt: skip


def test_a_colour_is_a_material_s_own_or_that_of_its_name(tmp_path: Path) -> None:
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
    found = read_urdf(arm(tmp_path, text)).visuals
    red, green, blue, white = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0), (1.0,) * 4
    assert [one.colour for one in found] == [red, green, red, blue, None, white, None]
    assert {one.shape for one in found} == {Mesh(str(tmp_path / "a.stl"), (1.0, 1.0, 1.0))}


def test_what_is_wrong_with_a_visual_is_said_with_its_line(tmp_path: Path) -> None:
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
    path = arm(tmp_path, text)
    assert refusal(RobotError, read_urdf, path).replace(str(path), "arm.urdf").splitlines() == [
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


def test_what_stands_beside_the_chain_is_not_looked_at(tmp_path: Path) -> None:
    text = ARM.replace('<box size="1 1 1"/>', "<plane/>")
    assert read_urdf(arm(tmp_path, text)).visuals == read_urdf(arm(tmp_path)).visuals


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
    with pytest.raises(RobotError) as caught:
        Chain("arm", (Joint("j"),), visuals=(Visual("k", Sphere(1.0)), Visual(None, Sphere(1.0))))
    assert str(caught.value) == "robot arm: a visual hangs on k, no joint of the chain; allowed: j"


# --- robot files -----------------------------------------------------------------------------------

sizes = st.floats(0.0, 2.0)
factors = st.floats(-2.0, 2.0)
shares = st.floats(0.0, 1.0)
SHAPES: SearchStrategy[Shape] = st.one_of(
    st.builds(Box, st.tuples(sizes, sizes, sizes)),
    st.builds(Cylinder, sizes, sizes),
    st.builds(Capsule, sizes, sizes),
    st.builds(Sphere, sizes),
    st.builds(
        Mesh,
        st.sampled_from(["file:///nowhere/a%20b.stl", "package://p/b & c.obj"]),
        st.tuples(factors, factors, factors),
    ),
)
ORIGINS = st.tuples(*(st.floats(-3.0, 3.0),) * 6).map(from_offset)
COLOURS = st.none() | st.tuples(shares, shares, shares, shares)


@st.composite
def shown(draw: DrawFn, chains: SearchStrategy[Chain]) -> Chain:
    """Draw a chain with visuals."""
    chain = draw(chains)
    carriers = st.sampled_from([None, *(joint.name for joint in chain.joints)])
    visuals = st.lists(st.builds(Visual, carriers, SHAPES, ORIGINS, COLOURS), max_size=4)
    return replace(chain, visuals=tuple(draw(visuals)))


@settings(deadline=None, max_examples=25)
@given(data=st.data())
def test_visuals_come_back_from_the_metadata_of_a_recording(
    chains: SearchStrategy[Chain], data: st.DataObject
) -> None:
    chain = data.draw(shown(chains))
    assert chain_from_dict(json.loads(json.dumps(chain_to_dict(chain)))) == chain


@pytest.mark.slow
@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_visuals_come_back_from_robot_files(
    chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    chain = data.draw(shown(chains.filter(lambda one: bool(one.name))))
    path = tmp_path / "arm.toml"
    path.write_text(robot_toml(chain), encoding="utf-8")
    assert read_robot_file(path) == chain


@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_visuals_come_back_from_urdf(
    chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    chain = data.draw(shown(chains))
    write_urdf(chain, tmp_path / "arm.urdf")
    found = {visual.joint: [] for visual in chain.visuals}  # type: dict[str | None, list[Visual]]
    for visual in read_urdf(tmp_path / "arm.urdf").visuals:
        found[visual.joint].append(visual)
    for joint, visuals in found.items():  # their order is kept on each link
        asked = [visual for visual in chain.visuals if visual.joint == joint]
        for one, other in zip(asked, visuals, strict=True):
            assert replace(one, origin=other.origin) == other
            np.testing.assert_allclose(one.origin.rotation, other.origin.rotation, rtol=0.0, atol=SAME)
            np.testing.assert_allclose(one.origin.translation, other.origin.translation, rtol=0, atol=SAME)


def test_an_arm_without_visuals_comes_back_without(tmp_path: Path) -> None:
    write_urdf(load_robot("urm6"), tmp_path / "urm6.urdf")
    assert "<cylinder" in (tmp_path / "urm6.urdf").read_text(encoding="utf-8")
    assert read_urdf(tmp_path / "urm6.urdf").visuals == ()
    assert "visuals" not in chain_to_dict(load_robot("urm6"))


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


def test_a_mesh_of_a_robot_file_is_looked_up_from_it(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(
        'kind = "joints"\nlength_unit = "mm"\n[[joints]]\nname = "j"\n'
        '[[visuals]]\nmesh = "a.stl"\nscale = [1, 2, 3]\n'
        '[[visuals]]\njoint = "j"\nbox = [100, 200, 300]\ncolour = [1, 0, 0, 1]\n'
        "origin = { translation = [10, 0, 0] }\n",
        encoding="utf-8",
    )
    assert read_robot_file(path).visuals == (
        Visual(None, Mesh(str(tmp_path / "a.stl"), (1.0, 2.0, 3.0))),
        Visual("j", Box((0.1, 0.2, 0.3)), translation(0.01, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0)),
    )
    path.write_text('kind = "joints"\n[[joints]]\nname = "j"\n[[visuals]]\nbox = [1, 1, 1]\nsphere = 1\n')
    with pytest.raises(RobotError) as caught:
        read_robot_file(path)
    said = "key visuals[0].box: found box and sphere, allowed: one of box, cylinder, capsule, sphere, mesh"
    assert str(caught.value) == f"{path}: {said}"


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
