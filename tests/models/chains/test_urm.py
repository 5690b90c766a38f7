"""URM arms by their lengths and tilts."""

from __future__ import annotations

from urmpipe_models.arm.geometric_models import urm_chain


def test_name_start_and_words_go_into_the_chain() -> None:
    chain = urm_chain("two", (0.3, 0.2, 0.1), (0.5, -0.7), start=(1, 2), description="short", source="a test")
    assert (chain.name, chain.start) == ("two", (1.0, 2.0))
    assert (chain.description, chain.source) == ("short", "a test")
    bare = urm_chain("two", (0.3, 0.2, 0.1), (0.5, -0.7))
    assert (bare.start, bare.description, bare.source) == ((0.0, 0.0), "", "")
