"""What a chain is, and what it refuses."""

from __future__ import annotations

import math

import pytest

from urmpipe_models.arm.chain import AXIS_TOLERANCE, Chain, Joint, Mimic
from urmpipe_models.arm.geometric_models import urm_chain
from urmpipe_models.errors import RobotError
from urmpipe_models.math3d import Transform, translation


def test_coordinates_are_the_joints_that_move_by_themselves() -> None:
    chain = Chain(
        "arm",
        (
            Joint("mount", "fixed"),
            Joint("turn"),
            Joint("follow", mimic=Mimic("turn", 2.0)),
            Joint("slide", "prismatic"),
        ),
    )
    assert chain.coordinates == ("turn", "slide")
    assert [joint.name for joint in chain.moving] == ["turn", "slide"]
    assert chain.start == (0.0, 0.0)
    assert chain.point_names == ("p1", "p2", "p3", "p4")


def test_placed_changes_base_and_tool_alone() -> None:
    chain = Chain("arm", (Joint("turn"),), tool=translation(0.0, 0.0, 0.1))
    base = translation(1.0, 2.0, 3.0)
    assert chain.placed(base).base == base
    assert chain.placed(base).tool == chain.tool
    assert chain.placed(tool=base) == Chain("arm", (Joint("turn"),), tool=base)
    assert chain.placed() == chain


def test_everything_wrong_is_said_at_once() -> None:
    with pytest.raises(RobotError) as caught:
        Chain(
            "arm",
            (
                Joint("a", axis=(0.0, 0.0, 2.0)),
                Joint("b", lower=1.0, upper=-1.0, velocity=0.0, acceleration=-1.0),
                Joint("b"),
                Joint("c", mimic=Mimic("d")),
            ),
            start=(0.0,),
        )
    assert str(caught.value).splitlines() == [
        "robot arm: joint names repeat: b; allowed: each once",
        "robot arm: joint a: axis [0.0, 0.0, 2.0] has length 2; allowed: 1",
        "robot arm: joint b: lower limit 1 above upper -1",
        "robot arm: joint b: velocity 0; allowed: more than 0",
        "robot arm: joint b: acceleration -1; allowed: more than 0",
        "robot arm: joint c mimics d, no moving joint of the chain; allowed: a, b, b",
        "robot arm: start has 1 values; allowed: 3, one a coordinate",
    ]


def test_limits_may_meet_a_rate_may_be_small_and_an_axis_may_be_rounded() -> None:
    held = Joint("held", lower=0.5, upper=0.5, velocity=1e-9, acceleration=1e-9)
    for length in (1.0 - 0.9 * AXIS_TOLERANCE, 1.0 + 0.9 * AXIS_TOLERANCE):
        assert Chain("arm", (held, Joint("turn", axis=(0.0, length, 0.0)))).coordinates == ("held", "turn")
    for length in (1.0 - 1.1 * AXIS_TOLERANCE, 1.0 + 1.1 * AXIS_TOLERANCE):
        with pytest.raises(RobotError, match=r"joint turn: axis \[.*\] has length 1; allowed: 1$"):
            Chain("arm", (Joint("turn", axis=(0.0, length, 0.0)),))


def test_limits_and_speeds_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(RobotError) as caught:
        joints = Joint("a", lower=math.nan), Joint("b", upper=math.nan), Joint("c", velocity=math.nan)
        Chain("arm", (*joints, Joint("d", acceleration=math.nan)))
    assert str(caught.value).splitlines() == [
        "robot arm: joint a: lower limit nan above upper inf",
        "robot arm: joint b: lower limit -inf above upper nan",
        "robot arm: joint c: velocity nan; allowed: more than 0",
        "robot arm: joint d: acceleration nan; allowed: more than 0",
    ]


def test_a_chain_without_a_moving_joint_is_none() -> None:
    with pytest.raises(RobotError) as caught:
        Chain("rod", (Joint("a", "fixed"),))
    assert str(caught.value) == "robot rod: has no moving joint; at least one is needed"


def test_a_chain_shows_itself_by_its_coordinates_and_a_row_a_joint() -> None:
    joints = (Joint("a<b", lower=-1.5, upper=2.0), Joint("c", "prismatic"), Joint("d", "fixed"))
    chain = Chain("arm", joints, description="a test")
    assert repr(chain) == "<Chain arm: a test, 2 coordinates (a<b, c)>"
    assert chain._repr_html_() == (
        "<p><b>Chain</b> arm: a test, 2 coordinates (a&lt;b, c)</p>"
        "<table><tr><th>joint</th><th>kind</th><th>lower</th><th>upper</th></tr>"
        "<tr><td>a&lt;b</td><td>revolute</td><td>-1.5</td><td>2</td></tr>"
        "<tr><td>c</td><td>prismatic</td><td>-inf</td><td>inf</td></tr>"
        "<tr><td>d</td><td>fixed</td><td>-inf</td><td>inf</td></tr></table>"
    )
    assert repr(Chain("rod", (Joint("a"),))) == "<Chain rod: 1 coordinate (a)>"


def test_urm_modules_are_joints_about_z_and_a_tilted_effector() -> None:
    chain = urm_chain("two", (0.3, 0.2, 0.1), (0.5, math.pi / 2), directions=(1, -1), start=(0.1, 0.2))
    assert chain.coordinates == ("phi1", "phi2")
    assert [joint.axis for joint in chain.moving] == [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    assert chain.joints[0].origin == Transform()
    assert chain.joints[1].origin.translation == (0.0, 0.0, 0.3)
    assert (chain.joints[2].name, chain.joints[2].kind) == ("effector", "fixed")
    assert chain.joints[2].origin.rotation == ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
    assert chain.tip == translation(0.0, 0.0, 0.1)
    limits = [(joint.upper, joint.velocity, joint.acceleration) for joint in chain.joints]
    assert limits == [(math.inf,) * 3] * 3


def test_urm_counts_and_directions_must_fit() -> None:
    with pytest.raises(RobotError) as caught:
        urm_chain("odd", (0.3, 0.2), (0.5, 0.5))
    assert str(caught.value) == "robot odd: 2 lengths and 2 tilts; n modules need n + 1 lengths and n tilts"
    with pytest.raises(RobotError) as caught:
        urm_chain("odd", (0.3, 0.2), (0.5,), directions=(2,))
    assert str(caught.value) == "robot odd: directions [2]; allowed: 1 values, each 1 or -1"
