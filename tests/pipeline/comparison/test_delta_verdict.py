"""The verdict of a delta meter: what is worst, when, and how often it is too much."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from asserting import refusal, there
from urmpipe_models.delta import delta as model_delta
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_pipeline.comparison.deviation import AXES, KINDS
from urmpipe_pipeline.comparison.measure import Quantity, compute_statistics
from urmpipe_pipeline.comparison.verdict import judge_delta_meter
from urmpipe_pipeline.comparison.wording import meter_words
from urmpipe_pipeline.iso9283.criteria import combine_verdicts

T_NS = np.array([0, 5_000_000, 10_000_000])
DELTA = np.array([[1e-3, 0.0, 0.0], [0.0, -4e-3, 3e-3], [3.5e-3, 0.0, 0.0]])


def test_the_component_that_uses_up_most_is_the_worst() -> None:
    found = there(judge_delta_meter("meter", T_NS, DELTA, {"axis": 0.0035}))
    assert (found.quantity, found.worst, found.t, found.sample) == ("y", 4e-3, 0.005, 1)
    assert (found.samples, found.out_of_tolerance, found.verdict) == (3, 1, "fail")  # what is allowed passes
    assert (found.utilisation, found.out_fraction) == (4e-3 / 0.0035, 1 / 3)
    assert meter_words(found) == (
        "|Δy| = 4.000 mm of 3.5 mm allowed (1.14 times the tolerance) at t = 0.005 s; out of tolerance: 1"
        " of 3 samples (33.3 %)"
    )


def test_a_tolerance_of_one_coordinate_or_of_the_norm_holds_for_that_alone() -> None:
    of_z = judge_delta_meter("meter", T_NS, DELTA, {"z": 0.003})
    of_norm = judge_delta_meter("meter", T_NS, DELTA, {"norm": 0.0045})
    both = judge_delta_meter("meter", T_NS, DELTA, {"axis": 0.005, "x": 0.001})
    assert of_z is not None and of_norm is not None and both is not None
    assert (of_z.quantity, of_z.worst, of_z.verdict) == ("z", 3e-3, "pass")
    assert (of_norm.quantity, of_norm.worst, of_norm.verdict) == ("norm", 5e-3, "fail")
    assert (both.quantity, both.sample, both.out_of_tolerance) == ("x", 2, 1)


def test_a_sample_without_a_value_is_out_and_the_worst() -> None:
    lacking = DELTA.copy()
    lacking[0, 2] = np.nan
    found = there(judge_delta_meter("meter", T_NS, lacking, {"axis": 1.0}))
    assert (found.sample, found.out_of_tolerance, found.verdict, found.utilisation) == (0, 1, "fail", None)
    assert math.isnan(found.worst) and found.to_dict()["worst"] is None
    assert (found.missing, found.coverage) == (1, 1.0 - 1.0 / len(lacking))
    assert meter_words(found) == (
        "|Δx| has no value at t = 0.000 s; out of tolerance: 1 of 3 samples (33.3 %); coverage 66.7 %: 1"
        " without a value"
    )


def test_a_doubt_keeps_it_from_passing_and_is_told() -> None:
    found = there(judge_delta_meter("meter", T_NS, DELTA, {"axis": 1.0}, ("a.y was nan", "it ended early")))
    assert (found.out_of_tolerance, found.verdict, found.utilisation) == (0, "fail", 4e-3)
    assert found.to_dict()["caveats"] == ["a.y was nan", "it ended early"]
    assert meter_words(found) == (
        "|Δy| = 4.000 mm of 1000 mm allowed (0.4 % of the tolerance) at t = 0.005 s; out of tolerance: 0 of"
        " 3 samples (0 %); a.y was nan; it ended early"
    )


def test_of_nothing_allowed_no_share_is_told() -> None:
    found = there(judge_delta_meter("meter", T_NS, DELTA, {"axis": 0.0}))
    assert meter_words(found) == (
        "|Δy| = 4.000 mm of 0 mm allowed at t = 0.005 s; out of tolerance: 3 of 3 samples (100 %)"
    )


def test_nothing_allowed_is_a_tolerance() -> None:
    found = judge_delta_meter("meter", T_NS, DELTA, {"axis": 0.0})
    still = judge_delta_meter("meter", T_NS, np.zeros((3, 3)), {"axis": 0.0})
    assert found is not None and still is not None
    assert (found.out_of_tolerance, found.verdict, found.utilisation) == (3, "fail", math.inf)
    assert (found.quantity, found.worst, found.sample) == ("y", 4e-3, 1)  # not the first that is out
    assert (still.out_of_tolerance, still.verdict, still.utilisation) == (0, "pass", 0.0)


def test_without_a_sample_there_is_no_verdict() -> None:
    assert judge_delta_meter("meter", T_NS[:0], DELTA[:0], {"axis": 1.0}) is None


@pytest.mark.parametrize(
    ("tolerance", "message"),
    [
        ({}, "meter: found no tolerance, allowed: axis, x, y, z, norm"),
        ({"axis": -1.0}, "meter: found a tolerance axis=-1, allowed: axis, x, y, z, norm; 0 or positive"),
        ({"angle": 1.0}, "meter: found a tolerance angle=1, allowed: axis, x, y, z, norm; 0 or positive"),
        ({"x": math.nan}, "meter: found a tolerance x=nan, allowed: axis, x, y, z, norm; 0 or positive"),
    ],
)
def test_what_is_no_tolerance_is_refused(tolerance: dict[str, float], message: str) -> None:
    assert refusal(OptionError, judge_delta_meter, "meter", T_NS, DELTA, tolerance) == message


def length(delta: FloatArray) -> FloatArray:
    """Return the norm as the model computes it."""
    return np.asarray(model_delta(tuple(delta.T), (0.0, 0.0, 0.0)).norm)


ROWS = st.lists(st.tuples(*(st.floats(-1.0, 1.0),) * 3), min_size=1, max_size=8).map(np.array)


@given(delta=ROWS, axis=st.floats(0.0, 1.0), norm=st.floats(0.0, 2.0))
def test_it_passes_if_and_only_if_every_quantity_of_every_sample_is_allowed(
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
def test_it_is_the_verdict_of_compare(delta: FloatArray, which: list[str], row: int, share: float) -> None:
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
