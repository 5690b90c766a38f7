"""Gears, racks and cams: closed forms, derivatives against differences, redundancy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from asserting import there
from urmpipe import load_network, network_check, network_drive, network_solve
from urmpipe_models.networks.assembly import assemble
from urmpipe_models.networks.forces import Wrench, compute_forces
from urmpipe_models.networks.mechanism import build_mechanism

UNEVEN = [[10, 0.0], [55, 4.0], [90, 9.0], [200, -3.0], [310, 1.5]]  # deg and mm


def shaft(bodies: tuple[str, str], x: float = 0.0, y: float = 0.0, **more: Any) -> dict[str, Any]:
    """Return a hinge along z at places on the x axes of both bodies."""
    return {"kind": "revolute", "bodies": bodies, "n": [0, 0, 1], "a": [[x, 0, 0], [y, 0, 0]], **more}


def wheels(element: dict[str, Any], **joints: dict[str, Any]) -> dict[str, Any]:
    """Return tables of a driven shaft A, what else is on the ground, and a pair; in mm and deg."""
    names = ["A", *joints]
    return {
        "length_unit": "mm", "angle_unit": "deg",
        "bodies": {name.lower(): {} for name in names},
        "controls": {"turn": {"start": 50}},
        "joints": {"A": shaft(("ground", "a"), driven="turn"), **joints},
        "elements": {"pair": {"joints": ["A", names[-1]], **element}},
    }  # fmt: skip


SLIDE = {"kind": "prismatic", "bodies": ["ground", "s"], "n": [1, 0, 0]}
GEARED = wheels({"kind": "gear", "teeth": [20, 40], "offset": 30}, B=shaft(("ground", "b"), 300))
RACK = wheels({"kind": "rack", "radius": -8, "offset": 3}, S=SLIDE)
CAM = wheels({"kind": "cam", "profile": UNEVEN}, S=SLIDE)
ROUNDING = 1e-12  # [m], [rad]: relations of numbers near 1, solved by Newton steps


def spline_of(profile: list[list[float]]) -> CubicSpline:
    """Return SciPy's periodic spline of a profile in [deg] and [mm], in [rad] and [m]."""
    x, y = np.array([*profile, [profile[0][0] + 360, profile[0][1]]]).T
    return CubicSpline(np.radians(x), 1e-3 * y, bc_type="periodic", extrapolate="periodic")


LIFT = float(spline_of(UNEVEN)(math.radians(40)))  # m
INTERNAL = wheels({"kind": "gear", "teeth": [20, -80]}, B=shaft(("ground", "b"), 300))
ROCKER = wheels({"kind": "cam", "profile": UNEVEN, "offset": 5}, R=shaft(("ground", "r"), 100))


@pytest.mark.parametrize(
    ("tables", "joint", "turn", "expected"),
    [
        *((GEARED, "B", turn, math.radians(30 - 0.5 * turn)) for turn in (50, -400)),
        *((RACK, "S", turn, 0.003 - 0.008 * math.radians(turn)) for turn in (50, -400)),
        (INTERNAL, "B", 100, math.radians(25)),  # an internal wheel turns the same way
        (ROCKER, "R", 400, math.radians(5 + 1e3 * LIFT)),
    ],
)
def test_a_pair_moves_by_its_closed_form_and_full_turns_count(
    tables: dict[str, Any], joint: str, turn: float, expected: float
) -> None:
    """Joints in [rad] or [m], the first shaft in [deg]."""
    found = there(network_check(tables, controls={"turn": turn}).assemblies[0])
    assert found.values[joint][-1] == pytest.approx(expected, abs=ROUNDING)


def test_full_turns_count_where_neither_joint_is_driven() -> None:
    joints = {**GEARED["joints"], "A": shaft(("ground", "a"), start=900)}
    found = network_check({**GEARED, "controls": {}, "joints": joints}).assemblies[0].values
    assert found["B"][0] == pytest.approx(math.pi / 6 - 0.5 * found["A"][0], abs=ROUNDING)
    assert found["A"][0] > 4 * math.pi  # near its start, 5 pi


def test_a_planetary_gear_moves_by_the_equation_of_willis() -> None:
    """Of a fixed ring, (w_ring - w_carrier) / (w_sun - w_carrier) = -z_sun / z_ring."""
    tables = {
        "angle_unit": "deg",
        "bodies": {name: {} for name in ("carrier", "sun", "planet", "ring")},
        "controls": {"turn": {"start": 40}},
        "joints": {
            "arm": shaft(("ground", "carrier"), driven="turn"),
            "sun_shaft": shaft(("carrier", "sun")),
            "planet_shaft": shaft(("carrier", "planet"), 0.06),
            "ring_shaft": shaft(("carrier", "ring")),
            "frame": {"kind": "user", "bodies": ["ground", "ring"],
                      "m": [1, 0, 0], "n": [0, 1, 0], "a": [0, 0, 0]},
        },
        "elements": {
            "outer": {"kind": "gear", "joints": ["sun_shaft", "planet_shaft"], "teeth": [20, 20]},
            "inner": {"kind": "gear", "joints": ["planet_shaft", "ring_shaft"], "teeth": [20, -60]},
        },
    }  # fmt: skip
    found = network_check(tables)
    sun = found.assemblies[0].values["sun_shaft"][0] + math.radians(40)
    assert sun == pytest.approx((1 + 60 / 20) * math.radians(40), abs=ROUNDING)
    assert (there(found.mobility).mobility, found.structure) == (1, "closed chain")


def test_joints_of_denavit_hartenberg_elements_and_of_arms_are_coupled() -> None:
    tables = {
        "angle_unit": "deg",
        "dh": {"elements": {"J": {"kind": "R"}, "K": {"kind": "P"}}},
        "chains": {"arm": {"robot": "ur5e"}},
        "elements": {
            "belt": {"kind": "rack", "joints": ["J", "K"], "radius": 0.05, "offset": 0.1},
            "wrist": {"kind": "gear", "joints": ["arm.wrist_1_joint", "arm.wrist_2_joint"], "teeth": [1, -2]},
        },
    }
    values = network_check(tables).assemblies[0].values
    assert values["K"][0] == pytest.approx(0.1 + 0.05 * values["J"][0], abs=ROUNDING)
    wrists = [values[f"arm.wrist_{k}_joint"][0] for k in (1, 2)]
    assert wrists[1] == pytest.approx(0.5 * wrists[0], abs=ROUNDING)


def test_what_a_gear_is_off_by_is_an_angle() -> None:
    blocked = {**GEARED, "joints": {**GEARED["joints"], "B": shaft(("ground", "b"), 300, value=0)}}
    found = network_solve(blocked, controls={"turn": 20}, restarts=1)
    assert [(one.name, one.metres) for one in found.closure_errors] == [("pair", 0.0)]
    assert found.closure_errors[0].radians == pytest.approx(math.radians(20), abs=ROUNDING)


def test_a_driven_cam_moves_its_follower_with_the_derivatives_of_its_spline() -> None:
    motion = network_drive(CAM, {"turn": (0, 720)}, duration=1.0, torques={"S": -50.0})
    spline, rate = spline_of(UNEVEN), 4 * math.pi  # rad/s of the uniform drive
    angle = motion.joint_motion[0][:, motion.joints.index("A")]
    for order, values in enumerate(motion.joint_motion):
        expected = spline(angle, order) * rate**order
        # rounding: lifts of 0.01 m, rates of 0.3 m/s, accelerations of 10 m/s2
        np.testing.assert_allclose(values[:, motion.joints.index("S")], expected, atol=1e-12)
    assert angle[-1] == pytest.approx(4 * math.pi, abs=ROUNDING)


@pytest.mark.parametrize("is_cut", [False, True])
def test_a_load_on_a_wheel_is_held_by_the_drive_through_the_gear(is_cut: bool) -> None:
    """By virtual work; no joint transmits a moment about the axis of the wheel that is free to turn."""
    tables: dict[str, Any] = {**GEARED, "joints": dict(GEARED["joints"])}
    if is_cut:  # a second hinge in line with the first closes a loop
        tables["joints"]["C"] = shaft(("ground", "b"), 300)
        tables["elements"] = {"pair": {**GEARED["elements"]["pair"], "joints": ["A", "C"]}}
    mechanism = build_mechanism(load_network(tables))
    x, driven = assemble(mechanism).x, mechanism.controls
    free = np.setdiff1d(np.arange(len(x)), driven)
    forces = compute_forces(mechanism, x, driven, free, [Wrench("b", moment=(0.0, 0.0, 5.0))])
    assert forces.drives.item() == pytest.approx(2.5 * math.pi / 180, abs=ROUNDING)  # per unit of turn, 1 deg
    assert forces.reactions["A"][4].item() == pytest.approx(2.5, abs=ROUNDING)
    assert forces.reactions["pair"].item() == pytest.approx(-5.0, abs=ROUNDING)
    for name in tables["joints"].keys() - {"A"}:
        assert forces.reactions[name][4].item() == pytest.approx(0.0, abs=ROUNDING)
