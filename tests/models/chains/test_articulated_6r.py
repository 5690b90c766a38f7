"""The articulated 6R arm: what it is called, and how its rows stand in the chain."""

from __future__ import annotations

from urmpipe_models.arm.geometric_models import articulated_6r

LENGTHS = (0.3, 0.1, 0.45, 0.4, 0.15)


def test_it_has_a_name_of_its_own_and_no_words() -> None:
    chain = articulated_6r(*LENGTHS)
    assert (chain.name, chain.start) == ("articulated6r", (0.0,) * 6)
    assert (chain.description, chain.source) == ("", "")


def test_name_start_and_words_go_into_the_chain() -> None:
    start = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    chain = articulated_6r(*LENGTHS, name="arm", start=start, description="short", source="a test")
    assert (chain.name, chain.start) == ("arm", start)
    assert (chain.description, chain.source) == ("short", "a test")


def test_six_joints_turn_about_z_x_x_z_x_z_the_last_three_in_the_wrist_centre() -> None:
    chain = articulated_6r(*LENGTHS)
    assert {joint.kind for joint in chain.joints} == {"revolute"}
    assert ["xyz"[joint.axis.index(1.0)] for joint in chain.joints] == ["z", "x", "x", "z", "x", "z"]
    heights = [joint.origin.translation for joint in chain.joints]
    assert heights == [(0.0, 0.0, z) for z in (*LENGTHS[:4], 0.0, 0.0)]
    assert chain.tip.translation == (0.0, 0.0, LENGTHS[4])
