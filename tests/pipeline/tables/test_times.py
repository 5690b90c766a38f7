"""Integer nanoseconds as text: nothing is lost, and nothing is written that is not needed."""

from __future__ import annotations

from datetime import UTC, datetime
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_pipeline.presentation.exports import DAY, Times
from urmpipe_pipeline.runs.file_columns import split_clock
from urmpipe_pipeline.tables.csv_files import EXPONENTS, format_times
from urmpipe_pipeline.tables.typed_files import to_arrow_times

NS = st.integers(-(2**62) + 1, 2**62 - 1)


def text(ns: list[int], unit: str) -> list[str]:
    return list(format_times(Times(np.array(ns, dtype=np.int64), unit)).to_pylist())


@given(st.lists(NS, min_size=1), st.sampled_from(sorted(EXPONENTS)))
def test_the_text_is_the_time_exactly(ns: list[int], unit: str) -> None:
    assert [Decimal(cell) for cell in text(ns, unit)] == [Decimal(t).scaleb(-EXPONENTS[unit]) for t in ns]
    assert all("e" not in cell.lower() for cell in text(ns, unit))


def test_a_column_has_the_decimals_that_its_finest_time_needs() -> None:
    assert text([0, 5_000_000, 2_000_000_000], "s") == ["0.000", "0.005", "2.000"]
    assert text([0, 3_000_000_000], "s") == ["0", "3"]
    assert text([-1, 1_700_000_000_123_456_789], "s") == ["-0.000000001", "1700000000.123456789"]
    assert text([1_500_000], "ms") == ["1.5"]
    assert text([1_500], "us") == ["1.5"]
    assert text([7], "ns") == ["7"]
    assert text([0], "s") == ["0"]


def test_dates_are_iso_8601_and_read_back_by_python() -> None:
    ns = 1_618_180_041_573_641_000
    assert text([ns], "date") == ["2021-04-11T22:27:21.573641"]
    parsed = datetime.fromisoformat(text([ns], "date")[0]).replace(tzinfo=UTC)
    assert int(parsed.timestamp() * 10**6) * 1000 == ns
    assert text([ns, ns + 1], "date")[1] == "2021-04-11T22:27:21.573641001"
    assert text([1_618_180_041 * 10**9], "date") == ["2021-04-11T22:27:21"]
    assert text([-(10**9)], "date") == ["1969-12-31T23:59:59"]


def test_times_of_day_count_on_past_a_day_and_below_midnight() -> None:
    assert text([0, 80_841_573_000_000], "time of day") == ["00:00:00.000", "22:27:21.573"]
    assert text([DAY + 3 * 10**9], "time of day") == ["24:00:03"]
    assert text([-5 * 10**9, 123 * 3600 * 10**9 + 10**7], "time of day") == ["-00:00:05.000", "123:00:00.010"]
    assert text([1_500], "time of day") == ["00:00:00.000001500"]


@given(st.lists(NS, min_size=1))
def test_seconds_and_nanoseconds_share_a_time(ns: list[int]) -> None:
    seconds, nanoseconds = split_clock(np.array(ns, dtype=np.int64), ["s", "ns"])
    for t, high, low in zip(
        ns, format_times(seconds).to_pylist(), format_times(nanoseconds).to_pylist(), strict=True
    ):
        assert int(high) * 10**9 + int(low) == t
        assert 0 <= int(low) < 10**9


def test_date_and_time_of_day_share_a_time() -> None:
    ns = np.array([1_618_180_041_573_641_000])
    date, time = split_clock(ns, ["date", "time of day"])
    assert format_times(date).to_pylist() == ["2021-04-11"]
    assert format_times(time).to_pylist() == ["22:27:21.573641"]


@pytest.mark.parametrize(
    ("unit", "kind"),
    [("s", "double"), ("ms", "double"), ("us", "double"), ("ns", "int64"), ("date", "timestamp[ns]"),
     ("time of day", "time64[ns]")],
)  # fmt: skip
def test_the_type_of_a_time_is_that_of_its_unit(unit: str, kind: str) -> None:
    array = to_arrow_times(Times(np.array([5_000_000]), unit))
    assert str(array.type) == kind
    if kind == "double":
        assert array[0].as_py() == 5e6 / 10 ** EXPONENTS[unit]
