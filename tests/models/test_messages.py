"""Messages as data, and their three voices."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tomllib
from typing import Any, get_args

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from urmpipe_models.errors import Finding, Hint, Voice, escape_line
from urmpipe_pipeline.joint_log import LogWarning


@pytest.mark.parametrize(
    ("hint", "option", "keyword", "key"),
    [
        (Hint("unit", {"q1": "deg"}), "--unit q1=deg", 'unit={"q1": "deg"}', 'units.q1 = "deg"'),
        (Hint("unit", {"": "deg"}), "--unit deg", 'unit="deg"', 'units."" = "deg"'),
        (
            Hint("unit", {"q1": "deg", "a b": "mm"}),
            "--unit q1=deg --unit 'a b=mm'",
            'unit={"q1": "deg", "a b": "mm"}',
            'units.q1 = "deg", units."a b" = "mm"',
        ),
        (
            Hint("interval", {"q 1": None}),
            "--interval 'q 1='LOW:HIGH",
            'interval={"q 1": (LOW, HIGH)}',
            'joints.interval."q 1" = [LOW, HIGH]',
        ),
        (
            Hint("interval", {"q1": (-1.0, 2.5)}),
            "--interval q1=-1:2.5",
            'interval={"q1": (-1, 2.5)}',
            "joints.interval.q1 = [-1, 2.5]",
        ),
        (Hint("joints", ["a", "b"]), "--joints a,b", 'joints=["a", "b"]', 'joints.column = ["a", "b"]'),
        (Hint("joints"), "--joints A,B,C", "joints=[A, B, C]", "joints.column = [A, B, C]"),
        (Hint("skip_bad", True), "--skip-bad", "skip_bad=True", "--skip-bad"),
        (Hint("tool", [0.0, 0.1]), "--tool 0,0.1", "tool=[0, 0.1]", "--tool 0,0.1"),
        (
            Hint("audit", call="ingest"),
            "urmpipe ingest --audit FILE.csv",
            "ingest(audit=FILE.csv)",
            "urmpipe ingest --audit FILE.csv",
        ),
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
    ("voice", "told"),
    [
        (
            "command line",
            "--time none or --time 2 leaves it out; --skip-bad skips them; use --robot NAME|FILE",
        ),
        ("python", 'time="none" or time="2" leaves it out; skip_bad=True skips them; use robot=NAME|FILE'),
        (
            "system file",
            'clock.column = "none" or clock.column = "2" in the map of the log leaves it out;'
            " use robot = NAME|FILE",
        ),
    ],
)
def test_what_hints_do_is_told_once_and_no_file_tells_what_it_cannot_say(voice: Voice, told: str) -> None:
    assert Finding("no clock", "log.csv", 3, hints=HINTS).format(voice) == f"log.csv:3: no clock; {told}"


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
