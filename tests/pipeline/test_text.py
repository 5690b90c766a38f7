"""Words around numbers, and values as one line."""

from __future__ import annotations

import math

import pytest

from urmpipe_models.display import format_count
from urmpipe_models.errors import shell_quote
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Statistics
from urmpipe_pipeline.comparison.wording import tolerance_words, used_words
from urmpipe_pipeline.text import format_option_value


@pytest.mark.parametrize(
    ("error", "written"),
    [
        (0.0, "0.001 ms"),
        (6.1e-8, "0.001 ms"),
        (1.26e-6, "0.0013 ms"),
        (2.1e-4, "0.21 ms"),
        (0.1234, "120 ms"),
        (12.6, "13000 ms"),
    ],
)
def test_a_standard_error_is_said_no_finer_than_a_microsecond(error: float, written: str) -> None:
    assert text.format_standard_error(error) == written


def test_a_tolerance_names_its_quantities() -> None:
    assert tolerance_words({"axis": 0.0035, "norm": 0.005}) == "±3.5 mm per axis, 5 mm norm"
    every = {"x": 0.001, "path": 0.002, "angle": math.radians(0.5), "joint": 0.002}
    assert tolerance_words(every, {"m", "rad"}) == (
        "±1 mm x, 2 mm from the path, 0.5 deg of orientation, ±0.114592 deg or ±2 mm per joint"
    )


def test_counts_lists_and_options() -> None:
    assert format_count(1, "log") == "1 log"
    assert format_count(0, "log") == "0 logs"
    assert text.join_words(("a",)) == "a"
    assert text.join_words(("a", "b", "c")) == "a, b and c"
    assert format_option_value("x") == "x"
    assert format_option_value((0.0, None, "é")) == '[0.0, null, "é"]'


@pytest.mark.parametrize(
    ("largest", "written"),
    [
        (0.005, "50.0 % of the tolerance"),
        (0.01, "100 % of the tolerance"),
        (0.010001, "1.0001 times the tolerance"),
        (0.0125, "1.25 times the tolerance"),
        (10.9, "1090 times the tolerance"),
    ],
)
def test_how_much_of_a_tolerance_is_used_is_never_rounded_to_all_of_it(largest: float, written: str) -> None:
    one = Statistics("path", "path", "m", largest, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0.01, 1, 1.0, "fail")
    assert used_words(one) == written


@pytest.mark.parametrize(
    ("share", "written"),
    [
        (0.0, "0 %"),
        (0.0012, "0.12 %"),
        (0.5, "50.0 %"),
        (0.99999, "99.99 %"),
        (1.0, "100 %"),
        (1.00001, "100.01 %"),
        (1.005, "100.50 %"),
        (7.586, "758.6 %"),
    ],
)
def test_a_share_is_never_rounded_to_none_or_all_of_it(share: float, written: str) -> None:
    assert text.format_percent(share) == written


@pytest.mark.parametrize(
    ("word", "elsewhere", "on_windows"),
    [
        ("log.csv", "log.csv", "log.csv"),
        ("weld path.csv", "'weld path.csv'", "'weld path.csv'"),
        ("run(2).rrd", "'run(2).rrd'", "'run(2).rrd'"),
        (r"logs\run.rrd", r"'logs\run.rrd'", r"logs\run.rrd"),
        ("it's.csv", """'it'"'"'s.csv'""", "'it''s.csv'"),
        ("a\u2019b", "'a\u2019b'", "'a\u2019\u2019b'"),
        ("$HOME;x", "'$HOME;x'", "'$HOME;x'"),
        ("größe", "'größe'", "größe"),
        ("q1\xa0'", "$'q1\\U000000a0\\''", "'q1\xa0'''"),
        ("", "''", "''"),
    ],
)
def test_a_word_is_quoted_where_a_shell_would_part_it(word: str, elsewhere: str, on_windows: str) -> None:
    assert shell_quote(word, "linux") == shell_quote(word, "darwin") == elsewhere
    assert shell_quote(word, "win32") == on_windows
