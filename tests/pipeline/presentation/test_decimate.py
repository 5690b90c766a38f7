"""Decimation keeps what the eye would miss."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_pipeline.presentation.curves import decimate

sizes = st.integers(1, 3000)
seeds = st.integers(0, 2**32 - 1)


@given(sizes, seeds, st.integers(1, 3), st.floats(0.0, 0.9))
@settings(max_examples=60, deadline=None)
def test_the_ends_and_every_peak_stay(count: int, seed: int, columns: int, missing: float) -> None:
    random = np.random.default_rng(seed)
    values = random.normal(size=(count, columns))
    values[random.random(values.shape) < missing] = np.nan
    buckets = 24
    points = buckets * (2 + 2 * columns)
    kept = decimate(values, points)
    assert (np.diff(kept) > 0).all()
    assert kept[0] == 0
    assert kept[-1] == count - 1
    if count <= points:
        assert len(kept) == count
        return
    assert len(kept) <= points + 2 * columns * buckets
    if not missing:
        assert len(kept) <= points
    # Wherever the buckets end: no value stands out of those that stay within a bucket's size of it.
    size = -(-count // buckets)
    for column in values.T:
        for start in range(0, count, size):
            near = column[kept[(kept >= start - size) & (kept < start + 2 * size)]]
            bucket = column[start : start + size]
            bucket = bucket[np.isfinite(bucket)]
            if len(bucket):
                assert np.nanmin(near) <= bucket.min()
                assert np.nanmax(near) >= bucket.max()
        if np.isfinite(column).any():
            assert np.nanargmin(column) in kept
            assert np.nanargmax(column) in kept


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


def test_what_is_no_array_in_a_row_is_decimated_alike() -> None:
    values = np.random.default_rng(1).normal(size=(5000, 3))
    before = values.copy()
    np.testing.assert_array_equal(decimate(values[:, 1], 100), decimate(values[:, 1].copy(), 100))
    np.testing.assert_array_equal(values, before)


@pytest.mark.slow
def test_the_library_is_loaded_by_a_drawing_and_not_by_the_reader() -> None:
    code = (
        "import sys\nfrom urmpipe_datasets import LOGS\nfrom urmpipe_pipeline.runs.ingest import ingest_log\n"
        "import urmpipe_pipeline.recording\nimport urmpipe_pipeline.report\n"
        "ingest_log([LOGS / 'coppeliasim.csv'])\nprint('tsdownsample' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
