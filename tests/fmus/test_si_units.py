"""Spellings of units: their base units, which are the same, and how they are displayed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_fmus.si_units import BaseUnit, coherent_unit, is_same_unit, parse_unit
from urmpipe_models.errors import UnitError


@pytest.mark.parametrize(
    ("coherent", "product"),
    [
        *[("J", "N.m"), ("W", "J/s"), ("V", "W/A"), ("Ohm", "V/A"), ("H", "V.s/A"), ("Wb", "V.s")],
        *[("F", "C/V"), ("S", "A/V"), ("Pa", "N/m2"), ("N", "kg.m/s2"), ("Hz", "1/s"), ("C", "A.s")],
        ("T", "Wb/m2"),
    ],
)
def test_derived_units_are_the_products_of_which_they_are_made(coherent: str, product: str) -> None:
    assert is_same_unit(coherent, product)


SYMBOLS = st.sampled_from(["m", "kg", "s", "A", "K", "mol", "cd", "rad", "N", "mm", "kOhm", "V", "deg", "J"])
POWERS = st.lists(st.tuples(SYMBOLS, st.integers(1, 9)), min_size=1, max_size=3)


def spelled(powers: list[tuple[str, int]]) -> str:
    return ".".join(symbol + (str(power) if power != 1 else "") for symbol, power in powers)


@given(above=POWERS, below=POWERS)
def test_a_quotient_has_the_difference_of_exponents_and_the_quotient_of_factors(
    above: list[tuple[str, int]], below: list[tuple[str, int]]
) -> None:
    unit = f"{spelled(above)}/({spelled(below)})"
    quotient = parse_unit(unit)
    assert parse_unit(coherent_unit(unit)) == replace(quotient, factor=1.0)
    up, down = parse_unit(spelled(above)), parse_unit(spelled(below))
    assert quotient.exponents == tuple(a - b for a, b in zip(up.exponents, down.exponents, strict=True))
    # Rounding of at most 6 powers and a quotient.
    assert math.isclose(quotient.factor, up.factor / down.factor, rel_tol=1e-13)


@given(above=POWERS)
def test_the_order_of_factors_does_not_matter(above: list[tuple[str, int]]) -> None:
    assert is_same_unit(spelled(above), spelled(above[::-1]))


@given(text=st.text(alphabet="mskgNradVA./()-+123 ", max_size=12))
def test_any_text_is_a_unit_or_a_unit_error(text: str) -> None:
    try:
        found = parse_unit(text)
    except UnitError:
        return
    assert math.isfinite(found.factor) and found.factor > 0.0


def test_a_factor_is_exact_and_written_with_ten_digits_the_same_unit() -> None:
    assert is_same_unit("deg", BaseUnit(rad=1, factor=0.01745329252))
    assert not is_same_unit("deg", BaseUnit(rad=1, factor=0.017453))
    assert parse_unit("deg").factor == math.pi / 180.0
    assert parse_unit("rev/min").factor == 2.0 * math.pi / 60.0
