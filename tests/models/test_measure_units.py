"""Units of measurement: exact factors, and no way from one measure to another."""

from __future__ import annotations

import math
from itertools import product

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
    read_quantity,
)

ALL_UNITS = [(si, unit) for si, units in MEASURES.items() for unit in units]
PAIRS = [pair for units in MEASURES.values() for pair in product(units, repeat=2)]


def test_factors_are_those_of_the_definitions() -> None:
    pairs = (("m", "mm"), ("mm", "um"), ("um", "m"), ("us", "ms"))
    assert {pair: conversion_factor(*pair) for pair in pairs} == {
        ("m", "mm"): 1e3, ("mm", "um"): 1e3, ("um", "m"): 1e-6, ("us", "ms"): 1e-3,
    }  # fmt: skip
    assert conversion_factor("rad", "deg") == 180.0 / math.pi
    assert conversion_factor("deg", "rad") == math.pi / 180.0
    # 30 / pi = 9.549296585513720146, and 360 deg in 60 s
    assert (conversion_factor("rad/s", "rpm"), conversion_factor("rpm", "deg/s")) == (9.54929658551372, 6.0)


def test_each_unit_is_what_its_prefix_or_a_turn_states() -> None:
    thousand = ("mm", "mm/s", "mm/s2", "mm/s3", "mrad", "ms", "mA", "mV")
    degrees = ("deg", "deg/s", "deg/s2", "deg/s3")
    expected = dict.fromkeys(thousand, 1e3) | dict.fromkeys(degrees, 180.0 / math.pi)
    expected |= {"um": 1e6, "us": 1e6, "rpm": 30.0 / math.pi}
    factors = {unit: conversion_factor(si, unit) for si, unit in ALL_UNITS if unit != si}
    assert factors == pytest.approx(expected, rel=1e-15)  # pi and the quotient are rounded, each by 2^-53


@pytest.mark.slow
@given(st.sampled_from(PAIRS), st.floats(1e-6, 1e6))
def test_there_and_back_is_the_same_value(pair: tuple[str, str], value: float) -> None:
    there = conversion_factor(*pair)
    back = conversion_factor(*reversed(pair))
    assert value * there * back == pytest.approx(value, rel=1e-15)  # four roundings of 2^-53


@pytest.mark.parametrize(("si", "unit"), ALL_UNITS)
def test_no_unit_stands_in_another_measure(si: str, unit: str) -> None:
    others = [other for measure, other in ALL_UNITS if measure != si]
    allowed = ", ".join(compatible_units(si))
    assert unit not in others
    for other in others:
        with pytest.raises(OptionError) as error:
            conversion_factor(unit, other)
        assert str(error.value) == f"unit: found {other!r} for {unit!r}, allowed: {allowed}"


def test_an_unknown_unit_is_refused_with_all_that_are_known() -> None:
    with pytest.raises(OptionError) as error:
        conversion_factor("inch", "mm")
    assert str(error.value) == f"unit: found 'inch', allowed: {', '.join(unit for _, unit in ALL_UNITS)}"
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
    assert quantity_to_si(text, WRITTEN["m"]) == pytest.approx(value, rel=0.0, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("text", "si", "quantities"),
    [
        ("3.5", "m", "3.5mm or 3.5m"), ("0.02", "m", "0.02mm or 0.02m"), ("0.3", "rad", "0.3deg or 0.3rad"),
        ("5", "1", "5% or 500%"), ("0.019", "m", ""), ("0.2", "rad", ""), ("1", "1", ""), ("3m", "m", ""),
        ("3", "s", ""),
    ],
)  # fmt: skip
def test_a_large_deviation_needs_its_unit(text: str, si: str, quantities: str) -> None:
    assert read_quantity(text, si) == quantity_to_si(text, WRITTEN[si])
    if quantities:
        with pytest.raises(OptionError, match=f"^found {text}, allowed: a unit: {quantities}$"):
            read_quantity(text, si, deviation=True)
    else:
        read_quantity(text, si, deviation=True)


def test_a_quantity_is_finite_and_positive_if_it_must() -> None:
    assert read_quantity("-1mm", "m", positive=False) == -1e-3
    for text, positive, kind in (("-1", True, "a positive length in m"), ("1e999", False, "a length in m")):
        with pytest.raises(OptionError, match=f"^found '{text}', allowed: {kind}, such as 0.0004 or 0.4mm$"):
            read_quantity(text, "m", positive=positive)
