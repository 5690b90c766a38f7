"""Clocks without sync: whenever two logs with absolute stamps begin, the verdict is that of their motion."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import urmpipe as api
from clock_logs import DIGITS, MS, ZONES, S, clock_log, times


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(
    st.integers(-S, 0), st.integers(4 * MS, 20 * MS), st.integers(4 * MS, 20 * MS),
    st.sampled_from([*DIGITS, *ZONES]), st.sampled_from([1e-6, 0.02]),
)  # fmt: skip
def test_the_verdict_is_that_of_the_motion_whenever_the_logs_begin(
    tmp_path_factory: pytest.TempPathFactory, start: int, period: int, other: int, clock: str, off: float
) -> None:
    folder = tmp_path_factory.mktemp("clocks")
    wanted, done = folder / "wanted.csv", folder / "done.csv"
    wanted.write_text(clock_log(clock, times(0, period, 4 * S // period)), encoding="utf-8")
    done.write_text(clock_log(clock, times(start, other, 5 * S // other + 1), off), encoding="utf-8")
    result = api.compare(wanted, done, "ur5e")
    assert result.runs[0].sync.offset == start / 1e9
    # 0.02 rad of joint 2 move a tool by 9 mm or more here; lines between samples of 20 ms miss by 0.1 mm.
    assert result.verdict == ("fail" if off > 1e-3 else "pass")
    assert not [one for one in result.warnings if one.kind == "clocks-differ"]
