"""What is wrong with networks that Python makes: whole texts."""

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
ONE = Expression("1")
NAN = math.nan


def complaints(*joints: Joint, **parts: Any) -> list[str]:
    """What is wrong with a network of a body b, a joint A to the ground, and further parts."""
    parts = {"bodies": (Body("b"), Body("c")), "name": "net", **parts}
    return refusal(NetworkError, lambda: Network(joints=joints, **parts)).splitlines()


def rod(**changes: Any) -> ConstraintElement:
    return ConstraintElement(
        **{"name": "rod", "kind": "gg", "bodies": ("ground", "c"), "length": ONE, **changes}
    )


def with_joint(**changes: Any) -> list[str]:
    return complaints(A, Joint(**{"name": "B", "kind": "revolute", "bodies": ("b", "c"), **changes}))


def with_rod(**changes: Any) -> list[str]:
    return complaints(A, elements=(rod(**changes),))


def with_controls(*controls: Control, value: str = "1") -> list[str]:
    return complaints(A, elements=(rod(length=Expression(value)),), controls=controls)


def test_a_network_without_faults_is_made() -> None:
    assert Network("net", (Body("b"), Body("c")), (A,), (rod(),)).body_names == ("ground", "b", "c")


def test_a_network_needs_something_between_bodies() -> None:
    assert complaints(bodies=()) == ["joints: found none, and no elements; allowed: at least one of them"]


def test_a_name_is_there_once() -> None:
    again = rod(name="A", length=Expression("b"))
    assert complaints(A, A, elements=(again,), controls=(Control("b", 1.0),)) == [
        "joints.A: joints.A has this name, too; allowed: each name once",
        "elements.A: joints.A has this name, too; allowed: each name once",
        "controls.b: bodies.b has this name, too; allowed: each name once",
    ]
    bodies = (Body("b"), Body("ground"), Body("c"), Body("c"))
    assert complaints(A, Joint("B", "global", ("b", "c")), bodies=bodies) == [
        "bodies.ground: bodies.ground has this name, too; allowed: each name once",
        "bodies.c: bodies.c has this name, too; allowed: each name once",
    ]


def test_a_body_has_the_name_of_the_joint_that_carries_it_unless_it_moves_by_itself() -> None:
    carried = Joint("b", "revolute", ("ground", "b"))
    assert Network("net", (Body("b"),), (carried,)).joints == (carried,)
    free = Joint("c", "revolute", ("b", "c"))
    element = ConstraintElement("rod", "gg", ("ground", "b"), ONE)
    lines = ["joints.c: bodies.c has this name, too; allowed: each name once"]
    assert complaints(free, bodies=(Body("b"), Body("c", (0.0,) * 6)), elements=(element,)) == lines


def test_bodies_are_tied_to_something() -> None:
    assert complaints(A) == ["bodies.c: nothing is tied to it; allowed: bodies with a joint or an element"]


def test_a_body_that_a_wrong_name_may_mean_is_not_called_untied() -> None:
    bodies = (Body("b"), Body("wheel"), Body("lost"))
    assert complaints(A, Joint("B", "global", ("b", "weel")), bodies=bodies) == [
        "bodies.lost: nothing is tied to it; allowed: bodies with a joint or an element",
        "joints.B.bodies: body found 'weel' (did you mean wheel?), allowed: ground, b, wheel, lost",
    ]


STARTED = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
ONE_START = "allowed: one for all bodies that joints tie together, none for those tied to the ground"


@pytest.mark.parametrize(
    ("bodies", "lines"),
    [
        ((Body("b", STARTED),), [f"bodies.b.start: found a start, but joints tie it to ground; {ONE_START}"]),
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
    names = [one.name for one in bodies]
    free = [Joint(f"J{k}", "global", ("c", name)) for k, name in enumerate(names[2:])]
    elements = (rod(),) if "c" in names else ()
    assert complaints(A, *free, bodies=bodies, elements=elements) == lines


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"bodies": ("c", "c")}, ["joints.B.bodies: found c twice, allowed: two bodies"]),
        ({"kind": "revolut"}, [
            "joints.B.kind: found 'revolut' (did you mean revolute?),"
            " allowed: revolute, prismatic, cylindrical, helical, global, user",
        ]),
        ({"start": (1.0, 2.0)}, ["joints.B.start: found 2 of them, allowed: 1"]),
        ({"start": (math.inf,)}, ["joints.B.start: found inf, allowed: a finite number"]),
        ({"kind": "helical", "pitch": NAN}, ["joints.B.pitch: found nan, allowed: a finite number"]),
        ({"values": (ONE, None)}, ["joints.B.value: found 2 of them, allowed: 1"]),
        ({"values": (Expression("s"),)}, ["joints.B.value: control found 's', allowed: none"]),
        ({"values": (Expression("1 / 0"),)}, [
            "joints.B.value: found inf where controls start, allowed: a finite number",
        ]),
        ({"kind": "cylindrical", "values": (Expression("sqrt(-1)"), ONE)}, [
            "joints.B.value: found nan where controls start, allowed: a finite number",
        ]),
        ({"kind": "user"}, ["joints.B: found 0 functions, allowed: 9: of m, n and a three each"]),
        ({"kind": "user", "motion": (ONE,) * 9, "start": (1.0,), "values": (ONE,)}, [
            "joints.B.start: found some, allowed: none of a user joint: m, n and a move it",
            "joints.B.value: found some, allowed: none of a user joint: m, n and a move it",
            "joints.B.n: m and n are not orthonormal where controls start:"
            " |m| - 1 = 0.732, |n| - 1 = 0.732, m . n = 3; allowed: 1e-09 at most",
        ]),
        ({"frames": (frame_from_axes(X, (0.0, 1.0 + 1e-8, 0.0), X), Transform())}, [
            "joints.B.n: m and n are not orthonormal in the first body:"
            " |m| - 1 = 0, |n| - 1 = 1e-08, m . n = 0; allowed: 1e-09 at most",
        ]),
        ({"frames": (frame_from_axes((0.6, 0.8, 0.0), Y, X),) * 2}, [
            "joints.B.m: m is not perpendicular to n: m . n = 0.8;"
            " allowed: 1e-09 at most, or no m: then one perpendicular to n is taken",
        ]),
        ({"frames": (Transform(), frame_from_axes((NAN, 0.0, 0.0), Y, X))}, [
            "joints.B.m: m and n are not orthonormal in the second body:"
            " |m| - 1 = nan, |n| - 1 = 0, m . n = 0; allowed: 1e-09 at most",
        ]),
        ({"frames": (Transform((X, Y, (0.0, 0.0, -1.0))), Transform())}, [
            "joints.B: the third axis in the first body is not m x n",
        ]),
        ({"frames": (Transform(), translation(0.0, math.inf, 0.0))}, [
            "joints.B.a: found inf, allowed: a finite number",
        ]),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_joint(changes: dict[str, Any], lines: list[str]) -> None:
    assert with_joint(**changes) == lines


def test_axes_that_are_rounded_are_orthonormal() -> None:
    frames = (frame_from_axes(X, (0.0, 1.0 + 5e-10, 0.0), X), Transform())
    assert Network("net", (Body("b"),), (Joint("A", "revolute", ("ground", "b"), frames),)).joints


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"bodies": ("c", "c")}, ["elements.rod.bodies: found c twice, allowed: two bodies"]),
        ({"kind": "cc"}, [
            "elements.rod.kind: found 'cc' (did you mean crc?),"
            " allowed: gg, eg, crc, gc, gear, rack, cam",
        ]),
        ({"length": Expression("0 / 0")}, [
            "elements.rod.d: found nan where controls start, allowed: a finite number",
        ]),
        ({"length": Expression("0")}, [
            "elements.rod.d: found 0 m where controls start, allowed: more than 0",
        ]),
        ({"kind": "gc", "length": Expression("-1")}, [
            "elements.rod.d: found -1 m where controls start, allowed: more than 0",
        ]),
        ({"kind": "crc", "normals": (X, Y), "length": Expression("-1")}, [
            "elements.rod.d: found -1 m where controls start, allowed: 0 or more",
        ]),
        ({"kind": "eg", "length": Expression("s")}, ["elements.rod.h: control found 's', allowed: none"]),
        ({"kind": "eg", "normals": ((1.0, 1.0, 0.0), (2.0, 0.0, 0.0))}, [
            "elements.rod.n: is not a unit vector: |n| - 1 = 0.414; allowed: 1e-09 at most",
        ]),
        ({"kind": "crc", "normals": (X, (2.0, 0.0, 0.0))}, [
            "elements.rod.n: is not a unit vector: |n| - 1 = 1; allowed: 1e-09 at most",
        ]),
        ({"kind": "gc", "points": ((NAN, 0.0, 0.0), X)}, [
            "elements.rod.a: found nan, allowed: a finite number",
        ]),
        ({"kind": "crc", "normals": (X, (-1.0, 0.0, 0.0))}, [
            "elements.rod.n: the lines are parallel where assembly starts: |n1 x n2| = 0; allowed: more",
        ]),
    ],
)  # fmt: skip
def test_what_is_wrong_with_an_element(changes: dict[str, Any], lines: list[str]) -> None:
    assert with_rod(**changes) == lines


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": "crc", "normals": (X, Y), "length": Expression("0")},
        {"kind": "eg", "length": Expression("-1"), "points": ((NAN, 0.0, 0.0), X)},
        {"kind": "gc", "normals": (X, (2.0, 0.0, 0.0))},
        {"normals": ((2.0, 0.0, 0.0), (2.0, 0.0, 0.0))},
    ],
)
def test_what_means_nothing_for_an_element_is_not_looked_at(changes: dict[str, Any]) -> None:
    assert Network("net", (Body("b"), Body("c")), (A,), (rod(**changes),)).elements


def test_lines_are_held_against_each_other_where_joints_start() -> None:
    """The line z of the ground is x of a body that starts turned by a right angle."""
    turned = Joint("A", "revolute", ("ground", "b"), start=(-math.pi / 2.0,))
    lines = ConstraintElement("rod", "crc", ("ground", "b"), ONE, normals=(Z, X))
    assert Network("net", (Body("b"),), (A,), (lines,)).elements
    assert complaints(turned, bodies=(Body("b"),), elements=(lines,)) == [
        "elements.rod.n: the lines are parallel where assembly starts: |n1 x n2| = 0; allowed: more"
    ]


@pytest.mark.parametrize(
    ("controls", "value", "lines"),
    [
        ((Control("s", 2.0, upper=1.0),), "s", ["controls.s.start: found 2, allowed: -inf to 1"]),
        ((Control("s", NAN),), "s", ["controls.s.start: found nan, allowed: a finite number"]),
        ((Control("s", 1.0, 2.0, 1.0),), "s", [
            "controls.s.lower: found 2, above upper, 1; allowed: at most upper",
        ]),
        ((Control("s", 1.0, NAN),), "s", [
            "controls.s.lower: found nan, above upper, inf; allowed: at most upper",
        ]),
        ((Control("s", 1.0), Control("t", value=Expression("s"))), "1", [
            "controls.s: drives nothing; allowed: controls that drive a joint or an element",
            "controls.t: drives nothing; allowed: controls that drive a joint or an element",
        ]),
        ((Control("speed", 1.0), Control("t", 1.0)), "sped", [
            "elements.rod.d: control found 'sped' (did you mean speed?), allowed: speed, t",
            "controls.t: drives nothing; allowed: controls that drive a joint or an element",
        ]),
        ((Control("s", value=Expression("s + 1")),), "s", [
            "controls.s.value: is a function of itself: s -> s; allowed: functions of other controls",
        ]),
        ((
            Control("r", value=Expression("t + 0")),
            Control("t", value=Expression("u * v")),
            Control("u", value=Expression("t")),
            Control("v", value=Expression("v - s")),
            Control("s", 1.0),
        ), "r", [
            "controls.t.value: is a function of itself: t -> u -> t; allowed: functions of other controls",
            "controls.v.value: is a function of itself: v -> v; allowed: functions of other controls",
        ]),
        ((
            Control("s", value=Expression("t / 0")),
            Control("t", 1.0),
            Control("u", value=Expression("s")),
        ), "u", [
            "controls.s.value: found inf where controls start, allowed: a finite number",
        ]),
    ],
)  # fmt: skip
def test_what_is_wrong_with_controls(controls: tuple[Control, ...], value: str, lines: list[str]) -> None:
    assert with_controls(*controls, value=value) == lines


@pytest.mark.parametrize("name", ["pi", "sin", "lambda", "a b", "a-b", "1a", ""])
def test_a_control_has_a_name_for_expressions(name: str) -> None:
    allowed = "a letter, then letters, digits, _; not pi, a function or a word of Python"
    assert (
        with_controls(Control(name, 1.0))[0]
        == f"controls.{name}: found {name!r} as a name, allowed: {allowed}"
    )


def user(*motion: str) -> Joint:
    return Joint("U", "user", ("b", "c"), motion=tuple(map(Expression, motion)))


def test_a_user_joint_is_looked_at_along_each_control() -> None:
    """m = (cos(s), 0, -sin(s)), n = (0, 1, t): wrong where t is not 0, most where it is -1."""
    joint = user("cos(s)", "0", "-sin(s)", "0", "1", "t * s", "s", "0", "0")
    controls = (Control("s", 0.0, -1.0, 2.0), Control("t", 0.0, -1.0, 0.5))
    assert Network(
        "net", (Body("b"), Body("c")), (A, joint), controls=controls
    ).joints  # t is 0 along s, s along t
    moved = (Control("s", 1.0, -1.0, 2.0), Control("t", 0.0, -1.0, 0.5))
    assert complaints(A, joint, controls=moved) == [
        "joints.U.n: m and n are not orthonormal at t = -1:"
        " |m| - 1 = 0, |n| - 1 = 0.414, m . n = 0.841; allowed: 1e-09 at most"
    ]


def test_a_user_joint_follows_controls_of_controls_and_is_looked_at_near_an_open_range() -> None:
    joint = user("1", "0", "0", "0", "1 + u", "0", "0", "0", "0")
    follower = Control("u", value=Expression("sqrt(s)"))
    assert complaints(A, joint, controls=(Control("s", lower=0.0), follower)) == [
        "joints.U.n: m and n are not orthonormal at s = 1:"
        " |m| - 1 = 0, |n| - 1 = 1, m . n = 0; allowed: 1e-09 at most"
    ]
    assert complaints(A, joint, controls=(Control("s", 0.0, -1.0, 0.0), follower)) == [
        "joints.U.n: m and n are not orthonormal at s = -1:"
        " |m| - 1 = 0, |n| - 1 = nan, m . n = nan; allowed: 1e-09 at most"
    ]


def test_names_that_nobody_sees_and_numbers_of_no_mechanism_are_refused() -> None:
    far = Joint("A", "revolute", ("ground", "b"), (frame_from_axes(X, Y, (1e10, 0.0, 0.0)),) * 2)
    assert complaints(far, Joint(" ", "revolute", ("b", "c"))) == [
        "joints. : found ' ' as a name, allowed: one that can be seen",
        "joints.A.a: found 1e+10, allowed: 1e+09 at most, in m or rad",
    ]
