"""The file's own number comes back from the SI value that was made of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from urmpipe_pipeline.joint_log import LogColumn
from urmpipe_pipeline.runs.file_columns import to_file_values, to_si

FACTORS = {"deg": 0.017453292519943295, "mm": 1e-3, "cm": 1e-2, "m": 1.0}


def column(unit: str, sign: int = 1, offset: float = 0.0) -> LogColumn:
    return LogColumn("q1", "q1", "joint", 0, unit, FACTORS[unit], sign, offset)


def there_and_back(numbers: list[float], how: LogColumn) -> list[float]:
    values = to_si(np.array(numbers), how)
    back = to_file_values(values, how)
    np.testing.assert_array_equal(to_si(back, how), values)
    return [float(number) for number in back]


def test_the_numbers_that_people_write_come_back() -> None:
    written = [45.0, 147.3, 7.3, -0.1, 1e-9, 179.9999999999, 0.0, 359.0, 123456.789, 1.5e-12]
    for unit in FACTORS:
        assert there_and_back(written, column(unit)) == written


def test_a_quotient_alone_would_not_do() -> None:
    assert 7.3 * FACTORS["deg"] / FACTORS["deg"] != 7.3


digits_15 = st.builds(
    lambda n, e: float(f"{n}e{e}"), st.integers(-(10**15) + 1, 10**15 - 1), st.integers(-24, 12)
)
doubles = st.floats(-1e6, 1e6, allow_subnormal=False).filter(lambda x: x == 0 or abs(x) > 1e-290)
signs = st.sampled_from([1, -1])


@given(st.lists(digits_15, min_size=1), st.sampled_from(sorted(FACTORS)), signs)
@example([8198616105081000.0], "deg", 1)
def test_numbers_of_15_digits_come_back_exactly(numbers: list[float], unit: str, sign: int) -> None:
    assert there_and_back(numbers, column(unit, sign)) == numbers


@given(st.lists(doubles, min_size=1), st.sampled_from(sorted(FACTORS)), signs)
def test_any_number_comes_back_within_one_unit_in_the_last_place(
    numbers: list[float], unit: str, sign: int
) -> None:
    back = np.array(there_and_back(numbers, column(unit, sign)))
    # Two neighbours may have the same product; which of them stood in the file, nothing tells.
    assert (np.abs(back - numbers) <= np.spacing(np.abs(numbers))).all()


@given(
    st.lists(st.decimals(-400, 400, places=6), min_size=1),
    st.sampled_from([90.0, -180.0, 0.5, 12.25]),
    st.sampled_from(sorted(FACTORS)),
    signs,
)
def test_decimals_come_back_through_an_offset(
    numbers: list[object], offset: float, unit: str, sign: int
) -> None:
    written = [float(str(number)) for number in numbers]
    assert there_and_back(written, column(unit, sign, offset)) == written


def test_missing_samples_stay_missing_and_the_input_is_left_alone() -> None:
    values = np.array([np.nan, 0.5])
    back = to_file_values(values, column("deg"))
    assert np.isnan(back[0])
    np.testing.assert_array_equal(values, [np.nan, 0.5])


@pytest.mark.parametrize("value", [5e-324, 1e-300, 1e300, np.inf, -np.inf])
def test_extremes_do_not_break_it(value: float) -> None:
    values = np.array([value])
    assert to_si(to_file_values(values, column("mm")), column("mm")) == values
