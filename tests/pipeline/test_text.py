"""How numbers are written."""

from __future__ import annotations

import math

import pytest

from urmpipe_models.spelling import pasted
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Statistics
from urmpipe_pipeline.comparison.symbols import allowed_words, used_words
from urmpipe_pipeline.json_values import plain


@pytest.mark.parametrize(
    ("metres", "against", "written"),
    [
        (0.0, None, "0.0000"),
        (0.00349996, None, "3.5000"),
        (0.00349996, 0.0035, "3.49996"),
        (0.003500001, 0.0035, "3.500001"),
        (0.0035, 0.0035, "3.5000"),
        (-0.4123456789, None, "-412.3457"),
        (8.5e-17, None, "8.500e-14"),
        (5.00001e-7, 5e-7, "5.00001e-04"),
        (5e-7, 5e-7, "5.000e-04"),
        (math.nan, None, "–"),
        (None, None, "–"),
    ],
)
def test_millimetres_have_the_digits_that_a_verdict_needs(
    metres: float | None, against: float | None, written: str
) -> None:
    assert text.millimetres(metres, against) == written


@pytest.mark.parametrize(
    ("radians", "against", "written"),
    [
        (math.radians(0.5), math.radians(0.5), "0.5000"),
        (math.radians(0.5000004), math.radians(0.5), "0.5000004"),
        (math.radians(-12.34567), None, "-12.3457"),
        (1e-9, None, "5.730e-08"),
        (math.nan, None, "–"),
    ],
)
def test_angles_follow_the_rule_of_lengths_in_degrees(
    radians: float, against: float | None, written: str
) -> None:
    assert text.number(radians, "rad", against) == written


def test_a_quantity_has_the_unit_that_people_read() -> None:
    assert text.quantity(0.0025, "m") == "2.5000 mm"
    assert text.quantity(math.radians(30), "rad") == "30.0000 deg"
    assert text.offset(0.0) == "0.000 s"
    assert text.offset(0.5) == "+0.500 s"
    assert text.offset(1e-9) == "0.000 s"
    assert text.offset(-1e-9) == "0.000 s"
    assert text.enumerated(("a",)) == "a"
    assert text.enumerated(("a", "b", "c")) == "a, b and c"


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
    assert text.standard_error(error) == written


@pytest.mark.parametrize(
    ("seconds", "written"),
    [(0.0, "0.000"), (36.91, "36.910"), (2.0625, "2.0625"), (1 / 3, "0.333333"), (math.nan, "–")],
)
def test_seconds_have_milliseconds_at_least(seconds: float, written: str) -> None:
    assert text.seconds(seconds) == written


@pytest.mark.parametrize(
    ("share", "written"),
    [
        (0.0, "0 %"),
        (1.0, "100 %"),
        (1e-6, "0.0001 %"),
        (0.0734, "7.3 %"),
        (0.0699, "7.0 %"),
        (0.5, "50.0 %"),
        (0.99999, "99.99 %"),
    ],
)
def test_a_share_is_never_rounded_to_none_or_all(share: float, written: str) -> None:
    assert text.percent(share) == written


def test_a_tolerance_names_its_quantities() -> None:
    assert allowed_words({"axis": 0.0035, "norm": 0.005}) == "±3.5 mm per axis, 5 mm norm"
    every = {"x": 0.001, "path": 0.002, "angle": math.radians(0.5), "joint": 0.002}
    assert allowed_words(every, {"m", "rad"}) == (
        "±1 mm x, 2 mm from the path, 0.5 deg of orientation, ±0.114592 deg or ±2 mm per joint"
    )
    assert text.limit(None) == "–"


def test_sizes_counts_and_options() -> None:
    assert text.size(1_234_567) == "1\u202f234\u202f567"
    assert text.counted(1, "log") == "1 log"
    assert text.counted(0, "log") == "0 logs"
    assert plain("x") == "x"
    assert plain((0.0, None, "é")) == '[0.0, null, "é"]'


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
    ("word", "elsewhere", "on_windows"),
    [
        ("log.csv", "log.csv", "log.csv"),
        ("weld path.csv", "'weld path.csv'", '"weld path.csv"'),
        ("run(2).rrd", "'run(2).rrd'", '"run(2).rrd"'),
        (r"logs\run.rrd", r"'logs\run.rrd'", r"logs\run.rrd"),
        ("it's.csv", """'it'"'"'s.csv'""", '"it\'s.csv"'),
        ("", "''", '""'),
    ],
)
def test_a_word_is_quoted_where_a_shell_would_part_it(word: str, elsewhere: str, on_windows: str) -> None:
    assert pasted(word, "linux") == pasted(word, "darwin") == elsewhere
    assert pasted(word, "win32") == on_windows
