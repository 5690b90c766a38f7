"""`urmpipe robot` as a user runs it."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import chain_from_dict
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import write_urdf
from urmpipe_pipeline.presentation.palette import MASS_COLOUR
from urmpipe_pipeline.presentation.projections import (
    FRONT,
    SIDEWAYS,
    Sketch,
    draw_projections,
    label_skeleton,
)

NAMES = list(robot_names())


def skeleton(name: str) -> Any:
    chain = load_robot(name)
    return points_over_log(chain, np.array([chain.start]))[0]


# --- list ------------------------------------------------------------------------------------------


def test_list_names_every_robot(urmpipe: Any) -> None:
    ran = urmpipe("robot", "list")
    assert (ran.code, ran.err) == (0, "")
    for name in NAMES:
        assert f" {name} " in ran.out
        assert load_robot(name).description in ran.out


def test_list_as_json(urmpipe: Any) -> None:
    answer = json.loads(urmpipe("robot", "list", "--json").out)
    assert answer["schema"] == 1
    assert [robot["name"] for robot in answer["robots"]] == NAMES
    assert answer["robots"][NAMES.index("urm4")]["joints"] == ["phi1", "phi2", "phi3", "phi4"]


# --- show ------------------------------------------------------------------------------------------


def test_show_prints_parameters_and_points(urmpipe: Any) -> None:
    ran = urmpipe("robot", "show", "urm6")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("urm6: URM arm of 6 modules: the paper's\n")
    (phi2,) = [" ".join(line.split()) for line in ran.out.splitlines() if " phi2 " in line[:9]]
    assert phi2 == "phi2 revolute 0, 0, 1 no limit no limit 180 deg"
    (theta2,) = [" ".join(line.split()) for line in ran.out.splitlines() if " theta2 " in line]
    assert theta2 == "theta2 52 deg about y phi2 URM tilt"
    assert "Parameters; 12 of value 0 not shown" in ran.out
    assert "p7      0.167397, 0, 1.10264   180, 0, 0" in ran.out
    assert "\x1b" not in ran.out  # no colours in a pipe


def test_show_tells_what_limits_rates(urmpipe: Any, tmp_path: Path) -> None:
    turn = '{ name = "turn", velocity = 90, acceleration = 360 }'
    slide = '{ name = "slide", kind = "prismatic", upper = 0.5, acceleration = 2.5 }'
    text = f'kind = "joints"\nangle_unit = "deg"\njoints = [{turn}, {slide}]\n'
    (tmp_path / "arm.toml").write_text(text, encoding="utf-8")
    lines = [" ".join(line.split()) for line in urmpipe("robot", "show", "arm.toml").out.splitlines()]
    assert "turn revolute 0, 0, 1 no limit 90 deg/s 360 deg/s² 0 deg" in lines
    assert "slide prismatic 0, 0, 1 -inf .. 0.5 m no limit 2.5 m/s² 0 m" in lines
    joints = json.loads(urmpipe("robot", "show", "arm.toml", "--json").out)["joints"]
    assert [(one["velocity"], one["acceleration"]) for one in joints] == [
        (math.pi / 2, 2 * math.pi), (None, 2.5),
    ]  # fmt: skip


HEAVY = """
kind = "joints"
gravity = [0, 9.81, 0]
left_out = ["finger"]
joints = [{ name = "turn", effort = 150 }, { name = "slide", kind = "prismatic", effort = 20.5 }]
inertials = [
    { mass = 1.5 },
    { joint = "turn", mass = 2, centre = [0, 0, 0.1], inertia = [2, 2, 3, 1, 0, 0], source = "CAD" },
]
drives.turn = { k = 2500, l = 5, i_p = 100, C = 0.05, R = 0.5, L = 0.001, I1 = 0.5, period = 0.005, \
Kphi = 7.5, Kw = 0.75, Keps = 0.01, u_max = 48 }
drives.slide = { k = 3000, l = 0 }
""".replace("\\\n", "")


def test_show_tells_masses_gravity_efforts_and_drives(urmpipe: Any, tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(HEAVY, encoding="utf-8")
    ran = urmpipe("robot", "show", "arm.toml")
    assert (ran.code, ran.err) == (
        0, "warning: the mass of finger is left out: this link moves by a joint outside the chain\n",
    )  # fmt: skip
    lines = [" ".join(line.split()) for line in ran.out.splitlines()]
    assert "Gravity: 0, 9.81, 0 m/s²" in lines
    assert "turn revolute 0, 0, 1 no limit no limit 150 N.m 0 deg" in lines
    assert "slide prismatic 0, 0, 1 no limit no limit 20.5 N 0 m" in lines
    first = lines.index("Masses; 3.5 kg in all")
    assert lines[first + 2] == "Joint Mass [kg] Centre x, y, z [m] Principal moments [kg.m²] Source"
    assert lines[first + 4] == "base 1.5 0, 0, 0 0, 0, 0"
    assert lines[first + 5] == "turn 2 0, 0, 0.1 1, 3, 3 CAD"
    assert "slide held k = 3000, l = 0" in lines
    first = lines.index("Drives; constants in SI")
    assert " ".join(lines[first + 4 : first + 6]) == (
        "turn driven k = 2500, l = 5, i_p = 100, C = 0.05, R = 0.5, L = 0.001, I1 = 0.5, period = 0.005,"
        " Kphi = 7.5, Kw = 0.75, Keps = 0.01, u_max = 48"
    )
    answer = json.loads(urmpipe("robot", "show", "arm.toml", "--json").out)
    assert (answer["gravity"], answer["left_out"]) == ([0.0, 9.81, 0.0], ["finger"])
    assert answer["inertials"][0] == {"mass": 1.5, "centre": [0.0] * 3, "inertia": [0.0] * 6}
    assert answer["drives"]["slide"] == {"k": 3000.0, "l": 0.0}
    light = urmpipe("robot", "show", "urm6").out
    assert not any(word in light for word in ("Gravity", "Masses", "Effort", "Drives"))


def test_show_as_json_is_the_chain_and_its_points(urmpipe: Any) -> None:
    ran = urmpipe("robot", "show", "ur5e", "--q", "0,0,0,0,0,0", "--tool", "0,0,0.1", "--json")
    answer = json.loads(ran.out)
    assert (answer["schema"], answer["name"], answer["q"]) == (1, "ur5e", [0.0] * 6)
    np.testing.assert_allclose(answer["points"]["p6"]["position"], [-0.8172, -0.3329, 0.0628], atol=1e-15)
    np.testing.assert_allclose(answer["points"]["p1"]["euler_zyx"], [0.0, 0.0, 0.0], atol=1e-15)
    described = {key: answer[key] for key in ("kind", "name", "joints", "base", "tip", "tool", "start")}
    assert chain_from_dict(described).joints == load_robot("ur5e").joints
    parameters = {one["name"]: one for one in answer["parameters"]}
    assert (parameters["d_1"]["value"], parameters["tool.z"]["value"]) == (0.1625, 0.1)
    assert parameters["alpha_1"] == {
        "name": "alpha_1", "value": np.pi / 2, "unit": "rad", "kind": "about", "axis": "x",
        "place": "shoulder_lift_joint", "source": "DH row 1",
    }  # fmt: skip


def test_show_tells_the_rotation_of_a_matrix(urmpipe: Any, tmp_path: Path) -> None:
    rows = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    tip = f"{{ translation = [0, 0, 1], rotation = {rows} }}"
    text = f'kind = "joints"\njoints = [{{ name = "a" }}]\ntip = {tip}\n'
    (tmp_path / "arm.toml").write_text(text, encoding="utf-8")
    lines = [" ".join(line.split()) for line in urmpipe("robot", "show", "arm.toml").out.splitlines()]
    assert "tip.z 1 m along z tip frame" in lines
    assert "90, 0, 0 deg about x, y, z tip constant" in lines


def test_show_draws_a_picture_and_replaces_only_its_own(urmpipe: Any, tmp_path: Path) -> None:
    picture = tmp_path / "urm6.svg"
    assert urmpipe("robot", "show", "urm6", "--picture", picture.name, "-q").out == ""
    assert ET.parse(picture).getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert urmpipe("robot", "show", "urm4", "--picture", picture.name).code == 0
    assert "urm4" in picture.read_text(encoding="utf-8")
    picture.write_text("mine", encoding="utf-8")
    ran = urmpipe("robot", "show", "urm6", "--picture", picture.name)
    assert ran.code == 2
    assert ran.err == (
        "error: urm6.svg: found a file that is not a robot export of urmpipe, allowed: a new name, or such an"
        " export to replace\n"
    )
    assert picture.read_text(encoding="utf-8") == "mine"


def test_a_picture_has_the_mass_centres(urmpipe: Any, tmp_path: Path) -> None:
    for name, dots in (("ur10", True), ("urm6", False)):
        assert urmpipe("robot", "show", name, "--picture", f"{name}.svg", "-q").code == 0
        drawn = (tmp_path / f"{name}.svg").read_text(encoding="utf-8")
        assert ("mass centres, as large as balls of one density: " in drawn) == dots
        assert (MASS_COLOUR in drawn) == dots


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["urm7"], "error: unknown robot 'urm7' (did you mean urm8?); allowed: " + ", ".join(NAMES)),
        (
            ["urm4", "--q", "1,2"],
            "error: q: found 2 values, allowed: 4, one for each of phi1, phi2, phi3, phi4",
        ),
        (
            ["urm4", "--tip", "x"],
            "error: robot urm4: found a base or tip link, allowed only for a .urdf file",
        ),
        (
            ["urm4", "--base", "1"],
            "error: base (--base): found '1', allowed: X,Y,Z or X,Y,Z,RX,RY,RZ in m and rad",
        ),
        (["arm.urdf"], "error: arm.urdf: cannot be read: No such file or directory"),
    ],
)
def test_show_errors_are_one_line(urmpipe: Any, arguments: list[str], said: str) -> None:
    ran = urmpipe("robot", "show", *arguments)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith(said)
    assert ran.err.count("\n") == 1


def test_joint_values_that_are_none_are_usage(urmpipe: Any) -> None:
    ran = urmpipe("robot", "show", "urm4", "--q", "1,2,x,4")
    assert ran.code == 2
    assert (
        "found '1,2,x,4', allowed: joint values in rad and m, or with units, such as 0,180deg,500mm"
        in ran.err
    )


# --- export ----------------------------------------------------------------------------------------


def test_export_writes_a_urdf_that_is_the_same_arm(urmpipe: Any, tmp_path: Path) -> None:
    ran = urmpipe("robot", "export", "urm6", "--tool", "0,0,0.1")
    assert (ran.code, ran.out) == (0, "Robot: urm6.urdf\n")
    assert [path.name for path in tmp_path.iterdir()] == ["urm6.urdf"]
    back = read_urdf(tmp_path / "urm6.urdf")
    assert back.point_names == load_robot("urm6").point_names
    assert back.tool.translation == (0.0, 0.0, 0.1)


def test_export_writes_a_toml_and_cuts_a_urdf(urmpipe: Any, tmp_path: Path) -> None:
    write_urdf(load_robot("ur3"), tmp_path / "whole.urdf")
    cut = ["--base-link", "link1", "--tip", "link3"]
    ran = urmpipe("robot", "export", "whole.urdf", *cut, "-o", "cut.toml", "--json")
    assert json.loads(ran.out) == {"schema": 1, "robot": "ur3", "file": "cut.toml"}
    assert load_robot(tmp_path / "cut.toml") == read_urdf(
        tmp_path / "whole.urdf", base_link="link1", tip_link="link3"
    )


def test_export_replaces_an_export_and_nothing_else(urmpipe: Any, tmp_path: Path) -> None:
    assert urmpipe("robot", "export", "urm4", "-o", "arm.urdf").code == 0
    assert urmpipe("robot", "export", "urm6", "-o", "arm.urdf").code == 0
    before = (tmp_path / "arm.urdf").read_bytes()
    ran = urmpipe("robot", "export", "arm.urdf")
    assert ran.code == 2
    assert ran.err == "error: arm.urdf: found the input of this command, allowed: any other name\n"
    (tmp_path / "mine.urdf").write_text("<robot/>", encoding="utf-8")
    ran = urmpipe("robot", "export", "urm6", "-o", "mine.urdf")
    assert ran.code == 2
    assert ran.err.startswith(
        "error: mine.urdf: found a file that is not a robot export of urmpipe, allowed:"
    )
    assert (tmp_path / "mine.urdf").read_text(encoding="utf-8") == "<robot/>"
    assert (tmp_path / "arm.urdf").read_bytes() == before
    (tmp_path / "folder.urdf").mkdir()
    ran = urmpipe("robot", "export", "urm6", "-o", "folder.urdf")
    assert ran.err == "error: folder.urdf: found a folder, allowed: the name of a file\n"
    assert urmpipe("robot", "export", "urm6", "-o", "arm.stl").err == (
        "error: output (--output): found 'arm.stl', allowed: a name that ends in .urdf or .toml\n"
    )


# --- the drawing -----------------------------------------------------------------------------------


def picture(skeleton: FloatArray, title: str) -> str:
    return draw_projections(Sketch([skeleton], spots=label_skeleton(skeleton)), (SIDEWAYS, FRONT), title)


def test_an_arm_of_no_length_is_drawn() -> None:
    chain = Chain("spin", (Joint("a"), Joint("b")))
    root = ET.fromstring(picture(points_over_log(chain, np.zeros((1, 2)))[0], "spin"))
    assert len(list(root.iter("{http://www.w3.org/2000/svg}circle"))) == 2 * 3


def test_the_picture_is_svg_with_all_points() -> None:
    root = ET.fromstring(picture(skeleton("urm8"), "<urm8> & co"))
    texts = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
    assert texts[0] == "<urm8> & co"
    assert texts.count("p9") == 2
    circles = list(root.iter("{http://www.w3.org/2000/svg}circle"))
    assert len(circles) == 2 * 10
    assert all(math.isfinite(float(circle.get("cx", "nan"))) for circle in circles)


@pytest.mark.parametrize(
    ("name", "inverse", "said"),
    [
        ("arm6", "spherical wrist", "closed form: spherical wrist"),
        ("ur5e", "three parallel axes", "closed form: three parallel axes"),
        ("urm6", "iterative", "iterative"),
    ],
)
def test_show_says_what_its_inverse_is(urmpipe: Any, name: str, inverse: str, said: str) -> None:
    assert f"Inverse: {said}" in urmpipe("robot", "show", name).out.splitlines()
    assert json.loads(urmpipe("robot", "show", name, "--json").out)["inverse"] == inverse


def test_a_pose_in_degrees_is_told_of(urmpipe: Any) -> None:
    ran = urmpipe("robot", "show", "urm6", "--q", "0,90,0,3,0,0")
    assert (ran.code, ran.err) == (
        0,
        "warning: q: these values look like degrees: found phi2 = 90 rad (5156.62 deg), allowed: rad\n",
    )
    assert urmpipe("robot", "show", "urm6", "--q", "0,3.14,0,3,0,0").err == ""


def test_an_arm_whose_last_axes_are_parallel_has_no_closed_form(urmpipe: Any, tmp_path: Path) -> None:
    """Where such axes all but meet, no point is nearest to them."""
    rows = ["d = 47", "alpha = 90", "a = 120, theta = 90", "alpha = -90, a = 20", "d = 130", "d = 29"]
    head = 'kind = "modified_dh"\nlength_unit = "mm"\nangle_unit = "deg"'
    text = f"{head}\njoints = [{{ {' }, { '.join(rows)} }}]"
    (tmp_path / "arm.toml").write_text(text, encoding="utf-8")
    ran = urmpipe("robot", "show", "arm.toml")
    assert (ran.code, ran.err) == (0, "")
    assert "Inverse: iterative" in ran.out


def test_a_null_character_in_a_name_is_one_line(urmpipe: Any, tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text('kind = "urdf"\nfile = "a\\u0000.urdf"', encoding="utf-8")
    for words, said in (
        (("robot", "show", "a\0.toml"), "found 'a\\x00.toml', allowed: the name of a file"),
        (("robot", "show", "arm.toml"), "arm.toml: found 'a\\x00.urdf', allowed: the name of a file"),
        (
            ("robot", "export", "urm6", "-o", "a\0.urdf"),
            "found a null character, allowed: none in the name of a file",
        ),
    ):
        ran = urmpipe(*words)
        assert (ran.code, ran.out, ran.err) == (2, "", f"error: {said}\n")
