"""What a log that is out of tolerance looks like: late, or with a joint's zero elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.comparison.causes import causes
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation

Compared = Callable[..., Comparison]

T = 0.005 * np.arange(1000)


def with_maxima(run: Deviation, **maxima: float) -> Deviation:
    """The log with these largest values, in m."""
    kept = {name: replace(one, max=maxima.get(name, one.max)) for name, one in run.statistics.items()}
    return replace(run, statistics=kept, verdict="fail")


@pytest.fixture
def off_by_zero(arms: Compared) -> Deviation:
    """A log whose second joint counts from 0.01 rad elsewhere, with some noise, the others a tenth of it."""
    noise = np.random.default_rng(3).normal(0.0, 1e-4, (1000, 6))
    return arms({"log": noise + np.array([0.001, 0.01, 0.0, -0.001, 0.0, 0.0])}).runs[0]


def test_a_joint_that_is_off_by_the_same_throughout_is_named(off_by_zero: Deviation) -> None:
    assert off_by_zero.verdict == "fail"
    one = list(off_by_zero.joint_statistics.values())[1]
    assert list(causes(off_by_zero)) == [
        f"{one.quantity} is off by the same throughout (reference - log = {np.degrees(one.mean):.4f} deg,"
        f" std {np.degrees(one.std):.4f} deg): another zero?"
    ]
    assert abs(abs(one.mean) - 0.01) < 1e-5


def test_a_joint_that_comes_and_goes_has_no_other_zero(arms: Compared) -> None:
    q: FloatArray = np.zeros((1000, 6))
    q[:, 1] = 0.01 + 0.005 * np.sin(T)
    assert list(causes(arms({"log": q}).runs[0])) == []


def test_a_log_on_the_path_but_not_in_time_is_late_or_early(paths: Compared) -> None:
    run = paths({"log": np.full((100, 3), 0.004)}).runs[0]
    said = "on the path but not in time (‖Δ‖ 81.2000 mm, path 0.0530 mm): late or early"
    late = with_maxima(run, norm=0.0812, path=5.3e-5)
    assert list(causes(late)) == [f"{said}; --sync auto finds an offset of the clocks"]
    assert list(causes(replace(late, sync=replace(late.sync, mode="auto")))) == [said]
    assert list(causes(with_maxima(run, norm=0.0812, path=0.0082))) == []
    assert list(causes(replace(late, verdict="pass"))) == []
