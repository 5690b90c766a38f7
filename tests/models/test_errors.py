"""Messages in their three voices, escapes of any text, and suggestions of names."""

from __future__ import annotations

import html
import json
import os
import re
import shlex
import shutil
import subprocess
import tomllib
import xml.etree.ElementTree as ET
from string import ascii_lowercase, digits
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from urmpipe_models.errors import (
    MAX_LISTED,
    Finding,
    Hint,
    LogError,
    OptionError,
    Voice,
    escape_control_characters,
    escape_html,
    escape_json,
    escape_line,
    escape_xml,
    format_names,
    format_suggestion,
    format_unknown_name,
    format_value,
    map_collecting_errors,
    python_command,
    shell_quote,
)
from urmpipe_models.math3d import Transform
from urmpipe_pipeline.joint_log import LogWarning


@pytest.mark.parametrize(
    ("hint", "option", "keyword", "key"),
    [
        (Hint("unit", {"q1": "deg"}), "--unit q1=deg", 'unit={"q1": "deg"}', 'units.q1 = "deg"'),
        (Hint("unit", {"": "deg"}), "--unit deg", 'unit="deg"', 'units."" = "deg"'),
        (Hint("unit", {"q1": "deg", "a b": "mm"}), "--unit q1=deg --unit 'a b=mm'",
         'unit={"q1": "deg", "a b": "mm"}', 'units.q1 = "deg", units."a b" = "mm"'),
        (Hint("interval", {"q 1": None}), "--interval 'q 1='LOW:HIGH", 'interval={"q 1": (LOW, HIGH)}',
         'joints.interval."q 1" = [LOW, HIGH]'),
        (Hint("interval", {"q1": (-1.0, 2.5)}), "--interval q1=-1:2.5", 'interval={"q1": (-1, 2.5)}',
         "joints.interval.q1 = [-1, 2.5]"),
        (Hint("joints", ["a", "b"]), "--joints a,b", 'joints=["a", "b"]', 'joints.column = ["a", "b"]'),
        (Hint("joints"), "--joints A,B,C", "joints=[A, B, C]", "joints.column = [A, B, C]"),
        (Hint("skip_bad", True), "--skip-bad", "skip_bad=True", "--skip-bad"),
        (Hint("tool", [0.0, 0.1]), "--tool 0,0.1", "tool=[0, 0.1]", "--tool 0,0.1"),
        (Hint("audit", call="ingest"), "urmpipe ingest --audit FILE.csv", "ingest(audit=FILE.csv)",
         "urmpipe ingest --audit FILE.csv"),
        (Hint("unit", "deg", robot="ur5e"), "--robot ur5e --unit deg", 'robot="ur5e", unit="deg"',
         'robot = "ur5e", units = "deg"'),
    ],
)  # fmt: skip
def test_a_value_is_spelled_by_its_type(hint: Hint, option: str, keyword: str, key: str) -> None:
    assert hint.format("command line") == option
    assert hint.format("python") == keyword
    assert hint.format("system file") == key


@given(name=st.text(min_size=1, max_size=9))
@example("größe $HOME; 'a' \"b\" `c` \u2019")
@example("q1\xa0\n\x7f\u2028")
def test_any_name_in_a_hint_is_read_back_by_who_reads_the_voice(name: str) -> None:
    hint = Hint("unit", {name: "deg"})
    assert eval(f"dict({hint.format('python')})") == {"unit": {name: "deg"}}  # it is Python
    assert tomllib.loads(hint.format("system file")) == {"units": {name: "deg"}}
    if name.isprintable():
        assert shlex.split(hint.format("command line")) == ["--unit", f"{name}=deg"]
    for voice in get_args(Voice):  # printing leaves them as they are
        assert escape_line(hint.format(voice)) == hint.format(voice)


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_a_shell_reads_a_name_that_is_not_printable() -> None:
    name = "q1\xa0$HOME'\n\u2028\\n;"
    spelled = Hint("time", name).format("command line")
    shell = ["bash", "-c", f"printf %s {spelled.removeprefix('--time ')}"]
    done = subprocess.run(shell, capture_output=True, env={**os.environ, "LC_ALL": "C.UTF-8"}, check=True)
    assert done.stdout.decode() == name


HINTS = (
    Hint("time", "none", "leaves it out"),
    Hint("time", "2", "leaves it out"),
    Hint("skip_bad", True, "skips them"),
    Hint("robot"),
)


@pytest.mark.parametrize(
    ("voice", "hints"),
    [
        ("command line", "--time none or --time 2 leaves it out; --skip-bad skips them;"
         " use --robot NAME|FILE"),
        ("python", 'time="none" or time="2" leaves it out; skip_bad=True skips them; use robot=NAME|FILE'),
        ("system file", 'clock.column = "none" or clock.column = "2" in the map of the log leaves it out;'
         " use robot = NAME|FILE"),
    ],
)  # fmt: skip
def test_what_hints_do_is_told_once_and_no_file_tells_what_it_cannot_say(voice: Voice, hints: str) -> None:
    assert Finding("no clock", "log.csv", 3, hints=HINTS).format(voice) == f"log.csv:3: no clock; {hints}"


def test_the_subject_is_spelled_as_who_reads_it_writes_it() -> None:
    found = Finding(parameter="base_link", found="'a'", allowed="b")
    assert found.format("command line") == "--base-link: found 'a', allowed: b"
    assert str(found) == "base_link: found 'a', allowed: b"
    assert Finding("a", parameter="time").format("system file") == "clock.column: a"


def test_a_warning_tells_log_row_and_column_before_its_sentence() -> None:
    one = LogWarning("gap", "1 s without a row", 5, column="q1").of("left")
    assert str(one) == "left: row 5: q1: 1 s without a row"
    assert one.sentence() == "1 s without a row"


@pytest.mark.parametrize("message", [Finding("a", hints=HINTS), LogWarning("b", "a", 2, hints=HINTS)])
def test_a_message_is_one_line_a_key_of_a_set_and_a_dict_of_its_fields(message: Any) -> None:
    assert {message, message} == {message}
    told = message.to_dict("command line")
    assert told["message"] == message.sentence("command line")
    assert [Hint(**one) for one in told["hints"]] == list(HINTS)


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


# No letter twice in a name: then what two names have in common is found without a doubt.
LETTERS = st.lists(st.sampled_from(ascii_lowercase + digits), min_size=2, max_size=12, unique=True)
NAMES = st.lists(LETTERS.map("".join), min_size=1, max_size=30)


@pytest.mark.parametrize(
    ("name", "allowed", "suggestion"),
    [
        ("igest", ("compare", "ingest", "export"), "ingest"), ("UR-5E", ("ur3e", "ur5e"), "ur5e"),
        ("base-link", ("base", "base_link"), "base_link"), ("q_- 1", ("q1",), "q1"),
        ("MASSE", ("mas", "maße"), "maße"), ("abcde", ("abcxy",), "abcxy"),  # 6 of 10 letters
        ("copy", ("compare",), None),  # 6 of 11
        ("lenght", (), None), ("q1", ("tool", "base"), None), ("x" * 201, ("x" * 200,), None),
    ],
)  # fmt: skip
def test_the_most_similar_name_is_suggested(
    name: str, allowed: tuple[str, ...], suggestion: str | None
) -> None:
    text = f" (did you mean {suggestion}?)" if suggestion else ""
    assert format_suggestion(name, allowed) == text


@settings(max_examples=40, deadline=None)
@given(NAMES, st.data())
def test_a_name_with_a_letter_missing_is_answered_with_it(names: list[str], data: st.DataObject) -> None:
    meant = data.draw(st.sampled_from(names))
    at = data.draw(st.integers(0, len(meant) - 1))
    written = meant[:at] + meant[at + 1 :]
    assume(written not in names)
    could_be = [one for one in names if any(written == one[:i] + one[i + 1 :] for i in range(len(one)))]
    assert format_suggestion(written.upper(), names) == f" (did you mean {max(could_be)}?)"


def test_what_is_found_and_what_is_allowed_is_said() -> None:
    assert format_unknown_name("q", ["q1", "q2"]) == "found 'q' (did you mean q2?), allowed: q1, q2"
    assert format_unknown_name("q", []) == "found 'q', allowed: none"


def test_of_many_names_the_nearest_are_listed() -> None:
    names = [f"u{i:02}" for i in range(20)] + ["speed"]
    text = format_names("sped", names)
    assert text.startswith("speed, ")
    assert text.endswith(" and 5 others")
    assert len(text.removesuffix(" and 5 others").split(", ")) == MAX_LISTED
    assert format_names("sped", names[:16]) == ", ".join(names[:16])
    assert format_unknown_name("sped", names) == f"found 'sped' (did you mean speed?), allowed: {text}"


def test_the_findings_of_all_items_are_one_error_of_the_first_class() -> None:
    def check(item: int) -> int:
        if item == 1:
            raise LogError("odd", "one")
        if item > 1:
            raise OptionError("odd")
        return -item

    assert map_collecting_errors(check, [0, -1]) == [0, 1]
    with pytest.raises(LogError) as error:
        map_collecting_errors(check, [0, 1, 2])
    assert [finding.message for finding in error.value.findings] == ["odd", "one"]


@pytest.mark.parametrize(("word", "quoted"), [("a b", "'a b'"), ("it's", "'it''s'"), (r"C:\a", r"C:\a")])
def test_a_word_is_quoted_for_powershell(word: str, quoted: str) -> None:
    assert shell_quote(word, "win32") == quoted


def test_a_line_of_python_is_in_double_quotes_if_the_shell_leaves_these_alone() -> None:
    assert python_command("print('a')") == "python -c \"print('a')\""
    assert shlex.split(python_command('print("$a")')) == ["python", "-c", 'print("$a")']
