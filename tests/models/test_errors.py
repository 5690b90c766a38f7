"""One line for each finding, whatever its names hold."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.errors import Finding, one_line


@given(st.text(st.characters(exclude_categories=())))
def test_any_text_becomes_one_printable_line(text: str) -> None:
    shown = one_line(text)
    assert shown.isprintable()
    if text.isprintable():
        assert shown == text


def test_a_finding_shows_what_a_terminal_would_act_on() -> None:
    found = Finding("found 'x'", file="a\x1b[31m\udce4.csv", line=3, column="q\r1")
    assert str(found) == r"a\x1b[31m\udce4.csv:3, column q\r1: found 'x'"
