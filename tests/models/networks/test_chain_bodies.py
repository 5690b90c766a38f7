"""Robots in networks: their bodies are where the frames of the chain are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import iter_frames
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.elements import chain_to_parts, control_name
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.parts import Body, Control, Expression
from urmpipe_models.robots.catalogue import load_robot, robot_names

EXACT = 1e-12
"""Some twenty products of matrices, of lengths of 2 m at most, each rounded to 1e-16."""


def expected_poses(name: str, chain: Chain, q: FloatArray) -> Iterator[tuple[str, Transform]]:
    """The moving frame of each joint, and the tool."""
    *_, last = moving = [*iter_frames(chain, list(q))][1:]
    for joint, frame in zip(chain.joints, moving, strict=True):
        yield f"{name}.{joint.name}", frame
    yield f"{name}.tool", last @ chain.tip @ chain.tool


def variables(mechanism: Mechanism, name: str, chain: Chain, q: FloatArray) -> FloatArray:
    """The variables of a mechanism at coordinates of a chain; a control for those that others follow."""
    of = {f"{name}.{key}": row for key, row in zip(chain.coordinates, q, strict=True)}
    of |= {control_name(name, key): row for key, row in zip(chain.coordinates, q, strict=True)}
    return np.array([of[one.owner] for one in mechanism.variables])


def check_poses(network: Network, name: str, chain: Chain, q: FloatArray) -> None:
    mechanism = build_mechanism(network)
    poses = mechanism.poses(variables(mechanism, name, chain, q))
    for body, frame in expected_poses(name, chain, q):
        pairs = zip(
            (*poses[body].rotation, poses[body].translation),
            (*frame.rotation, frame.translation),
            strict=True,
        )
        for found, expected in pairs:
            for a, b in zip(found, expected, strict=True):
                np.testing.assert_allclose(a, b, rtol=0, atol=EXACT, err_msg=body)


@pytest.mark.parametrize("robot", robot_names())
def test_a_robot_of_the_catalogue_moves_as_its_chain(robot: str) -> None:
    network = load_network({"chains": {"arm": {"robot": robot}}})
    chain = load_robot(robot)
    assert [one.name for one in network.bodies] == [f"arm.{one.name}" for one in chain.joints] + ["arm.tool"]
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (len(chain.coordinates), 7))
    check_poses(network, "arm", chain, q)
    start = dict(zip(chain.coordinates, chain.start, strict=True))
    assert all(one.start == (start[one.name[4:]],) for one in network.joints if one.name[4:] in start)


@pytest.mark.slow
@given(st.data())
def test_any_chain_moves_as_its_frames(chains: SearchStrategy[Chain], data: DataObject) -> None:
    chain = data.draw(chains)
    parts = chain_to_parts("arm", chain, "ground", chain.start, {})
    network = Network("arm", tuple(parts.bodies), tuple(parts.joints), (), tuple(parts.controls))
    rows = st.lists(st.floats(-3.0, 3.0), min_size=len(chain.coordinates), max_size=len(chain.coordinates))
    check_poses(network, "arm", chain, np.array([data.draw(rows)]).T)


GRIPPER = """
kind = "joints"
name = "gripper"
start = [0.2, 0.01]
base.translation = [0, 0, 0.1]
tool.rpy = [0.1, 0.2, 0.3]

[[joints]]
name = "wrist"
kind = "revolute"
axis = [0, -0.6, 0.8]
origin.translation = [0.1, 0, 0]

[[joints]]
name = "left"
kind = "prismatic"
axis = [0, 1, 0]

[[joints]]
name = "camera"
kind = "fixed"
origin = { translation = [0, 0, 0.05], rpy = [0, 0.5, 0] }

[[joints]]
name = "right"
kind = "prismatic"
axis = [1, 0, 0]
mimic = { joint = "left", multiplier = -2.0, offset = 0.03 }

[tip]
translation = [0, 0, 0.2]
"""

HELD = """
angle_unit = "deg"
length_unit = "mm"

[bodies]
carriage = {}

[joints.rail]
kind = "prismatic"
bodies = ["ground", "carriage"]

[chains.g]
robot = "gripper.toml"
body = "carriage"
start = [90, 20]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "gripper.toml").write_text(GRIPPER, encoding="utf-8")
    return tmp_path


def read(folder: Path, text: str) -> Network:
    (folder / "held.toml").write_text(text, encoding="utf-8")
    return load_network(folder / "held.toml")


def test_a_control_drives_a_joint_and_those_that_follow_it(folder: Path) -> None:
    network = read(folder, HELD)
    assert network.controls == (Control("g_left", 0.02),)
    drives = {one.name: [two and two.text for two in one.drives] for one in network.joints}
    assert drives == {
        "rail": [None],
        "g.wrist": [None],
        "g.left": ["g_left"],
        "g.camera": [],
        "g.right": ["g_left * -2.0 + 0.03"],
        "g.tool": [],
    }
    assert {one.name: one.start for one in network.joints}["g.wrist"] == (np.pi / 2.0,)
    assert {one.name: one.bodies for one in network.joints}["g.wrist"] == ("carriage", "g.wrist")
    mechanism, chain = build_mechanism(network), load_robot(folder / "gripper.toml")
    x = dict(zip([one.owner for one in mechanism.variables], (0.05, 0.3, 0.7), strict=True))
    assert x == {"g_left": 0.05, "rail": 0.3, "g.wrist": 0.7}
    poses = mechanism.poses([*x.values()])
    for body, frame in expected_poses("g", chain, np.array([0.7, 0.05])):
        moved = Transform(translation=(0.0, 0.3, 0.0)) @ frame
        np.testing.assert_allclose(poses[body].rotation, moved.rotation, rtol=0, atol=EXACT)
        np.testing.assert_allclose(poses[body].translation, moved.translation, rtol=0, atol=EXACT)


def test_controls_of_the_file_drive_coordinates_and_those_that_follow_them(folder: Path) -> None:
    value = '\n[controls]\ns = { start = 5 }\n[chains.g.value]\nwrist = "2 * s"\nleft = "s"\n'
    network = read(folder, HELD + value)
    assert network.controls == (Control("s", 5.0), Control("g_left", 0.02, value=Expression("(s) * 0.001")))
    drives = {one.name: one.values for one in network.joints}
    assert drives["g.wrist"] == (Expression("(2 * s) * pi / 180"),)
    assert drives["g.right"] == (Expression("g_left * -2.0 + 0.03"),)


def test_bodies_of_chains_are_tied_as_others_are(folder: Path) -> None:
    tied = '\n[elements.rod]\nkind = "gg"\nbodies = ["g.tool", "ground"]\nd = 500\n'
    network = read(folder, HELD + tied)
    assert network.elements[0].bodies == ("g.tool", "ground")
    assert network.bodies[0] == Body("carriage")


@pytest.mark.parametrize(
    ("name", "control"), [("arm", "arm_q1"), ("left arm", "left_arm_q1"), ("1", "_1_q1"), ("a.b", "a_b_q1")]
)
def test_names_of_controls_are_names_in_expressions(name: str, control: str) -> None:
    assert control_name(name, "q1") == control
    assert Expression(control).names == {control}
