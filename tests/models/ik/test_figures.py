"""Figures of reasons: as many digits as tell what was found from what is allowed."""

from __future__ import annotations

import math

from urmpipe_models.ik.solutions import format_with_limits


def test_four_digits_are_given_where_they_tell_the_numbers_apart() -> None:
    assert format_with_limits(2.71828, -3.14159, 1.0) == ("2.718", "-3.142", "1")
    assert format_with_limits(2.7000001, 2.7) == ("2.7000001", "2.7")
    assert format_with_limits(1.0 + 1e-9, 1.0, 1.0 + 2e-9) == ("1.000000001", "1", "1.000000002")


def test_neighbours_are_told_apart_and_equal_ones_have_all_digits_of_a_double() -> None:
    found = math.nextafter(0.1, 1.0)
    assert format_with_limits(found, 0.1) == ("0.10000000000000002", "0.10000000000000001")
    assert format_with_limits(0.1, 0.1) == ("0.10000000000000001", "0.10000000000000001")
