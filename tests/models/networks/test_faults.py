"""Errors of networks that Python makes: whole texts. Those of files are in test_file."""

from __future__ import annotations

import math
from typing import Any

import pytest

from asserting import refusal
from urmpipe_models.errors import NetworkError
from urmpipe_models.math3d import Transform, translation
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.parts import Body, ConstraintElement, Control, Expression, Joint, frame_from_axes

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
A = Joint("A", "revolute", ("ground", "b"))
ONE, NAN = Expression("1"), math.nan


def errors(*joints: Joint, **parts: Any) -> list[str]:
    """Return the errors of a network of bodies b and c, a joint A of b to the ground, and further parts."""
    parts = {"bodies": (Body("b"), Body("c")), "name": "net", **parts}
    return refusal(NetworkError, lambda: Network(joints=joints, **parts)).splitlines()


def joint(**changes: Any) -> Joint:
    return Joint(**{"name": "B", "kind": "revolute", "bodies": ("b", "c"), **changes})


def rod(**changes: Any) -> ConstraintElement:
    return ConstraintElement(
        **{"name": "rod", "kind": "gg", "bodies": ("ground", "c"), "length": ONE, **changes}
    )


def user(*motion: str) -> Joint:
    return joint(name="U", kind="user", motion=tuple(map(Expression, motion)))


# --- names and bodies


def test_each_name_is_there_once() -> None:
    again = rod(name="A", length=Expression("b"))
    assert errors(A, A, elements=(again,), controls=(Control("b", 1.0),)) == [
        "joints.A: joints.A has this name, too; allowed: each name once",
        "elements.A: joints.A has this name, too; allowed: each name once",
        "controls.b: bodies.b has this name, too; allowed: each name once",
    ]
    bodies = (Body("b"), Body("ground"), Body("c"), Body("c"))
    assert errors(A, joint(), bodies=bodies) == [
        "bodies.ground: bodies.ground has this name, too; allowed: each name once",
        "bodies.c: bodies.c has this name, too; allowed: each name once",
    ]


def test_a_body_has_the_name_of_the_joint_that_carries_it_unless_it_has_freedoms() -> None:
    carried = Joint("b", "revolute", ("ground", "b"))
    assert Network("net", (Body("b"),), (carried,)).joints == (carried,)
    lines = ["joints.c: bodies.c has this name, too; allowed: each name once"]
    free, bodies = joint(name="c"), (Body("b"), Body("c", (0.0,) * 6))
    assert errors(free, bodies=bodies, elements=(rod(bodies=("ground", "b")),)) == lines


def test_names_that_nobody_sees_and_numbers_of_no_mechanism_are_refused() -> None:
    far = Joint("A", "revolute", ("ground", "b"), (frame_from_axes(X, Y, (1e10, 0.0, 0.0)),) * 2)
    assert errors(far, joint(name=" ")) == [
        "joints. : found ' ' as a name, allowed: one that can be seen",
        "joints.A.a: found 1e+10, allowed: 1e+09 at most, in m or rad",
    ]


def test_a_body_that_a_wrong_name_may_mean_is_not_called_untied() -> None:
    bodies = (Body("b"), Body("wheel"), Body("lost"))
    assert errors(A, joint(bodies=("b", "weel")), bodies=bodies) == [
        "bodies.lost: nothing is tied to it; allowed: bodies with a joint or an element",
        "joints.B.bodies: body found 'weel' (did you mean wheel?), allowed: ground, b, wheel, lost",
    ]


STARTED = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
ONE_START = "allowed: one for all bodies that joints tie together, none for those tied to the ground"


@pytest.mark.parametrize(
    ("bodies", "lines"),
    [
        ((Body("b", (1.0,)),), [
            "bodies.b.start: found 1 numbers, allowed: 6: x, y, z and a rotation vector",
            f"bodies.b.start: found a start, but joints tie it to ground; {ONE_START}",
        ]),
        ((Body("b"), Body("c", (NAN, *STARTED[1:])), Body("d", STARTED), Body("e")), [
            "bodies.c.start: found nan, allowed: a finite number",
            f"bodies.d.start: found a start, but joints tie it to c, which has one; {ONE_START}",
        ]),
    ],
)  # fmt: skip
def test_a_start_is_of_a_body_that_has_freedoms(bodies: tuple[Body, ...], lines: list[str]) -> None:
    free = [Joint(f"J{k}", "global", ("c", body.name)) for k, body in enumerate(bodies[2:])]
    assert errors(A, *free, bodies=bodies, elements=(rod(),) if len(bodies) > 1 else ()) == lines


# --- joints and elements


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"kind": "revolut"}, [
            "B.kind: found 'revolut' (did you mean revolute?),"
            " allowed: revolute, prismatic, cylindrical, helical, global, user",
        ]),
        ({"start": (1.0, 2.0)}, ["B.start: found 2 of them, allowed: 1"]),
        ({"start": (math.inf,)}, ["B.start: found inf, allowed: a finite number"]),
        ({"kind": "helical", "pitch": NAN}, ["B.pitch: found nan, allowed: a finite number"]),
        ({"values": (ONE, None)}, ["B.value: found 2 of them, allowed: 1"]),
        ({"values": (Expression("s"),)}, ["B.value: control found 's', allowed: none"]),
        ({"values": (Expression("1 / 0"),)}, [
            "B.value: found inf where controls start, allowed: a finite number",
        ]),
        ({"kind": "user"}, ["B: found 0 functions, allowed: 9: of m, n and a three each"]),
        ({"kind": "user", "motion": (ONE,) * 9, "start": (1.0,), "values": (ONE,)}, [
            "B.start: found some, allowed: none of a user joint: m, n and a move it",
            "B.value: found some, allowed: none of a user joint: m, n and a move it",
            "B.n: m and n are not orthonormal where controls start:"
            " |m| - 1 = 0.732, |n| - 1 = 0.732, m . n = 3; allowed: 1e-09 at most",
        ]),
        ({"frames": (frame_from_axes(X, (0.0, 1.0 + 1e-8, 0.0), X), Transform())}, [
            "B.n: m and n are not orthonormal in the first body:"
            " |m| - 1 = 0, |n| - 1 = 1e-08, m . n = 0; allowed: 1e-09 at most",
        ]),
        ({"frames": (frame_from_axes((0.6, 0.8, 0.0), Y, X),) * 2}, [
            "B.m: m is not perpendicular to n: m . n = 0.8;"
            " allowed: 1e-09 at most, or no m: then one perpendicular to n is taken",
        ]),
        ({"frames": (Transform(), frame_from_axes((NAN, 0.0, 0.0), Y, X))}, [
            "B.m: m and n are not orthonormal in the second body:"
            " |m| - 1 = nan, |n| - 1 = 0, m . n = 0; allowed: 1e-09 at most",
        ]),
        ({"frames": (Transform((X, Y, (0.0, 0.0, -1.0))), Transform())}, [
            "B: the third axis in the first body is not m x n",
        ]),
        ({"frames": (Transform(), translation(0.0, math.inf, 0.0))}, [
            "B.a: found inf, allowed: a finite number",
        ]),
        ({"limits": ((0.0, 1.0),) * 2}, ["B.lower: found 2 limits, allowed: 1, one pair per variable"]),
        ({"kind": "global", "limits": ((0.0, 1.0),)}, [
            "B.lower: found 1 limits, allowed: none of a global joint",
        ]),
        ({"limits": ((NAN, 1.0),)}, ["B.lower: found nan rad, above upper, 1 rad; allowed: at most upper"]),
    ],
)  # fmt: skip
def test_errors_of_a_joint(changes: dict[str, Any], lines: list[str]) -> None:
    assert errors(A, joint(**changes)) == [f"joints.{line}" for line in lines]


def test_axes_that_are_rounded_are_orthonormal() -> None:
    frames = (frame_from_axes(X, (0.0, 1.0 + 5e-10, 0.0), X), Transform())
    assert Network("net", (Body("b"),), (Joint("A", "revolute", ("ground", "b"), frames),)).joints


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"bodies": ("c", "c")}, "bodies: found c twice, allowed: two bodies"),
        ({"kind": "cc"}, "kind: found 'cc' (did you mean crc?), allowed: gg, eg, crc, gc, gear, rack, cam"),
        ({"kind": "gc", "length": Expression("-1")},
         "d: found -1 m where controls start, allowed: more than 0"),
        ({"kind": "eg", "length": Expression("s")}, "h: control found 's', allowed: none"),
        ({"kind": "eg", "normals": ((1.0, 1.0, 0.0), (2.0, 0.0, 0.0))},
         "n: is not a unit vector: |n| - 1 = 0.414; allowed: 1e-09 at most"),
        ({"kind": "crc", "normals": (X, (2.0, 0.0, 0.0))},
         "n: is not a unit vector: |n| - 1 = 1; allowed: 1e-09 at most"),
        ({"kind": "gc", "points": ((NAN, 0.0, 0.0), X)}, "a: found nan, allowed: a finite number"),
    ],
)  # fmt: skip
def test_errors_of_an_element(changes: dict[str, Any], line: str) -> None:
    assert errors(A, elements=(rod(**changes),)) == [f"elements.rod.{line}"]


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": "crc", "normals": (X, Y), "length": Expression("0")},
        {"kind": "eg", "length": Expression("-1"), "points": ((NAN, 0.0, 0.0), X)},
        {"kind": "gc", "normals": (X, (2.0, 0.0, 0.0))},
        {"normals": ((2.0, 0.0, 0.0), (2.0, 0.0, 0.0))},
    ],
)
def test_values_that_an_element_does_not_use_are_not_checked(changes: dict[str, Any]) -> None:
    assert Network("net", (Body("b"), Body("c")), (A,), (rod(**changes),)).elements


def test_parallel_lines_are_found_where_joints_start() -> None:
    """The line z of the ground is x of a body that starts turned by a right angle."""
    turned = Joint("A", "revolute", ("ground", "b"), start=(-math.pi / 2.0,))
    lines = rod(kind="crc", bodies=("ground", "b"), normals=(Z, X))
    assert Network("net", (Body("b"),), (A,), (lines,)).elements
    assert errors(turned, bodies=(Body("b"),), elements=(lines,)) == [
        "elements.rod.n: the lines are parallel where assembly starts: |n1 x n2| = 0; allowed: more"
    ]


# --- controls


@pytest.mark.parametrize(
    ("controls", "value", "lines"),
    [
        ((Control("s", 2.0, upper=1.0),), "s", ["s.start: found 2, allowed: -inf to 1"]),
        ((Control("s", NAN),), "s", ["s.start: found nan, allowed: a finite number"]),
        ((Control("s", 1.0, NAN),), "s", ["s.lower: found nan, above upper, inf; allowed: at most upper"]),
        ((
            Control("r", value=Expression("t + 0")),
            Control("t", value=Expression("u * v")),
            Control("u", value=Expression("t")),
            Control("v", value=Expression("v - s")),
            Control("s", 1.0),
        ), "r", [
            "t.value: is a function of itself: t -> u -> t; allowed: functions of other controls",
            "v.value: is a function of itself: v -> v; allowed: functions of other controls",
        ]),
        ((
            Control("s", value=Expression("t / 0")),
            Control("t", 1.0),
            Control("u", value=Expression("s")),
        ), "u", ["s.value: found inf where controls start, allowed: a finite number"]),
    ],
)  # fmt: skip
def test_errors_of_controls(controls: tuple[Control, ...], value: str, lines: list[str]) -> None:
    elements = (rod(length=Expression(value)),)
    assert errors(A, elements=elements, controls=controls) == [f"controls.{line}" for line in lines]


def test_a_control_that_a_wrong_name_may_mean_is_not_called_idle() -> None:
    controls = (Control("speed", 1.0), Control("t", 1.0))
    assert errors(A, elements=(rod(length=Expression("sped")),), controls=controls) == [
        "elements.rod.d: control found 'sped' (did you mean speed?), allowed: speed, t",
        "controls.t: drives nothing; allowed: controls that drive a joint or an element",
    ]


@pytest.mark.parametrize("name", ["pi", "sin", "lambda", "a b", "a-b", "1a", ""])
def test_a_control_has_a_name_for_expressions(name: str) -> None:
    allowed = "a letter, then letters, digits, _; not pi, a function or a word of Python"
    first = errors(A, elements=(rod(),), controls=(Control(name, 1.0),))[0]
    assert first == f"controls.{name}: found {name!r} as a name, allowed: {allowed}"


def test_a_user_joint_is_checked_along_each_control() -> None:
    """m = (cos(s), 0, -sin(s)), n = (0, 1, t): wrong where t is not 0, most where it is -1."""
    moved = user("cos(s)", "0", "-sin(s)", "0", "1", "t * s", "s", "0", "0")
    t = Control("t", 0.0, -1.0, 0.5)
    controls = (Control("s", 0.0, -1.0, 2.0), t)  # t is 0 along s, s along t
    assert Network("net", (Body("b"), Body("c")), (A, moved), controls=controls).joints
    assert errors(A, moved, controls=(Control("s", 1.0, -1.0, 2.0), t)) == [
        "joints.U.n: m and n are not orthonormal at t = -1:"
        " |m| - 1 = 0, |n| - 1 = 0.414, m . n = 0.841; allowed: 1e-09 at most"
    ]


@pytest.mark.parametrize(
    ("control", "line"),
    [
        (
            Control("s", lower=0.0),
            "s = 1: |m| - 1 = 0, |n| - 1 = 1, m . n = 0",
        ),  # an open range: 1 from start
        (Control("s", 0.0, -1.0, 0.0), "s = -1: |m| - 1 = 0, |n| - 1 = nan, m . n = nan"),
    ],
)
def test_a_user_joint_follows_controls_of_controls(control: Control, line: str) -> None:
    moved = user("1", "0", "0", "0", "1 + u", "0", "0", "0", "0")
    assert errors(A, moved, controls=(control, Control("u", value=Expression("sqrt(s)")))) == [
        f"joints.U.n: m and n are not orthonormal at {line}; allowed: 1e-09 at most"
    ]
