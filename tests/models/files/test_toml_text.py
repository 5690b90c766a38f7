"""TOML as text: what is written reads back, and what is not TOML is told with its line."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asserting import refusal
from urmpipe_models.errors import OptionError
from urmpipe_models.files.toml_text import parse_toml, toml_lines, toml_text

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
leaves = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | texts
keys = st.from_regex(r"[A-Za-z0-9_-]+", fullmatch=True)
values = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3)
)


@given(st.dictionaries(keys, values, max_size=4))
def test_what_is_written_reads_back(table: dict[str, object]) -> None:
    assert tomllib.loads("\n".join(toml_lines(table))) == table


def test_each_kind_of_value_is_written_as_toml_has_it() -> None:
    table = {"a": True, "b": False, "c": 1, "d": 0.5, "e": "x", "f": (1, "y"), "g": {"h": [True]}, "i": None}
    assert toml_lines(table) == [
        "a = true", "b = false", "c = 1", "d = 0.5", 'e = "x"', 'f = [1, "y"]', "g = { h = [true] }",
    ]  # fmt: skip
    assert toml_text('Größe "\x7f\n') == '"Größe \\"\\u007f\\n"'


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
        ("a =", None, ""),
    ],
)
def test_what_is_no_toml_is_told_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: str, place: tuple[int, int] | None, hint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_bytes(written.encode())
    with pytest.raises(OptionError) as caught:
        parse_toml(Path("a.toml"), OptionError)
    if place is None:
        assert str(caught.value) == "a.toml: not valid TOML: Invalid value (at end of document)"
    else:
        at = f"(at line {place[0]}, column {place[1]})"
        assert str(caught.value) == f"a.toml:{place[0]}: not valid TOML: Invalid value {at}{hint}"


def test_what_cannot_be_read_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_bytes(b"a = '\xff'")
    for name, said in (
        ("a.toml", "a.toml: byte 5 is no UTF-8; allowed: TOML in UTF-8"),
        ("b.toml", "b.toml: cannot be read: No such file or directory"),
    ):
        assert refusal(OptionError, parse_toml, Path(name), OptionError) == said
    Path("a.toml").write_bytes(b"\xef\xbb\xbfa = 1")  # with a byte order mark, as Windows writes it
    assert parse_toml(Path("a.toml"), OptionError) == {"a": 1}
