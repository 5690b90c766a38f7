"""Regular clocks behind coarse stamps, and stamps behind which there is none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.logs.timestamps import fit_repeated, fit_rounded

MS = 1_000_000
SECOND = 1_000_000_000


def stamped(period: float, resolution: int, count: int, phase: float = 0.0, *, cut: bool = True) -> IntArray:
    """Stamp an even clock, in whole [ns]: else what stands on a border of two stamps would fall to either."""
    exact = np.arange(count) * round(period) + round(phase * period)
    return (exact if cut else exact + resolution // 2) // resolution * resolution


@settings(max_examples=200, deadline=None)
@given(
    st.floats(0.02, 0.7), st.integers(60, 400), st.floats(0, 1), st.sampled_from([10 * MS, SECOND]),
    st.booleans(),
)  # fmt: skip
def test_a_regular_clock_is_found_behind_coarse_stamps(
    share: float, ticks: int, phase: float, resolution: int, cut: bool
) -> None:
    period = share * resolution
    stamps = stamped(period, resolution, int(ticks / share), phase, cut=cut)
    found = fit_repeated(stamps)
    assert found is not None
    assert found.resolution == resolution
    # changes are seen up to one period late, at either end
    assert found.period == pytest.approx(period, rel=2.0 / ticks)
    assert np.abs(found.t_ns - stamps).max() <= resolution
    assert (np.diff(found.t_ns) > 0).all()


@settings(max_examples=200, deadline=None)
@given(st.floats(2.0, 50.0), st.integers(30, 2000), st.floats(0, 1), st.booleans())
def test_a_regular_clock_is_found_behind_stamps_of_a_millisecond(
    period: float, count: int, phase: float, cut: bool
) -> None:
    stamps = stamped(period * MS, MS, count, phase, cut=cut)
    found = fit_rounded(stamps)
    if np.ptp(np.diff(stamps)) == 0:
        return  # a clock that shows no rounding is regular by itself
    assert found is not None
    assert found.resolution == MS
    assert found.period == pytest.approx(period * MS, abs=2.0 * MS / count)
    assert np.abs(found.t_ns - stamps).max() <= MS


@pytest.mark.parametrize(
    "steps",
    [
        [5] * 20 + [0] + [5] * 20,  # one repeat
        [5] * 20 + [0, 10] + [5] * 20,  # one late stamp
        [0, 0, 10, 0, 10, 0, 0, 0, 0, 10, 10, 0, 0, 10],  # irregular repeats
        [0, 0, 0, 1000, 0, 0, 0, 5000, 0, 0, 0, 1000, 0, 0, 0, 1000],  # a pause
        [0, 0, 0, 0, 0, 1000, 0, 0, 0, 0, 0],  # one change tells no period
        [0, 10, 0, 10, 0, 10, 0, 10] + [0, 0, 10] * 20,  # the rate changes
    ],
)
def test_no_regular_clock_is_made_up(steps: list[int]) -> None:
    assert fit_repeated(np.cumsum([0, *steps]) * MS) is None


@pytest.mark.parametrize(
    "steps",
    [
        [5] * 50 + [10] + [5] * 50,  # a lost sample
        [10, 10, 9, 11, 10, 10, 12, 10],  # jitter
        [3, 3, 4] * 10 + [4, 4, 3] * 10 + [3] * 20,  # the rate changes
        [3, 4],  # too few to tell
    ],
)
def test_lost_samples_and_jitter_are_no_rounding(steps: list[int]) -> None:
    assert fit_rounded(np.cumsum([0, *steps]) * MS) is None
