"""Robot files: one meaning in any units, and the same chain after a round trip. toml.cases has the rest."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.math3d import Transform, rotation_x
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict, read_robot_file, robot_toml
from urmpipe_models.robots.urdf_writer import write_urdf

ROWS = """
joints = [
    { theta = QUARTER, d = LONG, a = SHORT, alpha = QUARTER },
    { kind = "prismatic", d = SHORT },
]
start = [QUARTER, SHORT]
limits.lower = [QUARTER, SHORT]
limits.upper = [HALF, LONG]
limits.velocity = [HALF, LONG]
limits.acceleration = [QUARTER, LONG]
"""

KINDS = {
    "urm": """
lengths = [LONG, SHORT]
tilts = [QUARTER]
start = [HALF]
limits = { lower = QUARTER, upper = HALF, velocity = [HALF], acceleration = QUARTER }
""",
    "dh": ROWS,
    "modified_dh": ROWS,
    "articulated6r": """
lengths = [LONG, SHORT, LONG, SHORT, LONG]
start = [HALF, 0, 0, 0, 0, QUARTER]
limits = { lower = QUARTER, upper = HALF, velocity = HALF, acceleration = HALF }
""",
    "joints": """
start = [QUARTER, SHORT, HALF, LONG]
joints = [
    { name = "a", origin = { rpy = [HALF, 0, QUARTER] }, lower = QUARTER, upper = HALF },
    { name = "b", kind = "prismatic", lower = SHORT, upper = LONG, velocity = LONG },
    { name = "c", mimic = { joint = "b", multiplier = 2, offset = QUARTER }, upper = HALF },
    { name = "d", velocity = QUARTER, acceleration = HALF },
    { name = "e", kind = "prismatic", acceleration = LONG },
]
tip = { translation = [0, SHORT, LONG], rpy = [0, 0, QUARTER] }
""",
    "urdf": 'file = "robot.urdf"\nstart = [QUARTER, SHORT]',
}

OF_EVERY_KIND = """
base = { translation = [LONG, 0, SHORT], rpy = [QUARTER, 0, 0] }
tool = { translation = [0, 0, SHORT], rpy = [0, HALF, 0] }
visuals = [
    { box = [LONG, SHORT, 0], origin = { translation = [LONG, 0, 0], rpy = [0, 0, HALF] } },
    { cylinder = [SHORT, LONG] }, { capsule = [SHORT, LONG] }, { sphere = SHORT },
    { mesh = "a.stl", scale = [2, 2, 2] },
]
"""


@pytest.mark.parametrize("kind", KINDS)
def test_every_value_of_a_file_is_in_the_units_of_the_file(tmp_path: Path, kind: str) -> None:
    write_urdf(Chain("u", (Joint("a"), Joint("b", "prismatic"))), tmp_path / "robot.urdf")

    def read(units: str, long: float, short: float, quarter: float, half: float) -> Chain:
        text = f'kind = "{kind}"\n{units}{KINDS[kind]}{OF_EVERY_KIND}'
        for name, value in {"LONG": long, "SHORT": short, "QUARTER": quarter, "HALF": half}.items():
            text = text.replace(name, repr(value))
        (tmp_path / "arm.toml").write_text(text, encoding="utf-8")
        return read_robot_file(tmp_path / "arm.toml")

    si = read("", 0.75, 0.25, math.pi / 2, math.pi)
    assert read('length_unit = "mm"\nangle_unit = "deg"\n', 750, 250, 90, 180) == si
    assert 0.25 in (si.tool.translation[2], si.start[-1])
    assert chain_from_dict(chain_to_dict(si)) == si


def bits(chain: Chain) -> str:
    """Every number of frames, joints, masses and drives: == takes 0.0 and -0.0 for the same."""
    frames = [(frame.translation, frame.rotation) for frame in chain.frames]
    joints = [replace(joint, origin=Transform()) for joint in chain.joints]
    return repr((chain.start, frames, joints, chain.gravity, chain.inertials, chain.drives))


@pytest.mark.slow
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_toml_file_and_a_dictionary_are_the_same_chain_bit_by_bit(
    visual_chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    chain = data.draw(visual_chains)
    path = tmp_path / f"{chain.name or 'x'}.toml" if chain.name.isalnum() else tmp_path / "x.toml"
    path.write_text(robot_toml(chain), encoding="utf-8", newline="\n")
    of_json = json.loads(json.dumps(chain_to_dict(chain), allow_nan=False))  # infinities are null
    for back in (read_robot_file(path), chain_from_dict(of_json)):
        assert (back, bits(back), back.parameters) == (chain, bits(chain), chain.parameters)


@pytest.mark.parametrize("name", robot_names())
def test_a_toml_file_keeps_the_parameters(tmp_path: Path, name: str) -> None:
    chain = load_robot(name).placed(tool=Transform(rotation_x(0.5).rotation, (0.1, 0.2, 0.3)))
    chain = chain.with_parameters({"tool.rx": 0.25, chain.parameters[6].name: 0.4})
    path = tmp_path / f"{name}.toml"
    path.write_text(robot_toml(chain), encoding="utf-8")
    back = read_robot_file(path)
    assert (back, back.parameters) == (chain, chain.parameters)
