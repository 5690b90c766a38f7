"""A law of changes since a baseline; `baseline.cases` has what they are and what of it is worse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from made_runs import paths
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.baseline import (
    compare_with_baseline,
)

ROUNDING = 1e-15
"""Positions of 1 m round at 2e-16 m, and are taken apart twice."""


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    hnp.arrays(float, (40, 3), elements=st.floats(-0.005, 0.005)),
    hnp.arrays(float, (40, 3), elements=st.floats(-1, 1)),
    st.floats(1e-7, 1e-3),
)
def test_no_change_within_the_noise_is_ever_worse(
    values: FloatArray, change: FloatArray, noise: float
) -> None:
    """Of no share, largest or rms. The norm may change by sqrt(3) as much as an axis."""
    before, now = paths({"a": values}), paths({"a": values + change * noise})
    level = noise * np.sqrt(3) + ROUNDING
    assert compare_with_baseline(now, before, level).worse == ()
