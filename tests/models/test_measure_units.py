"""Units of measurement: exact factors, and no way from one measure to another."""

from __future__ import annotations

import math
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.errors import OptionError
from urmpipe_models.measure_units import MEASURES, WRITTEN, conversion_factor, quantity_to_si

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


def test_no_unit_is_of_two_measures() -> None:
    assert len({unit for _, unit in ALL_UNITS}) == len(ALL_UNITS)
    for (si, unit), (other_si, other) in product(ALL_UNITS, repeat=2):
        if si != other_si:
            with pytest.raises(OptionError):
                conversion_factor(unit, other)


def test_a_quantity_is_rounded_once() -> None:
    for text, value in (("600mm", 0.6), ("1.1 mm", 1.1e-3), ("-2e3um", -2e-3), ("20µm", 2e-5)):
        assert quantity_to_si(text, WRITTEN["m"]) == value
