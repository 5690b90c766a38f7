"""Decimation keeps what the eye would miss."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_pipeline.decimate import decimate

sizes = st.integers(1, 3000)
seeds = st.integers(0, 2**32 - 1)


@given(sizes, seeds, st.integers(1, 3))
@settings(max_examples=60, deadline=None)
def test_every_bucket_keeps_its_ends_and_its_peaks(count: int, seed: int, columns: int) -> None:
    values = np.random.default_rng(seed).normal(size=(count, columns))
    points = 48 * (1 + columns)
    kept = decimate(values, points)
    assert (np.diff(kept) > 0).all()
    assert kept[0] == 0
    assert kept[-1] == count - 1
    if count <= points:
        assert len(kept) == count
        return
    assert len(kept) <= points
    size = -(-count * (2 + 2 * columns) // points)
    for start in range(0, count, size):
        bucket = values[start : start + size]
        stays = values[kept[(kept >= start) & (kept < start + size)]]
        np.testing.assert_array_equal(stays.min(axis=0), bucket.min(axis=0))
        np.testing.assert_array_equal(stays.max(axis=0), bucket.max(axis=0))


@given(st.integers(0, 1990), st.integers(1, 1000), seeds)
@settings(max_examples=60, deadline=None)
def test_a_gap_stays_a_gap(start: int, length: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=2000)
    values[start : start + length] = np.nan
    kept = decimate(values, 100)
    drawn = values[kept]
    before = kept < start
    after = kept >= start + length
    assert np.isnan(drawn[~before & ~after]).any()
    assert np.isfinite(drawn[before | after]).all()


def test_a_single_spike_survives_whatever_bucket_it_falls_in() -> None:
    for place in range(0, 10_000, 37):
        values = np.zeros(10_000)
        values[place] = -1.0
        assert place in decimate(values, 100)


def test_a_column_without_any_value_is_drawn_as_nothing() -> None:
    kept = decimate(np.full(5000, np.nan), 100)
    assert (kept < 5000).all()
    assert (kept >= 0).all()
