"""How a cell is written: digits that a judgement needs, units, advice."""

from __future__ import annotations

import math

import pytest

from urmpipe_models.errors import Hint
from urmpipe_pipeline.presentation.digits import unit_of, written
from urmpipe_pipeline.presentation.section import Advice, Cell, Judged, Place, Ref, Value
from urmpipe_pipeline.text import NOTHING


@pytest.mark.parametrize(
    ("cell", "with_unit", "without"),
    [
        (Value(0.0025, "m"), "2.500 mm", "2.500"),
        (Value(1.234567, "m"), "1235 mm", "1235"),
        (Value(0.0099996, "m"), "10.00 mm", "10.00"),  # rounded, then counted
        (Value(0.0, "m"), "0.0 mm", "0.0"),
        (Value(-0.4123456789, "m"), "-412.3 mm", "-412.3"),
        (Value(8.5e-17, "m"), "0.0000 mm", "0.0000"),
        (Value(-3.887e-10, "m"), "0.0000 mm", "0.0000"),  # no -0.0000
        (Value(9.166e-7, "m"), "0.0009 mm", "0.0009"),
        (Value(9.166e-7, "m", 0.0035), "0.0009 mm", "0.0009"),
        (Value(3e-10, "m", 5e-7), "0.0000003 mm", "0.0000003"),  # as fine as its limit has four digits
        (Value(0.0035, "m", given=True), "3.5 mm", "3.5"),
        (Value(0.00350000001, "m", 0.0035), "3.50000001 mm", "3.50000001"),  # it is out of its limit
        (Value(0.00349996, "m", 0.0035), "3.49996 mm", "3.49996"),
        (Value(0.0035, "m", 0.0035), "3.500 mm", "3.500"),
        (Value(5.00001e-7, "m", 5e-7), "0.000500001 mm", "0.000500001"),
        (Value(5e-7, "m", 5e-7), "0.0005000 mm", "0.0005000"),
        (Value(math.radians(0.5000004), "rad", math.radians(0.5)), "0.5000004 deg", "0.5000004"),
        (Value(math.radians(0.5), "rad", math.radians(0.5)), "0.5000 deg", "0.5000"),
        (Value(-0.5, "rad", signed=True), "-28.65 deg", "-28.65"),
        (Value(0.5, "rad", signed=True), "+28.65 deg", "+28.65"),
        (Value(1.25, "s"), "1.250 s", "1.250"),
        (Value(2.0625, "s"), "2.0625 s", "2.0625"),
        (Value(1 / 3, "s"), "0.333333 s", "0.333333"),
        (Value(-1e-9, "s"), "0.000 s", "0.000"),
        (Value(math.nan, "s"), NOTHING, NOTHING),
        (Value(0.0, "%"), "0 %", "0 %"),
        (Value(1.0, "%"), "100 %", "100 %"),
        (Value(1e-6, "%"), "0.0001 %", "0.0001 %"),
        (Value(-2.1e-7, "%"), "under 0.0001 %", "under 0.0001 %"),
        (Value(0.0699, "%"), "7.0 %", "7.0 %"),
        (Value(0.99999, "%"), "99.99 %", "99.99 %"),  # never rounded to none or all
        (Value(0.125, "%"), "12.5 %", "12.5 %"),
        (Value(0.12501, "%", 0.12502), "12.501 %", "12.501 %"),  # it differs from what it is held against
        (Value(-0.00004, "1", signed=True), "0.000", "0.000"),
        (Value(3), "3", "3"),
        (Value(1, signed=True), "+1", "+1"),
        (Value(0.25, "N.m"), "0.25 N.m", "0.25"),
        (Value(-0.640943, "N.m"), "-0.6409 N.m", "-0.6409"),
        (Value(33274.2, "N.m"), "33270 N.m", "33270"),  # no 3.327e+04
        (Value(0.357143, "N.m", given=True), "0.357143 N.m", "0.357143"),
        (Value(None, "m"), NOTHING, NOTHING),
        (Value(math.nan, "m", given=True), NOTHING, NOTHING),
        (Place((0.1, -0.2, 0.30004)), "(0.1000, -0.2000, 0.3000) m", "(0.1000, -0.2000, 0.3000)"),
        (Judged("fail"), "FAIL", "FAIL"),
        (Judged(None), NOTHING, NOTHING),
        (Ref("a log"), "a log", "a log"),
        ("", NOTHING, NOTHING),
        (None, NOTHING, NOTHING),
    ],
)
def test_a_cell_is_written_with_its_unit_or_without(cell: Cell, with_unit: str, without: str) -> None:
    assert (written(cell, unit=True), written(cell)) == (with_unit, without)


def test_advice_ends_with_its_hint() -> None:
    advice = Advice("late", (Hint("sync", "auto", "finds an offset"),))
    assert written(advice) == "late; --sync auto finds an offset"
    assert written(Advice()) == NOTHING


def test_a_column_has_a_unit_if_all_its_values_have_that() -> None:
    assert unit_of([Value(1.0, "m"), None, Value(None, "rad")]) == "mm"
    assert unit_of([Value(1.0, "m"), Value(1.0, "rad")]) == ""
    assert unit_of([Place((0.0, 0.0, 0.0))]) == "m"
    assert unit_of([Value(0.5, "%"), "words"]) == ""
