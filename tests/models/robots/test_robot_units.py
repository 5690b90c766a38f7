"""The units of robot files: every value is in those that the file names, and rows in mm must name them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from asserting import refusal
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.errors import RobotError
from urmpipe_models.robots.toml import read_robot_file
from urmpipe_models.robots.urdf_writer import write_urdf

Read = Callable[[str], Chain]


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Read:
    """Read a text as a robot file arm.toml of an empty folder, the working one."""
    monkeypatch.chdir(tmp_path)
    return read_text


def read_text(text: str) -> Chain:
    """Return the arm of a text."""
    Path("arm.toml").write_text(text, encoding="utf-8")
    return read_robot_file("arm.toml")


ROWS = """
    joints = [
        {{ theta = {quarter}, d = {long}, a = {short}, alpha = {quarter} }},
        {{ kind = "prismatic", d = {short} }},
    ]
    start = [{quarter}, {short}]
    limits.lower = [{quarter}, {short}]
    limits.upper = [{half}, {long}]
    limits.velocity = [{half}, {long}]
    limits.acceleration = [{quarter}, {long}]
"""

KINDS = {
    "urm": """
        lengths = [{long}, {short}]
        tilts = [{quarter}]
        start = [{half}]
        limits = {{ lower = {quarter}, upper = {half}, velocity = [{half}], acceleration = {quarter} }}
    """,
    "dh": ROWS,
    "modified_dh": ROWS,
    "articulated6r": """
        lengths = [{long}, {short}, {long}, {short}, {long}]
        start = [{half}, 0, 0, 0, 0, {quarter}]
        limits = {{ lower = {quarter}, upper = {half}, velocity = {half}, acceleration = {half} }}
    """,
    "joints": """
        start = [{quarter}, {short}, {half}, {long}]
        joints = [
            {{ name = "a", origin = {{ rpy = [{half}, 0, {quarter}] }}, lower = {quarter}, upper = {half} }},
            {{ name = "b", kind = "prismatic", lower = {short}, upper = {long}, velocity = {long} }},
            {{ name = "c", mimic = {{ joint = "b", multiplier = 2, offset = {quarter} }}, upper = {half} }},
            {{ name = "d", velocity = {quarter}, acceleration = {half} }},
            {{ name = "e", kind = "prismatic", acceleration = {long} }},
        ]
        tip = {{ translation = [0, {short}, {long}], rpy = [0, 0, {quarter}] }}
    """,
    "urdf": 'file = "robot.urdf"\nstart = [{quarter}, {short}]',
}

OF_EVERY_KIND = """
    base = {{ translation = [{long}, 0, {short}], rpy = [{quarter}, 0, 0] }}
    tool = {{ translation = [0, 0, {short}], rpy = [0, {half}, 0] }}
    visuals = [
        {{ box = [{long}, {short}, 0], origin = {{ translation = [{long}, 0, 0], rpy = [0, 0, {half}] }} }},
        {{ cylinder = [{short}, {long}] }},
        {{ capsule = [{short}, {long}] }},
        {{ sphere = {short} }},
        {{ mesh = "a.stl", scale = [2, 2, 2] }},
    ]
"""


@pytest.mark.parametrize("kind", KINDS)
def test_every_value_of_a_file_is_in_the_units_of_the_file(robot: Read, kind: str) -> None:
    write_urdf(Chain("u", (Joint("a"), Joint("b", "prismatic"))), "robot.urdf")
    text = f'kind = "{kind}"\n{KINDS[kind]}\n{OF_EVERY_KIND}'
    si = robot(text.format(long=0.75, short=0.25, quarter=math.pi / 2, half=math.pi))
    units = 'length_unit = "mm"\nangle_unit = "deg"\n'
    assert robot(units + text.format(long=750, short=250, quarter=90, half=180)) == si
    assert 0.25 in (si.tool.translation[2], si.start[-1])


def test_rows_that_make_no_arm_in_metres_and_radians_must_tell_their_units(robot: Read) -> None:
    rows = 'kind = "dh"\njoints = [{ d = 118, alpha = 90 }, { a = 612 }]'
    assert refusal(RobotError, robot, rows).splitlines() == [
        'arm.toml: key length_unit: found none, and links of 730 m, allowed: "mm", or "m" if intended',
        'arm.toml: key angle_unit: found none, and 90 rad, allowed: "deg", or "rad" if intended',
    ]
    assert robot(f'length_unit = "mm"\nangle_unit = "deg"\n{rows}').joints[1].origin.translation[2] == 0.118
    assert robot(f'length_unit = "m"\nangle_unit = "rad"\n{rows}').tip.translation[0] == 612.0


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ('kind = "dh"\njoints = [{ d = 100 }]', None),
        ('kind = "dh"\njoints = [{ d = 101 }]', "key length_unit: found none, and links of 101 m"),
        ('kind = "urm"\nlengths = [0.1, 0.1]\ntilts = [-45]', "key angle_unit: found none, and 45 rad"),
        ('kind = "dh"\njoints = [{ theta = 6.283185307179586 }]', None),
        ('kind = "modified_dh"\njoints = [{ theta = -6.3 }]', "key angle_unit: found none, and 6.3 rad"),
    ],
)
def test_units_are_asked_for_beyond_a_hundred_metres_and_beyond_a_turn(
    robot: Read, rows: str, told: str | None
) -> None:
    if told is None:
        assert len(robot(rows).coordinates) == 1
    else:
        (said,) = refusal(RobotError, robot, rows).splitlines()
        assert said.startswith(f"arm.toml: {told}, allowed: ")
