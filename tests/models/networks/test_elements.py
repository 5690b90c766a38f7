"""Denavit-Hartenberg elements (eq. 3-5 to 3-7, Craig's parameters), robots in networks, pairs of files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from asserting import refusal
from pair_tables import CAM, GEARED, RACK, UNEVEN
from random_networks import matrix
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import DHRow, modified_dh_chain
from urmpipe_models.elementwise import FloatArray, cross
from urmpipe_models.errors import NetworkError
from urmpipe_models.kinematics.forward import iter_frames
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.elements import (
    DHElement,
    chain_to_parts,
    control_name,
    element_frame,
    element_to_joint,
)
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.joint_motion import joint_frame
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.parts import Body, Control, Expression, Joint
from urmpipe_models.robots.catalogue import load_robot, robot_names

EXACT = 1e-14  # products of a few matrices whose entries are 5 at most, each rounded to 1e-16
ROBOT_EXACT = 1e-12  # some twenty products of matrices, of lengths of 2 m at most

values = st.tuples(*(st.floats(-2.0, 2.0) for _ in range(4)))


def assert_frames(found: Transform, expected: Transform, atol: float = EXACT) -> None:
    np.testing.assert_allclose(matrix(found), matrix(expected), rtol=0, atol=atol)


# --- Denavit-Hartenberg elements


def printed(a: float, alpha: float, s: float, theta: float) -> Transform:
    """The frame as the paper prints it: r, e1 and e2 are its columns."""
    r = (s * math.cos(alpha), a, -s * math.sin(alpha))
    e1 = (math.cos(alpha), 0.0, -math.sin(alpha))
    e2 = (math.sin(alpha) * math.sin(theta), math.cos(theta), math.cos(alpha) * math.sin(theta))
    return Transform(Transform((e1, e2, cross(e1, e2))).columns, r)


def across(joint: Joint, *values: float) -> Transform:
    """R = A_1 T A_2^-1."""
    return joint.frames[0] @ joint_frame(joint, values) @ joint.frames[1].inverse()


@given(values)
def test_the_frame_of_an_element_is_the_printed_one(row: tuple[float, float, float, float]) -> None:
    assert_frames(element_frame(*row), printed(*row))


@given(values, st.floats(-0.5, 0.5))
def test_the_joint_of_each_kind_moves_by_the_printed_frame(
    row: tuple[float, float, float, float], pitch: float
) -> None:
    a, alpha, s, theta = row
    ends = ("b", "c")
    for element, variables in (
        (DHElement("J", "R", a, alpha, s), (theta,)),
        (DHElement("J", "P", a, alpha, theta=theta), (s,)),
        (DHElement("J", "C", a, alpha), (theta, s)),
    ):
        assert_frames(across(element_to_joint(element, ends), *variables), printed(*row))
    helix = across(element_to_joint(DHElement("J", "H", a, alpha, pitch=pitch), ends), theta)
    assert_frames(helix, printed(a, alpha, pitch * theta, theta))


def test_the_number_of_a_variable_is_its_start() -> None:
    rows = [DHElement("J", kind, s=0.1, theta=0.2) for kind in "RPCH"]
    assert [element_to_joint(row, ("b", "c")).start for row in rows] == [(0.2,), (0.1,), (0.2, 0.1), (0.2,)]


@given(st.lists(values, min_size=1, max_size=5))
def test_an_element_is_a_row_of_modified_parameters(rows: list[tuple[float, float, float, float]]) -> None:
    """With x, y, z of Craig for e2, e3, e1."""
    axes = Transform(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    craig = modified_dh_chain("arm", [DHRow(theta, s, a, alpha) for a, alpha, s, theta in rows])
    here = Transform()
    for row, frame in zip(rows, [*iter_frames(craig, [0.0] * len(rows))][1:], strict=True):
        here = here @ element_frame(*row)
        assert_frames(axes.inverse() @ here @ axes, frame)


ROWS: dict[str, dict[str, Any]] = {
    "A": {"kind": "R", "a": 0.1, "alpha": 0.2, "s": 0.3, "theta": 0.4},
    "B": {"kind": "P", "a": -0.2, "alpha": 1.2, "s": 0.1, "theta": -0.7},
    "C": {"kind": "C", "a": 0.5, "alpha": -0.4, "s": -0.2, "theta": 2.0, "body": "hand"},
    "D": {"kind": "H", "a": 0.3, "alpha": 0.9, "theta": 1.1, "pitch": 0.05},
}


@pytest.mark.parametrize("closed", [False, True])
def test_a_chain_of_all_kinds_ends_in_a_body_or_leads_back_to_the_ground(closed: bool) -> None:
    network = load_network({"dh": {"closed": closed, "elements": ROWS}})
    bodies = ["A.body", "B.body", "hand", "ground" if closed else "D.body"]
    assert [joint.bodies for joint in network.joints] == [*zip(["ground", *bodies], bodies, strict=False)]
    assert network.bodies == tuple(Body(name) for name in bodies if name != "ground")
    mechanism = build_mechanism(network)
    poses = mechanism.poses(mechanism.start)
    here = expected = Transform()
    for joint, row in zip(network.joints, ROWS.values(), strict=True):
        s = row["pitch"] * row["theta"] if row["kind"] == "H" else row["s"]
        expected = expected @ printed(row["a"], row["alpha"], s, row["theta"])
        here = here @ across(joint, *joint.start)
        assert_frames(here, expected)
        if not closed:
            assert_frames(poses[joint.bodies[1]], expected)


def test_parameters_are_in_the_units_of_the_file() -> None:
    rows = {
        "A": {"kind": "R", "a": 100, "alpha": 90, "s": 20, "theta": 45},
        "B": {"kind": "H", "alpha": -90, "theta": 180, "pitch": 5},
    }
    network = load_network({"length_unit": "mm", "angle_unit": "deg", "dh": {"elements": rows}})
    right = math.pi / 2.0
    assert network.joints == (
        element_to_joint(DHElement("A", "R", 0.1, right, 0.02, right / 2.0), ("ground", "A.body")),
        element_to_joint(DHElement("B", "H", 0.0, -right, theta=math.pi, pitch=0.005), ("A.body", "B.body")),
    )


@pytest.mark.parametrize(("key", "value"), [("driven", "turn"), ("value", "2 * turn")])
def test_a_control_drives_an_element(key: str, value: str) -> None:
    rows = {"A": {"kind": "R", "theta": 0.3, key: value}, "B": {"kind": "C", key: ["", value]}}
    network = load_network({"controls": {"turn": {}}, "dh": {"elements": rows}})
    drive = Expression(value)
    assert [joint.drives for joint in network.joints] == [(drive,), (None, drive)]


# --- robots


def expected_poses(name: str, chain: Chain, q: FloatArray) -> Iterator[tuple[str, Transform]]:
    """Yield the moving frame of each joint, and the tool."""
    *_, last = moving = [*iter_frames(chain, list(q))][1:]
    for joint, frame in zip(chain.joints, moving, strict=True):
        yield f"{name}.{joint.name}", frame
    yield f"{name}.tool", last @ chain.tip @ chain.tool


def check_poses(network: Network, chain: Chain, q: FloatArray) -> None:
    """Compare an arm with the frames of its chain; a control drives joints that others follow."""
    mechanism = build_mechanism(network)
    of = {f"arm.{key}": row for key, row in zip(chain.coordinates, q, strict=True)}
    of |= {control_name("arm", key): row for key, row in zip(chain.coordinates, q, strict=True)}
    poses = mechanism.poses(np.array([of[variable.owner] for variable in mechanism.variables]))
    for body, frame in expected_poses("arm", chain, q):
        pose = poses[body]
        for found, expected in zip(
            (*pose.rotation, pose.translation), (*frame.rotation, frame.translation), strict=True
        ):
            for a, b in zip(found, expected, strict=True):
                np.testing.assert_allclose(a, b, rtol=0, atol=ROBOT_EXACT, err_msg=body)


@pytest.mark.parametrize("robot", robot_names())
def test_a_robot_of_the_catalogue_moves_as_its_chain_within_its_limits(robot: str) -> None:
    network = load_network({"chains": {"arm": {"robot": robot}}})
    chain = load_robot(robot)
    bodies = [f"arm.{joint.name}" for joint in chain.joints] + ["arm.tool"]
    assert [body.name for body in network.bodies] == bodies
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (len(chain.coordinates), 7))
    check_poses(network, chain, q)
    start = {f"arm.{key}": (value,) for key, value in zip(chain.coordinates, chain.start, strict=True)}
    assert all(joint.start == start[joint.name] for joint in network.joints if joint.name in start)
    limits = {joint.name: joint.limits for joint in network.joints if joint.limits}
    assert limits == {
        f"arm.{joint.name}": ((joint.lower, joint.upper),)
        for joint in chain.joints
        if joint.kind != "fixed" and (math.isfinite(joint.lower) or math.isfinite(joint.upper))
    }


@pytest.mark.slow
@given(st.data())
def test_any_chain_moves_as_its_frames(chains: SearchStrategy[Chain], data: DataObject) -> None:
    chain = data.draw(chains)
    parts = chain_to_parts("arm", chain, "ground", chain.start, {})
    network = Network("arm", parts.bodies, parts.joints, (), parts.controls)
    rows = st.lists(st.floats(-3.0, 3.0), min_size=len(chain.coordinates), max_size=len(chain.coordinates))
    check_poses(network, chain, np.array([data.draw(rows)]).T)


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

CARRIED = """
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


def read_carried(folder: Path, text: str = "") -> Network:
    """Return a gripper on a carriage, with further tables."""
    (folder / "gripper.toml").write_text(GRIPPER, encoding="utf-8")
    (folder / "carried.toml").write_text(CARRIED + text, encoding="utf-8")
    return load_network(folder / "carried.toml")


def test_a_control_drives_a_joint_and_those_that_follow_it(tmp_path: Path) -> None:
    network = read_carried(tmp_path)
    assert network.controls == (Control("g_left", 0.02),)
    drives = {joint.name: [drive and drive.text for drive in joint.drives] for joint in network.joints}
    assert drives == {
        "rail": [None],
        "g.wrist": [None],
        "g.left": ["g_left"],
        "g.camera": [],
        "g.right": ["g_left * -2.0 + 0.03"],
        "g.tool": [],
    }
    wrist = network.joints[1]
    assert (wrist.start, wrist.bodies) == ((np.pi / 2.0,), ("carriage", "g.wrist"))
    mechanism, chain = build_mechanism(network), load_robot(tmp_path / "gripper.toml")
    assert [variable.owner for variable in mechanism.variables] == ["g_left", "rail", "g.wrist"]
    poses = mechanism.poses([0.05, 0.3, 0.7])
    for body, frame in expected_poses("g", chain, np.array([0.7, 0.05])):
        assert_frames(poses[body], Transform(translation=(0.0, 0.3, 0.0)) @ frame, ROBOT_EXACT)


def test_controls_and_elements_of_the_file_are_those_of_the_chain_too(tmp_path: Path) -> None:
    network = read_carried(
        tmp_path,
        '\n[controls]\ns = { start = 5 }\n[chains.g.value]\nwrist = "2 * s"\nleft = "s"\n'
        '[elements.rod]\nkind = "gg"\nbodies = ["g.tool", "ground"]\nd = 500\n',
    )
    assert network.controls == (Control("s", 5.0), Control("g_left", 0.02, value=Expression("(s) * 0.001")))
    drives = {joint.name: joint.values for joint in network.joints}
    assert drives["g.wrist"] == (Expression("(2 * s) * pi / 180"),)
    assert drives["g.right"] == (Expression("g_left * -2.0 + 0.03"),)
    assert (network.elements[0].bodies, network.bodies[0]) == (("g.tool", "ground"), Body("carriage"))


@pytest.mark.parametrize(
    ("name", "control"), [("arm", "arm_q1"), ("left arm", "left_arm_q1"), ("1", "_1_q1"), ("a.b", "a_b_q1")]
)
def test_names_of_controls_are_names_in_expressions(name: str, control: str) -> None:
    assert control_name(name, "q1") == control
    assert Expression(control).names == {control}


# --- pairs


def test_errors_of_pairs_are_reported_at_once() -> None:
    pairs = {
        "p1": {"kind": "gear", "joints": ["A", "a"], "teeth": [20, 0]},
        "p2": {"kind": "gear", "joints": ["A", "A"], "teeth": [-20, -30]},
        "p3": {"kind": "rack", "joints": ["S", "A"], "radius": 0, "teeth": [1, 2]},
        "p4": {"kind": "cam", "joints": ["A"], "profile": [[0, 0], [20, 1], [20, 2]]},
        "p5": {"kind": "cam", "joints": ["A", "S"], "profile": [[0, 0], [9, 1], [50, 2], [360, 1]]},
        "p6": {"kind": "cam", "joints": ["A", "S"], "profile": [[0, 0], "x"], "offset": "speed"},
        "p7": {"kind": "rack", "joints": ["A", "S"]},
        "p8": {"kind": "cam", "joints": ["A", "S"]},
    }
    teeth = "allowed: two numbers other than 0, at most one of them negative: that of an internal wheel"
    assert refusal(NetworkError, lambda: load_network({**RACK, "elements": pairs})).splitlines() == [
        f"elements.{line}"
        for line in (
            "p3.teeth: unknown; allowed: kind, joints, offset, radius",
            "p6.profile[1]: found 'x', allowed: [angle, lift], two finite numbers",
            "p7.radius: found nothing, allowed: a finite number",
            "p8.profile: found nothing, allowed: a list of [angle, lift], or a .csv file",
            "p1.joints: joint found 'a' (did you mean A?), allowed: A, S",
            f"p1.teeth: found 20, 0, {teeth}",
            "p2.joints: found A twice, allowed: two joints",
            f"p2.teeth: found -20, -30, {teeth}",
            "p3.joints: found S, a prismatic joint, allowed as the first of a rack:"
            " revolute, cylindrical, helical",
            "p3.joints: found A, a revolute joint, allowed as the second of a rack: prismatic, cylindrical",
            "p3.radius: found 0 m, allowed: a radius other than 0, 1e+09 m at most;"
            " its sign is that of the motion",
            "p4.joints: found 1, allowed: the names of two joints",
            "p4.profile: found 3 points, allowed: 4 to 1000",
            "p4.profile[2]: found the angle 0.349066 rad after 0.349066 rad, allowed: angles that increase",
            "p5.profile: found angles over 6.28319 rad, allowed: less than a full turn:"
            " the first point repeats after it",
            "p6.offset: control found 'speed', allowed: turn",
        )
    ]


def test_joints_that_could_not_be_read_are_no_errors_of_their_pairs() -> None:
    unread = {**GEARED, "joints": {**GEARED["joints"], "B": {**GEARED["joints"]["B"], "kind": "round"}}}
    text = refusal(NetworkError, lambda: load_network(unread))
    assert text.startswith("joints.B.kind: found 'round'")
    assert "\n" not in text

    chain = {**unread, "chains": {"arm": {"robot": "ur50"}}}
    chain["elements"] = {"pair": {**GEARED["elements"]["pair"], "joints": ["A", "arm.elbow"]}}
    assert "elements" not in refusal(NetworkError, lambda: load_network(chain))


def test_the_bodies_of_a_pair_in_python_are_those_of_its_joints() -> None:
    network = load_network(GEARED)
    pair = replace(network.elements[0], bodies=("ground", "b"))
    text = refusal(NetworkError, lambda: replace(network, elements=(pair,)))
    assert text == "elements.pair.bodies: found ground, b, allowed: those of its joints, a, b"


def test_a_profile_is_read_from_a_csv_file_in_the_folder_of_the_network(tmp_path: Path) -> None:
    (tmp_path / "lift.csv").write_text("angle,lift\n" + "".join(f"{a},{b}\n\n" for a, b in UNEVEN))
    (tmp_path / "net.toml").write_text(
        'angle_unit = "deg"\nlength_unit = "mm"\n[bodies]\na = {}\ns = {}\n'
        '[joints.A]\nkind = "revolute"\nbodies = ["ground", "a"]\nn = [0, 0, 1]\n'
        '[joints.S]\nkind = "prismatic"\nbodies = ["ground", "s"]\n'
        '[elements.lift]\nkind = "cam"\njoints = ["A", "S"]\nprofile = "lift.csv"\n'
    )
    assert load_network(tmp_path / "net.toml").elements[0].profile == load_network(CAM).elements[0].profile


FORM = ", allowed: angle,lift, two finite numbers"


@pytest.mark.parametrize(
    ("content", "lines"),
    [
        ("0,0\n1;2\n3,inf\n4,5,6\n7,8\n", [
            f"lift.csv, line 2: found '1;2'{FORM}",
            f"lift.csv, line 3: found '3,inf'{FORM}",
            f"lift.csv, line 4: found '4,5,6'{FORM}",
        ]),
        ("x,1\n" * 13, [
            *(f"lift.csv, line {line}: found 'x,1'{FORM}" for line in range(1, 11)),
            "lift.csv: 3 more such lines",
        ]),
        (None, [
            "'lift.csv' cannot be read: No such file or directory; allowed: a .csv file of two columns",
        ]),
        ("\udcff", ["'lift.csv' cannot be read: it is no text; allowed: a .csv file of two columns"]),
    ],
)  # fmt: skip
def test_errors_of_a_file_of_a_profile_have_its_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str | None, lines: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path("lift.csv").write_text(content, encoding="utf-8", errors="surrogateescape")
    tables = {**CAM, "elements": {"pair": {**CAM["elements"]["pair"], "profile": "lift.csv"}}}
    expected = [f"elements.pair.profile: {line}" for line in lines]
    assert refusal(NetworkError, load_network, tables).splitlines() == expected
