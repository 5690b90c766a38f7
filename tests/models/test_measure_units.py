"""Units of measurement: exact factors, and no way from one measure to another."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.errors import OptionError
from urmpipe_models.measure_units import (
    MEASURES,
    WRITTEN,
    compatible_units,
    conversion_factor,
    quantity_to_si,
)

EVERY = [(si, unit) for si, units in MEASURES.items() for unit in units]
PAIRS = [(one, other) for units in MEASURES.values() for one in units for other in units]


def test_factors_are_those_of_the_definitions() -> None:
    pairs = (("m", "mm"), ("mm", "um"), ("um", "m"), ("us", "ms"))
    assert {pair: conversion_factor(*pair) for pair in pairs} == {
        ("m", "mm"): 1e3, ("mm", "um"): 1e3, ("um", "m"): 1e-6, ("us", "ms"): 1e-3,
    }  # fmt: skip
    assert (conversion_factor("rad", "deg"), conversion_factor("deg", "rad")) == (
        180.0 / math.pi,
        math.pi / 180.0,
    )
    # 30 / pi = 9.549296585513720146, and 360 deg in 60 s
    assert (conversion_factor("rad/s", "rpm"), conversion_factor("rpm", "deg/s")) == (9.54929658551372, 6.0)


def test_each_unit_is_what_its_prefix_or_a_turn_says() -> None:
    thousand = ("mm", "mm/s", "mm/s2", "mm/s3", "mrad", "ms", "mA", "mV")
    degrees = ("deg", "deg/s", "deg/s2", "deg/s3")
    said = dict.fromkeys(thousand, 1e3) | dict.fromkeys(degrees, 180.0 / math.pi)
    said |= {"um": 1e6, "us": 1e6, "rpm": 30.0 / math.pi}
    found = {unit: conversion_factor(si, unit) for si, unit in EVERY if unit != si}
    assert found == pytest.approx(said, rel=1e-15)  # pi and the quotient are rounded, each by 2^-53


@pytest.mark.slow
@given(st.sampled_from(PAIRS), st.floats(1e-6, 1e6))
def test_there_and_back_is_the_same_value(pair: tuple[str, str], value: float) -> None:
    there = conversion_factor(*pair)
    back = conversion_factor(*reversed(pair))
    assert value * there * back == pytest.approx(value, rel=1e-15)  # four roundings of 2^-53


@pytest.mark.parametrize(("si", "unit"), EVERY)
def test_no_unit_stands_in_another_measure(si: str, unit: str) -> None:
    others = [one for measure, one in EVERY if measure != si]
    assert unit not in others
    for other in others:
        with pytest.raises(OptionError) as error:
            conversion_factor(unit, other)
        assert (
            str(error.value)
            == f"unit: found {other!r} for {unit!r}, allowed: {', '.join(compatible_units(si))}"
        )


def test_an_unknown_unit_is_refused_with_all_that_are_known() -> None:
    with pytest.raises(OptionError) as error:
        conversion_factor("inch", "mm")
    assert str(error.value) == f"unit: found 'inch', allowed: {', '.join(unit for _, unit in EVERY)}"
    assert compatible_units("inch") == {}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.6", 0.6), ("600mm", 0.6), (" 1.1 mm ", 1.1e-3), ("3cm", 0.03), ("-2e3um", -2e-3), ("1e3", 1e3),
        ("nan", math.nan), ("inf", math.nan), ("mm", math.nan), ("", math.nan), ("1 2", math.nan),
        ("20µm", 2e-5), ("1rad", math.nan), ("0x1", math.nan), ("1e999", math.inf),
        ("1e99999999999999999999", math.nan),
    ],
)  # fmt: skip
def test_a_quantity_is_a_number_with_one_of_the_units_rounded_once(text: str, value: float) -> None:
    assert quantity_to_si(text, WRITTEN["m"]) == value or (
        math.isnan(quantity_to_si(text, WRITTEN["m"])) and math.isnan(value)
    )
