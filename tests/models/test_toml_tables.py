"""Tables of TOML: written and read back, with all errors at once and their lines."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asserting import refusal
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.toml_tables import CheckedTable, format_toml, quote_toml, read_toml

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


def test_a_checked_table_collects_all_errors_and_continues_with_substitutes() -> None:
    faults: list[Finding] = []
    data = {
        "text": 1, "choice": "ure", "number": "x", "numbers": [1, "a"], "few": [1], "flag": 1, "texts": "a",
        "mapping": {"a": 1}, "spread": "x", "rows": [1], "table": 1, "tables": [1], "lenght": 1,
    }  # fmt: skip
    table = CheckedTable(data, faults, "a.toml")
    assert (table.text("text"), table.choice("choice", ("ur5e", "panda"))) == ("", "ur5e")
    assert (table.number("number", si="m"), table.number("missing", 2.0)) == (0.0, 2.0)
    assert (table.numbers("numbers", 2), table.numbers("few", 2)) == ((0.0, 0.0), (0.0, 0.0))
    assert (table.flag("flag"), table.texts("texts"), table.mapping("mapping")) == (False, (), {})
    assert table.spread("spread", 2, 1.0) == (1.0, 1.0)
    assert table.rows("rows") == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    assert (table.table("table").value("length"), table.tables("tables")) == (None, [])
    table.text("length")
    table.report_unknown_keys()
    assert [str(fault).removeprefix("a.toml: key ").split(", allowed")[0] for fault in faults] == [
        "text: found 1", "choice: found 'ure'", "number: found 'x'", "numbers[1]: found 'a'",
        "few: found [1]", "flag: found 1", "texts: found 'a'", "mapping: found {'a': 1}",
        "spread: found 'x'", "rows: found [1]", "table: found 1", "tables: found [1]",
        "length: found nothing",
        "lenght: unknown (did you mean length?); allowed: text, choice, number, missing, numbers, few, flag,"
        " texts, mapping, spread, rows, table, tables, length",
    ]  # fmt: skip


def test_a_checked_table_converts_units_and_knows_the_place_of_its_tables() -> None:
    faults: list[Finding] = []
    data = {"a": {"x": "3mm"}, "b": [{"m": [[1, 0, 0]] * 3, "huge": 10**400}], "list": ["90deg", 2], "all": 3}
    table = CheckedTable(data, faults, None, key_in_about=True)
    assert table.table("a").number("x", si="m") == 0.003
    assert table.numbers("list", None, si=("rad", "m")) == (1.5707963267948966, 2.0)
    assert (table.spread("all", 2, 0.0), table.mapping("none"), table.flag("none")) == ((3.0, 3.0), {}, False)
    (inner,) = table.tables("b")
    assert inner.rows("m") == ((1.0, 0.0, 0.0),) * 3
    assert inner.number("huge", 1.0) == 1.0
    table.report_unknown_keys()
    assert [fault.about for fault in faults] == ["b[0].huge"]
