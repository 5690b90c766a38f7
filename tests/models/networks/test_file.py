"""Network files: the parts that they describe, and their errors, all at once."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from asserting import refusal
from urmpipe_models.errors import NetworkError
from urmpipe_models.networks.file import Network, load_network, network_names
from urmpipe_models.networks.parts import Body, ConstraintElement, Control, Expression, Joint, frame_from_axes
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.urdf_writer import urdf_text

X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)  # noqa: E741 - the origin


@pytest.fixture
def network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Write a text as net.toml in an empty folder, the working one, and read it."""
    monkeypatch.chdir(tmp_path)

    def read(text: str) -> Network:
        Path("net.toml").write_text(text, encoding="utf-8")
        return load_network("net.toml")

    return read


def complaints(read: Any, text: str) -> list[str]:
    return refusal(NetworkError, read, text).splitlines()


# --- what a file means -----------------------------------------------------------------------------

ALL_KINDS = """
name = "all kinds"
description = "Each kind of joint and element."
source = "made up"
length_unit = "mm"
angle_unit = "deg"
ground = "base"

[controls.s]
start = 200
lower = 100
upper = inf

[controls.t]
value = "2 * s"

[bodies]
base = {}
b = {}
c = {}

[bodies.d]
start = [1, 2, 3, 90, 0, 180]

[joints.R]
kind = "revolute"
bodies = ["base", "b"]
m = [0, 0, 1]
n = [[0, 1, 0], [1, 0, 0]]
a = [100, 0, 0]
start = 90

[joints.P]
kind = "prismatic"
bodies = ["b", "c"]
driven = "s"

[joints.C]
kind = "cylindrical"
bodies = ["base", "c"]
start = [90, 20]
value = ["t / 2", ""]

[joints.H]
kind = "helical"
bodies = ["b", "c"]
pitch = 5
value = 30

[joints.G]
kind = "global"
bodies = ["b", "c"]
start = [0, 0, 180]

[joints.U]
kind = "user"
bodies = ["b", "c"]
m = [1, 0, 0]
n = [0, "cos(0)", 0]
a = ["s", 12.5, 0]

[elements.gg]
kind = "gg"
bodies = ["b", "d"]
a = [[1, 2, 3], [4, 5, 6]]
d = 243.215

[elements.eg]
kind = "eg"
bodies = ["b", "d"]
n = [0, 0, 1]
a = [4, 5, 6]
h = "-t"

[elements.crc]
kind = "crc"
bodies = ["b", "d"]
n = [1, 0, 0]
d = 0

[elements.gc]
kind = "gc"
bodies = ["b", "d"]
n = [0, 0, 1]
a = [[1, 2, 3], [4, 5, 6]]
d = 1
"""

RIGHT = math.pi / 2.0
POINTS = ((0.001, 0.002, 0.003), (0.004, 0.005, 0.006))
MOTION = ("1.0", "0.0", "0.0", "0.0", "cos(0)", "0.0", "(s) * 0.001", "0.0125", "0.0")
FRAMES = (frame_from_axes(Z, Y, (0.1, 0.0, 0.0)), frame_from_axes(Z, X, (0.1, 0.0, 0.0)))
EXPECTED = Network(
    "all kinds",
    (Body("b"), Body("c"), Body("d", (0.001, 0.002, 0.003, RIGHT, 0.0, math.pi))),
    (
        Joint("R", "revolute", ("base", "b"), FRAMES, (RIGHT,)),
        Joint("P", "prismatic", ("b", "c"), values=(Expression("(s) * 0.001"),)),
        Joint("C", "cylindrical", ("base", "c"), start=(RIGHT, 0.02),
              values=(Expression("(t / 2) * pi / 180"), None)),
        Joint("H", "helical", ("b", "c"), values=(Expression(repr(math.radians(30.0))),), pitch=0.005),
        Joint("G", "global", ("b", "c"), start=(0.0, 0.0, math.pi)),
        Joint("U", "user", ("b", "c"), motion=tuple(map(Expression, MOTION))),
    ),
    (
        ConstraintElement("gg", "gg", ("b", "d"), Expression("0.243215"), POINTS),
        ConstraintElement("eg", "eg", ("b", "d"), Expression("(-t) * 0.001"), (O, POINTS[1]), (Z, Y)),
        ConstraintElement("crc", "crc", ("b", "d"), Expression("0.0"), normals=(X, X)),
        ConstraintElement("gc", "gc", ("b", "d"), Expression("0.001"), POINTS, (Z, Y)),
    ),
    (Control("s", 200.0, 100.0), Control("t", value=Expression("2 * s"))),
    "base",
    "Each kind of joint and element.",
    "made up",
)  # fmt: skip


def test_a_file_and_its_tables_are_made_si(network: Any) -> None:
    found = network(ALL_KINDS)
    assert found == load_network(tomllib.loads(ALL_KINDS)) == EXPECTED
    assert (found.length_unit, found.angle_unit) == ("mm", "deg")


def test_a_network_without_a_name_has_that_of_its_file(network: Any) -> None:
    text = '[joints.A]\nkind = "global"\nbodies = ["ground", "b"]\n[bodies.b]\n'
    assert network(text).name == "net"
    assert load_network(tomllib.loads(text)).name == "network"


@pytest.mark.parametrize("name", network_names())
def test_shipped_networks_are_found_in_any_spelling_of_their_names(name: str) -> None:
    found = load_network(name)
    assert found == load_network(name.upper().replace("-", "_"))
    assert found.name == name
    assert found.description


def hinged(**joint: Any) -> Network:
    """Return a door on a hinge along x, in mm and deg."""
    hinge = {"kind": "revolute", "bodies": ["ground", "door"], "n": [1, 0, 0], **joint}
    units = {"length_unit": "mm", "angle_unit": "deg"}
    return load_network({**units, "bodies": {"door": {}}, "joints": {"hinge": hinge}})


def test_limits_are_read_in_the_units_of_the_file() -> None:
    assert hinged().joints[0].limits == ()
    assert hinged(lower=-90).joints[0].limits == ((-math.pi / 2, math.inf),)
    both = hinged(kind="cylindrical", lower=[-180, -20], upper=[180, math.inf])
    assert both.joints[0].limits == ((-math.pi, math.pi), (-0.02, math.inf))


@pytest.mark.parametrize(
    ("n", "m"),
    [
        ((0.0, 0.6, 0.8), (1.0, 0.0, 0.0)),
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((0.6, 0.8, 0.0), (0.8, -0.6, 0.0)),
        ((0.6, 0.0, 0.8), (0.8, 0.0, -0.6)),
    ],
)
def test_m_is_perpendicular_to_n_by_default(n: tuple[float, ...], m: tuple[float, ...]) -> None:
    (frame, _) = hinged(n=n).joints[0].frames
    assert frame.columns[0] == pytest.approx(m, abs=1e-15)  # one projection
    assert frame.columns[1] == n


def test_any_n_has_an_m_that_is_accepted() -> None:
    for angle in [10.0**-k for k in range(17)]:
        network = hinged(n=[[math.cos(angle), 0, math.sin(angle)], [0, 1, 0]])
        assert network.joints[0].frames[1].columns[0] == (1.0, 0.0, 0.0)


# --- errors ----------------------------------------------------------------------------------------


def test_files_that_cannot_be_found_or_parsed_are_refused(network: Any) -> None:
    allowed = f"{', '.join(network_names())}, or a .toml file"
    assert refusal(NetworkError, load_network, "four-baar") == (
        f"unknown network 'four-baar' (did you mean four-bar?); allowed: {allowed}"
    )
    assert complaints(network, "[joints]\na = ") == [
        "net.toml:2: not valid TOML: Invalid value (at end of document)",
    ]
    assert refusal(NetworkError, load_network, "ned.toml") == (
        "ned.toml: cannot be read: No such file or directory (did you mean net.toml?)"
    )


BAD = """# Everything that may be wrong with a network, once.
length_unit = "inch"
angle_unit = "deg"
colour = "red"

[controls]
s = { start = 2, lower = 0, upper = 1 }
u = { lower = 2, upper = 1 }
pi = {}
ring = { value = "round + s" }
round = { value = "2 * ring" }
word = { start = "1" }
half = { value = "limit / 0", start = 1 }
limit = { lower = 0.0, upper = 1.0 }

[bodies]
crank = {}
rod = { start = [0, 0, 0, 0, 0, 0] }
wheel = { start = [0, 0, 1] }
ground = { start = [1, 0, 0, 0, 0, 0] }

[joints.A]
kind = "revolut"
bodies = ["ground", "crank"]

[joints.B]
kind = "revolute"
bodies = ["crank", "rot"]
m = [2, 0, 0]
n = [[0, 1, 0], [0.6, 0.9, 0]]
a = [0, 0, "x"]
driven = "s"
value = "2 * s"

[joints.C]
kind = "cylindrical"
bodies = ["crank", "rod"]
start = 0.3
driven = ["q", ""]
pitch = 0.1

[joints.D]
kind = "global"
bodies = ["rod", "rod"]
value = ["s + ", "1) + (s", "half"]
start = [1, 2, "3"]

[joints.E]
kind = "helical"
bodies = ["rod"]
driven = "s + u"

[joints.F]
kind = "user"
bodies = ["ground", "wheel"]
m = ["cos(limit)", 0, "-sin(limit)"]
n = [0, 1, "limit"]
a = [0, 0]
start = 1

[joints]
G = 3

[joints.H]
kind = "revolute"
bodies = ["ground", "wheel"]
value = ["s", "s"]

[elements.s]
kind = "gg"
bodies = ["rod", "wheel"]
d = "s - 2"

[elements.t]
kind = "eg"
bodies = ["ground", "wheel"]
n = [[0, 1, 0], [0, 1, 0]]
h = [1]

[elements.w]
kind = "crc"
bodies = ["ground", "wheel"]
n = [0, 1, 1]
d = "-limit - 0.1"

[elements.x]
kind = "gc"
bodies = ["ground", "arm.tool"]
n = [0, 1, 0]
a = [0, 0, 0]

[dh]
closed = 1

[dh.elements.J]
kind = "R"
theta = "s"
driven = "sin"

[dh.elements.K]
kind = "X"
body = "crank"

[chains.arm]
robot = "urm66"

[chains.other]
robot = "urm6"
body = "rad"
start = [1, 2]
value = { phi1 = "v", q9 = 1 }
"""

LINES = f"""
net.toml:2: length_unit: found 'inch', allowed: one of m, mm
net.toml:4: colour: unknown; allowed: length_unit, angle_unit, ground, name, description, source, bodies, controls, joints, elements, dh, chains
net.toml:7: controls.s: elements.s has this name, too; allowed: each name once
net.toml:7: controls.s.start: found 2, allowed: 0 to 1
net.toml:8: controls.u.lower: found 2, above upper, 1; allowed: at most upper
net.toml:9: controls.pi: found 'pi' as a name, allowed: a letter, then letters, digits, _; not pi, a function or a word of Python
net.toml:10: controls.ring.value: is a function of itself: ring -> round -> ring; allowed: functions of other controls
net.toml:12: controls.word.start: found '1', allowed: a finite number
net.toml:13: controls.half.start: unknown; allowed: value
net.toml:13: controls.half.value: found nan where controls start, allowed: a finite number
net.toml:18: bodies.rod.start: found a start, but joints tie it to ground; allowed: one for all bodies that joints tie together, none for those tied to the ground
net.toml:19: bodies.wheel.start: found [0, 0, 1], allowed: 6 finite numbers
net.toml:20: bodies.ground.start: found a start of the body that stands still, allowed: none
net.toml:23: joints.A.kind: found 'revolut', allowed: one of revolute, prismatic, cylindrical, helical, global, user (did you mean revolute?)
net.toml:28: joints.B.bodies: body found 'rot' (did you mean rod?), allowed: ground, crank, rod, wheel, J.body, other.phi1, other.phi2, other.phi3, other.phi4, other.phi5, other.phi6, other.effector, other.tool, arm.tool
net.toml:29: joints.B.m: m and n are not orthonormal in the first body: |m| - 1 = 1, |n| - 1 = 0, m . n = 0; allowed: 1e-09 at most
net.toml:30: joints.B.n: m and n are not orthonormal in the second body: |m| - 1 = 1, |n| - 1 = 0.0817, m . n = 1.2; allowed: 1e-09 at most
net.toml:31: joints.B.a: found [0, 0, 'x'], allowed: 3 finite numbers, or two lists of 3
net.toml:33: joints.B.value: found beside driven; allowed: one of the two
net.toml:38: joints.C.start: found 0.3, allowed: 2 finite numbers
net.toml:39: joints.C.driven: control found 'q', allowed: half, limit, pi, ring, round, s, u, word
net.toml:40: joints.C.pitch: unknown; allowed: bodies, kind, m, n, a, start, driven, value, lower, upper
net.toml:44: joints.D.bodies: found rod twice, allowed: two bodies
net.toml:45: joints.D.value: found 's + ', no arithmetic; allowed: numbers, names of controls, pi, + - * / ** and brackets, sin, cos, tan, atan2, sqrt, exp
net.toml:45: joints.D.value: found '1) + (s', no arithmetic; allowed: numbers, names of controls, pi, + - * / ** and brackets, sin, cos, tan, atan2, sqrt, exp
net.toml:46: joints.D.start: found [1, 2, '3'], allowed: 3 finite numbers
net.toml:48: joints.E.pitch: found nothing, allowed: a finite number
net.toml:50: joints.E.bodies: found 1, allowed: the names of two bodies
net.toml:51: joints.E.driven: found 's + u', allowed: the name of a control; a function of controls is a `value`
net.toml:57: joints.F.n: m and n are not orthonormal at limit = 1: |m| - 1 = 0, |n| - 1 = 0.414, m . n = -0.841; allowed: 1e-09 at most
net.toml:58: joints.F.a: found [0, 0], allowed: a list of 3 numbers or expressions
net.toml:59: joints.F.start: unknown; allowed: bodies, kind, m, n, a
net.toml:62: joints.G: found 3, allowed: a table
net.toml:67: joints.H.value: found ['s', 's'], allowed: one, of its only variable
net.toml:72: elements.s.d: found 0 m where controls start, allowed: more than 0
net.toml:77: elements.t.n: found [[0, 1, 0], [0, 1, 0]], allowed: 3 finite numbers
net.toml:78: elements.t.h: found [1], allowed: a finite number, or an expression as a text
net.toml:83: elements.w.n: is not a unit vector: |n| - 1 = 0.414; allowed: 1e-09 at most
net.toml:84: elements.w.d: found -0.1 m where controls start, allowed: 0 or more
net.toml:86: elements.x.d: found nothing, allowed: a finite number, or an expression as a text
net.toml:90: elements.x.a: found [0, 0, 0], allowed: two lists of 3 finite numbers, one for each body
net.toml:93: dh.closed: found 1, allowed: true or false
net.toml:97: dh.elements.J.theta: found 's', allowed: a finite number
net.toml:98: dh.elements.J.driven: found 'sin', allowed: the name of a control; a function of controls is a `value`
net.toml:101: dh.elements.K.kind: found 'X', allowed: one of R, P, C, H
net.toml:102: dh.elements.K.body: bodies.crank has this name, too; allowed: each name once
net.toml:105: chains.arm.robot: unknown robot 'urm66' (did you mean urm6?); allowed: {", ".join(robot_names())}, or a .toml or .urdf file
net.toml:109: chains.other.body: body found 'rad' (did you mean rod?), allowed: ground, crank, rod, wheel, J.body, other.phi1, other.phi2, other.phi3, other.phi4, other.phi5, other.phi6, other.effector, other.tool, arm.tool
net.toml:110: chains.other.start: found [1, 2], allowed: 6 finite numbers: phi1, phi2, phi3, phi4, phi5, phi6
net.toml:111: chains.other.value.q9: coordinate found 'q9', allowed: phi1, phi2, phi3, phi4, phi5, phi6
net.toml:111: chains.other.value.phi1: control found 'v', allowed: half, limit, pi, ring, round, s, u, word
"""  # noqa: E501 - lines as they are printed


def test_everything_is_reported_at_once_by_line(network: Any) -> None:
    assert complaints(network, BAD) == LINES.strip().splitlines()


def test_errors_of_tables_have_no_lines() -> None:
    found = refusal(NetworkError, load_network, tomllib.loads(BAD)).splitlines()
    without = [line.split(": ", 1)[1] for line in LINES.strip().splitlines()]
    assert sorted(found) == sorted(without)


IDLE = """
[controls]
s = {}
idle = { value = "s" }

[bodies.b]
[bodies.lost]

[joints.A]
kind = "global"
bodies = ["ground", "b"]
start = 1
"""

UNREAD_CHAIN = """
[bodies.b]
[chains.arm]
robot = "no"
body = "b"
[elements.rod]
kind = "gg"
bodies = ["arm.tool", "ground"]
d = 1
"""

UNREAD_AXES = """
[bodies.b]
[joints.A]
kind = "revolute"
bodies = ["ground", "b"]
m = 1
n = [1, 0, 0]
value = ""

[joints.B]
kind = "user"
bodies = ["ground", "b"]
m = [1, 0]
n = [1, 0, 0]
a = [0, 0, 0]

[chains.arm]
robot = "\\u0000.toml"
"""

CIRCLE = '[chains.a]\nrobot = "urm4"\nbody = "b.tool"\n[chains.b]\nrobot = "urm4"\nbody = "a.tool"\n'

CRC = """
[bodies.b]
start = [0, 0, 1, 0, 0, TURN]

[elements.E]
kind = "crc"
bodies = ["ground", "b"]
n = [1, 0, 0]
d = 0.1
"""


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("", [": joints: found none, and no elements; allowed: at least one of them"]),
        (IDLE, [
            ":3: controls.s: drives nothing; allowed: controls that drive a joint or an element",
            ":4: controls.idle: drives nothing; allowed: controls that drive a joint or an element",
            ":7: bodies.lost: nothing is tied to it; allowed: bodies with a joint or an element",
            ":12: joints.A.start: found 1, allowed: 3 finite numbers",
        ]),
        (CRC.replace("TURN", "0"), [
            ":8: elements.E.n: the lines are parallel where assembly starts: |n1 x n2| = 0; allowed: more",
        ]),
        (CRC.replace("TURN", "'x'"), [":3: bodies.b.start[5]: found 'x', allowed: a finite number"]),
        ('[dh]\nclosed = true\n[dh.elements.J]\nkind = "R"\nbody = "b"\n', [
            ":3: dh.elements.J: found ground twice, allowed: two bodies",
            ":5: dh.elements.J.body: unknown; allowed: driven, kind, a, alpha, s, theta, value",
        ]),
        (UNREAD_CHAIN, [
            f":4: chains.arm.robot: unknown robot 'no'; allowed: {', '.join(robot_names())},"
            " or a .toml or .urdf file",
        ]),
        (UNREAD_AXES, [
            ":6: joints.A.m: found 1, allowed: 3 finite numbers, or two lists of 3",
            ":8: joints.A.value: found '', allowed: one, of its only variable",
            ":13: joints.B.m: found [1, 0], allowed: a list of 3 numbers or expressions",
            ":18: chains.arm.robot: found '\\x00.toml', allowed: a robot or a file",
        ]),
        (CIRCLE, [
            ":3: chains.a.body: found a body that a carries itself; allowed: another",
            ":6: chains.b.body: found a body that b carries itself; allowed: another",
        ]),
        (f"[controls.s]\nstart = {'9' * 5001}\n", [
            ":2: found an integer of too many digits, allowed: 64 bits at most",
        ]),
    ],
)  # fmt: skip
def test_errors_that_follow_from_others_are_omitted(network: Any, text: str, lines: list[str]) -> None:
    assert complaints(network, text) == [f"net.toml{line}" for line in lines]


def test_lines_that_are_not_parallel_are_accepted(network: Any) -> None:
    assert network(CRC.replace("TURN", "0.1")).elements


def test_an_expression_is_refused_as_it_is_written(network: Any) -> None:
    text = 'angle_unit = "deg"\n[bodies.b]\n[joints.A]\nvalue = "s # x"\nkind = "revolute"\n'
    (line,) = complaints(network, text + 'bodies = ["ground", "b"]')
    assert line.startswith("net.toml:4: joints.A.value: found 's # x', no arithmetic")


@pytest.mark.parametrize(
    ("joint", "lines"),
    [
        ({"lower": "x", "upper": [1, 2]}, [
            "lower: found 'x', allowed: a number", "upper: found [1, 2], allowed: a number",
        ]),
        ({"lower": 90, "upper": -90}, [
            "lower: found 1.5708 rad, above upper, -1.5708 rad; allowed: at most upper",
        ]),
        ({"lower": -90, "upper": 90, "start": 100}, ["start: found 100, allowed: at most upper, 90"]),
        ({"kind": "cylindrical", "lower": 1, "upper": [2, 3]}, ["lower: found 1, allowed: 2 numbers"]),
        ({"kind": "global", "lower": 1}, [
            "lower: unknown; allowed: bodies, kind, m, n, a, start, driven, value",
        ]),
        ({"m": [1, 0, 0]}, [
            "m: m is not perpendicular to n: m . n = 1;"
            " allowed: 1e-09 at most, or no m: then one perpendicular to n is taken",
        ]),
    ],
)  # fmt: skip
def test_errors_of_limits_and_axes(joint: dict[str, Any], lines: list[str]) -> None:
    expected = [f"joints.hinge.{line}" for line in lines]
    assert refusal(NetworkError, lambda: hinged(**joint)).splitlines() == expected


def test_robots_are_read_from_the_folder_of_the_network_and_their_errors_reported(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text('kind = "urm"\nlengths = [1]\n', encoding="utf-8")
    file = tmp_path / "net.toml"
    file.write_text(
        '[chains.arm]\nrobot = "arm.toml"\n[chains.none]\n[chains.two]\nrobot = 2\n', encoding="utf-8"
    )
    assert refusal(NetworkError, load_network, file).splitlines() == [
        f"{file}:2: chains.arm.robot: {tmp_path / 'arm.toml'}: key tilts: found nothing,"
        " allowed: a list of finite numbers",
        f"{file}:3: chains.none.robot: found nothing, allowed: a text",
        f"{file}:5: chains.two.robot: found 2, allowed: a text",
    ]


def test_a_urdf_in_a_network_begins_and_ends_at_its_links(network: Any, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(urdf_text(load_robot("urm4")), encoding="utf-8")
    links = [link.get("name") for link in ElementTree.parse(tmp_path / "arm.urdf").getroot().iter("link")]
    complete = network('[chains.a]\nrobot = "arm.urdf"\n')
    part = network(f'[chains.a]\nrobot = "arm.urdf"\ntip_link = "{links[2]}"\n')
    assert 1 < len(part.joints) < len(complete.joints)
    (line,) = complaints(network, '[chains.a]\nrobot = "urm4"\ntip_link = "x"\n')
    assert line.endswith("robot urm4: found a base or tip link, allowed only for a .urdf file")


@pytest.mark.slow
def test_a_network_too_large_to_be_assembled_is_refused(network: Any) -> None:
    joints = "".join(
        f'[joints.j{k}]\nkind = "revolute"\nbodies = ["b{k}", "b{k + 1}"]\n[bodies.b{k + 1}]\n'
        for k in range(501)
    )
    assert complaints(network, joints.replace('"b0"', '"ground"')) == [
        "net.toml: joints: found 501 with elements and those of chains, allowed: 500 at most"
    ]
