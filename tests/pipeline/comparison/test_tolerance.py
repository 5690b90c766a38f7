"""Tolerances as they are written, bit for bit; `tolerance.cases` has what is allowed."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.measure_units import DEGREE
from urmpipe_pipeline.comparison.verdict import MIN_SHARES, UNITS, parse_tolerance


@given(st.floats(1e-9, 1e3), st.sampled_from(sorted(UNITS.keys() - MIN_SHARES)))
def test_a_number_in_si_comes_back_bit_for_bit(value: float, kind: str) -> None:
    unit = UNITS[kind].removesuffix("1")  # a share has none
    value = value if unit else min(value, 1.0)
    assert parse_tolerance(f"{kind}={value!r}{unit}") == {kind: value}


@given(st.integers(1, 999_999))
def test_a_unit_is_a_shift_of_the_decimal_point(number: int) -> None:
    assert parse_tolerance(f"{number}um") == parse_tolerance(f"{number}e-6m")
    assert parse_tolerance(f"{number}mm") == parse_tolerance(f"{number}e-3m")


def test_a_degree_is_that_of_pi() -> None:
    assert float(DEGREE) == math.pi / 180
