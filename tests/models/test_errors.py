"""One line for each finding, whatever its names hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.errors import Finding, shown
from urmpipe_models.messages import one_line
from urmpipe_models.transform import Transform


@given(st.text(st.characters(exclude_categories=())))
def test_any_text_becomes_one_printable_line(text: str) -> None:
    line = one_line(text)
    assert line.isprintable()
    if text.isprintable():
        assert line == text


def test_a_finding_shows_what_a_terminal_would_act_on() -> None:
    found = Finding("found 'x'", file="a\x1b[31m\udce4.csv", line=3, column="q\r1")
    assert str(found) == r"a\x1b[31m\udce4.csv:3, column q\r1: found 'x'"


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("a" * 99, f"'{'a' * 56}..."),
        ([0.5] * 99, "[0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0..."),
        ({"q1": "deg"}, "{'q1': 'deg'}"),
        (None, "None"),
        (Transform(), "a Transform"),
        (object(), "an object"),
        (print, "a builtin_function_or_method"),
        (np.zeros((3, 3)), "a ndarray"),
    ],
)
def test_a_value_is_told_in_one_short_line(value: object, told: str) -> None:
    assert shown(value) == told
