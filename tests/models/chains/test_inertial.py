"""Masses of a chain: what no body can have is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from asserting import refusal
from urmpipe_models.arm.chain import GRAVITY, Chain, Inertial, Joint, Mimic
from urmpipe_models.drives import Drive, DrivenJoint, Gains, PassiveJoint
from urmpipe_models.errors import RobotError

BALL = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)


def test_a_mass_alone_is_a_point_at_the_origin_of_its_frame() -> None:
    point = Inertial("j", 2.0)
    assert (point.centre, point.inertia, point.source) == ((0.0, 0.0, 0.0), (0.0,) * 6, "")
    assert (point.place, Inertial(None, 2.0).place) == ("joint j", "the base")
    assert Chain("arm", (Joint("j"),), inertials=(point,)).gravity == GRAVITY == (0.0, 0.0, -9.81)


@pytest.mark.parametrize(
    ("mass", "inertia", "fault"),
    [
        (-1.0, (0.0,) * 6, "inertial on joint j: mass -1 kg; allowed: 0 or more"),
        (0.0, BALL, "inertial on joint j: mass 0 with an inertia; allowed: a mass, or no inertia"),
        (
            1.0,
            (-0.1, 0.1, 0.1, 0.0, 0.0, 0.0),
            "inertial on joint j: principal moments -0.1, 0.1, 0.1 kg.m2; allowed: 0 or more",
        ),
        (
            1.0,
            (0.1, 0.1, 0.3, 0.0, 0.0, 0.0),
            "inertial on joint j: principal moments 0.1, 0.1, 0.3 kg.m2; allowed: none above the sum of the"
            " other two",
        ),
    ],
)
def test_masses_that_no_body_has_are_refused(
    mass: float, inertia: tuple[float, float, float, float, float, float], fault: str
) -> None:
    assert list(Inertial("j", mass, inertia=inertia).faults()) == [fault]


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([3, 4, 6]), st.sampled_from(["rod", "plate", "point"]))
def test_a_body_that_was_turned_and_printed_with_few_digits_is_a_body(
    seed: int, digits: int, what: str
) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.5, 1.0, 2)
    moments = {"rod": (0.0, a, a), "plate": (a, b, a + b), "point": (0.0, 0.0, 0.0)}[what]
    turn = Rotation.random(rng=rng).as_matrix()
    matrix = turn @ np.diag(moments) @ turn.T + 1e-20 * rng.normal()
    printed = [
        float(f"{matrix[i, k]:.{digits}g}")
        for i, k in zip((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2), strict=True)
    ]
    ixx, iyy, izz, ixy, ixz, iyz = printed
    assert list(Inertial("j", 1.0, inertia=(ixx, iyy, izz, ixy, ixz, iyz)).faults()) == []


def test_a_chain_says_all_that_is_wrong_with_masses_and_drives_at_once() -> None:
    drive = Drive(2500.0, 5.0, 100.0, 0.0, 0.5, 0.001, 0.5)
    inertials = (Inertial("j", -1.0), Inertial("k", 1.0), Inertial(None, 0.0, inertia=BALL))
    drives = (
        PassiveJoint("j", 0.0, -1.0),
        DrivenJoint("j", drive, 0.005, Gains(1.0, float("nan"), 0.0), 48.0),
        PassiveJoint("frame", 1.0, 0.0),
    )
    joints = (Joint("j", effort=-2.0), Joint("frame", "fixed"))
    said = refusal(RobotError, Chain, "arm", joints, inertials=inertials, drives=drives)
    assert said.splitlines() == [
        "robot arm: joint j: effort -2; allowed: more than 0",
        "robot arm: inertial on joint j: mass -1 kg; allowed: 0 or more",
        "robot arm: inertial on the base: mass 0 with an inertia; allowed: a mass, or no inertia",
        "robot arm: an inertial hangs on k, no joint of the chain; allowed: j, frame",
        "robot arm: drives.j.k: found 0, allowed: a finite number, 1e-09 or more",
        "robot arm: drives.j.l: found -1, allowed: a finite number, 0 or more",
        "robot arm: drives.j.C: found 0, allowed: a finite number, 1e-09 or more",
        "robot arm: drives.j.Kw: found nan, allowed: a finite number",
        "robot arm: drives.frame: found a drive for it, allowed: a joint with a coordinate: j",
        "robot arm: drives.j: found 2 times, allowed: once",
    ]


def test_numbers_that_are_not_finite_and_fixed_mimics_are_refused() -> None:
    nan, inf = float("nan"), float("inf")
    with pytest.raises(RobotError) as error:
        Chain(
            "arm",
            (Joint("j"), Joint("held", "fixed", mimic=Mimic("j"))),
            gravity=(0.0, nan, -9.81),
            inertials=(Inertial("j", inf), Inertial(None, 1.0, (0.0, 0.0, nan), (1.0,) * 6)),
        )
    odd, zeros, ones = "found a number that is not finite in", ", ".join(["0.0"] * 9), ", ".join(["1.0"] * 6)
    assert str(error.value).splitlines() == [
        "robot arm: joint held: is fixed and mimics j; allowed: one of the two",
        f"robot arm: inertial on joint j: {odd} [inf, {zeros}]; allowed: finite",
        f"robot arm: inertial on the base: {odd} [1.0, 0.0, 0.0, nan, {ones}]; allowed: finite",
        "robot arm: gravity [0.0, nan, -9.81]; allowed: finite numbers",
    ]
