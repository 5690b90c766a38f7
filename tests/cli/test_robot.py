"""`urmpipe robot` as a user runs it."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import chain_from_dict
from urmpipe_models.robots.urdf import read_urdf
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


def test_list_as_json(urmpipe: Any) -> None:
    answer = json.loads(urmpipe("robot", "list", "--json").out)
    assert answer["schema"] == 1
    assert [robot["name"] for robot in answer["robots"]] == NAMES
    assert answer["robots"][NAMES.index("urm4")]["joints"] == ["phi1", "phi2", "phi3", "phi4"]


# --- show ------------------------------------------------------------------------------------------


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


# --- export ----------------------------------------------------------------------------------------


def test_export_writes_a_urdf_that_is_the_same_arm(urmpipe: Any, tmp_path: Path) -> None:
    ran = urmpipe("robot", "export", "urm6", "--tool", "0,0,0.1")
    assert (ran.code, ran.out) == (0, "Robot: urm6.urdf\n")
    assert [path.name for path in tmp_path.iterdir()] == ["urm6.urdf"]
    back = read_urdf(tmp_path / "urm6.urdf")
    assert back.point_names == load_robot("urm6").point_names
    assert back.tool.translation == (0.0, 0.0, 0.1)


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


def test_a_pose_in_degrees_is_a_warning(urmpipe: Any) -> None:
    ran = urmpipe("robot", "show", "urm6", "--q", "0,90,0,3,0,0")
    assert (ran.code, ran.err) == (
        0,
        "warning: q: these values look like degrees: found phi2 = 90 rad (5156.62 deg), allowed: rad\n",
    )
    assert urmpipe("robot", "show", "urm6", "--q", "0,3.14,0,3,0,0").err == ""


def test_a_null_character_on_the_line_is_one_line(urmpipe: Any) -> None:
    for words, message in (
        (("show", "a\0.toml"), "found 'a\\x00.toml', allowed: the name of a file"),
        (("export", "urm6", "-o", "a\0.urdf"), "found a null character, allowed: none in the name of a file"),
    ):
        ran = urmpipe("robot", *words)
        assert (ran.code, ran.out, ran.err) == (2, "", f"error: {message}\n")
