"""A robot as a dictionary or a TOML file and back: the same chain."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from asserting import refusal
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.errors import RobotError
from urmpipe_models.math3d import Transform, rotation_x, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict, read_robot_file, robot_toml


def bits(chain: Chain) -> bytes:
    """Every number of a chain: == takes 0.0 and -0.0 for the same."""
    numbers: list[float] = [*chain.start]
    for frame in (chain.base, chain.tip, chain.tool, *(joint.origin for joint in chain.joints)):
        numbers += [*frame.translation, *(entry for row in frame.rotation for entry in row)]
    for joint in chain.joints:
        numbers += [*joint.axis, joint.lower, joint.upper, joint.velocity, joint.acceleration, joint.effort]
        if joint.mimic is not None:
            numbers += [joint.mimic.multiplier, joint.mimic.offset]
    return np.array(numbers, dtype=float).tobytes()


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_a_dictionary_through_json_is_the_same_chain_bit_by_bit(
    chains: SearchStrategy[Chain], data: st.DataObject
) -> None:
    chain = data.draw(chains)
    text = json.dumps(chain_to_dict(chain), allow_nan=False)  # infinities are null
    back = chain_from_dict(json.loads(text))
    assert back == chain
    assert bits(back) == bits(chain)
    assert back.parameters == chain.parameters


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_toml_file_is_the_same_chain_bit_by_bit(
    chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    chain = data.draw(chains)
    path = tmp_path / f"{chain.name or 'x'}.toml" if chain.name.isalnum() else tmp_path / "x.toml"
    path.write_text(robot_toml(chain), encoding="utf-8", newline="\n")
    back = read_robot_file(path)
    assert back == chain
    assert bits(back) == bits(chain)
    assert back.parameters == chain.parameters


@pytest.mark.parametrize("name", robot_names())
def test_a_toml_file_keeps_the_parameters(tmp_path: Path, name: str) -> None:
    chain = load_robot(name).placed(tool=Transform(rotation_x(0.5).rotation, (0.1, 0.2, 0.3)))
    chain = chain.with_parameters({"tool.rx": 0.25, chain.parameters[6].name: 0.4})
    path = tmp_path / f"{name}.toml"
    path.write_text(robot_toml(chain), encoding="utf-8")
    back = read_robot_file(path)
    assert (back, back.parameters) == (chain, chain.parameters)


def test_steps_of_a_file_are_parameters_in_its_units(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(
        """
        kind = "joints"
        length_unit = "mm"
        angle_unit = "deg"
        joints = [{ name = "a", origin = { steps = [
            { name = "height", along = "z", value = 250 },
            { rotation = [[1, 0, 0], [0, 0, -1], [0, 1, 0]] },
            { name = "lean", about = "y", value = 90, source = "drawing 7" },
        ] } }]
        """,
        encoding="utf-8",
    )
    chain = read_robot_file(path)
    height, lean = chain.parameters[6:8]
    assert (height.name, height.value, height.source) == ("height", 0.25, "")
    assert (lean.name, lean.value, lean.source, lean.place) == ("lean", math.pi / 2, "drawing 7", "a")
    assert lean.before.rotation == ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
    assert chain.joints[0].origin.translation == (0.0, 0.0, 0.25)


def test_steps_and_another_frame_beside_them_are_refused() -> None:
    data = chain_to_dict(load_robot("urm4"))
    data["joints"][1]["origin"]["translation"] = [0.0, 0.0, 0.3]
    data["joints"][2]["origin"]["steps"][0] |= {"along": "u"}
    assert refusal(RobotError, chain_from_dict, data) == (
        "key joints[1].origin.steps: found beside translation and rotation of another frame;"
        " allowed: steps alone\n"
        "key joints[2].origin.steps[0].along: found 'u', allowed: one of x, y, z\n"
        "key joints[2].origin.steps: found beside translation and rotation of another frame;"
        " allowed: steps alone"
    )


def test_a_negative_zero_and_odd_texts_come_back() -> None:
    chain = Chain('\x7f"\\\n', (Joint("é\t", origin=translation(-0.0, 1e-300, 5e-324)),), start=(-0.0,))
    back = chain_from_dict(chain_to_dict(chain))
    assert (back, bits(back)) == (chain, bits(chain))


def test_a_dictionary_from_before_limits_of_acceleration_has_none() -> None:
    data = chain_to_dict(load_robot("ur5e"))
    for joint in data["joints"]:
        assert "effort" not in joint  # one from before efforts and one without them are the same
        del joint["acceleration"]
    assert chain_from_dict(data) == load_robot("ur5e")


def test_a_dictionary_opens_no_file() -> None:
    with pytest.raises(RobotError) as caught:
        chain_from_dict({"kind": "urdf", "file": "robot.urdf"}, file="run.rrd")
    assert str(caught.value) == "run.rrd: key kind: found 'urdf', allowed: one of joints"


def test_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text('kind = "urm"\nlengths = [1, 1]\ntilts = [1]\n', encoding="utf-8-sig")
    assert read_robot_file(path).coordinates == ("phi1",)


def test_a_dictionary_that_is_wrong_names_its_origin() -> None:
    data = chain_to_dict(Chain("a", (Joint("j"),)))
    data["joints"][0]["kind"] = "helical"
    assert refusal(RobotError, chain_from_dict, data, file="run.rrd") == (
        "run.rrd: key joints[0].kind: found 'helical', allowed: one of revolute, prismatic, fixed"
    )


def test_numbers_of_numpy_are_written_as_numbers(tmp_path: Path) -> None:
    joints = (
        Joint("a", lower=np.deg2rad(-170), upper=np.float64(1.0)),
        Joint("b", mimic=Mimic("a", np.float64(2.0), np.float64(0.5))),
    )
    chain = Chain("arm", joints)
    path = tmp_path / "arm.toml"
    path.write_text(robot_toml(chain), encoding="utf-8")
    assert read_robot_file(path) == chain
