"""One line for each finding, whatever its names hold."""

from __future__ import annotations

import html
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.errors import (
    Finding,
    escape_control_characters,
    escape_html,
    escape_json,
    escape_line,
    escape_xml,
    format_value,
)
from urmpipe_models.math3d import Transform


@given(st.text(st.characters(exclude_categories=())))
def test_any_text_becomes_one_printable_line(text: str) -> None:
    line = escape_line(text)
    assert line.isprintable()
    if text.isprintable():
        assert line == text


@given(st.text(st.characters(exclude_categories=())))
def test_what_is_not_seen_stands_as_an_escape_in_every_format(text: str) -> None:
    """JSON holds the same text; XML the same text but for what it cannot hold."""
    assert "\n" not in escape_control_characters(text)
    assert escape_control_characters(text, kept="\n").count("\n") == text.count("\n")
    written = escape_json(json.dumps(text, ensure_ascii=False))
    assert json.loads(written) == text
    assert escape_html(text).isprintable()
    xml = f"<a>{escape_xml(html.escape(text))}</a>"
    for one in (escape_control_characters(text), written, xml):
        assert not re.search("[\x00-\x08\x0b\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]", one)
    holdable = re.sub(
        "[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]", lambda k: ascii(k[0])[1:-1], text
    )
    lines = holdable.replace("\r\n", "\n").replace("\r", "\n")  # as XML reads line ends
    assert (ET.fromstring(xml).text or "") == lines


def test_letters_that_are_merely_unusual_stay() -> None:
    assert (
        escape_control_characters("1\u00a0\u00b0 \u00dc\u200d\u4e2d\U0001f916")
        == "1\u00a0\u00b0 \u00dc\u200d\u4e2d\U0001f916"
    )
    assert escape_control_characters("a\r\nb\u202e\x9b") == r"a\r\nb\u202e\x9b"
    assert escape_xml("a\x1b\x85\u2066") == r"a\x1b&#x85;&#x2066;"


def test_a_finding_shows_what_a_terminal_would_act_on() -> None:
    found = Finding("found 'x'", file="a\x1b[31m\udce4.csv", line=3, column="q\r1")
    assert str(found) == r"a\x1b[31m\udce4.csv:3, column q\r1: found 'x'"


def nested(deep: int) -> list[object]:
    """Return lists within each other."""
    found: list[object] = []
    for _ in range(deep):
        found = [found]
    return found


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
        pytest.param(10**5000, "an int too large to be shown", id="digits"),
        pytest.param(nested(2000), "a list too large to be shown", id="nested"),
    ],
)
def test_a_value_is_told_in_one_short_line(value: object, told: str) -> None:
    assert format_value(value) == told
