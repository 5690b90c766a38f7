"""Integer nanoseconds as text: nothing is lost, and nothing is written that is not needed."""

from __future__ import annotations

from datetime import UTC, datetime
from decimal import Decimal

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_pipeline.presentation.exports import Times
from urmpipe_pipeline.runs.file_columns import split_clock
from urmpipe_pipeline.tables.csv_files import EXPONENTS, format_times

NS = st.integers(-(2**62) + 1, 2**62 - 1)


def text(ns: list[int], unit: str) -> list[str]:
    return list(format_times(Times(np.array(ns, dtype=np.int64), unit)).to_pylist())


@given(st.lists(NS, min_size=1), st.sampled_from(sorted(EXPONENTS)))
def test_the_text_is_the_time_exactly(ns: list[int], unit: str) -> None:
    assert [Decimal(cell) for cell in text(ns, unit)] == [Decimal(t).scaleb(-EXPONENTS[unit]) for t in ns]
    assert all("e" not in cell.lower() for cell in text(ns, unit))


def test_dates_are_read_back_by_python() -> None:
    ns = 1_618_180_041_573_641_000
    parsed = datetime.fromisoformat(text([ns], "date")[0]).replace(tzinfo=UTC)
    assert int(parsed.timestamp() * 10**6) * 1000 == ns


@given(st.lists(NS, min_size=1))
def test_seconds_and_nanoseconds_share_a_time(ns: list[int]) -> None:
    seconds, nanoseconds = split_clock(np.array(ns, dtype=np.int64), ["s", "ns"])
    for t, high, low in zip(
        ns, format_times(seconds).to_pylist(), format_times(nanoseconds).to_pylist(), strict=True
    ):
        assert int(high) * 10**9 + int(low) == t
        assert 0 <= int(low) < 10**9
