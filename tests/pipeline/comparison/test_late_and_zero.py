"""The diagnosis names what the norm beside the path, and the deviations of joints, show: lag and zeros."""

from __future__ import annotations

import numpy as np
import pytest

from asserting import there
from made_runs import arms, path_run
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison

T: FloatArray = 0.005 * np.arange(1000.0)


def causes(result: Comparison) -> dict[tuple[str, str], tuple[float, ...]]:
    """Return the values of the causes of the only log, by kind and name, the largest share first."""
    (one,) = result.runs
    return {(cause.kind, cause.name): cause.value for cause in there(one.diagnosis).causes}


def back_and_forth(t: FloatArray) -> FloatArray:
    """A motion along a bow, with a rest in the middle half."""
    moving = np.clip(t, 0.0, 1.25) + np.clip(t - 3.75, 0.0, 1.25)
    return np.column_stack((np.sin(2.5 * moving), 0.3 * np.cos(2.5 * moving), np.ones_like(t)))


def of_path(log: FloatArray) -> dict[tuple[str, str], tuple[float, ...]]:
    """Return why a path deviates from the motion."""
    return causes(compare_runs(path_run(back_and_forth(T)), [path_run(log)], CompareOptions(diagnose=True)))


def test_zeros_of_joints_are_named_the_largest_share_first() -> None:
    noise = np.random.default_rng(3).normal(0.0, 1e-4, (1000, 6))
    zeros = np.array([0.001, 0.01, 0.0, -0.001, 0.0, 0.0])
    found = causes(arms({"log": noise + zeros}, diagnose=True))
    assert list(found) == [("joint_offset", f"phi{k}") for k in (2, 1, 4)]
    within = 4e-4 / np.sqrt(1000)  # four standard errors of a mean of the noise
    np.testing.assert_allclose(np.ravel([*found.values()]), zeros[[1, 0, 3]], rtol=0.0, atol=within)


@pytest.mark.parametrize("by", [0.021, 0.005, -0.03])
def test_a_log_on_the_path_but_not_in_time_is_late_or_early(by: float) -> None:
    ((named, (value,)),) = of_path(back_and_forth(T - by)).items()
    assert named == ("time_lag", "clock")
    # a velocity is told by the samples beside: of a motion with w = 2.5 / s it lacks (w T)^2 / 6 = 2.6e-5
    assert value == pytest.approx(-by, rel=2.6e-5)


@pytest.mark.parametrize("rows", [1, 4, 40])
def test_some_rows_that_are_off_along_the_path_make_no_log_late(rows: int) -> None:
    log = back_and_forth(T)
    spiked = np.random.default_rng(rows).choice(np.r_[40:200, 800:960], rows, replace=False)
    log[spiked] = back_and_forth(T - 0.1)[spiked]
    assert ("time_lag", "clock") not in of_path(log)


def test_a_row_off_the_path_hides_no_lateness() -> None:
    log = back_and_forth(T - 0.02)
    log[100, 2] += 0.5
    ((named, (value,)),) = of_path(log).items()
    assert named == ("time_lag", "clock")
    assert value == pytest.approx(-0.02, abs=1e-6)


def test_a_log_beside_the_path_is_not_late() -> None:
    ((named, value),) = of_path(back_and_forth(T) - 0.004).items()
    assert named == ("base_shift", "base")
    np.testing.assert_allclose(value, 0.004, atol=1e-12)
