"""How numbers are written."""

from __future__ import annotations

import math

import pytest

from urmpipe_pipeline.report import text


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
        (math.nan, None, "–"),
        (None, None, "–"),
    ],
)
def test_millimetres_have_the_digits_that_a_verdict_needs(
    metres: float | None, against: float | None, written: str
) -> None:
    assert text.millimetres(metres, against) == written


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
        (0.5, "50.0 %"),
        (0.99999, "99.99 %"),
    ],
)
def test_a_share_is_never_rounded_to_none_or_all(share: float, written: str) -> None:
    assert text.percent(share) == written


def test_a_tolerance_names_its_quantities() -> None:
    assert text.tolerance({"axis": 0.0035, "norm": 0.005}) == "±3.5 mm per axis, 5 mm norm"
    assert text.limit(None) == "–"


def test_sizes_counts_and_options() -> None:
    assert text.size(1_234_567) == "1\u202f234\u202f567"
    assert text.counted(1, "log") == "1 log"
    assert text.counted(0, "log") == "0 logs"
    assert text.plain("x") == "x"
    assert text.plain((0.0, None, "é")) == '[0.0, null, "é"]'
