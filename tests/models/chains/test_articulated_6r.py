"""The articulated 6R arm: what it is called, and how its rows stand in the chain."""

from __future__ import annotations

from urmpipe_models.chains.articulated_6r import articulated_6r, articulated_6r_rows
from urmpipe_models.chains.geometric_model import GeometricRow

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


def test_the_last_two_joints_stand_in_the_wrist_centre() -> None:
    wrist = articulated_6r_rows(*LENGTHS[:4])[4:]
    assert wrist == (GeometricRow("R", "x", (0.0, 0.0, 0.0)), GeometricRow("R", "z", (0.0, 0.0, 0.0)))
