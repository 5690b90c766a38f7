"""Messages, escapes and suggestions for any name and text. errors.cases has examples."""

from __future__ import annotations

import html
import json
import os
import re
import shlex
import shutil
import subprocess
import xml.etree.ElementTree as ET
from string import ascii_lowercase, digits

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from urmpipe_models import errors
from urmpipe_models.errors import Finding, Hint
from urmpipe_pipeline.joint_log import LogWarning

any_text = st.text(st.characters(exclude_categories=()))


@pytest.mark.slow
@given(name=st.text(min_size=1, max_size=9))
@example("größe $HOME; 'a' \"b\" `c` \u2019")
@example("q1\xa0\n\x7f\u2028")
def test_any_name_in_a_hint_is_read_back_by_a_shell(name: str) -> None:
    hint = Hint("unit", {name: "deg"})
    if name.isprintable():
        assert shlex.split(str(hint)) == ["--unit", f"{name}=deg"]
    assert errors.escape_line(str(hint)) == str(hint)  # printing leaves it as it is


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_a_shell_reads_a_name_that_is_not_printable() -> None:
    name = "q1\xa0$HOME'\n\u2028\\n;"
    word = str(Hint("time", name)).removeprefix("--time ")
    shell = ["bash", "-c", f"printf %s {word}"]
    done = subprocess.run(shell, capture_output=True, env={**os.environ, "LC_ALL": "C.UTF-8"}, check=True)
    assert done.stdout.decode() == name


HINTS = Hint("time", "none", "leaves it out"), Hint("skip_bad", True, "skips them"), Hint("robot")


@pytest.mark.parametrize("message", [Finding("a", hints=HINTS), LogWarning("b", "a", 2, hints=HINTS)])
def test_a_message_is_a_key_of_a_set_and_a_dict_of_its_fields(message: Finding | LogWarning) -> None:
    assert {message, message} == {message}
    fields = message.to_dict()
    assert fields["message"] == message.sentence()
    assert [Hint(**one) for one in fields["hints"]] == list(HINTS)


@given(any_text)
def test_invisible_characters_are_escapes_in_every_format(text: str) -> None:
    """JSON has the same text; XML the same text but for what it cannot contain."""
    assert errors.escape_line(text).isprintable()
    assert errors.escape_line(text) == text or not text.isprintable()
    assert "\n" not in errors.escape_control_characters(text)
    assert errors.escape_control_characters(text, kept="\n").count("\n") == text.count("\n")
    written = errors.escape_json(json.dumps(text, ensure_ascii=False))
    assert json.loads(written) == text
    assert errors.escape_html(text).isprintable()
    xml = f"<a>{errors.escape_xml(html.escape(text))}</a>"
    for one in (errors.escape_control_characters(text), written, xml):
        assert not re.search("[\x00-\x08\x0b\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]", one)
    invalid = "[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]"
    lines = re.sub(invalid, lambda letter: ascii(letter[0])[1:-1], text)
    lines = lines.replace("\r\n", "\n").replace("\r", "\n")  # as XML reads line ends
    assert (ET.fromstring(xml).text or "") == lines


# No letter twice in a name: then what two names have in common is found without a doubt.
LETTERS = st.lists(st.sampled_from(ascii_lowercase + digits), min_size=2, max_size=12, unique=True)
NAMES = st.lists(LETTERS.map("".join), min_size=1, max_size=30)


@settings(max_examples=40, deadline=None)
@given(NAMES, st.data())
def test_a_name_with_a_letter_missing_is_answered_with_it(names: list[str], data: st.DataObject) -> None:
    meant = data.draw(st.sampled_from(names))
    at = data.draw(st.integers(0, len(meant) - 1))
    written = meant[:at] + meant[at + 1 :]
    assume(written not in names)
    could_be = [one for one in names if any(written == one[:i] + one[i + 1 :] for i in range(len(one)))]
    assert errors.format_suggestion(written.upper(), names) == f" (did you mean {max(could_be)}?)"
