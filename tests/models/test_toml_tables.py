"""TOML as text: what is written reads back, and what is not TOML is told with its line."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asserting import refusal
from urmpipe_models.errors import OptionError
from urmpipe_models.toml_tables import format_toml, quote_toml, read_toml

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
leaves = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | texts
keys = st.from_regex(r"[A-Za-z0-9_-]+", fullmatch=True)
values = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3)
)


@pytest.mark.slow
@given(st.dictionaries(keys, values, max_size=4))
def test_what_is_written_reads_back(table: dict[str, object]) -> None:
    assert tomllib.loads("\n".join(format_toml(table))) == table


def test_each_kind_of_value_is_written_as_toml_has_it() -> None:
    table = {"a": True, "b": False, "c": 1, "d": 0.5, "e": "x", "f": (1, "y"), "g": {"h": [True]}, "i": None}
    assert format_toml(table) == [
        "a = true", "b = false", "c = 1", "d = 0.5", 'e = "x"', 'f = [1, "y"]', "g = { h = [true] }",
    ]  # fmt: skip
    assert quote_toml('Größe "\x7f\n') == '"Größe \\"\\u007f\\n"'


@pytest.mark.parametrize(
    ("written", "place", "hint"),
    [
        ("a = 1\nb = UR", (2, 5), '; a text needs quotes: b = "UR"'),
        ("a = ur # b", (1, 5), '; a text needs quotes: a = "ur"'),
        ("a = ur\nb = [", (1, 5), '; a text needs quotes: a = "ur"'),
        ("# \u2028\n\na = ur\n", (3, 5), '; a text needs quotes: a = "ur"'),
        ("a = True", (1, 5), "; allowed: a = true"),
        ("a = False\r\n", (1, 5), "; allowed: a = false"),
        ("a = .5", (1, 5), ""),
        ("a = [", None, ""),
        ("\n\na = [\n\n", None, ""),
    ],
)
def test_what_is_no_toml_is_told_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: str, place: tuple[int, int] | None, hint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_bytes(written.encode())
    with pytest.raises(OptionError) as caught:
        read_toml(Path("a.toml"), OptionError)
    if place is None:
        line = 1 + written.rstrip("\n").count("\n")
        assert str(caught.value) == f"a.toml:{line}: not valid TOML: Invalid value (at end of document)"
    else:
        at = f"(at line {place[0]}, column {place[1]})"
        assert str(caught.value) == f"a.toml:{place[0]}: not valid TOML: Invalid value {at}{hint}"


def test_what_cannot_be_read_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_bytes(b"\na = '\xff'")
    os.mkfifo("pipe.toml")
    for name, said in (
        ("a.toml", "a.toml:2: byte 6 is not UTF-8; allowed: TOML in UTF-8"),
        ("pipe.toml", "pipe.toml: found a pipe or a device, allowed: a file"),
        ("a\0b.toml", "found 'a\\x00b.toml', allowed: the name of a file"),
        ("b.toml", "b.toml: cannot be read: No such file or directory"),
    ):
        assert refusal(OptionError, read_toml, Path(name), OptionError) == said
    Path("a.toml").write_bytes(b"\xef\xbb\xbfa = 1")  # with a byte order mark, as Windows writes it
    assert read_toml(Path("a.toml"), OptionError) == {"a": 1}


DEEP = "found tables or lists nested more than 50 deep, allowed: 50"


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("a = 1\nb = " + "[" * 2000 + "]" * 2000, f"a.toml:2: {DEEP}"),
        ("b = " + "{a=" * 2000 + "1" + "}" * 2000, f"a.toml:1: {DEEP}"),
        ("\n\n[" + ".".join("a" * 2000) + "]", f"a.toml:3: {DEEP}"),
        (".".join(["'a'"] * 2000) + " = 1", f"a.toml:1: {DEEP}"),
        ("a = [\n" * 51, f"a.toml:51: {DEEP}"),
        ("a = " + ("{" + ".".join("a" * 11) + " = ") * 9, f"a.toml:1: {DEEP}"),
        ("a" * 10**6 + ".a" * 10**6, f"a.toml:1: {DEEP}"),
        (
            "a = 1\nb = " + "9" * 5000,
            "a.toml:2: found an integer of too many digits, allowed: 64 bits at most",
        ),
        (
            "b.c = [0, 0x" + "f" * 17 + "]",
            "a.toml:1: b.c[1]: found an integer of 68 bits, allowed: 64 bits at most",
        ),
        (f"b = -{2**63 + 1}", "a.toml:1: b: found an integer of 64 bits, allowed: 64 bits at most"),
        ("a" * 1001 + " = 1", f"a.toml: '{'a' * 56}...: found a key of 1001 letters, allowed: 1000 at most"),
        (
            "".join(f"a{k} = 1\n" for k in range(20_001)),
            "a.toml: found 20001 keys, allowed: 20000 at most",
        ),
        ("a = '" + "x" * 10**7, "a.toml: found 10 MB, allowed: 10 MB at most"),
        ("a = 2024-02-31", "a.toml:1: not valid TOML: Invalid date or datetime (at line 1, column 5)"),
        ("a = 1\na = 2\n", "a.toml:2: not valid TOML: Cannot overwrite a value (at line 2, column 6)"),
        ("a = 'x\0'", "a.toml:1: not valid TOML: Found invalid character '\\x00' (at line 1, column 7)"),
    ],
)
def test_what_people_do_not_write_is_told_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(written, encoding="utf-8")
    assert refusal(OptionError, read_toml, Path("a.toml"), OptionError) == said


def test_what_only_looks_deep_is_read(tmp_path: Path) -> None:
    """Brackets in texts and remarks, dots of numbers, and as many of both as are allowed."""
    signs = "[" * 100 + "." * 100
    written = "\n".join(
        [
            f"# {signs}", f'a = "{signs} \\" {signs}" # {signs}', f"b = '{signs}\\'",
            f'c = """{signs}\n"{signs}\\""" {signs}"""', f"d = '''{signs}\n'{signs}'''",
            f"e = [{', '.join(['1.5'] * 100)}]", "f = " + "[" * 50 + "]" * 50, "g" + ".g" * 49 + " = 2.5",
            "[" + ".".join("h" * 50) + "]", "i = { j = 1.5 }", f'"{signs}" = {-(2**63)}', f"k = {2**63 - 1}",
        ]
    )  # fmt: skip
    path = tmp_path / "a.toml"
    path.write_text(written, encoding="utf-8")
    assert read_toml(path, OptionError) == tomllib.loads(written)
