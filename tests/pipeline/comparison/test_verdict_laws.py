"""Laws of tolerances, of the verdict of a delta meter and of changes since a baseline.

`tolerance.cases`, `delta_meter.cases` and `baseline.cases` have the answers.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asserting import there
from made_runs import paths
from urmpipe_models.delta import delta as model_delta
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.measure_units import DEGREE
from urmpipe_pipeline.comparison.baseline import compare_with_baseline
from urmpipe_pipeline.comparison.deviation import AXES, KINDS
from urmpipe_pipeline.comparison.measure import Quantity, compute_statistics
from urmpipe_pipeline.comparison.verdict import MIN_SHARES, UNITS, judge_delta_meter, parse_tolerance
from urmpipe_pipeline.iso9283.criteria import combine_verdicts


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


def length(delta: FloatArray) -> FloatArray:
    """Return the norm as the model computes it."""
    return np.asarray(model_delta(tuple(delta.T), (0.0, 0.0, 0.0)).norm)


ROWS = st.lists(st.tuples(*(st.floats(-1.0, 1.0),) * 3), min_size=1, max_size=8).map(np.array)


@given(delta=ROWS, axis=st.floats(0.0, 1.0), norm=st.floats(0.0, 2.0))
def test_a_delta_meter_passes_if_and_only_if_every_quantity_of_every_sample_is_allowed(
    delta: FloatArray, axis: float, norm: float
) -> None:
    found = there(judge_delta_meter("meter", np.arange(len(delta)), delta, {"axis": axis, "norm": norm}))
    out = (np.abs(delta) > axis).any(axis=1) | (length(delta) > norm)
    assert found.out_of_tolerance == np.count_nonzero(out)
    assert (found.verdict == "pass") == (not out.any())
    assert found.utilisation is not None
    # a size above what is allowed by its last bit may have a share that rounds to 1
    assert found.utilisation >= 1.0 if out.any() else found.utilisation <= 1.0


@given(
    delta=ROWS,
    which=st.lists(st.sampled_from(["axis", *AXES]), min_size=1, unique=True),
    row=st.integers(0, 7),
    share=st.sampled_from([0.5, 1.0, 2.0]),
)
def test_the_verdict_of_a_delta_meter_is_that_of_compare(
    delta: FloatArray, which: list[str], row: int, share: float
) -> None:
    """Also where a size is exactly what is allowed, to the last bit."""
    values = np.column_stack((delta, length(delta)))
    sizes = dict(zip(("x", "y", "z", "norm"), np.abs(values[row % len(values)]).tolist(), strict=True))
    tolerance = {kind: share * sizes.get(kind, sizes["y"]) for kind in which}
    assume(min(tolerance.values()) > 0.0)  # compare tells no share of nothing
    found = judge_delta_meter("meter", np.arange(len(delta)), delta, tolerance)
    measured = [Quantity(axis, KINDS[axis], "m", values[:, i]) for i, axis in enumerate(AXES)]
    every = [
        compute_statistics(one, np.arange(len(delta)) / 1e9, np.arange(len(delta)), tolerance)
        for one in measured
    ]
    assert found is not None
    assert found.verdict == combine_verdicts(one.verdict for one in every)
    outside = np.any([one.out_of_tolerance(tolerance) for one in measured], axis=0)
    assert found.out_of_tolerance == np.count_nonzero(outside)
    worst = max((one for one in every if one.utilisation is not None), key=lambda one: one.utilisation or 0.0)
    assert found.utilisation == worst.utilisation
    if math.isfinite(worst.utilisation or 0.0):
        assert (found.quantity, found.worst, found.sample) == (worst.quantity, worst.max, worst.sample_max)


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
    level = noise * np.sqrt(3) + 1e-15  # positions of 1 m round at 2e-16 m, and are taken apart twice
    assert compare_with_baseline(now, before, level).worse == ()
