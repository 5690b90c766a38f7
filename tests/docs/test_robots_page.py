"""docs/robots.md against the reader of robot files: its keys are those that it knows, its examples arms."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pages import lay_files, snippets, text_of
from urmpipe_models.arm.chain import Box, Chain, Cylinder
from urmpipe_models.drives import PassiveJoint
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.math3d import rotation_y
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import read_robot_file

PAGE = text_of("docs/robots.md")
EXAMPLES = {re.findall(r'name = "(.*?)"|$', one)[0]: one for one in snippets("docs/robots.md", "toml")}

DEEP = """
kind = "{kind}"
unheard = 1
joints = [{{ unheard = 1, origin = {{ unheard = 1 }}, mimic = {{ unheard = 1 }} }}]
limits = {{ unheard = 1 }}
base = {{ unheard = 1, steps = [{{ unheard = 1 }}, {{ along = "x", unheard = 1 }}] }}
tool = {{ unheard = 1 }}
tip = {{ unheard = 1 }}
visuals = [{{ unheard = 1, origin = {{ unheard = 1 }} }}, {{ mesh = "a.stl", unheard = 1 }}]
inertials = [{{ unheard = 1 }}]
drives = {{ q1 = {{ unheard = 1 }} }}
"""
"""A key that is none in every table that a kind may have."""


@pytest.fixture
def read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Chain]:
    """Write a text as arm.toml among the files of pages, and read it."""
    lay_files(tmp_path, monkeypatch)

    def read_text(text: str) -> Chain:
        Path("arm.toml").write_text(text, encoding="utf-8")
        return read_robot_file("arm.toml")

    return read_text


def section(title: str) -> str:
    """Return what stands under a heading, up to the next of its rank."""
    head = next(line for line in PAGE.splitlines() if line.startswith("###") and title in line)
    return PAGE.partition(f"{head}\n")[2].partition("\n## ")[0].partition("\n### ")[0]


def keys_of(text: str, head: str) -> set[str]:
    """Return the first column of the table with a head."""
    rows = text.partition(f"| {head} | unit |")[2].partition("\n\n")[0].splitlines()[2:]
    return {match[1] for row in rows if (match := re.match(r"\| `(\w+)` \|", row))}


def known(said: RobotError, place: str) -> set[str]:
    """Return the keys that messages call known in a table."""
    found = re.findall(rf"key {re.escape(place)}unheard: unknown.*?; allowed: (.*)", str(said))
    return {key for keys in found for key in keys.split(", ")}


def kinds() -> list[str]:
    """Return the kinds that the page has a section of."""
    heads = re.findall(r"^### Kinds? (.*)", PAGE, re.MULTILINE)
    return [kind for head in heads for kind in head.split(" and ")]


def test_every_kind_is_on_the_page(read: Callable[[str], Chain]) -> None:
    with pytest.raises(RobotError, match="allowed: one of ") as caught:
        read('kind = "none"')
    assert str(caught.value).partition("one of ")[2].split(", ") == kinds()
    shown = [re.findall(r'kind = "(\w+)"', one)[0] for one in EXAMPLES.values()]
    assert shown == [*kinds(), "joints"]  # the last one is the arm with masses


@pytest.mark.slow
@pytest.mark.parametrize("kind", kinds())
def test_the_keys_of_a_kind_are_those_that_are_read(read: Callable[[str], Chain], kind: str) -> None:
    with pytest.raises(RobotError) as caught:
        read(DEEP.format(kind=kind))
    every, own, visuals = section("of every kind"), section(kind), section("Visuals")
    assert known(caught.value, "") == keys_of(every, "key") | keys_of(own, "key")
    for place in ("base.", "tool.", "visuals[0].origin."):
        assert known(caught.value, place) == keys_of(every, "key of a frame")
    constant = keys_of(every, "key of a frame") - {"steps"}
    assert known(caught.value, "base.steps[0].") == {"along", "about"} | constant
    assert known(caught.value, "base.steps[1].") == keys_of(every, "key of `steps`") - {"about"}
    shapes = known(caught.value, "visuals[0].") | known(caught.value, "visuals[1].")
    assert shapes == keys_of(visuals, "key of `visuals`")
    assert known(caught.value, "inertials[0].") == keys_of(section("Masses"), "key of `inertials`")
    limits = keys_of(every, "key of `limits`") if "limits" in keys_of(own, "key") else set()
    assert known(caught.value, "limits.") == limits
    assert known(caught.value, "joints[0].") == keys_of(own, "key of `joints`")
    assert known(caught.value, "joints[0].mimic.") == keys_of(own, "key of `mimic`")


TURN = math.pi / 180.0

EXPECTED: dict[str, dict[str, Any]] = {
    "two-modules": {
        "coordinates": ("phi1", "phi2"),
        "start": (0, 180 * TURN),
        "lower": [-360 * TURN] * 2,
        "upper": [360 * TURN] * 2,
        "velocity": [180 * TURN, 90 * TURN],
        "tool": (0, 0, 0.15),
    },
    "turn-and-slide": {
        "coordinates": ("turn", "slide"),
        "start": (90 * TURN, 0.1),
        "lower": [-170 * TURN, 0],
        "upper": [170 * TURN, 0.5],
        "velocity": [180 * TURN, 1],
        "acceleration": [720 * TURN, 4],
        "tool": (0, 0, 0),
    },
    "elbow": {
        "coordinates": ("q1", "q2", "q3"),
        "start": (0, 0, 0),
        "lower": [-360 * TURN] * 3,
        "upper": [360 * TURN] * 3,
        "velocity": [120 * TURN, 120 * TURN, 180 * TURN],
        "tool": (0, 0, 0),
    },
    "": {
        "coordinates": tuple(f"q{k}" for k in range(1, 7)),
        "start": (0, 30 * TURN, 0, 0, 45 * TURN, 0),
        "lower": [-170 * TURN, -90 * TURN, -90 * TURN, -180 * TURN, -120 * TURN, -360 * TURN],
        "upper": [170 * TURN, 90 * TURN, 90 * TURN, 180 * TURN, 120 * TURN, 360 * TURN],
        "velocity": [150 * TURN] * 6,
        "tool": (0, 0, 0),
    },
    "gripping-arm": {
        "coordinates": ("turn", "finger"),
        "start": (90 * TURN, 0.02),
        "lower": [-170 * TURN, 0],
        "upper": [170 * TURN, 0.04],
        "velocity": [90 * TURN, math.inf],
        "acceleration": [360 * TURN, math.inf],
        "tool": (0, 0, 0),
    },
    "arm-with-gripper": {
        "coordinates": ("shoulder", "elbow", "slide"),
        "start": (0, -90 * TURN, 0.02),
        "lower": [-3.14, -1.6, 0],  # of the URDF, which is in rad and m
        "upper": [3.14, 1.6, 0.4],
        "velocity": [2, 2, 0.5],
        "tool": (0, 0, 0.15),
    },
    "parallelogram-arm": {
        "coordinates": ("theta1", "theta2", "theta3", "theta4"),
        "start": (0, 0, 0, 0),
        "lower": [-math.inf, -40 * TURN, -40 * TURN, 0],
        "upper": [math.inf, 60 * TURN, 60 * TURN, 0],
        "velocity": [math.inf] * 4,
        "effort": [700, 900, 900, math.inf],
        "tool": (0, 0, 0),
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_the_arm_that_it_says(read: Callable[[str], Chain], name: str) -> None:
    chain, expected = read(EXAMPLES[name]), {"acceleration": math.inf, "effort": math.inf} | EXPECTED[name]
    assert (chain.name, chain.coordinates) == (name or "arm", expected["coordinates"])
    for key in ("lower", "upper", "velocity", "acceleration", "effort"):
        np.testing.assert_allclose([getattr(one, key) for one in chain.moving], expected[key], rtol=1e-15)
    np.testing.assert_allclose(chain.start, expected["start"], rtol=1e-15)
    assert chain.tool.translation == expected["tool"]


def test_a_finger_follows_the_other_and_shapes_are_in_the_units_of_the_file(
    read: Callable[[str], Chain],
) -> None:
    chain = read(EXAMPLES["gripping-arm"])
    assert [(one.joint, one.multiplier, one.offset) for joint in chain.joints if (one := joint.mimic)] == [
        ("finger", -2.0, 0.0)
    ]
    shapes = [visual.shape for visual in chain.visuals]
    assert shapes == [Box((0.2, 0.2, 0.02)), Cylinder(0.03, 0.3)]
    assert chain.visuals[1].origin.translation == (0.0, 0.0, 0.15)


def test_the_parallelogram_turns_forearm_and_counterweight_by_the_angle_to_the_ground(
    read: Callable[[str], Chain],
) -> None:
    chain = read(EXAMPLES["parallelogram-arm"])
    assert [one.source for one in chain.inertials] == [
        "column", "counterweight", "upper arm", "forearm", "wrist",
    ]  # fmt: skip
    assert chain.drives == (PassiveJoint("theta4", 2500.0, 20.0),)
    q = (0.0, 0.3, 0.2, 0.0)
    crank, uncrank, upper, undone, forearm, level = forward(chain, q)[1:7]
    turned = (rotation_y(angle).rotation for angle in (0.2, 0.0, 0.3, 0.0, 0.2, 0.0))
    for pose, rotation in zip((crank, uncrank, upper, undone, forearm, level), turned, strict=True):
        np.testing.assert_allclose(pose.rotation, rotation, rtol=0.0, atol=1e-15)  # rounding
    end = (math.sin(0.3) + 1.1 * math.cos(0.2) + 0.2, 0.0, 0.8 + math.cos(0.3) - 1.1 * math.sin(0.2))
    np.testing.assert_allclose(forward(chain, q)[-1].translation, end, rtol=0.0, atol=1e-15)


def test_the_urdf_of_the_page_is_an_arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lay_files(tmp_path, monkeypatch)
    chain = load_robot("arm.urdf")
    assert [joint.name for joint in chain.joints] == ["shoulder", "elbow", "slide", "flange"]
    assert chain == load_robot("arm.urdf", base_link="base_link", tip_link="tool0")
