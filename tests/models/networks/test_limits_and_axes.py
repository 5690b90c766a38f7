"""Limits of joints and m by default: read in the units of the file, checked, compared with an assembly."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from asserting import refusal
from urmpipe import load_network, network_check, network_solve
from urmpipe_models.errors import NetworkError
from urmpipe_models.networks.file import Network
from urmpipe_models.robots.catalogue import load_robot


def hinged(**joint: Any) -> dict[str, Any]:
    """Return tables of a door on a hinge along x, in mm and deg."""
    return {
        "length_unit": "mm", "angle_unit": "deg", "bodies": {"door": {}},
        "joints": {"hinge": {"kind": "revolute", "bodies": ["ground", "door"], "n": [1, 0, 0], **joint}},
    }  # fmt: skip


def said(tables: dict[str, Any], **controls: float) -> list[str]:
    """Return the sentences of limits that the assembly of tables is beyond."""
    found = network_check(tables, controls=controls)
    return [one.sentence() for one in found.warnings if one.kind == "beyond-limit"]


def test_limits_are_read_in_the_units_of_the_file() -> None:
    assert load_network(hinged()).joints[0].limits == ()
    assert load_network(hinged(lower=-90)).joints[0].limits == ((-math.pi / 2, math.inf),)
    both = hinged(kind="cylindrical", lower=[-180, -20], upper=[180, math.inf])
    assert load_network(both).joints[0].limits == ((-math.pi, math.pi), (-0.02, math.inf))


@pytest.mark.parametrize(
    ("joint", "lines"),
    [
        ({"lower": "x", "upper": [1, 2]}, [
            "joints.hinge.lower: found 'x', allowed: a number",
            "joints.hinge.upper: found [1, 2], allowed: a number",
        ]),
        ({"lower": 90, "upper": -90}, [
            "joints.hinge.lower: found 1.5708 rad, above upper, -1.5708 rad; allowed: at most upper",
        ]),
        ({"lower": -90, "upper": 90, "start": 100}, [
            "joints.hinge.start: found 100, allowed: at most upper, 90",
        ]),
        ({"kind": "cylindrical", "lower": 1, "upper": [2, 3]}, [
            "joints.hinge.lower: found 1, allowed: 2 numbers",
        ]),
        ({"kind": "global", "lower": 1}, [
            "joints.hinge.lower: unknown; allowed: bodies, kind, m, n, a, start, driven, value",
        ]),
    ],
)  # fmt: skip
def test_wrong_limits_are_reported(joint: dict[str, Any], lines: list[str]) -> None:
    assert refusal(NetworkError, lambda: load_network(hinged(**joint))).splitlines() == lines


@pytest.mark.parametrize(
    ("kind", "limits", "line"),
    [
        ("revolute", ((0.0, 1.0),) * 2, "found 2 limits, allowed: 1, one pair per variable"),
        ("global", ((0.0, 1.0),), "found 1 limits, allowed: none of a global joint"),
        ("revolute", ((math.nan, 1.0),), "found nan rad, above upper, 1 rad; allowed: at most upper"),
    ],
)
def test_wrong_limits_of_a_joint_in_python(kind: Any, limits: Any, line: str) -> None:
    network = load_network(hinged())
    joint = replace(network.joints[0], kind=kind, limits=limits)
    text = refusal(NetworkError, lambda: Network("net", network.bodies, (joint,)))
    assert text == f"joints.hinge.lower: {line}"


DRIVEN: dict[str, Any] = {"driven": "turn", "lower": -30, "upper": 60}


@pytest.mark.parametrize(
    ("turn", "lines"),
    [
        (60, []),
        (360 + 59, []),  # an angle is compared within the full turn that fits
        (-360 - 31, ["joint hinge is at -391 deg, beyond its lower limit, -30 deg"]),
        (61, ["joint hinge is at 61 deg, beyond its upper limit, 60 deg"]),
    ],
)
def test_an_assembly_beyond_a_limit_is_a_warning(turn: float, lines: list[str]) -> None:
    assert said({**hinged(**DRIVEN), "controls": {"turn": {}}}, turn=turn) == lines


def test_turns_of_a_geared_joint_count_against_its_limits() -> None:
    tables = {**hinged(**DRIVEN), "controls": {"turn": {}}}
    tables["bodies"]["wheel"] = {}
    tables["joints"]["shaft"] = {"kind": "revolute", "bodies": ["ground", "wheel"]}
    tables["elements"] = {"mesh": {"kind": "gear", "joints": ["hinge", "shaft"], "teeth": [1, 1]}}
    assert said(tables, turn=360) == ["joint hinge is at 360 deg, beyond its upper limit, 60 deg"]


def test_a_sliding_joint_has_no_turns() -> None:
    rod = hinged(kind="prismatic", driven="turn", upper=5)
    assert said({**rod, "controls": {"turn": {}}}, turn=6) == [
        "joint hinge is at 6 mm, beyond its upper limit, 5 mm"
    ]


def test_only_the_assembly_that_is_shown_counts() -> None:
    tables = load_network("rack-and-pinion")
    found = network_solve(tables, every=True, restarts=100)
    assert max(abs(one.values["left"][0]) for one in found.assemblies) > math.radians(45)
    assert found.warnings == ()


def test_chains_have_the_limits_of_their_robot() -> None:
    robot = load_robot("panda")
    network = load_network({"chains": {"arm": {"robot": "panda"}}})
    limits = {one.name: one.limits for one in network.joints if one.limits}
    assert limits == {f"arm.{one.name}": ((one.lower, one.upper),) for one in robot.moving}
    name, value = robot.moving[3].name, 2.0
    beyond = {"chains": {"arm": {"robot": "panda", "value": {name: value}}}}
    assert said(beyond)[0].startswith(f"joint arm.{name} is at 114.6 deg, beyond its upper limit, ")


# --- m by default


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
    (frame, _) = load_network(hinged(n=n)).joints[0].frames
    assert frame.columns[0] == pytest.approx(m, abs=1e-15)  # one projection
    assert frame.columns[1] == n


def test_any_n_has_an_m_that_is_accepted() -> None:
    for angle in [10.0**-k for k in range(17)]:
        network = load_network(hinged(n=[[math.cos(angle), 0, math.sin(angle)], [0, 1, 0]]))
        assert network.joints[0].frames[1].columns[0] == (1.0, 0.0, 0.0)


def test_an_m_that_is_not_perpendicular_is_reported_with_the_way_out() -> None:
    text = refusal(NetworkError, lambda: load_network(hinged(m=[1, 0, 0])))
    assert text == (
        "joints.hinge.m: m is not perpendicular to n: m . n = 1;"
        " allowed: 1e-09 at most, or no m: then one perpendicular to n is taken"
    )
